//! [`SweptSurface`]: what the particles on a swept surface remember of it.
//!
//! A sweep has no plane to give every particle a sign. Instead the ends of each edge that was met know on which side
//! they were, and each particle on the surface keeps the surface's tangent plane where it was crossed, in the rest
//! shape, where nothing moves any more. The tangents give the side where no end can (or where a stroke that came back
//! gave it twice), and tell beforehand which particles the surface will pass closely.

use glam::DVec3;
use incise_mesh::ParticleId;

use crate::CutDelta;

/// Cosine of the angle up to which a face lies along the surface: about half-way between along and across.
const ALONG: f64 = 0.6;

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

    /// Whether the surface goes through a face: all its particles lie on it, and the tets beside were seen on different
    /// sides. Where they were not (all particles snapped, or a stroke that came back), the face counts as cut if it
    /// lies along the surface rather than across.
    pub(crate) fn cuts(
        &self,
        rest: &[DVec3],
        face: [ParticleId; 3],
        tets: [[ParticleId; 4]; 2],
    ) -> bool {
        let [Some(a), Some(b), Some(c)] = face.map(|p| self.tangent(p)) else {
            return false;
        };
        match tets.map(|tet| self.seen_side(tet)) {
            [Some(one), Some(other)] => one != other,
            _ => {
                let [x, y, z] = face.map(|p| rest[p.index()]);
                let across = (y - x).cross(z - x);
                let along = a.normal + b.normal + c.normal;
                across.dot(along).abs() > ALONG * across.length() * along.length()
            }
        }
    }

    /// The side that the particles of a tet off the surface were seen on, if they agree.
    fn seen_side(&self, corners: [ParticleId; 4]) -> Option<bool> {
        let mut sides = corners
            .into_iter()
            .filter(|&p| !self.contains(p))
            .map(|p| self.seen[p.index()]);
        let first = sides.find(|&seen| seen != Seen::Never)?;
        let agree = sides.all(|seen| seen == first || seen == Seen::Never);
        match first {
            Seen::On(side) if agree => Some(side),
            _ => None,
        }
    }

    /// The side of a tet that touches the surface: the one its particles were seen on, else the one most of it leans
    /// to by the tangents of those on the surface.
    pub(crate) fn side(&self, rest: &[DVec3], corners: [ParticleId; 4]) -> bool {
        self.seen_side(corners).unwrap_or_else(|| {
            let tangents = corners.iter().filter_map(|&p| self.tangent(p));
            let leaning = |t: Tangent| {
                corners
                    .iter()
                    .map(|p| t.distance(rest[p.index()]))
                    .sum::<f64>()
            };
            tangents.map(leaning).sum::<f64>() >= 0.0
        })
    }
}
