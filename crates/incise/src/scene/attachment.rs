//! [`AttachmentSpec`]: a part of a body that is held or moved.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Region;

/// A part of a body that is held or moved along a path. A cut through the part leaves both sides attached.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct AttachmentSpec {
    /// Number of the body, counted from 0.
    #[serde(default)]
    pub body: usize,
    /// Attached particles: those that lie at rest in any of these regions, except fixed ones.
    pub regions: Vec<Region>,
    /// Frames at whose start the attachment is at the start and at the end of the path.
    #[serde(default = "at_once")]
    pub frames: [u64; 2],
    /// Offsets of the attachment, at least two, at equal intervals of time. At the first one the particles are at rest.
    #[serde(default = "nowhere")]
    #[schemars(extend("unit" = "m"), length(min = 2))]
    pub path: Vec<[f64; 3]>,
    /// Rotation along the path; absent: none.
    pub rotation: Option<PathRotationSpec>,
    /// Compliance of each attached particle; 0 is rigid.
    #[serde(default)]
    #[schemars(extend("unit" = "m/N"), range(min = 0.0, max = 1e9))]
    pub compliance: f64,
}

impl Default for AttachmentSpec {
    /// An attachment of no particles of the first body.
    fn default() -> Self {
        Self::new(0, Vec::new())
    }
}

fn at_once() -> [u64; 2] {
    [0, 1]
}

fn nowhere() -> Vec<[f64; 3]> {
    vec![[0.0; 3]; 2]
}

impl AttachmentSpec {
    /// A rigid attachment of the particles in some regions, at rest until a program moves it.
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

/// A rotation about an axis at a constant rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct PathRotationSpec {
    /// Direction of the axis.
    pub axis: [f64; 3],
    /// Angle from start to end, counterclockwise when the axis points to the viewer; below 180 degrees a frame.
    #[schemars(extend("unit" = "degrees"), range(min = -1e6, max = 1e6))]
    pub angle_degrees: f64,
    /// Point on the axis, which moves along the path.
    #[serde(default)]
    #[schemars(extend("unit" = "m"))]
    pub center: [f64; 3],
}

impl Default for PathRotationSpec {
    /// The z axis, through the origin, and an angle of 0.
    fn default() -> Self {
        Self {
            axis: [0.0, 0.0, 1.0],
            angle_degrees: 0.0,
            center: [0.0; 3],
        }
    }
}
