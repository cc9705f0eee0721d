//! [`cut_plane`]: a whole plane cuts at once.
//!
//! Each particle gets its signed distance in the space where the blade is; everything else follows from the signs (see
//! the module `sign_split`). Source: paper section 4.3. Cost: a pass over particles and tets to find the cut ones, then the
//! cut.

use glam::DVec3;

use crate::finite::{require_finite, require_positions};
use crate::parallel;
use crate::sign_split::cut_by_signs;
use crate::{CutDelta, CutError, CutOptions, CuttableMesh};

/// A plane through a point.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Plane {
    /// A point on the plane in m.
    pub point: DVec3,
    /// The direction of the positive side; any length but zero.
    pub normal: DVec3,
}

impl Plane {
    /// Returns the unit normal.
    ///
    /// # Errors
    /// If the point or the normal is not finite or the normal has no direction.
    pub fn unit_normal(&self) -> Result<DVec3, CutError> {
        require_finite("the point", self.point)?;
        require_finite("the normal", self.normal)?;
        // Scaled first, so that neither tiny nor huge normals under- or overflow when squared.
        let largest = self.normal.abs().max_element();
        if largest < f64::MIN_POSITIVE {
            return Err(CutError::ZeroNormal { length: largest });
        }
        Ok((self.normal / largest).normalize())
    }
}

/// Cuts along a whole plane.
///
/// # Arguments
/// `positions` are the particles' present positions, where the blade is; the mesh at rest is cut at the same
/// fractions of its edges.
///
/// # Returns
/// Returns the changes; none if the plane misses or only touches the body.
///
/// # Errors
/// If the plane or the options are not valid or `positions` has another length than the mesh or is not finite; nothing
/// is changed then.
///
/// # Determinism
/// Equal input gives the same bits on every machine.
///
/// # Example
/// ```
/// use glam::DVec3;
/// use incise_cutting::{CutOptions, CuttableMesh, Plane, cut_plane};
/// use incise_mesh::kuhn_box;
///
/// let mut body = CuttableMesh::new(kuhn_box([2, 2, 2], DVec3::ONE))?;
/// let positions = body.mesh().positions.clone();
/// let plane = Plane { point: DVec3::splat(0.4), normal: DVec3::new(1.0, 0.2, 0.1) };
/// let delta = cut_plane(&mut body, &positions, &plane, &CutOptions::default())?;
/// assert!(!delta.added.is_empty());
/// assert_eq!(body.mesh().pieces().count, 2);
/// assert!((body.mesh().total_volume() - 1.0).abs() < 1e-12);
/// # Ok::<(), incise_cutting::CutError>(())
/// ```
pub fn cut_plane(
    cuttable: &mut CuttableMesh,
    positions: &[DVec3],
    plane: &Plane,
    options: &CutOptions,
) -> Result<CutDelta, CutError> {
    let _span = tracing::debug_span!("cutting::plane").entered();
    options.check()?;
    let normal = plane.unit_normal()?;
    require_positions(cuttable.mesh(), positions)?;

    let distance = parallel::map(positions, |x| normal.dot(*x - plane.point));
    let what = "the distance of a particle from the plane";
    cut_by_signs(cuttable, distance, what, options, |_, [a, b]| a / (a - b))
}
