//! The real binary, run in folders of its own: its output, its files, and what it leaves behind.

#![allow(clippy::unwrap_used, reason = "a helper that fails fails its test")]

mod advise;
mod bad_arguments;
mod bad_graphs;
mod bad_input;
mod color;
mod color_graph;
mod gpu;
mod help;
mod mesh;
mod pictures;
mod run;
mod run_files;
mod scene;
mod support;
mod sweep;
