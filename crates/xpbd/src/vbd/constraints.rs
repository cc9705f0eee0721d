//! [`ConstraintTerms`]: distances, volumes and soft attachments as energies of the incremental potential.
//!
//! A constraint C of compliance α has the energy `C² / 2α`; one that is one-sided has it for `C > 0` only. With a
//! damping time τ the step dissipates `τ / (2α Δt) (C - Cₙ)²`, with `Cₙ` at the start of the substep. Both together are
//! one quadratic `K/2 (C - s)²` with `K = (1 + τ/Δt) / α` and `s = Cₙ τ / (τ + Δt)`. A one-sided constraint takes the
//! positive part of `Cₙ`, so it never pushes.
//!
//! A constraint that is hard (α = 0) or stiffer than a penalty k is solved by the method of multipliers: the energy is
//! `(C - s + λ/k)² / 2 (α + 1/k)`, and after every iteration of the substep the multiplier becomes
//! `λ = (C - s + λ/k) / (α + 1/k)`. What converges is C, to `s - α λ`; one round divides what is left by about one plus
//! k over the stiffness that the bodies oppose to it. The penalty is a multiple of the stiffness and inertia of the
//! constraint's particles, so a sweep does not stall on it. Multipliers start from 0 in each substep: carried over,
//! they let slow vibrations of long chains grow.
//!
//! Along one particle volumes and attachments are quadratic. A distance is not: a particle takes three Newton steps
//! with the geometric term clamped at 0; if they raise the energy of its star, it takes one step with a quadratic that
//! bounds the energy from above (`K |x|² / 2` in place of the distance, since the length is convex). The energy of a
//! distance under tension has a kink where its particles coincide; there a particle moves only if the other forces
//! exceed the tension. So no sweep raises the potential.
//!
//! Source: method of multipliers after Hestenes 1969 and Powell 1969; in VBD after Giles, Diaz, Yuksel 2025 (without
//! their ramps). Cost: 60 operations a distance and particle and Newton step, 150 a volume, 10 an attachment.

use glam::DVec3;
use incise_graph::Incidence;

use super::block::{Block, add_isotropic, add_outer, solve};
use super::corner_term::{OTHERS, rows};
use crate::constraints::Distance;
use crate::constraints::ScalarConstraint;
use crate::constraints::TetVolume;
use crate::direction::direction;
use crate::float::{load, weight};
use crate::{Float, Solver};

/// Newton steps of a particle with a distance.
const NEWTON_STEPS: usize = 3;

/// Penalty of a hard constraint in units of the stiffness and inertia of its particles, where only sweeps are made.
pub(super) const SWEEP_PENALTY: f64 = 10.0;

/// Penalty of a hard constraint where corrections are made, which do not stall on large ones.
pub(super) const CORRECTION_PENALTY: f64 = 100.0;

/// No anchor.
const NONE: u32 = u32::MAX;

/// All constraints but the tets, by the particles of the stars. Lists are empty where nothing is declared.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(super) struct ConstraintTerms<R: Float> {
    /// Where the terms of each particle of the order end, a 0 before the first.
    offsets: Vec<usize>,
    terms: Vec<Term>,
    /// Particle -> its position in the order.
    pub(super) row_of: Vec<u32>,
    /// The stiffness in N/m of the tets around each particle.
    elastic: Vec<f64>,
    distance_count: usize,
    volume_count: usize,
    /// Whether each constraint is named by its schedule: after a cut, those of tets that are gone are not.
    scheduled: Vec<bool>,
    /// The constraints in the present substep, distances before volumes.
    springs: Vec<Spring<R>>,
    anchors: Vec<Anchor<R>>,
    /// The anchor of each particle; empty without anchors.
    anchor_of: Vec<u32>,
}

/// A constraint on a particle.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Term {
    /// Its number, volumes after distances.
    constraint: u32,
    corner: u32,
    /// Its other particles; that of a distance three times.
    others: [u32; 3],
}

/// `K/2 (C - s + λ/k)²`.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Spring<R> {
    /// K; 0 takes no part.
    stiffness: R,
    /// s.
    target: R,
    /// 1/k; 0 without a multiplier.
    per_penalty: R,
    /// λ.
    multiplier: R,
    one_sided: bool,
}

/// `K/2 |x - y|²`.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
struct Anchor<R: Float> {
    particle: u32,
    stiffness: R,
    /// y.
    position: R::Vector,
}

/// A distance seen from one of its particles.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
struct Stretch<R: Float> {
    /// The value that [`Spring::excess`] returns.
    excess: R,
    /// The gradient of the length.
    along: R::Vector,
    /// The geometric term over K, `(r - r₀) / r` with the length r and r₀ where it exerts no force; at least 0.
    geometric: R,
}

/// Force and matrix of one particle: `isotropic I + h` with h as xx, xy, xz, yy, yz, zz.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(super) struct Local<R: Float> {
    pub(super) isotropic: R,
    pub(super) h: [R; 6],
    pub(super) force: R::Vector,
}

/// What stands for the second derivative of a distance.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
enum Curvature {
    /// The derivative itself, its geometric term clamped at 0.
    Newton,
    /// A bound for every position.
    Bound,
}

impl<R: Float> Default for ConstraintTerms<R> {
    fn default() -> Self {
        Self {
            offsets: Vec::new(),
            terms: Vec::new(),
            row_of: Vec::new(),
            elastic: Vec::new(),
            distance_count: 0,
            volume_count: 0,
            scheduled: Vec::new(),
            springs: Vec::new(),
            anchors: Vec::new(),
            anchor_of: Vec::new(),
        }
    }
}

impl<R: Float> Spring<R> {
    /// `C - s + λ/k`, at least 0 if one-sided.
    #[inline]
    fn excess(&self, value: R) -> R {
        let excess = value - self.target + self.multiplier * self.per_penalty;
        if self.one_sided && excess < R::ZERO {
            R::ZERO
        } else {
            excess
        }
    }

    fn to_f64(self) -> Spring<f64> {
        Spring {
            stiffness: self.stiffness.to_f64(),
            target: self.target.to_f64(),
            per_penalty: self.per_penalty.to_f64(),
            multiplier: self.multiplier.to_f64(),
            one_sided: self.one_sided,
        }
    }
}

impl<R: Float> Local<R> {
    #[inline]
    fn solve(&self) -> R::Vector {
        solve(self.isotropic, self.h, self.force)
    }

    /// The minimum along the force of the quadratic plus `tension · |step|`: 0 if the force does not exceed the
    /// tension.
    fn solve_against(&self, tension: R) -> R::Vector {
        let size = R::dot(self.force, self.force).sqrt();
        if size > tension {
            let along = self.force * (R::ONE / size);
            along * ((size - tension) / R::dot(along, self.apply(along)))
        } else {
            R::Vector::default()
        }
    }

    /// Adds `factor · u uᵀ`.
    #[inline]
    fn add_outer(&mut self, u: R::Vector, factor: R) {
        let [x, y, z] = R::components(u);
        let [a, b, c] = [x, y, z].map(|v| v * factor);
        let entries = [a * x, a * y, a * z, b * y, b * z, c * z];
        for (entry, value) in self.h.iter_mut().zip(entries) {
            *entry += value;
        }
    }

    /// `(isotropic I + h) v`.
    #[inline]
    fn apply(&self, v: R::Vector) -> R::Vector {
        let [x, y, z] = R::components(v);
        let [xx, xy, xz, yy, yz, zz] = self.h;
        R::vector(
            xx * x + xy * y + xz * z,
            xy * x + yy * y + yz * z,
            xz * x + yz * y + zz * z,
        ) + v * self.isotropic
    }
}

impl<R: Float> ConstraintTerms<R> {
    /// Bytes of all lists.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&*self.offsets)
            + size_of_val(&*self.terms)
            + size_of_val(&*self.row_of)
            + size_of_val(&*self.elastic)
            + size_of_val(&*self.scheduled)
            + size_of_val(&*self.springs)
            + size_of_val(&*self.anchors)
            + size_of_val(&*self.anchor_of)
    }

    /// Forgets all constraints and anchors.
    pub(super) fn forget(&mut self) {
        self.offsets.clear();
        self.terms.clear();
        self.row_of.clear();
        self.elastic.clear();
        self.scheduled.clear();
        self.springs.clear();
        self.anchors.clear();
        self.anchor_of.clear();
        (self.distance_count, self.volume_count) = (0, 0);
    }

    /// Sorts the constraints of a solver by the particles of an order. O(constraints + particles), O(1) without any.
    pub(super) fn rebuild(&mut self, solver: &Solver<R>, order: &[u32], incidence: &Incidence) {
        self.forget();
        self.distance_count = solver.distance_count();
        self.volume_count = solver.volume_count();
        if self.distance_count + self.volume_count == 0 {
            return;
        }
        self.offsets.push(0);
        self.scheduled
            .resize(self.distance_count + self.volume_count, false);
        self.row_of.resize(order.len(), 0);
        for (row, &p) in (0u32..).zip(order) {
            self.row_of[p as usize] = row;
            let list = incidence.particles_of(p as usize);
            let tets = list.partition_point(|&c| (c as usize) < solver.tet_count());
            for &element in &list[tets..] {
                let constraint = element as usize - solver.tet_count();
                self.scheduled[constraint] = true;
                let corners = self.particles(solver, constraint);
                let corner = (0u32..).zip(corners).find(|&(_, q)| q == p);
                if let (Some((corner, _)), Ok(constraint)) = (corner, u32::try_from(constraint)) {
                    self.terms.push(Term {
                        constraint,
                        corner,
                        others: OTHERS[corner as usize].map(|k| corners[k]),
                    });
                }
            }
            self.offsets.push(self.terms.len());
        }
        self.elastic.resize(order.len(), 0.0);
        for tet in &solver.tets.list {
            let tet = tet.to_f64();
            for (p, q) in tet.particles.into_iter().zip(rows(&tet)) {
                self.elastic[p as usize] +=
                    tet.stiffness * (1.0 + tet.ratio / 3.0) * q.length_squared();
            }
        }
    }

    /// Whether these are the terms of as many constraints.
    pub(super) fn fits(&self, solver: &Solver<R>) -> bool {
        (self.distance_count, self.volume_count) == (solver.distance_count(), solver.volume_count())
    }

    /// Whether no particle has a term: neither distances, volumes nor soft attachments.
    #[inline]
    pub(super) fn is_empty(&self) -> bool {
        self.springs.is_empty() && self.anchors.is_empty()
    }

    /// The particles that share a distance or volume with the particle at a position of the order, with repetitions.
    pub(super) fn neighbors(&self, row: usize) -> impl Iterator<Item = u32> + '_ {
        self.terms(row).iter().flat_map(|term| term.others)
    }

    /// The particles of a constraint; those of a distance twice.
    fn particles(&self, solver: &Solver<R>, constraint: usize) -> [u32; 4] {
        match constraint.checked_sub(self.distance_count) {
            None => {
                let [a, b] = distance(solver, constraint).particles();
                [a, b, a, b]
            }
            Some(volume) => volume_of(solver, volume).particles(),
        }
    }

    #[inline]
    fn terms(&self, row: usize) -> &[Term] {
        if self.offsets.is_empty() {
            return &[];
        }
        &self.terms[self.offsets[row]..self.offsets[row + 1]]
    }

    /// Begins a substep: stiffness and target of each constraint, multipliers of 0.
    pub(super) fn begin(&mut self, solver: &Solver<R>, time: f64, penalty: f64) {
        self.springs.clear();
        for index in 0..self.distance_count {
            let distance = distance(solver, index).to_f64();
            let [a, b] = distance
                .particles()
                .map(|p| R::to_dvec3(solver.particles.previous[p as usize]));
            let spring = self.spring(&distance, a.distance(b) - distance.length(), 1.0, {
                (solver, time, penalty)
            });
            self.springs.push(spring);
        }
        for index in 0..self.volume_count {
            let volume = volume_of(solver, index).to_f64();
            let x = volume
                .particles()
                .map(|p| R::to_dvec3(solver.particles.previous[p as usize]));
            let spring = match volume.evaluate(x) {
                Some((value, _)) => self.spring(
                    &volume,
                    value,
                    volume.slope_squared(),
                    (solver, time, penalty),
                ),
                _ => Spring {
                    stiffness: R::ZERO,
                    target: R::ZERO,
                    per_penalty: R::ZERO,
                    multiplier: R::ZERO,
                    one_sided: false,
                },
            };
            self.springs.push(spring);
        }
        self.anchors.clear();
        self.anchor_of.clear();
        if !solver.constraints.attachments.is_soft() {
            return;
        }
        self.anchor_of.resize(solver.particle_count(), NONE);
        for attachment in solver.constraints.attachments.soft() {
            let p = attachment.particle as usize;
            let rate = attachment.damping / time;
            let lag = R::to_dvec3(solver.particles.previous[p] - attachment.before);
            let target = R::to_dvec3(attachment.target) + lag * (rate / (1.0 + rate));
            let stiffness = R::from_f64((1.0 + rate) / attachment.compliance);
            let position = R::from_dvec3(target);
            // Beyond what numbers can hold it is as good as rigid.
            let most = R::from_f64(
                (solver.mass(p) / (time * time)).max(f64::MIN_POSITIVE) / R::EPSILON.to_f64(),
            );
            self.anchor_of[p] = u32::try_from(self.anchors.len()).unwrap_or(NONE);
            self.anchors.push(Anchor {
                particle: attachment.particle,
                stiffness: if stiffness.is_finite() {
                    stiffness
                } else {
                    most
                },
                position,
            });
        }
    }

    /// What a constraint is in a substep: `value` at its start, `slope_squared` the square of a gradient at one
    /// particle.
    fn spring<const K: usize>(
        &self,
        constraint: &impl ScalarConstraint<f64, K>,
        value: f64,
        slope_squared: f64,
        (solver, time, penalty): (&Solver<R>, f64, f64),
    ) -> Spring<R> {
        let rate = constraint.damping() / time;
        let one_sided = constraint.one_sided();
        let start = if one_sided { value.max(0.0) } else { value };
        let target = if rate > 0.0 {
            start * (rate / (1.0 + rate))
        } else {
            0.0
        };
        let compliance = constraint.compliance() / (1.0 + rate);
        let free = constraint.particles().into_iter().map(|p| p as usize);
        let yielding: f64 = free
            .filter(|&p| weight::<R>(&solver.particles.cells[p]) > R::ZERO)
            .map(|p| slope_squared / (solver.mass(p) / (time * time) + self.elastic[p]))
            .sum();
        let per_penalty = yielding / penalty;
        let (stiffness, per_penalty) = if compliance >= per_penalty {
            (1.0 / compliance, 0.0)
        } else {
            (1.0 / (compliance + per_penalty), per_penalty)
        };
        let [stiffness, target, per_penalty] = [stiffness, target, per_penalty].map(R::from_f64);
        let sound = stiffness.is_finite() && target.is_finite() && per_penalty.is_finite();
        Spring {
            stiffness: if sound { stiffness } else { R::ZERO },
            target: if sound { target } else { R::ZERO },
            per_penalty: if sound { per_penalty } else { R::ZERO },
            multiplier: R::ZERO,
            one_sided,
        }
    }

    /// Brings the multipliers of hard constraints to the forces that the constraints exert now.
    pub(super) fn update_multipliers(&mut self, solver: &Solver<R>) {
        for index in 0..self.springs.len() {
            let spring = self.springs[index];
            if spring.per_penalty > R::ZERO && spring.stiffness > R::ZERO {
                let value = self.value(solver, index, &|p| solver.particles.local(p as usize));
                let multiplier = spring.stiffness * spring.excess(R::from_f64(value));
                if multiplier.is_finite() {
                    self.springs[index].multiplier = multiplier;
                }
            }
        }
    }

    /// The value of a constraint in double precision.
    fn value(&self, solver: &Solver<R>, index: usize, position: &impl Fn(u32) -> DVec3) -> f64 {
        match index.checked_sub(self.distance_count) {
            None => {
                let distance = distance(solver, index).to_f64();
                let [a, b] = distance.particles().map(position);
                a.distance(b) - distance.length()
            }
            Some(volume) => {
                let volume = volume_of(solver, volume).to_f64();
                let x = volume.particles().map(position);
                volume.evaluate(x).map_or(0.0, |(value, _)| value)
            }
        }
    }

    /// The energy of all constraints in J, with that of the multipliers.
    pub(super) fn energy(&self, solver: &Solver<R>, position: &impl Fn(u32) -> DVec3) -> f64 {
        self.energies(solver, position)
            .map(|(_, energy)| energy)
            .sum()
    }

    /// A particle of each constraint and the constraint's energy in J.
    pub(super) fn energies(
        &self,
        solver: &Solver<R>,
        position: &impl Fn(u32) -> DVec3,
    ) -> impl Iterator<Item = (u32, f64)> {
        let springs = self.springs.iter().enumerate().map(move |(index, spring)| {
            let spring = spring.to_f64();
            let excess = spring.excess(self.value(solver, index, position));
            let held = spring.multiplier * spring.multiplier * spring.per_penalty;
            let particle = self.particles(solver, index)[0];
            (particle, 0.5 * (spring.stiffness * excess * excess - held))
        });
        let anchors = self.anchors.iter().map(move |anchor| {
            let away = position(anchor.particle) - R::to_dvec3(anchor.position);
            let energy = 0.5 * anchor.stiffness.to_f64() * away.length_squared();
            (anchor.particle, energy)
        });
        springs.chain(anchors)
    }

    /// Adds the forces of all constraints in N.
    pub(super) fn add_forces(
        &self,
        solver: &Solver<R>,
        position: &impl Fn(u32) -> DVec3,
        out: &mut [DVec3],
    ) {
        for (index, spring) in self.springs.iter().enumerate() {
            let spring = spring.to_f64();
            match index.checked_sub(self.distance_count) {
                None => spring.pull(&distance(solver, index).to_f64(), position, out),
                Some(volume) => spring.pull(&volume_of(solver, volume).to_f64(), position, out),
            }
        }
        for (particle, force) in self.anchor_forces(position) {
            out[particle as usize] += force;
        }
    }

    /// The particles on springs of handles and the forces of these in N.
    pub(super) fn anchor_forces(
        &self,
        position: &impl Fn(u32) -> DVec3,
    ) -> impl Iterator<Item = (u32, DVec3)> {
        self.anchors.iter().map(move |anchor| {
            let away = R::to_dvec3(anchor.position) - position(anchor.particle);
            (anchor.particle, away * anchor.stiffness.to_f64())
        })
    }

    /// The step of the particle at a position of the order, now at `x`, that lowers the energy of its star. `tets` is what
    /// inertia and tets say at `x`. Also force and matrix at `x`.
    pub(super) fn minimize(
        &self,
        solver: &Solver<R>,
        order: &[u32],
        row: usize,
        tets: &Local<R>,
        relaxation: R,
    ) -> (R::Vector, Local<R>) {
        let p = order[row] as usize;
        let x = load::<R>(&solver.particles.cells[p]);
        let mut start = *tets;
        let curved = self.add(solver, row, p, x, Curvature::Newton, &mut start);
        let mut step = start.solve();
        if !curved {
            return (step * relaxation, start);
        }
        for _ in 1..NEWTON_STEPS {
            let mut local = *tets;
            local.force = tets.force - tets.apply(step);
            self.add(solver, row, p, x + step, Curvature::Newton, &mut local);
            step += local.solve();
        }
        let before = self.energy_of(solver, row, x);
        let falls = |step: R::Vector| {
            let after = self.energy_of(solver, row, x + step);
            let tets = R::dot(step, tets.apply(step) * R::from_f64(0.5) - tets.force);
            after - before + tets.to_f64() <= R::EPSILON.to_f64() * (before + after)
        };
        for step in [step * relaxation, step] {
            if falls(step) {
                return (step, start);
            }
        }
        let mut bound = *tets;
        self.add(solver, row, p, x, Curvature::Bound, &mut bound);
        let tension = self.tension_at_zero_length(solver, row, x);
        let step = if tension > R::ZERO {
            bound.solve_against(tension)
        } else {
            bound.solve()
        };
        (step * relaxation, start)
    }

    /// The tension of those distances of the particle at a position of the order, now at `x`, whose particles coincide. It
    /// resists a step in any direction.
    fn tension_at_zero_length(&self, solver: &Solver<R>, row: usize, x: R::Vector) -> R {
        let mut sum = R::ZERO;
        for term in self.terms(row) {
            let index = term.constraint as usize;
            if index >= self.distance_count {
                continue;
            }
            let spring = &self.springs[index];
            let tension = spring.stiffness * spring.excess(-distance(solver, index).length());
            let own = term.corner as usize;
            if tension > R::ZERO && self.stretch(solver, index, own, x).is_none() {
                sum += tension;
            }
        }
        sum
    }

    /// A distance whose particle `own` is at `x`; `None` where its particles coincide, for it has no direction there.
    #[inline]
    fn stretch(
        &self,
        solver: &Solver<R>,
        index: usize,
        own: usize,
        x: R::Vector,
    ) -> Option<Stretch<R>> {
        let distance = distance(solver, index);
        let [a, b] = corners(solver, distance, own, x);
        let (length, along) = direction::<R>(a - b)?;
        let excess = self.springs[index].excess(length - distance.length());
        let geometric = excess / length;
        geometric.is_finite().then_some(Stretch {
            excess,
            along: if own == 0 { along } else { -along },
            geometric: if geometric > R::ZERO {
                geometric
            } else {
                R::ZERO
            },
        })
    }

    /// Adds force and matrix of the constraints of a particle that is at `x`; returns whether one is no quadratic.
    fn add(
        &self,
        solver: &Solver<R>,
        row: usize,
        p: usize,
        x: R::Vector,
        curvature: Curvature,
        local: &mut Local<R>,
    ) -> bool {
        let mut curved = false;
        for term in self.terms(row) {
            let index = term.constraint as usize;
            let spring = &self.springs[index];
            let own = term.corner as usize;
            match index.checked_sub(self.distance_count) {
                None => {
                    curved = true;
                    let bound = curvature == Curvature::Bound;
                    match self.stretch(solver, index, own, x) {
                        Some(stretch) => {
                            let Stretch {
                                excess,
                                along,
                                geometric: part,
                            } = stretch;
                            local.force += along * -(spring.stiffness * excess);
                            if bound {
                                let part = if part > R::ONE { part } else { R::ONE };
                                local.isotropic += spring.stiffness * part;
                            } else if excess != R::ZERO || !spring.one_sided {
                                let outer = if part < R::ONE {
                                    R::ONE - part
                                } else {
                                    R::ZERO
                                };
                                local.isotropic += spring.stiffness * part;
                                local.add_outer(along, spring.stiffness * outer);
                            }
                        }
                        None if bound => local.isotropic += spring.stiffness,
                        None => {}
                    }
                }
                Some(volume) => {
                    let volume = volume_of(solver, volume);
                    if let Some((value, gradients)) =
                        volume.evaluate(corners(solver, volume, own, x))
                    {
                        let gradient = gradients[own];
                        local.force += gradient * -(spring.stiffness * spring.excess(value));
                        local.add_outer(gradient, spring.stiffness);
                    }
                }
            }
        }
        if let Some(anchor) = self.anchor(p) {
            local.force += (anchor.position - x) * anchor.stiffness;
            local.isotropic += anchor.stiffness;
        }
        curved
    }

    #[inline]
    fn anchor(&self, p: usize) -> Option<&Anchor<R>> {
        let anchor = *self.anchor_of.get(p)?;
        self.anchors.get(anchor as usize)
    }

    /// The energy of the distances, volumes and the anchor of a particle that is at `x`.
    fn energy_of(&self, solver: &Solver<R>, row: usize, x: R::Vector) -> f64 {
        let mut sum = 0.0;
        let mut own = NONE;
        for term in self.terms(row) {
            let index = term.constraint as usize;
            own = self.particles(solver, index)[term.corner as usize];
            let position = |p: u32| {
                if p == own {
                    R::to_dvec3(x)
                } else {
                    solver.particles.local(p as usize)
                }
            };
            let spring = self.springs[index].to_f64();
            let excess = spring.excess(self.value(solver, index, &position));
            sum += 0.5 * spring.stiffness * excess * excess;
        }
        if let Some(anchor) = self.anchor(own as usize) {
            let away = R::to_dvec3(x - anchor.position);
            sum += 0.5 * anchor.stiffness.to_f64() * away.length_squared();
        }
        sum
    }

    /// The force of the constraints on the particle at a position of the order.
    pub(super) fn force(&self, solver: &Solver<R>, order: &[u32], row: usize) -> R::Vector {
        let p = order[row] as usize;
        let x = load::<R>(&solver.particles.cells[p]);
        let mut local = Local {
            isotropic: R::ZERO,
            h: [R::ZERO; 6],
            force: R::Vector::default(),
        };
        self.add(solver, row, p, x, Curvature::Newton, &mut local);
        local.force
    }

    /// Adds force and blocks of the constraints of the particle at a position of the order; `columns` are those of its
    /// row, the diagonal first.
    pub(super) fn add_row(
        &self,
        solver: &Solver<R>,
        order: &[u32],
        row: usize,
        columns: &[u32],
        blocks: &mut [Block<R>],
        force: &mut R::Vector,
    ) {
        let p = order[row] as usize;
        let x = load::<R>(&solver.particles.cells[p]);
        let block_of = |q: u32| match columns[1..].binary_search(&self.row_of[q as usize]) {
            Ok(block) => block + 1,
            // Not beside the diagonal, so on it.
            Err(_) => 0,
        };
        for term in self.terms(row) {
            let index = term.constraint as usize;
            let spring = &self.springs[index];
            let own = term.corner as usize;
            match index.checked_sub(self.distance_count) {
                None => {
                    let Some(stretch) = self.stretch(solver, index, own, x) else {
                        continue;
                    };
                    let Stretch {
                        excess,
                        along,
                        geometric: part,
                    } = stretch;
                    *force += along * -(spring.stiffness * excess);
                    if excess == R::ZERO && spring.one_sided {
                        continue;
                    }
                    let other = block_of(distance(solver, index).particles()[1 - own]);
                    let outer = along * (spring.stiffness * (R::ONE - part));
                    let isotropic = spring.stiffness * part;
                    add_outer::<R>(&mut blocks[0], outer, along);
                    add_isotropic::<R>(&mut blocks[0], isotropic);
                    add_outer::<R>(&mut blocks[other], -outer, along);
                    add_isotropic::<R>(&mut blocks[other], -isotropic);
                }
                Some(volume) => {
                    let volume = volume_of(solver, volume);
                    let Some((value, gradients)) = volume.evaluate(corners(solver, volume, own, x))
                    else {
                        continue;
                    };
                    let scaled = gradients[own] * spring.stiffness;
                    *force += scaled * -spring.excess(value);
                    for (q, gradient) in volume.particles().into_iter().zip(gradients) {
                        let block = if q as usize == p { 0 } else { block_of(q) };
                        add_outer::<R>(&mut blocks[block], scaled, gradient);
                    }
                }
            }
        }
        if let Some(anchor) = self.anchor(p) {
            *force += (anchor.position - x) * anchor.stiffness;
            add_isotropic::<R>(&mut blocks[0], anchor.stiffness);
        }
    }
}

impl Spring<f64> {
    /// Adds the forces of a constraint at its particles.
    fn pull<const K: usize>(
        &self,
        constraint: &impl ScalarConstraint<f64, K>,
        position: &impl Fn(u32) -> DVec3,
        out: &mut [DVec3],
    ) {
        let particles = constraint.particles();
        let Some((value, gradients)) = constraint.evaluate(particles.map(position)) else {
            return;
        };
        let force = self.stiffness * self.excess(value);
        for (p, gradient) in particles.into_iter().zip(gradients) {
            out[p as usize] -= gradient * force;
        }
    }
}

/// The positions of a constraint's particles, one of them at `x`.
#[inline]
fn corners<R: Float, const K: usize>(
    solver: &Solver<R>,
    constraint: &impl ScalarConstraint<R, K>,
    own: usize,
    x: R::Vector,
) -> [R::Vector; K] {
    let mut positions = constraint
        .particles()
        .map(|p| load::<R>(&solver.particles.cells[p as usize]));
    positions[own] = x;
    positions
}

#[inline]
fn distance<R: Float>(solver: &Solver<R>, index: usize) -> &Distance<R> {
    &solver.constraints.distances.list[index]
}

#[inline]
fn volume_of<R: Float>(solver: &Solver<R>, index: usize) -> &TetVolume<R> {
    &solver.constraints.volumes.list[index]
}
