//! [`ContactShadow`]: soft contact shadow of bodies on the ground, as if lit from directly above.
//!
//! The ground around the bodies is a square of texels. Each texel stores the height of the lowest triangle above it, as
//! a darkness; this is blurred in both directions. It is not a shadow of the key light, which would move with the
//! camera: it shows whether and where bodies touch the ground. Twin: `contact_shadow.wgsl` and `blur.wgsl`, with all
//! steps rounded to a byte as in a texture. Cost: a pass over the triangles, most of which are smaller than a texel,
//! and two passes of 13 operations per texel.

use glam::Vec3;

use crate::props::Plane;
use crate::raster::fill;

/// Texels on a side.
pub(crate) const SIDE: usize = 128;
/// Half the square's side, in radii of the ground's patch.
pub(crate) const SHARE: f32 = 0.6;
/// Height at which the contact shadow has a third of its strength, in radii.
pub(crate) const FALLOFF: f32 = 0.05;
/// Weights of the blur: center first, then outward, from a Gaussian of 2.5 texels.
const WEIGHTS: [f32; 7] = [0.1624, 0.1499, 0.1179, 0.0790, 0.0451, 0.0219, 0.0050];

/// Darkness of the ground per texel.
#[derive(Clone, Debug)]
pub(crate) struct ContactShadow {
    plane: Plane,
    texels: Vec<f32>,
    /// Columns and rows that bound the dark texels.
    bounds: [[f32; 2]; 2],
}

impl ContactShadow {
    /// Contact shadow of triangles on a plane; positions are relative to the eye.
    pub(crate) fn new(plane: Plane, triangles: &[[u32; 3]], positions: &[Vec3]) -> Self {
        let mut texels = vec![0.0; SIDE * SIDE];
        let normal = plane.u.cross(plane.v);
        let scale = SIDE as f32 * 0.5 / (SHARE * plane.radius);
        let half = SIDE as f32 * 0.5;
        let put = |position: Vec3| {
            let from = position - plane.center;
            // Texel coordinates and height.
            Vec3::new(
                from.dot(plane.u) * scale + half,
                from.dot(plane.v) * scale + half,
                from.dot(normal),
            )
        };
        let positions: Vec<Vec3> = positions.iter().map(|position| put(*position)).collect();
        let inside = |x: Vec3| x.x >= 0.0 && x.y >= 0.0 && x.x <= SIDE as f32 && x.y <= SIDE as f32;
        for corners in triangles {
            let corners = corners.map(|v| positions[v as usize]);
            // Not clipped: triangles outside the square are far from the visible area.
            if !corners.into_iter().all(inside) {
                continue;
            }
            fill(corners, SIDE, 0..SIDE, |row| {
                let first = row.y * SIDE;
                let texels = &mut texels[first + row.start..first + row.end];
                for (texel, height) in texels.iter_mut().zip(row.depths()) {
                    let dark = (-height.max(0.0) / (FALLOFF * plane.radius)).exp();
                    *texel = rounded(dark).max(*texel);
                }
            });
        }
        let texels = blurred(&blurred(&texels, 1), SIDE);
        let mut bounds = [[0.0_f32; 2]; 2];
        let dark = |i: &usize| texels[*i] > 0.0;
        if let Some(first) = (0..texels.len()).find(dark) {
            bounds = [[SIDE as f32, 0.0], [(first / SIDE) as f32, 0.0]];
            for i in (first..texels.len()).filter(dark) {
                for (bounds, at) in bounds.iter_mut().zip([i % SIDE, i / SIDE]) {
                    // Interpolation extends a texel to the center of the next one.
                    bounds[0] = bounds[0].min(at as f32 - 1.0).max(0.0);
                    bounds[1] = bounds[1].max(at as f32 + 1.0).min((SIDE - 1) as f32);
                }
            }
        }
        Self {
            plane,
            texels,
            bounds,
        }
    }

    /// Darkness at a position relative to the eye, from 0 to 1, interpolated between texels.
    pub(crate) fn at(&self, position: Vec3) -> f32 {
        let plane = &self.plane;
        let scale = 1.0 / (SHARE * plane.radius);
        let from = position - plane.center;
        let side = SIDE as f32;
        let at = [plane.u, plane.v].map(|axis| (from.dot(axis) * scale * 0.5 + 0.5) * side - 0.5);
        let within = |(at, [low, high]): (&f32, &[f32; 2])| (*low..*high).contains(at);
        if !at.iter().zip(&self.bounds).all(within) {
            return 0.0;
        }
        let [(x, right), (y, down)] = at.map(split);
        let texel = |x: usize, y: usize| self.texels[y.min(SIDE - 1) * SIDE + x.min(SIDE - 1)];
        let above = texel(x, y) * (1.0 - right) + texel(x + 1, y) * right;
        let below = texel(x, y + 1) * (1.0 - right) + texel(x + 1, y + 1) * right;
        above * (1.0 - down) + below * down
    }
}

/// Integer part and fraction.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "within the texels"
)]
fn split(at: f32) -> (usize, f32) {
    (at as usize, at - (at as usize) as f32)
}

/// Value from 0 to 1 rounded to a multiple of 1/255.
fn rounded(part: f32) -> f32 {
    (part * 255.0).round() / 255.0
}

/// Blurs along one direction, given the index distance to the next texel; texels outside the square count as 0.
fn blurred(texels: &[f32], step: usize) -> Vec<f32> {
    let at = |i: usize, by: isize| {
        let along = i / step % SIDE;
        let there = along.checked_add_signed(by).filter(|&there| there < SIDE);
        there.map_or(0.0, |there| texels[i - along * step + there * step])
    };
    let blur = |i: usize| {
        let mut sum = texels[i] * WEIGHTS[0];
        for (by, weight) in (1..).zip(&WEIGHTS[1..]) {
            sum += (at(i, by) + at(i, -by)) * weight;
        }
        rounded(sum)
    };
    (0..texels.len()).map(blur).collect()
}
