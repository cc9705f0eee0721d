//! [`non_dominated`]: the Pareto front of measured settings.
//!
//! A setting is dominated if another one is as fast and as accurate, and better in one of both. The others form the
//! Pareto front. Source: Kung, Luccio and Preparata 1975, in two dimensions. Cost: O(n log n).

/// Returns the indices of the points that no other point dominates, by rising first and thus falling second coordinate.
/// Of equal points the first is kept; points that are not finite are ignored.
///
/// ```
/// use incise::advise::non_dominated;
///
/// // Milliseconds and errors: the third is slower than the second and no better.
/// let measured = [[1.0, 10.0], [2.0, 5.0], [3.0, 5.0], [4.0, 1.0]];
/// assert_eq!(non_dominated(&measured), [0, 1, 3]);
/// ```
#[must_use]
pub fn non_dominated(points: &[[f64; 2]]) -> Vec<usize> {
    let finite = |&i: &usize| points[i].iter().all(|c| c.is_finite());
    let mut order: Vec<usize> = (0..points.len()).filter(finite).collect();
    let [x, y] = [0, 1].map(|c| move |i: usize| points[i][c]);
    order.sort_by(|&a, &b| x(a).total_cmp(&x(b)).then(y(a).total_cmp(&y(b))));
    let mut lowest = f64::INFINITY;
    order.retain(|&i| {
        let better = y(i) < lowest;
        lowest = lowest.min(y(i));
        better
    });
    order
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Whether `a` dominates `b`, by the definition.
    fn dominates(a: [f64; 2], b: [f64; 2]) -> bool {
        a[0] <= b[0] && a[1] <= b[1] && a != b
    }

    proptest! {
        /// Against the definition, on a grid coarse enough for ties and equal points.
        #[test]
        fn the_front_is_not_dominated(
            points in prop::collection::vec([0..6u8, 0..6u8], 0..30),
        ) {
            let points: Vec<[f64; 2]> = points.iter().map(|p| p.map(f64::from)).collect();
            let first = |i: usize| points[..i].iter().all(|p| *p != points[i]);
            let free = |i: usize| points.iter().all(|&p| !dominates(p, points[i]));
            let mut expected: Vec<usize> =
                (0..points.len()).filter(|&i| first(i) && free(i)).collect();
            expected.sort_by(|&a, &b| points[a][0].total_cmp(&points[b][0]));
            prop_assert_eq!(non_dominated(&points), expected);
        }
    }

    #[test]
    fn non_finite_candidates_are_ignored() {
        let points = [[f64::NAN, 0.0], [1.0, f64::INFINITY], [2.0, 3.0]];
        assert_eq!(non_dominated(&points), [2]);
        assert!(non_dominated(&[]).is_empty());
    }
}
