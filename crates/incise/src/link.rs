//! Sutures and springs between two points of bodies, checked and handed to a solver.

use glam::DVec3;
use incise_coloring::{Order, greedy};
use incise_graph::{Clustering, Incidence, Schedule};
use incise_xpbd::DistanceConstraint;

use crate::backend::{AnySolver, each_mut};
use crate::limits::{LARGEST_COORDINATE, coordinates, existing, value, within};
use crate::scene::{EndSpec, LinkSpec};
use crate::{Error, Scene};

/// The bodies that links join, if they all exist.
pub(crate) fn pairs(scene: &Scene, bodies: usize) -> Result<Vec<[usize; 2]>, Error> {
    let links = scene.link.iter().enumerate();
    let pair = |(i, spec): (usize, &LinkSpec)| {
        existing(&format!("link[{i}].from.body"), spec.from.body, bodies)?;
        existing(&format!("link[{i}].to.body"), spec.to.body, bodies)?;
        Ok([spec.from.body, spec.to.body])
    };
    links.map(pair).collect()
}

/// Checks a link between bodies that exist. `positions` gives those of a body's particles at rest, and the number of its
/// first particle in its group, by the number of the body.
pub(crate) fn link<'a>(
    field: &str,
    spec: &LinkSpec,
    positions: impl Fn(usize) -> (&'a [DVec3], usize),
) -> Result<DistanceConstraint, Error> {
    let end = |key: &str, end: &EndSpec| -> Result<_, Error> {
        let (positions, first) = positions(end.body);
        let point = coordinates(&format!("{field}.{key}.point"), end.point)?;
        let nearest = (0..positions.len())
            .map(|p| (positions[p].distance_squared(point), p))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let (_, nearest) =
            nearest.ok_or_else(|| value(field, "on an empty body", "on a particle"))?;
        Ok((positions[nearest], first + nearest))
    };
    let (a, from) = end("from", &spec.from)?;
    let (b, to) = end("to", &spec.to)?;
    if from == to {
        let range = "such that another particle is nearest than from the other end";
        return Err(value(
            format!("{field}.to.point"),
            format!("{:?}", spec.to.point),
            range,
        ));
    }
    let number =
        |p: usize| u32::try_from(p).map_err(|_| Error::Inconsistent("too many particles".into()));
    let length = spec.length.unwrap_or(a.distance(b));
    Ok(DistanceConstraint {
        particles: [number(from)?, number(to)?],
        length: within(
            &format!("{field}.length"),
            length,
            0.0,
            2.0 * LARGEST_COORDINATE,
        )?,
        compliance: within(&format!("{field}.compliance"), spec.compliance, 0.0, 1e9)?,
        damping: 0.0,
        only_when_longer: spec.only_when_longer,
    })
}

/// Hands links to the solver, in an order by colors.
pub(crate) fn connect(solver: &mut AnySolver, links: &[DistanceConstraint]) -> Result<(), Error> {
    if links.is_empty() {
        return Ok(());
    }
    each_mut!(solver, solver => {
        let particles = links.iter().map(|link| link.particles);
        let incidence = Incidence::from_constraints(solver.particle_count(), particles)?;
        let coloring = greedy(&incidence, Order::LargestFirst);
        let schedule = Schedule::new(&Clustering::none(links.len()), &coloring);
        let set = solver.set_distances(links, schedule);
        set.map_err(|source| Error::Xpbd { field: "link".into(), source })
    })
}
