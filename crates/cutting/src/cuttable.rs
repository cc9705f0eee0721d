//! [`CuttableMesh`]: a mesh together with the lists that make cutting it local.

use std::collections::HashMap;

use foldhash::fast::FixedState;
use incise_mesh::{ParticleId, TetId, TetMesh};

use crate::faces::{Behind, Face, Faces};
use crate::places::Places;
use crate::sheets::Sheets;
use crate::stars::VertexStars;
use crate::{BoundaryTriangle, CutError};

/// A tetrahedral mesh at rest that can be cut.
///
/// Owns the mesh and the lists that make cutting it local: the tets around each particle, the neighbor behind each
/// face, and the boundary triangles. Strokes change these in place and return the changes as a [`crate::CutDelta`].
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CuttableMesh {
    pub(crate) mesh: TetMesh,
    pub(crate) stars: VertexStars,
    pub(crate) faces: Faces,
    /// How far planes and level sets were bent to particles. Never iterated.
    pub(crate) bent: HashMap<ParticleId, f64, FixedState>,
    /// The cut faces as they were opened.
    pub(crate) sheets: Sheets,
    /// Which particles are at one place.
    pub(crate) places: Places,
    /// The mean volume of the tets that the mesh was made of, in m³.
    pub(crate) mean_volume: f64,
    /// The particles that the appended meshes were made of: first and end of each range, ascending.
    pub(crate) original: Vec<[usize; 2]>,
}

impl CuttableMesh {
    /// Creates a cuttable mesh from a mesh, which is checked.
    ///
    /// # Errors
    /// [`CutError::Mesh`] if the mesh does not pass [`TetMesh::check`].
    pub fn new(mesh: TetMesh) -> Result<Self, CutError> {
        mesh.check()?;
        let stars = VertexStars::new(&mesh);
        let faces = Faces::new(&mesh);
        let mean_volume = mesh.total_volume() / mesh.tets.len().max(1) as f64;
        Ok(Self {
            mean_volume,
            original: vec![[0, mesh.positions.len()]],
            mesh,
            stars,
            faces,
            bent: HashMap::default(),
            sheets: Sheets::new(edge_of(mean_volume)),
            places: Places::new(edge_of(mean_volume)),
        })
    }

    /// Turns on or off that cuts record the faces they open, some 100 bytes each; on at first. Only [`improve`](crate::improve())
    /// needs them: a cut face that was not recorded stays in its plane. O(1).
    pub fn record_opened_faces(&mut self, on: bool) {
        self.sheets.is_recording = on;
    }

    /// Appends another mesh with its cuts. Its particles and tets follow those of this mesh, in their order, and so do
    /// its boundary triangles, which keep their tags. Sweeps that are under way on either mesh end. O(mesh appended).
    ///
    /// # Panics
    /// If both meshes together have 2²⁹ tets or more.
    ///
    /// # Example
    /// ```
    /// use glam::DVec3;
    /// use incise_cutting::CuttableMesh;
    /// use incise_mesh::kuhn_box;
    ///
    /// let mut bodies = CuttableMesh::new(kuhn_box([2, 1, 1], DVec3::ONE))?;
    /// let other = CuttableMesh::new(kuhn_box([1, 1, 1], DVec3::ONE))?;
    /// let triangles = bodies.boundary_count() + other.boundary_count();
    /// bodies.append(&other);
    /// bodies.check()?;
    /// assert_eq!(bodies.boundary_count(), triangles);
    /// assert_eq!(bodies.mesh().pieces().count, 2);
    /// # Ok::<(), incise_cutting::CutError>(())
    /// ```
    pub fn append(&mut self, other: &Self) {
        let first = self.mesh.positions.len();
        let shifted = |p: ParticleId| ParticleId::new(first + p.index());
        let [tets, appended] = [&self.mesh, &other.mesh].map(|mesh| mesh.tets.len() as f64);
        let volume = tets * self.mean_volume + appended * other.mean_volume;
        self.mean_volume = volume / (tets + appended).max(1.0);
        self.mesh.positions.extend(&other.mesh.positions);
        let corners = other.mesh.tets.iter().map(|tet| tet.map(shifted));
        self.mesh.tets.extend(corners);
        self.stars.append(&other.stars);
        self.faces.append(&other.faces);
        let bent = other.bent.iter().map(|(&p, &by)| (shifted(p), by));
        self.bent.extend(bent);
        self.sheets
            .append(&other.sheets, &self.mesh.positions, first);
        self.places
            .append(&other.places, &other.mesh.positions, first);
        let original = other.original.iter().map(|range| range.map(|p| first + p));
        self.original.extend(original);
    }

    /// The edge of a regular tet with the mean volume of the tets that the mesh was made of, in m.
    pub(crate) fn mean_edge(&self) -> f64 {
        edge_of(self.mean_volume)
    }

    /// Returns whether a particle has tets around it and none of the boundary triangles. O(tets around it).
    ///
    /// # Panics
    /// If the particle does not exist.
    #[must_use]
    pub fn is_inside(&self, particle: ParticleId) -> bool {
        let mut faces = self.around(particle).flat_map(Face::of);
        let is_at = |face: &Face| face.particles(&self.mesh).contains(&particle);
        let is_bounded =
            faces.any(|face| is_at(&face) && matches!(self.faces.behind(face), Behind::Nothing(_)));
        !is_bounded && self.around(particle).next().is_some()
    }

    /// Returns whether a particle is of the mesh as it was made, or of one that was appended, not of a cut. O(appended
    /// meshes).
    #[must_use]
    pub fn is_original(&self, particle: ParticleId) -> bool {
        let mut ranges = self.original.iter();
        ranges.any(|&[first, end]| (first..end).contains(&particle.index()))
    }

    /// Returns the mesh at rest, with all cuts made so far.
    #[must_use]
    pub fn mesh(&self) -> &TetMesh {
        &self.mesh
    }

    /// Returns the tets around a particle, in an unspecified order that depends only on the history of cuts.
    ///
    /// # Panics
    /// If the particle does not exist.
    pub fn around(&self, particle: ParticleId) -> impl Iterator<Item = TetId> + '_ {
        self.stars.around(particle)
    }

    /// The tets around the given particles, each once, ascending.
    pub(crate) fn tets_around(&self, particles: &[ParticleId]) -> Vec<TetId> {
        let mut tets: Vec<TetId> = particles.iter().flat_map(|&p| self.around(p)).collect();
        tets.sort_unstable();
        tets.dedup();
        tets
    }

    /// The length at rest of the longest edge of the tets around an edge's ends.
    pub(crate) fn longest_edge_around(&self, ends: [ParticleId; 2]) -> f64 {
        let rest = &self.mesh.positions;
        let mut longest: f64 = 0.0;
        for end in ends {
            for tet in self.around(end) {
                for corner in self.mesh.tets[tet.index()] {
                    longest = longest.max(rest[corner.index()].distance_squared(rest[end.index()]));
                }
            }
        }
        longest.sqrt()
    }

    /// Returns the tet behind each face of a tet, by the corner opposite to the face; `None` on the boundary. O(1).
    ///
    /// # Panics
    /// If the tet does not exist.
    #[must_use]
    pub fn neighbors(&self, tet: TetId) -> [Option<TetId>; 4] {
        Face::of(tet).map(|face| match self.faces.behind(face) {
            Behind::Twin(twin) => Some(twin.tet()),
            Behind::Nothing(_) => None,
        })
    }

    /// Returns the number of boundary triangles. O(1).
    #[must_use]
    pub fn boundary_count(&self) -> usize {
        self.faces.boundary().len()
    }

    /// Returns the boundary triangles, outer ones and cut ones, without a pass over the mesh.
    ///
    /// The order depends only on the history of cuts: a triangle that is cut keeps its index for one of its parts; new
    /// ones are appended.
    pub fn boundary(&self) -> impl Iterator<Item = BoundaryTriangle> + '_ {
        let faces = self.faces.boundary().iter();
        faces.filter_map(|&(face, _)| self.faces.triangle(&self.mesh, face))
    }

    /// Checks the mesh and recomputes the lists to compare. O(n log n); for tests and on request.
    ///
    /// # Errors
    /// [`CutError::Mesh`] if the mesh is broken.
    ///
    /// # Panics
    /// If the lists around the particles or the links across faces do not belong to the mesh, which would be a defect
    /// of this crate.
    pub fn check(&self) -> Result<(), CutError> {
        // A body may have been removed as a whole.
        if !self.mesh.tets.is_empty() {
            self.mesh.check()?;
        }
        assert_eq!(
            self.stars.first_difference(&self.mesh),
            None,
            "the lists of tets around particles are current"
        );
        assert_eq!(
            self.faces.first_difference(&self.mesh),
            None,
            "the links across faces and the boundary triangles are current"
        );
        Ok(())
    }
}

/// The edge of a regular tet with a volume: e³ / (6 √2).
fn edge_of(volume: f64) -> f64 {
    (volume * 6.0 * std::f64::consts::SQRT_2).cbrt()
}
