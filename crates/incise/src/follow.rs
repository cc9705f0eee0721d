//! How a solver follows a cut of its mesh.
//!
//! Tets keep the numbers of the mesh's, new particles come between two others or as copies, and masses are summed anew
//! where tets have changed. Cost: what the cut touched; VBD rebuilds its stars, O(tets).

use glam::DVec3;
use incise_cutting::{CutDelta, CuttableMesh};
use incise_mesh::{ParticleId, TetId};
use incise_xpbd::{Real, Solver};

use crate::Error;
use crate::backend::{AnySolver, each_mut};
use crate::report::Milliseconds;

impl AnySolver {
    /// Applies a cut to particles, tets and masses. Costs what the cut touched.
    pub(crate) fn follow(
        &mut self,
        delta: &CutDelta,
        cuttable: &CuttableMesh,
    ) -> Result<(), Error> {
        let mesh = cuttable.mesh();
        each_mut!(self, solver => {
            for point in &delta.points {
                let [a, b] = point.ends.map(ParticleId::index);
                solver.push_particle_between(a, b, point.parameter);
            }
            for source in &delta.copies {
                solver.push_copy(source.index());
            }
            let mut added: Vec<_> = delta.added.iter().collect();
            added.sort_unstable_by_key(|tet| tet.tet);
            for tet in added {
                let (corners, rest) = (tet.corners.map(|p| p.0), mesh.corners(tet.tet));
                if tet.tet.index() < solver.tet_count() {
                    solver.replace_tet(tet.tet.index(), corners, rest);
                } else {
                    solver.push_tet(corners, rest, solver.material_of(tet.parent.index()));
                }
            }
            for tet in &delta.relinked {
                solver.relink_tet(tet.tet.index(), tet.after.map(|p| p.0));
            }
            for tet in &delta.moved {
                solver.move_tet(tet.from.index(), tet.to.index());
            }
            solver.truncate_tets(delta.tets_after());
            let mut star = Vec::new();
            for p in touched(delta) {
                let mass = mass(solver, cuttable, p, &mut star);
                solver.set_mass_in_star(p.index(), mass, star.iter().map(|tet| tet.index()));
            }
            // Particles that lost all their tets stay where they are.
            for p in delta.deleted.iter().flat_map(|tet| tet.corners) {
                if cuttable.around(p).next().is_none() {
                    solver.set_velocity(p.index(), DVec3::ZERO);
                }
            }
        });
        Ok(())
    }

    /// Updates what VBD keeps after a cut, once tets and volume constraints have been.
    pub(crate) fn update_vbd(&mut self, ms: &mut Milliseconds) -> Result<(), Error> {
        match self {
            Self::Single(backend) => backend.follow(ms),
            Self::Double(backend) => backend.follow(ms),
            #[cfg(feature = "gpu")]
            Self::Device(_) => Ok(()),
        }
    }
}

/// A quarter of the mass of each tet around a particle, summed in the order of the tets, which `star` has afterwards.
pub(crate) fn mass<R: Real>(
    solver: &Solver<R>,
    cuttable: &CuttableMesh,
    particle: ParticleId,
    star: &mut Vec<TetId>,
) -> f64 {
    star.clear();
    star.extend(cuttable.around(particle));
    star.sort_unstable();
    let quarter = |t: &TetId| 0.25 * solver.density_of(t.index()) * cuttable.mesh().volume(*t);
    // Rounding can make the volume of a sliver negative.
    star.iter().map(quarter).sum::<f64>().max(0.0)
}

/// The particles whose tets changed, ascending.
fn touched(delta: &CutDelta) -> Vec<ParticleId> {
    let added = delta.added.iter().flat_map(|tet| tet.corners);
    let relinked = delta
        .relinked
        .iter()
        .flat_map(|tet| tet.before.into_iter().chain(tet.after));
    let removed = delta.removed.iter().chain(&delta.deleted);
    let removed = removed.flat_map(|tet| tet.corners);
    let mut touched: Vec<ParticleId> = added.chain(relinked).chain(removed).collect();
    touched.sort_unstable();
    touched.dedup();
    touched
}
