//! [`GpuError`]: errors of devices.

use thiserror::Error;

/// An error of a GPU or of the driver.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum GpuError {
    /// No adapter was found, or none that matches the options.
    #[error("no GPU: {reason}; found: {found}")]
    NoAdapter {
        /// The options that were searched for.
        reason: String,
        /// The available adapters.
        found: String,
    },
    /// The adapter refused to open a device.
    #[error("the GPU {adapter} cannot be used: {message}")]
    Refused {
        /// The adapter's name.
        adapter: String,
        /// The message of the driver.
        message: String,
    },
    /// A buffer would be larger than the device allows.
    #[error(
        "{what} need {bytes} bytes on the GPU, and one buffer holds {limit}: take a smaller body or another device"
    )]
    TooLarge {
        /// The name of the data.
        what: &'static str,
        /// The size in bytes.
        bytes: u64,
        /// The device's limit in bytes.
        limit: u64,
    },
    /// The device has no memory left.
    #[error("the GPU has no memory left for {what} ({bytes} bytes)")]
    OutOfMemory {
        /// The name of the data.
        what: &'static str,
        /// The size in bytes.
        bytes: u64,
    },
    /// The device is lost: driver crash, timeout, or explicit destruction. Its data are lost, too.
    #[error("the GPU is lost: {message}")]
    Lost {
        /// The message of the driver.
        message: String,
    },
    /// The device rejected a command: a defect of this crate or of a driver.
    #[error("the GPU refused a command: {message}")]
    Command {
        /// The message of the driver.
        message: String,
    },
    /// The GPU path does not support something.
    #[error("the GPU path does not do {what}: use the CPU")]
    Unsupported {
        /// The unsupported feature.
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
        /// The number of the cluster.
        cluster: u32,
        /// The number of its tets.
        tets: usize,
        /// The largest number of tets of a block.
        limit: usize,
    },
    /// The device's copy of the data differs from the host's: a defect of this crate or of a
    /// driver.
    #[error("internal check failed: on the GPU, {what} differs")]
    Inconsistent {
        /// The data that differ.
        what: String,
    },
    /// An algorithm did not end within its bound of rounds, which is a defect.
    #[error("{algorithm} did not end after {rounds} rounds")]
    Stalled {
        /// The name of the algorithm.
        algorithm: &'static str,
        /// The number of rounds made.
        rounds: usize,
    },
    /// The settings of a step are out of range.
    #[error(transparent)]
    Settings(#[from] incise_xpbd::XpbdError),
}
