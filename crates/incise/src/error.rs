//! [`Error`]: errors of scenes and simulations.

use std::path::PathBuf;

use incise_clustering::{ClusteringError, Method};
use incise_coloring::{Algorithm, ColoringError};
use incise_cutting::CutError;
use incise_graph::GraphError;
use incise_mesh::MeshError;
use incise_mesh_io::MeshIoError;
use incise_meshing::{MeshingError, Shape};
use incise_xpbd::XpbdError;

use crate::names::suggestion;

/// Why a scene could not be read or run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A scene file could not be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// A scene is not valid TOML or has a key that does not exist or has the wrong type.
    #[error("{}{message}", line.map_or(String::new(), |line| format!("line {line}: ")))]
    Parse {
        /// The line, counted from 1, if known.
        line: Option<usize>,
        /// Description of the problem.
        message: String,
    },
    /// A value of a scene lies outside its range.
    #[error("{field} is {value}: it must be {range}")]
    Value {
        /// The key, as in `body[0].scale`.
        field: String,
        /// Its value.
        value: String,
        /// Allowed values.
        range: String,
    },
    /// The mesh of a body is invalid.
    #[error("{field}: {source}")]
    Mesh {
        /// The body.
        field: String,
        /// Cause.
        source: MeshError,
    },
    /// The mesh file of a body could not be read.
    #[error("{field}: {source}")]
    MeshFile {
        /// The body.
        field: String,
        /// Cause.
        source: MeshIoError,
    },
    /// The shape of a body could not be generated.
    #[error("{field}: {source}{}", shape_suggestion(source))]
    Shape {
        /// The body.
        field: String,
        /// Cause.
        source: MeshingError,
    },
    /// A material or a solver setting is invalid.
    #[error("{field}.{source}")]
    Xpbd {
        /// The part of the scene.
        field: String,
        /// Cause.
        source: XpbdError,
    },
    /// A stroke is invalid or could not be carried out.
    #[error("{field}: {source}")]
    Cut {
        /// The stroke.
        field: String,
        /// Cause.
        source: CutError,
    },
    /// The name of a coloring is unknown or its parameters are invalid.
    #[error("solver.coloring: {}{}", .0, coloring_suggestion(.0))]
    Coloring(#[from] ColoringError),
    /// The name of a clustering is unknown or its parameters are invalid.
    #[error("solver.clustering: {}{}", .0, clustering_suggestion(.0))]
    Clustering(#[from] ClusteringError),
    /// A derived structure disagrees with its source: a defect of this library.
    #[error("internal check failed: {0}")]
    Inconsistent(String),
    /// A GPU was requested, but this build lacks the feature `gpu`.
    #[error("solver.backend is gpu, and this build has no GPU path: build with `--features gpu`")]
    NoGpuPath,
    /// An error of the GPU.
    #[cfg(feature = "gpu")]
    #[error(transparent)]
    Gpu(#[from] incise_gpu::GpuError),
    /// Settings could not be compared.
    #[cfg(feature = "advise")]
    #[error("{0}")]
    Advise(String),
    /// The threads could not be started.
    #[error("cannot start {threads} threads: {message}")]
    Threads {
        /// Number of threads.
        threads: usize,
        /// Cause.
        message: String,
    },
}

impl Error {
    /// Returns the scene key that the error concerns, as in `body[0].scale`, if there is one.
    #[must_use]
    pub fn key(&self) -> Option<String> {
        match self {
            Self::Value { field, .. }
            | Self::Mesh { field, .. }
            | Self::MeshFile { field, .. }
            | Self::Shape { field, .. }
            | Self::Cut { field, .. } => Some(field.clone()),
            Self::Xpbd { field, source } => Some(match source {
                XpbdError::Material { what, .. } | XpbdError::Setting { what, .. } => {
                    format!("{field}.{what}")
                }
                _ => field.clone(),
            }),
            Self::Coloring(_) => Some("solver.coloring".to_owned()),
            Self::Clustering(_) => Some("solver.clustering".to_owned()),
            Self::NoGpuPath => Some("solver.backend".to_owned()),
            _ => None,
        }
    }
}

/// The nearest known shape, as the end of a message; empty for other errors.
#[must_use]
pub fn shape_suggestion(error: &MeshingError) -> String {
    match error {
        MeshingError::UnknownShape { name, .. } => suggestion(name, Shape::NAMES),
        _ => String::new(),
    }
}

/// The nearest known coloring algorithm, as the end of a message; empty for other errors.
#[must_use]
pub fn coloring_suggestion(error: &ColoringError) -> String {
    match error {
        ColoringError::UnknownAlgorithm { name, .. } => suggestion(name, Algorithm::NAMES),
        _ => String::new(),
    }
}

/// The nearest known clustering, as the end of a message; empty for other errors.
#[must_use]
pub fn clustering_suggestion(error: &ClusteringError) -> String {
    match error {
        ClusteringError::UnknownMethod { text } => suggestion(text, Method::NAMES),
        _ => String::new(),
    }
}

impl Error {
    /// Wraps an error of a solver about a part of the scene.
    pub(crate) fn xpbd(field: &str) -> impl FnOnce(XpbdError) -> Self {
        move |source| Self::Xpbd {
            field: field.to_owned(),
            source,
        }
    }

    /// Wraps an error of a cut by a part of the scene.
    pub(crate) fn cut(field: &str) -> impl FnOnce(CutError) -> Self {
        move |source| Self::Cut {
            field: field.to_owned(),
            source,
        }
    }
}

impl From<GraphError> for Error {
    fn from(error: GraphError) -> Self {
        Self::Inconsistent(error.to_string())
    }
}
