//! Which side of the surface of a stroke the tets along it belong to.
//!
//! Most tets have a particle off the surface that tells. Those with all particles on it (snapped) join a neighbor,
//! across the face that lies most across the surface: left to themselves they could be cut off on all sides and become
//! chips. The method is Kruskal's: shared faces in ascending order of how much they lie along the surface, joining sets
//! of tets as long as one of both has no side. A side once given is kept for the rest of the stroke, else a face could
//! be open at one particle and closed at another. Cost: O(n log n) for n tets along the surface.

use std::collections::HashMap;

use foldhash::fast::FixedState;
use glam::DVec3;
use incise_mesh::{DisjointSets, ParticleId, TetId, TetMesh};

use crate::CutDelta;
use crate::blade::Blade;
use crate::index::index;
use crate::motion::Motion;
use crate::surface::CutSurface;

/// The sides given to tets with all particles on the surface, for as long as they are not split.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct GivenSides(HashMap<TetId, bool, FixedState>);

impl GivenSides {
    /// Forgets a tet that was split.
    pub(crate) fn forget(&mut self, split: TetId) -> Option<bool> {
        self.0.remove(&split)
    }

    /// Gives a tet its side back.
    pub(crate) fn restore(&mut self, tet: TetId, side: bool) {
        self.0.insert(tet, side);
    }

    /// Updates the tets after a cut or a removal made outside of the stroke.
    pub(crate) fn apply_delta(&mut self, delta: &CutDelta) {
        if self.0.is_empty() {
            return;
        }
        for gone in delta.removed.iter().chain(&delta.deleted) {
            self.0.remove(&gone.tet);
        }
        for moved in &delta.moved {
            if let Some(side) = self.0.remove(&moved.from) {
                self.0.insert(moved.to, side);
            }
        }
    }
}

/// The tets along a surface with their sides.
#[derive(Debug)]
pub(crate) struct Sides {
    /// Ascending by tet.
    sides: Vec<(TetId, Option<bool>)>,
}

impl Sides {
    /// Finds the sides of `tets`, which ascend. `by_blade` tells the side of a tet, if the blade can be asked, and whether
    /// that is only the side to prefer among those of its neighbors.
    pub(crate) fn new(
        mesh: &TetMesh,
        surface: &CutSurface,
        given: &mut GivenSides,
        tets: &[TetId],
        by_blade: impl Fn([ParticleId; 4]) -> Option<BladeSide>,
    ) -> Self {
        let told = |tet: &TetId| {
            let corners = mesh.tets[tet.index()];
            let preferred = match by_blade(corners) {
                Some(BladeSide::Known(side)) => return (Some(side), None),
                Some(BladeSide::Preferred(side)) => Some(side),
                None => None,
            };
            let whole = corners.iter().all(|&p| surface.contains(p));
            let side = if whole {
                given.0.get(tet).copied()
            } else {
                Some(surface.side(&mesh.positions, corners))
            };
            (side, preferred)
        };
        let (mut side, preferred): (Vec<Option<bool>>, Vec<_>) = tets.iter().map(told).unzip();
        let open: Vec<usize> = (0..tets.len()).filter(|&i| side[i].is_none()).collect();
        if !open.is_empty() {
            let mut sets = DisjointSets::new(tets.len());
            let shared = shared_faces(mesh, surface, tets);
            // First across faces where it leads to the side preferred.
            let passes = if open.iter().any(|&i| preferred[i].is_some()) {
                [true, false].as_slice()
            } else {
                &[false]
            };
            for &only_preferred in passes {
                for &(_, one, other) in &shared {
                    let (a, b) = (sets.root(one), sets.root(other));
                    let [of_a, of_b] = [a, b].map(|set| side[set as usize]);
                    let [for_a, for_b] =
                        [(a, of_a), (b, of_b)].map(|(set, side)| side.or(preferred[set as usize]));
                    let leads = !only_preferred || (for_a.is_some() && for_a == for_b);
                    if a != b && leads && (of_a.is_none() || of_b.is_none()) {
                        sets.unite(a, b);
                        side[a.min(b) as usize] = of_a.or(of_b);
                    }
                }
            }
            for i in open {
                side[i] = side[sets.root(index(i)) as usize];
                given.0.extend(side[i].map(|side| (tets[i], side)));
            }
        }
        Self {
            sides: tets.iter().copied().zip(side).collect(),
        }
    }

    /// Whether two tets are known to lie on different sides.
    pub(crate) fn differ(&self, tets: [TetId; 2]) -> bool {
        let side = |tet| {
            let found = self.sides.binary_search_by_key(&tet, |entry| entry.0);
            found.ok().and_then(|i| self.sides[i].1)
        };
        matches!(tets.map(side), [Some(one), Some(other)] if one != other)
    }
}

/// The side of a tet from where the blade is.
#[derive(Clone, Copy, Debug)]
pub(crate) enum BladeSide {
    Known(bool),
    /// If a neighbor has it, too.
    Preferred(bool),
}

/// The side of a tet from where the blade is: the one that its particles off the surface are on if they agree, else the
/// one its center is on. `None` where the blade cannot tell, or joins another whose place is not known.
///
/// Of tets with all particles on the surface a moving blade is not sure: what it meets next may put their neighbors on
/// another side, and they would be chips.
///
/// `turned` says whether the sides of the surface are the other way around than those of the blade.
pub(crate) fn side_by_blade<B: Blade>(
    surface: &CutSurface,
    blade: &B,
    turned: bool,
    corners: [ParticleId; 4],
    motion: &Motion,
) -> Option<BladeSide> {
    if corners.iter().any(|&p| surface.is_adopted(p)) {
        return None;
    }
    let at = corners.map(|p| motion.now[p.index()]);
    let center = at.iter().sum::<DVec3>() * 0.25;
    let before = corners.map(|p| motion.before[p.index()]);
    let drift = center - before.iter().sum::<DVec3>() * 0.25;
    let reach = at.iter().map(|x| x.distance(center)).fold(0.0, f64::max);
    let side = |x: DVec3, reach: f64| {
        let natural = blade.side(x, reach, drift)?;
        Some(natural != turned)
    };
    let mut agreed = None;
    for (particle, x) in corners.into_iter().zip(at) {
        if surface.contains(particle) {
            continue;
        }
        let seen = surface.seen(particle);
        let of_corner = seen.or_else(|| side(x, 2.0 * reach))?;
        if *agreed.get_or_insert(of_corner) != of_corner {
            agreed = None;
            break;
        }
    }
    let whole = corners.iter().all(|&p| surface.contains(p));
    let side = agreed.or_else(|| side(center, reach))?;
    Some(if B::IS_SWEPT && whole {
        BladeSide::Preferred(side)
    } else {
        BladeSide::Known(side)
    })
}

/// Pairs of tets with a common face, by ascending alignment of the face with the surface.
fn shared_faces(mesh: &TetMesh, surface: &CutSurface, tets: &[TetId]) -> Vec<(f64, u32, u32)> {
    let mut faces: Vec<([ParticleId; 3], u32)> = Vec::with_capacity(4 * tets.len());
    for (i, tet) in (0_u32..).zip(tets) {
        let [a, b, c, d] = mesh.tets[tet.index()];
        for mut face in [[b, c, d], [a, c, d], [a, b, d], [a, b, c]] {
            face.sort_unstable();
            faces.push((face, i));
        }
    }
    faces.sort_unstable();
    let pairs = faces
        .chunk_by(|a, b| a.0 == b.0)
        .filter(|same| same.len() == 2);
    let mut shared: Vec<(f64, u32, u32)> = pairs
        .map(|same| {
            (
                surface.alignment(&mesh.positions, same[0].0),
                same[0].1,
                same[1].1,
            )
        })
        .collect();
    shared.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    shared
}
