//! Vertex block descent (VBD), a primal method: particle by particle, on the potential of a backward Euler step.
//!
//! A step of backward Euler is the minimum of the incremental potential
//! `E(x) = ‖x - x̃‖²_M / (2 Δt²) + U(x)`, with `x̃` where the particles would be if they were free and `U` the Stable
//! Neo-Hookean energy `Σ V (μ/2 |F|² + l/2 (det F - γ)²)`. A sweep visits the particles in the colors of a particle
//! coloring and puts each into the minimum of `E` over its own position, all others held.
//!
//! That minimum is exact, not a Newton step towards it: `|F|²` is quadratic in a position and `det F` is *linear* in
//! it, so along one particle `E` is a convex quadratic with the matrix
//! `(m / Δt² + Σ μV |q|²) I + Σ lV (cof F q) (cof F q)ᵀ` (q the gradient of the particle's barycentric coordinate; the
//! sum runs over its tets). So no sweep raises the potential, whatever the stiffness, the step and the deformation, and
//! no line search is needed: nothing can overshoot. With over-relaxation by ω from 0 to 2 the same holds, because a
//! quadratic falls by `ω (2 - ω)` of the most it can.
//!
//! Sweeps reduce errors that vary from tet to tet, but hardly those that vary over the body, in
//! particular if it is stiff.
//! [`CoarseCorrection`] adds a truncated Newton step for the whole body, preconditioned by aggregates of particles.
//!
//! Source: Chen, Liu, Yang, Yuksel 2024 (vertex block VBD). Cost: see [`VertexStars`] and [`ImplicitStep::sweep`].

mod aggregates;
mod block;
mod cholesky;
mod coarse;
mod conjugate;
mod constraints;
mod corner_term;
mod correction;
mod hessian;
mod history;
mod matrix;
mod newton_matrix;
mod row_slices;
mod settings;
mod smoother;
mod star_update;
mod stars;
mod start;
mod state;
mod step;
mod sweep;
mod triangle;
mod vertex_stars;
mod viscosity;

/// Rows a thread takes at a time.
const PARALLEL_ROWS: usize = 512;

pub use correction::{CoarseCorrection, CoarseCorrectionReport, CoarseCorrectionSettings};
pub use settings::{Guess, Integrator, VbdSettings};
pub use step::{ImplicitStep, VbdReport};
pub use vertex_stars::VertexStars;
