//! [`Real`]: the precisions of solvers, and the functions that advance them.
//!
//! The large algorithms are called through this trait, so they are compiled once for each precision, with this crate;
//! called directly they would be compiled again in every crate that steps a solver.

use std::ops::Range;

use incise_graph::Schedule;

use crate::team::in_pool_if;
use crate::{
    CoarseCorrection, Float, Solver, StepReport, StepSettings, VbdReport, VbdSettings, VertexStars,
    XpbdError,
};

/// A precision of solvers that can advance: `f32` or `f64`.
pub trait Real: Float {
    /// Advances a solver by some substeps of a frame of XPBD.
    #[doc(hidden)]
    fn step(
        solver: &mut Solver<Self>,
        schedule: &Schedule,
        settings: &StepSettings,
        part: Range<u32>,
        keep_residuals: bool,
    ) -> Result<StepReport, XpbdError>;

    /// Advances a solver by one frame of vertex block descent.
    #[doc(hidden)]
    fn step_vbd(
        solver: &mut Solver<Self>,
        stars: &mut VertexStars<Self>,
        correction: Option<&mut CoarseCorrection<Self>>,
        settings: &VbdSettings,
    ) -> Result<VbdReport, XpbdError>;

    /// Updates the layout of a solver.
    #[doc(hidden)]
    fn lay_out(solver: &mut Solver<Self>, schedule: &Schedule);
}

macro_rules! real {
    ($($scalar:ty),*) => {$(
        impl Real for $scalar {
            #[inline(never)]
            fn step(
                solver: &mut Solver<Self>,
                schedule: &Schedule,
                settings: &StepSettings,
                part: Range<u32>,
                keep_residuals: bool,
            ) -> Result<StepReport, XpbdError> {
                solver.frame(schedule, settings, part, keep_residuals)
            }
            #[inline(never)]
            fn step_vbd(
                solver: &mut Solver<Self>,
                stars: &mut VertexStars<Self>,
                correction: Option<&mut CoarseCorrection<Self>>,
                settings: &VbdSettings,
            ) -> Result<VbdReport, XpbdError> {
                in_pool_if(true, || match correction {
                    None => solver.frame_of_sweeps(stars, settings),
                    Some(correction) => solver.frame_of_corrections(stars, correction, settings),
                })
            }
            #[inline(never)]
            fn lay_out(solver: &mut Solver<Self>, schedule: &Schedule) {
                solver.update_layout(schedule);
            }
        }
    )*};
}

real!(f32, f64);

impl<R: Real> Solver<R> {
    /// Advances by one frame of `settings.time_step`.
    ///
    /// # Errors
    /// If the settings do not pass [`StepSettings::check`]; nothing has moved then.
    ///
    /// # Panics
    /// If the schedule names a tet that does not exist.
    ///
    /// # Determinism
    /// Bit-identical for any number of threads.
    pub fn step(
        &mut self,
        schedule: &Schedule,
        settings: &StepSettings,
    ) -> Result<StepReport, XpbdError> {
        R::step(self, schedule, settings, 0..settings.substeps, false)
    }

    /// Advances by one frame and keeps the data of the last substep for [`Solver::residuals`].
    ///
    /// # Errors
    /// If the settings do not pass [`StepSettings::check`]; nothing has moved then.
    ///
    /// # Panics
    /// If the schedule names a tet that does not exist.
    pub fn step_keeping_residuals(
        &mut self,
        schedule: &Schedule,
        settings: &StepSettings,
    ) -> Result<StepReport, XpbdError> {
        R::step(self, schedule, settings, 0..settings.substeps, true)
    }

    /// Advances by some of the substeps of a frame, numbered from 0, so that contacts can be set again within the frame.
    /// All parts of a frame in their order are, to the bit, that frame, as long as nothing changes in between. With
    /// `keep_residuals` the part that ends the frame keeps what [`Solver::residuals`] needs.
    ///
    /// # Errors
    /// If the settings do not pass [`StepSettings::check`], or the part ends before it begins or beyond the frame;
    /// nothing has moved then.
    ///
    /// # Panics
    /// If the schedule names a tet that does not exist.
    ///
    /// # Example
    /// ```
    /// use glam::DVec3;
    /// use incise_graph::Schedule;
    /// use incise_xpbd::{Solver, StepSettings};
    ///
    /// let mut whole = Solver::<f64>::new(&[DVec3::ZERO]);
    /// whole.set_mass(0, 1.0);
    /// let mut parts = whole.clone();
    /// let gravity = Some(DVec3::NEG_Z * 9.81);
    /// let settings = StepSettings { substeps: 7, gravity, ..StepSettings::new(0.016) };
    /// whole.step(&Schedule::default(), &settings)?;
    /// for part in [0..3, 3..7] {
    ///     parts.step_part(&Schedule::default(), &settings, part, false)?;
    /// }
    /// assert_eq!(whole.position(0), parts.position(0));
    /// # Ok::<(), incise_xpbd::XpbdError>(())
    /// ```
    pub fn step_part(
        &mut self,
        schedule: &Schedule,
        settings: &StepSettings,
        part: Range<u32>,
        keep_residuals: bool,
    ) -> Result<StepReport, XpbdError> {
        R::step(self, schedule, settings, part, keep_residuals)
    }

    /// Updates the layout of the tets for a schedule, as a step does first. To measure the cost of a cut, call this
    /// before the step.
    ///
    /// A schedule that was [updated](Schedule::update) since the last call costs as much as the changes of schedule and
    /// tets, amortized. Another schedule, even an equal one, and new materials cost O(tets).
    ///
    /// # Panics
    /// If the schedule names a tet that does not exist.
    pub fn lay_out(&mut self, schedule: &Schedule) {
        R::lay_out(self, schedule);
    }

    /// Advances by one frame of `settings.step.time_step` by sweeps of vertex block descent. Frames may alternate with
    /// [`Solver::step`].
    ///
    /// Damping, distances, volume constraints and attachments have the meaning of [`Solver::step`]: both methods
    /// converge to one motion with smaller substeps. Hard constraints (compliance 0) have multipliers that each
    /// iteration improves; with few iterations a part of their violation is left.
    ///
    /// # Errors
    /// If the settings do not pass [`VbdSettings::check`]; nothing has moved then.
    ///
    /// # Panics
    /// If the stars have another number of particles, tets or constraints.
    ///
    /// # Determinism
    /// Bit-identical for any number of threads.
    ///
    /// # Example
    /// A tet of steel hangs from a corner. Kappa is 1e4, far beyond the reach of XPBD in one substep.
    /// ```
    /// use glam::DVec3;
    /// use incise_graph::{Clustering, ColorId, Coloring, Schedule};
    /// use incise_xpbd::{VbdSettings, Material, Solver, VertexStars};
    ///
    /// let rest = [DVec3::ZERO, DVec3::Y, DVec3::X, DVec3::NEG_Z];
    /// let steel = Material { young_modulus: 2e11, poisson_ratio: 0.3, density: 7800.0, damping: 0.0 };
    /// let mut solver = Solver::<f64>::new(&rest);
    /// solver.add_material(steel)?;
    /// solver.push_tet([0, 1, 2, 3], rest, 0);
    /// for p in 0..4 {
    ///     solver.set_mass(p, 7800.0 / 24.0);
    /// }
    /// solver.set_fixed(0, true);
    ///
    /// // Four particles of one tet need four colors.
    /// let colors = Coloring::new([0, 1, 2, 3].map(ColorId).to_vec());
    /// let mut stars = VertexStars::new(&solver, &Schedule::new(&Clustering::none(4), &colors))?;
    /// let mut settings = VbdSettings::new(1.0 / 60.0, 20);
    /// settings.step.gravity = Some(DVec3::new(0.0, 0.0, -9.81));
    /// for _ in 0..60 {
    ///     assert_eq!(solver.step_vbd(&mut stars, &settings)?.repaired, 0);
    /// }
    /// assert!((solver.volume().min_ratio - 1.0).abs() < 1e-3);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn step_vbd(
        &mut self,
        stars: &mut VertexStars<R>,
        settings: &VbdSettings,
    ) -> Result<VbdReport, XpbdError> {
        let _span = tracing::debug_span!("xpbd::step_vbd").entered();
        R::step_vbd(self, stars, None, settings)
    }

    /// Advances by one frame of VBD with a coarse correction after each sweep. A substep also ends when the accuracy of
    /// the settings is reached, or when two corrections in a row do not lower the potential; in single precision this
    /// happens soon in a stiff body.
    ///
    /// # Errors
    /// Those of [`Solver::step_vbd`].
    ///
    /// # Panics
    /// If stars or correction have another number of particles or tets.
    ///
    /// # Determinism
    /// Bit-identical for any number of threads.
    ///
    /// # Example
    /// A wedge of steel hangs from a corner and reaches 1e-9 of its first residual in a few rounds.
    /// ```
    /// use glam::DVec3;
    /// use incise_graph::{Clustering, ColorId, Coloring, Schedule};
    /// use incise_xpbd::{CoarseCorrection, CoarseCorrectionSettings, VbdSettings, Material, Solver, VertexStars};
    ///
    /// let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE];
    /// let steel = Material { young_modulus: 2e11, poisson_ratio: 0.3, density: 7800.0, damping: 0.0 };
    /// let mut solver = Solver::<f64>::new(&rest);
    /// solver.add_material(steel)?;
    /// for tet in [[0u32, 1, 2, 3], [1, 4, 2, 3]] {
    ///     solver.push_tet(tet, tet.map(|p| rest[p as usize]), 0);
    /// }
    /// for p in 0..5 {
    ///     solver.set_mass(p, 1000.0);
    /// }
    /// solver.set_fixed(0, true);
    ///
    /// // Particles 0 and 4 share no tet, so they share a color.
    /// let colors = Coloring::new([0, 1, 2, 3, 0].map(ColorId).to_vec());
    /// let mut stars = VertexStars::new(&solver, &Schedule::new(&Clustering::none(5), &colors))?;
    /// let mut correction = CoarseCorrection::new(&stars, CoarseCorrectionSettings::default())?;
    /// let mut settings = VbdSettings::new(1.0 / 60.0, 20);
    /// settings.step.gravity = Some(DVec3::new(0.0, 0.0, -9.81));
    /// settings.tolerance = Some(1e-9);
    /// let report = solver.step_vbd_two_level(&mut stars, &mut correction, &settings)?;
    /// assert!(report.iterations < 10);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn step_vbd_two_level(
        &mut self,
        stars: &mut VertexStars<R>,
        correction: &mut CoarseCorrection<R>,
        settings: &VbdSettings,
    ) -> Result<VbdReport, XpbdError> {
        let _span = tracing::debug_span!("xpbd::step_vbd_two_level").entered();
        R::step_vbd(self, stars, Some(correction), settings)
    }
}
