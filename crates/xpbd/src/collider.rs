//! [`Collider`]: solid obstacles that particles do not enter, with Coulomb friction.
//!
//! A collider is a shape with a closed form of its signed distance: plane, sphere, capsule or box. After the
//! constraints, a particle inside is put on the nearest point of the surface, and what it moved along the surface in
//! this substep is taken back by at most the coefficient of friction times the depth. The depth is what the normal
//! force pushed the particle out by, so this is Coulomb's law.
//!
//! Contacts are found where a particle is, not along its way: what crosses a collider within one substep passes, and
//! what got past the middle of a thin box leaves on the other side. A substep must be short against thickness over
//! speed.
//!
//! Source: Macklin, Müller, Chentanez, Kim 2014 (friction, section 6.1). Cost: 20 to 50 operations for each particle
//! and collider, more for those inside.

mod solid;

use glam::{DQuat, DVec3};
use rayon::prelude::*;

use crate::float::{finite, load, store, weight};
use crate::step::PARALLEL_PARTICLES;
use crate::{Float, Solver, StepSettings, XpbdError};
use solid::{Nearest, Solid};

/// How far a particle may be pushed, in depths.
const LONGEST_PUSH: f64 = 10.0;
/// How often a particle inside several colliders is handed around among them.
const ROUNDS: usize = 32;

/// A solid obstacle.
///
/// # Example
/// A particle falls on a ball and lies on its top.
/// ```
/// use glam::DVec3;
/// use incise_graph::Schedule;
/// use incise_xpbd::{Collider, ColliderShape, Solver, StepSettings};
///
/// let ball = Collider::new(ColliderShape::Sphere { center: DVec3::ZERO, radius: 0.5 });
/// let mut solver = Solver::<f64>::new(&[DVec3::Z]);
/// solver.set_mass(0, 1.0);
/// let settings = StepSettings {
///     substeps: 10,
///     gravity: Some(DVec3::new(0.0, 0.0, -9.81)),
///     colliders: vec![ball],
///     ..StepSettings::new(0.016)
/// };
/// for _ in 0..60 {
///     solver.step(&Schedule::default(), &settings)?;
/// }
/// assert!((solver.position(0).z - 0.5).abs() < 1e-12);
/// # Ok::<(), incise_xpbd::XpbdError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Collider {
    /// Its shape and place at the start of the frame.
    pub shape: ColliderShape,
    /// Coulomb's coefficient of friction, at least 0.
    pub friction: f64,
    /// Its velocity in m/s during the frame. The next frame starts where its caller says: see [`Collider::moved`].
    pub velocity: DVec3,
}

/// The shape of a collider.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ColliderShape {
    /// A half space, free on the side that the normal points to.
    Plane {
        /// A point on its surface in m.
        point: DVec3,
        /// Its normal, of any length but 0.
        normal: DVec3,
    },
    /// A ball.
    Sphere {
        /// Its center in m.
        center: DVec3,
        /// Its radius in m, positive.
        radius: f64,
    },
    /// All points within the radius of a segment.
    Capsule {
        /// The ends of the segment in m; they may coincide.
        ends: [DVec3; 2],
        /// Its radius in m, positive.
        radius: f64,
    },
    /// A turned box.
    Box {
        /// Its center in m.
        center: DVec3,
        /// Half its edges in m, positive.
        half_extents: DVec3,
        /// How it is turned, of any length but 0.
        rotation: DQuat,
    },
}

impl Collider {
    /// A collider at rest, without friction.
    #[must_use]
    pub fn new(shape: ColliderShape) -> Self {
        Self {
            shape,
            friction: 0.0,
            velocity: DVec3::ZERO,
        }
    }

    /// A horizontal floor at a height in m; up is z.
    #[must_use]
    pub fn ground(height: f64, friction: f64) -> Self {
        let shape = ColliderShape::Plane {
            point: DVec3::Z * height,
            normal: DVec3::Z,
        };
        Self {
            friction,
            ..Self::new(shape)
        }
    }

    /// The collider where its velocity takes it in `time` s.
    #[must_use]
    pub fn moved(&self, time: f64) -> Self {
        self.shifted(self.velocity * time)
    }

    fn shifted(&self, by: DVec3) -> Self {
        let mut moved = *self;
        match &mut moved.shape {
            ColliderShape::Plane { point, .. } => *point += by,
            ColliderShape::Sphere { center, .. } | ColliderShape::Box { center, .. } => {
                *center += by;
            }
            ColliderShape::Capsule { ends, .. } => ends.iter_mut().for_each(|end| *end += by),
        }
        moved
    }

    /// The distance of a point from the surface in m, negative inside, and the direction in which it grows fastest.
    ///
    /// Where there are several such directions (the center of a sphere, the axis of a capsule, the middle of a box),
    /// it is always the same one of them.
    ///
    /// # Example
    /// ```
    /// use glam::DVec3;
    /// use incise_xpbd::Collider;
    ///
    /// let (distance, normal) = Collider::ground(1.0, 0.0).distance(DVec3::ZERO);
    /// assert_eq!((distance, normal), (-1.0, DVec3::Z));
    /// ```
    #[must_use]
    pub fn distance(&self, point: DVec3) -> (f64, DVec3) {
        let nearest = Solid::<f64>::new(&self.shape).nearest(point);
        (nearest.distance, nearest.normal)
    }

    /// Checks that each value lies in its range.
    ///
    /// # Errors
    /// [`XpbdError::Setting`] names the first value that does not.
    pub fn check(&self) -> Result<(), XpbdError> {
        let refuse = |what, value, range| Err(XpbdError::Setting { what, value, range });
        let vectors = match self.shape {
            ColliderShape::Plane { point, normal } => {
                [("collider point", point), ("collider normal", normal)]
            }
            ColliderShape::Sphere { center, .. } => [("collider center", center); 2],
            ColliderShape::Capsule { ends, .. } => ends.map(|end| ("collider end", end)),
            ColliderShape::Box {
                center,
                half_extents,
                ..
            } => [
                ("collider center", center),
                ("collider half_extents", half_extents),
            ],
        };
        let velocity = [("collider velocity", self.velocity)];
        for (what, vector) in vectors.into_iter().chain(velocity) {
            if let Some(value) = vector.to_array().into_iter().find(|c| !c.is_finite()) {
                return refuse(what, value, "finite");
            }
        }
        if !(self.friction.is_finite() && self.friction >= 0.0) {
            return refuse("collider friction", self.friction, "at least 0 and finite");
        }
        match self.shape {
            ColliderShape::Plane { normal, .. } if normal == DVec3::ZERO => {
                refuse("collider normal", 0.0, "a direction")
            }
            ColliderShape::Sphere { radius, .. } | ColliderShape::Capsule { radius, .. }
                if !(radius.is_finite() && radius > 0.0) =>
            {
                refuse("collider radius", radius, "positive and finite")
            }
            ColliderShape::Box {
                half_extents,
                rotation,
                ..
            } => {
                let smallest = half_extents.min_element();
                if smallest <= 0.0 {
                    return refuse("collider half_extents", smallest, "positive");
                }
                let length = rotation.length();
                if !(length.is_finite() && length > 0.0) {
                    return refuse("collider rotation", length, "a rotation");
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }
}

/// A collider at the end of a substep.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Obstacle<R: Float> {
    solid: Solid<R>,
    friction: R,
    /// What it moved in the substep.
    motion: R::Vector,
}

impl<R: Float> Obstacle<R> {
    /// The colliders `elapsed` s after the start of the frame, at the end of a substep, relative to an origin.
    pub(crate) fn place(
        settings: &StepSettings,
        elapsed: f64,
        origin: DVec3,
    ) -> impl Iterator<Item = Self> {
        let place = move |collider: &Collider| Self {
            solid: Solid::new(&collider.moved(elapsed).shifted(-origin).shape),
            friction: R::from_f64(collider.friction),
            motion: R::from_dvec3(collider.velocity * settings.substep_time()),
        };
        settings.colliders.iter().map(place)
    }

    /// The outward normal, if a particle is inside or, but for rounding, on the surface.
    pub(crate) fn touched_at(&self, x: R::Vector) -> Option<R::Vector> {
        let nearest = self.solid.nearest(x);
        let [a, b, c] = R::components(x);
        let size = (a * a + b * b + c * c).sqrt();
        (nearest.distance <= size * R::EPSILON * R::from_f64(4.0)).then_some(nearest.normal)
    }

    /// What is left of a force in N on a particle that the collider bears: nothing of what presses the particle into it,
    /// nor of what friction then holds.
    pub(crate) fn left_of(&self, force: DVec3, x: R::Vector) -> DVec3 {
        let Some(normal) = self.touched_at(x).map(R::to_dvec3) else {
            return force;
        };
        let pressure = -normal.dot(force);
        if pressure < 0.0 {
            return force;
        }
        let along = force + normal * pressure;
        let (size, held) = (along.length(), self.friction.to_f64() * pressure);
        if size <= held {
            return DVec3::ZERO;
        }
        along * (1.0 - held / size)
    }

    /// Where a particle inside is put that was at `previous` before the substep.
    #[inline]
    fn push_out(&self, x: R::Vector, previous: R::Vector) -> Option<R::Vector> {
        let Nearest {
            distance,
            normal,
            point,
        } = self.solid.nearest(x);
        if distance >= R::ZERO {
            return None;
        }
        Some(self.rub(point, normal, -distance, x - previous))
    }

    /// Where a particle at `x` is put that wants to move to `moved` inside: onto the plane that touches the surface
    /// nearest to `x`, along `along(normal)`. With the direction in which a force along the normal moves the particle,
    /// what is left over in the end is such a force. `None` if that leads far away.
    #[inline]
    pub(crate) fn push_along(
        &self,
        x: R::Vector,
        moved: R::Vector,
        previous: R::Vector,
        along: impl Fn(R::Vector) -> R::Vector,
    ) -> Option<R::Vector> {
        if self.solid.nearest(moved).distance >= R::ZERO {
            return None;
        }
        let Nearest {
            distance, normal, ..
        } = self.solid.nearest(x);
        let depth = -(distance + R::dot(normal, moved - x));
        let along = along(normal);
        let straight = R::dot(normal, along);
        // A push that goes much further along the surface than out of it throws particles about in extreme states.
        let limit = straight * R::from_f64(LONGEST_PUSH);
        let sound = depth > R::ZERO && straight > R::ZERO && R::dot(along, along) <= limit * limit;
        let out = moved + along * (depth / straight);
        (sound && finite::<R>(out)).then(|| self.rub(out, normal, depth, out - previous))
    }

    /// Holds a particle on the surface back by at most the friction's share of the depth it was pushed out of.
    #[inline]
    fn rub(&self, x: R::Vector, normal: R::Vector, depth: R, way: R::Vector) -> R::Vector {
        let way = way - self.motion;
        let slide = way - normal * R::dot(normal, way);
        let length = R::dot(slide, slide).sqrt();
        let hold = self.friction * depth;
        let share = if length > hold { hold / length } else { R::ONE };
        x - slide * share
    }
}

impl Obstacle<f32> {
    /// All there is to know, at the places that `Solver::obstacle_data` names.
    pub(crate) fn numbers(&self) -> [f32; 20] {
        let mut numbers = self.solid.numbers();
        numbers[1] = self.friction;
        numbers[4..7].copy_from_slice(&self.motion.to_array());
        numbers
    }
}

impl<R: Float> Solver<R> {
    /// Puts the particles inside of colliders on their surface.
    pub(crate) fn project_to_colliders(&self, obstacles: &[Obstacle<R>]) {
        let particles = self.particles.par_iter().with_min_len(PARALLEL_PARTICLES);
        particles
            .zip(&self.previous)
            .for_each(|(particle, &previous)| {
                if weight::<R>(particle) <= R::ZERO {
                    return;
                }
                if let Some(x) = outside(obstacles, load::<R>(particle), previous) {
                    store::<R>(particle, x);
                }
            });
    }
}

/// Where a particle inside of a collider is put; `None` outside of all. Where colliders overlap, one may push a particle
/// into another; then they take turns, which ends at a point outside of all if there is one nearby.
#[inline]
pub(crate) fn outside<R: Float>(
    obstacles: &[Obstacle<R>],
    mut x: R::Vector,
    previous: R::Vector,
) -> Option<R::Vector> {
    // Obstacles in a row that the particle is not inside of.
    let (mut clear, mut moved) = (0, false);
    for obstacle in obstacles.iter().cycle().take(ROUNDS * obstacles.len()) {
        clear += 1;
        if let Some(out) = obstacle.push_out(x, previous) {
            (x, clear, moved) = (out, 1, true);
        }
        if clear == obstacles.len() {
            break;
        }
    }
    moved.then_some(x)
}
