//! [`Timeline`]: the strokes of a scene, carried out frame by frame.

use glam::DVec3;
use incise_cutting::{CutDelta, CutError, CutOptions, Plane, Sweep, cut_plane};

use crate::Error;
use crate::group::Group;
use crate::limits::{coordinates, direction, value};
use crate::scene::StrokeSpec;

/// A stroke and how far it is.
#[derive(Debug)]
struct Stroke {
    field: String,
    spec: StrokeSpec,
    /// One for each group of bodies once the blade has its first pose.
    sweeps: Vec<Sweep>,
}

/// The strokes that are not finished.
#[derive(Debug, Default)]
pub(crate) struct Timeline {
    strokes: Vec<Stroke>,
    added: usize,
    /// Smallest snap distance: rounding of the positions in the solver's precision.
    tolerance: f64,
}

impl Timeline {
    pub(crate) fn new(tolerance: f64) -> Self {
        Self {
            strokes: Vec::new(),
            added: 0,
            tolerance,
        }
    }

    /// Adds a stroke, if all its values are in their ranges.
    pub(crate) fn add(&mut self, mut spec: StrokeSpec) -> Result<(), Error> {
        let field = format!("stroke[{}]", self.added);
        let cut = |key: &str, source: CutError| Error::Cut {
            field: format!("{field}.{key}"),
            source,
        };
        match &mut spec {
            StrokeSpec::Plane {
                point,
                normal,
                snap,
                ..
            } => {
                let options = self.options(*snap).check();
                options.map_err(|source| cut("snap", source))?;
                coordinates(&format!("{field}.point"), *point)?;
                *normal = direction(&format!("{field}.normal"), *normal)?.to_array();
            }
            StrokeSpec::Sweep {
                frames,
                blade,
                path,
                snap,
            } => {
                let options = self.options(*snap).check();
                options.map_err(|source| cut("snap", source))?;
                if frames[0] >= frames[1] {
                    let range = "two frames, the second after the first";
                    return Err(value(
                        format!("{field}.frames"),
                        format!("{frames:?}"),
                        range,
                    ));
                }
                if path.len() < 2 {
                    return Err(value(
                        format!("{field}.path"),
                        format!("{} point(s)", path.len()),
                        "at least two",
                    ));
                }
                for &offset in path.iter() {
                    coordinates(&format!("{field}.path"), offset)?;
                }
                for &point in blade.iter() {
                    coordinates(&format!("{field}.blade"), point)?;
                }
                let length: f64 = blade
                    .windows(2)
                    .map(|ends| vector(ends[0]).distance(vector(ends[1])))
                    .sum();
                if blade.len() < 2 || length == 0.0 {
                    let points = blade.len();
                    return Err(cut("blade", CutError::ShortBlade { points, length }));
                }
            }
        }
        self.strokes.push(Stroke {
            field,
            spec,
            sweeps: Vec::new(),
        });
        self.added += 1;
        Ok(())
    }

    /// Carries out what is due in `frame` on every group; hands each delta to `follow` before the next stroke moves. The
    /// groups' positions are kept current.
    pub(crate) fn advance(
        &mut self,
        frame: u64,
        groups: &mut [Group],
        mut follow: impl FnMut(usize, &mut Group, &CutDelta) -> Result<(), Error>,
    ) -> Result<(), Error> {
        for i in 0..self.strokes.len() {
            for (g, group) in groups.iter_mut().enumerate() {
                let Some(delta) = self.strokes[i].advance(frame, self.tolerance, g, group)? else {
                    continue;
                };
                if delta.is_empty() {
                    continue;
                }
                delta.extend_particles(&mut group.positions);
                for other in self.strokes.iter_mut().enumerate().filter(|(j, _)| *j != i) {
                    if let Some(sweep) = other.1.sweeps.get_mut(g) {
                        sweep.follow(&group.cuttable, &delta);
                    }
                }
                follow(g, group, &delta)?;
            }
        }
        self.strokes
            .retain(|stroke| frame < stroke.spec.last_frame());
        Ok(())
    }

    fn options(&self, snap: f64) -> CutOptions {
        CutOptions {
            snap,
            tolerance: self.tolerance,
            ..CutOptions::default()
        }
    }
}

impl Stroke {
    /// Moves in the group of the given number.
    fn advance(
        &mut self,
        frame: u64,
        tolerance: f64,
        number: usize,
        group: &mut Group,
    ) -> Result<Option<CutDelta>, Error> {
        let (cuttable, positions) = (&mut group.cuttable, &group.positions);
        let cut = |source| Error::Cut {
            field: self.field.clone(),
            source,
        };
        match &self.spec {
            StrokeSpec::Plane {
                frame: due,
                point,
                normal,
                snap,
            } if *due <= frame => {
                let options = CutOptions {
                    snap: *snap,
                    tolerance,
                    ..CutOptions::default()
                };
                cut_plane(cuttable, positions, &plane(*point, *normal), &options)
                    .map(Some)
                    .map_err(cut)
            }
            StrokeSpec::Sweep {
                frames: [first, last],
                blade,
                path,
                snap,
            } if *first <= frame => {
                let elapsed = (frame.min(*last) - first) as f64 / (last - first) as f64;
                let offset = along(path, elapsed);
                let pose: Vec<DVec3> = blade.iter().map(|x| vector(*x) + offset).collect();
                if let Some(sweep) = self.sweeps.get_mut(number) {
                    return sweep
                        .advance(cuttable, positions, &pose)
                        .map(Some)
                        .map_err(cut);
                }
                let options = CutOptions {
                    snap: *snap,
                    tolerance,
                    ..CutOptions::default()
                };
                let sweep = Sweep::new(cuttable, positions, &pose, options);
                self.sweeps.push(sweep.map_err(cut)?);
                Ok(None)
            }
            _ => Ok(None),
        }
    }
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
    vector(from).lerp(vector(to), rest.min(1.0))
}

fn plane(point: [f64; 3], normal: [f64; 3]) -> Plane {
    Plane {
        point: vector(point),
        normal: vector(normal),
    }
}

fn vector(v: [f64; 3]) -> DVec3 {
    DVec3::from_array(v)
}

#[cfg(test)]
mod tests {
    use super::*;

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
