//! Input of `incise color`: the tets of a mesh, or the vertices of a graph file.
//!
//! The two differ in three points: the reader, the allowed clusterings, and the proof that a coloring is proper. A mesh
//! is colored directly from the particles of its tets, without a graph.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use anyhow::{Context, anyhow};
use incise::clustering::{Method, cluster, serial_neighbor};
use incise::coloring::Conflicts;
use incise::graph::{
    Clustering, Coloring, ConstraintGraph, GraphError, Incidence, read_dimacs, read_matrix_market,
};
use incise::mesh::TetMesh;
use incise::mesh_io::{self, MeshIoError};

use crate::failure::Failure;

/// File format by extension.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Format {
    /// Any mesh format.
    Mesh,
    /// `.mtx`
    MatrixMarket,
    /// `.col`
    Dimacs,
}

/// Content of the file.
#[derive(Debug)]
pub(crate) enum Source {
    Mesh(TetMesh),
    Graph(ConstraintGraph),
}

/// Conflict structure to be colored.
#[derive(Debug)]
pub(crate) enum Problem {
    /// Tets of a mesh; they conflict if they share a particle.
    Mesh(Incidence),
    Graph(ConstraintGraph),
}

/// Result of the independent check of a coloring.
#[derive(Debug)]
pub(crate) struct Proof {
    /// True if the coloring is proper, judged by the input alone.
    pub(crate) verified: bool,
    /// Size of a clique of clusters: for a mesh the largest number at one particle, for a graph the largest clique of a
    /// greedy search. It is a lower bound of the number of colors.
    pub(crate) clique: usize,
    /// Number of pairs of conflicting clusters.
    pub(crate) edges: usize,
}

impl Format {
    pub(crate) fn of(path: &Path) -> Self {
        let ending = path.extension().unwrap_or_default().to_string_lossy();
        match ending.to_ascii_lowercase().as_str() {
            "mtx" => Self::MatrixMarket,
            "col" => Self::Dimacs,
            _ => Self::Mesh,
        }
    }

    /// Returns an error for a clustering that the format does not support.
    pub(crate) fn require(self, method: Method) -> anyhow::Result<()> {
        match (self, method) {
            (Self::Mesh, _) | (_, Method::None | Method::Serial(_) | Method::SerialLoose(_)) => {
                Ok(())
            }
            _ => Err(anyhow!(
                "the clustering '{method}' needs the particles of a mesh: use none or serial:K for a graph"
            )),
        }
    }

    pub(crate) fn read(self, path: &Path) -> Result<Source, Failure> {
        match self {
            Self::Mesh => read_mesh(path).map(Source::Mesh),
            Self::MatrixMarket => read_graph(path, read_matrix_market),
            Self::Dimacs => read_graph(path, read_dimacs),
        }
    }
}

fn read_mesh(path: &Path) -> Result<TetMesh, Failure> {
    let mesh = mesh_io::read(path).map_err(|error| match error {
        MeshIoError::UnknownFormat { .. } => {
            Failure::Input(anyhow!("{error}; .mtx or .col for a graph"))
        }
        _ => error.into(),
    })?;
    mesh.check()
        .with_context(|| path.display().to_string())
        .map_err(Failure::Input)?;
    Ok(mesh)
}

fn read_graph(
    path: &Path,
    read: impl Fn(BufReader<File>) -> Result<ConstraintGraph, GraphError>,
) -> Result<Source, Failure> {
    let name = path.display();
    let result = match File::open(path) {
        Ok(file) => read(BufReader::new(file)).map_err(|error| match error {
            GraphError::Malformed { line, message } => anyhow!("{name}:{line}: {message}"),
            GraphError::Unreadable { message, .. } => anyhow!("cannot read {name}: {message}"),
            _ => anyhow!("{name}: {error}"),
        }),
        Err(error) => Err(anyhow!("cannot read {name}: {error}")),
    };
    result.map(Source::Graph).map_err(Failure::Input)
}

impl Source {
    /// Determines which constraints or vertices conflict.
    pub(crate) fn problem(self) -> anyhow::Result<Problem> {
        match self {
            Self::Graph(graph) => Ok(Problem::Graph(graph)),
            Self::Mesh(mesh) => {
                let incidence = Incidence::from_constraints(mesh.positions.len(), mesh.tets)?;
                Ok(Problem::Mesh(incidence))
            }
        }
    }
}

impl Problem {
    pub(crate) fn vertex_count(&self) -> usize {
        match self {
            Self::Mesh(incidence) => incidence.constraint_count(),
            Self::Graph(graph) => graph.vertex_count(),
        }
    }

    /// Clusters by a method that the format allows.
    pub(crate) fn cluster(&self, method: Method) -> Clustering {
        match self {
            Self::Mesh(incidence) => cluster(method, incidence),
            Self::Graph(graph) => serial_neighbor(graph, method.max_size()),
        }
    }

    /// Number of particles; 0 for a graph.
    pub(crate) fn particle_count(&self) -> usize {
        match self {
            Self::Mesh(incidence) => incidence.particle_count(),
            Self::Graph(_) => 0,
        }
    }

    /// Checks a coloring of the clusters without the cluster graph that it was made from: a mesh by its particles, a
    /// graph by its edges between different clusters.
    pub(crate) fn check(&self, clustering: &Clustering, coloring: &Coloring) -> Proof {
        match self {
            Self::Mesh(incidence) => {
                let clusters = incidence.quotient(clustering);
                Proof {
                    verified: coloring.verify_incidence(&clusters).is_ok(),
                    clique: clusters.clique_bound(),
                    edges: ConstraintGraph::from_incidence(&clusters).edge_count(),
                }
            }
            Self::Graph(graph) => {
                let labels = clustering.labels();
                let mut apart = graph
                    .edges()
                    .map(|(a, b)| (labels[a as usize], labels[b as usize]))
                    .filter(|(a, b)| a != b);
                let clusters = graph.quotient(clustering);
                let verified = coloring.vertex_count() == clustering.cluster_count()
                    && apart.all(|(a, b)| coloring.color(a.index()) != coloring.color(b.index()));
                Proof {
                    verified,
                    clique: clusters.clique_bound(),
                    edges: clusters.edge_count(),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use incise::graph::{ClusterId, ColorId};

    /// A path of three springs, as incidence and as graph, in two clusters or three.
    #[test]
    fn only_proper_colorings_are_verified() -> anyhow::Result<()> {
        let incidence = Incidence::from_constraints(4, [[0u32, 1], [1, 2], [2, 3]])?;
        let problems = [
            Problem::Graph(ConstraintGraph::from_incidence(&incidence)),
            Problem::Mesh(incidence),
        ];
        for problem in &problems {
            for (labels, colors, verified) in [
                ([0, 1, 2], &[0, 1, 0][..], true),
                ([0, 1, 2], &[0, 1, 1], false),
                ([0, 0, 1], &[0, 1], true),
                ([0, 0, 1], &[1, 1], false),
            ] {
                let clustering = Clustering::from_labels(labels.map(ClusterId).to_vec())?;
                let coloring = Coloring::new(colors.iter().copied().map(ColorId).collect());
                let proof = problem.check(&clustering, &coloring);
                assert_eq!((proof.verified, proof.clique), (verified, 2), "{problem:?}");
            }
        }
        Ok(())
    }
}
