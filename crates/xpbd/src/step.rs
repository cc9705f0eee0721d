//! [`Solver::step`]: one frame of XPBD by colored Gauss-Seidel.
//!
//! Each substep moves the particles as if they were free, corrects them constraint by constraint in the order of the
//! schedule, and adds to the velocities what the corrections moved. Clusters of one color share no particle and run in
//! parallel; a color too small to be worth a second thread stays on one. Who computes never changes what is computed:
//! the result is the same to the bit for any number of threads, which is that of the rayon pool this is called in.
//!
//! Source: Macklin, Müller, Chentanez 2016; substeps after Macklin et al. 2019; paper section 3 and 4.1.
//! Cost: `substeps · iterations` passes over all tets.

use incise_graph::Schedule;
use rayon::prelude::*;

use crate::collider::Obstacle;
use crate::float::{finite, load, store, weight};
use crate::gauss_seidel;
use crate::jacobi::Jacobi;
use crate::layout::{Ingredients, Layout};
use crate::neo_hookean::TetConstraint;
use crate::simd_kernel::Pass;
use crate::{Float, Material, Method, Solver, StepSettings, XpbdError};

/// Particles a thread takes at a time.
pub(crate) const PARALLEL_PARTICLES: usize = 4096;

/// What a step has to say about itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepReport {
    /// Particles that would have become infinite or NaN and were put back where they were instead, counted once for
    /// each substep. Anything but 0 means the step is not to be trusted: use more substeps.
    pub repaired: usize,
    /// Particles that were moved by a millionth of a tet's size because all tets lay on one line to the last digit, from
    /// where no constraint could have brought them back.
    pub unfolded: usize,
}

/// What the time of a substep and the settings are to a constraint.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Factors<R> {
    /// Square of the time of a substep in s².
    pub(crate) time_squared: R,
    /// One over the time of a substep in 1/s.
    pub(crate) per_time: R,
    /// Factor on each correction.
    pub(crate) relaxation: R,
}

impl<R: Float> Factors<R> {
    pub(crate) fn new(settings: &StepSettings) -> Self {
        let time = settings.substep_time();
        Self {
            time_squared: R::from_f64(time * time),
            per_time: R::from_f64(1.0 / time),
            relaxation: R::from_f64(settings.relaxation),
        }
    }
}

impl<R: Float> Solver<R> {
    pub(crate) fn frame(
        &mut self,
        schedule: &Schedule,
        settings: &StepSettings,
        keep: bool,
    ) -> Result<StepReport, XpbdError> {
        let _span = tracing::debug_span!("xpbd::step").entered();
        settings.check()?;
        self.update_layout(schedule);
        self.follow_body();
        let mut report = StepReport {
            repaired: 0,
            unfolded: self.unfold(),
        };
        self.predicted.clear();
        self.kept.clear();
        for substep in 0..settings.substeps {
            let keep = keep && substep + 1 == settings.substeps;
            report.repaired += self.substep(settings, substep, keep);
        }
        self.arrive();
        Ok(report)
    }

    fn substep(&mut self, settings: &StepSettings, number: u32, keep: bool) -> usize {
        let time = settings.substep_time();
        let ended = f64::from(number + 1);
        self.predict(settings, R::from_f64(time));
        let lost = self.move_held(ended / f64::from(settings.substeps));
        let mut obstacles = std::mem::take(&mut self.obstacles);
        obstacles.clear();
        obstacles.extend(Obstacle::place(settings, ended * time, self.origin));
        let jacobi = settings.method != Method::GaussSeidel;
        let with_multipliers = keep || settings.iterations > 1;
        self.multipliers.clear();
        if with_multipliers {
            let count = 2 * self.layout.lanes * self.layout.block_count();
            self.multipliers.resize_with(count, || R::ZERO.cell());
        }
        if let Some(distances) = &mut self.distances {
            distances.begin(with_multipliers);
        }
        if let Some(volumes) = &mut self.volume_constraints {
            volumes.begin(with_multipliers);
        }
        if keep {
            self.predicted = (0..self.particles.len()).map(|p| self.vector(p)).collect();
        }
        let mut state = match jacobi {
            true => Some(self.jacobi.take().unwrap_or_default()),
            false => None,
        };
        if let Some(state) = &mut state {
            state.restart();
        }
        let factors = Factors::new(settings);
        for _ in 0..settings.iterations {
            self.iterate(settings, &factors, state.as_mut());
            self.solve_attachments(&factors);
            if let Some(distances) = &self.distances {
                distances.pass(self, &factors);
            }
            if let Some(volumes) = &self.volume_constraints {
                volumes.pass(self, &factors);
            }
            if !obstacles.is_empty() {
                self.project_to_colliders(&obstacles);
            }
        }
        self.jacobi = state;
        self.obstacles = obstacles;
        if keep {
            self.kept = (0..self.tets.len())
                .map(|t| self.multipliers_of(t))
                .collect();
            self.kept_form = settings.tet_solve;
        }
        let repaired = self.update_velocities(R::from_f64(time), factors.per_time);
        self.update_held(factors.per_time);
        if self.is_damped() {
            self.damp(&factors);
        }
        lost + repaired
    }

    /// One iteration over the tets.
    fn iterate(
        &self,
        settings: &StepSettings,
        factors: &Factors<R>,
        mut jacobi: Option<&mut Jacobi<R>>,
    ) {
        if let Some(jacobi) = &mut jacobi {
            let extrapolating = settings.method != Method::Jacobi;
            jacobi.begin(&self.particles, &self.multipliers, extrapolating);
        }
        let pass = Pass {
            layout: &self.layout,
            particles: &self.particles,
            velocities: &[],
            multipliers: &self.multipliers,
            corrections: jacobi.as_ref().map_or(&[], |jacobi| &jacobi.corrections),
            iterated: settings.iterations > 1,
            factors: *factors,
        };
        gauss_seidel::solve(self.level, settings.tet_solve, &pass);
        let Some(jacobi) = jacobi else { return };
        jacobi.apply(&self.particles);
        if let Method::Chebyshev {
            spectral_radius,
            delay,
        } = settings.method
        {
            jacobi.extrapolate(&self.particles, &self.multipliers, spectral_radius, delay);
        }
    }

    /// Puts the tets into the order of a schedule, unless they are.
    pub(crate) fn update_layout(&mut self, schedule: &Schedule) {
        if self.layout.fits(schedule) {
            return;
        }
        let mut layout = std::mem::take(&mut self.layout);
        self.bring_up(&mut layout, schedule);
        self.layout = layout;
    }

    fn bring_up(&self, layout: &mut Layout<R>, schedule: &Schedule) {
        let lanes = gauss_seidel::lanes::<R>(self.level);
        let uniform = self.has_one_set_of_constants();
        layout.follow(schedule, lanes, uniform, |t| self.ingredients(t));
    }

    /// Whether all materials are one to the layout: their densities do not matter to it, nor, but for rounding, their
    /// Young's moduli.
    pub(crate) fn has_one_set_of_constants(&self) -> bool {
        let constants = |material: &Material| {
            let [ratio, gamma] = TetConstraint::<R>::constants(material);
            [ratio, gamma, R::from_f64(material.damping)]
        };
        let mut pairs = self.materials.windows(2);
        pairs.all(|pair| constants(&pair[0]) == constants(&pair[1]))
    }

    /// What the layout needs of a tet.
    pub(crate) fn ingredients(&self, t: u32) -> Ingredients<R> {
        let tet = self.tets.get(t as usize);
        let tet = *tet.expect("the schedule belongs to these tets");
        let material = &self.materials[usize::from(self.material_of[t as usize])];
        Ingredients {
            tet,
            weights: tet
                .particles
                .map(|p| weight::<R>(&self.particles[p as usize])),
            constants: [tet.ratio, tet.gamma, R::from_f64(material.damping)],
        }
    }

    /// Proves that what the next step with this schedule would solve is what schedule, tets and masses say, to the bit.
    /// A step carries over only what has changed since the last one; this finds what was forgotten, above all by
    /// [`Solver::set_mass_in_star`]. O(tets); for tests and on request.
    ///
    /// # Errors
    /// [`XpbdError::Layout`] with the first difference.
    ///
    /// # Panics
    /// If the schedule names a tet that does not exist.
    pub fn check_layout(&self, schedule: &Schedule) -> Result<(), XpbdError> {
        let mut layout = self.layout.clone();
        self.bring_up(&mut layout, schedule);
        layout.check(schedule, |t| self.ingredients(t))
    }

    /// The multipliers of a tet after the last substep; zero if the schedule does not solve it.
    fn multipliers_of(&self, tet: usize) -> [R; 2] {
        let Some((block, lane)) = self.layout.place(tet) else {
            return [R::ZERO; 2];
        };
        let lanes = self.layout.lanes;
        [0, 1].map(|k| R::load(&self.multipliers[(2 * block + k) * lanes + lane]))
    }

    /// Moves every free particle by its velocity.
    pub(crate) fn predict(&mut self, settings: &StepSettings, time: R) {
        let change = settings
            .gravity
            .map(|g| R::from_dvec3(g * settings.substep_time()));
        let particles = self.particles.par_chunks(PARALLEL_PARTICLES);
        particles
            .zip(self.previous.par_chunks_mut(PARALLEL_PARTICLES))
            .zip(self.velocities.par_chunks_mut(PARALLEL_PARTICLES))
            .for_each(|((particles, previous), velocities)| {
                for ((particle, previous), velocity) in
                    particles.iter().zip(previous).zip(velocities)
                {
                    let x = load::<R>(particle);
                    *previous = x;
                    if weight::<R>(particle) > R::ZERO {
                        if let Some(change) = change {
                            *velocity += change;
                        }
                        store::<R>(particle, x + *velocity * time);
                    }
                }
            });
    }

    /// Adds the corrections to the velocities; returns how many particles had to be put back.
    ///
    /// In exact numbers the velocity is the motion over the time. But positions are rounded, and a velocity taken from
    /// them would be wrong by their last digit over the time: in single precision a body in free fall would lose a
    /// hundredth of its speed, and far from the origin it would hang in the air. The prediction, computed again to the
    /// same bits, tells what part of the motion is correction; without correction the velocity stays as it is.
    pub(crate) fn update_velocities(&mut self, time: R, per_time: R) -> usize {
        let particles = self.particles.par_chunks(PARALLEL_PARTICLES);
        particles
            .zip(self.previous.par_chunks(PARALLEL_PARTICLES))
            .zip(self.velocities.par_chunks_mut(PARALLEL_PARTICLES))
            .map(|((particles, previous), velocities)| {
                let mut repaired = 0;
                for ((particle, previous), velocity) in
                    particles.iter().zip(previous).zip(velocities)
                {
                    if weight::<R>(particle) <= R::ZERO {
                        *velocity = R::Vector::default();
                        // Held, it gets no share of any correction, but no share of an infinite one is not a number.
                        if !finite::<R>(load::<R>(particle)) {
                            store::<R>(particle, *previous);
                            repaired += 1;
                        }
                        continue;
                    }
                    let predicted = *previous + *velocity * time;
                    let speed = *velocity + (load::<R>(particle) - predicted) * per_time;
                    let finite = finite::<R>(speed);
                    *velocity = if finite { speed } else { R::Vector::default() };
                    if !finite {
                        store::<R>(particle, *previous);
                        repaired += 1;
                    }
                }
                repaired
            })
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use crate::{Material, Solver};

    /// A second material that the kernel cannot tell from the first takes no room in the layout.
    #[test]
    fn materials_are_told_apart_by_what_the_kernel_needs() {
        let rubber = Material {
            young_modulus: 1e4,
            poisson_ratio: 0.45,
            density: 1e3,
            damping: 0.0,
        };
        let with = |second: Material| {
            let mut solver = Solver::<f32>::new(&[DVec3::ZERO]);
            solver.add_material(rubber).unwrap();
            solver.add_material(second).unwrap();
            solver.has_one_set_of_constants()
        };
        assert!(with(rubber));
        assert!(with(Material {
            young_modulus: 2e4,
            density: 2e3,
            ..rubber
        }));
        assert!(!with(Material {
            poisson_ratio: 0.4,
            ..rubber
        }));
        assert!(!with(Material {
            damping: 0.1,
            ..rubber
        }));
    }
}
