//! [`Method`]: how a substep is solved, and [`TetSolve`]: the constraints of a tet.

use serde::{Deserialize, Serialize};

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
