//! A beam that is held at one end and hangs under gravity, for the solver and for the reference.

use incise::mesh::glam::DVec3;
use incise::mesh::{ParticleId, TetMesh, kuhn_box};
use incise::xpbd::{Material, Real, Solver};
use incise_reference::ReferenceBody;

use super::body::body;

pub(crate) const GRAVITY: DVec3 = DVec3::new(0.0, 0.0, -9.81);
/// Time of a frame in s.
pub(crate) const FRAME: f64 = 1.0 / 60.0;
/// The angular frequency of the slowest vibration in 1/s by Euler and Bernoulli, `1.875² √(E I / ρ A L⁴)`.
pub(crate) const RATE: f64 = 8.0;

/// A soft beam of 1 m × 0.25 m × 0.25 m.
pub(crate) struct Beam {
    pub(crate) mesh: TetMesh,
    pub(crate) material: Material,
    /// The particle in the middle of the free end.
    pub(crate) tip: usize,
}

impl Beam {
    pub(crate) fn new(poisson_ratio: f64, quick: bool) -> Self {
        let cells = if quick { [8, 2, 2] } else { [16, 4, 4] };
        let mesh = kuhn_box(cells, DVec3::new(1.0, 0.25, 0.25));
        let end = DVec3::new(1.0, 0.125, 0.125);
        let distances = mesh.positions.iter().map(|x| x.distance(end)).enumerate();
        let nearest = distances.min_by(|a, b| a.1.total_cmp(&b.1));
        Self {
            tip: nearest.map_or(0, |(p, _)| p),
            mesh,
            material: Material {
                young_modulus: 1e6,
                poisson_ratio,
                density: 1000.0,
                damping: 0.0,
            },
        }
    }

    pub(crate) fn solver<R: Real>(&self) -> anyhow::Result<Solver<R>> {
        body(&self.mesh, self.material, |x| x.x == 0.0)
    }

    pub(crate) fn reference(&self) -> anyhow::Result<ReferenceBody> {
        let material = incise_reference::Material {
            young_modulus: self.material.young_modulus,
            poisson_ratio: self.material.poisson_ratio,
            density: self.material.density,
        };
        let tets: Vec<[u32; 4]> = self
            .mesh
            .tets
            .iter()
            .map(|t| t.map(|ParticleId(p)| p))
            .collect();
        let mut body = ReferenceBody::new(&self.mesh.positions, &tets, |_tet| material)?;
        for (fixed, x) in body.fixed.iter_mut().zip(&self.mesh.positions) {
            *fixed = x.x == 0.0;
        }
        Ok(body)
    }
}
