//! Surface color of a pixel in linear light: twin of `shading.wgsl`, function by function.
//!
//! Hemispherical ambient light, one wrapped key light (soft bodies scatter), a highlight by the half vector (J. Blinn,
//! "Models of light reflection", 1977) and a rim light at grazing angles. Powers are products, so that both twins round
//! alike. The ground has a grid, whose lines are one pixel wide at any distance by the exact derivatives of the ray,
//! and fades into the background. Cost: some 100 operations per pixel.

use glam::Vec3;

use crate::props::Plane;
use crate::srgb::decode;
use crate::view::View;

/// Color of tissue in linear light.
pub(crate) const TISSUE: Vec3 = Vec3::new(0.245, 0.044, 0.036);
/// Color of tissue on cut faces in linear light.
pub(crate) const FLESH: Vec3 = Vec3::new(0.780, 0.290, 0.250);
/// Gloss of tissue.
pub(crate) const GLOSS: f32 = 0.55;
const FLESH_GLOSS: f32 = 0.35;

const SKY: Vec3 = Vec3::new(0.50, 0.54, 0.60);
const EARTH: Vec3 = Vec3::new(0.235, 0.205, 0.195);
const KEY: Vec3 = Vec3::new(1.12, 1.06, 0.96);
const LINE: Vec3 = Vec3::new(0.012, 0.012, 0.018);
/// Factor of the distance from the rim of a cut, which makes its line wider than those of other edges.
pub(crate) const RIM: f32 = 0.5;
const TABLE: Vec3 = Vec3::new(0.62, 0.635, 0.66);
const TABLE_LINE: Vec3 = Vec3::new(0.30, 0.32, 0.36);
const TOP: Vec3 = Vec3::new(0.92, 0.935, 0.955);
const BOTTOM: Vec3 = Vec3::new(0.66, 0.69, 0.73);

/// Point of a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    /// Base color in linear light.
    pub(crate) base: Vec3,
    pub(crate) gloss: f32,
    /// Position relative to the eye.
    pub(crate) position: Vec3,
    /// Shading normal, of length 1.
    pub(crate) normal: Vec3,
    /// Normal of the triangle, of length 1.
    pub(crate) face: Vec3,
}

/// Normalized vector; up for a vector of length 0.
pub(crate) fn direction(v: Vec3) -> Vec3 {
    let squared = v.dot(v);
    if squared > 0.0 {
        v / squared.sqrt()
    } else {
        Vec3::Z
    }
}

pub(crate) fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Base color and gloss of a skin triangle from its color word (0: tissue) and whether it is a cut face.
pub(crate) fn skin_base(word: u32, cut: bool) -> (Vec3, f32) {
    if word == 0 {
        return if cut {
            (FLESH, FLESH_GLOSS)
        } else {
            (TISSUE, GLOSS)
        };
    }
    let [r, g, b, _] = word.to_le_bytes();
    let base = Vec3::new(decode(r), decode(g), decode(b));
    if cut {
        (base.lerp(Vec3::ONE, 0.30), 0.15)
    } else {
        (base, 0.25)
    }
}

/// Shading normal of a skin triangle: cut faces are shaded flatter than others.
pub(crate) fn skin_normal(normal: Vec3, face: Vec3, cut: bool, smooth: bool) -> Vec3 {
    if !smooth {
        return face;
    }
    let share = if cut { 0.35 } else { 0.0 };
    direction(direction(normal).lerp(face, share))
}

/// Light that a surface reflects to the eye.
pub(crate) fn shade(surface: Surface, light: Vec3) -> Vec3 {
    let to_eye = direction(-surface.position);
    let (mut normal, mut base, mut gloss) = (surface.normal, surface.base, surface.gloss);
    if surface.face.dot(to_eye) < 0.0 {
        // Back side.
        (normal, base, gloss) = (-normal, base * 0.5, gloss * 0.3);
    }
    let sky = 0.5 + 0.5 * normal.z;
    let ambient = EARTH.lerp(SKY, sky);
    let toward = normal.dot(light);
    let key = ((toward + 0.2) / 1.2).max(0.0);
    let diffuse = base * (ambient + KEY * (key * key * 0.4 + key * 0.6));
    let half = normal.dot(direction(light + to_eye)).max(0.0);
    let p2 = half * half;
    let p4 = p2 * p2;
    let p8 = p4 * p4;
    let p16 = p8 * p8;
    let p32 = p16 * p16;
    let highlight = gloss * (0.34 * p32 * p32 + 0.10 * p16) * smoothstep(0.0, 0.2, toward);
    let grazing = 1.0 - normal.dot(to_eye).max(0.0);
    let g2 = grazing * grazing;
    let rim = g2 * g2 * (0.05 + 0.15 * gloss);
    diffuse + KEY * highlight + ambient * rim
}

/// Draws the edges of a triangle over a color, given the distances to them in pixels.
pub(crate) fn wire(color: Vec3, distances: Vec3) -> Vec3 {
    let nearest = distances.min_element();
    let share = 1.0 - smoothstep(0.2, 1.1, nearest);
    color.lerp(LINE, 0.75 * share)
}

/// Background color at a fraction of the image height from the top.
pub(crate) fn background(y: f32) -> Vec3 {
    TOP.lerp(BOTTOM, y * y * (3.0 - 2.0 * y))
}

/// Intersects the ray through a pixel with a plane: its color in linear light, its opacity, and the depth. `shade_of`
/// is the contact shadow, from 0 to 1, at a position relative to the eye.
pub(crate) fn plane(
    view: &View,
    plane: &Plane,
    ray: Vec3,
    shade_of: impl Fn(Vec3) -> f32,
) -> Option<(Vec3, f32, f32)> {
    let normal = plane.u.cross(plane.v);
    let slope = ray.dot(normal);
    let depth = plane.center.dot(normal) / slope;
    let position = ray * depth;
    let away = (position - plane.center).length() / plane.radius;
    if !(depth > 0.0 && away < 1.0) {
        return None;
    }
    let fade = 1.0 - smoothstep(0.25, 1.0, away);
    let steps = view
        .ray_steps()
        .map(|step| (step - ray * (step.dot(normal) / slope)) * depth);
    let across = line(plane.u, plane.offsets[0], plane.spacing, position, steps);
    let along = line(plane.v, plane.offsets[1], plane.spacing, position, steps);
    let lines = across.max(along);
    let shadow = shade_of(position);
    let color = TABLE.lerp(TABLE_LINE, 0.55 * lines) * (1.0 - 0.62 * shadow);
    let cover = plane.opacity + (1.0 - plane.opacity) * (0.8 * shadow).max(0.35 * lines);
    Some((color, cover * fade, depth))
}

/// Fraction of a pixel covered by the grid lines across an axis.
fn line(axis: Vec3, offset: f32, spacing: f32, position: Vec3, steps: [Vec3; 2]) -> f32 {
    let at = (position.dot(axis) + offset) / spacing;
    let width = (steps[0].dot(axis).abs() + steps[1].dot(axis).abs()) / spacing;
    let distance = (at - floor(at + 0.5)).abs();
    (1.0 - smoothstep(0.4 * width, 1.3 * width, distance)) * (1.0 - smoothstep(0.08, 0.45, width))
}

/// `floor` without a call, for values in the range of an integer.
#[expect(
    clippy::cast_possible_truncation,
    reason = "lines are counted from the eye, and those beyond the patch are not asked for"
)]
fn floor(x: f32) -> f32 {
    let whole = (x as i32) as f32;
    if whole > x { whole - 1.0 } else { whole }
}
