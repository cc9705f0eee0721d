//! [`Journal`]: the record of changed clusters, for structures derived from a schedule.
//!
//! Each change gets a revision number that no other schedule has. A derived structure that stores
//! its last revision can determine whether it belongs to this schedule and which clusters have
//! changed since. The journal keeps as many changes as there are clusters; a structure that is
//! further behind has to be rebuilt.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::ClusterId;

/// The number of the next change. Numbers depend on other schedules of the process, but this
/// affects no result: they are compared for equality only.
static NEXT: AtomicU64 = AtomicU64::new(1);

#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Journal {
    revision: u64,
    /// Revisions before each change, ascending, and the start of its entries in `clusters`.
    revisions: Vec<(u64, usize)>,
    clusters: Vec<ClusterId>,
}

impl Journal {
    pub(super) fn revision(&self) -> u64 {
        self.revision
    }

    /// Records that everything has changed.
    pub(super) fn restart(&mut self) {
        self.revisions.clear();
        self.clusters.clear();
        self.revision = NEXT.fetch_add(1, Ordering::Relaxed);
    }

    /// Records that some clusters of `count` have changed.
    pub(super) fn note(&mut self, changed: &[ClusterId], count: usize) {
        if changed.is_empty() {
            return;
        }
        let before = self.revision;
        let start = self.clusters.len();
        self.revision = NEXT.fetch_add(1, Ordering::Relaxed);
        if start + changed.len() > count {
            self.revisions.clear();
            self.clusters.clear();
        }
        self.revisions.push((before, self.clusters.len()));
        self.clusters.extend_from_slice(changed);
    }

    pub(super) fn since(&self, revision: u64) -> Option<&[ClusterId]> {
        if revision == self.revision {
            return Some(&[]);
        }
        let entry = self
            .revisions
            .binary_search_by_key(&revision, |entry| entry.0)
            .ok()?;
        Some(&self.clusters[self.revisions[entry].1..])
    }
}
