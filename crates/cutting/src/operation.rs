//! [`Operation`]: one cut in progress: splits, separates and writes the delta.
//!
//! The order of work: all crossed edges get their particle, the tets around them are split by ordered bisection, then
//! each on-surface particle's star comes apart into its components. Every part looks only at the tets around the
//! particles concerned, so the cost follows the cut. The mesh is changed in place; the slots' first state is kept
//! until the delta is written.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;
use incise_mesh::{ParticleId, TetId, signed_volume};

use crate::delta::{AddedTet, CutDelta, EdgePoint, RelinkedTet, RemovedTet};
use crate::sides::root;
use crate::{CuttableMesh, SplitEdge, split_tet};

/// An edge and where it is crossed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Crossing {
    /// The ends, smaller id first.
    pub(crate) ends: [ParticleId; 2],
    /// Where: 0 at the first end, 1 at the second.
    pub(crate) parameter: f64,
}

/// A face with the tets on both sides.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SharedFace {
    pub(crate) particles: [ParticleId; 3],
    pub(crate) tets: [TetId; 2],
    pub(crate) corners: [[ParticleId; 4]; 2],
}

/// A cut in progress.
pub(crate) struct Operation<'a> {
    pub(crate) cuttable: &'a mut CuttableMesh,
    pub(crate) delta: CutDelta,
    first_state: BTreeMap<TetId, [ParticleId; 4]>,
    split: BTreeSet<TetId>,
    /// For each new slot the slot of the tet it was a part of before the operation.
    ancestors: Vec<TetId>,
}

impl<'a> Operation<'a> {
    pub(crate) fn begin(cuttable: &'a mut CuttableMesh) -> Self {
        let delta = CutDelta {
            particles_before: cuttable.mesh.positions.len(),
            tets_before: cuttable.mesh.tets.len(),
            worst_volume_ratio: 1.0,
            ..CutDelta::default()
        };
        Self {
            cuttable,
            delta,
            first_state: BTreeMap::new(),
            split: BTreeSet::new(),
            ancestors: Vec::new(),
        }
    }

    /// Puts a particle on each crossed edge and splits the tets around. `crossings` ascend by their ends.
    ///
    /// Must not be called after [`Operation::separate`]. Returns the tets touched, ascending.
    pub(crate) fn split(&mut self, crossings: &[Crossing]) -> Vec<TetId> {
        let mesh = &mut self.cuttable.mesh;
        let mut edges: Vec<(f64, SplitEdge)> = Vec::with_capacity(crossings.len());
        for crossing in crossings {
            let point = ParticleId::new(mesh.positions.len());
            let on_edge = EdgePoint {
                ends: crossing.ends,
                parameter: crossing.parameter,
            };
            let [a, b] = crossing.ends.map(|p| mesh.positions[p.index()]);
            edges.push((
                a.distance_squared(b),
                SplitEdge {
                    ends: crossing.ends,
                    point,
                },
            ));
            mesh.positions.push(on_edge.interpolate(&mesh.positions));
            self.cuttable.stars.push_particle();
            self.delta.points.push(on_edge);
        }
        // The one global order: longest edge first, then by ends. Particle ids follow the ends, so they break ties.
        edges.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.point.cmp(&b.1.point)));

        let mut work: Vec<(TetId, usize)> = Vec::new();
        for (rank, (_, edge)) in edges.iter().enumerate() {
            let [a, b] = edge.ends;
            let holds_b = |t: &TetId| mesh.tets[t.index()].contains(&b);
            work.extend(
                self.cuttable
                    .stars
                    .around(a)
                    .filter(holds_b)
                    .map(|t| (t, rank)),
            );
        }
        work.sort_unstable();

        let mut touched = Vec::new();
        let mut children = Vec::new();
        for group in work.chunk_by(|a, b| a.0 == b.0) {
            let tet = group[0].0;
            let of_tet: Vec<SplitEdge> = group.iter().map(|&(_, rank)| edges[rank].1).collect();
            split_tet(self.cuttable.mesh.tets[tet.index()], &of_tet, &mut children);
            self.replace(tet, &children, &mut touched);
        }
        touched.sort_unstable();
        touched
    }

    fn replace(&mut self, tet: TetId, children: &[[ParticleId; 4]], touched: &mut Vec<TetId>) {
        let ancestor = match tet.index().checked_sub(self.delta.tets_before) {
            Some(new) => self.ancestors[new],
            None => tet,
        };
        self.split.insert(ancestor);
        self.set_corners(tet, children[0]);
        touched.push(tet);
        for &child in &children[1..] {
            let slot = TetId::new(self.cuttable.mesh.tets.len());
            self.cuttable.mesh.tets.push(child);
            self.cuttable.stars.push_tet(slot, child);
            self.ancestors.push(ancestor);
            touched.push(slot);
        }
    }

    fn set_corners(&mut self, tet: TetId, corners: [ParticleId; 4]) {
        let before = std::mem::replace(&mut self.cuttable.mesh.tets[tet.index()], corners);
        for (k, (from, to)) in (0..).zip(before.into_iter().zip(corners)) {
            self.cuttable.stars.relink(tet, k, from, to);
        }
        if tet.index() < self.delta.tets_before {
            self.first_state.entry(tet).or_insert(before);
        }
    }

    /// Takes the star of each of `seeds` (ascending, all on the surface) apart where it was cut through.
    ///
    /// The parts of a star that hang together through faces that are not cut keep one particle each: the part with the
    /// lowest tet the old one, the others a copy. Particles at the front of an unfinished stroke need no special case:
    /// their star still hangs together around the front. This is the paper's shared-vertex criterion (section 4.3) put
    /// so that it also holds for snapped particles, partial cuts and meshes cut before.
    ///
    /// `is_cut` is asked about faces as they were before separation. Cost: the sum of the sizes of the stars.
    pub(crate) fn separate(&mut self, seeds: &[ParticleId], is_cut: impl Fn(&SharedFace) -> bool) {
        let first_copy = self.delta.particles_before + self.delta.points.len();
        let mut star: Vec<TetId> = Vec::new();
        let mut faces: Vec<([ParticleId; 2], usize)> = Vec::new();
        let mut parent: Vec<usize> = Vec::new();
        for &seed in seeds {
            star.clear();
            star.extend(self.cuttable.stars.around(seed));
            star.sort_unstable();

            let copies = &self.delta.copies;
            let source = |p: ParticleId| {
                p.index()
                    .checked_sub(first_copy)
                    .map_or(p, |copy| copies[copy])
            };
            let tets = &self.cuttable.mesh.tets;
            faces.clear();
            for (i, tet) in star.iter().enumerate() {
                let corners = tets[tet.index()];
                let others: [ParticleId; 3] = others_than(corners, seed);
                for pair in [
                    [others[0], others[1]],
                    [others[0], others[2]],
                    [others[1], others[2]],
                ] {
                    faces.push(([pair[0].min(pair[1]), pair[0].max(pair[1])], i));
                }
            }
            faces.sort_unstable();

            parent.clear();
            parent.extend(0..star.len());
            for shared in faces.chunk_by(|a, b| a.0 == b.0) {
                let [(pair, first), (_, second)] = *shared else {
                    continue;
                };
                let tets = [star[first], star[second]];
                let face = SharedFace {
                    particles: [seed, pair[0], pair[1]].map(source),
                    tets,
                    corners: tets.map(|t| self.cuttable.mesh.tets[t.index()].map(source)),
                };
                if !is_cut(&face) {
                    let (a, b) = (root(&mut parent, first), root(&mut parent, second));
                    // The lower index becomes the root, so each part is named by its lowest tet.
                    parent[a.max(b)] = a.min(b);
                }
            }
            self.part(seed, &star, &mut parent);
        }
    }

    /// Gives every part of a star but the first its own copy of the particle.
    fn part(&mut self, particle: ParticleId, star: &[TetId], parent: &mut [usize]) {
        let mut copy_of_part: Vec<(usize, ParticleId)> = Vec::new();
        for (i, &tet) in star.iter().enumerate() {
            let part = root(parent, i);
            if part == 0 {
                continue;
            }
            let known = copy_of_part
                .iter()
                .find(|(p, _)| *p == part)
                .map(|(_, copy)| *copy);
            let copy = known.unwrap_or_else(|| {
                let copy = self.push_copy(particle);
                copy_of_part.push((part, copy));
                copy
            });
            let corners = self.cuttable.mesh.tets[tet.index()];
            self.set_corners(tet, corners.map(|p| if p == particle { copy } else { p }));
        }
    }

    fn push_copy(&mut self, source: ParticleId) -> ParticleId {
        let mesh = &mut self.cuttable.mesh;
        let copy = ParticleId::new(mesh.positions.len());
        mesh.positions.push(mesh.positions[source.index()]);
        self.cuttable.stars.push_particle();
        self.delta.copies.push(source);
        copy
    }

    /// Writes the delta. `side` is asked about particles as they were before separation.
    pub(crate) fn finish(self, side: impl Fn(&[DVec3], [ParticleId; 4]) -> bool) -> CutDelta {
        let Self {
            cuttable,
            mut delta,
            first_state,
            split,
            ancestors,
        } = self;
        let mesh = &cuttable.mesh;
        let first_copy = delta.particles_before + delta.points.len();
        let source = |p: ParticleId| {
            p.index()
                .checked_sub(first_copy)
                .map_or(p, |copy| delta.copies[copy])
        };

        let mut families: Vec<(TetId, TetId)> = split.iter().map(|&t| (t, t)).collect();
        families.extend(
            ancestors
                .iter()
                .enumerate()
                .map(|(i, &a)| (a, TetId::new(delta.tets_before + i))),
        );
        families.sort_unstable();
        let added: Vec<AddedTet> = families
            .iter()
            .map(|&(parent, tet)| {
                let corners = mesh.tets[tet.index()];
                AddedTet {
                    tet,
                    parent,
                    corners,
                    positive: side(&mesh.positions, corners.map(source)),
                }
            })
            .collect();
        for (&tet, &before) in &first_state {
            if split.contains(&tet) {
                delta.removed.push(RemovedTet {
                    tet,
                    corners: before,
                });
            } else {
                delta.relinked.push(RelinkedTet {
                    tet,
                    before,
                    after: mesh.tets[tet.index()],
                });
            }
        }
        let rest_volume =
            |corners: [ParticleId; 4]| signed_volume(corners.map(|p| mesh.positions[p.index()]));
        for family in added.chunk_by(|a, b| a.parent == b.parent) {
            let parent_volume = rest_volume(first_state[&family[0].parent]);
            for child in family {
                let ratio = rest_volume(child.corners) / parent_volume;
                delta.worst_volume_ratio = delta.worst_volume_ratio.min(ratio);
            }
        }
        delta.added = added;
        delta
    }
}

/// The three corners of a tet other than `particle`.
fn others_than(corners: [ParticleId; 4], particle: ParticleId) -> [ParticleId; 3] {
    let mut others = [particle; 3];
    for (slot, corner) in others
        .iter_mut()
        .zip(corners.into_iter().filter(|&c| c != particle))
    {
        *slot = corner;
    }
    others
}
