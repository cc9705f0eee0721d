//! Graph coloring on the device, with input and result in device memory.
//!
//! The functions have the names of those of `incise-coloring`, which define the results: [`jones_plassmann`],
//! [`ecl_gc`], [`scgc`], [`vivace`] and [`wlc`] on a [`DeviceGraph`], and [`scgc_incidence`] on a [`DeviceIncidence`],
//! without building a list of edges. Each coloring equals that of its CPU twin bit for bit, on any device. The numbers
//! of colors and the degrees are not limited.
//!
//! **Rounds.** A GPU does not guarantee an order of threads, so no thread waits in a kernel. A round visits the
//! vertices on a worklist and puts those that cannot be colored yet on the next one. A kernel of one thread writes the
//! size of the next dispatch. Therefore 32 rounds are submitted at once before the host reads the number of vertices
//! left; surplus rounds dispatch no workgroups. Every round must color at least one vertex, otherwise the result is
//! [`GpuError::Stalled`](crate::GpuError::Stalled).
//!
//! **Rounds may differ between devices, colors may not.** If a vertex and its neighbor are decided in one round, the
//! device determines whether the vertex sees the neighbor's color in this round or in the next. The shaders explain why
//! the colors do not depend on it. In [`vivace`] and [`wlc`] they would, so there a round has several dispatches, and
//! the number of rounds equals that of the CPU, too.
//!
//! **Traffic.** Only the options of [`vivace`] and [`wlc`] are uploaded (16 bytes); 24 bytes are read back per 32
//! rounds.

mod algorithm;
mod ecl_gc;
mod graph;
mod incidence;
mod jones_plassmann;
mod kernels;
mod labels;
mod result;
mod rounds;
mod scgc;
mod scgc_incidence;
mod vivace;
mod wlc;

pub use algorithm::color;
pub use ecl_gc::ecl_gc;
pub use graph::DeviceGraph;
pub use incidence::DeviceIncidence;
pub use jones_plassmann::jones_plassmann;
pub use kernels::ColoringKernels;
pub use result::DeviceColoring;
pub use scgc::scgc;
pub use scgc_incidence::scgc_incidence;
pub use vivace::vivace;
pub use wlc::wlc;

pub(crate) use kernels::Round;
pub(crate) use kernels::SOURCES;
pub(crate) use rounds::Work;
pub(crate) use scgc::SEARCH_WORDS;
pub(crate) use scgc_incidence::WAIT_WORDS;
pub(crate) use vivace::VivaceSettings;
pub(crate) use wlc::WlcWork;
