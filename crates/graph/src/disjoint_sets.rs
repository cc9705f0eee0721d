//! [`DisjointSets`]: union-find over numbers.
//!
//! A forest whose roots represent the sets; find halves the paths. The root is the smallest number of its set, so
//! results depend on the united pairs but not on their order.
//!
//! Source: Tarjan, van Leeuwen 1984. Cost: amortized O(log n) per call, in practice nearly O(1).

/// Disjoint sets of the numbers from 0 on.
///
/// # Example
/// ```
/// use incise_graph::DisjointSets;
///
/// let mut sets = DisjointSets::new(4);
/// sets.unite(3, 1);
/// assert_eq!(sets.root(3), 1);
/// assert_eq!(sets.roots(), [0, 1, 2, 1]);
/// ```
#[derive(Clone, Debug, Default)]
pub struct DisjointSets {
    parents: Vec<u32>,
}

impl DisjointSets {
    /// Sets of one number each, for the numbers below `count`. O(count).
    ///
    /// # Panics
    /// With more than 2^32 - 1 numbers.
    #[must_use]
    pub fn new(count: usize) -> Self {
        let count = u32::try_from(count).expect("sets of numbers of 32 bits");
        Self {
            parents: (0..count).collect(),
        }
    }

    /// The root of a number: the smallest number of its set.
    ///
    /// # Panics
    /// If there is no such number.
    pub fn root(&mut self, number: u32) -> u32 {
        let mut at = number;
        while self.parents[at as usize] != at {
            let parent = self.parents[at as usize];
            self.parents[at as usize] = self.parents[parent as usize];
            at = parent;
        }
        at
    }

    /// Merges the sets of two numbers; returns true if they were different sets.
    ///
    /// # Panics
    /// If there is no such number.
    pub fn unite(&mut self, a: u32, b: u32) -> bool {
        let (a, b) = (self.root(a), self.root(b));
        self.parents[a.max(b) as usize] = a.min(b);
        a != b
    }

    /// The root of every number. O(count).
    #[must_use]
    pub fn roots(mut self) -> Vec<u32> {
        for at in 0..self.parents.len() {
            // A parent is smaller than its child, so it has been replaced by its root already.
            self.parents[at] = self.parents[self.parents[at] as usize];
        }
        self.parents
    }
}
