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
//! it and farther behind it than the blade is high are free. Source: closed forms. Cost: 40 operations a listed particle.

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
}

impl<R: Float> Placed<R> {
    fn new(blade: &SolidBlade, substep: &Substep<'_, R>, origin: DVec3) -> Option<Self> {
        let before = substep.fraction - 1.0 / f64::from(substep.settings.substeps);
        let (corner, length, [along, front, normal]) = blade.frame(substep.fraction)?;
        let (from, ..) = blade.frame(before)?;
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
        })
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
}

impl<R: Float> Default for Blades<R> {
    fn default() -> Self {
        Self {
            list: Vec::new(),
            placed: Vec::new(),
            pushes: Vec::new(),
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
        self.list = list;
        self.placed.clear();
        self.pushes.clear();
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
        } = self;
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

    fn solve(&mut self, particles: &Particles<R>, _substep: &Substep<'_, R>) {
        for (number, (blade, placed)) in self.list.iter().zip(&self.placed).enumerate() {
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
        }
    }

    fn bytes(&self) -> usize {
        0
    }
}
