//! The facade as its users see it: scenes in, frames out, and all derived data verified after every frame.

#![allow(clippy::unwrap_used, reason = "a helper that fails fails its test")]

#[cfg(feature = "advise")]
mod advise;
mod auto_method;
mod bodies;
mod builder;
mod conservation;
mod constraints;
mod contact;
mod contact_cases;
mod contact_edges;
mod contact_shapes;
mod contact_states;
mod cutting;
mod determinism;
mod edits;
mod forces;
#[cfg(feature = "gpu")]
mod gpu;
#[cfg(feature = "gpu")]
mod gpu_contact;
#[cfg(feature = "gpu")]
mod gpu_live;
#[cfg(feature = "gpu")]
mod gpu_settings;
mod grab;
mod interaction;
mod joining;
mod joining_random;
mod kappa;
mod live;
mod live_bodies;
mod locality;
mod methods;
mod mistakes;
mod parsing;
mod physics;
mod pieces;
mod preset;
mod recluster;
mod regions;
mod reports;
mod residuals;
mod rest_after_cuts;
#[cfg(feature = "save")]
mod save;
mod scenarios;
mod schema;
mod set_solver;
mod settings;
mod sleep;
mod snapshot;
mod solid_blade;
mod strokes;
mod substeps;
mod support;
mod ties;
mod values;
