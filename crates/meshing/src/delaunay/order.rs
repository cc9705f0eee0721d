//! Insertion order of points: random rounds of doubling size, each along a space-filling curve.
//!
//! Consecutive points of a round are near each other, which keeps walks short; the rounds distribute early points over
//! the whole body, which keeps cavities small in expectation. Source: N. Amenta, S. Choi and G. Rote, "Incremental
//! constructions con BRIO", 2003, with the Z-order of G. M. Morton, 1966. Cost: O(n log n).

use glam::DVec3;
use incise_mesh::Bounds;

use crate::random::hash;

/// Bits per axis of the curve.
const BITS: u32 = 20;

/// Indices of the points in the order of insertion; a function of the points alone.
pub(super) fn insertion_order(points: &[DVec3]) -> Vec<u32> {
    let keys = morton_keys(points);
    let mut order: Vec<(u32, u64, u32)> = (0_u32..)
        .zip(keys)
        .map(|(point, key)| {
            // Half of the points are in the last round, a quarter in the one before, and so on.
            let round = 64 - hash(0, u64::from(point)).trailing_zeros();
            (round, key, point)
        })
        .collect();
    order.sort_unstable();
    order.into_iter().map(|(_, _, point)| point).collect()
}

/// Position of each point on the Z-order curve through the bounding box.
pub(crate) fn morton_keys(points: &[DVec3]) -> impl Iterator<Item = u64> {
    let bounds = Bounds::around(points.iter().copied());
    let extent = bounds.size().max_element();
    let scale = f64::from((1_u32 << BITS) - 1) / if extent > 0.0 { extent } else { 1.0 };
    points.iter().map(move |&p| {
        let cell = (p - bounds.low) * scale;
        (0..3).fold(0, |key, axis| key | spread(cell[axis]) << axis)
    })
}

/// Integer bits of a number, spread with two zeros between any two.
fn spread(coordinate: f64) -> u64 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "between 0 and 2^20"
    )]
    let whole = coordinate as u64;
    (0..BITS).fold(0, |key, bit| key | (whole >> bit & 1) << (3 * bit))
}

#[cfg(test)]
mod tests {
    use glam::dvec3;

    use super::*;

    #[test]
    fn a_permutation_with_rounds() {
        let points: Vec<DVec3> = (0..500).map(|i| dvec3(f64::from(i), 0.0, 0.0)).collect();
        let order = insertion_order(&points);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..500).collect::<Vec<_>>());
        // The last half runs along the curve, here the x axis.
        assert!(order[300..].is_sorted());
    }

    #[test]
    fn one_place_is_one_key() {
        assert_eq!(morton_keys(&[DVec3::ONE; 3]).collect::<Vec<_>>(), [0; 3]);
    }
}
