//! [`Seats`]: which cluster is where on the device.
//!
//! A group of lanes is what a workgroup solves, and a slot of it a seat: a cluster has one as long as it has tets, and keeps
//! it while its color stays. Cost: O(changed clusters times groups of their colors / 64) for an update, O(clusters) to
//! make.

use incise_graph::{ClusterId, Lanes, Rows, Schedule};

/// No cluster.
const NONE: u32 = u32::MAX;

/// Groups of a color that may be empty beside half of all seats before all clusters are seated again.
const SPARE: usize = 2;

/// Which cluster is in which seat.
#[derive(Debug)]
pub(crate) struct Seats {
    lanes: Lanes,
    revision: Option<u64>,
    /// Seat -> cluster.
    clusters: Vec<u32>,
    /// Clusters that have a seat.
    seated: usize,
}

/// What changed.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Moved {
    /// Everything: whatever was known is void.
    All,
    /// What is in these seats, ascending.
    Seats(Vec<u32>),
}

impl Seats {
    /// For groups of so many seats, at most 64.
    pub(crate) fn new(width: usize) -> Self {
        Self {
            lanes: Lanes::new(width),
            revision: None,
            clusters: Vec::new(),
            seated: 0,
        }
    }

    pub(crate) fn seat_count(&self) -> usize {
        self.clusters.len()
    }

    pub(crate) fn color_count(&self) -> usize {
        self.lanes.color_count()
    }

    /// The groups of each color.
    pub(crate) fn groups(&self) -> &Rows<u32> {
        self.lanes.groups()
    }

    /// The cluster in a seat.
    pub(crate) fn cluster(&self, seat: u32) -> Option<ClusterId> {
        let cluster = self.clusters[seat as usize];
        (cluster != NONE).then_some(ClusterId(cluster))
    }

    /// The seat of a cluster.
    fn seat(&self, cluster: ClusterId) -> Option<u32> {
        let (group, lane) = self.lanes.slot(cluster)?;
        Some(index(group * self.lanes.width() + lane))
    }

    /// From now on nothing here is to be trusted.
    pub(crate) fn forget(&mut self) {
        self.revision = None;
    }

    /// Makes this the seats of a schedule.
    pub(crate) fn follow(&mut self, schedule: &Schedule) -> Moved {
        let changes = self.revision.and_then(|r| schedule.changes_since(r));
        let moved = changes.map(|changes| self.reseat(schedule, changes));
        self.revision = Some(schedule.revision());
        let spare = SPARE * self.color_count().max(1) * self.lanes.width();
        match moved {
            Some(seats) if self.seat_count() <= 2 * self.seated + spare => Moved::Seats(seats),
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
        self.seated = 0;
        for color in 0..schedule.color_count() {
            for &cluster in schedule.clusters(color) {
                self.sit(cluster, color);
            }
        }
    }

    fn reseat(&mut self, schedule: &Schedule, changes: &[ClusterId]) -> Vec<u32> {
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
        // All clusters leave before any is seated, so that emptied groups can be used again.
        for &cluster in &changed {
            let Some(seat) = self.seat(cluster) else {
                continue;
            };
            touched.push(seat);
            let group = self.lanes.group(seat as usize / self.lanes.width());
            if color_of(cluster) != Some(group.color as usize) {
                self.lanes.release(cluster);
                self.clusters[seat as usize] = NONE;
                self.seated -= 1;
            }
        }
        for &cluster in &changed {
            let Some(color) = color_of(cluster) else {
                continue;
            };
            if self.seat(cluster).is_none() {
                touched.push(self.sit(cluster, color));
            }
        }
        touched.sort_unstable();
        touched.dedup();
        touched
    }

    /// Gives a cluster a seat.
    fn sit(&mut self, cluster: ClusterId, color: usize) -> u32 {
        let groups = self.groups().row(color).iter().rev();
        let roomy = groups
            .map(|&group| group as usize)
            .find(|&group| self.lanes.has_room(group));
        let group = roomy.unwrap_or_else(|| self.lanes.open(color, 0).0);
        let seat = self.lanes.assign(cluster, group);
        let seats = self.lanes.group_count() * self.lanes.width();
        self.clusters.resize(seats, NONE);
        self.clusters[seat] = cluster.0;
        self.seated += 1;
        index(seat)
    }
}

fn index(value: usize) -> u32 {
    u32::try_from(value).expect("fewer than 2^32 seats")
}

#[cfg(test)]
mod tests {
    use incise_graph::{Clustering, ColorId, Coloring};
    use proptest::prelude::*;

    use super::*;

    fn check(seats: &Seats, schedule: &Schedule) {
        let mut seen = 0;
        for color in 0..schedule.color_count() {
            for &cluster in schedule.clusters(color) {
                let seat = seats.seat(cluster).expect("every cluster has a seat");
                assert_eq!(seats.cluster(seat), Some(cluster));
                let group = index(seat as usize / seats.lanes.width());
                assert!(seats.groups().row(color).contains(&group));
                seen += 1;
            }
        }
        let taken = (0..seats.seat_count()).filter(|&s| seats.cluster(index(s)).is_some());
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

        /// Whatever happens to a schedule, every cluster has a seat in a group of its color, and no other one moves.
        #[test]
        fn seats_follow_a_schedule(
            width in prop::sample::select(vec![1usize, 2, 3, 64]),
            steps in prop::collection::vec(
                (prop::collection::vec((0..200usize, 0..40u8), 0..30),
                 prop::collection::vec((0..40usize, 0..5u8), 0..10)), 1..8),
        ) {
            let mut seats = Seats::new(width);
            let mut labels: Vec<u8> = (0..200).map(|c| c / 5).collect();
            let mut colors = vec![0; 40];
            let (clustering, coloring) = schedule(&labels, &colors);
            let mut now = Schedule::new(&clustering, &coloring);
            prop_assert_eq!(seats.follow(&now), Moved::All);
            check(&seats, &now);
            for (relabeled, recolored) in &steps {
                relabeled.iter().for_each(|&(c, label)| labels[c] = label);
                recolored.iter().for_each(|&(k, color)| colors[k] = color);
                let before: Vec<_> = (0..40).map(|k| seats.seat(ClusterId(k))).collect();
                let (clustering, coloring) = schedule(&labels, &colors);
                let constraints: Vec<u32> = (0..200).collect();
                let clusters: Vec<_> = (0..clustering.cluster_count()).map(ClusterId::new).collect();
                let revision = now.revision();
                now.update(&clustering, &coloring, &constraints, &clusters);
                let changed = now.changes_since(revision).map(<[_]>::to_vec);
                let moved = seats.follow(&now);
                check(&seats, &now);
                if let (Moved::Seats(touched), Some(changed)) = (moved, changed) {
                    for k in (0..40).map(ClusterId) {
                        let seat = seats.seat(k);
                        if changed.contains(&k) {
                            prop_assert!(seat.is_none_or(|seat| touched.contains(&seat)));
                        } else {
                            prop_assert_eq!(seat, before[k.index()]);
                        }
                    }
                }
            }
        }
    }
}
