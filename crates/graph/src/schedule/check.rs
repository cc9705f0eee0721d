//! The checks of a schedule: no two clusters of a color conflict, and it matches its clustering and coloring.
//!
//! Both look at the stored order and share no code with its construction. Cost: one pass over all arrays.

use super::Schedule;
use crate::{ClusterId, Clustering, ColorId, Coloring, GraphError, Incidence};

impl Schedule {
    /// Checks that the schedule solves every constraint once and that clusters of one color share no particle.
    /// O(entries).
    ///
    /// A constraint without particles may be missing: its number is that of a removed constraint.
    ///
    /// # Errors
    /// A constraint that is unknown, missing or repeated; two clusters of one color on one particle.
    pub fn check(&self, incidence: &Incidence) -> Result<(), GraphError> {
        each_once("schedule", self.order(), incidence)?;
        // The last cluster and color at each particle.
        let mut touched = vec![(ClusterId::NONE, usize::MAX); incidence.particle_count()];
        for color in 0..self.color_count() {
            for &cluster in self.clusters(color) {
                for &constraint in self.constraints(cluster) {
                    for &particle in incidence.particles_of(constraint as usize) {
                        let last = &mut touched[particle as usize];
                        if last.1 == color && last.0 != cluster {
                            return Err(GraphError::ClustersCollide {
                                first: last.0,
                                second: cluster,
                                color: ColorId::new(color),
                                particle,
                            });
                        }
                        *last = (cluster, color);
                    }
                }
            }
        }
        Ok(())
    }

    /// Checks that the schedule matches a clustering and a coloring, after any edits. O(constraints + clusters +
    /// colors).
    ///
    /// # Errors
    ///
    /// A cluster whose members or color differ.
    pub fn check_partition(
        &self,
        clustering: &Clustering,
        coloring: &Coloring,
    ) -> Result<(), GraphError> {
        let members = clustering.members();
        let mut occupied = 0;
        for (k, members) in members.iter().enumerate() {
            let cluster = ClusterId::new(k);
            let color = (!members.is_empty()).then(|| coloring.color(k));
            occupied += usize::from(color.is_some());
            let is_listed = color.is_none_or(|color| {
                let position = self.slots[k].position as usize;
                let clusters = self.colors.rows().nth(color.index()).unwrap_or(&[]);
                clusters.get(position) == Some(&cluster)
            });
            if self.constraints(cluster) != members || self.color(cluster) != color || !is_listed {
                return Err(GraphError::Misplaced { cluster });
            }
        }
        // Each was found at a distinct position, so there are no others.
        let labels = clustering.labels().iter();
        let labels = labels.copied().chain(std::iter::repeat(ClusterId::NONE));
        let labeled = self
            .labels
            .iter()
            .copied()
            .eq(labels.take(self.labels.len()));
        if self.cluster_count() == occupied && labeled {
            Ok(())
        } else {
            Err(GraphError::Length {
                what: "schedule",
                expected: occupied,
                found: self.cluster_count(),
            })
        }
    }
}

/// An error unless `order` lists every constraint once; constraints without particles may be missing.
fn each_once(
    what: &'static str,
    order: impl Iterator<Item = u32>,
    incidence: &Incidence,
) -> Result<(), GraphError> {
    let constraints = incidence.constraint_count();
    let mut scheduled = vec![false; constraints];
    for constraint in order {
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
