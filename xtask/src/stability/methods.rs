//! Columns of the matrix: methods with their settings, precisions, backends.
//!
//! *Default* is a simulation with the settings of an empty `[solver]` table, which choose method, substeps and
//! precision. *Split* is the default form with as many substeps as bring kappa to 0.5, at most 200, and nothing
//! softened. *Softened* is the block form with the same substeps, tets that are still too stiff softened to kappa 1.
//! All others compute a frame in one step of twenty iterations (five with corrections), as the paper does.

use incise::mesh::glam::DVec3;
use incise::scene::{self, SolverSpec, Substeps, TetSolve as SceneTetSolve};
use incise::xpbd::{KappaLimit, Method as XpbdMethod, StepSettings, TetSolve, VbdSettings};
use serde::{Deserialize, Serialize};

use crate::solver::runner::Recipe;

/// Largest kappa at which a substep of one iteration is accurate.
const KAPPA: f64 = 0.5;
/// Limit of kappa to which stiffer tets are softened, as in scenes.
const KAPPA_LIMIT: f64 = 1.0;
/// Largest number of substeps per frame.
const MOST_SUBSTEPS: f64 = 200.0;
/// Iterations or sweeps per frame.
const ITERATIONS: u32 = 20;
/// Rounds of a sweep and a correction.
const ROUNDS: u32 = 5;

/// Method of computing a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Method {
    /// Default settings of a scene.
    Defaults,
    /// XPBD in split form, one iteration per substep, substeps by kappa, no softening.
    Split,
    /// XPBD in block form, one iteration per substep, substeps by kappa, softened to a kappa of 1.
    Softened,
    /// XPBD in block form, one step of 20 iterations.
    Block,
    /// Method of the paper: the constraints of a tet one after another, clusters of 10, relaxation 0.8.
    Paper,
    /// Relaxation 0.1.
    Jacobi,
    /// Relaxation 0.1, spectral radius 0.9.
    Chebyshev,
    /// 20 sweeps.
    Vbd,
    /// 5 sweeps, each with a global correction.
    Corrected,
}

use Method::{Block, Chebyshev, Corrected, Defaults, Jacobi, Paper, Softened, Split, Vbd};

impl Method {
    pub(crate) const ALL: [Self; 9] = [
        Defaults, Split, Softened, Block, Paper, Jacobi, Chebyshev, Vbd, Corrected,
    ];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Defaults => "default",
            Split => "split",
            Softened => "softened",
            Block => "block",
            Paper => "paper",
            Jacobi => "Jacobi",
            Chebyshev => "Chebyshev",
            Vbd => "vbd",
            Corrected => "corrected",
        }
    }

    /// True if it is XPBD in all rows; kappa limits it, and devices support it.
    pub(crate) fn is_xpbd(self) -> bool {
        !matches!(self, Defaults | Vbd | Corrected)
    }

    /// Iterations, sweeps or rounds per substep.
    fn iterations(self) -> u32 {
        match self {
            Defaults | Split | Softened => 1,
            Corrected => ROUNDS,
            _ => ITERATIONS,
        }
    }

    /// True if a frame may have more than one substep.
    pub(crate) fn has_substeps(self) -> bool {
        matches!(self, Split | Softened)
    }

    /// Substeps per frame for a body with that kappa at the frame's time.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "there are from 1 to 200 substeps"
    )]
    pub(crate) fn substeps(self, kappa: f64) -> u32 {
        if self.has_substeps() {
            (kappa / KAPPA).sqrt().ceil().clamp(1.0, MOST_SUBSTEPS) as u32
        } else {
            1
        }
    }

    /// The limit to which a body is softened.
    pub(crate) fn limit(self, substep_time: f64) -> Option<KappaLimit> {
        (self == Softened).then_some(KappaLimit {
            kappa: KAPPA_LIMIT,
            substep_time,
        })
    }

    /// Solver settings.
    pub(crate) fn recipe(self, time_step: f64, substeps: u32, gravity: Option<DVec3>) -> Recipe {
        let settings = StepSettings {
            substeps,
            iterations: self.iterations(),
            method: match self {
                Jacobi => XpbdMethod::Jacobi,
                Chebyshev => XpbdMethod::Chebyshev {
                    spectral_radius: 0.9,
                    chebyshev_start: 10,
                },
                _ => XpbdMethod::GaussSeidel,
            },
            tet_solve: match self {
                Paper => TetSolve::Sequential,
                Split => TetSolve::Split,
                _ => TetSolve::Block,
            },
            relaxation: match self {
                Paper => 0.8,
                Jacobi | Chebyshev => 0.1,
                _ => 1.0,
            },
            gravity,
            ..StepSettings::new(time_step)
        };
        let vbd = |settings| VbdSettings {
            step: settings,
            ..VbdSettings::new(time_step, self.iterations())
        };
        match self {
            Vbd => Recipe::Vbd(vbd(settings)),
            Corrected => Recipe::Corrected(vbd(settings)),
            Paper => Recipe::Xpbd {
                clustering: "serial:10",
                settings,
            },
            _ => Recipe::Xpbd {
                clustering: "none",
                settings,
            },
        }
    }

    /// Scene settings. The columns of the block form soften tets that are too stiff after a cut.
    pub(crate) fn spec(self, column: Column) -> SolverSpec {
        let method = match self {
            Defaults => scene::Method::Auto,
            Split | Softened | Block | Paper => scene::Method::GaussSeidel,
            Jacobi => scene::Method::Jacobi,
            Chebyshev => scene::Method::Chebyshev,
            Vbd | Corrected => scene::Method::Vbd,
        };
        let mut spec = match self {
            Paper => SolverSpec::paper(method),
            _ => SolverSpec::of(method),
        };
        spec.substeps = match self {
            Defaults | Split | Softened => Substeps::Auto,
            _ => Substeps::Fixed(1),
        };
        spec.iterations = self.iterations();
        if matches!(self, Softened | Block | Jacobi | Chebyshev) {
            spec.tet_solve = SceneTetSolve::Block;
            spec.kappa_limit = KAPPA_LIMIT;
        }
        spec.time_step = 1.0 / 60.0;
        spec.two_level = self == Corrected;
        spec.precision = match column.precision {
            Precision::Auto => scene::Precision::Auto,
            Precision::F32 => scene::Precision::F32,
            Precision::F64 => scene::Precision::F64,
        };
        spec
    }
}

/// Floating-point precision.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Precision {
    /// Chosen by the simulation.
    Auto,
    F32,
    F64,
}

/// Method, precision and backend.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Column {
    pub(crate) method: Method,
    pub(crate) precision: Precision,
    /// Runs on a device instead of the processor.
    pub(crate) gpu: bool,
}

impl Column {
    /// Default settings of a scene.
    pub(crate) const DEFAULTS: Self = Self {
        method: Defaults,
        precision: Precision::Auto,
        gpu: false,
    };

    /// Defaults, all other methods in both precisions, and on a device the supported methods.
    pub(crate) fn all(gpu: bool) -> Vec<Self> {
        let mut columns = vec![Self::DEFAULTS];
        for method in Method::ALL.into_iter().filter(|&m| m != Defaults) {
            for precision in [Precision::F32, Precision::F64] {
                columns.push(Self {
                    method,
                    precision,
                    gpu: false,
                });
            }
            if gpu && method.is_xpbd() {
                columns.push(Self {
                    method,
                    precision: Precision::F32,
                    gpu: true,
                });
            }
        }
        columns
    }

    /// Second line of the column's heading.
    pub(crate) fn place(self) -> &'static str {
        match (self.gpu, self.precision) {
            (true, _) => "GPU",
            (false, Precision::Auto) => "auto",
            (false, Precision::F32) => "f32",
            (false, Precision::F64) => "f64",
        }
    }
}
