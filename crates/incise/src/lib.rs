//! Cuts soft bodies in real time.
//!
//! This is the facade: a [`Scene`] or a [`SimulationBuilder`] describes bodies, cuts and settings, and a [`Simulation`]
//! advances them frame by frame. The other crates of the workspace are usable alone and re-exported here: [`mesh`],
//! [`mesh_io`], [`meshing`], [`graph`], [`coloring`], [`clustering`], [`cutting`], [`contact`], [`xpbd`].
//!
//! ```
//! use incise::{Scene, Simulation};
//!
//! let mut scene = Scene::built_in(); // a liver, sliced by a moving blade
//! # scene.body[0].shape = Some(incise::scene::ShapeSpec::new("liver", 1000));
//! let mut simulation = Simulation::new(&scene)?;
//! for _ in 0..3 {
//!     let report = simulation.step()?;
//!     println!("frame {}: {} tets, {:.1} ms", report.frame, report.tets, report.ms.total);
//! }
//! let triangles = simulation.surface().triangles;
//! let positions = simulation.positions();
//! # assert!(!triangles.is_empty() && !positions.is_empty());
//! # Ok::<(), incise::Error>(())
//! ```

mod accuracy;
#[cfg(feature = "advise")]
pub mod advise;
mod attachment;
mod backend;
mod blade_sides;
mod budget;
mod collider;
mod compute_device;
mod contacts;
#[cfg_attr(not(feature = "gpu"), path = "no_device.rs")]
mod device;
mod distance;
mod edge_points;
mod error;
mod event;
mod forces;
mod grab;
mod island;
mod island_builder;
mod islands;
mod live_blade;
mod masses;
mod measure;
mod merged_mesh;
mod method;
mod names;
mod partition;
mod pieces;
mod pinned_cut;
mod ray;
mod recluster;
mod recuts;
mod region;
pub mod report;
mod resolved_body;
#[cfg(feature = "save")]
mod saved;
pub mod scene;
mod simulation;
mod sleep;
mod solid_blade;
mod solver_backend;
mod strokes;
mod substeps;
mod text;
mod tool;
mod unused_keys;
mod validate;
mod vbd;
mod volume;
mod warning;

pub use attachment::{AttachmentHandle, Support};
pub use collider::ColliderHandle;
pub use distance::DistanceHandle;
pub use error::{Error, clustering_suggestion, coloring_suggestion, shape_suggestion};
pub use event::Event;
pub use grab::Grab;
pub use incise_clustering as clustering;
pub use incise_coloring as coloring;
pub use incise_contact as contact;
pub use incise_cutting as cutting;
#[cfg(feature = "gpu")]
pub use incise_gpu as gpu;
pub use incise_graph as graph;
pub use incise_mesh as mesh;
pub use incise_mesh_io as mesh_io;
pub use incise_meshing as meshing;
pub use incise_xpbd as xpbd;
pub use ray::RayHit;
pub use report::FrameReport;
pub use scene::Scene;
pub use simulation::{Body, BodyHandle, Simulation, SimulationBuilder, Snapshot};
pub use warning::{Warning, WarningCode};

/// The example of the README, run as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

/// The example of the README of the workspace, run as a test.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct WorkspaceReadme;
