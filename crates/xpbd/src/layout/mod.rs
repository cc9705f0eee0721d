//! [`Layout`]: the tets in the order and grouping of the SIMD kernels.
//!
//! Clusters of one color share no particle, so as many of them as a processor has lanes are solved side by side: lane
//! by lane the first tet of each, then the second. A *group* is such a set of clusters (`groups.rs`), a *block* one tet
//! of each (`blocks.rs`). The grouping changes the order of work only, since each cluster sees only its own particles.
//! Tets of a cluster that share corners follow each other (`order.rs`), so that the kernel keeps these corners.
//! Groups of a color follow each other in space, and so do the copies of particles that several threads work on
//! (`places.rs`): thus each thread keeps to its own part of the body.
//!
//! A layout is updated with its schedule (`update.rs`): groups keep their blocks, a changed cluster is moved from its
//! lane to a free one, and a tet whose rest shape or masses changed is marked and filled in again, with its cluster if its
//! corners changed. So a frame
//! after a cut costs what the cut touched. Another schedule, another material or a changed mass whose incident tets
//! were not named rebuilds all.
//!
//! Cost: to build, O(tets), and O(particles log particles) for their order; to update, O(changed clusters and marked
//! tets), amortized. 101 bytes a tet in single precision.

mod blocks;
mod check;
mod groups;
mod order;
mod places;
mod update;

use std::ops::Range;

use incise_graph::{ClusterId, Schedule};

use crate::Float;
use blocks::Blocks;
pub(crate) use blocks::{CONSTANTS, Ingredients, REST};
use groups::Groups;
pub use order::OrderedTet;
pub(crate) use order::{ClusterOrder, in_slots};
use places::Places;

/// No slot.
const NONE: u32 = u32::MAX;

/// The tets of a schedule, block by block.
#[derive(Clone, Debug)]
pub(crate) struct Layout<R> {
    /// The revision of the schedule that this is the layout of; `None` if it is to be rebuilt.
    revision: Option<u64>,
    pub(crate) blocks: Blocks<R>,
    groups: Groups,
    /// The order of particles for several threads.
    pub(crate) places: Places,
    /// Tet -> slot in the blocks.
    slots: Vec<u32>,
    /// Tets in the layout that have changed since, and for each tet whether it is listed.
    dirty: Vec<u32>,
    marked: Vec<bool>,
    /// Calls of [`Layout::compact`] since the last change.
    calm: u32,
    /// Working memory.
    clusters: Vec<ClusterId>,
    order: ClusterOrder,
}

impl<R: Float> Default for Layout<R> {
    fn default() -> Self {
        Self {
            revision: None,
            blocks: Blocks::default(),
            groups: Groups::default(),
            places: Places::default(),
            slots: Vec::new(),
            dirty: Vec::new(),
            marked: Vec::new(),
            calm: 0,
            clusters: Vec::new(),
            order: ClusterOrder::default(),
        }
    }
}

impl<R: Float> Layout<R> {
    /// Whether this is the layout of the schedule, and no tet has changed since.
    pub(crate) fn fits(&self, schedule: &Schedule) -> bool {
        self.revision == Some(schedule.revision()) && self.dirty.is_empty()
    }

    /// Makes the next update rebuild all.
    pub(crate) fn forget(&mut self) {
        self.revision = None;
    }

    /// Marks a tet whose corners, rest shape or masses have changed. O(1).
    pub(crate) fn touch(&mut self, tet: usize) {
        if self.revision.is_some() && self.slot(tet).is_some() && !self.marked[tet] {
            self.marked[tet] = true;
            self.dirty.push(index(tet));
        }
    }

    /// The groups of a color.
    #[inline]
    pub(crate) fn groups_of(&self, color: usize) -> &[u32] {
        self.groups.lanes.groups().row(color)
    }

    /// The blocks of a group.
    #[inline]
    pub(crate) fn blocks_of(&self, group: u32) -> Range<usize> {
        self.groups.blocks(group as usize)
    }

    /// The number of blocks of a color.
    pub(crate) fn block_count_of(&self, color: usize) -> usize {
        self.groups.usages[color].blocks as usize
    }

    pub(crate) fn color_count(&self) -> usize {
        self.groups.lanes.color_count()
    }

    /// The block and the lane of a tet; `None` if the schedule does not solve it.
    pub(crate) fn slot(&self, tet: usize) -> Option<(usize, usize)> {
        let slot = *self.slots.get(tet)?;
        let slot = (slot != NONE).then_some(slot as usize)?;
        Some((slot / self.blocks.lanes, slot % self.blocks.lanes))
    }
}

fn index(value: usize) -> u32 {
    u32::try_from(value).expect("fewer than 2³² tets, lanes included")
}

#[cfg(test)]
mod tests;
