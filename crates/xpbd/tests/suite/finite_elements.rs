//! An independent reference: small-strain linear elasticity on the same linear tets, solved by conjugate gradients.
//!
//! It shares no formula with the solver under test: strain and stress instead of constraints and compliances.

use glam::{DMat3, DVec3};
use incise_mesh::{TetId, TetMesh};
use incise_xpbd::Material;

use crate::body::within;

/// The elastic forces `-K u` of displacements `u`.
pub(crate) fn forces(mesh: &TetMesh, material: &Material, u: &[DVec3]) -> Vec<DVec3> {
    let (young, nu) = (material.young_modulus, material.poisson_ratio);
    let lambda = young * nu / ((1.0 + nu) * (1.0 - 2.0 * nu));
    let mu = young / (2.0 * (1.0 + nu));
    let mut out = vec![DVec3::ZERO; u.len()];
    for (t, tet) in mesh.tets.iter().enumerate() {
        let [a, b, c, d] = mesh.corners(TetId::new(t));
        let edges = DMat3::from_cols(b - a, c - a, d - a);
        let rows = edges.inverse().transpose();
        let volume = edges.determinant() / 6.0;
        let p = tet.map(|p| p.0 as usize);
        let gradient = DMat3::from_cols(u[p[1]] - u[p[0]], u[p[2]] - u[p[0]], u[p[3]] - u[p[0]])
            * rows.transpose();
        let strain = (gradient + gradient.transpose()) * 0.5;
        let trace = strain.x_axis.x + strain.y_axis.y + strain.z_axis.z;
        let stress = DMat3::from_diagonal(DVec3::splat(lambda * trace)) + strain * (2.0 * mu);
        let pulls = [rows.x_axis, rows.y_axis, rows.z_axis].map(|r| stress * r * volume);
        for k in 0..3 {
            out[p[k + 1]] -= pulls[k];
            out[p[0]] += pulls[k];
        }
    }
    out
}

/// The displacements at which the elastic forces balance `load`, with the particles named by `fixed` held.
pub(crate) fn equilibrium(
    mesh: &TetMesh,
    material: &Material,
    load: &[DVec3],
    fixed: impl Fn(usize) -> bool,
) -> Vec<DVec3> {
    let held = |v: &mut Vec<DVec3>| {
        for (p, x) in v.iter_mut().enumerate() {
            if fixed(p) {
                *x = DVec3::ZERO;
            }
        }
    };
    let dot = |a: &[DVec3], b: &[DVec3]| -> f64 { a.iter().zip(b).map(|(x, y)| x.dot(*y)).sum() };
    let mut u = vec![DVec3::ZERO; load.len()];
    let mut residual = load.to_vec();
    held(&mut residual);
    let mut direction = residual.clone();
    let start = dot(&residual, &residual);
    let mut square = start;
    for _ in 0..5000 {
        if square < 1e-18 * start {
            break;
        }
        let mut image = forces(mesh, material, &direction);
        held(&mut image);
        let step = -square / dot(&direction, &image);
        for p in 0..u.len() {
            u[p] += direction[p] * step;
            residual[p] += image[p] * step;
        }
        let next = dot(&residual, &residual);
        for p in 0..u.len() {
            direction[p] = residual[p] + direction[p] * (next / square);
        }
        square = next;
    }
    within(
        "finite elements: left of the load",
        (square / start).sqrt(),
        1e-8,
    );
    u
}
