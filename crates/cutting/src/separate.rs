//! Separation: how the stars of the particles on a cut are split.
//!
//! The parts of a star that hang together keep one particle each: the part with the lowest tet the old one, the others
//! a copy. What hangs together is said by faces ([`Operation::separate`]) or, as in the paper (section 4.3), by shared
//! particles ([`Operation::separate_by_particles`]). Particles at the front of an unfinished stroke need no special
//! case: their star still hangs together around the front. Cost: O(s log s) for a star of s tets.
//!
//! The paper's criterion, read for one cut of a sound mesh with no particle exactly on the surface, gives the same
//! parts. If two tets on one side share a face that is not cut, that face has a particle off the surface, which was
//! there before. If they share such a particle v besides p, the tets around the edge from p to v form a fan, every face
//! of the fan holds v, and none of them is cut. Tets on different sides never share one. Where particles lie on the
//! surface, where tets lie on it as a whole, and where three or more sheets of boundary meet in an edge, the two
//! differ; [`crate::Separation`] says how.

use incise_mesh::{DisjointSets, ParticleId, TetId};

use crate::crumbs::Crumbs;
use crate::faces::{Behind, Face, sorted};
use crate::index::index;
use crate::operation::Operation;

/// The tets on both sides of a face, with their corners as they were before separation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SharedFace {
    pub(crate) tets: [TetId; 2],
    pub(crate) corners: [[ParticleId; 4]; 2],
}

impl SharedFace {
    /// Its particles, ascending.
    pub(crate) fn particles(&self) -> Option<[ParticleId; 3]> {
        let [one, other] = self.corners;
        let mut shared = one.into_iter().filter(|p| other.contains(p));
        Some(sorted([shared.next()?, shared.next()?, shared.next()?]))
    }
}

/// The tets around a particle and which of them hang together.
struct Star {
    particle: ParticleId,
    /// Ascending.
    tets: Vec<TetId>,
    /// A part is named by its lowest tet.
    parts: DisjointSets,
}

impl Star {
    fn join(&mut self, one: usize, other: usize) {
        let [one, other] = [one, other].map(index);
        self.parts.unite(one, other);
    }
}

impl Operation<'_> {
    /// Takes the star of each of `seeds` (ascending, all on the surface) apart along the faces that are cut: those with
    /// all particles `on` the surface whose tets it `parts`, unless a crumb keeps them.
    ///
    /// Both are asked about particles and faces as they were before separation.
    pub(crate) fn separate(
        &mut self,
        seeds: &[ParticleId],
        on: impl Fn(ParticleId) -> bool,
        parts: impl Fn(&SharedFace) -> bool,
    ) {
        let is_cut = |operation: &Operation<'_>, face: Face| {
            let Behind::Twin(twin) = operation.cuttable.faces.behind(face) else {
                return true;
            };
            let mesh = &operation.cuttable.mesh;
            let mut particles = face.particles(mesh).into_iter();
            particles.all(|p| on(operation.source(p))) && {
                let tets = [face.tet(), twin.tet()];
                let corners = tets.map(|t| mesh.tets[t.index()].map(|p| operation.source(p)));
                parts(&SharedFace { tets, corners })
            }
        };
        let mut crumbs = Crumbs::new(self.crumb_limit);
        self.separate_with(seeds, |operation, star| {
            for i in 0..star.tets.len() {
                for (face, other) in operation.inner_faces(star, i) {
                    if !is_cut(operation, face) || crumbs.keep(operation, face, &is_cut) {
                        star.join(i, other);
                    }
                }
            }
        });
        let (count, volume) = crumbs.kept(self);
        self.delta.crumbs += count;
        self.delta.crumb_volume += volume;
    }

    /// Separates by the paper's criterion: tets of a star stay together if they share another particle that `ties`.
    pub(crate) fn separate_by_particles(
        &mut self,
        seeds: &[ParticleId],
        ties: impl Fn(ParticleId) -> bool,
    ) {
        let mut held: Vec<(ParticleId, usize)> = Vec::new();
        self.separate_with(seeds, |operation, star| {
            held.clear();
            for (i, tet) in star.tets.iter().enumerate() {
                let corners = operation.cuttable.mesh.tets[tet.index()].into_iter();
                let others = corners.filter(|&p| p != star.particle && ties(operation.source(p)));
                held.extend(others.map(|p| (p, i)));
            }
            held.sort_unstable();
            for pair in held.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
                star.join(pair[0].1, pair[1].1);
            }
        });
    }

    fn separate_with(&mut self, seeds: &[ParticleId], mut join: impl FnMut(&Self, &mut Star)) {
        self.settle();
        let (tets, parts) = (Vec::new(), DisjointSets::default());
        let mut star = Star {
            particle: ParticleId(0),
            tets,
            parts,
        };
        let mut due = seeds.to_vec();
        let mut done: Vec<ParticleId> = Vec::new();
        while !due.is_empty() {
            let mut parted = Vec::new();
            for &seed in &due {
                star.particle = seed;
                star.tets.clear();
                star.tets.extend(self.cuttable.stars.around(seed));
                star.tets.sort_unstable();
                star.parts.reset(star.tets.len());
                join(self, &mut star);
                self.take_apart(&mut star, &mut parted);
            }
            // A stroke that crosses itself can open a face beside a particle it does not name.
            done.append(&mut due);
            done.sort_unstable();
            parted.retain(|p| done.binary_search(p).is_err());
            parted.sort_unstable();
            parted.dedup();
            due = parted;
        }
    }

    /// The faces that the `i`-th tet of a star shares with later ones.
    fn inner_faces(&self, star: &Star, i: usize) -> impl Iterator<Item = (Face, usize)> + use<> {
        let tet = star.tets[i];
        let corners = self.cuttable.mesh.tets[tet.index()];
        let shared = Face::of(tet).map(|face| {
            let holds = corners[face.opposite()] != star.particle;
            let Behind::Twin(twin) = self.cuttable.faces.behind(face) else {
                return None;
            };
            let later = holds && twin.tet() > tet;
            let found = later.then(|| star.tets.binary_search(&twin.tet()).ok());
            found.flatten().map(|other| (face, other))
        });
        shared.into_iter().flatten()
    }

    /// Gives every part of a star but the first its own copy of the particle.
    fn take_apart(&mut self, star: &mut Star, parted: &mut Vec<ParticleId>) {
        let part_of: Vec<u32> = (0_u32..)
            .take(star.tets.len())
            .map(|i| star.parts.root(i))
            .collect();
        if part_of.iter().all(|&part| part == 0) {
            return;
        }
        for i in 0..star.tets.len() {
            for (face, other) in self.inner_faces(star, i) {
                if part_of[i] != part_of[other] {
                    let particles = face.particles(&self.cuttable.mesh);
                    parted.extend(particles.map(|p| self.source(p)));
                    self.part(face);
                }
            }
        }
        let mut copies: Vec<(u32, ParticleId)> = Vec::new();
        for (&tet, &part) in star
            .tets
            .iter()
            .zip(&part_of)
            .filter(|(_, part)| **part > 0)
        {
            let known = copies.iter().find(|(p, _)| *p == part);
            let copy = known.map(|(_, copy)| *copy).unwrap_or_else(|| {
                let copy = self.push_copy(star.particle);
                copies.push((part, copy));
                copy
            });
            let corners = self.cuttable.mesh.tets[tet.index()];
            let seed = star.particle;
            self.relink(tet, corners.map(|p| if p == seed { copy } else { p }));
        }
    }
}
