//! Converts the settings of a scene to those of a solver, and resolves `method = "auto"`.
//!
//! Gauss-Seidel, Jacobi and Chebyshev solve the constraints of XPBD. VBD lowers the potential of the implicit step,
//! which has terms for damping, distances, soft attachments and volume constraints, so it supports every scene.
//!
//! `auto` takes Gauss-Seidel where `max_substeps` are enough for the accuracy wanted, and two-level VBD with one step a
//! frame for stiffer bodies.

use incise_xpbd::{StepSettings, VbdSettings};

use crate::accuracy::DEFAULT_ACCURACY;
use crate::scene::{
    Integrator, Method, Quantity, ReportSpec, SolverSpec, StrokeSpec, Substeps, TetSolve,
};
use crate::substeps::{Choice, Shortfall};
use crate::validate::{coordinates, value, within};
use crate::{Error, Scene, collider, solid_blade};

/// Rounds of two-level VBD in a frame, at most: what has not converged then is reported.
const MOST_ROUNDS: u32 = 20;

/// Converts the scene's enum to the solver's.
pub(crate) fn tet_solve(form: TetSolve) -> incise_xpbd::TetSolve {
    match form {
        TetSolve::Split => incise_xpbd::TetSolve::Split,
        TetSolve::Block => incise_xpbd::TetSolve::Block,
        TetSolve::Sequential => incise_xpbd::TetSolve::Sequential,
    }
}

/// Converts the scene's integrator to the solver's.
pub(crate) fn integrator(integrator: Integrator) -> incise_xpbd::Integrator {
    match integrator {
        Integrator::Bdf2 => incise_xpbd::Integrator::Bdf2,
        Integrator::ImplicitEuler => incise_xpbd::Integrator::ImplicitEuler,
    }
}

/// The settings of a scene, checked; each island of bodies puts in its own substeps.
pub(crate) fn settings(scene: &Scene) -> Result<StepSettings, Error> {
    let solver = &scene.solver;
    let gravity = scene.world.gravity;
    let settings = StepSettings {
        time_step: solver.time_step,
        substeps: match solver.substeps {
            Substeps::Fixed(substeps) => substeps,
            Substeps::Auto => 1,
        },
        iterations: solver.iterations,
        method: match solver.method {
            Method::Chebyshev => incise_xpbd::Method::Chebyshev {
                spectral_radius: solver.spectral_radius,
                chebyshev_start: solver.chebyshev_start,
            },
            Method::Jacobi => incise_xpbd::Method::Jacobi,
            // VBD does not ask.
            Method::Auto | Method::GaussSeidel | Method::Vbd => incise_xpbd::Method::GaussSeidel,
        },
        tet_solve: tet_solve(solver.tet_solve),
        relaxation: solver.relaxation,
        gravity: gravity
            .map(|g| coordinates("world.gravity", g))
            .transpose()?,
        colliders: collider::colliders(scene)?,
    };
    let checked = match solver.method {
        Method::Jacobi | Method::Chebyshev | Method::Vbd if scene.contact.is_some() => {
            let range = "auto or gauss-seidel in a scene with contact";
            Err(value("solver.method", method_name(solver.method), range))
        }
        Method::Vbd => check_vbd(scene).map(|()| vbd(&settings).check()),
        _ if solver.two_level => Err(refused("solver.two_level", true, "false unless")),
        _ => Ok(settings.check()),
    };
    checked?.map_err(Error::xpbd("solver"))?;
    check_forces(&scene.report, solver.method, false)?;
    if let Some(stroke) = scene.stroke.iter().position(StrokeSpec::is_solid) {
        solid_blade::check(&format!("stroke[{stroke}]"), solver.method, false)?;
    }
    within("solver.time_step", settings.time_step, 1e-9, 1e3)?;
    Ok(settings)
}

/// The settings of one island, in which `auto` is replaced by the method for it. `choice` is that of its substeps, which
/// becomes that of VBD where VBD is taken; `is_open` is [`leaves_open`].
///
/// VBD solves a frame in one step, so its motion is accurate only for bodies so stiff that they follow their loads within
/// a frame. Where the most substeps still leave less than a tenth, motion takes many frames: they are taken, and a
/// warning says what is missing.
pub(crate) fn resolve(
    spec: &SolverSpec,
    choice: Option<Choice>,
    is_open: bool,
) -> (SolverSpec, Option<Choice>) {
    let mut own = spec.clone();
    if spec.method != Method::Auto {
        return (own, choice);
    }
    own.method = Method::GaussSeidel;
    match choice {
        Some(capped)
            if is_open
                && capped.shortfall == Some(Shortfall::Cap)
                && capped.expected_error > DEFAULT_ACCURACY =>
        {
            let (own, choice) = with_vbd(spec, capped);
            (own, Some(choice))
        }
        _ => (own, choice),
    }
}

/// The name of a method in a scene.
fn method_name(method: Method) -> &'static str {
    match method {
        Method::Auto => "auto",
        Method::GaussSeidel => "gauss-seidel",
        Method::Jacobi => "jacobi",
        Method::Chebyshev => "chebyshev",
        Method::Vbd => "vbd",
    }
}

/// Whether VBD may be taken for bodies of a scene that ask for these substeps: settings leave the method open and name
/// nothing that only Gauss-Seidel has, no device solves, and there are neither colliders nor contacts.
pub(crate) fn leaves_open(
    scene: &Scene,
    asked: &[Substeps],
    settings: &StepSettings,
    on_device: bool,
) -> bool {
    let spec = &scene.solver;
    let defaults = SolverSpec::default();
    spec.method == Method::Auto
        && asked.iter().all(|s| *s == Substeps::Auto)
        && settings.colliders.is_empty()
        && !on_device
        && scene.contact.is_none()
        && !scene.stroke.iter().any(StrokeSpec::is_solid)
        && (spec.iterations, spec.relaxation, spec.tet_solve)
            == (defaults.iterations, defaults.relaxation, defaults.tet_solve)
        && !spec.kappa_limit.is_finite()
}

/// The settings with two-level VBD of one step a frame, and what becomes of the choice of substeps. Rounds end when their
/// estimated error is the accuracy wanted.
pub(crate) fn with_vbd(spec: &SolverSpec, choice: Choice) -> (SolverSpec, Choice) {
    let accuracy = spec.accuracy.unwrap_or(DEFAULT_ACCURACY);
    let own = SolverSpec {
        method: Method::Vbd,
        two_level: true,
        substeps: Substeps::Fixed(1),
        iterations: MOST_ROUNDS,
        accuracy: Some(accuracy),
        ..spec.clone()
    };
    (own, choice.solved_by_vbd(accuracy))
}

/// The settings of VBD for a scene's settings.
pub(crate) fn vbd(settings: &StepSettings) -> VbdSettings {
    VbdSettings {
        // What lies or hangs starts where it is, so that few sweeps do.
        guess: incise_xpbd::Guess::Adaptive,
        step: settings.clone(),
        ..VbdSettings::new(settings.time_step, settings.iterations)
    }
}

/// Refuses keys that VBD does not have.
pub(crate) fn check_vbd(scene: &Scene) -> Result<(), Error> {
    if scene.solver.tet_solve != TetSolve::Split {
        return Err(refused("solver.tet_solve", "not split", "split where"));
    }
    Ok(())
}

/// An error about a value that VBD does not know.
pub(crate) fn refused(field: &str, given: impl ToString, range: &str) -> Error {
    value(field, given, format!("{range} solver.method is \"vbd\""))
}

/// Refuses forces where the method or the device has none.
pub(crate) fn check_forces(report: &ReportSpec, method: Method, is_gpu: bool) -> Result<(), Error> {
    if !report.quantities.contains(&Quantity::Force) {
        return Ok(());
    }
    let range = if is_gpu {
        "without `force` on a GPU"
    } else if method == Method::Chebyshev {
        "without `force` for method chebyshev, whose extrapolation moves particles by no force"
    } else {
        return Ok(());
    };
    Err(value("report.quantities", "with `force`", range))
}
