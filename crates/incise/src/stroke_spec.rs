//! [`StrokeSpec`]: a cut, as a scene file describes it.
//!
//! Every kind names the frame at whose start it acts, in the space where the body is then. What is carried out:
//! `tool.rs` checks and prepares, `strokes.rs` cuts.

use serde::{Deserialize, Serialize};

use crate::scene::Region;

/// A cut.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub enum StrokeSpec {
    /// A whole plane, at once.
    Plane {
        /// The frame at whose start it cuts.
        frame: u64,
        /// A point on the plane in m.
        point: [f64; 3],
        /// Its normal.
        normal: [f64; 3],
        /// Snap distance as a fraction of an edge.
        #[serde(default = "tenth")]
        snap: f64,
    },
    /// A blade moved along a path, cutting as it goes.
    Sweep {
        /// The frames at whose start the blade is at the path's start and end.
        frames: [u64; 2],
        /// The blade: a polyline in m.
        blade: Vec<[f64; 3]>,
        /// Offsets of the blade in m, passed through at equal times.
        path: Vec<[f64; 3]>,
        /// Snap distance as a fraction of an edge.
        #[serde(default = "tenth")]
        snap: f64,
    },
    /// A bounded plane, at once.
    Rectangle {
        /// The frame at whose start it cuts.
        frame: u64,
        /// Its middle in m.
        center: [f64; 3],
        /// From the middle to the middle of one side in m.
        half_u: [f64; 3],
        /// From the middle to the middle of the next side in m.
        half_v: [f64; 3],
        /// Snap distance as a fraction of an edge.
        #[serde(default = "tenth")]
        snap: f64,
    },
    /// A surface of triangles, open or closed, at once.
    Surface {
        /// The frame at whose start it cuts.
        frame: u64,
        /// The corners in m.
        points: Vec<[f64; 3]>,
        /// Three numbers of corners each.
        triangles: Vec<[u32; 3]>,
        /// Snap distance as a fraction of an edge.
        #[serde(default = "tenth")]
        snap: f64,
    },
    /// A cut around a region, at once: what is inside comes off as a plug.
    Plug {
        /// The frame at whose start it cuts.
        frame: u64,
        /// What comes off, in the space where the body is then; not `particles`.
        region: Region,
        /// Snap distance as a fraction of an edge.
        #[serde(default = "tenth")]
        snap: f64,
    },
    /// Tets taken away, at once: those with their middle in a region.
    Remove {
        /// The frame at whose start they go.
        frame: u64,
        /// Where, in the space where the body is then; not `particles`.
        region: Region,
    },
}

impl StrokeSpec {
    /// The first frame in which the stroke cuts or, for a moved blade, has its first pose.
    #[must_use]
    pub fn first_frame(&self) -> u64 {
        match self {
            Self::Sweep { frames, .. } => frames[0],
            _ => self.last_frame(),
        }
    }

    /// The last frame in which the stroke cuts.
    #[must_use]
    pub fn last_frame(&self) -> u64 {
        match self {
            Self::Plane { frame, .. }
            | Self::Rectangle { frame, .. }
            | Self::Surface { frame, .. }
            | Self::Plug { frame, .. }
            | Self::Remove { frame, .. } => *frame,
            Self::Sweep { frames, .. } => frames[1],
        }
    }
}

fn tenth() -> f64 {
    0.1
}
