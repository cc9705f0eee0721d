//! The default: few colors, quickly, and no longer than it takes.
//!
//! Constraints on one particle are a clique, so the most crowded particle bounds the number of
//! colors from below, and a coloring that meets the bound is as good as any. On scanned bodies the
//! first attempt often does. So the attempts go from cheap to costly and stop at the bound:
//!
//! 1. first fit, largest degree bound first ([`Order::DegreeBound`]);
//! 2. a few passes of [`iterated_greedy`](crate::iterated_greedy());
//! 3. first fit in [`Order::SmallestLast`] and in [`Order::MaximumCardinality`];
//! 4. [`tabu`](crate::tabu()) from the best so far, for as many steps as there are vertices, for each
//!    color to lose.
//!
//! The steps are counted, not timed, so the result is the same on every machine.

use incise_graph::Coloring;

use crate::clique::clique_of_last_color;
use crate::{Conflicts, Order, greedy, iterated_greedy, tabu};

/// A coloring, its lower bound, and the work of finding it.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Auto {
    /// The coloring.
    pub coloring: Coloring,
    /// Lower bound: [`Conflicts::clique_bound`], or for a graph possibly more. A coloring with this
    /// number of colors is optimal.
    pub bound: usize,
    /// Passes of iterated greedy.
    pub passes: usize,
    /// Steps of the search.
    pub steps: usize,
}

/// Passes of iterated greedy: on scanned meshes three were enough where passes helped at all.
const PASSES: usize = 5;

/// Steps of the search for a color on small graphs.
const MIN_STEPS: usize = 5000;

/// Seed of the search; its value does not matter.
const SEED: u64 = 1;

/// Finds a coloring with few colors; stops early if it meets the lower bound.
///
/// Proper, deterministic, labels without gaps. A graph and the incidence it came from may give
/// different colorings, because [`Order::DegreeBound`] and the bound read a graph differently. From
/// O(entries) if the first attempt meets the bound to O(vertices * (degree + colors)) for each
/// color saved and the last one tried.
///
/// ```
/// use incise_coloring::auto;
/// use incise_graph::Incidence;
///
/// let springs = Incidence::from_constraints(5, (0u32..5).map(|i| [i, (i + 1) % 5]))?;
/// let result = auto(&springs);
/// result.coloring.verify_incidence(&springs)?;
/// assert_eq!((result.coloring.color_count(), result.bound), (3, 2));
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
#[must_use]
pub fn auto(conflicts: &impl Conflicts) -> Auto {
    let mut result = Auto {
        coloring: greedy(conflicts, Order::DegreeBound),
        bound: conflicts.clique_bound(),
        passes: 0,
        steps: 0,
    };
    if !result.is_best(conflicts) {
        let Auto {
            coloring, bound, ..
        } = &mut result;
        result.passes = iterated_greedy(conflicts, coloring, PASSES, *bound, SEED);
    }
    if result.is_best(conflicts) {
        return result;
    }
    // From here on every step walks neighbors: with the edges at hand that is faster.
    let graph = conflicts.graph();
    for order in [Order::SmallestLast, Order::MaximumCardinality] {
        let other = greedy(&*graph, order);
        if other.color_count() < result.coloring.color_count() {
            result.coloring = other;
        }
        if result.is_best(conflicts) {
            return result;
        }
    }
    let steps = graph.vertex_count().max(MIN_STEPS);
    result.steps = tabu(&*graph, &mut result.coloring, result.bound, steps, SEED);
    result
}

impl Auto {
    /// Returns whether the number of colors meets the lower bound. In a graph that does not meet it
    /// yet, looks for a larger clique first.
    fn is_best(&mut self, conflicts: &impl Conflicts) -> bool {
        let colors = self.coloring.color_count();
        if conflicts.incidence().is_none() && colors > self.bound {
            let clique = clique_of_last_color(&conflicts.graph(), &self.coloring);
            self.bound = self.bound.max(clique);
        }
        colors <= self.bound
    }
}
