//! Graph coloring on the device, from data that is there already, with results that stay there.
//!
//! The functions have the names of those of `incise-coloring`, which define what they give: [`jones_plassmann`],
//! [`ecl_gc`], [`scgc`], [`vivace`] and [`wlc`] on a [`DeviceGraph`], and [`scgc_incidence`] on a [`DeviceIncidence`],
//! which never lists an edge. Each coloring equals that of its CPU twin bit for bit, on any device. There is no limit
//! to colors or degrees.
//!
//! **Rounds.** A GPU guarantees no order of threads, so no thread waits in a kernel. A round visits the vertices on
//! a worklist, and those that cannot be colored yet go to the next one. A kernel of one thread writes the size of the
//! next dispatch, so 32 rounds are handed over at once, and then the host reads a few words to learn whether vertices
//! are left. Rounds beyond the last are dispatches of nothing. Every round colors at least one vertex; if not,
//! [`GpuError::Stalled`](crate::GpuError::Stalled) says so.
//!
//! **Rounds may differ, colors may not.** Where a vertex decides while its neighbors do, whether it sees them in this
//! round or in the next depends on the device; why the colors do not is told in the shaders. [`vivace`] and [`wlc`]
//! depend on what a vertex sees of its neighbors, so there a round has several dispatches, and rounds are those of the
//! CPU, too.
//!
//! **Traffic.** Nothing is uploaded, but 16 bytes with the options of [`vivace`] and [`wlc`]; what is read back is 24 bytes
//! per 32 rounds.

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
