//! Properties of the data types, compared with slow definitions.

#![expect(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod disjoint_sets;
mod graph;
mod read;
mod rows;
mod schedule;
