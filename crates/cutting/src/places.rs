//! [`Places`]: which particles are at one place at rest, such as those on both sides of a cut.
//!
//! Copies are at the place of their particle, and a cut that crosses an open cut makes points on both sides of it at one
//! place, but for rounding (module `align`). Particles are chained by the cell of a fine grid that they are
//! in. Two that rounding puts into neighboring cells are not found, which costs an improvement and nothing else. Cost: a
//! look-up for each new particle.

use std::collections::HashMap;

use foldhash::fast::FixedState;
use glam::DVec3;
use incise_mesh::{ParticleId, TetMesh};

use crate::index::index;

const NONE: u32 = u32::MAX;
/// Size of a cell in edges of a mean tet.
const CELL: f64 = 1e-9;

/// Particles that cuts created, and those that they copied, by place.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Places {
    /// Size of a cell in m.
    cell: f64,
    /// The last entry of each chain by a hash of the cell. Never iterated.
    last: HashMap<u64, u32, FixedState>,
    /// Particles in the order of their entry, each with the entry before it in its chain.
    entries: Vec<(ParticleId, u32)>,
}

impl Places {
    /// Those of a mesh whose mean tet has edges of a length in m.
    pub(crate) fn new(edge: f64) -> Self {
        Self {
            cell: CELL * edge,
            ..Self::default()
        }
    }

    /// A hash of the cell; the chain may have particles of other cells.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a place so far away that its number does not fit shares a chain with others"
    )]
    fn hash(&self, x: DVec3) -> u64 {
        let cells = (x / self.cell).to_array().map(|c| c.round() as i64 as u64);
        let mixed = cells.into_iter().fold(0_u64, |hash, cell| {
            (hash.rotate_left(23) ^ cell).wrapping_mul(0x9e37_79b9_7f4a_7c15)
        });
        mixed ^ mixed >> 29
    }

    /// The particles of a chain, last first.
    fn chain(&self, x: DVec3) -> impl Iterator<Item = ParticleId> + '_ {
        let mut at = self.last.get(&self.hash(x)).copied().unwrap_or(NONE);
        std::iter::from_fn(move || {
            let &(particle, before) = self.entries.get(at as usize)?;
            at = before;
            Some(particle)
        })
    }

    /// The entered particles at a place, in an order that depends only on the history of cuts.
    pub(crate) fn at<'a>(
        &'a self,
        mesh: &'a TetMesh,
        x: DVec3,
    ) -> impl Iterator<Item = ParticleId> + 'a {
        let is_near = move |p: &ParticleId| self.is_same(mesh.positions[p.index()], x);
        self.chain(x).filter(is_near)
    }

    /// Whether two positions are one place.
    pub(crate) fn is_same(&self, x: DVec3, y: DVec3) -> bool {
        (x - y).abs().max_element() <= self.cell
    }

    /// Enters a particle at its place, if it is not entered.
    pub(crate) fn enter(&mut self, particle: ParticleId, x: DVec3) {
        if self.chain(x).any(|p| p == particle) {
            return;
        }
        let hash = self.hash(x);
        let entry = index(self.entries.len());
        let before = self.last.insert(hash, entry).unwrap_or(NONE);
        self.entries.push((particle, before));
    }

    /// Forgets the particles from number `particles` on, which were entered last. The mesh still has them.
    pub(crate) fn truncate(&mut self, mesh: &TetMesh, particles: usize) {
        let mut left = mesh.positions.len() - particles;
        while left > 0 {
            let Some((particle, before)) = self.entries.pop() else {
                break;
            };
            // Particles that were copied are entered before their copies, and go with them.
            left -= usize::from(particle.index() >= particles);
            let hash = self.hash(mesh.positions[particle.index()]);
            if before == NONE {
                self.last.remove(&hash);
            } else {
                self.last.insert(hash, before);
            }
        }
    }

    /// Appends those of a mesh that is appended as `appended` to one with so many particles.
    pub(crate) fn append(&mut self, other: &Self, appended: &[DVec3], particles: usize) {
        for &(particle, _) in &other.entries {
            let shifted = ParticleId::new(particles + particle.index());
            self.enter(shifted, appended[particle.index()]);
        }
    }
}
