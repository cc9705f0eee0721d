//! Pictures of bodies as SVG: the triangles of the boundary, far ones first, each filled with a color of its own.
//!
//! The painter's algorithm (Newell et al. 1972) from the front, above and to the left. Back faces are omitted, and so
//! are triangles that are visible at no pixel. Cost: O(triangles log triangles + pixels).

use std::fmt::Write;

use incise::mesh::glam::DVec3;

/// Width and height of an image; visibility is tested at this resolution.
const SIZE: usize = 640;
/// From the body to the eye, and up in the picture.
const EYE: DVec3 = DVec3::new(-0.45, -0.8, 0.4);

/// A triangle, counterclockwise seen from outside, and its color as red, green, blue.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    pub(super) corners: [DVec3; 3],
    pub(super) rgb: [u8; 3],
}

/// A triangle in the picture: corners in pixels and toward the eye.
struct Flat {
    corners: [DVec3; 3],
    rgb: [u8; 3],
}

/// Draws a body.
pub(super) fn picture(triangles: &[Triangle]) -> String {
    let flat = project(triangles);
    let seen = seen(&flat);
    let mut order: Vec<usize> = (0..flat.len()).filter(|&i| seen[i]).collect();
    let depth = |i: usize| flat[i].corners.iter().map(|x| x.z).sum::<f64>();
    order.sort_by(|&a, &b| depth(a).total_cmp(&depth(b)).then(a.cmp(&b)));
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {SIZE} {SIZE}\" width=\"{SIZE}\" height=\"{SIZE}\">\
         <rect width=\"{SIZE}\" height=\"{SIZE}\" fill=\"#fff\"/><g stroke-width=\"0.3\" stroke=\"#333\" stroke-linejoin=\"round\">"
    );
    for i in order {
        let Flat { corners, rgb } = &flat[i];
        let [a, b, c] = corners;
        // Writing to a string cannot fail.
        let _ = write!(
            svg,
            "<path d=\"M{:.1} {:.1} {:.1} {:.1} {:.1} {:.1}z\" fill=\"#{:02x}{:02x}{:02x}\"/>",
            a.x, a.y, b.x, b.y, c.x, c.y, rgb[0], rgb[1], rgb[2]
        );
    }
    svg + "</g></svg>\n"
}

/// The triangles that look at the eye, fitted into the picture and shaded.
fn project(triangles: &[Triangle]) -> Vec<Flat> {
    let eye = EYE.normalize();
    let right = DVec3::Z.cross(eye).normalize();
    let up = eye.cross(right);
    let turn = |x: DVec3| DVec3::new(x.dot(right), -x.dot(up), x.dot(eye));
    let all = || triangles.iter().flat_map(|t| t.corners).map(turn);
    let low = all().fold(DVec3::MAX, DVec3::min);
    let high = all().fold(DVec3::MIN, DVec3::max);
    let extent = (high - low).truncate().max_element().max(f64::MIN_POSITIVE);
    let scale = 0.96 * SIZE as f64 / extent;
    let middle = 0.5 * (low + high);
    let center = DVec3::new(0.5 * SIZE as f64, 0.5 * SIZE as f64, 0.0);
    let mut flat = Vec::new();
    for triangle in triangles {
        let [a, b, c] = triangle.corners;
        let facing = (b - a).cross(c - a).normalize_or_zero().dot(eye);
        if facing > 0.0 {
            let light = 0.55 + 0.45 * facing;
            flat.push(Flat {
                corners: [a, b, c].map(|x| (turn(x) - middle) * scale + center),
                rgb: triangle.rgb.map(|part| shade(part, light)),
            });
        }
    }
    flat
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a part of 0 to 255 times at most 1"
)]
fn shade(part: u8, light: f64) -> u8 {
    (f64::from(part) * light.clamp(0.0, 1.0)).round() as u8
}

/// Marks the triangles that are in front at the center of some pixel.
fn seen(flat: &[Flat]) -> Vec<bool> {
    let mut front = vec![(f64::MIN, usize::MAX); SIZE * SIZE];
    for (i, triangle) in flat.iter().enumerate() {
        let [a, b, c] = triangle.corners;
        let low = a.min(b).min(c);
        let high = a.max(b).max(c);
        let area = (b - a).truncate().perp_dot((c - a).truncate());
        if area == 0.0 {
            continue;
        }
        for y in pixels(low.y, high.y) {
            for x in pixels(low.x, high.x) {
                let p = DVec3::new(x as f64 + 0.5, y as f64 + 0.5, 0.0);
                let part =
                    |q: DVec3, r: DVec3| (q - p).truncate().perp_dot((r - p).truncate()) / area;
                let (u, v, w) = (part(b, c), part(c, a), part(a, b));
                if u < 0.0 || v < 0.0 || w < 0.0 {
                    continue;
                }
                let depth = u * a.z + v * b.z + w * c.z;
                let pixel = &mut front[y * SIZE + x];
                if depth > pixel.0 {
                    *pixel = (depth, i);
                }
            }
        }
    }
    let mut seen = vec![false; flat.len()];
    for (_, i) in front {
        if let Some(seen) = seen.get_mut(i) {
            *seen = true;
        }
    }
    seen
}

/// The pixels from one coordinate to another.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to the picture"
)]
fn pixels(from: f64, to: f64) -> std::ops::Range<usize> {
    let inside = |x: f64| x.clamp(0.0, SIZE as f64) as usize;
    inside(from.floor())..inside(to.ceil())
}

/// A color for a number: neighbors in the list of numbers differ most (hues by the golden angle).
pub(super) fn hue(number: usize) -> [u8; 3] {
    let turn = (number as f64 * 0.618_033_988_75).fract() * 6.0;
    let value = [1.0, 0.8, 0.62][number % 3];
    let saturation = [0.55, 0.75, 0.65][(number / 3) % 3];
    let part = |offset: f64| {
        let k = (offset + turn) % 6.0;
        let dip = k.min(4.0 - k).clamp(0.0, 1.0);
        shade(255, value * (1.0 - saturation * dip))
    };
    [part(5.0), part(3.0), part(1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of two triangles one behind the other only the front one is drawn, and none that looks away.
    #[test]
    fn hidden_triangles_are_not_drawn() {
        let eye = EYE.normalize();
        let right = DVec3::Z.cross(eye).normalize();
        let up = eye.cross(right);
        let at = |depth: f64, size: f64, rgb| Triangle {
            corners: [-right - up, right - up, up].map(|x| x * size + eye * depth),
            rgb,
        };
        let front = at(1.0, 1.0, [255, 0, 0]);
        let mut away = at(2.0, 1.0, [0, 0, 255]);
        away.corners.swap(0, 1);
        let svg = picture(&[at(0.0, 0.5, [0, 255, 0]), front, away]);
        assert_eq!(svg.matches("<path").count(), 1);
        // It faces the eye, so its color is not darkened.
        assert!(svg.contains("#ff0000"), "{svg}");
        // Beside each other, far first.
        let mut far = at(-1.0, 1.0, [0, 255, 0]);
        far.corners = far.corners.map(|x| x + right);
        let svg = picture(&[front, far]);
        assert!(svg.find("#00ff00") < svg.find("#ff0000"));
        assert_eq!(svg.matches("<path").count(), 2);
    }
}
