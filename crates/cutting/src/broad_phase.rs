//! Which tets a moving blade segment can have met: the cheap test before the exact one, and a search that follows the
//! blade.
//!
//! The region a segment sweeps in one frame fits a box along blade, motion and normal. Each particle gets one bit per
//! box face that it lay outside of both at the start and at the end of the frame; since everything moves on straight
//! lines and half-spaces are convex, a tet whose four particles share a bit cannot have been met. The others are near.
//!
//! [`Search`] floods the near tets over the stars of their particles, from those near in the last frame and from those
//! behind boundary triangles whose particles share no bit. It misses no near tet that holds a part of the blade at any
//! time of the frame: take the near tets that hang together with it. All faces around them lie outside of the box
//! during the whole frame, if no seed is among them: the boundary triangles because they are no seeds, the others
//! because the tet behind is not near. So the blade never passes the surface of this region. It was not inside at the
//! start of the frame, since the tets that held it then were near in the last frame and so are seeds; so it never is.
//! Or exactly, since a body that moves may overlap itself: the blade always is in as many positive tets of the region
//! as in inverted ones, that is in none, as long as none is inverted. Where tets are inverted, those found hang
//! together with tets the blade came from.
//!
//! Cost of a frame: how far the particles moved and a test for each box of boundary triangles (see the module `tiles`),
//! then what is near. A scan of all particles and tets happens once, at the first pose, which may lie anywhere in the
//! body.

use glam::DVec3;
use incise_mesh::{Bounds, ParticleId, TetId, TetMesh};

use crate::ccd::MovingSegment;
use crate::delta::FaceTag;
use crate::faces::{Face, TILE};
use crate::parallel;
use crate::tiles::AabbTiles;
use crate::{CutDelta, CuttableMesh};

/// A box along axes of its own.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Slabs {
    axes: [DVec3; 3],
    low: [f64; 3],
    high: [f64; 3],
}

impl Slabs {
    /// The smallest box around points, with a margin.
    pub(crate) fn around(axes: [DVec3; 3], points: &[DVec3], margin: f64) -> Self {
        let along = |axis: DVec3| points.iter().map(move |x| axis.dot(*x));
        Self {
            axes,
            low: axes.map(|axis| along(axis).fold(f64::INFINITY, f64::min) - margin),
            high: axes.map(|axis| along(axis).fold(f64::NEG_INFINITY, f64::max) + margin),
        }
    }

    /// The box around the region a segment sweeps.
    fn swept(blade: &MovingSegment) -> Self {
        let ends = [blade.before[0], blade.before[1], blade.now[0], blade.now[1]];
        let along = (ends[1] - ends[0]).normalize_or(DVec3::X);
        let motion = ends[2] + ends[3] - ends[0] - ends[1];
        let sideways =
            (motion - along * motion.dot(along)).normalize_or(along.any_orthonormal_vector());
        // Rounding and the slack of the exact test.
        let size = ends
            .iter()
            .map(|x| (*x - ends[0]).length() + x.length())
            .fold(0.0, f64::max);
        Self::around([along, sideways, along.cross(sideways)], &ends, 1e-8 * size)
    }

    /// One bit per face that the point lies outside of.
    pub(crate) fn outside(&self, x: DVec3) -> u8 {
        let mut bits = 0;
        for i in 0..3 {
            let along = self.axes[i].dot(x);
            bits |= u8::from(along < self.low[i]) << (2 * i)
                | u8::from(along > self.high[i]) << (2 * i + 1);
        }
        bits
    }
    /// Whether a box along the axes of space lies outside of one face as a whole.
    fn misses(&self, bounds: &Bounds) -> bool {
        // Halved first: the sum could overflow.
        let center = 0.5 * bounds.low + 0.5 * bounds.high;
        let half = 0.5 * bounds.high - 0.5 * bounds.low;
        (0..3).any(|i| {
            let (at, across) = (self.axes[i].dot(center), self.axes[i].abs());
            // More than rounding, in this and in the test of single particles.
            let reach = across.dot(half) + 1e-12 * across.dot(center.abs() + half);
            at + reach < self.low[i] || at - reach > self.high[i]
        })
    }
}

/// A blade segment with the region it sweeps in a frame.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct SweptSegment {
    pub(crate) segment: MovingSegment,
    swept: Slabs,
}

impl SweptSegment {
    pub(crate) fn new(segment: MovingSegment) -> Self {
        let swept = Slabs::swept(&segment);
        Self { segment, swept }
    }

    /// The faces of the region's box that a particle lies outside of.
    fn outside(&self, before: DVec3, now: DVec3) -> u8 {
        self.swept.outside(before) & self.swept.outside(now)
    }

    /// Whether the segment cannot have met an edge.
    pub(crate) fn misses(&self, edge: &MovingSegment) -> bool {
        let bits = self.outside(edge.before[0], edge.now[0]);
        bits != 0 && bits & self.outside(edge.before[1], edge.now[1]) != 0
    }
}

/// The tets that a segment can have met while the particles moved from `before` to `now`, ascending: by a look at all.
fn scan(mesh: &TetMesh, before: &[DVec3], now: &[DVec3], segment: &SweptSegment) -> Vec<TetId> {
    let outside = parallel::map_numbers(now.len(), |p| segment.outside(before[p], now[p]));
    parallel::filter_map_numbers(mesh.tets.len(), |t| {
        let bits = mesh.tets[t].map(|p| outside[p.index()]);
        let near = bits[0] & bits[1] & bits[2] & bits[3] == 0;
        near.then(|| TetId::new(t))
    })
}

/// Particles for each segment of a blade.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Lists {
    particles: Vec<ParticleId>,
    ends: Vec<usize>,
}

impl Lists {
    fn of(&self, segment: usize) -> &[ParticleId] {
        let start = segment.checked_sub(1).map_or(0, |last| self.ends[last]);
        &self.particles[start..self.ends[segment]]
    }

    fn clear(&mut self) {
        self.particles.clear();
        self.ends.clear();
    }
}

/// The state of a search that follows a blade.
///
/// It remembers particles, not tets: what becomes of the tets around a particle, the lists around it tell.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Search {
    /// The particles of the tets near each segment in the last frame.
    known: Lists,
    /// The particles of the tets near each segment in this frame, until [`Search::keep`] takes them over.
    found: Lists,
    /// Particles that came since the last frame, by whatever cut.
    fresh: Vec<ParticleId>,
    tiles: AabbTiles,
    marks: Marks,
    /// Whether to look at all tets in every frame.
    #[cfg(test)]
    pub(crate) everywhere: bool,
}

impl Search {
    /// Looks for a blade in its first pose. O(n), in parallel.
    pub(crate) fn new(mesh: &TetMesh, positions: &[DVec3], blade: &[SweptSegment]) -> Self {
        let mut known = Lists::default();
        for segment in blade {
            let near = scan(mesh, positions, positions, segment);
            let corners = near.iter().flat_map(|tet| mesh.tets[tet.index()]);
            let mut corners: Vec<ParticleId> = corners.collect();
            corners.sort_unstable();
            corners.dedup();
            known.particles.append(&mut corners);
            known.ends.push(known.particles.len());
        }
        Self {
            known,
            found: Lists::default(),
            fresh: Vec::new(),
            tiles: AabbTiles::default(),
            marks: Marks::default(),
            #[cfg(test)]
            everywhere: false,
        }
    }

    /// The tets that one of the segments can have met while the particles moved from `before` to `now`, ascending.
    pub(crate) fn find(
        &mut self,
        cuttable: &CuttableMesh,
        before: &[DVec3],
        now: &[DVec3],
        blade: &[SweptSegment],
    ) -> Vec<TetId> {
        let mut near: Vec<TetId> = Vec::new();
        self.found.clear();
        self.tiles.begin(&cuttable.faces, before, now);
        for (i, segment) in blade.iter().enumerate() {
            self.marks.begin(now.len());
            let mut flood = Flood {
                cuttable,
                marks: &mut self.marks,
                outside: |p: ParticleId| segment.outside(before[p.index()], now[p.index()]),
                corners: &mut self.found.particles,
                near: &mut near,
            };
            let mut next = flood.corners.len();
            let boundary = cuttable.faces.boundary();
            let missed = |bounds: &Bounds| segment.swept.misses(bounds);
            self.tiles.reached(cuttable, now, missed, |tile| {
                flood.enter(boundary.iter().skip(tile * TILE).take(TILE));
            });
            for &seed in self.known.of(i).iter().chain(&self.fresh) {
                // A cut taken back takes its particles along.
                if seed.index() < now.len() {
                    flood.walk(seed);
                }
            }
            while let Some(&particle) = flood.corners.get(next) {
                flood.walk(particle);
                next += 1;
            }
            self.found.ends.push(next);
        }
        #[cfg(test)]
        if self.everywhere {
            let all = blade
                .iter()
                .flat_map(|segment| scan(&cuttable.mesh, before, now, segment));
            near = all.collect();
        }
        near.sort_unstable();
        near.dedup();
        near
    }

    /// Makes what was found last the start of the next search, after the cut it led to.
    pub(crate) fn keep(&mut self, delta: &CutDelta) {
        std::mem::swap(&mut self.known, &mut self.found);
        self.fresh.clear();
        self.apply_delta(delta);
    }

    /// Forgets a frame that did not come to be.
    pub(crate) fn forget(&mut self) {
        self.tiles.clear();
    }

    /// Follows a cut made by whomever.
    pub(crate) fn apply_delta(&mut self, delta: &CutDelta) {
        let new = delta.particles_before..delta.particles_after();
        self.fresh.extend(new.map(ParticleId::new));
    }
}

/// A flood over the near tets of one segment.
struct Flood<'a, O> {
    cuttable: &'a CuttableMesh,
    marks: &'a mut Marks,
    /// The faces of the box that a particle lies outside of.
    outside: O,
    /// The corners of near tets, each once, in the order they were found.
    corners: &'a mut Vec<ParticleId>,
    near: &'a mut Vec<TetId>,
}

impl<O: Fn(ParticleId) -> u8> Flood<'_, O> {
    /// Looks at the tets behind those of the triangles that are near.
    fn enter<'b>(&mut self, triangles: impl Iterator<Item = &'b (Face, FaceTag)>) {
        for (face, _) in triangles {
            let particles = face.particles(&self.cuttable.mesh);
            let bits = particles.map(|p| self.marks.bits(p, &self.outside));
            if bits[0] & bits[1] & bits[2] == 0 {
                self.walk(particles[0]);
            }
        }
    }

    /// Looks at the tets around a particle, if that has not been done.
    fn walk(&mut self, particle: ParticleId) {
        let here = self.marks.bits(particle, &self.outside);
        if !self.marks.set(particle, Marks::WALKED) {
            return;
        }
        for tet in self.cuttable.stars.around(particle) {
            let corners = self.cuttable.mesh.tets[tet.index()];
            let apart = here != 0
                && corners
                    .iter()
                    .fold(here, |bits, &p| bits & self.marks.bits(p, &self.outside))
                    != 0;
            if apart {
                continue;
            }
            // All corners of a near tet are walked, so one of them may count it.
            if corners.iter().all(|&p| particle <= p) {
                self.near.push(tet);
            }
            for p in corners {
                self.marks.bits(p, &self.outside);
                if self.marks.set(p, Marks::CORNER) {
                    self.corners.push(p);
                }
            }
        }
    }
}

/// State of a flood at the particles that it has visited: the number of the flood and eight bits.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Marks {
    flood: u32,
    marks: Vec<u32>,
}

impl Marks {
    /// The lower bits say what the particle lies outside of.
    const OUTSIDE: u8 = (1 << 6) - 1;
    const WALKED: u32 = 1 << 6;
    const CORNER: u32 = 1 << 7;

    /// Forgets all marks.
    fn begin(&mut self, particles: usize) {
        self.marks.resize(particles, 0);
        self.flood += 1 << 8;
        if self.flood == u32::MAX << 8 {
            self.marks.fill(0);
            self.flood = 1 << 8;
        }
    }

    #[inline]
    fn bits(&mut self, particle: ParticleId, outside: impl Fn(ParticleId) -> u8) -> u8 {
        let mark = &mut self.marks[particle.index()];
        if *mark & (u32::MAX << 8) != self.flood {
            *mark = self.flood | u32::from(outside(particle));
        }
        mark.to_le_bytes()[0] & Self::OUTSIDE
    }

    /// Sets a flag of a particle whose bits are known; returns whether it was not set.
    fn set(&mut self, particle: ParticleId, flag: u32) -> bool {
        let mark = &mut self.marks[particle.index()];
        let fresh = *mark & flag == 0;
        *mark |= flag;
        fresh
    }
}

#[cfg(test)]
mod tests;
