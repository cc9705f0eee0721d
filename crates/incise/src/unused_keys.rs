//! Warnings about keys of `[solver]` that change nothing in a scene, and about a frame that is probably in other units.
//!
//! A key counts as given where it has another value than the default of the preset or method. Cost: O(bodies).

use crate::island::Island;
use crate::scene::{Method, Preset, SolverSpec};
use crate::warning::Warning;

/// Frames that last longer than this many seconds are probably given in milliseconds.
const LONG_FRAME: f64 = 1.0;

/// The warnings about the settings of a scene that is solved in some islands.
pub(crate) fn warnings(spec: &SolverSpec, islands: &[Island]) -> Vec<Warning> {
    let mut warnings = Vec::new();
    if spec.time_step > LONG_FRAME {
        warnings.push(Warning::of_long_frame(spec.time_step));
    }
    if islands.is_empty() {
        return warnings;
    }
    let defaults = match spec.preset {
        Some(Preset::Paper) => SolverSpec::paper(spec.method),
        None => SolverSpec::of(spec.method),
    };
    let takes = |method: Method| islands.iter().any(|island| island.spec.method == method);
    let has_constraints = islands
        .iter()
        .any(|island| island.spec.method != Method::Vbd);
    let is_open = islands
        .iter()
        .any(|island| island.judged.leaves_substeps_open);
    let mut check = |key: &str, is_given: bool, has_effect: bool, reason: &str| {
        if is_given && !has_effect {
            warnings.push(Warning::of_unused_key(key, reason));
        }
    };
    let is_given = spec.integrator != defaults.integrator;
    let of_vbd = "only method = \"vbd\" has it";
    check("integrator", is_given, takes(Method::Vbd), of_vbd);
    let is_chebyshev = takes(Method::Chebyshev);
    let of_chebyshev = "only method = \"chebyshev\" has it";
    let is_given = spec.spectral_radius != defaults.spectral_radius;
    check("spectral_radius", is_given, is_chebyshev, of_chebyshev);
    let is_given = spec.chebyshev_start != defaults.chebyshev_start;
    check("chebyshev_start", is_given, is_chebyshev, of_chebyshev);
    let is_given = spec.relaxation != defaults.relaxation;
    let of_others = "all methods but VBD have it";
    check("relaxation", is_given, has_constraints, of_others);
    let is_given = spec.max_substeps != defaults.max_substeps;
    let of_auto = "only substeps = \"auto\" follows it";
    check("max_substeps", is_given, is_open, of_auto);
    check("budget_ms", spec.budget_ms.is_some(), is_open, of_auto);
    warnings
}
