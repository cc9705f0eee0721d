//! Strokes on generated meshes: every mesh checked after every cut, pieces against an independent count.

#![allow(clippy::unwrap_used, reason = "a helper that fails fails its test")]

mod bodies;
mod pieces;
mod planes;
mod scenarios;
mod sweeps;
mod symmetry;
