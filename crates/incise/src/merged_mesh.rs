//! [`MergedMesh`]: all islands of bodies as one mesh.
//!
//! At the start particles and tets are numbered body by body in the order of the scene. A cut keeps all numbers: new
//! particles and tets get the next ones, stroke by stroke and within a stroke island by island, each island's in the
//! order of its own delta. Each island numbers its own from 0; the lists here translate the numbers and the deltas.
//! Scenes with a single island use its mesh directly.
//!
//! Cost: a delta costs as much as it changes; clusters and colors are merged on request.

use glam::DVec3;
use incise_cutting::{
    AddedTet, BoundaryTriangle, CutDelta, EdgePoint, MovedTet, RelinkedTet, RemovedTet,
};
use incise_graph::{ClusterId, Clustering, Coloring};
use incise_mesh::{ParticleId, TetId, TetMesh};

use crate::Error;
use crate::island::Island;
use crate::resolved_body::ResolvedBody;

/// The numbers in the merged mesh of an island's particles and tets.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
struct Numbers {
    particles: Vec<ParticleId>,
    tets: Vec<TetId>,
}

impl Numbers {
    /// Appends particles of the island; their numbers in the merged mesh are the next ones, so `locations` gets theirs at its end.
    fn add_particles(
        &mut self,
        island: usize,
        new: impl Iterator<Item = ParticleId>,
        locations: &mut Vec<(u32, ParticleId)>,
    ) {
        let island = u32::try_from(island).expect("each island has particles, numbered by 32 bits");
        for particle in new {
            locations.push((island, ParticleId::new(self.particles.len())));
            self.particles.push(particle);
        }
    }
}

/// All islands as one mesh.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct MergedMesh {
    pub(crate) mesh: TetMesh,
    pub(crate) positions: Vec<DVec3>,
    numbers: Vec<Numbers>,
    /// For each particle its island and its number there.
    locations: Vec<(u32, ParticleId)>,
}

impl MergedMesh {
    /// The bodies as one mesh, before they go to their islands; `island_of` says to which.
    pub(crate) fn new(bodies: &[ResolvedBody], island_of: &[usize]) -> Self {
        let mut mesh = TetMesh::default();
        let islands = island_of.iter().max().map_or(0, |last| last + 1);
        let mut numbers: Vec<Numbers> = (0..islands).map(|_| Numbers::default()).collect();
        let mut locations = Vec::new();
        for (body, &island) in bodies.iter().zip(island_of) {
            let first = mesh.positions.len();
            let shifted = |p: ParticleId| ParticleId::new(first + p.index());
            let first_tet = mesh.tets.len();
            mesh.positions.extend(&body.mesh.positions);
            let tets = body.mesh.tets.iter().map(|tet| tet.map(shifted));
            mesh.tets.extend(tets);
            let numbers = &mut numbers[island];
            let particles = (first..mesh.positions.len()).map(ParticleId::new);
            numbers.add_particles(island, particles, &mut locations);
            let tets = (first_tet..mesh.tets.len()).map(TetId::new);
            numbers.tets.extend(tets);
        }
        Self {
            positions: mesh.positions.clone(),
            mesh,
            numbers,
            locations,
        }
    }

    /// An island that is the only one, seen as one of several.
    pub(crate) fn of_one(island: &Island) -> Self {
        let mut merged = Self {
            mesh: TetMesh::default(),
            positions: Vec::new(),
            numbers: Vec::new(),
            locations: Vec::new(),
        };
        merged.add_island(island);
        merged
    }

    /// Appends an island: its particles and tets get the next numbers.
    pub(crate) fn add_island(&mut self, island: &Island) {
        let mesh = island.cuttable.mesh();
        let (first, first_tet) = (self.mesh.positions.len(), self.mesh.tets.len());
        let shifted = |p: ParticleId| ParticleId::new(first + p.index());
        self.mesh.positions.extend(&mesh.positions);
        self.positions.extend(&island.positions);
        let tets = mesh.tets.iter().map(|tet| tet.map(shifted));
        self.mesh.tets.extend(tets);
        let mut numbers = Numbers::default();
        let particles = (first..self.mesh.positions.len()).map(ParticleId::new);
        numbers.add_particles(self.numbers.len(), particles, &mut self.locations);
        numbers
            .tets
            .extend((first_tet..self.mesh.tets.len()).map(TetId::new));
        self.numbers.push(numbers);
    }

    /// Notes that island `other` was appended to island `into`, and later ones moved up. No number here changes.
    /// O(particles).
    pub(crate) fn join(&mut self, into: usize, other: usize) {
        let of_other = self.numbers.remove(other);
        let first = self.numbers[into].particles.len();
        self.numbers[into].particles.extend(of_other.particles);
        self.numbers[into].tets.extend(of_other.tets);
        for (island, particle) in &mut self.locations {
            let number = *island as usize;
            if number == other {
                *particle = ParticleId::new(first + particle.index());
                *island = u32::try_from(into).expect("islands are numbered in 32 bits");
            } else if number > other {
                *island -= 1;
            }
        }
    }

    /// The island of a particle and its number there. O(1).
    pub(crate) fn location(&self, particle: ParticleId) -> (usize, usize) {
        let (island, number) = self.locations[particle.index()];
        (island as usize, number.index())
    }

    /// Applies a delta of one island; returns the delta in the numbers of the merged mesh.
    pub(crate) fn apply_delta(&mut self, island: usize, delta: &CutDelta) -> CutDelta {
        let numbers = &mut self.numbers[island];
        let (particles_before, tets_before) = (self.mesh.positions.len(), self.mesh.tets.len());
        let new = delta.particles_after() - delta.particles_before;
        let particles = (particles_before..particles_before + new).map(ParticleId::new);
        numbers.add_particles(island, particles, &mut self.locations);
        let new = delta.added.len() - delta.removed.len();
        let new = (tets_before..tets_before + new).map(TetId::new);
        numbers.tets.extend(new);

        let particle = |p: ParticleId| numbers.particles[p.index()];
        let tet = |t: TetId| numbers.tets[t.index()];
        let point = |point: &EdgePoint| EdgePoint {
            ends: point.ends.map(particle),
            parameter: point.parameter,
        };
        let removed = |removed: &RemovedTet| RemovedTet {
            tet: tet(removed.tet),
            corners: removed.corners.map(particle),
        };
        let added = |added: &AddedTet| AddedTet {
            tet: tet(added.tet),
            parent: tet(added.parent),
            corners: added.corners.map(particle),
            positive: added.positive,
        };
        let relinked = |relinked: &RelinkedTet| RelinkedTet {
            tet: tet(relinked.tet),
            before: relinked.before.map(particle),
            after: relinked.after.map(particle),
        };
        let triangle = |triangle: &BoundaryTriangle| BoundaryTriangle {
            tet: tet(triangle.tet),
            particles: triangle.particles.map(particle),
            ..*triangle
        };
        let mut merged = CutDelta {
            particles_before,
            tets_before,
            points: delta.points.iter().map(point).collect(),
            copies: delta.copies.iter().map(|&p| particle(p)).collect(),
            removed: delta.removed.iter().map(removed).collect(),
            added: delta.added.iter().map(added).collect(),
            relinked: delta.relinked.iter().map(relinked).collect(),
            deleted: delta.deleted.iter().map(removed).collect(),
            moved: Vec::new(),
            surface_removed: delta.surface_removed.iter().map(triangle).collect(),
            surface_added: Vec::new(),
            snapped: delta.snapped,
            crumbs: delta.crumbs,
            crumb_volume: delta.crumb_volume,
            collapsed: delta.collapsed,
            flipped: delta.flipped,
            bent: delta.bent.iter().map(|&p| particle(p)).collect(),
            opened: delta.opened,
            worst_volume_ratio: delta.worst_volume_ratio,
            dihedral: delta.dihedral,
        };
        merged.deleted.sort_unstable_by_key(|deleted| deleted.tet);

        // A tet that moves within its island keeps its number in the merged mesh.
        for moved in &delta.moved {
            numbers.tets[moved.to.index()] = numbers.tets[moved.from.index()];
        }
        numbers.tets.truncate(delta.tets_after());
        self.fill_gaps(&mut merged);
        let triangles = delta.surface_added.iter();
        merged.surface_added = triangles.map(|t| self.triangle(island, t)).collect();
        merged.apply(&mut self.mesh);
        merged.extend_particles(&mut self.positions);
        merged
    }

    /// A boundary triangle of an island in the numbers of the merged mesh.
    pub(crate) fn triangle(&self, island: usize, triangle: &BoundaryTriangle) -> BoundaryTriangle {
        let numbers = &self.numbers[island];
        BoundaryTriangle {
            tet: numbers.tets[triangle.tet.index()],
            particles: triangle.particles.map(|p| numbers.particles[p.index()]),
            ..*triangle
        }
    }

    /// Gives the numbers of deleted tets to the last ones, whichever islands they belong to. O(tets) if there are any.
    fn fill_gaps(&mut self, merged: &mut CutDelta) {
        if merged.deleted.is_empty() {
            return;
        }
        let after = merged.tets_after();
        let deleted = |tet: TetId| merged.deleted.binary_search_by_key(&tet, |d| d.tet).is_ok();
        let gaps = merged.deleted.iter().map(|deleted| deleted.tet);
        let gaps = gaps.take_while(|tet| tet.index() < after);
        let last = (after..merged.tets_before).map(TetId::new);
        let movers = last.filter(|&tet| !deleted(tet));
        let moves: Vec<(TetId, TetId)> = movers.zip(gaps).collect();
        let reshaped = merged.added.iter().map(|added| (added.tet, added.corners));
        let mut reshaped: Vec<(TetId, [ParticleId; 4])> = reshaped.collect();
        reshaped.sort_unstable_by_key(|(tet, _)| *tet);
        for numbers in &mut self.numbers {
            for number in &mut numbers.tets {
                if let Ok(i) = moves.binary_search_by_key(number, |(from, _)| *from) {
                    let (from, to) = moves[i];
                    *number = to;
                    let corners = self.mesh.tets[from.index()];
                    let relinked = merged.relinked.iter().find(|relinked| relinked.tet == from);
                    let corners = relinked.map_or(corners, |relinked| relinked.after);
                    let added = reshaped.binary_search_by_key(&from, |(tet, _)| *tet);
                    let corners = added.map_or(corners, |i| reshaped[i].1);
                    merged.moved.push(MovedTet { from, to, corners });
                }
            }
        }
        merged.moved.sort_unstable_by_key(|moved| moved.to);
    }

    /// Bytes of all arrays.
    pub(crate) fn bytes(&self) -> usize {
        let of = |numbers: &Numbers| size_of_val(&*numbers.particles) + size_of_val(&*numbers.tets);
        size_of_val(&*self.mesh.positions)
            + size_of_val(&*self.mesh.tets)
            + size_of_val(&*self.positions)
            + self.numbers.iter().map(of).sum::<usize>()
    }

    /// The number of an island's particle.
    pub(crate) fn particle(&self, island: usize, particle: usize) -> usize {
        self.numbers[island].particles[particle].index()
    }

    /// Merges per-tet values of all islands in the order of the merged mesh.
    pub(crate) fn of_tets<T: Copy + Default>(&self, of_islands: &[Vec<T>]) -> Vec<T> {
        let mut of_tets = vec![T::default(); self.mesh.tets.len()];
        for (numbers, of_island) in self.numbers.iter().zip(of_islands) {
            for (tet, value) in numbers.tets.iter().zip(of_island) {
                of_tets[tet.index()] = *value;
            }
        }
        of_tets
    }

    /// Copies the positions of the islands.
    pub(crate) fn collect_positions(&mut self, islands: &[Island]) {
        for (numbers, island) in self.numbers.iter().zip(islands) {
            for (p, x) in numbers.particles.iter().zip(&island.positions) {
                self.positions[p.index()] = *x;
            }
        }
    }

    /// The clusters of all islands and their colors: those of an island follow those of the islands before it, vacant numbers
    /// are left out. O(tets).
    pub(crate) fn partition(&self, islands: &[Island]) -> (Clustering, Coloring) {
        let mut labels = vec![ClusterId::NONE; self.mesh.tets.len()];
        let mut colors = Vec::new();
        for (numbers, island) in self.numbers.iter().zip(islands) {
            let partition = &island.partition;
            let mut names = Vec::with_capacity(partition.clustering.cluster_count());
            for (&size, &color) in partition
                .clustering
                .sizes()
                .iter()
                .zip(partition.coloring().colors())
            {
                names.push(ClusterId::new(colors.len()));
                colors.extend((size > 0).then_some(color));
            }
            for (t, tet) in numbers.tets.iter().enumerate() {
                if let Some(cluster) = partition.clustering.cluster_of(t) {
                    labels[tet.index()] = names[cluster.index()];
                }
            }
        }
        let clustering = Clustering::from_labels(labels)
            .expect("each island has at most as many clusters with a tet as it has tets");
        (clustering, Coloring::new(colors))
    }

    /// Compares with the islands.
    pub(crate) fn check(&self, islands: &[Island]) -> Result<(), Error> {
        let mut particles = vec![0_u32; self.mesh.positions.len()];
        let mut tets = vec![0_u32; self.mesh.tets.len()];
        let differs = |what: &str| {
            Err(Error::Inconsistent(format!(
                "{what} of the merged mesh differs"
            )))
        };
        for (g, (numbers, island)) in self.numbers.iter().zip(islands).enumerate() {
            let mesh = island.cuttable.mesh();
            if (numbers.particles.len(), numbers.tets.len())
                != (mesh.positions.len(), mesh.tets.len())
            {
                return differs("the size");
            }
            for (p, number) in numbers.particles.iter().enumerate() {
                particles[number.index()] += 1;
                if self.mesh.positions[number.index()] != mesh.positions[p]
                    || self.positions[number.index()] != island.positions[p]
                    || self.location(*number) != (g, p)
                {
                    return differs("a particle");
                }
            }
            for (t, number) in numbers.tets.iter().enumerate() {
                tets[number.index()] += 1;
                let corners = mesh.tets[t].map(|p| numbers.particles[p.index()]);
                if self.mesh.tets[number.index()] != corners {
                    return differs("a tet");
                }
            }
        }
        if particles.iter().chain(&tets).any(|count| *count != 1) {
            return differs("the numbering");
        }
        Ok(())
    }
}
