//! [`SolidBlade`]: the body of a blade, which pushes apart what the blade has cut.
//!
//! The cut is made at the start of a frame, up to the blade's pose for that frame. During the frame the body follows: its
//! edge moves from the pose before to this one, so it never leaves the cut. The body lies behind the edge, against the
//! direction of motion; a blade that is drawn back keeps its direction.
//!
//! Where the blade has a toughness, the tissue decides in the frame how far the edge gets ([`crate::edge_points`]). The cut
//! then comes a frame later: at the start of a frame it is made up to where the body ended in the frame before, through the
//! material as that moved meanwhile. Tissue that gave before the edge has not been met and is not cut.
//! Cost: O(1) a frame.

use glam::DVec3;

use crate::Error;
use crate::scene::{Method, SolidBladeSpec};
use crate::validate::{value, within};

/// The body of a blade between two frames.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct SolidBlade {
    thickness: f64,
    wedge_angle: f64,
    height: f64,
    friction: f64,
    toughness: f64,
    /// The pose of the last frame.
    last: Option<[DVec3; 2]>,
    /// The direction of motion, once it has moved.
    front: Option<DVec3>,
    /// Whether it has touched what it cut: before that it may turn round.
    has_touched: bool,
}

/// A blade with a body in a frame.
#[derive(Clone, Debug)]
pub(crate) struct FrameBlade {
    /// The number of its stroke.
    pub(crate) stroke: u32,
    /// The middle of its edge at the end of the frame.
    pub(crate) point: DVec3,
    /// The blade without particles and edge points; `None` before it has moved.
    pub(crate) blade: Option<incise_xpbd::SolidBlade>,
    /// Whether its cut has run ahead of its edge: more area is open than the edge has done work.
    pub(crate) owes: bool,
}

impl SolidBlade {
    /// Checks the body of a blade. `field` is the key of its stroke.
    pub(crate) fn new(field: &str, spec: &SolidBladeSpec, points: usize) -> Result<Self, Error> {
        let field = format!("{field}.solid");
        if points != 2 {
            let range = "a straight blade of two points where it is solid";
            return Err(value(
                format!("{field}.blade"),
                format!("{points} points"),
                range,
            ));
        }
        let key = |key: &str| format!("{field}.{key}");
        let angle = within(
            &key("wedge_angle_degrees"),
            spec.wedge_angle_degrees,
            1.0,
            170.0,
        )?;
        Ok(Self {
            thickness: within(&key("thickness"), spec.thickness, 1e-9, 1e3)?,
            wedge_angle: angle.to_radians(),
            height: within(&key("height"), spec.height, 1e-9, 1e6)?,
            friction: within(&key("friction"), spec.friction, 0.0, 1e3)?,
            toughness: within(&key("toughness"), spec.toughness, 0.0, 1e9)?,
            last: None,
            front: None,
            has_touched: false,
        })
    }

    /// Work in J that it takes to part a square meter.
    pub(crate) fn toughness(&self) -> f64 {
        self.toughness
    }

    /// Whether tissue resists its edge, so that cuts come a frame later.
    pub(crate) fn is_tough(&self) -> bool {
        self.toughness > 0.0
    }

    /// Where the body ended in the last frame.
    pub(crate) fn last_pose(&self) -> Option<[DVec3; 2]> {
        self.last
    }

    /// Notes that the blade touches what it has cut: it keeps its direction from now on.
    pub(crate) fn note_touch(&mut self) {
        self.has_touched = true;
    }

    /// Follows the blade to its pose for a frame.
    pub(crate) fn advance(&mut self, stroke: u32, pose: &[DVec3]) -> Option<FrameBlade> {
        let &[a, b] = pose else { return None };
        let from = self.last.replace([a, b]).unwrap_or([a, b]);
        let along = (b - a).normalize_or_zero();
        let way = 0.5 * (a + b - from[0] - from[1]);
        let across = (way - along * along.dot(way)).normalize_or_zero();
        // Drawn back it still looks ahead. In the air it turns as it moves.
        let follows = |front: DVec3| !self.has_touched || front.dot(across) > 0.0;
        if across != DVec3::ZERO && self.front.is_none_or(follows) {
            self.front = Some(across);
        }
        let blade = self.front.map(|front| incise_xpbd::SolidBlade {
            edge: [from, [a, b]],
            front,
            thickness: self.thickness,
            wedge_angle: self.wedge_angle,
            height: self.height,
            friction: self.friction,
            sides: Vec::new(),
            toughness: self.toughness,
            uncut: Vec::new(),
        });
        Some(FrameBlade {
            stroke,
            point: 0.5 * (a + b),
            // Turned so far that it has no front.
            blade: blade.filter(|blade| blade.check().is_ok()),
            owes: false,
        })
    }
}

/// Refuses a solid blade where method or device know none.
pub(crate) fn check(field: &str, method: Method, is_gpu: bool) -> Result<(), Error> {
    let range = if is_gpu {
        "absent on a GPU"
    } else if method == Method::Vbd {
        "absent with method vbd"
    } else {
        return Ok(());
    };
    Err(value(format!("{field}.solid"), "declared", range))
}
