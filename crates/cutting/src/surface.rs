//! [`CutSurface`]: what the particles along the surface of a stroke remember of it.
//!
//! A stroke has no plane to give every particle a sign. Instead the ends of each edge that was met know on which side
//! they were, and each particle on the surface keeps the surface's tangent plane where it was crossed, in the rest
//! shape, where nothing moves any more. The tangents give the side where no end can (or where a stroke that came back
//! gave it twice), and tell beforehand which particles the surface will pass closely.
//!
//! Only particles along the surface have an entry, so that a stroke costs nothing where it is not. Cost: a look-up.

use std::collections::HashMap;

use foldhash::fast::FixedState;
use glam::DVec3;
use incise_mesh::ParticleId;

use crate::CutDelta;

/// The tangent plane of a surface at a crossing, in the rest shape.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Tangent {
    pub(crate) point: DVec3,
    /// Unit length, towards the positive side.
    pub(crate) normal: DVec3,
}

impl Tangent {
    pub(crate) fn distance(&self, x: DVec3) -> f64 {
        self.normal.dot(x - self.point)
    }
}

/// What one particle remembers.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Mark {
    /// The surface there, if the particle is on it.
    pub(crate) tangent: Option<Tangent>,
    /// On which side it was.
    seen: Seen,
    /// Whether one of its edges was met, so that it is decided if it is on the surface.
    decided: bool,
    /// Whether this was taken over from an earlier stroke.
    adopted: bool,
}

impl Mark {
    /// That of a particle on a surface.
    pub(crate) fn on(tangent: Tangent) -> Self {
        Self {
            tangent: Some(tangent),
            decided: true,
            ..Self::default()
        }
    }
}

/// On which side of the surface a particle was when one of its edges was met.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
enum Seen {
    #[default]
    Never,
    On(bool),
    Both,
}

/// Part of a tet's size below which the distance of a particle from a tangent plane is rounding.
const IN_SURFACE: f64 = 1e-9;

/// The particles along the surface of a stroke. The order of the map has no effect.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct CutSurface {
    marks: HashMap<ParticleId, Mark, FixedState>,
    /// Particles whose marks changed since the registry last learned of them, if it has.
    news: Option<Vec<ParticleId>>,
    /// What was known before each change of this call, in order.
    journal: Vec<(ParticleId, Option<Mark>)>,
}

impl CutSurface {
    pub(crate) fn contains(&self, particle: ParticleId) -> bool {
        self.tangent(particle).is_some()
    }

    pub(crate) fn tangent(&self, particle: ParticleId) -> Option<Tangent> {
        self.marks.get(&particle)?.tangent
    }

    /// Whether one of the particle's edges was met.
    pub(crate) fn is_decided(&self, particle: ParticleId) -> bool {
        self.marks.get(&particle).is_some_and(|mark| mark.decided)
    }

    pub(crate) fn decide(&mut self, particle: ParticleId) {
        self.edit(particle).decided = true;
    }

    /// Whether what is known of the particle was taken over from an earlier stroke.
    pub(crate) fn is_adopted(&self, particle: ParticleId) -> bool {
        self.marks.get(&particle).is_some_and(|mark| mark.adopted)
    }

    fn edit(&mut self, particle: ParticleId) -> &mut Mark {
        if let Some(news) = &mut self.news {
            news.push(particle);
        }
        let before = self.marks.get(&particle).copied();
        self.journal.push((particle, before));
        self.marks.entry(particle).or_default()
    }

    /// Notes from now on what changes, for [`CutSurface::take_news`].
    pub(crate) fn keep_news(&mut self) {
        self.news.get_or_insert_default();
    }

    /// Begins a call that may be taken back.
    pub(crate) fn begin(&mut self) {
        self.journal.clear();
    }

    /// Takes back all changes since the call began.
    pub(crate) fn roll_back(&mut self) {
        for (particle, mark) in self.journal.drain(..).rev() {
            match mark {
                Some(mark) => self.marks.insert(particle, mark),
                None => self.marks.remove(&particle),
            };
        }
        if let Some(news) = &mut self.news {
            news.clear();
        }
    }

    /// What changed since the last call, by particle.
    pub(crate) fn take_news(&mut self) -> Vec<(ParticleId, Mark)> {
        let mut news = self.news.as_mut().map(std::mem::take).unwrap_or_default();
        news.sort_unstable();
        news.dedup();
        news.into_iter().map(|p| (p, self.marks[&p])).collect()
    }

    /// Forgets the particles that the blade has left, and returns them ascending.
    pub(crate) fn leave(&mut self, has_left: impl Fn(ParticleId) -> bool) -> Vec<ParticleId> {
        let all = self.marks.keys().copied();
        let mut left: Vec<ParticleId> = all.filter(|p| has_left(*p)).collect();
        left.sort_unstable();
        for particle in &left {
            self.marks.remove(particle);
        }
        left
    }

    /// Takes over what an earlier stroke of the same surface knew of a particle, if nothing contrary is known;
    /// `same_orientation` says whether their positive sides are the same. Returns whether the particle came to lie on the
    /// surface by it.
    pub(crate) fn adopt(
        &mut self,
        particle: ParticleId,
        mut mark: Mark,
        same_orientation: bool,
    ) -> bool {
        if self.marks.contains_key(&particle) {
            return false;
        }
        if !same_orientation {
            mark.tangent = mark.tangent.map(|t| Tangent {
                normal: -t.normal,
                ..t
            });
            if let Seen::On(side) = &mut mark.seen {
                *side = !*side;
            }
        }
        mark.adopted = true;
        self.journal.push((particle, None));
        self.marks.insert(particle, mark);
        mark.tangent.is_some()
    }

    /// Puts a particle on the surface.
    pub(crate) fn put(&mut self, particle: ParticleId, tangent: Tangent) {
        let mark = self.edit(particle);
        mark.tangent = Some(tangent);
        mark.decided = true;
    }

    /// Notes that a particle is on the given side of the surface.
    pub(crate) fn see(&mut self, particle: ParticleId, side: bool) {
        let seen = &mut self.edit(particle).seen;
        *seen = match *seen {
            Seen::Never => Seen::On(side),
            Seen::On(before) if before == side => Seen::On(side),
            _ => Seen::Both,
        };
    }

    /// Whether a particle was seen on both sides.
    pub(crate) fn is_seen_on_both(&self, particle: ParticleId) -> bool {
        self.marks
            .get(&particle)
            .is_some_and(|mark| mark.seen == Seen::Both)
    }

    /// The side that a particle was always seen on.
    pub(crate) fn seen(&self, particle: ParticleId) -> Option<bool> {
        match self.marks.get(&particle)?.seen {
            Seen::On(side) => Some(side),
            _ => None,
        }
    }

    /// Gives the copies that a cut made what their particles remember.
    pub(crate) fn copy(&mut self, delta: &CutDelta) {
        let first = delta.particles_before + delta.points.len();
        for (i, source) in delta.copies.iter().enumerate() {
            if let Some(&mark) = self.marks.get(source) {
                *self.edit(ParticleId::new(first + i)) = mark;
            }
        }
    }

    /// Follows a cut made by another stroke. A new particle between two on the surface is on it as well, and so is one
    /// beside it that is closer than `reach` times the edge: it may lie behind the front, where no blade will come by.
    pub(crate) fn apply_delta(&mut self, delta: &CutDelta, rest: &[DVec3], reach: f64) {
        for (i, point) in delta.points.iter().enumerate() {
            let particle = ParticleId::new(delta.particles_before + i);
            let tangents = point.ends.map(|p| self.tangent(p));
            if let Some(tangent) = Self::between(tangents, point.ends, particle, rest, reach) {
                self.put(particle, tangent);
            }
        }
        self.copy(delta);
    }

    /// The surface at a new particle on an edge whose ends have the given tangents, if it lies on the surface.
    pub(crate) fn between(
        tangents: [Option<Tangent>; 2],
        ends: [ParticleId; 2],
        particle: ParticleId,
        rest: &[DVec3],
        reach: f64,
    ) -> Option<Tangent> {
        let point = rest[particle.index()];
        let [a, b] = ends.map(|p| rest[p.index()]);
        match tangents {
            [Some(a), Some(b)] => Some(Tangent {
                point,
                normal: (a.normal + b.normal).normalize_or(a.normal),
            }),
            [Some(t), None] | [None, Some(t)] => {
                (t.distance(point).abs() <= reach * a.distance(b)).then_some(t)
            }
            [None, None] => None,
        }
    }

    /// How much a face lies along the surface: the cosine of the angle between them, and less than that of any face on
    /// the surface for one with a particle off it.
    pub(crate) fn alignment(&self, rest: &[DVec3], face: [ParticleId; 3]) -> f64 {
        let [Some(a), Some(b), Some(c)] = face.map(|p| self.tangent(p)) else {
            return -1.0;
        };
        let [x, y, z] = face.map(|p| rest[p.index()]);
        let (across, along) = ((y - x).cross(z - x), a.normal + b.normal + c.normal);
        across.dot(along).abs() / (across.length() * along.length())
    }

    /// The side of a tet that touches the surface: the one its particles off the surface were seen on if they agree,
    /// else the one they, or without any the whole tet, lean to by the tangents of those on the surface.
    pub(crate) fn side(&self, rest: &[DVec3], corners: [ParticleId; 4]) -> bool {
        let marks = corners.map(|p| self.marks.get(&p).copied().unwrap_or_default());
        let off = || marks.iter().zip(corners).filter(|m| m.0.tangent.is_none());
        let vote = |mark: &Mark| match mark.seen {
            Seen::On(true) => 1,
            Seen::On(false) => -1,
            _ => 0,
        };
        let votes: i32 = off().map(|(mark, _)| vote(mark)).sum();
        if votes != 0 {
            return votes > 0;
        }
        let leaning = |p: ParticleId| {
            let tangents = marks.iter().filter_map(|mark| mark.tangent);
            tangents.map(|t| t.distance(rest[p.index()])).sum::<f64>()
        };
        let all = || corners.into_iter().map(leaning).sum::<f64>();
        let off_it: f64 = off().map(|(_, p)| leaning(p)).sum();
        let [a, b, c, d] = corners.map(|p| rest[p.index()]);
        let size = (b - a).length().max((c - a).length()).max((d - a).length());
        // Particles can lie in the surface and not be known to: then only the whole tet says more than rounding does.
        let leans = if off_it.abs() > IN_SURFACE * size {
            off_it
        } else {
            all()
        };
        leans >= 0.0
    }
}
