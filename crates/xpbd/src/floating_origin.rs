//! The origin of a solver: the point that its particles' positions are relative to.
//!
//! A single-precision number has seven digits: ten kilometers from the origin of the world the last one is a
//! millimeter, and a body that falls by a hundredth of that in a substep does not move. Positions are therefore
//! relative to a point in the body, which is known in double precision, and precision does not depend on the position
//! in the world.
//!
//! The origin is the center of the bounding box, rounded to multiples of the power of two above the box's longest side,
//! so coordinates are at most one and a half times as long as that side. A body that contains or touches the origin of
//! the world mostly keeps it as its own. Bodies that differ by a shift of such a multiple have bit-identical relative
//! positions, if double precision holds the shifted ones. A body that has moved by more than twice its size gets a new
//! origin between frames.
//!
//! Cost: a pass over the particles a frame, one more when the origin moves.

use glam::DVec3;
use rayon::prelude::*;

use crate::Float;
use crate::float::{load, store};
use crate::particles::{PARALLEL_PARTICLES, Particles};

/// An axis-aligned box.
#[derive(Clone, Copy, Debug)]
struct BoundingBox {
    low: DVec3,
    high: DVec3,
}

impl BoundingBox {
    const EMPTY: Self = Self {
        low: DVec3::INFINITY,
        high: DVec3::NEG_INFINITY,
    };

    fn with(self, x: DVec3) -> Self {
        self.union(Self { low: x, high: x })
    }

    fn union(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }

    /// The longest side; not finite without points.
    fn size(self) -> f64 {
        (self.high - self.low).max_element()
    }

    fn center(self) -> DVec3 {
        0.5 * self.low + 0.5 * self.high
    }

    /// The center, rounded as this file's head says.
    fn origin(self) -> DVec3 {
        const EXPONENT: u64 = 0x7ff0_0000_0000_0000;
        // Without its mantissa a double is the power of two below it.
        let grid = 2.0 * f64::from_bits(self.size().to_bits() & EXPONENT);
        let center = self.center();
        // A body as flat as a point has no grid. Halves are rounded down: a body that begins at 0 keeps the 0.
        let rounded = (center / grid - 0.5).ceil() * grid;
        [rounded, center]
            .into_iter()
            .find(|origin| origin.is_finite())
            .unwrap_or(DVec3::ZERO)
    }
}

/// Where the origin of a body with particles at `positions` goes, and the longest side of its bounding box.
pub(crate) fn frame_of(positions: &[DVec3]) -> (DVec3, f64) {
    let bounds = positions
        .iter()
        .fold(BoundingBox::EMPTY, |bounds, x| bounds.with(*x));
    if bounds.size().is_finite() {
        (bounds.origin(), bounds.size())
    } else {
        (DVec3::ZERO, 0.0)
    }
}

/// Gives the body a new origin if it has moved on by more than twice its size, and returns by how much the origin
/// moved.
///
/// Particles keep their position in the world but for one rounding in the solver's precision; those that come
/// closer to the origin, exactly.
pub(crate) fn recenter<R: Float>(particles: &mut Particles<R>) -> Option<R::Vector> {
    let bounds = particles
        .cells
        .par_iter()
        .with_min_len(PARALLEL_PARTICLES)
        .map(|cell| BoundingBox::EMPTY.with(R::to_dvec3(load::<R>(cell))))
        .reduce(|| BoundingBox::EMPTY, BoundingBox::union);
    let distance = bounds.center().abs().max_element();
    let size = particles.size.max(bounds.size());
    if !(distance.is_finite() && distance > 2.0 * size) {
        return None;
    }
    let shift = bounds.origin();
    // What double precision cannot add to the origin must not be taken from the particles.
    let origin = particles.origin + shift;
    let shift = R::from_dvec3(origin - particles.origin);
    particles
        .cells
        .par_iter()
        .with_min_len(PARALLEL_PARTICLES)
        .for_each(|cell| store::<R>(cell, load::<R>(cell) - shift));
    particles.origin = origin;
    Some(shift)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn origins_are_round_and_shift_with_the_body() {
        let unit = [DVec3::splat(-0.4), DVec3::new(0.5, 0.2, 0.3)];
        assert_eq!(frame_of(&unit), (DVec3::ZERO, 0.9));
        for shift in [1.0, -7.0, 1e4, -1e6, 1e9].map(DVec3::splat) {
            let (origin, _) = frame_of(&unit.map(|x| x + shift));
            assert_eq!(origin, shift);
        }
        // A body from 0 to 1 has its center exactly between two multiples.
        assert_eq!(frame_of(&[DVec3::ZERO, DVec3::ONE]), (DVec3::ZERO, 1.0));
    }

    #[test]
    fn degenerate_bodies_have_an_origin() {
        assert_eq!(frame_of(&[]), (DVec3::ZERO, 0.0));
        let point = DVec3::new(1.5, -3e8, 1e-300);
        assert_eq!(frame_of(&[point, point]), (point, 0.0));
        for huge in [[DVec3::splat(-1e308), DVec3::splat(1e308)], [DVec3::MAX; 2]] {
            assert!(frame_of(&huge).0.is_finite());
        }
        let (origin, size) = frame_of(&[DVec3::ZERO, DVec3::splat(5e-324)]);
        assert!(origin.is_finite() && size > 0.0);
    }
}
