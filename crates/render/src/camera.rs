//! [`Camera`]: viewpoint and projection of a scene.
//!
//! The camera looks at a target from a distance, in a direction given by two angles; z is up. Axes, rays and
//! projections for rendering and picking are derived from five values, in double precision.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DMat4, DVec3, DVec4};

/// Smallest angle between the view direction and straight up or down, in radians.
const POLE: f64 = 0.01;
/// Smallest distance to the target, in m.
const NEAREST: f64 = 1e-6;
const FARTHEST: f64 = 1e9;
/// Near plane, in distances to the target.
const NEAR: f64 = 1e-2;

/// Viewpoint of a scene. Lengths are in m, angles in radians.
///
/// # Example
/// ```
/// use glam::DVec3;
/// use incise_render::Camera;
///
/// let mut camera = Camera::fit(DVec3::ZERO, DVec3::ONE);
/// camera.orbit(0.5, 0.1);
/// let size = [640.0, 480.0];
/// let at = camera.project(DVec3::splat(0.5), size).expect("in front of the eye");
/// assert!((at.x - 320.0).abs() < 1e-9 && (at.y - 240.0).abs() < 1e-9); // the middle of the picture
/// let (origin, direction) = camera.ray([at.x, at.y], size);
/// assert!((origin + direction * at.z - DVec3::splat(0.5)).length() < 1e-9);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Point at the center of the image.
    pub target: DVec3,
    /// Distance from the eye to the target; positive.
    pub distance: f64,
    /// Angle of the eye around the target, counterclockwise seen from above; 0 is the direction of x.
    pub azimuth: f64,
    /// Angle of the eye above the target, between -π/2 and π/2.
    pub elevation: f64,
    /// Vertical field of view, from 0 to π.
    pub field_of_view: f64,
}

impl Camera {
    /// Three-quarter view that shows all of a box, in any image at least as wide as it is high. A box without extent is
    /// seen from 1 m.
    #[must_use]
    pub fn fit(low: DVec3, high: DVec3) -> Self {
        let mut camera = Self {
            target: (low + high) * 0.5,
            distance: 1.0,
            azimuth: -60_f64.to_radians(),
            elevation: 22_f64.to_radians(),
            field_of_view: 28_f64.to_radians(),
        };
        camera.fit_distance(low, high, 1.0);
        camera
    }

    /// Sets the smallest distance that shows all of a box in an image of `aspect` (width over height), in the current
    /// direction: for a camera turned after [`Camera::fit`], and for images higher than wide. An `aspect` that is not a
    /// positive number changes nothing.
    pub fn fit_distance(&mut self, low: DVec3, high: DVec3, aspect: f64) {
        let tangent = (self.field_of_view * 0.5).tan();
        let (forward, right, up) = (self.forward(), self.right(), self.up());
        let mut distance: f64 = 0.0;
        for corner in corners(low, high) {
            let from_target = corner - self.target;
            let across = right.dot(from_target).abs() / aspect;
            let aside = across.max(up.dot(from_target).abs());
            distance = distance.max(aside * 1.08 / tangent - forward.dot(from_target));
        }
        if aspect > 0.0 && distance > 0.0 && distance.is_finite() {
            self.distance = distance.clamp(NEAREST, FARTHEST);
        }
    }

    /// Turns the eye around the target, in radians. The elevation stops short of the poles, where right and left are
    /// undefined.
    pub fn orbit(&mut self, right: f64, up: f64) {
        if right.is_finite() {
            self.azimuth = (self.azimuth + right % TAU + PI).rem_euclid(TAU) - PI;
        }
        if up.is_finite() {
            let highest = FRAC_PI_2 - POLE;
            self.elevation = (self.elevation + up).clamp(-highest, highest);
        }
    }

    /// Pans: shifts the image content right and up by fractions of the image height at the target's distance; the
    /// camera moves the opposite way.
    pub fn pan(&mut self, right: f64, up: f64) {
        let height = 2.0 * self.distance * (self.field_of_view * 0.5).tan();
        let shift = (self.right() * right + self.up() * up) * height;
        let target = self.target - shift;
        if target.is_finite() {
            self.target = target;
        }
    }

    /// Multiplies the distance: a factor below 1 moves closer. A factor that is not a positive number changes nothing.
    /// The distance stays between a micrometer and a million kilometers.
    pub fn zoom(&mut self, factor: f64) {
        if factor > 0.0 {
            self.distance = (self.distance * factor).clamp(NEAREST, FARTHEST);
        }
    }

    /// Position of the eye.
    #[must_use]
    pub fn eye(&self) -> DVec3 {
        self.target - self.forward() * self.distance
    }

    /// View direction, of length 1.
    #[must_use]
    pub fn forward(&self) -> DVec3 {
        let (sin, cos) = self.elevation.sin_cos();
        -DVec3::new(cos * self.azimuth.cos(), cos * self.azimuth.sin(), sin)
    }

    /// Right direction of the image, horizontal and of length 1.
    #[must_use]
    pub fn right(&self) -> DVec3 {
        DVec3::new(-self.azimuth.sin(), self.azimuth.cos(), 0.0)
    }

    /// Up direction of the image, of length 1.
    #[must_use]
    pub fn up(&self) -> DVec3 {
        self.right().cross(self.forward())
    }

    /// Projection from points relative to the eye to the clip space of wgpu: x to the right, y up, depth from 0 to 1.
    /// `aspect` is width over height. The near plane is at a hundredth of the distance to the target; there is no far
    /// plane.
    pub(crate) fn projection(&self, aspect: f64) -> DMat4 {
        let (right, up, back) = (self.right(), self.up(), -self.forward());
        let row = |axis: DVec3| axis.extend(0.0);
        let view = DMat4::from_cols(row(right), row(up), row(back), DVec4::W).transpose();
        let near = self.distance * NEAR;
        let slope = 1.0 / (self.field_of_view * 0.5).tan();
        // Depth is 1 - near / distance; 32 bits are precise enough for it.
        let projection = DMat4::from_cols(
            DVec4::new(slope / aspect, 0.0, 0.0, 0.0),
            DVec4::new(0.0, slope, 0.0, 0.0),
            DVec4::new(0.0, 0.0, -1.0, -1.0),
            DVec4::new(0.0, 0.0, -near, 0.0),
        );
        projection * view
    }

    /// Projects a point into an image of `size` pixels: x and y in pixels from the upper left corner, to the right and
    /// down; z is the distance from the eye along [`Camera::forward`] in m. `None` for a point that is not in front of
    /// the eye.
    #[must_use]
    pub fn project(&self, point: DVec3, size: [f64; 2]) -> Option<DVec3> {
        let from_eye = point - self.eye();
        let depth = self.forward().dot(from_eye);
        if depth <= 0.0 {
            return None;
        }
        let pixels = self.pixels_per_slope(size) / depth;
        let x = size[0] * 0.5 + self.right().dot(from_eye) * pixels;
        let y = size[1] * 0.5 - self.up().dot(from_eye) * pixels;
        Some(DVec3::new(x, y, depth))
    }

    /// Ray through a position in the image, in pixels from its upper left corner: the eye and a direction of length 1.
    #[must_use]
    pub fn ray(&self, pixel: [f64; 2], size: [f64; 2]) -> (DVec3, DVec3) {
        let pixels = self.pixels_per_slope(size);
        let x = (pixel[0] - size[0] * 0.5) / pixels;
        let y = (size[1] * 0.5 - pixel[1]) / pixels;
        let direction = self.forward() + self.right() * x + self.up() * y;
        (self.eye(), direction.normalize())
    }

    /// Pixels per unit slope.
    fn pixels_per_slope(&self, size: [f64; 2]) -> f64 {
        size[1] * 0.5 / (self.field_of_view * 0.5).tan()
    }
}

/// The corners of a box.
pub(crate) fn corners(low: DVec3, high: DVec3) -> [DVec3; 8] {
    std::array::from_fn(|i| {
        let pick = |bit: usize, low: f64, high: f64| if i >> bit & 1 == 0 { low } else { high };
        DVec3::new(
            pick(0, low.x, high.x),
            pick(1, low.y, high.y),
            pick(2, low.z, high.z),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clip_space_is_the_same_projection() {
        let mut camera = Camera::fit(DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 4.0, 5.0));
        camera.orbit(0.7, -0.9);
        let size = [640.0, 480.0];
        for corner in corners(DVec3::splat(-0.4), DVec3::new(0.1, 0.3, 0.4)) {
            let at = camera.target + corner * camera.distance;
            let clip = camera.projection(size[0] / size[1]) * (at - camera.eye()).extend(1.0);
            let place = clip / clip.w;
            let seen = camera.project(at, size).unwrap();
            // Pixel coordinates of a few hundred with sixteen digits.
            assert!(((place.x + 1.0) * 0.5 * size[0] - seen.x).abs() < 1e-9);
            assert!(((1.0 - place.y) * 0.5 * size[1] - seen.y).abs() < 1e-9);
            assert!((0.0..=1.0).contains(&place.z));
        }
    }
}
