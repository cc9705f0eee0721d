//! Images of deformable bodies: drawn on a GPU without copying positions, or by a software rasterizer.
//!
//! A [`RenderScene`] tracks the surface of a [`Simulation`](incise::Simulation) through its cuts. A [`Renderer`] draws
//! it for a [`Camera`] and a [`Style`]: on a device, from the solver's own position buffer, or on the processor, with
//! the same formulas and nearly equal pixels. [`Animation`] and [`contact_sheet`] combine several images.

mod animation;
mod camera;
mod contact_shadow;
mod error;
#[cfg_attr(not(feature = "gpu"), path = "no_gpu.rs")]
mod gpu;
mod image;
mod normals;
mod palette;
mod props;
mod raster;
mod render_scene;
mod renderer;
mod rims;
mod shading;
mod sheet;
mod software;
mod srgb;
mod stretch;
mod style;
mod view;

pub use animation::Animation;
pub use camera::Camera;
pub use error::RenderError;
#[cfg(feature = "gpu")]
pub use gpu::{GpuRenderer, Shader, shaders};
pub use image::Image;
pub use normals::normal_sums;
pub use palette::Legend;
pub use render_scene::RenderScene;
pub use renderer::Renderer;
pub use sheet::contact_sheet;
pub use software::software_picture;
pub use stretch::stretch;
pub use style::{ColorBy, Style};
pub use view::LARGEST_SIDE;

/// The example of the README, run as a test.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
