//! [`SolidBlade`]: the body of a blade, which pushes apart what the blade has cut.
//!
//! The cut is made at the start of a frame, up to the blade's pose for that frame. During the frame the body follows: its
//! edge moves from the pose before to this one, so it never leaves the cut. The body lies behind the edge, against the
//! direction of motion; a blade that is drawn back keeps its direction.
//!
//! Just after a cut both sides are at one place, so positions cannot tell to which side a particle belongs. The triangles
//! of the cut can: each looks away from its tissue. A particle with triangles that look both ways is on the front of the
//! cut, where the sides are one, and is left alone. Cost: a pass over the boundary triangles in frames with such a blade.

use std::collections::BTreeMap;

use glam::DVec3;
use incise_cutting::FaceTag;

use crate::Error;
use crate::island::Island;
use crate::scene::{Method, SolidBladeSpec};
use crate::validate::{value, within};

/// How far a triangle may lean against the blade and still say which side it is on, as a cosine.
const LEANING: f64 = 0.3;

/// The body of a blade between two frames.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct SolidBlade {
    thickness: f64,
    wedge_angle: f64,
    height: f64,
    friction: f64,
    /// The pose of the last frame.
    last: Option<[DVec3; 2]>,
    /// The direction of motion, once it has moved.
    front: Option<DVec3>,
}

/// A blade with a body in a frame.
#[derive(Clone, Debug)]
pub(crate) struct FrameBlade {
    /// The number of its stroke.
    pub(crate) stroke: u32,
    /// The middle of its edge at the end of the frame.
    pub(crate) point: DVec3,
    /// The blade without particles; `None` before it has moved.
    pub(crate) blade: Option<incise_xpbd::SolidBlade>,
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
            last: None,
            front: None,
        })
    }

    /// Follows the blade to its pose for a frame.
    pub(crate) fn advance(&mut self, stroke: u32, pose: &[DVec3]) -> Option<FrameBlade> {
        let &[a, b] = pose else { return None };
        let from = self.last.replace([a, b]).unwrap_or([a, b]);
        let along = (b - a).normalize_or_zero();
        let way = 0.5 * (a + b - from[0] - from[1]);
        let across = (way - along * along.dot(way)).normalize_or_zero();
        // Drawn back it still looks ahead.
        if across != DVec3::ZERO && self.front.is_none_or(|front| front.dot(across) > 0.0) {
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
        });
        Some(FrameBlade {
            stroke,
            point: 0.5 * (a + b),
            // Turned so far that it has no front.
            blade: blade.filter(|blade| blade.check().is_ok()),
        })
    }
}

/// The blades of a frame that touch the cuts of an island, with the particles on each side.
pub(crate) fn touching(
    island: &Island,
    blades: &[FrameBlade],
) -> Vec<(u32, incise_xpbd::SolidBlade)> {
    let with_sides = blades.iter().filter_map(|frame| {
        let mut blade = frame.blade.clone()?;
        blade.sides = sides(island, frame.stroke, &blade);
        (!blade.sides.is_empty()).then_some((frame.stroke, blade))
    });
    with_sides.collect()
}

/// The particles on the faces of a stroke near a blade, ascending, and whether each is on the side that `edge × front`
/// points to.
fn sides(island: &Island, stroke: u32, blade: &incise_xpbd::SolidBlade) -> Vec<(u32, bool)> {
    let [a, b] = blade.edge[1];
    let length = a.distance(b);
    let normal = ((b - a).cross(blade.front)).normalize_or_zero();
    let way = blade.edge[0][0]
        .distance(a)
        .max(blade.edge[0][1].distance(b));
    let reach = blade.height + length + way;
    // Of each particle whether it has triangles of tissue on the negative and on the positive side.
    let mut votes: BTreeMap<u32, [bool; 2]> = BTreeMap::new();
    for triangle in island.cuttable.boundary() {
        if triangle.tag != FaceTag::Cut(stroke) {
            continue;
        }
        let [x, y, z] = triangle.particles.map(|p| island.positions[p.index()]);
        if x.distance_squared(a) > reach * reach {
            continue;
        }
        let outward = (y - x).cross(z - x).normalize_or_zero();
        let looks = outward.dot(normal);
        if looks.abs() < LEANING {
            continue;
        }
        for p in triangle.particles {
            votes.entry(p.0).or_default()[usize::from(looks < 0.0)] = true;
        }
    }
    let clear = votes.into_iter().filter_map(|(p, votes)| match votes {
        [true, false] => Some((p, false)),
        [false, true] => Some((p, true)),
        _ => None,
    });
    clear.collect()
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
