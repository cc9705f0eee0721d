//! The search for what a vertex may touch: triangles near it that face it, at a valid distance.
//!
//! A vertex and a triangle become a candidate if all of these hold, cheapest first:
//!
//! 1. the vertex is no corner of the triangle, and no live pair of a fresh cut says the same ([`crate::FreshPairs`]);
//! 2. their bodies may touch;
//! 3. their sides face each other;
//! 4. the closest point of the triangle is within reach, which grows with the speed at which the two may approach, and is
//!    a local minimum of the distance to the surface: on an edge or a vertex no triangle around it is closer. So a flat or
//!    convex surface is touched once and a concave corner by each of its walls. One triangle stands for all those around
//!    the edge or the vertex: the one that faces most;
//! 5. outside, one of the nearest three. Inside, of those that it does not lie behind at rest, the nearest from which a
//!    way through tets leads to the vertex without meeting one of the vertex's own tets, if its depth is less than half
//!    of the thickness there.
//!
//! A vertex inside a tet of a body that no such triangle explains is deep: from that tet the neighbors are searched for a
//! way out, nearest first, up to 64 tets. If there is none, the vertex is buried. Such a tet is one that held the vertex at
//! the last search, one to which a way leads from a near triangle, or one behind a triangle of the surface. Of the latter in
//! its own part, only those count whose triangles face the vertex: around each vertex lie many others, which it has not come
//! through.
//!
//! A vertex of an inverted tet is on the wrong side of its own surface, where contact with its own part would hold it: so
//! it touches nothing of that part until elasticity has brought it back and no tet of the part contains it. While the tet
//! is inverted, the triangles and feature edges at its corners touch nothing of their own part either. Other parts they
//! all still touch.
//!
//! Sources: J. A. Bærentzen and H. Aanæs 2005 (sides); H. Chen, E. Diaz, C. Yuksel 2023 (valid ways). Cost: a search in
//! the tree, and for each triangle found a few dozen operations.

use glam::{DVec3, Vec4};
use incise_cutting::FaceTag;
use incise_mesh::{Bounds, ClosestPoint, ParticleId, TetId, TrianglePart, closest_on_triangle};

use crate::ahead::{Lookout, Reach, approach};
use crate::face::{FaceContact, Meeting, face_contact};
use crate::index::NONE;
use crate::normals::{Inversion, Owner, Shape};
use crate::pairs::FreshPairs;
use crate::settings::ContactSettings;
use crate::state::ContactState;
use crate::tree::{Answers, Box32, Boxes, Children, Leaf, TriangleTree};
use crate::walk::{Barycentric, walk};

/// Sides face each other where the dot product of their unit normals is below this.
const FACING: f64 = 0.2;
/// The limit for dot products in single precision beyond which it is passed in double precision, too.
const FACING_SINGLE: f32 = 0.2 + 1e-5;
/// Distances that differ by this, in mean edges, are the same.
const SAME: f64 = 1e-9;
/// What rounding adds to a distance at most, as a part of it.
const ROUNDING: f64 = 1e-9;
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
/// A vertex that has moved less than this part of its depth, relative to a triangle, has not come through it.
pub(crate) const AS_AT_REST: f64 = 0.5;
/// Tets that are looked at for a way out of a body.
const DEEP_TETS: usize = 64;

/// What was found for a vertex.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Found {
    contacts: [FaceContact; OUTSIDE + 1],
    count: usize,
    /// Whether nothing was searched for, and what is known stays.
    pub(crate) is_kept: bool,
    pub(crate) is_searched: bool,
    /// A tet of another part that contains it; [`NONE`] if there is none.
    pub(crate) inside: u32,
    /// Whether no triangle near it says how it got there.
    pub(crate) is_deep: bool,
    /// True if the vertex is deep and no way out was found.
    pub(crate) is_buried: bool,
    /// Whether it touches nothing of its own part, because a tet at it is or was inverted.
    pub(crate) is_inverted: bool,
}

impl Found {
    pub(crate) const NOTHING: Self = Self {
        contacts: [FaceContact {
            particles: [0; 4],
            beyond: None,
            limit: None,
        }; OUTSIDE + 1],
        count: 0,
        is_kept: false,
        is_searched: false,
        inside: NONE,
        is_deep: false,
        is_buried: false,
        is_inverted: false,
    };

    pub(crate) fn clear(&mut self) {
        self.count = 0;
        self.is_kept = false;
        self.is_searched = false;
        self.inside = NONE;
        self.is_deep = false;
        self.is_buried = false;
        self.is_inverted = false;
    }

    pub(crate) fn contacts(&self) -> &[FaceContact] {
        &self.contacts[..self.count]
    }

    /// Keeps a contact, unless there is one with its triangle: a folded surface may be found from both sides, and two
    /// triangles may stand for the one between them.
    fn push(&mut self, contact: Option<FaceContact>) {
        let Some(contact) = contact else { return };
        let corners = |contact: &FaceContact| {
            let [_, corners @ ..] = contact.particles;
            corners
        };
        let [a, b, c] = corners(&contact);
        let is_known = |known: &FaceContact| corners(known).iter().all(|p| [a, b, c].contains(p));
        if !self.contacts().iter().any(is_known) {
            self.contacts[self.count] = contact;
            self.count += 1;
        }
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
    is_inside: bool,
    /// The direction from the closest point to the vertex of a triangle that is on an edge or a corner of it.
    apart: Option<DVec3>,
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
    single: [Vec4; Self::MOST],
    count: usize,
}

impl VertexNormals {
    /// Tags with a normal of their own; where more strokes meet in a vertex, the others share the last one.
    const MOST: usize = 8;

    fn new(shape: &Shape<'_>, vertex: ParticleId) -> Self {
        let mut this = Self {
            normals: [(FaceTag::Outer, DVec3::ZERO); Self::MOST],
            single: [Vec4::ZERO; Self::MOST],
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
            this.normals[place].1 += shape.placed[slot as usize].area;
        }
        for k in 0..this.count {
            let normal = &mut this.normals[k].1;
            *normal = normal.normalize_or_zero();
            this.single[k] = normal.extend(0.0).as_vec4();
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

    /// Which of four boxes hold no normal of a triangle that faces the vertex, as bits.
    #[inline]
    fn turned_away(&self, normals: &Boxes) -> u32 {
        let own = self.single[..self.count].iter();
        let all = own.map(|normal| turned_away(normals, *normal));
        all.reduce(|one, other| one & other).unwrap_or(0)
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

/// Which of four boxes hold no unit normal that faces another one, whatever rounding does, as bits.
#[inline]
pub(crate) fn turned_away(normals: &Boxes, normal: Vec4) -> u32 {
    // The least dot product with a vector of the box.
    let mut least = Vec4::ZERO;
    for k in 0..3 {
        least += (normals.low(k) * normal[k]).min(normals.high(k) * normal[k]);
    }
    least.cmpge(Vec4::splat(FACING_SINGLE)).bitmask()
}

/// Whether sides with such a dot product of their normals face each other. There is none beside a vertex without a normal,
/// which all face.
fn is_facing(facing: f64) -> bool {
    facing < FACING || !facing.is_finite()
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
    /// By particle the way that it goes in the frame.
    pub(crate) steps: &'a [DVec3],
    /// How far away a triangle may be.
    pub(crate) reach: Reach,
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
    /// Whether it may touch its own part.
    touches_own: bool,
    /// The part whose tets count as containing it only where their triangles face it: its own, unless a tet at it is or was
    /// inverted.
    faced_part: Option<u32>,
    normals: &'q VertexNormals,
}

/// What boxes say about a triangle beside a vertex.
#[derive(Clone, Copy)]
struct Beside {
    /// Whether it may face the vertex within its reach.
    is_near: bool,
    /// Whether the tet behind it may contain the vertex.
    may_contain: bool,
}

impl Query<'_> {
    /// The tet of another part that contains a vertex, searched for among all tets of a tree over their numbers.
    pub(crate) fn locate(&self, id: ParticleId, tets: &TriangleTree) -> Option<TetId> {
        let normals = VertexNormals::new(&self.shape, id);
        let vertex = self.vertex_of(id, &normals)?;
        let wanted = Box32::around(&Bounds::around([vertex.behind]));
        let mut containing: Option<TetId> = None;
        tets.search(&wanted, |leaf| {
            let tet = TetId(leaf.number);
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
        let inversion = self.shape.inversion(id);
        let piece = self.state.pieces.piece_of(self.shape.triangle(first).tet);
        Some(Vertex {
            id,
            x,
            behind: x - normals.mean() * (BEHIND * self.mean_edge),
            body: self.body_of[id.index()],
            piece,
            touches_own: self.settings.self_contact && inversion != Inversion::Present,
            faced_part: (inversion == Inversion::None).then_some(piece),
            normals,
        })
    }

    /// Writes what `id` may touch in place of what `found` says. `was_inside` is the tet of another part that contained it at the last search.
    pub(crate) fn vertex(&self, id: ParticleId, was_inside: Option<TetId>, found: &mut Found) {
        found.clear();
        let normals = VertexNormals::new(&self.shape, id);
        let Some(mut vertex) = self.vertex_of(id, &normals) else {
            return;
        };
        self.contacts(&vertex, was_inside, found);
        found.is_inverted = match self.shape.inversion(id) {
            Inversion::None => false,
            Inversion::Recent => {
                found.inside != NONE && self.is_of_own_part(TetId(found.inside), &vertex)
            }
            Inversion::Present => true,
        };
        if found.is_inverted && vertex.touches_own {
            // Back, but not out of its part.
            found.clear();
            vertex.touches_own = false;
            self.contacts(&vertex, None, found);
            found.is_inverted = true;
        }
    }

    /// Appends what a vertex may touch.
    fn contacts(&self, vertex: &Vertex<'_>, was_inside: Option<TetId>, found: &mut Found) {
        let x = vertex.x;
        let mut outside = Nearest::<OUTSIDE>::EMPTY;
        let mut inside = Nearest::<TRIES>::EMPTY;
        let mut containing = NONE;
        let lookout = self.lookout(vertex);
        self.each_beside(vertex, &lookout, |leaf, beside| {
            if !self.may_touch(vertex, leaf.number) {
                return true;
            }
            if beside.may_contain && self.counts_as_containing(vertex, leaf) {
                let tet = self.shape.triangle(leaf.number).tet;
                if self.is_inside(tet, vertex) {
                    containing = containing.min(tet.0);
                }
            }
            if !beside.is_near {
                return true;
            }
            let most = f64::from(lookout.reach(&leaf.steps));
            if let Some(near) = self.near(vertex, leaf.number, most) {
                if !near.is_inside {
                    outside.insert(near);
                } else if !self.is_as_at_rest(vertex, near.slot, near.distance) {
                    inside.insert(near);
                }
            }
            true
        });
        for near in outside.iter() {
            found.push(self.contact(vertex, near));
        }
        let mut ways = inside.iter();
        let nearest = ways.find_map(|near| Some((near, self.way(near, vertex, x)?)));
        let shallow = nearest.filter(|(near, _)| self.is_shallow(near, x));
        if let Some((near, tet)) = shallow {
            found.push(self.contact(vertex, near));
            found.inside = tet.0;
            return;
        }
        // What merely touches is not inside.
        if let Some((near, _)) = nearest
            && containing == NONE
            && let Some(tet) = self.way(near, vertex, vertex.behind)
        {
            containing = tet.0;
        }
        if let Some(tet) = was_inside.and_then(|tet| self.followed(tet, vertex)) {
            containing = tet.0;
        }
        if containing != NONE && !self.is_held_by_pair(vertex, TetId(containing)) {
            found.inside = containing;
            found.is_deep = true;
            match self.way_out(TetId(containing), vertex) {
                Some(near) => found.push(self.contact(vertex, &near)),
                None => found.is_buried = true,
            }
        }
    }

    /// Around a vertex.
    fn lookout(&self, vertex: &Vertex<'_>) -> Lookout {
        let of = |x: DVec3| Box32::around(&Bounds::around([x]));
        let step = self.steps[vertex.id.index()];
        Lookout::new(&of(vertex.x), &of(step), &self.reach)
    }

    /// Whether a triangle of some parts that faces a vertex is within its reach, or a tet behind one contains it.
    pub(crate) fn meets(&self, id: ParticleId, is_of_parts: impl Fn(u32) -> bool) -> bool {
        let normals = VertexNormals::new(&self.shape, id);
        let Some(vertex) = self.vertex_of(id, &normals) else {
            return false;
        };
        let lookout = self.lookout(&vertex);
        let is_near = |leaf: &Leaf| {
            let most = f64::from(lookout.reach(&leaf.steps));
            self.faces(&vertex, leaf.number)
                && self.within_reach(&vertex, leaf.number, most).is_some()
        };
        let meets_none = self.each_beside(&vertex, &lookout, |leaf, beside| {
            let tet = || self.shape.triangle(leaf.number).tet;
            let is_met = is_of_parts(leaf.part)
                && self.may_touch(&vertex, leaf.number)
                && (beside.is_near && is_near(leaf)
                    || beside.may_contain
                        && self.counts_as_containing(&vertex, leaf)
                        && self.is_inside(tet(), &vertex));
            !is_met
        });
        !meets_none
    }

    /// Whether a triangle faces a vertex.
    fn faces(&self, vertex: &Vertex<'_>, slot: u32) -> bool {
        is_facing(vertex.normals.facing(self.shape.normal(slot)))
    }

    /// Whether the vertex is deep if the tet behind a triangle contains it.
    fn counts_as_containing(&self, vertex: &Vertex<'_>, leaf: &Leaf) -> bool {
        vertex.faced_part != Some(leaf.part) || self.faces(vertex, leaf.number)
    }

    /// Calls `visit` with each triangle that may face a vertex within its reach, or has a tet behind it that may contain it,
    /// until it returns false. Whether it never did.
    #[inline]
    fn each_beside(
        &self,
        vertex: &Vertex<'_>,
        lookout: &Lookout,
        mut visit: impl FnMut(&Leaf, Beside) -> bool,
    ) -> bool {
        let behind = Box32::around(&Bounds::around([vertex.behind]));
        // What is unsound has an empty box.
        let ask = |children: &Children, part: u32| {
            let reached = lookout.reached(children);
            let containing = children.tets.overlapping(&behind);
            let is_faced = vertex.faced_part == Some(part);
            let asked = if is_faced {
                reached | containing
            } else {
                reached
            };
            let away = match asked {
                0 => 0,
                _ => vertex.normals.turned_away(&children.normals),
            };
            Answers {
                first: reached & !away,
                second: if is_faced {
                    containing & !away
                } else {
                    containing
                },
            }
        };
        let mut look = |leaf: &Leaf, [is_near, may_contain]: [bool; 2]| {
            visit(
                leaf,
                Beside {
                    is_near,
                    may_contain,
                },
            )
        };
        let mut trees = self.trees.into_iter();
        trees.all(|tree| tree.search_where(ask, &mut look))
    }

    /// How far away a triangle may be for a vertex.
    fn reach_of(&self, vertex: &Vertex<'_>, slot: u32) -> f64 {
        let corners = self.shape.triangle(slot).particles.map(|p| p.0);
        self.reach
            .of(approach(self.steps, &[vertex.id.0], &corners))
    }

    /// The point of a triangle that is closest to a vertex, with its distance, if it is within reach, which is at most
    /// `most`.
    #[inline]
    fn within_reach(
        &self,
        vertex: &Vertex<'_>,
        slot: u32,
        most: f64,
    ) -> Option<(ClosestPoint, f64)> {
        let corners = self.shape.corners(slot);
        // The plane is no further than the triangle.
        let from = vertex.x - corners[0];
        if self.shape.normal(slot).dot(from).abs() > most * (1.0 + ROUNDING) {
            return None;
        }
        let closest = closest_on_triangle(corners, vertex.x);
        let distance = closest.point.distance(vertex.x);
        let is_within = distance <= self.reach.still
            || (distance <= most && distance <= self.reach_of(vertex, slot));
        is_within.then_some((closest, distance))
    }

    /// Whether the vertex may touch a triangle: it is no corner of it and their bodies may touch.
    fn may_touch(&self, vertex: &Vertex<'_>, slot: u32) -> bool {
        let owner = self.shape.owner(slot);
        let corners = &self.shape.triangle(slot).particles;
        // A corner that is on the wrong side of its own surface takes the triangle with it.
        let is_right = |corner: &ParticleId| self.shape.inversion(*corner) != Inversion::Present;
        self.may_touch_owner(vertex, owner)
            && !corners.contains(&vertex.id)
            && (!Self::is_own_part(vertex, owner) || corners.iter().all(is_right))
    }

    fn is_own_part(vertex: &Vertex<'_>, owner: Owner) -> bool {
        owner.body == vertex.body && owner.piece == vertex.piece
    }

    fn may_touch_owner(&self, vertex: &Vertex<'_>, owner: Owner) -> bool {
        if Self::is_own_part(vertex, owner) {
            vertex.touches_own
        } else if owner.body == vertex.body {
            true
        } else {
            self.settings.bodies.allow(owner.body, vertex.body)
        }
    }

    fn may_touch_part(&self, vertex: &Vertex<'_>, tet: TetId) -> bool {
        self.may_touch_owner(vertex, self.owner_of(tet))
    }

    fn owner_of(&self, tet: TetId) -> Owner {
        let [first, ..] = self.state.mesh.mesh().tets[tet.index()];
        Owner {
            body: self.body_of[first.index()],
            piece: self.state.pieces.piece_of(tet),
        }
    }

    fn is_of_own_part(&self, tet: TetId, vertex: &Vertex<'_>) -> bool {
        Self::is_own_part(vertex, self.owner_of(tet))
    }

    /// Whether two edges may touch by the parts of their tets, and by their ends within one part.
    pub(crate) fn may_edges_touch(&self, tets: [TetId; 2], ends: [[u32; 2]; 2]) -> bool {
        let [one, other] = tets.map(|tet| self.owner_of(tet));
        let is_right = |end: &u32| self.shape.inversion(ParticleId(*end)) != Inversion::Present;
        if one.body != other.body {
            self.settings.bodies.allow(one.body, other.body)
        } else {
            one.piece != other.piece
                || self.settings.self_contact && ends.as_flattened().iter().all(is_right)
        }
    }

    /// The triangle of a slot if the vertex may be about to touch it or has passed it; `most` bounds its distance.
    fn near(&self, vertex: &Vertex<'_>, slot: u32, most: f64) -> Option<Near> {
        let facing = vertex.normals.facing(self.shape.normal(slot));
        if !is_facing(facing) {
            return None;
        }
        let x = vertex.x;
        let (closest, distance) = self.within_reach(vertex, slot, most)?;
        let ClosestPoint { point, part, .. } = closest;
        let key = self.shape.surface.key(slot);
        if part != TrianglePart::Face {
            let closer = (distance - SAME * self.mean_edge).max(0.0);
            // Those of the vertex are closest.
            let is_own = |(other, _)| self.shape.triangle(other).particles.contains(&vertex.id);
            if closer > 0.0 && self.shape.around(slot, part).any(is_own) {
                return None;
            }
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
        let is_inside = self.shape.side_normal(slot, part).dot(x - point) < 0.0;
        // The direction between the two; there is none where they touch.
        let is_apart = part != TrianglePart::Face && distance > TOUCHING * self.mean_edge;
        Some(Near {
            distance,
            key,
            slot,
            point,
            part,
            is_inside,
            apart: is_apart.then(|| (x - point) / distance),
        })
    }

    /// `None` if a live pair holds the vertex there, or if it lies below the surface as it does at rest, beside a concave
    /// edge.
    fn contact(&self, vertex: &Vertex<'_>, near: &Near) -> Option<FaceContact> {
        let meeting = Meeting {
            vertex: vertex.id,
            slot: near.slot,
            part: near.part,
            // Inside, that direction leads through the surface.
            apart: near.apart.filter(|_| !near.is_inside),
            is_inside: near.is_inside,
            touching: TOUCHING * self.mean_edge,
            reach: self.reach_of(vertex, near.slot),
        };
        let (contact, slot) = face_contact(&self.shape, &meeting);
        // From the outer surface it may come to be one with the cut face that the vertex was parted from.
        let tag = self.shape.triangle(slot).tag;
        let is_of_pair = |partner| {
            self.shape
                .surface
                .fan(partner)
                .any(|other| other.tag == tag)
        };
        let is_held = slot != near.slot && self.pairs.partners(vertex.id).any(is_of_pair);
        let depth = -contact.gap(self.state.positions);
        let is_as_at_rest = depth > 0.0 && self.is_as_at_rest(vertex, slot, depth);
        (!is_held && !is_as_at_rest).then_some(contact)
    }

    /// Whether a vertex lies as deep behind a triangle of its body as it does at rest, where parts do not overlap: the triangle is
    /// the far side of a wall that ends at the vertex. Rounding decides whether a way through such a wall is valid.
    fn is_as_at_rest(&self, vertex: &Vertex<'_>, slot: u32, depth: f64) -> bool {
        let triangle = self.shape.triangle(slot);
        let [first, ..] = triangle.particles;
        if self.body_of[first.index()] != vertex.body {
            return false;
        }
        let at_rest = &self.state.mesh.mesh().positions;
        // In axes that turn with the triangle.
        let seen = |positions: &[DVec3], x: DVec3| {
            let [x1, x2, x3] = triangle.particles.map(|p| positions[p.index()]);
            let (e1, e2) = (x2 - x1, x3 - x1);
            let along = e1.normalize_or_zero();
            let normal = e1.cross(e2).normalize_or_zero();
            let way = x - x1;
            DVec3::new(
                way.dot(along),
                way.dot(normal.cross(along)),
                way.dot(normal),
            )
        };
        let now = seen(self.state.positions, vertex.x);
        let before = seen(at_rest, at_rest[vertex.id.index()]);
        now.distance(before) < AS_AT_REST * depth
    }

    /// Whether the depth is less than half of the thickness there: a point as deep again is still inside.
    fn is_shallow(&self, near: &Near, x: DVec3) -> bool {
        let normal = near
            .apart
            .map_or(self.shape.normal(near.slot), |apart| -apart);
        let depth = normal.dot(near.point - x);
        let twice = near.point - normal * (2.0 * depth);
        self.ways(near, twice).next().is_some()
    }

    /// The tet at the end of a way through tets from a triangle to a point at the vertex, which is none of its own.
    fn way(&self, near: &Near, vertex: &Vertex<'_>, to: DVec3) -> Option<TetId> {
        let mut ends = self.ways(near, to);
        ends.find(|&tet| !self.is_own(tet, vertex))
    }

    /// The ends of the ways from the closest point of a triangle, which start in the tets behind all triangles there:
    /// from a concave edge, the way may lie on the outer side of one of them.
    fn ways(&self, near: &Near, to: DVec3) -> impl Iterator<Item = TetId> {
        let starts = self.shape.around(near.slot, near.part);
        let segment = [near.point, to];
        starts.filter_map(move |(slot, _)| self.walk(self.shape.triangle(slot).tet, segment))
    }

    pub(crate) fn walk(&self, tet: TetId, segment: [DVec3; 2]) -> Option<TetId> {
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
    /// those that face it, unless another one is much nearer or none does. Ways lead to the point behind the vertex, which
    /// is what the tet contains: a vertex that touches may be outside by rounding.
    ///
    /// Tets are looked at in the order of the distances of the faces that they are entered by, so that a way through many
    /// thin tets is found before one through a few large ones.
    fn way_out(&self, tet: TetId, vertex: &Vertex<'_>) -> Option<Near> {
        // The tets known, with the distance where they are entered and whether they were looked at.
        let mut known = [(0.0, tet, false); 3 * DEEP_TETS + 2];
        let mut count = 1;
        let [mut facing, mut other] = [None::<Near>; 2];
        for _ in 0..DEEP_TETS {
            let due = known[..count].iter_mut().filter(|known| !known.2);
            let order = |one: &(f64, TetId, bool), other: &(f64, TetId, bool)| {
                one.0.total_cmp(&other.0).then(one.1.cmp(&other.1))
            };
            let Some(next) = due.min_by(|one, other| order(one, other)) else {
                break;
            };
            let (entered, tet, done) = next;
            // A way that faces the vertex is kept if it is the nearest of those.
            if facing.is_some_and(|near| near.distance <= *entered) {
                break;
            }
            *done = true;
            let (entered, tet) = (*entered, *tet);
            for (opposite, neighbor) in (0..).zip(self.state.mesh.neighbors(tet)) {
                let Some(neighbor) = neighbor else {
                    let slot = self.shape.surface.slot_of(tet, opposite);
                    let may_touch =
                        |slot: &u32| self.shape.is_sound(*slot) && self.may_touch(vertex, *slot);
                    if let Some(slot) = slot.filter(may_touch) {
                        let (near, faces) = self.deep(vertex, slot);
                        let best = if faces { &mut facing } else { &mut other };
                        let is_nearer = best.is_none_or(|best| near.precedes(&best));
                        if is_nearer && self.way(&near, vertex, vertex.behind).is_some() {
                            *best = Some(near);
                        }
                    }
                    continue;
                };
                if known[..count]
                    .iter()
                    .all(|(_, known, _)| *known != neighbor)
                {
                    let closest = closest_on_triangle(self.face_corners(tet, opposite), vertex.x);
                    let distance = closest.point.distance(vertex.x).max(entered);
                    known[count] = (distance, neighbor, false);
                    count += 1;
                }
            }
        }
        match (facing, other) {
            (Some(near), Some(other)) if near.distance > FAR * other.distance => Some(other),
            (near, other) => near.or(other),
        }
    }

    /// The corners of a tet but one.
    fn face_corners(&self, tet: TetId, opposite: u8) -> [DVec3; 3] {
        let corners = self.tet_corners(tet);
        [1, 2, 3].map(|k| corners[(usize::from(opposite) + k) % 4])
    }

    /// A triangle that a deep vertex might leave by, and whether it faces it.
    fn deep(&self, vertex: &Vertex<'_>, slot: u32) -> (Near, bool) {
        let ClosestPoint { point, part, .. } =
            closest_on_triangle(self.shape.corners(slot), vertex.x);
        let near = Near {
            distance: point.distance(vertex.x),
            key: self.shape.surface.key(slot),
            slot,
            point,
            part,
            is_inside: true,
            apart: None,
        };
        (near, self.faces(vertex, slot))
    }
}
