//! [`SolverSpec`]: how a scene is computed.
//!
//! Keys that a scene names replace those of its preset or method, which are sets of other defaults.

use std::num::NonZeroU32;

use serde::{Deserialize, Serialize};

use super::{Integrator, Method, Preset, Substeps, TetSolve};
use crate::Error;

/// How it is computed.
///
/// Some defaults depend on the method: see [`SolverSpec::of`]. Those and a preset's are applied when a scene is read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SolverSpec {
    /// Other defaults for the keys below: `paper`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<Preset>,
    /// Time of a frame in s.
    pub time_step: f64,
    /// The largest error wanted, as a fraction of the motion, above 0 and at most 1; absent: 0.1. Decides what
    /// `substeps = "auto"` and `method = "auto"` take, and, if given, ends the rounds of two-level VBD.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accuracy: Option<f64>,
    /// The time in ms that a frame may take on this machine, positive; absent: no limit. Substeps that are chosen, and the
    /// method, are fitted to it: with `accuracy` no more than that needs, without it as many as fit. Runs then differ from
    /// each other. Not on a GPU.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub budget_ms: Option<f64>,
    /// Equal parts of a frame: a number, or `auto`, which chooses for each body by the accuracy.
    pub substeps: Substeps,
    /// The most substeps that `auto` takes.
    pub max_substeps: u32,
    /// Passes over the constraints in a substep, or sweeps of VBD. With Gauss-Seidel 1 is what converges.
    pub iterations: u32,
    /// How a substep is solved: `auto`, `gauss-seidel`, `jacobi`, `chebyshev` or `vbd`.
    pub method: Method,
    /// How the elastic energy of a tet is solved. VBD has no constraints.
    pub tet_solve: TetSolve,
    /// Factor on each correction.
    pub relaxation: f64,
    /// For Chebyshev: the spectral radius of the Jacobi iteration, from 0 to below 1: the larger, the bolder. At 0.99
    /// the weights tend to 1.75, which they reach in some ten iterations; more pays only with hundreds of them.
    pub spectral_radius: f64,
    /// For Chebyshev: plain iterations before the first extrapolation, at least 1. They damp what extrapolation would
    /// blow up.
    pub delay: u32,
    /// For VBD: whether each sweep is followed by a correction of the whole body, which costs some 100 sweeps.
    #[serde(skip_serializing_if = "is_false")]
    pub two_level: bool,
    /// For VBD: how a substep advances in time, `bdf2` or `implicit-euler`.
    #[serde(skip_serializing_if = "Integrator::is_default")]
    pub integrator: Integrator,
    /// How constraints are put together: `none` or `serial:K`.
    pub clustering: String,
    /// Whether clusters that a cut leaves small are merged with neighbors. This makes a cut a little more expensive
    /// and all frames after many cuts cheaper; without it clusters shrink and colors grow with every cut, as in the
    /// paper.
    #[serde(skip_serializing_if = "is_true")]
    pub merge_clusters: bool,
    /// When clusters and colors that many cuts have degraded are rebuilt, in the background; absent: never.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recluster: Option<ReclusterSpec>,
    /// How clusters are colored, by the name of an [`Algorithm`](incise_coloring::Algorithm). Clusters that cuts make are
    /// colored one by one, until they need more colors than they should; then all are recolored, with `auto`.
    pub coloring: String,
    /// Width of the numbers.
    pub precision: Precision,
    /// Where it is computed: `cpu`, `gpu` or `auto`. On a GPU clusters of up to 32 tets are a thread's work each, larger
    /// ones, up to 256, that of a workgroup.
    #[serde(skip_serializing_if = "Backend::is_cpu")]
    pub backend: Backend,
    /// Largest kappa of a tet, positive: stiffer ones, as cuts leave them, are softened to it. `inf`, the default,
    /// softens none.
    pub kappa_limit: f64,
    /// Bodies at rest are not solved until they are cut or something moves them; absent: all are always solved.
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
            delay: 10,
            two_level: false,
            integrator: Integrator::Bdf2,
            clustering: "serial:10".to_owned(),
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

/// Width of the numbers the solver computes with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Precision {
    /// Single on a GPU and wherever the substep is long enough for it, else double; double also where `method = "auto"`
    /// takes VBD.
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

/// Where a scene is to be computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Backend {
    /// On the processor.
    #[default]
    Cpu,
    /// On a GPU; an error if there is none or it cannot do what the scene asks for. Needs the feature `gpu`.
    Gpu,
    /// On a GPU if there is a real one that can, else on the processor.
    Auto,
}

impl Backend {
    pub(crate) fn is_cpu(&self) -> bool {
        *self == Self::Cpu
    }
}

/// When clusters and colors are rebuilt in the background, and how long that may take.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReclusterSpec {
    /// Degradation at which they are rebuilt, above 1: the number of colors over that of the last full coloring, or the mean cluster
    /// size of that over the present one, whichever is larger.
    #[serde(default = "five_quarters")]
    pub threshold: f64,
    /// After how many frames the new ones are taken, at least 1. A frame that comes too early waits for them.
    #[serde(default = "ten")]
    pub frames: NonZeroU32,
}

fn five_quarters() -> f64 {
    1.25
}
fn ten() -> NonZeroU32 {
    NonZeroU32::MIN.saturating_add(9)
}

/// When a body falls asleep.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SleepSpec {
    /// The largest speed in m/s of a particle that still counts as rest, positive. Choose it below the speed after one
    /// frame of free fall (0.16 m/s at 0.016 s), or a body falls asleep before it falls.
    #[serde(default = "millimeter_per_second")]
    pub speed: f64,
    /// For how long in s a body must rest before it sleeps, positive.
    #[serde(default = "half_a_second")]
    pub time: f64,
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
    /// The defaults that go with a method: those of [`SolverSpec::default`], but
    ///
    /// * Jacobi, Chebyshev and VBD take 20 `iterations`, as one of theirs does little;
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

    /// The setting of the paper's experiments: frames of 0.016 s in a single step of many iterations, one constraint of
    /// a tet after the other, relaxation 0.8 for Gauss-Seidel and 0.1 for Jacobi and Chebyshev (table 3), SCGC colors
    /// on serial clusters of 10 that are never merged, nothing softened. The paper's convergence experiments take 500 iterations (section
    /// 5.1.1); how many its animations take it does not say. It has no VBD; with that, the keys that only
    /// constraints have keep their defaults.
    ///
    /// It is there to compare with, not to use: its kappa is far beyond what is accurate or even stable, as the paper's
    /// body has `young_modulus = 1e7`, `poisson_ratio = 0.49` and `damping = 0.05` (section 5.2; it does not give size
    /// and density).
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

    /// What a scene's text says about the solver, over the defaults of the preset and the method that it names.
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
