//! [`Judged`]: chosen substeps and method of an island, and what is known of their accuracy.
//!
//! Settings are judged when they are chosen, and again after cuts: small tets may need more substeps than were chosen, or
//! fewer may fit a time budget. What misses the accuracy wanted is a warning. Cost: O(tets log tets) where substeps are
//! chosen, O(changed tets) after a cut, and O(tets) four times a second of simulated time for what is inverted.

use glam::DVec3;
use incise_mesh::TetMesh;
use incise_xpbd::{ErasedSolver, StepSettings, shortest_substep_of_f32};

use super::Island;
use crate::accuracy::{DEFAULT_ACCURACY, OutsideVolume, largest_kappas};
use crate::island_builder::{demands, is_all_fixed, substeps};
use crate::method::tet_solve;
use crate::scene::{Method, Substeps};
use crate::solver_backend::Measures;
use crate::substeps::{Choice, Shortfall, evaluate};
use crate::text::percent;
use crate::warning::{self, Warning, WarningCode};

/// Chosen settings of an island, and what is known of their accuracy.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Judged {
    /// Choice of substeps, if the scene leaves it open.
    #[cfg_attr(feature = "save", serde(with = "crate::substeps::saved"))]
    pub(crate) choice: Option<Choice>,
    /// The substeps before all cuts.
    pub(crate) first_substeps: u32,
    /// Whether no body of it names a number of substeps.
    pub(crate) leaves_substeps_open: bool,
    /// Whether VBD may be chosen for it.
    pub(crate) leaves_method_open: bool,
    /// Cost and time limit, in a scene with a budget.
    pub(crate) budget: Option<Budget>,
    /// The longest side of the box around its bodies at rest in m.
    pub(crate) size: f64,
    /// Volume that is solved less accurately than the accuracy wanted.
    pub(crate) outside: OutsideVolume,
    /// Whether the last frame of VBD missed the accuracy wanted.
    pub(crate) misses_accuracy: bool,
    /// Whether it was reported that slivers hold much of the elastic energy.
    #[cfg_attr(feature = "save", serde(default))]
    pub(crate) sliver_energy_reported: bool,
    #[cfg_attr(feature = "save", serde(default))]
    inversion: Inversion,
    /// Warnings for the next report.
    pub(crate) warnings: Vec<Warning>,
    /// Change of kappa by the last cut, if it is reported.
    pub(crate) cut_kappa: Option<CutKappa>,
}

impl Judged {
    /// Settings that were chosen for a mesh before all cuts, not yet judged.
    pub(super) fn new(choice: Option<Choice>, substeps: u32, mesh: &TetMesh) -> Self {
        Self {
            choice,
            first_substeps: substeps,
            leaves_substeps_open: false,
            leaves_method_open: false,
            budget: None,
            size: longest_side(&mesh.positions),
            outside: OutsideVolume::default(),
            misses_accuracy: false,
            sliver_energy_reported: false,
            inversion: Inversion::default(),
            warnings: Vec::new(),
            cut_kappa: None,
        }
    }
}

/// How long much of a body has been inverted.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
struct Inversion {
    /// Since it was looked for in s.
    time: f64,
    was_much: bool,
    is_reported: bool,
}

/// Cost of an island and its share of a time budget.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Budget {
    /// Milliseconds of a substep for each tet.
    pub(crate) per_tet: f64,
    /// Milliseconds of a frame.
    pub(crate) share: f64,
}

impl Budget {
    /// The most substeps that fit with a number of tets, at least 1.
    pub(crate) fn most(self, tets: usize) -> u32 {
        whole(self.share / (self.per_tet * tets.max(1) as f64))
    }
}

/// The number rounded down to a positive integer.
fn whole(number: f64) -> u32 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the cast saturates, and 0 becomes 1"
    )]
    let whole = number as u32;
    whole.max(1)
}

/// Change of kappa by cuts.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct CutKappa {
    /// The largest of a tet before.
    pub(crate) before: Option<f64>,
    /// The largest of a tet that was made.
    pub(crate) new_tets: f64,
}

/// The part of a body's volume outside the accuracy wanted from which a warning is given.
const OUTSIDE_FRACTION: f64 = 0.01;

/// Cuts raise a chosen number of substeps to at most so many times what it was before them: a live scene must not become
/// slower without end.
const MOST_GROWTH: u32 = 2;

/// The part of the accuracy that rounding to single precision may use up. Discretization has the rest.
const OF_ROUNDING: f64 = 1.0 / 3.0;

/// Factor by which gravity may be weaker than on earth and still decide the precision.
const WEAKEST: f64 = 1e4;

/// The part of the elastic energy that slivers may hold without a warning.
const SLIVER_ENERGY: f64 = 0.1;

/// The part of the volume that may be in inverted tets without a warning, and the time in s from one look at it to the next.
const INVERTED: f64 = 0.01;
const INVERSION_TIME: f64 = 0.25;

/// Energy below which nothing is judged, as a part of stiffness times volume: a strain of 3e-5, which is near rounding in a
/// sliver.
const NO_ENERGY: f64 = 1e-9;

/// Material, kappa and volume of a tet; kappa 0 of one that is fixed.
pub(super) fn accuracy_data(
    solver: &dyn ErasedSolver,
    tet: usize,
    settings: &StepSettings,
) -> (u16, f64, f64) {
    let kappa = if is_all_fixed(solver, tet) {
        0.0
    } else {
        solver.kappa_of(tet, settings.substep_time())
    };
    (solver.material_of(tet), kappa, solver.rest_volume(tet))
}

/// The longest side of the box around points, 0 without points.
fn longest_side(points: &[DVec3]) -> f64 {
    let (low, high) = points
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), x| {
            (low.min(*x), high.max(*x))
        });
    (high - low).max_element().max(0.0)
}

impl Island {
    /// Whether VBD was chosen for it.
    pub(crate) fn chose_vbd(&self) -> bool {
        self.judged.choice.is_some_and(|choice| choice.by_vbd)
    }

    /// Whether two-level VBD has an accuracy to reach. Single precision may not resolve it: the strains of a stiff body in
    /// free fall are rounding.
    pub(crate) fn must_converge(&self) -> bool {
        self.spec.method == Method::Vbd && self.spec.two_level && self.spec.accuracy.is_some()
    }

    /// Judges the accuracy of the present settings and notes warnings. Those of the scene that were not reported yet stay. O(tets
    /// log tets).
    pub(crate) fn judge_settings(&mut self) {
        let mut before = std::mem::take(&mut self.judged.warnings);
        before.retain(|warning| warning.code.is_of_scene());
        self.warn_of_settings();
        self.judged.warnings.extend(before);
    }

    fn warn_of_settings(&mut self) {
        self.judged.misses_accuracy = false;
        if self.is_too_short_for_f32() && self.solver.host().is_single() {
            let (substep, shortest) =
                (self.settings.substep_time(), self.shortest_substep_of_f32());
            let error = self.largest_rounding() * (shortest / substep).powi(2);
            let message = format!(
                "a substep of {substep:.1e} s is too short for single precision, which needs {shortest:.1e} s: rounding may change \
                 forces at rest by {} of the weight; set precision = \"f64\", or fewer substeps",
                percent(error)
            );
            self.warn(WarningCode::ShortSubstepF32, message);
        }
        if let Some(choice) = self.judged.choice.filter(|_| self.chose_vbd()) {
            let warning = warning::of_vbd(&self.bodies, &choice, &self.spec);
            self.judged.warnings.push(warning);
        }
        let spec = &self.spec;
        if spec.method != Method::GaussSeidel {
            self.judged.outside = OutsideVolume::default();
            return;
        }
        let form = tet_solve(spec.tet_solve);
        let accuracy = spec.accuracy.unwrap_or(DEFAULT_ACCURACY);
        let substeps = self.settings.substeps;
        let mesh = self.cuttable.mesh();
        let mut judged = evaluate(
            demands(spec, &self.solver, mesh, |_| true),
            |_| substeps,
            form,
        );
        let limit = self.judged.choice.and_then(|choice| choice.shortfall);
        if let Some(Shortfall::Budget | Shortfall::Growth | Shortfall::Precision) = limit {
            judged.shortfall = limit;
        }
        let chosen = self.judged.choice.is_some();
        self.judged.warnings.extend(warning::of_substeps(
            &self.bodies,
            &judged,
            chosen,
            spec.accuracy,
            // VBD has no contact.
            self.constraints.contacts.is_none(),
        ));
        let softened = self.solver.host().softened();
        if softened.tets > 0 {
            let message = format!(
                "{} of {} tets ({:.1}% of the volume) are softened to kappa_limit",
                softened.tets,
                self.cuttable.mesh().tets.len(),
                100.0 * softened.volume_fraction
            );
            self.warn(WarningCode::Softened, message);
        }
        let solver = self.solver.host();
        let limits = largest_kappas(accuracy, solver.materials(), form);
        let tets = (0..solver.tet_count()).map(|t| accuracy_data(solver, t, &self.settings));
        self.judged.outside = OutsideVolume::new(limits, tets);
    }

    fn warn(&mut self, code: WarningCode, message: String) {
        self.judged
            .warnings
            .push(Warning::new(code, &self.bodies, message));
    }

    /// Whether the substep is too short for single precision.
    pub(crate) fn is_too_short_for_f32(&self) -> bool {
        self.settings.substep_time() < 0.999 * self.shortest_substep_of_f32()
    }

    /// The shortest substep of single precision in s: under weak gravity bodies move more slowly than its rule supposes.
    fn shortest_substep_of_f32(&self) -> f64 {
        let gravity = self.settings.gravity.map_or(0.0, |g| g.length());
        let weakness = if gravity > 0.0 {
            (9.81 / gravity).clamp(1.0, WEAKEST)
        } else {
            1.0
        };
        shortest_substep_of_f32(self.judged.size, self.largest_rounding()) * weakness.sqrt()
    }

    /// What rounding may change forces at rest by, as a fraction of the weight.
    fn largest_rounding(&self) -> f64 {
        OF_ROUNDING * self.spec.accuracy.unwrap_or(DEFAULT_ACCURACY)
    }

    /// The most substeps that cuts may raise a number to that was chosen.
    fn most_substeps(&self) -> (u32, Shortfall) {
        let growth = MOST_GROWTH.saturating_mul(self.judged.first_substeps);
        if !self.solver.host().is_single() {
            return (growth, Shortfall::Growth);
        }
        let single = whole(self.settings.time_step / self.shortest_substep_of_f32());
        if single < growth {
            (single, Shortfall::Precision)
        } else {
            (growth, Shortfall::Growth)
        }
    }

    /// Takes a number of substeps, from which cuts raise it.
    pub(crate) fn set_substeps(&mut self, substeps: u32) {
        self.settings.substeps = substeps;
        self.judged.first_substeps = substeps;
    }

    /// Takes a number of substeps, with the error to expect of it.
    pub(crate) fn take_substeps(&mut self, substeps: u32) {
        let form = tet_solve(self.spec.tet_solve);
        let tets = demands(&self.spec, &self.solver, self.cuttable.mesh(), |_| true);
        let mut choice = evaluate(tets, |_| substeps, form);
        if choice.shortfall == Some(Shortfall::Cap) {
            choice.shortfall = Some(Shortfall::Budget);
        }
        self.judged.choice = Some(choice);
        self.set_substeps(substeps);
    }

    /// After cuts: takes fewer substeps where they no longer fit the budget. Tells whether that is so.
    fn keep_budget(&mut self) -> bool {
        let Some(budget) = self
            .judged
            .budget
            .filter(|_| self.spec.method != Method::Vbd)
        else {
            return false;
        };
        let most = budget.most(self.cuttable.mesh().tets.len());
        if self.settings.substeps <= most {
            return false;
        }
        self.take_substeps(most);
        self.judge_settings();
        true
    }

    /// Takes over substeps that settings have changed: cuts raise them from there.
    pub(crate) fn set_first_substeps(&mut self, substeps: u32) {
        if substeps != self.settings.substeps {
            self.judged.first_substeps = substeps;
        }
    }

    /// After cuts: chooses substeps again where too much of the body is outside the accuracy, or warns.
    pub(crate) fn judge_cut(&mut self, asked: &[Substeps]) {
        if self.keep_budget() {
            return;
        }
        let fraction = self.judged.outside.outside / self.volume();
        if self.spec.method != Method::GaussSeidel
            || fraction <= OUTSIDE_FRACTION
            || self.judged.outside.outside <= 2.0 * self.judged.outside.at_choice
        {
            return;
        }
        let before = self.settings.substeps;
        if self.judged.choice.is_some()
            && self.judged.budget.is_none()
            && !self.spec.kappa_limit.is_finite()
        {
            let (chosen, choice) = substeps(asked, &self.spec, &self.solver, self.cuttable.mesh());
            let (most, shortfall) = self.most_substeps();
            let taken = chosen.min(most).max(before);
            self.settings.substeps = taken;
            let ratio = f64::from(before) / f64::from(self.settings.substeps);
            if let Some(noted) = &mut self.judged.cut_kappa {
                // Kappa goes with the square of the substep.
                noted.before = noted.before.map(|kappa| kappa * ratio * ratio);
                noted.new_tets *= ratio * ratio;
            }
            self.judged.choice = match choice {
                Some(_) if taken < chosen => {
                    let form = tet_solve(self.spec.tet_solve);
                    let mesh = self.cuttable.mesh();
                    let tets = demands(&self.spec, &self.solver, mesh, |_| true);
                    let mut limited = evaluate(tets, |_| taken, form);
                    limited.shortfall = Some(shortfall);
                    Some(limited)
                }
                choice => choice,
            };
            let is_capped = |warning: &Warning| warning.code == WarningCode::SubstepsCapped;
            let was_capped = self.judged.warnings.iter().any(is_capped);
            self.judge_settings();
            if !was_capped {
                // It is the small tets that need more, of which the next warning has the volume.
                self.judged.warnings.retain(|warning| !is_capped(warning));
            }
        }
        self.judged.outside.at_choice = self.judged.outside.outside;
        let fraction = self.judged.outside.outside / self.volume();
        if fraction > OUTSIDE_FRACTION {
            let (substeps, choice) = (self.settings.substeps, self.judged.choice.as_ref());
            let warning = warning::of_outside(&self.bodies, fraction, substeps, choice);
            self.judged.warnings.push(warning);
        }
    }

    /// Whether a speed in m/s is beyond anything that the material, gravity and moving parts can cause.
    pub(crate) fn is_absurd(&self, speed: f64, elapsed: f64) -> bool {
        let materials = self.solver.host().materials().iter();
        let waves = materials.map(|m| (m.young_modulus / m.density).sqrt());
        let wave = waves.fold(0.0, f64::max);
        let fall = self.settings.gravity.map_or(0.0, |g| g.length() * elapsed);
        let plausible =
            100.0 * wave + 2.0 * fall + 10.0 * self.judged.size / self.settings.time_step;
        speed.is_nan() || speed > plausible
    }

    /// Warns when VBD begins to miss the accuracy wanted.
    pub(super) fn judge_step(&mut self) {
        let error = self.solver.backend().vbd_error();
        let (Some(wanted), Some(error)) = (self.spec.accuracy, error) else {
            return;
        };
        let misses = error > wanted;
        if misses && !self.judged.misses_accuracy {
            let message = format!(
                "{} rounds of two-level VBD leave an estimated error of {:.0}% of the motion, where {:.0}% are wanted; use \
                 more, smaller frames or a Poisson's ratio farther from 0.5",
                self.settings.iterations,
                100.0 * error.min(1e6),
                100.0 * wanted
            );
            self.warn(WarningCode::NotConverged, message);
        }
        self.judged.misses_accuracy = misses;
    }

    /// Warns when much of the body has stayed inverted. O(tets) four times a second of simulated time; positions on a device
    /// are not known.
    pub(super) fn judge_inversion(&mut self) {
        let Inversion {
            time,
            was_much,
            is_reported,
        } = &mut self.judged.inversion;
        *time += self.settings.time_step;
        if *time < INVERSION_TIME || self.solver.is_on_device() {
            return;
        }
        let part = self.solver.host().inverted_fraction();
        let is_much = part > INVERTED;
        let stays = is_much && *was_much;
        let is_new = stays && !*is_reported;
        (*time, *was_much, *is_reported) = (0.0, is_much, stays);
        if is_new {
            let message = format!(
                "{} of the volume is in tets that have stayed inverted for {INVERSION_TIME} s, where its shape is wrong: the load is \
                 too large for the material; raise young_modulus, or spread loads and fixed regions over more of the body",
                percent(part)
            );
            self.warn(WarningCode::Inverted, message);
        }
    }

    /// Warns, once, when slivers hold much of a reported elastic energy.
    pub(crate) fn judge_energy(&mut self, measures: &Measures) {
        let (Some(energy), Some(of_slivers)) = (measures.energy, measures.sliver_energy) else {
            return;
        };
        let materials = self.solver.host().materials().iter();
        let stiffness = materials.map(|m| m.young_modulus).fold(0.0, f64::max);
        let least = NO_ENERGY * stiffness * self.cuttable.mesh().total_volume();
        let is_much = of_slivers > least.max(SLIVER_ENERGY * energy.elastic);
        if self.judged.sliver_energy_reported || !is_much {
            return;
        }
        self.judged.sliver_energy_reported = true;
        let message = format!(
            "{:.0}% of the elastic energy is that of tets below a hundredth of the mean volume, which a tiny error of \
             position raises by orders of magnitude; use more snap in strokes, or more substeps",
            100.0 * of_slivers / energy.elastic
        );
        self.warn(WarningCode::SliverEnergy, message);
    }

    /// Makes [`Island::apply_delta`] note the largest kappa of the tets that the cuts of a frame create, and if wanted
    /// that of all tets before the first cut, which is O(tets).
    pub(crate) fn note_kappa(&mut self, before: bool) {
        if self.judged.cut_kappa.is_none() {
            self.judged.cut_kappa = Some(CutKappa {
                before: before.then(|| self.kappa()),
                new_tets: 0.0,
            });
        }
    }

    /// The largest kappa of a tet that can move, had none been softened. O(tets).
    pub(crate) fn kappa(&self) -> f64 {
        let solver = self.solver.host();
        let kappas = (0..solver.tet_count()).map(|t| accuracy_data(solver, t, &self.settings).1);
        kappas.fold(0.0, f64::max)
    }
}
