//! A set of colors per vertex, a bit per color, of any size.
//!
//! The palettes of the algorithms that pick any color of a set, not only the smallest: a set starts
//! as {0, ..., n} with its own n and may lose and get colors up to n. All sets lie in one array.
//! Words are atomics because several threads may change sets in one pass; changes commute, so the
//! result does not depend on their order. `Relaxed` is enough: passes that read are separated
//! from passes that write by the joins of the thread pool.

use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;

/// One set per vertex.
#[derive(Debug)]
pub(crate) struct ColorSets {
    offsets: Vec<u32>,
    words: Vec<AtomicU64>,
}

impl ColorSets {
    /// Set `v` has room for the colors below `rooms[v].0` and holds those below `rooms[v].1`.
    pub(crate) fn new(rooms: impl Iterator<Item = (u32, u32)>) -> Self {
        let mut offsets = vec![0];
        let mut words = Vec::new();
        for (room, held) in rooms {
            words.extend((0..room).step_by(64).map(|from| {
                let bits = held.saturating_sub(from);
                AtomicU64::new(if bits < 64 { (1 << bits) - 1 } else { u64::MAX })
            }));
            // Fewer words than the graph has directed edges and vertices together, each below 2^32.
            offsets.push(u32::try_from(words.len()).expect("sets hold fewer than 2^32 words"));
        }
        Self { offsets, words }
    }

    #[inline]
    fn words(&self, v: u32) -> &[AtomicU64] {
        &self.words[self.offsets[v as usize] as usize..self.offsets[v as usize + 1] as usize]
    }

    /// May `v` still get `color`?
    #[inline]
    pub(crate) fn contains(&self, v: u32, color: u32) -> bool {
        let word = self.words(v).get(color as usize / 64);
        word.is_some_and(|word| word.load(Relaxed) >> (color % 64) & 1 == 1)
    }

    /// Takes `color` from `v`; nothing happens if it is not there.
    #[inline]
    pub(crate) fn remove(&self, v: u32, color: u32) {
        if self.contains(v, color) {
            self.words(v)[color as usize / 64].fetch_and(!(1 << (color % 64)), Relaxed);
        }
    }

    /// Gives `color` to `v`, which must be below the size its set had at first.
    #[inline]
    pub(crate) fn insert(&self, v: u32, color: u32) {
        self.words(v)[color as usize / 64].fetch_or(1 << (color % 64), Relaxed);
    }

    /// The number of colors of `v`.
    #[inline]
    pub(crate) fn count(&self, v: u32) -> u32 {
        let words = self.words(v).iter();
        words.map(|word| word.load(Relaxed).count_ones()).sum()
    }

    /// The color of `v` that has `place` smaller ones before it; there must be one.
    #[inline]
    pub(crate) fn nth(&self, v: u32, place: u32) -> u32 {
        let mut left = place;
        for (index, word) in (0..).zip(self.words(v)) {
            let mut bits = word.load(Relaxed);
            let held = bits.count_ones();
            if left < held {
                for _ in 0..left {
                    bits &= bits - 1;
                }
                return index * 64 + bits.trailing_zeros();
            }
            left -= held;
        }
        unreachable!("vertex {v} has no more than {place} colors")
    }

    /// The smallest color of `v`, which is known to be `from` or larger.
    #[inline]
    pub(crate) fn first(&self, v: u32, from: u32) -> u32 {
        for (index, word) in (0..).zip(self.words(v)).skip(from as usize / 64) {
            let bits = word.load(Relaxed);
            if bits != 0 {
                return index * 64 + bits.trailing_zeros();
            }
        }
        unreachable!("vertex {v} has more colors than neighbors that can take them")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn colors(sets: &ColorSets, v: u32) -> Vec<u32> {
        (0..300).filter(|&color| sets.contains(v, color)).collect()
    }

    #[test]
    fn sizes_around_words() {
        let sizes = [1, 63, 64, 65, 128, 130];
        let full = ColorSets::new(sizes.into_iter().map(|size| (size, size)));
        let small = ColorSets::new(sizes.into_iter().map(|size| (size, size.div_ceil(2))));
        for (v, size) in (0..).zip(sizes) {
            assert_eq!(colors(&full, v), (0..size).collect::<Vec<_>>());
            assert_eq!(colors(&small, v), (0..size.div_ceil(2)).collect::<Vec<_>>());
            small.insert(v, size - 1);
            assert_eq!(small.nth(v, small.count(v) - 1), size - 1);
        }
    }

    #[test]
    fn colors_go_and_come() {
        let sets = ColorSets::new([(130, 130), (2, 2)].into_iter());
        for color in 0..65 {
            sets.remove(0, color);
        }
        sets.remove(1, 99);
        assert_eq!(
            (sets.first(0, 0), sets.count(0), sets.nth(0, 2)),
            (65, 65, 67)
        );
        sets.insert(0, 3);
        assert_eq!((sets.first(0, 0), sets.count(0)), (3, 66));
        assert_eq!(colors(&sets, 1), [0, 1]);
    }
}
