//! [`Journal`]: which clusters changed when, for structures that follow a schedule.
//!
//! Each change gets a number that no other schedule has, so a follower that remembers the number
//! it has seen last can tell whether it follows this schedule, and finds what changed since. As many
//! changes are kept as there are clusters: a follower that is further behind has to be rebuilt.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::ClusterId;

/// The next number of a change. That numbers depend on what else runs in the process changes no
/// result: they are compared for equality only.
static NEXT: AtomicU64 = AtomicU64::new(1);

#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Journal {
    revision: u64,
    /// Revisions before each change, ascending, and where in `clusters` its entries begin.
    revisions: Vec<(u64, usize)>,
    clusters: Vec<ClusterId>,
}

impl Journal {
    pub(super) fn revision(&self) -> u64 {
        self.revision
    }

    /// Everything has changed.
    pub(super) fn restart(&mut self) {
        self.revisions.clear();
        self.clusters.clear();
        self.revision = NEXT.fetch_add(1, Ordering::Relaxed);
    }

    /// Some clusters have changed, of `count` in all.
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
