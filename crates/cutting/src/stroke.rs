//! [`Stroke`]: the engine behind every blade that is not a whole field: from met edges to a cut.
//!
//! A [`Blade`] says where it meets an edge; whether it moves (`sweep`) or stands (`triangles`) makes no difference
//! here. Every edge met gets a particle there, and a face opens as soon as all three of its particles lie on the
//! surface. So the mesh conforms after every cut, and a surface may end anywhere.
//!
//! A particle is put on the surface (snapped) only before any of its edges is split, else a corner already cut free
//! could be cut off again as a chip of its own. So when a moving blade first meets an edge of a particle, the surface
//! is continued by its tangent plane through all edges of the particle, which decides as a whole plane would. Where the
//! body moves, a later meeting may come closer to the particle than foreseen; the new particle then keeps the snap
//! distance, which bends the surface as snapping does, the other way.
//!
//! A blade that comes back over what it has cut sweeps the same surface with its normal the other way around. The sides
//! of a surface must stay what they were, so hits beside it, or after hits of the opposite direction, are turned over:
//! a stroke in rows, or to and fro, keeps one orientation wherever its passes overlap.
//!
//! With a [`StrokeRegistry`] the stroke takes over what earlier strokes of the same surface left beside the edges it meets,
//! and continues as if it were one of them. What a moving blade has left behind is that of an earlier stroke: coming back
//! along it the stroke joins it, and across it the stroke cuts it.
//!
//! Which particles are put on the surface: `snap`. Source: paper section 4.3, with the moving front as described here.
//! Cost: what the edges offered and the cut cost, and a look at the tets around the particles near a moving blade.

mod snap;

use glam::{DMat3, DVec3};
use incise_mesh::{ParticleId, TetId, TetMesh};

use crate::blade::{ALIGNED, Blade, CrossedEdge, SAME_SHEET};
use crate::ccd::EdgeHit;
use crate::motion::Motion;
use crate::operation::{Crossing, Operation, SplitError};
use crate::parallel;
use crate::side_labels::{GivenSides, Sides, side_by_blade};
use crate::sign_split::linear;
use crate::stroke_registry::StrokeRegistry;
use crate::surface::{CutSurface, Tangent};
use crate::{CutDelta, CutError, CutOptions, CuttableMesh};

/// Edges beside its front by which a moving blade has left a particle behind.
const LEFT: f64 = 2.0;

/// The state of a stroke.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Stroke {
    options: CutOptions,
    surface: CutSurface,
    given: GivenSides,
    /// Sides of tets split in this call.
    forgotten: Vec<(TetId, bool)>,
    /// The number of the stroke in the registry.
    number: Option<u32>,
    /// The numbers in the registry of what it has left behind.
    behind: Vec<u32>,
    /// Whether the positive side is where the blade's own normal does not point to: the blade goes back over what it
    /// has cut, and the surface keeps its orientation.
    turned: bool,
    /// For each segment of the blade the mean normal of its last hits at rest, zero before the first.
    heading: Vec<DVec3>,
}

impl Stroke {
    pub(crate) fn new(options: CutOptions) -> Self {
        Self {
            options,
            surface: CutSurface::default(),
            given: GivenSides::default(),
            forgotten: Vec::new(),
            number: None,
            behind: Vec::new(),
            turned: false,
            heading: Vec::new(),
        }
    }

    /// Cuts what the blade meets among the tets `near`. `motion` is extended to the new particles, its present
    /// positions also to the copies.
    pub(crate) fn cut<B: Blade>(
        &mut self,
        cuttable: &mut CuttableMesh,
        motion: &mut Motion,
        mut near: Vec<TetId>,
        blade: &B,
        mut registry: Option<&mut StrokeRegistry>,
    ) -> Result<CutDelta, CutError> {
        let particles = motion.now.len();
        let heading = (self.turned, self.heading.clone());
        let mut fresh: Vec<ParticleId> = Vec::new();
        self.surface.begin();
        self.forgotten.clear();
        let mut operation = Operation::begin(cuttable, &self.options);
        // A round a meeting of an edge: then nothing is left, but what would be cut off by more is smaller than a tet.
        // Near the tip of a surface there may be no end to it: every new edge crosses it again, nearer to the tip.
        let mut rounds = 1 + blade.most_meetings();
        let mut round = 0;
        while round < rounds {
            let edges = edges_of(&operation.cuttable.mesh, &near);
            let mut hits = self.hits(operation.cuttable, &edges, motion, blade);
            if B::IS_SWEPT && self.runs_against(operation.cuttable, &hits) {
                self.turned = !self.turned;
                hits.iter_mut().for_each(CrossedEdge::turn);
            }
            if let Some(registry) = &mut registry {
                let number = *self.number.get_or_insert_with(|| registry.next_stroke());
                self.surface.keep_news();
                let cuttable = &*operation.cuttable;
                if registry.join(number, cuttable, &hits, &mut self.surface, &mut fresh) {
                    hits = self.hits(cuttable, &edges, motion, blade);
                }
            }
            if hits.is_empty() {
                break;
            }
            if B::IS_SWEPT {
                self.note_heading(&hits);
            }
            if round == 0 && !B::IS_SWEPT {
                rounds = hits.iter().map(|hit| hit.meetings).max().unwrap_or(0);
            }
            round += 1;
            let touched = if round == 1 && !B::IS_SWEPT {
                touched(operation.cuttable, &motion.now, &edges, blade)
            } else {
                Vec::new()
            };
            let snapped = self.snap(&mut operation, &hits, touched, B::IS_SWEPT);
            near = match self.open(&mut operation, motion, hits, &snapped, &mut fresh) {
                Ok(touched) => touched,
                Err(error) => {
                    (self.turned, self.heading) = heading;
                    return Err(self.give_up(operation, motion, particles, error));
                }
            };
        }

        while let (Some(registry), Some(number)) = (&registry, self.number) {
            let gaps = self.gaps(operation.cuttable, &fresh);
            if gaps.is_empty() {
                break;
            }
            let cuttable = &*operation.cuttable;
            if registry.join(number, cuttable, &gaps, &mut self.surface, &mut fresh) {
                continue;
            }
            let snapped = self.snap(&mut operation, &gaps, Vec::new(), false);
            if let Err(error) = self.open(&mut operation, motion, gaps, &snapped, &mut fresh) {
                (self.turned, self.heading) = heading;
                return Err(self.give_up(operation, motion, particles, error));
            }
        }

        let seeds = self.seeds(operation.cuttable, &fresh);
        let along = operation.cuttable.tets_around(&seeds);
        let mesh = &operation.cuttable.mesh;
        let by_blade = |corners: [ParticleId; 4]| {
            side_by_blade(&self.surface, blade, self.turned, corners, motion)
        };
        let sides = Sides::new(mesh, &self.surface, &mut self.given, &along, by_blade);
        let on = |p| self.surface.contains(p);
        operation.separate(&seeds, on, |face| sides.differ(face.tets));
        let delta = operation.finish(|rest, c| self.surface.side(rest, c));
        for source in &delta.copies {
            motion.now.push(motion.now[source.index()]);
        }
        self.surface.copy(&delta);
        if let (Some(registry), Some(number)) = (registry, self.number) {
            registry.apply_delta_to_others(number, cuttable, &delta, self.options.reach());
            registry.learn(number, &mut self.surface);
            if B::IS_SWEPT {
                let left = self.left(cuttable, &motion.now, blade);
                registry.leave_behind(number, &mut self.behind, &left);
            }
        }
        Ok(delta)
    }

    /// Forgets the particles that the blade has left, with the sides of tets there, and returns them.
    fn left(
        &mut self,
        cuttable: &CuttableMesh,
        now: &[DVec3],
        blade: &impl Blade,
    ) -> Vec<ParticleId> {
        let mean = cuttable.mean_edge();
        let left = self.surface.leave(|particle| {
            let x = now[particle.index()];
            let around = cuttable.around(particle);
            let neighbors = around.flat_map(|tet| cuttable.mesh.tets[tet.index()]);
            let lengths = neighbors.map(|p| x.distance(now[p.index()]));
            blade.is_beyond(x, LEFT * lengths.fold(mean, f64::max))
        });
        // They were those of a surface that comes to be another one.
        for tet in left.iter().flat_map(|p| cuttable.around(*p)) {
            self.given.forget(tet);
        }
        left
    }

    /// Takes the cut back, and what the stroke learned from it.
    fn give_up(
        &mut self,
        operation: Operation<'_>,
        motion: &mut Motion,
        particles: usize,
        error: CutError,
    ) -> CutError {
        operation.roll_back();
        motion.before.truncate(particles);
        motion.now.truncate(particles);
        self.surface.roll_back();
        for (tet, side) in self.forgotten.drain(..) {
            self.given.restore(tet, side);
        }
        error
    }

    /// Splits the edges that were hit and have no end on the surface. Returns the tets touched.
    fn open(
        &mut self,
        operation: &mut Operation<'_>,
        motion: &mut Motion,
        mut hits: Vec<CrossedEdge>,
        snapped: &[ParticleId],
        fresh: &mut Vec<ParticleId>,
    ) -> Result<Vec<TetId>, CutError> {
        operation.delta.snapped += snapped.len();
        hits.retain(|hit| {
            let ends = hit.crossing.ends;
            ends.iter().all(|p| snapped.binary_search(p).is_err())
        });
        let reach = self.options.reach();
        for hit in &mut hits {
            hit.crossing.parameter = hit.crossing.parameter.clamp(reach, 1.0 - reach);
        }
        let crossings = hits.iter_mut().map(|hit| &mut hit.crossing);
        operation.cuttable.align_sides(crossings);
        let near = loop {
            let crossings: Vec<Crossing> = hits.iter().map(|hit| hit.crossing).collect();
            match operation.split(&crossings) {
                Ok(near) => break near,
                Err(SplitError::TooMany(error)) => return Err(error),
                Err(SplitError::TooThin(refused)) => {
                    let ends = refused.into_iter().map(|i| {
                        let hit = &hits[i];
                        (hit.crossing.nearer_end(), hit.tangent)
                    });
                    let ends = self.bend(operation, ends.collect());
                    let off = |p: &ParticleId| ends.binary_search(p).is_err();
                    hits.retain(|hit| hit.crossing.ends.iter().all(off));
                    operation.delta.snapped += ends.len();
                    fresh.extend(ends);
                }
            }
        };
        let given = &mut self.given;
        let forgotten = near.iter().filter_map(|&t| Some((t, given.forget(t)?)));
        self.forgotten.extend(forgotten);
        fresh.extend(snapped);
        for hit in hits {
            let point = ParticleId::new(motion.now.len());
            fresh.push(point);
            motion.push(&hit.crossing);
            self.surface.put(point, hit.tangent);
        }
        Ok(near)
    }

    /// The edges between this stroke's surface and the one it joins.
    ///
    /// Where the two run beside each other, an edge may slip through between the end of one and the start of the other.
    /// So in tets that have particles of both, an edge that no blade met is taken to cross the mean of their tangent
    /// planes, if its ends lie on different sides.
    fn gaps(&self, cuttable: &CuttableMesh, fresh: &[ParticleId]) -> Vec<CrossedEdge> {
        let rest = &cuttable.mesh.positions;
        let mut gaps: Vec<CrossedEdge> = Vec::new();
        for tet in cuttable.tets_around(fresh) {
            let corners = cuttable.mesh.tets[tet.index()];
            let on = || corners.into_iter().filter(|&p| self.surface.contains(p));
            let joins = on().any(|p| self.surface.is_adopted(p))
                && on().any(|p| !self.surface.is_adopted(p));
            let mut off = corners.into_iter().filter(|&p| !self.surface.contains(p));
            let (true, Some(a), Some(b)) = (joins, off.next(), off.next()) else {
                continue;
            };
            let ends = [a.min(b), a.max(b)];
            let tangents = on().filter_map(|p| self.surface.tangent(p));
            let distances = ends.map(|p| {
                let each = tangents.clone().map(|t| t.distance(rest[p.index()]));
                each.sum::<f64>()
            });
            if distances[0] * distances[1] >= 0.0 {
                continue;
            }
            let parameter = linear(distances);
            let crossing = Crossing { ends, parameter };
            let upwards = distances[0] < 0.0;
            gaps.push(CrossedEdge {
                crossing,
                tangent: Tangent {
                    point: rest[ends[0].index()].lerp(rest[ends[1].index()], parameter),
                    normal: tangents
                        .map(|t| t.normal)
                        .sum::<DVec3>()
                        .normalize_or_zero(),
                },
                sides: [Some(!upwards), Some(upwards)],
                segment: 0,
                meetings: 1,
            });
        }
        gaps.sort_by_key(|hit| hit.crossing.ends);
        gaps.dedup_by_key(|hit| hit.crossing.ends);
        gaps
    }

    /// Follows a cut that another stroke made.
    pub(crate) fn apply_delta(&mut self, cuttable: &CuttableMesh, delta: &CutDelta) {
        self.given.apply_delta(delta);
        self.surface
            .apply_delta(delta, &cuttable.mesh.positions, self.options.reach());
    }

    /// The edges met, each with its first meeting that is not with the sheet one of its ends lies on.
    fn hits(
        &self,
        cuttable: &CuttableMesh,
        edges: &[[ParticleId; 2]],
        motion: &Motion,
        blade: &impl Blade,
    ) -> Vec<CrossedEdge> {
        let rest = &cuttable.mesh.positions;
        parallel::filter_map(edges, |&ends| {
            if ends.iter().all(|&p| self.surface.contains(p)) {
                return None;
            }
            let [a, b] = ends.map(|p| rest[p.index()]);
            let known = ends.iter().find_map(|&p| self.surface.tangent(p));
            let adopted = || ends.iter().any(|&p| self.surface.is_adopted(p));
            let old = |m: &EdgeHit| {
                known.is_some_and(|t| {
                    let distance = t.distance(a.lerp(b, m.parameter)).abs();
                    let length = a.distance(b);
                    let close = distance <= SAME_SHEET * length
                        || (adopted()
                            && distance <= SAME_SHEET * cuttable.longest_edge_around(ends));
                    // Past a corner of the path it is another sheet, which begins on this one.
                    let has_turned = || {
                        let there = hit(cuttable, &motion.now, ends, m).tangent.normal;
                        t.normal.dot(there).abs() < ALIGNED
                    };
                    close
                        && !(blade.is_straight()
                            && distance > self.options.tolerance * length
                            && has_turned())
                })
            };
            let (meeting, meetings) = blade.first_meeting(&motion.edge(ends), |m| !old(m))?;
            let mut crossed = CrossedEdge {
                meetings,
                ..hit(cuttable, &motion.now, ends, &meeting)
            };
            if self.turned {
                crossed.turn();
            }
            Some(crossed)
        })
    }

    /// Whether the edges met continue what this stroke has cut, with their normals the other way around: the blade goes
    /// back over its own surface.
    ///
    /// Counts the particles on the surface in the tets around each edge, those where it runs the same way and closely.
    /// Away from all of them the last hits tell.
    fn runs_against(&self, cuttable: &CuttableMesh, hits: &[CrossedEdge]) -> bool {
        let mesh = &cuttable.mesh;
        let vote = |ours: DVec3, theirs: DVec3| {
            let cosine = ours.dot(theirs);
            i64::from(cosine >= ALIGNED) - i64::from(cosine <= -ALIGNED)
        };
        let votes = parallel::map(hits, |hit| {
            let [a, b] = hit.crossing.ends;
            let close = SAME_SHEET * mesh.positions[a.index()].distance(mesh.positions[b.index()]);
            let around = cuttable.around(a).map(|tet| mesh.tets[tet.index()]);
            let corners = around.filter(|tet| tet.contains(&b)).flatten();
            let tangents = corners.filter_map(|corner| self.surface.tangent(corner));
            let beside = tangents.filter(|theirs| {
                hit.tangent.distance(theirs.point).abs() <= close
                    && theirs.distance(hit.tangent.point).abs() <= close
            });
            let votes = beside.map(|theirs| vote(hit.tangent.normal, theirs.normal));
            votes.sum::<i64>()
        });
        let beside: i64 = votes.into_iter().sum();
        if beside != 0 {
            return beside < 0;
        }
        let last = hits.iter().filter_map(|hit| {
            let heading = self.heading.get(hit.segment)?;
            Some(vote(hit.tangent.normal, *heading))
        });
        last.sum::<i64>() < 0
    }

    /// Notes the mean normals of hits.
    fn note_heading(&mut self, hits: &[CrossedEdge]) {
        let segments = hits.iter().map(|hit| hit.segment + 1).max().unwrap_or(0);
        let mut sums = vec![DVec3::ZERO; segments.max(self.heading.len())];
        self.heading.resize(sums.len(), DVec3::ZERO);
        for hit in hits {
            sums[hit.segment] += hit.tangent.normal;
        }
        for (heading, sum) in self.heading.iter_mut().zip(sums) {
            *heading = sum.normalize_or(*heading);
        }
    }

    /// The particles whose stars can separate: the fresh ones and those on the surface beside them. Ascending.
    fn seeds(&self, cuttable: &CuttableMesh, fresh: &[ParticleId]) -> Vec<ParticleId> {
        let around = fresh.iter().flat_map(|&p| cuttable.around(p));
        let mut seeds: Vec<ParticleId> = around
            .flat_map(|tet| cuttable.mesh.tets[tet.index()])
            .filter(|&p| self.surface.contains(p))
            .collect();
        seeds.sort_unstable();
        seeds.dedup();
        seeds
    }
}

/// The particles of the edges that the blade touches where it stands, with the surface there. Ascending.
fn touched(
    cuttable: &CuttableMesh,
    now: &[DVec3],
    edges: &[[ParticleId; 2]],
    blade: &impl Blade,
) -> Vec<(ParticleId, Tangent)> {
    let mut lengths: Vec<(ParticleId, f64)> = Vec::with_capacity(2 * edges.len());
    for &[a, b] in edges {
        let length = now[a.index()].distance(now[b.index()]);
        lengths.extend([(a, length), (b, length)]);
    }
    lengths.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)));
    lengths.dedup_by_key(|(particle, _)| *particle);
    parallel::filter_map(&lengths, |&(particle, length)| {
        let normal = blade.touches(now[particle.index()], length)?;
        let tangent = Tangent {
            point: cuttable.mesh.positions[particle.index()],
            normal: pull_back(cuttable, now, cuttable.around(particle), normal)?,
        };
        Some((particle, tangent))
    })
}

/// The edges of the given tets, each once, ascending.
fn edges_of(mesh: &TetMesh, tets: &[TetId]) -> Vec<[ParticleId; 2]> {
    // Both ends in one number, which sorts at less than half the cost of a pair.
    let mut edges: Vec<u64> = Vec::with_capacity(6 * tets.len());
    for tet in tets {
        let c = mesh.tets[tet.index()].map(|p| p.0);
        for (i, j) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            edges.push(u64::from(c[i].min(c[j])) << 32 | u64::from(c[i].max(c[j])));
        }
    }
    edges.sort_unstable();
    edges.dedup();
    let ends = |edge: u64| {
        let [a, b, c, d, e, f, g, h] = edge.to_be_bytes();
        [[a, b, c, d], [e, f, g, h]].map(|end| ParticleId(u32::from_be_bytes(end)))
    };
    edges.into_iter().map(ends).collect()
}

/// The direction in the rest shape of a normal among the given tets.
///
/// With deformation gradient F, `n · F dX = (Fᵀ n) · dX`: the normal goes back by the transpose, summed over the tets,
/// which are taken in ascending order: the sum must not depend on the order of a list. `None` in a body crushed flat,
/// from which there is no way back.
fn pull_back(
    cuttable: &CuttableMesh,
    now: &[DVec3],
    tets: impl Iterator<Item = TetId>,
    present: DVec3,
) -> Option<DVec3> {
    let rest = &cuttable.mesh.positions;
    let edges_from = |values: &[DVec3], c: [ParticleId; 4]| {
        let [a, b, c, d] = c.map(|p| values[p.index()]);
        DMat3::from_cols(b - a, c - a, d - a)
    };
    let mut tets: Vec<TetId> = tets.collect();
    tets.sort_unstable();
    let mut normal = DVec3::ZERO;
    for tet in tets {
        let corners = cuttable.mesh.tets[tet.index()];
        let gradient = edges_from(now, corners) * edges_from(rest, corners).inverse();
        normal += (gradient.transpose() * present).normalize_or_zero();
    }
    normal.try_normalize()
}

/// What a meeting says of the surface, with its tangent plane carried back to the rest shape.
fn hit(
    cuttable: &CuttableMesh,
    now: &[DVec3],
    ends: [ParticleId; 2],
    meeting: &EdgeHit,
) -> CrossedEdge {
    let rest = &cuttable.mesh.positions;
    let around = cuttable
        .around(ends[0])
        .filter(|tet| cuttable.mesh.tets[tet.index()].contains(&ends[1]));
    let [a, b] = ends.map(|p| rest[p.index()]);
    // In a body crushed flat the crossed edge itself serves as the normal.
    let along = (b - a).normalize_or_zero() * if meeting.upwards { 1.0 } else { -1.0 };
    let tangent = Tangent {
        point: a + (b - a) * meeting.parameter,
        normal: pull_back(cuttable, now, around, meeting.normal).unwrap_or(along),
    };
    CrossedEdge {
        crossing: Crossing {
            ends,
            parameter: meeting.parameter,
        },
        tangent,
        sides: meeting.sides,
        segment: meeting.segment,
        meetings: 1,
    }
}
