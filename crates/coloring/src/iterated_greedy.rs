//! Iterated greedy: color again, class by class, and lose a color now and then (Culberson 1992).
//!
//! If first fit gets the vertices class after class of a proper coloring, in any order of the
//! classes, no vertex needs a color later than the position of its class, so the number of colors
//! never grows; and vertices that slip into earlier classes may leave a class empty. Which order is
//! good is a matter of luck, so several kinds take turns. From incidence a pass costs about one
//! word operation per entry, which makes it the cheapest improvement there is.

use incise_graph::Coloring;

use crate::Conflicts;
use crate::random::Random;

/// Improves a coloring by up to `passes` greedy passes, keeps the best, and stops at `target`
/// colors. Returns the number of passes.
///
/// The coloring must be proper and stays proper; its number of colors never grows. Deterministic
/// for a seed; a graph and the incidence it came from give equal results. O(passes * (vertices +
/// edges)), from incidence O(passes * entries) per 64 colors.
///
/// # Panics
/// If the coloring has another number of vertices than `conflicts`.
///
/// ```
/// use incise_coloring::iterated_greedy;
/// use incise_graph::{ColorId, Coloring, ConstraintGraph};
///
/// // A row of six with three colors: two are enough.
/// let row = ConstraintGraph::from_edges(6, &[(0, 1), (1, 2), (2, 3), (3, 4), (4, 5)])?;
/// let mut coloring = Coloring::new([0, 1, 2, 0, 1, 2].map(ColorId).to_vec());
/// iterated_greedy(&row, &mut coloring, 50, 2, 1);
/// coloring.verify(&row)?;
/// assert_eq!(coloring.color_count(), 2);
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
pub fn iterated_greedy(
    conflicts: &impl Conflicts,
    coloring: &mut Coloring,
    passes: usize,
    target: usize,
    seed: u64,
) -> usize {
    assert_eq!(
        coloring.vertex_count(),
        conflicts.vertex_count(),
        "one color per vertex"
    );
    let mut random = Random::new(seed);
    let mut current = coloring.clone();
    let mut fewest = coloring.color_count();
    for pass in 0..passes {
        if fewest <= target {
            return pass;
        }
        let order = by_class(&current, &mut random);
        current = Coloring::new(conflicts.first_fit(&order));
        let count = current.color_count();
        debug_assert!(count <= fewest, "a pass never adds a color");
        if count < fewest {
            fewest = count;
            coloring.clone_from(&current);
        }
    }
    passes
}

/// The vertices class by class. Culberson's mix: half of the times the classes backwards, else the
/// largest first, and now and then at random.
fn by_class(coloring: &Coloring, random: &mut Random) -> Vec<u32> {
    let classes = coloring.classes();
    let mut turn: Vec<usize> = (0..classes.count()).collect();
    match random.below(10) {
        0..5 => turn.reverse(),
        5..8 => turn.sort_by_key(|&class| std::cmp::Reverse(classes.members(class).len())),
        _ => random.shuffle(&mut turn),
    }
    let members = turn.iter().flat_map(|&class| classes.members(class));
    members.copied().collect()
}

#[cfg(test)]
mod tests {
    use incise_graph::{ColorId, ConstraintGraph};

    use super::*;

    #[test]
    fn a_bad_start_loses_colors() {
        // A path with four colors where two are enough.
        let edges: Vec<(u32, u32)> = (1..100).map(|b| (b - 1, b)).collect();
        let path = ConstraintGraph::from_edges(100, &edges).unwrap();
        let mut coloring = Coloring::new((0..100).map(|v| ColorId(v % 4)).collect());
        let passes = iterated_greedy(&path, &mut coloring, 100, 2, 7);
        coloring.verify(&path).unwrap();
        assert!(coloring.color_count() < 4 && passes > 0);
        assert_eq!(iterated_greedy(&path, &mut coloring, 100, 4, 7), 0);
    }
}
