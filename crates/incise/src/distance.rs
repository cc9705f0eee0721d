//! Distance constraints between two points of bodies, checked and passed to a solver.
//!
//! A change of one passes all of an island to the solver again: O(distances of the island).

use glam::DVec3;
use incise_coloring::{Order, greedy};
use incise_graph::{Clustering, Incidence, Schedule};
use incise_mesh::ParticleId;
use incise_xpbd::DistanceConstraint;

use crate::backend::AnySolver;
use crate::scene::{DistanceSpec, EndSpec};
use crate::validate::{LARGEST_COORDINATE, coordinates, existing, value, within};
use crate::{Error, Scene};

/// Handle of a distance constraint of a simulation, valid until the constraint is removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub struct DistanceHandle(pub(crate) u32);

impl DistanceHandle {
    /// The handle of the distance constraint of a scene with this index.
    pub(crate) fn of_scene(index: usize) -> Self {
        Self(u32::try_from(index).expect("distances are numbered in 32 bits"))
    }
}

/// The bodies that distance constraints join, if they all exist.
pub(crate) fn pairs(scene: &Scene, bodies: usize) -> Result<Vec<[usize; 2]>, Error> {
    let specs = scene.distance.iter().enumerate();
    specs
        .map(|(i, spec)| ends_exist(&format!("distance[{i}]"), spec, bodies))
        .collect()
}

/// The bodies of both ends, if there are so many bodies.
pub(crate) fn ends_exist(
    field: &str,
    spec: &DistanceSpec,
    bodies: usize,
) -> Result<[usize; 2], Error> {
    existing(&format!("{field}.from.body"), spec.from.body, bodies)?;
    existing(&format!("{field}.to.body"), spec.to.body, bodies)?;
    Ok([spec.from.body, spec.to.body])
}

/// The position nearest to a point, and its index; the first of several.
pub(crate) fn nearest(point: [f64; 3], positions: &[DVec3]) -> Option<(DVec3, usize)> {
    let point = DVec3::from_array(point);
    let near = positions.iter().enumerate().min_by(|a, b| {
        let [a, b] = [a, b].map(|(_, x)| x.distance_squared(point));
        a.total_cmp(&b)
    });
    near.map(|(p, &x)| (x, p))
}

/// Checks a distance constraint. `particle` gives the position at rest of the particle of an end, and its number in its
/// island; nothing if its body has none.
pub(crate) fn constraint(
    field: &str,
    spec: &DistanceSpec,
    particle: impl Fn(&EndSpec) -> Option<(DVec3, usize)>,
) -> Result<DistanceConstraint, Error> {
    let end = |key: &str, end: &EndSpec| {
        coordinates(&format!("{field}.{key}.point"), end.point)?;
        particle(end).ok_or_else(|| value(field, "on a body without particles", "on a particle"))
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
        tension_only: spec.tension_only,
    })
}

/// The distance constraints of an island.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Distances {
    names: Vec<DistanceHandle>,
    list: Vec<DistanceConstraint>,
}

impl Distances {
    /// Whether a constraint ends at a particle. Linear in the constraints.
    pub(crate) fn holds(&self, particle: ParticleId) -> bool {
        self.ends().flatten().any(|end| end == particle.0)
    }

    /// The particles of each constraint.
    pub(crate) fn ends(&self) -> impl Iterator<Item = [u32; 2]> + '_ {
        self.list.iter().map(|constraint| constraint.particles)
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Appends a constraint.
    pub(crate) fn add(&mut self, name: DistanceHandle, constraint: DistanceConstraint) {
        self.names.push(name);
        self.list.push(constraint);
    }

    /// Appends those of an island whose particles get numbers from `first` on.
    pub(crate) fn append(&mut self, other: &Self, first: u32) {
        self.names.extend(&other.names);
        let list = other.list.iter().map(|constraint| DistanceConstraint {
            particles: constraint.particles.map(|p| first + p),
            ..*constraint
        });
        self.list.extend(list);
    }

    /// The constraint of a name.
    pub(crate) fn get_mut(&mut self, name: DistanceHandle) -> Option<&mut DistanceConstraint> {
        let index = self.names.iter().position(|n| *n == name)?;
        Some(&mut self.list[index])
    }

    /// Removes the constraint of a name; tells whether there was one.
    pub(crate) fn remove(&mut self, name: DistanceHandle) -> bool {
        let Some(index) = self.names.iter().position(|n| *n == name) else {
            return false;
        };
        self.names.remove(index);
        self.list.remove(index);
        true
    }

    /// Hands all to the solver, in an order by colors.
    pub(crate) fn hand_to(&self, solver: &mut AnySolver) -> Result<(), Error> {
        let solver = solver.edit()?;
        let incidence = Incidence::from_constraints(solver.particle_count(), self.ends())?;
        let coloring = greedy(&incidence, Order::LargestFirst);
        let schedule = Schedule::new(&Clustering::none(self.list.len()), &coloring);
        let set = solver.set_distances(&self.list, schedule);
        set.map_err(Error::xpbd("distance"))
    }
}
