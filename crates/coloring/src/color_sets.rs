//! A set of colors per vertex, a bit per color, of any size.
//!
//! The palettes of the algorithms that pick any color of a set, not only the smallest: a set starts
//! as {0, ..., n} with its own n and may lose and get colors up to n. All sets lie in one array.
//! Words are atomics because several threads may change sets in one pass; changes commute, so the
//! result does not depend on who was first. `Relaxed` is enough: passes that read are separated
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
    /// Set `v` holds the colors below `sizes[v]`, of which there must be at least one.
    pub(crate) fn new(sizes: impl Iterator<Item = u32>) -> Self {
        let mut offsets = vec![0];
        let mut words = Vec::new();
        for size in sizes {
            let full = size as usize / 64;
            words.extend((0..full).map(|_| AtomicU64::new(u64::MAX)));
            if !size.is_multiple_of(64) {
                words.push(AtomicU64::new((1 << (size % 64)) - 1));
            }
            // Fewer words than the graph has directed edges and vertices together, each below 2^32.
            offsets.push(u32::try_from(words.len()).expect("sets hold fewer than 2^32 words"));
        }
        Self { offsets, words }
    }

    fn words(&self, v: u32) -> &[AtomicU64] {
        &self.words[self.offsets[v as usize] as usize..self.offsets[v as usize + 1] as usize]
    }

    /// May `v` still get `color`?
    pub(crate) fn contains(&self, v: u32, color: u32) -> bool {
        let word = self.words(v).get(color as usize / 64);
        word.is_some_and(|word| word.load(Relaxed) >> (color % 64) & 1 == 1)
    }

    /// Takes `color` from `v`; nothing happens if it is not there.
    pub(crate) fn remove(&self, v: u32, color: u32) {
        if self.contains(v, color) {
            self.words(v)[color as usize / 64].fetch_and(!(1 << (color % 64)), Relaxed);
        }
    }

    /// Gives `color` to `v`, which must be below the size its set had at first.
    pub(crate) fn insert(&self, v: u32, color: u32) {
        self.words(v)[color as usize / 64].fetch_or(1 << (color % 64), Relaxed);
    }

    /// The number of colors of `v`.
    pub(crate) fn count(&self, v: u32) -> u32 {
        let words = self.words(v).iter();
        words.map(|word| word.load(Relaxed).count_ones()).sum()
    }

    /// The color of `v` that has `place` smaller ones before it; there must be one.
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
    pub(crate) fn first(&self, v: u32, from: u32) -> u32 {
        for (index, word) in (0..).zip(self.words(v)).skip(from as usize / 64) {
            let bits = word.load(Relaxed);
            if bits != 0 {
                return index * 64 + bits.trailing_zeros();
            }
        }
        unreachable!("vertex {v} has more colors than neighbors that can take them")
    }

    /// Takes from `v` all but its `count` smallest colors.
    pub(crate) fn keep_first(&self, v: u32, count: u32) {
        let mut room = count;
        for word in self.words(v) {
            let mut bits = word.load(Relaxed);
            let held = bits.count_ones();
            if held > room {
                for _ in room..held {
                    bits &= !(1 << (63 - bits.leading_zeros()));
                }
                word.store(bits, Relaxed);
            }
            room = room.saturating_sub(held);
        }
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
        let sets = ColorSets::new(sizes.into_iter());
        for (v, size) in (0..).zip(sizes) {
            assert_eq!(colors(&sets, v), (0..size).collect::<Vec<_>>());
        }
    }

    #[test]
    fn sets_shrink() {
        let sets = ColorSets::new([130, 70, 2].into_iter());
        for color in 0..65 {
            sets.remove(0, color);
        }
        sets.remove(2, 99);
        assert_eq!(sets.first(0, 0), 65);
        sets.keep_first(0, 3);
        assert_eq!(colors(&sets, 0), [65, 66, 67]);
        assert_eq!((sets.count(0), sets.nth(0, 2)), (3, 67));
        sets.insert(0, 129);
        assert_eq!((sets.count(0), sets.nth(0, 3)), (4, 129));
        sets.keep_first(1, 66);
        assert_eq!(colors(&sets, 1), (0..66).collect::<Vec<_>>());
    }
}
