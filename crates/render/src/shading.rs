//! The color of what is seen at a pixel, in linear light: twin of `shading.wgsl`, function by function.
//!
//! A hemisphere of ambient light, one key light that wraps a little around (soft bodies scatter), a highlight by the half
//! vector (J. Blinn, "Models of light reflection", 1977) and a rim by the grazing angle. Powers are products, so that both
//! twins round alike. The ground has a grid, whose lines are as wide as a pixel at any distance by the exact derivatives of
//! the ray, and fades into the background. Cost: some 100 operations a pixel.

use glam::Vec3;

use crate::props::Plane;
use crate::srgb::decode;
use crate::view::View;

/// Tissue, in linear light.
pub(crate) const TISSUE: Vec3 = Vec3::new(0.245, 0.044, 0.036);
/// Tissue that a cut laid bare.
pub(crate) const FLESH: Vec3 = Vec3::new(0.780, 0.290, 0.250);
/// How much it shines.
pub(crate) const GLOSS: f32 = 0.55;
const FLESH_GLOSS: f32 = 0.35;

const SKY: Vec3 = Vec3::new(0.50, 0.54, 0.60);
const EARTH: Vec3 = Vec3::new(0.235, 0.205, 0.195);
const KEY: Vec3 = Vec3::new(1.12, 1.06, 0.96);
const LINE: Vec3 = Vec3::new(0.012, 0.012, 0.018);
const TABLE: Vec3 = Vec3::new(0.62, 0.635, 0.66);
const TABLE_LINE: Vec3 = Vec3::new(0.30, 0.32, 0.36);
const TOP: Vec3 = Vec3::new(0.92, 0.935, 0.955);
const BOTTOM: Vec3 = Vec3::new(0.66, 0.69, 0.73);

/// A point of a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    /// Its color in linear light.
    pub(crate) base: Vec3,
    pub(crate) gloss: f32,
    /// Relative to the eye.
    pub(crate) position: Vec3,
    /// The normal that shading goes by, of length 1.
    pub(crate) normal: Vec3,
    /// That of the triangle, of length 1.
    pub(crate) face: Vec3,
}

/// `normalize`, but a vector without a direction becomes up.
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

/// The color of a triangle of a body from its word (nothing in it: tissue) and whether a cut laid it bare; and its gloss.
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

/// The normal that a triangle of a body is shaded by: cut faces are flatter than others.
pub(crate) fn skin_normal(normal: Vec3, face: Vec3, cut: bool, smooth: bool) -> Vec3 {
    if !smooth {
        return face;
    }
    let share = if cut { 0.35 } else { 0.0 };
    direction(direction(normal).lerp(face, share))
}

/// What a surface sends to the eye.
pub(crate) fn shade(surface: Surface, light: Vec3) -> Vec3 {
    let to_eye = direction(-surface.position);
    let (mut normal, mut base, mut gloss) = (surface.normal, surface.base, surface.gloss);
    if surface.face.dot(to_eye) < 0.0 {
        // The inside.
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

/// Draws the edges of a triangle over a color, by the distances to them in pixels.
pub(crate) fn wire(color: Vec3, distances: Vec3) -> Vec3 {
    let nearest = distances.min_element();
    let share = 1.0 - smoothstep(0.2, 1.1, nearest);
    color.lerp(LINE, 0.75 * share)
}

/// What is behind everything, at a fraction of the picture's height from above.
pub(crate) fn background(y: f32) -> Vec3 {
    TOP.lerp(BOTTOM, y * y * (3.0 - 2.0 * y))
}

/// A plane where the ray through a pixel meets it: its color in linear light and how much of what is behind it covers;
/// and the depth. `shade_of` is the contact shadow of what stands on it, from 0 to 1, at a position relative to the eye.
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

/// How much of a pixel the lines across an axis cover.
fn line(axis: Vec3, offset: f32, spacing: f32, position: Vec3, steps: [Vec3; 2]) -> f32 {
    let at = (position.dot(axis) + offset) / spacing;
    let width = (steps[0].dot(axis).abs() + steps[1].dot(axis).abs()) / spacing;
    let distance = (at - floor(at + 0.5)).abs();
    (1.0 - smoothstep(0.4 * width, 1.3 * width, distance)) * (1.0 - smoothstep(0.08, 0.45, width))
}

/// `floor` without a call, for what is far from the ends of an integer.
#[expect(
    clippy::cast_possible_truncation,
    reason = "lines are counted from the eye, and those beyond the patch are not asked for"
)]
fn floor(x: f32) -> f32 {
    let whole = (x as i32) as f32;
    if whole > x { whole - 1.0 } else { whole }
}
