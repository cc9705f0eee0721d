//! [`CutError`]: errors of cuts.

use incise_mesh::MeshError;

/// Error of a cut. Nothing has been changed when it is returned.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CutError {
    /// The mesh to be cut is broken.
    #[error("the mesh cannot be cut: {0}")]
    Mesh(#[from] MeshError),
    /// A number of the stroke is infinite or not a number.
    #[error("{what} of the stroke is {value}: it must be finite")]
    NonFinite {
        /// The part of the stroke.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// The normal of a plane has no direction.
    #[error("the plane's normal has length {length:e}: give it a direction")]
    ZeroNormal {
        /// The length of the normal.
        length: f64,
    },
    /// A blade without length cannot cut.
    #[error(
        "the blade has {length} m from its first point to its last (points: {points}): it needs at least two different points"
    )]
    ShortBlade {
        /// Number of points of the polyline.
        points: usize,
        /// Its total length.
        length: f64,
    },
    /// A blade changed its number of points during a stroke.
    #[error(
        "the blade had {before} points at the last pose and has {now} now: a stroke keeps its blade"
    )]
    BladeChanged {
        /// Points at the last pose.
        before: usize,
        /// Points now.
        now: usize,
    },
    /// Snap distance outside its range.
    #[error("snap is {value}: it must lie between 0 and 0.25 of an edge")]
    Snap {
        /// The value given.
        value: f64,
    },
    /// Tolerance outside its range.
    #[error("tolerance is {value:e}: it must lie between 1e-12 and 0.01 of an edge")]
    Tolerance {
        /// The value given.
        value: f64,
    },
    /// Limit of the volume of children outside its range.
    #[error("min_volume_ratio is {value}: it must lie between 0 and 0.015")]
    VolumeLimit {
        /// The value given.
        value: f64,
    },
    /// Size of crumbs outside its range.
    #[error("crumbs is {value}: it must lie between 0 and 100 mean tets")]
    Crumbs {
        /// The value given.
        value: f64,
    },
    /// Tolerance of an improvement outside its range.
    #[error("the tolerance is {value}: it must lie between 0 and 0.25 edges")]
    Improve {
        /// The value given.
        value: f64,
    },
    /// A cut would make too many tets.
    #[error(
        "the cut would leave {tets} tets and {limit} are allowed: cut less at once, use a coarser mesh or raise the limit"
    )]
    TooManyTets {
        /// Tets after the cut.
        tets: usize,
        /// [`crate::CutOptions::max_tets`].
        limit: usize,
    },
    /// A tet to be removed does not exist.
    #[error("tet {tet} was to be removed but the mesh has {tets}")]
    NoSuchTet {
        /// The tet given.
        tet: incise_mesh::TetId,
        /// Tets of the mesh.
        tets: usize,
    },
    /// A delta is not the last one made of this mesh.
    #[error(
        "only the last cut can be undone: this delta left {tets} tets and {particles} particles, the mesh has others"
    )]
    NotLast {
        /// Tets after the delta.
        tets: usize,
        /// Particles after the delta.
        particles: usize,
    },
    /// Positions do not belong to the mesh.
    #[error("{given} positions were given for a mesh of {expected} particles")]
    PositionCount {
        /// Particles of the mesh.
        expected: usize,
        /// Positions given.
        given: usize,
    },
    /// A surface without triangles cannot cut.
    #[error("the surface has no triangles")]
    EmptySurface,
    /// A triangle of a surface names a point that does not exist.
    #[error("triangle {triangle} of the surface names point {point}, of {points}")]
    TriangleIndex {
        /// Number of the triangle.
        triangle: usize,
        /// The point it names.
        point: u32,
        /// Number of points.
        points: usize,
    },
    /// A triangle of a surface has no area and so no direction.
    #[error("triangle {triangle} of the surface has area {area:e} m²: its points lie on a line")]
    FlatTriangle {
        /// Number of the triangle.
        triangle: usize,
        /// Its area in m².
        area: f64,
    },
    /// The mesh was changed since the last call without an update of the stroke.
    #[error(
        "the stroke goes on from a mesh of {particles} particles and {tets} tets, which has changed since: let it \
         follow cuts and removals, and go on with an earlier clone after an undo"
    )]
    NotFollowed {
        /// Number of particles at the last call.
        particles: usize,
        /// Number of tets at the last call.
        tets: usize,
    },
    /// The tracked pieces differ from those of the mesh: a defect of this crate.
    #[error("the pieces are not current: {0}")]
    Pieces(String),
}
