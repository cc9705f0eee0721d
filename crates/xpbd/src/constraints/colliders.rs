//! [`Colliders`]: solid obstacles that particles do not enter, with Coulomb friction.
//!
//! A [`Collider`] is a shape with a closed form of its signed distance: plane, sphere, capsule or box. After the other
//! constraints, a particle inside is put on the nearest point of the surface, and what it moved along the surface in
//! this substep is taken back by at most the coefficient of friction times the depth. The depth is what the normal
//! force pushed the particle out by, so this is Coulomb's law.
//!
//! A particle that is inside already when a substep begins, because its body or the collider was put there, would get a
//! speed of its depth over the substep. It keeps a part of that depth, as contacts between bodies do: it comes out at its
//! depth over [`RECOVERY_TIME`]. What a substep adds to the depth is always taken back in full. VBD has substeps about as
//! long as this time and puts particles out at once.
//!
//! Contacts are found where a particle is, not along its way: what crosses a collider within one substep passes, and
//! what got past the middle of a thin box leaves on the other side. A substep must be short against thickness over
//! speed.
//!
//! Source: Macklin, Müller, Chentanez, Kim 2014 (friction, section 6.1). Cost: 6 operations for each particle, and 5
//! to 100 for each collider that it is near.

use glam::DVec3;
use rayon::prelude::*;

use super::ConstraintKind;
use crate::collider::{Nearest, Solid};
use crate::float::{finite, load, store, weight};
use crate::force::Force;
use crate::particles::{PARALLEL_PARTICLES, Particles};
use crate::substep::Substep;
use crate::{Collider, Float, StepSettings};

/// The time in s in which an existing depth decays by a factor of e: that of contacts by default.
pub(crate) const RECOVERY_TIME: f64 = 0.02;

/// How far a particle may be pushed, in depths.
const LONGEST_PUSH: f64 = 10.0;
/// Numbers of an obstacle for a device.
const COLLIDER_NUMBERS: usize = 22;
/// Consecutive particles that are compared with an obstacle at once.
const GROUP: usize = 32;
/// Largest number of times that a particle inside several colliders is pushed from one into another.
const ROUNDS: usize = 32;

/// The colliders of the settings, where they are at the end of the present substep.
#[derive(Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(crate) struct Colliders<R: Float> {
    #[cfg_attr(feature = "serde", serde(skip))]
    pub(crate) obstacles: Vec<Obstacle<R>>,
    /// Of each obstacle, while forces are measured: the sum of mass times motion that particles gave it in the substep,
    /// and its moment.
    #[cfg_attr(feature = "serde", serde(skip))]
    pushes: Vec<Force>,
}

impl<R: Float> Default for Colliders<R> {
    fn default() -> Self {
        Self {
            obstacles: Vec::new(),
            pushes: Vec::new(),
        }
    }
}

/// Without obstacles: each substep places its own.
impl<R: Float> Clone for Colliders<R> {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl<R: Float> Colliders<R> {
    /// Places the colliders `elapsed` s after the start of the frame, at the end of a substep, which then keep the part
    /// `kept` of a depth that the substep begins with.
    pub(crate) fn place(
        &mut self,
        settings: &StepSettings,
        elapsed: f64,
        origin: DVec3,
        kept: f64,
    ) {
        self.obstacles.clear();
        self.obstacles
            .extend(Obstacle::place(settings, elapsed, origin, kept));
    }

    /// Whether a particle is inside of a collider or, but for rounding, on its surface.
    pub(crate) fn touches(&self, x: R::Vector) -> bool {
        self.obstacles.iter().any(|o| o.touched_at(x).is_some())
    }

    /// [`Colliders::project`], which adds to the sums of all obstacles what particles push them by. The sums have a fixed
    /// order.
    fn project_measured(&mut self, particles: &Particles<R>) {
        let obstacles = &*self.obstacles;
        let chunks = particles.cells.par_chunks(PARALLEL_PARTICLES).enumerate();
        let sums = chunks.map(|(chunk, cells)| {
            let mut pushes = vec![Force::default(); obstacles.len()];
            each_near(obstacles, cells, |i| {
                let (cell, p) = (&cells[i], chunk * PARALLEL_PARTICLES + i);
                let mass = particles.masses[p];
                let note = |obstacle: usize, from: R::Vector, to: R::Vector| {
                    let at = particles.origin + R::to_dvec3(to);
                    pushes[obstacle].add(R::to_dvec3(from - to) * mass, at);
                };
                let x = load::<R>(cell);
                if let Some(x) = outside_noting(obstacles, x, particles.previous[p], note) {
                    store::<R>(cell, x);
                }
            });
            pushes
        });
        for pushes in sums.collect::<Vec<_>>() {
            for (sum, push) in self.pushes.iter_mut().zip(pushes) {
                sum.force += push.force;
                sum.torque += push.torque;
            }
        }
    }

    /// Adds the impulses of the substep to those of a frame.
    pub(crate) fn take_pushes(&mut self, impulses: &mut [Force], per_time: f64) {
        for (sum, push) in impulses.iter_mut().zip(self.pushes.drain(..)) {
            sum.force += push.force * per_time;
            sum.torque += push.torque * per_time;
        }
    }

    /// Puts the particles inside of colliders on their surface.
    pub(crate) fn project(&self, particles: &Particles<R>) {
        if self.obstacles.is_empty() {
            return;
        }
        let cells = particles.cells.par_chunks(PARALLEL_PARTICLES);
        cells
            .zip(particles.previous.par_chunks(PARALLEL_PARTICLES))
            .for_each(|(cells, previous)| {
                each_near(&self.obstacles, cells, |i| {
                    let x = load::<R>(&cells[i]);
                    if let Some(x) = outside(&self.obstacles, x, previous[i]) {
                        store::<R>(&cells[i], x);
                    }
                });
            });
    }
}

impl<R: Float> ConstraintKind<R> for Colliders<R> {
    fn begin(&mut self, particles: &Particles<R>, substep: &Substep<'_, R>) -> usize {
        let kept = kept_depth(substep.settings);
        self.place(substep.settings, substep.elapsed, particles.origin, kept);
        self.pushes.clear();
        if particles.keeps_refused() {
            self.pushes.resize(self.obstacles.len(), Force::default());
        }
        0
    }

    fn solve(&mut self, particles: &Particles<R>, _substep: &Substep<'_, R>) {
        if self.pushes.is_empty() {
            self.project(particles);
        } else {
            self.project_measured(particles);
        }
    }

    fn bytes(&self) -> usize {
        0
    }
}

/// A collider at the end of a substep.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Obstacle<R: Float> {
    solid: Solid<R>,
    friction: R,
    /// What it moved in the substep.
    motion: R::Vector,
    /// The part of a depth at the start of the substep that is left at its end.
    kept: R,
    /// A depth that is rounding of the shape's numbers.
    slack: R,
}

/// The part of a depth that is left after a substep of XPBD.
pub(crate) fn kept_depth(settings: &StepSettings) -> f64 {
    1.0 - (settings.substep_time() / RECOVERY_TIME).min(1.0)
}

impl<R: Float> Obstacle<R> {
    /// The colliders `elapsed` s after the start of the frame, at the end of a substep, relative to an origin.
    pub(crate) fn place(
        settings: &StepSettings,
        elapsed: f64,
        origin: DVec3,
        kept: f64,
    ) -> impl Iterator<Item = Self> {
        let place = move |collider: &Collider| {
            let solid = Solid::new(&collider.moved(elapsed).shifted(-origin).shape);
            Self {
                friction: R::from_f64(collider.friction),
                motion: R::from_dvec3(collider.velocity * settings.substep_time()),
                kept: R::from_f64(kept),
                slack: solid.reach() * R::EPSILON * R::from_f64(8.0),
                solid,
            }
        };
        settings.colliders.iter().map(place)
    }

    /// The outward normal, if a particle is inside or, but for rounding, on the surface.
    pub(crate) fn touched_at(&self, x: R::Vector) -> Option<R::Vector> {
        let nearest = self.solid.nearest(x);
        (nearest.distance <= rounding::<R>(x)).then_some(nearest.normal)
    }

    /// What is left of a force in N on a particle that the collider bears: nothing of what presses the particle into
    /// it, nor of what friction then holds.
    pub(crate) fn left_of(&self, force: DVec3, x: R::Vector) -> DVec3 {
        match self.touched_at(x) {
            Some(normal) => self.left_along(force, R::to_dvec3(normal)),
            None => force,
        }
    }

    /// What a collider bears by its law of a force in N that presses a particle into it, at most `gap` m outside of its
    /// surface; `None` if the particle is farther away or the force pulls it off.
    pub(crate) fn borne(&self, force: DVec3, x: R::Vector, gap: f64) -> Option<DVec3> {
        let nearest = self.solid.nearest(x);
        let normal = R::to_dvec3(nearest.normal);
        let presses = nearest.distance.to_f64() <= gap && normal.dot(force) < 0.0;
        presses.then(|| force - self.left_along(force, normal))
    }

    fn left_along(&self, force: DVec3, normal: DVec3) -> DVec3 {
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
        let kept = self.kept_distance(previous);
        if distance >= kept {
            return None;
        }
        let (to, depth) = (point + normal * kept, kept - distance);
        Some(self.rub(to, normal, depth, x - previous))
    }

    /// The distance from the surface, zero or negative, that a particle may keep which was at `previous` before the
    /// substep. What lies on the surface is inside by no more than rounding, which is no depth.
    #[inline]
    fn kept_distance(&self, previous: R::Vector) -> R {
        if self.kept <= R::ZERO {
            return R::ZERO;
        }
        let before = previous + self.motion;
        let distance = self.solid.nearest(before).distance;
        if distance < -(self.slack + rounding::<R>(before)) {
            self.kept * distance
        } else {
            R::ZERO
        }
    }

    /// Where a particle at `x` is put that wants to move to `moved` inside: onto the plane that touches the surface
    /// nearest to `x`, along `along(normal)`. With the direction in which a force along the normal moves the particle,
    /// what is left over in the end is such a force. If that leads far away, as far towards `moved` as it is outside;
    /// `None` if it is nowhere on the way.
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
        let out = if sound {
            moved + along * (depth / straight)
        } else if depth > R::ZERO && distance >= R::ZERO {
            // On the way to the minimum the energy falls at every point, so also at the last one outside.
            x + (moved - x) * (distance / (distance + depth))
        } else {
            return None;
        };
        finite::<R>(out).then(|| self.rub(out, normal, depth, out - previous))
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

/// How far a particle on a surface may be off it by rounding.
#[inline]
fn rounding<R: Float>(x: R::Vector) -> R {
    let [a, b, c] = R::components(x);
    let size = (a * a + b * b + c * c).sqrt();
    size * R::EPSILON * R::from_f64(4.0)
}

impl Obstacle<f32> {
    /// The numbers of the obstacle, in the order of `Solver::collider_data`.
    pub(crate) fn numbers(&self) -> [f32; COLLIDER_NUMBERS] {
        let mut numbers = [0.0; COLLIDER_NUMBERS];
        numbers[..20].copy_from_slice(&self.solid.numbers());
        numbers[1] = self.friction;
        [numbers[20], numbers[21]] = [self.kept, self.slack];
        numbers[4..7].copy_from_slice(&self.motion.to_array());
        numbers
    }
}

/// Calls `visit` with the place of each particle that may move and that may be inside of an obstacle. Most are far from
/// all, and so are the boxes around most groups of consecutive ones.
#[inline]
fn each_near<R: Float>(
    obstacles: &[Obstacle<R>],
    cells: &[R::Particle],
    mut visit: impl FnMut(usize),
) {
    for (number, group) in cells.chunks(GROUP).enumerate() {
        let first = R::components(load::<R>(&group[0]));
        let (mut low, mut high) = (first, first);
        for cell in &group[1..] {
            let x = R::components(load::<R>(cell));
            for k in 0..3 {
                low[k] = if x[k] < low[k] { x[k] } else { low[k] };
                high[k] = if x[k] > high[k] { x[k] } else { high[k] };
            }
        }
        if obstacles.iter().all(|o| o.solid.clears_box(low, high)) {
            continue;
        }
        for (i, cell) in group.iter().enumerate() {
            if weight::<R>(cell) > R::ZERO {
                visit(number * GROUP + i);
            }
        }
    }
}

/// Where a particle inside of a collider is put; `None` outside of all. Where colliders overlap, one may push a
/// particle into another; then they take turns, which ends at a point outside of all if there is one nearby.
#[inline]
pub(crate) fn outside<R: Float>(
    obstacles: &[Obstacle<R>],
    x: R::Vector,
    previous: R::Vector,
) -> Option<R::Vector> {
    outside_noting(obstacles, x, previous, |_, _, _| {})
}

/// [`outside`], which tells which obstacle puts the particle from where to where.
#[inline]
fn outside_noting<R: Float>(
    obstacles: &[Obstacle<R>],
    mut x: R::Vector,
    previous: R::Vector,
    mut note: impl FnMut(usize, R::Vector, R::Vector),
) -> Option<R::Vector> {
    let mut is_near = false;
    for obstacle in obstacles {
        is_near |= !obstacle.solid.clears(x);
    }
    if !is_near {
        return None;
    }
    // Obstacles in a row that the particle is not inside of.
    let (mut clear, mut moved) = (0, false);
    let turns = ROUNDS * obstacles.len();
    for (number, obstacle) in obstacles.iter().enumerate().cycle().take(turns) {
        clear += 1;
        if let Some(out) = obstacle.push_out(x, previous) {
            note(number, x, out);
            (x, clear, moved) = (out, 1, true);
        }
        if clear == obstacles.len() {
            break;
        }
    }
    moved.then_some(x)
}
