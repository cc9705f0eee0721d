//! [`cut_plane`]: a whole plane cuts at once.
//!
//! Each particle gets its signed distance in the space where the blade is; edges between different signs are crossed,
//! crossings close to a particle make that particle's sign zero, and everything else follows from the signs.
//! Source: paper section 4.3. Cost: a pass over particles and tets to find the cut ones, then the cut.

use glam::DVec3;
use incise_mesh::ParticleId;

use crate::operation::{Crossing, Operation};
use crate::{CutDelta, CutError, CutOptions, CuttableMesh, Separation};

/// A plane through a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// A point on the plane in m.
    pub point: DVec3,
    /// The direction of the positive side; any length but zero.
    pub normal: DVec3,
}

impl Plane {
    /// The unit normal.
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
/// What changed. Nothing, if the plane misses the body or only touches it.
///
/// # Errors
/// If the plane or the options are not valid or `positions` has another length than the mesh; nothing is changed then.
///
/// # Determinism
/// The same input gives the same bits on every machine.
///
/// # Example
/// ```
/// use glam::DVec3;
/// use incise_cutting::{CutOptions, CuttableMesh, Plane, cut_plane};
/// use incise_mesh::generate::kuhn_box;
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
    let expected = cuttable.mesh.positions.len();
    if positions.len() != expected {
        return Err(CutError::PositionCount {
            expected,
            given: positions.len(),
        });
    }

    let mut distance: Vec<f64> = positions
        .iter()
        .map(|x| normal.dot(*x - plane.point))
        .collect();
    if let Some(&value) = distance.iter().find(|d| !d.is_finite()) {
        return Err(CutError::NonFinite {
            what: "the distance of a particle from the plane",
            value,
        });
    }
    let mut on_surface: Vec<bool> = distance.iter().map(|&d| d == 0.0).collect();

    let crossings = crossings(cuttable, &distance);
    let snapped = snap(&crossings, options.reach(), &mut on_surface);
    let free = |c: &&Crossing| c.ends.iter().all(|p| !on_surface[p.index()]);
    let flagged: Vec<Crossing> = crossings.iter().filter(free).copied().collect();

    let mut operation = Operation::begin(cuttable, options);
    operation.delta.snapped = snapped;
    operation.split(&flagged)?;
    distance.resize(distance.len() + flagged.len(), 0.0);
    on_surface.resize(on_surface.len() + flagged.len(), true);

    let side = |corners: [ParticleId; 4]| {
        let off = corners
            .iter()
            .filter(|p| !on_surface[p.index()])
            .map(|p| distance[p.index()])
            .sum::<f64>();
        let all = || corners.iter().map(|p| distance[p.index()]).sum::<f64>();
        if off == 0.0 { all() >= 0.0 } else { off > 0.0 }
    };
    let seeds: Vec<ParticleId> = (0..on_surface.len())
        .filter(|&p| on_surface[p])
        .map(ParticleId::new)
        .collect();
    let (particles, on) = (positions.len(), |p: ParticleId| on_surface[p.index()]);
    match options.separation {
        Separation::CutFaces => operation.separate(&seeds, |face| {
            let [one, other] = face.corners.map(side);
            one != other && face.particles.into_iter().all(on)
        }),
        Separation::SharedOriginal => {
            operation.separate_by_particles(&seeds, |p| p.index() < particles);
        }
        Separation::SharedOffSurface => operation.separate_by_particles(&seeds, |p| !on(p)),
    }
    Ok(operation.finish(|_, corners| side(corners)))
}

/// The edges whose ends lie on different sides, ascending by their ends.
fn crossings(cuttable: &CuttableMesh, distance: &[f64]) -> Vec<Crossing> {
    let mut ends: Vec<[ParticleId; 2]> = Vec::new();
    for corners in &cuttable.mesh.tets {
        let d = corners.map(|p| distance[p.index()]);
        if d.iter().all(|&d| d >= 0.0) || d.iter().all(|&d| d <= 0.0) {
            continue;
        }
        for i in 0..4 {
            for j in i + 1..4 {
                if (d[i] < 0.0 && d[j] > 0.0) || (d[i] > 0.0 && d[j] < 0.0) {
                    ends.push([corners[i].min(corners[j]), corners[i].max(corners[j])]);
                }
            }
        }
    }
    ends.sort_unstable();
    ends.dedup();
    ends.into_iter()
        .map(|ends| {
            let [a, b] = ends.map(|p| distance[p.index()]);
            Crossing {
                ends,
                parameter: a / (a - b),
            }
        })
        .collect()
}

/// Puts particles on the surface that a crossing comes closer to than `reach`; returns how many.
///
/// All crossings are judged before any is dropped, so the result does not depend on their order.
fn snap(crossings: &[Crossing], reach: f64, on_surface: &mut [bool]) -> usize {
    let mut snapped = 0;
    let mut put = |p: ParticleId| {
        snapped += usize::from(!std::mem::replace(&mut on_surface[p.index()], true));
    };
    for crossing in crossings {
        if crossing.parameter < reach {
            put(crossing.ends[0]);
        } else if crossing.parameter > 1.0 - reach {
            put(crossing.ends[1]);
        }
    }
    snapped
}

pub(crate) fn require_finite(what: &'static str, v: DVec3) -> Result<(), CutError> {
    match v.to_array().into_iter().find(|c| !c.is_finite()) {
        Some(value) => Err(CutError::NonFinite { what, value }),
        None => Ok(()),
    }
}
