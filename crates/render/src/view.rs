//! [`View`]: values that both renderers derive from camera and size, in single precision relative to the eye.
//!
//! Differences to the eye are taken in double precision and rounded once. Particles have single precision relative to
//! the origin of their solver, or to the first particle where positions are uploaded: precision near that point does
//! not depend on the distance from the world origin.

use glam::{Mat4, Vec3, Vec4Swizzles};

use crate::{Camera, RenderError};

/// Largest side of an image by software, in pixels: the limit of every device with WebGPU's default limits.
pub const LARGEST_SIDE: u32 = 8192;

/// Values shared by everything drawn in an image.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View {
    pub(crate) eye: glam::DVec3,
    /// Projection from points relative to the eye to clip space, depth from 0 to 1.
    pub(crate) clip: Mat4,
    pub(crate) right: Vec3,
    pub(crate) up: Vec3,
    pub(crate) forward: Vec3,
    /// Half the image width and height at a depth of 1.
    pub(crate) tangents: [f32; 2],
    /// Unit vector to the light.
    pub(crate) light: Vec3,
    /// Size of the image in pixels.
    pub(crate) size: [u32; 2],
}

impl View {
    /// # Errors
    /// If a side of the image is 0 or more than `largest`.
    pub(crate) fn new(
        camera: &Camera,
        [width, height]: [u32; 2],
        largest: u32,
    ) -> Result<Self, RenderError> {
        if width == 0 || height == 0 || width > largest || height > largest {
            let range = format!("each side has from 1 to {largest} pixels");
            return Err(RenderError::Size {
                width,
                height,
                range,
            });
        }
        let aspect = f64::from(width) / f64::from(height);
        let tangent = (camera.field_of_view * 0.5).tan();
        let (right, forward) = (camera.right(), camera.forward());
        // From behind the camera's left shoulder and above in the world.
        let light = glam::DVec3::Z * 0.8 - right * 0.55 - forward.with_z(0.0) * 0.45;
        Ok(Self {
            eye: camera.eye(),
            clip: camera.projection(aspect).as_mat4(),
            right: right.as_vec3(),
            up: camera.up().as_vec3(),
            forward: forward.as_vec3(),
            tangents: [single(tangent * aspect), single(tangent)],
            light: light.normalize().as_vec3(),
            size: [width, height],
        })
    }

    /// Converts a point to single precision relative to the eye.
    pub(crate) fn relative(&self, point: glam::DVec3) -> Vec3 {
        (point - self.eye).as_vec3()
    }

    /// Ray through a position in the image, in pixels from its upper left corner; it ends at a depth of 1.
    pub(crate) fn ray(&self, x: f32, y: f32) -> Vec3 {
        let [width, height] = self.size.map(|side| side as f32);
        self.forward
            + self.right * (self.tangents[0] * (2.0 * x / width - 1.0))
            + self.up * (self.tangents[1] * (1.0 - 2.0 * y / height))
    }

    /// Change of the ray per pixel to the right and per pixel down.
    pub(crate) fn ray_steps(&self) -> [Vec3; 2] {
        let [width, height] = self.size.map(|side| side as f32);
        [
            self.right * (2.0 * self.tangents[0] / width),
            self.up * (-2.0 * self.tangents[1] / height),
        ]
    }

    /// Projects a point relative to the eye to pixels from the upper left; `None` for a point nearer than the near
    /// plane.
    pub(crate) fn pixel(&self, point: Vec3) -> Option<glam::Vec2> {
        let clip = self.clip * point.extend(1.0);
        let size = glam::Vec2::new(self.size[0] as f32, self.size[1] as f32);
        let place = clip.xy() / clip.w * glam::Vec2::new(0.5, -0.5) + 0.5;
        (clip.z > 0.0).then_some(place * size)
    }
}

/// Rounds to the nearest single-precision value.
#[expect(
    clippy::cast_possible_truncation,
    reason = "meant to round: what is drawn is single precision"
)]
pub(crate) fn single(value: f64) -> f32 {
    value as f32
}
