//! Which shortcuts a run of the parallel coloring may take.
//!
//! Jones and Plassmann (1993) let a vertex wait for all neighbors of higher priority. Each shortcut
//! lets it go earlier without changing what it gets, so every choice of shortcuts gives the same
//! coloring, and only rounds and work differ. [`scgc_with`](crate::scgc_with) takes the choice; the
//! rules themselves are described there.

/// A choice among the three shortcuts of the paper's Algorithm 1.
///
/// ```
/// use incise_coloring::{Shortcuts, scgc_with};
/// use incise_graph::ConstraintGraph;
///
/// let ring = ConstraintGraph::from_edges(5, &[(0, 1), (1, 2), (2, 3), (3, 4), (4, 0)])?;
/// let all = scgc_with(&ring, Shortcuts::ALL);
/// for shortcuts in Shortcuts::COMBINATIONS {
///     let some = scgc_with(&ring, shortcuts);
///     assert_eq!(some.coloring, all.coloring);
///     assert!(some.stats.rounds >= all.stats.rounds);
/// }
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Shortcuts {
    /// Pass a neighbor that cannot take the best color any more (lines 6-7).
    pub one: bool,
    /// Drop the edge to a neighbor that shares no color (lines 8-10).
    pub two: bool,
    /// Pass a neighbor whose best color is larger (lines 11-12).
    pub three: bool,
}

impl Shortcuts {
    /// No shortcut: plain Jones-Plassmann.
    pub const NONE: Self = Self::new(false, false, false);

    /// All three: the paper's algorithm.
    pub const ALL: Self = Self::new(true, true, true);

    /// All eight choices, from [`NONE`](Self::NONE) to [`ALL`](Self::ALL).
    pub const COMBINATIONS: [Self; 8] = [
        Self::NONE,
        Self::new(true, false, false),
        Self::new(false, true, false),
        Self::new(true, true, false),
        Self::new(false, false, true),
        Self::new(true, false, true),
        Self::new(false, true, true),
        Self::ALL,
    ];

    const fn new(one: bool, two: bool, three: bool) -> Self {
        Self { one, two, three }
    }
}

/// [`ALL`](Self::ALL).
impl Default for Shortcuts {
    fn default() -> Self {
        Self::ALL
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn combinations_count_in_binary() {
        for (bits, shortcuts) in Shortcuts::COMBINATIONS.into_iter().enumerate() {
            let read = usize::from(shortcuts.one)
                + 2 * usize::from(shortcuts.two)
                + 4 * usize::from(shortcuts.three);
            assert_eq!(read, bits);
        }
        assert_eq!(Shortcuts::default(), Shortcuts::COMBINATIONS[7]);
    }
}
