//! The search for what a vertex may touch: triangles near it that face it, at a valid distance.
//!
//! A vertex and a triangle become a candidate if all of these hold, cheapest first:
//!
//! 1. the vertex is no corner of the triangle, and no live pair of a fresh cut says the same ([`crate::FreshPairs`]);
//! 2. their bodies may touch;
//! 3. their sides face each other;
//! 4. the closest point of the triangle is within reach and is a local minimum of the distance to the surface: on an
//!    edge or a vertex no triangle around it is closer. So a flat or convex surface is touched once and a concave corner
//!    by each of its walls. One triangle stands for all those around the edge or the vertex: the one that faces most;
//! 5. outside, one of the nearest three. Inside, the nearest whose depth is less than half of the thickness there and
//!    from which a way through tets leads to the vertex without meeting one of the vertex's own tets.
//!
//! A vertex inside a tet of a body that no such triangle explains is deep: from that tet the neighbors are searched for a
//! way out, up to 64 tets. If there is none, the vertex is buried.
//!
//! Sources: J. A. Bærentzen and H. Aanæs 2005 (sides); H. Chen, E. Diaz, C. Yuksel 2023 (valid ways). Cost: a search in
//! the tree, and for each triangle found a few dozen operations.

use glam::DVec3;
use incise_cutting::FaceTag;
use incise_mesh::{Bounds, ClosestPoint, ParticleId, TetId, TrianglePart, closest_on_triangle};

use crate::index::NONE;
use crate::normals::Shape;
use crate::pairs::FreshPairs;
use crate::settings::ContactSettings;
use crate::state::ContactState;
use crate::tree::{Box32, TriangleTree};
use crate::walk::{Barycentric, walk};

/// Sides face each other where the dot product of their unit normals is below this.
const FACING: f64 = 0.2;
/// Distances that differ by this, in mean edges, are the same.
const SAME: f64 = 1e-9;
/// Up to this distance in mean edges a vertex counts as touching an edge or a vertex.
const TOUCHING: f64 = 0.01;
/// A vertex counts as inside another part if the point this far behind it, in mean edges, is: what merely touches is
/// not.
const BEHIND: f64 = 1e-4;
/// Outer triangles kept for a vertex: as many as there are directions that can hold it.
const OUTSIDE: usize = 3;
/// Inner triangles that are tried for a valid way, nearest first; the vertex counts as deep after that.
const TRIES: usize = 8;
/// A way out that faces a vertex is taken unless it is this many times as long as another one.
const FAR: f64 = 2.0;
/// Tets that are looked at for a way out of a body.
const DEEP_TETS: usize = 64;

/// A contact of a vertex with a triangle: `n · (x₀ − Σ βᵢ xᵢ) ≥ 0` with weights `β` of a point of the triangle.
///
/// The weights are those of the present positions, not of the search. Where the normal is the triangle's own, they are
/// those of the vertex's projection, at most a quarter beyond the triangle: on a flat surface the contact then stays
/// while the vertex slides on to the next triangle. Otherwise the vertex is about to touch an edge or a corner, and they
/// are those of the closest point of the triangle ([`incise_mesh::closest_on_triangle`]).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FaceContact {
    /// The vertex, then the corners of the triangle, counterclockwise seen from outside.
    pub particles: [u32; 4],
    /// The normal `n` in the triangle's own basis: `n = unit(a e₁ + b e₂ + c (e₁ × e₂))` with `e₁ = x₂ − x₁` and
    /// `e₂ = x₃ − x₁`, so that it turns with the triangle. `[0, 0, 1]` is that of the triangle itself.
    pub normal: [f64; 3],
}

impl FaceContact {
    /// The normal at the positions given, of unit length; zero if the triangle has collapsed.
    ///
    /// # Panics
    /// If a particle has no position.
    #[must_use]
    pub fn normal_at(&self, positions: &[DVec3]) -> DVec3 {
        let [_, x1, x2, x3] = self.particles.map(|p| positions[p as usize]);
        let (e1, e2) = (x2 - x1, x3 - x1);
        let [a, b, c] = self.normal;
        (e1 * a + e2 * b + e1.cross(e2) * c).normalize_or_zero()
    }

    /// The distance of the vertex to the closest point of the triangle along the normal in m, negative inside.
    ///
    /// # Panics
    /// If a particle has no position.
    #[must_use]
    pub fn gap(&self, positions: &[DVec3]) -> f64 {
        let [x, x1, x2, x3] = self.particles.map(|p| positions[p as usize]);
        let closest = closest_on_triangle([x1, x2, x3], x).point;
        self.normal_at(positions).dot(x - closest)
    }
}

/// What was found for a vertex.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Found {
    contacts: [FaceContact; OUTSIDE + 1],
    count: usize,
    /// A tet of another part that contains it; [`NONE`] if there is none.
    pub(crate) inside: u32,
    /// Whether no triangle near it says how it got there.
    pub(crate) is_deep: bool,
    /// True if the vertex is deep and no way out was found.
    pub(crate) is_buried: bool,
}

impl Found {
    pub(crate) const NOTHING: Self = Self {
        contacts: [FaceContact {
            particles: [0; 4],
            normal: [0.0; 3],
        }; OUTSIDE + 1],
        count: 0,
        inside: NONE,
        is_deep: false,
        is_buried: false,
    };

    pub(crate) fn contacts(&self) -> &[FaceContact] {
        &self.contacts[..self.count]
    }

    fn push(&mut self, contact: FaceContact) {
        self.contacts[self.count] = contact;
        self.count += 1;
    }
}

/// A triangle near a vertex.
#[derive(Clone, Copy)]
struct Near {
    /// What orders them: a distance, then the face.
    distance: f64,
    key: u32,
    slot: u32,
    point: DVec3,
    part: TrianglePart,
    normal: DVec3,
}

impl Near {
    fn precedes(&self, other: &Self) -> bool {
        (self.distance, self.key) < (other.distance, other.key)
    }
}

/// The nearest `N`, whatever the order in which they come.
struct Nearest<const N: usize> {
    items: [Option<Near>; N],
}

impl<const N: usize> Nearest<N> {
    const EMPTY: Self = Self { items: [None; N] };

    fn insert(&mut self, mut near: Near) {
        for item in &mut self.items {
            match item {
                None => {
                    *item = Some(near);
                    return;
                }
                Some(held) if near.precedes(held) => std::mem::swap(held, &mut near),
                Some(_) => {}
            }
        }
    }

    fn iter(&self) -> impl Iterator<Item = &Near> {
        self.items.iter().flatten()
    }
}

/// The outward normals of a vertex, one for each tag around it.
struct VertexNormals {
    normals: [(FaceTag, DVec3); Self::MOST],
    count: usize,
}

impl VertexNormals {
    /// Tags with a normal of their own; where more strokes meet in a vertex, the others share the last one.
    const MOST: usize = 8;

    fn new(shape: &Shape<'_>, vertex: ParticleId) -> Self {
        let mut this = Self {
            normals: [(FaceTag::Outer, DVec3::ZERO); Self::MOST],
            count: 0,
        };
        for (slot, _) in shape.surface.corners(vertex) {
            let tag = shape.triangle(slot).tag;
            let known = this.normals[..this.count].iter().position(|n| n.0 == tag);
            let place = known.unwrap_or_else(|| {
                this.count = Self::MOST.min(this.count + 1);
                this.normals[this.count - 1].0 = tag;
                this.count - 1
            });
            this.normals[place].1 += shape.surface.area(slot, shape.positions);
        }
        for (_, normal) in &mut this.normals[..this.count] {
            *normal = normal.normalize_or_zero();
        }
        this
    }

    /// The direction out of the body over all tags; zero without one.
    fn mean(&self) -> DVec3 {
        let normals = self.normals[..self.count].iter();
        normals
            .map(|(_, normal)| *normal)
            .sum::<DVec3>()
            .normalize_or_zero()
    }

    /// The least dot product with a normal: how little a triangle faces the vertex. A vertex without a normal, whose
    /// triangles have collapsed, is faced by all.
    fn facing(&self, normal: DVec3) -> f64 {
        let dots = self.normals[..self.count]
            .iter()
            .map(|(_, n)| n.dot(normal));
        dots.fold(f64::INFINITY, f64::min)
    }
}

/// A dot product of unit vectors rounded to a millionth, so that triangles of one plane face a vertex alike.
#[expect(clippy::cast_possible_truncation, reason = "within a few millions")]
fn rounded(facing: f64) -> i64 {
    (facing * 1e6).round() as i64
}

/// All that a search needs. Nothing in it changes while vertices are searched for, by as many threads as there are.
pub(crate) struct Query<'a> {
    pub(crate) state: &'a ContactState<'a>,
    pub(crate) settings: &'a ContactSettings,
    pub(crate) shape: Shape<'a>,
    pub(crate) trees: [&'a TriangleTree; 2],
    pub(crate) pairs: &'a FreshPairs,
    pub(crate) body_of: &'a [u32],
    /// How far away a triangle may be in m.
    pub(crate) reach: f64,
    /// The mean edge of the surface.
    pub(crate) mean_edge: f64,
}

/// A vertex with what is asked often.
struct Vertex<'q> {
    id: ParticleId,
    x: DVec3,
    /// A point a little behind it, inside its own body.
    behind: DVec3,
    body: u32,
    piece: u32,
    normals: &'q VertexNormals,
}

impl Query<'_> {
    /// The tet of another part that contains a vertex, searched for among all tets of a tree over their numbers.
    pub(crate) fn locate(&self, id: ParticleId, tets: &TriangleTree) -> Option<TetId> {
        let normals = VertexNormals::new(&self.shape, id);
        let vertex = self.vertex_of(id, &normals)?;
        let wanted = Box32::around(&Bounds::around([vertex.behind]));
        let mut containing: Option<TetId> = None;
        tets.search(&wanted, |tet, _| {
            let tet = TetId(tet);
            if self.may_touch_part(&vertex, tet) && self.is_inside(tet, &vertex) {
                containing = Some(containing.map_or(tet, |other| other.min(tet)));
            }
        });
        containing
    }

    /// `None` for a particle that is no vertex of the surface.
    fn vertex_of<'q>(&self, id: ParticleId, normals: &'q VertexNormals) -> Option<Vertex<'q>> {
        let (first, _) = self.shape.surface.corners(id).next()?;
        let x = self.state.positions[id.index()];
        Some(Vertex {
            id,
            x,
            behind: x - normals.mean() * (BEHIND * self.mean_edge),
            body: self.body_of[id.index()],
            piece: self.state.pieces.piece_of(self.shape.triangle(first).tet),
            normals,
        })
    }

    /// What `id` may touch. `was_inside` is the tet of another part that contained it at the last search.
    pub(crate) fn vertex(&self, id: ParticleId, was_inside: Option<TetId>) -> Found {
        let mut found = Found::NOTHING;
        let normals = VertexNormals::new(&self.shape, id);
        let Some(vertex) = self.vertex_of(id, &normals) else {
            return found;
        };
        let x = vertex.x;
        let mut outside = Nearest::<OUTSIDE>::EMPTY;
        let mut inside = Nearest::<TRIES>::EMPTY;
        let mut containing = NONE;
        let around = Bounds::around([x]).widened(self.reach);
        let wanted = Box32::around(&around);
        for tree in self.trees {
            tree.search(&wanted, |slot, bounds| {
                if !self.shape.is_sound(slot) || !self.may_touch(&vertex, slot) {
                    return;
                }
                if bounds.contains(vertex.behind) {
                    let tet = self.shape.triangle(slot).tet;
                    if self.is_inside(tet, &vertex) {
                        containing = containing.min(tet.0);
                    }
                }
                if let Some((near, is_inside)) = self.near(&vertex, slot) {
                    if is_inside {
                        inside.insert(near);
                    } else {
                        outside.insert(near);
                    }
                }
            });
        }
        for near in outside.iter() {
            found.push(self.contact(&vertex, near));
        }
        let valid = inside.iter().find_map(|near| {
            let way = self.way(near, &vertex)?;
            self.is_shallow(near, x).then_some((near, way))
        });
        if let Some((near, tet)) = valid {
            found.push(self.contact(&vertex, near));
            found.inside = tet.0;
            return found;
        }
        if let Some(tet) = was_inside.and_then(|tet| self.followed(tet, &vertex)) {
            containing = tet.0;
        }
        if containing != NONE && !self.is_held_by_pair(&vertex, TetId(containing)) {
            found.inside = containing;
            found.is_deep = true;
            match self.way_out(TetId(containing), &vertex) {
                Some(near) => {
                    let contact = self.contact(&vertex, &near);
                    // A folded surface may have been found from outside, too.
                    let same = |known: &FaceContact| known.particles == contact.particles;
                    if !found.contacts().iter().any(same) {
                        found.push(contact);
                    }
                }
                None => found.is_buried = true,
            }
        }
        found
    }

    /// Whether the vertex may touch a triangle: it is no corner of it and their bodies may touch.
    fn may_touch(&self, vertex: &Vertex<'_>, slot: u32) -> bool {
        let triangle = self.shape.triangle(slot);
        !triangle.particles.contains(&vertex.id) && self.may_touch_part(vertex, triangle.tet)
    }

    fn may_touch_part(&self, vertex: &Vertex<'_>, tet: TetId) -> bool {
        let corners = self.state.mesh.mesh().tets[tet.index()];
        let body = self.body_of[corners[0].index()];
        if body == vertex.body {
            self.settings.self_contact || self.state.pieces.piece_of(tet) != vertex.piece
        } else {
            self.settings.bodies.allow(body, vertex.body)
        }
    }

    /// The triangle of a slot if the vertex may be about to touch it or has passed it, and whether it has.
    fn near(&self, vertex: &Vertex<'_>, slot: u32) -> Option<(Near, bool)> {
        let face = self.shape.normal(slot);
        let facing = vertex.normals.facing(face);
        if facing >= FACING && facing.is_finite() {
            return None;
        }
        let x = vertex.x;
        let ClosestPoint { point, part, .. } = closest_on_triangle(self.shape.corners(slot), x);
        let squared = point.distance_squared(x);
        if squared > self.reach * self.reach || squared.is_nan() {
            return None;
        }
        let key = self.shape.surface.key(slot);
        let distance = squared.sqrt();
        if part != TrianglePart::Face {
            let closer = (distance - SAME * self.mean_edge).max(0.0);
            let rank = (rounded(facing), key);
            let around = self.shape.around(slot, part);
            for (other, _) in around.filter(|(other, _)| *other != slot) {
                let closest = closest_on_triangle(self.shape.corners(other), x).point;
                if closest.distance_squared(x) < closer * closer {
                    return None;
                }
                let facing = vertex.normals.facing(self.shape.normal(other));
                let other_rank = (rounded(facing), self.shape.surface.key(other));
                if other_rank < rank && self.may_touch(vertex, other) {
                    return None;
                }
            }
        }
        let has_partner = |partner| self.shape.triangle(slot).particles.contains(&partner);
        if self.pairs.partners(vertex.id).any(has_partner) {
            return None;
        }
        let side = self.shape.side_normal(slot, part).dot(x - point);
        let is_inside = side < 0.0;
        // Along the way to the closest point. It has no direction where the two touch, and there the triangle's own
        // normal serves: at the rim of a box, a sum over all faces would push aside what stands on it.
        let normal = if part == TrianglePart::Face || distance <= TOUCHING * self.mean_edge {
            face
        } else if is_inside {
            (point - x) / distance
        } else {
            (x - point) / distance
        };
        let near = Near {
            distance,
            key,
            slot,
            point,
            part,
            normal,
        };
        Some((near, is_inside))
    }

    fn contact(&self, vertex: &Vertex<'_>, near: &Near) -> FaceContact {
        let [a, b, c] = self.shape.triangle(near.slot).particles.map(|p| p.0);
        FaceContact {
            particles: [vertex.id.0, a, b, c],
            normal: if near.normal == self.shape.normal(near.slot) {
                [0.0, 0.0, 1.0]
            } else {
                self.shape.in_basis(near.slot, near.normal)
            },
        }
    }

    /// Whether the depth is less than half of the thickness there: a point as deep again is still inside.
    fn is_shallow(&self, near: &Near, x: DVec3) -> bool {
        let depth = near.normal.dot(near.point - x);
        let twice = near.point - near.normal * (2.0 * depth);
        self.ways(near, twice).next().is_some()
    }

    /// The tet at the end of a way through tets from a triangle to the vertex, which is none of its own.
    fn way(&self, near: &Near, vertex: &Vertex<'_>) -> Option<TetId> {
        let mut ends = self.ways(near, vertex.x);
        ends.find(|&tet| !self.is_own(tet, vertex))
    }

    /// The ends of the ways from the closest point of a triangle, which start in the tets behind all triangles there:
    /// from a concave edge, the way may lie on the outer side of one of them.
    fn ways(&self, near: &Near, to: DVec3) -> impl Iterator<Item = TetId> {
        let starts = self.shape.around(near.slot, near.part);
        let segment = [near.point, to];
        starts.filter_map(move |(slot, _)| self.walk(self.shape.triangle(slot).tet, segment))
    }

    fn walk(&self, tet: TetId, segment: [DVec3; 2]) -> Option<TetId> {
        walk(self.state.mesh, self.state.positions, tet, segment)
    }

    fn is_own(&self, tet: TetId, vertex: &Vertex<'_>) -> bool {
        self.state.mesh.mesh().tets[tet.index()].contains(&vertex.id)
    }

    fn tet_corners(&self, tet: TetId) -> [DVec3; 4] {
        let corners = self.state.mesh.mesh().tets[tet.index()];
        corners.map(|p| self.state.positions[p.index()])
    }

    fn is_inside(&self, tet: TetId, vertex: &Vertex<'_>) -> bool {
        // Cheap, and true of most tets around a vertex that touches nothing.
        if self.is_own(tet, vertex) {
            return false;
        }
        let barycentric = Barycentric::new(self.tet_corners(tet));
        barycentric.is_some_and(|coordinates| {
            let coordinates = coordinates.of(vertex.behind);
            coordinates.iter().all(|&b| b >= 0.0)
        })
    }

    /// The tet that contains a vertex that was in `tet` at the last search.
    fn followed(&self, tet: TetId, vertex: &Vertex<'_>) -> Option<TetId> {
        let center = self.tet_corners(tet).iter().sum::<DVec3>() / 4.0;
        let end = self.walk(tet, [center, vertex.behind])?;
        let is_other = !self.is_own(end, vertex) && self.may_touch_part(vertex, end);
        is_other.then_some(end)
    }

    /// Whether the vertex has a live pair with the piece that it is inside of, which holds it.
    fn is_held_by_pair(&self, vertex: &Vertex<'_>, tet: TetId) -> bool {
        let piece = self.state.pieces.piece_of(tet);
        let mut partners = self.pairs.partners(vertex.id);
        partners.any(|partner| {
            let mut fan = self.shape.surface.fan(partner);
            fan.any(|triangle| self.state.pieces.piece_of(triangle.tet) == piece)
        })
    }

    /// The nearest triangle of the boundary around the tet that contains the vertex from which a way leads to it: among
    /// those that face it, unless another one is much nearer or none does.
    fn way_out(&self, tet: TetId, vertex: &Vertex<'_>) -> Option<Near> {
        let mut seen = [TetId(0); DEEP_TETS];
        seen[0] = tet;
        let (mut known, mut done) = (1, 0);
        let mut facing = Nearest::<TRIES>::EMPTY;
        let mut others = Nearest::<TRIES>::EMPTY;
        while done < known {
            let tet = seen[done];
            done += 1;
            for (opposite, neighbor) in (0..).zip(self.state.mesh.neighbors(tet)) {
                match neighbor {
                    Some(neighbor) if known < DEEP_TETS => {
                        if !seen[..known].contains(&neighbor) {
                            seen[known] = neighbor;
                            known += 1;
                        }
                    }
                    Some(_) => {}
                    None => {
                        let slot = self.shape.surface.slot_of(tet, opposite);
                        let slot = slot.filter(|&slot| {
                            self.shape.is_sound(slot) && self.may_touch(vertex, slot)
                        });
                        if let Some((near, faces)) = slot.map(|slot| self.deep(vertex, slot)) {
                            if faces {
                                facing.insert(near);
                            } else {
                                others.insert(near);
                            }
                        }
                    }
                }
            }
        }
        let first = |list: &Nearest<TRIES>| {
            let mut ways = list.iter().filter(|near| self.way(near, vertex).is_some());
            ways.next().copied()
        };
        match (first(&facing), first(&others)) {
            (Some(near), Some(other)) if near.distance > FAR * other.distance => Some(other),
            (near, other) => near.or(other),
        }
    }

    /// A triangle that a deep vertex might leave by, and whether it faces it.
    fn deep(&self, vertex: &Vertex<'_>, slot: u32) -> (Near, bool) {
        let normal = self.shape.normal(slot);
        let ClosestPoint { point, part, .. } =
            closest_on_triangle(self.shape.corners(slot), vertex.x);
        let near = Near {
            distance: point.distance(vertex.x),
            key: self.shape.surface.key(slot),
            slot,
            point,
            part,
            normal,
        };
        let facing = vertex.normals.facing(normal);
        (near, facing < FACING || !facing.is_finite())
    }
}
