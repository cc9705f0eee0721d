//! [`ColoringMetrics`]: the number of colors and the evenness of their classes.
//!
//! Few colors mean few steps; even classes keep all cores busy in each step. The metrics are those
//! of the paper's Table 2, with formulas spelled out because the paper gives none for its
//! chi-squared column, and the share of busy lanes on machines that run in groups. Cost: O(vertices
//! + colors).

use crate::Coloring;

/// The evenness of k color classes with sizes `n_c` that sum to N.
///
/// Empty classes count, since a solver steps through them too. A coloring without vertices has all
/// fields 0, except `max_over_mean`, `lanes_32` and `lanes_256`, which are 1.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ColoringMetrics {
    /// k, the largest label plus one.
    pub colors: usize,
    /// N, the number of vertices or their total weight.
    pub total: u64,
    /// The size of the smallest class.
    pub min: u64,
    /// The size of the largest class.
    pub max: u64,
    /// `max - min`.
    pub range: u64,
    /// N / k.
    pub mean: f64,
    /// Population standard deviation: `sqrt(sum_c (n_c - N/k)^2 / k)`.
    pub std: f64,
    /// Reduced chi-squared against equal sizes: `sum_c (n_c - N/k)^2 / (N/k) / (k - 1)`; 0 for k <
    /// 2.
    pub chi2: f64,
    /// Largest class over mean: the slowdown compared with even classes if the time of a class is
    /// proportional to its size.
    pub max_over_mean: f64,
    /// Share of busy lanes when each class runs in groups of 32, the last one filled up with idle
    /// lanes: `N / sum_c (32 ceil(n_c / 32))`. 32 lanes are a warp of a GPU.
    pub lanes_32: f64,
    /// Share of busy lanes when each class runs in groups of 256, the last one filled up with idle
    /// lanes: `N / sum_c (256 ceil(n_c / 256))`. 256 lanes are a common thread block or workgroup.
    pub lanes_256: f64,
}

impl ColoringMetrics {
    /// Metrics in which every vertex counts 1. O(vertices + colors).
    ///
    /// ```
    /// use incise_graph::{ColorId, Coloring, ColoringMetrics};
    ///
    /// let coloring = Coloring::new([0, 0, 0, 1].map(ColorId).to_vec());
    /// let metrics = ColoringMetrics::by_vertices(&coloring);
    /// assert_eq!((metrics.colors, metrics.range, metrics.std, metrics.chi2), (2, 2, 1.0, 1.0));
    /// ```
    #[must_use]
    pub fn by_vertices(coloring: &Coloring) -> Self {
        let mut classes = vec![0; coloring.color_count()];
        for color in coloring.colors() {
            classes[color.index()] += 1;
        }
        Self::of_classes(&classes)
    }

    /// Metrics in which vertex `v` counts `weights[v]`, for example the number of constraints of
    /// cluster `v` ([`Clustering::sizes`](crate::Clustering::sizes)); a vacant cluster then counts
    /// 0. O(vertices + colors).
    ///
    /// `n_c` is then the work of class c in items of equal cost. `lanes_32` and `lanes_256`
    /// describe a solver that assigns a lane to each item. A solver that assigns a lane to each
    /// cluster has the values of [`by_vertices`](Self::by_vertices), and its lanes also idle until
    /// the largest cluster of a group is done.
    ///
    /// # Panics
    /// If the number of weights is not the number of vertices.
    #[must_use]
    pub fn by_weights(coloring: &Coloring, weights: &[u32]) -> Self {
        assert_eq!(
            weights.len(),
            coloring.vertex_count(),
            "one weight per vertex"
        );
        let mut classes = vec![0; coloring.color_count()];
        for (color, &weight) in coloring.colors().iter().zip(weights) {
            classes[color.index()] += u64::from(weight);
        }
        Self::of_classes(&classes)
    }

    /// Metrics of classes of these sizes.
    fn of_classes(classes: &[u64]) -> Self {
        let colors = classes.len();
        let total = classes.iter().sum();
        let min = classes.iter().copied().min().unwrap_or(0);
        let max = classes.iter().copied().max().unwrap_or(0);
        let k = colors.max(1) as f64;
        let mean = total as f64 / k;
        let squares: f64 = classes
            .iter()
            .map(|&size| (size as f64 - mean).powi(2))
            .sum();
        let balanced = total == 0;
        let lanes = |width: u64| {
            let occupied: u64 = classes
                .iter()
                .map(|size| size.div_ceil(width) * width)
                .sum();
            if balanced {
                1.0
            } else {
                total as f64 / occupied as f64
            }
        };
        Self {
            colors,
            total,
            min,
            max,
            range: max - min,
            mean,
            std: (squares / k).sqrt(),
            chi2: if balanced || colors < 2 {
                0.0
            } else {
                squares / mean / (k - 1.0)
            },
            max_over_mean: if balanced { 1.0 } else { max as f64 / mean },
            lanes_32: lanes(32),
            lanes_256: lanes(256),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ColorId;

    #[test]
    fn weights_replace_counts() {
        let coloring = Coloring::new([0, 1, 2, 2].map(ColorId).to_vec());
        let metrics = ColoringMetrics::by_weights(&coloring, &[4, 1, 0, 1]);
        assert_eq!(
            (metrics.total, metrics.min, metrics.max, metrics.range),
            (6, 1, 4, 3)
        );
        assert_eq!((metrics.mean, metrics.max_over_mean), (2.0, 2.0));
        // Deviations 2, -1, -1: squares sum to 6.
        assert!((metrics.std - 2f64.sqrt()).abs() < 1e-15);
        assert_eq!(metrics.chi2, 1.5);
    }

    /// Compares single classes of each size with a count of lanes one by one.
    #[test]
    fn lanes_fill_up_whole_groups() {
        for sizes in [
            &[1][..],
            &[31],
            &[32],
            &[33],
            &[64, 1],
            &[255, 256, 257],
            &[100, 0, 7],
        ] {
            let colors: Vec<ColorId> = (0..)
                .zip(sizes)
                .flat_map(|(color, &size)| vec![ColorId(color); size])
                .collect();
            let total = colors.len() as f64;
            let share = |width: usize| {
                let mut lanes = 0;
                for &size in sizes {
                    let mut left = size;
                    while left > 0 {
                        lanes += width;
                        left = left.saturating_sub(width);
                    }
                }
                total / lanes as f64
            };
            let metrics = ColoringMetrics::by_vertices(&Coloring::new(colors));
            assert_eq!(
                (metrics.lanes_32, metrics.lanes_256),
                (share(32), share(256)),
                "{sizes:?}"
            );
        }
    }

    #[test]
    fn lanes_by_weights_count_items() {
        let coloring = Coloring::new([0, 0, 1].map(ColorId).to_vec());
        let metrics = ColoringMetrics::by_weights(&coloring, &[30, 10, 24]);
        // 40 items take two groups of 32 and 24 one; either takes one of 256.
        assert_eq!(
            (metrics.lanes_32, metrics.lanes_256),
            (64.0 / 96.0, 64.0 / 512.0)
        );
        let idle = ColoringMetrics::by_weights(&coloring, &[0, 0, 0]);
        assert_eq!((idle.lanes_32, idle.lanes_256), (1.0, 1.0));
    }

    #[test]
    fn even_classes_and_nothing() {
        let even = ColoringMetrics::by_vertices(&Coloring::new([0, 1, 1, 0].map(ColorId).to_vec()));
        assert_eq!((even.std, even.chi2, even.max_over_mean), (0.0, 0.0, 1.0));
        let none = ColoringMetrics::by_vertices(&Coloring::default());
        assert_eq!(
            (none.colors, none.total, none.mean, none.std, none.chi2),
            (0, 0, 0.0, 0.0, 0.0)
        );
        let one = ColoringMetrics::by_vertices(&Coloring::new(vec![ColorId(0); 3]));
        assert_eq!((one.colors, one.chi2), (1, 0.0));
    }
}
