//! The colors taken at each particle, a bit per color.
//!
//! Vertices at one particle all differ in color, so a color at a particle belongs to one of them, and
//! the colors that a vertex cannot have are the union over its particles. That takes a word per
//! particle and 64 colors and looks at no neighbor. Cost: O(particles of the vertex * colors / 64)
//! for each question; all words are moved when a color needs more of them, which is rare.

use incise_graph::ColorId;

/// The colors at each particle.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Taken {
    /// Words per particle, at least 1.
    stride: usize,
    words: Vec<u64>,
}

impl Default for Taken {
    fn default() -> Self {
        Self {
            stride: 1,
            words: Vec::new(),
        }
    }
}

impl Taken {
    /// Makes sure that there are `particles` particles at least.
    pub(super) fn reserve_particles(&mut self, particles: usize) {
        if self.words.len() < particles * self.stride {
            self.words.resize(particles * self.stride, 0);
        }
    }

    /// Takes a color at some particles.
    pub(super) fn take(&mut self, particles: impl Iterator<Item = u32>, color: ColorId) {
        let word = color.index() / 64;
        if word >= self.stride {
            self.widen(word + 1);
        }
        for p in particles {
            self.words[p as usize * self.stride + word] |= 1 << (color.index() % 64);
        }
    }

    /// Gives a color back at some particles, where it was taken.
    pub(super) fn give_back(&mut self, particles: impl Iterator<Item = u32>, color: ColorId) {
        let word = color.index() / 64;
        for p in particles {
            self.words[p as usize * self.stride + word] &= !(1 << (color.index() % 64));
        }
    }

    /// Whether a color is free at all of some particles.
    pub(super) fn is_free(&self, mut particles: impl Iterator<Item = u32>, color: ColorId) -> bool {
        let word = color.index() / 64;
        word >= self.stride
            || particles.all(|p| {
                self.words[p as usize * self.stride + word] >> (color.index() % 64) & 1 == 0
            })
    }

    /// The smallest color that is free at all of some particles.
    pub(super) fn first_free(&self, particles: impl Iterator<Item = u32> + Clone) -> ColorId {
        for word in 0..self.stride {
            let words = particles
                .clone()
                .map(|p| self.words[p as usize * self.stride + word]);
            let taken = words.fold(0, |taken, word| taken | word);
            if taken != u64::MAX {
                return ColorId::new(64 * word + taken.trailing_ones() as usize);
            }
        }
        ColorId::new(64 * self.stride)
    }

    /// Adds to `counts` for each of its colors at how many of some particles it is taken.
    pub(super) fn count(&self, particles: impl Iterator<Item = u32>, counts: &mut [u32]) {
        for p in particles {
            let words = &self.words[p as usize * self.stride..][..self.stride];
            for (counts, word) in counts.chunks_mut(64).zip(words) {
                let mut word = *word;
                while word != 0 {
                    if let Some(count) = counts.get_mut(word.trailing_zeros() as usize) {
                        *count += 1;
                    }
                    word &= word - 1;
                }
            }
        }
    }

    /// Whether the same colors are taken, whatever the number of words.
    pub(super) fn agrees_with(&self, other: &Self) -> bool {
        let (mut a, mut b) = (self.clone(), other.clone());
        let stride = a.stride.max(b.stride);
        a.widen(stride);
        b.widen(stride);
        a == b
    }

    /// Gives every particle `stride` words.
    fn widen(&mut self, stride: usize) {
        let particles = self.words.len() / self.stride;
        let mut words = Vec::with_capacity(particles * stride);
        for old in self.words.chunks_exact(self.stride) {
            words.extend(old);
            words.resize(words.len() + stride - self.stride, 0);
        }
        (self.stride, self.words) = (stride, words);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colors_past_a_word_move_the_others() {
        let mut taken = Taken::default();
        taken.reserve_particles(3);
        for color in 0..64 {
            taken.take([1].into_iter(), ColorId(color));
        }
        let at = |taken: &Taken, list: &[u32]| taken.first_free(list.iter().copied()).index();
        assert_eq!([at(&taken, &[0, 2]), at(&taken, &[0, 1])], [0, 64]);
        assert!(taken.is_free([1].into_iter(), ColorId(64)));
        taken.take([2].into_iter(), ColorId(64));
        taken.take([1, 2].into_iter(), ColorId(130));
        assert_eq!([at(&taken, &[1]), at(&taken, &[1, 2])], [64, 65]);
        assert!(!taken.is_free([0, 2].into_iter(), ColorId(130)));
        taken.give_back([1].into_iter(), ColorId(63));
        assert_eq!([at(&taken, &[0, 1]), at(&taken, &[])], [63, 0]);
    }
}
