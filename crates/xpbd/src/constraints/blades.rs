//! [`Blades`]: solid blades that push the two sides of their cut apart.
//!
//! A [`SolidBlade`] is a wedge behind a straight edge that ends in two parallel faces. A particle on a side of the cut
//! stays on that side of it: the side comes from the caller, because just after the cut both sides are at one place and
//! nothing in their positions tells them apart. With d the distance from the middle plane on the particle's own side and s
//! the distance behind the edge, it is inside where `d - h < 0` and `d cos α - s sin α < 0` (h half the thickness, α half
//! the angle of the wedge), and goes onto the nearer of both planes. What it slid along the plane, relative to the blade,
//! is taken back by at most the coefficient of friction times the depth: the law of colliders.
//!
//! The plane of the wedge leans forward, so what is pushed aside pushes the blade back. Particles beside the edge, before
//! it and farther behind it than the blade is high are free.
//!
//! With a toughness the edge itself holds the uncut tissue before it ([`EdgePoint`]): what would fall behind the edge in a
//! substep is pushed forward with it, by a force of at most the toughness times the length of edge. That is Griffith's
//! criterion for a crack that runs where its blade is: tissue yields until the force at the edge is the toughness times its
//! length, then the edge passes through it at this force. It is friction with a known limit; what is lost is the limit times
//! the way through the tissue, the toughness times the area that the edge passes.
//!
//! Source: closed forms; Griffith 1921. Cost: 40 operations a listed particle, 120 a point of the edge.

use glam::DVec3;

use super::ConstraintKind;
use crate::direction::direction;
use crate::float::{finite, load, store, weight};
use crate::force::Force;
use crate::particles::Particles;
use crate::substep::Substep;
use crate::{Float, XpbdError};

/// A blade of some thickness during a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct SolidBlade {
    /// The ends of its edge in m at the start of the frame and at its end; in between they move in straight lines.
    pub edge: [[DVec3; 2]; 2],
    /// The direction that it cuts in, of any length but 0; only the part across the edge counts.
    pub front: DVec3,
    /// Thickness in m behind the wedge, positive.
    pub thickness: f64,
    /// The angle of the wedge in radians, above 0 and below π.
    pub wedge_angle: f64,
    /// How far it reaches behind its edge in m, positive.
    pub height: f64,
    /// Coulomb's coefficient of friction, at least 0.
    pub friction: f64,
    /// Particles on the faces of its cut, each once, and whether each belongs to the side that `edge × front` points to.
    pub sides: Vec<(u32, bool)>,
    /// Work in J that it takes to part a square meter of tissue, at least 0.
    pub toughness: f64,
    /// Points of uncut tissue that the edge meets in the frame; without a toughness they have no effect.
    pub uncut: Vec<EdgePoint>,
}

/// A point of uncut tissue at the edge of a blade, or before it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgePoint {
    /// The corners of its tet.
    pub particles: [u32; 4],
    /// The shares of the corners in the point; they add up to 1.
    pub weights: [f64; 4],
    /// Distance in m from the first end of the edge to where it meets the point.
    pub along: f64,
    /// The length in m of the edge that the point stands for.
    pub length: f64,
}

impl SolidBlade {
    /// Checks that each value lies in its range.
    ///
    /// # Errors
    /// [`XpbdError::Setting`] names the first value that does not.
    pub fn check(&self) -> Result<(), XpbdError> {
        let refuse = |what, value, range| Err(XpbdError::Setting { what, value, range });
        for (what, value) in [
            ("blade thickness", self.thickness),
            ("blade height", self.height),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return refuse(what, value, "positive and finite");
            }
        }
        let angle = self.wedge_angle;
        if !(angle > 0.0 && angle < std::f64::consts::PI) {
            return refuse("blade wedge angle", angle, "above 0 and below pi");
        }
        if !(self.friction.is_finite() && self.friction >= 0.0) {
            return refuse("blade friction", self.friction, "at least 0 and finite");
        }
        if !(self.toughness.is_finite() && self.toughness >= 0.0) {
            return refuse("blade toughness", self.toughness, "at least 0 and finite");
        }
        let numbers = |point: &EdgePoint| {
            let [a, b, c, d] = point.weights;
            [a, b, c, d, point.along, point.length]
        };
        let mut numbers = self.uncut.iter().flat_map(numbers);
        if let Some(value) = numbers.find(|value| !value.is_finite()) {
            return refuse("blade edge point", value, "finite");
        }
        let points = self.edge.iter().flatten();
        if !(points.copied().all(DVec3::is_finite) && self.front.is_finite()) {
            return refuse("blade coordinate", f64::NAN, "finite");
        }
        if self.frame(1.0).is_none() {
            return refuse(
                "blade front",
                self.front.length(),
                "a direction across the edge",
            );
        }
        Ok(())
    }

    /// Where it is at a fraction of the frame: an end of the edge, its length, and the directions of edge, front and
    /// normal; `None` without an edge or a front.
    fn frame(&self, fraction: f64) -> Option<(DVec3, f64, [DVec3; 3])> {
        let [a, b] = [0, 1].map(|end| self.edge[0][end].lerp(self.edge[1][end], fraction));
        let (length, along) = direction::<f64>(b - a)?;
        let (_, front) = direction::<f64>(self.front - along * along.dot(self.front))?;
        Some((a, length, [along, front, along.cross(front)]))
    }
}

/// A blade at the end of a substep.
#[derive(Clone, Copy, Debug)]
struct Placed<R: Float> {
    corner: R::Vector,
    length: R,
    along: R::Vector,
    front: R::Vector,
    normal: R::Vector,
    half_thickness: R,
    height: R,
    /// Sine and cosine of half the angle.
    lean: [R; 2],
    friction: R,
    /// What it moved in the substep.
    motion: R::Vector,
    /// What the direction of its edge turned in the substep.
    turn: R::Vector,
}

impl<R: Float> Placed<R> {
    fn new(blade: &SolidBlade, substep: &Substep<'_, R>, origin: DVec3) -> Option<Self> {
        let before = substep.fraction - 1.0 / f64::from(substep.settings.substeps);
        let (corner, length, [along, front, normal]) = blade.frame(substep.fraction)?;
        let (from, _, [along_before, ..]) = blade.frame(before)?;
        let (sin, cos) = (0.5 * blade.wedge_angle).sin_cos();
        Some(Self {
            corner: R::from_dvec3(corner - origin),
            length: R::from_f64(length),
            along: R::from_dvec3(along),
            front: R::from_dvec3(front),
            normal: R::from_dvec3(normal),
            half_thickness: R::from_f64(0.5 * blade.thickness),
            height: R::from_f64(blade.height),
            lean: [R::from_f64(sin), R::from_f64(cos)],
            friction: R::from_f64(blade.friction),
            motion: R::from_dvec3(corner - from),
            turn: R::from_dvec3(along - along_before),
        })
    }

    /// How far a point falls behind the edge in the substep.
    fn falls_behind(&self, point: &EdgePoint, particles: &Particles<R>) -> R {
        let along = R::from_f64(point.along);
        let at = self.corner + self.along * along;
        let was_at = at - self.motion - self.turn * along;
        let (mut now, mut ahead) = (R::ZERO, R::ZERO);
        for (&p, &weight) in point.particles.iter().zip(&point.weights) {
            let (p, weight) = (p as usize, R::from_f64(weight));
            now += R::dot(self.front, load::<R>(&particles.cells[p]) - at) * weight;
            ahead += R::dot(self.front, particles.previous[p] - was_at) * weight;
        }
        // A point behind it is one that it has passed before.
        let passed = if ahead < R::ZERO { ahead } else { R::ZERO };
        passed - now
    }

    /// Where a particle of a side is put that is inside; `None` if it is not.
    fn push_out(&self, x: R::Vector, previous: R::Vector, is_positive: bool) -> Option<R::Vector> {
        let r = x - self.corner;
        let beside = R::dot(r, self.along);
        let behind = -R::dot(r, self.front);
        let is_beside = beside < R::ZERO || beside > self.length;
        if is_beside || behind <= R::ZERO || behind > self.height {
            return None;
        }
        let own = if is_positive {
            self.normal
        } else {
            -self.normal
        };
        let [sin, cos] = self.lean;
        let distance = R::dot(r, own);
        let (flat, wedge) = (
            distance - self.half_thickness,
            distance * cos - behind * sin,
        );
        if flat >= R::ZERO || wedge >= R::ZERO {
            return None;
        }
        let (gap, normal) = if flat > wedge {
            (flat, own)
        } else {
            (wedge, own * cos + self.front * sin)
        };
        let out = x - normal * gap;
        let way = out - previous - self.motion;
        let slide = way - normal * R::dot(normal, way);
        let (length, hold) = (R::dot(slide, slide).sqrt(), self.friction * -gap);
        let share = if length > hold { hold / length } else { R::ONE };
        let out = out - slide * share;
        finite::<R>(out).then_some(out)
    }
}

/// The solid blades of a frame.
#[derive(Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(crate) struct Blades<R: Float> {
    #[cfg_attr(feature = "serde", serde(skip))]
    list: Vec<SolidBlade>,
    #[cfg_attr(feature = "serde", serde(skip))]
    placed: Vec<Option<Placed<R>>>,
    /// Of each blade, while forces are measured: the sum of mass times motion that particles gave it in the substep, and
    /// its moment.
    #[cfg_attr(feature = "serde", serde(skip))]
    pushes: Vec<Force>,
    /// Of each edge point, blade by blade: the mass times motion that it was pushed by in the substep.
    #[cfg_attr(feature = "serde", serde(skip))]
    pushed: Vec<R>,
    /// Of each blade the work in J that its edge has done in the frame to pass through tissue.
    #[cfg_attr(feature = "serde", serde(skip))]
    work: Vec<f64>,
}

impl<R: Float> Default for Blades<R> {
    fn default() -> Self {
        Self {
            list: Vec::new(),
            placed: Vec::new(),
            pushes: Vec::new(),
            pushed: Vec::new(),
            work: Vec::new(),
        }
    }
}

/// Without blades: they are set for each frame.
impl<R: Float> Clone for Blades<R> {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl<R: Float> Blades<R> {
    /// Replaces all blades, which have been checked.
    pub(crate) fn set(&mut self, list: Vec<SolidBlade>) {
        self.placed.clear();
        self.pushes.clear();
        self.pushed.clear();
        self.work.clear();
        self.work.resize(list.len(), 0.0);
        self.list = list;
    }

    /// The work in J of each edge since the blades were set.
    pub(crate) fn work(&self) -> &[f64] {
        &self.work
    }

    pub(crate) fn count(&self) -> usize {
        self.list.len()
    }

    /// Adds the impulses of the substep to those of a frame.
    pub(crate) fn take_pushes(&mut self, impulses: &mut [Force], per_time: f64) {
        for (sum, push) in impulses.iter_mut().zip(self.pushes.drain(..)) {
            sum.force += push.force * per_time;
            sum.torque += push.torque * per_time;
        }
    }
}

impl<R: Float> ConstraintKind<R> for Blades<R> {
    fn begin(&mut self, particles: &Particles<R>, substep: &Substep<'_, R>) -> usize {
        let Self {
            list,
            placed,
            pushes,
            pushed,
            work: _,
        } = self;
        pushed.clear();
        pushed.resize(list.iter().map(edge_points).sum(), R::ZERO);
        placed.clear();
        placed.extend(
            list.iter()
                .map(|blade| Placed::new(blade, substep, particles.origin)),
        );
        pushes.clear();
        if particles.keeps_refused() {
            pushes.resize(list.len(), Force::default());
        }
        0
    }

    fn solve(&mut self, particles: &Particles<R>, substep: &Substep<'_, R>) {
        let mut first = 0;
        for (number, (blade, placed)) in self.list.iter().zip(&self.placed).enumerate() {
            let points = first..first + edge_points(blade);
            first = points.end;
            let Some(placed) = placed else { continue };
            for &(p, is_positive) in &blade.sides {
                let p = p as usize;
                let cell = &particles.cells[p];
                if weight::<R>(cell) <= R::ZERO {
                    continue;
                }
                let x = load::<R>(cell);
                let Some(out) = placed.push_out(x, particles.previous[p], is_positive) else {
                    continue;
                };
                store::<R>(cell, out);
                if let Some(push) = self.pushes.get_mut(number) {
                    let at = particles.origin + R::to_dvec3(out);
                    push.add(R::to_dvec3(x - out) * particles.masses[p], at);
                }
            }
            let per_length = R::from_f64(blade.toughness) * substep.factors.time_squared;
            for (point, pushed) in blade.uncut.iter().zip(&mut self.pushed[points]) {
                let limit = per_length * R::from_f64(point.length);
                let push = self.pushes.get_mut(number);
                hold(placed, point, limit, pushed, particles, push);
            }
        }
    }

    fn end(&mut self, particles: &mut Particles<R>, substep: &Substep<'_, R>) {
        let mut pushed = self.pushed.iter();
        let blades = self.list.iter().zip(&self.placed).zip(&mut self.work);
        for ((blade, placed), work) in blades {
            let Some(placed) = placed else {
                pushed.by_ref().take(edge_points(blade)).for_each(drop);
                continue;
            };
            for (point, &pushed) in blade.uncut.iter().zip(pushed.by_ref()) {
                let way = placed.falls_behind(point, particles);
                if pushed > R::ZERO && way > R::ZERO {
                    let time = substep.settings.substep_time();
                    *work += R::to_f64(pushed) / (time * time) * R::to_f64(way);
                }
            }
        }
    }

    fn bytes(&self) -> usize {
        0
    }
}

/// The number of edge points that have an effect.
fn edge_points(blade: &SolidBlade) -> usize {
    if blade.toughness > 0.0 {
        blade.uncut.len()
    } else {
        0
    }
}

/// Keeps a point of tissue before an edge, up to the limit of what it can be pushed by in a substep.
fn hold<R: Float>(
    placed: &Placed<R>,
    point: &EdgePoint,
    limit: R,
    pushed: &mut R,
    particles: &Particles<R>,
    push: Option<&mut Force>,
) {
    let way = placed.falls_behind(point, particles);
    if way <= R::ZERO {
        return;
    }
    let corners = point.particles.iter().zip(&point.weights);
    let corners = corners.map(|(&p, &share)| (p, R::from_f64(share)));
    let mass = corners.clone().map(|(p, share)| {
        let per_mass = weight::<R>(&particles.cells[p as usize]);
        per_mass * share * share
    });
    let per_mass = mass.fold(R::ZERO, |sum, part| sum + part);
    let rest = limit - *pushed;
    let wanted = way / per_mass;
    // Tissue that is held whole does not yield.
    let by = if wanted < rest { wanted } else { rest };
    *pushed += by;
    for (p, share) in corners.clone() {
        let cell = &particles.cells[p as usize];
        let part = placed.front * (by * share);
        let per_mass = weight::<R>(cell);
        if per_mass > R::ZERO {
            let out = load::<R>(cell) + part * per_mass;
            if finite::<R>(out) {
                store::<R>(cell, out);
            }
        } else if particles.keeps_refused() {
            particles.refuse(p, part);
        }
    }
    if let Some(push) = push {
        let at = placed.corner + placed.along * R::from_f64(point.along);
        let at = particles.origin + R::to_dvec3(at);
        push.add(R::to_dvec3(placed.front * -by), at);
    }
}
