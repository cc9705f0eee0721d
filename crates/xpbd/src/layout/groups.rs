//! [`Groups`]: the blocks of each group of lanes, and the utilization of a color's blocks.
//!
//! Groups keep their blocks; a group without clusters is reused for one of its depth. Cost: O(1) an edit, amortized.

use std::ops::Range;

use incise_graph::{ClusterId, Lanes};

use super::index;

/// No group.
const NONE: u32 = u32::MAX;

/// The groups of all colors.
#[derive(Clone, Debug)]
pub(super) struct Groups {
    /// The lane of each cluster. The depth of a group is the number of its blocks.
    pub(super) lanes: Lanes,
    /// By color.
    pub(super) usages: Vec<Usage>,
    /// Group -> the first of its blocks.
    firsts: Vec<u32>,
    /// Blocks of groups that have no cluster.
    pub(super) free_blocks: usize,
}

/// How well the blocks of a color are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Usage {
    pub(super) tets: u32,
    pub(super) blocks: u32,
    /// The most blocks of a group since the groups of the color were formed.
    depth: u32,
    /// The group that takes new clusters.
    open: u32,
    /// Whether rebuilding the groups is known not to be worth it.
    pub(super) is_settled: bool,
}

impl Usage {
    pub(super) const NONE: Self = Self {
        tets: 0,
        blocks: 0,
        depth: 0,
        open: NONE,
        is_settled: true,
    };

    /// Whether rebuilding the groups is worth it. A color that was just built has no more than `tets / lanes + depth`
    /// blocks, so in between at least half as many have become idle.
    pub(super) fn is_wasteful(self, lanes: usize) -> bool {
        let lanes = u64::try_from(lanes).unwrap_or(u64::MAX);
        let [tets, blocks, depth] = [self.tets, self.blocks, self.depth].map(u64::from);
        2 * lanes * blocks > 3 * (tets + lanes * depth)
    }
}

impl Default for Groups {
    fn default() -> Self {
        Self {
            lanes: Lanes::new(1),
            usages: Vec::new(),
            firsts: Vec::new(),
            free_blocks: 0,
        }
    }
}

impl Groups {
    /// Removes all groups.
    pub(super) fn reset(&mut self, lanes: usize, colors: usize) {
        self.lanes.reset(lanes);
        self.usages.clear();
        self.set_color_count(colors);
        self.firsts.clear();
        self.free_blocks = 0;
    }

    /// Sets the number of colors; those that vanish have no groups.
    pub(super) fn set_color_count(&mut self, colors: usize) {
        self.lanes.set_color_count(colors);
        self.usages.resize(colors, Usage::NONE);
    }

    /// The blocks of a group.
    #[inline]
    pub(super) fn blocks(&self, group: usize) -> Range<usize> {
        let first = self.firsts[group] as usize;
        first..first + self.lanes.group(group).depth as usize
    }

    /// Adds a group of so many blocks to a color: one that is free, or a new one after the `blocks` that there are.
    pub(super) fn open(&mut self, color: usize, depth: usize, blocks: usize) -> usize {
        let (number, is_new) = self.lanes.open(color, depth);
        if is_new {
            self.firsts.push(index(blocks));
        } else {
            self.free_blocks -= depth;
        }
        let usage = &mut self.usages[color];
        usage.blocks += index(depth);
        usage.depth = usage.depth.max(index(depth));
        usage.open = index(number);
        number
    }

    /// The group of a color that takes a new cluster of a length, if there is one.
    pub(super) fn with_room(&self, color: usize, length: usize) -> Option<usize> {
        let open = self.usages[color].open as usize;
        (open < self.lanes.group_count()
            && self.lanes.group(open).depth as usize >= length
            && self.lanes.has_room(open))
        .then_some(open)
    }

    /// Releases the lane of a cluster, which is empty.
    pub(super) fn release(&mut self, cluster: ClusterId) {
        let Some(number) = self.lanes.release(cluster) else {
            return;
        };
        let group = self.lanes.group(number);
        let usage = &mut self.usages[group.color as usize];
        usage.blocks -= group.depth;
        if usage.open == index(number) {
            usage.open = NONE;
        }
        self.free_blocks += group.depth as usize;
    }
}
