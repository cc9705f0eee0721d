//! DIMACS graph format (Second DIMACS Challenge, "Clique and Coloring Problems Graph Format", 1993), the format of the
//! classic coloring instances.
//!
//! The first letter of a line is its kind. Published instances differ from the description in two ways, both accepted
//! here: many list each edge in both directions, and the number in their header counts lines, edges, or neither. Cost:
//! O(length of the file + edges log edges).

use std::io::BufRead;

use super::{Line, Lines, build, show};
use crate::{ConstraintGraph, GraphError};

/// Reads a graph in DIMACS format (`.col`).
///
/// A line that begins with `c` is a comment, in any encoding; `p edge VERTICES EDGES` (or `p col`) appears once, before
/// the edges; `e U V` is an edge, with vertices from 1, in either or both directions, counted once. Lines of nodes and
/// optional descriptors (`n`, `d`, `v`, `x`) and blank lines are skipped. The number of edges in the header is ignored,
/// because many published files count differently. An edge from a vertex to itself is an error, since such a graph has
/// no coloring.
///
/// Counts in the file reserve no memory; a graph of more than 2^20 vertices must have at least one edge for every 16
/// vertices above that.
///
/// Deterministic. O(length of the file + edges log edges), memory proportional to the length of the file.
///
/// # Errors
/// [`GraphError::Malformed`] with the line: no or a second `p` line, an edge before it, another letter, a vertex that
/// does not exist, a loop, words that are not numbers, too few or too many words, lines of more than 65535 bytes.
/// [`GraphError::Unreadable`] if the source fails,
/// [`GraphError::TooMany`] for 2^31 edges or more.
///
/// ```
/// use incise_graph::read_dimacs;
///
/// let ring = "c a ring of five\np edge 5 5\ne 1 2\ne 2 3\ne 3 4\ne 4 5\ne 5 1\n";
/// let graph = read_dimacs(ring.as_bytes())?;
/// assert_eq!((graph.vertex_count(), graph.edge_count()), (5, 5));
/// assert_eq!(graph.neighbors(0), [1, 4]);
///
/// let error = read_dimacs("p edge 2 1\ne 1 3\n".as_bytes()).unwrap_err();
/// assert_eq!(error.to_string(), "line 2: there is no vertex 3: the header announces 2 vertices");
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
pub fn read_dimacs(source: impl BufRead) -> Result<ConstraintGraph, GraphError> {
    let mut lines = Lines::new(source);
    // The header's line number and the number of vertices.
    let mut header: Option<(usize, u32)> = None;
    let mut edges = Vec::new();
    while let Some(line) = lines.next()? {
        let Some(word) = line.words().next() else {
            continue;
        };
        match (word, header) {
            ([b'c', ..] | b"n" | b"d" | b"v" | b"x", _) => {}
            (b"p", None) => header = Some((line.number, problem(line)?)),
            (b"p", Some((first, _))) => {
                return Err(line.malformed(format!(
                    "a second line \"p\": the graph is announced in line {first}"
                )));
            }
            (b"e", None) => {
                return Err(line.malformed("an edge before the line \"p edge VERTICES EDGES\""));
            }
            (b"e", Some((_, vertices))) => edges.push(edge(line, vertices)?),
            _ => {
                return Err(line.malformed(format!(
                    "a line begins with {}: one of c, p, e, n, d, v, x expected",
                    show(word)
                )));
            }
        }
    }
    match header {
        Some((line, vertices)) => build(line, vertices, edges.len() as u64, &edges),
        None => Err(lines.ends_early("a line \"p edge VERTICES EDGES\" expected")),
    }
}

/// `p edge VERTICES EDGES`.
fn problem(line: Line<'_>) -> Result<u32, GraphError> {
    let [_, format, vertices, edges] = line.exactly("\"p edge VERTICES EDGES\"")?;
    let known = [&b"edge"[..], b"edges", b"col"];
    if !known.iter().any(|name| format.eq_ignore_ascii_case(name)) {
        return Err(line.malformed(format!(
            "there is no graph format {}: \"edge\" or \"col\" expected",
            show(format)
        )));
    }
    line.count(edges, "a number of edges")?;
    line.vertex_count(vertices)
}

/// `e U V`.
fn edge(line: Line<'_>, vertices: u32) -> Result<(u32, u32), GraphError> {
    let [_, u, v] = line.exactly("\"e\" and two vertices")?;
    let (u, v) = (line.vertex(u, vertices)?, line.vertex(v, vertices)?);
    if u == v {
        return Err(line.malformed(format!(
            "an edge joins vertex {} to itself: such a graph has no coloring, leave it out",
            u64::from(u) + 1
        )));
    }
    Ok((u, v))
}
