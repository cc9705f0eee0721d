//! [`jitter`]: adds a little width to a body on an exact line.
//!
//! Where all tets lie on one line, det F is zero to second order: the volume constraint has no gradient, the other
//! constraint pulls along the line, and no constraint moves a particle off it. The state is an unstable equilibrium; on
//! most lines that are not along an axis, rounding alone leaves it. On a plane the volume constraint has a gradient and
//! no jitter is needed. On a point jitter does not help, because that is a minimum of the energy.
//!
//! Cost: a test of one tet in a frame, unless that is degenerate.

use glam::DVec3;

use crate::Float;
use crate::float::{finite, store};
use crate::particles::Particles;
use crate::tets::TetSet;

/// How far particles are moved, as a part of the size of a tet.
const JITTER: f64 = 1e-6;

/// Moves each free particle by about [`JITTER`] of a tet's size if all tets lie on one line; returns how many it moved.
///
/// Deterministic: the direction is a hash of the particle's number.
pub(crate) fn jitter<R: Float>(particles: &Particles<R>, tets: &TetSet<R>) -> usize {
    if !is_on_a_line(particles, tets) {
        return 0;
    }
    let volume: f64 = tets.rest_volumes.iter().map(|v| v.abs()).sum();
    let size = (volume / tets.rest_volumes.len() as f64).cbrt();
    let free = (0..particles.len()).filter(|&p| particles.is_free(p));
    free.filter(|&p| displace(particles, p, JITTER * size))
        .count()
}

/// Whether no tet has two dimensions, to the last digit, while one has one.
fn is_on_a_line<R: Float>(particles: &Particles<R>, tets: &TetSet<R>) -> bool {
    let mut line = false;
    for tet in &tets.list {
        let [a, b, c, d] = particles.corners(tet.particles);
        let [u, v, w] = [b - a, c - a, d - a];
        if [u.cross(v), v.cross(w), w.cross(u)] != [DVec3::ZERO; 3] {
            return false;
        }
        line |= [u, v, w] != [DVec3::ZERO; 3];
    }
    line
}

/// Moves a particle by `amount` in every coordinate, or by as much more as it takes to change the last digit of each;
/// returns whether that was possible.
fn displace<R: Float>(particles: &Particles<R>, particle: usize, mut amount: f64) -> bool {
    let x = particles.local(particle);
    let direction = direction(particle as u64);
    loop {
        let moved = R::from_dvec3(x + direction * amount);
        if !finite::<R>(moved) {
            return false;
        }
        if R::to_dvec3(moved).cmpne(x).all() {
            store::<R>(&particles.cells[particle], moved);
            return true;
        }
        amount *= 2.0;
    }
}

/// A vector of coordinates between 1/2 and 1, each of either sign, that depends on `number` alone (`SplitMix64`:
/// Steele, Lea, Flood 2014).
fn direction(number: u64) -> DVec3 {
    let coordinate = |axis: u64| {
        let mut z = (3 * number + axis + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        let size = 0.5 + ((z >> 11) as f64) / (1u64 << 54) as f64;
        if z & 1 == 0 { size } else { -size }
    };
    DVec3::new(coordinate(0), coordinate(1), coordinate(2))
}
