//! [`FreshPairs`]: contact across a fresh cut, known from who was copied from whom.
//!
//! When a cut opens an inner face, its two sides become triangles of the boundary at the same place: twins. The
//! particles at a corner of both are copies of one another, or still one and the same at the front of a running cut.
//! Two different ones are a pair, whose contact needs no search:
//!
//! `C = n · (x_b − x_a) ≥ 0`, `n = unit(N_a − N_b)`,
//!
//! where `N_a` and `N_b` are the sums of the outward area vectors of the twins on either side that have the pair as a
//! corner. Only these: the outer skin would tilt the normal at the rim, and where cuts cross, other sides would. The
//! normal is no difference of positions, so it is well defined at a gap of exactly 0, which each cut starts with.
//!
//! Where cuts cross, a particle has several copies; only those that share twins are paired, never all with all. A cut
//! that splits both sides of an earlier one at the same places leaves parts that are twins again. A pair ends when the
//! sides have slid apart by a quarter of an edge (or half the way out of the triangles around it), when they fold, or when a
//! later cut took its faces. It does not come back: from then on the search takes care of both particles. A pair whose
//! sides the frame does not bring together sleeps: it is left out of the list, and is there again when they come close. So
//! does a pair within a piece while a tet at one of its particles is inverted: it would hold that tet inverted.
//!
//! Cost: a delta costs what the boundary lost and gained; an update is a pass over the twins.

use glam::DVec3;
use incise_cutting::{CutDelta, CuttableMesh};
use incise_mesh::{ParticleId, TetId};

use crate::ContactError;
use crate::index::{NONE, index};
use crate::surface::{ContactSurface, SurfaceChange, is_cut};

/// A pair ends when its sides have slid by this fraction of an edge.
const OF_EDGE: f64 = 0.25;
/// A pair ends when its sides have slid by this fraction of the way out of the triangles around it.
const OF_HEIGHT: f64 = 0.5;
/// A pair ends where `|N_a − N_b|` falls below this fraction of `|N_a| + |N_b|`.
const FOLDED: f64 = 0.5;

/// Points on the same edge of both sides of a cut are one if their parameters differ by at most this.
const SAME_PARAMETER: f64 = 0.05;

/// A contact of two particles that were one before a cut: `normal · (x₁ − x₀) ≥ 0`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PairContact {
    /// The particles.
    pub particles: [u32; 2],
    /// Unit length, from the side of the first one into that of the second.
    pub normal: DVec3,
}

impl PairContact {
    /// The distance of the sides along the normal in m, negative where they overlap.
    ///
    /// # Panics
    /// If a particle has no position.
    #[must_use]
    pub fn gap(&self, positions: &[DVec3]) -> f64 {
        let [a, b] = self.particles.map(|p| positions[p as usize]);
        self.normal.dot(b - a)
    }
}

/// Two triangles that were one inner face.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Twin {
    slots: [u32; 2],
    /// For each corner of the first the corner of the second at the same place.
    partner: [u8; 3],
    /// For each corner of the first the pair, if its particles differ.
    pairs: [u32; 3],
}

/// Two particles at a corner of twins.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Pair {
    /// The smaller number first.
    particles: [u32; 2],
    /// The number of twins with it as a corner; 0 if this place is free.
    twins: u32,
    /// How far its sides may slide in m, the least that one of its twins allowed.
    largest_slide: f64,
    is_retired: bool,
    /// For each of the particles the next end of its list.
    next: [u32; 2],
}

/// The twins and pairs of all cuts.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FreshPairs {
    twins: Vec<Twin>,
    /// By slot of the surface, [`NONE`] or past the end without one.
    twin_of_slot: Vec<u32>,
    pairs: Vec<Pair>,
    vacant: Vec<u32>,
    /// By particle the first end of its list; end `k` of pair `i` is `2 i + k`. [`NONE`] or past the end without one.
    head: Vec<u32>,
    /// By pair the sums of the area vectors of both sides: room for an update.
    #[cfg_attr(feature = "serde", serde(skip))]
    areas: Vec<[DVec3; 2]>,
}

impl FreshPairs {
    /// The number of pairs that have not ended, those that sleep included. O(pairs).
    #[must_use]
    pub fn count(&self) -> usize {
        self.iter().count()
    }

    /// The particles of the pairs that have not ended, smaller number first.
    pub fn iter(&self) -> impl Iterator<Item = [ParticleId; 2]> + '_ {
        let live = self.pairs.iter().filter(|pair| pair.is_live());
        live.map(|pair| pair.particles.map(ParticleId))
    }

    /// The particles that a particle is paired with.
    pub fn partners(&self, particle: ParticleId) -> impl Iterator<Item = ParticleId> + '_ {
        let ends = self.ends(particle.0);
        let live = ends.filter(|(pair, _)| self.pairs[*pair as usize].is_live());
        live.map(|(pair, end)| ParticleId(self.pairs[pair as usize].particles[1 - end]))
    }

    /// The pairs of a particle and which end it is.
    fn ends(&self, particle: u32) -> impl Iterator<Item = (u32, usize)> + '_ {
        let mut end = self.head.get(particle as usize).copied().unwrap_or(NONE);
        std::iter::from_fn(move || {
            let here = (end != NONE).then_some(end)?;
            let (pair, side) = (here / 2, (here % 2) as usize);
            end = self.pairs[pair as usize].next[side];
            Some((pair, side))
        })
    }

    pub(crate) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Applies what a delta did to the surface.
    pub(crate) fn apply_delta(
        &mut self,
        mesh: &CuttableMesh,
        surface: &ContactSurface,
        delta: &CutDelta,
        change: &SurfaceChange,
    ) {
        self.resize(surface);
        self.split_twins(mesh, surface, delta, change);
        let relinked = |tet: TetId| delta.relinked.binary_search_by_key(&tet, |r| r.tet).is_ok();
        for &(slot, tet, opposite) in &change.removed {
            // A whole tet that hangs on copies keeps its faces, with other corners.
            let again = relinked(tet).then(|| surface.slot_of(delta.slot_after(tet), opposite));
            self.replace(mesh, surface, slot, again.flatten(), change.first_added);
        }
        // Faces that were one before the delta have the same corners then.
        let added = change.first_added..index(surface.slot_count());
        let cut = added.filter(|&slot| is_cut(surface.triangle(slot)));
        let faces = cut.map(|slot| {
            let mut originals = surface.triangle(slot).particles.map(|p| original(delta, p));
            originals.sort_unstable();
            (originals, slot)
        });
        let mut faces: Vec<([ParticleId; 3], u32)> = faces.collect();
        faces.sort_unstable();
        for same in faces.chunk_by(|one, other| one.0 == other.0) {
            let [(_, one), (_, other)] = *same else {
                continue;
            };
            let [first, second] = [one, other]
                .map(|slot| surface.triangle(slot).particles.map(|p| original(delta, p)));
            let is_new = [one, other].map(|slot| self.twin_of_slot[slot as usize] == NONE);
            let place = |p: ParticleId| second.iter().position(|q| *q == p);
            if let Some(partner) = opposite(first.map(place)).filter(|_| is_new == [true; 2]) {
                self.add_twin(mesh, surface, [one, other], partner);
            }
        }
    }

    /// Makes twins of the parts of twins of which a delta split a side or both, where the parts are at the same places.
    fn split_twins(
        &mut self,
        mesh: &CuttableMesh,
        surface: &ContactSurface,
        delta: &CutDelta,
        change: &SurfaceChange,
    ) {
        let is_split = |tet: TetId| delta.removed.binary_search_by_key(&tet, |r| r.tet).is_ok();
        let mut split: Vec<u32> = Vec::new();
        for &(slot, tet, _) in &change.removed {
            let twin = self.twin_of_slot[slot as usize];
            if twin != NONE && is_split(tet) {
                split.push(twin);
            }
        }
        if split.is_empty() {
            return;
        }
        // From the last on, so that the others keep their places while these are removed.
        split.sort_unstable_by(|one, other| other.cmp(one));
        split.dedup();
        let parts = Parts::new(surface, delta, change);
        for twin in split {
            let old = self.twins[twin as usize];
            let [first, second] = old.slots.map(|slot| *surface.triangle(slot));
            // The corners of the second in the order of their partners.
            let partners = old.partner.map(|k| second.particles[usize::from(k)]);
            let [firsts, seconds] = old.slots.map(|slot| parts.of(surface, delta, slot));
            for &one in &firsts {
                let Some(places) = places(surface, delta, one, first.particles) else {
                    continue;
                };
                let found = seconds.iter().find_map(|&other| {
                    let others = self::places(surface, delta, other, partners)?;
                    let place = |at: FacePlace| others.iter().position(|o| o.is_same(&at));
                    opposite(places.map(place)).map(|partner| (other, partner))
                });
                if let Some((other, partner)) = found {
                    self.add_twin(mesh, surface, [one, other], partner);
                }
            }
            // Only now, so that pairs at its corners keep what is known of them.
            self.remove_twin(twin);
        }
    }

    /// Applies what undoing a delta did to the surface.
    pub(crate) fn undo_delta(
        &mut self,
        mesh: &CuttableMesh,
        surface: &ContactSurface,
        delta: &CutDelta,
        change: &SurfaceChange,
    ) {
        self.resize(surface);
        for &(slot, tet, opposite) in &change.removed {
            let moved = delta.moved.binary_search_by_key(&tet, |moved| moved.to);
            let before = moved.map_or(tet, |i| delta.moved[i].from);
            let relinked = delta.relinked.binary_search_by_key(&before, |r| r.tet);
            let again = relinked
                .ok()
                .and_then(|_| surface.slot_of(before, opposite));
            self.replace(mesh, surface, slot, again, change.first_added);
        }
        self.head.truncate(delta.particles_before);
    }

    fn resize(&mut self, surface: &ContactSurface) {
        self.twin_of_slot.resize(surface.slot_count(), NONE);
    }

    /// Gives a removed triangle's place in its twin to the one that took its place, or ends the twin.
    fn replace(
        &mut self,
        mesh: &CuttableMesh,
        surface: &ContactSurface,
        slot: u32,
        again: Option<u32>,
        first_added: u32,
    ) {
        let twin = self.twin_of_slot[slot as usize];
        if twin == NONE {
            return;
        }
        let Some(again) = again.filter(|&again| again >= first_added) else {
            self.remove_twin(twin);
            return;
        };
        self.twin_of_slot[slot as usize] = NONE;
        self.twin_of_slot[again as usize] = twin;
        let at = &mut self.twins[twin as usize];
        let side = usize::from(at.slots[1] == slot);
        at.slots[side] = again;
        for corner in 0..3 {
            let Twin { pairs, .. } = self.twins[twin as usize];
            let now = self.corner(surface, twin, corner);
            let before = pairs[corner];
            let known = (before != NONE).then(|| self.pairs[before as usize].particles);
            if known != now {
                let slot = self.twins[twin as usize].slots[0];
                let slide = largest_slide(mesh, surface, slot, corner);
                let pair = now.map_or(NONE, |particles| self.add_pair(particles, slide));
                self.twins[twin as usize].pairs[corner] = pair;
                if before != NONE {
                    self.release(before);
                }
            }
        }
    }

    /// The particles at a corner of a twin, smaller number first, if they differ.
    fn corner(&self, surface: &ContactSurface, twin: u32, corner: usize) -> Option<[u32; 2]> {
        let Twin { slots, partner, .. } = self.twins[twin as usize];
        let [first, second] = slots.map(|slot| surface.triangle(slot).particles);
        let (a, b) = (first[corner].0, second[usize::from(partner[corner])].0);
        (a != b).then(|| [a.min(b), a.max(b)])
    }

    fn add_twin(
        &mut self,
        mesh: &CuttableMesh,
        surface: &ContactSurface,
        slots: [u32; 2],
        partner: [u8; 3],
    ) {
        let twin = index(self.twins.len());
        self.twins.push(Twin {
            slots,
            partner,
            pairs: [NONE; 3],
        });
        for corner in 0..3 {
            if let Some(particles) = self.corner(surface, twin, corner) {
                let slide = largest_slide(mesh, surface, slots[0], corner);
                self.twins[twin as usize].pairs[corner] = self.add_pair(particles, slide);
            }
        }
        for slot in slots {
            self.twin_of_slot[slot as usize] = twin;
        }
    }

    fn remove_twin(&mut self, twin: u32) {
        let last = index(self.twins.len() - 1);
        let Twin { slots, pairs, .. } = self.twins.swap_remove(twin as usize);
        // A slot may belong to a newer twin already.
        for slot in slots {
            if self.twin_of_slot[slot as usize] == twin {
                self.twin_of_slot[slot as usize] = NONE;
            }
        }
        for pair in pairs.into_iter().filter(|&pair| pair != NONE) {
            self.release(pair);
        }
        if let Some(moved) = self.twins.get(twin as usize) {
            for slot in moved.slots {
                if self.twin_of_slot[slot as usize] == last {
                    self.twin_of_slot[slot as usize] = twin;
                }
            }
        }
    }

    /// The pair of two particles, smaller number first, with one more twin.
    fn add_pair(&mut self, particles: [u32; 2], largest_slide: f64) -> u32 {
        let known = self
            .ends(particles[0])
            .find(|(pair, _)| self.pairs[*pair as usize].particles == particles);
        if let Some((pair, _)) = known {
            let pair_of = &mut self.pairs[pair as usize];
            pair_of.twins += 1;
            pair_of.largest_slide = pair_of.largest_slide.min(largest_slide);
            return pair;
        }
        let largest = particles[1] as usize;
        if self.head.len() <= largest {
            self.head.resize(largest + 1, NONE);
        }
        let pair = Pair {
            particles,
            twins: 1,
            largest_slide,
            is_retired: false,
            next: particles.map(|p| self.head[p as usize]),
        };
        let place = self.vacant.pop().unwrap_or_else(|| {
            self.pairs.push(pair);
            index(self.pairs.len() - 1)
        });
        self.pairs[place as usize] = pair;
        for (end, particle) in (0..).zip(particles) {
            self.head[particle as usize] = 2 * place + end;
        }
        place
    }

    /// Takes a twin from a pair, which goes with its last one.
    fn release(&mut self, pair: u32) {
        let at = &mut self.pairs[pair as usize];
        at.twins -= 1;
        if at.twins > 0 {
            return;
        }
        let Pair {
            particles, next, ..
        } = *at;
        for (end, particle) in (0..).zip(particles) {
            let gone = 2 * pair + end;
            let mut before = NONE;
            let mut here = self.head[particle as usize];
            while here != gone {
                before = here;
                here = self.pairs[here as usize / 2].next[here as usize % 2];
            }
            if before == NONE {
                self.head[particle as usize] = next[end as usize];
            } else {
                self.pairs[before as usize / 2].next[before as usize % 2] = next[end as usize];
            }
        }
        self.vacant.push(pair);
    }

    /// Follows [`ContactSurface::compact`]: `slots` are the new ones by the old.
    pub(crate) fn renumber(&mut self, surface: &ContactSurface, slots: &[u32]) {
        self.twin_of_slot.clear();
        self.resize(surface);
        for (i, twin) in (0..).zip(&mut self.twins) {
            twin.slots = twin.slots.map(|slot| slots[slot as usize]);
            for slot in twin.slots {
                self.twin_of_slot[slot as usize] = i;
            }
        }
    }

    /// Ends the pairs that have slid apart or folded, for whose particles it calls `retire`, and lists the others that are
    /// to be held by their particles and their gap, ascending by their numbers.
    pub(crate) fn evaluate(
        &mut self,
        surface: &ContactSurface,
        positions: &[DVec3],
        is_held: impl Fn([u32; 2], f64) -> bool,
        mut retire: impl FnMut([u32; 2]),
        list: &mut Vec<PairContact>,
    ) {
        list.clear();
        self.areas.clear();
        self.areas.resize(self.pairs.len(), [DVec3::ZERO; 2]);
        for twin in &self.twins {
            if twin.pairs == [NONE; 3] {
                continue;
            }
            let sides = twin.slots.map(|slot| surface.area(slot, positions));
            let first = surface.triangle(twin.slots[0]).particles;
            for (particle, &pair) in first.iter().zip(&twin.pairs) {
                if pair != NONE {
                    let is_first = self.pairs[pair as usize].particles[0] == particle.0;
                    let [a, b] = &mut self.areas[pair as usize];
                    *a += sides[usize::from(!is_first)];
                    *b += sides[usize::from(is_first)];
                }
            }
        }
        for (pair, [a, b]) in self.pairs.iter_mut().zip(&self.areas) {
            if !pair.is_live() {
                continue;
            }
            let across = *a - *b;
            let length = across.length();
            let normal = across / length;
            let [from, to] = pair.particles.map(|p| positions[p as usize]);
            let gap = normal.dot(to - from);
            let slide = (to - from - normal * gap).length();
            let is_folded = length < FOLDED * (a.length() + b.length());
            // Not a number where all areas are 0.
            let holds = slide < pair.largest_slide && !is_folded;
            if !holds {
                pair.is_retired = true;
                retire(pair.particles);
            } else if is_held(pair.particles, gap) {
                list.push(PairContact {
                    particles: pair.particles,
                    normal,
                });
            }
        }
    }

    /// Compares the lists with what they are made of. O(twins) and a little more.
    pub(crate) fn check(&self, surface: &ContactSurface) -> Result<(), ContactError> {
        let differs = |what: String| Err(ContactError::Differs(what));
        let mut counts = vec![0; self.pairs.len()];
        for (i, twin) in (0..).zip(&self.twins) {
            for slot in twin.slots {
                if !surface.is_alive(slot) || self.twin_of_slot[slot as usize] != i {
                    return differs(format!("twin {i} has lost its triangle {slot}"));
                }
            }
            for corner in 0..3 {
                let pair = twin.pairs[corner];
                let known = (pair != NONE).then(|| self.pairs[pair as usize].particles);
                if known != self.corner(surface, i, corner) {
                    return differs(format!("twin {i} has a wrong pair at corner {corner}"));
                }
                if pair != NONE {
                    counts[pair as usize] += 1;
                }
            }
        }
        let held = self.twin_of_slot.iter().filter(|&&twin| twin != NONE);
        if held.count() != 2 * self.twins.len() {
            return differs("triangles have twins that do not exist".to_owned());
        }
        let mut ends = 0;
        for (particle, _) in (0..).zip(&self.head) {
            for (pair, end) in self.ends(particle) {
                ends += 1;
                if self.pairs[pair as usize].particles[end] != particle {
                    return differs(format!("particle {particle} has the pair of another"));
                }
            }
        }
        let used = counts.iter().filter(|&&count| count > 0).count();
        if counts
            .iter()
            .zip(&self.pairs)
            .any(|(count, pair)| *count != pair.twins)
            || ends != 2 * used
            || self.vacant.len() + used != self.pairs.len()
        {
            return differs("the pairs are counted wrong".to_owned());
        }
        Ok(())
    }
}

impl Pair {
    fn is_live(&self) -> bool {
        self.twins > 0 && !self.is_retired
    }
}

/// What has become of triangles of cuts in a delta.
struct Parts {
    /// The new ones by the tet that theirs is a part of, ascending.
    by_parent: Vec<(TetId, u32)>,
    first_added: u32,
}

impl Parts {
    fn new(surface: &ContactSurface, delta: &CutDelta, change: &SurfaceChange) -> Self {
        let mut parents: Vec<(TetId, TetId)> = delta
            .added
            .iter()
            .map(|a| (delta.slot_after(a.tet), a.parent))
            .collect();
        parents.sort_unstable();
        let mut by_parent: Vec<(TetId, u32)> = Vec::new();
        for slot in change.first_added..index(surface.slot_count()) {
            let triangle = surface.triangle(slot);
            let parent = parents.binary_search_by_key(&triangle.tet, |p| p.0);
            if let Some(parent) = parent.ok().filter(|_| is_cut(triangle)) {
                by_parent.push((parents[parent].1, slot));
            }
        }
        by_parent.sort_unstable();
        Self {
            by_parent,
            first_added: change.first_added,
        }
    }

    /// The new slots that may be parts of the triangle that a slot held before the delta: itself if nothing happened to
    /// it, its tet's face again if that only hangs on copies, else the faces of the tets its own was split into.
    fn of(&self, surface: &ContactSurface, delta: &CutDelta, slot: u32) -> Vec<u32> {
        if surface.is_alive(slot) {
            return vec![slot];
        }
        let triangle = surface.triangle(slot);
        let is_split = delta.removed.binary_search_by_key(&triangle.tet, |r| r.tet);
        if is_split.is_err() {
            let again = surface.slot_of(delta.slot_after(triangle.tet), triangle.opposite);
            return again
                .filter(|&again| again >= self.first_added)
                .into_iter()
                .collect();
        }
        let from = self.by_parent.partition_point(|part| part.0 < triangle.tet);
        let end = self
            .by_parent
            .partition_point(|part| part.0 <= triangle.tet);
        self.by_parent[from..end]
            .iter()
            .map(|part| part.1)
            .collect()
    }
}

/// A place on a triangle: a corner, or a point on one of its edges.
#[derive(Clone, Copy)]
struct FacePlace {
    /// The ends of the edge as numbers of corners, the lower one first; twice the same for a corner.
    ends: [usize; 2],
    /// Where on the edge.
    parameter: f64,
}

impl FacePlace {
    fn is_same(&self, other: &Self) -> bool {
        self.ends == other.ends && (self.parameter - other.parameter).abs() <= SAME_PARAMETER
    }
}

/// Where the corners of a new triangle lie on one that was split, if it is a part of that.
fn places(
    surface: &ContactSurface,
    delta: &CutDelta,
    slot: u32,
    corners: [ParticleId; 3],
) -> Option<[FacePlace; 3]> {
    let corner = |p: ParticleId| corners.iter().position(|q| *q == p);
    let place = |p: ParticleId| {
        let p = original(delta, p);
        let Some(point) = p.index().checked_sub(delta.particles_before) else {
            let corner = corner(p)?;
            let (ends, parameter) = ([corner; 2], 0.0);
            return Some(FacePlace { ends, parameter });
        };
        let point = &delta.points[point];
        let [from, to] = point.ends.map(corner);
        let (from, to) = (from?, to?);
        Some(if from < to {
            FacePlace {
                ends: [from, to],
                parameter: point.parameter,
            }
        } else {
            FacePlace {
                ends: [to, from],
                parameter: 1.0 - point.parameter,
            }
        })
    };
    let [a, b, c] = surface.triangle(slot).particles.map(place);
    Some([a?, b?, c?])
}

/// The particle that a copy made by the delta was made of, or the particle itself.
fn original(delta: &CutDelta, mut particle: ParticleId) -> ParticleId {
    let first_copy = delta.particles_before + delta.points.len();
    while let Some(copy) = particle.index().checked_sub(first_copy) {
        particle = delta.copies[copy];
    }
    particle
}

/// Which corner of a triangle each corner of another one is, if there is one for each and the two look in opposite
/// directions: what comes after a corner in one comes before it in the other.
fn opposite(corners: [Option<usize>; 3]) -> Option<[u8; 3]> {
    let [a, b, c] = corners;
    let (a, b, c) = (a?, b?, c?);
    ((a + 2) % 3 == b && (b + 2) % 3 == c).then(|| [a, b, c].map(|k| [0, 1, 2][k]))
}

/// How far a particle may slide along a triangle from one of its corners, at rest: at most a quarter of an edge and half of
/// the way out of the triangles around the corner, beyond which the search sees others.
fn largest_slide(mesh: &CuttableMesh, surface: &ContactSurface, slot: u32, corner: usize) -> f64 {
    let corners = surface.triangle(slot).particles;
    let at = |k: usize| mesh.mesh().positions[corners[(corner + k) % 3].index()];
    let (a, b, c) = (at(0), at(1), at(2));
    let mean_edge = (a.distance(b) + b.distance(c) + c.distance(a)) / 3.0;
    let height = (b - a).cross(c - a).length() / b.distance(c);
    (OF_EDGE * mean_edge).min(OF_HEIGHT * height)
}
