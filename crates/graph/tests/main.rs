//! Properties of the vocabulary, against definitions too slow to ship.

#![expect(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod disjoint_sets;
mod graph;
mod read;
mod rows;
mod schedule;
