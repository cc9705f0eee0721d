//! [`reduce`]: color quantization to a palette.
//!
//! All colors start in one box. The box with the largest spread is split at its mean along the channel with the largest
//! spread, until there are enough boxes (X. Wu, "Color quantization by dynamic programming and principal analysis",
//! 1992, in its greedy form); each box gives the mean of its colors. Colors are weighted by the square root of their
//! count, so that a small highlight is not lost in a large background. Cost: O(pixels), plus a few passes over the
//! distinct colors.
//!
//! `NeuQuant` (`color_quant`) and Wu's method in `quantette` were compared on an image of the built-in run: the first
//! has large errors in rare colors, which show as blemishes; the second finds fewer colors and has a larger mean error.

use std::collections::HashMap;

/// A palette, and the palette index of each pixel.
#[derive(Debug)]
pub(super) struct Reduced {
    pub(super) palette: Vec<[u8; 3]>,
    pub(super) numbers: Vec<u8>,
}

/// A color and its weight.
#[derive(Clone, Copy)]
struct Color {
    color: [u8; 3],
    weight: f64,
}

/// Colors that share one palette entry.
struct Group {
    colors: Vec<Color>,
    mean: [f64; 3],
    /// Sums of squared deviations from the mean, per channel.
    spread: [f64; 3],
}

impl Group {
    fn new(colors: Vec<Color>) -> Self {
        let total: f64 = colors.iter().map(|color| color.weight).sum();
        let sum = |of: &dyn Fn(f64, usize) -> f64| -> [f64; 3] {
            std::array::from_fn(|i| {
                let parts = colors.iter();
                let parts = parts.map(|color| color.weight * of(f64::from(color.color[i]), i));
                parts.sum()
            })
        };
        let mean = sum(&|value, _| value).map(|sum| sum / total);
        let spread = sum(&|value, i| (value - mean[i]) * (value - mean[i]));
        Self {
            colors,
            mean,
            spread,
        }
    }

    fn error(&self) -> f64 {
        self.spread.iter().sum()
    }

    /// Splits the group into two parts; neither is empty if the colors differ.
    fn split(&self) -> [Self; 2] {
        let widest = (1..3).fold(0, |widest, i| {
            if self.spread[i] > self.spread[widest] {
                i
            } else {
                widest
            }
        });
        let below = |color: &Color| f64::from(color.color[widest]) <= self.mean[widest];
        let (low, high) = self.colors.iter().copied().partition(below);
        [Self::new(low), Self::new(high)]
    }
}

/// Reduces pixels of four bytes, the last of which is ignored, to at most `count` colors (256 or fewer). Deterministic.
pub(super) fn reduce(rgba: &[u8], count: usize) -> Reduced {
    let pixels = || rgba.chunks_exact(4).map(|p| [p[0], p[1], p[2]]);
    // Count of each color, later its index; never iterated.
    let mut known: HashMap<[u8; 3], u32> = HashMap::new();
    let mut colors = Vec::new();
    for color in pixels() {
        let seen = known.entry(color).or_insert(0);
        if *seen == 0 {
            colors.push(color);
        }
        *seen += 1;
    }
    let weighted = colors.iter().map(|color| Color {
        color: *color,
        weight: f64::from(known[color]).sqrt(),
    });
    let mut groups = Vec::new();
    if !colors.is_empty() {
        groups.push(Group::new(weighted.collect()));
    }
    while groups.len() < count {
        let errors = groups.iter().map(Group::error).enumerate();
        let worst = errors.max_by(|a, b| a.1.total_cmp(&b.1));
        // Rounding may leave a small spread in a group of one color.
        let Some((worst, _)) = worst.filter(|&(i, _)| groups[i].colors.len() > 1) else {
            break;
        };
        let [low, high] = groups[worst].split();
        if low.colors.is_empty() || high.colors.is_empty() {
            break;
        }
        groups[worst] = low;
        groups.push(high);
    }
    for (number, group) in (0..).zip(&groups) {
        for color in &group.colors {
            known.insert(color.color, number);
        }
    }
    Reduced {
        palette: groups.iter().map(|group| group.mean.map(byte)).collect(),
        numbers: pixels()
            .map(|color| u8::try_from(known[&color]).unwrap_or(u8::MAX))
            .collect(),
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "means of bytes are in a byte's range"
)]
fn byte(mean: f64) -> u8 {
    mean.round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_colors_stay_as_they_are() {
        let rgba: Vec<u8> = (0..=99)
            .flat_map(|i: u8| [i, 2 * i, 255 - i, 255])
            .collect();
        let reduced = reduce(&rgba, 255);
        assert_eq!(reduced.palette.len(), 100);
        for (pixel, number) in rgba.chunks_exact(4).zip(&reduced.numbers) {
            assert_eq!(reduced.palette[usize::from(*number)], pixel[..3]);
        }
        let none = reduce(&[], 255);
        assert!(none.palette.is_empty() && none.numbers.is_empty());
    }

    #[test]
    fn a_small_highlight_in_a_large_gradient_is_kept() {
        let gradient = (0..40_000).flat_map(|i: u32| {
            let part = |by: u32| u8::try_from(150 + i / by % 100).unwrap();
            [part(7), part(11), part(13), 255]
        });
        let highlight = [255, 10, 10, 255].repeat(20);
        let rgba: Vec<u8> = gradient.chain(highlight).collect();
        let reduced = reduce(&rgba, 255);
        assert_eq!(reduced.palette.len(), 255);
        let last = usize::from(*reduced.numbers.last().unwrap());
        assert_eq!(reduced.palette[last], [255, 10, 10]);
        // Boxes of a cube of 100 levels: 255 of them have sides of some 16 levels; the error is half of that.
        let errors = rgba
            .chunks_exact(4)
            .zip(&reduced.numbers)
            .map(|(pixel, number)| {
                let color = reduced.palette[usize::from(*number)];
                (0..3).map(|i| color[i].abs_diff(pixel[i])).max().unwrap()
            });
        let worst = errors.max().unwrap();
        assert!(worst < 24, "{worst}");
    }
}
