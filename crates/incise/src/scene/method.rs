//! [`Method`]: the solver of a substep, [`Integrator`]: its time integration, and [`TetSolve`]: the constraints of a tet.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The solver of a substep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Method {
    /// Gauss-Seidel, or two-level VBD for a body whose accuracy needs more than `max_substeps`. VBD is chosen only where
    /// `substeps`, `iterations`, `relaxation`, `tet_solve` and `kappa_limit` have their defaults, not on a GPU, and not in
    /// scenes with contact or colliders, where an impact of a stiff body does not converge within a frame.
    #[default]
    Auto,
    /// XPBD by colored Gauss-Seidel: each constraint uses the corrections of those before it.
    GaussSeidel,
    /// XPBD by Jacobi: all constraints are solved from one state and their corrections are added up.
    Jacobi,
    /// XPBD by Jacobi with Chebyshev extrapolation.
    Chebyshev,
    /// Vertex block descent: minimizes the potential of an implicit step, particle by particle. Stable at any stiffness.
    Vbd,
}

/// The time integration of VBD.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Integrator {
    /// The backward differentiation formula of two steps, second order.
    #[default]
    Bdf2,
    /// Implicit Euler, first order: damps vibrations much more.
    ImplicitEuler,
}

impl Integrator {
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// The constraints that stand for the elastic energy of a tet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum TetSolve {
    /// A shear part and a volume part that both vanish at rest: bounded at any stiffness.
    #[default]
    Split,
    /// `|F|` and `det F` as one system of two unknowns: stable up to a kappa of 1, unstable from 4 on unless `kappa_limit` softens.
    Block,
    /// `|F|` and `det F` in sequence, the paper's form.
    Sequential,
}
