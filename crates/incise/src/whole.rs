//! [`Whole`]: several groups of bodies seen as one mesh.
//!
//! At the start particles and tets are numbered body by body in the order of the scene. A cut keeps all numbers: new
//! particles and tets get the next ones, stroke by stroke and within a stroke group by group, each group's in the order
//! of its own delta. Each group numbers its own from 0; the lists here translate, and one delta of a group becomes one
//! of the whole. Only scenes with more than one group have a whole; a single group is its own.
//!
//! Cost: following a cut costs what the cut touched; clusters and colors of the whole are put together on request.

use glam::DVec3;
use incise_cutting::{
    AddedTet, BoundaryTriangle, CutDelta, EdgePoint, MovedTet, RelinkedTet, RemovedTet,
};
use incise_graph::{ClusterId, Clustering, Coloring};
use incise_mesh::{ParticleId, TetId, TetMesh};

use crate::Error;
use crate::body::Body;
use crate::group::Group;

/// The numbers in the whole of a group's particles and tets.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
struct Numbers {
    particles: Vec<ParticleId>,
    tets: Vec<TetId>,
}

impl Numbers {
    /// Appends particles of the group; their numbers in the whole are the next ones, so `places` gets theirs at its end.
    fn add_particles(
        &mut self,
        group: usize,
        new: impl Iterator<Item = ParticleId>,
        places: &mut Vec<(u32, ParticleId)>,
    ) {
        let group = u32::try_from(group).expect("each group has particles, numbered by 32 bits");
        for particle in new {
            places.push((group, ParticleId::new(self.particles.len())));
            self.particles.push(particle);
        }
    }
}

/// All groups as one mesh.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Whole {
    pub(crate) mesh: TetMesh,
    pub(crate) positions: Vec<DVec3>,
    numbers: Vec<Numbers>,
    /// For each particle its group and its number there.
    places: Vec<(u32, ParticleId)>,
}

impl Whole {
    /// The bodies as one mesh, before they go to their `islands`.
    pub(crate) fn new(bodies: &[Body], islands: &[usize]) -> Self {
        let mut mesh = TetMesh::default();
        let groups = islands.iter().max().map_or(0, |last| last + 1);
        let mut numbers: Vec<Numbers> = (0..groups).map(|_| Numbers::default()).collect();
        let mut places = Vec::new();
        for (body, &island) in bodies.iter().zip(islands) {
            let first = mesh.positions.len();
            let shifted = |p: ParticleId| ParticleId::new(first + p.index());
            let first_tet = mesh.tets.len();
            mesh.positions.extend(&body.mesh.positions);
            let tets = body.mesh.tets.iter().map(|tet| tet.map(shifted));
            mesh.tets.extend(tets);
            let numbers = &mut numbers[island];
            let particles = (first..mesh.positions.len()).map(ParticleId::new);
            numbers.add_particles(island, particles, &mut places);
            let tets = (first_tet..mesh.tets.len()).map(TetId::new);
            numbers.tets.extend(tets);
        }
        Self {
            positions: mesh.positions.clone(),
            mesh,
            numbers,
            places,
        }
    }

    /// A group that is the only one, seen as one of several.
    pub(crate) fn of_one(group: &Group) -> Self {
        let mut whole = Self {
            mesh: TetMesh::default(),
            positions: Vec::new(),
            numbers: Vec::new(),
            places: Vec::new(),
        };
        whole.add_group(group);
        whole
    }

    /// Appends a group: its particles and tets get the next numbers.
    pub(crate) fn add_group(&mut self, group: &Group) {
        let mesh = group.cuttable.mesh();
        let (first, first_tet) = (self.mesh.positions.len(), self.mesh.tets.len());
        let shifted = |p: ParticleId| ParticleId::new(first + p.index());
        self.mesh.positions.extend(&mesh.positions);
        self.positions.extend(&group.positions);
        let tets = mesh.tets.iter().map(|tet| tet.map(shifted));
        self.mesh.tets.extend(tets);
        let mut numbers = Numbers::default();
        let particles = (first..self.mesh.positions.len()).map(ParticleId::new);
        numbers.add_particles(self.numbers.len(), particles, &mut self.places);
        numbers
            .tets
            .extend((first_tet..self.mesh.tets.len()).map(TetId::new));
        self.numbers.push(numbers);
    }

    /// The group of a particle and its number there. O(1).
    pub(crate) fn place(&self, particle: ParticleId) -> (usize, usize) {
        let (group, number) = self.places[particle.index()];
        (group as usize, number.index())
    }

    /// Follows a cut in one group; returns what it changed in the numbers of the whole.
    pub(crate) fn follow(&mut self, group: usize, delta: &CutDelta) -> CutDelta {
        let numbers = &mut self.numbers[group];
        let (particles_before, tets_before) = (self.mesh.positions.len(), self.mesh.tets.len());
        let new = delta.particles_after() - delta.particles_before;
        let particles = (particles_before..particles_before + new).map(ParticleId::new);
        numbers.add_particles(group, particles, &mut self.places);
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
        let mut whole = CutDelta {
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
            bent: delta.bent.iter().map(|&p| particle(p)).collect(),
            worst_volume_ratio: delta.worst_volume_ratio,
            dihedral: delta.dihedral,
        };
        whole.deleted.sort_unstable_by_key(|deleted| deleted.tet);

        // A tet that moves within its group keeps its number in the whole.
        for moved in &delta.moved {
            numbers.tets[moved.to.index()] = numbers.tets[moved.from.index()];
        }
        numbers.tets.truncate(delta.tets_after());
        self.fill_gaps(&mut whole);
        let triangles = delta.surface_added.iter();
        whole.surface_added = triangles.map(|t| self.triangle(group, t)).collect();
        whole.apply(&mut self.mesh);
        whole.extend_particles(&mut self.positions);
        whole
    }

    /// A boundary triangle of a group in the numbers of the whole.
    pub(crate) fn triangle(&self, group: usize, triangle: &BoundaryTriangle) -> BoundaryTriangle {
        let numbers = &self.numbers[group];
        BoundaryTriangle {
            tet: numbers.tets[triangle.tet.index()],
            particles: triangle.particles.map(|p| numbers.particles[p.index()]),
            ..*triangle
        }
    }

    /// Gives the numbers of deleted tets to the last ones, whichever groups they belong to. O(tets) if there are any.
    fn fill_gaps(&mut self, whole: &mut CutDelta) {
        if whole.deleted.is_empty() {
            return;
        }
        let after = whole.tets_after();
        let deleted = |tet: TetId| whole.deleted.binary_search_by_key(&tet, |d| d.tet).is_ok();
        let gaps = whole.deleted.iter().map(|deleted| deleted.tet);
        let gaps = gaps.take_while(|tet| tet.index() < after);
        let last = (after..whole.tets_before).map(TetId::new);
        let movers = last.filter(|&tet| !deleted(tet));
        let moves: Vec<(TetId, TetId)> = movers.zip(gaps).collect();
        for numbers in &mut self.numbers {
            for number in &mut numbers.tets {
                if let Ok(i) = moves.binary_search_by_key(number, |(from, _)| *from) {
                    let (from, to) = moves[i];
                    *number = to;
                    let corners = self.mesh.tets[from.index()];
                    let relinked = whole.relinked.iter().find(|relinked| relinked.tet == from);
                    let corners = relinked.map_or(corners, |relinked| relinked.after);
                    whole.moved.push(MovedTet { from, to, corners });
                }
            }
        }
        whole.moved.sort_unstable_by_key(|moved| moved.to);
    }

    /// Bytes of all arrays.
    pub(crate) fn bytes(&self) -> usize {
        let of = |numbers: &Numbers| size_of_val(&*numbers.particles) + size_of_val(&*numbers.tets);
        size_of_val(&*self.mesh.positions)
            + size_of_val(&*self.mesh.tets)
            + size_of_val(&*self.positions)
            + self.numbers.iter().map(of).sum::<usize>()
    }

    /// The number of a group's particle.
    #[cfg(feature = "advise")]
    pub(crate) fn particle(&self, group: usize, particle: usize) -> usize {
        self.numbers[group].particles[particle].index()
    }

    /// Puts what each group says of its tets in the order of the whole.
    pub(crate) fn of_tets<T: Copy + Default>(&self, of_groups: &[Vec<T>]) -> Vec<T> {
        let mut of_tets = vec![T::default(); self.mesh.tets.len()];
        for (numbers, of_group) in self.numbers.iter().zip(of_groups) {
            for (tet, value) in numbers.tets.iter().zip(of_group) {
                of_tets[tet.index()] = *value;
            }
        }
        of_tets
    }

    /// Takes over the groups' positions.
    pub(crate) fn collect_positions(&mut self, groups: &[Group]) {
        for (numbers, group) in self.numbers.iter().zip(groups) {
            for (p, x) in numbers.particles.iter().zip(&group.positions) {
                self.positions[p.index()] = *x;
            }
        }
    }

    /// The clusters of all groups and their colors: those of a group follow those of the groups before it, vacant numbers
    /// are left out. O(tets).
    pub(crate) fn plan(&self, groups: &[Group]) -> (Clustering, Coloring) {
        let mut labels = vec![ClusterId::NONE; self.mesh.tets.len()];
        let mut colors = Vec::new();
        for (numbers, group) in self.numbers.iter().zip(groups) {
            let plan = &group.plan;
            let mut names = Vec::with_capacity(plan.clustering.cluster_count());
            for (&size, &color) in plan.clustering.sizes().iter().zip(plan.coloring().colors()) {
                names.push(ClusterId::new(colors.len()));
                colors.extend((size > 0).then_some(color));
            }
            for (t, tet) in numbers.tets.iter().enumerate() {
                if let Some(cluster) = plan.clustering.cluster_of(t) {
                    labels[tet.index()] = names[cluster.index()];
                }
            }
        }
        let clustering = Clustering::from_labels(labels)
            .expect("each group has at most as many clusters with a tet as it has tets");
        (clustering, Coloring::new(colors))
    }

    /// Compares with the groups.
    pub(crate) fn check(&self, groups: &[Group]) -> Result<(), Error> {
        let mut particles = vec![0_u32; self.mesh.positions.len()];
        let mut tets = vec![0_u32; self.mesh.tets.len()];
        let differs = |what: &str| Err(Error::Inconsistent(format!("{what} of the whole differs")));
        for (g, (numbers, group)) in self.numbers.iter().zip(groups).enumerate() {
            let mesh = group.cuttable.mesh();
            if (numbers.particles.len(), numbers.tets.len())
                != (mesh.positions.len(), mesh.tets.len())
            {
                return differs("the size");
            }
            for (p, number) in numbers.particles.iter().enumerate() {
                particles[number.index()] += 1;
                if self.mesh.positions[number.index()] != mesh.positions[p]
                    || self.positions[number.index()] != group.positions[p]
                    || self.place(*number) != (g, p)
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
