//! Reported quantities over all islands of bodies.
//!
//! Sums over the islands, or the largest or smallest value. A single island's values are unchanged. Cost: a pass over
//! the particles or tets for each quantity.

use glam::DVec3;
use incise_xpbd::Volume;

use crate::Error;
use crate::island::Island;
use crate::report::{
    BodyReport, ChosenMethod, ContactReport, EnergyReport, ResidualReport, SoftenedReport,
};
use crate::scene::{Method, Quantity};
use crate::solver_backend::{LastSubstep, Measures};

/// The contacts of all islands; `None` without contact.
pub(crate) fn contact(islands: &[Island]) -> Option<ContactReport> {
    let mut depths = Vec::new();
    let counts = islands.iter().filter_map(|island| {
        let contacts = island.constraints.contacts.as_ref()?;
        Some(contacts.count(&island.solver, &mut depths))
    });
    let counts: Vec<_> = counts.collect();
    (!counts.is_empty()).then(|| ContactReport::new(counts.into_iter(), depths))
}

/// Whether a quantity is one of those.
pub(crate) fn is_of_state(quantity: &Quantity) -> bool {
    matches!(
        quantity,
        Quantity::Energy | Quantity::Volume | Quantity::Speed
    )
}

/// Measures the state of each island where it is. Returns an empty list if no quantity of the state is requested.
pub(crate) fn states(
    islands: &mut [Island],
    gravity: Option<DVec3>,
    quantities: &[Quantity],
) -> Result<Vec<Measures>, Error> {
    if !quantities.iter().any(is_of_state) {
        return Ok(Vec::new());
    }
    let state = |island: &mut Island| {
        let measures = island.solver.backend_mut().state(gravity, quantities)?;
        island.judge_energy(&measures);
        Ok(measures)
    };
    islands.iter_mut().map(state).collect()
}

/// Residuals of the last substep of each island awake, as one vector's length, and their potentials' sum; `None` if all
/// sleep or one has not kept its own. What is too large for a double is the largest one.
pub(crate) fn residual(islands: &[Island], gravity: Option<DVec3>) -> Option<ResidualReport> {
    let awake = || islands.iter().filter(|island| !island.asleep());
    // The weight's norm in N, and the same times the square of each island's substep.
    let (mut weight, mut moved) = (0.0_f64, 0.0_f64);
    let (mut primal, mut dual, mut force) = (0.0_f64, 0.0_f64, 0.0_f64);
    let (mut potential, mut constraints, mut descends) = (0.0, 0, false);
    for island in awake() {
        let time = island.settings.substep_time();
        if let Some(gravity) = gravity {
            let load = island.solver.host().load(gravity);
            weight = weight.hypot(load);
            moved = moved.hypot(load * time * time);
        }
        match island.solver.backend().last_substep(time)? {
            LastSubstep::Constraints(residuals) => {
                primal = primal.hypot(residuals.primal);
                dual = dual.hypot(residuals.dual);
                force = force.hypot(residuals.force);
                potential += residuals.potential;
                constraints += residuals.constraints;
            }
            LastSubstep::Vbd {
                force: left,
                potential: of_island,
            } => {
                force = force.hypot(left);
                potential += of_island;
                descends = true;
            }
        }
    }
    awake().next()?;
    let of_constraints = |value: f64| (!descends).then_some(value.min(f64::MAX));
    let relative = |value: f64, unit: f64| (unit > 0.0).then(|| (value / unit).min(f64::MAX));
    Some(ResidualReport {
        primal: of_constraints(primal),
        primal_relative: relative(primal, moved).and_then(of_constraints),
        dual: of_constraints(dual),
        dual_rms: of_constraints(dual / (constraints.max(1) as f64).sqrt()),
        force: force.min(f64::MAX),
        force_relative: relative(force, weight),
        potential: potential.min(f64::MAX),
    })
}

/// The residual of each tet of an island in the last substep: none asleep; `None` if they were not kept.
pub(crate) fn residuals_of_tets(island: &Island) -> Option<Vec<f64>> {
    if island.asleep() {
        return Some(vec![0.0; island.cuttable.mesh().tets.len()]);
    }
    if island.spec.method == Method::Vbd {
        return None;
    }
    let time = island.settings.substep_time();
    island.solver.host().residuals_of_tets(time)
}

pub(crate) fn energy(states: &[Measures]) -> EnergyReport {
    let mut sum = EnergyReport {
        kinetic: 0.0,
        elastic: 0.0,
        gravity: 0.0,
    };
    for energy in states.iter().filter_map(|state| state.energy) {
        sum.kinetic += energy.kinetic;
        sum.elastic += energy.elastic;
        sum.gravity += energy.gravity;
    }
    sum
}

pub(crate) fn volume(states: &[Measures]) -> Volume {
    let mut sum = Volume {
        total: 0.0,
        rest: 0.0,
        min_ratio: 1.0,
        inverted: 0,
    };
    for volume in states.iter().filter_map(|state| state.volume) {
        sum.total += volume.total;
        sum.rest += volume.rest;
        sum.min_ratio = sum.min_ratio.min(volume.min_ratio);
        sum.inverted += volume.inverted;
    }
    sum
}

/// The largest speed of a particle in m/s.
pub(crate) fn max_speed(states: &[Measures]) -> f64 {
    let speeds = states.iter().filter_map(|state| state.max_speed);
    speeds.fold(0.0, f64::max)
}

/// The largest kappa of a tet, each at the substep of its island.
pub(crate) fn kappa(islands: &[Island]) -> f64 {
    islands.iter().map(Island::kappa).fold(0.0, f64::max)
}

pub(crate) fn softened(islands: &[Island]) -> SoftenedReport {
    if let [island] = islands {
        return softened_of(island);
    }
    let mut sum = SoftenedReport {
        tets: 0,
        volume_fraction: 0.0,
        strongest: 1.0,
    };
    let mut volume = 0.0;
    for island in islands {
        let softened = softened_of(island);
        sum.tets += softened.tets;
        sum.volume_fraction += softened.volume_fraction * island.initial_volume;
        sum.strongest = sum.strongest.max(softened.strongest);
        volume += island.initial_volume;
    }
    sum.volume_fraction /= volume;
    sum
}

fn softened_of(island: &Island) -> SoftenedReport {
    island.solver.host().softened().into()
}

/// Substeps and what cuts did to kappa by island; `with_kappa` also those that take a pass over the tets.
pub(crate) fn by_body(islands: &mut [Island], with_kappa: bool) -> Vec<BodyReport> {
    let report = |island: &mut Island| {
        let cut = island.judged.cut_kappa.take();
        BodyReport {
            bodies: island.bodies.clone(),
            substeps: island.settings.substeps,
            method: island.judged.choice.map(|_| ChosenMethod::of(&island.spec)),
            iterations: island.judged.choice.map(|_| island.settings.iterations),
            asleep: island.sleep.map(|sleep| sleep.asleep()),
            choice: island.judged.choice,
            kappa: with_kappa.then(|| island.kappa()),
            kappa_before_cut: cut.and_then(|cut| cut.before),
            kappa_of_new_tets: cut.map(|cut| cut.new_tets),
            softened: with_kappa.then(|| softened_of(island)),
        }
    };
    islands.iter_mut().map(report).collect()
}
