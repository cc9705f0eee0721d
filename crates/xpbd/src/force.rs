//! [`Force`]: a force with its torque, as sums of forces at points have it. Cost: O(1).

use glam::DVec3;

/// A force and its torque about the origin of the world.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Force {
    /// The force in N.
    pub force: DVec3,
    /// The torque about the origin of the world in N·m.
    pub torque: DVec3,
}

impl Force {
    /// Returns the torque about another point in N·m.
    ///
    /// ```
    /// use glam::DVec3;
    /// use incise_xpbd::Force;
    ///
    /// // 2 N upwards at x = 3 m turn nothing about that point.
    /// let force = Force { force: DVec3::Z * 2.0, torque: DVec3::Y * -6.0 };
    /// assert_eq!(force.torque_about(DVec3::X * 3.0), DVec3::ZERO);
    /// ```
    #[must_use]
    pub fn torque_about(&self, point: DVec3) -> DVec3 {
        self.torque - point.cross(self.force)
    }

    /// Adds a force that acts at a point.
    pub(crate) fn add(&mut self, force: DVec3, at: DVec3) {
        self.force += force;
        self.torque += at.cross(force);
    }

    /// Returns force and torque times a factor.
    pub(crate) fn scaled(&self, factor: f64) -> Self {
        Self {
            force: self.force * factor,
            torque: self.torque * factor,
        }
    }
}
