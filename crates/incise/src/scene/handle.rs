//! [`HandleSpec`]: what holds a part of a body and moves it.

use serde::{Deserialize, Serialize};

use super::Region;

/// Holds some particles of a body and moves them. Cuts through what it holds leave both sides held.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HandleSpec {
    /// The number of the body.
    #[serde(default)]
    pub body: usize,
    /// What is held: the particles that lie at rest in any of these regions. Fixed ones stay where they are.
    pub holds: Vec<Region>,
    /// The frames at whose start the handle is at the path's start and end.
    pub frames: [u64; 2],
    /// Offsets of the handle in m, passed through at equal times. What is held is at rest at the first one.
    pub path: Vec<[f64; 3]>,
    /// How it turns meanwhile; absent: not at all.
    pub turn: Option<TurnSpec>,
    /// One over the stiffness by which each particle is held, in m/N; 0 holds rigidly.
    #[serde(default)]
    pub compliance: f64,
}

/// A turn about an axis through a point, at an even rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TurnSpec {
    /// The axis.
    pub axis: [f64; 3],
    /// The angle from start to end in degrees, against the clock as seen against the axis; below 180 a frame.
    pub angle_degrees: f64,
    /// A point on the axis in m, which moves along the path.
    #[serde(default)]
    pub center: [f64; 3],
}
