//! Clusterings compared with a slow version of the paper's algorithm; local updates and mergers
//! compared with a recount.

#![expect(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod greedy_k_neighbor;
mod inputs;
mod merge;
mod methods;
mod serial_neighbor;
mod update;
