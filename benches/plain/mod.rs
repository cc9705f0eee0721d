//! The scalar kernel that the solver's kernel is compared with: one tet after the other.
//!
//! Solves both constraints of a tet as one system, gradients at the corners and all, with structures of plain numbers
//! in the order of the solver, single precision, one thread. It is complete and not optimized.

use incise::mesh::glam::{DMat3, DVec3, Vec3};

/// A tet with what the solver needs of its rest shape.
#[derive(Debug)]
struct Tet {
    corners: [usize; 4],
    /// The gradients of the barycentric coordinates of corners 1 to 3.
    gradients: [Vec3; 3],
    /// Compliances of both constraints over the square of the time.
    compliances: [f32; 2],
}

/// Particles and tets of a body of rubber.
#[derive(Debug)]
pub(crate) struct Plain {
    positions: Vec<Vec3>,
    velocities: Vec<Vec3>,
    previous: Vec<Vec3>,
    weights: Vec<f32>,
    tets: Vec<Tet>,
    gamma: f32,
    time: f32,
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "rounding to single precision is the purpose"
)]
impl Plain {
    /// A body whose tets are solved in an order. `mu` and `l` are its stiffnesses in Pa.
    pub(crate) fn new(
        positions: &[DVec3],
        weights: &[f64],
        tets: &[[usize; 4]],
        order: impl Iterator<Item = u32>,
        [mu, l]: [f64; 2],
        time: f64,
    ) -> Self {
        let tet = |t: u32| {
            let corners = tets[t as usize];
            let [a, b, c, d] = corners.map(|p| positions[p]);
            let edges = DMat3::from_cols(b - a, c - a, d - a);
            let volume = edges.determinant() / 6.0;
            let inverse = edges.inverse();
            let per_time = 1.0 / (volume * time * time);
            Tet {
                corners,
                gradients: [0, 1, 2].map(|i| inverse.row(i).as_vec3()),
                compliances: [per_time / mu, per_time / l].map(|c| c as f32),
            }
        };
        let still = vec![Vec3::ZERO; positions.len()];
        Self {
            positions: positions.iter().map(|x| x.as_vec3()).collect(),
            velocities: still.clone(),
            previous: still,
            weights: weights.iter().map(|&w| w as f32).collect(),
            tets: order.map(tet).collect(),
            gamma: (1.0 + mu / l) as f32,
            time: time as f32,
        }
    }

    /// A substep of one iteration under gravity.
    pub(crate) fn substep(&mut self, gravity: DVec3) {
        let (time, gravity) = (self.time, gravity.as_vec3());
        for p in 0..self.positions.len() {
            self.previous[p] = self.positions[p];
            if self.weights[p] > 0.0 {
                self.velocities[p] += gravity * time;
                self.positions[p] += self.velocities[p] * time;
            }
        }
        for tet in &self.tets {
            solve(tet, &mut self.positions, &self.weights, self.gamma);
        }
        for p in 0..self.positions.len() {
            self.velocities[p] = (self.positions[p] - self.previous[p]) / time;
        }
    }

    /// Position of a particle.
    pub(crate) fn position(&self, particle: usize) -> DVec3 {
        self.positions[particle].as_dvec3()
    }
}

#[inline]
fn solve(tet: &Tet, positions: &mut [Vec3], weights: &[f32], gamma: f32) {
    let x = tet.corners.map(|p| positions[p]);
    let w = tet.corners.map(|p| weights[p]);
    let [p, q, r] = tet.gradients;
    let (a, b, c) = (x[1] - x[0], x[2] - x[0], x[3] - x[0]);
    let f1 = a * p.x + b * q.x + c * r.x;
    let f2 = a * p.y + b * q.y + c * r.y;
    let f3 = a * p.z + b * q.z + c * r.z;
    let norm = (f1.dot(f1) + f2.dot(f2) + f3.dot(f3)).sqrt();
    let s = if norm > 1e-12 { 1.0 / norm } else { 0.0 };
    let corners = |d1: Vec3, d2: Vec3, d3: Vec3| {
        let g1 = d1 * p.x + d2 * p.y + d3 * p.z;
        let g2 = d1 * q.x + d2 * q.y + d3 * q.z;
        let g3 = d1 * r.x + d2 * r.y + d3 * r.z;
        [-(g1 + g2 + g3), g1, g2, g3]
    };
    let deviatoric = corners(f1 * s, f2 * s, f3 * s);
    let cofactor = f2.cross(f3);
    let hydrostatic = corners(cofactor, f3.cross(f1), f1.cross(f2));
    let product =
        |g: &[Vec3; 4], h: &[Vec3; 4]| -> f32 { (0..4).map(|k| w[k] * g[k].dot(h[k])).sum() };
    let a11 = product(&deviatoric, &deviatoric) + tet.compliances[0];
    let a22 = product(&hydrostatic, &hydrostatic) + tet.compliances[1];
    let a12 = product(&deviatoric, &hydrostatic);
    let determinant = a11 * a22 - a12 * a12;
    // Rounding can make it 0, and huge numbers NaN.
    if determinant.partial_cmp(&0.0) != Some(std::cmp::Ordering::Greater) {
        return;
    }
    let (b1, b2) = (-norm, gamma - f1.dot(cofactor));
    let d1 = (a22 * b1 - a12 * b2) / determinant;
    let d2 = (a11 * b2 - a12 * b1) / determinant;
    for k in 0..4 {
        positions[tet.corners[k]] = x[k] + (deviatoric[k] * d1 + hydrostatic[k] * d2) * w[k];
    }
}
