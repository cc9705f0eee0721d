//! [`Faces`]: all triangular faces of a set of tets, sorted so that the sides of one face are adjacent in the list.
//!
//! A side is one face seen from one tet. Its three particles, in ascending order, and its index `4 * tet + local face`
//! are packed into one `u128`, so sorting needs no indirection. Cost: O(n log n) for sorting 4 n packed keys on all
//! cores; all keys are distinct, so the order does not depend on the number of cores.

use rayon::slice::ParallelSliceMut;

use crate::{ParticleId, TetId, TetMesh};

/// The corners of the four faces of a positive tet, each counterclockwise when seen from outside.
const LOCAL_FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

/// One face of one tet; orders by face first, then by tet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct FaceSide(u128);

impl FaceSide {
    fn new(tets: &[[ParticleId; 4]], tet: usize, local: usize) -> Self {
        let mut face = outward_face(tets[tet], local).map(|p| p.0);
        face.sort_unstable();
        let index = u32::try_from(4 * tet + local).expect("the mesh has fewer than 2^30 tets");
        let [a, b, c] = face.map(u128::from);
        Self(a << 96 | b << 64 | c << 32 | u128::from(index))
    }

    /// The tet of this side.
    #[must_use]
    pub fn tet(self) -> TetId {
        TetId(self.index() / 4)
    }

    /// The local index of the face in the tet, in the order of [`Surface`](crate::Surface).
    #[must_use]
    pub fn local(self) -> usize {
        self.index() as usize % 4
    }

    /// Position of the side in the order by tet, then local face.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the low 32 bits are the index"
    )]
    pub(crate) fn index(self) -> u32 {
        self.0 as u32
    }

    /// The particles of the face in ascending order.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "takes one 32-bit lane at a time"
    )]
    #[must_use]
    pub fn face(self) -> [ParticleId; 3] {
        [96, 64, 32].map(|shift| ParticleId((self.0 >> shift) as u32))
    }

    fn same_face(&self, other: &Self) -> bool {
        self.0 >> 32 == other.0 >> 32
    }
}

/// One face of a tet, counterclockwise when seen from outside a positive tet.
pub(crate) fn outward_face(tet: [ParticleId; 4], local: usize) -> [ParticleId; 3] {
    LOCAL_FACES[local].map(|corner| tet[corner])
}

/// The faces of a mesh, sorted so that the sides of one face are adjacent.
///
/// Sorting dominates the cost of the boundary and of the pieces connected by faces. [`TetMesh::surface_from`] and
/// [`TetMesh::face_pieces_from`] share one sort.
///
/// # Example
/// ```
/// use incise_mesh::{glam::DVec3, kuhn_box};
///
/// let mesh = kuhn_box([2, 2, 2], DVec3::ONE);
/// let faces = mesh.faces();
/// let boundary = faces.iter().filter(|sides| sides.len() == 1).count();
/// assert_eq!(mesh.surface_from(&faces).triangles.len(), boundary);
/// assert_eq!(mesh.face_pieces_from(&faces).count, 1);
/// ```
#[derive(Clone, Debug)]
pub struct Faces {
    sides: Vec<FaceSide>,
}

impl Faces {
    /// The faces of the tets for which `keep` holds.
    pub(crate) fn of(tets: &[[ParticleId; 4]], keep: impl Fn(usize) -> bool) -> Self {
        let mut sides = Vec::with_capacity(4 * tets.len());
        for tet in (0..tets.len()).filter(|&tet| keep(tet)) {
            sides.extend((0..4).map(|local| FaceSide::new(tets, tet, local)));
        }
        sides.par_sort_unstable();
        Self { sides }
    }

    /// The sides of each distinct face, ordered by the particles of the face.
    pub fn iter(&self) -> impl Iterator<Item = &[FaceSide]> {
        self.sides.chunk_by(FaceSide::same_face)
    }
}

impl TetMesh {
    /// Sorts the faces of all tets. O(n log n) for n tets, on all cores.
    ///
    /// # Panics
    /// From 2³⁰ tets on.
    #[must_use]
    pub fn faces(&self) -> Faces {
        Faces::of(&self.tets, |_| true)
    }
}
