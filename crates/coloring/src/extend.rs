//! Local recoloring: new vertices get colors, old ones keep theirs.
//!
//! After a cut, only the clusters of new elements need a color. What a cut removes or duplicates
//! can only delete conflicts between the others, so their colors stay proper and are frozen. The
//! new vertices choose first fit, one after the other. Cost: O(sum of the degrees of the new
//! vertices), whatever the size of the rest.

use incise_graph::{ColorId, Coloring};

use crate::first_fit::FirstFit;

/// Colors the vertices `new`, in the given order, each with the smallest color that no neighbor
/// has; all other vertices keep theirs.
///
/// `neighbors(v, &mut list)` appends the neighbors of `v` to an empty list, in any order; repeats
/// and `v` itself do no harm. A new vertex may use an old number again (its old color is forgotten
/// first) or lie past the end (the coloring grows). If the old vertices were properly colored among
/// themselves, the result is proper. Deterministic; O(sum of the lengths of the neighbor lists).
///
/// # Panics
/// If `new` skips a number past the end of the coloring.
///
/// ```
/// use incise_coloring::extend_first_fit;
/// use incise_graph::{ColorId, Coloring, ConstraintGraph};
///
/// // A path 0 - 1 - 2; then vertex 1 is replaced and vertex 3 joins it.
/// let mut coloring = Coloring::new([0, 1, 0].map(ColorId).to_vec());
/// let after = ConstraintGraph::from_edges(4, &[(0, 1), (1, 3), (2, 3)])?;
/// extend_first_fit(&mut coloring, &[1, 3], |v, list| {
///     list.extend_from_slice(after.neighbors(v as usize));
/// });
/// coloring.verify(&after)?;
/// assert_eq!(coloring.colors(), [0, 1, 0, 2].map(ColorId));
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
pub fn extend_first_fit(
    coloring: &mut Coloring,
    new: &[u32],
    mut neighbors: impl FnMut(u32, &mut Vec<u32>),
) {
    // Too large for any palette, so it never counts as taken.
    const NONE: ColorId = ColorId(u32::MAX);
    let before = coloring.vertex_count();
    let after = new.iter().map(|&v| v as usize + 1).max().unwrap_or(0);
    for _ in before..after {
        coloring.push(NONE);
    }
    for &v in new {
        coloring.set(v as usize, NONE);
    }
    let mut first_fit = FirstFit::default();
    let mut list = Vec::new();
    for &v in new {
        list.clear();
        neighbors(v, &mut list);
        let others = list.iter().filter(|&&u| u != v);
        let color = first_fit.choose(list.len(), others.map(|&u| coloring.color(u as usize)));
        coloring.set(v as usize, color);
    }
    let skipped = (before..after).find(|&v| coloring.color(v) == NONE);
    assert!(
        skipped.is_none(),
        "vertex {skipped:?} is past the end, but not among the new ones"
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_new_changes_nothing() {
        let mut coloring = Coloring::new(vec![ColorId(5), ColorId(2)]);
        extend_first_fit(&mut coloring, &[], |_, _| unreachable!());
        assert_eq!(coloring.colors(), [ColorId(5), ColorId(2)]);
    }

    #[test]
    fn a_clique_grows_past_a_word() {
        let mut coloring = Coloring::default();
        let new: Vec<u32> = (0..130).collect();
        extend_first_fit(&mut coloring, &new, |_, list| list.extend(0..130));
        assert_eq!(coloring.distinct_colors(), 130);
        assert_eq!(coloring.color_count(), 130);
    }

    #[test]
    #[should_panic(expected = "not among the new ones")]
    fn gaps_are_refused() {
        extend_first_fit(&mut Coloring::default(), &[1], |_, _| {});
    }
}
