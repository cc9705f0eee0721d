//! [`Operation`]: one cut in progress: splits, separates and writes the delta.
//!
//! The order of work: all crossed edges get their particle, the tets around them are split by ordered bisection, then
//! each on-surface particle's star separates into its components (module `separate`). Every part looks only at the tets
//! around the particles concerned, so the cost follows the cut. The mesh is changed in place; the first state of what
//! changed is kept until the delta is written.

use std::collections::BTreeMap;
use std::collections::hash_map::Entry;

use glam::DVec3;
use incise_mesh::{ParticleId, TetId, signed_volume};

use crate::bisect::split_linked;
use crate::delta::{
    AddedTet, BoundaryTriangle, CutDelta, EdgePoint, FaceTag, RelinkedTet, RemovedTet,
};
use crate::faces::{Behind, Face, face_of};
use crate::quality::{Dihedrals, is_thin};
use crate::{CutError, CutOptions, CuttableMesh, SplitEdge};

/// An edge and where it is crossed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Crossing {
    /// The ends, smaller id first.
    pub(crate) ends: [ParticleId; 2],
    /// Where: 0 at the first end, 1 at the second.
    pub(crate) parameter: f64,
}

impl Crossing {
    fn point(&self) -> EdgePoint {
        EdgePoint {
            ends: self.ends,
            parameter: self.parameter,
        }
    }

    /// The end that is nearer, the first of two that are as near.
    pub(crate) fn nearer_end(&self) -> ParticleId {
        self.ends[usize::from(self.parameter > 0.5)]
    }
}

/// Why a split was not made. It has changed nothing then.
#[derive(Debug)]
pub(crate) enum SplitError {
    /// There would be too many tets.
    TooMany(CutError),
    /// At these crossings, numbers ascending, tets would become too thin to have a volume: they must move to an end.
    TooThin(Vec<usize>),
}

/// A tet as it was before the operation.
struct Original {
    corners: [ParticleId; 4],
    /// What was on the boundary.
    tags: [Option<FaceTag>; 4],
    /// Whether it was split; otherwise its corners have changed.
    split: bool,
}

/// A cut in progress.
pub(crate) struct Operation<'a> {
    pub(crate) cuttable: &'a mut CuttableMesh,
    pub(crate) delta: CutDelta,
    /// Number of the cut, with which faces that it opens are tagged.
    number: u32,
    max_tets: usize,
    /// Parts of a smaller volume do not come off, in m³.
    pub(crate) crumb_limit: f64,
    first: BTreeMap<TetId, Original>,
    /// For each new slot the slot of the tet it was a part of before the operation.
    ancestors: Vec<TetId>,
}

impl<'a> Operation<'a> {
    pub(crate) fn begin(cuttable: &'a mut CuttableMesh, options: &CutOptions) -> Self {
        let delta = CutDelta {
            particles_before: cuttable.mesh.positions.len(),
            tets_before: cuttable.mesh.tets.len(),
            worst_volume_ratio: 1.0,
            ..CutDelta::default()
        };
        let crumb_limit = options.crumbs * cuttable.mean_volume;
        Self {
            cuttable,
            delta,
            crumb_limit,
            number: options.tag,
            max_tets: options.max_tets,
            first: BTreeMap::new(),
            ancestors: Vec::new(),
        }
    }

    /// Puts a particle on each crossed edge and splits the tets around. `crossings` ascend by their ends.
    ///
    /// Must not be called after [`Operation::separate`]. Returns the tets touched, ascending.
    pub(crate) fn split(&mut self, crossings: &[Crossing]) -> Result<Vec<TetId>, SplitError> {
        let mesh = &mut self.cuttable.mesh;
        let mut edges: Vec<(f64, SplitEdge)> = Vec::with_capacity(crossings.len());
        for (i, crossing) in crossings.iter().enumerate() {
            let [a, b] = crossing.ends.map(|p| mesh.positions[p.index()]);
            let edge = SplitEdge {
                ends: crossing.ends,
                point: ParticleId::new(mesh.positions.len() + i),
            };
            edges.push((a.distance_squared(b), edge));
        }
        // The one global order: longest edge first, then by ends. Particle ids follow the ends, so they break ties.
        edges.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.point.cmp(&b.1.point)));

        let mut work: Vec<(TetId, usize)> = Vec::new();
        for (rank, (_, edge)) in edges.iter().enumerate() {
            let [a, b] = edge.ends;
            let holds_b = |t: &TetId| mesh.tets[t.index()].contains(&b);
            let around = self.cuttable.stars.around(a).filter(holds_b);
            work.extend(around.map(|t| (t, rank)));
        }
        work.sort_unstable();

        let points: Vec<EdgePoint> = crossings.iter().map(Crossing::point).collect();
        let at_rest: Vec<DVec3> = points
            .iter()
            .map(|point| point.interpolate(&mesh.positions))
            .collect();
        let at = |p: ParticleId| match p.index().checked_sub(mesh.positions.len()) {
            Some(new) => at_rest[new],
            None => mesh.positions[p.index()],
        };
        let mut thin: Vec<usize> = Vec::new();

        let mut families: Vec<(TetId, usize)> = Vec::new();
        let mut children = Vec::new();
        let (mut of_tet, mut family) = (Vec::new(), Vec::new());
        for group in work.chunk_by(|a, b| a.0 == b.0) {
            let tet = group[0].0;
            of_tet.clear();
            of_tet.extend(group.iter().map(|&(_, rank)| edges[rank].1));
            let whole = (mesh.tets[tet.index()], self.cuttable.faces.links_of(tet));
            split_linked(whole, &of_tet, &mut family);
            if family.iter().any(|(corners, _)| is_thin(corners.map(at))) {
                let first = mesh.positions.len();
                thin.extend(of_tet.iter().map(|edge| edge.point.index() - first));
            }
            families.push((tet, family.len()));
            children.append(&mut family);
        }
        let tets = mesh.tets.len() + children.len() - families.len();
        if tets > self.max_tets {
            let limit = self.max_tets;
            return Err(SplitError::TooMany(CutError::TooManyTets { tets, limit }));
        }
        if !thin.is_empty() {
            thin.sort_unstable();
            thin.dedup();
            return Err(SplitError::TooThin(thin));
        }

        for &x in &at_rest {
            let particle = ParticleId::new(mesh.positions.len());
            mesh.positions.push(x);
            self.cuttable.stars.push_particle();
            self.cuttable.places.enter(particle, x);
        }
        self.delta.points.extend(points);
        let mut touched = Vec::with_capacity(children.len());
        let mut children = children.into_iter();
        for (tet, size) in families {
            self.replace(tet, children.by_ref().take(size), &mut touched);
        }
        touched.sort_unstable();
        Ok(touched)
    }

    /// Gives a tet's slot to the first child and appends the others.
    fn replace(
        &mut self,
        tet: TetId,
        children: impl Iterator<Item = ([ParticleId; 4], [u32; 4])>,
        touched: &mut Vec<TetId>,
    ) {
        let ancestor = match tet.index().checked_sub(self.delta.tets_before) {
            Some(new) => self.ancestors[new],
            None => tet,
        };
        for (i, (corners, links)) in children.enumerate() {
            let slot = if i == 0 {
                self.note(tet, true);
                self.set_corners(tet, corners);
                tet
            } else {
                let slot = TetId::new(self.cuttable.mesh.tets.len());
                self.cuttable.mesh.tets.push(corners);
                self.cuttable.stars.push_tet(slot, corners);
                self.ancestors.push(ancestor);
                slot
            };
            self.cuttable.faces.set_links(slot, links);
            touched.push(slot);
        }
    }

    /// Notes the state of a tet before its first change.
    pub(crate) fn note(&mut self, tet: TetId, split: bool) {
        if tet.index() >= self.delta.tets_before {
            return;
        }
        let faces = &self.cuttable.faces;
        self.first.entry(tet).or_insert_with(|| Original {
            corners: self.cuttable.mesh.tets[tet.index()],
            tags: faces.links_of(tet).map(|link| faces.tag_of(link)),
            split,
        });
    }

    /// Hangs a whole tet on other particles.
    pub(crate) fn relink(&mut self, tet: TetId, corners: [ParticleId; 4]) {
        self.note(tet, false);
        self.set_corners(tet, corners);
    }

    fn set_corners(&mut self, tet: TetId, corners: [ParticleId; 4]) {
        let before = std::mem::replace(&mut self.cuttable.mesh.tets[tet.index()], corners);
        for (k, (from, to)) in (0..).zip(before.into_iter().zip(corners)) {
            self.cuttable.stars.relink(tet, k, from, to);
        }
    }

    /// Makes a face and its twin boundary triangles of this cut.
    pub(crate) fn part(&mut self, face: Face) {
        if let Behind::Twin(twin) = self.cuttable.faces.behind(face) {
            // Their tags are noted as they were.
            self.note(face.tet(), false);
            self.note(twin.tet(), false);
            self.open(face);
            let tag = FaceTag::Cut(self.number);
            self.cuttable.faces.open(twin, tag);
        }
    }

    /// Makes a face a boundary triangle, which stands for both sides.
    fn open(&mut self, face: Face) {
        let CuttableMesh {
            mesh,
            faces,
            sheets,
            ..
        } = &mut *self.cuttable;
        faces.open(face, FaceTag::Cut(self.number));
        if sheets.is_recording {
            sheets.enter(face.particles(mesh), self.number, &mesh.positions);
            self.delta.opened += 1;
        }
    }

    /// Makes a face whose neighbor is taken away a boundary triangle of this cut.
    pub(crate) fn expose(&mut self, face: Face) {
        self.note(face.tet(), false);
        self.open(face);
    }

    pub(crate) fn push_copy(&mut self, source: ParticleId) -> ParticleId {
        let mesh = &mut self.cuttable.mesh;
        let copy = ParticleId::new(mesh.positions.len());
        let x = mesh.positions[source.index()];
        mesh.positions.push(x);
        self.cuttable.stars.push_particle();
        self.cuttable.places.enter(source, x);
        self.cuttable.places.enter(copy, x);
        if let Some(&distance) = self.cuttable.bent.get(&source) {
            self.cuttable.bent.insert(copy, distance);
        }
        self.delta.copies.push(source);
        copy
    }

    /// Notes that the surface was bent to a particle over a distance. Must not be called after [`Operation::separate`].
    pub(crate) fn bend(&mut self, particle: ParticleId, distance: f64) {
        if let Entry::Vacant(entry) = self.cuttable.bent.entry(particle) {
            entry.insert(distance);
            self.delta.bent.push(particle);
        }
    }

    /// The particle that a copy made by this operation was made of, or the particle itself.
    pub(crate) fn source(&self, particle: ParticleId) -> ParticleId {
        let first_copy = self.delta.particles_before + self.delta.points.len();
        let copy = particle.index().checked_sub(first_copy);
        copy.map_or(particle, |copy| self.delta.copies[copy])
    }

    /// Lets the split tets find their neighbors.
    pub(crate) fn settle(&mut self) {
        let split = self.first.iter().filter(|(_, first)| first.split);
        let mut split: Vec<TetId> = split.map(|(&tet, _)| tet).collect();
        split.extend((self.delta.tets_before..self.cuttable.mesh.tets.len()).map(TetId::new));
        self.cuttable.faces.settle(&self.cuttable.mesh, &split);
    }

    /// Takes everything back.
    pub(crate) fn roll_back(mut self) {
        self.settle();
        let (cuttable, delta) = self.write(|_, _| true);
        delta.take_back(cuttable);
    }

    /// Writes the delta. `side` is asked about particles as they were before separation.
    pub(crate) fn finish(self, side: impl Fn(&[DVec3], [ParticleId; 4]) -> bool) -> CutDelta {
        self.write(side).1
    }

    pub(crate) fn write(
        self,
        side: impl Fn(&[DVec3], [ParticleId; 4]) -> bool,
    ) -> (&'a mut CuttableMesh, CutDelta) {
        let mesh = &self.cuttable.mesh;
        let mut families: Vec<(TetId, TetId)> = Vec::new();
        families.extend(
            self.first
                .iter()
                .filter(|(_, first)| first.split)
                .map(|(&t, _)| (t, t)),
        );
        let new = self.ancestors.iter().enumerate();
        families.extend(new.map(|(i, &a)| (a, TetId::new(self.delta.tets_before + i))));
        families.sort_unstable();
        let added = families.iter().map(|&(parent, tet)| {
            let corners = mesh.tets[tet.index()];
            AddedTet {
                tet,
                parent,
                corners,
                positive: side(&mesh.positions, corners.map(|p| self.source(p))),
            }
        });
        let added: Vec<AddedTet> = added.collect();
        let (surface_removed, surface_added) = self.boundary(&added);

        let mut delta = self.delta;
        for (&tet, first) in &self.first {
            let (before, after) = (first.corners, mesh.tets[tet.index()]);
            if first.split {
                let corners = before;
                delta.removed.push(RemovedTet { tet, corners });
            } else if before != after {
                delta.relinked.push(RelinkedTet { tet, before, after });
            }
        }
        let at_rest = |corners: [ParticleId; 4]| corners.map(|p| mesh.positions[p.index()]);
        let mut dihedrals = Dihedrals::default();
        for family in added.chunk_by(|a, b| a.parent == b.parent) {
            let parent_volume = signed_volume(at_rest(self.first[&family[0].parent].corners));
            for child in family {
                let corners = at_rest(child.corners);
                let ratio = signed_volume(corners) / parent_volume;
                delta.worst_volume_ratio = delta.worst_volume_ratio.min(ratio);
                dihedrals.add(corners);
            }
        }
        delta.dihedral = dihedrals.range();
        delta.added = added;
        delta.surface_removed = surface_removed;
        delta.surface_added = surface_added;
        (self.cuttable, delta)
    }

    /// What the boundary lost and gained, each ascending by tet and face.
    fn boundary(&self, added: &[AddedTet]) -> (Vec<BoundaryTriangle>, Vec<BoundaryTriangle>) {
        let (mesh, faces) = (&self.cuttable.mesh, &self.cuttable.faces);
        let (mut removed, mut new) = (Vec::new(), Vec::new());
        for (&tet, first) in &self.first {
            let after = mesh.tets[tet.index()];
            for (face, tag) in Face::of(tet).into_iter().zip(first.tags) {
                let before = face_of(first.corners, face.opposite());
                let kept = !first.split && before == face_of(after, face.opposite());
                if let Some(tag) = tag.filter(|_| !kept) {
                    removed.push(BoundaryTriangle {
                        tet,
                        opposite: [0, 1, 2, 3][face.opposite()],
                        particles: before,
                        tag,
                    });
                }
                let old = first.split || (kept && tag.is_some());
                if !old {
                    new.extend(faces.triangle(mesh, face));
                }
            }
        }
        for child in added {
            let of_child = Face::of(child.tet);
            new.extend(
                of_child
                    .into_iter()
                    .filter_map(|face| faces.triangle(mesh, face)),
            );
        }
        new.sort_unstable_by_key(|triangle| (triangle.tet, triangle.opposite));
        (removed, new)
    }
}
