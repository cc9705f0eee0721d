//! Refusals of numbers that are infinite or no numbers.

use glam::DVec3;
use incise_mesh::TetMesh;

use crate::CutError;

/// Refuses a vector that is not finite; `what` names it.
pub(crate) fn require_finite(what: &'static str, v: DVec3) -> Result<(), CutError> {
    match v.to_array().into_iter().find(|c| !c.is_finite()) {
        Some(value) => Err(CutError::NonFinite { what, value }),
        None => Ok(()),
    }
}

/// Refuses positions that are not finite or not one a particle.
pub(crate) fn require_positions(mesh: &TetMesh, positions: &[DVec3]) -> Result<(), CutError> {
    let (expected, given) = (mesh.positions.len(), positions.len());
    if expected != given {
        return Err(CutError::PositionCount { expected, given });
    }
    // Zero times what is not finite is not a number: one sum tells of all, and none is looked at by itself.
    if positions.iter().map(|x| *x * 0.0).sum::<DVec3>() == DVec3::ZERO {
        return Ok(());
    }
    let mut positions = positions.iter();
    positions.try_for_each(|&x| require_finite("the position of a particle", x))
}
