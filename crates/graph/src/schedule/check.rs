//! The proofs of a schedule: that nothing in it collides, and that it is that of its clusters and colors.
//!
//! Both look at what is there and share nothing with how it came about. Cost: one pass over everything.

use super::Schedule;
use crate::{ClusterId, Clustering, ColorId, Coloring, GraphError, Incidence};

impl Schedule {
    /// Proves that the schedule solves everything once and that nothing that runs together shares a
    /// particle. O(entries).
    ///
    /// A constraint without particles may be missing: that is the number of a removed constraint.
    ///
    /// # Errors
    /// A constraint that is unknown, missing or there twice; two clusters of one color on one
    /// particle.
    pub fn check(&self, incidence: &Incidence) -> Result<(), GraphError> {
        each_once("schedule", self.order(), incidence)?;
        // The last cluster and color that touched each particle.
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

    /// Proves that the schedule is that of a clustering and a coloring, whatever edits it went
    /// through. O(constraints + clusters + colors).
    ///
    /// # Errors
    /// A cluster that has other members or another color here than there.
    pub fn check_plan(
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
            let seated = color.is_none_or(|color| {
                let position = self.slots[k].position as usize;
                let clusters = self.colors.rows().nth(color.index()).unwrap_or(&[]);
                clusters.get(position) == Some(&cluster)
            });
            if self.constraints(cluster) != members || self.color(cluster) != color || !seated {
                return Err(GraphError::Misplaced { cluster });
            }
        }
        // Each was found at a position of its own, so nothing else is there.
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

/// An error unless `order` lists every constraint once; those without particles may be missing.
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
