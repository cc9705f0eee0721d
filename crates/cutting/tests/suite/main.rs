//! Strokes on generated meshes: every mesh checked after every cut, pieces against an independent count.

#![allow(clippy::unwrap_used, reason = "a helper that fails fails its test")]

mod bends;
mod bodies;
mod crumbs;
mod deltas;
mod improve;
mod joins;
mod level_sets;
mod passes;
mod pieces;
mod planes;
mod programs;
mod removal;
mod scenarios;
mod separation;
mod soak;
mod surfaces;
mod sweeps;
mod symmetry;
