//! [`Traffic`]: counters of transfers and commands of a device.
//!
//! Uploads, readbacks and passes make a GPU path slow without changing results. They are therefore counted where they
//! happen, and tests bound them. Cost: one atomic addition each.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Transfers and commands of a device since it was opened.
///
/// Use the difference of two values for the cost of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Traffic {
    /// Bytes written to buffers.
    pub uploaded_bytes: u64,
    /// Bytes read from buffers.
    pub read_bytes: u64,
    /// Readbacks, each of which waits for the device.
    pub readbacks: u64,
    /// Dispatches of kernels.
    pub dispatches: u64,
    /// Compute passes.
    pub passes: u64,
    /// Submits of commands.
    pub submits: u64,
    /// Buffers created.
    pub buffers: u64,
}

impl Traffic {
    /// The traffic since an earlier count.
    #[must_use]
    pub fn since(self, earlier: Self) -> Self {
        Self {
            uploaded_bytes: self.uploaded_bytes - earlier.uploaded_bytes,
            read_bytes: self.read_bytes - earlier.read_bytes,
            readbacks: self.readbacks - earlier.readbacks,
            dispatches: self.dispatches - earlier.dispatches,
            passes: self.passes - earlier.passes,
            submits: self.submits - earlier.submits,
            buffers: self.buffers - earlier.buffers,
        }
    }
}

/// The counters themselves.
#[derive(Debug, Default)]
pub(crate) struct Counters {
    pub(crate) uploaded_bytes: AtomicU64,
    pub(crate) read_bytes: AtomicU64,
    pub(crate) readbacks: AtomicU64,
    pub(crate) dispatches: AtomicU64,
    pub(crate) passes: AtomicU64,
    pub(crate) submits: AtomicU64,
    pub(crate) buffers: AtomicU64,
}

/// Adds to a counter.
pub(crate) fn count(counter: &AtomicU64, amount: u64) {
    counter.fetch_add(amount, Relaxed);
}

impl Counters {
    pub(crate) fn read(&self) -> Traffic {
        Traffic {
            uploaded_bytes: self.uploaded_bytes.load(Relaxed),
            read_bytes: self.read_bytes.load(Relaxed),
            readbacks: self.readbacks.load(Relaxed),
            dispatches: self.dispatches.load(Relaxed),
            passes: self.passes.load(Relaxed),
            submits: self.submits.load(Relaxed),
            buffers: self.buffers.load(Relaxed),
        }
    }
}
