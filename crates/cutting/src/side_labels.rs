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
    /// Finds the sides of `tets`, which ascend. `standing` tells the side of a tet, if the blade can still be asked.
    pub(crate) fn new(
        mesh: &TetMesh,
        surface: &CutSurface,
        given: &mut GivenSides,
        tets: &[TetId],
        standing: impl Fn([ParticleId; 4]) -> Option<bool>,
    ) -> Self {
        let told = |tet: &TetId| {
            let corners = mesh.tets[tet.index()];
            if let Some(side) = standing(corners) {
                return Some(side);
            }
            let whole = corners.iter().all(|&p| surface.contains(p));
            if whole {
                given.0.get(tet).copied()
            } else {
                Some(surface.side(&mesh.positions, corners))
            }
        };
        let mut side: Vec<Option<bool>> = tets.iter().map(told).collect();
        let open: Vec<usize> = (0..tets.len()).filter(|&i| side[i].is_none()).collect();
        if !open.is_empty() {
            let mut sets = DisjointSets::new(tets.len());
            for (_, one, other) in shared_faces(mesh, surface, tets) {
                let (a, b) = (sets.root(one), sets.root(other));
                let [of_a, of_b] = [a, b].map(|set| side[set as usize]);
                if a != b && (of_a.is_none() || of_b.is_none()) {
                    sets.unite(a, b);
                    side[a.min(b) as usize] = of_a.or(of_b);
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

/// The side of a tet from where the blade stands: the one that its particles off the surface are on if they agree, else
/// the one its center is on. `None` where the blade moves, or joins another whose place is not known.
pub(crate) fn standing_side(
    surface: &CutSurface,
    blade: &impl Blade,
    corners: [ParticleId; 4],
    now: &[DVec3],
) -> Option<bool> {
    if corners.iter().any(|&p| surface.is_adopted(p)) {
        return None;
    }
    let at = corners.map(|p| now[p.index()]);
    let center = at.iter().sum::<DVec3>() * 0.25;
    let reach = at.iter().map(|x| x.distance(center)).fold(0.0, f64::max);
    let mut agreed = None;
    for (particle, x) in corners.into_iter().zip(at) {
        if surface.contains(particle) {
            continue;
        }
        let seen = surface.seen(particle);
        let side = seen.or_else(|| blade.side(x, 2.0 * reach))?;
        if *agreed.get_or_insert(side) != side {
            return blade.side(center, reach);
        }
    }
    agreed.or_else(|| blade.side(center, reach))
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
