//! [`DistanceSpec`]: a suture or a spring between two points of bodies.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A distance constraint between two particles: a suture, a spring or a rod. Cuts leave it in place.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct DistanceSpec {
    /// First end.
    pub from: EndSpec,
    /// Second end.
    pub to: EndSpec,
    /// Length at rest; absent: the distance of both particles at rest.
    #[schemars(extend("unit" = "m"), range(min = 0.0, max = 2e9))]
    pub length: Option<f64>,
    /// Compliance; 0 is a rod, or with `tension_only` a thread that does not stretch.
    #[serde(default)]
    #[schemars(extend("unit" = "m/N"), range(min = 0.0, max = 1e9))]
    pub compliance: f64,
    /// Act only while longer than at rest, like a thread.
    #[serde(default)]
    pub tension_only: bool,
}

impl DistanceSpec {
    /// A rod between two points whose length is their distance at rest.
    #[must_use]
    pub fn new(from: EndSpec, to: EndSpec) -> Self {
        Self {
            from,
            to,
            ..Self::default()
        }
    }
}

/// An end of a distance constraint: the particle of a body that is nearest to a point at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct EndSpec {
    /// Number of the body, counted from 0.
    pub body: usize,
    /// Point in the world.
    #[schemars(extend("unit" = "m"))]
    pub point: [f64; 3],
}

impl EndSpec {
    /// The particle of a body that is nearest at rest to a point of the world, in m.
    #[must_use]
    pub const fn new(body: usize, point: [f64; 3]) -> Self {
        Self { body, point }
    }
}
