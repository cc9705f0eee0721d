//! [`improve`]: takes particles that cuts made out again where the mesh is better or as good without them.
//!
//! Cuts of cuts leave ever smaller tets. A particle that a cut created is merged into a neighbor: the tets around the
//! edge between them go, the others around the particle get the neighbor as their corner. That is done where
//!
//! - the topology stays (link condition of Dey, Edelsbrunner, Guha and Nekhayev 1999, for the mesh with its boundary), so
//!   no pieces are joined or lost;
//! - no tet is inverted or nearly so, neither at rest nor in the present shape;
//! - the smallest sine of a dihedral angle around all that change together grows, or stays above [`GOOD`];
//! - the boundary keeps its shape. Outer faces stay in their planes to rounding. A cut face stays within
//!   [`ImproveOptions::tolerance`] of the faces that its own stroke opened, however often it is moved (module `sheets`). It
//!   moves only together with the face opposite to it on the other side of the cut, so that one side gains what the other
//!   loses and the volume stays to rounding. Where cuts cross, the particles of all parts that meet at a place are
//!   therefore merged at once. A cut face whose other side is different stays in its plane. Rims and corners of cut faces
//!   move along a rim only, the front of an unfinished cut not at all.
//!
//! Where a stroke may be continued, a particle on its surface is merged only into another one on the same sheet: the surface
//! gets fewer particles and stays closed.
//!
//! Where no particle around can be taken out, edges inside of tets with an angle below 5 degrees are flipped (module `flips`) if
//! the worst of the tets around them becomes better.
//!
//! Original particles are never taken out, so the mesh does not become coarser than it was made. Cost: each round looks
//! at the particles around the changes of the round before, each with the tets around it and its neighbors; a call ends
//! after [`ImproveOptions::max_tets`] and leaves the rest to the next one.

use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;
use incise_mesh::{ParticleId, TetId};

use crate::delta::{AddedTet, BoundaryTriangle, CutDelta, FaceTag, RemovedTet};
use crate::faces::{Behind, Face, face_of};
use crate::finite::require_positions;
use crate::flips::Flip;
use crate::quality::{Dihedrals, is_thin, least_sine};
use crate::remove::fill_gaps;
use crate::{CutError, CuttableMesh, StrokeRegistry};

/// Sine of a dihedral angle of 12 degrees. Tets with larger angles only are good enough to be merged into others.
const GOOD: f64 = 0.2;
/// Largest distance of an outer face from its plane, and of a cut face without another side, in edges of a mean tet.
const EXACT: f64 = 1e-10;
/// Smallest cosine between the normals of a face before and after.
const SMOOTH: f64 = 0.5;
/// Largest distance of a particle from the plane of a cut face that is to have it as a corner, in tolerances: from one limit
/// on one side of the stroke's faces to that on the other. A quick test before that of the whole face.
const MOST_BEND: f64 = 2.0;
/// Smallest cosine between the normals of neighboring faces of a cut; where they fold more, the cut ends.
const FRONT: f64 = 0.0;
/// Sine of a dihedral angle of 5 degrees. Edges of tets with a smaller one, or a larger one than 175 degrees, are flipped.
const THIN: f64 = 0.0872;
/// By how much of itself the smallest sine must grow in a flip.
const GAIN: f64 = 1e-6;
/// Particles of which the shortest are taken out first.
const CHUNK: usize = 128;
/// In the present shape a tet must keep this fraction of its volume at rest, or half of the smallest around it.
const PRESENT: f64 = 0.3;

/// Limits of [`improve`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImproveOptions {
    /// Largest distance of a cut face from the faces that its stroke opened, as a fraction of the edge of a regular tet with
    /// the mean volume of the original ones; from 0 to 0.25.
    pub tolerance: f64,
    /// Number of tets to look at after which a call ends; one counts each time its shape is computed, and a cut face each
    /// time it is compared. A call looks at one particle at least.
    pub max_tets: usize,
}

impl Default for ImproveOptions {
    /// Tolerance 0.05, no limit of the work.
    fn default() -> Self {
        Self {
            tolerance: 0.05,
            max_tets: usize::MAX,
        }
    }
}

/// Particles around which a mesh is still to be improved.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ImproveQueue {
    /// Those that no call has looked at. They come first, so that they do not wait for those that come again and again.
    new: Vec<ParticleId>,
    /// Those around which a call has changed something.
    again: Vec<ParticleId>,
    /// Those that stay, and may have thin tets around them.
    thin: Vec<ParticleId>,
}

impl ImproveQueue {
    /// Appends particles, such as the corners of the tets that a stroke created ([`CutDelta::created_particles`]).
    pub fn extend(&mut self, particles: impl IntoIterator<Item = ParticleId>) {
        self.new.extend(particles);
    }

    /// Appends the queue of a mesh that is appended to one with so many particles: see [`CuttableMesh::append`].
    pub fn append(&mut self, other: &Self, particles: usize) {
        let shifted = |p: &ParticleId| ParticleId::new(particles + p.index());
        self.new.extend(other.new.iter().map(shifted));
        self.again.extend(other.again.iter().map(shifted));
        self.thin.extend(other.thin.iter().map(shifted));
    }

    /// Returns whether all work is done.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.new.is_empty() && self.again.is_empty() && self.thin.is_empty()
    }
}

/// Takes out particles that cuts created, from those in `queue` on and wherever a change allows another one, and flips edges
/// of the thin tets that are left.
///
/// # Arguments
/// `positions` are the present positions of the particles. `queue` has the particles to begin with, and afterwards those that
/// the next call is to begin with, none if the work is done. Strokes in `registry` can be continued afterwards. Particles
/// for which `is_locked` is true stay; lock those that something else refers to and those between materials. It is given the
/// mesh in progress, in which tets that stay have their slots from before.
///
/// # Returns
/// A delta in which the tets around the particles taken out are `removed` and `added` with other corners, each its own
/// child, or `deleted`; a flip does the same with the tets around an edge. The particles taken out keep their number and
/// position but have no tet any more. Edges become longer, so that crossings of later cuts may snap further.
///
/// # Errors
/// [`CutError::Improve`] if the tolerance is out of its range; an error if `positions` has another length than the mesh
/// or is not finite. Nothing is changed then.
///
/// # Determinism
/// Equal input gives the same bits on every machine.
///
/// # Example
/// ```
/// use glam::DVec3;
/// use incise_cutting::{
///     CutOptions, CuttableMesh, ImproveOptions, ImproveQueue, Plane, StrokeRegistry, cut_plane, improve,
/// };
/// use incise_mesh::kuhn_box;
///
/// let mut body = CuttableMesh::new(kuhn_box([5; 3], DVec3::ONE))?;
/// let rest = body.mesh().positions.clone();
/// let plane = Plane { point: DVec3::splat(0.43), normal: DVec3::new(1.0, 0.2, 0.1) };
/// let cut = cut_plane(&mut body, &rest, &plane, &CutOptions { snap: 0.0, ..CutOptions::default() })?;
/// let tets = body.mesh().tets.len();
///
/// let rest = body.mesh().positions.clone();
/// let mut queue = ImproveQueue::default();
/// queue.extend(cut.created_particles());
/// let registry = StrokeRegistry::default();
/// let options = ImproveOptions::default();
/// let delta = improve(&mut body, &rest, &mut queue, &options, &registry, |_, _| false)?;
/// assert!(queue.is_empty() && delta.collapsed > 0 && body.mesh().tets.len() < tets);
/// assert_eq!(body.mesh().pieces().count, 2);
/// assert!((body.mesh().total_volume() - 1.0).abs() < 1e-12);
/// # Ok::<(), incise_cutting::CutError>(())
/// ```
pub fn improve(
    cuttable: &mut CuttableMesh,
    positions: &[DVec3],
    queue: &mut ImproveQueue,
    options: &ImproveOptions,
    registry: &StrokeRegistry,
    is_locked: impl Fn(&CuttableMesh, ParticleId) -> bool,
) -> Result<CutDelta, CutError> {
    let _span = tracing::debug_span!("cutting::improve").entered();
    if !(0.0..=0.25).contains(&options.tolerance) {
        return Err(CutError::Improve {
            value: options.tolerance,
        });
    }
    require_positions(cuttable.mesh(), positions)?;
    let edge = cuttable.mean_edge();
    let mut improvement = Improvement {
        exact: EXACT * edge,
        tolerance: options.tolerance * edge,
        cuttable,
        positions,
        registry,
        first: BTreeMap::new(),
        deleted: BTreeSet::new(),
        looked_at: Cell::new(0),
        collapsed: 0,
        flipped: 0,
    };
    improvement.run(queue, options.max_tets, &is_locked);
    Ok(improvement.finish())
}

/// A tet as it was before.
struct Original {
    corners: [ParticleId; 4],
    tags: [Option<FaceTag>; 4],
    /// Whether it has other corners now.
    is_reshaped: bool,
}

/// A boundary triangle at a particle: its other corners, counterclockwise after the particle.
#[derive(Clone, Copy)]
struct FanFace {
    next: [ParticleId; 2],
    tag: FaceTag,
    /// Whether the other side of the cut has this face too.
    is_mirrored: bool,
    /// Whether the coincident face on the other side has the same tag, so that a test of that one is enough.
    is_represented: bool,
}

/// What is around a particle.
struct Star {
    particle: ParticleId,
    /// Ascending.
    tets: Vec<TetId>,
    /// The particles that share a tet with it, ascending.
    neighbors: Vec<ParticleId>,
    /// Its boundary triangles; none inside.
    fan: Vec<FanFace>,
}

impl Star {
    fn of(cuttable: &CuttableMesh, particle: ParticleId) -> Self {
        let mut tets: Vec<TetId> = cuttable.around(particle).collect();
        tets.sort_unstable();
        let corners = tets.iter().flat_map(|tet| cuttable.mesh.tets[tet.index()]);
        let mut neighbors: Vec<ParticleId> = corners.filter(|p| *p != particle).collect();
        neighbors.sort_unstable();
        neighbors.dedup();
        let faces = tets.iter().flat_map(|&tet| Face::of(tet));
        let fan = faces.filter_map(|face| {
            let Behind::Nothing(tag) = cuttable.faces.behind(face) else {
                return None;
            };
            let corners = face.particles(&cuttable.mesh);
            let k = corners.iter().position(|p| *p == particle)?;
            let next = [corners[(k + 1) % 3], corners[(k + 2) % 3]];
            Some(FanFace {
                next,
                tag,
                is_mirrored: false,
                is_represented: false,
            })
        });
        let fan = fan.collect();
        Self {
            particle,
            tets,
            neighbors,
            fan,
        }
    }

    /// Whether the boundary triangles make a single closed fan.
    fn is_single_fan(&self) -> bool {
        let Some(first) = self.fan.first() else {
            return true;
        };
        let (mut at, mut steps) = (first.next[1], 1);
        while at != first.next[0] {
            let mut onward = self.fan.iter().filter(|face| face.next[0] == at);
            let (Some(face), None) = (onward.next(), onward.next()) else {
                return false;
            };
            at = face.next[1];
            steps += 1;
            if steps > self.fan.len() {
                return false;
            }
        }
        steps == self.fan.len()
    }

    /// The other ends of the edges where faces of two kinds meet.
    fn rims(&self) -> Vec<ParticleId> {
        let mut rims = Vec::new();
        for face in &self.fan {
            let before = self.fan.iter().find(|other| other.next[1] == face.next[0]);
            if before.is_none_or(|before| before.tag != face.tag) {
                rims.push(face.next[0]);
            }
        }
        rims
    }

    /// The particles that it may be merged into.
    fn targets(&self) -> Vec<ParticleId> {
        let rims = self.rims();
        if self.fan.is_empty() {
            self.neighbors.clone()
        } else if rims.is_empty() {
            self.fan_neighbors()
        } else {
            rims
        }
    }

    /// The other ends of the edges of the fan, ascending.
    fn fan_neighbors(&self) -> Vec<ParticleId> {
        let mut ends: Vec<ParticleId> = self.fan.iter().map(|face| face.next[0]).collect();
        ends.sort_unstable();
        ends
    }
}

/// The improvement in progress.
struct Improvement<'a> {
    cuttable: &'a mut CuttableMesh,
    positions: &'a [DVec3],
    registry: &'a StrokeRegistry,
    exact: f64,
    tolerance: f64,
    first: BTreeMap<TetId, Original>,
    deleted: BTreeSet<TetId>,
    /// Tets looked at, each time counted.
    looked_at: Cell<usize>,
    collapsed: usize,
    flipped: usize,
}

/// The worst shapes of the tets around a particle.
#[derive(Clone, Copy)]
struct Shape {
    /// The smallest sine of a dihedral angle at rest.
    sine: f64,
    /// The smallest volume now, as a fraction of that at rest.
    scale: f64,
}

/// A particle to be merged into another one.
#[derive(Clone, Copy)]
struct Collapse {
    from: ParticleId,
    to: ParticleId,
}

impl Improvement<'_> {
    fn rest(&self, particle: ParticleId) -> DVec3 {
        self.cuttable.mesh.positions[particle.index()]
    }

    /// The first particle at a particle's place, which stands for the place.
    fn place(&self, particle: ParticleId) -> ParticleId {
        let CuttableMesh { mesh, places, .. } = &*self.cuttable;
        let there = places.at(mesh, self.rest(particle)).min();
        there.unwrap_or(particle).min(particle)
    }

    /// Rounds until one changes nothing or the work is at its limit. Ends, since each merge takes a particle out, and between
    /// two of them each flip makes the ascending list of all sines larger.
    fn run(
        &mut self,
        queue: &mut ImproveQueue,
        max_tets: usize,
        is_locked: &impl Fn(&CuttableMesh, ParticleId) -> bool,
    ) {
        let ImproveQueue { new, again, thin } = std::mem::take(queue);
        let new = BTreeSet::from_iter(new);
        let mut next: BTreeSet<ParticleId> = BTreeSet::from_iter(again);
        next.retain(|particle| !new.contains(particle));
        let mut thin: BTreeSet<ParticleId> = BTreeSet::from_iter(thin);
        let (mut round, mut is_new) = (Vec::from_iter(new).into_iter(), true);
        let mut due: Vec<(f64, ParticleId)> = Vec::new();
        let mut is_over = false;
        while !is_over {
            if round.as_slice().is_empty() {
                is_new = false;
                // Flips last: they change the tets that a merge would take out.
                while next.is_empty()
                    && !is_over
                    && let Some(particle) = thin.pop_first()
                {
                    next.extend(self.flip_around(particle, is_locked));
                    is_over = self.looked_at.get() >= max_tets;
                }
                if next.is_empty() || is_over {
                    break;
                }
                round = Vec::from_iter(std::mem::take(&mut next)).into_iter();
            }
            due.clear();
            for particle in round.by_ref().take(CHUNK) {
                if self.cuttable.is_original(particle) || is_locked(self.cuttable, particle) {
                    continue;
                }
                let mut shortest = f64::INFINITY;
                let tets = self.cuttable.around(particle);
                for neighbor in tets.flat_map(|tet| self.cuttable.mesh.tets[tet.index()]) {
                    if neighbor != particle {
                        let length = self.rest(particle).distance_squared(self.rest(neighbor));
                        shortest = shortest.min(length);
                    }
                }
                if shortest.is_finite() {
                    due.push((shortest, particle));
                }
            }
            due.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            for &(_, particle) in &due {
                if is_over {
                    next.insert(particle);
                    continue;
                }
                let merged = self.take_out(particle, is_locked);
                if merged.is_empty() {
                    thin.insert(particle);
                }
                for to in merged {
                    next.insert(to);
                    next.extend(Star::of(self.cuttable, to).neighbors);
                }
                is_over = self.looked_at.get() >= max_tets;
            }
        }
        let rest = if is_new {
            &mut queue.new
        } else {
            &mut queue.again
        };
        rest.extend(round);
        queue.again.extend(next);
        queue.thin.extend(thin);
    }

    /// Merges a particle into the neighbor with the best result, if there is one. Returns the particles merged into.
    fn take_out(
        &mut self,
        particle: ParticleId,
        is_locked: &impl Fn(&CuttableMesh, ParticleId) -> bool,
    ) -> Vec<ParticleId> {
        let star = Star::of(self.cuttable, particle);
        self.looked_at.set(self.looked_at.get() + star.tets.len());
        // A change of this round may have locked it.
        if is_locked(self.cuttable, particle) || !self.is_movable(&star) {
            return Vec::new();
        }
        // Most particles that must stay are at rims and corners, which is known before their other sides are.
        let mut targets = star.targets();
        targets.retain(|to| self.may_bend(&star, *to, true) && self.keeps_surfaces(&star, *to));
        if targets.is_empty() {
            return Vec::new();
        }
        let mut parts = self.parts(star, is_locked);
        let mut best: Option<(f64, Vec<Collapse>)> = None;
        loop {
            let places = self.places_of(&parts);
            let mut shapes: Vec<Shape> = Vec::new();
            for &to in &targets {
                let Some(collapses) = self.collapses(&parts, &places, to) else {
                    continue;
                };
                if shapes.is_empty() {
                    shapes.extend(parts.iter().map(|part| self.shape(part)));
                    // One part may become worse where the worst of all becomes better.
                    let sines = shapes.iter().map(|shape| shape.sine);
                    let worst = sines.fold(f64::INFINITY, f64::min);
                    shapes.iter_mut().for_each(|shape| shape.sine = worst);
                }
                let least = best.as_ref().map_or(f64::NEG_INFINITY, |(most, _)| *most);
                let mut quality = f64::INFINITY;
                let is_better =
                    parts
                        .iter()
                        .zip(&shapes)
                        .zip(&collapses)
                        .all(|((part, shape), collapse)| {
                            let of_part = self.quality(part, *shape, collapse.to, least);
                            quality = quality.min(of_part.unwrap_or(f64::NEG_INFINITY));
                            of_part.is_some()
                        })
                        && parts
                            .iter()
                            .zip(&collapses)
                            .all(|(part, collapse)| self.keeps_cuts(part, collapse.to));
                if is_better {
                    best = Some((quality, collapses));
                }
            }
            if best.is_some() || parts.len() == 1 {
                break;
            }
            // By itself, if all faces stay in their planes.
            stay_alone(&mut parts);
        }
        let collapses = best.map_or(Vec::new(), |(_, collapses)| collapses);
        for collapse in &collapses {
            self.collapse(*collapse);
        }
        collapses.into_iter().map(|collapse| collapse.to).collect()
    }

    /// Whether a particle has tets, was created by a cut, is at no pinch of the boundary and not where a cut ends.
    fn is_movable(&self, star: &Star) -> bool {
        let is_created = !self.cuttable.is_original(star.particle);
        if star.tets.is_empty() || !is_created || !star.is_single_fan() {
            return false;
        }
        star.fan.iter().all(|face| {
            let before = star.fan.iter().find(|other| other.next[1] == face.next[0]);
            let folds = |before: &FanFace| {
                let at = self.rest(star.particle);
                let [one, other] = [before, face].map(|face| self.normal(at, face));
                one.dot(other) < FRONT * one.length() * other.length()
            };
            let is_inner = |before: &&FanFace| before.tag == face.tag && face.tag != FaceTag::Outer;
            !before.filter(is_inner).is_some_and(folds)
        })
    }

    /// The normal of a boundary triangle with its first corner at a position, with a length of twice the area.
    fn normal(&self, from: DVec3, face: &FanFace) -> DVec3 {
        let [b, c] = face.next.map(|p| self.rest(p));
        (b - from).cross(c - from)
    }

    /// The stars of a particle and of those at its place whose cut faces are the other sides of cut faces around it, of
    /// those of theirs and so on; mirrored faces are marked. Only the first star if one of them must stay.
    fn parts(
        &self,
        star: Star,
        is_locked: &impl Fn(&CuttableMesh, ParticleId) -> bool,
    ) -> Vec<Star> {
        let mut parts = vec![star];
        if parts[0].fan.iter().all(|face| face.tag == FaceTag::Outer) {
            return parts;
        }
        let CuttableMesh { mesh, places, .. } = &*self.cuttable;
        let particle = parts[0].particle;
        let there = places.at(mesh, self.rest(particle));
        let is_live = |p: &ParticleId| self.cuttable.around(*p).next().is_some();
        let mut others: Vec<ParticleId> = there.filter(|p| *p != particle && is_live(p)).collect();
        others.sort_unstable();
        parts.extend(others.into_iter().map(|p| Star::of(self.cuttable, p)));

        // Cut faces by their places, each way round.
        let mut faces: Vec<([ParticleId; 2], bool, usize, usize)> = Vec::new();
        for (i, part) in parts.iter().enumerate() {
            for (k, face) in part.fan.iter().enumerate() {
                if face.tag != FaceTag::Outer {
                    let [a, b] = face.next.map(|p| self.place(p));
                    faces.push(([a.min(b), a.max(b)], a < b, i, k));
                }
            }
        }
        faces.sort_unstable();
        let mut groups: Vec<usize> = (0..parts.len()).collect();
        for same in faces.chunk_by(|x, y| x.0 == y.0) {
            // More than two are faces of more than two parts beside each other.
            if let [(_, false, i, k), (_, true, j, l)] = *same
                && i != j
            {
                parts[i].fan[k].is_mirrored = true;
                parts[j].fan[l].is_mirrored = true;
                parts[j].fan[l].is_represented = parts[i].fan[k].tag == parts[j].fan[l].tag;
                let (keep, drop) = (groups[i].min(groups[j]), groups[i].max(groups[j]));
                groups
                    .iter_mut()
                    .filter(|group| **group == drop)
                    .for_each(|group| *group = keep);
            }
        }
        let mut groups = groups.into_iter();
        parts.retain(|_| groups.next() == Some(0));
        let may_move =
            |part: &Star| self.is_movable(part) && !is_locked(self.cuttable, part.particle);
        if !parts[1..].iter().all(may_move) {
            stay_alone(&mut parts);
        }
        parts
    }

    /// For all parts but the first the particles that theirs may be merged into, each with its place.
    fn places_of(&self, parts: &[Star]) -> Vec<Vec<(ParticleId, ParticleId)>> {
        let places = parts[1..].iter().map(|part| {
            let targets = part.targets().into_iter();
            targets.map(|target| (self.place(target), target)).collect()
        });
        places.collect()
    }

    /// The collapses that merge the particles of all parts at a place into their neighbors at another one, that of a
    /// neighbor of the first; `None` if faces would move that must not, or one would change what is around another.
    fn collapses(
        &self,
        parts: &[Star],
        places: &[Vec<(ParticleId, ParticleId)>],
        to: ParticleId,
    ) -> Option<Vec<Collapse>> {
        let mut targets = vec![to];
        let place = (!places.is_empty()).then(|| self.place(to));
        for of_part in places {
            let mut there = of_part.iter().filter(|(at, _)| Some(*at) == place);
            let (Some((_, target)), None) = (there.next(), there.next()) else {
                return None;
            };
            targets.push(*target);
        }
        let mut collapses: Vec<Collapse> = Vec::with_capacity(parts.len());
        for (part, to) in parts.iter().zip(targets) {
            if !self.may_bend(part, to, false) {
                return None;
            }
            let from = part.particle;
            collapses.push(Collapse { from, to });
        }
        // One must not change what is around another one.
        for (i, part) in parts.iter().enumerate() {
            for (j, other) in collapses.iter().enumerate() {
                let has = |p: ParticleId| part.neighbors.binary_search(&p).is_ok();
                if i != j && (has(other.from) || has(other.to) || other.to == part.particle) {
                    return None;
                }
            }
        }
        Some(collapses)
    }

    /// Whether the faces around a particle may move and turn as they do if it is merged into another one. `is_mirrored`
    /// takes all cut faces for mirrored.
    fn may_bend(&self, star: &Star, to: ParticleId, is_mirrored: bool) -> bool {
        let (at, target) = (self.rest(star.particle), self.rest(to));
        star.fan.iter().all(|face| {
            if face.next.contains(&to) {
                return true;
            }
            let [Some(before), Some(after)] =
                [at, target].map(|from| self.normal(from, face).try_normalize())
            else {
                return false;
            };
            let height = (target - at).dot(before).abs();
            let may_move = face.is_mirrored || (is_mirrored && face.tag != FaceTag::Outer);
            let most = if may_move {
                MOST_BEND * self.tolerance
            } else {
                0.0
            };
            height <= most.max(self.exact) && before.dot(after) >= SMOOTH
        })
    }

    /// Whether the surfaces that strokes have passed and not opened stay if a particle is merged into another one, so that
    /// later strokes can continue there.
    fn keeps_surfaces(&self, star: &Star, to: ParticleId) -> bool {
        let rest = &self.cuttable.mesh.positions;
        let is_cut = |face: &FanFace| face.tag != FaceTag::Outer;
        let ends = [star.particle, to];
        star.fan.iter().any(is_cut) || self.registry.has_on_same_sheets(rest, ends, self.tolerance)
    }

    /// Whether the cut faces around a particle stay within the tolerance of what their strokes opened if it is merged into
    /// another one.
    fn keeps_cuts(&self, star: &Star, to: ParticleId) -> bool {
        if self.keeps_regions(star, to) {
            return true;
        }
        let CuttableMesh { mesh, sheets, .. } = &*self.cuttable;
        star.fan.iter().all(|face| {
            let FaceTag::Cut(stroke) = face.tag else {
                return true;
            };
            if face.next.contains(&to) || face.is_represented {
                return true;
            }
            self.looked_at.set(self.looked_at.get() + 1);
            let corners = [to, face.next[0], face.next[1]].map(|p| self.rest(p));
            sheets.has_near(mesh, stroke, corners, self.tolerance)
        })
    }

    /// Whether the faces of each kind around a particle cover what they covered, to rounding, if it is merged into another
    /// one: all stay in their planes, and the rim between two kinds is straight there.
    fn keeps_regions(&self, star: &Star, to: ParticleId) -> bool {
        let (at, target) = (self.rest(star.particle), self.rest(to));
        let is_level = |face: &FanFace| {
            let normal = self.normal(at, face).normalize_or_zero();
            (target - at).dot(normal).abs() <= self.exact
        };
        let along = (target - at).normalize_or_zero();
        let is_in_line = |end: &ParticleId| {
            let offset = self.rest(*end) - at;
            (offset - along * along.dot(offset)).length() <= self.exact
        };
        star.fan.iter().all(is_level) && star.rims().iter().all(is_in_line)
    }

    /// The shape of the tets around a particle.
    fn shape(&self, star: &Star) -> Shape {
        self.looked_at.set(self.looked_at.get() + star.tets.len());
        let mut shape = Shape {
            sine: f64::INFINITY,
            scale: f64::INFINITY,
        };
        for tet in &star.tets {
            let corners = self.cuttable.mesh.tets[tet.index()];
            let [rest, now] = self.corners(corners);
            shape.sine = shape.sine.min(least_sine(rest));
            shape.scale = shape.scale.min(volume(now) / volume(rest));
        }
        shape
    }

    /// The positions of particles at rest and now.
    fn corners(&self, corners: [ParticleId; 4]) -> [[DVec3; 4]; 2] {
        [
            corners.map(|p| self.rest(p)),
            corners.map(|p| self.positions[p.index()]),
        ]
    }

    /// The smallest sine of a dihedral angle around after a collapse; `None` if it must not be made or this is not more than
    /// `least`.
    fn quality(&self, star: &Star, before: Shape, to: ParticleId, least: f64) -> Option<f64> {
        if before.scale <= 0.0 {
            return None;
        }
        let mesh = &self.cuttable.mesh;
        let scale_limit = PRESENT.min(0.5 * before.scale);
        let (mut after, mut is_empty) = (f64::INFINITY, true);
        for tet in &star.tets {
            let mut corners = mesh.tets[tet.index()];
            if corners.contains(&to) {
                continue;
            }
            is_empty = false;
            for corner in &mut corners {
                if *corner == star.particle {
                    *corner = to;
                }
            }
            self.looked_at.set(self.looked_at.get() + 1);
            let [rest, now] = self.corners(corners);
            after = after.min(least_sine(rest));
            let is_better = after > least && (after >= GOOD || after > before.sine);
            if !is_better || is_thin(rest) || volume(now) < scale_limit * volume(rest) {
                return None;
            }
        }
        (!is_empty && self.keeps_topology(star, to)).then_some(after)
    }

    /// The link condition: what is around both ends is around the edge between them, the boundary taken as one more
    /// particle that has a tet with each boundary triangle.
    fn keeps_topology(&self, star: &Star, to: ParticleId) -> bool {
        let mesh = &self.cuttable.mesh;
        let target = Star::of(self.cuttable, to);
        let from = star.particle;
        let is_around = |tet: &&TetId| mesh.tets[tet.index()].contains(&to);
        let ring: Vec<TetId> = star.tets.iter().filter(is_around).copied().collect();
        // Particles.
        let across = |tet: &TetId| {
            let corners = mesh.tets[tet.index()].into_iter();
            corners.filter(|p| *p != from && *p != to)
        };
        let mut around: Vec<ParticleId> = ring.iter().flat_map(across).collect();
        around.sort_unstable();
        around.dedup();
        if common(&star.neighbors, &target.neighbors) != around {
            return false;
        }
        // Edges and faces.
        let links = |star: &Star| {
            let (mut edges, mut faces) = (Vec::new(), Vec::new());
            for tet in &star.tets {
                let corners = mesh.tets[tet.index()].into_iter();
                let mut others = corners.filter(|p| *p != star.particle);
                let mut face = [0; 3].map(|_: u8| others.next().unwrap_or(star.particle));
                face.sort_unstable();
                edges.extend([[face[0], face[1]], [face[0], face[2]], [face[1], face[2]]]);
                faces.push(face);
            }
            edges.sort_unstable();
            edges.dedup();
            faces.sort_unstable();
            (edges, faces)
        };
        let ((edges, faces), (target_edges, target_faces)) = (links(star), links(&target));
        let mut around: Vec<[ParticleId; 2]> = Vec::new();
        for tet in &ring {
            let mut edge: Vec<ParticleId> = across(tet).collect();
            edge.sort_unstable();
            around.push([edge[0], edge[1]]);
        }
        around.sort_unstable();
        if common(&edges, &target_edges) != around || !common(&faces, &target_faces).is_empty() {
            return false;
        }
        // The boundary.
        if star.fan.is_empty() {
            return true;
        }
        let opposite = |face: &FanFace| match face.next {
            [a, b] if a == to => Some(b),
            [a, b] if b == to => Some(a),
            _ => None,
        };
        let mut around: Vec<ParticleId> = star.fan.iter().filter_map(opposite).collect();
        around.sort_unstable();
        let outline = |star: &Star| {
            let edges = star.fan.iter().map(|face| {
                let [a, b] = face.next;
                [a.min(b), a.max(b)]
            });
            let mut edges: Vec<[ParticleId; 2]> = edges.collect();
            edges.sort_unstable();
            edges
        };
        around.len() == 2
            && common(&star.fan_neighbors(), &target.fan_neighbors()) == around
            && common(&outline(star), &outline(&target)).is_empty()
    }

    /// Flips edges of thin tets around a particle where the worst tet around them becomes better. Returns the corners of
    /// those that changed.
    fn flip_around(
        &mut self,
        particle: ParticleId,
        is_locked: &impl Fn(&CuttableMesh, ParticleId) -> bool,
    ) -> Vec<ParticleId> {
        let mut changed = Vec::new();
        let mut tets: Vec<TetId> = self.cuttable.around(particle).collect();
        tets.sort_unstable();
        for tet in tets {
            // An earlier flip may have taken it away from the particle.
            let corners = self.cuttable.mesh.tets[tet.index()];
            if self.deleted.contains(&tet) || !corners.contains(&particle) {
                continue;
            }
            let [rest, _] = self.corners(corners);
            if least_sine(rest) >= THIN {
                continue;
            }
            let mut best: Option<(f64, Flip)> = None;
            for (i, &a) in corners.iter().enumerate() {
                for &b in &corners[i + 1..] {
                    for flip in Flip::of_edge(self.cuttable, tet, [a, b]) {
                        let least = best.as_ref().map_or(0.0, |(most, _)| *most);
                        if let Some(quality) = self.quality_of_flip(&flip, least)
                            && self.may_flip(&flip, is_locked)
                        {
                            best = Some((quality, flip));
                        }
                    }
                }
            }
            if let Some((_, flip)) = best {
                changed.extend(flip.edge);
                changed.extend(&flip.ring);
                for &tet in &flip.removed {
                    self.note(tet, true);
                }
                self.deleted.extend(flip.apply(self.cuttable));
                self.flipped += 1;
            }
        }
        changed
    }

    /// The smallest sine of a dihedral angle after a flip; `None` if it must not be made or this is not more than before and
    /// than `least`.
    fn quality_of_flip(&self, flip: &Flip, least: f64) -> Option<f64> {
        let tets = &self.cuttable.mesh.tets;
        let (mut least, mut scale) = (least, f64::INFINITY);
        let mut before = f64::INFINITY;
        for tet in &flip.removed {
            let [rest, now] = self.corners(tets[tet.index()]);
            before = before.min(least_sine(rest));
            scale = scale.min(volume(now) / volume(rest));
        }
        least = least.max(before * (1.0 + GAIN));
        let scale_limit = PRESENT.min(0.5 * scale);
        let mut after = f64::INFINITY;
        for corners in &flip.added {
            self.looked_at.set(self.looked_at.get() + 1);
            let [rest, now] = self.corners(*corners);
            after = after.min(least_sine(rest));
            let is_better = after > least && scale > 0.0;
            if !is_better || is_thin(rest) || volume(now) < scale_limit * volume(rest) {
                return None;
            }
        }
        Some(after)
    }

    /// Whether a flip leaves what must stay: the surfaces of earlier strokes where later ones may continue. No face of a
    /// surface goes, and a new edge beside a surface ends on it, so that none crosses it where no blade comes by any more. One
    /// end of the edge must not be locked.
    fn may_flip(
        &self,
        flip: &Flip,
        is_locked: &impl Fn(&CuttableMesh, ParticleId) -> bool,
    ) -> bool {
        let cuttable = &*self.cuttable;
        if flip.is_doubled(cuttable) || flip.edge.iter().all(|p| is_locked(cuttable, *p)) {
            return false;
        }
        let corners: Vec<ParticleId> = flip.edge.iter().chain(&flip.ring).copied().collect();
        let strokes = self.registry.strokes_through(&corners);
        strokes.into_iter().all(|stroke| {
            let is_on = |p: &ParticleId| self.registry.is_on_surface_of(*p, stroke);
            let loses_face = flip.edge.iter().all(is_on) && flip.ring.iter().any(is_on);
            let mut diagonal = flip.diagonal.iter();
            !loses_face && diagonal.all(|ends| ends.iter().any(is_on))
        })
    }

    /// Notes the state of a tet before its first change.
    fn note(&mut self, tet: TetId, is_reshaped: bool) {
        let faces = &self.cuttable.faces;
        let original = self.first.entry(tet).or_insert_with(|| Original {
            corners: self.cuttable.mesh.tets[tet.index()],
            tags: faces.links_of(tet).map(|link| faces.tag_of(link)),
            is_reshaped: false,
        });
        original.is_reshaped |= is_reshaped;
    }

    /// Merges a particle into another one.
    fn collapse(&mut self, collapse: Collapse) {
        let Collapse { from, to } = collapse;
        for tet in Star::of(self.cuttable, from).tets {
            self.note(tet, true);
            let corners = self.cuttable.mesh.tets[tet.index()];
            if !corners.contains(&to) {
                continue;
            }
            let [mut opposite_from, mut opposite_to] = [None; 2];
            for (face, corner) in Face::of(tet).into_iter().zip(corners) {
                let behind = self.cuttable.faces.behind(face);
                if matches!(behind, Behind::Nothing(_)) {
                    self.cuttable.faces.close(face);
                }
                if corner == from {
                    opposite_from = Some(behind);
                } else if corner == to {
                    opposite_to = Some(behind);
                }
            }
            // The faces behind become one.
            match (opposite_from, opposite_to) {
                (Some(Behind::Twin(one)), Some(Behind::Twin(other))) => {
                    self.cuttable.faces.join(one, other);
                }
                (Some(Behind::Twin(face)), Some(Behind::Nothing(tag)))
                | (Some(Behind::Nothing(tag)), Some(Behind::Twin(face))) => {
                    self.note(face.tet(), false);
                    self.cuttable.faces.open(face, tag);
                }
                _ => unreachable!("the link condition leaves a neighbor behind one of the faces"),
            }
            self.cuttable.faces.clear(tet);
            self.cuttable.stars.remove(tet, corners);
            self.deleted.insert(tet);
        }
        for tet in Star::of(self.cuttable, from).tets {
            let corners = &mut self.cuttable.mesh.tets[tet.index()];
            for (k, corner) in (0..).zip(corners) {
                if *corner == from {
                    *corner = to;
                    self.cuttable.stars.relink(tet, k, from, to);
                }
            }
        }
        self.collapsed += 1;
    }

    /// Writes the delta and fills the gaps.
    fn finish(self) -> CutDelta {
        let Self {
            cuttable,
            first,
            deleted,
            collapsed,
            flipped,
            ..
        } = self;
        let mesh = &cuttable.mesh;
        let mut delta = CutDelta {
            particles_before: mesh.positions.len(),
            tets_before: mesh.tets.len(),
            collapsed,
            flipped,
            worst_volume_ratio: 1.0,
            ..CutDelta::default()
        };
        let mut dihedrals = Dihedrals::default();
        for (&tet, original) in &first {
            let Original {
                corners: before,
                tags,
                is_reshaped,
            } = *original;
            let was = RemovedTet {
                tet,
                corners: before,
            };
            let is_deleted = deleted.contains(&tet);
            if is_deleted {
                delta.deleted.push(was);
            } else if is_reshaped {
                let corners = mesh.tets[tet.index()];
                dihedrals.add(corners.map(|p| mesh.positions[p.index()]));
                delta.removed.push(was);
                delta.added.push(AddedTet {
                    tet,
                    parent: tet,
                    corners,
                    positive: true,
                });
            }
            for (face, tag) in Face::of(tet).into_iter().zip(tags) {
                let keeps = !is_deleted && !is_reshaped;
                if let Some(tag) = tag.filter(|_| !keeps) {
                    delta.surface_removed.push(BoundaryTriangle {
                        tet,
                        opposite: [0, 1, 2, 3][face.opposite()],
                        particles: face_of(before, face.opposite()),
                        tag,
                    });
                }
                if is_deleted || (keeps && tag.is_some()) {
                    continue;
                }
                let triangle = cuttable.faces.triangle(mesh, face);
                delta.surface_added.extend(triangle);
            }
        }
        delta.dihedral = dihedrals.range();
        fill_gaps(cuttable, &deleted, &mut delta);
        delta
    }
}

/// Leaves the first part only, whose faces have no other sides then.
fn stay_alone(parts: &mut Vec<Star>) {
    parts.truncate(1);
    for face in parts.iter_mut().flat_map(|part| &mut part.fan) {
        face.is_mirrored = false;
        face.is_represented = false;
    }
}

/// The determinant of the edges from a corner: six times the volume.
fn volume([a, b, c, d]: [DVec3; 4]) -> f64 {
    (b - a).cross(c - a).dot(d - a)
}

/// What two ascending lists have in common, ascending.
fn common<T: Ord + Clone>(one: &[T], other: &[T]) -> Vec<T> {
    let found = one.iter().filter(|x| other.binary_search(x).is_ok());
    found.cloned().collect()
}
