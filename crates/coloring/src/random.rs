//! Random numbers without state that differs between machines: a counter, scrambled.
//!
//! `SplitMix64` (Steele, Lea and Flood 2014): the counter steps by an odd constant, the output is a
//! bijection of it. Searches need no more than that, and the same seed gives the same search
//! everywhere.

/// A sequence that depends on its seed only.
#[derive(Clone, Debug)]
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next number, any of 64 bits.
    #[inline]
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        scramble(self.0)
    }

    /// The next number below `end`, which must not be 0 and must fit in 32 bits; a little uneven
    /// where `end` comes near 2^32.
    #[inline]
    pub(crate) fn below(&mut self, end: usize) -> usize {
        let index = ((self.next() >> 32) * end as u64) >> 32;
        usize::try_from(index).expect("the index is below `end`")
    }

    /// Puts `list` in random order (Fisher and Yates).
    pub(crate) fn shuffle<T>(&mut self, list: &mut [T]) {
        for last in (1..list.len()).rev() {
            list.swap(last, self.below(last + 1));
        }
    }
}

/// A bijection that looks random.
#[inline]
pub(crate) fn scramble(x: u64) -> u64 {
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pinned_and_spread() {
        // The first outputs of the published generator for seed 0.
        let mut random = Random::new(0);
        assert_eq!(random.next(), 0xe220_a839_7b1d_cdaf);
        assert_eq!(random.next(), 0x6e78_9e6a_a1b9_65f4);
        let mut counts = [0; 7];
        for _ in 0..7000 {
            counts[random.below(7)] += 1;
        }
        assert!(counts.iter().all(|&count| (900..1100).contains(&count)));
        let mut list: Vec<u32> = (0..100).collect();
        random.shuffle(&mut list);
        assert!(!list.is_sorted());
        list.sort_unstable();
        assert!(list.into_iter().eq(0..100));
    }
}
