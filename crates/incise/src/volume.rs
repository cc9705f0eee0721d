//! [`Volumes`]: the volume constraints of an island's tets, and their update after a cut.
//!
//! Constraint `i` is that of tet `i`, so the schedule of the tets serves both. Tets of bodies without volume
//! constraints take no part. Cost: O(tets) at the start, then that of a cut and a copy of the schedule.

use glam::DVec3;
use incise_cutting::{CutDelta, CuttableMesh};
use incise_graph::Schedule;
use incise_mesh::{ParticleId, TetId};
use incise_xpbd::{ErasedSolver, VolumeConstraint, XpbdError};

use crate::Error;
use crate::backend::AnySolver;

/// Volume compliance of each material's body in an island.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Volumes {
    compliances: Vec<Option<f64>>,
}

impl Volumes {
    /// Creates the constraints; `None` if no body has them.
    pub(crate) fn new(compliances: Vec<Option<f64>>) -> Option<Self> {
        let any = compliances.iter().any(Option::is_some);
        any.then_some(Self { compliances })
    }

    /// Those of two islands with so many materials; `None` if neither has them.
    pub(crate) fn joined(
        one: (Option<&Self>, usize),
        other: (Option<&Self>, usize),
    ) -> Option<Self> {
        let of = |(volumes, materials): (Option<&Self>, usize)| {
            volumes.map_or_else(|| vec![None; materials], |v| v.compliances.clone())
        };
        Self::new([of(one), of(other)].concat())
    }

    /// Constrains all tets.
    pub(crate) fn constrain(
        &self,
        solver: &mut AnySolver,
        cuttable: &CuttableMesh,
        schedule: &Schedule,
    ) -> Result<(), Error> {
        let mesh = cuttable.mesh();
        let solver = solver.edit()?;
        let constraint = |t: usize| {
            let rest = mesh.corners(TetId::new(t));
            self.constraint(solver.material_of(t), mesh.tets[t], rest)
        };
        let list: Vec<VolumeConstraint> = (0..mesh.tets.len()).map(constraint).collect();
        let set = solver.set_volumes(&list, schedule.clone());
        set.map_err(refused)
    }

    /// Applies a delta, after the solver and the schedule have.
    pub(crate) fn apply_delta(
        &self,
        solver: &mut AnySolver,
        delta: &CutDelta,
        cuttable: &CuttableMesh,
        schedule: &Schedule,
    ) -> Result<(), Error> {
        let mesh = cuttable.mesh();
        let mut added: Vec<_> = delta.added.iter().collect();
        added.sort_unstable_by_key(|tet| tet.tet);
        let solver = solver.edit()?;
        let put = |solver: &mut dyn ErasedSolver, slot: TetId, corners: [ParticleId; 4]| {
            let material = solver.material_of(slot.index());
            let constraint = self.constraint(material, corners, mesh.corners(slot));
            let put = solver.put_volume(slot.index(), constraint);
            put.map_err(refused)
        };
        for tet in added {
            put(solver, delta.slot_after(tet.tet), tet.corners)?;
        }
        for tet in &delta.relinked {
            solver.relink_volume(tet.tet.index(), tet.after.map(|p| p.0));
        }
        // Constraints past the last tet stay in the list, but no schedule names them any more.
        for tet in &delta.moved {
            put(solver, tet.to, tet.corners)?;
        }
        solver.reschedule_volumes(schedule);
        Ok(())
    }

    fn constraint(
        &self,
        material: u16,
        corners: [ParticleId; 4],
        rest: [DVec3; 4],
    ) -> VolumeConstraint {
        let compliance = self.compliances[usize::from(material)];
        let particles = corners.map(|p| p.0);
        let mut constraint = VolumeConstraint::of_tet(particles, rest, compliance.unwrap_or(0.0));
        if compliance.is_none() {
            constraint.rest_volume = 0.0;
        }
        constraint
    }
}

fn refused(error: XpbdError) -> Error {
    Error::Inconsistent(error.to_string())
}
