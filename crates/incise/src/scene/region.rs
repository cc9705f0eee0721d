//! [`Region`]: a part of space, or a list of particles or tets of a body.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A part of space that selects particles, or tets by their centers; or a list of them. Coordinates are in the world.
///
/// ```
/// use incise::scene::{BodySpec, Region};
///
/// let mut body = BodySpec::default();
/// body.fixed = vec![Region::half_space([0.0; 3], [0.0, 0.0, -1.0]), Region::Particles(vec![7])];
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum Region {
    /// The side of a plane that its normal points to.
    #[non_exhaustive]
    HalfSpace {
        /// Point on the plane.
        #[schemars(extend("unit" = "m"))]
        point: [f64; 3],
        /// Normal of the plane, of any length.
        normal: [f64; 3],
    },
    /// An axis-aligned box.
    #[non_exhaustive]
    Box {
        /// Corner with the smallest coordinates.
        #[schemars(extend("unit" = "m"))]
        low: [f64; 3],
        /// Corner with the largest coordinates.
        #[schemars(extend("unit" = "m"))]
        high: [f64; 3],
    },
    /// A sphere.
    #[non_exhaustive]
    Sphere {
        /// Center of the sphere.
        #[schemars(extend("unit" = "m"))]
        center: [f64; 3],
        /// Radius of the sphere.
        #[schemars(extend("unit" = "m"), range(min = 0.0))]
        radius: f64,
    },
    /// Particles by their numbers in the body's mesh; of tets, those with all four corners in the list.
    Particles(Vec<u32>),
    /// Tets by their numbers in the body's mesh; only in the `material` of a body.
    Tets(Vec<u32>),
}

impl Region {
    /// The side of a plane through a point, in m, that the normal, of any length, points to.
    #[must_use]
    pub const fn half_space(point: [f64; 3], normal: [f64; 3]) -> Self {
        Self::HalfSpace { point, normal }
    }

    /// The axis-aligned box between the corners with the smallest and the largest coordinates, in m.
    #[must_use]
    pub const fn axis_box(low: [f64; 3], high: [f64; 3]) -> Self {
        Self::Box { low, high }
    }

    /// A sphere, in m.
    #[must_use]
    pub const fn sphere(center: [f64; 3], radius: f64) -> Self {
        Self::Sphere { center, radius }
    }
}
