//! Which tets a moving blade segment can have met: the cheap test before the exact one.
//!
//! The region a segment sweeps in one frame fits a box along blade, motion and normal. Each particle gets one bit per
//! box face that it lay outside of both at the start and at the end of the frame; since everything moves on straight
//! lines and half-spaces are convex, a tet whose four particles share a bit cannot have been met.
//! Cost: six products per particle and a few bit operations per tet.

use glam::DVec3;
use incise_mesh::{TetId, TetMesh};

use crate::meet::MovingSegment;

/// The box around the region a segment sweeps.
struct SweptBox {
    axes: [DVec3; 3],
    low: [f64; 3],
    high: [f64; 3],
}

impl SweptBox {
    fn new(blade: &MovingSegment) -> Self {
        let ends = [blade.before[0], blade.before[1], blade.now[0], blade.now[1]];
        let along = (ends[1] - ends[0]).normalize_or(DVec3::X);
        let motion = ends[2] + ends[3] - ends[0] - ends[1];
        let sideways =
            (motion - along * motion.dot(along)).normalize_or(along.any_orthonormal_vector());
        let axes = [along, sideways, along.cross(sideways)];
        let extent = |axis: DVec3, pick: fn(f64, f64) -> f64| {
            ends.map(|x| axis.dot(x)).into_iter().reduce(pick)
        };
        // Rounding and the slack of the exact test.
        let size = ends
            .iter()
            .map(|x| (*x - ends[0]).length() + x.length())
            .fold(0.0, f64::max);
        let margin = 1e-8 * size;
        Self {
            axes,
            low: axes.map(|axis| extent(axis, f64::min).unwrap_or(0.0) - margin),
            high: axes.map(|axis| extent(axis, f64::max).unwrap_or(0.0) + margin),
        }
    }

    /// One bit per face that the point lies outside of.
    fn outside(&self, x: DVec3) -> u8 {
        let mut bits = 0;
        for i in 0..3 {
            let along = self.axes[i].dot(x);
            bits |= u8::from(along < self.low[i]) << (2 * i)
                | u8::from(along > self.high[i]) << (2 * i + 1);
        }
        bits
    }
}

/// The tets that one of the segments can have met while the particles moved from `before` to `now`, ascending.
pub(crate) fn near_tets(
    mesh: &TetMesh,
    before: &[DVec3],
    now: &[DVec3],
    blade: &[MovingSegment],
) -> Vec<TetId> {
    let mut near = vec![false; mesh.tets.len()];
    let mut outside = Vec::with_capacity(now.len());
    for segment in blade {
        let swept = SweptBox::new(segment);
        outside.clear();
        outside.extend(
            before
                .iter()
                .zip(now)
                .map(|(a, b)| swept.outside(*a) & swept.outside(*b)),
        );
        for (near, corners) in near.iter_mut().zip(&mesh.tets) {
            *near |= corners
                .iter()
                .fold(u8::MAX, |bits, p| bits & outside[p.index()])
                == 0;
        }
    }
    (0..near.len())
        .filter(|&t| near[t])
        .map(TetId::new)
        .collect()
}
