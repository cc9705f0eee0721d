//! [`ContactDetector`]: finds what touches, frame by frame, while bodies move and are cut.
//!
//! Once a frame, [`ContactDetector::update`] lists the contacts that the frame may meet. The candidates of the search
//! are kept as long as surfaces have moved towards each other by less than a skin; the pairs of fresh cuts, which need
//! no search, are evaluated each frame. The solver takes the plain records and decides in each substep which of them
//! act.
//!
//! How far the search looks is known for each vertex and triangle: a skin, and what the frame brings the two closer at
//! their present velocities. So a fast corner of a sliver looks far, and what falls or bends beside it does not. Of the
//! candidates, those are listed that the frame may bring together. What none of the particles involved can change is not
//! listed unless it overlaps.
//!
//! Vertices are searched for one by one, when the motion of the vertex or of a triangle near it has used up the skin.
//! Motion is measured beside that of parts, the pieces of all bodies: a part that falls or turns as a whole does not
//! approach itself, and two parts whose boxes are out of reach of each other do not matter to each other. Where two parts
//! have used up the skin as a whole, those of their vertices are searched for that are near the other part. The search
//! looks beyond what counts as near for the frame, by as much again: bodies at rest shake by less than that.
//!
//! The decision to search again depends on positions, velocities and frame time only, so results are the same for any
//! number of threads. The shape of the search tree does not matter either: candidates are sorted by vertex, then by
//! distance and face.
//!
//! Cost: an update without a search is three passes over the surface vertices, and one over the candidates and the
//! twins. A search is a refit of the trees, a query for each vertex that is due and for each feature edge, one for each
//! triangle that has moved, and a short one for each other vertex of parts that have, on all threads but for the triangles. A
//! delta costs what the boundary lost and gained. The first search also looks for vertices that start inside of other
//! parts, among all tets. The search after a cut, or after an improvement of the mesh, is for the vertices of triangles that came or
//! went and those near them, and for all where that is much of the surface or parts do not touch themselves; it builds a tree
//! over the new triangles, and over all of them once these are more than a quarter.

use glam::DVec3;
use incise_cutting::{AddedTet, BoundaryTriangle, CutDelta, CuttableMesh, RemovedTet};
use incise_mesh::{Bounds, ParticleId, TetId};
use rayon::prelude::*;

use crate::ContactError;
use crate::ahead::{Lookout, Near, Reach};
use crate::edges::{EdgeContact, FeatureEdges, turn};
use crate::face::FaceContact;
use crate::index::{NONE, index};
use crate::normals::{Inversion, Owner, PlacedTriangle, Shape};
use crate::pairs::{FreshPairs, PairContact};
use crate::parts::{Motion, Part};
use crate::query::{Found, Query, turned_away};
use crate::reserve::Reserve;
use crate::settings::ContactSettings;
use crate::state::ContactState;
use crate::surface::{ContactSurface, SurfaceChange};
use crate::tree::{Answers, Box32, Children, Item, TriangleTree};
use crate::walk::Barycentric;

/// New triangles as a fraction of those in the main tree beyond which that is built again.
const FRESH: usize = 4;
/// Triangles or vertices that are not worth another thread.
const PARALLEL: usize = 512;
/// A candidate whose vertex has moved along its triangle by this in barycentric coordinates is searched for again.
const SLID: f64 = 0.5;
/// It has to have moved by this fraction of the near skin at least: on a sliver half a barycentric coordinate is nothing.
const SLID_SKIN: f64 = 0.5;
/// A tet is inverted if six times its volume is below minus this, in cubes of mean edges.
const INVERTED: f64 = 1e-3;
/// A vertex inside that has gone deeper by this fraction of the near skin is searched for again, before it gets out of reach.
const DEEPER: f64 = 0.5;
/// A candidate whose vertex lies beneath a point this far beyond its triangle is searched for again.
const BEYOND: f64 = 0.25;
/// Candidates are listed that are apart by this fraction of the near skin more than the frame may bring them together: what
/// speeds up within the frame may come further.
const SPARE: f64 = 0.5;
/// The search looks ahead in time by so many times the distance by which a frame may bring surfaces together before it is
/// divided: a few vertices may be faster.
const FURTHER: f64 = 4.0;
/// A frame is divided if more than this part of the vertices of a piece approach what is near them by more than
/// [`ContactSettings::reach`] and half of the skin.
const FAST: f64 = 0.01;
/// A frame is divided if two near parts move relative to each other by this many times that distance, most of which may be
/// sliding.
const WHOLE: f64 = 2.0;
/// Where more than this part of all vertices have moved out of their reserve, all are searched for.
const MOST: f64 = 0.02;
/// Where a cut has changed the surface around more than this part of all vertices, all are searched for.
const CHANGED: f64 = 0.2;
/// The part of the skin within which surfaces count as near. The rest saves searches: bodies at rest shake by less.
const NEAR: f64 = 0.5;
/// The motion of a part as a whole is fitted to at least so many of its vertices, and to all if it has fewer.
const FITTED: u32 = 512;

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
    /// The vertices inside another part without a triangle near them, ascending, each with whether it has no way out.
    deep: Vec<(ParticleId, bool)>,
    /// The vertices that touch nothing of their own part, because a tet at them is or was inverted, ascending.
    inverted: Vec<u32>,
    /// How many vertices the last update searched for.
    searched: usize,
    /// The surface vertices, ascending.
    vertices: Vec<u32>,
    /// The piece of each of them.
    parts: Vec<u32>,
    reserve: Reserve,
    /// Whether the next update has to search for all vertices.
    search_is_due: bool,
    /// The corners of the triangles that came or went since the last search.
    changed: Vec<u32>,
    /// Whether the surface vertices are others than when they were listed.
    vertices_are_due: bool,
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
    last_candidates: Vec<FaceContact>,
    last_sightings: Vec<Sighting>,
    last_deep: Vec<(ParticleId, bool)>,
    last_inverted: Vec<u32>,
    /// By particle.
    inversions: Vec<Inversion>,
    /// By particle.
    due: Vec<Due>,
    /// By particle the way that it goes in the frame.
    steps: Vec<DVec3>,
    retired: Vec<u32>,
    /// By piece how many vertices ask for two parts of a frame, and for four.
    fast: Vec<[u32; 2]>,
    /// The numbers of the surface vertices in the order of the triangles of the trees, in which those in a row look at the
    /// same nodes; and the place of each in that order.
    order: Vec<u32>,
    place: Vec<u32>,
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
            deep: Vec::new(),
            inverted: Vec::new(),
            searched: 0,
            vertices: Vec::new(),
            parts: Vec::new(),
            reserve: Reserve::default(),
            search_is_due: true,
            changed: Vec::new(),
            vertices_are_due: true,
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
        self.changed.clear();
        self.location_is_due = true;
        self.inside.clear();
        self.deep.clear();
        self.inverted.clear();
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

    /// Forces a search in the next update, to measure its cost.
    pub fn search_again(&mut self) {
        self.search_is_due = true;
    }

    /// The settings.
    #[must_use]
    pub fn settings(&self) -> &ContactSettings {
        &self.settings
    }

    /// Applies the delta of a cut or a removal; `mesh` is the one after it. New particles belong to the bodies of those they
    /// were made of. Costs what the boundary lost and gained; the next update searches.
    ///
    /// # Panics
    /// If the delta does not follow the last one.
    pub fn apply_delta(&mut self, mesh: &CuttableMesh, delta: &CutDelta) {
        let change = &mut self.room.change;
        self.surface.apply_delta_into(mesh, delta, change);
        self.fresh_pairs
            .apply_delta(mesh, &self.surface, delta, change);
        for point in &delta.points {
            self.body_of.push(self.body_of[point.ends[0].index()]);
        }
        for source in &delta.copies {
            self.body_of.push(self.body_of[source.index()]);
        }
        if delta.is_improvement() {
            self.location_is_due |= !self.follow_improvement(mesh, delta);
        }
        let is_deleted = |tet: TetId| delta.deleted.binary_search_by_key(&tet, |d| d.tet).is_ok();
        self.inside.retain(|(_, tet)| !is_deleted(*tet));
        for (_, tet) in &mut self.inside {
            *tet = delta.slot_after(*tet);
        }
        self.fresh_is_due = true;
        self.features_are_due = true;
        self.vertices_are_due = true;
        let triangles = delta.surface_removed.iter().chain(&delta.surface_added);
        let corners = triangles.flat_map(|triangle| triangle.particles);
        self.changed.extend(corners.map(|p| p.0));
        // Where parts do not touch themselves, those that came apart may touch anywhere.
        self.search_is_due |= !self.settings.self_contact;
    }

    /// Where an improvement deletes or flips a tet with vertices inside, lists for them the new tet that contains the center of
    /// the old one at rest; the next search goes on from there. False if there is none.
    fn follow_improvement(&mut self, mesh: &CuttableMesh, delta: &CutDelta) -> bool {
        let rest = &mesh.mesh().positions;
        let place = |corners: [ParticleId; 4]| corners.map(|p| rest[p.index()]);
        let mut all_are_found = true;
        for (_, tet) in &mut self.inside {
            let gone = |of: &[RemovedTet]| {
                let number = of.binary_search_by_key(tet, |gone| gone.tet);
                number.ok().map(|i| of[i].corners)
            };
            let flipped = || (delta.flipped > 0).then(|| gone(&delta.removed)).flatten();
            let Some(corners) = gone(&delta.deleted).or_else(flipped) else {
                continue;
            };
            let center = place(corners).iter().sum::<DVec3>() / 4.0;
            let has_center = |added: &&AddedTet| {
                let inside = Barycentric::new(place(added.corners));
                inside.is_some_and(|inside| inside.of(center).iter().all(|x| *x >= 0.0))
            };
            match delta.added.iter().find(has_center) {
                Some(added) => *tet = added.tet,
                None => all_are_found = false,
            }
        }
        all_are_found
    }

    /// Takes the last cut or removal back; `mesh` is the one before it. Pairs that it ended do not come back, those that
    /// it made are gone. Costs what the boundary lost and gained; the next update searches.
    ///
    /// # Panics
    /// If the delta was not the last one.
    pub fn undo(&mut self, mesh: &CuttableMesh, delta: &CutDelta) {
        let change = &mut self.room.change;
        self.surface.undo_delta(mesh, delta, change);
        self.fresh_pairs
            .undo_delta(mesh, &self.surface, delta, change);
        self.body_of.truncate(delta.particles_before);
        let before = |tet: TetId| {
            let moved = delta.moved.binary_search_by_key(&tet, |moved| moved.to);
            moved.map_or(tet, |i| delta.moved[i].from)
        };
        self.inside.retain_mut(|(particle, tet)| {
            *tet = before(*tet);
            particle.index() < delta.particles_before && tet.index() < delta.tets_before
        });
        let is_known = |p: &u32| (*p as usize) < delta.particles_before;
        self.inverted.retain(is_known);
        self.changed.clear();
        // Those that are left are searched for.
        self.face_candidates.clear();
        self.sightings.clear();
        self.deep.clear();
        self.edge_candidates
            .retain(|contact| contact.particles.iter().all(is_known));
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
        assert_eq!(self.body_of.len(), particles, "all deltas were applied");

        self.update_vertices(state);
        self.survey(state);
        let near = self.near(state);
        std::mem::swap(&mut self.pairs, &mut self.room.last_pairs);
        let mut retired = std::mem::take(&mut self.room.retired);
        retired.clear();
        let near = Near {
            steps: &self.room.steps,
            ..near
        };
        let (surface, mean_edge) = (&self.surface, self.mean_edge);
        // A particle that was pushed through its own tet would be held on the wrong side.
        let rests = |pair: [u32; 2]| {
            let pair = pair.map(ParticleId);
            are_of_one_piece(surface, state, pair)
                && pair
                    .iter()
                    .any(|&p| is_pushed_through(surface, state, mean_edge, p))
        };
        self.fresh_pairs.evaluate(
            surface,
            state.positions,
            |[a, b], gap| near.of(&[a], &[b], gap) && !rests([a, b]),
            |pair| retired.extend(pair),
            &mut self.pairs,
        );
        let asked = self.ask(state, &retired);
        self.room.retired = retired;
        let mut update = ContactUpdate {
            searched: asked.vertices,
            ..ContactUpdate::default()
        };
        if asked.vertices {
            self.search(state, asked);
        }
        if !asked.edges {
            turn(&mut self.edge_candidates, state.positions);
        }
        self.list(state);
        update.faces_changed = differ(&self.faces, &self.room.last_faces, |c| c.particles);
        update.edges_changed = differ(&self.edges, &self.room.last_edges, |c| c.particles);
        update.pairs_changed = differ(&self.pairs, &self.room.last_pairs, |c| c.particles);
        update
    }

    fn skin(&self) -> f64 {
        self.settings.skin * self.mean_edge
    }

    fn near_skin(&self) -> f64 {
        NEAR * self.skin()
    }

    /// How far a search looks.
    fn reach(&self) -> Reach {
        Reach {
            still: self.skin() + self.settings.thickness,
            limit: FURTHER * self.settings.reach * self.mean_edge,
        }
    }

    /// What decides which contacts are listed, but for the steps.
    fn near<'s>(&self, state: &ContactState<'s>) -> Near<'s> {
        Near {
            fixed: state.fixed,
            steps: &[],
            reach: Reach {
                still: SPARE * self.near_skin() + self.settings.thickness,
                ..self.reach()
            },
        }
    }

    /// Notes what is due.
    fn ask(&mut self, state: &ContactState<'_>, retired: &[u32]) -> Asked {
        let mut due = std::mem::take(&mut self.room.due);
        due.clear();
        due.resize(state.positions.len(), Due::Nothing);
        self.searched = 0;
        let all = self.ask_for_moved(&mut due);
        if !all {
            let mut look = |p: u32| due[p as usize] = due[p as usize].max(Due::Search);
            self.each_slid(state, &mut look);
            let is_back =
                |p: &u32| !is_pushed_through(&self.surface, state, self.mean_edge, ParticleId(*p));
            let back = self.inverted.iter().filter(|p| is_back(p));
            back.chain(retired).copied().for_each(look);
            if !self.changed.is_empty() {
                self.look_after_change(&mut due);
            }
        }
        let is_due = |least: Due| self.vertices.iter().any(|&p| due[p as usize] >= least);
        let has_moved = is_due(Due::Moved);
        let is_changed = !self.changed.is_empty();
        let have_parts = !self.reserve.used_up_pairs().is_empty();
        let asked = Asked {
            all,
            vertices: self.search_is_due || is_changed || have_parts || is_due(Due::Search),
            edges: self.search_is_due
                || is_changed
                || have_parts
                || has_moved
                || !retired.is_empty(),
            has_moved: has_moved && !all,
            have_parts: have_parts && !all,
        };
        self.room.due = due;
        if asked.is_measured_anew() && !asked.all {
            self.reserve.mark();
        }
        asked
    }

    /// Notes what a cut may have changed besides its own surface: the candidates with a triangle that is gone or beside one,
    /// and vertices inside other parts or beside inverted tets.
    fn look_after_change(&self, due: &mut [Due]) {
        let mut look = |p: u32| due[p as usize] = due[p as usize].max(Due::Search);
        self.inside.iter().for_each(|(p, _)| look(p.0));
        self.deep.iter().for_each(|(p, _)| look(p.0));
        self.inverted.iter().for_each(|p| look(*p));
        for contact in &self.face_candidates {
            let [vertex, corners @ ..] = contact.particles;
            if corners.iter().any(|&p| due[p as usize] == Due::Moved) {
                due[vertex as usize] = due[vertex as usize].max(Due::Search);
            }
        }
    }

    /// Notes the vertices that have moved out of their reserve, which starts over for them; whether all are due.
    fn ask_for_moved(&mut self, due: &mut [Due]) -> bool {
        let skin = self.skin();
        let parts = &self.room.parts;
        let self_contact = self.settings.self_contact;
        let is_asked = |part: usize| self_contact || parts[part].is_near;
        let vertices = || {
            let parts = self.parts.iter().map(|&part| part as usize);
            parts.zip(&self.vertices).enumerate()
        };
        let mut moved = 0;
        for (i, (part, &p)) in vertices().filter(|(_, (part, _))| is_asked(*part)) {
            let is_used_up =
                self.reserve.is_part_empty(part) || self.reserve.is_used_up(i, part, skin);
            if self.search_is_due || is_used_up {
                due[p as usize] = Due::Moved;
                moved += 1;
            }
        }
        let all = moved as f64 > MOST * self.vertices.len() as f64;
        if all {
            for (_, (_, &p)) in vertices().filter(|(_, (part, _))| is_asked(*part)) {
                due[p as usize] = Due::Moved;
            }
        }
        for &p in &self.changed {
            due[p as usize] = Due::Moved;
        }
        for (i, &p) in self.vertices.iter().enumerate() {
            if due[p as usize] == Due::Moved {
                self.reserve.renew(i);
            }
        }
        for part in (0..parts.len()).filter(|&part| parts[part].body != NONE) {
            if !is_asked(part) {
                self.reserve.empty_part(part);
            } else if all || self.search_is_due || self.reserve.is_part_empty(part) {
                self.reserve.renew_part(part);
            }
        }
        all || self.search_is_due
    }

    /// Lists the candidates that the frame may bring together.
    fn list(&mut self, state: &ContactState<'_>) {
        let near = self.near(state);
        let Room {
            steps,
            last_faces,
            last_edges,
            ..
        } = &mut self.room;
        let near = Near { steps, ..near };
        std::mem::swap(&mut self.faces, last_faces);
        std::mem::swap(&mut self.edges, last_edges);
        self.faces.clear();
        self.edges.clear();
        let faces = self.face_candidates.iter().filter(|contact| {
            let [vertex, corners @ ..] = &contact.particles;
            let gap = contact.gap(state.positions);
            near.of(std::slice::from_ref(vertex), corners, gap)
        });
        self.faces.extend(faces);
        let edges = self.edge_candidates.iter().filter(|contact| {
            let (one, other) = contact.particles.split_at(2);
            near.of(one, other, contact.separation(state.positions))
        });
        self.edges.extend(edges);
    }

    /// Returns the number of equal parts, 1, 2 or 4, into which to divide the frame, with an update for each. More than 1
    /// if more than 1% of the vertices of a part approach what is near them by more than [`ContactSettings::reach`] and half
    /// of the skin, or if parts near each other move relative to each other as a whole by twice as much. Fewer vertices are
    /// not worth the time: the search looks further for them. O(surface vertices + candidates + pieces²).
    ///
    /// # Panics
    /// If there are fewer positions or velocities than particles, or a delta was left out.
    #[must_use]
    pub fn intervals(&mut self, state: &ContactState<'_>) -> u32 {
        self.update_vertices(state);
        let skin = self.near_skin();
        let ahead = self.settings.reach * self.mean_edge + skin;
        let step = |p: u32| state.velocities[p as usize] * state.frame_time;
        // If all are, no two vertices approach each other by more than `ahead`.
        let is_calm = |&p: &u32| 4.0 * step(p).length_squared() <= ahead * ahead;
        if self.vertices.iter().all(is_calm) {
            return 1;
        }
        let places = |p: u32| [state.positions[p as usize]; 2];
        let parts = &mut self.room.parts;
        fit(parts, &self.parts, &self.vertices, &self.body_of, |_, p| {
            (places(p), [step(p), DVec3::ZERO])
        });
        let mut most = 0.0_f64;
        let parts = self.room.parts.iter().filter(|part| part.body != NONE);
        for (i, one) in parts.clone().enumerate() {
            for other in parts.clone().skip(i + 1) {
                let may_touch =
                    one.body == other.body || self.settings.bodies.allow(one.body, other.body);
                if !may_touch {
                    continue;
                }
                let approach = one.approach(other, skin);
                let around = one.bounds().widened(approach + skin);
                if around.overlaps(other.bounds()) {
                    most = most.max(approach);
                }
            }
        }
        let by_parts = match most {
            approach if approach <= WHOLE * ahead => 1,
            approach if approach <= 2.0 * WHOLE * ahead => 2,
            _ => 4,
        };
        by_parts.max(self.intervals_of_vertices(state, ahead))
    }

    /// Into how many parts a frame should be divided for what vertices are near.
    fn intervals_of_vertices(&mut self, state: &ContactState<'_>, ahead: f64) -> u32 {
        let Room {
            parts, steps, fast, ..
        } = &mut self.room;
        steps.clear();
        steps.extend(state.velocities.iter().map(|v| *v * state.frame_time));
        fast.clear();
        fast.resize(parts.len(), [0; 2]);
        let mut candidates = &self.face_candidates[..];
        for (&vertex, &part) in self.vertices.iter().zip(&self.parts) {
            let own = candidates.partition_point(|contact| contact.particles[0] <= vertex);
            let (these, others) = candidates.split_at(own);
            candidates = others;
            let most = these.iter().map(|contact| {
                let normal = contact.normal_at(state.positions);
                let [vertex, corners @ ..] = contact.particles.map(|p| steps[p as usize]);
                let closing = corners.map(|corner| normal.dot(corner - vertex));
                closing.into_iter().fold(0.0, f64::max)
            });
            let most = most.fold(0.0, f64::max);
            let fast = &mut fast[part as usize];
            fast[0] += u32::from(most > ahead);
            fast[1] += u32::from(most > 2.0 * ahead);
        }
        let mut intervals = 1;
        for (part, &[twice, four]) in parts.iter().zip(&*fast) {
            let few = FAST * f64::from(part.vertices);
            if f64::from(four) > few {
                intervals = 4;
            } else if f64::from(twice) > few {
                intervals = intervals.max(2);
            }
        }
        intervals
    }

    /// Brings the list of the surface vertices up to date. After a cut, what is known of those that stay is kept, unless it
    /// has changed much of the surface.
    fn update_vertices(&mut self, state: &ContactState<'_>) {
        if !self.search_is_due && self.vertices_are_due {
            self.changed.sort_unstable();
            self.changed.dedup();
            let most = CHANGED * self.vertices.len() as f64;
            // Where the main tree is built again, the mean edge changes, too.
            self.search_is_due = self.changed.len() as f64 > most
                || self.is_rebuilding_due()
                || !self.keep_vertices(state);
        }
        if self.search_is_due {
            self.list_vertices(state);
            self.reserve.clear();
        }
        self.vertices_are_due = false;
    }

    /// Lists the surface vertices again and keeps what is known of those that stay. False if parts were joined, which have no
    /// common history.
    fn keep_vertices(&mut self, state: &ContactState<'_>) -> bool {
        let (vertices, parts) = (self.vertices.clone(), self.parts.clone());
        self.list_vertices(state);
        let place = |p: u32| {
            let x = state.positions[p as usize];
            [x, x + state.velocities[p as usize] * state.frame_time]
        };
        let numbers = self.parts.iter().map(|&part| part as usize + 1).max();
        // By part what it was before; a part without a vertex of before is searched for as a whole.
        let mut origins = vec![NONE; numbers.unwrap_or(0)];
        let mut known = vertices.iter().zip(parts).enumerate().peekable();
        let mut stayed = Vec::with_capacity(self.vertices.len());
        for (&p, &part) in self.vertices.iter().zip(&self.parts) {
            while known.next_if(|(_, (before, _))| **before < p).is_some() {}
            let same = known.next_if(|(_, (before, _))| **before == p);
            stayed.push(match same {
                Some((i, (_, before))) => {
                    let origin = &mut origins[part as usize];
                    if *origin != NONE && *origin != before {
                        return false;
                    }
                    *origin = before;
                    Some(i)
                }
                None => {
                    self.changed.push(p);
                    None
                }
            });
        }
        self.changed.sort_unstable();
        self.changed.dedup();
        let new = self.vertices.iter().map(|&p| place(p));
        self.reserve.keep(stayed.into_iter().zip(new), &origins);
        true
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
    }

    /// Looks at all parts: which are near each other, and what they and their vertices have moved by.
    fn survey(&mut self, state: &ContactState<'_>) {
        let Reach { still, limit } = self.reach();
        let (skin, widest) = (self.skin(), still + limit);
        let Room {
            parts,
            sorted,
            steps,
            ..
        } = &mut self.room;
        steps.clear();
        steps.extend(state.velocities.iter().map(|v| *v * state.frame_time));
        let places = |p: u32| {
            let x = state.positions[p as usize];
            [x, x + steps[p as usize]]
        };
        let reserve = &mut self.reserve;
        fit(parts, &self.parts, &self.vertices, &self.body_of, |i, p| {
            (places(p), reserve.moved(i, places(p)))
        });
        sorted.clear();
        sorted.extend((0..index(parts.len())).filter(|&p| parts[p as usize].body != NONE));
        let low = |p: &u32| parts[*p as usize].bounds().low.x;
        sorted.sort_unstable_by(|p, q| low(p).total_cmp(&low(q)).then(p.cmp(q)));

        reserve.begin_pairs(parts.len());
        for i in 0..sorted.len() {
            let first = sorted[i] as usize;
            let one = parts[first];
            let around = one.bounds().widened(widest);
            for &second in &sorted[i + 1..] {
                let second = second as usize;
                let other = parts[second];
                if other.bounds().low.x > around.high.x {
                    break;
                }
                let may_touch =
                    one.body == other.body || self.settings.bodies.allow(one.body, other.body);
                if may_touch && around.overlaps(other.bounds()) {
                    let ahead = one.fastest(&other).min(limit);
                    reserve.note_pair([first, second], [&one, &other], still + ahead, ahead);
                    parts[first].is_near = true;
                    parts[second].is_near = true;
                }
            }
        }
        reserve.end_pairs(skin);
        for (i, (&part, &vertex)) in self.parts.iter().zip(&self.vertices).enumerate() {
            reserve.note(i, &parts[part as usize], places(vertex));
        }
    }

    /// Calls `look` with each vertex in contact that is about to leave its triangle or has gone deeper.
    fn each_slid(&self, state: &ContactState<'_>, mut look: impl FnMut(u32)) {
        let skin = self.near_skin();
        let close = 0.5 * skin + self.settings.thickness;
        for (contact, sighting) in self.face_candidates.iter().zip(&self.sightings) {
            let gap = contact.gap(state.positions);
            if gap >= close {
                continue;
            }
            if gap < 0.0 && gap < sighting.gap - DEEPER * skin {
                look(contact.particles[0]);
                continue;
            }
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
            if !(has_slid || is_beyond) {
                continue;
            }
            let [_, x1, x2, x3] = contact.particles.map(|p| state.positions[p as usize]);
            let way = (x2 - x1) * slid[0] + (x3 - x1) * slid[1];
            if way.length() > SLID_SKIN * skin || !way.is_finite() {
                look(contact.particles[0]);
            }
        }
    }

    /// Finds all candidates that were asked for.
    fn search(&mut self, state: &ContactState<'_>, asked: Asked) {
        self.prepare_slots(state);
        self.sync_trees(state);
        if self.features_are_due {
            let rest = &state.mesh.mesh().positions;
            self.features.list(&self.surface, rest);
            self.features_are_due = false;
        }
        if self.search_is_due
            || !self.changed.is_empty()
            || self.room.order.len() != self.vertices.len()
        {
            self.order_vertices();
        }
        if asked.has_moved {
            self.note_near_moved();
        }
        self.query(state, asked);
        self.collect(state);
        self.search_is_due = false;
        self.changed.clear();
    }

    /// Whether new triangles are so many that the main tree is built again.
    fn is_rebuilding_due(&self) -> bool {
        self.surface.slot_count() - self.main_slots > self.main_slots / FRESH
    }

    /// Boxes and normals of the triangles at the present positions.
    fn prepare_slots(&mut self, state: &ContactState<'_>) {
        let Room {
            boxes,
            placed,
            steps,
            due,
            inversions,
            ..
        } = &mut self.room;
        let count = self.surface.slot_count();
        let edge = self.mean_edge;
        boxes.resize(count, Box32::EMPTY);
        placed.resize(count, PlacedTriangle::default());
        let (surface, body_of) = (&self.surface, &self.body_of);
        let prepare = |(slot, (bounds, placed)): (usize, (&mut Box32, &mut PlacedTriangle))| {
            (*bounds, *placed) = prepared(surface, body_of, state, edge, index(slot));
            let corners = surface.triangle(index(slot)).particles.map(|p| p.index());
            let steps = corners.map(|p| steps.get(p).copied().unwrap_or_default());
            if placed.normal == DVec3::ZERO {
                placed.tet = Box32::EMPTY;
            }
            placed.steps = Box32::around(&Bounds::around(steps));
            placed.is_marked = corners.iter().any(|&p| due.get(p) == Some(&Due::Moved));
        };
        if count < 2 * PARALLEL {
            let slots = boxes.iter_mut().zip(&mut *placed).enumerate();
            slots.for_each(prepare);
        } else {
            let slots = boxes.par_iter_mut().zip(&mut *placed).enumerate();
            slots.with_min_len(PARALLEL).for_each(prepare);
        }
        inversions.clear();
        inversions.resize(state.positions.len(), Inversion::None);
        for &vertex in &self.inverted {
            inversions[vertex as usize] = Inversion::Recent;
        }
        let inverted = (0..).zip(placed).filter(|(_, placed)| placed.is_inverted);
        for (slot, _) in inverted {
            for p in state.mesh.mesh().tets[self.surface.triangle(slot).tet.index()] {
                inversions[p.index()] = Inversion::Present;
            }
        }
    }

    /// Brings the trees up to date: refits, and builds what new triangles ask for.
    fn sync_trees(&mut self, state: &ContactState<'_>) {
        let slots = self.surface.slot_count();
        if self.is_rebuilding_due() {
            let numbers = self.surface.compact(state.mesh);
            self.fresh_pairs.renumber(&self.surface, &numbers);
            self.mean_edge = self.surface.mean_edge(&state.mesh.mesh().positions);
            self.prepare_slots(state);
            self.features_are_due = true;
            self.main_slots = self.surface.slot_count();
            let Room { boxes, placed, .. } = &self.room;
            let item_of = by_slot(placed);
            let all = 0..index(self.main_slots);
            self.main.build(all, boxes, item_of);
            self.fresh.clear();
            self.fresh_is_due = false;
            return;
        }
        let Room { boxes, placed, .. } = &self.room;
        let item_of = by_slot(placed);
        self.main.refit(boxes, item_of);
        if self.fresh_is_due {
            let new = index(self.main_slots)..index(slots);
            let alive = new.filter(|&slot| self.surface.is_alive(slot));
            self.fresh.build(alive, boxes, item_of);
            self.fresh_is_due = false;
        } else {
            self.fresh.refit(boxes, item_of);
        }
    }

    /// Notes the vertices that may be near a triangle that has moved and faces them, or in the tet behind it: one of the
    /// triangles around such a vertex faces that one, too, or must not be touched.
    fn note_near_moved(&mut self) {
        let reach = self.reach();
        let Room {
            boxes, placed, due, ..
        } = &mut self.room;
        let mut note = |slot: u32| {
            for p in self.surface.triangle(slot).particles {
                due[p.index()] = due[p.index()].max(Due::Search);
            }
        };
        for (slot, triangle) in (0..).zip(&*placed) {
            if triangle.normal == DVec3::ZERO {
                if self.surface.is_alive(slot) {
                    note(slot);
                }
                continue;
            }
            if !triangle.is_marked {
                continue;
            }
            let lookout = Lookout::new(&boxes[slot as usize], &triangle.steps, &reach);
            let normal = triangle.normal.extend(0.0).as_vec4();
            let (tet, piece) = (triangle.tet, triangle.owner.piece);
            let ask = |children: &Children, _| Answers {
                first: lookout.reached(children) & !turned_away(&children.normals, normal),
                second: children.bounds.overlapping(&tet),
            };
            for tree in [&self.main, &self.fresh] {
                tree.search_where(ask, |leaf, [is_near, overlaps]| {
                    if is_near || (leaf.part != piece && overlaps) {
                        note(leaf.number);
                    }
                    true
                });
            }
        }
    }

    /// Orders the vertices by the triangles of the trees.
    fn order_vertices(&mut self) {
        let Room { order, place, .. } = &mut self.room;
        // By slot the place of the triangle.
        place.clear();
        place.resize(self.surface.slot_count(), NONE);
        let slots = [&self.main, &self.fresh]
            .into_iter()
            .flat_map(TriangleTree::order);
        for (at, &slot) in (0..).zip(slots) {
            place[slot as usize] = at;
        }
        order.clear();
        order.extend(0..index(self.vertices.len()));
        order.sort_unstable_by_key(|&i| {
            let vertex = ParticleId(self.vertices[i as usize]);
            let first = self.surface.corners(vertex).next();
            (first.map(|(slot, _)| place[slot as usize]), i)
        });
        place.clear();
        place.resize(order.len(), 0);
        for (at, &i) in (0..).zip(&*order) {
            place[i as usize] = at;
        }
    }

    /// Searches for each vertex and each feature edge.
    fn query(&mut self, state: &ContactState<'_>, asked: Asked) {
        let mut reach = self.reach();
        if !asked.is_measured_anew() {
            // What is out of this reach was out of the other one when it was last measured.
            reach.still += self.skin();
        }
        let Room {
            placed,
            inversions,
            found,
            parts,
            steps,
            due,
            order,
            ..
        } = &mut self.room;
        let query = Query {
            state,
            settings: &self.settings,
            shape: Shape {
                surface: &self.surface,
                positions: state.positions,
                placed,
                inversions,
            },
            trees: [&self.main, &self.fresh],
            pairs: &self.fresh_pairs,
            body_of: &self.body_of,
            steps,
            reach,
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
        let (vertices, all_parts, parts) = (&self.vertices, &*parts, &self.parts);
        let (candidates, used_up) = (&self.face_candidates, self.reserve.used_up_pairs());
        let of_vertex = |contact: &FaceContact| contact.particles[0];
        // The parts that have moved relative to one.
        let moved_beside = |part: u32| {
            let first = used_up.partition_point(|[one, _]| *one < part);
            let pairs = used_up[first..].iter();
            let pairs = pairs.take_while(move |[one, _]| *one == part);
            pairs.map(|[_, other]| *other)
        };
        let widest = reach.still + reach.limit;
        let is_in_box = |other: u32, x: DVec3| {
            let bounds = all_parts[other as usize].bounds().widened(widest);
            bounds.overlaps(&Bounds::around([x]))
        };
        let ask = |(&i, found): (&u32, &mut Found)| {
            let part = parts[i as usize];
            found.clear();
            if !is_asked(part) {
                return;
            }
            let vertex = ParticleId(vertices[i as usize]);
            let was_inside = inside.binary_search_by_key(&vertex, |known| known.0);
            let is_near_moved_part = || {
                let x = state.positions[vertex.index()];
                asked.have_parts
                    && moved_beside(part).any(|other| is_in_box(other, x))
                    && (candidates
                        .binary_search_by_key(&vertex.0, of_vertex)
                        .is_ok()
                        || was_inside.is_ok()
                        || query.meets(vertex, |other| moved_beside(part).any(|o| o == other)))
            };
            found.is_kept =
                !asked.all && due[vertex.index()] == Due::Nothing && !is_near_moved_part();
            if !found.is_kept {
                query.vertex(vertex, was_inside.ok().map(|i| inside[i].1), found);
                found.is_searched = true;
            }
        };
        found.resize(vertices.len(), Found::NOTHING);
        if found.len() < PARALLEL {
            order.iter().zip(found).for_each(ask);
        } else {
            let places = order.par_iter().zip(found);
            places.with_min_len(PARALLEL / 4).for_each(ask);
        }
        if asked.edges {
            self.features.search(&query, &mut self.edge_candidates);
        }
    }

    /// Makes lists of what was found for the vertices.
    fn collect(&mut self, state: &ContactState<'_>) {
        let Room {
            found,
            last_inside,
            last_candidates,
            last_sightings,
            last_deep,
            last_inverted,
            place,
            ..
        } = &mut self.room;
        std::mem::swap(&mut self.inside, last_inside);
        std::mem::swap(&mut self.face_candidates, last_candidates);
        std::mem::swap(&mut self.sightings, last_sightings);
        self.face_candidates.clear();
        self.inside.clear();
        self.sightings.clear();
        std::mem::swap(&mut self.deep, last_deep);
        self.deep.clear();
        std::mem::swap(&mut self.inverted, last_inverted);
        self.inverted.clear();
        let (mut candidates, mut sightings) = (&last_candidates[..], &last_sightings[..]);
        let mut inside = &last_inside[..];
        for (&vertex, &place) in self.vertices.iter().zip(&*place) {
            let found = &found[place as usize];
            let known = candidates.partition_point(|contact| contact.particles[0] <= vertex);
            let first = candidates.partition_point(|contact| contact.particles[0] < vertex);
            let was_inside = inside.partition_point(|(p, _)| p.0 < vertex);
            inside = &inside[was_inside..];
            if found.is_kept {
                self.face_candidates.extend(&candidates[first..known]);
                self.sightings.extend(&sightings[first..known]);
                self.inside
                    .extend(inside.first().filter(|(p, _)| p.0 == vertex));
                let was_deep = last_deep.binary_search_by_key(&ParticleId(vertex), |deep| deep.0);
                self.deep.extend(was_deep.ok().map(|i| last_deep[i]));
                let was_inverted = last_inverted.binary_search(&vertex).is_ok();
                self.inverted.extend(was_inverted.then_some(vertex));
            } else {
                self.searched += usize::from(found.is_searched);
                self.face_candidates.extend_from_slice(found.contacts());
                self.sightings
                    .extend(found.contacts().iter().map(|contact| {
                        let [_, second, third] = beneath(contact, state.positions);
                        Sighting {
                            weights: [second, third],
                            gap: contact.gap(state.positions),
                        }
                    }));
                if found.inside != NONE {
                    self.inside.push((ParticleId(vertex), TetId(found.inside)));
                }
                if found.is_inverted {
                    self.inverted.push(vertex);
                }
                if found.is_deep {
                    self.deep.push((ParticleId(vertex), found.is_buried));
                }
            }
            candidates = &candidates[known..];
            sightings = &sightings[known..];
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
        self.deep.len()
    }

    /// How many vertices the last update searched for.
    #[must_use]
    pub fn searched_vertices(&self) -> usize {
        self.searched
    }

    /// How many of the deep vertices have no way out within reach of the search, so that nothing pushes them out: a
    /// piece that was swallowed as a whole.
    #[must_use]
    pub fn buried(&self) -> usize {
        self.deep.iter().filter(|(_, is_buried)| *is_buried).count()
    }

    /// The vertices that touch nothing of their own piece, ascending: a tet at them is inverted, or was and they have not
    /// come out of the piece since.
    #[must_use]
    pub fn inverted(&self) -> &[u32] {
        &self.inverted
    }

    /// The mean edge of the surface at rest in m, as it was when the search tree was built over all triangles.
    #[must_use]
    pub fn mean_edge(&self) -> f64 {
        self.mean_edge
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

/// What has to be done for a vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Due {
    Nothing,
    /// It is searched for.
    Search,
    /// The vertex and all vertices near its triangles are searched for.
    Moved,
}

/// What a search is for.
#[derive(Clone, Copy, Debug)]
struct Asked {
    /// All vertices.
    all: bool,
    /// Any vertex.
    vertices: bool,
    edges: bool,
    /// Whether vertices near triangles that have moved are searched for besides those that are due.
    has_moved: bool,
    /// Whether vertices near another part are that has moved relative to theirs.
    have_parts: bool,
}

impl Asked {
    /// Whether the reserve of some vertices or parts starts over.
    fn is_measured_anew(&self) -> bool {
        self.all || self.has_moved || self.have_parts
    }
}

/// Fits the motions of all parts; `motion` gives the places of a surface vertex by its number and its particle, and what
/// it has moved by.
fn fit(
    parts: &mut Vec<Part>,
    part_of: &[u32],
    vertices: &[u32],
    body_of: &[u32],
    motion: impl Fn(usize, u32) -> ([DVec3; 2], [DVec3; 2]),
) {
    let number = part_of.iter().map(|&part| part as usize);
    parts.clear();
    parts.resize(number.clone().max().map_or(0, |most| most + 1), Part::EMPTY);
    for part in number.clone() {
        parts[part].vertices += 1;
    }
    for part in &mut *parts {
        part.stride = (part.vertices / FITTED).max(1);
    }
    for (i, (part, &vertex)) in number.zip(vertices).enumerate() {
        let part = &mut parts[part];
        part.body = body_of[vertex as usize];
        let (places, moved) = motion(i, vertex);
        let step = places[1] - places[0];
        part.steps = part.steps.union(Bounds::around([step]));
        let is_fitted = part.skipped == 0;
        part.skipped += 1;
        if part.skipped == part.stride {
            part.skipped = 0;
        }
        for (motion, (x, by)) in part.motions.iter_mut().zip(places.into_iter().zip(moved)) {
            motion.cover(x);
            if is_fitted {
                motion.add(x, by);
            }
        }
    }
    let motions = parts.iter_mut().flat_map(|part| &mut part.motions);
    motions.for_each(Motion::fit);
}

/// Whether two surface vertices are of the same piece.
fn are_of_one_piece(
    surface: &ContactSurface,
    state: &ContactState<'_>,
    vertices: [ParticleId; 2],
) -> bool {
    let piece = |p| Some(state.pieces.piece_of(surface.fan(p).next()?.tet));
    let [one, other] = vertices.map(piece);
    one == other
}

/// Whether a tet behind a triangle around a vertex is inverted.
fn is_pushed_through(
    surface: &ContactSurface,
    state: &ContactState<'_>,
    mean_edge: f64,
    vertex: ParticleId,
) -> bool {
    let tets = &state.mesh.mesh().tets;
    surface.fan(vertex).any(|triangle| {
        let corners = tets[triangle.tet.index()].map(|p| state.positions[p.index()]);
        is_inverted(corners, mean_edge)
    })
}

/// Whether a tet is inverted by more than rounding turns a sliver over.
fn is_inverted([a, b, c, d]: [DVec3; 4], mean_edge: f64) -> bool {
    let volume = (b - a).dot((c - a).cross(d - a));
    volume < -INVERTED * mean_edge.powi(3)
}

/// The box of a triangle and the triangle at the present positions; the empty box and no normal if it must not be touched.
/// The tet behind it has a box of its own, so that the search also says which tets may contain a vertex.
fn prepared(
    surface: &ContactSurface,
    body_of: &[u32],
    state: &ContactState<'_>,
    mean_edge: f64,
    slot: u32,
) -> (Box32, PlacedTriangle) {
    if !surface.is_alive(slot) {
        return (Box32::EMPTY, PlacedTriangle::default());
    }
    let BoundaryTriangle { tet, particles, .. } = *surface.triangle(slot);
    let mut placed = PlacedTriangle {
        area: surface.area(slot, state.positions),
        corners: particles.map(|p| state.positions[p.index()]),
        owner: Owner {
            body: body_of[particles[0].index()],
            piece: state.pieces.piece_of(tet),
        },
        ..PlacedTriangle::default()
    };
    let corners = state.mesh.mesh().tets[tet.index()].map(|p| state.positions[p.index()]);
    placed.is_inverted = is_inverted(corners, mean_edge);
    let squared = placed.area.length_squared();
    if !Barycentric::exist(corners) || surface.is_collapsed(slot, squared) {
        return (Box32::EMPTY, placed);
    }
    placed.normal = placed.area / squared.sqrt();
    placed.tet = Box32::around(&Bounds::around(corners));
    (Box32::around(&Bounds::around(placed.corners)), placed)
}

/// What a tree takes over of triangles, by slot.
fn by_slot(placed: &[PlacedTriangle]) -> impl Fn(u32) -> Item + Copy + '_ {
    |slot: u32| {
        let placed = &placed[slot as usize];
        Item {
            normal: placed.normal,
            tet: placed.tet,
            steps: placed.steps,
            part: placed.owner.piece,
        }
    }
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
    tree.build(0..index(boxes.len()), &boxes, |_| Item::PLAIN);
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
