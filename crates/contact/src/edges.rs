//! [`EdgeContact`]: two sharp edges that may meet between their ends, which no vertex notices.
//!
//! A vertex against a triangle sees all that touches but edges that cross: the rims of two slices, the edges of two boxes.
//! Only *feature edges* are looked at: those between the outer surface and a cut face or between two cuts, and those whose
//! triangles turn by more than 40° at rest. They are a few percent of all edges.
//!
//! Two feature edges are a candidate if all of these hold:
//!
//! 1. they share no particle, no live pair of a fresh cut connects them, and their parts may touch;
//! 2. both are convex at present, and their directions differ by more than 3°: what is parallel is touched at vertices;
//! 3. they are within reach of each other, which grows with the speed at which they may approach, or have passed each
//!    other before;
//! 4. the plane through both directions parts the triangles of the one from those of the other. That is the condition under
//!    which two edges, and not a vertex and a face, are what touches: on the sphere of normals, the arc between the
//!    triangles of one edge crosses the opposite of the other's;
//! 5. where they have passed each other, they cross no nearer to an end of either than a tenth of how deep they are, since
//!    otherwise that end is what touches; and a way through tets leads from one of the edges to the other, as for a vertex,
//!    and goes on by the same length again;
//! 6. it is one of the four nearest of either edge, those that have passed each other first, deepest first: a long edge
//!    over a fine rim has many near it, and is held by some of them.
//!
//! The normal is the cross product of both directions, taken from the present positions in each update, with the sign
//! that it had when the candidate was found: it does not change when the edges pass each other.
//!
//! Cost: the list of feature edges is a pass over the surface after a cut; a search refits a tree over them and looks at
//! the edges near each of them.

use glam::DVec3;
use incise_mesh::{Bounds, ParticleId, TetId};
use rayon::prelude::*;

use crate::ahead::{Lookout, approach};
use crate::index::index;
use crate::query::{AS_AT_REST, Query};
use crate::surface::ContactSurface;
use crate::tree::{Answers, Box32, Children, Item, Leaf, TriangleTree};

/// The cosine of the angle by which the triangles of a feature edge turn at rest.
const SHARP: f64 = 0.766;
/// The sine of the angle from which an edge counts as convex, and from which two edges are not parallel.
const FLAT: f64 = 1e-3;
const PARALLEL: f64 = 0.05;
/// Triangles may lie beyond the plane between two edges by this sine.
const BENT: f64 = 0.1;
/// Edges that cross beyond their ends or too near to them are no candidate if they have passed by this, in mean edges.
const PASSED: f64 = 0.01;
/// Edges are no candidate if they have passed each other deeper than this many times the distance from where they cross to
/// an end.
const DEEP: f64 = 10.0;
/// Candidates kept of an edge.
const NEAREST: usize = 4;
/// Edges that one task looks at.
const CHUNK: usize = 128;

/// Two edges that stay on their sides of each other: `n · (p₁ − p₂) ≥ 0` with the points `p₁` and `p₂` of both where their
/// lines are closest, while these lie on the edges.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct EdgeContact {
    /// The ends of the first edge, then those of the second; each ascending.
    pub particles: [u32; 4],
    /// Unit length, from the second edge to the first.
    pub normal: DVec3,
}

impl EdgeContact {
    /// The distance of the edges along the normal in m, negative where they have passed each other; at the points of the
    /// edges nearest to where their lines are closest.
    ///
    /// # Panics
    /// If a particle has no position.
    #[must_use]
    pub fn gap(&self, positions: &[DVec3]) -> f64 {
        let [a, b, c, d] = self.particles.map(|p| positions[p as usize]);
        let [first, second] = on_lines([a, b], [c, d]).map(|part| part.clamp(0.0, 1.0));
        self.normal.dot(a.lerp(b, first) - c.lerp(d, second))
    }

    /// The distance of the edges in m.
    ///
    /// # Panics
    /// If a particle has no position.
    #[must_use]
    pub fn distance(&self, positions: &[DVec3]) -> f64 {
        let [a, b, c, d] = self.particles.map(|p| positions[p as usize]);
        let [p, q] = closest_on_segments([a, b], [c, d]);
        p.distance(q)
    }

    /// The gap where the edges have passed each other, otherwise their distance.
    pub(crate) fn separation(&self, positions: &[DVec3]) -> f64 {
        let gap = self.gap(positions);
        if gap < 0.0 {
            gap
        } else {
            self.distance(positions)
        }
    }

    /// Takes the normal from the present positions; it stays where the edges are nearly parallel.
    fn turn(&mut self, positions: &[DVec3]) {
        let [a, b, c, d] = self.particles.map(|p| positions[p as usize]);
        if let Some(normal) = across(b - a, d - c) {
            self.normal = if normal.dot(self.normal) < 0.0 {
                -normal
            } else {
                normal
            };
        }
    }
}

/// The unit normal to two directions that are not parallel.
fn across(one: DVec3, other: DVec3) -> Option<DVec3> {
    across_units(one.normalize_or_zero(), other.normalize_or_zero())
}

/// The unit normal to two unit vectors that are not parallel.
fn across_units(one: DVec3, other: DVec3) -> Option<DVec3> {
    let across = one.cross(other);
    let sine = across.length();
    (sine > PARALLEL).then(|| across / sine)
}

/// Where two lines that are not parallel are closest, as fractions of the segments that they go through.
fn on_lines([a, b]: [DVec3; 2], [c, d]: [DVec3; 2]) -> [f64; 2] {
    let (one, other, from) = (b - a, d - c, a - c);
    let across = one.cross(other);
    let square = across.length_squared();
    [
        from.cross(other).dot(-across) / square,
        from.cross(one).dot(-across) / square,
    ]
}

/// The points of two segments that are closest to each other.
fn closest_on_segments([a, b]: [DVec3; 2], [c, d]: [DVec3; 2]) -> [DVec3; 2] {
    let part = |x: DVec3, from: DVec3, along: DVec3| {
        let part = (x - from).dot(along) / along.length_squared();
        // A segment without length is a point.
        if part.is_finite() {
            part.clamp(0.0, 1.0)
        } else {
            0.0
        }
    };
    let on_first = |x: DVec3| [a.lerp(b, part(x, a, b - a)), x];
    let on_second = |x: DVec3| [x, c.lerp(d, part(x, c, d - c))];
    // Inside of both, or with an end of one of them.
    let [first, second] = on_lines([a, b], [c, d]);
    let is_inside = |part: f64| (0.0..=1.0).contains(&part);
    if is_inside(first) && is_inside(second) {
        return [a.lerp(b, first), c.lerp(d, second)];
    }
    let ends = [on_second(a), on_second(b), on_first(c), on_first(d)];
    let nearer = |one: [DVec3; 2], other: [DVec3; 2]| {
        if other[0].distance_squared(other[1]) < one[0].distance_squared(one[1]) {
            other
        } else {
            one
        }
    };
    ends.into_iter().fold(ends[0], nearer)
}

/// An edge between two triangles.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Feature {
    /// Ascending.
    ends: [u32; 2],
    /// The slot in whose triangle the edge runs from the first end to the second, and the other one.
    slots: [u32; 2],
}

/// A feature edge at the present positions.
#[derive(Clone, Copy, Debug)]
struct Wedge {
    ends: [DVec3; 2],
    /// The unit vector from the first end to the second.
    along: DVec3,
    /// From the edge into each of the triangles, across the edge.
    inward: [DVec3; 2],
}

/// The feature edges of a surface.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct FeatureEdges {
    /// Ascending.
    edges: Vec<Feature>,
    tree: TriangleTree,
    tree_is_due: bool,
    #[cfg_attr(feature = "serde", serde(skip))]
    wedges: Vec<Option<Wedge>>,
    #[cfg_attr(feature = "serde", serde(skip))]
    boxes: Vec<Box32>,
    /// What each task found: room for a search.
    #[cfg_attr(feature = "serde", serde(skip))]
    found: Vec<Vec<EdgeContact>>,
    /// Each candidate by both of its edges: room for a search.
    #[cfg_attr(feature = "serde", serde(skip))]
    by_edge: Vec<Ranked>,
}

/// The ends of an edge, the separation and the number of one of its candidates.
type Ranked = ([u32; 2], f64, u32);

impl FeatureEdges {
    /// Lists the edges of a surface; `rest` are the positions at rest. O(triangles).
    pub(crate) fn list(&mut self, surface: &ContactSurface, rest: &[DVec3]) {
        self.edges.clear();
        for slot in (0..index(surface.slot_count())).filter(|&slot| surface.is_alive(slot)) {
            let triangle = surface.triangle(slot);
            for k in 0..3 {
                let [p, q] = [k, k + 1].map(|k| triangle.particles[k % 3]);
                let Some(other) = (p < q).then(|| beyond(surface, p, q)).flatten() else {
                    continue;
                };
                let is_rim = triangle.tag != surface.triangle(other).tag;
                let normals = [slot, other].map(|s| surface.area(s, rest).normalize_or_zero());
                if is_rim || normals[0].dot(normals[1]) < SHARP {
                    self.edges.push(Feature {
                        ends: [p.0, q.0],
                        slots: [slot, other],
                    });
                }
            }
        }
        self.edges
            .sort_unstable_by_key(|edge| (edge.ends, edge.slots));
        self.tree_is_due = true;
    }

    pub(crate) fn clear(&mut self) {
        self.edges.clear();
        self.tree_is_due = true;
    }

    /// Whether both have the same edges.
    pub(crate) fn same(&self, other: &Self) -> bool {
        let of = |features: &Self| {
            features
                .edges
                .iter()
                .map(|e| (e.ends, e.slots))
                .collect::<Vec<_>>()
        };
        of(self) == of(other)
    }

    pub(crate) fn count(&self) -> usize {
        self.edges.len()
    }

    /// All candidates, ascending by the first edge, then the second; `contacts` has those of the last search.
    pub(crate) fn search(&mut self, query: &Query<'_>, contacts: &mut Vec<EdgeContact>) {
        let known = &*contacts;
        let Self {
            edges,
            wedges,
            boxes,
            tree,
            ..
        } = self;
        wedges.clear();
        wedges.extend(edges.iter().map(|edge| wedge(query, edge)));
        boxes.clear();
        boxes.extend(wedges.iter().map(|wedge| match wedge {
            Some(wedge) => Box32::around(&Bounds::around(wedge.ends)),
            None => Box32::EMPTY,
        }));
        let item_of = |number: u32| Item {
            steps: steps_of(query, &edges[number as usize]),
            ..Item::PLAIN
        };
        if self.tree_is_due {
            tree.build(0..index(edges.len()), boxes, item_of);
            self.tree_is_due = false;
        } else {
            tree.refit(boxes, item_of);
        }
        self.found
            .resize_with(edges.len().div_ceil(CHUNK), Vec::new);
        let (edges, wedges, tree) = (&self.edges, &self.wedges, &self.tree);
        let look = |(chunk, found): (usize, &mut Vec<EdgeContact>)| {
            found.clear();
            let end = edges.len().min(CHUNK * (chunk + 1));
            for first in CHUNK * chunk..end {
                look_around(query, (edges, wedges), (tree, known), first, found);
            }
        };
        if self.found.len() < 2 {
            self.found.iter_mut().enumerate().for_each(look);
        } else {
            self.found.par_iter_mut().enumerate().for_each(look);
        }
        contacts.clear();
        self.found.iter().for_each(|found| contacts.extend(found));
        self.keep_nearest(query.state.positions, contacts);
    }

    /// Leaves out the candidates that are not among the nearest of both edges.
    fn keep_nearest(&mut self, positions: &[DVec3], contacts: &mut Vec<EdgeContact>) {
        let by_edge = &mut self.by_edge;
        by_edge.clear();
        for (number, contact) in (0..).zip(&*contacts) {
            let ([a, b, c, d], by) = (contact.particles, contact.separation(positions));
            by_edge.extend([([a, b], by, number), ([c, d], by, number)]);
        }
        by_edge.sort_unstable_by(|one, other| {
            let by_separation = one.1.total_cmp(&other.1);
            one.0
                .cmp(&other.0)
                .then(by_separation)
                .then(one.2.cmp(&other.2))
        });
        for of_edge in by_edge.chunk_by(|one, other| one.0 == other.0) {
            for (_, _, number) in of_edge.iter().skip(NEAREST) {
                // No edge has its own end twice.
                contacts[*number as usize].particles[1] = contacts[*number as usize].particles[0];
            }
        }
        contacts.retain(|contact| contact.particles[0] != contact.particles[1]);
    }
}

/// Takes the normals of candidates from the present positions.
pub(crate) fn turn(contacts: &mut [EdgeContact], positions: &[DVec3]) {
    contacts
        .iter_mut()
        .for_each(|contact| contact.turn(positions));
}

/// The triangle in which an edge runs in the other direction.
fn beyond(surface: &ContactSurface, p: ParticleId, q: ParticleId) -> Option<u32> {
    let mut fan = surface.corners(p);
    fan.find(|&(slot, k)| surface.triangle(slot).particles[(k + 2) % 3] == q)
        .map(|(slot, _)| slot)
}

/// Appends the candidates of an edge with those after it; `known` are those of the last search.
fn look_around(
    query: &Query<'_>,
    (edges, wedges): (&[Feature], &[Option<Wedge>]),
    (tree, known): (&TriangleTree, &[EdgeContact]),
    first: usize,
    found: &mut Vec<EdgeContact>,
) {
    let edge = &edges[first];
    let Some(wedge) = &wedges[first] else {
        return;
    };
    let begin = found.len();
    let bounds = Box32::around(&Bounds::around(wedge.ends));
    let lookout = Lookout::new(&bounds, &steps_of(query, edge), &query.reach);
    let visit = |leaf: &Leaf, _| {
        if leaf.number as usize > first {
            let other = leaf.number as usize;
            if let Some(other_wedge) = &wedges[other] {
                found.extend(contact(
                    query,
                    (edge, wedge),
                    (&edges[other], other_wedge),
                    false,
                ));
            }
        }
        true
    };
    let ask = |children: &Children, _| Answers {
        first: lookout.reached(children),
        second: 0,
    };
    tree.search_where(ask, visit);
    // Of those that have passed it before, all, however deep.
    let from = known.partition_point(|contact| contact.particles[..2] < edge.ends[..]);
    let known = known[from..].iter();
    for passed in known.take_while(|contact| contact.particles[..2] == edge.ends) {
        let [.., c, d] = passed.particles;
        let other = edges.binary_search_by_key(&[c, d], |other| other.ends);
        let is_deep = passed.gap(query.state.positions) < 0.0;
        let is_new = !found[begin..]
            .iter()
            .any(|contact| contact.particles == passed.particles);
        if let Ok(other) = other
            && let Some(other_wedge) = &wedges[other]
            && is_deep
            && is_new
        {
            found.extend(contact(
                query,
                (edge, wedge),
                (&edges[other], other_wedge),
                true,
            ));
        }
    }
    found[begin..].sort_unstable_by_key(|contact| contact.particles);
}

/// The box around the steps of an edge.
fn steps_of(query: &Query<'_>, edge: &Feature) -> Box32 {
    let steps = edge.ends.map(|p| query.steps[p as usize]);
    Box32::around(&Bounds::around(steps))
}

/// An edge that is sound and convex at present.
fn wedge(query: &Query<'_>, edge: &Feature) -> Option<Wedge> {
    let shape = &query.shape;
    let normals = edge.slots.map(|slot| shape.normal(slot));
    let ends = edge.ends.map(|p| query.state.positions[p as usize]);
    let along = (ends[1] - ends[0]).normalize_or_zero();
    // Triangles are counterclockwise.
    let inward = [normals[0].cross(along), normals[1].cross(-along)];
    let is_sound = edge.slots.iter().all(|&slot| shape.is_sound(slot));
    let is_convex = normals[0].dot(inward[1]) < -FLAT;
    (is_sound && is_convex).then_some(Wedge {
        ends,
        along,
        inward,
    })
}

fn contact(
    query: &Query<'_>,
    (edge, one): (&Feature, &Wedge),
    (other, two): (&Feature, &Wedge),
    has_passed: bool,
) -> Option<EdgeContact> {
    let crossed = across_units(one.along, two.along)?;
    // The first edge lies above the second, with its triangles going up and those of the second going down. Few edges within
    // reach do, so this comes first.
    let is_above = |normal: DVec3| {
        let up = |wedge: &Wedge| wedge.inward.map(|inward| inward.dot(normal));
        up(one).iter().all(|up| *up >= -BENT) && up(two).iter().all(|up| *up <= BENT)
    };
    let normal = match [is_above(crossed), is_above(-crossed)] {
        [true, false] => crossed,
        [false, true] => -crossed,
        _ => return None,
    };
    let [p, q] = closest_on_segments(one.ends, two.ends);
    let distance = p.distance(q);
    let reach = query
        .reach
        .of(approach(query.steps, &edge.ends, &other.ends));
    if (distance > reach && !has_passed) || distance.is_nan() {
        return None;
    }
    let shares = |p: &u32| other.ends.contains(p);
    let mut ends = edge.ends.iter();
    if ends.any(|&p| shares(&p) || query.pairs.partners(ParticleId(p)).any(|p| shares(&p.0))) {
        return None;
    }
    let tets = [edge, other].map(|edge| query.shape.triangle(edge.slots[0]).tet);
    if !query.may_edges_touch(tets, [edge.ends, other.ends]) {
        return None;
    }
    let [a, b] = edge.ends;
    let [c, d] = other.ends;
    let contact = EdgeContact {
        particles: [a, b, c, d],
        normal,
    };
    let gap = contact.gap(query.state.positions);
    if gap >= 0.0 {
        return (distance <= reach).then_some(contact);
    }
    if query.body_of[a as usize] == query.body_of[c as usize] {
        // At rest parts do not overlap: edges that have passed each other there are those of a wall.
        let at_rest = &query.state.mesh.mesh().positions;
        let [x1, x2, x3, x4] = contact.particles.map(|p| at_rest[p as usize]);
        let turned = across(x2 - x1, x4 - x3).map(|turned| turned * crossed.dot(normal).signum());
        let before = turned.map(|normal| EdgeContact { normal, ..contact }.gap(at_rest));
        if before.is_some_and(|before| before < AS_AT_REST * gap) {
            return None;
        }
    }
    // How far inside of both edges they cross. What is much deeper than that touches with the end, which is less deep.
    let [first, second] = on_lines(one.ends, two.ends);
    let inside = |part: f64, [a, b]: [DVec3; 2]| part.min(1.0 - part) * a.distance(b);
    let meet = inside(first, one.ends).min(inside(second, two.ends)) >= -gap / DEEP;
    let is_valid = if meet {
        has_way(query, other, [q, p], edge) || has_way(query, edge, [p, q], other)
    } else {
        gap > -PASSED * query.mean_edge
    };
    is_valid.then_some(contact)
}

/// Whether a way through tets leads from a point of an edge to one of another edge that is inside, which ends in none of
/// the other's own tets, and on as far again.
fn has_way(query: &Query<'_>, from: &Feature, [start, end]: [DVec3; 2], to: &Feature) -> bool {
    let tets = from.slots.map(|slot| query.shape.triangle(slot).tet);
    let ends = |x: DVec3| {
        tets.into_iter()
            .filter_map(move |tet| query.walk(tet, [start, x]))
    };
    let is_own = |tet: TetId| {
        let corners = query.state.mesh.mesh().tets[tet.index()];
        to.ends.iter().any(|&p| corners.contains(&ParticleId(p)))
    };
    ends(end).any(|tet| !is_own(tet)) && ends(start + (end - start) * 2.0).next().is_some()
}
