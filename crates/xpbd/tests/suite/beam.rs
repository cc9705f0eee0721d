//! A beam held at one end sags under its own weight: beam theory, finite elements on the same mesh, any schedule, both
//! precisions.
//!
//! The load is small (tip below a fiftieth of the length), so that linear theory holds. The beam settles by kinetic
//! damping: whenever its kinetic energy has passed a peak, all velocities are set to zero. The state where it ends does
//! not depend on that.

use glam::{DVec3, dvec3};
use incise_graph::Schedule;
use incise_mesh::{TetMesh, kuhn_box};
use incise_xpbd::{Material, Real, StepSettings};

use crate::body::{KineticDamping, body, plain, schedule, substep, within};
use crate::finite_elements;

/// Gravity in m/s²: the tip sinks by a hundredth of the length.
const LIGHT: f64 = 0.1;
const STUFF: Material = Material {
    young_modulus: 1e6,
    poisson_ratio: 0.3,
    density: 1000.0,
    damping: 0.0,
};
/// Cells along the beam for each cell across: the beam is four times as long as thick.
const SLENDERNESS: usize = 4;

/// Cycles of kinetic damping that must leave the tip where it is.
const QUIET_CYCLES: usize = 6;

fn beam(across: usize) -> TetMesh {
    let cells = [SLENDERNESS * across, across, across];
    kuhn_box(cells, dvec3(SLENDERNESS as f64, 1.0, 1.0))
}

/// The mean height of the far end above its rest.
fn tip(mesh: &TetMesh, heights: impl Fn(usize) -> f64) -> f64 {
    let far = (0..mesh.positions.len()).filter(|&p| mesh.positions[p].x == SLENDERNESS as f64);
    let (sum, count) = far.fold((0.0, 0.0), |(sum, count), p| {
        (sum + heights(p) - mesh.positions[p].z, count + 1.0)
    });
    sum / count
}

/// The tip of the settled beam.
fn settled<R: Real>(mesh: &TetMesh, schedule: &Schedule, kappa: f64) -> f64 {
    let mut solver = body::<R>(mesh, STUFF);
    for p in 0..mesh.positions.len() {
        solver.set_fixed(p, mesh.positions[p].x == 0.0);
    }
    let settings = StepSettings {
        gravity: Some(DVec3::NEG_Z * LIGHT),
        ..substep(&solver, kappa)
    };
    let (mut damping, mut tips) = (KineticDamping::default(), vec![0.0]);
    let mut first = usize::MAX;
    for n in 0..20_000 {
        solver.step(schedule, &settings).unwrap();
        if !damping.apply(&mut solver) {
            continue;
        }
        tips.push(tip(mesh, |p| solver.position(p).z));
        // Short cycles of high modes and rounding noise never end; the tip does not follow them.
        let steady = |pair: &[f64]| (pair[1] - pair[0]).abs() < 1e-4 * pair[1].abs();
        first = first.min(n);
        if n > 6 * first
            && tips.len() > QUIET_CYCLES
            && tips[tips.len() - QUIET_CYCLES..].windows(2).all(steady)
        {
            return tips[tips.len() - 1];
        }
    }
    panic!("the beam does not settle: {:?}", tips.last());
}

/// The sag that Timoshenko's theory predicts: bending and shear.
fn timoshenko(gravity: f64) -> f64 {
    let (length, nu) = (SLENDERNESS as f64, STUFF.poisson_ratio);
    let weight = STUFF.density * gravity;
    let shear_modulus = STUFF.young_modulus / (2.0 * (1.0 + nu));
    let form = 10.0 * (1.0 + nu) / (12.0 + 11.0 * nu);
    1.5 * weight * length.powi(4) / STUFF.young_modulus
        + weight * length.powi(2) / (2.0 * form * shear_modulus)
}

fn finite_element_tip(mesh: &TetMesh) -> f64 {
    let load: Vec<DVec3> = {
        let solver = body::<f64>(mesh, STUFF);
        (0..mesh.positions.len())
            .map(|p| DVec3::NEG_Z * (LIGHT * solver.mass(p)))
            .collect()
    };
    let u = finite_elements::equilibrium(mesh, &STUFF, &load, |p| mesh.positions[p].x == 0.0);
    tip(mesh, |p| mesh.positions[p].z + u[p].z)
}

/// Linear tets are too stiff in bending: with 8 cells across the elements themselves lack 8.5 % of the sag of theory.
/// The solver adds its own error, of the order of kappa and in the other direction: 1.2 % of the sag at kappa 0.5. So
/// that the sum is 7.4 % is no merit; what is asked of the solver is its distance from the elements.
#[test]
fn sag_of_a_fine_beam_is_that_of_theory_and_of_finite_elements() {
    let mesh = beam(8);
    let sag = -settled::<f64>(&mesh, &plain(&mesh), 0.5);
    let elements = -finite_element_tip(&mesh);
    let theory = timoshenko(LIGHT);
    within("tip in lengths", theory / SLENDERNESS as f64, 1.0 / 50.0);
    within("solver against theory", (sag / theory - 1.0).abs(), 0.2);
    within(
        "elements against theory",
        (elements / theory - 1.0).abs(),
        0.2,
    );
    within(
        "solver against elements",
        (sag / elements - 1.0).abs(),
        0.02,
    );
}

/// Measured: 2.4 %, 1.1 %, 0.53 %, 0.27 % at kappa 1/2, 1/4, 1/8, 1/16. Half the kappa must at least give 0.6 of the
/// gap.
#[test]
fn sag_converges_to_that_of_finite_elements_with_kappa() {
    let mesh = beam(4);
    let (schedule, elements) = (plain(&mesh), -finite_element_tip(&mesh));
    let gap = |kappa| (-settled::<f64>(&mesh, &schedule, kappa) / elements - 1.0).abs();
    let gaps = [0.5, 0.25, 0.125, 0.0625].map(gap);
    within("gap at kappa 0.5", gaps[0], 0.03);
    for pair in gaps.windows(2) {
        within("gap at half the kappa", pair[1] / pair[0], 0.6);
    }
}

/// Another order of solving changes the state at rest by a small part of kappa: 3.4e-4 at 1/8; at 1/2 it is 2e-3.
#[test]
fn settled_sag_does_not_depend_on_the_schedule() {
    let mesh = beam(4);
    let reference = settled::<f64>(&mesh, &plain(&mesh), 0.125);
    for clustering in ["serial:5", "serial:10"] {
        let schedule = schedule(&mesh, "scgc", clustering);
        let sag = settled::<f64>(&mesh, &schedule, 0.125);
        within(clustering, (sag / reference - 1.0).abs(), 1e-3);
    }
}

/// Gravity moves a particle by `g Δt²` in a substep, at kappa 0.5 three units in the last place of the far end's
/// coordinate in single precision; the elastic corrections are rounded as coarsely. Measured 0.16 %, and 1.1 % at
/// kappa 1/8: smaller substeps make single precision worse.
#[test]
fn single_precision_sags_like_double() {
    let mesh = beam(4);
    let schedule = plain(&mesh);
    for (kappa, tolerance) in [(0.5, 0.005), (0.125, 0.03)] {
        let single = settled::<f32>(&mesh, &schedule, kappa);
        let double = settled::<f64>(&mesh, &schedule, kappa);
        within(
            "single against double",
            (single / double - 1.0).abs(),
            tolerance,
        );
    }
}
