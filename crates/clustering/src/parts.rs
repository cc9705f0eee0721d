//! [`Parts`]: a clustering under construction: the members of clusters, and the pressure on every
//! particle.
//!
//! The *pressure* of a particle is the number of clusters at it plus the number of its free
//! constraints. It starts as the valence, decreases by one when a constraint joins a cluster that
//! is at the particle already, and ends as the number of clusters at the particle.
//!
//! The members of a cluster are a linked list through all constraints, so clusters need no list of
//! their own. One cluster at a time is *open*: only it can be joined, and its particles are marked.
//! Cost: O(arity) per constraint that joins or is freed, O(members * arity) to reopen a cluster.

use incise_graph::{ClusterId, Clustering, Incidence};

/// The end of a linked list, or the label of a free constraint.
const NONE: u32 = u32::MAX;

/// Labels, members and pressures.
#[derive(Debug)]
pub(crate) struct Parts<'a> {
    pub(crate) incidence: &'a Incidence,
    labels: Vec<u32>,
    /// Cluster -> its latest member.
    last: Vec<u32>,
    /// Constraint -> the member that joined before it.
    previous: Vec<u32>,
    sizes: Vec<usize>,
    /// Numbers of clusters without members.
    vacant: Vec<u32>,
    /// Particle -> number of clusters and free constraints at it.
    pressure: Vec<u32>,
    /// Particle -> number of free constraints at it.
    free: Vec<u32>,
    /// Particle -> the last opening in which it was a particle of the open cluster.
    mark: Vec<u64>,
    openings: u64,
}

impl<'a> Parts<'a> {
    /// A state with all constraints free. O(constraints + particles).
    pub(crate) fn new(incidence: &'a Incidence) -> Self {
        let constraints = incidence.constraint_count();
        let mut valence = vec![0; incidence.particle_count()];
        for &p in incidence.values() {
            valence[p as usize] += 1;
        }
        Self {
            incidence,
            labels: vec![NONE; constraints],
            last: Vec::new(),
            previous: vec![NONE; constraints],
            sizes: Vec::new(),
            vacant: Vec::new(),
            pressure: valence.clone(),
            free: valence,
            mark: vec![0; incidence.particle_count()],
            openings: 0,
        }
    }

    pub(crate) fn is_free(&self, c: u32) -> bool {
        self.labels[c as usize] == NONE
    }

    /// The cluster of `c`, which must not be free.
    pub(crate) fn cluster_of(&self, c: u32) -> u32 {
        self.labels[c as usize]
    }

    pub(crate) fn pressure(&self, p: u32) -> u32 {
        self.pressure[p as usize]
    }

    /// The largest pressure of any particle.
    pub(crate) fn max_pressure(&self) -> u32 {
        self.pressure.iter().copied().max().unwrap_or(0)
    }

    pub(crate) fn has_free(&self, p: u32) -> bool {
        self.free[p as usize] > 0
    }

    /// The number of cluster numbers in use, including vacant ones.
    pub(crate) fn cluster_count(&self) -> u32 {
        (0..)
            .zip(&self.sizes)
            .last()
            .map_or(0, |(k, _): (u32, _)| k + 1)
    }

    pub(crate) fn size(&self, cluster: u32) -> usize {
        self.sizes[cluster as usize]
    }

    /// The members of a cluster, latest first.
    pub(crate) fn members(&self, cluster: u32) -> impl Iterator<Item = u32> + '_ {
        let listed = |c: u32| Some(c).filter(|&c| c != NONE);
        std::iter::successors(listed(self.last[cluster as usize]), move |&c| {
            listed(self.previous[c as usize])
        })
    }

    /// Opens a new cluster without members.
    pub(crate) fn start(&mut self) -> u32 {
        self.openings += 1;
        self.vacant.pop().unwrap_or_else(|| {
            self.last.push(NONE);
            self.sizes.push(0);
            self.cluster_count() - 1
        })
    }

    /// Opens a cluster that has members.
    pub(crate) fn open(&mut self, cluster: u32) {
        self.openings += 1;
        let mut member = self.last[cluster as usize];
        while member != NONE {
            for &p in self.incidence.particles_of(member as usize) {
                self.mark[p as usize] = self.openings;
            }
            member = self.previous[member as usize];
        }
    }

    /// True if `p` is a particle of the open cluster.
    pub(crate) fn is_open_at(&self, p: u32) -> bool {
        self.mark[p as usize] == self.openings
    }

    /// Adds the free constraint `c` to the open cluster, which is `cluster`.
    pub(crate) fn join(&mut self, c: u32, cluster: u32) {
        self.labels[c as usize] = cluster;
        self.previous[c as usize] = self.last[cluster as usize];
        self.last[cluster as usize] = c;
        self.sizes[cluster as usize] += 1;
        for &p in self.incidence.particles_of(c as usize) {
            let p = p as usize;
            self.free[p] -= 1;
            if self.mark[p] == self.openings {
                self.pressure[p] -= 1;
            }
            self.mark[p] = self.openings;
        }
    }

    /// Frees the latest member of a cluster of at least two.
    pub(crate) fn free_last(&mut self, cluster: u32) {
        let c = self.last[cluster as usize];
        self.labels[c as usize] = NONE;
        self.last[cluster as usize] = self.previous[c as usize];
        self.sizes[cluster as usize] -= 1;
        self.open(cluster);
        for &p in self.incidence.particles_of(c as usize) {
            let p = p as usize;
            self.free[p] += 1;
            if self.mark[p] == self.openings {
                self.pressure[p] += 1;
            }
        }
    }

    /// Frees all members of a cluster. [`start`](Self::start) reuses its number next.
    pub(crate) fn dissolve(&mut self, cluster: u32) {
        self.openings += 1;
        let mut member = self.last[cluster as usize];
        while member != NONE {
            self.labels[member as usize] = NONE;
            for &p in self.incidence.particles_of(member as usize) {
                let p = p as usize;
                self.free[p] += 1;
                if self.mark[p] == self.openings {
                    self.pressure[p] += 1;
                }
                self.mark[p] = self.openings;
            }
            member = self.previous[member as usize];
        }
        self.last[cluster as usize] = NONE;
        self.sizes[cluster as usize] = 0;
        self.vacant.push(cluster);
    }

    /// The finished clustering; clusters are numbered by their smallest member.
    pub(crate) fn finish(self) -> Clustering {
        let mut numbers = vec![NONE; self.last.len()];
        let mut next = 0;
        let labels = self.labels.iter().map(|&k| {
            let number = &mut numbers[k as usize];
            if *number == NONE {
                *number = next;
                next += 1;
            }
            ClusterId(*number)
        });
        Clustering::from_labels(labels.collect())
            .expect("there are at most as many clusters as constraints")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares pressures and free counts with a recount.
    fn check(parts: &Parts<'_>) {
        for p in (0..).take(parts.incidence.particle_count()) {
            let constraints = parts.incidence.constraints_of(p as usize);
            let free = constraints.iter().filter(|&&c| parts.is_free(c)).count();
            let clustered = constraints.iter().filter(|&&c| !parts.is_free(c));
            let mut clusters: Vec<u32> = clustered.map(|&c| parts.cluster_of(c)).collect();
            clusters.sort_unstable();
            clusters.dedup();
            assert_eq!(parts.pressure(p) as usize, free + clusters.len(), "{p}");
            assert_eq!(parts.has_free(p), free > 0);
        }
    }

    #[test]
    fn pressure_follows_every_step() {
        let triangles = (0u32..6).map(|i| [0, i + 1, (i + 1) % 6 + 1]);
        let wheel = Incidence::from_constraints(7, triangles).unwrap();
        let mut parts = Parts::new(&wheel);
        check(&parts);
        let first = parts.start();
        for c in [0, 1, 3] {
            parts.join(c, first);
            check(&parts);
        }
        let second = parts.start();
        parts.join(2, second);
        check(&parts);
        assert_eq!((parts.pressure(0), parts.max_pressure()), (4, 4));
        parts.open(first);
        assert!(parts.is_open_at(2) && !parts.is_open_at(6));
        parts.join(4, first);
        check(&parts);
        assert_eq!(parts.members(first).collect::<Vec<_>>(), [4, 3, 1, 0]);
        parts.free_last(first);
        check(&parts);
        parts.dissolve(first);
        check(&parts);
        assert_eq!(parts.start(), first, "the number comes back");
        for c in [0, 1, 3, 4, 5] {
            parts.join(c, first);
        }
        check(&parts);
        let labels = [0, 0, 1, 0, 0, 0].map(ClusterId);
        assert_eq!(parts.finish().labels(), labels);
    }
}
