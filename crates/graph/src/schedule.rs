//! The order a solver walks: color after color, in a color cluster beside cluster, in a cluster
//! constraint after constraint.
//!
//! Everything a solver needs in its inner loop is in three flat arrays, made by two counting sorts:
//! clusters by color, then constraints by cluster. A *slot* is the place of a cluster in that
//! order; slots of one color are contiguous, and so are the constraints of one color. Vacant
//! clusters get no slot. Cost: O(constraints + clusters + colors), and no allocation once the
//! arrays have grown.

use std::ops::Range;

use crate::csr::{accumulate, offset};
use crate::{ClusterId, Clustering, ColorId, Coloring, GraphError, Incidence};

/// Color -> clusters -> constraints in solving order. The example is in the [crate
/// documentation](crate).
#[derive(Clone, Debug)]
pub struct Schedule {
    /// Color -> slots.
    color_offsets: Vec<u32>,
    /// Slot -> cluster.
    clusters: Vec<ClusterId>,
    /// Slot -> constraints.
    slot_offsets: Vec<u32>,
    order: Vec<u32>,
    /// Work: where the next cluster of a color, then the next constraint of a cluster, goes.
    cursor: Vec<u32>,
}

/// Two schedules are equal if they solve the same constraints in the same order; work arrays do not
/// count.
impl PartialEq for Schedule {
    fn eq(&self, other: &Self) -> bool {
        self.color_offsets == other.color_offsets
            && self.clusters == other.clusters
            && self.slot_offsets == other.slot_offsets
            && self.order == other.order
    }
}

impl Eq for Schedule {}

impl Default for Schedule {
    /// The schedule of nothing, to [`rebuild`](Self::rebuild).
    fn default() -> Self {
        Self {
            color_offsets: vec![0],
            clusters: Vec::new(),
            slot_offsets: vec![0],
            order: Vec::new(),
            cursor: Vec::new(),
        }
    }
}

impl Schedule {
    /// The schedule of a clustering whose clusters are colored; `coloring.color(k)` is the color of
    /// cluster `k`.
    ///
    /// Without clusters, pass [`Clustering::none`]. Clusters of one color ascend, and so do the
    /// constraints of a cluster. The coloring is taken as it is; [`check`](Self::check) proves the
    /// result.
    ///
    /// # Panics
    /// If there is not one color per cluster number.
    #[must_use]
    pub fn new(clustering: &Clustering, coloring: &Coloring) -> Self {
        let mut schedule = Self::default();
        schedule.rebuild(clustering, coloring);
        schedule
    }

    /// Replaces the schedule, using its arrays again. O(constraints + clusters + colors).
    ///
    /// # Panics
    /// If there is not one color per cluster number.
    pub fn rebuild(&mut self, clustering: &Clustering, coloring: &Coloring) {
        assert_eq!(
            coloring.vertex_count(),
            clustering.cluster_count(),
            "one color per cluster number"
        );
        self.sort_clusters(clustering, coloring);
        self.sort_constraints(clustering);
    }

    /// Clusters by color. Colors that only vacant clusters have are not counted.
    fn sort_clusters(&mut self, clustering: &Clustering, coloring: &Coloring) {
        let occupied = || {
            let ids = (0..).map(ClusterId);
            ids.zip(coloring.colors())
                .zip(clustering.sizes())
                .filter(|(_, size)| **size > 0)
                .map(|(pair, _)| pair)
        };
        let colors = occupied()
            .map(|(_, color)| color.index() + 1)
            .max()
            .unwrap_or(0);
        self.color_offsets.clear();
        self.color_offsets.resize(colors + 1, 0);
        for (_, color) in occupied() {
            self.color_offsets[color.index() + 1] += 1;
        }
        accumulate(&mut self.color_offsets);
        self.cursor.clear();
        self.cursor.extend_from_slice(&self.color_offsets);
        self.clusters.clear();
        self.clusters.resize(clustering.occupied(), ClusterId::NONE);
        for (cluster, color) in occupied() {
            let place = &mut self.cursor[color.index()];
            self.clusters[*place as usize] = cluster;
            *place += 1;
        }
    }

    /// Constraints by cluster, in the order of the slots.
    fn sort_constraints(&mut self, clustering: &Clustering) {
        self.cursor.clear();
        self.cursor.resize(clustering.cluster_count(), 0);
        self.slot_offsets.clear();
        self.slot_offsets.push(0);
        let mut end = 0;
        for &cluster in &self.clusters {
            self.cursor[cluster.index()] = end;
            end = offset(end as usize + clustering.size(cluster));
            self.slot_offsets.push(end);
        }
        self.order.clear();
        self.order.resize(end as usize, 0);
        for (constraint, label) in (0..).zip(clustering.labels()) {
            if *label != ClusterId::NONE {
                let place = &mut self.cursor[label.index()];
                self.order[*place as usize] = constraint;
                *place += 1;
            }
        }
    }

    /// The number of colors: the parallel steps of one sweep.
    #[must_use]
    pub fn color_count(&self) -> usize {
        self.color_offsets.len() - 1
    }

    /// The number of slots: the clusters that have a constraint.
    #[must_use]
    pub fn cluster_count(&self) -> usize {
        self.clusters.len()
    }

    /// The slots of one color, which may run at the same time.
    ///
    /// # Panics
    /// If there is no such color.
    #[must_use]
    pub fn clusters(&self, color: usize) -> Range<usize> {
        self.color_offsets[color] as usize..self.color_offsets[color + 1] as usize
    }

    /// The constraints in one slot, ascending, to be solved one after the other.
    ///
    /// # Panics
    /// If there is no such slot.
    #[must_use]
    pub fn constraints(&self, slot: usize) -> &[u32] {
        &self.order[self.slot_offsets[slot] as usize..self.slot_offsets[slot + 1] as usize]
    }

    /// The cluster in one slot.
    ///
    /// # Panics
    /// If there is no such slot.
    #[must_use]
    pub fn cluster(&self, slot: usize) -> ClusterId {
        self.clusters[slot]
    }

    /// All constraints in solving order.
    #[must_use]
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// The constraints of one color, slot after slot.
    ///
    /// # Panics
    /// If there is no such color.
    #[must_use]
    pub fn color_constraints(&self, color: usize) -> &[u32] {
        let slots = self.clusters(color);
        &self.order[self.slot_offsets[slots.start] as usize..self.slot_offsets[slots.end] as usize]
    }

    /// The raw offsets of color -> slots, one more than there are colors.
    #[must_use]
    pub fn color_offsets(&self) -> &[u32] {
        &self.color_offsets
    }

    /// The raw offsets of slot -> constraints into [`order`](Self::order), one more than there are
    /// slots.
    #[must_use]
    pub fn slot_offsets(&self) -> &[u32] {
        &self.slot_offsets
    }

    /// Proves that the schedule solves everything once and that nothing that runs together shares a
    /// particle. O(entries).
    ///
    /// A constraint without particles may be missing: that is the slot of a removed constraint.
    ///
    /// # Errors
    /// A constraint that is unknown, missing or there twice; two clusters of one color on one
    /// particle.
    pub fn check(&self, incidence: &Incidence) -> Result<(), GraphError> {
        each_once("schedule", &self.order, incidence)?;
        // The last slot and color that touched each particle.
        let mut touched = vec![(usize::MAX, usize::MAX); incidence.particle_count()];
        for color in 0..self.color_count() {
            for slot in self.clusters(color) {
                for &constraint in self.constraints(slot) {
                    for &particle in incidence.particles_of(constraint as usize) {
                        let last = &mut touched[particle as usize];
                        if last.1 == color && last.0 != slot {
                            return Err(GraphError::ClustersCollide {
                                first: self.clusters[last.0],
                                second: self.clusters[slot],
                                color: ColorId::new(color),
                                particle,
                            });
                        }
                        *last = (slot, color);
                    }
                }
            }
        }
        Ok(())
    }
}

/// An error unless `order` lists every constraint once; those without particles may be missing.
pub(crate) fn each_once(
    what: &'static str,
    order: &[u32],
    incidence: &Incidence,
) -> Result<(), GraphError> {
    let constraints = incidence.constraint_count();
    let mut scheduled = vec![false; constraints];
    for &constraint in order {
        match scheduled.get_mut(constraint as usize) {
            None => {
                return Err(GraphError::Length {
                    what,
                    expected: constraints,
                    found: constraint as usize + 1,
                });
            }
            Some(true) => return Err(GraphError::ScheduledTwice { constraint }),
            Some(seen) => *seen = true,
        }
    }
    let missing = |c: &usize| !scheduled[*c] && !incidence.particles_of(*c).is_empty();
    match (0..constraints).find(missing) {
        Some(constraint) => Err(GraphError::Unscheduled { constraint }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn coloring(colors: &[u32]) -> Coloring {
        Coloring::new(colors.iter().copied().map(ColorId).collect())
    }

    /// Five springs in a row; clusters {0, 1}, {}, {3, 4}, {2}.
    fn row() -> (Incidence, Clustering) {
        let springs = Incidence::from_constraints(6, (0u32..5).map(|i| [i, i + 1])).unwrap();
        let clustering = Clustering::from_labels([0, 0, 3, 2, 2].map(ClusterId).to_vec()).unwrap();
        (springs, clustering)
    }

    #[test]
    fn vacant_clusters_and_their_colors_are_skipped() {
        let (springs, clustering) = row();
        let schedule = Schedule::new(&clustering, &coloring(&[1, 9, 1, 0]));
        schedule.check(&springs).unwrap();
        assert_eq!((schedule.color_count(), schedule.cluster_count()), (2, 3));
        assert_eq!(schedule.order(), [2, 0, 1, 3, 4]);
        assert_eq!(schedule.clusters(1), 1..3);
        assert_eq!(
            (schedule.cluster(0), schedule.cluster(2)),
            (ClusterId(3), ClusterId(2))
        );
        assert_eq!(schedule.constraints(2), [3, 4]);
        assert_eq!(schedule.color_constraints(1), [0, 1, 3, 4]);
    }

    #[test]
    fn rebuilding_equals_building() {
        let (_, clustering) = row();
        let mut schedule = Schedule::new(&Clustering::none(9), &coloring(&[0; 9]));
        let colors = coloring(&[1, 0, 1, 0]);
        schedule.rebuild(&clustering, &colors);
        assert_eq!(schedule, Schedule::new(&clustering, &colors));
        schedule.rebuild(&Clustering::none(0), &coloring(&[]));
        assert_eq!(schedule, Schedule::default());
        assert_eq!(schedule.color_count(), 0);
    }

    #[test]
    fn check_refuses_collisions_and_omissions() {
        let (springs, mut clustering) = row();
        let collision = Schedule::new(&clustering, &coloring(&[0, 0, 1, 1]))
            .check(&springs)
            .unwrap_err();
        let (first, second) = (ClusterId(2), ClusterId(3));
        assert_eq!(
            collision,
            GraphError::ClustersCollide {
                first,
                second,
                color: ColorId(1),
                particle: 3
            }
        );
        let colors = coloring(&[1, 0, 1, 0]);
        clustering.remove(1);
        assert_eq!(
            Schedule::new(&clustering, &colors).check(&springs),
            Err(GraphError::Unscheduled { constraint: 1 })
        );
        let mut twice = Schedule::new(&clustering, &colors);
        twice.order[0] = twice.order[1];
        assert!(matches!(
            twice.check(&springs),
            Err(GraphError::ScheduledTwice { .. })
        ));
        let mut foreign = Schedule::new(&clustering, &colors);
        foreign.order[0] = 7;
        assert!(matches!(
            foreign.check(&springs),
            Err(GraphError::Length { .. })
        ));
    }
}
