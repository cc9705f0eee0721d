//! What all groups of bodies together are worth: the quantities of a report.
//!
//! Sums, and the largest or smallest value where that is what is asked. For a single group they are its own numbers to
//! the bit. Cost: a pass over the particles or tets each.

use glam::DVec3;
use incise_xpbd::Volume;

use crate::Error;
use crate::backend::{LastSubstep, Measures, each};
use crate::group::Group;
use crate::report::{BodyReport, ChosenMethod, EnergyReport, ResidualReport, SoftenedReport};
use crate::scene::{Method, Quantity};

/// Whether a quantity is one of those.
pub(crate) fn is_of_state(quantity: &Quantity) -> bool {
    matches!(
        quantity,
        Quantity::Energy | Quantity::Volume | Quantity::Speed
    )
}

/// Measures the state of each group where it is. Returns an empty list if no quantity of the state is requested.
pub(crate) fn states(
    groups: &mut [Group],
    gravity: Option<DVec3>,
    quantities: &[Quantity],
) -> Result<Vec<Measures>, Error> {
    if !quantities.iter().any(is_of_state) {
        return Ok(Vec::new());
    }
    let state = |group: &mut Group| group.solver.state(gravity, quantities);
    groups.iter_mut().map(state).collect()
}

/// Residuals of the last substep of each group awake, as one vector's length, and their potentials' sum; `None` if all
/// sleep or one has not kept its own. What is too large for a double is the largest one.
pub(crate) fn residual(groups: &[Group], gravity: Option<DVec3>) -> Option<ResidualReport> {
    let awake = || groups.iter().filter(|group| !group.asleep());
    // The weight's norm in N, and the same times the square of each group's substep.
    let (mut weight, mut moved) = (0.0_f64, 0.0_f64);
    let (mut primal, mut dual, mut force) = (0.0_f64, 0.0_f64, 0.0_f64);
    let (mut potential, mut constraints, mut descends) = (0.0, 0, false);
    for group in awake() {
        let time = group.settings.substep_time();
        if let Some(gravity) = gravity {
            let load = each!(&group.solver, solver => solver.load(gravity));
            weight = weight.hypot(load);
            moved = moved.hypot(load * time * time);
        }
        match group.solver.last_substep(time)? {
            LastSubstep::Constraints(residuals) => {
                primal = primal.hypot(residuals.primal);
                dual = dual.hypot(residuals.dual);
                force = force.hypot(residuals.force);
                potential += residuals.potential;
                constraints += residuals.constraints;
            }
            LastSubstep::Vbd {
                force: left,
                potential: of_group,
            } => {
                force = force.hypot(left);
                potential += of_group;
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

/// The residual of each tet of a group in the last substep: none asleep; `None` if they were not kept.
pub(crate) fn residuals_of_tets(group: &Group) -> Option<Vec<f64>> {
    if group.asleep() {
        return Some(vec![0.0; group.cuttable.mesh().tets.len()]);
    }
    if group.spec.method == Method::Vbd {
        return None;
    }
    let time = group.settings.substep_time();
    group.solver.residuals_of_tets(time)
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

/// The largest kappa of a tet, each at the substep of its group.
pub(crate) fn kappa(groups: &[Group]) -> f64 {
    groups.iter().map(Group::kappa).fold(0.0, f64::max)
}

pub(crate) fn softened(groups: &[Group]) -> SoftenedReport {
    if let [group] = groups {
        return softened_of(group);
    }
    let mut sum = SoftenedReport {
        tets: 0,
        volume_fraction: 0.0,
        strongest: 1.0,
    };
    let mut volume = 0.0;
    for group in groups {
        let softened = softened_of(group);
        sum.tets += softened.tets;
        sum.volume_fraction += softened.volume_fraction * group.initial_volume;
        sum.strongest = sum.strongest.max(softened.strongest);
        volume += group.initial_volume;
    }
    sum.volume_fraction /= volume;
    sum
}

fn softened_of(group: &Group) -> SoftenedReport {
    each!(&group.solver, solver => solver.softened()).into()
}

/// Substeps and what cuts did to kappa by group; `with_kappa` also those that take a pass over the tets.
pub(crate) fn by_body(groups: &mut [Group], with_kappa: bool) -> Vec<BodyReport> {
    let report = |group: &mut Group| {
        let cut = group.cut_kappa.take();
        BodyReport {
            bodies: group.bodies.clone(),
            substeps: group.settings.substeps,
            method: group.choice.map(|_| ChosenMethod::of(&group.spec)),
            iterations: group.choice.map(|_| group.settings.iterations),
            asleep: group.rest.map(|rest| rest.asleep()),
            choice: group.choice,
            kappa: with_kappa.then(|| group.kappa()),
            kappa_before_cut: cut.and_then(|cut| cut.before),
            kappa_of_new_tets: cut.map(|cut| cut.new_tets),
            softened: with_kappa.then(|| softened_of(group)),
        }
    };
    groups.iter_mut().map(report).collect()
}
