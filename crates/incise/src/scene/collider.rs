//! [`ColliderSpec`]: an obstacle.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A solid obstacle for particles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum ColliderSpec {
    /// A half space below a plane; the normal points to the free side.
    Plane {
        /// Point on the plane.
        #[schemars(extend("unit" = "m"))]
        point: [f64; 3],
        /// Normal of the plane, of any length.
        normal: [f64; 3],
        /// Coefficient of friction.
        #[serde(default)]
        #[schemars(range(min = 0.0, max = 1e3))]
        friction: f64,
        /// Velocity, from the first frame on.
        #[serde(default)]
        #[schemars(extend("unit" = "m/s"))]
        velocity: [f64; 3],
    },
    /// A sphere.
    Sphere {
        /// Center.
        #[schemars(extend("unit" = "m"))]
        center: [f64; 3],
        /// Radius.
        #[schemars(extend("unit" = "m"), range(min = 1e-9, max = 1e9))]
        radius: f64,
        /// Coefficient of friction.
        #[serde(default)]
        #[schemars(range(min = 0.0, max = 1e3))]
        friction: f64,
        /// Velocity, from the first frame on.
        #[serde(default)]
        #[schemars(extend("unit" = "m/s"))]
        velocity: [f64; 3],
    },
    /// A capsule: all points within a radius of a segment.
    Capsule {
        /// Ends of the segment.
        #[schemars(extend("unit" = "m"))]
        ends: [[f64; 3]; 2],
        /// Radius.
        #[schemars(extend("unit" = "m"), range(min = 1e-9, max = 1e9))]
        radius: f64,
        /// Coefficient of friction.
        #[serde(default)]
        #[schemars(range(min = 0.0, max = 1e3))]
        friction: f64,
        /// Velocity, from the first frame on.
        #[serde(default)]
        #[schemars(extend("unit" = "m/s"))]
        velocity: [f64; 3],
    },
    /// A box.
    Box {
        /// Center.
        #[schemars(extend("unit" = "m"))]
        center: [f64; 3],
        /// Half lengths of the edges.
        #[schemars(extend("unit" = "m"))]
        half_extents: [f64; 3],
        /// Rotation; absent: the edges are parallel to the axes.
        rotation: Option<RotationSpec>,
        /// Coefficient of friction.
        #[serde(default)]
        #[schemars(range(min = 0.0, max = 1e3))]
        friction: f64,
        /// Velocity, from the first frame on.
        #[serde(default)]
        #[schemars(extend("unit" = "m/s"))]
        velocity: [f64; 3],
    },
}

/// A rotation of a collider.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RotationSpec {
    /// Direction of the axis.
    pub axis: [f64; 3],
    /// Angle, counterclockwise when the axis points to the viewer.
    #[schemars(extend("unit" = "degrees"), range(min = -1e6, max = 1e6))]
    pub angle_degrees: f64,
}
