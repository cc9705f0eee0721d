//! The solver against closed forms, conservation laws, finite elements on the same mesh, and extreme states.
//!
//! Every tolerance is stated where it is used, with the reason for its size; measured values lie a factor below it so
//! that another processor's rounding does not fail a sound solver.

#![allow(clippy::unwrap_used, reason = "a helper that fails fails its test")]

mod allocations;
mod attachments;
mod beam;
mod body;
mod closed_forms;
mod colliders;
mod conservation;
mod contacts;
mod convergence;
mod copies;
mod damping;
mod determinism;
mod distances;
mod edits;
mod energy;
mod extremes;
mod finite_elements;
mod forces;
mod ground;
mod guards;
mod kappa;
mod large_deformations;
mod layout;
mod origin;
mod precision;
mod recovery;
mod reference;
mod refusals;
mod residuals;
mod rest;
mod vbd;
mod vbd_bdf2;
mod vbd_constraints;
mod vbd_correction;
mod vbd_damping;
mod vbd_extremes;
mod vibration;
mod volumes;
