//! [`VertexStars`]: for each particle the tets around it, editable in constant time.
//!
//! A doubly linked list per particle, threaded through the tets' corners: slot `4 t + k` holds the neighbors in the
//! list of the particle at corner `k` of tet `t`. Linking and unlinking a corner touches three entries and never
//! allocates beyond new tets and particles, so a cut costs what it touches.

use incise_mesh::{ParticleId, TetId, TetMesh};

const NONE: u32 = u32::MAX;

/// The tets around each particle.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct VertexStars {
    head: Vec<u32>,
    next: Vec<u32>,
    previous: Vec<u32>,
}

impl VertexStars {
    pub(crate) fn new(mesh: &TetMesh) -> Self {
        let mut stars = Self {
            head: vec![NONE; mesh.positions.len()],
            next: Vec::with_capacity(4 * mesh.tets.len()),
            previous: Vec::with_capacity(4 * mesh.tets.len()),
        };
        for (t, corners) in mesh.tets.iter().enumerate() {
            stars.push_tet(TetId::new(t), *corners);
        }
        stars
    }

    /// Appends the stars of another mesh, whose particles and tets get the next numbers.
    pub(crate) fn append(&mut self, other: &Self) {
        let first = u32::try_from(self.next.len()).expect("fewer than 2³⁰ tets");
        let shifted = |&slot: &u32| if slot == NONE { NONE } else { first + slot };
        self.head.extend(other.head.iter().map(shifted));
        self.next.extend(other.next.iter().map(shifted));
        self.previous.extend(other.previous.iter().map(shifted));
    }

    pub(crate) fn push_particle(&mut self) {
        self.head.push(NONE);
    }

    /// Appends a tet, which must be the next one.
    pub(crate) fn push_tet(&mut self, tet: TetId, corners: [ParticleId; 4]) {
        debug_assert_eq!(self.next.len(), 4 * tet.index());
        self.next.resize(self.next.len() + 4, NONE);
        self.previous.resize(self.previous.len() + 4, NONE);
        self.insert(tet, corners);
    }

    /// Moves corner `k` of `tet` from one particle's star to another's.
    pub(crate) fn relink(&mut self, tet: TetId, k: u32, from: ParticleId, to: ParticleId) {
        if from != to {
            self.unlink(tet, k, from);
            self.link(tet, k, to);
        }
    }

    /// Takes all corners of a tet out of their stars.
    pub(crate) fn remove(&mut self, tet: TetId, corners: [ParticleId; 4]) {
        for (k, particle) in (0..).zip(corners) {
            self.unlink(tet, k, particle);
        }
    }

    /// Puts all corners of a tet, which are in no star, into those of its particles.
    pub(crate) fn insert(&mut self, tet: TetId, corners: [ParticleId; 4]) {
        for (k, particle) in (0..).zip(corners) {
            self.link(tet, k, particle);
        }
    }

    /// Forgets or makes room for tets and particles at the end; those forgotten are in no star and have no star.
    pub(crate) fn resize(&mut self, particles: usize, tets: usize) {
        self.head.resize(particles, NONE);
        self.next.resize(4 * tets, NONE);
        self.previous.resize(4 * tets, NONE);
    }

    fn unlink(&mut self, tet: TetId, k: u32, particle: ParticleId) {
        let slot = (4 * tet.0 + k) as usize;
        let (next, previous) = (self.next[slot], self.previous[slot]);
        match previous {
            NONE => self.head[particle.index()] = next,
            p => self.next[p as usize] = next,
        }
        if next != NONE {
            self.previous[next as usize] = previous;
        }
    }

    fn link(&mut self, tet: TetId, k: u32, particle: ParticleId) {
        let slot = 4 * tet.0 + k;
        let head = self.head[particle.index()];
        self.next[slot as usize] = head;
        self.previous[slot as usize] = NONE;
        if head != NONE {
            self.previous[head as usize] = slot;
        }
        self.head[particle.index()] = slot;
    }

    /// The tets around a particle, in no particular order (but the same one for the same history).
    pub(crate) fn around(&self, particle: ParticleId) -> impl Iterator<Item = TetId> + '_ {
        let mut slot = self.head[particle.index()];
        std::iter::from_fn(move || {
            let current = (slot != NONE).then_some(slot)?;
            slot = self.next[current as usize];
            Some(TetId(current / 4))
        })
    }

    /// Compares with rebuilt lists; returns the first particle whose star differs.
    pub(crate) fn first_difference(&self, mesh: &TetMesh) -> Option<ParticleId> {
        let fresh = Self::new(mesh);
        (0..mesh.positions.len()).map(ParticleId::new).find(|&p| {
            let sorted = |stars: &Self| {
                let mut tets: Vec<TetId> = stars.around(p).collect();
                tets.sort_unstable();
                tets
            };
            self.head.len() != fresh.head.len() || sorted(self) != sorted(&fresh)
        })
    }
}
