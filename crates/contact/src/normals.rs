//! Normals of the parts of a surface: its faces, edges and vertices.
//!
//! Where the closest point of a surface lies on an edge or a vertex, the normals of the faces there may disagree about
//! the side that a point is on. The sum of the normals weighted by the angles that the faces take up there does not
//! (J. A. Bærentzen and H. Aanæs 2005, Signed Distance Computation Using the Angle Weighted Pseudonormal). Cost: that
//! of the fan.

use glam::DVec3;
use incise_cutting::BoundaryTriangle;
use incise_mesh::{ParticleId, TrianglePart};

use crate::surface::ContactSurface;
use crate::tree::Box32;

/// The body and the piece of a triangle.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Owner {
    pub(crate) body: u32,
    pub(crate) piece: u32,
}

/// A triangle at the present positions: what a search reads of it, side by side.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PlacedTriangle {
    /// Of unit length; zero for an empty slot and for a triangle that must not be touched, because it has collapsed or its
    /// tet is inverted.
    pub(crate) normal: DVec3,
    /// See [`ContactSurface::area`]; of use where there is a triangle.
    pub(crate) area: DVec3,
    pub(crate) corners: [DVec3; 3],
    pub(crate) owner: Owner,
    /// The box around the tet behind it; empty where there is no normal.
    pub(crate) tet: Box32,
    /// The box around the ways that its corners go in the frame.
    pub(crate) steps: Box32,
    /// Whether the tet behind it is inverted by more than rounding.
    pub(crate) is_inverted: bool,
    /// Whether a corner has moved out of its reserve.
    pub(crate) is_marked: bool,
}

/// A surface at the present positions.
#[derive(Clone, Copy)]
pub(crate) struct Shape<'a> {
    pub(crate) surface: &'a ContactSurface,
    pub(crate) positions: &'a [DVec3],
    /// By slot.
    pub(crate) placed: &'a [PlacedTriangle],
    /// By particle.
    pub(crate) inversions: &'a [Inversion],
}

/// Whether a vertex has been pushed through its own tets, so that it is on the wrong side of its own surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Inversion {
    /// It has not.
    #[default]
    None,
    /// At the last search it had, and may not be out of its own part yet.
    Recent,
    /// A tet at it is inverted.
    Present,
}

impl<'a> Shape<'a> {
    pub(crate) fn triangle(&self, slot: u32) -> &'a BoundaryTriangle {
        self.surface.triangle(slot)
    }

    pub(crate) fn normal(&self, slot: u32) -> DVec3 {
        self.placed[slot as usize].normal
    }

    pub(crate) fn inversion(&self, vertex: ParticleId) -> Inversion {
        self.inversions[vertex.index()]
    }

    pub(crate) fn is_sound(&self, slot: u32) -> bool {
        self.normal(slot) != DVec3::ZERO
    }

    pub(crate) fn corners(&self, slot: u32) -> [DVec3; 3] {
        self.placed[slot as usize].corners
    }

    pub(crate) fn owner(&self, slot: u32) -> Owner {
        self.placed[slot as usize].owner
    }

    /// The sound triangles that share a part with a triangle, itself included, each with its corner at the part (for a
    /// side, at one of its ends).
    pub(crate) fn around(
        &self,
        slot: u32,
        part: TrianglePart,
    ) -> impl Iterator<Item = (u32, usize)> + 'a {
        let shape = *self;
        let particles = self.triangle(slot).particles;
        let (corner, other_end) = match part {
            TrianglePart::Face => (None, None),
            TrianglePart::Corner(k) => (Some(particles[usize::from(k)]), None),
            TrianglePart::Side(k) => {
                let k = usize::from(k);
                (Some(particles[k]), Some(particles[(k + 1) % 3]))
            }
        };
        let alone = corner.is_none().then_some((slot, 0));
        let fan = corner.into_iter();
        let fan = fan.flat_map(move |corner| shape.surface.corners(corner));
        let shares = move |(slot, _): &(u32, usize)| {
            let particles = shape.triangle(*slot).particles;
            shape.is_sound(*slot) && other_end.is_none_or(|end| particles.contains(&end))
        };
        alone.into_iter().chain(fan.filter(shares))
    }

    /// The vector that says on which side of the surface a point is whose closest point lies on this part of a sound
    /// triangle, of unit length.
    pub(crate) fn side_normal(&self, slot: u32, part: TrianglePart) -> DVec3 {
        let face = self.normal(slot);
        if part == TrianglePart::Face {
            return face;
        }
        let mut sum = DVec3::ZERO;
        for (other, corner) in self.around(slot, part) {
            let weight = match part {
                TrianglePart::Corner(_) => {
                    let corners = self.corners(other);
                    let [at, next, last] = [0, 1, 2].map(|k| corners[(corner + k) % 3]);
                    (next - at).angle_between(last - at)
                }
                _ => 1.0,
            };
            sum += self.normal(other) * weight;
        }
        // Faces folded onto each other have no common outside.
        sum.normalize_or(face)
    }
}

#[cfg(test)]
mod tests {
    use incise_cutting::CuttableMesh;
    use incise_mesh::{ParticleId, kuhn_box};

    use super::*;

    /// At a corner of a box the angles are right whatever the triangles; so is the sum at an edge.
    #[test]
    fn of_a_box() {
        let body = CuttableMesh::new(kuhn_box([2; 3], DVec3::ONE)).unwrap();
        let positions = &body.mesh().positions;
        let surface = ContactSurface::new(&body);
        let slots = 0..u32::try_from(surface.slot_count()).unwrap();
        let placed = slots.map(|slot| PlacedTriangle {
            normal: surface.area(slot, positions).normalize(),
            corners: surface
                .triangle(slot)
                .particles
                .map(|p| positions[p.index()]),
            ..PlacedTriangle::default()
        });
        let placed: Vec<PlacedTriangle> = placed.collect();
        let shape = Shape {
            surface: &surface,
            positions,
            placed: &placed,
            inversions: &[],
        };
        let particle = |x: DVec3| ParticleId::new(positions.iter().position(|p| *p == x).unwrap());
        let top = particle(DVec3::ONE);
        for (slot, k) in surface.corners(top) {
            let normal = shape.side_normal(slot, TrianglePart::Corner([0, 1, 2][k]));
            assert!(normal.distance(DVec3::ONE.normalize()) < 1e-15);
        }
        let next = particle(DVec3::new(1.0, 1.0, 0.5));
        let mut sides = 0;
        for (slot, k) in surface.corners(top) {
            let particles = surface.triangle(slot).particles;
            let side = match [particles[(k + 1) % 3], particles[(k + 2) % 3]] {
                [p, _] if p == next => k,
                [_, p] if p == next => (k + 2) % 3,
                _ => continue,
            };
            sides += 1;
            let normal = shape.side_normal(slot, TrianglePart::Side([0, 1, 2][side]));
            assert!(normal.distance(DVec3::new(1.0, 1.0, 0.0).normalize()) < 1e-15);
        }
        assert_eq!(sides, 2);
    }
}
