//! [`View`]: what both renderers derive from camera and size, in single precision relative to the eye.
//!
//! Differences to the eye are taken in double precision and rounded once. Particles have single precision relative to the
//! origin of their solver, or to the first particle where positions are sent: what is near that is as sharp far from the
//! origin of the world as at it.

use glam::{Mat4, Vec3, Vec4Swizzles};

use crate::{Camera, RenderError};

/// Most pixels on a side of a picture by software: what every device allows that has WebGPU's default limits.
pub const LARGEST_SIDE: u32 = 8192;

/// What is the same for all that is drawn in a picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View {
    pub(crate) eye: glam::DVec3,
    /// From points relative to the eye to clip space, depth from 0 to 1.
    pub(crate) clip: Mat4,
    pub(crate) right: Vec3,
    pub(crate) up: Vec3,
    pub(crate) forward: Vec3,
    /// Half the picture's width and height at a depth of 1.
    pub(crate) tangents: [f32; 2],
    /// To the light, of length 1.
    pub(crate) light: Vec3,
    /// In pixels.
    pub(crate) size: [u32; 2],
}

impl View {
    /// # Errors
    /// If a side of the picture is 0 or more than `largest`.
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
        // From behind the camera's left shoulder, from above in the world.
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

    /// A point relative to the eye.
    pub(crate) fn relative(&self, point: glam::DVec3) -> Vec3 {
        (point - self.eye).as_vec3()
    }

    /// The ray through a place in the picture, in pixels from its upper left corner; as long as is a depth of 1.
    pub(crate) fn ray(&self, x: f32, y: f32) -> Vec3 {
        let [width, height] = self.size.map(|side| side as f32);
        self.forward
            + self.right * (self.tangents[0] * (2.0 * x / width - 1.0))
            + self.up * (self.tangents[1] * (1.0 - 2.0 * y / height))
    }

    /// What the ray changes by from a pixel to the next to the right and to the next below.
    pub(crate) fn ray_steps(&self) -> [Vec3; 2] {
        let [width, height] = self.size.map(|side| side as f32);
        [
            self.right * (2.0 * self.tangents[0] / width),
            self.up * (-2.0 * self.tangents[1] / height),
        ]
    }

    /// Where a point relative to the eye is seen in pixels from the upper left corner; nothing for what is nearer than
    /// what is drawn.
    pub(crate) fn pixel(&self, point: Vec3) -> Option<glam::Vec2> {
        let clip = self.clip * point.extend(1.0);
        let size = glam::Vec2::new(self.size[0] as f32, self.size[1] as f32);
        let place = clip.xy() / clip.w * glam::Vec2::new(0.5, -0.5) + 0.5;
        (clip.z > 0.0).then_some(place * size)
    }
}

/// The nearest single.
#[expect(
    clippy::cast_possible_truncation,
    reason = "meant to round: what is drawn is single precision"
)]
pub(crate) fn single(value: f64) -> f32 {
    value as f32
}
