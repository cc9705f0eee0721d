//! [`AabbTiles`]: boxes around neighboring boundary triangles that are refit only where it matters.
//!
//! No particle moves in a frame by more than the one that moves most. So a box fit to where its triangles were some
//! frames ago, widened by the sum of these distances, holds them still. Only boxes that the blade may reach are fit
//! again. Boxes need not change when triangles are split, whose parts lie within them, nor when tets hang on copies,
//! which start where their particles are; when triangles come or go, [`Faces`] says so.
//!
//! Cost of a frame: the distances that the particles moved, a test a box, and the boxes near the blade.

use glam::DVec3;
use incise_mesh::Bounds;

use crate::CuttableMesh;
use crate::faces::{Faces, TILE};

/// More than what rounding adds to a sum over frames.
const SLACK: f64 = 1.0 + 1e-6;

/// A box around the boundary triangles whose places are `TILE` in a row.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Tile {
    bounds: Bounds,
    /// How far the triangles can have moved since it was fit.
    moved: f64,
    /// What [`Faces::versions`] said then.
    version: u32,
}

/// The boxes around all boundary triangles.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct AabbTiles {
    tiles: Vec<Tile>,
    /// How far the particles moved in this frame, at most.
    moved: f64,
}

impl AabbTiles {
    /// Forgets all boxes.
    pub(crate) fn clear(&mut self) {
        self.tiles.clear();
    }

    /// Starts a frame in which the particles moved from `before` to `now`.
    pub(crate) fn begin(&mut self, faces: &Faces, before: &[DVec3], now: &[DVec3]) {
        self.moved = farthest(before, now);
        let unknown = Tile {
            bounds: Bounds::around([]),
            moved: f64::INFINITY,
            version: 0,
        };
        let count = faces.boundary().len().div_ceil(TILE);
        self.tiles.resize(count, unknown);
        for (tile, version) in self.tiles.iter_mut().zip(faces.versions()) {
            tile.moved += self.moved;
            if tile.version != *version {
                tile.moved = f64::INFINITY;
                tile.version = *version;
            }
        }
    }

    /// Visits the numbers of the boxes that are not `missed`.
    pub(crate) fn reached(
        &mut self,
        cuttable: &CuttableMesh,
        now: &[DVec3],
        missed: impl Fn(&Bounds) -> bool,
        mut visit: impl FnMut(usize),
    ) {
        for (i, tile) in self.tiles.iter_mut().enumerate() {
            // The box holds where the triangles are; that they were elsewhere in this frame counts as well.
            let misses =
                |tile: &Tile| missed(&tile.bounds.widened(SLACK * tile.moved.max(self.moved)));
            if misses(tile) {
                continue;
            }
            if tile.moved > 0.0 {
                let triangles = cuttable.faces.boundary().iter().skip(i * TILE).take(TILE);
                let corners = triangles.flat_map(|(face, _)| face.particles(&cuttable.mesh));
                tile.bounds = Bounds::around(corners.map(|p| now[p.index()]));
                tile.moved = 0.0;
                if misses(tile) {
                    continue;
                }
            }
            visit(i);
        }
    }
}

/// The largest distance along an axis between where a particle was and where it is.
fn farthest(before: &[DVec3], now: &[DVec3]) -> f64 {
    let mut most = [0.0_f64; 3];
    for (a, b) in before.iter().zip(now) {
        let distance = (*b - *a).abs().to_array();
        for (most, d) in most.iter_mut().zip(distance) {
            if d > *most {
                *most = d;
            }
        }
    }
    most.into_iter().fold(0.0, f64::max)
}
