//! [`Contacts`]: bodies made of tets that touch, hard and one-sided, with Coulomb friction.
//!
//! A contact is a linear combination of particles along a normal, `C = n · Σ sₖ xₖ - h ≥ 0` with `Σ sₖ = 0`: a vertex
//! against the point below it on a triangle, two edges at the points where they are closest, or a particle against its
//! partner on the other side of a fresh cut.
//!
//! The point on the triangle is found in each solve: the foot of the vertex in the plane of the triangle. Where the foot
//! lies beyond a side by more than a quarter of the altitude, a point on the sides moved outward by a quarter takes its
//! place: weights below -1/4 become -1/4, and the others shrink towards -1/4 in proportion until the sum is 1 again. That
//! point is not the closest one, which would need a distinction of cases; it decides how the force is distributed, and it
//! does not change `C`, since all of the plane has the same distance.
//!
//! Two edges touch while the points where their lines are closest lie on both; otherwise a corner of one of them is what
//! touches, and that is the contact of a vertex. Their normal is given, for the sign of the cross product of both
//! directions tells inside from outside only as long as they have not turned past each other.
//!
//! Near a convex edge a vertex is outside if it is outside of one of both surfaces that meet there. So a contact may
//! have a second plane, that of the surface beyond an edge of its triangle. With one plane only, or with a normal in
//! between, a vertex of a floor catches the front of a block that slides over it. A vertex inside is held by the plane that
//! it was less deep under when the substep began: it came in through that one. So the smaller of both depths never grows,
//! and nothing is pushed out of a surface that it did not pass. The slight overlaps of contacts at rest must not catch
//! either: if it was under neither plane by more than 1% of the edge, the one acts that takes less to satisfy. The normal
//! of the second plane is given in the basis of the triangle, so it turns with it.
//!
//! A plane has no end, a surface has: past a rim a vertex would be held where there is nothing below it. So a contact may
//! have a limit, a direction away from the nearest edge and a distance along it beyond which the vertex touches nothing.
//! A limit only opens a contact, it never presses.
//!
//! What the substep adds to the overlap is stopped in full; the overlap that was there at its start is taken back over
//! a recovery time τ: `C̃ = C - α min(C₀, 0)` with `1 - α = min(1, Δt/τ)`. So an overlap parts at its depth over τ, and
//! a contact at rest still ends at C = 0. Where `C̃ ≥ 0` nothing is written, so a contact that is exactly closed and
//! does not press leaves every bit in place. Otherwise `Δλ = -C̃ / W` with `W = Σ wₖ sₖ²` moves particle k by
//! `wₖ sₖ Δλ n`, and of what the two sides slid along each other in this substep up to `μ λ W` is taken back. That is
//! the law that colliders have. The relaxation of the solver does not scale contacts: damped contacts sink in.
//!
//! A corner that is light and far from the point of contact would be thrown by `C̃ / sₖ`, a hundred times the overlap for
//! a share of 1%. So W is at least a quarter of the largest `wₖ |sₖ|`: no particle is moved by more than four times what
//! is to be taken back, all by the same factor less, so that momentum is kept. That acts only where the movable particles
//! of a contact have shares below a quarter or weigh next to nothing; such an overlap takes several substeps to part.
//!
//! Colors are solved one after the other, pairs before the others; contacts of a color beyond the sixteenth of their kind
//! form a tail that one thread solves, since a vertex that touches dozens of triangles needs dozens of colors of few
//! contacts each. Contacts of a color are solved several at once ([`lanes`]).
//!
//! Source: Macklin et al. 2019 and Müller et al. 2020 (detection by frames, friction of positions); the split of old and
//! new overlap is that of Giles, Diaz and Yuksel 2025 with a time in place of a factor. Cost: about 50 operations a
//! contact apart, 200 one that presses.

mod lanes;

use std::ops::Range;

use fearless_simd::Level;
use glam::DVec3;
use incise_graph::{Coloring, GraphError};

use super::ConstraintKind;
use crate::direction::{absolute, direction};
use crate::float::{load, store, weight};
use crate::pace::Pace;
use crate::particles::{Particles, number};
use crate::substep::Substep;
use crate::team::parallel_rounds;
use crate::{Float, StepSettings, XpbdError};

/// Colors of a kind that are solved in parallel; the contacts beyond are the tail.
const PARALLEL_COLORS: usize = 16;
/// Fewest contacts that a thread is given of a color.
const CONTACTS_A_THREAD: usize = 128;
/// By how much the foot of a vertex may lie outside of a side of its triangle, in altitudes.
const MARGIN: f64 = 0.25;
/// The sine of the angle between two edges up to which they count as parallel.
const PARALLEL: f64 = 0.01;
/// The square of the depth under both planes at an edge up to which the one acts that takes less to satisfy, in lengths of
/// the edge.
const SLIGHT: f64 = 1e-4;
/// One over how many times the part of an overlap that is taken back a particle may be moved by.
const PER_MOVE: f64 = 0.25;

/// The law of all contacts of a solver. See [`crate::Solver::set_contacts`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ContactLaw {
    /// Coulomb's coefficient of friction, at least 0.
    pub friction: f64,
    /// Time in s in which an overlap that is there parts, at least 0; 0 parts it within a substep, at any speed that
    /// takes.
    pub recovery_time: f64,
}

/// Two particles that were one before a cut: the second stays on the side of the first that `normal` points to.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PairContact {
    /// The two particles.
    pub particles: [u32; 2],
    /// From the side of the first into that of the second, of any length but 0.
    pub normal: DVec3,
}

/// Where the surface of a contact ends. See [`FaceContact::limit`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FaceLimit {
    /// The direction away from the surface, of any length but 0, as coefficients of the edges `e₁ = x₂ - x₁` and
    /// `e₂ = x₃ - x₁` of the triangle and of `e₁ × e₂`.
    pub normal: [f64; 3],
    /// How far in m along the direction the contact goes beyond the edge from the first corner to the second, at least 0.
    pub distance: f64,
}

/// A vertex that stays on the outer side of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FaceContact {
    /// The vertex, then the corners of the triangle, counterclockwise seen from outside.
    pub particles: [u32; 4],
    /// Where the edge from the first corner to the second is convex, the outward normal of the surface beyond it: of any
    /// length but 0, as coefficients of the edges `e₁ = x₂ - x₁` and `e₂ = x₃ - x₁` and of `e₁ × e₂`. A vertex on the
    /// outer side of that plane through the edge touches nothing.
    pub beyond: Option<[f64; 3]>,
    /// Where the surface ends near the edge from the first corner to the second: a vertex whose way from the closest point
    /// of that edge goes further in this direction touches nothing. Without a limit the plane goes on forever.
    pub limit: Option<FaceLimit>,
    /// The distance that is kept in m, at least 0.
    pub thickness: f64,
}

/// Two edges that stay on their sides of each other.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct EdgeContact {
    /// The ends of the one edge, then those of the other.
    pub particles: [u32; 4],
    /// From the second edge to the side that the first one stays on, of any length but 0.
    pub normal: DVec3,
    /// The distance that is kept in m, at least 0.
    pub thickness: f64,
}

/// A contact between two surfaces.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum SurfaceContact {
    /// A vertex and a triangle.
    Face(FaceContact),
    /// Two edges.
    Edges(EdgeContact),
}

impl SurfaceContact {
    /// The particles, as [`FaceContact::particles`] or [`EdgeContact::particles`].
    #[must_use]
    pub fn particles(&self) -> [u32; 4] {
        match self {
            Self::Face(contact) => contact.particles,
            Self::Edges(contact) => contact.particles,
        }
    }
}

impl From<FaceContact> for SurfaceContact {
    fn from(contact: FaceContact) -> Self {
        Self::Face(contact)
    }
}

impl From<EdgeContact> for SurfaceContact {
    fn from(contact: EdgeContact) -> Self {
        Self::Edges(contact)
    }
}

/// A contact after a frame. See [`crate::Solver::contacts`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactState {
    /// The vertex, the first end of the first edge, or the second particle of a pair.
    pub vertex: u32,
    /// The first corner of the triangle, the first end of the second edge, or the first particle of a pair.
    pub against: u32,
    /// Where the force acts in m: at the vertex, or at the closest point of the first edge.
    pub point: DVec3,
    /// How far the vertex or the edge is on the wrong side in m; negative if the two are apart, not above 0 if the vertex
    /// lies beside the triangle, or edges pass each other beyond their ends.
    pub depth: f64,
    /// The normal force in N, summed up over the substeps since the contacts were set and divided by those of the frame:
    /// the mean of a frame, or in a frame of several parts the share of the last part. 0 if the contact did not press.
    pub pressure: f64,
    /// The force in N on the vertex or on the first edge with friction, as `pressure`. The other side has its opposite.
    pub force: DVec3,
}

/// A contact as plain numbers for a kernel. See [`crate::Solver::contact_data`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactData<R> {
    /// The particles: the two of a pair and twice [`u32::MAX`], a vertex and the corners of a triangle, or the ends of two
    /// edges.
    pub particles: [u32; 4],
    /// Of a pair the unit normal and zeros; of two edges the unit normal, the thickness, three zeros and -1; of a vertex
    /// and a triangle [`FaceContact::beyond`] and the thickness, then [`FaceContact::limit`]. Three zeros stand for no
    /// direction.
    pub numbers: [R; 8],
}

/// Contacts that a kernel solves together: a color, or a tail. See [`crate::Solver::contact_rounds`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ContactRound {
    /// Their places in the solving order.
    pub contacts: Range<usize>,
    /// Whether they may share particles: then those that do are solved one after the other.
    pub is_tail: bool,
}

/// What all contacts of a step have in common, as plain numbers for a kernel. See [`crate::Solver::contact_factors`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactFactors<R> {
    /// The coefficient of friction.
    pub friction: R,
    /// The part of an old overlap that a substep leaves.
    pub kept: R,
    /// By how much the foot of a vertex may lie outside of a side of its triangle, in altitudes.
    pub margin: R,
}

impl ContactLaw {
    /// Checks that each value lies in its range.
    ///
    /// # Errors
    /// [`XpbdError::Setting`] names the first value that does not.
    pub fn check(&self) -> Result<(), XpbdError> {
        for (what, value) in [
            ("contact friction", self.friction),
            ("contact recovery_time", self.recovery_time),
        ] {
            if !(value.is_finite() && value >= 0.0) {
                let range = "at least 0 and finite";
                return Err(XpbdError::Setting { what, value, range });
            }
        }
        Ok(())
    }
}

/// The normal as a unit vector in the solver's precision.
fn unit<R: Float>(index: usize, normal: DVec3) -> Result<R::Vector, XpbdError> {
    let (_, unit) = direction::<f64>(normal).ok_or(XpbdError::Constraint {
        index,
        what: "normal",
        value: normal.length(),
        range: "a direction",
    })?;
    Ok(R::from_dvec3(unit))
}

/// A plane of a contact of `K` particles at the present positions.
#[derive(Clone, Copy)]
struct ContactPlane<R: Float, const K: usize> {
    normal: R::Vector,
    /// The gradient at each particle is the normal times this; their sum is 0.
    shares: [R; K],
    /// True for the second plane of the contact.
    is_second: bool,
}

/// A contact of `K` particles at the present positions.
#[derive(Clone, Copy)]
struct Gap<R: Float, const K: usize> {
    /// The plane that it acts along.
    plane: ContactPlane<R, K>,
    /// `C`, below 0 in an overlap.
    value: R,
    /// `C` without the part of an old overlap that the substep leaves.
    residual: R,
    /// Whether the vertex is past the end of the surface, so that there is no contact whatever `C` says.
    is_past: bool,
}

impl<R: Float, const K: usize> Gap<R, K> {
    fn is_open(&self) -> bool {
        self.is_past || self.residual >= R::ZERO
    }
}

/// A contact in the solver's precision.
trait Contact<R: Float, const K: usize>: Copy + Sync {
    fn particles(&self) -> [u32; K];
    /// From positions now and at the start of the substep and the part of an old overlap that is left; `None` where a
    /// triangle has no normal.
    fn gap(&self, x: [R::Vector; K], previous: [R::Vector; K], kept: R) -> Option<Gap<R, K>>;
    /// The first or the second plane; `None` where a triangle has no normal.
    fn plane(&self, x: [R::Vector; K], is_second: bool) -> Option<ContactPlane<R, K>>;
    /// Whether the first particle is above or below the other side, not beside it.
    fn is_opposite(&self, x: [R::Vector; K]) -> bool;
}

#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
struct Pair<R: Float> {
    particles: [u32; 2],
    normal: R::Vector,
}

#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
struct Surface<R: Float> {
    particles: [u32; 4],
    /// Zeros where there is none. Of two edges the unit normal.
    beyond: [R; 3],
    /// Zeros where there is none.
    limit: [R; 3],
    distance: R,
    thickness: R,
    is_edges: bool,
}

impl<R: Float> Pair<R> {
    fn new(index: usize, contact: &PairContact) -> Result<Self, XpbdError> {
        Ok(Self {
            particles: contact.particles,
            normal: unit::<R>(index, contact.normal)?,
        })
    }
}

impl<R: Float> Surface<R> {
    fn new(index: usize, contact: &SurfaceContact) -> Result<Self, XpbdError> {
        let refuse = |what, value, range| {
            Err(XpbdError::Constraint {
                index,
                what,
                value,
                range,
            })
        };
        let thickness = match contact {
            SurfaceContact::Face(contact) => contact.thickness,
            SurfaceContact::Edges(contact) => contact.thickness,
        };
        if !(thickness.is_finite() && thickness >= 0.0) {
            return refuse("thickness", thickness, "at least 0 and finite");
        }
        let thickness = R::from_f64(thickness);
        let contact = match contact {
            SurfaceContact::Face(contact) => contact,
            SurfaceContact::Edges(contact) => {
                return Ok(Self {
                    particles: contact.particles,
                    beyond: R::components(unit::<R>(index, contact.normal)?),
                    limit: [R::ZERO; 3],
                    distance: R::ZERO,
                    thickness,
                    is_edges: true,
                });
            }
        };
        let limit = contact.limit.map(|limit| limit.normal);
        let distance = contact.limit.map_or(0.0, |limit| limit.distance);
        if !(distance.is_finite() && distance >= 0.0) {
            return refuse("limit distance", distance, "at least 0 and finite");
        }
        let mut directions = [[R::ZERO; 3]; 2];
        for (given, out) in [contact.beyond, limit].into_iter().zip(&mut directions) {
            let Some(normal) = given else { continue };
            *out = normal.map(R::from_f64);
            if !out.iter().all(|n| n.is_finite()) || *out == [R::ZERO; 3] {
                let length = DVec3::from_array(normal).length();
                return refuse("normal", length, "a direction");
            }
        }
        let [beyond, limit] = directions;
        Ok(Self {
            particles: contact.particles,
            beyond,
            limit,
            distance: R::from_f64(distance),
            thickness,
            is_edges: false,
        })
    }
}

impl<R: Float> Contact<R, 2> for Pair<R> {
    fn particles(&self) -> [u32; 2] {
        self.particles
    }

    #[inline]
    fn gap(&self, x: [R::Vector; 2], previous: [R::Vector; 2], kept: R) -> Option<Gap<R, 2>> {
        let value = R::dot(self.normal, x[1] - x[0]);
        let before = R::dot(self.normal, previous[1] - previous[0]);
        Some(Gap {
            plane: self.plane(x, false)?,
            value,
            residual: new_part(value, before, kept),
            is_past: false,
        })
    }

    #[inline]
    fn plane(&self, _x: [R::Vector; 2], is_second: bool) -> Option<ContactPlane<R, 2>> {
        Some(ContactPlane {
            normal: self.normal,
            shares: [-R::ONE, R::ONE],
            is_second,
        })
    }

    fn is_opposite(&self, _x: [R::Vector; 2]) -> bool {
        true
    }
}

/// Both edges from the first corner of a triangle, and the vertex from there.
type Basis<R> = [<R as Float>::Vector; 3];

fn basis<R: Float>(x: [R::Vector; 4]) -> Basis<R> {
    [x[2] - x[1], x[3] - x[1], x[0] - x[1]]
}

/// A vector from its coefficients in the basis of a triangle with this area vector.
#[inline]
fn combined<R: Float>([e1, e2, _]: Basis<R>, area: R::Vector, [a, b, c]: [R; 3]) -> R::Vector {
    e1 * a + e2 * b + area * c
}

fn clamped<R: Float>(x: R, low: R, high: R) -> R {
    let x = if x < low { low } else { x };
    if x > high { high } else { x }
}

impl<R: Float> Surface<R> {
    /// The plane of the triangle.
    #[inline]
    fn own_plane(&self, [e1, e2, r]: Basis<R>) -> Option<ContactPlane<R, 4>> {
        let area = R::cross(e1, e2);
        // The normal, scaled by hand: squares of areas leave the range of single precision.
        let (size, normal) = direction::<R>(area)?;
        let [second, third] = inside(
            R::dot(R::cross(r, e2), normal) / size,
            R::dot(R::cross(e1, r), normal) / size,
        )?;
        Some(ContactPlane {
            normal,
            shares: [R::ONE, second + third - R::ONE, -second, -third],
            is_second: false,
        })
    }

    /// The plane beyond the edge from the first corner to the second.
    fn plane_beyond(&self, basis: Basis<R>) -> Option<ContactPlane<R, 4>> {
        if self.beyond == [R::ZERO; 3] {
            return None;
        }
        let [e1, e2, r] = basis;
        let (_, normal) = direction::<R>(combined(basis, R::cross(e1, e2), self.beyond))?;
        let (length, along) = direction::<R>(e1)?;
        let (low, high) = (R::from_f64(-MARGIN), R::from_f64(1.0 + MARGIN));
        let part = clamped(R::dot(r, along) / length, low, high);
        Some(ContactPlane {
            normal,
            shares: [R::ONE, part - R::ONE, -part, R::ZERO],
            is_second: true,
        })
    }

    /// Whether the vertex is past the end of the surface.
    fn is_past(&self, basis: Basis<R>) -> bool {
        if self.limit == [R::ZERO; 3] {
            return false;
        }
        let [e1, e2, r] = basis;
        let outward = direction::<R>(combined(basis, R::cross(e1, e2), self.limit));
        let (Some((_, outward)), Some((length, along))) = (outward, direction::<R>(e1)) else {
            return false;
        };
        let part = clamped(R::dot(r, along) / length, R::ZERO, R::ONE);
        R::dot(outward, r - e1 * part) > self.distance + self.thickness
    }

    /// The plane between two edges through their closest points, and whether these lie beyond an end of one of them;
    /// `None` if they are parallel.
    fn edge_plane(&self, [x0, x1, x2, x3]: [R::Vector; 4]) -> Option<(ContactPlane<R, 4>, bool)> {
        let (length, along) = direction::<R>(x1 - x0)?;
        let (other_length, other) = direction::<R>(x3 - x2)?;
        let across = R::cross(along, other);
        let square = R::dot(across, across);
        let are_parallel = square <= R::from_f64(PARALLEL * PARALLEL);
        if are_parallel || !square.is_finite() {
            return None;
        }
        let r = x0 - x2;
        let first = -(R::dot(r, R::cross(other, across)) / square) / length;
        let second = -(R::dot(r, R::cross(along, across)) / square) / other_length;
        if !(first.is_finite() && second.is_finite()) {
            return None;
        }
        let on_edge = |part: R| part >= R::ZERO && part <= R::ONE;
        let is_past = !(on_edge(first) && on_edge(second));
        let [first, second] = [first, second].map(|part| clamped(part, R::ZERO, R::ONE));
        let [x, y, z] = self.beyond;
        let plane = ContactPlane {
            normal: R::vector(x, y, z),
            shares: [R::ONE - first, first, second - R::ONE, -second],
            is_second: false,
        };
        Some((plane, is_past))
    }

    fn edge_gap(&self, x: [R::Vector; 4], previous: [R::Vector; 4], kept: R) -> Option<Gap<R, 4>> {
        let (plane, is_past) = self.edge_plane(x)?;
        let [_, first, _, second] = plane.shares;
        let between = |x: [R::Vector; 4]| {
            let way = (x[0] - x[2]) + (x[1] - x[0]) * first + (x[3] - x[2]) * second;
            R::dot(plane.normal, way) - self.thickness
        };
        let value = between(x);
        Some(Gap {
            plane,
            value,
            residual: new_part(value, between(previous), kept),
            is_past,
        })
    }

    /// The distance of the vertex from a plane, less the thickness.
    #[inline]
    fn above(&self, plane: &ContactPlane<R, 4>, [e1, e2, r]: Basis<R>) -> R {
        let [_, _, second, third] = plane.shares;
        R::dot(plane.normal, r + e1 * second + e2 * third) - self.thickness
    }
}

impl<R: Float> Contact<R, 4> for Surface<R> {
    fn particles(&self) -> [u32; 4] {
        self.particles
    }

    #[inline]
    fn gap(&self, x: [R::Vector; 4], previous: [R::Vector; 4], kept: R) -> Option<Gap<R, 4>> {
        if self.is_edges {
            return self.edge_gap(x, previous, kept);
        }
        let (now, old) = (basis::<R>(x), basis::<R>(previous));
        let at = |plane: ContactPlane<R, 4>| {
            let [value, before] = [now, old].map(|basis| self.above(&plane, basis));
            let gap = Gap {
                plane,
                value,
                residual: new_part(value, before, kept),
                is_past: false,
            };
            (gap, before)
        };
        let (mut gap, before) = at(self.own_plane(now)?);
        if gap.value < R::ZERO
            && let Some(beyond) = self.plane_beyond(now)
        {
            let (other, other_before) = at(beyond);
            let [edge, ..] = now;
            let slight = R::from_f64(SLIGHT) * R::dot(edge, edge);
            let is_slight = |before: R| before >= R::ZERO || before * before < slight;
            // Outside of one plane is outside: that one lets go of what it pressed.
            let acts = if other.value >= R::ZERO {
                true
            } else if is_slight(before) && is_slight(other_before) {
                other.residual > gap.residual
            } else {
                other_before > before
            };
            if acts {
                gap = other;
            }
        }
        gap.is_past = !gap.is_open() && self.is_past(now);
        Some(gap)
    }

    #[inline]
    fn plane(&self, x: [R::Vector; 4], is_second: bool) -> Option<ContactPlane<R, 4>> {
        if self.is_edges {
            return self.edge_plane(x).map(|(plane, _)| plane);
        }
        let basis = basis::<R>(x);
        if is_second {
            self.plane_beyond(basis)
        } else {
            self.own_plane(basis)
        }
    }

    fn is_opposite(&self, x: [R::Vector; 4]) -> bool {
        if self.is_edges {
            return true;
        }
        let [e1, e2, r] = basis::<R>(x);
        let Some((size, normal)) = direction::<R>(R::cross(e1, e2)) else {
            return false;
        };
        let second = R::dot(R::cross(r, e2), normal) / size;
        let third = R::dot(R::cross(e1, r), normal) / size;
        let weights = [R::ONE - second - third, second, third];
        // The grown triangle serves the force, not the measure.
        let rounding = R::from_f64(-1e-6);
        weights.iter().all(|weight| *weight >= rounding)
    }
}

/// What is left of `C` without the part of an old overlap that the substep leaves.
#[inline]
fn new_part<R: Float>(value: R, before: R, kept: R) -> R {
    if before < R::ZERO {
        value - kept * before
    } else {
        value
    }
}

/// The weights of the second and the third corner for those of a point in the plane of a triangle: unchanged inside of the
/// triangle with its sides moved outward by [`MARGIN`] altitudes, otherwise of a point on those sides. `None` for what is
/// no number.
#[inline]
fn inside<R: Float>(second: R, third: R) -> Option<[R; 2]> {
    let margin = R::from_f64(MARGIN);
    let weights = [R::ONE - second - third, second, third];
    if !weights.iter().all(|w| w.is_finite()) {
        return None;
    }
    if weights.iter().all(|w| *w >= -margin) {
        return Some([second, third]);
    }
    // Weights measured from the grown sides: what lies beyond a side goes onto it, the others keep their ratio.
    let [a, b, c] = weights.map(|w| if w > -margin { w + margin } else { R::ZERO });
    let scale = (R::ONE + margin + margin + margin) / (a + b + c);
    Some([b * scale - margin, c * scale - margin])
}

/// Contacts that one thread or several solve at once: a color, or a tail.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Round {
    is_pairs: bool,
    /// Whether its contacts may share particles.
    is_tail: bool,
    from: usize,
    to: usize,
}

/// Memory that is of use while contacts are set only.
#[derive(Debug)]
struct Room {
    /// The numbers of the contacts in the order of their colors.
    order: Vec<usize>,
    /// Of each color the place of its next contact.
    next: Vec<usize>,
    /// Of each particle the mark of the last color that it was seen in.
    seen: Vec<u64>,
    /// The mark of the next color.
    first: u64,
}

impl Default for Room {
    fn default() -> Self {
        Self {
            order: Vec::new(),
            next: Vec::new(),
            seen: Vec::new(),
            // Particles that were not seen have 0.
            first: 1,
        }
    }
}

/// The contacts of a solver.
#[derive(Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(crate) struct Contacts<R: Float> {
    /// Absent where no contacts are declared.
    law: Option<ContactLaw>,
    /// In solving order.
    pairs: Vec<Pair<R>>,
    surfaces: Vec<Surface<R>>,
    rounds: Vec<Round>,
    /// Of pairs and of surfaces where each color ends.
    ends: [Vec<usize>; 2],
    #[cfg_attr(feature = "serde", serde(skip))]
    room: Room,
    /// Of each contact, pairs first: the impulse of friction and the multiplier of the substep; only while a step has
    /// more than one iteration.
    #[cfg_attr(feature = "serde", serde(skip))]
    multipliers: Vec<R::Particle>,
    /// Of each contact: the impulse with friction and its normal part, summed up over the substeps of a frame.
    #[cfg_attr(feature = "serde", serde(skip))]
    impulses: Vec<R::Particle>,
    /// Force in N for an impulse.
    #[cfg_attr(feature = "serde", serde(skip))]
    per_impulse: f64,
    /// Whether several threads pay.
    #[cfg_attr(feature = "serde", serde(skip))]
    pace: Pace,
}

impl<R: Float> Default for Contacts<R> {
    fn default() -> Self {
        Self {
            law: None,
            pairs: Vec::new(),
            surfaces: Vec::new(),
            rounds: Vec::new(),
            ends: [Vec::new(), Vec::new()],
            room: Room::default(),
            multipliers: Vec::new(),
            impulses: Vec::new(),
            per_impulse: 0.0,
            pace: Pace::default(),
        }
    }
}

/// Without forces, which the next frame measures.
impl<R: Float> Clone for Contacts<R> {
    fn clone(&self) -> Self {
        Self {
            law: self.law,
            pairs: self.pairs.clone(),
            surfaces: self.surfaces.clone(),
            rounds: self.rounds.clone(),
            ends: self.ends.clone(),
            ..Self::default()
        }
    }
}

/// Replaces `out` by `list` in the order of `colors` and `ends` by where each color ends, and appends the rounds.
///
/// # Errors
/// A contact that is refused, a particle that does not exist or is named twice, or two contacts of a color on one particle.
fn arrange<T, U, const K: usize>(
    list: &[T],
    colors: &Coloring,
    numbers: impl Fn(&T) -> [u32; K],
    convert: impl Fn(usize, &T) -> Result<U, XpbdError>,
    (out, ends): (&mut Vec<U>, &mut Vec<usize>),
    rounds: &mut Vec<Round>,
    room: &mut Room,
) -> Result<(), XpbdError> {
    out.clear();
    ends.clear();
    ends.resize(colors.color_count(), 0);
    let color_of = |c: usize| colors.color(c).index();
    (0..list.len()).for_each(|c| ends[color_of(c)] += 1);
    let Room {
        order,
        next,
        seen,
        first,
    } = room;
    next.clear();
    let mut to = 0;
    for end in &mut *ends {
        next.push(to);
        to += *end;
        *end = to;
    }
    order.clear();
    order.resize(list.len(), 0);
    for c in 0..list.len() {
        let place = &mut next[color_of(c)];
        order[*place] = c;
        *place += 1;
    }
    for &c in &*order {
        see(seen, *first + color_of(c) as u64, list, c, &numbers, colors)?;
        out.push(convert(c, &list[c])?);
    }
    *first += colors.color_count() as u64;
    let is_pairs = K == 2;
    let tail = PARALLEL_COLORS.min(ends.len());
    let mut from = 0;
    let mut round = |to: usize, is_tail| {
        if from < to {
            rounds.push(Round {
                is_pairs,
                is_tail,
                from,
                to,
            });
        }
        from = to;
    };
    ends[..tail].iter().for_each(|&end| round(end, false));
    round(list.len(), true);
    Ok(())
}

/// Marks the particles of a contact by a number of its color.
fn see<T, const K: usize>(
    seen: &mut [u64],
    mark: u64,
    list: &[T],
    constraint: usize,
    numbers: impl Fn(&T) -> [u32; K],
    colors: &Coloring,
) -> Result<(), XpbdError> {
    let particles = seen.len();
    let of_contact = numbers(&list[constraint]);
    let color = colors.color(constraint);
    for (k, &particle) in of_contact.iter().enumerate() {
        if of_contact[..k].contains(&particle) {
            return Err(refuse(GraphError::RepeatedParticle {
                constraint,
                particle,
            }));
        }
        let Some(seen) = seen.get_mut(particle as usize) else {
            return Err(refuse(GraphError::ParticleOutOfRange {
                constraint,
                particle,
                particles,
            }));
        };
        if *seen == mark {
            let is_other =
                |c: &usize| colors.color(*c) == color && numbers(&list[*c]).contains(&particle);
            let other = (0..constraint).find(is_other).unwrap_or(constraint);
            return Err(refuse(GraphError::SharedParticle {
                first: number(other),
                second: number(constraint),
                color,
                particle,
            }));
        }
        *seen = mark;
    }
    Ok(())
}

impl<R: Float> Contacts<R> {
    /// Whether contacts are declared, even if there are none at present.
    pub(crate) fn is_declared(&self) -> bool {
        self.law.is_some()
    }

    /// Number of pairs and of contacts between surfaces.
    pub(crate) fn counts(&self) -> [usize; 2] {
        [self.pairs.len(), self.surfaces.len()]
    }

    /// Number of colors, of pairs and of surfaces together.
    pub(crate) fn color_count(&self) -> usize {
        self.ends.iter().map(Vec::len).sum()
    }

    /// Forgets all contacts and their memory.
    pub(crate) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Replaces all contacts; on an error there are none.
    pub(crate) fn set(
        &mut self,
        particle_count: usize,
        law: &ContactLaw,
        pairs: (&[PairContact], &Coloring),
        surfaces: (&[SurfaceContact], &Coloring),
    ) -> Result<(), XpbdError> {
        let result = self.try_set(particle_count, law, pairs, surfaces);
        if result.is_err() {
            self.clear();
        }
        result
    }

    fn try_set(
        &mut self,
        particle_count: usize,
        law: &ContactLaw,
        pairs: (&[PairContact], &Coloring),
        surfaces: (&[SurfaceContact], &Coloring),
    ) -> Result<(), XpbdError> {
        law.check()?;
        self.law = Some(*law);
        let lists = [
            (pairs.0.len(), pairs.1.vertex_count()),
            (surfaces.0.len(), surfaces.1.vertex_count()),
        ];
        for (expected, found) in lists {
            if expected != found {
                return Err(refuse(GraphError::Length {
                    what: "colors of contacts",
                    expected,
                    found,
                }));
            }
        }
        let Self {
            rounds,
            pairs: own_pairs,
            surfaces: own_surfaces,
            ends: [pair_ends, surface_ends],
            room,
            ..
        } = self;
        room.seen.resize(particle_count, 0);
        rounds.clear();
        arrange(
            pairs.0,
            pairs.1,
            |pair| pair.particles,
            Pair::new,
            (own_pairs, pair_ends),
            rounds,
            room,
        )?;
        arrange(
            surfaces.0,
            surfaces.1,
            SurfaceContact::particles,
            Surface::new,
            (own_surfaces, surface_ends),
            rounds,
            room,
        )?;
        // Those of the frame before belong to other contacts.
        self.impulses.clear();
        Ok(())
    }

    /// All contacts as plain numbers, in solving order.
    pub(crate) fn data(&self) -> impl Iterator<Item = ContactData<R>> + '_ {
        let (none, o) = (u32::MAX, R::ZERO);
        let pairs = self.pairs.iter().map(move |pair| {
            let ([a, b], [x, y, z]) = (pair.particles, R::components(pair.normal));
            ContactData {
                particles: [a, b, none, none],
                numbers: [x, y, z, o, o, o, o, o],
            }
        });
        let surfaces = self.surfaces.iter().map(|surface| {
            let ([a, b, c], [d, e, f]) = (surface.beyond, surface.limit);
            let last = if surface.is_edges {
                -R::ONE
            } else {
                surface.distance
            };
            ContactData {
                particles: surface.particles,
                numbers: [a, b, c, surface.thickness, d, e, f, last],
            }
        });
        pairs.chain(surfaces)
    }

    /// The rounds of the solving order.
    pub(crate) fn rounds(&self) -> impl Iterator<Item = ContactRound> + '_ {
        let pairs = self.pairs.len();
        self.rounds.iter().map(move |round| {
            let first = if round.is_pairs { 0 } else { pairs };
            ContactRound {
                contacts: first + round.from..first + round.to,
                is_tail: round.is_tail,
            }
        })
    }

    /// What all contacts have in common, if they are declared.
    pub(crate) fn factors(&self, settings: &StepSettings) -> Option<ContactFactors<R>> {
        let law = self.law?;
        // The time may be 0.
        let part = settings.substep_time() / law.recovery_time;
        Some(ContactFactors {
            friction: R::from_f64(law.friction),
            kept: R::from_f64(1.0 - part.min(1.0)),
            margin: R::from_f64(MARGIN),
        })
    }

    /// Takes the impulses of a frame or a part that was computed elsewhere.
    pub(crate) fn load(&mut self, impulses: &[[R; 4]], settings: &StepSettings) {
        assert_eq!(impulses.len(), self.pairs.len() + self.surfaces.len());
        self.impulses.clear();
        self.impulses
            .extend(impulses.iter().copied().map(R::particle));
        self.per_impulse = per_impulse(settings);
    }

    /// All contacts at the present positions, in solving order. Forces are those of the last frame.
    pub(crate) fn states<'a>(
        &'a self,
        particles: &'a Particles<R>,
    ) -> impl Iterator<Item = ContactState> + 'a {
        let pairs = self.pairs.iter().enumerate().map(|(i, pair)| {
            let [a, b] = pair.particles;
            self.state(particles, i, pair, [b, a])
        });
        let first = self.pairs.len();
        let surfaces = self.surfaces.iter().enumerate().map(move |(i, surface)| {
            let [vertex, corner, end, _] = surface.particles;
            let against = if surface.is_edges { end } else { corner };
            let mut state = self.state(particles, first + i, surface, [vertex, against]);
            let x = surface.particles.map(|p| particles.vector(p as usize));
            if let Some((plane, is_past)) = surface.edge_plane(x).filter(|_| surface.is_edges) {
                let [_, first, _, second] = plane.shares;
                let end = particles.position(corner as usize);
                state.point = state.point.lerp(end, first.to_f64());
                if is_past {
                    let way = (x[0] - x[2]) + (x[1] - x[0]) * first + (x[3] - x[2]) * second;
                    state.depth = state.depth.min(-R::to_dvec3(way).length());
                }
            }
            state
        });
        pairs.chain(surfaces)
    }

    fn state<const K: usize>(
        &self,
        particles: &Particles<R>,
        index: usize,
        contact: &impl Contact<R, K>,
        [vertex, against]: [u32; 2],
    ) -> ContactState {
        let x = contact.particles().map(|p| particles.vector(p as usize));
        let gap = contact.gap(x, x, R::ZERO);
        let mut depth = gap.map_or(0.0, |gap| -gap.value.to_f64());
        // Below the plane of a triangle but beside the triangle, a vertex is not inside.
        if gap.is_some_and(|gap| gap.is_past) || !contact.is_opposite(x) {
            depth = depth.min(0.0);
        }
        let [x, y, z, normal] = self
            .impulses
            .get(index)
            .map_or([R::ZERO; 4], R::read)
            .map(|impulse| impulse.to_f64() * self.per_impulse);
        ContactState {
            vertex,
            against,
            point: particles.position(vertex as usize),
            depth,
            pressure: normal,
            force: DVec3::new(x, y, z),
        }
    }

    /// Solves a contact alone. [`lanes`] computes the same for several at once.
    #[inline]
    fn solve_one<const K: usize>(
        &self,
        index: usize,
        contact: &impl Contact<R, K>,
        particles: &Particles<R>,
        factors: ContactFactors<R>,
    ) {
        let numbers = contact.particles();
        let cells = numbers.map(|p| &particles.cells[p as usize]);
        let mut x = cells.map(|cell| load::<R>(cell));
        let previous = numbers.map(|p| particles.previous[p as usize]);
        let Some(mut gap) = contact.gap(x, previous, factors.kept) else {
            return;
        };
        let multiplier = self.multipliers.get(index);
        let [hx, hy, hz, signed] = multiplier.map_or([R::ZERO; 4], R::read);
        let was_second = signed < R::ZERO;
        let mut before = if was_second { -signed } else { signed };
        let mut friction = R::vector(hx, hy, hz);
        let has_pressed = before > R::ZERO;
        // Open, and no impulse to take back.
        if gap.is_open() && !has_pressed {
            return;
        }
        if !gap.residual.is_finite() {
            return;
        }
        let weights = cells.map(|cell| weight::<R>(cell));
        if has_pressed && (gap.is_past || gap.plane.is_second != was_second) {
            // What pressed along another plane, or on a surface that has ended, is taken back where it acted.
            let Some(plane) = contact.plane(x, was_second) else {
                return;
            };
            let impulse = -(plane.normal * before + friction);
            if !self.push(
                index,
                numbers,
                &mut x,
                particles,
                plane.shares,
                (impulse, -before),
            ) {
                return;
            }
            (before, friction) = (R::ZERO, R::Vector::default());
            if let Some(multiplier) = multiplier {
                R::write(multiplier, [R::ZERO; 4]);
            }
            match contact.gap(x, previous, factors.kept) {
                Some(now) if !now.is_open() => gap = now,
                _ => return,
            }
        }
        let plane = gap.plane;
        let (mut sum, mut most) = (R::ZERO, R::ZERO);
        for (&weight, &share) in weights.iter().zip(&plane.shares) {
            sum += weight * share * share;
            let moved = weight * absolute(share);
            most = if moved > most { moved } else { most };
        }
        let least = most * R::from_f64(PER_MOVE);
        if least > sum {
            sum = least;
        }
        let mut change = -(gap.residual / sum);
        if before + change < R::ZERO {
            change = -before;
        }
        // Nothing that could move it, or out of range.
        if !change.is_finite() {
            return;
        }
        let pressure = before + change;
        let mut impulse = plane.normal * change;
        if factors.friction > R::ZERO {
            let mut slide = R::Vector::default();
            for k in 0..K {
                slide += (x[k] - previous[k]) * plane.shares[k];
            }
            slide = slide - plane.normal * R::dot(plane.normal, slide);
            let mut wanted = friction - slide * (R::ONE / sum);
            let (length, limit) = (R::dot(wanted, wanted).sqrt(), factors.friction * pressure);
            if length > limit {
                wanted = wanted * (limit / length);
            }
            impulse += wanted - friction;
            friction = wanted;
        }
        if !self.push(
            index,
            numbers,
            &mut x,
            particles,
            plane.shares,
            (impulse, change),
        ) {
            return;
        }
        if let Some(multiplier) = multiplier {
            let [x, y, z] = R::components(friction);
            // Its sign tells the plane.
            let signed = if plane.is_second { -pressure } else { pressure };
            R::write(multiplier, [x, y, z, signed]);
        }
    }

    /// Moves the particles of a contact by an impulse along a plane and adds it up, unless it is out of range.
    #[inline]
    fn push<const K: usize>(
        &self,
        index: usize,
        numbers: [u32; K],
        x: &mut [R::Vector; K],
        particles: &Particles<R>,
        shares: [R; K],
        (impulse, change): (R::Vector, R),
    ) -> bool {
        if !R::components(impulse).into_iter().all(R::is_finite) {
            return false;
        }
        for k in 0..K {
            let cell = &particles.cells[numbers[k] as usize];
            x[k] += impulse * (weight::<R>(cell) * shares[k]);
            store::<R>(cell, x[k]);
        }
        if particles.keeps_refused() {
            for (&particle, &share) in numbers.iter().zip(&shares) {
                particles.refuse(particle, impulse * share);
            }
        }
        if let Some(total) = self.impulses.get(index) {
            let [x, y, z, normal] = R::read(total);
            let [dx, dy, dz] = R::components(impulse);
            R::write(total, [x + dx, y + dy, z + dz, normal + change]);
        }
        true
    }
}

/// Force in N for an impulse of a frame.
fn per_impulse(settings: &StepSettings) -> f64 {
    let time = settings.substep_time();
    1.0 / (time * time * f64::from(settings.substeps))
}

fn refuse(source: GraphError) -> XpbdError {
    XpbdError::Schedule {
        what: "contact",
        source,
    }
}

impl<R: Float> ConstraintKind<R> for Contacts<R> {
    fn begin(&mut self, _particles: &Particles<R>, substep: &Substep<'_, R>) -> usize {
        if self.law.is_none() {
            return 0;
        }
        let count = self.pairs.len() + self.surfaces.len();
        let nothing = || R::particle([R::ZERO; 4]);
        // Those of a part of a frame are forgotten when contacts are set.
        if substep.number == 0 || self.impulses.len() != count {
            self.impulses.clear();
            self.impulses.resize_with(count, nothing);
            self.per_impulse = per_impulse(substep.settings);
        }
        self.multipliers.clear();
        if substep.settings.iterations > 1 {
            self.multipliers.resize_with(count, nothing);
        }
        0
    }

    /// One pass over all contacts, round after round, within a color in parallel.
    fn solve(&mut self, particles: &Particles<R>, substep: &Substep<'_, R>) {
        let (Some(factors), false) = (self.factors(substep.settings), self.rounds.is_empty())
        else {
            return;
        };
        let mut pace = std::mem::take(&mut self.pace);
        let level = Level::new();
        let this = &*self;
        let threads = rayon::current_num_threads();
        let chunks = |round: usize| {
            let round = this.rounds[round];
            let most = if round.is_tail { 1 } else { threads };
            ((round.to - round.from) / CONTACTS_A_THREAD).clamp(1, most)
        };
        let work = |number: usize, chunk: usize| {
            let (round, chunks) = (this.rounds[number], chunks(number));
            let share = |part: usize| round.from + (round.to - round.from) * part / chunks;
            let range = share(chunk)..share(chunk + 1);
            let ends = &this.ends[usize::from(!round.is_pairs)];
            let first = ends.partition_point(|end| *end <= range.start);
            let mut from = range.start;
            // A tail has many colors, which one thread solves one after the other.
            for &end in &ends[first..] {
                let to = end.min(range.end);
                lanes::solve(level, this, round.is_pairs, from..to, particles, factors);
                from = to;
                if from == range.end {
                    break;
                }
            }
        };
        let rounds = this.rounds.len();
        let alone = || {
            for round in 0..rounds {
                for chunk in 0..chunks(round) {
                    work(round, chunk);
                }
            }
        };
        if threads == 1 || (0..rounds).all(|round| chunks(round) < 2) {
            alone();
        } else {
            let contacts = this.pairs.len() + this.surfaces.len();
            pace.run(contacts, |is_shared| match is_shared {
                true => parallel_rounds(rounds, chunks, work),
                false => alone(),
            });
        }
        self.pace = pace;
    }

    fn bytes(&self) -> usize {
        let ends = self.ends.iter().map(|ends| size_of_val(&**ends));
        size_of_val(&*self.pairs)
            + size_of_val(&*self.surfaces)
            + size_of_val(&*self.rounds)
            + ends.sum::<usize>()
    }
}

#[cfg(test)]
mod tests;
