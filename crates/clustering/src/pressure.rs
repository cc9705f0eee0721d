//! Pressure clustering: clusters that minimize the number of clusters at any particle.
//!
//! All clusters at a particle need different colors, so the largest number of clusters at a particle is a lower bound
//! of the colors of the clustered graph, and on irregular meshes colorings come close to it. The method therefore
//! lowers this bound. The pressure of a particle, its clusters plus its free constraints, decreases by one whenever a
//! constraint joins a cluster that is at the particle already. The method is our own and has three steps:
//!
//! 1. **Grow.** Start at the particle of highest pressure; then add, again and again, the free
//!    constraint whose particles shared with the cluster have the largest sum of pressures, plus a
//!    constant each. Sharing a particle under pressure counts for more.
//! 2. **Absorb.** Growth leaves pockets. From a size limit of 16 on, clusters first grow to only 15/16 of it; then the
//!    members of each smaller cluster are distributed over its neighbors, if all of them find room.
//! 3. **Regrow.** At the particles of highest pressure, all clusters there and adjacent ones with room are dissolved
//!    and regrown with increased apparent pressure of the particle. The result is kept if the sum over the particles of
//!    2^pressure decreased, or the number of clusters at an equal sum; otherwise the old clusters are restored (ruin
//!    and recreate, Schrimpf and others 2000). There are at most two passes over these particles, and no attempt begins
//!    after as many constraints have been dissolved as there are.
//!
//! Clusters larger than the valence of a particle lower its pressure in any case. There the number of clusters adjacent
//! to a cluster matters, which compactness keeps low: from a size limit of 32 on, growth counts the particles shared
//! with each member with equal weights, and there is no third step. Both limits and the constant were tuned on
//! tetrahedral meshes.
//!
//! Cost: O(sum over particles of valence squared) score updates, each with the logarithm of a heap,
//! for growing, and at most a few times that for regrowing.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::num::NonZeroUsize;

use incise_graph::{Clustering, Incidence};

use crate::candidates::Candidates;
use crate::parts::Parts;

/// Smallest size limit at which growth reserves a share of each cluster for pockets, one over this.
const RESERVE: usize = 16;
/// Smallest size limit at which growth uses compactness instead of pressure.
const COMPACT: usize = 32;
/// Weight of a shared particle in addition to its pressure.
const STEADY: u64 = 20;
/// Increase of a particle's apparent pressure for each repetition of the growth around it.
const BOOST: u32 = 2;
/// Largest number of passes over the particles of highest pressure.
const PASSES: usize = 2;

/// Clusters of up to `max_size` constraints such that few clusters meet at any particle.
///
/// Every constraint is in one cluster. A cluster is connected: its members have an order in which each but the first
/// shares a particle with an earlier one. Clusters are numbered by their smallest member. Ties go to the smallest
/// number; the arithmetic is in integers. Deterministic. O(sum over particles of valence squared, times log),
/// independent of `max_size`.
///
/// ```
/// use std::num::NonZeroUsize;
///
/// use incise_clustering::pressure;
/// use incise_graph::Incidence;
///
/// // A wheel: six triangles around particle 0. In threes, two clusters meet at the hub.
/// let triangles = (0u32..6).map(|i| [0, i + 1, (i + 1) % 6 + 1]);
/// let incidence = Incidence::from_constraints(7, triangles)?;
/// let clustering = pressure(&incidence, NonZeroUsize::MIN.saturating_add(2));
/// assert_eq!(clustering.sizes(), [3, 3]);
/// assert_eq!(incidence.quotient(&clustering).clique_bound(), 2);
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
#[must_use]
pub fn pressure(incidence: &Incidence, max_size: NonZeroUsize) -> Clustering {
    let constraints = incidence.constraint_count();
    let max_size = max_size.get();
    let mut growth = Growth {
        parts: Parts::new(incidence),
        compact: max_size >= COMPACT,
        candidates: Candidates::new(constraints),
        boost: vec![0; incidence.particle_count()],
        started: Vec::new(),
    };
    let target = max_size - max_size / RESERVE;
    growth.grow_around(
        (0..).zip(0..incidence.particle_count()).map(|(p, _)| p),
        target,
    );
    for c in (0..).take(constraints) {
        // Only constraints without particles are left.
        if growth.parts.is_free(c) {
            let cluster = growth.parts.start();
            growth.parts.join(c, cluster);
        }
    }
    growth.absorb(target, max_size);
    if !growth.compact {
        growth.regrow_worst(max_size);
    }
    growth.parts.finish()
}

/// Clusters that are grown, dissolved and regrown.
struct Growth<'a> {
    parts: Parts<'a>,
    /// True if growth uses only the number of shared particles.
    compact: bool,
    candidates: Candidates,
    /// Particle -> apparent pressure in addition to its own.
    boost: Vec<u32>,
    /// The clusters grown by the last call of `grow_around`.
    started: Vec<u32>,
}

impl Growth<'_> {
    /// The apparent pressure of a particle.
    fn weight(&self, p: u32) -> u32 {
        self.parts
            .pressure(p)
            .saturating_add(self.boost[p as usize])
    }

    /// Adds all free constraints on the given particles, and others around them, to clusters.
    fn grow_around(&mut self, particles: impl Iterator<Item = u32>, size: usize) {
        self.started.clear();
        // Pressure only decreases, so an outdated entry is pushed again with the present value.
        let mut worst: BinaryHeap<(u32, Reverse<u32>)> = particles
            .filter(|&p| self.parts.has_free(p))
            .map(|p| (self.weight(p), Reverse(p)))
            .collect();
        while let Some((weight, Reverse(p))) = worst.pop() {
            if !self.parts.has_free(p) {
                continue;
            }
            let now = self.weight(p);
            if now == weight {
                self.grow(p, size);
            }
            worst.push((now, Reverse(p)));
        }
    }

    /// Grows a cluster from the free constraint on `p` with the highest pressure.
    fn grow(&mut self, p: u32, size: usize) {
        let incidence = self.parts.incidence;
        let load = |c: u32| -> u64 {
            let particles = incidence.particles_of(c as usize).iter();
            particles.map(|&p| u64::from(self.weight(p))).sum()
        };
        let on_p = incidence.constraints_of(p as usize).iter().copied();
        let free = on_p.filter(|&c| self.parts.is_free(c));
        let mut member = free.max_by_key(|&c| (load(c), Reverse(c)));
        let cluster = self.parts.start();
        self.started.push(cluster);
        while let Some(c) = member {
            self.raise_around(c);
            self.parts.join(c, cluster);
            member = if self.parts.size(cluster) < size {
                self.candidates.best(|d| self.parts.is_free(d))
            } else {
                None
            };
        }
        self.candidates.clear();
    }

    /// Raises the scores of the constraints on those particles of `c` that are not yet particles of the open cluster.
    fn raise_around(&mut self, c: u32) {
        let incidence = self.parts.incidence;
        for &p in incidence.particles_of(c as usize) {
            let amount = if self.compact {
                1
            } else if self.parts.is_open_at(p) {
                continue;
            } else {
                u64::from(self.weight(p)) + STEADY
            };
            for &d in incidence.constraints_of(p as usize) {
                if self.parts.is_free(d) {
                    self.candidates.raise(d, amount);
                }
            }
        }
    }

    /// Distributes clusters smaller than `target` over their neighbors, the smallest first.
    fn absorb(&mut self, target: usize, max_size: usize) {
        let clusters = 0..self.parts.cluster_count();
        let mut small: Vec<(usize, u32)> = clusters
            .map(|k| (self.parts.size(k), k))
            .filter(|&(size, _)| size < target)
            .collect();
        small.sort_unstable();
        for (_, cluster) in small {
            // It may have absorbed others meanwhile.
            if self.parts.size(cluster) < target {
                self.spread(cluster, max_size);
            }
        }
    }

    /// Distributes one cluster over its neighbors, or leaves it unchanged.
    fn spread(&mut self, cluster: u32, max_size: usize) {
        let mut members: Vec<u32> = self.parts.members(cluster).collect();
        members.reverse();
        self.parts.dissolve(cluster);
        let mut moved = Vec::new();
        let mut left = members.clone();
        loop {
            let before = left.len();
            left.retain(|&c| {
                let target = self.best_neighbor(c, max_size);
                if let Some(target) = target {
                    self.parts.open(target);
                    self.parts.join(c, target);
                    moved.push(target);
                }
                target.is_none()
            });
            if left.is_empty() {
                return;
            }
            if left.len() == before {
                break;
            }
        }
        for target in moved.into_iter().rev() {
            self.parts.free_last(target);
        }
        self.restore(&members);
    }

    /// The cluster with room that shares the highest pressure with the free constraint `c`.
    fn best_neighbor(&mut self, c: u32, max_size: usize) -> Option<u32> {
        let incidence = self.parts.incidence;
        let mut near = Vec::new();
        for &p in incidence.particles_of(c as usize) {
            let weight = u64::from(self.weight(p));
            let start = near.len();
            let others = incidence.constraints_of(p as usize).iter();
            let clustered = others.filter(|&&d| !self.parts.is_free(d));
            let clusters = clustered.map(|&d| (self.parts.cluster_of(d), weight));
            near.extend(clusters.filter(|&(k, _)| self.parts.size(k) < max_size));
            near[start..].sort_unstable();
            // Each cluster counts once per particle.
            let mut last = None;
            let mut kept = start;
            for i in start..near.len() {
                if last != Some(near[i].0) {
                    last = Some(near[i].0);
                    near[kept] = near[i];
                    kept += 1;
                }
            }
            near.truncate(kept);
        }
        near.sort_unstable();
        near.chunk_by(|a, b| a.0 == b.0)
            .map(|same| (same.iter().map(|s| s.1).sum::<u64>(), Reverse(same[0].0)))
            .max()
            .map(|(_, Reverse(cluster))| cluster)
    }

    /// Restores a cluster with these members.
    fn restore(&mut self, members: &[u32]) {
        let cluster = self.parts.start();
        for &c in members {
            self.parts.join(c, cluster);
        }
    }

    /// Regrows the clusters around the particles of highest pressure, pass after pass.
    fn regrow_worst(&mut self, max_size: usize) {
        let constraints = self.parts.incidence.constraint_count();
        let mut effort = constraints;
        for _ in 0..PASSES {
            // Particles with the largest pressure and with one less, which would be the largest next.
            let bound = self.parts.max_pressure();
            let particles = (0..).take(self.parts.incidence.particle_count());
            let mut worst: Vec<(Reverse<u32>, u32)> = particles
                .map(|p| (Reverse(self.parts.pressure(p)), p))
                .filter(|(pressure, _)| pressure.0 + 1 >= bound)
                .collect();
            worst.sort_unstable();
            let mut kept = false;
            for (_, p) in worst {
                if self.parts.pressure(p) + 1 < bound {
                    continue;
                }
                if effort == 0 {
                    return;
                }
                self.boost[p as usize] += BOOST;
                kept |= self.regrow(p, max_size, bound, &mut effort);
            }
            if !kept {
                return;
            }
        }
    }

    /// Regrows the clusters at `p` and adjacent ones with room; returns true if the result was better.
    fn regrow(&mut self, p: u32, max_size: usize, bound: u32, effort: &mut usize) -> bool {
        let clusters = self.clusters_around(p, max_size);
        let mut members = Vec::new();
        let mut ends = Vec::with_capacity(clusters.len());
        for &cluster in &clusters {
            members.extend(self.parts.members(cluster));
            ends.push(members.len());
        }
        *effort = effort.saturating_sub(members.len());
        let particles = self.particles_of(&members);
        // The largest pressure counts 2^64; pressures far below it all count equally.
        let cost = |parts: &Parts<'_>| -> u128 {
            let exponents = particles
                .iter()
                .map(|&p| (parts.pressure(p) + 64).saturating_sub(bound));
            exponents.map(|exponent| 1 << exponent.min(95)).sum()
        };
        let before = (cost(&self.parts), clusters.len());
        for &cluster in &clusters {
            self.parts.dissolve(cluster);
        }
        self.grow_around(particles.iter().copied(), max_size);
        if (cost(&self.parts), self.started.len()) < before {
            return true;
        }
        for cluster in std::mem::take(&mut self.started) {
            self.parts.dissolve(cluster);
        }
        let mut start = 0;
        for end in ends {
            self.restore(&members[start..end]);
            start = end;
        }
        false
    }

    /// The clusters at `p` and those with room at any of their particles, ascending.
    fn clusters_around(&self, p: u32, max_size: usize) -> Vec<u32> {
        let incidence = self.parts.incidence;
        let on = |p: u32| {
            let constraints = incidence.constraints_of(p as usize).iter();
            constraints.map(|&c| self.parts.cluster_of(c))
        };
        let mut clusters: Vec<u32> = on(p).collect();
        clusters.sort_unstable();
        clusters.dedup();
        let members: Vec<u32> = clusters
            .iter()
            .flat_map(|&k| self.parts.members(k))
            .collect();
        for p in self.particles_of(&members) {
            clusters.extend(on(p).filter(|&k| self.parts.size(k) < max_size));
        }
        clusters.sort_unstable();
        clusters.dedup();
        clusters
    }

    /// The distinct particles of some constraints, ascending.
    fn particles_of(&self, constraints: &[u32]) -> Vec<u32> {
        let rows = constraints.iter();
        let mut particles: Vec<u32> = rows
            .flat_map(|&c| self.parts.incidence.particles_of(c as usize))
            .copied()
            .collect();
        particles.sort_unstable();
        particles.dedup();
        particles
    }
}
