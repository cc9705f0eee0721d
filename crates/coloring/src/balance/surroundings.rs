//! Which classes a vertex may not enter, asked of a graph or of incidence.
//!
//! A graph is walked neighbor by neighbor. With incidence, constraints on one particle all differ
//! in color, so a particle needs one bit per class, and the classes around a constraint are the
//! union of its particles' bits: about ten words instead of 65 neighbors for tetrahedra. Both give
//! the same sets, so they give the same balanced coloring. Cost: O(degree + k / 64) a question when
//! walking, O(arity * k / 64) with bits.

use incise_graph::Incidence;

use super::partition::NONE;
use crate::Conflicts;

/// The neighbors of a vertex and their classes, while vertices change class.
pub(super) trait Surroundings {
    /// Adds to `words`, a bit per class, the classes of the neighbors of `v`. The class of `v`
    /// itself may or may not be among them.
    fn add_taken(&self, v: u32, class: &[u32], words: &mut [u64]);

    /// Calls `visit` for every neighbor of `v`, for some perhaps several times.
    fn visit_neighbors(&self, v: u32, visit: impl FnMut(u32));

    /// `v` is about to leave `class`.
    fn leave(&mut self, v: u32, class: u32);

    /// `v` is about to enter `class`. All its neighbors in there have left.
    fn enter(&mut self, v: u32, class: u32);

    /// Calls `join(v, u)` for all neighbors `v` and `u` in the one and the other of two classes, in
    /// either order, for some perhaps several times. `members` are all members of the classes.
    fn join(
        &mut self,
        classes: [u32; 2],
        members: [&[u32]; 2],
        class: &[u32],
        join: impl FnMut(u32, u32),
    );
}

/// Walks all neighbors.
#[derive(Debug)]
pub(super) struct Walk<'a, C>(pub(super) &'a C);

impl<C: Conflicts> Surroundings for Walk<'_, C> {
    fn add_taken(&self, v: u32, class: &[u32], words: &mut [u64]) {
        self.0.visit_neighbors(v, |u| {
            let class = class[u as usize];
            if class != NONE {
                words[class as usize / 64] |= 1 << (class % 64);
            }
        });
    }

    fn visit_neighbors(&self, v: u32, visit: impl FnMut(u32)) {
        self.0.visit_neighbors(v, visit);
    }

    fn leave(&mut self, _: u32, _: u32) {}

    fn enter(&mut self, _: u32, _: u32) {}

    fn join(
        &mut self,
        classes: [u32; 2],
        members: [&[u32]; 2],
        class: &[u32],
        mut join: impl FnMut(u32, u32),
    ) {
        // The smaller class has less to walk.
        let from = usize::from(members[1].len() < members[0].len());
        for &v in members[from] {
            self.0.visit_neighbors(v, |u| {
                if class[u as usize] == classes[1 - from] {
                    join(v, u);
                }
            });
        }
    }
}

/// Keeps a bit per particle and class.
#[derive(Debug)]
pub(super) struct Bits<'a> {
    incidence: &'a Incidence,
    /// Words per particle.
    stride: usize,
    words: Vec<u64>,
    /// Particle -> its constraint of the current class, if it has one; work of `join`.
    owner: Vec<u32>,
}

impl<'a> Bits<'a> {
    /// Are the bits small beside the incidence itself? A single particle with very many constraints
    /// asks for as many bits on all others.
    pub(super) fn fit(incidence: &Incidence, classes: usize) -> bool {
        incidence.particle_count() * classes.div_ceil(64) <= 16 * (1 + incidence.values().len())
    }

    pub(super) fn new(incidence: &'a Incidence, class: &[u32], classes: usize) -> Self {
        let stride = classes.div_ceil(64);
        let mut bits = Self {
            incidence,
            stride,
            words: vec![0; incidence.particle_count() * stride],
            owner: vec![0; incidence.particle_count()],
        };
        for (v, &class) in (0..).zip(class) {
            if class != NONE {
                bits.enter(v, class);
            }
        }
        bits
    }
}

impl Surroundings for Bits<'_> {
    fn add_taken(&self, v: u32, _: &[u32], words: &mut [u64]) {
        for &p in self.incidence.particles_of(v as usize) {
            let start = p as usize * self.stride;
            for (sum, word) in words.iter_mut().zip(&self.words[start..]) {
                *sum |= word;
            }
        }
    }

    fn visit_neighbors(&self, v: u32, visit: impl FnMut(u32)) {
        self.incidence.visit_neighbors(v, visit);
    }

    fn leave(&mut self, v: u32, class: u32) {
        for &p in self.incidence.particles_of(v as usize) {
            self.words[p as usize * self.stride + class as usize / 64] &= !(1 << (class % 64));
        }
    }

    fn enter(&mut self, v: u32, class: u32) {
        for &p in self.incidence.particles_of(v as usize) {
            self.words[p as usize * self.stride + class as usize / 64] |= 1 << (class % 64);
        }
    }

    fn join(
        &mut self,
        [_, class]: [u32; 2],
        [first, second]: [&[u32]; 2],
        _: &[u32],
        mut join: impl FnMut(u32, u32),
    ) {
        for &u in second {
            for &p in self.incidence.particles_of(u as usize) {
                self.owner[p as usize] = u;
            }
        }
        for &v in first {
            for &p in self.incidence.particles_of(v as usize) {
                // The bit says that a member of the class is here, so its number was just written.
                let word = self.words[p as usize * self.stride + class as usize / 64];
                if word >> (class % 64) & 1 == 1 {
                    join(v, self.owner[p as usize]);
                }
            }
        }
    }
}
