//! [`ColliderSpec`]: an obstacle.

use std::fmt;

use schemars::JsonSchema;
use serde::de::value::MapAccessDeserializer;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

/// A solid obstacle for particles.
///
/// ```
/// use incise::scene::ColliderSpec;
///
/// let ball = ColliderSpec::sphere([0.0, 0.0, 1.0], 0.2).with_friction(0.5).with_velocity([0.0, 0.0, -1.0]);
/// assert!(matches!(ball, ColliderSpec::Sphere { radius: 0.2, friction: 0.5, .. }));
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
#[non_exhaustive]
pub enum ColliderSpec {
    /// A half space below a plane; the normal points to the free side.
    #[non_exhaustive]
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
    #[non_exhaustive]
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
    #[non_exhaustive]
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
    #[non_exhaustive]
    Box {
        /// Center.
        #[schemars(extend("unit" = "m"))]
        center: [f64; 3],
        /// Half lengths of the edges.
        #[schemars(extend("unit" = "m"))]
        half_extents: [f64; 3],
        /// Rotation; absent: the edges are parallel to the axes.
        #[serde(default, deserialize_with = "rotation")]
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

impl ColliderSpec {
    /// The half space below a plane through a point, in m; the normal, of any length, points to the free side. Without
    /// friction, at rest.
    #[must_use]
    pub const fn plane(point: [f64; 3], normal: [f64; 3]) -> Self {
        Self::Plane {
            point,
            normal,
            friction: 0.0,
            velocity: [0.0; 3],
        }
    }

    /// A sphere, in m. Without friction, at rest.
    #[must_use]
    pub const fn sphere(center: [f64; 3], radius: f64) -> Self {
        Self::Sphere {
            center,
            radius,
            friction: 0.0,
            velocity: [0.0; 3],
        }
    }

    /// All points within a radius of the segment between two ends, in m. Without friction, at rest.
    #[must_use]
    pub const fn capsule(ends: [[f64; 3]; 2], radius: f64) -> Self {
        Self::Capsule {
            ends,
            radius,
            friction: 0.0,
            velocity: [0.0; 3],
        }
    }

    /// A box of a center and half lengths of its edges, in m; without a rotation the edges are parallel to the axes.
    /// Without friction, at rest.
    #[must_use]
    pub const fn cuboid(
        center: [f64; 3],
        half_extents: [f64; 3],
        rotation: Option<RotationSpec>,
    ) -> Self {
        Self::Box {
            center,
            half_extents,
            rotation,
            friction: 0.0,
            velocity: [0.0; 3],
        }
    }

    /// Returns the obstacle with a coefficient of friction.
    #[must_use]
    pub fn with_friction(mut self, coefficient: f64) -> Self {
        let (Self::Plane { friction, .. }
        | Self::Sphere { friction, .. }
        | Self::Capsule { friction, .. }
        | Self::Box { friction, .. }) = &mut self;
        *friction = coefficient;
        self
    }

    /// Returns the obstacle with a velocity, in m/s, from the first frame on.
    #[must_use]
    pub fn with_velocity(mut self, v: [f64; 3]) -> Self {
        let (Self::Plane { velocity, .. }
        | Self::Sphere { velocity, .. }
        | Self::Capsule { velocity, .. }
        | Self::Box { velocity, .. }) = &mut self;
        *velocity = v;
        self
    }
}

/// Reads a rotation from a table. A list, which might be angles or a quaternion, would be taken for the values of its keys.
fn rotation<'de, D: Deserializer<'de>>(reader: D) -> Result<Option<RotationSpec>, D::Error> {
    struct Table;
    impl<'de> Visitor<'de> for Table {
        type Value = Option<RotationSpec>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a table with axis and angle_degrees")
        }

        fn visit_unit<E>(self) -> Result<Self::Value, E> {
            Ok(None)
        }

        fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
            RotationSpec::deserialize(MapAccessDeserializer::new(map)).map(Some)
        }
    }
    reader.deserialize_any(Table)
}

/// A rotation of a collider.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct RotationSpec {
    /// Direction of the axis.
    pub axis: [f64; 3],
    /// Angle, counterclockwise when the axis points to the viewer.
    #[schemars(extend("unit" = "degrees"), range(min = -1e6, max = 1e6))]
    pub angle_degrees: f64,
}

impl Default for RotationSpec {
    /// The z axis and an angle of 0.
    fn default() -> Self {
        Self {
            axis: [0.0, 0.0, 1.0],
            angle_degrees: 0.0,
        }
    }
}
