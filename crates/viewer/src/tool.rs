//! Tools of the left mouse button: cut, grab, orbit.
//!
//! A blade is the part of the view ray under the pointer from in front of the body to a chosen depth below its surface.
//! A stroke is therefore the drawn line swept along the view direction.

use incise::mesh::glam::DVec3;
use incise_render::Camera;

/// Tool of the left mouse button.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Tool {
    /// Cuts along the drawn line.
    #[default]
    Blade,
    /// Grabs the body and pulls.
    Grab,
    /// Orbits the camera, as the right button always does.
    Orbit,
}

/// Settings of the tools.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ToolSettings {
    /// Depth of the blade below the surface as a fraction of the body's size; 1 and more goes through.
    pub(crate) depth: f64,
    /// Snap distance as a fraction of an edge.
    pub(crate) snap: f64,
    /// Radius of the grabbed region as a fraction of the body's size.
    pub(crate) radius: f64,
    /// Compliance of the grab in m/N.
    pub(crate) compliance: f64,
}

impl Default for ToolSettings {
    fn default() -> Self {
        Self {
            depth: 1.0,
            snap: 0.1,
            radius: 0.08,
            compliance: 0.002,
        }
    }
}

/// The blade under a pixel. `bounds` are those of the body, `surface` is the last known distance along the ray to the
/// body, and `depth` the depth of the blade below that, in m; absent: through the body.
pub(crate) fn blade(
    camera: &Camera,
    pixel: [f64; 2],
    size: [f64; 2],
    bounds: [DVec3; 2],
    surface: Option<f64>,
    depth: Option<f64>,
) -> [DVec3; 2] {
    let (origin, direction) = camera.ray(pixel, size);
    let [low, high] = bounds;
    let (middle, reach) = ((low + high) / 2.0, (high - low).length() / 2.0);
    // Beyond any pose of the body during the stroke, but not behind the eye.
    let along = (middle - origin).dot(direction);
    let near = (along - 1.5 * reach).max(0.02 * along.abs().max(reach));
    let through = along + 1.5 * reach;
    let far = match (surface, depth) {
        (Some(surface), Some(depth)) => surface + depth,
        _ => through,
    };
    [near, far.max(near + 1e-3 * reach)].map(|distance| origin + direction * distance)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_blade_lies_on_the_view_ray_down_to_its_depth() {
        let bounds = [DVec3::splat(-1.0), DVec3::splat(1.0)];
        let camera = Camera::fit(bounds[0], bounds[1]);
        let (pixel, size) = ([400.0, 300.0], [800.0, 600.0]);
        let (origin, direction) = camera.ray(pixel, size);
        for depth in [Some(0.3), Some(1.7), None] {
            let surface = (camera.target - origin).length() - 0.5;
            let ends = blade(&camera, pixel, size, bounds, Some(surface), depth);
            for end in ends {
                let off = (end - origin).cross(direction).length();
                assert!(off < 1e-9, "off the ray by {off}");
            }
            let reach = (ends[1] - origin).dot(direction);
            match depth {
                Some(depth) => assert!((reach - surface - depth).abs() < 1e-9),
                None => assert!(reach > surface + 2.0, "goes through"),
            }
            assert!((ends[0] - origin).dot(direction) < surface);
        }
    }
}
