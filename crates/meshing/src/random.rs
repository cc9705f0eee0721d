//! Counter-based random numbers: a pure function of the arguments, equal on every platform.
//!
//! The finalizer of `SplitMix64` (Steele, Lea and Flood, "Fast Splittable Pseudorandom Number Generators", 2014),
//! applied to a seed and a counter. Constant time.

use glam::{DVec3, dvec3};

/// Random number for a counter.
pub(super) fn hash(seed: u64, counter: u64) -> u64 {
    let mut h = seed
        .wrapping_mul(0xd134_2543_de82_ef95)
        .wrapping_add(counter.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    h = (h ^ h >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    h = (h ^ h >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    h ^ h >> 31
}

/// Vector for a counter, uniform in the cube from -1 to 1.
pub(super) fn in_cube(seed: u64, counter: u64) -> DVec3 {
    let coordinate = |axis| {
        let bits = hash(seed, counter.wrapping_mul(3).wrapping_add(axis));
        (bits >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    dvec3(coordinate(0), coordinate(1), coordinate(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fixed_and_uniform() {
        // Fixed values, so that meshes are stable across versions and platforms.
        assert_eq!(hash(0, 0), 0xe220_a839_7b1d_cdaf);
        let mut mean = DVec3::ZERO;
        for n in 0..4096 {
            let p = in_cube(7, n);
            assert!(p.abs().max_element() <= 1.0);
            mean += p / 4096.0;
        }
        // Five standard deviations of a mean of 4096.
        assert!(mean.abs().max_element() < 5.0 / (3.0_f64 * 4096.0).sqrt());
    }
}
