//! [`CutDelta`]: all changes of a cut, and the only result of this crate's cuts.
//!
//! With the feature `serde` deltas can be written and read, so that a session can be recorded and replayed; take a
//! format that keeps all digits (JSON through `serde_json` does so with its feature `float_roundtrip`).
//! Mesh, solver, clusters and colors consume the same delta instead of comparing before and after. Particles are only
//! ever appended. A cut tet's slot is taken over by its first child and the other children are appended, so tets stay
//! dense and no other tet changes its number.

use glam::DVec3;
use incise_mesh::{ParticleId, TetId, TetMesh};

/// A new particle on an edge.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct EdgePoint {
    /// The ends of the edge; both have smaller ids than the new particle.
    pub ends: [ParticleId; 2],
    /// Position on the edge: 0 at the first end, 1 at the second. The same parameter interpolates rest position,
    /// position, velocity and other quantities of particles, so mass, momentum and volume are kept.
    pub parameter: f64,
}

impl EdgePoint {
    /// Interpolates a quantity of particles at the point.
    #[must_use]
    pub fn interpolate(&self, values: &[DVec3]) -> DVec3 {
        let [a, b] = self.ends.map(|p| values[p.index()]);
        a + (b - a) * self.parameter
    }
}

/// A tet before it was cut or deleted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RemovedTet {
    /// Index of the tet, which its first child has taken over.
    pub tet: TetId,
    /// Corners of the tet before the cut.
    pub corners: [ParticleId; 4],
}

/// A child of a cut tet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct AddedTet {
    /// Its slot, before any moves.
    pub tet: TetId,
    /// Index of the cut tet that the child is a part of.
    pub parent: TetId,
    /// Its corners.
    pub corners: [ParticleId; 4],
    /// Whether the child is on the side of the cut that the normal points to.
    pub positive: bool,
}

/// A tet that was not cut but has copies of particles as corners now.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RelinkedTet {
    /// Its slot.
    pub tet: TetId,
    /// Corners before the cut.
    pub before: [ParticleId; 4],
    /// Corners after the cut.
    pub after: [ParticleId; 4],
}

/// A tet that moved to the index of a deleted one, so that indices stay dense.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MovedTet {
    /// Index before the removal.
    pub from: TetId,
    /// Index after the removal.
    pub to: TetId,
    /// Corners of the tet, which do not change.
    pub corners: [ParticleId; 4],
}

/// Kind of a boundary triangle: outer surface or cut face.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum FaceTag {
    /// Part of the original surface of the body.
    Outer,
    /// Cut face, opened by the stroke with this number.
    Cut(u32),
}

/// A triangle of the boundary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BoundaryTriangle {
    /// The tet that the triangle is a face of.
    pub tet: TetId,
    /// The corner of that tet, 0 to 3, opposite to the triangle.
    pub opposite: u8,
    /// Particles of the triangle, counterclockwise seen from outside.
    pub particles: [ParticleId; 3],
    /// Kind of the triangle.
    pub tag: FaceTag,
}

/// All changes of one cut: new particles, removed and added tets, tets with other corners, and boundary triangles.
///
/// A cut splits and separates tets; a removal deletes and moves tets; an improvement ([`crate::improve`]) gives tets
/// other corners, as their own and only children, and deletes and moves tets. A delta describes one of these.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CutDelta {
    /// Number of particles before the cut; new ones follow: first the points, then the copies.
    pub particles_before: usize,
    /// Number of tets before the cut.
    pub tets_before: usize,
    /// New particles on edges: point `i` is particle `particles_before + i`.
    pub points: Vec<EdgePoint>,
    /// New particles where the body separated, each a copy of the listed particle: copy `i` is particle
    /// `particles_before + points.len() + i`.
    pub copies: Vec<ParticleId>,
    /// The cut tets, ascending.
    pub removed: Vec<RemovedTet>,
    /// Children of the cut tets, ascending by parent, then by index.
    pub added: Vec<AddedTet>,
    /// Tets that were not cut but have other corners now, ascending by index before any moves.
    pub relinked: Vec<RelinkedTet>,
    /// Tets removed without children, ascending by their index before.
    pub deleted: Vec<RemovedTet>,
    /// The last tets, moved to the indices of deleted ones, ascending by `to`. Every `to` is below
    /// [`CutDelta::tets_after`], and no `from` is.
    pub moved: Vec<MovedTet>,
    /// Removed boundary triangles, with the indices of their tets before the cut.
    pub surface_removed: Vec<BoundaryTriangle>,
    /// New boundary triangles, with the indices of their tets after the cut.
    pub surface_added: Vec<BoundaryTriangle>,
    /// Number of particles that the surface was snapped to.
    pub snapped: usize,
    /// Parts too small to come off, which stayed with the other side of the cut. A moving blade may find one in several
    /// frames.
    pub crumbs: usize,
    /// Rest volume of the crumbs in m³.
    pub crumb_volume: f64,
    /// Particles that an improvement took out; 0 for cuts and removals.
    pub collapsed: usize,
    /// Edges inside that an improvement took away by flips; 0 for cuts and removals.
    pub flipped: usize,
    /// Snapped particles of a plane or level set that no earlier cut had snapped to, kept for undo.
    pub bent: Vec<ParticleId>,
    /// Number of opened faces that were recorded, both sides counted as one; kept for undo.
    pub opened: usize,
    /// The smallest volume of a child as a fraction of its parent's (1 if none was cut).
    pub worst_volume_ratio: f64,
    /// The smallest and the largest dihedral angle of a child at rest in degrees, if any tet was cut.
    pub dihedral: Option<[f64; 2]>,
}

impl CutDelta {
    /// Returns whether the cut changed nothing.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
            && self.copies.is_empty()
            && self.added.is_empty()
            && self.deleted.is_empty()
    }

    /// Returns whether the changes are those of an improvement that changed something.
    #[must_use]
    pub fn is_improvement(&self) -> bool {
        self.collapsed > 0 || self.flipped > 0
    }

    /// Returns the number of particles after the cut.
    #[must_use]
    pub fn particles_after(&self) -> usize {
        self.particles_before + self.points.len() + self.copies.len()
    }

    /// Returns the number of tets after the cut.
    #[must_use]
    pub fn tets_after(&self) -> usize {
        self.tets_before + self.added.len() - self.removed.len() - self.deleted.len()
    }

    /// Returns the index after the cut of a tet that was not deleted.
    #[must_use]
    pub fn slot_after(&self, tet: TetId) -> TetId {
        // Both ends of the moves ascend.
        let moved = self.moved.binary_search_by_key(&tet, |moved| moved.from);
        moved.map_or(tet, |i| self.moved[i].to)
    }

    /// Returns the corners of the new tets, ascending, each once.
    #[must_use]
    pub fn created_particles(&self) -> Vec<ParticleId> {
        let corners = self.added.iter().flat_map(|tet| tet.corners);
        let mut particles: Vec<ParticleId> = corners.collect();
        particles.sort_unstable();
        particles.dedup();
        particles
    }

    /// Extends a quantity of particles to the new ones: interpolated on edges, repeated for copies.
    ///
    /// # Panics
    /// If `values` does not have an entry for each particle before the cut.
    pub fn extend_particles(&self, values: &mut Vec<DVec3>) {
        self.extend_with(values, |a, b, t| *a + (*b - *a) * t);
    }

    /// Extends a quantity of particles of any type to the new ones, such as texture coordinates or temperatures.
    /// `interpolate` gets the values at both ends of an edge and the parameter. Copies repeat the value.
    ///
    /// # Panics
    /// If `values` does not have an entry for each particle before the cut.
    ///
    /// # Example
    /// ```
    /// use glam::DVec3;
    /// use incise_cutting::{CutOptions, CuttableMesh, Plane, cut_plane};
    /// use incise_mesh::kuhn_box;
    ///
    /// let mut body = CuttableMesh::new(kuhn_box([2; 3], DVec3::ONE))?;
    /// let rest = body.mesh().positions.clone();
    /// let mut heights: Vec<f64> = rest.iter().map(|x| x.z).collect();
    /// let plane = Plane { point: DVec3::splat(0.4), normal: DVec3::ONE };
    /// let delta = cut_plane(&mut body, &rest, &plane, &CutOptions::default())?;
    /// delta.extend_with(&mut heights, |a, b, t| a + (b - a) * t);
    /// assert!(heights.iter().zip(&body.mesh().positions).all(|(h, x)| (h - x.z).abs() < 1e-12));
    /// # Ok::<(), incise_cutting::CutError>(())
    /// ```
    pub fn extend_with<T: Clone>(
        &self,
        values: &mut Vec<T>,
        interpolate: impl Fn(&T, &T, f64) -> T,
    ) {
        assert_eq!(
            values.len(),
            self.particles_before,
            "one value for each particle before the cut"
        );
        for point in &self.points {
            let [a, b] = point.ends.map(|p| &values[p.index()]);
            values.push(interpolate(a, b, point.parameter));
        }
        for source in &self.copies {
            values.push(values[source.index()].clone());
        }
    }

    /// Applies the delta to a copy of the mesh as it was before the cut.
    ///
    /// # Panics
    /// If the mesh is not the one the delta was made from.
    pub fn apply(&self, mesh: &mut TetMesh) {
        self.extend_particles(&mut mesh.positions);
        mesh.tets
            .resize(self.tets_before.max(self.tets_after()), [ParticleId(0); 4]);
        for added in &self.added {
            mesh.tets[added.tet.index()] = added.corners;
        }
        for relinked in &self.relinked {
            mesh.tets[relinked.tet.index()] = relinked.after;
        }
        for moved in &self.moved {
            mesh.tets[moved.to.index()] = moved.corners;
        }
        mesh.tets.truncate(self.tets_after());
    }
}
