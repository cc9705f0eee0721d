//! [`Sweep`]: a blade moved through the body, cutting as it goes.
//!
//! Each frame, every edge that the blade met since the last frame gets a particle there, and a face opens as soon as
//! all three of its particles lie on the swept surface. So the cut stays behind the blade by less than one tet, the
//! mesh conforms after every frame, and a stroke may stop anywhere. The blade is followed in the material's own time
//! (see the module `meet`), so a body that moves or deforms between frames leaves no gap.
//!
//! A particle is put on the surface (snapped) only before any of its edges is split, else a corner already cut free
//! could be cut off again as a chip of its own. So when the blade first meets an edge of a particle, the surface is
//! continued by its tangent plane through all edges of the particle, which decides as a whole plane would. Where the
//! body moves, a later meeting may come closer to the particle than foreseen; the new particle then keeps the snap
//! distance, which bends the surface as snapping does, the other way.
//!
//! Source: paper section 4.3, with the moving front as described here. Cost of a frame: a pass over particles and tets
//! to find those near the blade, then the cut.

use glam::{DMat3, DVec3};
use incise_mesh::{ParticleId, TetId, TetMesh};

use crate::meet::{Meeting, MovingSegment, meetings};
use crate::near::near_tets;
use crate::operation::{Crossing, Operation};
use crate::plane::require_finite;
use crate::sides::{GivenSides, Sides};
use crate::surface::{SweptSurface, Tangent};
use crate::{CutDelta, CutError, CutOptions, CuttableMesh};

/// A meeting within this fraction of the edge's length from the tangent plane of an end is that same surface again,
/// bent to its particles; one further away is another sheet of a stroke that came back.
const SAME_SHEET: f64 = 0.25;
/// A particle that the surface passed on both sides, and this time within this fraction of an edge, is put on it: the
/// body between the two sheets is thinner than a tet, and cutting both would leave it as a thread.
const BETWEEN: f64 = 0.5;

/// A stroke in progress.
///
/// Faces open only where all three particles lie on this stroke's surface: a stroke that is to meet an earlier one must
/// overlap it by a tet.
///
/// # Example
/// ```
/// use glam::DVec3;
/// use incise_cutting::{CutOptions, CuttableMesh, Sweep};
/// use incise_mesh::generate::kuhn_box;
///
/// let mut body = CuttableMesh::new(kuhn_box([3, 3, 3], DVec3::ONE))?;
/// let blade = |z: f64| [DVec3::new(0.4, -1.0, z), DVec3::new(0.5, 2.0, z)];
/// let positions = body.mesh().positions.clone();
/// let mut stroke = Sweep::new(&body, &positions, &blade(1.2), CutOptions::default())?;
/// for frame in 1..=14 {
///     let positions = body.mesh().positions.clone(); // a body at rest
///     stroke.advance(&mut body, &positions, &blade(1.2 - 0.1 * f64::from(frame)))?;
///     body.check()?;
/// }
/// assert_eq!(body.mesh().pieces().count, 2);
/// # Ok::<(), incise_cutting::CutError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Sweep {
    options: CutOptions,
    blade: Vec<DVec3>,
    /// Positions of the particles at the last pose.
    before: Vec<DVec3>,
    surface: SweptSurface,
    /// Particles one of whose edges was met: whether they are on the surface is decided.
    decided: Vec<bool>,
    given: GivenSides,
}

/// An edge met by the blade, with the surface there.
struct Hit {
    crossing: Crossing,
    tangent: Tangent,
    /// Whether the edge runs from the negative side to the positive one.
    upwards: bool,
}

impl Sweep {
    /// Starts a stroke with the blade (a polyline of at least two points) in its first pose, which does not cut yet.
    ///
    /// # Errors
    /// If the blade or the options are not valid or `positions` has another length than the mesh.
    pub fn new(
        cuttable: &CuttableMesh,
        positions: &[DVec3],
        blade: &[DVec3],
        options: CutOptions,
    ) -> Result<Self, CutError> {
        options.check()?;
        blade
            .iter()
            .try_for_each(|&point| require_finite("a blade point", point))?;
        let length: f64 = blade.windows(2).map(|ends| ends[0].distance(ends[1])).sum();
        if blade.len() < 2 || length < f64::MIN_POSITIVE {
            return Err(CutError::ShortBlade {
                points: blade.len(),
                length,
            });
        }
        require_count(cuttable.mesh(), positions)?;
        Ok(Self {
            options,
            blade: blade.to_vec(),
            before: positions.to_vec(),
            surface: SweptSurface::new(positions.len()),
            decided: vec![false; positions.len()],
            given: GivenSides::default(),
        })
    }

    /// Moves the blade to its next pose and cuts what it meets on the way.
    ///
    /// # Arguments
    /// `positions` are the particles' present positions; between the last call and this one they are taken to have
    /// moved on straight lines, as are the blade's points.
    ///
    /// # Returns
    /// What changed; nothing if the blade met no edge.
    ///
    /// # Errors
    /// If the blade is not finite or has another number of points, or `positions` has another length than the mesh;
    /// nothing is changed then.
    ///
    /// # Determinism
    /// The same history gives the same bits on every machine.
    pub fn advance(
        &mut self,
        cuttable: &mut CuttableMesh,
        positions: &[DVec3],
        blade: &[DVec3],
    ) -> Result<CutDelta, CutError> {
        let _span = tracing::debug_span!("cutting::sweep").entered();
        blade
            .iter()
            .try_for_each(|&point| require_finite("a blade point", point))?;
        if blade.len() != self.blade.len() {
            return Err(CutError::BladeChanged {
                before: self.blade.len(),
                now: blade.len(),
            });
        }
        require_count(cuttable.mesh(), positions)?;

        let pairs = self.blade.windows(2).zip(blade.windows(2));
        let segments: Vec<MovingSegment> = pairs
            .map(|(b, n)| MovingSegment {
                before: [b[0], b[1]],
                now: [n[0], n[1]],
            })
            .collect();
        let mut now = positions.to_vec();
        let mut fresh: Vec<ParticleId> = Vec::new();
        let mut near = near_tets(cuttable.mesh(), &self.before, &now, &segments);
        let mut operation = Operation::begin(cuttable, &self.options);
        // A segment meets an edge three times at most, so after as many rounds nothing can be left to split.
        for _ in 0..=3 * segments.len() {
            let edges = edges_of(&operation.cuttable.mesh, &near);
            let hits = self.hits(operation.cuttable, &edges, &now, &segments);
            if hits.is_empty() {
                break;
            }
            let snapped = self.snap(operation.cuttable, &hits);
            operation.delta.snapped += snapped.len();
            let free = |hit: &Hit| {
                hit.crossing
                    .ends
                    .iter()
                    .all(|p| snapped.binary_search(p).is_err())
            };
            let mut flagged: Vec<Hit> = hits.into_iter().filter(free).collect();
            let reach = self.options.reach();
            for hit in &mut flagged {
                hit.crossing.parameter = hit.crossing.parameter.clamp(reach, 1.0 - reach);
            }
            let crossings: Vec<Crossing> = flagged.iter().map(|hit| hit.crossing).collect();
            near = match operation.split(&crossings) {
                Ok(touched) => touched,
                Err(error) => {
                    operation.roll_back();
                    return Err(error);
                }
            };
            self.given.forget(near.iter().copied());
            fresh.extend(&snapped);
            for hit in flagged {
                fresh.push(ParticleId::new(now.len()));
                for values in [&mut self.before, &mut now] {
                    let [a, b] = hit.crossing.ends.map(|p| values[p.index()]);
                    values.push(a + (b - a) * hit.crossing.parameter);
                }
                self.surface.push(hit.tangent);
                self.decided.push(true);
            }
        }

        let seeds = self.seeds(operation.cuttable, &fresh);
        let along = tets_around(operation.cuttable, &seeds);
        let mesh = &operation.cuttable.mesh;
        let sides = Sides::new(mesh, &self.surface, &mut self.given, &along);
        operation.separate(&seeds, |face| {
            face.particles.iter().all(|&p| self.surface.contains(p)) && sides.differ(face.tets)
        });
        let delta = operation.finish(|rest, c| self.surface.side(rest, c));
        now.extend(
            delta
                .copies
                .iter()
                .map(|p| now[p.index()])
                .collect::<Vec<_>>(),
        );
        self.decided.resize(now.len(), true);
        self.surface.push_copies(&delta.copies);
        self.before = now;
        self.blade.copy_from_slice(blade);
        Ok(delta)
    }

    /// Follows a cut that another stroke made since the last call of [`Sweep::advance`].
    ///
    /// Two strokes at the same time must keep their fronts more than a tet apart where they cross: an edge that one
    /// makes just behind the other's front is not met again, and the body may hang together there.
    ///
    /// # Panics
    /// If `cuttable` is not the mesh as `delta` left it.
    pub fn follow(&mut self, cuttable: &CuttableMesh, delta: &CutDelta) {
        delta.extend_particles(&mut self.before);
        self.given.forget(delta.removed.iter().map(|tet| tet.tet));
        self.surface
            .follow(delta, &cuttable.mesh.positions, self.options.reach());
        self.decided.extend(
            (self.decided.len()..self.before.len())
                .map(|p| self.surface.contains(ParticleId::new(p))),
        );
    }

    /// The edges met in this frame, each with its first meeting that is not with the sheet one of its ends lies on.
    fn hits(
        &self,
        cuttable: &CuttableMesh,
        edges: &[[ParticleId; 2]],
        now: &[DVec3],
        blade: &[MovingSegment],
    ) -> Vec<Hit> {
        let rest = &cuttable.mesh.positions;
        let mut hits = Vec::new();
        for &ends in edges {
            if ends.iter().all(|&p| self.surface.contains(p)) {
                continue;
            }
            let [a, b] = ends.map(ParticleId::index);
            let edge = MovingSegment {
                before: [self.before[a], self.before[b]],
                now: [now[a], now[b]],
            };
            let known = ends.iter().find_map(|&p| self.surface.tangent(p));
            let old = |m: &Meeting| {
                let at = rest[a].lerp(rest[b], m.parameter);
                known
                    .is_some_and(|t| t.distance(at).abs() <= SAME_SHEET * rest[a].distance(rest[b]))
            };
            let all = blade
                .iter()
                .flat_map(|segment| meetings(&edge, segment))
                .filter(|m| !old(m));
            if let Some(meeting) = all.min_by(|m, n| m.time.total_cmp(&n.time)) {
                hits.push(hit(cuttable, now, ends, &meeting));
            }
        }
        hits
    }

    /// Notes what the hits say of their ends, and puts those on the surface that it passes closely.
    fn snap(&mut self, cuttable: &CuttableMesh, hits: &[Hit]) -> Vec<ParticleId> {
        for hit in hits {
            let sides = [!hit.upwards, hit.upwards];
            for (particle, side) in hit.crossing.ends.into_iter().zip(sides) {
                self.surface.see(particle, side);
            }
        }
        let mut snapped: Vec<(ParticleId, Tangent)> = Vec::new();
        for hit in hits {
            let at = hit.crossing.parameter;
            for (particle, fraction) in hit.crossing.ends.into_iter().zip([at, 1.0 - at]) {
                let undecided = !self.decided[particle.index()];
                let close = fraction < self.options.tolerance
                    || (undecided && fraction < self.options.snap)
                    || (undecided && self.passes_closely(cuttable, particle, &hit.tangent))
                    || (fraction < BETWEEN && self.surface.is_seen_on_both(particle));
                if close && !self.surface.contains(particle) {
                    snapped.push((particle, hit.tangent));
                }
            }
        }
        for particle in hits.iter().flat_map(|hit| hit.crossing.ends) {
            self.decided[particle.index()] = true;
        }
        snapped.sort_by_key(|(particle, _)| *particle);
        snapped.dedup_by_key(|(particle, _)| *particle);
        for &(particle, tangent) in &snapped {
            self.surface.put(particle, tangent);
        }
        snapped.into_iter().map(|(particle, _)| particle).collect()
    }

    /// Whether the plane crosses one of the particle's edges within the snap distance from it.
    fn passes_closely(
        &self,
        cuttable: &CuttableMesh,
        particle: ParticleId,
        plane: &Tangent,
    ) -> bool {
        let rest = &cuttable.mesh.positions;
        let here = plane.distance(rest[particle.index()]);
        cuttable.around(particle).any(|tet| {
            cuttable.mesh.tets[tet.index()].iter().any(|&other| {
                let there = plane.distance(rest[other.index()]);
                (here > 0.0) != (there > 0.0)
                    && here.abs() < self.options.snap * (here - there).abs()
            })
        })
    }

    /// The particles whose stars can come apart: the fresh ones and those on the surface beside them. Ascending.
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

/// The tets around the given particles, each once, ascending.
fn tets_around(cuttable: &CuttableMesh, particles: &[ParticleId]) -> Vec<TetId> {
    let mut tets: Vec<TetId> = particles.iter().flat_map(|&p| cuttable.around(p)).collect();
    tets.sort_unstable();
    tets.dedup();
    tets
}

/// The edges of the given tets, each once, ascending.
fn edges_of(mesh: &TetMesh, tets: &[TetId]) -> Vec<[ParticleId; 2]> {
    let mut edges = Vec::with_capacity(6 * tets.len());
    for tet in tets {
        let c = mesh.tets[tet.index()];
        for (i, j) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            edges.push([c[i].min(c[j]), c[i].max(c[j])]);
        }
    }
    edges.sort_unstable();
    edges.dedup();
    edges
}

/// What a meeting says of the surface, with its tangent plane carried back to the rest shape.
///
/// With deformation gradient F, `n · F dX = (Fᵀ n) · dX`: the normal goes back by the transpose, summed over the tets
/// around the edge.
fn hit(cuttable: &CuttableMesh, now: &[DVec3], ends: [ParticleId; 2], meeting: &Meeting) -> Hit {
    let rest = &cuttable.mesh.positions;
    let edges_from = |values: &[DVec3], c: [ParticleId; 4]| {
        let [a, b, c, d] = c.map(|p| values[p.index()]);
        DMat3::from_cols(b - a, c - a, d - a)
    };
    let mut normal = DVec3::ZERO;
    for tet in cuttable.around(ends[0]) {
        let corners = cuttable.mesh.tets[tet.index()];
        if corners.contains(&ends[1]) {
            let gradient = edges_from(now, corners) * edges_from(rest, corners).inverse();
            normal += (gradient.transpose() * meeting.normal).normalize_or_zero();
        }
    }
    let [a, b] = ends.map(|p| rest[p.index()]);
    let upwards = meeting.normal.dot(meeting.edge) > 0.0;
    // In a body crushed flat there is no way back; the crossed edge itself then serves as the normal.
    let along = (b - a).normalize_or_zero() * if upwards { 1.0 } else { -1.0 };
    let tangent = Tangent {
        point: a + (b - a) * meeting.parameter,
        normal: normal.try_normalize().unwrap_or(along),
    };
    Hit {
        crossing: Crossing {
            ends,
            parameter: meeting.parameter,
        },
        tangent,
        upwards,
    }
}

fn require_count(mesh: &TetMesh, positions: &[DVec3]) -> Result<(), CutError> {
    let expected = mesh.positions.len();
    if positions.len() == expected {
        return Ok(());
    }
    Err(CutError::PositionCount {
        expected,
        given: positions.len(),
    })
}
