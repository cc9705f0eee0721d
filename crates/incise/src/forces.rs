//! [`Measured`]: the forces of a frame on what holds the bodies of an island.
//!
//! A solver measures forces on its handles, colliders and fixed particles by number. Here they are kept for the getters
//! and reports of a simulation until the next frame that measures. An island that sleeps keeps those of the frame in
//! which it fell asleep: nothing has changed since. Cost: that of the lists, in frames that measure.

use std::collections::BTreeMap;

use glam::DVec3;
use incise_cutting::CuttableMesh;
use incise_mesh::{ParticleId, TetId};

use crate::backend::AnySolver;

/// The forces of a frame from the bodies of an island, with torques about the origin of the world.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Measured {
    /// On the frames of the solver by number; `None` on those that hold something else since.
    handles: Vec<Option<incise_xpbd::Force>>,
    /// In the order of the settings.
    pub(crate) colliders: Vec<incise_xpbd::Force>,
    /// On each solid blade that touches, by the number of its stroke.
    pub(crate) blades: BTreeMap<u32, incise_xpbd::Force>,
    /// By body, with the center of the fixed particles.
    pub(crate) fixed: BTreeMap<usize, (incise_xpbd::Force, DVec3)>,
}

impl Measured {
    /// Takes over what the solver of an island has measured; `None` if it has not. `strokes` are those of the solid blades
    /// in the order of the solver.
    pub(crate) fn of(
        solver: &AnySolver,
        mesh: &CuttableMesh,
        body_of_tet: impl Fn(TetId) -> usize,
        strokes: impl Iterator<Item = u32>,
    ) -> Option<Box<Self>> {
        let forces = solver.host().forces()?;
        let mut fixed = BTreeMap::new();
        for (p, force) in forces.fixed {
            let mut around = mesh.around(ParticleId(p));
            // What has lost all its tets belongs to no body.
            let Some(tet) = around.next() else { continue };
            let x = solver.host().position(p as usize);
            let none = (incise_xpbd::Force::default(), DVec3::ZERO, 0.0);
            let (sum, center, count) = fixed.entry(body_of_tet(tet)).or_insert(none);
            sum.force += force;
            sum.torque += x.cross(force);
            *center += x;
            *count += 1.0;
        }
        let fixed = fixed.into_iter();
        Some(Box::new(Self {
            handles: forces.handles.into_iter().map(Some).collect(),
            colliders: forces.colliders,
            blades: strokes.zip(forces.blades).collect(),
            fixed: fixed
                .map(|(body, (sum, center, count))| (body, (sum, center / count)))
                .collect(),
        }))
    }

    /// The force on a frame of the solver, if it holds what it held in the frame.
    pub(crate) fn handle(&self, number: u32) -> Option<incise_xpbd::Force> {
        *self.handles.get(number as usize)?
    }

    /// Forgets the force on a frame of the solver, which holds something else from now on.
    pub(crate) fn forget(&mut self, number: u32) {
        if let Some(force) = self.handles.get_mut(number as usize) {
            *force = None;
        }
    }
}
