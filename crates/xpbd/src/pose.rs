//! [`Pose`]: position and rotation of a handle that particles are attached to.

use glam::{DQuat, DVec3};

/// Position and rotation of a handle.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Pose {
    /// Position in m.
    pub position: DVec3,
    /// Rotation, of length 1.
    pub rotation: DQuat,
}

impl Pose {
    /// Creates a pose at a position, without rotation.
    #[must_use]
    pub fn at(position: DVec3) -> Self {
        Self {
            position,
            rotation: DQuat::IDENTITY,
        }
    }

    /// Transforms a point of the handle's frame to the world.
    #[must_use]
    pub fn apply(&self, point: DVec3) -> DVec3 {
        self.position + self.rotation * point
    }

    /// Interpolates to another pose, which is returned exactly at a fraction of 1.
    #[must_use]
    pub fn toward(&self, to: &Self, fraction: f64) -> Self {
        if fraction >= 1.0 || self == to {
            return *to;
        }
        Self {
            position: self.position.lerp(to.position, fraction),
            rotation: self.rotation.slerp(to.rotation, fraction),
        }
    }

    /// # Panics
    /// If the pose is not finite or its rotation not of length 1.
    pub(crate) fn check(&self) {
        let sound = self.position.is_finite() && self.rotation.is_finite();
        assert!(
            sound && (self.rotation.length() - 1.0).abs() < 1e-6,
            "poses are finite and their rotations of length 1"
        );
    }
}
