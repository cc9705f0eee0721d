//! [`Guess::Adaptive`](super::Guess::Adaptive): the initial guess of a substep.
//!
//! Sweeps that do not converge keep much of what they start with, so the start decides how a stiff body moves. The
//! inertial guess `x + Δt v` can hold any energy: with slivers it inverts tets by multiples of their height, and
//! descent from there ends in a tangle above the energy that the body had. Each connected part of a body therefore
//! starts on the line from a safe start to that guess, nowhere above the potential of the safe start. That is where the
//! part was; for a part that nothing holds, the rigid motion with its momentum and angular momentum. From
//! `E(x) ≤ E(x_n)` follows `½ ‖v_{n+1} - v_n‖²_M + U(x_{n+1}) ≤ ½ ‖v_n‖²_M + U(x_n)` for implicit Euler, at any
//! stiffness and after any number of sweeps. Cost: two to four evaluations of the potential, about half a sweep each.

use glam::{DMat3, DQuat, DVec3};

use super::ImplicitStep;
use crate::constraints::outside;
use crate::float::{finite, load, store, weight};
use crate::{Float, Solver};

/// The part of an accuracy that a substep may use up in which a free part starts from its rigid motion: what is left
/// over then has the same direction in every substep and adds up. Measured: without it up to 1.65 times the accuracy.
const RIGID_START_SHARE: f64 = 0.5;

impl<R: Float> ImplicitStep<'_, R> {
    /// Moves the particles from the inertial guess to where the sweeps start.
    pub(super) fn start(&mut self, accuracy: Option<f64>) {
        let is_held = self.held_parts();
        if let Some(gravity) = self.settings.gravity {
            self.start_where_gravity_led(R::from_dvec3(gravity), &is_held);
        }
        if let (Some(accuracy), true) = (accuracy, self.stars.try_start) {
            self.stars.try_start = self.start_at_lowest_potential(accuracy, &is_held);
            if self.stars.try_start {
                return;
            }
        }
        if self.start_below_safe_potential(&is_held) {
            self.accuracy = accuracy.map(|accuracy| accuracy * RIGID_START_SHARE);
        }
    }

    /// Whether each connected part, by its smallest particle, has a particle that is held or anchored.
    fn held_parts(&mut self) -> Vec<bool> {
        self.stars.parts(self.solver);
        let solver = &*self.solver;
        let parts = &*self.stars.parts;
        let mut is_held = vec![false; parts.len()];
        let soft = solver
            .constraints
            .attachments
            .soft()
            .map(|a| a.particle as usize);
        let fixed =
            (0..parts.len()).filter(|&p| weight::<R>(&solver.particles.cells[p]) <= R::ZERO);
        for p in fixed.chain(soft) {
            is_held[parts[p] as usize] = true;
        }
        is_held
    }

    /// Starts every part where its potential is at most that of its safe start. Returns whether a free part starts
    /// elsewhere than at the guess.
    fn start_below_safe_potential(&self, is_held: &[bool]) -> bool {
        let Solver {
            particles,
            constraints,
            ..
        } = &*self.solver;
        constraints.colliders.project(particles);
        let safe = self.safe_start(is_held);
        let solver = &*self.solver;
        let parts = &*self.stars.parts;
        let guess: Vec<R::Vector> = solver.particles.cells.iter().map(load::<R>).collect();
        let count = parts.len();
        let at = |part: &dyn Fn(usize) -> f64| {
            for (p, particle) in solver.particles.cells.iter().enumerate() {
                if weight::<R>(particle) > R::ZERO {
                    let way = guess[p] - safe[p];
                    store::<R>(
                        particle,
                        match part(parts[p] as usize) {
                            1.0 => guess[p],
                            part => safe[p] + way * R::from_f64(part),
                        },
                    );
                }
            }
        };
        let potentials = |step: &Self| {
            let mut sums = vec![0.0; count];
            step.add_potentials(&mut sums);
            sums
        };
        let whole = potentials(self);
        at(&|_| 0.0);
        let none = potentials(self);
        let mut taken: Vec<f64> = (0..count)
            .map(|part| if whole[part] <= none[part] { 1.0 } else { 0.5 })
            .collect();
        if taken.iter().all(|&part| part == 1.0) {
            at(&|_| 1.0);
            return false;
        }
        at(&|part| taken[part]);
        let half = potentials(self);
        for part in 0..count {
            if taken[part] < 1.0 {
                taken[part] = lowest_of_parabola(none[part], half[part], whole[part]);
            }
        }
        at(&|part| taken[part]);
        let lowest = potentials(self);
        for part in 0..count {
            let is_below = lowest[part] <= none[part];
            if taken[part] < 1.0 && !is_below {
                taken[part] = 0.0;
            }
        }
        at(&|part| taken[part]);
        (0..count).any(|part| taken[part] < 1.0 && !is_held[part])
    }

    /// The safe start of each particle: where it was; in parts that nothing holds, moved with the part's momentum and
    /// angular momentum, unless that leads into a collider.
    fn safe_start(&self, is_held: &[bool]) -> Vec<R::Vector> {
        let solver = &*self.solver;
        let parts = &*self.stars.parts;
        let previous = |p: usize| R::to_dvec3(solver.particles.previous[p]);
        let way = |p: usize| solver.particles.local(p) - previous(p);
        let mut motions = vec![RigidMotion::NONE; parts.len()];
        for (p, &part) in parts.iter().enumerate() {
            if !is_held[part as usize] {
                motions[part as usize].add_mass(solver.mass(p), previous(p), way(p));
            }
        }
        for motion in &mut motions {
            motion.center();
        }
        for (p, &part) in parts.iter().enumerate() {
            if !is_held[part as usize] {
                motions[part as usize].add_inertia(solver.mass(p), previous(p), way(p));
            }
        }
        for motion in &mut motions {
            motion.turn();
        }
        let moved = |p: usize| {
            let part = parts[p] as usize;
            if is_held[part] {
                return solver.particles.previous[p];
            }
            let moved = R::from_dvec3(motions[part].apply(previous(p)));
            if finite::<R>(moved) {
                moved
            } else {
                solver.particles.previous[p]
            }
        };
        let mut safe: Vec<R::Vector> = (0..parts.len()).map(moved).collect();
        let obstacles = &*solver.constraints.colliders.obstacles;
        if !obstacles.is_empty() {
            let mut is_inside = vec![false; parts.len()];
            for (p, &part) in parts.iter().enumerate() {
                is_inside[part as usize] |=
                    outside(obstacles, safe[p], solver.particles.previous[p]).is_some();
            }
            for (p, &part) in parts.iter().enumerate() {
                if is_inside[part as usize] {
                    safe[p] = solver.particles.previous[p];
                }
            }
        }
        safe
    }

    /// Takes back the part of gravity that the last substep did not show. A particle that has joined since then goes by
    /// those around it.
    fn start_where_gravity_led(&mut self, gravity: R::Vector, is_held: &[bool]) {
        let change = gravity * self.time;
        let squared = R::dot(change, change);
        let count = self.solver.particle_count();
        let known = match self.stars.earlier.len() {
            known if known <= count => known,
            _ => 0,
        };
        // What nothing holds or touches falls, even if too few sweeps have shown little of it.
        let mut rests = is_held.to_vec();
        for (p, &part) in self.stars.parts.iter().enumerate() {
            let rests = &mut rests[part as usize];
            *rests |= self
                .solver
                .constraints
                .colliders
                .touches(self.solver.particles.previous[p]);
        }
        self.stars.earlier.resize(count, R::Vector::default());
        let mut taken_back = vec![R::ZERO; count];
        for (p, taken_back) in taken_back.iter_mut().enumerate() {
            let velocity = self.solver.particles.velocities[p] - change;
            let followed = R::dot(velocity - self.stars.earlier[p], change) / squared;
            self.stars.earlier[p] = velocity;
            let rests = rests[self.stars.parts[p] as usize]
                && weight::<R>(&self.solver.particles.cells[p]) > R::ZERO;
            if p < known && followed < R::ONE && rests {
                *taken_back = R::ONE
                    - if followed > R::ZERO {
                        followed
                    } else {
                        R::ZERO
                    };
            }
        }
        if 0 < known && known < count {
            for (row, &p) in self.stars.data.order.iter().enumerate() {
                let around = self.stars.data.of(row).iter().flat_map(|term| term.others);
                let around = around.filter(|&q| (q as usize) < known);
                if (p as usize) < known
                    || weight::<R>(&self.solver.particles.cells[p as usize]) <= R::ZERO
                {
                    continue;
                }
                let (mut sum, mut neighbors) = (R::ZERO, R::ZERO);
                for q in around {
                    sum += taken_back[q as usize];
                    neighbors += R::ONE;
                }
                if neighbors > R::ZERO {
                    taken_back[p as usize] = sum / neighbors;
                }
            }
        }
        for (particle, &part) in self.solver.particles.cells.iter().zip(&taken_back) {
            let x = load::<R>(particle) - change * (part * self.time);
            if part > R::ZERO && finite::<R>(x) {
                store::<R>(particle, x);
            }
        }
    }

    /// Takes parts of the body that are held back toward where they were while the potential falls, if the energy of
    /// their motion is below the error that is allowed: a motion that small is mostly what the last substep left over.
    ///
    /// Parts that nothing holds keep their velocity: a crumb that falls beside a strained body has little energy too.
    ///
    /// Returns whether it helped.
    fn start_at_lowest_potential(&self, accuracy: f64, is_held: &[bool]) -> bool {
        let solver = &*self.solver;
        let parts = &*self.stars.parts;
        // What moves, from where and by how much.
        let (mut moving, mut kinetic) = (Vec::new(), 0.0);
        for (p, particle) in solver.particles.cells.iter().enumerate() {
            if is_held[parts[p] as usize] && weight::<R>(particle) > R::ZERO {
                let velocity = R::to_dvec3(solver.particles.velocities[p]);
                kinetic += 0.5 * solver.mass(p) * velocity.length_squared();
                let from = solver.particles.previous[p];
                moving.push((p, from, load::<R>(particle) - from));
            }
        }
        let at = |part: f64| {
            for &(p, from, way) in &moving {
                store::<R>(&solver.particles.cells[p], from + way * R::from_f64(part));
            }
        };
        if moving.is_empty() {
            return false;
        }
        let whole = self.potentials().total;
        at(0.5);
        let half = self.potentials().total;
        if half >= whole || !half.is_finite() {
            at(1.0);
            return false;
        }
        at(0.0);
        let none = self.potentials();
        let allowed = accuracy * accuracy * none.elastic;
        if kinetic > allowed || !allowed.is_finite() {
            at(1.0);
            return false;
        }
        at(lowest_of_parabola(none.total, half, whole));
        true
    }
}

/// The lowest point in 0 .. 1 of the parabola with the values `none` at 0, `half` at 1/2 and `whole` at 1; 0 if it has
/// none.
fn lowest_of_parabola(none: f64, half: f64, whole: f64) -> f64 {
    let curvature = 4.0 * (none - 2.0 * half + whole);
    let slope = 4.0 * half - 3.0 * none - whole;
    if curvature > 0.0 && curvature.is_finite() && slope.is_finite() {
        (-slope / curvature).clamp(0.0, 1.0)
    } else {
        0.0
    }
}

/// The rigid motion of a part that has its momentum and, to first order in the angle, its angular momentum.
#[derive(Clone, Copy, Debug)]
struct RigidMotion {
    mass: f64,
    /// First the sum of `m x`, then the center.
    center: DVec3,
    /// First the sum of `m d`, then the mean.
    way: DVec3,
    inertia: DMat3,
    momentum: DVec3,
    rotation: DQuat,
}

impl RigidMotion {
    const NONE: Self = Self {
        mass: 0.0,
        center: DVec3::ZERO,
        way: DVec3::ZERO,
        inertia: DMat3::ZERO,
        momentum: DVec3::ZERO,
        rotation: DQuat::IDENTITY,
    };

    fn add_mass(&mut self, mass: f64, x: DVec3, way: DVec3) {
        self.mass += mass;
        self.center += x * mass;
        self.way += way * mass;
    }

    fn center(&mut self) {
        if self.mass > 0.0 {
            self.center /= self.mass;
            self.way /= self.mass;
        }
    }

    fn add_inertia(&mut self, mass: f64, x: DVec3, way: DVec3) {
        let arm = x - self.center;
        self.momentum += arm.cross(way - self.way) * mass;
        let squared = arm.length_squared();
        let outer = DMat3::from_cols(arm * arm.x, arm * arm.y, arm * arm.z);
        self.inertia += (DMat3::from_diagonal(DVec3::splat(squared)) - outer) * mass;
    }

    fn turn(&mut self) {
        let [x, y, z] = self.inertia.to_cols_array_2d();
        // A part that lies on a line has no inertia about it.
        let floor = SINGULAR * (x[0] + y[1] + z[2]);
        let inertia = self.inertia + DMat3::from_diagonal(DVec3::splat(floor));
        let angle = inertia.inverse() * self.momentum;
        self.rotation = if angle.is_finite() {
            DQuat::from_scaled_axis(angle)
        } else {
            DQuat::IDENTITY
        };
    }

    fn apply(&self, x: DVec3) -> DVec3 {
        self.center + self.way + self.rotation * (x - self.center)
    }
}

/// An inertia that is smaller, as a part of the sum of the three, is rounding.
const SINGULAR: f64 = 1e-12;
