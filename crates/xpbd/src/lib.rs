//! Soft bodies of Stable Neo-Hookean tetrahedra, solved by XPBD (colored Gauss-Seidel) or vertex block descent.
//!
//! A [`Solver`] holds particles and tets in single or double precision. [`Solver::step`] advances it by a frame of XPBD
//! over an `incise_graph::Schedule`, [`Solver::step_vbd`] by a frame of VBD. Results are bit-identical for any number
//! of threads.
//!
//! ```
//! use glam::DVec3;
//! use incise_graph::{Clustering, ColorId, Coloring, Schedule};
//! use incise_xpbd::{Material, Solver, StepSettings};
//!
//! // A tet of rubber hangs from one corner.
//! let rest = [DVec3::ZERO, DVec3::Y, DVec3::X, DVec3::NEG_Z]; // in an order that makes its volume positive
//! let mut solver = Solver::<f32>::new(&rest);
//! let rubber = solver.add_material(Material {
//!     young_modulus: 1e5,
//!     poisson_ratio: 0.45,
//!     density: 1000.0,
//!     damping: 0.01,
//! })?;
//! solver.push_tet([0, 1, 2, 3], rest, rubber);
//! for p in 0..4 {
//!     solver.set_mass(p, 1000.0 / 6.0 / 4.0);
//! }
//! solver.set_fixed(0, true);
//!
//! let schedule = Schedule::new(&Clustering::none(1), &Coloring::new(vec![ColorId(0)]));
//! let settings = StepSettings { substeps: 4, gravity: Some(DVec3::new(0.0, 0.0, -9.81)), ..StepSettings::new(0.016) };
//! for _ in 0..60 {
//!     let report = solver.step(&schedule, &settings)?;
//!     assert_eq!(report.repaired, 0);
//! }
//! assert_eq!(solver.position(0), DVec3::ZERO);
//! assert_eq!(solver.volume().inverted, 0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Limit of XPBD: iterating a large step does not converge to the implicit solution of that step, because XPBD leaves
//! out the primal residual. Use substeps and watch [`Solver::kappa`], or VBD.

mod changes;
mod collider;
mod constraints;
mod damping;
mod degeneracy_jitter;
mod device;
mod direction;
mod erased;
mod error;
mod float;
mod floating_origin;
mod force;
mod forces;
mod gauss_seidel;
mod jacobi;
mod layout;
mod material;
mod measure;
mod neo_hookean;
mod pace;
mod particles;
mod pose;
mod real;
mod residuals;
mod settings;
mod simd_kernel;
mod solver;
mod stepper;
mod substep;
mod team;
mod tets;
mod transpose;
mod vbd;
mod wide;

pub use changes::Changes;
pub use collider::{Collider, ColliderShape};
pub use constraints::{
    AttachmentData, ContactData, ContactFactors, ContactLaw, ContactRound, ContactState,
    DistanceConstraint, DistanceData, EdgeContact, EdgePoint, FaceContact, FaceLimit, PairContact,
    SolidBlade, SurfaceContact, VolumeConstraint, VolumeData,
};
pub use device::TetData;
pub use erased::ErasedSolver;
pub use error::XpbdError;
pub use float::Float;
#[doc(hidden)]
pub use float::Saved;
pub use force::Force;
pub use forces::Forces;
pub use layout::OrderedTet;
pub use material::Material;
pub use measure::{Energy, Softened, Volume};
pub use pose::Pose;
pub use real::Real;
pub use residuals::Residuals;
pub use settings::{Method, StepSettings, TetSolve, shortest_substep_of_f32};
pub use solver::Solver;
pub use stepper::StepReport;
pub use tets::KappaLimit;
pub use vbd::{
    CoarseCorrection, CoarseCorrectionReport, CoarseCorrectionSettings, Guess, ImplicitStep,
    Integrator, VbdReport, VbdSettings, VertexStars,
};

/// The example of the README, run as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
