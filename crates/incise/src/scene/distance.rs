//! [`DistanceSpec`]: a suture or a spring between two points of bodies.

use serde::{Deserialize, Serialize};

/// Keeps two particles at a distance. A cut leaves it on its particles.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DistanceSpec {
    /// One end.
    pub from: EndSpec,
    /// The other end.
    pub to: EndSpec,
    /// The length at rest in m; absent: the distance of both particles at rest.
    pub length: Option<f64>,
    /// One over the stiffness in m/N; 0 is a rod, or a thread that does not stretch.
    #[serde(default)]
    pub compliance: f64,
    /// Whether it acts only while it is longer than at rest, as a thread does.
    #[serde(default)]
    pub tension_only: bool,
}

/// The particle of a body that is nearest to a point at rest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EndSpec {
    /// The number of the body.
    pub body: usize,
    /// The point in m in the world.
    pub point: [f64; 3],
}
