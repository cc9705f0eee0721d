//! [`CornerTerm`]: the energy of a tet as a function of one of its corners.
//!
//! With the other corners a, b, c relative to the particle's position and `n = (b - a) × (c - a)`, the determinant of F
//! is `n · a / 6V`, and the pull of `|F|²` is a weighted sum of a, b and c. So a particle needs eight numbers of a tet,
//! not the nine of its rest matrix, and the deformation gradient is never formed. Cost: about 60 operations.

use crate::Float;
use crate::neo_hookean::TetConstraint;
use crate::particles::Particles;

/// The other corners of each corner, such that corner and others are an even permutation.
pub(super) const OTHERS: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [3, 0, 1], [2, 1, 0]];

/// A tet seen from one of its particles: 32 bytes in single precision.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct CornerTerm<R> {
    /// The other particles, in an order that makes `n · a` positive at rest.
    pub(super) others: [u32; 3],
    /// `μV q · q'` with q' of each other particle: the gradient of `μV/2 |F|²` is the sum of these times a, b, c.
    pub(super) pulls: [R; 3],
    /// `√(lV) / 6V`: times n, minus the gradient of `√(lV) det F`.
    pub(super) slope: R,
    /// `√(lV) γ`.
    pub(super) target: R,
}

/// A term at the present positions.
pub(super) struct Corner<R: Float> {
    /// The other particles relative to the own one.
    pub(super) others: [R::Vector; 3],
    /// Minus the gradient of `√(lV) det F`.
    pub(super) slope: R::Vector,
    /// The elastic force on the particle in N.
    pub(super) force: R::Vector,
}

impl<R: Float> CornerTerm<R> {
    /// The term with its own particle at `x`.
    #[inline(always)]
    pub(super) fn at(&self, particles: &Particles<R>, x: R::Vector) -> Corner<R> {
        // Written out: the closure of an array's `map` would be compiled without wide registers, as a call.
        let ([p, q, r], [wa, wb, wc]) = (self.others, self.pulls);
        let a = particles.vector(p as usize) - x;
        let b = particles.vector(q as usize) - x;
        let c = particles.vector(r as usize) - x;
        let slope = R::cross(b - a, c - a) * self.slope;
        let excess = R::dot(slope, a) - self.target;
        Corner {
            others: [a, b, c],
            slope,
            force: slope * excess - (a * wa + b * wb + c * wc),
        }
    }

    /// What a corner sees of a tet, computed in double precision and rounded once; `None` if the tet takes no part.
    pub(super) fn new(tet: &TetConstraint<f64>, corner: usize) -> Option<Self> {
        if !takes_part(tet) {
            return None;
        }
        let q = rows(tet);
        let others = OTHERS[corner];
        let volume = volume_term(tet.stiffness * tet.ratio, tet.gamma, determinant(&q));
        Some(Self {
            others: others.map(|k| tet.particles[k]),
            pulls: others.map(|k| R::from_f64(tet.stiffness * q[corner].dot(q[k]))),
            slope: R::from_f64(volume[0]),
            target: R::from_f64(volume[1]),
        })
    }
}

/// Whether a tet has elastic energy: removed tets have none.
pub(super) fn takes_part<R: Float>(tet: &TetConstraint<R>) -> bool {
    tet.stiffness > R::ZERO
}

/// The gradients of the four barycentric coordinates of a tet at rest.
pub(super) fn rows(tet: &TetConstraint<f64>) -> [glam::DVec3; 4] {
    let row = |i: usize| glam::DVec3::from_slice(&tet.inverse_rest[3 * i..3 * i + 3]);
    let [a, b, c] = [row(0), row(1), row(2)];
    [-(a + b + c), a, b, c]
}

/// `1 / 6V`.
pub(super) fn determinant(rows: &[glam::DVec3; 4]) -> f64 {
    rows[1].dot(rows[2].cross(rows[3]))
}

/// Slope and target of a volume term `stiffness / 2 (det F - γ)²`.
pub(super) fn volume_term(stiffness: f64, gamma: f64, determinant: f64) -> [f64; 2] {
    let root = stiffness.sqrt();
    [root * determinant, root * gamma]
}
