//! Pictures of deformable bodies: on a GPU without a copy, or by a software rasterizer.
//!
//! A [`Painting`] follows a [`Simulation`](incise::Simulation) through its cuts. A [`Renderer`] draws it as a [`Camera`] sees
//! it and a [`Style`] wants it: on a device, where the positions of a solver there are drawn from its own buffer, or on the
//! processor, with the same formulas and nearly the same pixels. [`Film`] and
//! [`contact_sheet`] put pictures together.

mod camera;
mod error;
mod film;
#[cfg(feature = "gpu")]
mod gpu;
mod impression;
mod normals;
mod painting;
mod palette;
mod picture;
mod props;
mod raster;
mod renderer;
mod shading;
mod sheet;
mod software;
mod srgb;
mod stretch;
mod style;
mod view;

pub use camera::Camera;
pub use error::RenderError;
pub use film::Film;
#[cfg(feature = "gpu")]
pub use gpu::{GpuRenderer, Shader, shaders};
pub use normals::normal_sums;
pub use painting::Painting;
pub use palette::Legend;
pub use picture::Picture;
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
