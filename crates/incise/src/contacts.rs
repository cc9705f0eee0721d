//! [`Contacts`]: what of an island touches, found between its substeps and handed to its solver.
//!
//! A detector (`incise-contact`) follows the cuts of the island's mesh and lists what may touch in the frame to come:
//! pairs of particles across fresh cuts, vertices near triangles, and sharp edges near each other. The lists are colored
//! when their particles change and handed to the solver before the substeps, in which it decides which of them press. In a frame in which
//! many vertices approach other surfaces by more than half an edge, the frame is divided and contacts are found again.
//! What pressed is summed up by pairs of pieces after the frame, for forces and for the events of contacts that begin
//! and end.
//!
//! Bodies that may touch are one island, since what touches is solved together.
//!
//! Source: `incise-contact` and `incise-xpbd`. Cost: that of a detector, about 40 ns a contact to color when the list
//! changes, and a pass over the contacts after the frame.

use std::collections::BTreeMap;

use glam::DVec3;
use incise_coloring::{Order, greedy};
use incise_contact::{BodyPairs, ContactDetector, ContactSettings, ContactState};
use incise_cutting::{CutDelta, CuttableMesh, PieceTracker};
use incise_graph::{Coloring, Incidence};
use incise_mesh::{ParticleId, closest_on_triangle};
use incise_xpbd::{ContactLaw, EdgeContact, FaceContact, FaceLimit, PairContact, SurfaceContact};
use web_time::Instant;

use crate::backend::AnySolver;
use crate::report::{ContactCounts, milliseconds};
use crate::scene::{ContactPairs, ContactSpec};
use crate::validate::{existing, value, within};
use crate::warning::{Warning, WarningCode};
use crate::{Error, Scene};

/// Bytes of a particle in a detector: its body, the head of its list of triangles, where it was and where it was expected,
/// and how it has moved beside its piece.
const PARTICLE: usize = 4 + 4 + 48 + 48 + 24;
/// Bytes of a triangle there: corners and tet, its places in the lists of its corners, and its part of the search tree.
const TRIANGLE: usize = 24 + 24 + 32;
/// Pieces that have touched do so until their gap is this part of a mean edge.
const TOUCHING: f64 = 0.02;
/// A contact that stays deeper than this part of a mean edge is told.
const DEEP: f64 = 0.1;
/// For how long it has to: s, and recovery times, within which an overlap of the start has parted.
const DEEP_TIME: f64 = 0.25;
const RECOVERIES: f64 = 5.0;
/// The pairs of bodies that contact joins into islands, if all that the scene says about it is in its range.
pub(crate) fn pairs(scene: &Scene, bodies: usize) -> Result<Vec<[usize; 2]>, Error> {
    let Some(contact) = &scene.contact else {
        return Ok(Vec::new());
    };
    check(contact)?;
    match &contact.pairs {
        ContactPairs::All => Ok((1..bodies).map(|body| [0, body]).collect()),
        ContactPairs::Only(pairs) => {
            for (i, pair) in pairs.iter().enumerate() {
                let field = format!("contact.pairs[{i}]");
                existing(&field, pair[0], bodies)?;
                existing(&field, pair[1], bodies)?;
                if pair[0] == pair[1] {
                    let range = "a pair of different bodies: self_contact is about one body";
                    return Err(value(field, format!("{pair:?}"), range));
                }
            }
            Ok(pairs.clone())
        }
    }
}

/// Refuses numbers outside their ranges.
pub(crate) fn check(contact: &ContactSpec) -> Result<(), Error> {
    within("contact.friction", contact.friction, 0.0, 1e3)?;
    within("contact.recovery_time", contact.recovery_time, 0.0, 1e3)?;
    within("contact.thickness", contact.thickness, 0.0, 1e9)?;
    Ok(())
}

/// Two pieces that touched in the last frame, by their numbers in an island or in a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Touch {
    /// Ascending.
    pub(crate) pieces: [u32; 2],
    /// On the second piece in N, the mean of the frame.
    pub(crate) force: DVec3,
    /// The torque of the force about the origin in N·m.
    pub(crate) torque: DVec3,
}

/// Two pieces that began to touch, or ended it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TouchChange {
    /// Ascending.
    pub(crate) pieces: [u32; 2],
    pub(crate) begins: bool,
}

/// Two pieces that have overlapped for long, by their numbers in an island.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Overlap {
    /// Ascending; equal where a piece overlaps itself.
    pub(crate) pieces: [u32; 2],
    /// Of the deepest contact, in mean edges.
    pub(crate) depth: f64,
    /// For how long contacts have been deep, in s.
    pub(crate) time: f64,
}

impl Overlap {
    /// The warning about an overlap that does not part; `of_scene` has the numbers in the scene of each piece and of its
    /// body.
    pub(crate) fn warning(&self, of_scene: [(u32, usize); 2]) -> Warning {
        let [(first, of_first), (second, of_second)] = of_scene;
        let who = if first == second {
            format!("piece {first} overlaps itself")
        } else {
            let [low, high] = [first.min(second), first.max(second)];
            format!("pieces {low} and {high} overlap")
        };
        let mut bodies = vec![of_first.min(of_second), of_first.max(of_second)];
        bodies.dedup();
        let message = format!(
            "{who} by {:.0}% of the mean edge, and contacts have been deeper than {:.0}% for {:.2} s: what presses is \
             faster or stronger than contact resolves; use more substeps, press more slowly, or use larger or more equal \
             tets where they touch",
            100.0 * self.depth,
            100.0 * DEEP,
            self.time
        );
        Warning::new(WarningCode::ContactDepth, &bodies, message)
    }
}

/// What of an island touches.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Contacts {
    detector: ContactDetector,
    law: ContactLaw,
    thickness: f64,
    pair_colors: Coloring,
    surface_colors: Coloring,
    /// The contacts of vertices and those of edges as the solver takes them, from the last search.
    surfaces: Vec<SurfaceContact>,
    /// Ascending by pieces.
    touches: Vec<Touch>,
    /// For how long in s a contact has been deep at the end of each frame.
    deep_time: f64,
    /// Whether contacts were never searched for.
    is_new: bool,
    /// Bodies that the first search found inside each other, ascending, with the depth in m, until they are asked for.
    #[cfg_attr(feature = "save", serde(skip))]
    starts_inside: BTreeMap<[u32; 2], f64>,
    /// Those of the frame before.
    #[cfg_attr(feature = "save", serde(skip))]
    before: Vec<Touch>,
    /// Pieces that began to touch or ended it in the last frame, until they are asked for.
    #[cfg_attr(feature = "save", serde(skip))]
    changes: Vec<TouchChange>,
    /// The overlap to warn about, until it is asked for.
    #[cfg_attr(feature = "save", serde(skip))]
    overlap: Option<Overlap>,
    /// What the search and the coloring of the last frame took, until it is asked for.
    #[cfg_attr(feature = "save", serde(skip))]
    milliseconds: f64,
    #[cfg_attr(feature = "save", serde(skip))]
    room: Room,
}

/// Memory that each frame uses again. Nothing in it outlives a frame.
#[derive(Clone, Debug, Default)]
struct Room {
    positions: Vec<DVec3>,
    velocities: Vec<DVec3>,
    /// Whether no force moves a particle.
    fixed: Vec<bool>,
    pairs: Vec<PairContact>,
    /// The depth in m and the particles of the deepest contact at the end of a part of a frame.
    deepest: (f64, [u32; 2]),
    /// The touches of the present frame, one a contact.
    touches: Vec<Touch>,
}

impl Room {
    /// What the detector needs to know for the next `frame_time` s.
    fn state<'a>(
        &'a self,
        mesh: &'a CuttableMesh,
        pieces: &'a PieceTracker,
        frame_time: f64,
    ) -> ContactState<'a> {
        ContactState {
            mesh,
            pieces,
            positions: &self.positions,
            velocities: &self.velocities,
            fixed: &self.fixed,
            frame_time,
        }
    }
}

/// An error of the detector: it comes with wrong input from this crate only, since the scene was checked.
fn inconsistent(error: incise_contact::ContactError) -> Error {
    Error::Inconsistent(error.to_string())
}

fn detector_settings(spec: &ContactSpec) -> ContactSettings {
    ContactSettings {
        bodies: match &spec.pairs {
            ContactPairs::All => BodyPairs::All,
            ContactPairs::Only(pairs) => {
                let number = |body: usize| u32::try_from(body).unwrap_or(u32::MAX);
                BodyPairs::Only(pairs.iter().map(|pair| pair.map(number)).collect())
            }
        },
        self_contact: spec.self_contact,
        thickness: spec.thickness,
        ..ContactSettings::default()
    }
}

fn law(spec: &ContactSpec) -> ContactLaw {
    ContactLaw {
        friction: spec.friction,
        recovery_time: spec.recovery_time,
    }
}

impl Contacts {
    /// Contact of an island that has not moved; `body_of` has the number in the scene of the body of each particle.
    pub(crate) fn new(
        spec: &ContactSpec,
        mesh: &CuttableMesh,
        body_of: Vec<u32>,
    ) -> Result<Self, Error> {
        let detector = ContactDetector::new(mesh, body_of, detector_settings(spec));
        Ok(Self {
            detector: detector.map_err(inconsistent)?,
            law: law(spec),
            thickness: spec.thickness,
            pair_colors: Coloring::default(),
            surface_colors: Coloring::default(),
            surfaces: Vec::new(),
            touches: Vec::new(),
            deep_time: 0.0,
            is_new: true,
            starts_inside: BTreeMap::new(),
            before: Vec::new(),
            changes: Vec::new(),
            overlap: None,
            milliseconds: 0.0,
            room: Room::default(),
        })
    }

    /// Contact of two islands that became one with this mesh and so many pieces of the first. What touches is known
    /// further on. The sides of cuts are no longer told apart by pairs: the search takes care of their particles.
    pub(crate) fn joined(
        spec: &ContactSpec,
        mesh: &CuttableMesh,
        one: &Self,
        other: &Self,
        first_piece: u32,
    ) -> Result<Self, Error> {
        // Without self-contact the sides of a cut touch by the pairs of its particles only, which a new detector lacks.
        let has_pairs = |contacts: &Self| !contacts.detector.pairs().is_empty();
        if !spec.self_contact && (has_pairs(one) || has_pairs(other)) {
            let range = "true where bodies with fresh cuts are joined";
            return Err(value("contact.self_contact", false, range));
        }
        let bodies = [one.detector.body_of(), other.detector.body_of()].concat();
        let mut joined = Self::new(spec, mesh, bodies)?;
        let shifted = |touch: &Touch| Touch {
            pieces: touch.pieces.map(|piece| first_piece + piece),
            ..*touch
        };
        joined.deep_time = one.deep_time.max(other.deep_time);
        joined.touches.clone_from(&one.touches);
        joined.touches.extend(other.touches.iter().map(shifted));
        Ok(joined)
    }

    /// Takes over other settings from the next frame on.
    pub(crate) fn set(&mut self, spec: &ContactSpec) -> Result<(), Error> {
        let settings = detector_settings(spec);
        self.detector.set_settings(settings).map_err(inconsistent)?;
        (self.law, self.thickness) = (law(spec), spec.thickness);
        Ok(())
    }

    /// Follows a cut or a removal of tets; `mesh` is the one after it.
    pub(crate) fn apply_delta(&mut self, mesh: &CuttableMesh, delta: &CutDelta) {
        self.detector.apply_delta(mesh, delta);
    }

    /// Searches in the next update, even if nothing has moved.
    pub(crate) fn search_again(&mut self) {
        self.detector.search_again();
    }

    /// Into how many parts the frame to come is divided.
    pub(crate) fn begin_frame(
        &mut self,
        solver: &AnySolver,
        mesh: &CuttableMesh,
        pieces: &PieceTracker,
        time: f64,
        substeps: u32,
    ) -> u32 {
        let start = Instant::now();
        self.read(solver);
        let parts = self
            .detector
            .intervals(&self.room.state(mesh, pieces, time));
        self.room.touches.clear();
        self.milliseconds = milliseconds(start.elapsed());
        parts.min(substeps)
    }

    fn read(&mut self, solver: &AnySolver) {
        let Room {
            positions,
            velocities,
            fixed,
            ..
        } = &mut self.room;
        let solver = solver.host();
        solver.positions(positions);
        solver.velocities(velocities);
        solver.held(fixed);
    }

    /// Finds what may touch in a part of a frame, which takes `time` s, and hands it to the solver. Part 0 begins with the
    /// state that [`Self::begin_frame`] has read.
    pub(crate) fn update(
        &mut self,
        solver: &mut AnySolver,
        mesh: &CuttableMesh,
        pieces: &PieceTracker,
        part: u32,
        time: f64,
    ) -> Result<(), Error> {
        let start = Instant::now();
        if part > 0 {
            self.read(solver);
        }
        let update = self.detector.update(&self.room.state(mesh, pieces, time));
        if std::mem::take(&mut self.is_new) {
            self.note_start();
        }
        let particles = self.room.positions.len();
        let pairs = self.detector.pairs();
        if update.pairs_changed || pairs.len() != self.pair_colors.vertex_count() {
            let all = pairs.iter().map(|contact| contact.particles);
            self.pair_colors = colors(particles, all)?;
        }
        let (faces, edges) = (self.detector.faces().len(), self.detector.edges().len());
        let lists = update.faces_changed || update.edges_changed;
        if update.searched || lists || faces + edges != self.surfaces.len() {
            self.list_surfaces(&mesh.mesh().positions);
            if lists || self.surfaces.len() != self.surface_colors.vertex_count() {
                let all = self.surfaces.iter().map(SurfaceContact::particles);
                self.surface_colors = colors(particles, all)?;
            }
        } else {
            let edges = self.detector.edges().iter();
            for (contact, known) in edges.zip(&mut self.surfaces[faces..]) {
                if let SurfaceContact::Edges(known) = known {
                    known.normal = contact.normal;
                }
            }
        }
        let (room, pairs) = (&mut self.room, self.detector.pairs());
        room.pairs.clear();
        room.pairs.extend(pairs.iter().map(|contact| PairContact {
            particles: contact.particles,
            normal: contact.normal,
        }));
        let pairs = (&room.pairs[..], &self.pair_colors);
        let surfaces = (&self.surfaces[..], &self.surface_colors);
        let set = solver.edit()?.set_contacts(&self.law, pairs, surfaces);
        set.map_err(Error::xpbd("contact"))?;
        self.milliseconds += milliseconds(start.elapsed());
        Ok(())
    }

    /// Takes over the contacts between surfaces from the detector. Between surfaces of one body, a thickness is at most
    /// their distance at rest.
    fn list_surfaces(&mut self, rest: &[DVec3]) {
        let bodies = self.detector.body_of();
        let thickness = |[one, other]: [u32; 2], distance: &dyn Fn() -> f64| {
            if self.thickness > 0.0 && bodies[one as usize] == bodies[other as usize] {
                self.thickness.min(distance())
            } else {
                self.thickness
            }
        };
        self.surfaces.clear();
        self.surfaces
            .extend(self.detector.faces().iter().map(|contact| {
                let [vertex, corner, ..] = contact.particles;
                let distance = || {
                    let [x, a, b, c] = contact.particles.map(|p| rest[p as usize]);
                    x.distance(closest_on_triangle([a, b, c], x).point)
                };
                SurfaceContact::Face(FaceContact {
                    particles: contact.particles,
                    beyond: contact.beyond,
                    limit: contact.limit.map(|limit| FaceLimit {
                        normal: limit.normal,
                        distance: limit.distance,
                    }),
                    thickness: thickness([vertex, corner], &distance),
                })
            }));
        self.surfaces
            .extend(self.detector.edges().iter().map(|contact| {
                let [end, _, other, _] = contact.particles;
                SurfaceContact::Edges(EdgeContact {
                    particles: contact.particles,
                    normal: contact.normal,
                    thickness: thickness([end, other], &|| contact.distance(rest)),
                })
            }));
    }

    /// Notes what pressed in the part of the frame that has ended.
    pub(crate) fn note(&mut self, solver: &AnySolver, mesh: &CuttableMesh, pieces: &PieceTracker) {
        let piece_of = |particle: u32| {
            let mut around = mesh.around(ParticleId(particle));
            around.next().map(|tet| pieces.piece_of(tet))
        };
        let (near, touches) = (TOUCHING * self.detector.mean_edge(), &self.touches);
        let touched =
            |pieces: &[u32; 2]| touches.binary_search_by_key(pieces, |t| t.pieces).is_ok();
        let Room {
            touches: out,
            deepest,
            ..
        } = &mut self.room;
        *deepest = (0.0, [0; 2]);
        solver.host().for_each_contact(&mut |contact| {
            if contact.depth > deepest.0 {
                *deepest = (contact.depth, [contact.against, contact.vertex]);
            }
            let presses = contact.pressure > 0.0;
            if !presses && contact.depth < -near {
                return;
            }
            let of = [contact.against, contact.vertex].map(piece_of);
            let [Some(against), Some(vertex)] = of else {
                return;
            };
            let pieces = [against.min(vertex), against.max(vertex)];
            // A piece that touches itself is not an event, and its forces add up to nothing.
            if against == vertex || !(presses || touched(&pieces)) {
                return;
            }
            let sign = if vertex > against { 1.0 } else { -1.0 };
            let force = sign * contact.force;
            let torque = contact.point.cross(force);
            out.push(Touch {
                pieces,
                force,
                torque,
            });
        });
    }

    /// Judges the depth at the end of a frame of `time` s, after [`Self::note`]. Once contacts have been deep for long
    /// there is an [`Overlap`]; the next one comes only after a frame without a deep contact.
    pub(crate) fn judge_depth(&mut self, mesh: &CuttableMesh, pieces: &PieceTracker, time: f64) {
        let (deepest, particles) = self.room.deepest;
        let depth = deepest / self.detector.mean_edge();
        // No number without an edge.
        if depth.partial_cmp(&DEEP) != Some(std::cmp::Ordering::Greater) {
            self.deep_time = 0.0;
            return;
        }
        let limit = DEEP_TIME + RECOVERIES * self.law.recovery_time;
        let was_told = self.deep_time > limit;
        self.deep_time += time;
        if was_told || self.deep_time <= limit {
            return;
        }
        let piece_of = |particle: u32| {
            let mut around = mesh.around(ParticleId(particle));
            around.next().map(|tet| pieces.piece_of(tet))
        };
        if let [Some(a), Some(b)] = particles.map(piece_of) {
            self.overlap = Some(Overlap {
                pieces: [a.min(b), a.max(b)],
                depth,
                time: self.deep_time,
            });
        }
    }

    /// Notes the bodies that the first search found deep inside each other, where a contact can part them.
    fn note_start(&mut self) {
        let (detector, positions) = (&self.detector, &self.room.positions);
        let is_fixed = |p: &u32| self.room.fixed.get(*p as usize) == Some(&true);
        let body_of = detector.body_of();
        for contact in detector.faces() {
            let [vertex, corner, ..] = contact.particles;
            let [one, other] = [vertex, corner].map(|p| body_of[p as usize]);
            let depth = -contact.gap(positions);
            let moves = !contact.particles.iter().all(is_fixed);
            if one != other && moves && depth > DEEP * detector.mean_edge() {
                let deepest = self.starts_inside.entry([one.min(other), one.max(other)]);
                let deepest = deepest.or_default();
                *deepest = deepest.max(depth);
            }
        }
    }

    /// Takes the bodies of the scene that were inside each other at the first search, with the depth in m.
    pub(crate) fn take_starts_inside(&mut self) -> BTreeMap<[u32; 2], f64> {
        std::mem::take(&mut self.starts_inside)
    }

    /// Takes the overlap that became worth a warning in the last frame.
    pub(crate) fn take_overlap(&mut self) -> Option<Overlap> {
        self.overlap.take()
    }

    /// Sums up what was noted, by pieces.
    pub(crate) fn end_frame(&mut self) {
        std::mem::swap(&mut self.before, &mut self.touches);
        self.touches.clear();
        // Stable, so that sums are taken in the order of solving.
        self.room.touches.sort_by_key(|touch| touch.pieces);
        for touch in &self.room.touches {
            match self.touches.last_mut() {
                Some(last) if last.pieces == touch.pieces => {
                    last.force += touch.force;
                    last.torque += touch.torque;
                }
                _ => self.touches.push(*touch),
            }
        }
        let (before, now) = (&self.before, &self.touches);
        for (these, others, begins) in [(now, before, true), (before, now, false)] {
            let all = these.iter().map(|touch| touch.pieces);
            let is_new =
                |pieces: &[u32; 2]| others.binary_search_by_key(pieces, |t| t.pieces).is_err();
            let new = all.filter(is_new);
            self.changes
                .extend(new.map(|pieces| TouchChange { pieces, begins }));
        }
    }

    /// Lets go of all contacts, where there is nothing left that could touch.
    pub(crate) fn end(&mut self, solver: &mut AnySolver) -> Result<(), Error> {
        self.room.touches.clear();
        self.deep_time = 0.0;
        self.end_frame();
        (self.pair_colors, self.surface_colors) = (Coloring::default(), Coloring::default());
        self.surfaces.clear();
        let none = Coloring::default();
        let solver = solver.edit()?;
        let set = solver.set_contacts(&self.law, (&[], &none), (&[], &none));
        set.map_err(Error::xpbd("contact"))
    }

    /// Pieces that touched in the last frame, ascending.
    pub(crate) fn touches(&self) -> &[Touch] {
        &self.touches
    }

    /// Takes the pieces that began to touch in the last frame, then those that ended it, each ascending.
    pub(crate) fn take_changes(&mut self) -> Vec<TouchChange> {
        std::mem::take(&mut self.changes)
    }

    /// Takes the milliseconds that finding and coloring took in the last frame.
    pub(crate) fn take_milliseconds(&mut self) -> f64 {
        std::mem::take(&mut self.milliseconds)
    }

    /// Counts, and appends to `depths` how deep each contact is that pressed or overlaps, in mean edges.
    pub(crate) fn count(&self, solver: &AnySolver, depths: &mut Vec<f64>) -> ContactCounts {
        let edge = self.detector.mean_edge();
        let mut counts = ContactCounts {
            buried: self.detector.buried(),
            ..ContactCounts::default()
        };
        let solver = solver.host();
        counts.colors = solver.contact_color_count();
        counts.candidates = solver.contact_counts().iter().sum();
        solver.for_each_contact(&mut |contact| {
            let presses = contact.pressure > 0.0;
            counts.active += usize::from(presses);
            if presses || contact.depth > 0.0 {
                depths.push(contact.depth.max(0.0) / edge);
            }
        });
        counts
    }

    /// About the bytes of a copy.
    pub(crate) fn bytes(&self) -> usize {
        let particles = self.detector.body_of().len();
        let triangles = self.detector.surface().triangle_count();
        particles * PARTICLE
            + triangles * TRIANGLE
            + size_of_val(&*self.surfaces)
            + size_of_val(self.detector.faces())
            + size_of_val(self.detector.edges())
            + size_of_val(self.detector.pairs())
    }

    /// Recomputes what follows from the mesh and compares.
    pub(crate) fn check(&self, mesh: &CuttableMesh) -> Result<(), Error> {
        self.detector.check(mesh).map_err(inconsistent)
    }
}

/// Colors by first fit in the order of the list, which is that of its keys.
fn colors<const K: usize>(
    particles: usize,
    contacts: impl Iterator<Item = [u32; K]>,
) -> Result<Coloring, Error> {
    let incidence = Incidence::from_constraints(particles, contacts)?;
    Ok(greedy(&incidence, Order::Natural))
}
