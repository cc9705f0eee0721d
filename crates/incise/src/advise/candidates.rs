//! [`candidates`]: solver settings to measure for a scene, with their names and their TOML tables.
//!
//! They are multiples of the substeps that bring kappa to 0.5, so they fit scenes of any size, stiffness and time step.
//! Relaxation, Jacobi and Chebyshev are left out: in all measurements (`cargo xtask accuracy`) Gauss-Seidel with
//! relaxation 1 was as fast and more accurate.

use crate::method::settings;
use crate::scene::{Method, Precision, Scene, SolverSpec, Substeps, TetSolve};
use crate::{Error, Simulation};

use super::reference::with;

/// Accuracies for which `auto` chooses substeps.
const ACCURACIES: [f64; 4] = [0.2, 0.1, 0.05, 0.02];

/// Returns the largest number of substeps that `auto` would take for a body of a scene without `max_substeps`.
///
/// # Errors
/// Returns the errors of [`Simulation::new`].
pub fn accurate_substeps(scene: &Scene) -> Result<u32, Error> {
    let solver = SolverSpec {
        substeps: Substeps::Auto,
        max_substeps: 100_000,
        time_step: scene.solver.time_step,
        ..SolverSpec::of(Method::GaussSeidel)
    };
    let simulation = Simulation::with_threads(&with(scene, &solver), 1)?;
    let bodies = simulation.report().bodies.iter();
    Ok(bodies.map(|body| body.substeps).max().unwrap_or(1))
}

/// Returns settings from coarse to fine around `substeps`, a result of [`accurate_substeps`]. The scene's keys for
/// clusters, colors, sleep, softening and the backend are kept.
#[must_use]
pub fn candidates(scene: &Scene, substeps: u32) -> Vec<SolverSpec> {
    let of = |method| SolverSpec {
        preset: None,
        accuracy: None,
        budget_ms: None,
        kappa_limit: match method {
            Method::Vbd => f64::INFINITY,
            _ => scene.solver.kappa_limit,
        },
        tet_solve: TetSolve::Split,
        relaxation: SolverSpec::of(method).relaxation,
        two_level: false,
        precision: Precision::F32,
        method,
        ..scene.solver.clone()
    };
    let mut all = Vec::new();
    let mut add = |spec: SolverSpec| {
        if !all.contains(&spec) {
            all.push(spec);
        }
    };
    let mut add_passes = |precision, eighths: &[u32], iterations| {
        for part in eighths {
            add(SolverSpec {
                substeps: Substeps::Fixed((substeps.saturating_mul(*part)).div_ceil(8)),
                iterations,
                precision,
                ..of(Method::GaussSeidel)
            });
        }
    };
    add_passes(Precision::F32, &[1, 2, 4, 8, 16, 32, 64], 1);
    add_passes(Precision::F64, &[16, 32, 64, 128, 256, 512], 1);
    add_passes(Precision::F32, &[8, 16, 32], 4);
    for accuracy in ACCURACIES {
        add(SolverSpec {
            substeps: Substeps::Auto,
            iterations: 1,
            kappa_limit: f64::INFINITY,
            precision: Precision::Auto,
            accuracy: Some(accuracy),
            ..of(Method::Auto)
        });
    }
    // Where it is refused, as with contact, it is no candidate.
    if settings(&with(scene, &of(Method::Vbd))).is_ok() {
        for (substeps, iterations) in [(1, 20), (1, 100), (4, 20)] {
            add(SolverSpec {
                substeps: Substeps::Fixed(substeps),
                iterations,
                ..of(Method::Vbd)
            });
        }
        for (substeps, iterations) in [
            (1, 1),
            (2, 1),
            (1, 4),
            (2, 4),
            (4, 4),
            (8, 4),
            (16, 4),
            (32, 4),
        ] {
            add(SolverSpec {
                substeps: Substeps::Fixed(substeps),
                iterations,
                two_level: true,
                precision: Precision::F64,
                ..of(Method::Vbd)
            });
        }
    }
    all
}

/// Returns a short name: method, substeps x iterations, precision, and settings other than the defaults of the method.
///
/// ```
/// use incise::{Scene, advise::name};
///
/// let scene = Scene::from_toml("[solver]\nmethod = \"gauss-seidel\"\nsubsteps = 20\nprecision = \"f32\"\nrelaxation = 0.8")?;
/// assert_eq!(name(&scene.solver), "gauss-seidel 20 x 1 f32, relaxation 0.8");
/// # Ok::<(), incise::Error>(())
/// ```
#[must_use]
pub fn name(spec: &SolverSpec) -> String {
    let defaults = SolverSpec::of(spec.method);
    if let (Method::Auto, Substeps::Auto, Some(accuracy)) =
        (spec.method, spec.substeps, spec.accuracy)
    {
        return format!("auto, accuracy {accuracy}");
    }
    let method = match spec.method {
        Method::Auto => "auto",
        Method::GaussSeidel => "gauss-seidel",
        Method::Jacobi => "jacobi",
        Method::Chebyshev => "chebyshev",
        Method::Vbd if spec.two_level => "vbd with coarse correction",
        Method::Vbd => "vbd",
    };
    let substeps = match spec.substeps {
        Substeps::Fixed(n) => n.to_string(),
        Substeps::Auto => "auto".to_owned(),
    };
    let width = spec.precision.name();
    let mut name = format!("{method} {substeps} x {} {width}", spec.iterations);
    if spec.relaxation != defaults.relaxation {
        name += &format!(", relaxation {}", spec.relaxation);
    }
    if spec.method == Method::Chebyshev && spec.spectral_radius != defaults.spectral_radius {
        name += &format!(", spectral radius {}", spec.spectral_radius);
    }
    match spec.tet_solve {
        TetSolve::Split => {}
        TetSolve::Block => name += ", block",
        TetSolve::Sequential => name += ", sequential",
    }
    if spec.clustering != defaults.clustering {
        name += &format!(", {}", spec.clustering);
    }
    if spec.kappa_limit != defaults.kappa_limit {
        name += &format!(", kappa limit {}", spec.kappa_limit);
    }
    if spec.backend != defaults.backend {
        name += match spec.backend {
            crate::scene::Backend::Gpu => ", gpu",
            _ => ", backend auto",
        };
    }
    name
}

/// Returns the `[solver]` table of a scene with these settings, without the defaults of the method.
///
/// # Errors
/// [`Error::Parse`] if the settings cannot be written. Settings read from a scene can always be written.
pub fn solver_table(spec: &SolverSpec) -> Result<String, Error> {
    let failed = |error: toml::ser::Error| Error::Parse {
        line: None,
        message: error.to_string(),
    };
    let defaults = toml::Table::try_from(SolverSpec::of(spec.method)).map_err(failed)?;
    let mut keys = toml::Table::try_from(spec).map_err(failed)?;
    let always = ["method", "substeps", "iterations", "precision"];
    keys.retain(|key, value| always.contains(&key) || defaults.get(key) != Some(value));
    Ok(format!("[solver]\n{keys}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_of_a_candidate_reads_back_as_it() {
        let mut scene = Scene::built_in();
        scene.contact = None;
        scene.body[0].damping = 0.0;
        for limit in [1.0, f64::INFINITY] {
            scene.solver.kappa_limit = limit;
            let all = candidates(&scene, 30);
            assert!(all.iter().any(|spec| spec.two_level));
            for spec in all {
                let table = solver_table(&spec).unwrap();
                assert_eq!(Scene::from_toml(&table).unwrap().solver, spec, "{table}");
            }
        }
    }

    /// No setting is measured twice, each has a name of its own, and a single round of two-level VBD is among them; with
    /// contact, which VBD does not have, there is none of it.
    #[test]
    fn candidates_differ() {
        let mut scene = Scene::built_in();
        let with_contact = candidates(&scene, 30);
        assert!(with_contact.iter().all(|spec| spec.method != Method::Vbd));
        scene.contact = None;
        for substeps in [1, 2, 7, 30] {
            let all = candidates(&scene, substeps);
            let mut names: Vec<String> = all.iter().map(name).collect();
            names.sort();
            let count = names.len();
            names.dedup();
            assert_eq!(names.len(), count);
            assert!(
                all.iter()
                    .any(|spec| spec.two_level && spec.iterations == 1)
            );
        }
    }

    /// The number is the smallest with the default accuracy.
    #[test]
    fn substeps_have_the_default_accuracy() {
        let mut scene = Scene::built_in();
        scene.contact = None;
        let substeps = accurate_substeps(&scene).unwrap();
        for (substeps, accurate) in [(substeps, true), (substeps - 1, false)] {
            scene.solver.substeps = substeps.into();
            let kappa = Simulation::with_threads(&scene, 1).unwrap().kappa();
            let form = incise_xpbd::TetSolve::Split;
            let error = crate::accuracy::expected_error(kappa, scene.body[0].poisson_ratio, form);
            assert_eq!(error <= 0.1, accurate, "{substeps}: {kappa}, {error}");
        }
    }
}
