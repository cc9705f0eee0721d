//! [`Region`]: some of a body's particles, or a part of space.

use serde::{Deserialize, Serialize};

/// Some of a body's particles.
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
    /// Those with these numbers in the body's mesh.
    Particles(Vec<u32>),
}
