//! Removal: tets are taken away, leaving a hole where they were.
//!
//! Faces behind the removed tets become cut faces, and what hangs together only by a particle or an edge afterwards
//! separates there, by the same rule as after a cut. The last tets move into the free slots, so tets stay dense.
//! Particles keep their numbers, those without a tet are left over. This loses volume and mass: where a smooth cut is
//! wanted, cut along a closed surface and drop the plug. Source: element deletion as in the carving plugin of SOFA.
//! Cost: that of the tets removed.

use std::collections::BTreeSet;

use glam::DVec3;
use incise_mesh::{ParticleId, TetId};

use crate::delta::{BoundaryTriangle, CutDelta, MovedTet, RemovedTet};
use crate::faces::{Behind, Face};
use crate::finite::require_positions;
use crate::operation::Operation;
use crate::{CutError, CutOptions, CuttableMesh};

/// Removes tets; `tets` may be in any order and repeat. The opened faces get the tag `tag`.
///
/// # Errors
/// [`CutError::NoSuchTet`] names the first tet that does not exist; nothing is changed then.
///
/// # Determinism
/// Equal input gives the same bits on every machine.
///
/// # Example
/// ```
/// use glam::DVec3;
/// use incise_cutting::{CuttableMesh, remove_tets};
/// use incise_mesh::{TetId, kuhn_box};
///
/// let mut body = CuttableMesh::new(kuhn_box([2, 1, 1], DVec3::ONE))?;
/// let delta = remove_tets(&mut body, &[TetId(3)], 0)?;
/// assert_eq!((body.mesh().tets.len(), delta.deleted.len()), (11, 1));
/// assert_eq!(delta.moved[0].from, TetId(11)); // the last tet fills the gap
/// body.undo(&delta)?;
/// assert_eq!(body.mesh().tets.len(), 12);
/// # Ok::<(), incise_cutting::CutError>(())
/// ```
pub fn remove_tets(
    cuttable: &mut CuttableMesh,
    tets: &[TetId],
    tag: u32,
) -> Result<CutDelta, CutError> {
    let _span = tracing::debug_span!("cutting::remove").entered();
    let count = cuttable.mesh.tets.len();
    if let Some(&tet) = tets.iter().find(|tet| tet.index() >= count) {
        return Err(CutError::NoSuchTet { tet, tets: count });
    }
    let doomed: BTreeSet<TetId> = tets.iter().copied().collect();

    let options = CutOptions {
        tag,
        ..CutOptions::default()
    };
    let mut operation = Operation::begin(cuttable, &options);
    let mut bare: Vec<BoundaryTriangle> = Vec::new();
    let mut seeds: Vec<ParticleId> = Vec::new();
    for &tet in &doomed {
        for face in Face::of(tet) {
            let mesh = &operation.cuttable.mesh;
            bare.extend(operation.cuttable.faces.triangle(mesh, face));
        }
        seeds.extend(operation.cuttable.mesh.tets[tet.index()]);
    }
    for &tet in &doomed {
        operation.detach(tet, &doomed);
    }
    seeds.sort_unstable();
    seeds.dedup();
    operation.separate(&seeds, |_| false, |_| false);

    let (cuttable, mut delta) = operation.write(|_, _| true);
    let corners = |tet: &TetId| cuttable.mesh.tets[tet.index()];
    delta.deleted = doomed
        .iter()
        .map(|tet| RemovedTet {
            tet: *tet,
            corners: corners(tet),
        })
        .collect();
    delta.surface_removed.extend(bare);
    delta
        .surface_removed
        .sort_unstable_by_key(|triangle| (triangle.tet, triangle.opposite));
    fill_gaps(cuttable, &doomed, &mut delta);
    Ok(delta)
}

/// Removes the tets whose centroid, at the present `positions` of the particles, is `inside`. O(tets).
///
/// # Errors
/// If `positions` has another length than the mesh or is not finite; nothing is changed then.
///
/// # Example
/// ```
/// use glam::DVec3;
/// use incise_cutting::{CuttableMesh, carve};
/// use incise_mesh::kuhn_box;
///
/// let mesh = kuhn_box([8; 3], DVec3::ONE);
/// let mut body = CuttableMesh::new(mesh.clone())?;
/// let drill = |x: DVec3| (x - DVec3::splat(0.5)).truncate().length() < 0.2;
/// let delta = carve(&mut body, &mesh.positions, drill, 0)?;
/// let gone = 1.0 - body.mesh().total_volume();
/// assert!((gone - 0.2 * 0.2 * std::f64::consts::PI).abs() < 0.02);
/// # Ok::<(), incise_cutting::CutError>(())
/// ```
pub fn carve(
    cuttable: &mut CuttableMesh,
    positions: &[DVec3],
    inside: impl Fn(DVec3) -> bool,
    tag: u32,
) -> Result<CutDelta, CutError> {
    require_positions(cuttable.mesh(), positions)?;
    let centroid = |corners: &[ParticleId; 4]| {
        corners.iter().map(|p| positions[p.index()]).sum::<DVec3>() * 0.25
    };
    let tets = cuttable.mesh.tets.iter().enumerate();
    let doomed: Vec<TetId> = tets
        .filter(|(_, corners)| inside(centroid(corners)))
        .map(|(t, _)| TetId::new(t))
        .collect();
    remove_tets(cuttable, &doomed, tag)
}

impl Operation<'_> {
    /// Takes a tet out of the stars and from behind its neighbors' faces, those that stay.
    fn detach(&mut self, tet: TetId, doomed: &BTreeSet<TetId>) {
        for face in Face::of(tet) {
            match self.cuttable.faces.behind(face) {
                Behind::Nothing(_) => self.cuttable.faces.close(face),
                Behind::Twin(twin) if !doomed.contains(&twin.tet()) => self.expose(twin),
                Behind::Twin(_) => {}
            }
        }
        let corners = self.cuttable.mesh.tets[tet.index()];
        self.cuttable.stars.remove(tet, corners);
    }
}

/// Moves the last tets into the slots that have become free.
pub(crate) fn fill_gaps(
    cuttable: &mut CuttableMesh,
    doomed: &BTreeSet<TetId>,
    delta: &mut CutDelta,
) {
    let CuttableMesh {
        mesh, stars, faces, ..
    } = cuttable;
    let after = delta.tets_after();
    let first = TetId::new(after);
    let gaps = doomed.range(..first);
    let last = (after..mesh.tets.len()).map(TetId::new);
    let movers = last.filter(|tet| !doomed.contains(tet));
    for (from, &to) in movers.zip(gaps) {
        let corners = mesh.tets[from.index()];
        stars.remove(from, corners);
        stars.insert(to, corners);
        faces.move_tet(from, to);
        mesh.tets[to.index()] = corners;
        delta.moved.push(MovedTet { from, to, corners });
    }
    mesh.tets.truncate(after);
    stars.resize(mesh.positions.len(), after);
    faces.resize(after);
    for triangle in &mut delta.surface_added {
        let moved = delta.moved.binary_search_by_key(&triangle.tet, |m| m.from);
        triangle.tet = moved.map_or(triangle.tet, |i| delta.moved[i].to);
    }
    delta
        .surface_added
        .sort_unstable_by_key(|triangle| (triangle.tet, triangle.opposite));
}
