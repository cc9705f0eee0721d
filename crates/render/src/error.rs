//! [`RenderError`]: why a picture or a film could not be made, and what to do about it.

use std::path::PathBuf;

use thiserror::Error;

/// Why something could not be drawn or written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RenderError {
    /// A picture of a size that cannot be drawn.
    #[error("a picture of {width} x {height} pixels: {range}")]
    Size {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
        /// What is allowed.
        range: String,
    },
    /// A name that means no coloring.
    #[error("unknown coloring '{given}': known are {known}")]
    UnknownColoring {
        /// What was given.
        given: String,
        /// The names of all.
        known: &'static str,
    },
    /// Residuals are to be shown, and none were given.
    #[error("colors by residual need a residual of each tet")]
    NoResiduals,
    /// The number of given residuals is not the number of tets.
    #[error("{given} residuals were given for {tets} tets")]
    Residuals {
        /// How many were given.
        given: usize,
        /// How many tets there are.
        tets: usize,
    },
    /// An animation in a format that is not supported.
    #[error("{}: unknown ending; animations are written as {known}", .path.display())]
    UnknownAnimation {
        /// The file.
        path: PathBuf,
        /// The endings that are.
        known: &'static str,
    },
    /// An animation with a frame time that its format cannot store.
    #[error("an animation with {given} s for each image; use 0.01 s to 10 s")]
    FrameTime {
        /// What was asked for.
        given: f64,
    },
    /// An image whose size is not that of its animation.
    #[error(
        "an image of {width} x {height} pixels in an animation of {animation_width} x {animation_height} pixels"
    )]
    OtherSize {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
        /// Those of the film.
        animation_width: u32,
        /// Those of the film.
        animation_height: u32,
    },
    /// A film without a picture.
    #[error("{}: an animation needs an image", .path.display())]
    EmptyFilm {
        /// The file.
        path: PathBuf,
    },
    /// A file could not be read or written.
    #[error("cannot {action} {}: {source}", .path.display())]
    Io {
        /// What was tried: `read` or `write`.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// Why it failed.
        source: std::io::Error,
    },
    /// The simulation could not say where its particles are.
    #[error(transparent)]
    Simulation(#[from] incise::Error),
    /// The device cannot draw, or is lost.
    #[cfg(feature = "gpu")]
    #[error(transparent)]
    Gpu(#[from] incise::gpu::GpuError),
    /// The device lacks what drawing needs.
    #[cfg(feature = "gpu")]
    #[error("the GPU {adapter} cannot draw: {reason}")]
    Unable {
        /// The adapter's name.
        adapter: String,
        /// What it lacks.
        reason: String,
    },
}
