//! [`ColliderSpec`]: an obstacle.

use serde::{Deserialize, Serialize};

/// A solid obstacle that particles do not enter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum ColliderSpec {
    /// A half space, free on the side that the normal points to.
    Plane {
        /// A point on its surface in m.
        point: [f64; 3],
        /// Its normal.
        normal: [f64; 3],
        /// Coefficient of friction.
        #[serde(default)]
        friction: f64,
        /// Velocity in m/s, from the first frame on.
        #[serde(default)]
        velocity: [f64; 3],
    },
    /// A ball.
    Sphere {
        /// Its center in m.
        center: [f64; 3],
        /// Its radius in m.
        radius: f64,
        /// Coefficient of friction.
        #[serde(default)]
        friction: f64,
        /// Velocity in m/s, from the first frame on.
        #[serde(default)]
        velocity: [f64; 3],
    },
    /// All points within the radius of a segment.
    Capsule {
        /// The ends of the segment in m.
        ends: [[f64; 3]; 2],
        /// Its radius in m.
        radius: f64,
        /// Coefficient of friction.
        #[serde(default)]
        friction: f64,
        /// Velocity in m/s, from the first frame on.
        #[serde(default)]
        velocity: [f64; 3],
    },
    /// A box.
    Box {
        /// Its center in m.
        center: [f64; 3],
        /// Half its edges in m.
        half_extents: [f64; 3],
        /// How it is turned; absent: its edges are along the axes.
        rotation: Option<RotationSpec>,
        /// Coefficient of friction.
        #[serde(default)]
        friction: f64,
        /// Velocity in m/s, from the first frame on.
        #[serde(default)]
        velocity: [f64; 3],
    },
}

/// A rotation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RotationSpec {
    /// The axis.
    pub axis: [f64; 3],
    /// The angle in degrees, against the clock as seen against the axis.
    pub angle_degrees: f64,
}
