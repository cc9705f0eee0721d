//! The colors each vertex may still get, a bit per color, as many words as its neighborhood asks
//! for.
//!
//! A vertex with h neighbors of higher priority ends below color h, or at it, so its palette starts
//! as {0, ..., h} (ECL-GC) and only ever shrinks. The first 64 colors lie beside the smallest one
//! and the mark of the decided, 16 bytes a vertex, so that looking at a neighbor is one access in
//! nearly all cases; further words lie in a second array. Words are atomics because several
//! neighbors may remove colors from one palette in the same phase; removal commutes, so the result
//! does not depend on the order. `Relaxed` is enough: phases that read are separated from
//! phases that write by the joins of the thread pool.
//!
//! The algorithms are generic in their input and compiled where they are called, so these methods
//! have to offer themselves for inlining.

use std::sync::atomic::Ordering::Relaxed;
use std::sync::atomic::{AtomicU32, AtomicU64};

/// The mark of a decided vertex in [`Held::best`]. It makes the number larger than any color, and
/// no color is that large: a palette of h + 1 colors takes h neighbors of no smaller degree, so
/// h * h / 2 edges.
const DECIDED: u32 = 1 << 31;

/// What a vertex holds.
#[derive(Debug)]
struct Held {
    /// Colors below 64.
    word: AtomicU64,
    /// The smallest color as of the last [`Palettes::renew`]; with the mark, the color for good.
    best: AtomicU32,
    /// Where its further words start; they end where those of the next vertex start.
    more: u32,
}

/// One palette per vertex.
#[derive(Debug)]
pub(crate) struct Palettes {
    /// One entry more than vertices.
    held: Vec<Held>,
    more: Vec<AtomicU64>,
}

impl Palettes {
    /// Palette `v` holds the colors below `sizes[v]`, of which there must be at least one.
    pub(crate) fn new(sizes: impl Iterator<Item = u32>) -> Self {
        let mut held = Vec::with_capacity(sizes.size_hint().0 + 1);
        let mut more: Vec<AtomicU64> = Vec::new();
        let mut push = |more: &[AtomicU64], word| {
            held.push(Held {
                word: AtomicU64::new(word),
                best: AtomicU32::new(0),
                more: u32::try_from(more.len()).expect("a bit per edge fits in 2^32 words"),
            });
        };
        for size in sizes {
            push(&more, low_bits(size));
            let further = (64..size).step_by(64);
            more.extend(further.map(|from| AtomicU64::new(low_bits(size - from))));
        }
        push(&more, 0);
        Self { held, more }
    }

    /// The words of `v` beyond the first.
    #[inline]
    fn more(&self, v: u32) -> &[AtomicU64] {
        let [from, to] = [v as usize, v as usize + 1].map(|v| self.held[v].more as usize);
        &self.more[from..to]
    }

    #[inline]
    fn words(&self, v: u32) -> impl Iterator<Item = &AtomicU64> {
        std::iter::once(&self.held[v as usize].word).chain(self.more(v))
    }

    /// The word of `v` that has a bit for `color`, if there is one.
    #[inline]
    fn word(&self, v: u32, color: u32) -> Option<&AtomicU64> {
        match color as usize / 64 {
            0 => Some(&self.held[v as usize].word),
            word => self.more(v).get(word - 1),
        }
    }

    /// May `v` still get `color`?
    #[inline]
    pub(crate) fn contains(&self, v: u32, color: u32) -> bool {
        self.word(v, color)
            .is_some_and(|word| word.load(Relaxed) >> (color % 64) & 1 == 1)
    }

    /// Takes `color` from `v`; nothing happens if it is not there.
    #[inline]
    pub(crate) fn remove(&self, v: u32, color: u32) {
        if let Some(word) = self.word(v, color) {
            let bit = 1 << (color % 64);
            // Most often it is not there: a look is much cheaper than a removal.
            if word.load(Relaxed) & bit != 0 {
                word.fetch_and(!bit, Relaxed);
            }
        }
    }

    /// The best color of `v` as of the last renewal, or its color if it is decided.
    #[inline]
    pub(crate) fn best(&self, v: u32) -> u32 {
        self.held[v as usize].best.load(Relaxed) & !DECIDED
    }

    /// The best color of `v`, `None` if it is decided.
    #[inline]
    pub(crate) fn pending(&self, v: u32) -> Option<u32> {
        let best = self.held[v as usize].best.load(Relaxed);
        (best < DECIDED).then_some(best)
    }

    /// Gives `v` its best color for good and takes it all others, and returns the color.
    #[inline]
    pub(crate) fn decide(&self, v: u32) -> u32 {
        let color = self.best(v);
        self.held[v as usize].best.store(color | DECIDED, Relaxed);
        for word in self.words(v) {
            word.store(0, Relaxed);
        }
        color
    }

    /// Finds the best color of undecided `v` again, stores it and returns it.
    #[inline]
    pub(crate) fn renew(&self, v: u32) -> u32 {
        let mut base = 0;
        for word in self.words(v) {
            let bits = word.load(Relaxed);
            if bits != 0 {
                let best = base + bits.trailing_zeros();
                self.held[v as usize].best.store(best, Relaxed);
                return best;
            }
            base += 64;
        }
        unreachable!("vertex {v} has more colors than neighbors that can take them")
    }

    /// Have `u` and `v` no color in common?
    #[inline]
    pub(crate) fn disjoint(&self, u: u32, v: u32) -> bool {
        let [a, b] = [u, v].map(|v| self.held[v as usize].word.load(Relaxed));
        a & b == 0
            && self
                .more(u)
                .iter()
                .zip(self.more(v))
                .all(|(a, b)| a.load(Relaxed) & b.load(Relaxed) == 0)
    }

    /// Takes from `v` all but its `count` smallest colors.
    #[inline]
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

    /// The colors of all vertices, once they are decided.
    pub(crate) fn into_colors(self) -> impl Iterator<Item = u32> {
        let vertices = self.held.len() - 1;
        let held = self.held.into_iter().take(vertices);
        held.map(|held| held.best.into_inner() & !DECIDED)
    }
}

/// A word whose lowest `count` bits are set, all of them from 64 on.
fn low_bits(count: u32) -> u64 {
    if count < 64 {
        (1 << count) - 1
    } else {
        u64::MAX
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn colors(palettes: &Palettes, v: u32) -> Vec<u32> {
        (0..300)
            .filter(|&color| palettes.contains(v, color))
            .collect()
    }

    #[test]
    fn sizes_around_words() {
        let sizes = [1, 31, 32, 33, 63, 64, 65, 127, 128, 129, 130];
        let palettes = Palettes::new(sizes.into_iter());
        for (v, size) in (0..).zip(sizes) {
            assert_eq!(colors(&palettes, v), (0..size).collect::<Vec<_>>());
        }
    }

    #[test]
    fn palettes_shrink() {
        let palettes = Palettes::new([130, 70, 2].into_iter());
        for color in 0..65 {
            palettes.remove(0, color);
        }
        palettes.remove(2, 99);
        assert_eq!(palettes.best(0), 0, "as of the last renewal");
        assert_eq!(palettes.renew(0), 65);
        assert_eq!(palettes.best(0), 65);
        assert!(!palettes.disjoint(0, 1));
        assert!(palettes.disjoint(0, 2));
        palettes.keep_first(0, 3);
        assert_eq!(colors(&palettes, 0), [65, 66, 67]);
        palettes.keep_first(1, 66);
        assert_eq!(colors(&palettes, 1), (0..66).collect::<Vec<_>>());
    }

    #[test]
    fn the_decided_hold_nothing() {
        let palettes = Palettes::new([130, 3].into_iter());
        (0..70).for_each(|color| palettes.remove(0, color));
        palettes.renew(0);
        assert_eq!(palettes.pending(0), Some(70));
        assert_eq!(palettes.decide(0), 70);
        assert_eq!((palettes.pending(0), palettes.best(0)), (None, 70));
        assert_eq!(colors(&palettes, 0), []);
        assert_eq!(palettes.into_colors().collect::<Vec<_>>(), [70, 0]);
    }
}
