//! [`StrokeRegistry`]: what finished strokes leave for later ones to join.
//!
//! A face opens where all three particles lie on the surface of one stroke, so a stroke that continues where another
//! stopped would leave the tets between both fronts as threads. The registry keeps, for each particle along earlier
//! strokes, what they knew of it. Where a new stroke meets an edge, it looks at the particles around the edge's ends:
//! those on an earlier surface that runs the same way (within some 25 degrees) and closely (a quarter of an edge) show
//! that it is the same surface, and what that stroke knew there is taken over. A surface that crosses at an angle is
//! left alone.
//!
//! Cost: a look-up for each particle around the edges met; the registry grows with the particles along all strokes.

use std::collections::{HashMap, HashSet};

use foldhash::fast::FixedState;
use glam::DVec3;
use incise_mesh::ParticleId;

use crate::blade::{ALIGNED, CrossedEdge, SAME_SHEET};
use crate::surface::{CutSurface, Mark, Tangent};
use crate::{CutDelta, CutOptions, CuttableMesh};

/// Surfaces of earlier strokes, which later strokes can continue. The caller keeps it from stroke to stroke.
///
/// Pass it to [`crate::Sweep::advance_joining`] and [`crate::cut_surface_joining`]; call
/// [`StrokeRegistry::apply_delta`] after cuts made without it. Without a registry strokes join only if they overlap by
/// a tet. Strokes that end at each other at an angle divide a body after [`crate::join_ends`].
///
/// # Example
/// ```
/// use glam::DVec3;
/// use incise_cutting::{StrokeRegistry, CutOptions, CuttableMesh, TriangleSurface, cut_surface_joining};
/// use incise_mesh::kuhn_box;
///
/// let mut body = CuttableMesh::new(kuhn_box([4, 4, 4], DVec3::ONE))?;
/// let mut registry = StrokeRegistry::default();
/// // The upper and the lower part of one plane, which meet in the middle of tets.
/// for center in [0.93, -0.07] {
///     let center = DVec3::new(0.4, 0.5, center);
///     let half = TriangleSurface::rectangle(center, DVec3::Y, DVec3::Z * 0.5)?;
///     let positions = body.mesh().positions.clone();
///     cut_surface_joining(&mut body, &positions, &half, &CutOptions::default(), &mut registry)?;
/// }
/// assert_eq!(body.mesh().pieces().count, 2);
/// # Ok::<(), incise_cutting::CutError>(())
/// ```
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct StrokeRegistry {
    /// Strokes so far.
    strokes: u32,
    /// For each particle and 0, 1, .. a stroke that has marked it, with the mark. Its order never affects results.
    known: HashMap<(ParticleId, u32), (u32, Mark), FixedState>,
    /// Particles of which strokes have learned since their ends were joined.
    fresh: HashSet<ParticleId, FixedState>,
}

impl StrokeRegistry {
    /// Applies the delta of a cut that was made without this registry. `options` are those of the cut.
    ///
    /// # Panics
    /// If `cuttable` is not the mesh as `delta` left it.
    pub fn apply_delta(&mut self, cuttable: &CuttableMesh, delta: &CutDelta, options: &CutOptions) {
        self.apply_delta_to_others(u32::MAX, cuttable, delta, options.reach());
    }

    /// Appends what strokes left on a mesh that is appended to one with so many particles: see
    /// [`CuttableMesh::append`]. Linear in the registry appended.
    pub fn append(&mut self, other: &Self, particles: usize) {
        let first = self.strokes;
        self.known
            .extend(other.known.iter().map(|(&(p, slot), &(stroke, mark))| {
                let p = ParticleId::new(particles + p.index());
                ((p, slot), (first + stroke, mark))
            }));
        self.strokes += other.strokes;
        let fresh = other.fresh.iter();
        self.fresh
            .extend(fresh.map(|p| ParticleId::new(particles + p.index())));
    }

    /// Removes the particles from number `particles` on, which an undone cut had added. Linear in the registry.
    pub fn truncate(&mut self, particles: usize) {
        self.known.retain(|key, _| key.0.index() < particles);
        self.fresh.retain(|p| p.index() < particles);
    }

    /// Returns whether a particle is on the surface of an earlier stroke. Looks at each stroke that has marked it.
    #[must_use]
    pub fn is_on_surface(&self, particle: ParticleId) -> bool {
        self.entries(particle)
            .any(|(_, mark)| mark.tangent.is_some())
    }

    /// The earlier strokes that have a particle on their surface, with their tangent planes there.
    pub(crate) fn surfaces_through(
        &self,
        particle: ParticleId,
    ) -> impl Iterator<Item = (u32, Tangent)> + '_ {
        let entries = self.entries(particle);
        entries.filter_map(|(stroke, mark)| Some((stroke, mark.tangent?)))
    }

    /// Returns whether strokes have cut since their ends were joined: see [`crate::join_ends`].
    #[must_use]
    pub fn has_new_ends(&self) -> bool {
        !self.fresh.is_empty()
    }

    /// The particles of which strokes have learned since the last call, ascending.
    pub(crate) fn take_fresh(&mut self) -> Vec<ParticleId> {
        let mut fresh: Vec<ParticleId> = self.fresh.drain().collect();
        fresh.sort_unstable();
        fresh
    }

    pub(crate) fn has_one_stroke(&self) -> bool {
        self.strokes < 2
    }

    /// Whether each earlier stroke whose surface has a particle has another one on the same sheet, with tangent planes that
    /// pass each other's particle within a distance, so that the first can be merged into the other.
    pub(crate) fn has_on_same_sheets(
        &self,
        rest: &[DVec3],
        [from, to]: [ParticleId; 2],
        distance: f64,
    ) -> bool {
        self.entries(from).all(|(stroke, mark)| {
            let Some(ours) = mark.tangent else {
                return true;
            };
            let theirs = self.mark(to, stroke).and_then(|mark| mark.tangent);
            theirs.is_some_and(|theirs| {
                ours.normal.dot(theirs.normal) >= ALIGNED
                    && ours.distance(rest[to.index()]).abs() <= distance
                    && theirs.distance(rest[from.index()]).abs() <= distance
            })
        })
    }

    /// The earlier strokes that have one of some particles on their surface, ascending.
    pub(crate) fn strokes_through(&self, particles: &[ParticleId]) -> Vec<u32> {
        let entries = particles.iter().flat_map(|&p| self.entries(p));
        let through = entries.filter(|(_, mark)| mark.tangent.is_some());
        let mut strokes: Vec<u32> = through.map(|(stroke, _)| stroke).collect();
        strokes.sort_unstable();
        strokes.dedup();
        strokes
    }

    /// Whether a particle is on the surface of an earlier stroke of a number.
    pub(crate) fn is_on_surface_of(&self, particle: ParticleId, stroke: u32) -> bool {
        let mark = self.mark(particle, stroke);
        mark.is_some_and(|mark| mark.tangent.is_some())
    }

    pub(crate) fn next_stroke(&mut self) -> u32 {
        self.strokes += 1;
        self.strokes - 1
    }

    fn entries(&self, particle: ParticleId) -> impl Iterator<Item = (u32, Mark)> + '_ {
        (0..).map_while(move |i| self.known.get(&(particle, i)).copied())
    }

    fn mark(&self, particle: ParticleId, stroke: u32) -> Option<Mark> {
        self.entries(particle)
            .find_map(|(of, mark)| (of == stroke).then_some(mark))
    }

    fn insert(&mut self, particle: ParticleId, stroke: u32, mark: Mark) {
        let slot = self
            .entries(particle)
            .take_while(|(of, _)| *of != stroke)
            .count();
        let slot = u32::try_from(slot).unwrap_or(u32::MAX);
        self.known.insert((particle, slot), (stroke, mark));
    }

    /// Takes what earlier strokes of the same surface knew of the particles around the hits over into `surface`.
    /// Appends to `adopted` those that lie on it now. Returns whether there were any.
    pub(crate) fn join(
        &self,
        stroke: u32,
        cuttable: &CuttableMesh,
        hits: &[CrossedEdge],
        surface: &mut CutSurface,
        adopted: &mut Vec<ParticleId>,
    ) -> bool {
        let before = adopted.len();
        // A first stroke has no earlier one to join.
        if self.known.is_empty() || (stroke == 0 && self.strokes == 1) {
            return false;
        }
        let rest = &cuttable.mesh.positions;
        let mut corners: Vec<ParticleId> = Vec::new();
        // Strokes of the same surface and whether their positive side is ours.
        let mut same: Vec<(u32, bool)> = Vec::new();
        for hit in hits {
            let ends = hit.crossing.ends;
            corners.clear();
            for tet in cuttable.tets_around(&ends) {
                corners.extend(cuttable.mesh.tets[tet.index()]);
            }
            corners.sort_unstable();
            corners.dedup();
            same.clear();
            let close = SAME_SHEET * cuttable.longest_edge_around(ends);
            let ours = hit.tangent;
            for &corner in &corners {
                for (of, mark) in self.entries(corner).filter(|entry| entry.0 != stroke) {
                    let Some(theirs) = mark.tangent else { continue };
                    let cosine = ours.normal.dot(theirs.normal);
                    if cosine.abs() >= ALIGNED
                        && ours.distance(rest[corner.index()]).abs() <= close
                        && theirs.distance(ours.point).abs() <= close
                        && same.iter().all(|(known, _)| *known != of)
                    {
                        same.push((of, cosine > 0.0));
                    }
                }
            }
            if same.is_empty() {
                continue;
            }
            for &corner in &corners {
                for &(of, same_orientation) in &same {
                    let Some(mark) = self.mark(corner, of) else {
                        continue;
                    };
                    // On another sheet of that stroke, unless close and alike.
                    let beside = mark.tangent.is_some_and(|theirs| {
                        ours.normal.dot(theirs.normal).abs() < ALIGNED
                            || ours.distance(rest[corner.index()]).abs() > close
                    });
                    if !beside && surface.adopt(corner, mark, same_orientation) {
                        adopted.push(corner);
                    }
                }
            }
        }
        adopted.len() > before
    }

    /// Gives what a stroke knew of particles that it has left to strokes of other numbers, `behind`, to which numbers are
    /// appended where a particle is on the surface of all of them.
    pub(crate) fn leave_behind(
        &mut self,
        stroke: u32,
        behind: &mut Vec<u32>,
        particles: &[ParticleId],
    ) {
        for &particle in particles {
            let of: Vec<u32> = self.entries(particle).map(|(of, _)| of).collect();
            let Some(slot) = of.iter().position(|of| *of == stroke) else {
                continue;
            };
            let free = behind.iter().copied().find(|number| !of.contains(number));
            let number = free.unwrap_or_else(|| {
                let number = self.next_stroke();
                behind.push(number);
                number
            });
            let slot = u32::try_from(slot).unwrap_or(u32::MAX);
            if let Some(known) = self.known.get_mut(&(particle, slot)) {
                known.0 = number;
            }
        }
    }

    /// Learns what a stroke came to know since it was last asked.
    pub(crate) fn learn(&mut self, stroke: u32, surface: &mut CutSurface) {
        for (particle, mark) in surface.take_news() {
            self.insert(particle, stroke, mark);
            self.fresh.insert(particle);
        }
    }

    /// Follows a cut with what all strokes but one know, as [`CutSurface::apply_delta`] does.
    pub(crate) fn apply_delta_to_others(
        &mut self,
        stroke: u32,
        cuttable: &CuttableMesh,
        delta: &CutDelta,
        reach: f64,
    ) {
        if self.known.is_empty() {
            return;
        }
        let rest = &cuttable.mesh.positions;
        for (i, point) in delta.points.iter().enumerate() {
            let particle = ParticleId::new(delta.particles_before + i);
            let known: Vec<(u32, Mark)> = point
                .ends
                .iter()
                .flat_map(|&end| self.entries(end))
                .filter(|(of, mark)| *of != stroke && mark.tangent.is_some())
                .collect();
            for &(of, _) in &known {
                let [a, b] = point
                    .ends
                    .map(|end| self.mark(end, of).and_then(|mark| mark.tangent));
                if let Some(tangent) =
                    CutSurface::between([a, b], point.ends, particle, rest, reach)
                {
                    self.insert(particle, of, Mark::on(tangent));
                }
            }
        }
        let first = delta.particles_before + delta.points.len();
        for (i, &source) in delta.copies.iter().enumerate() {
            let known: Vec<(u32, Mark)> = self.entries(source).collect();
            for (of, mark) in known.into_iter().filter(|entry| entry.0 != stroke) {
                self.insert(ParticleId::new(first + i), of, mark);
            }
        }
    }
}
