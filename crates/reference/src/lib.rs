//! Reference solutions for soft bodies, as a ground truth for fast solvers.
//!
//! Stable Neo-Hookean tets by implicit Euler in double precision. Each step is solved by Newton's method, with an exact
//! Hessian and a sparse Cholesky factorization, until the unbalanced force is 1e-10 of the acting forces; a step that
//! does not reach this returns an error. [`ReferenceBody::settle`] finds static equilibria in the same way.
//!
//! ```
//! use glam::DVec3;
//! use incise_reference::{ReferenceBody, Material};
//!
//! // A row of two tets, held at three particles, sinks under its weight.
//! let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE];
//! let rubber = Material { young_modulus: 1e5, poisson_ratio: 0.45, density: 1000.0 };
//! let mut body = ReferenceBody::new(&rest, &[[0, 1, 2, 3], [1, 4, 2, 3]], |_tet| rubber)?;
//! body.fixed[..3].fill(true);
//! let gravity = DVec3::NEG_Z * 9.81;
//! body.settle(gravity)?;
//!
//! // In equilibrium the elastic forces carry the weight.
//! let weight = gravity * body.masses()[4];
//! assert!((body.elastic_forces()[4] + weight).length() < 1e-8 * weight.length());
//! // Without gravity it springs back and swings.
//! body.step(0.01, DVec3::ZERO)?;
//! assert!(body.velocities[4].z > 0.0);
//! # Ok::<(), incise_reference::ReferenceError>(())
//! ```
//!
//! Implicit Euler is of first order and adds damping; for small steps it converges to the exact motion of the tets. The
//! crate shares no code with the solvers that are compared with it.

mod body;
mod element;
mod error;
mod material;
mod newton;
mod pieces;
mod stable_neo_hookean;
mod symmetric;
mod system;

pub use body::{Energy, ReferenceBody};
pub use error::ReferenceError;
pub use material::Material;
pub use newton::Report;
pub use stable_neo_hookean::StableNeoHookean;
pub use symmetric::{Matrix9, clamp_eigenvalues};

/// The example of the README, run as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
