//! Undo: a delta replayed backwards.
//!
//! The mesh comes back byte for byte; stars, links and boundary triangles come back as sets, and nothing that is made
//! of them depends on their order. Cost: that of the cut.

use incise_mesh::{ParticleId, TetId};

use crate::faces::{Face, sorted};
use crate::{AddedTet, CutDelta, CutError, CuttableMesh};

impl CuttableMesh {
    /// Undoes the last cut or removal: restores the mesh before it, byte for byte.
    ///
    /// Strokes in progress and a [`crate::StrokeRegistry`] cannot be updated: continue with clones from before the cut,
    /// or start new ones.
    ///
    /// # Errors
    /// [`CutError::NotLast`] if the mesh does not have the size and the new tets that `delta` left it with; nothing is changed
    /// then.
    ///
    /// # Panics
    /// If `delta` is of another mesh of the same size with the same new tets.
    ///
    /// # Example
    /// ```
    /// use glam::DVec3;
    /// use incise_cutting::{CutOptions, CuttableMesh, Plane, cut_plane};
    /// use incise_mesh::kuhn_box;
    ///
    /// let mesh = kuhn_box([3; 3], DVec3::ONE);
    /// let mut body = CuttableMesh::new(mesh.clone())?;
    /// let plane = Plane { point: DVec3::splat(0.4), normal: DVec3::ONE };
    /// let delta = cut_plane(&mut body, &mesh.positions, &plane, &CutOptions::default())?;
    /// body.undo(&delta)?;
    /// assert_eq!(body.mesh(), &mesh);
    /// # Ok::<(), incise_cutting::CutError>(())
    /// ```
    pub fn undo(&mut self, delta: &CutDelta) -> Result<(), CutError> {
        let (tets, particles) = (delta.tets_after(), delta.particles_after());
        let has_child = |child: &AddedTet| {
            let slot = delta.slot_after(child.tet).index();
            self.mesh.tets.get(slot) == Some(&child.corners)
        };
        if (self.mesh.tets.len(), self.mesh.positions.len()) != (tets, particles)
            || !delta.added.iter().all(has_child)
        {
            return Err(CutError::NotLast { tets, particles });
        }
        delta.take_back(self);
        Ok(())
    }

    /// The other tet that has a face.
    fn twin_of(&self, face: Face) -> Option<Face> {
        let particles = sorted(face.particles(&self.mesh));
        let around = self.stars.around(particles[0]).filter(|&t| t != face.tet());
        let faces = around.flat_map(Face::of);
        let mut twins = faces.filter(|twin| sorted(twin.particles(&self.mesh)) == particles);
        twins.next()
    }
}

impl CutDelta {
    pub(crate) fn take_back(&self, cuttable: &mut CuttableMesh) {
        let CuttableMesh {
            mesh,
            stars,
            faces,
            bent,
            sheets,
            places,
            mean_volume: _,
            original: _,
        } = cuttable;
        let new = (self.particles_before..self.particles_after()).map(ParticleId::new);
        for particle in new.chain(self.bent.iter().copied()) {
            bent.remove(&particle);
        }
        sheets.truncate(mesh, sheets.count() - self.opened);
        places.truncate(mesh, self.particles_before);
        let face = |tet: TetId, opposite: u8| Face::of(tet)[usize::from(opposite)];
        for triangle in &self.surface_added {
            faces.close(face(triangle.tet, triangle.opposite));
        }

        // Taken away tets come back.
        let most = self.tets_before.max(mesh.tets.len());
        mesh.tets.resize(most, [ParticleId(0); 4]);
        stars.resize(mesh.positions.len(), most);
        faces.resize(most);
        for moved in self.moved.iter().rev() {
            stars.remove(moved.to, moved.corners);
            stars.insert(moved.from, moved.corners);
            faces.move_tet(moved.to, moved.from);
            mesh.tets[moved.from.index()] = moved.corners;
        }
        for deleted in &self.deleted {
            stars.insert(deleted.tet, deleted.corners);
            faces.clear(deleted.tet);
            mesh.tets[deleted.tet.index()] = deleted.corners;
        }

        // Split tets become whole, separated ones hang together.
        for child in &self.added {
            stars.remove(child.tet, child.corners);
        }
        for relinked in &self.relinked {
            stars.remove(relinked.tet, relinked.after);
            stars.insert(relinked.tet, relinked.before);
            mesh.tets[relinked.tet.index()] = relinked.before;
        }
        for removed in &self.removed {
            stars.insert(removed.tet, removed.corners);
            faces.clear(removed.tet);
            mesh.tets[removed.tet.index()] = removed.corners;
        }
        mesh.tets.truncate(self.tets_before);
        mesh.positions.truncate(self.particles_before);
        stars.resize(self.particles_before, self.tets_before);
        faces.resize(self.tets_before);

        for triangle in &self.surface_removed {
            faces.open(face(triangle.tet, triangle.opposite), triangle.tag);
        }
        self.find_twins(cuttable);
    }

    /// Joins the faces that were left without a link.
    fn find_twins(&self, cuttable: &mut CuttableMesh) {
        let before = |tet: TetId| {
            let moved = self.moved.binary_search_by_key(&tet, |moved| moved.to);
            moved.map_or(tet, |i| self.moved[i].from)
        };
        let opened = self
            .surface_added
            .iter()
            .map(|triangle| before(triangle.tet));
        let mut tets: Vec<TetId> = opened
            .filter(|tet| tet.index() < self.tets_before)
            .collect();
        tets.extend(self.removed.iter().chain(&self.deleted).map(|tet| tet.tet));
        tets.extend(self.relinked.iter().map(|tet| tet.tet));
        tets.sort_unstable();
        tets.dedup();
        for face in tets.into_iter().flat_map(Face::of) {
            if cuttable.faces.is_loose(face)
                && let Some(twin) = cuttable.twin_of(face)
            {
                cuttable.faces.join(face, twin);
            }
        }
    }
}
