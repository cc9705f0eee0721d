//! [`Clustering`]: the partition of constraints into blocks whose members are solved one after the other.
//!
//! A clustering is a label per constraint. Cutting edits it locally: the constraint of a removed element leaves its
//! cluster, the constraints of the new elements form new clusters, all other clusters stay (paper section 4.3). Each
//! such edit is O(1). The number of a cluster that lost its last member is reused, the latest first, so that numbers
//! stay dense in long scenes and per-cluster arrays stay small.

use crate::csr::offset;
use crate::{Classes, ClusterId, GraphError};

/// A partition of the constraints `0..constraint_count()` into clusters, minus those that were
/// removed.
///
/// Invariant: a cluster number is *vacant* (available for reuse) exactly if its cluster has no member, so there are
/// never more numbers than there were constraints at once.
///
/// ```
/// use incise_graph::Clustering;
///
/// let mut clustering = Clustering::none(3);
/// // A cut: constraint 1 goes; its slot is used again, and constraint 3 is appended, as one cluster.
/// let old = clustering.remove(1);
/// let new = clustering.new_cluster(1);
/// clustering.assign(3, new);
/// assert_eq!(Some(new), old, "the vacated number is used first");
/// assert_eq!(clustering.size(new), 2);
/// clustering.check()?;
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Clustering {
    labels: Vec<ClusterId>,
    sizes: Vec<u32>,
    /// Numbers of empty clusters; the last is used next.
    vacant: Vec<ClusterId>,
}

impl Clustering {
    /// A clustering in which each of `constraints` constraints is alone in the cluster of its own number.
    /// O(constraints).
    ///
    /// # Panics
    /// If the numbers do not fit in 32 bits.
    #[must_use]
    pub fn none(constraints: usize) -> Self {
        Self {
            labels: (0..offset(constraints)).map(ClusterId).collect(),
            sizes: vec![1; constraints],
            vacant: Vec::new(),
        }
    }

    /// The clustering with the given label per constraint; [`ClusterId::NONE`] for one in no
    /// cluster.
    ///
    /// Numbers below the largest label that no constraint has are vacant; the smallest is reused first.
    /// O(labels).
    ///
    /// # Errors
    /// A label that is not below the number of constraints.
    pub fn from_labels(labels: Vec<ClusterId>) -> Result<Self, GraphError> {
        let constraints = labels.len();
        let mut sizes = Vec::new();
        for (constraint, &cluster) in labels.iter().enumerate() {
            if cluster == ClusterId::NONE {
                continue;
            }
            if cluster.index() >= constraints {
                return Err(GraphError::LabelOutOfRange {
                    constraint,
                    cluster,
                    constraints,
                });
            }
            if cluster.index() >= sizes.len() {
                sizes.resize(cluster.index() + 1, 0);
            }
            sizes[cluster.index()] += 1;
        }
        let vacant = (0..sizes.len())
            .rev()
            .filter(|&k| sizes[k] == 0)
            .map(ClusterId::new)
            .collect();
        Ok(Self {
            labels,
            sizes,
            vacant,
        })
    }

    /// The number of constraint numbers in use, removed ones included.
    #[must_use]
    pub fn constraint_count(&self) -> usize {
        self.labels.len()
    }

    /// The number of cluster numbers in use, vacant ones included: the length of a per-cluster
    /// array.
    #[must_use]
    pub fn cluster_count(&self) -> usize {
        self.sizes.len()
    }

    /// The number of clusters with at least one member.
    #[must_use]
    pub fn occupied(&self) -> usize {
        self.sizes.len() - self.vacant.len()
    }

    /// The cluster of constraint `c`, or `None` if it was removed or never assigned.
    ///
    /// # Panics
    /// If there is no constraint `c`.
    #[must_use]
    pub fn cluster_of(&self, c: usize) -> Option<ClusterId> {
        Some(self.labels[c]).filter(|&k| k != ClusterId::NONE)
    }

    /// The number of constraints in `cluster`, 0 if it is vacant.
    ///
    /// # Panics
    /// If there is no such cluster number.
    #[must_use]
    pub fn size(&self, cluster: ClusterId) -> usize {
        self.sizes[cluster.index()] as usize
    }

    /// The size of every cluster by number, for use as weights.
    #[must_use]
    pub fn sizes(&self) -> &[u32] {
        &self.sizes
    }

    /// The size of the largest cluster. O(clusters).
    #[must_use]
    pub fn max_size(&self) -> usize {
        self.sizes.iter().copied().max().unwrap_or(0) as usize
    }

    /// The label of every constraint, [`ClusterId::NONE`] for those in no cluster.
    #[must_use]
    pub fn labels(&self) -> &[ClusterId] {
        &self.labels
    }

    /// The constraints of every cluster, ascending. O(constraints + clusters).
    #[must_use]
    pub fn members(&self) -> Classes {
        Classes::group(self.cluster_count(), self.labels.iter().map(|k| k.0))
    }

    /// Removes constraint `c` from its cluster and returns that cluster, `None` if `c` was in none. O(1).
    ///
    /// A cluster that loses its last member becomes vacant.
    ///
    /// # Panics
    /// If there is no constraint `c`.
    pub fn remove(&mut self, c: usize) -> Option<ClusterId> {
        let cluster = self.cluster_of(c)?;
        self.labels[c] = ClusterId::NONE;
        let size = &mut self.sizes[cluster.index()];
        *size -= 1;
        if *size == 0 {
            self.vacant.push(cluster);
        }
        Some(cluster)
    }

    /// Starts a cluster with the single member `c` and returns its number: the one vacated last, or else a new one.
    /// Amortized O(1).
    ///
    /// # Panics
    /// If `c` is in a cluster already ([`remove`](Self::remove) it first), or if no number is left.
    pub fn new_cluster(&mut self, c: usize) -> ClusterId {
        self.ensure_unassigned(c);
        let cluster = self.vacant.pop().unwrap_or_else(|| {
            self.sizes.push(0);
            ClusterId::new(self.sizes.len() - 1)
        });
        self.labels[c] = cluster;
        self.sizes[cluster.index()] = 1;
        cluster
    }

    /// Puts constraint `c`, which is in no cluster, into `cluster`. Amortized O(1).
    ///
    /// `c` may be past the end: the clustering grows, and the numbers in between are in no cluster.
    ///
    /// # Panics
    /// If `c` is in a cluster already ([`remove`](Self::remove) it first), or if `cluster` is
    /// vacant or unknown (start it with [`new_cluster`](Self::new_cluster)).
    pub fn assign(&mut self, c: usize, cluster: ClusterId) {
        let occupied = self
            .sizes
            .get(cluster.index())
            .is_some_and(|&size| size > 0);
        assert!(occupied, "cluster {cluster} has no member to join");
        self.ensure_unassigned(c);
        self.labels[c] = cluster;
        self.sizes[cluster.index()] += 1;
    }

    /// Renumbers constraint `from` to `to`, which must be in no cluster; `from` is in no cluster afterwards. O(1).
    ///
    /// Its cluster keeps number and size.
    ///
    /// # Panics
    /// If there is no constraint `from`, or if `to` is in a cluster.
    ///
    /// ```
    /// use incise_graph::{ClusterId, Clustering};
    ///
    /// // Constraint 0 is removed, and the last one takes over its number.
    /// let mut clustering = Clustering::none(3);
    /// clustering.remove(0);
    /// clustering.renumber(2, 0);
    /// clustering.truncate(2);
    /// assert_eq!(clustering.labels(), [2, 1].map(ClusterId));
    /// clustering.check()?;
    /// # Ok::<(), incise_graph::GraphError>(())
    /// ```
    pub fn renumber(&mut self, from: usize, to: usize) {
        self.ensure_unassigned(to);
        self.labels[to] = std::mem::replace(&mut self.labels[from], ClusterId::NONE);
    }

    /// Removes the constraint numbers from `constraints` on; O(1) for each. Cluster numbers stay.
    ///
    /// # Panics
    /// If one of them is in a cluster.
    pub fn truncate(&mut self, constraints: usize) {
        for c in constraints..self.labels.len() {
            assert!(
                self.labels[c] == ClusterId::NONE,
                "constraint {c} is in cluster {}",
                self.labels[c]
            );
        }
        self.labels.truncate(constraints);
    }

    /// Makes sure that constraint `c` exists and is in no cluster.
    fn ensure_unassigned(&mut self, c: usize) {
        if c >= self.labels.len() {
            self.labels.resize(c + 1, ClusterId::NONE);
        }
        assert!(
            self.labels[c] == ClusterId::NONE,
            "constraint {c} is in cluster {} already",
            self.labels[c]
        );
    }

    /// Recounts sizes and vacant numbers and compares them. O(constraints + clusters).
    ///
    /// # Errors
    /// A label out of range, a recorded size that is wrong, or a vacant list that is not the set of
    /// empty clusters.
    pub fn check(&self) -> Result<(), GraphError> {
        let mut found = vec![0usize; self.sizes.len()];
        for (constraint, &cluster) in self
            .labels
            .iter()
            .enumerate()
            .filter(|(_, k)| **k != ClusterId::NONE)
        {
            *found
                .get_mut(cluster.index())
                .ok_or(GraphError::LabelOutOfRange {
                    constraint,
                    cluster,
                    constraints: self.labels.len(),
                })? += 1;
        }
        let mut listed = vec![0usize; self.sizes.len()];
        for &cluster in &self.vacant {
            *listed
                .get_mut(cluster.index())
                .ok_or(GraphError::Vacancy { cluster })? += 1;
        }
        for (k, (&found, &listed)) in found.iter().zip(&listed).enumerate() {
            let cluster = ClusterId::new(k);
            let recorded = self.size(cluster);
            if recorded != found {
                return Err(GraphError::ClusterSize {
                    cluster,
                    recorded,
                    found,
                });
            }
            if listed != usize::from(found == 0) {
                return Err(GraphError::Vacancy { cluster });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vacated_numbers_come_back_latest_first() {
        let mut clustering = Clustering::none(4);
        clustering.remove(2);
        clustering.remove(0);
        assert_eq!((clustering.occupied(), clustering.cluster_count()), (2, 4));
        clustering.check().unwrap();
        assert_eq!(clustering.new_cluster(4), ClusterId(0));
        assert_eq!(clustering.new_cluster(6), ClusterId(2));
        assert_eq!(clustering.new_cluster(5), ClusterId(4));
        assert_eq!(clustering.cluster_of(0), None);
        assert_eq!(clustering.remove(0), None);
        clustering.check().unwrap();
    }

    #[test]
    fn labels_may_leave_gaps() {
        let labels = vec![ClusterId(3), ClusterId::NONE, ClusterId(0), ClusterId(3)];
        let mut clustering = Clustering::from_labels(labels).unwrap();
        clustering.check().unwrap();
        assert_eq!(
            (
                clustering.cluster_count(),
                clustering.occupied(),
                clustering.max_size()
            ),
            (4, 2, 2)
        );
        assert_eq!(clustering.members().members(3), [0, 3]);
        assert_eq!(clustering.new_cluster(1), ClusterId(1));
        let error = Clustering::from_labels(vec![ClusterId(1)]).unwrap_err();
        assert_eq!(
            error,
            GraphError::LabelOutOfRange {
                constraint: 0,
                cluster: ClusterId(1),
                constraints: 1
            }
        );
    }

    #[test]
    #[should_panic(expected = "already")]
    fn a_constraint_is_in_one_cluster() {
        Clustering::none(2).assign(0, ClusterId(1));
    }

    #[test]
    #[should_panic(expected = "no member")]
    fn a_vacant_cluster_cannot_be_joined() {
        let mut clustering = Clustering::none(2);
        clustering.remove(1);
        clustering.assign(1, ClusterId(1));
    }

    #[test]
    fn the_last_member_of_a_cluster_may_be_renumbered() {
        let mut clustering = Clustering::none(4);
        clustering.remove(0);
        clustering.remove(1);
        clustering.renumber(3, 0);
        clustering.truncate(3);
        clustering.check().unwrap();
        assert_eq!(
            clustering.labels(),
            [ClusterId(3), ClusterId::NONE, ClusterId(2)]
        );
        // Truncated below the number of clusters: cluster numbers stay valid and are reused.
        clustering.renumber(2, 1);
        clustering.truncate(2);
        clustering.check().unwrap();
        assert_eq!(clustering.new_cluster(2), ClusterId(1));
        clustering.check().unwrap();
    }

    #[test]
    #[should_panic(expected = "constraint 1 is in cluster 1")]
    fn clustered_constraints_cannot_be_truncated() {
        Clustering::none(2).truncate(1);
    }

    #[test]
    fn check_finds_wrong_counts() {
        let mut clustering = Clustering::none(3);
        clustering.sizes[1] = 2;
        assert!(matches!(
            clustering.check(),
            Err(GraphError::ClusterSize { .. })
        ));
        let mut clustering = Clustering::none(3);
        clustering.vacant.push(ClusterId(0));
        assert_eq!(
            clustering.check(),
            Err(GraphError::Vacancy {
                cluster: ClusterId(0)
            })
        );
    }
}
