//! Soft bodies on the GPU: coloring and XPBD through wgpu, without leaving the device.

mod array;
pub mod coloring;
mod context;
mod error;
mod index;
mod kernel;
mod shaders;
mod solver;
mod traffic;

pub use context::{AdapterDescription, GpuContext, GpuOptions};
pub use error::GpuError;
pub use shaders::{Shader, SharedStruct, shaders, shared_structs};
pub use solver::{ClusterMapping, GpuSolver, Measures, StageTimes};
pub use traffic::Traffic;
pub use wgpu;

/// The example of the README, run as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
