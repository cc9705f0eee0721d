//! [`Groups`]: which cluster is in which lane of which blocks.
//!
//! Groups keep their blocks; one without clusters waits for another of its length. Cost: O(1) an edit, amortized.

use std::ops::Range;

use incise_graph::{ClusterId, Rows};

use super::index;

/// No slot, no group.
const NONE: u32 = u32::MAX;

/// The groups of all colors. A cluster's *slot* is its group times the lanes plus its lane.
#[derive(Clone, Debug)]
pub(super) struct Groups {
    /// Lanes of a group.
    pub(super) lanes: usize,
    /// Color -> groups.
    pub(super) colors: Rows<u32>,
    /// By color.
    pub(super) usages: Vec<Usage>,
    pub(super) list: Vec<Group>,
    /// Blocks -> groups of so many blocks that have no cluster.
    pub(super) free: Rows<u32>,
    pub(super) free_blocks: usize,
    /// Cluster -> slot.
    slots: Vec<u32>,
}

/// Clusters that are solved side by side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Group {
    /// The first of its blocks, and their number.
    pub(super) first: u32,
    pub(super) depth: u32,
    pub(super) color: u32,
    /// Its index among the groups of its color.
    pub(super) index: u32,
    /// A bit for each lane that has a cluster.
    pub(super) occupied: u16,
}

impl Group {
    pub(super) fn blocks(&self) -> Range<usize> {
        self.first as usize..(self.first + self.depth) as usize
    }
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
}

impl Usage {
    pub(super) const NONE: Self = Self {
        tets: 0,
        blocks: 0,
        depth: 0,
        open: NONE,
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
            lanes: 1,
            colors: Rows::default(),
            usages: Vec::new(),
            list: Vec::new(),
            free: Rows::default(),
            free_blocks: 0,
            slots: Vec::new(),
        }
    }
}

impl Groups {
    /// Removes all groups.
    pub(super) fn reset(&mut self, lanes: usize, colors: usize) {
        self.lanes = lanes;
        self.colors.refill(colors, std::iter::empty());
        self.usages.clear();
        self.usages.resize(colors, Usage::NONE);
        self.list.clear();
        self.free.refill(0, std::iter::empty());
        self.free_blocks = 0;
        self.slots.clear();
    }

    /// Sets the number of colors; those that vanish have no groups.
    pub(super) fn set_color_count(&mut self, colors: usize) {
        self.colors.set_row_count(colors);
        self.usages.resize(colors, Usage::NONE);
    }

    /// Adds a group of so many blocks to a color: one that is free, or a new one after the `blocks` that there are.
    pub(super) fn open(&mut self, color: usize, depth: usize, blocks: usize) -> usize {
        let free = (depth < self.free.row_count()).then(|| self.free.pop(depth));
        let (number, first) = match free.flatten() {
            Some(number) => {
                self.free_blocks -= depth;
                (number as usize, self.list[number as usize].first)
            }
            None => (self.list.len(), index(blocks)),
        };
        let group = Group {
            first,
            depth: index(depth),
            color: index(color),
            index: index(self.colors.row(color).len()),
            occupied: 0,
        };
        if number == self.list.len() {
            self.list.push(group);
        } else {
            self.list[number] = group;
        }
        self.colors.push(color, index(number));
        let usage = &mut self.usages[color];
        usage.blocks += group.depth;
        usage.depth = usage.depth.max(group.depth);
        usage.open = index(number);
        number
    }

    /// The group of a color that takes a new cluster of a length, if there is one.
    pub(super) fn with_room(&self, color: usize, length: usize) -> Option<usize> {
        let open = self.usages[color].open as usize;
        let group = self.list.get(open)?;
        (group.depth as usize >= length && self.free_lane(group).is_some()).then_some(open)
    }

    /// The first lane of a group without a cluster.
    fn free_lane(&self, group: &Group) -> Option<usize> {
        let lane = group.occupied.trailing_ones() as usize;
        (lane < self.lanes).then_some(lane)
    }

    /// Group and lane of a cluster.
    pub(super) fn slot(&self, cluster: ClusterId) -> Option<(usize, usize)> {
        let slot = *self.slots.get(cluster.index())?;
        let slot = (slot != NONE).then_some(slot as usize)?;
        Some((slot / self.lanes, slot % self.lanes))
    }

    /// Assigns a free lane of a group to a cluster.
    pub(super) fn assign(&mut self, cluster: ClusterId, group: usize) {
        let lane = self.free_lane(&self.list[group]);
        let lane = lane.expect("groups are opened before they are full");
        self.list[group].occupied |= 1 << lane;
        if self.slots.len() <= cluster.index() {
            self.slots.resize(cluster.index() + 1, NONE);
        }
        self.slots[cluster.index()] = index(group * self.lanes + lane);
    }

    /// Releases the lane of a cluster, which is empty.
    pub(super) fn release(&mut self, cluster: ClusterId) {
        let (group, lane) = self.slot(cluster).expect("it has a lane");
        self.slots[cluster.index()] = NONE;
        self.list[group].occupied &= !(1 << lane);
        if self.list[group].occupied == 0 {
            self.close(group);
        }
    }

    /// Removes a group without clusters from its color.
    fn close(&mut self, number: usize) {
        let group = self.list[number];
        let color = group.color as usize;
        self.colors.swap_remove(color, group.index as usize);
        if let Some(&other) = self.colors.row(color).get(group.index as usize) {
            self.list[other as usize].index = group.index;
        }
        let usage = &mut self.usages[color];
        usage.blocks -= group.depth;
        if usage.open == index(number) {
            usage.open = NONE;
        }
        let depth = group.depth as usize;
        self.free
            .set_row_count(self.free.row_count().max(depth + 1));
        self.free.push(depth, index(number));
        self.free_blocks += depth;
    }
}
