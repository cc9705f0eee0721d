//! What all groups of bodies together are worth: the quantities of a report.
//!
//! Sums, and the largest or smallest value where that is what is asked. For a single group they are its own numbers to
//! the bit. Cost: a pass over the particles or tets each.

use glam::DVec3;
use incise_xpbd::Volume;

use crate::backend::each;
use crate::group::Group;
use crate::report::{BodyReport, EnergyReport, ResidualReport, SoftenedReport};

/// Residuals of the last substep of each group awake, as one vector's length; `None` unless these have kept theirs.
pub(crate) fn residual(groups: &[Group]) -> Option<ResidualReport> {
    let mut sum = ResidualReport {
        primal: 0.0,
        dual: 0.0,
    };
    for group in groups.iter().filter(|group| !group.asleep()) {
        let time = group.settings.substep_time();
        let residuals = each!(&group.solver, solver => solver.residuals(time))?;
        sum.primal = sum.primal.hypot(residuals.primal);
        sum.dual = sum.dual.hypot(residuals.dual);
    }
    Some(sum)
}

pub(crate) fn energy(groups: &[Group], gravity: Option<DVec3>) -> EnergyReport {
    let mut sum = EnergyReport {
        kinetic: 0.0,
        elastic: 0.0,
        gravity: 0.0,
    };
    for group in groups {
        let energy = each!(&group.solver, solver => solver.energy(gravity));
        sum.kinetic += energy.kinetic;
        sum.elastic += energy.elastic;
        sum.gravity += energy.gravity;
    }
    sum
}

pub(crate) fn volume(groups: &[Group]) -> Volume {
    let mut sum = Volume {
        total: 0.0,
        rest: 0.0,
        min_ratio: 1.0,
        inverted: 0,
    };
    for group in groups {
        let volume = each!(&group.solver, solver => solver.volume());
        sum.total += volume.total;
        sum.rest += volume.rest;
        sum.min_ratio = sum.min_ratio.min(volume.min_ratio);
        sum.inverted += volume.inverted;
    }
    sum
}

/// The largest speed of a particle in m/s.
pub(crate) fn max_speed(groups: &[Group]) -> f64 {
    let speeds = groups
        .iter()
        .map(|group| each!(&group.solver, solver => solver.max_speed()));
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
