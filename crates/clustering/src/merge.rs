//! Repair of clusters after a cut: loose constraints join small clusters or form new ones, and small clusters merge.
//!
//! A cut removes members from clusters and adds constraints that are in none yet (*loose*). Three passes work on the
//! changed constraints, all along links between constraints (for tets, shared faces), so that no cluster grows across a
//! cut:
//!
//! 1. Clusters that fill at most half of the size limit and are linked to a loose constraint or a seed grow into the
//!    loose constraints.
//!
//! 2. Remaining loose constraints form new clusters, each starting where the last one stopped.
//!
//! 3. Those of these clusters that are small merge with a neighbor that has room, the smallest first, repeatedly while
//!    the result is small. Of two clusters that fit into one, one fills at most half of it, so every such pair is
//!    found.
//!
//! A growing cluster takes the constraint with the fewest loose neighbors, which would otherwise end up alone; ties go
//! to the one with most links into the cluster. If a cut left a cluster in parts without a link, each part is handled
//! separately.
//!
//! The paper makes one cluster of the children of each cut element (section 4.3) and does not describe how such
//! clusters stay large (figure 8, where the number of colors grows from cut to cut). Cost: O(m k) for m loose
//! constraints and small clusters, with k = `max_size` times the links of a constraint, independent of the size of the
//! mesh.

use std::cmp::Reverse;
use std::num::NonZeroUsize;

use incise_graph::{ClusterId, Clustering};

/// A constraint that changed its cluster, and the cluster it was in before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Moved {
    /// The constraint.
    pub constraint: u32,
    /// Its previous cluster, which may be vacant now.
    pub from: ClusterId,
}

/// Working memory of [`merge_small`], kept between calls to avoid allocations.
#[derive(Clone, Debug, Default)]
pub struct MergeLists {
    /// Candidates for the growing cluster.
    frontier: Vec<Candidate>,
    /// One member of each cluster that grew or could not grow; these clusters may be small.
    grown: Vec<u32>,
    /// The members of the connected part found last.
    part: Vec<u32>,
    /// Other clusters with room, and the number of links to each.
    near: Vec<(ClusterId, u32)>,
    assigned: Vec<u32>,
    /// `assigned` in ascending order.
    sorted: Vec<u32>,
    moved: Vec<Moved>,
}

/// A loose constraint linked to a growing cluster.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    constraint: u32,
    /// Links to loose constraints.
    loose: u32,
    /// Links to members of the cluster.
    links: u32,
}

/// Puts loose constraints into clusters and merges the small clusters around them.
///
/// A cluster is small if it has at most half of `max_size` constraints. Afterwards each loose constraint is in a
/// cluster, no cluster is larger than `max_size`, and no small cluster that was visited fits into a linked neighbor.
/// Only clusters of seeds and clusters linked to them or to loose constraints change.
///
/// # Arguments
/// `loose` are constraints that are in no cluster, or past the end of the clustering; others that are linked to them
/// and in no cluster count as loose, too. `seeds` are constraints whose clusters are visited as well; seeds in no
/// cluster are skipped. `neighbors_of` returns the constraints linked to one; links are symmetric.
///
/// The changes are in `lists` afterwards. Deterministic: equal lists in equal order give equal clusters. The source of
/// the module documents the cost.
///
/// ```
/// use std::num::NonZeroUsize;
///
/// use incise_clustering::{MergeLists, merge_small};
/// use incise_graph::{ClusterId, Clustering};
///
/// // A row of eight springs; 3, 4 and 5 are new, and the cut has left 6 and 7 as clusters of their own.
/// let [a, b, c] = [0, 1, 2].map(ClusterId);
/// let none = ClusterId::NONE;
/// let mut clustering = Clustering::from_labels(vec![a, a, a, none, none, none, b, c])?;
/// let mut lists = MergeLists::default();
/// merge_small(
///     &mut lists,
///     &mut clustering,
///     &[3, 4, 5],
///     &[7],
///     NonZeroUsize::MIN.saturating_add(3),
///     |spring| (spring.saturating_sub(1)..=(spring + 1).min(7)).filter(move |&other| other != spring),
/// );
/// // The cluster of spring 6 has grown to four, so 7 does not fit.
/// assert_eq!(clustering.labels(), [a, a, a, b, b, b, b, c]);
/// assert_eq!((lists.assigned(), lists.moved()), (&[5, 4, 3][..], &[][..]));
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
pub fn merge_small<N: IntoIterator<Item = u32>>(
    lists: &mut MergeLists,
    clustering: &mut Clustering,
    loose: &[u32],
    seeds: &[u32],
    max_size: NonZeroUsize,
    neighbors_of: impl Fn(u32) -> N,
) {
    let max_size = max_size.get();
    lists.grown.clear();
    lists.assigned.clear();
    lists.moved.clear();
    let mut merging = Merging {
        lists: &mut *lists,
        clustering: &mut *clustering,
        neighbors_of,
        max_size,
        small: max_size / 2,
    };
    for &c in seeds {
        merging.grow_if_small(c);
    }
    for &c in loose {
        if merging.label(c) == ClusterId::NONE {
            for neighbor in (merging.neighbors_of)(c) {
                merging.grow_if_small(neighbor);
            }
        }
    }
    for &c in loose {
        let mut next = Some(c).filter(|&c| merging.label(c) == ClusterId::NONE);
        while let Some(start) = next {
            merging.clustering.new_cluster(start as usize);
            merging.lists.assigned.push(start);
            merging.grow(start);
            next = merging.pick().map(|candidate| candidate.constraint);
        }
    }
    merging.merge();
    lists.finish(clustering);
}

/// State of a call of [`merge_small`].
struct Merging<'a, F> {
    lists: &'a mut MergeLists,
    clustering: &'a mut Clustering,
    neighbors_of: F,
    max_size: usize,
    /// Largest size of a small cluster.
    small: usize,
}

impl<N: IntoIterator<Item = u32>, F: Fn(u32) -> N> Merging<'_, F> {
    /// The cluster of a constraint, which may be past the end.
    fn label(&self, c: u32) -> ClusterId {
        let label = self.clustering.labels().get(c as usize);
        label.copied().unwrap_or(ClusterId::NONE)
    }

    /// Grows the cluster of a constraint if it is small.
    fn grow_if_small(&mut self, c: u32) {
        let cluster = self.label(c);
        if cluster != ClusterId::NONE && self.clustering.size(cluster) <= self.small {
            self.grow(c);
        }
    }

    /// Adds loose constraints to the cluster of a constraint until it is full or none is linked to it.
    fn grow(&mut self, seed: u32) {
        let cluster = self.label(seed);
        self.lists.grown.push(seed);
        self.lists.frontier.clear();
        self.find_part(seed);
        for i in 0..self.lists.part.len() {
            self.look_around(self.lists.part[i], cluster);
        }
        while self.clustering.size(cluster) < self.max_size
            && let Some(next) = self.pick()
        {
            self.clustering.assign(next.constraint as usize, cluster);
            self.lists.assigned.push(next.constraint);
            self.look_around(next.constraint, cluster);
        }
    }

    /// Removes and returns the best candidate of the frontier.
    fn pick(&mut self) -> Option<Candidate> {
        let frontier = &mut self.lists.frontier;
        let rank = |candidate: &Candidate| {
            let Candidate {
                constraint,
                loose,
                links,
            } = *candidate;
            (loose, Reverse(links), constraint)
        };
        let indices = 0..frontier.len();
        let best = indices.min_by_key(|&index| rank(&frontier[index]))?;
        Some(frontier.swap_remove(best))
    }

    /// Adds the loose neighbors of a new member to the frontier.
    fn look_around(&mut self, member: u32, cluster: ClusterId) {
        for c in (self.neighbors_of)(member) {
            if self.label(c) != ClusterId::NONE {
                continue;
            }
            let frontier = &mut self.lists.frontier;
            if let Some(candidate) = frontier.iter_mut().find(|known| known.constraint == c) {
                candidate.links += 1;
                candidate.loose = candidate.loose.saturating_sub(1);
                continue;
            }
            let (mut loose, mut links) = (0, 0);
            for neighbor in (self.neighbors_of)(c) {
                let label = self.label(neighbor);
                loose += u32::from(label == ClusterId::NONE);
                links += u32::from(label == cluster);
            }
            self.lists.frontier.push(Candidate {
                constraint: c,
                loose,
                links,
            });
        }
    }

    /// Finds the constraints of the seed's cluster that are connected to it.
    fn find_part(&mut self, seed: u32) {
        let own = self.label(seed);
        let size = self.clustering.size(own);
        self.lists.part.clear();
        self.lists.part.push(seed);
        let mut next = 0;
        while next < self.lists.part.len() && self.lists.part.len() < size {
            for c in (self.neighbors_of)(self.lists.part[next]) {
                if self.label(c) == own && !self.lists.part.contains(&c) {
                    self.lists.part.push(c);
                }
            }
            next += 1;
        }
    }

    /// Merges the small clusters among those that grew, the smallest first.
    fn merge(&mut self) {
        let mut grown = std::mem::take(&mut self.lists.grown);
        let size = |merging: &Self, seed: u32| merging.clustering.size(merging.label(seed));
        grown.retain(|&seed| size(self, seed) <= self.small);
        for step in 1..=self.small {
            let mut next = 0;
            // A cluster whose other part has moved may be smaller than the step.
            while let Some(&seed) = grown.get(next) {
                if size(self, seed) > step {
                    next += 1;
                    continue;
                }
                grown.swap_remove(next);
                // A cluster that is still small after a merge is queued again.
                if let Some(merged) = self.join_best(seed)
                    && merged <= self.small
                {
                    grown.push(seed);
                }
            }
        }
        self.lists.grown = grown;
    }

    /// Moves the part that contains the seed into the neighbor with most links to it among those with room; ties go to
    /// the smaller neighbor, then to the smaller number. Returns the size of the result; `None` if no neighbor has
    /// room.
    fn join_best(&mut self, seed: u32) -> Option<usize> {
        self.find_part(seed);
        let own = self.label(seed);
        let room = self.max_size - self.lists.part.len();
        self.lists.near.clear();
        for i in 0..self.lists.part.len() {
            for c in (self.neighbors_of)(self.lists.part[i]) {
                let cluster = self.label(c);
                if cluster == own || cluster == ClusterId::NONE {
                    continue;
                }
                let near = &mut self.lists.near;
                match near.iter_mut().find(|near| near.0 == cluster) {
                    Some(near) => near.1 += 1,
                    None if self.clustering.size(cluster) <= room => near.push((cluster, 1)),
                    None => {}
                }
            }
        }
        let rank = |&&(cluster, links): &&(ClusterId, u32)| {
            let size = self.clustering.size(cluster);
            (links, Reverse((size, cluster)))
        };
        let &(best, _) = self.lists.near.iter().max_by_key(rank)?;
        for &constraint in &self.lists.part {
            if let Some(from) = self.clustering.remove(constraint as usize) {
                self.clustering.assign(constraint as usize, best);
                self.lists.moved.push(Moved { constraint, from });
            }
        }
        Some(self.clustering.size(best))
    }
}

impl MergeLists {
    /// The loose constraints of the last call, in the order of their assignment; members of one cluster are mostly
    /// consecutive.
    #[must_use]
    pub fn assigned(&self) -> &[u32] {
        &self.assigned
    }

    /// The constraints whose cluster was changed by the last call, ascending.
    #[must_use]
    pub fn moved(&self) -> &[Moved] {
        &self.moved
    }

    /// Keeps one entry per moved constraint, with its first cluster.
    fn finish(&mut self, clustering: &Clustering) {
        let Self {
            moved,
            assigned,
            sorted,
            ..
        } = self;
        if moved.is_empty() {
            return;
        }
        // The sort is stable: of several moves the first is kept.
        moved.sort_by_key(|moved| moved.constraint);
        moved.dedup_by_key(|moved| moved.constraint);
        sorted.clone_from(assigned);
        sorted.sort_unstable();
        moved.retain(|moved| {
            let now = clustering.labels()[moved.constraint as usize];
            now != moved.from && sorted.binary_search(&moved.constraint).is_err()
        });
    }
}
