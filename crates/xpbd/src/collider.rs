//! [`Collider`]: the shape and motion of a solid obstacle, with its signed distance in closed form.
//!
//! `constraints/colliders.rs` keeps particles outside.

mod solid;

use glam::{DQuat, DVec3};

use crate::XpbdError;
pub(crate) use solid::{Nearest, Solid};

/// A solid obstacle.
///
/// Particles do not enter it. One that is inside already comes out at its depth over 20 ms, so that a body or an obstacle
/// that was put inside the other is not torn apart; in substeps of that length, and with VBD, at once.
///
/// # Example
/// A particle falls on a ball and comes to rest on its top.
/// ```
/// use glam::DVec3;
/// use incise_graph::Schedule;
/// use incise_xpbd::{Collider, ColliderShape, Solver, StepSettings};
///
/// let ball = Collider::new(ColliderShape::Sphere { center: DVec3::ZERO, radius: 0.5 });
/// let mut solver = Solver::<f64>::new(&[DVec3::Z]);
/// solver.set_mass(0, 1.0);
/// let settings = StepSettings {
///     substeps: 10,
///     gravity: Some(DVec3::new(0.0, 0.0, -9.81)),
///     colliders: vec![ball],
///     ..StepSettings::new(0.016)
/// };
/// for _ in 0..60 {
///     solver.step(&Schedule::default(), &settings)?;
/// }
/// assert!((solver.position(0).z - 0.5).abs() < 1e-12);
/// # Ok::<(), incise_xpbd::XpbdError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Collider {
    /// Shape and position at the start of the frame.
    pub shape: ColliderShape,
    /// Coulomb's coefficient of friction, at least 0.
    pub friction: f64,
    /// Velocity in m/s during the frame. The caller sets the position for the next frame: see [`Collider::moved`].
    pub velocity: DVec3,
}

/// The shape of a collider.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ColliderShape {
    /// A half space, free on the side that the normal points to.
    Plane {
        /// A point on its surface in m.
        point: DVec3,
        /// Its normal, of any length but 0.
        normal: DVec3,
    },
    /// A ball.
    Sphere {
        /// Its center in m.
        center: DVec3,
        /// Its radius in m, positive.
        radius: f64,
    },
    /// All points within the radius of a segment.
    Capsule {
        /// The ends of the segment in m; they may coincide.
        ends: [DVec3; 2],
        /// Its radius in m, positive.
        radius: f64,
    },
    /// A rotated box.
    Box {
        /// Its center in m.
        center: DVec3,
        /// Half its edges in m, positive.
        half_extents: DVec3,
        /// Rotation, of any length but 0.
        rotation: DQuat,
    },
}

impl Collider {
    /// Creates a collider at rest without friction.
    #[must_use]
    pub fn new(shape: ColliderShape) -> Self {
        Self {
            shape,
            friction: 0.0,
            velocity: DVec3::ZERO,
        }
    }

    /// Creates a horizontal floor at a height in m; up is z.
    #[must_use]
    pub fn ground(height: f64, friction: f64) -> Self {
        let shape = ColliderShape::Plane {
            point: DVec3::Z * height,
            normal: DVec3::Z,
        };
        Self {
            friction,
            ..Self::new(shape)
        }
    }

    /// Returns the collider moved by its velocity for `time` s.
    #[must_use]
    pub fn moved(&self, time: f64) -> Self {
        self.shifted(self.velocity * time)
    }

    pub(crate) fn shifted(&self, by: DVec3) -> Self {
        let mut moved = *self;
        match &mut moved.shape {
            ColliderShape::Plane { point, .. } => *point += by,
            ColliderShape::Sphere { center, .. } | ColliderShape::Box { center, .. } => {
                *center += by;
            }
            ColliderShape::Capsule { ends, .. } => ends.iter_mut().for_each(|end| *end += by),
        }
        moved
    }

    /// Returns the signed distance of a point from the surface in m, negative inside, and its gradient.
    ///
    /// Where the gradient is not unique (the center of a sphere, the axis of a capsule, the middle of a box), always
    /// one fixed direction is returned.
    ///
    /// # Example
    /// ```
    /// use glam::DVec3;
    /// use incise_xpbd::Collider;
    ///
    /// let (distance, normal) = Collider::ground(1.0, 0.0).distance(DVec3::ZERO);
    /// assert_eq!((distance, normal), (-1.0, DVec3::Z));
    /// ```
    #[must_use]
    pub fn distance(&self, point: DVec3) -> (f64, DVec3) {
        let nearest = Solid::<f64>::new(&self.shape).nearest(point);
        (nearest.distance, nearest.normal)
    }

    /// Checks that each value lies in its range.
    ///
    /// # Errors
    /// [`XpbdError::Setting`] names the first value that does not.
    pub fn check(&self) -> Result<(), XpbdError> {
        let refuse = |what, value, range| Err(XpbdError::Setting { what, value, range });
        let vectors = match self.shape {
            ColliderShape::Plane { point, normal } => {
                [("collider point", point), ("collider normal", normal)]
            }
            ColliderShape::Sphere { center, .. } => [("collider center", center); 2],
            ColliderShape::Capsule { ends, .. } => ends.map(|end| ("collider end", end)),
            ColliderShape::Box {
                center,
                half_extents,
                ..
            } => [
                ("collider center", center),
                ("collider half_extents", half_extents),
            ],
        };
        let velocity = [("collider velocity", self.velocity)];
        for (what, vector) in vectors.into_iter().chain(velocity) {
            if let Some(value) = vector.to_array().into_iter().find(|c| !c.is_finite()) {
                return refuse(what, value, "finite");
            }
        }
        if !(self.friction.is_finite() && self.friction >= 0.0) {
            return refuse("collider friction", self.friction, "at least 0 and finite");
        }
        match self.shape {
            ColliderShape::Plane { normal, .. } if normal == DVec3::ZERO => {
                refuse("collider normal", 0.0, "a direction")
            }
            ColliderShape::Sphere { radius, .. } | ColliderShape::Capsule { radius, .. }
                if !(radius.is_finite() && radius > 0.0) =>
            {
                refuse("collider radius", radius, "positive and finite")
            }
            ColliderShape::Box {
                half_extents,
                rotation,
                ..
            } => {
                let smallest = half_extents.min_element();
                if smallest <= 0.0 {
                    return refuse("collider half_extents", smallest, "positive");
                }
                let length = rotation.length();
                if !(length.is_finite() && length > 0.0) {
                    return refuse("collider rotation", length, "a rotation");
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }
}
