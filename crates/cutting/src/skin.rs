//! [`Skin`]: the boundary as a renderer wants it, following cuts.
//!
//! A dense list of triangles over render vertices, those of the outer surface first, so that outer and cut faces are
//! two ranges of one index buffer, to be drawn with two materials. A render vertex is a particle on one kind of
//! boundary: a particle on the rim of a cut has one for the outer surface and one for each cut surface, so that shading
//! breaks there and is smooth elsewhere. Positions and attributes, such as texture coordinates, are those of the
//! particle, which [`CutDelta::extend_with`] interpolates on cut edges. Following a delta costs what the boundary lost
//! and gained; normals cost a pass over the triangles, since they follow the motion.

use std::collections::HashMap;
use std::ops::Range;

use glam::DVec3;
use incise_mesh::{ParticleId, TetId};

use crate::delta::{BoundaryTriangle, CutDelta, FaceTag};
use crate::index::index;

/// A render vertex: a particle on one kind of boundary.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SkinVertex {
    /// Particle that has the position and attributes of the vertex.
    pub particle: ParticleId,
    /// Kind of boundary: outer surface or the cut of a stroke.
    pub tag: FaceTag,
}

/// Changes by [`Skin::apply_delta`], for partial uploads: ascending indices, each once.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SkinChange {
    /// New or moved triangles; those past the end of the list were removed.
    pub triangles: Vec<usize>,
    /// Vertices that are new.
    pub vertices: Vec<usize>,
}

/// The boundary as a triangle list for renderers, updated by deltas.
///
/// # Example
/// ```
/// use glam::DVec3;
/// use incise_cutting::{CutOptions, CuttableMesh, FaceTag, Plane, Skin, cut_plane};
/// use incise_mesh::kuhn_box;
///
/// let mut body = CuttableMesh::new(kuhn_box([3; 3], DVec3::ONE))?;
/// let mut skin = Skin::new(body.boundary());
/// let positions = body.mesh().positions.clone();
/// let plane = Plane { point: DVec3::splat(0.4), normal: DVec3::X };
/// let delta = cut_plane(&mut body, &positions, &plane, &CutOptions::default())?;
/// let changed = skin.apply_delta(&delta);
/// println!("{} triangles to upload", changed.triangles.len());
/// let normals = skin.normals(&body.mesh().positions);
/// for (vertex, normal) in skin.vertices().iter().zip(&normals) {
///     if vertex.tag == FaceTag::Cut(0) {
///         assert!((normal.x.abs() - 1.0).abs() < 0.2, "flat across the rim, too");
///     }
/// }
/// # Ok::<(), incise_cutting::CutError>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Skin {
    vertices: Vec<SkinVertex>,
    /// For each vertex the number of triangles that use it.
    uses: Vec<u32>,
    /// Vertices without a triangle, to be used again.
    vacant: Vec<u32>,
    /// Those of the outer surface first.
    triangles: Vec<[u32; 3]>,
    /// How many triangles are of the outer surface.
    outer: usize,
    /// For each triangle its face.
    faces: Vec<(TetId, u8)>,
    /// Never iterated: their order is that of a hash.
    slot_of_face: HashMap<(TetId, u8), u32>,
    slot_of_vertex: HashMap<SkinVertex, u32>,
}

impl Skin {
    /// Creates the skin of some triangles, usually those of [`crate::CuttableMesh::boundary`].
    #[must_use]
    pub fn new(boundary: impl IntoIterator<Item = BoundaryTriangle>) -> Self {
        let mut skin = Self::default();
        let mut change = SkinChange::default();
        for triangle in boundary {
            skin.add(&triangle, &mut change);
        }
        skin
    }

    /// Returns the corners of the triangles, counterclockwise seen from outside, as indices of vertices: first those of
    /// the outer surface, then those of cuts.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Returns the triangles of the outer surface, a range of [`Skin::triangles`].
    #[must_use]
    pub fn outer_triangles(&self) -> Range<usize> {
        0..self.outer
    }

    /// Returns the triangles of cuts, a range of [`Skin::triangles`].
    #[must_use]
    pub fn cut_triangles(&self) -> Range<usize> {
        self.outer..self.triangles.len()
    }

    /// Returns the tet behind a triangle.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    pub fn tet(&self, triangle: usize) -> TetId {
        self.faces[triangle].0
    }

    /// Returns the kind of a triangle.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    pub fn tag(&self, triangle: usize) -> FaceTag {
        self.vertices[self.triangles[triangle][0] as usize].tag
    }

    /// Returns the vertices. Some may have no triangle; their indices are reused.
    #[must_use]
    pub fn vertices(&self) -> &[SkinVertex] {
        &self.vertices
    }

    /// Applies the delta of a cut or a removal.
    ///
    /// # Panics
    /// If deltas were left out or applied in another order.
    pub fn apply_delta(&mut self, delta: &CutDelta) -> SkinChange {
        let mut change = SkinChange::default();
        for triangle in &delta.surface_removed {
            self.remove(triangle, &mut change);
        }
        for moved in &delta.moved {
            for opposite in 0..4 {
                if let Some(slot) = self.slot_of_face.remove(&(moved.from, opposite)) {
                    self.slot_of_face.insert((moved.to, opposite), slot);
                    self.faces[slot as usize].0 = moved.to;
                }
            }
        }
        for triangle in &delta.surface_added {
            self.add(triangle, &mut change);
        }
        change.triangles.retain(|&slot| slot < self.triangles.len());
        for list in [&mut change.triangles, &mut change.vertices] {
            list.sort_unstable();
            list.dedup();
        }
        change
    }

    /// Returns the unit normals of the vertices for present positions of the particles; zero for vertices without
    /// triangles or with flat ones only. O(triangles).
    ///
    /// # Panics
    /// If a particle has no position.
    #[must_use]
    pub fn normals(&self, positions: &[DVec3]) -> Vec<DVec3> {
        let mut normals = vec![DVec3::ZERO; self.vertices.len()];
        for corners in &self.triangles {
            let at = |v: u32| positions[self.vertices[v as usize].particle.index()];
            let [a, b, c] = corners.map(at);
            // As long as twice the area: large triangles count more.
            let across = (b - a).cross(c - a);
            for v in corners {
                normals[*v as usize] += across;
            }
        }
        for normal in &mut normals {
            *normal = normal.normalize_or_zero();
        }
        normals
    }

    /// Adds a triangle at the end of its range.
    fn add(&mut self, triangle: &BoundaryTriangle, change: &mut SkinChange) {
        let tag = triangle.tag;
        let corners = triangle.particles.map(|particle| {
            let (slot, is_new) = self.vertex(SkinVertex { particle, tag });
            change.vertices.extend(is_new.then_some(slot as usize));
            slot
        });
        let face = (triangle.tet, triangle.opposite);
        let end = self.triangles.len();
        self.triangles.push(corners);
        self.faces.push(face);
        let before = self.slot_of_face.insert(face, index(end));
        assert!(before.is_none(), "a face is on the boundary once");
        change.triangles.push(end);
        if tag == FaceTag::Outer {
            // The first triangle of the cuts makes room.
            self.swap(self.outer, end, change);
            self.outer += 1;
        }
    }

    /// Swaps two triangles.
    fn swap(&mut self, a: usize, b: usize, change: &mut SkinChange) {
        if a == b {
            return;
        }
        self.triangles.swap(a, b);
        self.faces.swap(a, b);
        for slot in [a, b] {
            self.slot_of_face.insert(self.faces[slot], index(slot));
            change.triangles.push(slot);
        }
    }

    /// The slot of a vertex and whether it is new.
    fn vertex(&mut self, vertex: SkinVertex) -> (u32, bool) {
        if let Some(&slot) = self.slot_of_vertex.get(&vertex) {
            self.uses[slot as usize] += 1;
            return (slot, false);
        }
        let slot = self.vacant.pop().unwrap_or_else(|| {
            self.vertices.push(vertex);
            self.uses.push(0);
            index(self.vertices.len() - 1)
        });
        self.vertices[slot as usize] = vertex;
        self.uses[slot as usize] = 1;
        self.slot_of_vertex.insert(vertex, slot);
        (slot, true)
    }

    fn remove(&mut self, triangle: &BoundaryTriangle, change: &mut SkinChange) {
        let face = (triangle.tet, triangle.opposite);
        let slot = self.slot_of_face.get(&face).copied();
        let mut slot = slot.expect("the triangle was on the boundary") as usize;
        if slot < self.outer {
            self.outer -= 1;
            self.swap(slot, self.outer, change);
            slot = self.outer;
        }
        let last = self.triangles.len() - 1;
        self.swap(slot, last, change);
        self.faces.pop();
        self.slot_of_face.remove(&face);
        for v in self.triangles.pop().into_iter().flatten() {
            self.uses[v as usize] -= 1;
            if self.uses[v as usize] == 0 {
                self.slot_of_vertex.remove(&self.vertices[v as usize]);
                self.vacant.push(v);
            }
        }
    }
}
