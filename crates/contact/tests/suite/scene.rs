//! Bodies with all that follows them, moved by hand.

use glam::DVec3;
use incise_contact::{ContactDetector, ContactSettings, ContactState, ContactUpdate};
use incise_cutting::{CutDelta, CutOptions, CuttableMesh, PieceTracker, Plane, cut_plane};
use incise_mesh::{ParticleId, TetId, TetMesh, kuhn_box};

/// The length of a frame in s.
pub(crate) const FRAME: f64 = 1.0 / 60.0;

fn hash(seed: u64, number: usize) -> u64 {
    let mut x = seed ^ (number as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    for _ in 0..2 {
        x = (x ^ (x >> 31)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    }
    x >> 11
}

/// A hash of a seed and a number, in -1..1.
pub(crate) fn noise(seed: u64, number: usize) -> f64 {
    hash(seed, number) as f64 / (1_u64 << 52) as f64 - 1.0
}

/// A hash of a seed and a number below a limit.
pub(crate) fn below(limit: usize, seed: u64, number: usize) -> usize {
    usize::try_from(hash(seed, number) % limit as u64).unwrap()
}

/// A direction from a seed.
pub(crate) fn direction(seed: u64, number: usize) -> DVec3 {
    let at = DVec3::from_array([0, 1, 2].map(|k| noise(seed, 3 * number + k)));
    at.normalize_or(DVec3::X)
}

/// A grid of `n`³ cells with its inner particles displaced.
pub(crate) fn jittered_box(n: usize, amount: f64, seed: u64) -> TetMesh {
    let mut mesh = kuhn_box([n; 3], DVec3::ONE);
    for (i, x) in mesh.positions.iter_mut().enumerate() {
        if x.to_array().into_iter().all(|c| c > 1e-9 && c < 1.0 - 1e-9) {
            let shift = DVec3::from_array([0, 1, 2].map(|k| noise(seed, 3 * i + k)));
            *x += shift * amount / n as f64;
        }
    }
    mesh
}

/// Several bodies as one mesh, and the body of each particle.
pub(crate) fn merged(bodies: &[TetMesh]) -> (TetMesh, Vec<u32>) {
    let mut mesh = TetMesh::default();
    let mut body_of = Vec::new();
    for (number, body) in (0..).zip(bodies) {
        let first = mesh.positions.len();
        mesh.positions.extend(&body.positions);
        body_of.resize(mesh.positions.len(), number);
        let shifted = |p: ParticleId| ParticleId::new(first + p.index());
        mesh.tets
            .extend(body.tets.iter().map(|tet| tet.map(shifted)));
    }
    (mesh, body_of)
}

pub(crate) struct Scene {
    pub(crate) body: CuttableMesh,
    pub(crate) pieces: PieceTracker,
    pub(crate) contacts: ContactDetector,
    pub(crate) positions: Vec<DVec3>,
    pub(crate) velocities: Vec<DVec3>,
    pub(crate) fixed: Vec<bool>,
    pub(crate) frame_time: f64,
}

impl Scene {
    pub(crate) fn new(bodies: &[TetMesh], settings: ContactSettings) -> Self {
        let (mesh, body_of) = merged(bodies);
        let body = CuttableMesh::new(mesh).unwrap();
        let contacts = ContactDetector::new(&body, body_of, settings).unwrap();
        Self {
            pieces: PieceTracker::new(&body),
            contacts,
            positions: body.mesh().positions.clone(),
            velocities: vec![DVec3::ZERO; body.mesh().positions.len()],
            fixed: Vec::new(),
            frame_time: FRAME,
            body,
        }
    }

    pub(crate) fn state(&self) -> ContactState<'_> {
        ContactState {
            mesh: &self.body,
            pieces: &self.pieces,
            positions: &self.positions,
            velocities: &self.velocities,
            fixed: &self.fixed,
            frame_time: self.frame_time,
        }
    }

    /// The detector, and the state that it is to look at.
    fn split(&mut self) -> (&mut ContactDetector, ContactState<'_>) {
        let Self {
            body: mesh,
            pieces,
            contacts,
            positions,
            velocities,
            fixed,
            frame_time,
        } = self;
        let state = ContactState {
            mesh,
            pieces,
            positions,
            velocities,
            fixed,
            frame_time: *frame_time,
        };
        (contacts, state)
    }

    pub(crate) fn update(&mut self) -> ContactUpdate {
        let (contacts, state) = self.split();
        contacts.update(&state)
    }

    /// What a search for all vertices finds. The contacts of the scene stay as they are.
    pub(crate) fn searched_anew(&self) -> ContactDetector {
        let mut fresh = self.contacts.clone();
        fresh.search_again();
        fresh.update(&self.state());
        fresh
    }

    /// Into how many parts a frame is divided.
    pub(crate) fn intervals(&mut self) -> u32 {
        let (contacts, state) = self.split();
        contacts.intervals(&state)
    }

    /// How far apart the search looks for particles that may touch those of another group, by the rule that its
    /// documentation gives: a skin, the thickness, and what the frame brings them closer, up to four times what a frame is divided
    /// for.
    pub(crate) fn reach(&self, one: &[u32], other: &[u32]) -> f64 {
        let settings = self.contacts.settings();
        let edge = self.contacts.mean_edge();
        let mut approach = 0.0_f64;
        for &p in one {
            for &q in other {
                let [p, q] = [p, q].map(|p| self.velocities[p as usize]);
                approach = approach.max((p * self.frame_time).distance(q * self.frame_time));
            }
        }
        settings.skin * edge + settings.thickness + approach.min(4.0 * settings.reach * edge)
    }

    /// An update that searches for all vertices.
    pub(crate) fn search(&mut self) {
        let settings = self.contacts.settings().clone();
        self.contacts.set_settings(settings).unwrap();
        assert!(self.update().searched);
    }

    pub(crate) fn apply(&mut self, delta: &CutDelta) {
        delta.extend_particles(&mut self.positions);
        delta.extend_particles(&mut self.velocities);
        self.pieces.apply_delta(&self.body, delta);
        self.contacts.apply_delta(&self.body, delta);
        self.contacts.check(&self.body).unwrap();
    }

    /// Cuts the present shape by a plane.
    pub(crate) fn cut(&mut self, tag: u32, point: DVec3, normal: DVec3) -> CutDelta {
        let options = CutOptions {
            tag,
            ..CutOptions::default()
        };
        self.cut_with(&options, point, normal)
    }

    pub(crate) fn cut_with(
        &mut self,
        options: &CutOptions,
        point: DVec3,
        normal: DVec3,
    ) -> CutDelta {
        let plane = Plane { point, normal };
        let delta = cut_plane(&mut self.body, &self.positions, &plane, options).unwrap();
        self.apply(&delta);
        delta
    }

    /// Takes the last cut back.
    pub(crate) fn undo(&mut self, delta: &CutDelta) {
        self.body.undo(delta).unwrap();
        self.positions.truncate(delta.particles_before);
        self.velocities.truncate(delta.particles_before);
        self.pieces = PieceTracker::new(&self.body);
        self.contacts.undo(&self.body, delta);
        self.contacts.check(&self.body).unwrap();
    }

    /// Moves the particles of a piece.
    pub(crate) fn shift(&mut self, piece: u32, by: DVec3) {
        for particle in self.particles_of(piece) {
            self.positions[particle] += by;
        }
    }

    /// The particles of a piece, ascending.
    pub(crate) fn particles_of(&self, piece: u32) -> Vec<usize> {
        let tets = self.body.mesh().tets.iter().enumerate();
        let of_piece = tets.filter(|(t, _)| self.pieces.piece_of(TetId::new(*t)) == piece);
        let mut particles: Vec<usize> = of_piece
            .flat_map(|(_, corners)| corners.map(|p| p.index()))
            .collect();
        particles.sort_unstable();
        particles.dedup();
        particles
    }
}
