//! [`Method`]: how a substep is solved, and the defaults that go with it.

use serde::{Deserialize, Serialize};

use super::SolverSpec;

/// How a substep is solved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Method {
    /// Gauss-Seidel, and two-level VBD for each body of which the accuracy needs more than `max_substeps`. VBD is taken
    /// only where `substeps`, `iterations`, `relaxation`, `tet_solve` and `kappa_limit` have their defaults, not on a GPU, and
    /// not in scenes with colliders: an impact of a stiff body does not converge in a frame.
    #[default]
    Auto,
    /// Color after color, each constraint seeing the corrections before it.
    GaussSeidel,
    /// All constraints at once, corrections added up: see `incise_xpbd::Method::Jacobi`.
    Jacobi,
    /// Jacobi, extrapolated: see `incise_xpbd::Method::Chebyshev`.
    Chebyshev,
    /// No XPBD: particle by particle into the minimum of the implicit step's potential, see
    /// `incise_xpbd::Solver::step_vbd`. Stable at any stiffness.
    Vbd,
}

/// The rule by which VBD advances in time: see `incise_xpbd::Integrator`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Integrator {
    /// The backward differentiation formula of two steps, second order.
    #[default]
    Bdf2,
    /// Implicit Euler, first order: it damps vibrations much more.
    ImplicitEuler,
}

impl Integrator {
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// How the elastic energy of a tet is solved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum TetSolve {
    /// A shear part and a volume part that vanish at rest: bounded at any stiffness.
    #[default]
    Split,
    /// `|F|` and `det F` as one system of two unknowns: unstable from a kappa of about 2 on unless `kappa_limit` softens.
    Block,
    /// One after the other, as in the paper.
    Sequential,
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
}
