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

    /// On which side of the surface a tet lies that touches it: where its particles off the surface were seen, or
    /// else where the tangents of those on the surface say; if all are on the surface, where it leans to.
    pub(crate) fn side(&self, rest: &[DVec3], corners: [ParticleId; 4]) -> bool {
        let off = corners.into_iter().filter(|&p| !self.contains(p));
        let seen: i32 = off
            .clone()
            .map(|p| match self.seen[p.index()] {
                Seen::On(true) => 1,
                Seen::On(false) => -1,
                _ => 0,
            })
            .sum();
        if seen != 0 {
            return seen > 0;
        }
        let leaning = |p: ParticleId| {
            let x = rest[p.index()];
            corners
                .iter()
                .filter_map(|&q| self.tangent(q))
                .map(|t| t.distance(x))
                .sum::<f64>()
        };
        if off.clone().count() == 0 {
            corners.into_iter().map(leaning).sum::<f64>() >= 0.0
        } else {
            off.map(leaning).sum::<f64>() >= 0.0
        }
    }
}
