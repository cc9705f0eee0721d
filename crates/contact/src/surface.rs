//! [`ContactSurface`]: the boundary triangles of a mesh with their fans around each vertex, updated by the delta of each cut.
//!
//! Triangles live in slots: a removed one leaves its slot empty, new ones are appended, so that a search tree built over
//! the slots stays valid through a cut. [`ContactSurface::compact`] drops the empty ones now and then. The fan of a
//! particle is a linked list threaded through the corners of its triangles, sorted by face, so that what is computed
//! from it does not depend on the history. Cost: a delta costs what the boundary lost and gained, times the fans it
//! touches; compaction O(n log n).

use std::collections::HashMap;

use foldhash::fast::FixedState;
use glam::DVec3;
use incise_cutting::{BoundaryTriangle, CutDelta, CuttableMesh, FaceTag};
use incise_mesh::{ParticleId, TetId};

use crate::ContactError;
use crate::index::{NONE, index};

/// The triangles removed and added by a delta.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct SurfaceChange {
    /// The slots that became empty, with the faces they held, in the order of the delta.
    pub(crate) removed: Vec<(u32, TetId, u8)>,
    /// The first slot of the new ones, which are the last.
    pub(crate) first_added: u32,
}

/// The boundary of a mesh, updated by the delta of each cut.
///
/// # Example
/// ```
/// use glam::DVec3;
/// use incise_contact::ContactSurface;
/// use incise_cutting::{CutOptions, CuttableMesh, Plane, cut_plane};
/// use incise_mesh::kuhn_box;
///
/// let mut body = CuttableMesh::new(kuhn_box([3; 3], DVec3::ONE))?;
/// let mut surface = ContactSurface::new(&body);
/// assert_eq!(surface.triangles().count(), 2 * 6 * 9);
/// let positions = body.mesh().positions.clone();
/// let plane = Plane { point: DVec3::splat(0.4), normal: DVec3::X };
/// let delta = cut_plane(&mut body, &positions, &plane, &CutOptions::default())?;
/// surface.apply_delta(&body, &delta);
/// surface.check(&body)?; // recomputes and compares
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ContactSurface {
    /// By slot, the empty ones with the triangle they held last.
    slots: Vec<BoundaryTriangle>,
    /// By slot whether it holds a triangle.
    alive: Vec<bool>,
    count: usize,
    /// Never iterated.
    slot_of_face: HashMap<u32, u32, FixedState>,
    /// By particle the first corner of its fan; corner `k` of slot `s` is `3 s + k`.
    head: Vec<u32>,
    /// By corner the next one of the fan.
    next: Vec<u32>,
    /// By slot the square of the area below which the triangle counts as collapsed, times 4.
    collapsed: Vec<f64>,
}

/// A triangle whose area falls below this fraction of that at rest has no reliable normal.
const COLLAPSED_AREA: f64 = 1e-3;

impl ContactSurface {
    /// The boundary of a mesh. O(n log n) for n boundary triangles.
    #[must_use]
    pub fn new(mesh: &CuttableMesh) -> Self {
        let mut surface = Self::default();
        surface.rebuild(mesh);
        surface
    }

    /// Starts over from the boundary of a mesh. O(n log n).
    pub fn rebuild(&mut self, mesh: &CuttableMesh) {
        let mut triangles: Vec<BoundaryTriangle> = mesh.boundary().collect();
        triangles.sort_unstable_by_key(face_of);
        self.fill(mesh, triangles);
    }

    fn fill(&mut self, mesh: &CuttableMesh, triangles: Vec<BoundaryTriangle>) {
        self.slots.clear();
        self.alive.clear();
        self.next.clear();
        self.collapsed.clear();
        self.slot_of_face.clear();
        self.count = 0;
        self.head.clear();
        self.head.resize(mesh.mesh().positions.len(), NONE);
        for triangle in triangles {
            self.add(&mesh.mesh().positions, triangle);
        }
    }

    /// Applies the delta of a cut or a removal. `mesh` is the one after it. Costs what the boundary lost and gained.
    ///
    /// # Panics
    /// If the delta does not follow the last one.
    pub fn apply_delta(&mut self, mesh: &CuttableMesh, delta: &CutDelta) {
        let mut change = SurfaceChange::default();
        self.apply_delta_into(mesh, delta, &mut change);
    }

    /// Applies a delta and notes the slots that it removed and added.
    pub(crate) fn apply_delta_into(
        &mut self,
        mesh: &CuttableMesh,
        delta: &CutDelta,
        change: &mut SurfaceChange,
    ) {
        assert_eq!(
            self.head.len(),
            delta.particles_before,
            "the delta follows the last one"
        );
        self.head.resize(delta.particles_after(), NONE);
        change.removed.clear();
        for triangle in &delta.surface_removed {
            let slot = self.remove(triangle.tet, triangle.opposite);
            change.removed.push((slot, triangle.tet, triangle.opposite));
        }
        for moved in &delta.moved {
            self.move_tet(moved.from, moved.to);
        }
        change.first_added = index(self.slots.len());
        for triangle in &delta.surface_added {
            self.add(&mesh.mesh().positions, *triangle);
        }
    }

    /// Takes a cut back. `mesh` is the one before it.
    pub(crate) fn undo_delta(
        &mut self,
        mesh: &CuttableMesh,
        delta: &CutDelta,
        change: &mut SurfaceChange,
    ) {
        assert_eq!(
            self.head.len(),
            delta.particles_after(),
            "the delta was the last one"
        );
        change.removed.clear();
        for triangle in &delta.surface_added {
            let slot = self.remove(triangle.tet, triangle.opposite);
            change.removed.push((slot, triangle.tet, triangle.opposite));
        }
        for moved in delta.moved.iter().rev() {
            self.move_tet(moved.to, moved.from);
        }
        change.first_added = index(self.slots.len());
        for triangle in &delta.surface_removed {
            self.add(&mesh.mesh().positions, *triangle);
        }
        self.head.truncate(delta.particles_before);
    }

    /// Drops the empty slots; the others are sorted by face. Returns for each old slot the new one. O(n log n).
    pub(crate) fn compact(&mut self, mesh: &CuttableMesh) -> Vec<u32> {
        let old: Vec<u32> = self
            .slots
            .iter()
            .map(|t| key_of(t.tet, t.opposite))
            .collect();
        let alive = std::mem::take(&mut self.alive);
        let held = self.slots.iter().zip(&alive).filter(|(_, alive)| **alive);
        let mut triangles: Vec<BoundaryTriangle> = held.map(|(triangle, _)| *triangle).collect();
        triangles.sort_unstable_by_key(face_of);
        self.fill(mesh, triangles);
        let slots = old.iter().zip(alive).map(|(key, alive)| {
            let slot = self.slot_of_face.get(key).filter(|_| alive);
            slot.copied().unwrap_or(NONE)
        });
        slots.collect()
    }

    /// The triangles, in the order of their slots.
    pub fn triangles(&self) -> impl Iterator<Item = &BoundaryTriangle> + '_ {
        let slots = self.slots.iter().zip(&self.alive);
        slots.filter_map(|(triangle, alive)| alive.then_some(triangle))
    }

    /// How many triangles there are. O(1).
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.count
    }

    /// The particles that have a triangle, ascending. O(particles).
    pub fn vertices(&self) -> impl Iterator<Item = ParticleId> + '_ {
        let heads = self.head.iter().enumerate();
        heads
            .filter(|(_, head)| **head != NONE)
            .map(|(p, _)| ParticleId::new(p))
    }

    /// The triangles around a particle, by tet and face.
    ///
    /// # Panics
    /// If there is no such particle.
    pub fn fan(&self, particle: ParticleId) -> impl Iterator<Item = &BoundaryTriangle> + '_ {
        self.corners(particle).map(|(slot, _)| self.triangle(slot))
    }

    /// The slots of a fan, each with the corner that the particle is, by tet and face.
    pub(crate) fn corners(&self, particle: ParticleId) -> impl Iterator<Item = (u32, usize)> + '_ {
        let mut corner = self.head[particle.index()];
        std::iter::from_fn(move || {
            let here = (corner != NONE).then_some(corner)?;
            corner = self.next[here as usize];
            Some((here / 3, (here % 3) as usize))
        })
    }

    pub(crate) fn slot_count(&self) -> usize {
        self.slots.len()
    }

    pub(crate) fn is_alive(&self, slot: u32) -> bool {
        self.alive[slot as usize]
    }

    /// The triangle of a slot; of an empty one the triangle it held last.
    pub(crate) fn triangle(&self, slot: u32) -> &BoundaryTriangle {
        &self.slots[slot as usize]
    }

    pub(crate) fn key(&self, slot: u32) -> u32 {
        face_of(self.triangle(slot))
    }

    pub(crate) fn slot_of(&self, tet: TetId, opposite: u8) -> Option<u32> {
        self.slot_of_face.get(&key_of(tet, opposite)).copied()
    }

    /// The area vector of a triangle: along its outward normal, twice its area long.
    pub(crate) fn area(&self, slot: u32, positions: &[DVec3]) -> DVec3 {
        let corners = self.triangle(slot).particles;
        let [a, b, c] = corners.map(|p| positions[p.index()]);
        (b - a).cross(c - a)
    }

    /// Whether the squared length of an area vector is that of a triangle that has collapsed.
    pub(crate) fn is_collapsed(&self, slot: u32, squared: f64) -> bool {
        squared.is_nan() || squared <= self.collapsed[slot as usize]
    }

    /// The mean edge of the triangles at the positions given, 0 without any. O(triangles).
    #[must_use]
    pub fn mean_edge(&self, positions: &[DVec3]) -> f64 {
        let mut sum = 0.0;
        for triangle in self.triangles() {
            let [a, b, c] = triangle.particles.map(|p| positions[p.index()]);
            sum += a.distance(b) + b.distance(c) + c.distance(a);
        }
        sum / (3 * self.count.max(1)) as f64
    }

    fn add(&mut self, rest: &[DVec3], triangle: BoundaryTriangle) {
        let slot = index(self.slots.len());
        let before = self.slot_of_face.insert(face_of(&triangle), slot);
        assert!(before.is_none(), "a face is on the boundary once");
        self.slots.push(triangle);
        self.alive.push(true);
        self.next.extend([NONE; 3]);
        self.count += 1;
        let area = self.area(slot, rest).length_squared();
        self.collapsed.push(COLLAPSED_AREA.powi(2) * area);
        self.link(slot);
    }

    /// Empties a slot and returns it.
    fn remove(&mut self, tet: TetId, opposite: u8) -> u32 {
        let slot = self.slot_of_face.remove(&key_of(tet, opposite));
        let slot = slot.expect("the triangle was on the boundary");
        self.unlink(slot);
        self.alive[slot as usize] = false;
        self.count -= 1;
        slot
    }

    fn move_tet(&mut self, from: TetId, to: TetId) {
        for opposite in 0..4 {
            if let Some(slot) = self.slot_of_face.remove(&key_of(from, opposite)) {
                self.unlink(slot);
                self.slots[slot as usize].tet = to;
                self.slot_of_face.insert(key_of(to, opposite), slot);
                self.link(slot);
            }
        }
    }

    /// Puts the corners of a triangle into the fans of its particles.
    fn link(&mut self, slot: u32) {
        let key = self.key(slot);
        for (k, particle) in (0..).zip(self.triangle(slot).particles) {
            let mut before = NONE;
            let mut here = self.head[particle.index()];
            while here != NONE && self.key(here / 3) < key {
                before = here;
                here = self.next[here as usize];
            }
            let corner = 3 * slot + k;
            self.next[corner as usize] = here;
            self.set_next(particle, before, corner);
        }
    }

    fn unlink(&mut self, slot: u32) {
        for (k, particle) in (0..).zip(self.triangle(slot).particles) {
            let corner = 3 * slot + k;
            let mut before = NONE;
            let mut here = self.head[particle.index()];
            while here != corner {
                before = here;
                here = self.next[here as usize];
            }
            self.set_next(particle, before, self.next[corner as usize]);
        }
    }

    fn set_next(&mut self, particle: ParticleId, before: u32, corner: u32) {
        if before == NONE {
            self.head[particle.index()] = corner;
        } else {
            self.next[before as usize] = corner;
        }
    }

    /// Recomputes everything from the mesh and compares. O(n log n); for tests and on request.
    ///
    /// # Errors
    /// [`ContactError::Differs`] names the first difference.
    pub fn check(&self, mesh: &CuttableMesh) -> Result<(), ContactError> {
        let differs = |what: String| Err(ContactError::Differs(what));
        let mut expected: Vec<BoundaryTriangle> = mesh.boundary().collect();
        expected.sort_unstable_by_key(face_of);
        let mut known: Vec<BoundaryTriangle> = self.triangles().copied().collect();
        known.sort_unstable_by_key(face_of);
        if known.len() != self.count || self.count != self.slot_of_face.len() {
            return differs(format!("{} triangles are counted wrong", known.len()));
        }
        if let Some((known, expected)) = known.iter().zip(&expected).find(|(k, e)| k != e) {
            return differs(format!("the triangle {known:?} should be {expected:?}"));
        }
        if known.len() != expected.len() {
            let (known, expected) = (known.len(), expected.len());
            return differs(format!("{known} triangles are known, there are {expected}"));
        }
        for slot in (0..index(self.slots.len())).filter(|&slot| self.is_alive(slot)) {
            let triangle = self.triangle(slot);
            if self.slot_of(triangle.tet, triangle.opposite) != Some(slot) {
                return differs(format!("the slot of {triangle:?} is not {slot}"));
            }
        }
        let fresh = Self::new(mesh);
        if self.head.len() != fresh.head.len() {
            return differs(format!("{} particles are known", self.head.len()));
        }
        for particle in (0..self.head.len()).map(ParticleId::new) {
            if !self.fan(particle).eq(fresh.fan(particle)) {
                return differs(format!("the fan of particle {particle} is wrong"));
            }
        }
        Ok(())
    }
}

/// The number of a face: `4 tet + the corner it lies opposite to`.
fn face_of(triangle: &BoundaryTriangle) -> u32 {
    key_of(triangle.tet, triangle.opposite)
}

fn key_of(tet: TetId, opposite: u8) -> u32 {
    4 * tet.0 + u32::from(opposite)
}

/// Whether a triangle was laid bare by a cut.
pub(crate) fn is_cut(triangle: &BoundaryTriangle) -> bool {
    matches!(triangle.tag, FaceTag::Cut(_))
}
