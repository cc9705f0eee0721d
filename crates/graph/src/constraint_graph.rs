//! Conflicts between constraints or clusters: an undirected graph in flat arrays.
//!
//! A vertex is a constraint or a cluster; an edge joins two that share a particle. Rows are
//! symmetric, ascending and free of loops and repeats. All algorithms rely on this, so only this
//! module builds graphs.
//!
//! All constructors end in one step: given the *smaller* neighbors of every vertex in any order,
//! one transposition lists the larger neighbors in ascending order, and a second one the smaller
//! ones; a row is the concatenation of both. No row is sorted and no hash map is used: O(vertices +
//! edges) after the edges are known.

use std::cmp::Ordering;

use crate::csr::{Csr, fits, offset};
use crate::{Clustering, GraphError, Incidence};

/// An undirected graph on the vertices `0..vertex_count()`, in CSR form.
///
/// Both directions of an edge are stored, so a graph has fewer than 2^31 edges.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConstraintGraph {
    csr: Csr,
}

impl ConstraintGraph {
    /// The graph of the constraints that share a particle.
    ///
    /// Walks constraint -> particles -> smaller constraints with a stamp array: O(sum over
    /// particles of valence squared), which is what listing the conflicts pair by pair costs.
    ///
    /// # Panics
    /// If there are 2^31 edges or more (a single particle with 65,537 constraints has that many).
    ///
    /// ```
    /// use incise_graph::{ConstraintGraph, Incidence};
    ///
    /// let triangles = Incidence::from_constraints(5, [[0u32, 1, 2], [1, 2, 3], [3, 4, 0]])?;
    /// let graph = ConstraintGraph::from_incidence(&triangles);
    /// assert_eq!(graph.neighbors(0), [1, 2]);
    /// assert_eq!(graph.edge_count(), 3);
    /// # Ok::<(), incise_graph::GraphError>(())
    /// ```
    #[must_use]
    pub fn from_incidence(incidence: &Incidence) -> Self {
        let vertices = incidence.constraint_count();
        let mut stamp = vec![u32::MAX; vertices];
        let mut smaller = Csr::with_rows(vertices);
        for c in 0..offset(vertices) {
            for &p in incidence.particles_of(c as usize) {
                for &d in incidence
                    .constraints_of(p as usize)
                    .iter()
                    .take_while(|&&d| d < c)
                {
                    if stamp[d as usize] != c {
                        stamp[d as usize] = c;
                        smaller.values.push(d);
                    }
                }
            }
            smaller.end_row();
        }
        Self::from_smaller(&smaller)
    }

    /// The graph with the given edges, in any order and direction; repeated edges count once.
    ///
    /// O(vertices + edges log edges).
    ///
    /// # Errors
    /// An edge to a vertex not below `vertices`, an edge from a vertex to itself, too many vertices
    /// or edges.
    ///
    /// ```
    /// use incise_graph::ConstraintGraph;
    ///
    /// let graph = ConstraintGraph::from_edges(3, &[(2, 0), (0, 2), (1, 2)])?;
    /// assert_eq!(graph.neighbors(2), [0, 1]);
    /// # Ok::<(), incise_graph::GraphError>(())
    /// ```
    pub fn from_edges(vertices: usize, edges: &[(u32, u32)]) -> Result<Self, GraphError> {
        fits("vertices", vertices)?;
        for (edge, &(a, b)) in edges.iter().enumerate() {
            let vertex = a.max(b);
            if vertex as usize >= vertices {
                return Err(GraphError::VertexOutOfRange {
                    edge,
                    vertex,
                    vertices,
                });
            }
            if a == b {
                return Err(GraphError::SelfLoop { edge, vertex });
            }
        }
        let mut pairs: Vec<(u32, u32)> = edges.iter().map(|&(a, b)| (a.max(b), a.min(b))).collect();
        pairs.sort_unstable();
        pairs.dedup();
        fits("directed edges", 2 * pairs.len())?;
        let mut smaller = Csr::with_rows(vertices);
        let mut rest = pairs.into_iter().peekable();
        for vertex in 0..offset(vertices) {
            while let Some((_, small)) = rest.next_if(|&(large, _)| large == vertex) {
                smaller.values.push(small);
            }
            smaller.end_row();
        }
        Ok(Self::from_smaller(&smaller))
    }

    /// Takes a graph in CSR form: vertex `v` is adjacent to `values[offsets[v]..offsets[v + 1]]`.
    ///
    /// A row may list its neighbors in any order and name one several times; rows are sorted and
    /// repeats count once. Both directions of an edge are required. O(vertices + values), by two
    /// transpositions: the first finds for each vertex the rows that list it, the second sorts the
    /// rows, and the graph is symmetric if both agree.
    ///
    /// # Errors
    /// Offsets that do not start at 0, go down or end elsewhere than at `values.len()`; a neighbor
    /// that does not exist; a vertex that is its own neighbor; an edge in one direction only, the
    /// first by smaller, then by larger end; more than `u32::MAX` vertices or values.
    ///
    /// ```
    /// use incise_graph::{ConstraintGraph, GraphError};
    ///
    /// let path = ConstraintGraph::from_csr(vec![0, 1, 3, 4], vec![1, 2, 0, 1])?;
    /// assert_eq!(path.neighbors(1), [0, 2]);
    ///
    /// let one_sided = ConstraintGraph::from_csr(vec![0, 1, 1], vec![1]);
    /// assert_eq!(one_sided, Err(GraphError::OneSided { from: 0, to: 1 }));
    /// # Ok::<(), incise_graph::GraphError>(())
    /// ```
    pub fn from_csr(offsets: Vec<u32>, values: Vec<u32>) -> Result<Self, GraphError> {
        fits("vertices", offsets.len().saturating_sub(1))?;
        fits("directed edges", values.len())?;
        let rows = Csr::new(offsets, values)?;
        let vertices = rows.row_count();
        let ends = (0..)
            .zip(rows.rows())
            .flat_map(|(v, row)| row.iter().map(move |&u| (v, u)));
        for (edge, (v, vertex)) in ends.enumerate() {
            if vertex as usize >= vertices {
                return Err(GraphError::VertexOutOfRange {
                    edge,
                    vertex,
                    vertices,
                });
            }
            if vertex == v {
                return Err(GraphError::SelfLoop { edge, vertex });
            }
        }
        let listed_by = rows.transpose(vertices);
        let sorted = listed_by.transpose(vertices);
        let mut csr = Csr::with_rows(vertices);
        for (v, (row, back)) in (0..).zip(sorted.rows().zip(listed_by.rows())) {
            let (mut row, mut back) = (distinct(row), distinct(back));
            loop {
                // Where the two differ, the smaller one is missing in the other list.
                match (row.next(), back.next()) {
                    (None, None) => break,
                    (Some(to), None) => return Err(GraphError::OneSided { from: v, to }),
                    (None, Some(from)) => return Err(GraphError::OneSided { from, to: v }),
                    (Some(to), Some(from)) => match to.cmp(&from) {
                        Ordering::Less => return Err(GraphError::OneSided { from: v, to }),
                        Ordering::Greater => return Err(GraphError::OneSided { from, to: v }),
                        Ordering::Equal => csr.values.push(to),
                    },
                }
            }
            csr.end_row();
        }
        Ok(Self { csr })
    }

    /// Row `v` of `smaller` lists the neighbors of `v` below `v`, once each, in any order.
    fn from_smaller(smaller: &Csr) -> Self {
        let vertices = smaller.row_count();
        let larger = smaller.transpose(vertices);
        let smaller = larger.transpose(vertices);
        let mut csr = Csr::with_rows(vertices);
        csr.values.reserve_exact(2 * larger.values.len());
        for (below, above) in smaller.rows().zip(larger.rows()) {
            csr.values.extend_from_slice(below);
            csr.values.extend_from_slice(above);
            csr.end_row();
        }
        Self { csr }
    }

    /// The graph of the clusters: two clusters are adjacent if a member of one is adjacent to a
    /// member of the other. Vacant clusters become vertices without neighbors. O(vertices + edges).
    ///
    /// # Panics
    /// If `clustering` has another number of constraints than the graph has vertices.
    ///
    /// ```
    /// use incise_graph::{ClusterId, Clustering, ConstraintGraph};
    ///
    /// let path = ConstraintGraph::from_edges(4, &[(0, 1), (1, 2), (2, 3)])?;
    /// let pairs = Clustering::from_labels([0, 0, 1, 1].map(ClusterId).to_vec())?;
    /// assert_eq!(path.quotient(&pairs), ConstraintGraph::from_edges(2, &[(0, 1)])?);
    /// # Ok::<(), incise_graph::GraphError>(())
    /// ```
    #[must_use]
    pub fn quotient(&self, clustering: &Clustering) -> Self {
        assert_eq!(
            clustering.constraint_count(),
            self.vertex_count(),
            "one label per vertex"
        );
        let labels = clustering.labels();
        let members = clustering.members();
        let mut stamp = vec![u32::MAX; members.count()];
        let mut smaller = Csr::with_rows(members.count());
        for (a, cluster) in (0..).zip(members.iter()) {
            for &v in cluster {
                for &u in self.neighbors(v as usize) {
                    let b = labels[u as usize].0;
                    // Also skips neighbors in no cluster: their label is above every number.
                    if b < a && stamp[b as usize] != a {
                        stamp[b as usize] = a;
                        smaller.values.push(b);
                    }
                }
            }
            smaller.end_row();
        }
        Self::from_smaller(&smaller)
    }

    /// The number of vertices.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.csr.row_count()
    }

    /// The number of undirected edges.
    #[must_use]
    pub fn edge_count(&self) -> usize {
        self.csr.values.len() / 2
    }

    /// The neighbors of `v`, ascending, without `v`.
    ///
    /// # Panics
    /// If there is no vertex `v`.
    #[must_use]
    pub fn neighbors(&self, v: usize) -> &[u32] {
        self.csr.row(v)
    }

    /// The number of neighbors of `v`.
    ///
    /// # Panics
    /// If there is no vertex `v`.
    #[must_use]
    pub fn degree(&self, v: usize) -> usize {
        self.csr.row(v).len()
    }

    /// The largest degree, 0 for a graph without vertices. O(vertices).
    #[must_use]
    pub fn max_degree(&self) -> usize {
        self.csr.rows().map(<[u32]>::len).max().unwrap_or(0)
    }

    /// The raw offsets, one more than there are vertices.
    #[must_use]
    pub fn offsets(&self) -> &[u32] {
        &self.csr.offsets
    }

    /// The raw neighbor lists, row after row.
    #[must_use]
    pub fn values(&self) -> &[u32] {
        &self.csr.values
    }

    /// Each edge once, as (smaller, larger), ascending.
    pub fn edges(&self) -> impl Iterator<Item = (u32, u32)> {
        (0..).zip(self.csr.rows()).flat_map(|(v, row)| {
            let above = row.partition_point(|&u| u < v);
            row[above..].iter().map(move |&u| (v, u))
        })
    }
}

/// The distinct values of a sorted row.
fn distinct(row: &[u32]) -> impl Iterator<Item = u32> {
    row.chunk_by(|a, b| a == b).map(|run| run[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ClusterId;

    #[test]
    fn rows_are_symmetric_and_sorted() {
        let graph =
            ConstraintGraph::from_edges(5, &[(4, 0), (0, 1), (3, 0), (1, 4), (1, 0)]).unwrap();
        assert_eq!(graph.neighbors(0), [1, 3, 4]);
        assert_eq!(graph.neighbors(1), [0, 4]);
        assert_eq!(graph.neighbors(2), [0u32; 0]);
        assert_eq!(
            (graph.edge_count(), graph.max_degree(), graph.degree(4)),
            (4, 3, 2)
        );
        assert_eq!(
            graph.edges().collect::<Vec<_>>(),
            [(0, 1), (0, 3), (0, 4), (1, 4)]
        );
    }

    #[test]
    fn refuses_broken_edges() {
        let refuse = |edges: &[(u32, u32)]| ConstraintGraph::from_edges(2, edges).unwrap_err();
        assert_eq!(
            refuse(&[(0, 1), (2, 0)]),
            GraphError::VertexOutOfRange {
                edge: 1,
                vertex: 2,
                vertices: 2
            }
        );
        assert_eq!(
            refuse(&[(1, 1)]),
            GraphError::SelfLoop { edge: 0, vertex: 1 }
        );
    }

    #[test]
    fn foreign_rows_are_sorted_and_merged() {
        let triangle = ConstraintGraph::from_edges(4, &[(0, 1), (1, 3), (3, 0)]).unwrap();
        let foreign =
            ConstraintGraph::from_csr(vec![0, 3, 5, 5, 8], vec![3, 1, 3, 3, 0, 1, 0, 1]).unwrap();
        assert_eq!(foreign, triangle);
        let (offsets, values) = (triangle.offsets().to_vec(), triangle.values().to_vec());
        assert_eq!(
            ConstraintGraph::from_csr(offsets, values).unwrap(),
            triangle
        );
        assert_eq!(
            ConstraintGraph::from_csr(vec![0], vec![]).unwrap(),
            ConstraintGraph::from_edges(0, &[]).unwrap()
        );
    }

    #[test]
    fn refuses_broken_rows() {
        let refuse = |offsets: &[u32], values: &[u32]| {
            ConstraintGraph::from_csr(offsets.to_vec(), values.to_vec()).unwrap_err()
        };
        assert_eq!(refuse(&[], &[]), GraphError::OffsetsStart);
        assert_eq!(refuse(&[1, 1], &[0]), GraphError::OffsetsStart);
        assert_eq!(
            refuse(&[0, 2, 1], &[0]),
            GraphError::OffsetsDecrease {
                row: 1,
                before: 2,
                after: 1
            }
        );
        assert_eq!(
            refuse(&[0, 1], &[0, 1]),
            GraphError::OffsetsEnd { last: 1, values: 2 }
        );
        assert_eq!(
            refuse(&[0, 1, 2], &[1, 2]),
            GraphError::VertexOutOfRange {
                edge: 1,
                vertex: 2,
                vertices: 2
            }
        );
        assert_eq!(
            refuse(&[0, 1, 2], &[1, 1]),
            GraphError::SelfLoop { edge: 1, vertex: 1 }
        );
        // The edges 1 -> 0 and 2 -> 3 have no reverse; then the mirrored case.
        assert_eq!(
            refuse(&[0, 1, 3, 5, 6], &[2, 0, 2, 1, 3, 2]),
            GraphError::OneSided { from: 1, to: 0 }
        );
        assert_eq!(
            refuse(&[0, 2, 3, 3], &[2, 1, 0]),
            GraphError::OneSided { from: 0, to: 2 }
        );
    }

    #[test]
    fn quotient_ignores_unclustered_constraints() {
        let path = ConstraintGraph::from_edges(5, &[(0, 1), (1, 2), (2, 3), (3, 4)]).unwrap();
        let labels = vec![
            ClusterId(4),
            ClusterId::NONE,
            ClusterId(1),
            ClusterId(1),
            ClusterId(4),
        ];
        let clusters = path.quotient(&Clustering::from_labels(labels).unwrap());
        assert_eq!(clusters, ConstraintGraph::from_edges(5, &[(1, 4)]).unwrap());
    }

    #[test]
    fn empty_graphs() {
        let none = ConstraintGraph::from_edges(0, &[]).unwrap();
        assert_eq!(
            (none.vertex_count(), none.edge_count(), none.max_degree()),
            (0, 0, 0)
        );
        assert_eq!(none.quotient(&Clustering::none(0)), none);
    }
}
