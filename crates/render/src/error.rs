//! [`RenderError`]: errors of drawing and of writing images and animations.

use std::path::PathBuf;

use thiserror::Error;

/// Error of drawing or writing an image or an animation.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RenderError {
    /// An image size that cannot be drawn.
    #[error("a picture of {width} x {height} pixels: {range}")]
    Size {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// Allowed range.
        range: String,
    },
    /// Unknown name of a [`ColorBy`](crate::ColorBy).
    #[error("unknown coloring '{given}': known are {known}")]
    UnknownColoring {
        /// Name given.
        given: String,
        /// List of known names.
        known: &'static str,
    },
    /// Coloring by residual without residuals.
    #[error("colors by residual need a residual of each tet")]
    NoResiduals,
    /// Number of residuals that differs from the number of tets.
    #[error("{given} residuals were given for {tets} tets")]
    Residuals {
        /// Number of residuals given.
        given: usize,
        /// Number of tets.
        tets: usize,
    },
    /// An animation in a format that is not supported.
    #[error("{}: unknown ending; animations are written as {known}", .path.display())]
    UnknownAnimation {
        /// The file.
        path: PathBuf,
        /// List of supported extensions.
        known: &'static str,
    },
    /// An animation with a frame time that its format cannot store.
    #[error("an animation with {given} s for each image; use 0.01 s to 10 s")]
    FrameTime {
        /// Time given, in s.
        given: f64,
    },
    /// An image whose size is not that of its animation.
    #[error(
        "an image of {width} x {height} pixels in an animation of {animation_width} x {animation_height} pixels"
    )]
    OtherSize {
        /// Width of the image in pixels.
        width: u32,
        /// Height of the image in pixels.
        height: u32,
        /// Width of the animation in pixels.
        animation_width: u32,
        /// Height of the animation in pixels.
        animation_height: u32,
    },
    /// An animation without images.
    #[error("{}: an animation needs an image", .path.display())]
    EmptyFilm {
        /// The file.
        path: PathBuf,
    },
    /// A file could not be read or written.
    #[error("cannot {action} {}: {source}", .path.display())]
    Io {
        /// Failed action: `read` or `write`.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// Positions could not be read from the simulation.
    #[error(transparent)]
    Simulation(#[from] incise::Error),
    /// Device error while drawing.
    #[cfg(feature = "gpu")]
    #[error(transparent)]
    Gpu(#[from] incise::gpu::GpuError),
    /// The device lacks a required feature or limit.
    #[error("the GPU {adapter} cannot draw: {reason}")]
    Unable {
        /// The adapter's name.
        adapter: String,
        /// Missing feature or limit.
        reason: String,
    },
}
