//! Merging what a cut left small: clusters around the cut join neighbors that have room.
//!
//! A cut takes members out of clusters and puts their parts into clusters of their own, a few constraints each
//! ([`update_local`](crate::update_local)). Cut again and again, clusters shrink and colors grow. So the clusters that
//! the cut made or took from, if they fill at most half of the size limit, are merged with a neighbor: the smallest
//! first, each with the neighbor that shares most particles with it among those that have room, and again as long as the
//! result is small itself. Of two clusters that fit into one, one fills at most half of it, so no pair is overlooked for
//! that limit. Clusters across a cut share no particle and are never merged. Where a cut left a cluster in parts that
//! share nothing any more, each part goes its own way.
//!
//! The paper leaves this open (section 4.3 and figure 8, where colors grow from cut to cut). Greedy agglomeration, the
//! score is that of [`greedy_k_neighbor`](crate::greedy_k_neighbor). Cost: O(m (k + v)) for m small clusters at the cut,
//! with k = `max_size` squared and v the constraints at the particles of one cluster, whatever the size of the rest.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;
use std::num::NonZeroUsize;

use incise_graph::{ClusterId, Clustering};

/// A constraint that changed its cluster, and the cluster it was in before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Moved {
    /// The constraint.
    pub constraint: u32,
    /// Its cluster before; perhaps vacant now.
    pub from: ClusterId,
}

/// Merges the small clusters among those of `seeds` with neighbors.
///
/// Small is a cluster of at most half of `max_size` constraints. It is merged with the cluster that shares most
/// particles with it (of equal ones the smaller, of these the one with the smaller number) among those that it fits
/// into; no cluster gets larger than `max_size`. The larger of the two keeps its number (of equal ones the smaller
/// number), the other number becomes vacant. Nothing but the clusters of the seeds, and clusters that share a particle
/// with them or with what they were merged with, changes.
///
/// # Arguments
/// `seeds` are constraints of the clusters to look at, in any order, those without a cluster are skipped: after a cut,
/// the new constraints and the others in clusters that lost some. `particles_of` gives the particles of a constraint,
/// `constraints_of` the constraints at a particle, in any order: the result does not depend on it.
///
/// # Returns
/// The constraints that are in another cluster now, ascending.
///
/// # Panics
/// If a seed or a constraint at a particle is no number of the clustering.
///
/// Deterministic. For the cost see the module's source: O(m (k + v)) for m small clusters, each with v constraints at its
/// particles, and k the square of `max_size`.
///
/// ```
/// use std::num::NonZeroUsize;
///
/// use incise_clustering::merge_small;
/// use incise_graph::{ClusterId, Clustering, Incidence};
///
/// // A row of eight springs; a cut has left 1 and 2 as clusters of their own.
/// let springs = Incidence::from_constraints(9, (0u32..8).map(|i| [i, i + 1]))?;
/// let labels = [0, 1, 2, 3, 3, 3, 3, 3].map(ClusterId).to_vec();
/// let mut clustering = Clustering::from_labels(labels)?;
/// let limit = NonZeroUsize::MIN.saturating_add(4);
/// let moved = merge_small(
///     &mut clustering,
///     &[1, 2],
///     limit,
///     |c| springs.particles_of(c as usize).iter().copied(),
///     |p| springs.constraints_of(p as usize).iter().copied(),
/// );
/// assert_eq!(moved.iter().map(|moved| moved.constraint).collect::<Vec<_>>(), [1, 2]);
/// assert_eq!(clustering.sizes(), [3, 0, 0, 5]);
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
pub fn merge_small<P, C>(
    clustering: &mut Clustering,
    seeds: &[u32],
    max_size: NonZeroUsize,
    particles_of: impl Fn(u32) -> P,
    constraints_of: impl Fn(u32) -> C,
) -> Vec<Moved>
where
    P: IntoIterator<Item = u32>,
    C: IntoIterator<Item = u32>,
{
    let max_size = max_size.get();
    let small = max_size / 2;
    if small == 0 {
        return Vec::new();
    }
    let mut merging = Merging {
        clustering,
        particles_of,
        constraints_of,
        members: Vec::new(),
        particles: Vec::new(),
        near: Vec::new(),
        shared: Vec::new(),
        moved: Vec::new(),
    };
    let seeds = merging.by_cluster(seeds);
    let mut waiting = BinaryHeap::new();
    for same in seeds.chunk_by(|a, b| a.0 == b.0) {
        let (cluster, seed) = same[0];
        let size = merging.clustering.size(cluster);
        if size <= small {
            waiting.push(Reverse((size, seed)));
        } else {
            merging.small_parts(same, small, &mut waiting);
        }
    }
    while let Some(Reverse((size, seed))) = waiting.pop() {
        match merging.flood(seed, size).cmp(&size) {
            // It has joined another one, which waits under its new size.
            Ordering::Greater => {}
            Ordering::Equal => {
                if let Some((merged, seed)) = merging.merge(max_size)
                    && merged <= small
                {
                    waiting.push(Reverse((merged, seed)));
                }
            }
            // A cluster in parts: this one, and perhaps others.
            Ordering::Less => {
                waiting.push(Reverse((merging.members.len(), seed)));
                let cluster = merging.clustering.cluster_of(seed as usize);
                let from = seeds.partition_point(|seed| Some(seed.0) < cluster);
                let to = seeds.partition_point(|seed| Some(seed.0) <= cluster);
                merging.small_parts(&seeds[from..to], small, &mut waiting);
            }
        }
    }
    merging.finish()
}

/// What the flooded part shares with another cluster.
struct Shared {
    cluster: ClusterId,
    /// The particle counted last.
    particle: u32,
    /// How many particles.
    count: u32,
    /// The smallest constraint of the cluster that shares one.
    constraint: u32,
}

/// The work of merging.
struct Merging<'a, F, G> {
    clustering: &'a mut Clustering,
    particles_of: F,
    constraints_of: G,
    /// The part flooded last: constraints of one cluster that hang together.
    members: Vec<u32>,
    /// Its particles.
    particles: Vec<u32>,
    /// For each constraint of others at these particles: its cluster, the particle and itself.
    near: Vec<(ClusterId, u32, u32)>,
    /// Those of the clusters there that have room.
    shared: Vec<Shared>,
    moved: Vec<Moved>,
}

impl<P, C, F, G> Merging<'_, F, G>
where
    P: IntoIterator<Item = u32>,
    C: IntoIterator<Item = u32>,
    F: Fn(u32) -> P,
    G: Fn(u32) -> C,
{
    /// The seeds that are in a cluster, with it, sorted.
    fn by_cluster(&self, seeds: &[u32]) -> Vec<(ClusterId, u32)> {
        let clustered = seeds.iter().filter_map(|&c| {
            let cluster = self.clustering.cluster_of(c as usize)?;
            Some((cluster, c))
        });
        let mut seeds: Vec<(ClusterId, u32)> = clustered.collect();
        seeds.sort_unstable();
        seeds.dedup();
        seeds
    }

    /// Lists the parts of at most `small` constraints that hold one of the seeds of a cluster, those that are in it no
    /// more left out: size and smallest member.
    fn small_parts(
        &mut self,
        seeds: &[(ClusterId, u32)],
        small: usize,
        parts: &mut BinaryHeap<Reverse<(usize, u32)>>,
    ) {
        let mut seen: Vec<u32> = Vec::new();
        for &(cluster, seed) in seeds {
            let there = self.clustering.cluster_of(seed as usize) == Some(cluster);
            if !there || seen.contains(&seed) {
                continue;
            }
            let size = self.flood(seed, small);
            seen.extend(&self.members);
            if size <= small {
                let first = self.members.iter().copied().fold(seed, u32::min);
                parts.push(Reverse((size, first)));
            }
        }
    }

    /// Finds the constraints of the seed's cluster that hang together with it, until they are more than `enough`;
    /// returns how many were found. Other clusters at their particles are noted.
    fn flood(&mut self, seed: u32, enough: usize) -> usize {
        let Self {
            clustering,
            members,
            particles,
            near,
            ..
        } = self;
        let own = clustering.labels()[seed as usize];
        members.clear();
        particles.clear();
        near.clear();
        members.push(seed);
        let mut next = 0;
        while next < members.len() && members.len() <= enough {
            for particle in (self.particles_of)(members[next]) {
                if particles.contains(&particle) {
                    continue;
                }
                particles.push(particle);
                for c in (self.constraints_of)(particle) {
                    let cluster = clustering.labels()[c as usize];
                    if cluster != own {
                        near.push((cluster, particle, c));
                    } else if !members.contains(&c) {
                        members.push(c);
                    }
                }
            }
            next += 1;
        }
        members.len()
    }

    /// Merges the flooded part with its best neighbor; returns the size of the result and a member, or nothing if no
    /// neighbor has room.
    fn merge(&mut self, max_size: usize) -> Option<(usize, u32)> {
        let seed = self.members[0];
        let own = self.clustering.cluster_of(seed as usize)?;
        let (other, neighbor) = self.best_neighbor(max_size)?;
        let (part, others) = (self.members.len(), self.clustering.size(other));
        let whole = part == self.clustering.size(own);
        let kept = if whole && (Reverse(part), own) < (Reverse(others), other) {
            // Parts of the neighbor that do not hang together with this one stay where they are.
            self.flood(neighbor, usize::MAX);
            own
        } else {
            other
        };
        for i in 0..self.members.len() {
            self.put(self.members[i], kept);
        }
        Some((self.clustering.size(kept), seed))
    }

    /// The cluster with room that shares most particles with the flooded part, and a constraint of it that does.
    fn best_neighbor(&mut self, max_size: usize) -> Option<(ClusterId, u32)> {
        let room = max_size - self.members.len();
        self.shared.clear();
        for &(cluster, particle, constraint) in &self.near {
            if cluster == ClusterId::NONE || self.clustering.size(cluster) > room {
                continue;
            }
            // Few have room; and entries come particle by particle.
            match self
                .shared
                .iter_mut()
                .find(|shared| shared.cluster == cluster)
            {
                Some(shared) => {
                    shared.count += u32::from(shared.particle != particle);
                    shared.particle = particle;
                    shared.constraint = shared.constraint.min(constraint);
                }
                None => self.shared.push(Shared {
                    cluster,
                    particle,
                    count: 1,
                    constraint,
                }),
            }
        }
        let size = |shared: &&Shared| {
            let size = self.clustering.size(shared.cluster);
            (shared.count, Reverse((size, shared.cluster)))
        };
        let best = self.shared.iter().max_by_key(size)?;
        Some((best.cluster, best.constraint))
    }

    /// Moves a constraint into a cluster.
    fn put(&mut self, constraint: u32, cluster: ClusterId) {
        if let Some(from) = self.clustering.remove(constraint as usize) {
            self.clustering.assign(constraint as usize, cluster);
            self.moved.push(Moved { constraint, from });
        }
    }

    /// The constraints that moved, each with the cluster it was in at first.
    fn finish(self) -> Vec<Moved> {
        let Self {
            clustering,
            mut moved,
            ..
        } = self;
        // Stable: of several moves the first stays.
        moved.sort_by_key(|moved| moved.constraint);
        moved.dedup_by_key(|moved| moved.constraint);
        moved.retain(|moved| clustering.cluster_of(moved.constraint as usize) != Some(moved.from));
        moved
    }
}
