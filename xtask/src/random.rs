//! [`Random`]: seeded pseudo-random numbers, equal on every machine.
//!
//! `SplitMix64` of Steele, Lea and Flood 2014: a counter and a mixing function. Cost: two multiplications per number.

use incise::mesh::glam::DVec3;

/// A generator; its state is the seed.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// From 0 to below 1.
    pub(crate) fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// From -1 to below 1.
    pub(crate) fn signed(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }

    /// A whole number from 0 to below `count`, which is at least 1.
    pub(crate) fn below(&mut self, count: usize) -> usize {
        usize::try_from(self.next() % count as u64).unwrap_or(0)
    }

    /// A vector in the cube from -1 to 1.
    pub(crate) fn vector(&mut self) -> DVec3 {
        DVec3::new(self.signed(), self.signed(), self.signed())
    }

    /// A vector of length 1.
    pub(crate) fn direction(&mut self) -> DVec3 {
        self.vector().normalize_or(DVec3::Z)
    }
}

#[cfg(test)]
mod tests {
    use super::Random;

    /// The first outputs for the seed 1234567 that the authors' program prints.
    #[test]
    fn outputs_are_those_of_split_mix_64() {
        let mut random = Random(1_234_567);
        let first = [
            6_457_827_717_110_365_317,
            3_203_168_211_198_807_973,
            9_817_491_932_198_370_423,
        ];
        assert_eq!(first, first.map(|_| random.next()));
    }
}
