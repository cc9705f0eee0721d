//! [`ContactDetector`]: finds what touches, frame by frame, while bodies move and are cut.
//!
//! Once a frame, [`ContactDetector::update`] lists the contacts that the frame may meet. The candidates of the search
//! are kept as long as surfaces have moved towards each other by less than a skin; the pairs of fresh cuts, which need
//! no search, are evaluated each frame. The solver takes the plain records and decides in each substep which of them
//! act.
//!
//! Of the candidates, those are listed that the frame may bring together. How far to look ahead is known by vertex: the
//! motion of a part as a whole towards others, and what the vertex moves beside it. So a fast corner of a sliver looks
//! far, and what rests beside it does not. What none of the particles involved can change is not listed unless it overlaps.
//!
//! What is near is known by parts: the pieces of all bodies. Two parts whose boxes are out of reach of each other do not
//! matter to each other, however fast they part or pass, and a part that turns as a whole does not approach itself.
//!
//! The decision to search again depends on positions, velocities and frame time only, so results are the same for any
//! number of threads. The shape of the search tree does not matter either: candidates are sorted by vertex, then by
//! distance and face.
//!
//! Cost: an update without a search is three passes over the surface vertices, and one over the candidates and the twins; a
//! search is a refit of the trees and a query for each surface vertex and each feature edge, on all threads; a delta costs what the boundary lost and
//! gained. The first search also looks for vertices that start inside of other parts, among all tets. The search after a
//! cut builds a tree over the new triangles, and over all of them once these are more than a
//! quarter.

use glam::DVec3;
use incise_cutting::{BoundaryTriangle, CutDelta, CuttableMesh};
use incise_mesh::{Bounds, ParticleId, TetId};
use rayon::prelude::*;

use crate::ContactError;
use crate::edges::{EdgeContact, FeatureEdges, turn};
use crate::face::FaceContact;
use crate::index::{NONE, index};
use crate::normals::{Owner, PlacedTriangle, Shape};
use crate::pairs::{FreshPairs, PairContact};
use crate::parts::Part;
use crate::query::{Found, Query};
use crate::settings::ContactSettings;
use crate::state::ContactState;
use crate::surface::{ContactSurface, SurfaceChange};
use crate::tree::{Box32, TriangleTree};
use crate::walk::Barycentric;

/// New triangles as a fraction of those in the main tree beyond which that is built again.
const FRESH: usize = 4;
/// Triangles or vertices that are not worth another thread.
const PARALLEL: usize = 512;
/// A candidate whose vertex has moved along its triangle by this in barycentric coordinates is searched for again.
const SLID: f64 = 0.5;
/// It has to have moved by this fraction of the skin at least: on a sliver half a barycentric coordinate is nothing.
const SLID_SKIN: f64 = 0.5;
/// A vertex inside that has gone deeper by this fraction of the reach is searched for again, before it gets out of reach.
const DEEPER: f64 = 0.25;
/// A candidate whose vertex lies beneath a point this far beyond its triangle is searched for again.
const BEYOND: f64 = 0.25;
/// Candidates are listed that are apart by this fraction of the skin more than the frame may bring them together: what
/// speeds up within the frame may come further.
const SPARE: f64 = 0.5;

/// What an update changed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ContactUpdate {
    /// Whether candidates were searched for.
    pub searched: bool,
    /// Whether [`ContactDetector::pairs`] has other particles than before; normals change all the time.
    pub pairs_changed: bool,
    /// Whether [`ContactDetector::faces`] has other particles than before.
    pub faces_changed: bool,
    /// Whether [`ContactDetector::edges`] has other particles than before; normals change all the time.
    pub edges_changed: bool,
}

/// A candidate beside its record: where it was found.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Sighting {
    /// The barycentric coordinates of the vertex in the plane of the triangle, the second and the third.
    weights: [f64; 2],
    /// How far apart they were.
    gap: f64,
}

/// Finds contacts between bodies, pieces and the sides of cuts.
///
/// # Example
/// ```
/// use glam::DVec3;
/// use incise_contact::{ContactDetector, ContactSettings, ContactState};
/// use incise_cutting::{CutOptions, CuttableMesh, PieceTracker, Plane, cut_plane};
/// use incise_mesh::kuhn_box;
///
/// let mut body = CuttableMesh::new(kuhn_box([4, 2, 2], DVec3::new(2.0, 1.0, 1.0)))?;
/// let mut pieces = PieceTracker::new(&body);
/// let body_of = vec![0; body.mesh().positions.len()];
/// let mut contacts = ContactDetector::new(&body, body_of, ContactSettings::default())?;
///
/// let mut positions = body.mesh().positions.clone();
/// let plane = Plane { point: DVec3::splat(0.8), normal: DVec3::X };
/// let delta = cut_plane(&mut body, &positions, &plane, &CutOptions::default())?;
/// delta.extend_particles(&mut positions);
/// pieces.apply_delta(&body, &delta);
/// contacts.apply_delta(&body, &delta);
///
/// let velocities = vec![DVec3::ZERO; positions.len()];
/// let state = ContactState {
///     mesh: &body,
///     pieces: &pieces,
///     positions: &positions,
///     velocities: &velocities,
///     fixed: &[],
///     frame_time: 1.0 / 60.0,
/// };
/// contacts.update(&state);
/// // The two sides of the cut touch, at a gap of exactly 0.
/// assert_eq!(contacts.pairs().len(), delta.copies.len());
/// assert!(contacts.pairs().iter().all(|pair| pair.gap(&positions) == 0.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ContactDetector {
    settings: ContactSettings,
    surface: ContactSurface,
    fresh_pairs: FreshPairs,
    /// By particle.
    body_of: Vec<u32>,
    /// The mean edge of the surface at rest.
    mean_edge: f64,
    /// Over the first slots of the surface.
    main: TriangleTree,
    /// Over the slots from the end of the main tree on.
    fresh: TriangleTree,
    fresh_is_due: bool,
    /// Slots that the main tree was built over.
    main_slots: usize,
    pairs: Vec<PairContact>,
    /// All that the last search found, and where.
    face_candidates: Vec<FaceContact>,
    sightings: Vec<Sighting>,
    edge_candidates: Vec<EdgeContact>,
    /// Those that the frame may bring together.
    faces: Vec<FaceContact>,
    edges: Vec<EdgeContact>,
    features: FeatureEdges,
    /// Whether the surface has changed since they were listed.
    features_are_due: bool,
    /// The vertices inside another part, ascending, each with the tet that contains it.
    inside: Vec<(ParticleId, TetId)>,
    deep: usize,
    buried: usize,
    /// The surface vertices, ascending.
    vertices: Vec<u32>,
    /// The piece of each of them.
    parts: Vec<u32>,
    /// Where they were at the last search.
    searched_at: Vec<DVec3>,
    /// How far the last search reached in m.
    reach: f64,
    /// Whether the next update has to search.
    search_is_due: bool,
    /// Whether the next search has to look for vertices inside of other parts everywhere. Later ones know which they
    /// are: a vertex gets inside through the outer tets, which the search looks at.
    location_is_due: bool,
    #[cfg_attr(feature = "serde", serde(skip))]
    room: Room,
}

/// Memory of a search that is used again by the next one. Nothing in it outlives a search.
#[derive(Clone, Debug, Default)]
struct Room {
    boxes: Vec<Box32>,
    placed: Vec<PlacedTriangle>,
    found: Vec<Found>,
    last_faces: Vec<FaceContact>,
    last_edges: Vec<EdgeContact>,
    last_pairs: Vec<PairContact>,
    last_inside: Vec<(ParticleId, TetId)>,
    /// By particle.
    ahead: Vec<Ahead>,
    /// By piece.
    parts: Vec<Part>,
    /// The pieces in the order of their boxes along x.
    sorted: Vec<u32>,
    change: SurfaceChange,
}

impl ContactDetector {
    /// A detector for a mesh; `body_of` gives the body of each particle, numbered as [`ContactSettings::bodies`] does.
    /// O(n log n).
    ///
    /// # Errors
    /// [`ContactError::Setting`] or [`ContactError::Bodies`].
    pub fn new(
        mesh: &CuttableMesh,
        body_of: Vec<u32>,
        settings: ContactSettings,
    ) -> Result<Self, ContactError> {
        settings.check()?;
        let mut detector = Self {
            settings,
            surface: ContactSurface::default(),
            fresh_pairs: FreshPairs::default(),
            body_of: Vec::new(),
            mean_edge: 0.0,
            main: TriangleTree::default(),
            fresh: TriangleTree::default(),
            fresh_is_due: false,
            main_slots: 0,
            pairs: Vec::new(),
            face_candidates: Vec::new(),
            sightings: Vec::new(),
            edge_candidates: Vec::new(),
            faces: Vec::new(),
            edges: Vec::new(),
            features: FeatureEdges::default(),
            features_are_due: true,
            inside: Vec::new(),
            deep: 0,
            buried: 0,
            vertices: Vec::new(),
            parts: Vec::new(),
            searched_at: Vec::new(),
            reach: 0.0,
            search_is_due: true,
            location_is_due: true,
            room: Room::default(),
        };
        detector.rebuild(mesh, body_of)?;
        Ok(detector)
    }

    /// Starts over with another mesh, as after bodies were added or removed; fresh pairs are forgotten, so that the
    /// search takes care of their particles. O(n log n).
    ///
    /// # Errors
    /// [`ContactError::Bodies`] if `body_of` has another length than the mesh has particles; nothing is changed then.
    pub fn rebuild(&mut self, mesh: &CuttableMesh, body_of: Vec<u32>) -> Result<(), ContactError> {
        let (given, particles) = (body_of.len(), mesh.mesh().positions.len());
        if given != particles {
            return Err(ContactError::Bodies { given, particles });
        }
        self.body_of = body_of;
        self.surface.rebuild(mesh);
        self.fresh_pairs.clear();
        self.mean_edge = self.surface.mean_edge(&mesh.mesh().positions);
        self.forget();
        Ok(())
    }

    /// Drops what refers to the surface of before.
    fn forget(&mut self) {
        self.main.clear();
        self.fresh.clear();
        self.main_slots = 0;
        self.fresh_is_due = true;
        self.search_is_due = true;
        self.location_is_due = true;
        self.inside.clear();
        self.face_candidates.clear();
        self.sightings.clear();
        self.edge_candidates.clear();
        self.faces.clear();
        self.edges.clear();
        self.features.clear();
        self.features_are_due = true;
        self.pairs.clear();
    }

    /// Changes the settings between frames. The next update searches.
    ///
    /// # Errors
    /// [`ContactError::Setting`]; nothing is changed then.
    pub fn set_settings(&mut self, settings: ContactSettings) -> Result<(), ContactError> {
        settings.check()?;
        self.settings = settings;
        self.search_is_due = true;
        Ok(())
    }

    /// Searches in the next update, even if nothing has moved: to measure what a search costs.
    pub fn search_again(&mut self) {
        self.search_is_due = true;
    }

    /// The settings.
    #[must_use]
    pub fn settings(&self) -> &ContactSettings {
        &self.settings
    }

    /// Follows a cut or a removal; `mesh` is the one after it. New particles belong to the bodies of those they were made
    /// of. Costs what the boundary lost and gained; the next update searches.
    ///
    /// # Panics
    /// If the delta does not follow the last one.
    pub fn apply_delta(&mut self, mesh: &CuttableMesh, delta: &CutDelta) {
        let change = &mut self.room.change;
        self.surface.follow(mesh, delta, change);
        self.fresh_pairs.follow(mesh, &self.surface, delta, change);
        for point in &delta.points {
            self.body_of.push(self.body_of[point.ends[0].index()]);
        }
        for source in &delta.copies {
            self.body_of.push(self.body_of[source.index()]);
        }
        let is_deleted = |tet: TetId| delta.deleted.binary_search_by_key(&tet, |d| d.tet).is_ok();
        // Other tets take over the volume of those that an improvement deletes.
        let mut inside = self.inside.iter();
        self.location_is_due |= delta.collapsed > 0 && inside.any(|(_, tet)| is_deleted(*tet));
        self.inside.retain(|(_, tet)| !is_deleted(*tet));
        for (_, tet) in &mut self.inside {
            *tet = delta.slot_after(*tet);
        }
        self.fresh_is_due = true;
        self.features_are_due = true;
        self.search_is_due = true;
    }

    /// Takes the last cut or removal back; `mesh` is the one before it. Pairs that it ended do not come back, those that
    /// it made are gone. Costs what the boundary lost and gained; the next update searches.
    ///
    /// # Panics
    /// If the delta was not the last one.
    pub fn undo(&mut self, mesh: &CuttableMesh, delta: &CutDelta) {
        let change = &mut self.room.change;
        self.surface.follow_back(mesh, delta, change);
        self.fresh_pairs
            .follow_back(mesh, &self.surface, delta, change);
        self.body_of.truncate(delta.particles_before);
        let before = |tet: TetId| {
            let moved = delta.moved.binary_search_by_key(&tet, |moved| moved.to);
            moved.map_or(tet, |i| delta.moved[i].from)
        };
        self.inside.retain_mut(|(particle, tet)| {
            *tet = before(*tet);
            particle.index() < delta.particles_before && tet.index() < delta.tets_before
        });
        self.fresh_is_due = true;
        self.features_are_due = true;
        self.search_is_due = true;
    }

    /// Lists the contacts that the next `frame_time` may meet. Asks for no memory once it has as much as it needs.
    ///
    /// # Panics
    /// If positions or velocities are not as many as the particles of the mesh, or a delta was left out.
    ///
    /// # Determinism
    /// Equal input gives the same bits for any number of threads.
    pub fn update(&mut self, state: &ContactState<'_>) -> ContactUpdate {
        let particles = state.mesh.mesh().positions.len();
        assert_eq!(
            state.positions.len(),
            particles,
            "a position for each particle"
        );
        assert_eq!(
            state.velocities.len(),
            particles,
            "a velocity for each particle"
        );
        assert_eq!(self.body_of.len(), particles, "all deltas were followed");

        if self.search_is_due {
            self.list_vertices(state);
        }
        let moved = self.survey(state);
        let skin = self.settings.skin * self.mean_edge;
        let reach = skin + moved.margin + self.settings.thickness;

        let near = self.near(state);
        std::mem::swap(&mut self.pairs, &mut self.room.last_pairs);
        let ahead = &self.room.ahead;
        let is_near = |[a, b]: [u32; 2], gap: f64| near.of(ahead, &[a], &[b], gap);
        let evaluated =
            self.fresh_pairs
                .evaluate(&self.surface, state.positions, is_near, &mut self.pairs);
        let searched = self.search_is_due
            || evaluated.retired
            || moved.needed > self.reach
            || moved.needed.is_nan()
            || self.has_slid(state);
        let mut update = ContactUpdate {
            searched,
            ..ContactUpdate::default()
        };
        if searched {
            self.reach = reach;
            self.search(state);
        } else {
            turn(&mut self.edge_candidates, state.positions);
        }
        self.list(state);
        update.faces_changed = differ(&self.faces, &self.room.last_faces, |c| c.particles);
        update.edges_changed = differ(&self.edges, &self.room.last_edges, |c| c.particles);
        update.pairs_changed = differ(&self.pairs, &self.room.last_pairs, |c| c.particles);
        update
    }

    /// What decides which contacts are near.
    fn near<'s>(&self, state: &ContactState<'s>) -> Near<'s> {
        let skin = self.settings.skin * self.mean_edge;
        Near {
            fixed: state.fixed,
            spare: SPARE * skin + self.settings.thickness,
            limit: self.settings.reach * self.mean_edge,
        }
    }

    /// Lists the candidates that the frame may bring together.
    fn list(&mut self, state: &ContactState<'_>) {
        let near = self.near(state);
        let Room {
            ahead,
            last_faces,
            last_edges,
            ..
        } = &mut self.room;
        std::mem::swap(&mut self.faces, last_faces);
        std::mem::swap(&mut self.edges, last_edges);
        self.faces.clear();
        self.edges.clear();
        let faces = self.face_candidates.iter().filter(|contact| {
            let [vertex, corners @ ..] = &contact.particles;
            let gap = contact.gap(state.positions);
            near.of(ahead, std::slice::from_ref(vertex), corners, gap)
        });
        self.faces.extend(faces);
        let edges = self.edge_candidates.iter().filter(|contact| {
            let (one, other) = contact.particles.split_at(2);
            near.of(ahead, one, other, contact.separation(state.positions))
        });
        self.edges.extend(edges);
    }

    /// Into how many equal parts the frame should be divided, each with an update of its own: 1, 2 or 4. More than 1 if
    /// surfaces that may meet in the frame may approach each other by more than the search looks ahead. O(surface
    /// vertices + pieces²).
    ///
    /// # Panics
    /// If there are fewer positions or velocities than particles, or a delta was left out.
    #[must_use]
    pub fn intervals(&mut self, state: &ContactState<'_>) -> u32 {
        if self.search_is_due {
            self.list_vertices(state);
        }
        self.fit_parts(state);
        let ahead = (self.settings.reach + self.settings.skin) * self.mean_edge;
        let mut most = 0.0_f64;
        let parts = self.room.parts.iter().filter(|part| part.body != NONE);
        for (i, one) in parts.clone().enumerate() {
            if self.settings.self_contact {
                let [_, speed] = one.within();
                most = most.max(speed * state.frame_time);
            }
            for other in parts.clone().skip(i + 1) {
                let may_touch =
                    one.body == other.body || self.settings.bodies.allow(one.body, other.body);
                let approach = one.fastest(other) * state.frame_time;
                let around = one.bounds.widened(approach + ahead);
                if may_touch && around.overlaps(&other.bounds) {
                    most = most.max(approach);
                }
            }
        }
        match most {
            approach if approach <= ahead => 1,
            approach if approach <= 2.0 * ahead => 2,
            _ => 4,
        }
    }

    /// The surface vertices and their pieces.
    fn list_vertices(&mut self, state: &ContactState<'_>) {
        self.vertices.clear();
        self.parts.clear();
        for vertex in self.surface.vertices() {
            let triangle = self.surface.fan(vertex).next();
            self.vertices.push(vertex.0);
            self.parts
                .push(triangle.map_or(0, |triangle| state.pieces.piece_of(triangle.tet)));
        }
        self.searched_at.clear();
    }

    /// Finds the boxes and the motions of all parts.
    fn fit_parts(&mut self, state: &ContactState<'_>) {
        let parts = &mut self.room.parts;
        let number = self.parts.iter().map(|&part| part as usize);
        let motions = self.vertices.iter().enumerate().map(|(i, &vertex)| {
            let x = state.positions[vertex as usize];
            // Where a search is due there is nothing to compare with.
            let moved = self
                .searched_at
                .get(i)
                .map_or(DVec3::ZERO, |before| x - *before);
            (x, [moved, state.velocities[vertex as usize]])
        });
        parts.clear();
        parts.resize(number.clone().max().map_or(0, |most| most + 1), Part::EMPTY);
        for ((part, &vertex), (x, moves)) in number.clone().zip(&self.vertices).zip(motions.clone())
        {
            parts[part].body = self.body_of[vertex as usize];
            parts[part].add(x, moves);
        }
        parts.iter_mut().for_each(Part::fit);
        for (part, (x, moves)) in number.zip(motions) {
            parts[part].leave(x, moves);
        }
    }

    /// Looks at all parts: how they have moved and may move towards those that they may touch and are near.
    fn survey(&mut self, state: &ContactState<'_>) -> Moved {
        self.fit_parts(state);
        let limit = self.settings.reach * self.mean_edge;
        let thickness = self.settings.thickness;
        let widest = (self.settings.skin * self.mean_edge + limit + thickness).max(self.reach);
        let Room {
            parts,
            sorted,
            ahead,
            ..
        } = &mut self.room;
        sorted.clear();
        sorted.extend((0..index(parts.len())).filter(|&p| parts[p as usize].body != NONE));
        let low = |p: &u32| parts[*p as usize].bounds.low.x;
        sorted.sort_unstable_by(|p, q| low(p).total_cmp(&low(q)).then(p.cmp(q)));

        let mut all = Moved::default();
        let mut meet = |[moved, speed]: [f64; 2], turned: f64| {
            let margin = (speed * state.frame_time).min(limit);
            let needed = moved + margin + thickness + turned * (margin + thickness);
            all.margin = all.margin.max(margin);
            // What is no number asks for a search.
            all.needed = if needed.is_nan() {
                needed
            } else {
                all.needed.max(needed)
            };
        };
        for i in 0..sorted.len() {
            let one = parts[sorted[i] as usize];
            if self.settings.self_contact {
                meet(one.within(), one.turned());
            }
            let around = one.bounds.widened(widest);
            for &second in &sorted[i + 1..] {
                let other = &mut parts[second as usize];
                if other.bounds.low.x > around.high.x {
                    break;
                }
                let may_touch =
                    one.body == other.body || self.settings.bodies.allow(one.body, other.body);
                if may_touch && around.overlaps(&other.bounds) {
                    meet(one.towards(other, widest), other.turned());
                    let approach = one.approach(other, widest);
                    other.meet(approach);
                    parts[sorted[i] as usize].meet(approach);
                }
            }
        }
        let most = |way: f64| if way <= limit { way } else { limit };
        ahead.resize(state.positions.len(), Ahead::default());
        for (&part, &vertex) in self.parts.iter().zip(&self.vertices) {
            let p = vertex as usize;
            let part = &parts[part as usize];
            let own = part.beside(state.positions[p], state.velocities[p]) * state.frame_time;
            ahead[p] = Ahead {
                own: most(own),
                towards_others: most(part.approach_of_others() * state.frame_time),
            };
        }
        all
    }

    /// Whether a vertex in contact is about to leave its triangle or has gone deeper.
    fn has_slid(&self, state: &ContactState<'_>) -> bool {
        let skin = self.settings.skin * self.mean_edge;
        let close = 0.5 * skin + self.settings.thickness;
        let mut candidates = self.face_candidates.iter().zip(&self.sightings);
        candidates.any(|(contact, sighting)| {
            let [_, second, third] = beneath(contact, state.positions);
            let [before2, before3] = sighting.weights;
            let first = 1.0 - second - third;
            let slid = [
                second - before2,
                third - before3,
                before2 + before3 - second - third,
            ];
            let has_slid = slid.iter().any(|by| by.abs() > SLID);
            // One that was found beyond its triangle, at an edge, may stay there.
            let beyond = |now: f64, before: f64| now < -BEYOND && before >= -BEYOND;
            let is_beyond = beyond(first, 1.0 - before2 - before3)
                || beyond(second, before2)
                || beyond(third, before3);
            let gap = contact.gap(state.positions);
            let is_deeper = gap < 0.0 && gap < sighting.gap - DEEPER * self.reach;
            if is_deeper {
                return true;
            }
            let [_, x1, x2, x3] = contact.particles.map(|p| state.positions[p as usize]);
            let way = (x2 - x1) * slid[0] + (x3 - x1) * slid[1];
            let has_moved = way.length() > SLID_SKIN * skin || !way.is_finite();
            (has_slid || is_beyond) && has_moved && gap < close
        })
    }

    /// Finds all candidates.
    fn search(&mut self, state: &ContactState<'_>) {
        self.prepare_slots(state);
        self.sync_trees(state);
        if self.features_are_due {
            let rest = &state.mesh.mesh().positions;
            self.features.list(&self.surface, rest);
            self.features_are_due = false;
        }
        self.query(state);
        self.collect(state);
        self.search_is_due = false;
    }

    /// Boxes and normals of the triangles at the present positions.
    fn prepare_slots(&mut self, state: &ContactState<'_>) {
        let Room { boxes, placed, .. } = &mut self.room;
        let count = self.surface.slot_count();
        boxes.resize(count, Box32::EMPTY);
        placed.resize(count, PlacedTriangle::default());
        let (surface, body_of) = (&self.surface, &self.body_of);
        let prepare = |(slot, (bounds, placed)): (usize, (&mut Box32, &mut PlacedTriangle))| {
            (*bounds, *placed) = prepared(surface, body_of, state, index(slot));
        };
        if count < 2 * PARALLEL {
            let slots = boxes.iter_mut().zip(placed).enumerate();
            slots.for_each(prepare);
        } else {
            let slots = boxes.par_iter_mut().zip(placed).enumerate();
            slots.with_min_len(PARALLEL).for_each(prepare);
        }
    }

    /// Brings the trees up to date: refits, and builds what new triangles ask for.
    fn sync_trees(&mut self, state: &ContactState<'_>) {
        let slots = self.surface.slot_count();
        if slots - self.main_slots > self.main_slots / FRESH {
            let numbers = self.surface.compact(state.mesh);
            self.fresh_pairs.renumber(&self.surface, &numbers);
            self.mean_edge = self.surface.mean_edge(&state.mesh.mesh().positions);
            self.prepare_slots(state);
            self.features_are_due = true;
            self.main_slots = self.surface.slot_count();
            let Room { boxes, placed, .. } = &self.room;
            let (normal_of, part_of) = by_slot(placed);
            let all = 0..index(self.main_slots);
            self.main.build(all, boxes, normal_of, part_of);
            self.fresh.clear();
            self.fresh_is_due = false;
            return;
        }
        let Room { boxes, placed, .. } = &self.room;
        let (normal_of, part_of) = by_slot(placed);
        self.main.refit(boxes, normal_of);
        if self.fresh_is_due {
            let new = index(self.main_slots)..index(slots);
            let alive = new.filter(|&slot| self.surface.is_alive(slot));
            self.fresh.build(alive, boxes, normal_of, part_of);
            self.fresh_is_due = false;
        } else {
            self.fresh.refit(boxes, normal_of);
        }
    }

    /// Searches for each vertex and each feature edge.
    fn query(&mut self, state: &ContactState<'_>) {
        let Room {
            placed,
            found,
            parts,
            ..
        } = &mut self.room;
        let query = Query {
            state,
            settings: &self.settings,
            shape: Shape {
                surface: &self.surface,
                positions: state.positions,
                placed,
            },
            trees: [&self.main, &self.fresh],
            pairs: &self.fresh_pairs,
            body_of: &self.body_of,
            reach: self.reach,
            mean_edge: self.mean_edge,
        };
        let self_contact = self.settings.self_contact;
        let is_asked = |part: u32| self_contact || parts[part as usize].is_near;
        if self.location_is_due {
            self.inside.clear();
            let vertices = self.vertices.iter().zip(&self.parts);
            let asked = vertices.filter(|&(_, &part)| is_asked(part));
            let mut asked = asked.map(|(&vertex, _)| ParticleId(vertex)).peekable();
            if asked.peek().is_some() {
                let tets = tree_of_tets(state);
                let located = asked.filter_map(|p| Some((p, query.locate(p, &tets)?)));
                self.inside.extend(located);
            }
            self.location_is_due = false;
        }
        let inside = &self.inside;
        let ask = |((&vertex, &part), found): ((&u32, &u32), &mut Found)| {
            if is_asked(part) {
                let vertex = ParticleId(vertex);
                let was_inside = inside.binary_search_by_key(&vertex, |known| known.0);
                query.vertex(vertex, was_inside.ok().map(|i| inside[i].1), found);
            } else {
                found.clear();
            }
        };
        found.resize(self.vertices.len(), Found::NOTHING);
        if found.len() < PARALLEL {
            let vertices = self.vertices.iter().zip(&self.parts);
            vertices.zip(found).for_each(ask);
        } else {
            let vertices = self.vertices.par_iter().zip(&self.parts).zip(found);
            vertices.with_min_len(PARALLEL / 4).for_each(ask);
        }
        self.features.search(&query, &mut self.edge_candidates);
    }

    /// Makes lists of what was found for the vertices.
    fn collect(&mut self, state: &ContactState<'_>) {
        let Room {
            found, last_inside, ..
        } = &mut self.room;
        std::mem::swap(&mut self.inside, last_inside);
        self.face_candidates.clear();
        self.inside.clear();
        self.sightings.clear();
        self.searched_at.clear();
        (self.deep, self.buried) = (0, 0);
        for (&vertex, found) in self.vertices.iter().zip(found) {
            self.searched_at.push(state.positions[vertex as usize]);
            self.face_candidates.extend_from_slice(found.contacts());
            if found.inside != NONE {
                self.inside.push((ParticleId(vertex), TetId(found.inside)));
            }
            self.deep += usize::from(found.is_deep);
            self.buried += usize::from(found.is_buried);
        }
        for contact in &self.face_candidates {
            let [_, second, third] = beneath(contact, state.positions);
            self.sightings.push(Sighting {
                weights: [second, third],
                gap: contact.gap(state.positions),
            });
        }
    }

    /// The contacts across fresh cuts whose sides the frame may bring together.
    #[must_use]
    pub fn pairs(&self) -> &[PairContact] {
        &self.pairs
    }

    /// The candidates of the search that the frame may bring together: a vertex and a triangle each, ascending by vertex;
    /// at most four for a vertex.
    #[must_use]
    pub fn faces(&self) -> &[FaceContact] {
        &self.faces
    }

    /// The candidates of feature edges that the frame may bring together, ascending by the ends of the first edge, then the
    /// second. Each two edges are there once, and an edge at most four times.
    #[must_use]
    pub fn edges(&self) -> &[EdgeContact] {
        &self.edges
    }

    /// All candidates of the last search for vertices, of which [`Self::faces`] are those that the frame may bring together.
    #[must_use]
    pub fn face_candidates(&self) -> &[FaceContact] {
        &self.face_candidates
    }

    /// All candidates of the last search for edges, of which [`Self::edges`] are those that the frame may bring together.
    #[must_use]
    pub fn edge_candidates(&self) -> &[EdgeContact] {
        &self.edge_candidates
    }

    /// How many edges are sharp enough to be looked at, as of the last search.
    #[must_use]
    pub fn feature_edges(&self) -> usize {
        self.features.count()
    }

    /// How many vertices lie inside another body or piece, beyond half of its thickness or without a triangle near
    /// them, at the last search.
    #[must_use]
    pub fn deep(&self) -> usize {
        self.deep
    }

    /// How many of the deep vertices have no way out within reach of the search, so that nothing pushes them out: a
    /// piece that was swallowed as a whole.
    #[must_use]
    pub fn buried(&self) -> usize {
        self.buried
    }

    /// The mean edge of the surface at rest in m, as it was when the search tree was built over all triangles.
    #[must_use]
    pub fn mean_edge(&self) -> f64 {
        self.mean_edge
    }

    /// How far the last search reached in m.
    #[must_use]
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// The surface.
    #[must_use]
    pub fn surface(&self) -> &ContactSurface {
        &self.surface
    }

    /// The pairs of fresh cuts, those that sleep included.
    #[must_use]
    pub fn fresh_pairs(&self) -> &FreshPairs {
        &self.fresh_pairs
    }

    /// The body of each particle.
    #[must_use]
    pub fn body_of(&self) -> &[u32] {
        &self.body_of
    }

    /// Recomputes the surface and the lists of pairs and compares. O(n log n); for tests and on request.
    ///
    /// # Errors
    /// [`ContactError::Differs`] names the first difference.
    pub fn check(&self, mesh: &CuttableMesh) -> Result<(), ContactError> {
        self.surface.check(mesh)?;
        self.fresh_pairs.check(&self.surface)?;
        if self.body_of.len() != mesh.mesh().positions.len() {
            let known = self.body_of.len();
            return Err(ContactError::Differs(format!(
                "{known} particles are known"
            )));
        }
        for triangle in self.surface.triangles() {
            let [a, b, c] = triangle.particles.map(|p| self.body_of[p.index()]);
            if a != b || a != c {
                let what = format!("{triangle:?} belongs to several bodies");
                return Err(ContactError::Differs(what));
            }
        }
        if !self.features_are_due {
            let mut features = FeatureEdges::default();
            features.list(&self.surface, &mesh.mesh().positions);
            if !features.same(&self.features) {
                let what = "the feature edges are others";
                return Err(ContactError::Differs(what.to_owned()));
            }
        }
        let built = self.main_slots + self.fresh.len();
        if !self.fresh_is_due && self.main.len() + self.fresh.len() != built {
            return Err(ContactError::Differs("the trees miss triangles".to_owned()));
        }
        Ok(())
    }
}

/// How far a vertex may move in a frame, in m, each at most what the search looks ahead.
#[derive(Clone, Copy, Debug, Default)]
struct Ahead {
    /// Beside the motion of its part as a whole.
    own: f64,
    /// By that motion, towards other parts near it.
    towards_others: f64,
}

/// Decides which contacts a frame may bring together.
#[derive(Clone, Copy)]
struct Near<'a> {
    fixed: &'a [bool],
    /// How far in m they may be apart beyond what the motion of the frame brings them together.
    spare: f64,
    /// The most in m that the search looks ahead.
    limit: f64,
}

impl Near<'_> {
    /// Whether the particles of one side may meet those of the other in the frame, and one of them can move. An overlap is
    /// near in any case, so that reports tell of one that nothing can part.
    fn of(&self, ahead: &[Ahead], one: &[u32], other: &[u32], gap: f64) -> bool {
        let is_fixed = |p: &u32| self.fixed.get(*p as usize).copied().unwrap_or_default();
        if one.iter().chain(other).all(is_fixed) {
            return gap < 0.0;
        }
        let most = |of: &[u32]| {
            let own = of.iter().map(|&p| ahead[p as usize].own);
            own.fold(0.0, f64::max)
        };
        let towards = ahead[one[0] as usize].towards_others;
        // What is no number is kept.
        let is_apart = gap > self.spare + (most(one) + most(other) + towards).min(self.limit);
        !is_apart
    }
}

/// How parts that are near each other move, see [`ContactDetector::survey`].
#[derive(Clone, Copy, Default)]
struct Moved {
    /// How much closer two of them may come in the frame in m, at most what the search looks ahead.
    margin: f64,
    /// How far a search must have reached in m to know of all that may come into contact in the frame.
    needed: f64,
}

/// The box of a triangle and the triangle at the present positions; the empty box and no normal if it must not be touched.
/// The box is that of the tet behind it, so that the search also says which tets may contain a vertex.
fn prepared(
    surface: &ContactSurface,
    body_of: &[u32],
    state: &ContactState<'_>,
    slot: u32,
) -> (Box32, PlacedTriangle) {
    if !surface.is_alive(slot) {
        return (Box32::EMPTY, PlacedTriangle::default());
    }
    let BoundaryTriangle { tet, particles, .. } = *surface.triangle(slot);
    let mut placed = PlacedTriangle {
        normal: DVec3::ZERO,
        area: surface.area(slot, state.positions),
        corners: particles.map(|p| state.positions[p.index()]),
        owner: Owner {
            body: body_of[particles[0].index()],
            piece: state.pieces.piece_of(tet),
        },
    };
    let corners = state.mesh.mesh().tets[tet.index()].map(|p| state.positions[p.index()]);
    let squared = placed.area.length_squared();
    if !Barycentric::exist(corners) || surface.is_collapsed(slot, squared) {
        return (Box32::EMPTY, placed);
    }
    placed.normal = placed.area / squared.sqrt();
    (Box32::around(&Bounds::around(corners)), placed)
}

/// What a tree asks of triangles, by slot: their normals and their pieces.
fn by_slot(
    placed: &[PlacedTriangle],
) -> (
    impl Fn(u32) -> DVec3 + Copy + '_,
    impl Fn(u32) -> u32 + Copy + '_,
) {
    let normal_of = |slot: u32| placed[slot as usize].normal;
    let part_of = |slot: u32| placed[slot as usize].owner.piece;
    (normal_of, part_of)
}

/// A tree over all tets that are not flat or inverted, by their numbers. O(n log n).
fn tree_of_tets(state: &ContactState<'_>) -> TriangleTree {
    let tets = state.mesh.mesh().tets.iter();
    let boxes = tets.map(|corners| {
        let corners = corners.map(|p| state.positions[p.index()]);
        if Barycentric::exist(corners) {
            Box32::around(&Bounds::around(corners))
        } else {
            Box32::EMPTY
        }
    });
    let boxes: Vec<Box32> = boxes.collect();
    let mut tree = TriangleTree::default();
    tree.build(0..index(boxes.len()), &boxes, |_| DVec3::ZERO, |_| 0);
    tree
}

/// The barycentric coordinates of the point beneath a vertex in the plane of its triangle; of the first corner where
/// the triangle has no area.
fn beneath(contact: &FaceContact, positions: &[DVec3]) -> [f64; 3] {
    let [x, x1, x2, x3] = contact.particles.map(|p| positions[p as usize]);
    let (e1, e2) = (x2 - x1, x3 - x1);
    let across = e1.cross(e2);
    let squared = across.length_squared();
    let from = x - x1;
    let second = from.cross(e2).dot(across) / squared;
    let third = e1.cross(from).dot(across) / squared;
    if second.is_finite() && third.is_finite() {
        [1.0 - second - third, second, third]
    } else {
        [1.0, 0.0, 0.0]
    }
}

/// Whether two lists have other particles.
fn differ<T, const N: usize>(now: &[T], before: &[T], particles: impl Fn(&T) -> [u32; N]) -> bool {
    now.len() != before.len()
        || now
            .iter()
            .zip(before)
            .any(|(one, other)| particles(one) != particles(other))
}
