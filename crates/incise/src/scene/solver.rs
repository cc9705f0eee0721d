//! [`SolverSpec`]: solver settings of a scene.
//!
//! Keys of a scene override the defaults of its preset or method.

use std::num::NonZeroU32;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Integrator, Method, Preset, Substeps, TetSolve};
use crate::Error;

/// Settings of the solver.
///
/// Some defaults depend on the method: see [`SolverSpec::of`]. Those and a preset's are applied when a scene is read.
///
/// ```
/// use incise::scene::{SleepSpec, SolverSpec};
///
/// let solver = SolverSpec::default().with(|solver| {
///     solver.substeps = 20.into();
///     solver.sleep = Some(SleepSpec::default());
/// });
/// # assert_eq!((solver.substeps, solver.iterations), (20.into(), 1));
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct SolverSpec {
    /// Other defaults for the keys of this table: `paper`, the settings of the paper's experiments.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<Preset>,
    /// Time of a frame.
    #[schemars(extend("unit" = "s"), range(min = 1e-9, max = 1e3))]
    pub time_step: f64,
    /// Largest error wanted, as a fraction of the motion; absent: 0.1. Decides what `substeps = "auto"` and
    /// `method = "auto"` take, and, if given, ends the rounds of two-level VBD.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 1.0))]
    pub accuracy: Option<f64>,
    /// Computing time that a frame may take on this machine; absent: no limit. `substeps = "auto"` and `method = "auto"` are
    /// fitted to it: with `accuracy` no more substeps than that needs, without it as many as fit. Runs then differ from
    /// each other. Not on a GPU.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "ms", "exclusiveMinimum" = 0))]
    pub budget_ms: Option<f64>,
    /// Equal parts of a frame: a number, or `auto`, which chooses for each body by `accuracy`.
    pub substeps: Substeps,
    /// Largest number of substeps that `auto` takes.
    #[schemars(range(min = 1))]
    pub max_substeps: u32,
    /// Passes over the constraints in a substep, or sweeps of VBD. Gauss-Seidel converges with 1 and more substeps. The
    /// default is 20 for Jacobi, Chebyshev and VBD.
    #[schemars(range(min = 1))]
    pub iterations: u32,
    /// Solver of a substep.
    pub method: Method,
    /// Constraints that stand for the elastic energy of a tet. Not used by VBD.
    pub tet_solve: TetSolve,
    /// Factor on each correction; 0.1 by default for Jacobi and Chebyshev.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 2.0))]
    pub relaxation: f64,
    /// For Chebyshev: estimated spectral radius of the Jacobi iteration. Larger values extrapolate further: with 0.99 the
    /// weights reach 1.75 after some ten iterations.
    #[schemars(extend("exclusiveMaximum" = 1), range(min = 0.0))]
    pub spectral_radius: f64,
    /// For Chebyshev: plain iterations before the first extrapolation. They damp the high frequencies that
    /// extrapolation would amplify.
    #[schemars(range(min = 1))]
    pub chebyshev_start: u32,
    /// For VBD: follow each sweep by a coarse correction of the whole body, which costs as much as about 100 sweeps.
    #[serde(skip_serializing_if = "is_false")]
    #[schemars(extend("default" = false))]
    pub two_level: bool,
    /// For VBD: time integration of a substep.
    #[serde(skip_serializing_if = "Integrator::is_default")]
    #[schemars(extend("default" = Integrator::default()))]
    pub integrator: Integrator,
    /// Clustering of the tets: `none`, `serial:K` or `pressure:K`, with K tets a cluster. `serial` is that of the paper;
    /// `pressure` takes eight times as long to build, needs half the colors and solves faster.
    pub clustering: String,
    /// Merge clusters that a cut leaves small with their neighbors. A cut then costs a little more and frames after
    /// many cuts cost less; without it clusters shrink and colors grow with every cut, as in the paper.
    #[serde(skip_serializing_if = "is_true")]
    #[schemars(extend("default" = true))]
    pub merge_clusters: bool,
    /// Rebuilding of clusters and colors in the background after many cuts; absent: never.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recluster: Option<ReclusterSpec>,
    /// Coloring algorithm for clusters, by the name of an [`Algorithm`](incise_coloring::Algorithm) or `auto`. New
    /// clusters of cuts are colored one by one; if that needs too many colors, all are recolored with `auto`.
    pub coloring: String,
    /// Floating-point precision.
    pub precision: Precision,
    /// Compute device. On a GPU a thread solves a cluster of up to 32 tets, a workgroup a larger one of up to 256.
    #[serde(skip_serializing_if = "Backend::is_cpu")]
    #[schemars(extend("default" = Backend::default()))]
    pub backend: Backend,
    /// Largest kappa of a tet (squared Courant number of the substep): stiffer tets are softened to it. `inf`, the
    /// default, softens none.
    #[schemars(extend("exclusiveMinimum" = 0, "default" = "inf"))]
    pub kappa_limit: f64,
    /// Sleep: bodies at rest are not solved until they are cut or moved; absent: all bodies are always solved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sleep: Option<SleepSpec>,
}

impl Default for SolverSpec {
    fn default() -> Self {
        Self {
            preset: None,
            time_step: 0.016,
            accuracy: None,
            budget_ms: None,
            substeps: Substeps::Auto,
            max_substeps: 200,
            iterations: 1,
            method: Method::Auto,
            tet_solve: TetSolve::Split,
            relaxation: 1.0,
            spectral_radius: 0.99,
            chebyshev_start: 10,
            two_level: false,
            integrator: Integrator::Bdf2,
            clustering: "pressure:10".to_owned(),
            merge_clusters: true,
            recluster: None,
            coloring: "auto".to_owned(),
            precision: Precision::Auto,
            backend: Backend::Cpu,
            kappa_limit: f64::INFINITY,
            sleep: None,
        }
    }
}

/// Floating-point precision of the solver.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Precision {
    /// Single on a GPU and wherever the substep is long enough for it, else double. Double for two-level VBD with an
    /// accuracy.
    #[default]
    Auto,
    /// Single: 32 bits.
    F32,
    /// Double: 64 bits.
    F64,
}

impl Precision {
    /// The name as written in a scene.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }
}

/// Compute device of a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Backend {
    /// The processor.
    #[default]
    Cpu,
    /// A GPU; an error if there is none or it does not support the scene's settings. Needs the feature `gpu`.
    Gpu,
    /// A hardware GPU if there is one that supports the scene's settings, else the processor.
    Auto,
}

impl Backend {
    pub(crate) fn is_cpu(&self) -> bool {
        *self == Self::Cpu
    }
}

/// Rebuilding of clusters and colors in the background.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ReclusterSpec {
    /// Degradation at which clusters and colors are rebuilt: the number of colors over that after the last rebuild, or
    /// the mean cluster size after the last rebuild over the present one, whichever is larger.
    #[serde(default = "five_quarters")]
    #[schemars(extend("exclusiveMinimum" = 1))]
    pub threshold: f64,
    /// Frames after which the rebuilt ones are taken. A frame that comes before they are ready waits for them.
    #[serde(default = "ten")]
    pub frames: NonZeroU32,
}

impl Default for ReclusterSpec {
    fn default() -> Self {
        Self {
            threshold: five_quarters(),
            frames: ten(),
        }
    }
}

fn five_quarters() -> f64 {
    1.25
}
fn ten() -> NonZeroU32 {
    NonZeroU32::MIN.saturating_add(9)
}

/// Conditions under which a body falls asleep.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct SleepSpec {
    /// Largest speed of a particle that counts as rest. Choose it below the speed after one frame of free fall (0.16 m/s
    /// at 0.016 s), or a body falls asleep before it falls.
    #[serde(default = "millimeter_per_second")]
    #[schemars(extend("unit" = "m/s", "exclusiveMinimum" = 0))]
    pub speed: f64,
    /// Time at rest before a body sleeps.
    #[serde(default = "half_a_second")]
    #[schemars(extend("unit" = "s", "exclusiveMinimum" = 0))]
    pub time: f64,
}

impl SleepSpec {
    /// Sleep of bodies whose particles are not faster than a speed in m/s, after a time in s.
    #[must_use]
    pub const fn new(speed: f64, time: f64) -> Self {
        Self { speed, time }
    }
}

impl Default for SleepSpec {
    fn default() -> Self {
        Self::new(millimeter_per_second(), half_a_second())
    }
}

fn millimeter_per_second() -> f64 {
    1e-3
}
fn half_a_second() -> f64 {
    0.5
}

fn is_false(flag: &bool) -> bool {
    !flag
}
fn is_true(flag: &bool) -> bool {
    *flag
}

impl SolverSpec {
    /// Returns the defaults of a method: those of [`SolverSpec::default`], with these differences:
    ///
    /// * Jacobi, Chebyshev and VBD take 20 `iterations`, since one of theirs converges little;
    /// * Jacobi and Chebyshev have a `relaxation` of 0.1: with 1 they overshoot where more than two tets meet;
    /// * VBD takes one substep, as it is stable at any stiffness.
    ///
    /// ```
    /// let scene = incise::Scene::from_toml("[solver]\nmethod = \"jacobi\"\niterations = 7")?;
    /// assert_eq!((scene.solver.iterations, scene.solver.relaxation), (7, 0.1));
    /// # Ok::<(), incise::Error>(())
    /// ```
    #[must_use]
    pub fn of(method: Method) -> Self {
        let mut spec = Self {
            method,
            ..Self::default()
        };
        match method {
            Method::Auto | Method::GaussSeidel => {}
            Method::Jacobi | Method::Chebyshev => (spec.iterations, spec.relaxation) = (20, 0.1),
            Method::Vbd => (spec.substeps, spec.iterations) = (1.into(), 20),
        }
        spec
    }

    /// Returns the settings of the paper's experiments: frames of 0.016 s in a single step of 500 iterations (section
    /// 5.1.1), sequential constraints, relaxation 0.8 for Gauss-Seidel and 0.1 for Jacobi and Chebyshev (table 3), SCGC
    /// colors on serial clusters of 10 that are never merged, no softening. The paper does not state the iterations of
    /// its animations. It has no VBD; with VBD, keys of constraints keep their defaults.
    ///
    /// For comparison only: kappa is far beyond what is accurate or stable, because the paper's body has
    /// `young_modulus = 1e7`, `poisson_ratio = 0.49` and `damping = 0.05` (section 5.2, which does not state size and
    /// density).
    ///
    /// ```
    /// let scene = incise::Scene::from_toml("[solver]\npreset = \"paper\"\niterations = 20")?;
    /// assert_eq!((scene.solver.substeps, scene.solver.iterations), (1.into(), 20));
    /// # Ok::<(), incise::Error>(())
    /// ```
    #[must_use]
    pub fn paper(method: Method) -> Self {
        let method = match method {
            Method::Auto => Method::GaussSeidel,
            named => named,
        };
        let (tet_solve, relaxation) = match method {
            Method::GaussSeidel => (TetSolve::Sequential, 0.8),
            Method::Jacobi | Method::Chebyshev => (TetSolve::Sequential, 0.1),
            Method::Auto | Method::Vbd => (TetSolve::Split, 1.0),
        };
        Self {
            preset: Some(Preset::Paper),
            time_step: 0.016,
            substeps: Substeps::Fixed(1),
            iterations: 500,
            tet_solve,
            relaxation,
            clustering: "serial:10".to_owned(),
            merge_clusters: false,
            coloring: "scgc".to_owned(),
            kappa_limit: f64::INFINITY,
            ..Self::of(method)
        }
    }

    /// Returns the solver settings of a scene's text over the defaults of the preset and method that it names.
    pub(crate) fn with_defaults(self, text: &str) -> Result<Self, Error> {
        let defaults = match self.preset {
            Some(Preset::Paper) => Self::paper(self.method),
            None if self.method == Method::default() => return Ok(self),
            None => Self::of(self.method),
        };
        let failed = |message: String| Error::Parse {
            line: None,
            message,
        };
        let mut keys = toml::Table::try_from(defaults).map_err(|e| failed(e.to_string()))?;
        let mut scene: toml::Table = toml::from_str(text).map_err(|e| failed(e.to_string()))?;
        if let Some(toml::Value::Table(named)) = scene.remove("solver") {
            keys.extend(named);
        }
        keys.try_into().map_err(|e| failed(e.to_string()))
    }
}
