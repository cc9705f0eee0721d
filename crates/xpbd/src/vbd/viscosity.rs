//! [`Viscosity`]: the damping of materials as a dissipation potential of the substep.
//!
//! With `Fₙ` the deformation gradient at the start of the substep and `dF = F - Fₙ`, a tet of volume V and damping time
//! τ dissipates `R = τ V / Δt (μ |D|² + λ/2 j²)` with the rate of Green's strain `D = sym(Fₙᵀ dF)` and the rate of
//! volume `j = cof Fₙ : dF`. It is the stiffness of linear elasticity times τ: a Kelvin-Voigt viscosity. It is convex,
//! its gradient vanishes where nothing has moved, so an equilibrium stays where it is, and a rigid motion costs nothing
//! to first order. A vibration of angular frequency ω loses the fraction `τ ω / 2` of critical damping.
//!
//! R is quadratic in the positions, so it is one matrix for the whole substep: with `Bₖ = Fₙ qₖ` and `cₖ = cof Fₙ qₖ`
//! for the gradients q of the barycentric coordinates, its blocks are
//! `τ V / Δt (μ (qₖ·qₘ) Fₙ Fₙᵀ + μ Bₘ Bₖᵀ + λ cₖ cₘᵀ)`. They are assembled once a substep, and a sweep multiplies a
//! row.
//!
//! Source: Kelvin-Voigt solid; Rayleigh damping on the strain rate after Brown, Overby, Forootaninia, Narain 2018.
//! Cost: a matrix with the pattern of the mesh, only where a material is damped; filling it is some ten sweeps, then a
//! sweep costs about a third more.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::PARALLEL_ROWS;
use super::block::{add_outer, add_symmetric, apply};
use super::corner_term::{OTHERS, rows};
use super::matrix::Blocks;
use super::row_slices::row_slices;
use super::stars::StarData;
use crate::float::finite;
use crate::neo_hookean::TetConstraint;
use crate::{Float, Solver};

/// The matrix of the dissipation in a substep.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(super) struct Viscosity<R: Float> {
    matrix: Blocks<R>,
    tets: Vec<ViscousTet<R>>,
}

/// What a block is made of, scaled so that a block is `pull · metric + images imagesᵀ + areas areasᵀ`.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
struct ViscousTet<R: Float> {
    /// `√(τ μ V / Δt) Bₖ`.
    images: [R::Vector; 4],
    /// `√(τ λ V / Δt) cₖ`.
    areas: [R::Vector; 4],
    /// `τ / Δt · Fₙ Fₙᵀ` by columns; the pulls of a corner have the rest of the factor.
    metric: [R::Vector; 3],
}

impl<R: Float> ViscousTet<R> {
    /// A tet without damping, or out of the range of numbers.
    fn none() -> Self {
        Self {
            images: [R::Vector::default(); 4],
            areas: [R::Vector::default(); 4],
            metric: [R::Vector::default(); 3],
        }
    }

    fn new(tet: &TetConstraint<f64>, x: [DVec3; 4], rate: f64) -> Self {
        let q = rows(tet);
        let f = DMat3::from_cols(x[1] - x[0], x[2] - x[0], x[3] - x[0])
            * DMat3::from_cols_array(&tet.inverse_rest).transpose();
        let cofactor = DMat3::from_cols(
            f.y_axis.cross(f.z_axis),
            f.z_axis.cross(f.x_axis),
            f.x_axis.cross(f.y_axis),
        );
        let shear = (rate * tet.stiffness).sqrt();
        // λ = l - μ.
        let bulk = (rate * tet.stiffness * (tet.ratio - 1.0).max(0.0)).sqrt();
        let metric = f * f.transpose() * rate;
        let viscous = Self {
            images: q.map(|q| R::from_dvec3(f * q * shear)),
            areas: q.map(|q| R::from_dvec3(cofactor * q * bulk)),
            metric: [metric.x_axis, metric.y_axis, metric.z_axis].map(R::from_dvec3),
        };
        let columns = viscous.images.into_iter().chain(viscous.areas);
        let sound = columns.chain(viscous.metric).all(finite::<R>);
        if sound { viscous } else { Self::none() }
    }
}

impl<R: Float> Viscosity<R> {
    /// The pattern of some stars; no values yet.
    pub(super) fn new(stars: &StarData<R>) -> Self {
        Self {
            matrix: Blocks::new(stars),
            tets: Vec::new(),
        }
    }

    /// Bytes of all lists.
    pub(super) fn bytes(&self) -> usize {
        self.matrix.bytes() + size_of_val(&*self.tets)
    }

    /// Assembles the matrix of a substep from the positions at its start.
    pub(super) fn fill(&mut self, solver: &Solver<R>, stars: &StarData<R>, time: f64) {
        let tets = solver.tets.list.par_iter().with_min_len(PARALLEL_ROWS);
        tets.zip(&solver.tets.material_of)
            .map(|(tet, &material)| {
                let rate = solver.tets.materials[usize::from(material)].damping / time;
                if rate == 0.0 || tet.stiffness <= R::ZERO {
                    return ViscousTet::none();
                }
                let start = |p: u32| R::to_dvec3(solver.particles.previous[p as usize]);
                ViscousTet::new(&tet.to_f64(), tet.particles.map(start), rate)
            })
            .collect_into_vec(&mut self.tets);
        let Blocks {
            offsets,
            blocks,
            block_indices,
            ..
        } = &mut self.matrix;
        let tets = &self.tets;
        row_slices(offsets, blocks)
            .into_par_iter()
            .for_each(|(range, blocks)| {
                let first = offsets[range.start];
                for row in range {
                    let blocks = &mut blocks[offsets[row] - first..offsets[row + 1] - first];
                    blocks.fill([R::Vector::default(); 3]);
                    let p = stars.order[row];
                    let pairs = stars.offsets[row]..stars.offsets[row + 1];
                    for (pair, block_indices) in pairs.clone().zip(&block_indices[pairs]) {
                        let t = stars.tets[pair] as usize;
                        let corners = solver.tets.list[t].particles;
                        let Some(own) = corners.iter().position(|&corner| corner == p) else {
                            continue;
                        };
                        let viscous = &tets[t];
                        let [wa, wb, wc] = stars.terms[pair].pulls;
                        let mut add = |place: u32, other: usize, pull: R| {
                            let block = &mut blocks[place as usize];
                            for (column, metric) in block.iter_mut().zip(viscous.metric) {
                                *column += metric * pull;
                            }
                            add_outer::<R>(block, viscous.images[other], viscous.images[own]);
                            add_outer::<R>(block, viscous.areas[own], viscous.areas[other]);
                        };
                        add(0, own, -(wa + wb + wc));
                        for (k, pull) in [wa, wb, wc].into_iter().enumerate() {
                            add(block_indices[k], OTHERS[own][k], pull);
                        }
                    }
                }
            });
    }

    /// Adds the blocks of a row to those of another matrix of this pattern.
    pub(super) fn add_blocks(&self, row: usize, blocks: &mut [[R::Vector; 3]]) {
        for (block, (_, viscous)) in blocks.iter_mut().zip(self.matrix.row(row)) {
            for (column, viscous) in block.iter_mut().zip(viscous) {
                *column += *viscous;
            }
        }
    }

    /// Adds the diagonal block of a row to `h`, given as xx, xy, xz, yy, yz, zz.
    #[inline]
    pub(super) fn add_diagonal(&self, row: usize, h: &mut [R; 6]) {
        add_symmetric(h, &self.matrix.blocks[self.matrix.offsets[row]]);
    }

    /// The viscous force on the particle of a row, where particle p has moved by `motion(p)` since the start.
    #[inline]
    pub(super) fn force(
        &self,
        row: usize,
        order: &[u32],
        motion: impl Fn(usize) -> R::Vector,
    ) -> R::Vector {
        let blocks = self.matrix.row(row);
        -blocks.fold(R::Vector::default(), |sum, (column, block)| {
            sum + apply::<R>(block, motion(order[column] as usize))
        })
    }

    /// The viscous force on the particle of a row in double precision.
    pub(super) fn exact_force(
        &self,
        row: usize,
        order: &[u32],
        motion: &impl Fn(usize) -> DVec3,
    ) -> DVec3 {
        let blocks = self.matrix.row(row);
        -blocks.fold(DVec3::ZERO, |sum, (column, block)| {
            let [x, y, z] = motion(order[column] as usize).to_array();
            let [a, b, c] = block.map(R::to_dvec3);
            sum + a * x + b * y + c * z
        })
    }
}
