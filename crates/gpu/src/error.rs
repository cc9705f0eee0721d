//! [`GpuError`]: what can go wrong with a device, and what to do about it.

use thiserror::Error;

/// Why something could not be done on a GPU.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum GpuError {
    /// No adapter was found, or none that answers the wish.
    #[error("no GPU: {reason}; found: {found}")]
    NoAdapter {
        /// What was looked for.
        reason: String,
        /// The adapters that there are.
        found: String,
    },
    /// The adapter refused to open a device.
    #[error("the GPU {adapter} cannot be used: {message}")]
    Refused {
        /// The adapter's name.
        adapter: String,
        /// What it said.
        message: String,
    },
    /// A buffer would be larger than the device allows.
    #[error(
        "{what} need {bytes} bytes on the GPU, and one buffer holds {limit}: take a smaller body or another device"
    )]
    TooLarge {
        /// What was to be stored.
        what: &'static str,
        /// The size in bytes.
        bytes: u64,
        /// The device's limit in bytes.
        limit: u64,
    },
    /// The device has no memory left.
    #[error("the GPU has no memory left for {what} ({bytes} bytes)")]
    OutOfMemory {
        /// What was to be stored.
        what: &'static str,
        /// The size in bytes.
        bytes: u64,
    },
    /// The device is gone: driver crash, timeout, or explicit destruction. What it held is lost.
    #[error("the GPU is lost: {message}")]
    Lost {
        /// What the driver said.
        message: String,
    },
    /// The device refused a command; a defect of this crate or of a driver.
    #[error("the GPU refused a command: {message}")]
    Command {
        /// What was said.
        message: String,
    },
    /// Something that the GPU path does not do.
    #[error("the GPU path does not do {what}: use the CPU")]
    Unsupported {
        /// What was asked for.
        what: &'static str,
    },
    /// The device has no clock for its stages.
    #[error("this GPU cannot time its stages: it has no timestamp queries")]
    NoTimestamps,
    /// A cluster does not fit into a block of the GPU.
    #[error(
        "cluster {cluster} has {tets} tets and a block holds {limit}: cluster with a smaller size"
    )]
    Block {
        /// The cluster.
        cluster: u32,
        /// Its tets.
        tets: usize,
        /// The most tets of a block.
        limit: usize,
    },
    /// The device does not have what the host says: a defect of this crate or of a driver.
    #[error("internal check failed: on the GPU, {what} differs")]
    Inconsistent {
        /// What differs.
        what: String,
    },
    /// An algorithm gave up; a defect, since all of them end.
    #[error("{algorithm} did not end after {rounds} rounds")]
    Stalled {
        /// The name of the algorithm.
        algorithm: &'static str,
        /// Rounds made.
        rounds: usize,
    },
    /// The settings of a step are out of range.
    #[error(transparent)]
    Settings(#[from] incise_xpbd::XpbdError),
}
