//! [`AnySolver`]: the solver in the precision that the scene asks for, and how it follows a cut.

use glam::DVec3;
use incise_cutting::{CutDelta, CuttableMesh};
use incise_mesh::{ParticleId, TetId, TetMesh};
use incise_xpbd::{KappaLimit, Solver};

use crate::Error;
use crate::group::Joined;
use crate::scene::Precision;

/// A solver in one of both precisions.
#[derive(Debug)]
pub(crate) enum AnySolver {
    Single(Solver<f32>),
    Double(Solver<f64>),
}

/// Does the same with whichever solver it is.
macro_rules! each {
    ($any:expr, $solver:ident => $body:expr) => {
        match $any {
            $crate::backend::AnySolver::Single($solver) => $body,
            $crate::backend::AnySolver::Double($solver) => $body,
        }
    };
}
pub(crate) use each;

impl AnySolver {
    pub(crate) fn new(
        precision: Precision,
        joined: &Joined,
        cuttable: &CuttableMesh,
    ) -> Result<Self, Error> {
        let positions = &cuttable.mesh().positions;
        let mut any = match precision {
            Precision::F32 => Self::Single(Solver::new(positions)),
            Precision::F64 => Self::Double(Solver::new(positions)),
        };
        let mesh = cuttable.mesh();
        each!(&mut any, solver => {
            for material in &joined.materials {
                let field = "body".to_owned();
                solver.add_material(*material).map_err(|source| Error::Xpbd { field, source })?;
            }
            for (t, tet) in mesh.tets.iter().enumerate() {
                solver.push_tet(tet.map(|p| p.0), mesh.corners(TetId::new(t)), joined.material_of[t]);
            }
            for (p, &fixed) in joined.fixed.iter().enumerate() {
                solver.set_mass(p, mass(solver, cuttable, ParticleId::new(p)));
                if fixed {
                    solver.set_fixed(p, true);
                }
            }
        });
        Ok(any)
    }

    /// Softens every tet, present and to come, that exceeds the limit. O(tets).
    pub(crate) fn limit_kappa(&mut self, limit: KappaLimit, mesh: &TetMesh) {
        each!(self, solver => {
            solver.limit_kappa(Some(limit));
            for t in 0..solver.tet_count() {
                if solver.kappa_of(t, limit.substep_time) > limit.kappa {
                    solver.replace_tet(t, solver.tet_particles(t), mesh.corners(TetId::new(t)));
                }
            }
        });
    }

    /// Follows a cut. Costs what the cut touched.
    pub(crate) fn follow(&mut self, delta: &CutDelta, cuttable: &CuttableMesh) {
        let mesh = cuttable.mesh();
        each!(self, solver => {
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
            for p in touched(delta) {
                solver.set_mass(p.index(), mass(solver, cuttable, p));
            }
        });
    }

    /// Recomputes masses and corners and compares; for tests and on request.
    pub(crate) fn check(&self, cuttable: &CuttableMesh) -> Result<(), Error> {
        let mesh = cuttable.mesh();
        each!(self, solver => {
            if (solver.particle_count(), solver.tet_count()) != (mesh.positions.len(), mesh.tets.len()) {
                return Err(Error::Inconsistent("the solver has another size than the mesh".into()));
            }
            for (t, tet) in mesh.tets.iter().enumerate() {
                if solver.tet_particles(t) != tet.map(|p| p.0) {
                    return Err(Error::Inconsistent(format!("tet {t} has other particles in the solver")));
                }
            }
            for p in 0..mesh.positions.len() {
                let (stored, fresh) = (solver.mass(p), mass(solver, cuttable, ParticleId::new(p)));
                if (stored - fresh).abs() > 1e-12 * fresh {
                    return Err(Error::Inconsistent(format!("particle {p} has mass {stored} instead of {fresh}")));
                }
            }
        });
        Ok(())
    }

    pub(crate) fn positions(&self, out: &mut Vec<DVec3>) {
        each!(self, solver => solver.positions(out));
    }
}

/// A quarter of the mass of each tet around a particle, summed in the order of the tets.
fn mass<R: incise_xpbd::Real>(
    solver: &Solver<R>,
    cuttable: &CuttableMesh,
    particle: ParticleId,
) -> f64 {
    let mut tets: Vec<TetId> = cuttable.around(particle).collect();
    tets.sort_unstable();
    let quarter = |t: &TetId| 0.25 * solver.density_of(t.index()) * cuttable.mesh().volume(*t);
    // Rounding can make the volume of a sliver negative.
    tets.iter().map(quarter).sum::<f64>().max(0.0)
}

/// The particles whose tets changed, ascending.
fn touched(delta: &CutDelta) -> Vec<ParticleId> {
    let added = delta.added.iter().flat_map(|tet| tet.corners);
    let relinked = delta
        .relinked
        .iter()
        .flat_map(|tet| tet.before.into_iter().chain(tet.after));
    let removed = delta.removed.iter().flat_map(|tet| tet.corners);
    let mut touched: Vec<ParticleId> = added.chain(relinked).chain(removed).collect();
    touched.sort_unstable();
    touched.dedup();
    touched
}
