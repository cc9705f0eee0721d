//! [`SweptSurface`]: what the particles on a swept surface remember of it.
//!
//! A sweep has no plane to give every particle a sign. Instead the ends of each edge that was met know on which side
//! they were, and each particle on the surface keeps the surface's tangent plane where it was crossed, in the rest
//! shape, where nothing moves any more. The tangents give the side where no end can (or where a stroke that came back
//! gave it twice), and tell beforehand which particles the surface will pass closely.

use glam::DVec3;
use incise_mesh::ParticleId;

use crate::CutDelta;

/// The tangent plane of the swept surface at a crossing, in the rest shape.
#[derive(Clone, Copy, Debug)]
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

/// The particles on a swept surface.
#[derive(Clone, Debug)]
pub(crate) struct SweptSurface {
    /// For each particle the index of its plane, if it is on the surface.
    index: Vec<Option<u32>>,
    tangents: Vec<Tangent>,
    /// For each particle the side it was seen on.
    seen: Vec<Seen>,
}

/// On which side of the surface a particle was when one of its edges was met.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Seen {
    #[default]
    Never,
    On(bool),
    Both,
}

impl SweptSurface {
    pub(crate) fn new(particles: usize) -> Self {
        Self {
            index: vec![None; particles],
            tangents: Vec::new(),
            seen: vec![Seen::Never; particles],
        }
    }

    pub(crate) fn contains(&self, particle: ParticleId) -> bool {
        self.index[particle.index()].is_some()
    }

    pub(crate) fn tangent(&self, particle: ParticleId) -> Option<Tangent> {
        self.index[particle.index()].map(|i| self.tangents[i as usize])
    }

    pub(crate) fn put(&mut self, particle: ParticleId, tangent: Tangent) {
        self.index[particle.index()] = u32::try_from(self.tangents.len()).ok();
        self.tangents.push(tangent);
    }

    /// Appends a particle that lies on the surface.
    pub(crate) fn push(&mut self, tangent: Tangent) {
        let particle = ParticleId::new(self.index.len());
        self.index.push(None);
        self.seen.push(Seen::Never);
        self.put(particle, tangent);
    }

    /// Notes that a particle is on the given side of the surface.
    pub(crate) fn see(&mut self, particle: ParticleId, side: bool) {
        let seen = &mut self.seen[particle.index()];
        *seen = match *seen {
            Seen::Never => Seen::On(side),
            Seen::On(before) if before == side => Seen::On(side),
            _ => Seen::Both,
        };
    }

    /// Whether a particle was seen on both sides.
    pub(crate) fn is_seen_on_both(&self, particle: ParticleId) -> bool {
        self.seen[particle.index()] == Seen::Both
    }

    /// Appends the copies of particles.
    pub(crate) fn push_copies(&mut self, sources: &[ParticleId]) {
        for source in sources {
            self.index.push(self.index[source.index()]);
            self.seen.push(self.seen[source.index()]);
        }
    }

    /// Follows a cut made by another stroke. A new particle between two on the surface is on it as well, and so is one
    /// beside it that is closer than `reach` times the edge: it may lie behind the front, where no blade will come by.
    pub(crate) fn follow(&mut self, delta: &CutDelta, rest: &[DVec3], reach: f64) {
        for point in &delta.points {
            let here = rest[self.index.len()];
            let [a, b] = point.ends.map(|p| self.tangent(p));
            let length = rest[point.ends[0].index()].distance(rest[point.ends[1].index()]);
            let close = |t: &Tangent| t.distance(here).abs() <= reach * length;
            match (a, b) {
                (Some(a), Some(b)) => {
                    self.push(Tangent {
                        point: here,
                        normal: (a.normal + b.normal).normalize_or(a.normal),
                    });
                }
                (Some(t), None) | (None, Some(t)) if close(&t) => self.push(t),
                _ => {
                    self.index.push(None);
                    self.seen.push(Seen::Never);
                }
            }
        }
        self.push_copies(&delta.copies);
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
        let off = || corners.into_iter().filter(|&p| !self.contains(p));
        let vote = |p: ParticleId| match self.seen[p.index()] {
            Seen::On(true) => 1,
            Seen::On(false) => -1,
            _ => 0,
        };
        let votes: i32 = off().map(vote).sum();
        if votes != 0 {
            return votes > 0;
        }
        let leaning = |p: ParticleId| {
            let tangents = corners.iter().filter_map(|&q| self.tangent(q));
            tangents.map(|t| t.distance(rest[p.index()])).sum::<f64>()
        };
        let leans: f64 = if off().next().is_some() {
            off().map(leaning).sum()
        } else {
            corners.into_iter().map(leaning).sum()
        };
        leans >= 0.0
    }
}
