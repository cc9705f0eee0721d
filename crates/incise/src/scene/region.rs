//! [`Region`]: some of a body's particles or tets, or a part of space.

use serde::{Deserialize, Serialize};

/// Some of a body's particles, or of its tets by their centers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Region {
    /// Those on the side of a plane that its normal points to.
    HalfSpace {
        /// A point on the plane.
        point: [f64; 3],
        /// Its normal.
        normal: [f64; 3],
    },
    /// Those in an axis-aligned box.
    Box {
        /// The corner with the smallest coordinates.
        low: [f64; 3],
        /// The corner with the largest coordinates.
        high: [f64; 3],
    },
    /// Those in a sphere.
    Sphere {
        /// Its center.
        center: [f64; 3],
        /// Its radius.
        radius: f64,
    },
    /// Those with these numbers in the body's mesh; tets if they have all four corners.
    Particles(Vec<u32>),
    /// The tets with these numbers in the body's mesh, as part of another material only.
    Tets(Vec<u32>),
}
