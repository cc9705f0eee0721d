//! [`Tool`]: the geometry of a stroke of the scene, its values checked.

use glam::DVec3;
use incise_cutting::{CutError, Plane, TriangleSurface};
use incise_mesh::Bounds;

use crate::Error;
use crate::live_blade::{LiveBlade, long_enough};
use crate::region::Solid;
use crate::scene::{Region, StrokeSpec};
use crate::text::counted;
use crate::validate::{coordinates, direction, value};

/// The geometry that a stroke cuts with, checked.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum Tool {
    Plane(Plane),
    Surface {
        surface: TriangleSurface,
        bounds: Bounds,
    },
    /// The inside is cut off.
    Punch(Solid),
    /// Tets inside are removed.
    Remove(Solid),
    /// A polyline and the offsets it passes through.
    Sweep {
        blade: Vec<DVec3>,
        path: Vec<[f64; 3]>,
    },
    /// A polyline that is moved interactively.
    Live(LiveBlade),
}

/// The part of space that a tool has passed.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum Reach {
    Box(Bounds),
    /// A whole plane, or the boundary of a half space.
    Plane {
        point: DVec3,
        normal: DVec3,
    },
}

impl Tool {
    /// The part of space that the tool has passed by the end of its stroke; `None` for a live blade that was not moved.
    pub(crate) fn reach(&self) -> Option<Reach> {
        let of_solid = |solid: &Solid| match *solid {
            Solid::HalfSpace { point, normal } => Reach::Plane { point, normal },
            Solid::Box { low, high } => Reach::Box(Bounds { low, high }),
            Solid::Sphere { center, radius } => {
                Reach::Box(Bounds::around([center]).widened(radius))
            }
        };
        match self {
            Self::Plane(plane) => Some(Reach::Plane {
                point: plane.point,
                normal: plane.normal,
            }),
            Self::Surface { bounds, .. } => Some(Reach::Box(*bounds)),
            Self::Punch(solid) | Self::Remove(solid) => Some(of_solid(solid)),
            Self::Sweep { blade, path } => {
                let offsets = Bounds::around(path.iter().copied().map(DVec3::from_array));
                let blade = Bounds::around(blade.iter().copied());
                Some(Reach::Box(Bounds {
                    low: blade.low + offsets.low,
                    high: blade.high + offsets.high,
                }))
            }
            Self::Live(blade) => blade.swept().map(Reach::Box),
        }
    }
}

/// A stroke that met no tet from its beginning to its end.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct MissedStroke {
    /// Its key in the scene.
    pub(crate) field: String,
    /// Where it was.
    pub(crate) reach: Reach,
}

impl Reach {
    /// Distance to a box in m, 0 where they meet.
    pub(crate) fn distance(&self, other: &Bounds) -> f64 {
        match *self {
            Self::Box(bounds) => {
                let apart = (bounds.low - other.high).max(other.low - bounds.high);
                apart.max(DVec3::ZERO).length()
            }
            Self::Plane { point, normal } => {
                let unit = normal.normalize_or_zero();
                let center = 0.5 * (other.low + other.high);
                let reach = unit.abs().dot(0.5 * other.size());
                (unit.dot(center - point).abs() - reach).max(0.0)
            }
        }
    }
}

/// The tool of a stroke and its snap distance.
pub(crate) fn tool(field: &str, spec: &StrokeSpec) -> Result<(Tool, f64), Error> {
    let point = |key: &str, x: &[f64; 3]| coordinates(&format!("{field}.{key}"), *x);
    let points = |key: &str, list: &[[f64; 3]]| -> Result<Vec<DVec3>, Error> {
        list.iter().map(|x| point(key, x)).collect()
    };
    let surface = |key: &str, result: Result<TriangleSurface, CutError>, bounds: Bounds| {
        let tool = result.map(|surface| Tool::Surface { surface, bounds });
        tool.map_err(Error::cut(&format!("{field}.{key}")))
    };
    Ok(match spec {
        StrokeSpec::Plane {
            point: x,
            normal,
            snap,
            ..
        } => {
            let plane = Plane {
                point: point("point", x)?,
                normal: direction(&format!("{field}.normal"), *normal)?,
            };
            (Tool::Plane(plane), *snap)
        }
        StrokeSpec::Rectangle {
            center,
            half_u,
            half_v,
            snap,
            ..
        } => {
            let center = point("center", center)?;
            let (u, v) = (point("half_u", half_u)?, point("half_v", half_v)?);
            let rectangle = TriangleSurface::rectangle(center, u, v);
            let bounds = Bounds::around([u + v, u - v, v - u, -u - v].map(|x| center + x));
            (surface("half_u", rectangle, bounds)?, *snap)
        }
        StrokeSpec::Surface {
            points: corners,
            triangles,
            snap,
            ..
        } => {
            let corners = points("points", corners)?;
            let bounds = Bounds::around(corners.iter().copied());
            let triangles = TriangleSurface::new(&corners, triangles);
            (surface("triangles", triangles, bounds)?, *snap)
        }
        StrokeSpec::Punch { region, snap, .. } => (Tool::Punch(solid(field, region)?), *snap),
        StrokeSpec::Remove { region, .. } => (Tool::Remove(solid(field, region)?), 0.0),
        StrokeSpec::Sweep {
            frames,
            blade,
            path,
            snap,
            // Checked beside the tool.
            solid: _,
        } => {
            if frames[0] >= frames[1] {
                let range = "two frames, the second after the first";
                let frames = format!("{frames:?}");
                return Err(value(format!("{field}.frames"), frames, range));
            }
            if path.len() < 2 {
                let given = counted(path.len(), "point");
                return Err(value(format!("{field}.path"), given, "at least two"));
            }
            points("path", path)?;
            let (path, blade) = (path.clone(), points("blade", blade)?);
            long_enough(field, &blade)?;
            (Tool::Sweep { blade, path }, *snap)
        }
    })
}

fn solid(field: &str, region: &Region) -> Result<Solid, Error> {
    let field = format!("{field}.region");
    let range = "half_space, box or sphere";
    Solid::new(&field, region)?.ok_or_else(|| value(field, "particles", range))
}
