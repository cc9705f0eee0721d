//! [`Stepper`]: one frame of XPBD by colored Gauss-Seidel, and the memory that it works in.
//!
//! Each substep moves the particles as if they were free, corrects them tet by tet in the order of the schedule and
//! then kind by kind of the other constraints, and adds to the velocities what the corrections moved. Clusters of one
//! color share no particle and run in parallel; a color too small to be worth a second thread stays on one. The result
//! is bit-identical for any number of threads, which is that of the rayon pool this is called in.
//!
//! Source: Macklin, Müller, Chentanez 2016; substeps after Macklin et al. 2019; paper section 3 and 4.1.
//! Cost: `substeps · iterations` passes over all tets.

use std::ops::Range;

use fearless_simd::Level;

use crate::constraints::Constraints;
use crate::damping::Damping;
use crate::forces::ForceMeter;
use crate::gauss_seidel::{self, Sharing};
use crate::jacobi::Jacobi;
use crate::layout::Layout;
use crate::particles::{PARALLEL_PARTICLES, Particles};
use crate::simd_kernel::{Cells, Pass};
use crate::substep::Substep;
use crate::team::{in_pool_if, keep_awake};
use crate::tets::TetSet;
use crate::{Float, Method, StepSettings, TetSolve};

/// Report of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepReport {
    /// Number of particles that would have become Inf or NaN and were put back, counted once for each substep. Above 0
    /// the step cannot be trusted: use more substeps.
    pub repaired: usize,
    /// Number of particles that were moved by a millionth of a tet's size because all tets lay on one exact line, from
    /// which no constraint could move them.
    pub jittered: usize,
}

/// What residuals need of the last substep.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(crate) struct LastSubstep<R: Float> {
    /// Positions before the constraints were solved; empty if they were not kept.
    pub(crate) predicted: Vec<R::Vector>,
    /// The multipliers of each tet after it, and the constraints that they belong to.
    pub(crate) multipliers: Vec<[R; 2]>,
    pub(crate) tet_solve: TetSolve,
}

impl<R: Float> LastSubstep<R> {
    /// Forgets an earlier substep.
    pub(crate) fn clear(&mut self) {
        self.predicted.clear();
        self.multipliers.clear();
    }

    /// Bytes of both lists.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&*self.predicted) + size_of_val(&*self.multipliers)
    }
}

/// What steps through frames.
#[derive(Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(crate) struct Stepper<R: Float> {
    /// The instructions that this processor has.
    #[cfg_attr(feature = "serde", serde(skip, default = "Level::new"))]
    level: Level,
    /// By block, number and lane of the layout, four in a cell; only while a step has more than one iteration or is asked
    /// for its residuals.
    #[cfg_attr(feature = "serde", serde(skip))]
    multipliers: Vec<R::Particle>,
    #[cfg_attr(feature = "serde", serde(skip))]
    jacobi: Option<Jacobi<R>>,
    #[cfg_attr(feature = "serde", serde(skip))]
    sharing: Sharing<R>,
    #[cfg_attr(feature = "serde", serde(skip))]
    damping: Damping<R>,
    pub(crate) last: LastSubstep<R>,
    /// What sums up forces, while they are measured.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub(crate) meter: Option<Box<ForceMeter>>,
}

impl<R: Float> Default for Stepper<R> {
    fn default() -> Self {
        Self {
            level: Level::new(),
            multipliers: Vec::new(),
            jacobi: None,
            sharing: Sharing::default(),
            damping: Damping::default(),
            last: LastSubstep {
                predicted: Vec::new(),
                multipliers: Vec::new(),
                tet_solve: TetSolve::default(),
            },
            meter: None,
        }
    }
}

/// Without working memory, which each step fills again.
impl<R: Float> Clone for Stepper<R> {
    fn clone(&self) -> Self {
        Self {
            last: self.last.clone(),
            ..Self::default()
        }
    }
}

impl<R: Float> Stepper<R> {
    /// The tets in a block of the layout.
    pub(crate) fn lanes(&self) -> usize {
        gauss_seidel::lanes::<R>(self.level)
    }

    /// Advances by some substeps of a frame; returns how many particles had to be put back. The layout of the tets is up
    /// to date.
    pub(crate) fn frame(
        &mut self,
        particles: &mut Particles<R>,
        tets: &TetSet<R>,
        constraints: &mut Constraints<R>,
        settings: &StepSettings,
        part: Range<u32>,
        keep: bool,
    ) -> usize {
        let mut meter = self.meter.take();
        if let Some(meter) = &mut meter {
            if part.start == 0 {
                meter.start(particles, constraints, settings);
            }
            particles.keep_refused();
        }
        self.last.clear();
        let (mut repaired, ends) = (0, part.end == settings.substeps);
        let is_large = particles.len() > PARALLEL_PARTICLES
            || gauss_seidel::has_work_for_several(&tets.layout);
        let shared = self.sharing.pace.is_shared();
        let substeps = || {
            for number in part {
                let keep = keep && number + 1 == settings.substeps;
                let substep = Substep::new(settings, number, keep);
                let meter = meter.as_deref_mut();
                repaired += self.substep(particles, tets, constraints, meter, &substep, keep);
            }
        };
        in_pool_if(is_large, || match shared {
            true => keep_awake(substeps),
            false => substeps(),
        });
        particles.refused.clear();
        self.meter = meter;
        if ends {
            constraints.end_frame();
        }
        repaired
    }

    fn substep(
        &mut self,
        particles: &mut Particles<R>,
        tets: &TetSet<R>,
        constraints: &mut Constraints<R>,
        mut meter: Option<&mut ForceMeter>,
        substep: &Substep<'_, R>,
        keep: bool,
    ) -> usize {
        let settings = substep.settings;
        let time = settings.substep_time();
        let gravity = settings.gravity.map(|g| R::from_dvec3(g * time));
        let shared = self.sharing.pace.is_shared();
        particles.predict(gravity, R::from_f64(time), shared);
        if let Some(meter) = meter.as_deref_mut() {
            meter.begin(particles);
        }
        let lost = constraints.begin(particles, substep);
        self.multipliers.clear();
        if substep.has_multipliers {
            let count = tets.layout.blocks.lanes / 2 * tets.layout.blocks.len();
            let none = || R::particle([R::ZERO; 4]);
            self.multipliers.resize_with(count, none);
        }
        if keep {
            let all = 0..particles.len();
            self.last.predicted.extend(all.map(|p| particles.vector(p)));
        }
        if settings.method == Method::GaussSeidel {
            self.jacobi = None;
        } else {
            self.jacobi.get_or_insert_default().restart();
        }
        for _ in 0..settings.iterations {
            self.iterate(particles, &tets.layout, substep);
            constraints.solve(particles, substep);
        }
        if keep {
            let all = 0..tets.len();
            let multipliers = all.map(|t| multipliers_of(&tets.layout, &self.multipliers, t));
            self.last.multipliers.extend(multipliers);
            self.last.tet_solve = settings.tet_solve;
        }
        if let Some(meter) = meter.as_deref_mut() {
            meter.take_moved(particles, constraints, 1.0 / time);
            meter.take_refused(particles, 1.0 / time);
        }
        let per_time = substep.factors.per_time;
        let repaired = particles.update_velocities(R::from_f64(time), per_time, shared);
        constraints.end(particles, substep);
        if let Some(meter) = meter.as_deref_mut() {
            meter.end(particles, settings.gravity, time);
        }
        if tets.is_damped() {
            self.damping
                .damp(particles, &tets.layout, substep.factors, self.level);
            if let Some(meter) = meter {
                meter.take_refused(particles, 1.0);
            }
        }
        lost + repaired
    }

    /// One iteration over the tets.
    fn iterate(
        &mut self,
        particles: &mut Particles<R>,
        layout: &Layout<R>,
        substep: &Substep<'_, R>,
    ) {
        let Self {
            level,
            multipliers,
            jacobi,
            sharing,
            ..
        } = self;
        let settings = substep.settings;
        if let Some(jacobi) = jacobi {
            let extrapolating = settings.method != Method::Jacobi;
            jacobi.begin(&particles.cells, multipliers, extrapolating);
        }
        let pass = Pass {
            layout,
            corners: &layout.blocks.corners,
            keeps_multipliers: !multipliers.is_empty(),
            corrections: jacobi.as_ref().map_or(&[], |jacobi| &jacobi.corrections),
            refused: &particles.refused,
            iterated: settings.iterations > 1,
            factors: substep.factors,
        };
        let mut cells = Cells {
            moved: &mut particles.cells,
            positions: &mut [],
            multipliers,
        };
        gauss_seidel::solve(*level, settings.tet_solve, &pass, &mut cells, sharing);
        let Some(jacobi) = jacobi else { return };
        jacobi.apply(&particles.cells);
        if let Method::Chebyshev {
            spectral_radius,
            chebyshev_start,
        } = settings.method
        {
            jacobi.extrapolate(
                &particles.cells,
                multipliers,
                spectral_radius,
                chebyshev_start,
            );
        }
    }
}

/// The multipliers of a tet after the last substep; zero if the schedule does not solve it.
fn multipliers_of<R: Float>(layout: &Layout<R>, multipliers: &[R::Particle], tet: usize) -> [R; 2] {
    let Some((block, lane)) = layout.slot(tet) else {
        return [R::ZERO; 2];
    };
    [0, 1].map(|k| {
        let number = (2 * block + k) * layout.blocks.lanes + lane;
        R::read(&multipliers[number / 4])[number % 4]
    })
}
