//! [`Tool`]: the geometry of a stroke of the scene, its values checked.

use glam::DVec3;
use incise_cutting::{CutError, Plane, TriangleSurface};

use crate::Error;
use crate::live_blade::{LiveBlade, long_enough};
use crate::region::Solid;
use crate::scene::{Region, StrokeSpec};
use crate::validate::{coordinates, direction, value};

/// The geometry that a stroke cuts with, checked.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum Tool {
    Plane(Plane),
    Surface(TriangleSurface),
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

/// The tool of a stroke and its snap distance.
pub(crate) fn tool(field: &str, spec: &StrokeSpec) -> Result<(Tool, f64), Error> {
    let point = |key: &str, x: &[f64; 3]| coordinates(&format!("{field}.{key}"), *x);
    let points = |key: &str, list: &[[f64; 3]]| -> Result<Vec<DVec3>, Error> {
        list.iter().map(|x| point(key, x)).collect()
    };
    let surface = |key: &str, result: Result<TriangleSurface, CutError>| {
        result.map(Tool::Surface).map_err(|source| Error::Cut {
            field: format!("{field}.{key}"),
            source,
        })
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
            (surface("half_u", rectangle)?, *snap)
        }
        StrokeSpec::Surface {
            points: corners,
            triangles,
            snap,
            ..
        } => {
            let corners = points("points", corners)?;
            let triangles = TriangleSurface::new(&corners, triangles);
            (surface("triangles", triangles)?, *snap)
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
                let given = format!("{} point(s)", path.len());
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
