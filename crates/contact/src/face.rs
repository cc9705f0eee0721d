//! [`FaceContact`]: a vertex and a triangle, with the planes that bound the surface where they meet.
//!
//! The surface near a triangle is known by its plane, and where the edge nearest to the vertex is convex by the plane of
//! the triangle beyond that edge: a vertex is outside if it is outside of one of both. A plane has no end, the surface
//! has. Where it ends near the vertex, at a rim or a corner, a contact has a [`FaceLimit`]: the direction that parts the
//! vertex from the closest point if they are apart, otherwise the direction out of the triangle. Past the limit nothing is
//! touched.
//!
//! All directions are given in the basis of the triangle, so that they turn with it between two searches. Cost: the fans
//! of the vertex and of a corner of the triangle.

use glam::DVec3;
use incise_mesh::{ParticleId, TrianglePart, closest_on_triangle};

use crate::normals::Shape;

/// The sine of the angle between two triangles from which the edge between them counts as convex.
const FLAT: f64 = 1e-3;
/// The cosine between the normals of two triangles below which they face each other, and that above which they do not.
const FACES: f64 = -0.3;
const FACES_NOT: f64 = -0.1;
/// How far beyond an edge or a corner, in altitudes of the triangle, a contact that touches there goes on.
const MARGIN: f64 = 0.25;

/// Limit of a contact at a rim or a corner, beyond which it does not act. See [`FaceContact::limit`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FaceLimit {
    /// The direction away from the surface in the basis of the triangle, as [`FaceContact::beyond`].
    pub normal: [f64; 3],
    /// Largest distance from the surface in that direction, in m.
    pub distance: f64,
}

/// A contact of a vertex with a triangle: `n · (x₀ − Σ βᵢ xᵢ) ≥ 0` with weights `β` of a point of the triangle.
///
/// The weights are those of the present positions, not of the search: the foot of the vertex in the plane of the triangle,
/// at most a quarter of an altitude beyond it. On a flat surface the contact then stays while the vertex slides on to the
/// next triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FaceContact {
    /// The vertex, then the corners of the triangle, counterclockwise seen from outside, turned so that the edge nearest to
    /// the vertex runs from the first corner to the second.
    pub particles: [u32; 4],
    /// Where that edge is convex, the outward normal of the surface beyond it: `[a, b, c]` stands for
    /// `a e₁ + b e₂ + c (e₁ × e₂)` with `e₁ = x₂ − x₁` and `e₂ = x₃ − x₁`. A vertex on the outer side of the plane through
    /// the edge with this normal touches nothing.
    ///
    /// There is none if no triangle around the vertex faces the surface beyond: at the rim of a cut, the vertices of one
    /// side meet the cut face of the other side and not its outer surface.
    pub beyond: Option<[f64; 3]>,
    /// Where the surface ends near that edge: a vertex whose way from the closest point of the edge goes further in this
    /// direction touches nothing.
    pub limit: Option<FaceLimit>,
}

impl FaceContact {
    /// The normal of the surface that holds the vertex, of unit length: that of the plane of the triangle or of the one
    /// beyond, whichever the vertex is less deep under. Past the limit its direction; zero if the triangle has collapsed.
    ///
    /// # Panics
    /// If a particle has no position.
    #[must_use]
    pub fn normal_at(&self, positions: &[DVec3]) -> DVec3 {
        self.acting(positions).0
    }

    /// The distance of the vertex from the surface along [`Self::normal_at`] in m, negative inside.
    ///
    /// # Panics
    /// If a particle has no position.
    #[must_use]
    pub fn gap(&self, positions: &[DVec3]) -> f64 {
        self.acting(positions).1
    }

    /// The normal and the distance.
    fn acting(&self, positions: &[DVec3]) -> (DVec3, f64) {
        let [x, x1, x2, x3] = self.particles.map(|p| positions[p as usize]);
        let (e1, e2, r) = (x2 - x1, x3 - x1, x - x1);
        let area = e1.cross(e2);
        let combined = |[a, b, c]: [f64; 3]| (e1 * a + e2 * b + area * c).normalize_or_zero();
        let normal = area.normalize_or_zero();
        let mut acting = (normal, normal.dot(r));
        if normal == DVec3::ZERO {
            return acting;
        }
        let part = (r.dot(e1) / e1.length_squared()).clamp(0.0, 1.0);
        let way = r - e1 * part;
        if let Some(normal) = self.beyond.map(combined) {
            let height = normal.dot(way);
            if height > acting.1 {
                acting = (normal, height);
            }
        }
        if let Some(limit) = self.limit {
            let outward = combined(limit.normal);
            let along = outward.dot(way);
            if along > limit.distance && along > acting.1 {
                acting = (outward, along);
            }
        }
        acting
    }
}

/// Where a vertex and a triangle meet.
#[derive(Clone, Copy)]
pub(crate) struct Meeting {
    pub(crate) vertex: ParticleId,
    pub(crate) slot: u32,
    /// The part of the triangle that is closest to the vertex.
    pub(crate) part: TrianglePart,
    /// The direction from the closest point to the vertex, of unit length, if they are apart there, outside, and the
    /// closest point is on an edge or a corner.
    pub(crate) apart: Option<DVec3>,
    pub(crate) is_inside: bool,
    /// Up to this distance they touch, from this one on there is no contact.
    pub(crate) touching: f64,
    pub(crate) reach: f64,
}

/// The corners of a triangle, an edge of it first.
type Turned = [ParticleId; 3];

/// A contact of a vertex with the surface at a sound triangle, and the slot of the triangle that it is with.
pub(crate) fn face_contact(shape: &Shape<'_>, meeting: &Meeting) -> (FaceContact, u32) {
    let Meeting { vertex, slot, .. } = *meeting;
    let at = |p: ParticleId| shape.positions[p.index()];
    let side = nearest_side(shape, meeting);
    let corners = shape.triangle(slot).particles;
    let turned: Turned = [0, 1, 2].map(|k| corners[(usize::from(side) + k) % 3]);
    let [p, q, _] = turned;
    let own = shape.normal(slot);
    let around = shape.around(slot, TrianglePart::Side(side));
    let other = around.map(|(other, _)| other).find(|&other| other != slot);
    let other = other.and_then(|other| {
        let mut corners = shape.triangle(other).particles.into_iter();
        let far = corners.find(|corner| *corner != p && *corner != q)?;
        let way = at(far) - at(p);
        // Convex: the other triangle bends away from the plane of this one.
        (own.dot(way) < -FLAT * way.length()).then_some((other, far))
    });
    let Some((other, far)) = other else {
        let contact = contact(shape, meeting, own, turned, None, false);
        return (contact, slot);
    };
    let normal = shape.normal(other);
    let (mut to_own, mut to_other) = (1.0_f64, 1.0_f64);
    for (around, _) in shape.surface.corners(vertex) {
        if shape.is_sound(around) {
            to_own = to_own.min(shape.normal(around).dot(own));
            to_other = to_other.min(shape.normal(around).dot(normal));
        }
    }
    // Of the two surfaces, one that no triangle around the vertex faces cannot be what it meets, if the other is faced.
    if to_own < FACES && to_other > FACES_NOT {
        let contact = contact(shape, meeting, own, turned, None, true);
        return (contact, slot);
    }
    if to_other < FACES && to_own > FACES_NOT && far != vertex {
        let x = at(vertex);
        let closest = closest_on_triangle([at(q), at(p), at(far)], x);
        let distance = closest.point.distance(x);
        if distance <= meeting.reach {
            let is_apart = !meeting.is_inside
                && closest.part != TrianglePart::Face
                && distance > meeting.touching;
            let meeting = Meeting {
                slot: other,
                // The common edge, which is nearest.
                part: TrianglePart::Face,
                apart: is_apart.then(|| (x - closest.point) / distance),
                ..*meeting
            };
            let contact = contact(shape, &meeting, normal, [q, p, far], None, true);
            return (contact, other);
        }
    }
    let contact = contact(shape, meeting, own, turned, Some(normal), true);
    (contact, slot)
}

/// The side of the triangle that is nearest to the vertex, of those at the part that is closest to it.
fn nearest_side(shape: &Shape<'_>, meeting: &Meeting) -> u8 {
    let x = shape.positions[meeting.vertex.index()];
    let corners = shape.corners(meeting.slot);
    let normal = shape.normal(meeting.slot);
    // The area of the triangle that a side makes with the foot of the vertex.
    let weight = |side: u8| {
        let [from, to] = [0, 1].map(|step| corners[(usize::from(side) + step) % 3]);
        (to - from).cross(x - from).dot(normal)
    };
    let nearer = |one: u8, other: u8| {
        if weight(other) < weight(one) {
            other
        } else {
            one
        }
    };
    match meeting.part {
        TrianglePart::Side(side) => side,
        TrianglePart::Corner(corner) => nearer(corner, (corner + 2) % 3),
        TrianglePart::Face => nearer(nearer(0, 1), 2),
    }
}

/// A contact with a triangle of this normal and with the surface beyond its first edge.
fn contact(
    shape: &Shape<'_>,
    meeting: &Meeting,
    normal: DVec3,
    corners: Turned,
    beyond: Option<DVec3>,
    is_convex: bool,
) -> FaceContact {
    let [x1, x2, x3] = corners.map(|p| shape.positions[p.index()]);
    let (e1, e2) = (x2 - x1, x3 - x1);
    let area = e1.cross(e2);
    let in_basis = |vector: DVec3| {
        let square = area.length_squared();
        [
            vector.dot(e2.cross(area)) / square,
            vector.dot(area.cross(e1)) / square,
            vector.dot(area) / square,
        ]
    };
    let outward = match meeting.apart {
        // In one plane with the triangle the surface goes on.
        Some(apart) => (apart.dot(normal) < 1.0 - FLAT * FLAT).then_some((apart, 0.0)),
        None => {
            let outward = match meeting.part {
                TrianglePart::Corner(_) => past_corner(shape, meeting, normal),
                _ if is_convex && beyond.is_none() => e1.cross(normal).try_normalize(),
                _ => None,
            };
            outward.map(|outward| (outward, MARGIN * area.length() / e1.length()))
        }
    };
    let [a, b, c] = corners.map(|p| p.0);
    FaceContact {
        particles: [meeting.vertex.0, a, b, c],
        beyond: beyond.map(in_basis),
        limit: outward.map(|(outward, distance)| FaceLimit {
            normal: in_basis(outward),
            distance,
        }),
    }
}

/// The direction in the plane of a triangle that leads past a convex corner of it; `None` where the surface goes on.
fn past_corner(shape: &Shape<'_>, meeting: &Meeting, normal: DVec3) -> Option<DVec3> {
    let TrianglePart::Corner(k) = meeting.part else {
        return None;
    };
    let corner = shape.triangle(meeting.slot).particles[usize::from(k)];
    let at = shape.positions[corner.index()];
    let is_below = |x: DVec3| normal.dot(x - at) <= FLAT * (x - at).length();
    let mut fan = shape.surface.corners(corner);
    if !fan.all(|(slot, _)| shape.corners(slot).into_iter().all(is_below)) {
        return None;
    }
    let outside = shape.side_normal(meeting.slot, meeting.part);
    let along = outside - normal * outside.dot(normal);
    (along.length() > FLAT.sqrt()).then(|| along.normalize())
}
