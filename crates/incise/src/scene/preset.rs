//! [`Preset`]: a setting of the solver under one name, whose single keys can still be overridden.
//!
//! The keys that a scene names are laid over those of the preset, so a preset is a set of other defaults. The defaults
//! of a method that is not the default one are treated the same way.

use serde::{Deserialize, Serialize};

use super::{Method, SolverSpec, Substeps, TetSolve};
use crate::Error;

/// Other defaults for the keys of `[solver]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Preset {
    /// That of the paper: see [`SolverSpec::paper`].
    Paper,
}

impl SolverSpec {
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
