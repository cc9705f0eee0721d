//! [`Region`]: a part of space, or a list of particles or tets of a body.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A part of space that selects particles, or tets by their centers; or a list of them. Coordinates are in the world.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Region {
    /// The side of a plane that its normal points to.
    HalfSpace {
        /// Point on the plane.
        #[schemars(extend("unit" = "m"))]
        point: [f64; 3],
        /// Normal of the plane, of any length.
        normal: [f64; 3],
    },
    /// An axis-aligned box.
    Box {
        /// Corner with the smallest coordinates.
        #[schemars(extend("unit" = "m"))]
        low: [f64; 3],
        /// Corner with the largest coordinates.
        #[schemars(extend("unit" = "m"))]
        high: [f64; 3],
    },
    /// A sphere.
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
