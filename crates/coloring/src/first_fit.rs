//! The smallest color that no neighbor has, by a bit per color.
//!
//! A vertex with d neighbors finds a color below d + 1, so d / 64 + 1 words are enough, and larger
//! colors of neighbors cannot matter. The words are kept between calls. Cost: O(d).

use incise_graph::ColorId;

/// Colors that are taken around the current vertex.
#[derive(Debug, Default)]
pub(crate) struct FirstFit {
    taken: Vec<u64>,
}

impl FirstFit {
    /// The smallest color that is not among the `degree` or fewer `colors`.
    #[inline]
    pub(crate) fn choose(
        &mut self,
        degree: usize,
        colors: impl Iterator<Item = ColorId>,
    ) -> ColorId {
        self.taken.clear();
        self.taken.resize(degree / 64 + 1, 0);
        for color in colors {
            if let Some(word) = self.taken.get_mut(color.index() / 64) {
                *word |= 1 << (color.index() % 64);
            }
        }
        let word = self.taken.iter().position(|&word| word != u64::MAX);
        let word = word.expect("degree + 1 colors are more than degree neighbors take");
        ColorId::new(word * 64 + self.taken[word].trailing_ones() as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_gap_at_word_borders() {
        let mut first_fit = FirstFit::default();
        for gap in [0, 1, 63, 64, 65, 127, 128] {
            let colors = (0..130).filter(|&c| c != gap).map(ColorId::new);
            assert_eq!(first_fit.choose(129, colors).index(), gap);
        }
        assert_eq!(first_fit.choose(64, (0..64).map(ColorId::new)).index(), 64);
        assert_eq!(
            first_fit.choose(1, [ColorId(u32::MAX)].into_iter()).index(),
            0
        );
        assert_eq!(first_fit.choose(0, std::iter::empty()).index(), 0);
    }
}
