//! [`Lanes`]: the assignment of clusters to lanes, for processors that solve several clusters of a color at once.
//!
//! A *group* is a fixed number of lanes that work together on clusters of one color: the lanes of a SIMD instruction,
//! or the threads of a GPU's workgroup. A cluster keeps its lane while its color stays, so a cut moves only the
//! clusters that it changes. A group whose lanes are all empty is reused by the next color that needs a group of its
//! depth. Cost: amortized O(1) per edit; 4 bytes per cluster and 24 per group.

use crate::{ClusterId, Rows};

/// Marks a missing slot or color.
const NONE: u32 = u32::MAX;

/// Groups of lanes by color, and the lane of each cluster.
///
/// A cluster's *slot* is the number of its group times the width plus its lane. Data stored by slot stay valid after an
/// edit, except for clusters that were assigned or released.
///
/// ```
/// use incise_graph::{ClusterId, Lanes};
///
/// // Two colors, groups of two lanes, clusters of up to 3 constraints in this one.
/// let mut lanes = Lanes::new(2);
/// lanes.set_color_count(2);
/// let (group, _) = lanes.open(0, 3);
/// assert_eq!(lanes.assign(ClusterId(7), group), 0);
/// assert_eq!(lanes.assign(ClusterId(8), group), 1);
/// assert!(!lanes.has_room(group));
/// assert_eq!(lanes.slot(ClusterId(8)), Some((group, 1)));
///
/// // Without clusters the group is available to another color.
/// assert_eq!(lanes.release(ClusterId(7)), None);
/// assert_eq!(lanes.release(ClusterId(8)), Some(group));
/// assert!(lanes.groups().row(0).is_empty());
/// assert_eq!(lanes.open(1, 3), (group, false));
/// ```
#[derive(Clone, Debug)]
pub struct Lanes {
    width: usize,
    /// Color -> groups.
    colors: Rows<u32>,
    list: Vec<LaneGroup>,
    /// Depth -> groups without clusters.
    free: Rows<u32>,
    /// Cluster -> slot.
    slots: Vec<u32>,
}

/// A group of lanes for clusters of one color.
#[derive(Clone, Copy, Debug)]
pub struct LaneGroup {
    /// The depth passed to [`Lanes::open`]: the largest number of constraints per cluster in the group, or 0 if
    /// unlimited.
    pub depth: u32,
    /// The color of its clusters, or of the last ones if it has none.
    pub color: u32,
    /// A bit for each occupied lane.
    pub occupied: u64,
    /// The index of the group within its color.
    index: u32,
}

impl Lanes {
    /// No groups and no colors, with `width` lanes per group.
    ///
    /// # Panics
    /// If the width is not from 1 to 64.
    #[must_use]
    pub fn new(width: usize) -> Self {
        check_width(width);
        Self {
            width,
            colors: Rows::default(),
            list: Vec::new(),
            free: Rows::default(),
            slots: Vec::new(),
        }
    }

    /// Removes all groups and colors; memory is reused.
    ///
    /// # Panics
    /// If the width is not from 1 to 64.
    pub fn reset(&mut self, width: usize) {
        check_width(width);
        self.width = width;
        self.colors.refill(0, std::iter::empty());
        self.list.clear();
        self.free.refill(0, std::iter::empty());
        self.slots.clear();
    }

    /// The number of lanes per group.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// The number of colors.
    #[must_use]
    pub fn color_count(&self) -> usize {
        self.colors.row_count()
    }

    /// Sets the number of colors; removed ones must not have groups.
    pub fn set_color_count(&mut self, colors: usize) {
        self.colors.set_row_count(colors);
    }

    /// The groups of each color.
    #[must_use]
    pub fn groups(&self) -> &Rows<u32> {
        &self.colors
    }

    /// The number of groups, including those without clusters.
    #[must_use]
    pub fn group_count(&self) -> usize {
        self.list.len()
    }

    /// A group.
    ///
    /// # Panics
    /// If there is no such group.
    #[inline]
    #[must_use]
    pub fn group(&self, number: usize) -> &LaneGroup {
        &self.list[number]
    }

    /// Adds a group to a color: an empty one that was opened with the same depth, or else a new one with the next
    /// number. Returns its number and true if it is new.
    ///
    /// # Panics
    /// If there is no such color, or the lanes do not fit into `u32`.
    pub fn open(&mut self, color: usize, depth: usize) -> (usize, bool) {
        let free = (depth < self.free.row_count()).then(|| self.free.pop(depth));
        let free = free.flatten().map(|number| number as usize);
        let group = LaneGroup {
            depth: index(depth),
            color: index(color),
            occupied: 0,
            index: index(self.colors.row(color).len()),
        };
        let number = free.unwrap_or(self.list.len());
        match free {
            Some(number) => self.list[number] = group,
            None => self.list.push(group),
        }
        self.colors.push(color, index(number));
        (number, free.is_none())
    }

    /// True if a group has an unoccupied lane.
    ///
    /// # Panics
    /// If there is no such group.
    #[must_use]
    pub fn has_room(&self, group: usize) -> bool {
        self.free_lane(group) < self.width
    }

    fn free_lane(&self, group: usize) -> usize {
        self.list[group].occupied.trailing_ones() as usize
    }

    /// Group and lane of a cluster; `None` if it has none.
    #[inline]
    #[must_use]
    pub fn slot(&self, cluster: ClusterId) -> Option<(usize, usize)> {
        let slot = *self.slots.get(cluster.index())?;
        let slot = (slot != NONE).then_some(slot as usize)?;
        Some((slot / self.width, slot % self.width))
    }

    /// Assigns the first unoccupied lane of a group to a cluster without a lane; returns the slot.
    ///
    /// # Panics
    /// If the group has no room.
    pub fn assign(&mut self, cluster: ClusterId, group: usize) -> usize {
        let lane = self.free_lane(group);
        assert!(lane < self.width, "the group has room");
        self.list[group].occupied |= 1 << lane;
        if self.slots.len() <= cluster.index() {
            self.slots.resize(cluster.index() + 1, NONE);
        }
        let slot = group * self.width + lane;
        self.slots[cluster.index()] = index(slot);
        slot
    }

    /// Releases the lane of a cluster. If the group becomes empty, it is returned; it belongs to no color until it is
    /// opened again.
    ///
    /// # Panics
    /// If the cluster has no lane.
    pub fn release(&mut self, cluster: ClusterId) -> Option<usize> {
        let (number, lane) = self.slot(cluster).expect("the cluster has a lane");
        self.slots[cluster.index()] = NONE;
        let group = &mut self.list[number];
        group.occupied &= !(1 << lane);
        if group.occupied != 0 {
            return None;
        }
        let LaneGroup {
            depth,
            color,
            index: at,
            ..
        } = *group;
        let (color, depth, at) = (color as usize, depth as usize, at as usize);
        self.colors.swap_remove(color, at);
        if let Some(&other) = self.colors.row(color).get(at) {
            self.list[other as usize].index = index(at);
        }
        let depths = self.free.row_count().max(depth + 1);
        self.free.set_row_count(depths);
        self.free.push(depth, index(number));
        Some(number)
    }

    /// Closes gaps that edits have left in the rows; numbers stay. O(groups) if there are many gaps, else O(1).
    pub fn tidy(&mut self) {
        self.colors.tidy();
        self.free.tidy();
    }
}

fn check_width(width: usize) {
    assert!(
        (1..=64).contains(&width),
        "a word has a bit for each lane of a group"
    );
}

fn index(value: usize) -> u32 {
    u32::try_from(value).expect("fewer than 2^32 lanes")
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use proptest::prelude::*;

    use super::*;

    /// An edit: a cluster is assigned to a color and a depth, or, without them, released.
    type Edit = (u32, Option<(usize, usize)>);

    fn check(lanes: &Lanes, expected: &BTreeMap<u32, (usize, usize)>) {
        let mut occupied = vec![0_u64; lanes.group_count()];
        for (&cluster, &(color, depth)) in expected {
            let (group, lane) = lanes.slot(ClusterId(cluster)).expect("it has a lane");
            assert_eq!(occupied[group] & (1 << lane), 0, "two clusters in a lane");
            occupied[group] |= 1 << lane;
            let known = lanes.group(group);
            assert_eq!((known.color, known.depth), (index(color), index(depth)));
        }
        for (number, &found) in occupied.iter().enumerate() {
            let group = lanes.group(number);
            assert_eq!(group.occupied, found);
            let of_color = lanes.groups().row(group.color as usize);
            let at = of_color.iter().position(|&g| g as usize == number);
            assert_eq!(at, (found != 0).then_some(group.index as usize));
        }
        let used = lanes.groups().value_count();
        assert_eq!(used + lanes.free.value_count(), lanes.group_count());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// After any sequence of edits, every cluster has a distinct lane in a group of its color and depth, and
        /// unchanged clusters keep their lanes.
        #[test]
        fn lanes_follow_edits(
            width in prop::sample::select(vec![1_usize, 2, 3, 16, 64]),
            edits in prop::collection::vec(
                (0..40_u32, prop::option::of((0..4_usize, 0..3_usize))), 0..200),
        ) {
            let mut lanes = Lanes::new(width);
            lanes.set_color_count(4);
            let mut expected = BTreeMap::new();
            for (cluster, target) in edits as Vec<Edit> {
                let id = ClusterId(cluster);
                let before: Vec<_> = expected.keys().map(|&k| (k, lanes.slot(ClusterId(k)))).collect();
                if expected.remove(&cluster).is_some() {
                    lanes.release(id);
                }
                if let Some((color, depth)) = target {
                    let roomy = lanes.groups().row(color).iter().map(|&g| g as usize).find(|&g| {
                        lanes.group(g).depth == index(depth) && lanes.has_room(g)
                    });
                    let count = lanes.group_count();
                    let group = roomy.unwrap_or_else(|| {
                        let (group, is_new) = lanes.open(color, depth);
                        assert_eq!(is_new, group == count);
                        group
                    });
                    let slot = lanes.assign(id, group);
                    prop_assert_eq!(lanes.slot(id), Some((slot / width, slot % width)));
                    expected.insert(cluster, (color, depth));
                } else {
                    prop_assert_eq!(lanes.slot(id), None);
                }
                for (k, slot) in before.into_iter().filter(|&(k, _)| k != cluster) {
                    prop_assert_eq!(lanes.slot(ClusterId(k)), slot);
                }
                lanes.tidy();
                check(&lanes, &expected);
            }
        }
    }

    #[test]
    #[should_panic(expected = "the group has room")]
    fn a_full_group_takes_no_cluster() {
        let mut lanes = Lanes::new(1);
        lanes.set_color_count(1);
        let (group, _) = lanes.open(0, 1);
        lanes.assign(ClusterId(0), group);
        lanes.assign(ClusterId(1), group);
    }

    #[test]
    fn a_reset_forgets_everything() {
        let mut lanes = Lanes::new(4);
        lanes.set_color_count(1);
        let (group, _) = lanes.open(0, 2);
        lanes.assign(ClusterId(3), group);
        lanes.reset(8);
        assert_eq!(
            (lanes.width(), lanes.color_count(), lanes.group_count()),
            (8, 0, 0)
        );
        assert_eq!(lanes.slot(ClusterId(3)), None);
    }
}
