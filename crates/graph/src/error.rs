//! [`GraphError`]: errors of inputs and failed checks, one variant per mistake.
//!
//! Every variant has the number of the item, so that the message points at the line of a file or
//! the entry of an array that has to change.

use crate::{ClusterId, ColorId};

/// An inconsistent input or a failed check.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum GraphError {
    /// More entries than 32-bit offsets can address.
    #[error("{count} {what} are too many: at most 4294967295 fit; split the problem")]
    TooMany {
        /// The name of the items.
        what: &'static str,
        /// The number of items.
        count: usize,
    },
    /// CSR offsets that do not start at 0, or an empty array of offsets.
    #[error("offsets must start with 0 and hold one entry more than there are rows")]
    OffsetsStart,
    /// CSR offsets that decrease.
    #[error("offsets go down from {before} to {after} at row {row}; they must not decrease")]
    OffsetsDecrease {
        /// The row that would have a negative length.
        row: usize,
        /// The first offset of the row.
        before: u32,
        /// The second, smaller offset of the row.
        after: u32,
    },
    /// CSR offsets that do not end at the number of values.
    #[error("offsets end at {last}, but there are {values} values; both must agree")]
    OffsetsEnd {
        /// The last offset.
        last: u32,
        /// The number of values.
        values: usize,
    },
    /// A constraint on a particle that does not exist.
    #[error(
        "constraint {constraint} names particle {particle}, but there are {particles} particles (from 0)"
    )]
    ParticleOutOfRange {
        /// The constraint.
        constraint: usize,
        /// The particle that does not exist.
        particle: u32,
        /// The number of particles.
        particles: usize,
    },
    /// A constraint that names one particle twice.
    #[error("constraint {constraint} names particle {particle} twice; list each particle once")]
    RepeatedParticle {
        /// The constraint.
        constraint: usize,
        /// The repeated particle.
        particle: u32,
    },
    /// An edge to a vertex that does not exist.
    #[error("edge {edge} names vertex {vertex}, but there are {vertices} vertices (from 0)")]
    VertexOutOfRange {
        /// The position of the edge in the input; for CSR input, in the values.
        edge: usize,
        /// The vertex that does not exist.
        vertex: u32,
        /// The number of vertices.
        vertices: usize,
    },
    /// An edge from a vertex to itself, which no coloring can satisfy.
    #[error(
        "edge {edge} joins vertex {vertex} to itself; such a graph has no coloring, leave the edge out"
    )]
    SelfLoop {
        /// The position of the edge in the input; for CSR input, in the values.
        edge: usize,
        /// The vertex.
        vertex: u32,
    },
    /// An edge that is listed in one direction only.
    #[error(
        "row {from} lists vertex {to}, but row {to} does not list vertex {from}; list each edge in both rows"
    )]
    OneSided {
        /// The vertex whose row has the edge.
        from: u32,
        /// The vertex whose row lacks it.
        to: u32,
    },
    /// A file that violates its format.
    #[error("line {line}: {message}")]
    Malformed {
        /// The line, counted from 1; the last one if something is missing at the end.
        line: usize,
        /// The text that was found and the expected one.
        message: String,
    },
    /// An error of the source during reading.
    #[error("cannot read line {line}: {message}")]
    Unreadable {
        /// The line, counted from 1.
        line: usize,
        /// The kind of failure.
        kind: std::io::ErrorKind,
        /// The message of the source.
        message: String,
    },
    /// A label that is not a cluster number of a clustering of this size.
    #[error(
        "constraint {constraint} is labeled {cluster}, but cluster numbers must be below {constraints}"
    )]
    LabelOutOfRange {
        /// The constraint.
        constraint: usize,
        /// Its label.
        cluster: ClusterId,
        /// The number of constraints, which bounds the number of clusters.
        constraints: usize,
    },
    /// A clustering whose counts do not match its labels.
    #[error(
        "cluster {cluster} is recorded with {recorded} constraints, but {found} constraints carry its label"
    )]
    ClusterSize {
        /// The cluster.
        cluster: ClusterId,
        /// The recorded size.
        recorded: usize,
        /// The number of labels.
        found: usize,
    },
    /// A clustering whose list of vacant numbers is not the set of its empty clusters.
    #[error("cluster {cluster} is empty or listed as vacant, but not both exactly once")]
    Vacancy {
        /// The cluster.
        cluster: ClusterId,
    },
    /// Two arrays of different length that describe the same items.
    #[error("{what}: expected {expected} entries, found {found}")]
    Length {
        /// The name of the array.
        what: &'static str,
        /// The required number of entries.
        expected: usize,
        /// The actual number of entries.
        found: usize,
    },
    /// Two adjacent vertices of one color.
    #[error("vertices {first} and {second} are adjacent and both have color {color}")]
    SameColor {
        /// The smaller vertex.
        first: u32,
        /// The larger vertex.
        second: u32,
        /// Their color.
        color: ColorId,
    },
    /// Two constraints of one color on one particle.
    #[error(
        "constraints {first} and {second} both have color {color} and share particle {particle}"
    )]
    SharedParticle {
        /// The smaller constraint.
        first: u32,
        /// The larger constraint.
        second: u32,
        /// Their color.
        color: ColorId,
        /// The particle shared by both.
        particle: u32,
    },
    /// A constraint that is missing in a schedule.
    #[error("constraint {constraint} is not in the schedule")]
    Unscheduled {
        /// The constraint.
        constraint: usize,
    },
    /// A constraint that appears in a schedule more than once.
    #[error("constraint {constraint} is in the schedule more than once")]
    ScheduledTwice {
        /// The constraint.
        constraint: u32,
    },
    /// A cluster whose members or color in a schedule are outdated.
    #[error("the schedule has other members or another color for cluster {cluster}")]
    Misplaced {
        /// The cluster.
        cluster: ClusterId,
    },
    /// Two clusters that share a particle but have one color in a schedule.
    #[error(
        "clusters {first} and {second} run together in color {color} but share particle {particle}"
    )]
    ClustersCollide {
        /// The cluster found first.
        first: ClusterId,
        /// The cluster found second.
        second: ClusterId,
        /// The color of both.
        color: ColorId,
        /// The particle shared by both.
        particle: u32,
    },
}
