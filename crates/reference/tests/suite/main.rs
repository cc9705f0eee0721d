//! The reference against finite differences, closed forms, patch tests and beam theory.
//!
//! Every tolerance is stated where it is used, with the reason for its size.

#![allow(clippy::unwrap_used, reason = "a helper that fails fails its test")]

mod cantilever;
mod convergence;
mod extremes;
mod homogeneous;
mod law;
mod motion;
mod refusals;
mod support;
