//! [`Faces`]: for each face of a tet what lies behind it, editable in constant time.
//!
//! One number a face, four a tet: the slot of the same face in the neighboring tet, or, on the boundary, the slot in
//! a dense list of boundary triangles. So neighbors are found without a search, and the boundary needs no pass over the
//! mesh. Face `4 t + k` is the face of tet `t` opposite to its corner `k`.
//!
//! The children of a split tet inherit what lies behind their parent's faces while tets are split; [`Faces::settle`]
//! then finds the twins among them. Cost: O(k log k) for k faces of split tets, O(1) for each other edit.

use incise_mesh::{Bounds, ParticleId, TetId, TetMesh};

use crate::delta::{BoundaryTriangle, FaceTag};
use crate::index::index;

/// Marks a slot in the list of boundary triangles.
const BOUNDARY: u32 = 1 << 31;
/// A face between children of one tet whose twin is not known yet.
pub(crate) const INNER: u32 = u32::MAX;
/// Boundary triangles that count as neighbors: this many in a row of their list, which starts in an order in space; the
/// triangles of a cut follow, in the order of their tets.
pub(crate) const TILE: usize = 64;
/// The corners of the face opposite to each corner, counterclockwise seen from outside a positive tet.
const OPPOSITE: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// A face by its index `4 tet + corner it lies opposite to`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Face(u32);

impl Face {
    /// The faces of a tet, by opposite corner.
    ///
    /// # Panics
    /// From 2²⁹ tets on, where places would run into the marks of links.
    pub(crate) fn of(tet: TetId) -> [Self; 4] {
        assert!(tet.0 < 1 << 29, "fewer than 2²⁹ tets");
        [0, 1, 2, 3].map(|opposite| Self(4 * tet.0 + opposite))
    }

    pub(crate) fn tet(self) -> TetId {
        TetId(self.0 / 4)
    }

    pub(crate) fn opposite(self) -> usize {
        (self.0 % 4) as usize
    }

    /// The particles, counterclockwise seen from outside.
    pub(crate) fn particles(self, mesh: &TetMesh) -> [ParticleId; 3] {
        face_of(mesh.tets[self.tet().index()], self.opposite())
    }
}

/// The face of a tet opposite to a corner, counterclockwise seen from outside.
pub(crate) fn face_of(corners: [ParticleId; 4], opposite: usize) -> [ParticleId; 3] {
    OPPOSITE[opposite].map(|k| corners[k])
}

/// The particles of a face in ascending order.
pub(crate) fn sorted(mut face: [ParticleId; 3]) -> [ParticleId; 3] {
    face.sort_unstable();
    face
}

/// What lies behind a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Behind {
    /// The twin of the face in the neighboring tet.
    Twin(Face),
    /// Nothing: it is a boundary triangle.
    Nothing(FaceTag),
}

/// The faces of all tets.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Faces {
    links: Vec<u32>,
    /// The boundary triangles, in the order in which they came to be.
    boundary: Vec<(Face, FaceTag)>,
    /// How often triangles came to or went from each tile of the list.
    versions: Vec<u32>,
}

impl Faces {
    pub(crate) fn new(mesh: &TetMesh) -> Self {
        let mut faces = Self {
            links: vec![INNER; 4 * mesh.tets.len()],
            boundary: Vec::new(),
            versions: Vec::new(),
        };
        let tets = (0..mesh.tets.len()).map(TetId::new);
        let sides = sides(mesh, tets.flat_map(Face::of));
        faces.pair_up(&sides);
        let all = (0..mesh.tets.len()).map(TetId::new).flat_map(Face::of);
        let outer: Vec<Face> = all.filter(|&face| faces.is_loose(face)).collect();
        for face in in_space(mesh, outer) {
            faces.open(face, FaceTag::Outer);
        }
        faces
    }

    /// Appends the faces of another mesh, whose tets get the next numbers. Its boundary triangles keep their order and
    /// follow those of this mesh.
    pub(crate) fn append(&mut self, other: &Self) {
        let first = index(self.links.len());
        // Links to the boundary are set below.
        let links = other.links.iter().map(|&code| match code & BOUNDARY {
            0 => first + code,
            _ => INNER,
        });
        self.links.extend(links);
        for &(face, tag) in &other.boundary {
            self.open(Face(first + face.0), tag);
        }
    }

    /// The boundary triangles, in an order that is the same for the same history.
    pub(crate) fn boundary(&self) -> &[(Face, FaceTag)] {
        &self.boundary
    }

    /// A number for each tile of the boundary triangles that changes when a triangle comes to it. Parts of a triangle
    /// that take its slot do not count.
    pub(crate) fn versions(&self) -> &[u32] {
        &self.versions
    }

    fn note_change(&mut self, slot: usize) {
        let tile = slot / TILE;
        if tile == self.versions.len() {
            self.versions.push(0);
        }
        self.versions[tile] = self.versions[tile].wrapping_add(1);
    }

    pub(crate) fn behind(&self, face: Face) -> Behind {
        match self.links[face.0 as usize] {
            code if code & BOUNDARY == 0 => Behind::Twin(Face(code)),
            code => Behind::Nothing(self.boundary[(code & !BOUNDARY) as usize].1),
        }
    }

    /// The raw links of a tet, to be handed to its children.
    pub(crate) fn links_of(&self, tet: TetId) -> [u32; 4] {
        [0, 1, 2, 3].map(|k| self.links[4 * tet.index() + k])
    }

    /// The tag behind a raw link, if it is one of the boundary.
    pub(crate) fn tag_of(&self, link: u32) -> Option<FaceTag> {
        (link != INNER && link & BOUNDARY != 0)
            .then(|| self.boundary[(link & !BOUNDARY) as usize].1)
    }

    /// Sets the raw links of a tet, which is the next one or exists.
    pub(crate) fn set_links(&mut self, tet: TetId, links: [u32; 4]) {
        if self.links.len() == 4 * tet.index() {
            self.links.extend(links);
        } else {
            self.links[4 * tet.index()..][..4].copy_from_slice(&links);
        }
    }

    /// Finds the twins of the faces of split tets, whose links are those their parents had. `split` ascends and names
    /// each tet once; all other tets have kept their faces.
    pub(crate) fn settle(&mut self, mesh: &TetMesh, split: &[TetId]) {
        let mut among: Vec<Face> = Vec::with_capacity(4 * split.len());
        let mut outside: Vec<(u32, Face)> = Vec::new();
        for &tet in split {
            for face in Face::of(tet) {
                match self.links[face.0 as usize] {
                    INNER => among.push(face),
                    code if code & BOUNDARY != 0 => outside.push((code, face)),
                    code if split.binary_search(&TetId(code / 4)).is_ok() => among.push(face),
                    // The neighbor was not split, so this is still its whole face.
                    code => self.join(face, Face(code)),
                }
            }
        }
        let sides = sides(mesh, among.iter().copied());
        self.pair_up(&sides);
        // One part of a boundary triangle takes its slot in the list, the others are appended.
        outside.sort_unstable();
        let mut last = None;
        for (code, face) in outside {
            let slot = (code & !BOUNDARY) as usize;
            if last == Some(code) {
                self.open(face, self.boundary[slot].1);
            } else {
                self.boundary[slot].0 = face;
                self.links[face.0 as usize] = code;
            }
            last = Some(code);
        }
    }

    /// Makes a face a boundary triangle. Its link must not be one of the boundary.
    pub(crate) fn open(&mut self, face: Face, tag: FaceTag) {
        let slot = index(self.boundary.len());
        self.boundary.push((face, tag));
        self.note_change(slot as usize);
        self.links[face.0 as usize] = BOUNDARY | slot;
    }

    /// Takes a boundary triangle from the list; its link is then [`INNER`].
    pub(crate) fn close(&mut self, face: Face) {
        let link = std::mem::replace(&mut self.links[face.0 as usize], INNER);
        debug_assert!(link != INNER && link & BOUNDARY != 0);
        self.boundary.swap_remove((link & !BOUNDARY) as usize);
        self.note_change((link & !BOUNDARY) as usize);
        if let Some((moved, _)) = self.boundary.get((link & !BOUNDARY) as usize) {
            self.links[moved.0 as usize] = link;
        }
    }

    /// Makes two faces each other's twins.
    pub(crate) fn join(&mut self, one: Face, other: Face) {
        self.links[one.0 as usize] = other.0;
        self.links[other.0 as usize] = one.0;
    }

    /// Gives a tet's faces to another slot.
    pub(crate) fn move_tet(&mut self, from: TetId, to: TetId) {
        for (face, slot) in Face::of(from).into_iter().zip(Face::of(to)) {
            let link = self.links[face.0 as usize];
            self.links[slot.0 as usize] = link;
            match link {
                INNER => {}
                link if link & BOUNDARY != 0 => {
                    self.boundary[(link & !BOUNDARY) as usize].0 = slot;
                }
                twin => self.links[twin as usize] = slot.0,
            }
        }
    }

    /// Forgets what lies behind a tet's faces.
    pub(crate) fn clear(&mut self, tet: TetId) {
        self.set_links(tet, [INNER; 4]);
    }

    /// True if the tet behind a face is not known.
    pub(crate) fn is_loose(&self, face: Face) -> bool {
        self.links[face.0 as usize] == INNER
    }

    /// Forgets the tets from `count` on, whose faces nothing refers to any more; or makes room up to it.
    pub(crate) fn resize(&mut self, count: usize) {
        self.links.resize(4 * count, INNER);
    }

    /// The list entry of a boundary face.
    pub(crate) fn triangle(&self, mesh: &TetMesh, face: Face) -> Option<BoundaryTriangle> {
        match self.behind(face) {
            Behind::Twin(_) => None,
            Behind::Nothing(tag) => Some(BoundaryTriangle {
                tet: face.tet(),
                opposite: [0, 1, 2, 3][face.opposite()],
                particles: face.particles(mesh),
                tag,
            }),
        }
    }

    fn pair_up(&mut self, sides: &[([ParticleId; 3], Face)]) {
        for pair in sides.chunk_by(|a, b| a.0 == b.0) {
            if let [(_, one), (_, other)] = *pair {
                self.join(one, other);
            }
        }
    }

    /// The first face whose link is not what the mesh says.
    pub(crate) fn first_difference(&self, mesh: &TetMesh) -> Option<Face> {
        let fresh = Self::new(mesh);
        let mut faces = (0..mesh.tets.len()).map(TetId::new).flat_map(Face::of);
        let wrong = |&face: &Face| {
            let (here, there) = (
                self.links.get(face.0 as usize),
                fresh.links[face.0 as usize],
            );
            let on_boundary = there & BOUNDARY != 0;
            match here {
                Some(&link) if on_boundary => {
                    link == INNER
                        || link & BOUNDARY == 0
                        || self
                            .boundary
                            .get((link & !BOUNDARY) as usize)
                            .map(|entry| entry.0)
                            != Some(face)
                }
                Some(&link) => link != there,
                None => true,
            }
        };
        let sizes =
            (self.links.len(), self.boundary.len()) == (fresh.links.len(), fresh.boundary.len());
        if sizes {
            faces.find(wrong)
        } else {
            Some(Face(0))
        }
    }
}

/// Faces in an order in which neighbors in the list are neighbors in space: that of their first particles along a
/// Z-curve (G. M. Morton 1966), whatever order the mesh has.
fn in_space(mesh: &TetMesh, faces: Vec<Face>) -> Vec<Face> {
    const CELLS: f64 = 1023.0;
    let at = |face: Face| mesh.positions[face.particles(mesh)[0].index()];
    let bounds = Bounds::around(faces.iter().map(|&face| at(face)));
    let size = bounds.high - bounds.low;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "in 0..=CELLS, and 0 where the box is flat"
    )]
    let code = |face: Face| {
        let cell = (at(face) - bounds.low) / size * CELLS;
        let cell = cell.to_array().map(|c| c as u32);
        let bits = (0..10).rev().flat_map(|i| cell.map(|c| c >> i & 1));
        bits.fold(0, |code, bit| code << 1 | bit)
    };
    let mut sorted: Vec<(u32, Face)> = faces.into_iter().map(|face| (code(face), face)).collect();
    sorted.sort_unstable();
    sorted.into_iter().map(|(_, face)| face).collect()
}

/// Faces with their particles, sorted so that twins are neighbors.
fn sides(mesh: &TetMesh, faces: impl Iterator<Item = Face>) -> Vec<([ParticleId; 3], Face)> {
    let mut sides: Vec<_> = faces
        .map(|face| (sorted(face.particles(mesh)), face))
        .collect();
    sides.sort_unstable();
    sides
}
