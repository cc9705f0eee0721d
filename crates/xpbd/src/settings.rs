//! [`StepSettings`]: settings of a frame: time step, method, gravity, colliders.

use glam::DVec3;

use crate::{Collider, XpbdError};

/// Settings of one frame.
///
/// To gain accuracy raise `substeps`: they converge to the true motion. More `iterations` of a large step converge to
/// another state, because the projection leaves out part of the equations of motion. [`crate::Solver::kappa`] is the
/// number to look at.
///
/// In single precision a substep can be too short: see [`shortest_substep_of_f32`].
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct StepSettings {
    /// Time of a frame in s, positive.
    pub time_step: f64,
    /// Equal parts a frame is divided into, at least 1.
    pub substeps: u32,
    /// Passes over all constraints in a substep, at least 1.
    pub iterations: u32,
    /// Method of an iteration over the constraints.
    pub method: Method,
    /// Constraints that represent the energy of a tet.
    pub tet_solve: TetSolve,
    /// Factor on each correction, above 0 and at most 2; 1 is none.
    pub relaxation: f64,
    /// Acceleration in m/s².
    pub gravity: Option<DVec3>,
    /// Obstacles.
    pub colliders: Vec<Collider>,
}

/// Returns the shortest substep in s in which rounding to single precision changes the forces on a body at rest by at most
/// `error`, as a fraction of its weight on earth; `size` is its longest side in m.
///
/// A position is rounded to 6e-8 of its distance from the middle of the body. Corrections of constraints are rounded so as
/// well, and more on one side of a tet than on the other, so forces within the body no longer add up to zero. In a substep
/// gravity moves a particle by `g Δt²`, so what is rounded is at most `4e-8 size / (g Δt²)` of the weight: a bound on
/// measured forces of boxes of 2 cm to 1 m and of stacks, most of which were off by less than half of it
/// (`tests/suite/precision.rs`). With an error of a sixth or more, rounding also adds energy: at an eighth of that substep
/// several times the body's energy within 100,000 substeps. Use double precision in shorter substeps.
///
/// ```
/// // A box of 20 cm with forces within 3%.
/// assert!((incise_xpbd::shortest_substep_of_f32(0.2, 0.03) - 1.65e-4).abs() < 1e-6);
/// ```
#[must_use]
pub fn shortest_substep_of_f32(size: f64, error: f64) -> f64 {
    (4e-8 * size / (9.81 * error)).sqrt()
}

/// Method of an iteration over the constraints.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Method {
    /// Gauss-Seidel: color by color, each constraint uses the corrections before it.
    #[default]
    GaussSeidel,
    /// Jacobi: all constraints use the positions before the iteration, and the corrections are added up. Stable only
    /// with a relaxation below about 2 over the largest number of tets around a particle; the paper takes 0.1.
    Jacobi,
    /// Jacobi, extrapolated from the two last iterates of positions and multipliers with growing weights
    /// `ω = 4 / (4 - ρ² ω)`, the first being `2 / (2 - ρ²)`.
    Chebyshev {
        /// Spectral radius ρ of the Jacobi iteration, from 0 to below 1. Larger values extrapolate further.
        spectral_radius: f64,
        /// Plain iterations before the first extrapolation, at least 1.
        chebyshev_start: u32,
    },
}

/// Constraints that represent the elastic energy of a tet.
///
/// All three have the same energy.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum TetSolve {
    /// A shear part and a volume part that both vanish at rest. A body at rest stays at rest and a loaded body stays
    /// bounded at any stiffness, so the number of substeps affects accuracy only.
    #[default]
    Split,
    /// `|F|` and `det F - γ` as one system of two unknowns. At rest stable up to kappa 1 and unstable from 4 on, unless
    /// tets are softened by [`crate::KappaLimit`].
    Block,
    /// The constraints of the block form one after the other, deviatoric first, as in the paper and in most
    /// implementations.
    Sequential,
}

impl Method {
    /// Refuses the methods that do not solve contacts.
    pub(crate) fn check_contacts(self) -> Result<(), XpbdError> {
        let method = match self {
            Self::GaussSeidel => return Ok(()),
            Self::Jacobi => "jacobi",
            Self::Chebyshev { .. } => "chebyshev",
        };
        Err(XpbdError::ContactMethod { method })
    }

    /// Refuses the methods that move particles by more than impulses.
    pub(crate) fn check_forces(self) -> Result<(), XpbdError> {
        match self {
            Self::GaussSeidel | Self::Jacobi => Ok(()),
            Self::Chebyshev { .. } => Err(XpbdError::ForceMethod {
                method: "chebyshev",
            }),
        }
    }
}

impl StepSettings {
    /// Returns settings with one substep of one iteration, without forces.
    #[must_use]
    pub fn new(time_step: f64) -> Self {
        Self {
            time_step,
            substeps: 1,
            iterations: 1,
            method: Method::GaussSeidel,
            tet_solve: TetSolve::Split,
            relaxation: 1.0,
            gravity: None,
            colliders: Vec::new(),
        }
    }

    /// Returns the time of a substep in s.
    #[must_use]
    pub fn substep_time(&self) -> f64 {
        self.time_step / f64::from(self.substeps)
    }

    /// Checks that each value lies in its range.
    ///
    /// # Errors
    /// [`XpbdError::Setting`] names the first value that does not.
    pub fn check(&self) -> Result<(), XpbdError> {
        let refuse = |what, value, range| Err(XpbdError::Setting { what, value, range });
        if !(self.time_step.is_finite() && self.time_step > 0.0) {
            return refuse("time_step", self.time_step, "positive and finite");
        }
        if self.substeps == 0 {
            return refuse("substeps", 0.0, "at least 1");
        }
        if self.iterations == 0 {
            return refuse("iterations", 0.0, "at least 1");
        }
        if !(self.relaxation > 0.0 && self.relaxation <= 2.0) {
            return refuse("relaxation", self.relaxation, "above 0 and at most 2");
        }
        if let Method::Chebyshev {
            spectral_radius,
            chebyshev_start,
        } = self.method
        {
            if !(0.0..1.0).contains(&spectral_radius) {
                let range = "at least 0 and below 1";
                return refuse("spectral_radius", spectral_radius, range);
            }
            if chebyshev_start == 0 {
                return refuse("chebyshev_start", 0.0, "at least 1");
            }
        }
        if let Some(value) = self
            .gravity
            .and_then(|g| g.to_array().into_iter().find(|c| !c.is_finite()))
        {
            return refuse("gravity", value, "finite");
        }
        self.colliders.iter().try_for_each(Collider::check)
    }
}
