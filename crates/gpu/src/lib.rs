//! Soft bodies on the GPU: coloring and XPBD through wgpu, without leaving the device.

mod array;
mod context;
mod error;
mod kernel;
mod solver;
mod traffic;

pub use context::{AdapterDescription, GpuContext, GpuOptions};
pub use error::GpuError;
pub use solver::{Form, GpuSolver};
pub use traffic::Traffic;
pub use wgpu;
