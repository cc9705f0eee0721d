//! [`Slots`]: the assignment of clusters to slots on the device.
//!
//! A workgroup solves a group of slots. A cluster has a slot while it has tets, and keeps it while its color stays.
//! Cost: O(changed clusters times groups of their colors / 64) for an update, O(clusters) to build.

use crate::index::index;
use incise_graph::{ClusterId, Lanes, Rows, Schedule};

/// The cluster of an empty slot.
const NONE: u32 = u32::MAX;

/// Empty groups per color, beside half of all slots, above which all clusters are assigned again.
const SPARE: usize = 2;

/// The assignment of clusters to slots.
#[derive(Debug)]
pub(crate) struct Slots {
    lanes: Lanes,
    revision: Option<u64>,
    /// Slot -> cluster.
    clusters: Vec<u32>,
    /// Clusters that have a slot.
    assigned: usize,
}

/// The slots that an update has changed.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Moved {
    /// All slots were assigned again.
    All,
    /// The contents of these slots, ascending.
    Slots(Vec<u32>),
}

impl Slots {
    /// Empty slots in groups of `width`, at most 64.
    pub(crate) fn new(width: usize) -> Self {
        Self {
            lanes: Lanes::new(width),
            revision: None,
            clusters: Vec::new(),
            assigned: 0,
        }
    }

    pub(crate) fn slot_count(&self) -> usize {
        self.clusters.len()
    }

    pub(crate) fn color_count(&self) -> usize {
        self.lanes.color_count()
    }

    /// The groups of each color.
    pub(crate) fn groups(&self) -> &Rows<u32> {
        self.lanes.groups()
    }

    /// The cluster in a slot.
    pub(crate) fn cluster(&self, slot: u32) -> Option<ClusterId> {
        let cluster = self.clusters[slot as usize];
        (cluster != NONE).then_some(ClusterId(cluster))
    }

    /// The slot of a cluster.
    fn slot(&self, cluster: ClusterId) -> Option<u32> {
        let (group, lane) = self.lanes.slot(cluster)?;
        Some(index(group * self.lanes.width() + lane))
    }

    /// Marks all slots as outdated.
    pub(crate) fn forget(&mut self) {
        self.revision = None;
    }

    /// Updates the slots to a schedule.
    pub(crate) fn sync(&mut self, schedule: &Schedule) -> Moved {
        let changes = self.revision.and_then(|r| schedule.changes_since(r));
        let moved = changes.map(|changes| self.update(schedule, changes));
        self.revision = Some(schedule.revision());
        let spare = SPARE * self.color_count().max(1) * self.lanes.width();
        match moved {
            Some(slots) if self.slot_count() <= 2 * self.assigned + spare => Moved::Slots(slots),
            _ => {
                self.rebuild(schedule);
                Moved::All
            }
        }
    }

    fn rebuild(&mut self, schedule: &Schedule) {
        self.lanes.reset(self.lanes.width());
        self.lanes.set_color_count(schedule.color_count());
        self.clusters.clear();
        self.assigned = 0;
        for color in 0..schedule.color_count() {
            for &cluster in schedule.clusters(color) {
                self.assign(cluster, color);
            }
        }
    }

    fn update(&mut self, schedule: &Schedule, changes: &[ClusterId]) -> Vec<u32> {
        if self.color_count() < schedule.color_count() {
            self.lanes.set_color_count(schedule.color_count());
        }
        let mut changed = changes.to_vec();
        changed.sort_unstable();
        changed.dedup();
        let mut touched = Vec::new();
        let color_of = |cluster| {
            let color = schedule.color(cluster).map(|color| color.index());
            color.filter(|_| !schedule.constraints(cluster).is_empty())
        };
        // All clusters are removed before any is assigned, so that emptied groups can be reused.
        for &cluster in &changed {
            let Some(slot) = self.slot(cluster) else {
                continue;
            };
            touched.push(slot);
            let group = self.lanes.group(slot as usize / self.lanes.width());
            if color_of(cluster) != Some(group.color as usize) {
                self.lanes.release(cluster);
                self.clusters[slot as usize] = NONE;
                self.assigned -= 1;
            }
        }
        for &cluster in &changed {
            let Some(color) = color_of(cluster) else {
                continue;
            };
            if self.slot(cluster).is_none() {
                touched.push(self.assign(cluster, color));
            }
        }
        touched.sort_unstable();
        touched.dedup();
        touched
    }

    /// Assigns a slot to a cluster.
    fn assign(&mut self, cluster: ClusterId, color: usize) -> u32 {
        let groups = self.groups().row(color).iter().rev();
        let roomy = groups
            .map(|&group| group as usize)
            .find(|&group| self.lanes.has_room(group));
        let group = roomy.unwrap_or_else(|| self.lanes.open(color, 0).0);
        let slot = self.lanes.assign(cluster, group);
        let slots = self.lanes.group_count() * self.lanes.width();
        self.clusters.resize(slots, NONE);
        self.clusters[slot] = cluster.0;
        self.assigned += 1;
        index(slot)
    }
}

#[cfg(test)]
mod tests {
    use incise_graph::{Clustering, ColorId, Coloring};
    use proptest::prelude::*;

    use super::*;

    fn check(slots: &Slots, schedule: &Schedule) {
        let mut seen = 0;
        for color in 0..schedule.color_count() {
            for &cluster in schedule.clusters(color) {
                let slot = slots.slot(cluster).expect("every cluster has a slot");
                assert_eq!(slots.cluster(slot), Some(cluster));
                let group = index(slot as usize / slots.lanes.width());
                assert!(slots.groups().row(color).contains(&group));
                seen += 1;
            }
        }
        let taken = (0..slots.slot_count()).filter(|&s| slots.cluster(index(s)).is_some());
        assert_eq!(taken.count(), seen);
    }

    fn schedule(labels: &[u8], colors: &[u8]) -> (Clustering, Coloring) {
        let labels = labels.iter().map(|&l| ClusterId(u32::from(l))).collect();
        let clustering = Clustering::from_labels(labels).expect("labels are in range");
        let colors = (0..clustering.cluster_count()).map(|k| ColorId(u32::from(colors[k])));
        (clustering, Coloring::new(colors.collect()))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// After any change of a schedule, every cluster has a slot in a group of its color, and unchanged clusters
        /// keep theirs.
        #[test]
        fn slots_follow_a_schedule(
            width in prop::sample::select(vec![1usize, 2, 3, 64]),
            steps in prop::collection::vec(
                (prop::collection::vec((0..200usize, 0..40u8), 0..30),
                 prop::collection::vec((0..40usize, 0..5u8), 0..10)), 1..8),
        ) {
            let mut slots = Slots::new(width);
            let mut labels: Vec<u8> = (0..200).map(|c| c / 5).collect();
            let mut colors = vec![0; 40];
            let (clustering, coloring) = schedule(&labels, &colors);
            let mut now = Schedule::new(&clustering, &coloring);
            prop_assert_eq!(slots.sync(&now), Moved::All);
            check(&slots, &now);
            for (relabeled, recolored) in &steps {
                relabeled.iter().for_each(|&(c, label)| labels[c] = label);
                recolored.iter().for_each(|&(k, color)| colors[k] = color);
                let before: Vec<_> = (0..40).map(|k| slots.slot(ClusterId(k))).collect();
                let (clustering, coloring) = schedule(&labels, &colors);
                let constraints: Vec<u32> = (0..200).collect();
                let clusters: Vec<_> = (0..clustering.cluster_count()).map(ClusterId::new).collect();
                let revision = now.revision();
                now.update(&clustering, &coloring, &constraints, &clusters);
                let changed = now.changes_since(revision).map(<[_]>::to_vec);
                let moved = slots.sync(&now);
                check(&slots, &now);
                if let (Moved::Slots(touched), Some(changed)) = (moved, changed) {
                    for k in (0..40).map(ClusterId) {
                        let slot = slots.slot(k);
                        if changed.contains(&k) {
                            prop_assert!(slot.is_none_or(|slot| touched.contains(&slot)));
                        } else {
                            prop_assert_eq!(slot, before[k.index()]);
                        }
                    }
                }
            }
        }
    }
}
