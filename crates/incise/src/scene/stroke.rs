//! [`StrokeSpec`]: a cut in a scene file.
//!
//! Every kind states the frame at whose start it acts, in the world coordinates of that frame. `tool.rs` checks and
//! prepares the geometry; `strokes.rs` cuts.

use glam::DVec3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Region;

/// A cut.
///
/// ```
/// use incise::scene::StrokeSpec;
///
/// let slice = StrokeSpec::plane(4, [0.0; 3], [1.0, 0.0, 0.0]);
/// let blade = vec![[0.0, -1.0, 0.6], [0.0, 1.0, 0.6]];
/// let slit = StrokeSpec::sweep([10, 40], blade, vec![[0.0; 3], [0.0, 0.0, -1.2]]).with_snap(0.0);
/// # assert_eq!([slice, slit].map(|stroke| stroke.last_frame()), [4, 40]);
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
#[non_exhaustive]
pub enum StrokeSpec {
    /// A whole plane, cut at once.
    #[non_exhaustive]
    Plane {
        /// Frame at whose start the cut is made.
        frame: u64,
        /// Point on the plane.
        #[schemars(extend("unit" = "m"))]
        point: [f64; 3],
        /// Normal of the plane, of any length.
        normal: [f64; 3],
        /// Snap distance as a fraction of an edge; 0 turns snapping off.
        #[serde(default = "tenth")]
        #[schemars(range(min = 0.0, max = 0.25))]
        snap: f64,
    },
    /// A blade moved along a path, cutting as it goes.
    #[non_exhaustive]
    Sweep {
        /// Frames at whose start the blade is at the start and at the end of the path.
        frames: [u64; 2],
        /// Blade: a polyline.
        #[schemars(extend("unit" = "m"), length(min = 2))]
        blade: Vec<[f64; 3]>,
        /// Offsets of the blade, at least two, at equal intervals of time.
        #[schemars(extend("unit" = "m"), length(min = 2))]
        path: Vec<[f64; 3]>,
        /// Snap distance as a fraction of an edge; 0 turns snapping off.
        #[serde(default = "tenth")]
        #[schemars(range(min = 0.0, max = 0.25))]
        snap: f64,
        /// Body of the blade, which pushes the sides of its cut apart; absent: it has no thickness and no force.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        solid: Option<SolidBladeSpec>,
    },
    /// A rectangle, cut at once.
    #[non_exhaustive]
    Rectangle {
        /// Frame at whose start the cut is made.
        frame: u64,
        /// Center of the rectangle.
        #[schemars(extend("unit" = "m"))]
        center: [f64; 3],
        /// Vector from the center to the middle of one side.
        #[schemars(extend("unit" = "m"))]
        half_u: [f64; 3],
        /// Vector from the center to the middle of the adjacent side.
        #[schemars(extend("unit" = "m"))]
        half_v: [f64; 3],
        /// Snap distance as a fraction of an edge; 0 turns snapping off.
        #[serde(default = "tenth")]
        #[schemars(range(min = 0.0, max = 0.25))]
        snap: f64,
    },
    /// A triangle surface, open or closed, cut at once.
    #[non_exhaustive]
    Surface {
        /// Frame at whose start the cut is made.
        frame: u64,
        /// Vertices of the surface.
        #[schemars(extend("unit" = "m"))]
        points: Vec<[f64; 3]>,
        /// Triangles: three numbers of vertices each.
        triangles: Vec<[u32; 3]>,
        /// Snap distance as a fraction of an edge; 0 turns snapping off.
        #[serde(default = "tenth")]
        #[schemars(range(min = 0.0, max = 0.25))]
        snap: f64,
    },
    /// A cut around a region, made at once: the inside comes off as a piece.
    #[non_exhaustive]
    Punch {
        /// Frame at whose start the cut is made.
        frame: u64,
        /// Region that is cut out, in the world at that frame; not `particles` or `tets`.
        region: Region,
        /// Snap distance as a fraction of an edge; 0 turns snapping off.
        #[serde(default = "tenth")]
        #[schemars(range(min = 0.0, max = 0.25))]
        snap: f64,
    },
    /// Tets that are removed at once: those whose centers lie in a region.
    #[non_exhaustive]
    Remove {
        /// Frame at whose start the tets are removed.
        frame: u64,
        /// Region of the removed tets, in the world at that frame; not `particles` or `tets`.
        region: Region,
    },
}

/// The body of a straight blade: a wedge behind the edge that ends in two parallel faces. It pushes the sides of its cut
/// apart and bears the force. Not on a GPU, nor with method `vbd`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct SolidBladeSpec {
    /// Thickness behind the wedge.
    #[schemars(extend("unit" = "m"), range(min = 1e-9, max = 1e3))]
    pub thickness: f64,
    /// Angle between the two faces of the wedge.
    #[schemars(extend("unit" = "degrees"), range(min = 1.0, max = 170.0))]
    pub wedge_angle_degrees: f64,
    /// How far the blade reaches behind its edge, against the direction of its motion.
    #[schemars(extend("unit" = "m"), range(min = 1e-9, max = 1e6))]
    pub height: f64,
    /// Coefficient of friction on its faces.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1e3))]
    pub friction: f64,
    /// Work that it takes to part a square meter of tissue: the tissue gives before the edge until the force at the edge is
    /// this times the length of the edge in it, and then parts at this force. 0: parting takes no force.
    #[serde(default)]
    #[schemars(extend("unit" = "J/m²"), range(min = 0.0, max = 1e9))]
    pub toughness: f64,
}

impl SolidBladeSpec {
    /// A blade without friction and toughness, by its thickness and height in m and the angle of its wedge in degrees.
    #[must_use]
    pub const fn new(thickness: f64, wedge_angle_degrees: f64, height: f64) -> Self {
        Self {
            thickness,
            wedge_angle_degrees,
            height,
            friction: 0.0,
            toughness: 0.0,
        }
    }
}

impl Default for SolidBladeSpec {
    /// A blade for bodies of about 1 m: 1 cm thick, a wedge of 20 degrees, 0.5 m high.
    fn default() -> Self {
        Self::new(0.01, 20.0, 0.5)
    }
}

impl StrokeSpec {
    /// The whole plane through a point, in m, cut at the start of a frame; the normal may have any length.
    #[must_use]
    pub fn plane(frame: u64, point: [f64; 3], normal: [f64; 3]) -> Self {
        Self::Plane {
            frame,
            point,
            normal,
            snap: tenth(),
        }
    }

    /// A blade, a polyline in m, whose offsets along a path, in m, reach from the start of one frame to that of
    /// another.
    #[must_use]
    pub fn sweep(frames: [u64; 2], blade: Vec<[f64; 3]>, path: Vec<[f64; 3]>) -> Self {
        Self::Sweep {
            frames,
            blade,
            path,
            snap: tenth(),
            solid: None,
        }
    }

    /// A blade with a body, which pushes the sides of its cut apart; otherwise [`StrokeSpec::sweep`].
    #[must_use]
    pub fn solid_sweep(
        frames: [u64; 2],
        blade: Vec<[f64; 3]>,
        path: Vec<[f64; 3]>,
        solid: SolidBladeSpec,
    ) -> Self {
        Self::Sweep {
            frames,
            blade,
            path,
            snap: tenth(),
            solid: Some(solid),
        }
    }

    /// A rectangle, cut at the start of a frame, by its center and the vectors from there to the middles of two adjacent
    /// sides, in m.
    #[must_use]
    pub fn rectangle(frame: u64, center: [f64; 3], half_u: [f64; 3], half_v: [f64; 3]) -> Self {
        Self::Rectangle {
            frame,
            center,
            half_u,
            half_v,
            snap: tenth(),
        }
    }

    /// A triangle surface, open or closed, cut at the start of a frame: vertices in m, and three of their numbers for
    /// each triangle.
    #[must_use]
    pub fn surface(frame: u64, points: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>) -> Self {
        Self::Surface {
            frame,
            points,
            triangles,
            snap: tenth(),
        }
    }

    /// A cut around a region, made at the start of a frame: the inside comes off as a piece.
    #[must_use]
    pub fn punch(frame: u64, region: Region) -> Self {
        Self::Punch {
            frame,
            region,
            snap: tenth(),
        }
    }

    /// Removal of the tets whose centers lie in a region, at the start of a frame.
    #[must_use]
    pub fn remove(frame: u64, region: Region) -> Self {
        Self::Remove { frame, region }
    }

    /// Returns the stroke with a snap distance, a fraction of an edge; 0 turns snapping off. A removal has none and stays
    /// unchanged.
    #[must_use]
    pub fn with_snap(mut self, fraction: f64) -> Self {
        match &mut self {
            Self::Plane { snap, .. }
            | Self::Sweep { snap, .. }
            | Self::Rectangle { snap, .. }
            | Self::Surface { snap, .. }
            | Self::Punch { snap, .. } => *snap = fraction,
            Self::Remove { .. } => {}
        }
        self
    }

    /// Returns whether the stroke has a solid blade.
    #[must_use]
    pub fn is_solid(&self) -> bool {
        matches!(self, Self::Sweep { solid: Some(_), .. })
    }

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
            | Self::Punch { frame, .. }
            | Self::Remove { frame, .. } => *frame,
            Self::Sweep { frames, .. } => frames[1],
        }
    }

    /// Returns the blade at the start of a frame, a polyline in m; `None` before the stroke begins, after it has ended,
    /// for strokes that cut at once, and for an invalid path. Bit-identical to the blade of the simulation.
    ///
    /// ```
    /// use incise::Scene;
    ///
    /// let stroke = &Scene::built_in().stroke[0]; // frames 4 to 64, obliquely down
    /// let (start, middle) = (stroke.blade_at(4).unwrap(), stroke.blade_at(34).unwrap());
    /// assert!((start[0].z - middle[0].z - 0.14).abs() < 1e-12);
    /// assert_eq!(stroke.blade_at(65), None);
    /// ```
    #[must_use]
    pub fn blade_at(&self, frame: u64) -> Option<Vec<DVec3>> {
        let Self::Sweep {
            frames: [first, last],
            blade,
            path,
            ..
        } = self
        else {
            return None;
        };
        if first == last || !(first..=last).contains(&&frame) || path.is_empty() {
            return None;
        }
        let blade = blade.iter().map(|x| DVec3::from_array(*x));
        Some(pose(blade, path, [*first, *last], frame))
    }
}

/// A blade at the start of a frame that its stroke has reached, for `frames` that ascend and a path with a point.
pub(crate) fn pose(
    blade: impl Iterator<Item = DVec3>,
    path: &[[f64; 3]],
    [first, last]: [u64; 2],
    frame: u64,
) -> Vec<DVec3> {
    let passed = (frame.min(last) - first) as f64 / (last - first) as f64;
    let offset = along(path, passed);
    blade.map(|x| x + offset).collect()
}

/// The point at a fraction of a path whose points are passed at equal times.
pub(crate) fn along(path: &[[f64; 3]], fraction: f64) -> DVec3 {
    let (mut from, mut to, mut rest) = (path[0], path[0], fraction * (path.len() - 1) as f64);
    for &next in &path[1..] {
        (from, to) = (to, next);
        if rest <= 1.0 {
            break;
        }
        rest -= 1.0;
    }
    DVec3::from_array(from).lerp(DVec3::from_array(to), rest.min(1.0))
}

fn tenth() -> f64 {
    0.1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blades_are_where_they_cut() {
        let sweep = |frames, path: &[[f64; 3]]| StrokeSpec::Sweep {
            frames,
            blade: vec![[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]],
            path: path.to_vec(),
            snap: 0.1,
            solid: None,
        };
        let path = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 4.0, 0.0]];
        let stroke = sweep([3, 7], &path);
        assert_eq!([2, 8].map(|frame| stroke.blade_at(frame)), [None, None]);
        let x = [3, 4, 5, 7].map(|frame| stroke.blade_at(frame).unwrap()[0].x);
        assert_eq!(x, [0.0, 0.5, 1.0, 1.0]);
        let end = [DVec3::new(1.0, 3.0, 0.0), DVec3::new(1.0, 5.0, 0.0)];
        assert_eq!(stroke.blade_at(7).unwrap(), end);
        // What no simulation takes.
        assert_eq!(sweep([3, 3], &path).blade_at(3), None);
        assert_eq!(sweep([7, 3], &path).blade_at(5), None);
        assert_eq!(sweep([3, 7], &[]).blade_at(5), None);
    }

    #[test]
    fn a_path_passes_through_its_points() {
        let path = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 4.0, 0.0]];
        for (fraction, expected) in [
            (0.0, [0.0, 0.0, 0.0]),
            (0.25, [0.5, 0.0, 0.0]),
            (0.5, [1.0, 0.0, 0.0]),
            (0.75, [1.0, 2.0, 0.0]),
            (1.0, [1.0, 4.0, 0.0]),
        ] {
            assert_eq!(along(&path, fraction).to_array(), expected);
        }
    }
}
