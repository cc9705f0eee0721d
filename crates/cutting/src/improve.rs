//! [`improve`]: takes particles that cuts made out again where the mesh is better or as good without them.
//!
//! Cuts of cuts leave ever smaller tets. A particle that a cut created is merged into a neighbor: the tets around the
//! edge between them go, the others around the particle get the neighbor as their corner. That is done where
//!
//! - the topology stays (link condition of Dey, Edelsbrunner, Guha and Nekhayev 1999, for the mesh with its boundary), so
//!   no pieces are joined or lost;
//! - no tet is inverted or nearly so, neither at rest nor in the present shape;
//! - the smallest sine of a dihedral angle around grows, or stays above [`GOOD`];
//! - the boundary keeps its shape. Outer faces stay in their planes to rounding. A cut face moves at most by
//!   [`ImproveOptions::tolerance`], and only together with the face opposite to it on the other side of the cut, so
//!   that one side gains what the other loses and the volume stays to rounding; a cut face whose other side is
//!   different stays in its plane. Rims and corners of cut faces move along the rim only, the front of an unfinished cut
//!   not at all.
//!
//! Original particles are never taken out, so the mesh does not become coarser than it was made. Cost: each round looks
//! at the particles around the changes of the round before, each with the tets around it and its neighbors.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use foldhash::fast::FixedState;
use glam::DVec3;
use incise_mesh::{ParticleId, TetId};

use crate::delta::{AddedTet, BoundaryTriangle, CutDelta, FaceTag, RemovedTet};
use crate::faces::{Behind, Face, face_of};
use crate::finite::require_positions;
use crate::quality::{Dihedrals, is_thin, least_sine};
use crate::remove::fill_gaps;
use crate::{CutError, CuttableMesh};

/// Sine of a dihedral angle of 12 degrees. Tets with larger angles only are good enough to be merged into others.
const GOOD: f64 = 0.2;
/// Largest distance of an outer face from its plane, and of a cut face without another side, in edges of a mean tet.
const EXACT: f64 = 1e-10;
/// Smallest cosine between normals of faces of one kind around a particle that count as smooth.
const SMOOTH: f64 = 0.8;
/// In the present shape a tet must keep this fraction of its volume at rest, or half of the smallest around it.
const PRESENT: f64 = 0.3;

/// Limits of [`improve`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImproveOptions {
    /// Largest distance by which a call moves a cut face, as a fraction of the edge of a regular tet with the mean
    /// volume of the original ones; from 0 to 0.25.
    pub tolerance: f64,
    /// Whether all boundary triangles keep their particles, so that only particles inside are taken out.
    pub keeps_boundary: bool,
}

impl Default for ImproveOptions {
    /// Tolerance 0.05, boundary triangles may change.
    fn default() -> Self {
        Self {
            tolerance: 0.05,
            keeps_boundary: false,
        }
    }
}

/// Takes out particles that cuts created, from `near` on and wherever a change allows another one.
///
/// # Arguments
/// `positions` are the present positions of the particles. `near` are particles to begin with, such as the corners of
/// the tets that a stroke created ([`CutDelta::created_particles`]). Particles for which `is_locked` is true stay; lock
/// those that something else refers to and those between materials. It is given the mesh in progress, in which tets that
/// stay have their slots from before.
///
/// # Returns
/// A delta in which the tets around the particles taken out are `removed` and `added` with other corners, each its own
/// child, or `deleted`. The particles taken out keep their number and position but have no tet any more.
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
/// use incise_cutting::{CutOptions, CuttableMesh, ImproveOptions, Plane, cut_plane, improve};
/// use incise_mesh::kuhn_box;
///
/// let mut body = CuttableMesh::new(kuhn_box([5; 3], DVec3::ONE))?;
/// let rest = body.mesh().positions.clone();
/// let plane = Plane { point: DVec3::splat(0.43), normal: DVec3::new(1.0, 0.2, 0.1) };
/// let cut = cut_plane(&mut body, &rest, &plane, &CutOptions { snap: 0.0, ..CutOptions::default() })?;
/// let tets = body.mesh().tets.len();
///
/// let rest = body.mesh().positions.clone();
/// let near = cut.created_particles();
/// let delta = improve(&mut body, &rest, &near, &ImproveOptions::default(), |_, _| false)?;
/// assert!(delta.collapsed > 0 && body.mesh().tets.len() < tets);
/// assert_eq!(body.mesh().pieces().count, 2);
/// assert!((body.mesh().total_volume() - 1.0).abs() < 1e-12);
/// # Ok::<(), incise_cutting::CutError>(())
/// ```
pub fn improve(
    cuttable: &mut CuttableMesh,
    positions: &[DVec3],
    near: &[ParticleId],
    options: &ImproveOptions,
    is_locked: impl Fn(&CuttableMesh, ParticleId) -> bool,
) -> Result<CutDelta, CutError> {
    let _span = tracing::debug_span!("cutting::improve").entered();
    if !(0.0..=0.25).contains(&options.tolerance) {
        return Err(CutError::Improve {
            value: options.tolerance,
        });
    }
    require_positions(cuttable.mesh(), positions)?;
    // Volume of a regular tet with edge e: e³ / (6 √2).
    let edge = (cuttable.mean_volume * 6.0 * std::f64::consts::SQRT_2).cbrt();
    let mut improvement = Improvement {
        exact: EXACT * edge,
        tolerance: options.tolerance * edge,
        keeps_boundary: options.keeps_boundary,
        cuttable,
        positions,
        first: BTreeMap::new(),
        deleted: BTreeSet::new(),
        at: HashMap::default(),
        moved: HashMap::default(),
        collapsed: 0,
    };
    improvement.run(near, &is_locked);
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
            Some(FanFace { next, tag })
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
    exact: f64,
    tolerance: f64,
    keeps_boundary: bool,
    first: BTreeMap<TetId, Original>,
    deleted: BTreeSet<TetId>,
    /// The particles seen at each position at rest. Never iterated.
    at: HashMap<[u64; 3], Vec<ParticleId>, FixedState>,
    /// How far the cut faces around a particle have moved so far. Never iterated.
    moved: HashMap<ParticleId, f64, FixedState>,
    collapsed: usize,
}

/// A particle to be merged into another one.
#[derive(Clone, Copy)]
struct Collapse {
    from: ParticleId,
    to: ParticleId,
    /// How far cut faces move.
    distance: f64,
}

impl Improvement<'_> {
    fn rest(&self, particle: ParticleId) -> DVec3 {
        self.cuttable.mesh.positions[particle.index()]
    }

    fn key(&self, particle: ParticleId) -> [u64; 3] {
        // 0.0 and -0.0 are one position.
        self.rest(particle).to_array().map(|c| (c + 0.0).to_bits())
    }

    /// Rounds until one changes nothing. Ends, since each change takes a particle out.
    fn run(&mut self, near: &[ParticleId], is_locked: &impl Fn(&CuttableMesh, ParticleId) -> bool) {
        let mut active: BTreeSet<ParticleId> = near.iter().copied().collect();
        while !active.is_empty() {
            let mut due: Vec<(f64, ParticleId)> = Vec::new();
            for &particle in &active {
                self.see(particle);
                let mut shortest = f64::INFINITY;
                for neighbor in Star::of(self.cuttable, particle).neighbors {
                    self.see(neighbor);
                    let length = self.rest(particle).distance_squared(self.rest(neighbor));
                    shortest = shortest.min(length);
                }
                let is_created = !self.cuttable.is_original(particle);
                if is_created && shortest.is_finite() && !is_locked(self.cuttable, particle) {
                    due.push((shortest, particle));
                }
            }
            due.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            active.clear();
            for (_, particle) in due {
                for to in self.take_out(particle, is_locked) {
                    active.insert(to);
                    active.extend(Star::of(self.cuttable, to).neighbors);
                }
            }
        }
    }

    /// Notes where a particle is at rest.
    fn see(&mut self, particle: ParticleId) {
        let key = self.key(particle);
        let there = self.at.entry(key).or_default();
        if !there.contains(&particle) {
            there.push(particle);
        }
    }

    /// Merges a particle into the neighbor with the best result, if there is one. Returns the particles merged into.
    fn take_out(
        &mut self,
        particle: ParticleId,
        is_locked: &impl Fn(&CuttableMesh, ParticleId) -> bool,
    ) -> Vec<ParticleId> {
        let star = Star::of(self.cuttable, particle);
        // A change of this round may have locked it.
        if star.tets.is_empty()
            || is_locked(self.cuttable, particle)
            || !star.is_single_fan()
            || (self.keeps_boundary && !star.fan.is_empty())
        {
            return Vec::new();
        }
        let twin = self
            .twin(&star)
            .filter(|twin| !is_locked(self.cuttable, twin.particle));
        let rims = star.rims();
        let targets = match rims.len() {
            0 if star.fan.is_empty() => star.neighbors.clone(),
            0 => star.fan_neighbors(),
            2 => rims,
            _ => return Vec::new(),
        };
        let mut best: Option<(f64, Vec<Collapse>)> = None;
        for to in targets {
            if let Some((quality, collapses)) = self.collapses(&star, twin.as_ref(), to)
                && best.as_ref().is_none_or(|(most, _)| quality > *most)
            {
                best = Some((quality, collapses));
            }
        }
        let collapses = best.map_or(Vec::new(), |(_, collapses)| collapses);
        for collapse in &collapses {
            self.collapse(*collapse);
        }
        collapses.into_iter().map(|collapse| collapse.to).collect()
    }

    /// The star of the particle on the other side of a cut, if the cut faces around are mirrored there.
    fn twin(&self, star: &Star) -> Option<Star> {
        let is_live = |p: &ParticleId| self.cuttable.around(*p).next().is_some();
        let there = self.at.get(&self.key(star.particle))?;
        let mut live = there.iter().copied().filter(is_live);
        let (one, other, None) = (live.next()?, live.next()?, live.next()) else {
            return None;
        };
        let twin = if one == star.particle { other } else { one };
        if self.cuttable.is_original(twin) {
            return None;
        }
        let twin = Star::of(self.cuttable, twin);
        let cut = |star: &Star, order: [usize; 2]| {
            let faces = star.fan.iter().filter(|face| face.tag != FaceTag::Outer);
            let mut keys: Vec<_> = faces
                .map(|face| order.map(|k| self.key(face.next[k])))
                .collect();
            keys.sort_unstable();
            keys
        };
        let mirrored = cut(star, [0, 1]) == cut(&twin, [1, 0]);
        (mirrored && twin.is_single_fan()).then_some(twin)
    }

    /// The collapses that take a particle out, on both sides of a cut if it has two, and the quality they lead to.
    fn collapses(
        &self,
        star: &Star,
        twin: Option<&Star>,
        to: ParticleId,
    ) -> Option<(f64, Vec<Collapse>)> {
        let (bend, distance) = self.bend(star, to)?;
        if bend <= self.exact && (star.fan.is_empty() || twin.is_none()) {
            let quality = self.quality(star, to)?;
            let from = star.particle;
            return Some((quality, vec![Collapse { from, to, distance }]));
        }
        let twin = twin?;
        if distance > self.tolerance {
            return None;
        }
        let key = self.key(to);
        let mut others = twin.fan_neighbors().into_iter();
        let other = others.find(|p| self.key(*p) == key)?;
        let twin_rims = twin.rims();
        if other == to
            || !(twin_rims.is_empty() || (twin_rims.len() == 2 && twin_rims.contains(&other)))
        {
            return None;
        }
        let is_apart = |star: &Star, others: [ParticleId; 2]| {
            let mut corners = star
                .tets
                .iter()
                .map(|tet| self.cuttable.mesh.tets[tet.index()]);
            corners.all(|corners| others.iter().all(|p| !corners.contains(p)))
        };
        let are_apart =
            is_apart(star, [twin.particle, other]) && is_apart(twin, [star.particle, to]);
        let (_, other_distance) = self.bend(twin, other)?;
        if !are_apart || other_distance > self.tolerance {
            return None;
        }
        let quality = self.quality(star, to)?.min(self.quality(twin, other)?);
        let pairs = [
            (star.particle, to, distance),
            (twin.particle, other, other_distance),
        ];
        let collapses = pairs.map(|(from, to, distance)| Collapse { from, to, distance });
        Some((quality, collapses.to_vec()))
    }

    /// How far cut faces move if a particle is merged into another one: by this, and together with all before. `None` if
    /// outer faces move, or the boundary is not smooth enough.
    fn bend(&self, star: &Star, to: ParticleId) -> Option<(f64, f64)> {
        let (at, target) = (self.rest(star.particle), self.rest(to));
        let normal = |from: DVec3, face: &FanFace| {
            let [b, c] = face.next.map(|p| self.rest(p));
            (b - from).cross(c - from)
        };
        let mut bend: f64 = 0.0;
        for face in &star.fan {
            let kind = star.fan.iter().filter(|other| other.tag == face.tag);
            let mean: DVec3 = kind.map(|other| normal(at, other)).sum();
            let across = normal(at, face).try_normalize()?;
            if face.tag != FaceTag::Outer && across.dot(mean.try_normalize()?) < SMOOTH {
                return None;
            }
            if face.next.contains(&to) {
                continue;
            }
            let height = (target - at).dot(across).abs();
            if face.tag == FaceTag::Outer && height > self.exact {
                return None;
            }
            if across.dot(normal(target, face).try_normalize()?) < SMOOTH {
                return None;
            }
            bend = bend.max(height);
        }
        let before = self.moved.get(&star.particle).copied().unwrap_or(0.0);
        Some((bend, bend + before))
    }

    /// The smallest sine of a dihedral angle around after a collapse; `None` if it must not be made.
    fn quality(&self, star: &Star, to: ParticleId) -> Option<f64> {
        let mesh = &self.cuttable.mesh;
        let rest = |corners: [ParticleId; 4]| corners.map(|p| self.rest(p));
        let now = |corners: [ParticleId; 4]| corners.map(|p| self.positions[p.index()]);
        let scale = |corners| volume(now(corners)) / volume(rest(corners));
        let (mut before, mut scale_before) = (f64::INFINITY, f64::INFINITY);
        for tet in &star.tets {
            let corners = mesh.tets[tet.index()];
            before = before.min(least_sine(rest(corners)));
            scale_before = scale_before.min(scale(corners));
        }
        if scale_before <= 0.0 {
            return None;
        }
        let scale_limit = PRESENT.min(0.5 * scale_before);
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
            after = after.min(least_sine(rest(corners)));
            let is_better = after >= GOOD || after > before;
            if !is_better || is_thin(rest(corners)) || scale(corners) < scale_limit {
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
        let is_bounded = |tet: &TetId| {
            let faces = Face::of(*tet).into_iter();
            let mut behind = faces.map(|face| self.cuttable.faces.behind(face));
            behind.any(|behind| matches!(behind, Behind::Nothing(_)))
        };
        if self.keeps_boundary && ring.iter().any(is_bounded) {
            return false;
        }
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
                let mut face: Vec<ParticleId> = corners.filter(|p| *p != star.particle).collect();
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
        let Collapse { from, to, distance } = collapse;
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
        let moved = self.moved.entry(to).or_insert(0.0);
        *moved = moved.max(distance);
        self.collapsed += 1;
    }

    /// Writes the delta and fills the gaps.
    fn finish(self) -> CutDelta {
        let Self {
            cuttable,
            first,
            deleted,
            collapsed,
            ..
        } = self;
        let mesh = &cuttable.mesh;
        let mut delta = CutDelta {
            particles_before: mesh.positions.len(),
            tets_before: mesh.tets.len(),
            collapsed,
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

/// The determinant of the edges from a corner: six times the volume.
fn volume([a, b, c, d]: [DVec3; 4]) -> f64 {
    (b - a).cross(c - a).dot(d - a)
}

/// What two ascending lists have in common, ascending.
fn common<T: Ord + Clone>(one: &[T], other: &[T]) -> Vec<T> {
    let found = one.iter().filter(|x| other.binary_search(x).is_ok());
    found.cloned().collect()
}
