//! [`AttachmentSpec`]: what holds a part of a body and moves it.

use serde::{Deserialize, Serialize};

use super::Region;

/// Holds some particles of a body and moves them. Cuts through what it holds leave both sides held.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AttachmentSpec {
    /// The number of the body.
    #[serde(default)]
    pub body: usize,
    /// What is held: the particles that lie at rest in any of these regions. Fixed ones stay where they are.
    pub regions: Vec<Region>,
    /// The frames at whose start the attachment is at the path's start and end.
    #[serde(default = "at_once")]
    pub frames: [u64; 2],
    /// Offsets of the attachment in m, passed through at equal times. What is held is at rest at the first one.
    #[serde(default = "nowhere")]
    pub path: Vec<[f64; 3]>,
    /// How it turns meanwhile; absent: not at all.
    pub rotation: Option<PathRotationSpec>,
    /// One over the stiffness by which each particle is held, in m/N; 0 holds rigidly.
    #[serde(default)]
    pub compliance: f64,
}

fn at_once() -> [u64; 2] {
    [0, 1]
}

fn nowhere() -> Vec<[f64; 3]> {
    vec![[0.0; 3]; 2]
}

impl AttachmentSpec {
    /// Holds the parts of a body in some regions rigidly where they are, until a program moves them.
    #[must_use]
    pub fn new(body: usize, regions: Vec<Region>) -> Self {
        Self {
            body,
            regions,
            frames: at_once(),
            path: nowhere(),
            rotation: None,
            compliance: 0.0,
        }
    }
}

/// A turn about an axis through a point, at an even rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PathRotationSpec {
    /// The axis.
    pub axis: [f64; 3],
    /// The angle from start to end in degrees, against the clock as seen against the axis; below 180 a frame.
    pub angle_degrees: f64,
    /// A point on the axis in m, which moves along the path.
    #[serde(default)]
    pub center: [f64; 3],
}
