//! [`Seats`]: which cluster is where on the device.
//!
//! A group is what a workgroup solves: so many seats, all of one color. A cluster has a seat as long as it has tets and
//! keeps it while its color stays, so that what a cut does not touch does not move. A group whose seats are all empty
//! goes to whatever color needs one next. Cost: O(changed clusters times groups of their colors / 64) for an update,
//! O(clusters) to make.

use incise_graph::{ClusterId, Rows, Schedule};

/// No seat, no group, no color.
const NONE: u32 = u32::MAX;

/// Groups of a color that may be empty beside half of all seats before all clusters are seated again.
const SPARE: usize = 2;

/// Which cluster is in which seat.
#[derive(Debug)]
pub(crate) struct Seats {
    /// Seats of a group, at most 64.
    width: usize,
    revision: Option<u64>,
    /// Color -> groups.
    colors: Rows<u32>,
    groups: Vec<Group>,
    /// Groups without color.
    free: Vec<u32>,
    /// Cluster -> seat.
    seats: Vec<u32>,
    /// Seat -> cluster.
    clusters: Vec<u32>,
    /// Clusters that have a seat.
    seated: usize,
}

#[derive(Clone, Copy, Debug)]
struct Group {
    color: u32,
    /// Its place among the groups of its color.
    place: u32,
    /// A bit for each seat that is taken.
    taken: u64,
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
    /// For groups of so many seats.
    pub(crate) fn new(width: usize) -> Self {
        assert!(
            (1..=64).contains(&width),
            "a word holds the seats of a group"
        );
        Self {
            width,
            revision: None,
            colors: Rows::default(),
            groups: Vec::new(),
            free: Vec::new(),
            seats: Vec::new(),
            clusters: Vec::new(),
            seated: 0,
        }
    }

    #[cfg(test)]
    pub(crate) fn group_count(&self) -> usize {
        self.groups.len()
    }

    pub(crate) fn seat_count(&self) -> usize {
        self.clusters.len()
    }

    pub(crate) fn color_count(&self) -> usize {
        self.colors.row_count()
    }

    /// The groups of each color.
    pub(crate) fn groups(&self) -> &Rows<u32> {
        &self.colors
    }

    /// The cluster in a seat.
    pub(crate) fn cluster(&self, seat: u32) -> Option<ClusterId> {
        let cluster = self.clusters[seat as usize];
        (cluster != NONE).then_some(ClusterId(cluster))
    }

    /// The seat of a cluster.
    #[cfg(test)]
    pub(crate) fn seat(&self, cluster: ClusterId) -> Option<u32> {
        let seat = self.seats.get(cluster.index()).copied();
        seat.filter(|&seat| seat != NONE)
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
        let spare = SPARE * self.color_count().max(1) * self.width;
        match moved {
            Some(seats) if self.seat_count() <= 2 * self.seated + spare => Moved::Seats(seats),
            _ => {
                self.rebuild(schedule);
                Moved::All
            }
        }
    }

    fn rebuild(&mut self, schedule: &Schedule) {
        self.colors
            .refill(schedule.color_count(), std::iter::empty());
        self.groups.clear();
        self.free.clear();
        self.seats.clear();
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
            self.colors.set_row_count(schedule.color_count());
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
            let Some(&seat) = self
                .seats
                .get(cluster.index())
                .filter(|&&seat| seat != NONE)
            else {
                continue;
            };
            touched.push(seat);
            let here = self.groups[seat as usize / self.width].color as usize;
            if color_of(cluster) != Some(here) {
                self.leave(cluster, seat);
            }
        }
        for &cluster in &changed {
            let Some(color) = color_of(cluster) else {
                continue;
            };
            if self
                .seats
                .get(cluster.index())
                .is_none_or(|&seat| seat == NONE)
            {
                touched.push(self.sit(cluster, color));
            }
        }
        touched.sort_unstable();
        touched.dedup();
        touched
    }

    /// Gives a cluster a seat.
    fn sit(&mut self, cluster: ClusterId, color: usize) -> u32 {
        let all = u64::MAX >> (64 - self.width);
        let groups = self.colors.row(color).iter().rev();
        let roomy = groups
            .copied()
            .find(|&g| self.groups[g as usize].taken != all);
        let group = roomy.unwrap_or_else(|| self.open(color));
        let taken = &mut self.groups[group as usize].taken;
        let lane = taken.trailing_ones() as usize;
        *taken |= 1 << lane;
        let seat = index(group as usize * self.width + lane);
        if self.seats.len() <= cluster.index() {
            self.seats.resize(cluster.index() + 1, NONE);
        }
        self.seats[cluster.index()] = seat;
        self.clusters[seat as usize] = cluster.0;
        self.seated += 1;
        seat
    }

    /// Adds a group to a color.
    fn open(&mut self, color: usize) -> u32 {
        let group = Group {
            color: index(color),
            place: index(self.colors.row(color).len()),
            taken: 0,
        };
        let number = match self.free.pop() {
            Some(number) => {
                self.groups[number as usize] = group;
                number
            }
            None => {
                self.groups.push(group);
                let seats = self.groups.len() * self.width;
                self.clusters.resize(seats, NONE);
                index(self.groups.len() - 1)
            }
        };
        self.colors.push(color, number);
        number
    }

    /// Takes its seat from a cluster.
    fn leave(&mut self, cluster: ClusterId, seat: u32) {
        self.seats[cluster.index()] = NONE;
        self.clusters[seat as usize] = NONE;
        self.seated -= 1;
        let number = seat as usize / self.width;
        let group = &mut self.groups[number];
        group.taken &= !(1 << (seat as usize % self.width));
        if group.taken == 0 {
            let Group { color, place, .. } = *group;
            group.color = NONE;
            self.colors.swap_remove(color as usize, place as usize);
            if let Some(&other) = self.colors.row(color as usize).get(place as usize) {
                self.groups[other as usize].place = place;
            }
            self.free.push(index(number));
        }
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
                let group = index(seat as usize / seats.width);
                assert!(seats.groups().row(color).contains(&group));
                seen += 1;
            }
        }
        let taken = (0..seats.seat_count()).filter(|&s| seats.cluster(index(s)).is_some());
        assert_eq!(taken.count(), seen);
        let mut groups: Vec<u32> = seats.colors.rows().flatten().copied().collect();
        groups.sort_unstable();
        let used = groups.len();
        groups.dedup();
        assert_eq!(groups.len(), used, "a group has one color");
        assert_eq!(used + seats.free.len(), seats.group_count());
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
