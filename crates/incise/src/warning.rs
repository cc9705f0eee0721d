//! [`Warning`]: a problem of a result, with its cause and a fix.
//!
//! Warnings of the settings come with the first frame and whenever settings change, those of a cut or of the motion with
//! the frame in which they begin. Cost: a pass over the particles a frame for the largest speed; the others cost what
//! sets them off.

use std::fmt;

use glam::DVec3;
use incise_mesh::Bounds;
use serde::Serialize;

use crate::accuracy::DEFAULT_ACCURACY;
use crate::scene::SolverSpec;
use crate::substeps::{Choice, Shortfall};
use crate::text::{counted, percent};
use crate::tool::{MissedStroke, Reach};

/// The kind of a [`Warning`], written in JSON as `substeps_capped` and so on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
#[cfg_attr(feature = "save", derive(serde::Deserialize))]
pub enum WarningCode {
    /// The accuracy wanted needs more substeps than `max_substeps`.
    SubstepsCapped,
    /// Two-level VBD has not reached the accuracy wanted in a frame.
    NotConverged,
    /// The accuracy wanted needs more substeps than fit into `budget_ms`.
    BudgetTooSmall,
    /// The given number of substeps leaves an expected error above `accuracy` (0.1 of the motion if absent).
    Inaccurate,
    /// The expected error is too large because Poisson's ratio is near 0.5.
    NearlyIncompressible,
    /// The accuracy wanted needs more substeps than `max_substeps`, so the body is solved by two-level VBD with one step a
    /// frame: states at rest are accurate, vibrations are damped.
    VibrationsDamped,
    /// Cuts have left more than 1% of a body's volume in tets that are solved less accurately than asked for.
    OutsideAccuracy,
    /// Slivers hold more than a tenth of the elastic energy that is reported.
    SliverEnergy,
    /// A region of the scene contains no particle, or no tet.
    EmptyRegion,
    /// A body starts inside the ground, a collider or another body that it touches.
    StartsInside,
    /// A collider is thinner than the surface edges of a body, so that it may pass between its particles.
    ThinCollider,
    /// A body collapses under its own weight.
    TooHeavy,
    /// More than 1% of a body's volume has stayed in inverted tets.
    Inverted,
    /// The scene has a ground and says nothing about gravity, so nothing falls onto it.
    NoGravity,
    /// A key of the scene changes nothing with the settings beside it.
    UnusedKey,
    /// A frame lasts longer than a second.
    LongFrame,
    /// A stroke has ended without meeting a tet.
    StrokeMissed,
    /// A stroke has cut where pinned particles keep both sides together.
    PinnedCut,
    /// The substep is too short for single precision.
    ShortSubstepF32,
    /// Tets were softened to keep `kappa_limit`.
    Softened,
    /// Contacts have stayed deeper than a tenth of a mean edge for longer than an overlap takes to part.
    ContactDepth,
    /// Particles would have become infinite and were put back: the frame cannot be trusted.
    Repaired,
    /// The largest speed is absurd: the solution has diverged.
    Diverged,
}

impl WarningCode {
    /// True for warnings about what a scene describes, whatever the settings of the solver.
    pub(crate) fn is_of_scene(self) -> bool {
        matches!(
            self,
            Self::EmptyRegion | Self::StartsInside | Self::ThinCollider | Self::TooHeavy
        )
    }
}

/// A problem of a result: its kind, its place in the scene, and a sentence with cause and fix.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
#[cfg_attr(feature = "save", derive(serde::Deserialize))]
pub struct Warning {
    /// Kind of the warning.
    pub code: WarningCode,
    /// One sentence: the problem and a fix.
    pub message: String,
    /// The part of the scene, as in `body 0`.
    #[serde(rename = "where")]
    pub location: String,
}

impl Warning {
    pub(crate) fn new(code: WarningCode, bodies: &[usize], message: String) -> Self {
        let numbers: Vec<String> = bodies.iter().map(ToString::to_string).collect();
        let noun = if bodies.len() == 1 { "body" } else { "bodies" };
        Self {
            code,
            message,
            location: format!("{noun} {}", numbers.join(", ")),
        }
    }

    /// The warning about a region that selects nothing, at a place like `body[0].fixed[0]`.
    pub(crate) fn of_empty_region(field: String) -> Self {
        Self {
            code: WarningCode::EmptyRegion,
            message: "the region contains nothing of the body: compare it with scale and position of the body".into(),
            location: field,
        }
    }

    /// The warning about a body that starts `depth` m inside of a collider.
    pub(crate) fn of_start_inside(body: usize, depth: f64, collider: &str) -> Self {
        let depth = rounded(depth);
        let message = format!(
            "it starts {depth} m inside {collider}, which pushes it out: move one of them by {depth} m"
        );
        Self::new(WarningCode::StartsInside, &[body], message)
    }

    /// The warning about two bodies that start `depth` m inside of each other.
    pub(crate) fn of_start_inside_each_other(bodies: [usize; 2], depth: f64) -> Self {
        let depth = rounded(depth);
        let message = format!(
            "they start up to {depth} m inside each other, and contact pushes them apart: move one of them"
        );
        Self::new(WarningCode::StartsInside, &bodies, message)
    }

    /// The warning about a collider thinner than the mean `edge` of a body's surface, both in m.
    pub(crate) fn of_thin_collider(body: usize, edge: f64, collider: &str, thickness: f64) -> Self {
        let message = format!(
            "{collider} is {} m thick, less than the mean edge of the body's surface, {} m: colliders hold particles only, so it \
             may pass between them without a force; use smaller tets or a thicker collider",
            rounded(thickness),
            rounded(edge)
        );
        Self::new(WarningCode::ThinCollider, &[body], message)
    }

    /// The warning about a body of `size` m, of a mesh scaled by `scale`, that the pressure of its weight, `weight` times its
    /// Young's modulus, crushes.
    pub(crate) fn of_weight(body: usize, size: f64, scale: f64, weight: f64) -> Self {
        let message = format!(
            "it is {} m large, and the pressure of its weight is {weight:.0} times its Young's modulus, so it collapses: raise \
             young_modulus, or set scale = {} if its lengths are in mm",
            rounded(size),
            rounded(0.001 * scale)
        );
        Self::new(WarningCode::TooHeavy, &[body], message)
    }

    /// The warning about a ground in a scene without gravity.
    pub(crate) fn of_no_gravity() -> Self {
        Self {
            code: WarningCode::NoGravity,
            message: "there is a ground and no gravity, so nothing falls onto it: set gravity = [0.0, 0.0, -9.81], or [0.0, 0.0, 0.0] if bodies are to float".into(),
            location: "world".into(),
        }
    }

    /// The warning about a key of `[solver]` that changes nothing, for a `reason`.
    pub(crate) fn of_unused_key(key: &str, reason: &str) -> Self {
        Self {
            code: WarningCode::UnusedKey,
            message: format!("it has no effect here: {reason}"),
            location: format!("solver.{key}"),
        }
    }

    /// The warning about a frame of so many seconds.
    pub(crate) fn of_long_frame(time_step: f64) -> Self {
        let message = format!(
            "a frame lasts {} s: time_step is in s, so that 16 ms are 0.016",
            rounded(time_step)
        );
        Self {
            code: WarningCode::LongFrame,
            message,
            location: "solver.time_step".into(),
        }
    }

    /// The warning about a stroke that met no tet, at a place like `stroke[0]`, with the nearest body and its box when
    /// the stroke ended.
    pub(crate) fn of_missed_stroke(missed: MissedStroke, nearest: Option<(usize, Bounds)>) -> Self {
        let MissedStroke { field, reach } = missed;
        let blade = match reach {
            Reach::Box(bounds) => format!("it passed {}", box_text(&bounds)),
            Reach::Plane { point, normal } => {
                let (point, normal) = (point_text(point), point_text(normal));
                format!("its plane passes {point} m with normal {normal}")
            }
        };
        // Within the box of a body it may have met tets: a slice that is thinner than the snap distance is not cut off.
        let is_in_box = nearest.is_some_and(|(_, bounds)| reach.distance(&bounds) <= 0.0);
        let what = if is_in_box {
            "the stroke cut nothing, because it passes beside the body or within the snap distance of an earlier cut"
        } else {
            "the stroke met no tet"
        };
        let body = match nearest {
            Some((body, bounds)) => {
                let distance = reach.distance(&bounds);
                let apart = if distance > 0.0 {
                    format!(" at a distance of {} m", rounded(distance))
                } else {
                    String::new()
                };
                format!(
                    "the nearest body is body {body}{apart}, in {}{}",
                    box_text(&bounds),
                    units_hint(&reach, &bounds)
                )
            }
            None => "there is no body".to_owned(),
        };
        Self {
            code: WarningCode::StrokeMissed,
            message: format!("{what}: {blade}; {body}"),
            location: field,
        }
    }

    /// Whether the frame cannot be trusted: the code is [`WarningCode::Diverged`] or [`WarningCode::Repaired`].
    #[must_use]
    pub fn is_failure(&self) -> bool {
        matches!(self.code, WarningCode::Diverged | WarningCode::Repaired)
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.location, self.message)
    }
}

/// Ratio of the sizes of a blade and a body from which their units are probably not the same. Units in use differ by 10
/// (cm and mm) to 1000 (m and mm); a scalpel is rarely 20 times smaller than an organ.
const OTHER_UNITS: f64 = 30.0;

/// A question about units, if a blade is much larger or smaller than a body or much farther away than the body is large.
fn units_hint(reach: &Reach, body: &Bounds) -> String {
    let size = body.size().max_element();
    let (of_blade, distance) = match reach {
        Reach::Box(bounds) => (bounds.size().max_element(), reach.distance(body)),
        Reach::Plane { .. } => (size, reach.distance(body)),
    };
    if size <= 0.0 || of_blade <= 0.0 {
        return String::new();
    }
    let times = |ratio: f64| rounded(ratio);
    let what = if of_blade > OTHER_UNITS * size {
        format!(
            "the stroke is {} times as large as the body",
            times(of_blade / size)
        )
    } else if size > OTHER_UNITS * of_blade {
        format!(
            "the body is {} times as large as the stroke",
            times(size / of_blade)
        )
    } else if distance > OTHER_UNITS * size {
        format!(
            "the distance is {} times the size of the body",
            times(distance / size)
        )
    } else {
        return String::new();
    };
    format!("; {what}: check that both are in m")
}

/// A number with three significant digits.
fn rounded(x: f64) -> f64 {
    format!("{:.2e}", x + 0.0).parse().unwrap_or(x)
}

fn point_text(x: DVec3) -> String {
    format!("({}, {}, {})", rounded(x.x), rounded(x.y), rounded(x.z))
}

pub(crate) fn box_text(bounds: &Bounds) -> String {
    format!(
        "the box from {} to {} m",
        point_text(bounds.low),
        point_text(bounds.high)
    )
}

/// The warning about the substeps of bodies, if their expected error is too large. `wanted` is the accuracy that the
/// scene states; the fix is VBD only if `takes_vbd`.
pub(crate) fn of_substeps(
    bodies: &[usize],
    choice: &Choice,
    chosen: bool,
    wanted: Option<f64>,
    takes_vbd: bool,
) -> Option<Warning> {
    let accuracy = wanted.unwrap_or(DEFAULT_ACCURACY);
    if choice.expected_error <= accuracy * (1.0 + 1e-9) {
        return None;
    }
    let needed = choice.substeps_needed;
    let error = format!(
        "the expected error is {} of the motion with {}; {needed} are needed for {}",
        percent(choice.expected_error),
        counted(choice.substeps, "substep"),
        percent(accuracy)
    );
    let capped = chosen && choice.shortfall == Some(Shortfall::Cap);
    let (code, fix) = if choice.nearly_incompressible {
        let fix = if takes_vbd {
            "Poisson's ratio is near 0.5: lower it, or set method = \"vbd\" and two_level = true"
        } else {
            "Poisson's ratio is near 0.5: lower it"
        };
        (WarningCode::NearlyIncompressible, fix)
    } else if choice.shortfall == Some(Shortfall::Budget) {
        let fix = "raise budget_ms, use fewer tets or a softer material";
        (WarningCode::BudgetTooSmall, fix)
    } else if let Some(Shortfall::Growth | Shortfall::Precision) = choice.shortfall {
        let message = format!("{error}; {}", fix_after_cuts(choice));
        return Some(Warning::new(WarningCode::SubstepsCapped, bodies, message));
    } else if capped {
        let fix = if takes_vbd {
            "raise max_substeps, or set method = \"vbd\" and two_level = true"
        } else {
            "raise max_substeps, or use larger tets or a softer material"
        };
        (WarningCode::SubstepsCapped, fix)
    } else {
        (WarningCode::Inaccurate, "set substeps = \"auto\"")
    };
    Some(Warning::new(code, bodies, format!("{error}; {fix}")))
}

/// What lets tets that cuts have made be solved with the accuracy wanted.
fn fix_after_cuts(choice: &Choice) -> String {
    let needed = choice.substeps_needed;
    let fix = match choice.shortfall {
        Some(Shortfall::Growth) => {
            format!("cuts at most double the substeps of the start: set substeps = {needed}, or ")
        }
        Some(Shortfall::Precision) => {
            "single precision gains nothing from more substeps: set precision = \"f64\", or "
                .to_owned()
        }
        Some(Shortfall::Cap) => format!("set max_substeps = {needed}, or "),
        Some(Shortfall::Budget) => "raise budget_ms, or ".to_owned(),
        Some(Shortfall::Sliver) | None => String::new(),
    };
    format!("{fix}use more snap in strokes")
}

/// The warning that tets which cuts have made, `fraction` of the volume, miss the accuracy wanted.
pub(crate) fn of_outside(
    bodies: &[usize],
    fraction: f64,
    substeps: u32,
    choice: Option<&Choice>,
) -> Warning {
    let fix = choice.map_or_else(
        || "set substeps = \"auto\", or use more snap in strokes".to_owned(),
        fix_after_cuts,
    );
    let message = format!(
        "after cuts {} of the volume is in tets too small for the accuracy wanted with {}; {fix}",
        percent(fraction),
        counted(substeps, "substep"),
    );
    Warning::new(WarningCode::OutsideAccuracy, bodies, message)
}

/// The notice that bodies are solved by VBD in place of many substeps.
pub(crate) fn of_vbd(bodies: &[usize], choice: &Choice, spec: &SolverSpec) -> Warning {
    let step = 1e3 * spec.time_step;
    let message = format!(
        "{} substeps would be needed, so it is solved by two-level VBD with one step a frame: accurate to {:.1}% at rest and in \
         slow motion, but vibrations of periods below {:.0} ms lose more than a tenth of their amplitude each \
         period; set method = \"gauss-seidel\" and max_substeps = {} to resolve them",
        choice.substeps_needed,
        100.0 * choice.expected_error,
        // exp(-π z³ / 2) with z = 2π Δt / T is 0.9 at 15.5 steps a period.
        15.5 * step,
        choice.substeps_needed,
    );
    Warning::new(WarningCode::VibrationsDamped, bodies, message)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_name_their_bodies() {
        let of = |bodies: &[usize]| Warning::new(WarningCode::Softened, bodies, "soft".to_owned());
        assert_eq!(of(&[0]).to_string(), "body 0: soft");
        assert_eq!(of(&[1, 2]).to_string(), "bodies 1, 2: soft");
        let json = serde_json::to_string(&of(&[3])).unwrap();
        assert_eq!(
            json,
            r#"{"code":"softened","message":"soft","where":"body 3"}"#
        );
    }
}
