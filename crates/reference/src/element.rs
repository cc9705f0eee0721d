//! [`Element`]: a linear tet, which maps functions of the deformation gradient to functions of its four corners.
//!
//! The deformation gradient is constant in a linear tet: `F = Σ x_a ⊗ ∇λ_a` over the corners a, with the gradients of
//! the barycentric coordinates λ of the rest shape. Forces and stiffness are chain rules through it.
//! Source: Bonet and Wood 2008, chapter 7. Cost: constant.

use glam::{DMat3, DVec3};

use crate::{Material, ReferenceError, StableNeoHookean};

/// A tet with the precomputed data of its rest shape.
#[derive(Clone, Debug)]
pub(crate) struct Element {
    pub(crate) particles: [u32; 4],
    /// Gradients of the barycentric coordinates in 1/m.
    pub(crate) gradients: [DVec3; 4],
    /// Volume at rest in m³.
    pub(crate) volume: f64,
    pub(crate) law: StableNeoHookean,
}

impl Element {
    /// Creates the element of tet number `tet` with rest shape `rest`.
    pub(crate) fn new(
        tet: usize,
        particles: [u32; 4],
        rest: [DVec3; 4],
        material: &Material,
    ) -> Result<Self, ReferenceError> {
        material.check()?;
        let [a, b, c, d] = rest;
        let edges = DMat3::from_cols(b - a, c - a, d - a);
        let volume = edges.determinant() / 6.0;
        let inverse = edges.inverse();
        let [p, q, r] = [inverse.row(0), inverse.row(1), inverse.row(2)];
        let gradients = [-(p + q + r), p, q, r];
        if !(volume > 0.0 && volume.is_finite() && gradients.iter().all(|g| g.is_finite())) {
            return Err(ReferenceError::Volume { tet, volume });
        }
        Ok(Self {
            particles,
            gradients,
            volume,
            law: material.law(),
        })
    }

    /// Deformation gradient for corners at `x`.
    pub(crate) fn deformation(&self, x: &[DVec3]) -> DMat3 {
        let [a, b, c, d] = self.particles.map(|p| x[p as usize]);
        let [_, p, q, r] = self.gradients;
        outer(b - a, p) + outer(c - a, q) + outer(d - a, r)
    }

    /// Blocks of the stiffness matrix: entry `[a][b]` is the derivative of minus the force on corner a with respect to
    /// corner b.
    pub(crate) fn stiffness(&self, h: &crate::Matrix9) -> [[DMat3; 4]; 4] {
        let blocks: [[DMat3; 3]; 3] = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let column =
                    |c| DVec3::from_array(std::array::from_fn(|r| h[3 * i + r][3 * j + c]));
                DMat3::from_cols(column(0), column(1), column(2)) * self.volume
            })
        });
        let g = self.gradients.map(|g| g.to_array());
        std::array::from_fn(|a| {
            // Contract over the columns of F at corner a, then at corner b.
            let half: [DMat3; 3] = std::array::from_fn(|j| {
                blocks[0][j] * g[a][0] + blocks[1][j] * g[a][1] + blocks[2][j] * g[a][2]
            });
            std::array::from_fn(|b| half[0] * g[b][0] + half[1] * g[b][1] + half[2] * g[b][2])
        })
    }
}

fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}
