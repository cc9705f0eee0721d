//! [`Incidence`]: the particles of each constraint, and the constraints on each particle.
//!
//! This is the input of all other stages. Both directions are flat arrays, because building the
//! constraint graph and checking a schedule walk constraint -> particle -> constraint. Conflicts
//! are defined only here: two constraints conflict if and only if they share a particle.
//!
//! Cost of construction: O(particles + entries), two counting passes and a stamp array.

use std::borrow::Borrow;

use crate::csr::{Csr, fits};
use crate::{Clustering, GraphError};

/// Constraints as lists of particles, with the reverse lists.
///
/// A constraint may have any arity, also 0 (the slot of a removed constraint). Equality compares
/// both lists.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Incidence {
    particles_of: Csr,
    constraints_of: Csr,
}

impl Incidence {
    /// Takes constraints in CSR form: constraint `c` touches `values[offsets[c]..offsets[c + 1]]`.
    ///
    /// The order of the particles within a constraint is kept. O(particles + values).
    ///
    /// # Errors
    /// Offsets that do not start at 0, go down or end elsewhere than at `values.len()`; a particle
    /// not below `particles`; a constraint that names a particle twice; more than `u32::MAX`
    /// particles or values.
    ///
    /// ```
    /// use incise_graph::Incidence;
    ///
    /// // A triangle and a spring on four particles.
    /// let incidence = Incidence::new(4, vec![0, 3, 5], vec![2, 0, 1, 2, 3])?;
    /// assert_eq!(incidence.particles_of(0), [2, 0, 1]);
    /// assert_eq!(incidence.constraints_of(2), [0, 1]);
    /// # Ok::<(), incise_graph::GraphError>(())
    /// ```
    pub fn new(particles: usize, offsets: Vec<u32>, values: Vec<u32>) -> Result<Self, GraphError> {
        fits("particles", particles)?;
        fits("constraints", offsets.len())?;
        fits("constraint-particle pairs", values.len())?;
        let particles_of = Csr::new(offsets, values)?;
        let mut seen_by = vec![usize::MAX; particles];
        for (constraint, row) in particles_of.rows().enumerate() {
            for &particle in row {
                match seen_by.get_mut(particle as usize) {
                    None => {
                        return Err(GraphError::ParticleOutOfRange {
                            constraint,
                            particle,
                            particles,
                        });
                    }
                    Some(last) if *last == constraint => {
                        return Err(GraphError::RepeatedParticle {
                            constraint,
                            particle,
                        });
                    }
                    Some(last) => *last = constraint,
                }
            }
        }
        let constraints_of = particles_of.transpose(particles);
        Ok(Self {
            particles_of,
            constraints_of,
        })
    }

    /// Builds an incidence from an iterator over slices of particle numbers, by value or by reference: from a
    /// `Vec<[u32; 4]>`, a `&[[u32; 2]]`, a `&[Vec<u32>]` or a `&[&[u32]]`. O(particles + entries).
    ///
    /// # Errors
    /// A particle not below `particles`; a constraint that names a particle twice; more than
    /// `u32::MAX` particles or entries.
    ///
    /// ```
    /// use incise_graph::Incidence;
    ///
    /// let tets = [[0u32, 1, 2, 3], [1, 2, 3, 4]];
    /// let incidence = Incidence::from_constraints(5, tets)?;
    /// assert_eq!(incidence.clique_bound(), 2);
    ///
    /// let rods: &[Vec<u32>] = &[vec![0, 1, 2], vec![2, 3]];
    /// assert_eq!(Incidence::from_constraints(4, rods)?.particles_of(1), [2, 3]);
    ///
    /// let mixed: [&[u32]; 2] = [&tets[0], &rods[1]];
    /// assert_eq!(Incidence::from_constraints(4, &mixed)?.particles_of(1), [2, 3]);
    /// # Ok::<(), incise_graph::GraphError>(())
    /// ```
    pub fn from_constraints<P: Borrow<u32>>(
        particles: usize,
        constraints: impl IntoIterator<Item = impl AsRef<[P]>>,
    ) -> Result<Self, GraphError> {
        let mut offsets = vec![0];
        let mut values = Vec::new();
        for constraint in constraints {
            values.extend(
                constraint
                    .as_ref()
                    .iter()
                    .map(|particle| *particle.borrow()),
            );
            let end = u32::try_from(values.len()).map_err(|_| GraphError::TooMany {
                what: "constraint-particle pairs",
                count: values.len(),
            })?;
            offsets.push(end);
        }
        Self::new(particles, offsets, values)
    }

    /// The number of constraints.
    #[must_use]
    pub fn constraint_count(&self) -> usize {
        self.particles_of.row_count()
    }

    /// The number of particles, including those without a constraint.
    #[must_use]
    pub fn particle_count(&self) -> usize {
        self.constraints_of.row_count()
    }

    /// The particles of constraint `c`, in the order given.
    ///
    /// # Panics
    /// If there is no constraint `c`.
    #[must_use]
    pub fn particles_of(&self, c: usize) -> &[u32] {
        self.particles_of.row(c)
    }

    /// The constraints on particle `p`, ascending.
    ///
    /// # Panics
    /// If there is no particle `p`.
    #[must_use]
    pub fn constraints_of(&self, p: usize) -> &[u32] {
        self.constraints_of.row(p)
    }

    /// The largest number of constraints on one particle.
    ///
    /// These constraints all conflict (a clique), so no coloring of the unclustered graph has fewer
    /// colors. O(particles).
    #[must_use]
    pub fn clique_bound(&self) -> usize {
        self.constraints_of
            .rows()
            .map(<[u32]>::len)
            .max()
            .unwrap_or(0)
    }

    /// The incidence of the clusters: row `k` lists, ascending and once each, the particles of the
    /// members of cluster `k`. Vacant clusters get an empty row; constraints in no cluster are left
    /// out.
    ///
    /// Two clusters conflict exactly if their rows share a particle, and
    /// [`clique_bound`](Self::clique_bound) of the result bounds the colors of the clustered graph.
    /// O(entries log arity).
    ///
    /// # Panics
    /// If `clustering` has another number of constraints.
    #[must_use]
    pub fn quotient(&self, clustering: &Clustering) -> Self {
        assert_eq!(
            clustering.constraint_count(),
            self.constraint_count(),
            "one label per constraint"
        );
        let members = clustering.members();
        let mut particles_of = Csr::with_rows(members.count());
        for cluster in members.iter() {
            let start = particles_of.values.len();
            for &c in cluster {
                particles_of
                    .values
                    .extend_from_slice(self.particles_of(c as usize));
            }
            let row = &mut particles_of.values[start..];
            row.sort_unstable();
            let kept = compact_sorted(row);
            particles_of.values.truncate(start + kept);
            particles_of.end_row();
        }
        let constraints_of = particles_of.transpose(self.particle_count());
        Self {
            particles_of,
            constraints_of,
        }
    }

    /// The raw offsets of constraint -> particles, one more than there are constraints.
    #[must_use]
    pub fn offsets(&self) -> &[u32] {
        &self.particles_of.offsets
    }

    /// The raw values of constraint -> particles.
    #[must_use]
    pub fn values(&self) -> &[u32] {
        &self.particles_of.values
    }
}

/// Moves the distinct values of a sorted row to its front and returns their number.
fn compact_sorted(row: &mut [u32]) -> usize {
    let mut kept = 0;
    for i in 0..row.len() {
        if kept == 0 || row[i] != row[kept - 1] {
            row[kept] = row[i];
            kept += 1;
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ClusterId;

    #[test]
    fn both_directions_agree() {
        let incidence =
            Incidence::from_constraints(5, [vec![0u32, 1, 2], vec![], vec![4, 2]]).unwrap();
        assert_eq!(incidence.constraint_count(), 3);
        assert_eq!(incidence.particle_count(), 5);
        assert_eq!(incidence.particles_of(2), [4, 2]);
        assert_eq!(incidence.constraints_of(2), [0, 2]);
        assert_eq!(incidence.constraints_of(3), [0u32; 0]);
        assert_eq!(incidence.clique_bound(), 2);
    }

    #[test]
    fn refuses_broken_input() {
        let refuse = |offsets: &[u32], values: &[u32]| {
            Incidence::new(3, offsets.to_vec(), values.to_vec()).unwrap_err()
        };
        assert_eq!(refuse(&[], &[]), GraphError::OffsetsStart);
        assert_eq!(refuse(&[1, 1], &[0]), GraphError::OffsetsStart);
        assert_eq!(
            refuse(&[0, 2, 1], &[0]),
            GraphError::OffsetsDecrease {
                row: 1,
                before: 2,
                after: 1
            }
        );
        assert_eq!(
            refuse(&[0, 1], &[0, 1]),
            GraphError::OffsetsEnd { last: 1, values: 2 }
        );
        assert_eq!(
            refuse(&[0, 1, 2], &[0, 3]),
            GraphError::ParticleOutOfRange {
                constraint: 1,
                particle: 3,
                particles: 3
            }
        );
        assert_eq!(
            refuse(&[0, 3], &[0, 1, 0]),
            GraphError::RepeatedParticle {
                constraint: 0,
                particle: 0
            }
        );
    }

    #[test]
    fn nothing_is_valid() {
        let incidence = Incidence::new(0, vec![0], vec![]).unwrap();
        assert_eq!(
            (
                incidence.constraint_count(),
                incidence.particle_count(),
                incidence.clique_bound()
            ),
            (0, 0, 0)
        );
    }

    #[test]
    fn quotient_merges_particles() {
        let incidence =
            Incidence::from_constraints(4, [[3u32, 0], [0, 1], [1, 2], [2, 3]]).unwrap();
        let clustering = Clustering::from_labels([0, 0, 3, 3].map(ClusterId).to_vec()).unwrap();
        let clusters = incidence.quotient(&clustering);
        assert_eq!(clusters.constraint_count(), 4);
        assert_eq!(clusters.particles_of(0), [0, 1, 3]);
        assert_eq!(clusters.particles_of(1), [0u32; 0]);
        assert_eq!(clusters.particles_of(3), [1, 2, 3]);
        assert_eq!(clusters.constraints_of(3), [0, 3]);
    }
}
