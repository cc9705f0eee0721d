//! [`DisjointSets`]: union-find over numbers.
//!
//! Find halves paths; the smallest number of a set is its root, so results depend on the united pairs but not on their
//! order.
//!
//! Source: R. E. Tarjan and J. van Leeuwen, "Worst-case Analysis of Set Union Algorithms", 1984. Cost: amortized O(log
//! n) per call, in practice nearly O(1).

/// Disjoint sets of the numbers from 0 on.
///
/// # Example
/// ```
/// use incise_mesh::DisjointSets;
///
/// let mut sets = DisjointSets::new(4);
/// sets.unite(3, 1);
/// assert_eq!(sets.root(3), 1);
/// ```
#[derive(Clone, Debug, Default)]
pub struct DisjointSets {
    parents: Vec<u32>,
}

impl DisjointSets {
    /// Sets of one number each, for the numbers below `count`. O(count).
    ///
    /// # Panics
    /// If `count` does not fit in 32 bits.
    #[must_use]
    pub fn new(count: usize) -> Self {
        let mut sets = Self::default();
        sets.reset(count);
        sets
    }

    /// Resets to `count` sets of one number each, reusing the memory. O(count).
    ///
    /// # Panics
    /// If `count` does not fit in 32 bits.
    pub fn reset(&mut self, count: usize) {
        let count = u32::try_from(count).expect("the numbers fit in 32 bits");
        self.parents.clear();
        self.parents.extend(0..count);
    }

    /// The root of a number: the smallest number of its set.
    ///
    /// # Panics
    /// If there is no such number.
    #[inline]
    pub fn root(&mut self, mut number: u32) -> u32 {
        while self.parents[number as usize] != number {
            let parent = self.parents[number as usize];
            self.parents[number as usize] = self.parents[parent as usize];
            number = parent;
        }
        number
    }

    /// Unites the sets of two numbers.
    ///
    /// # Panics
    /// If there is no such number.
    #[inline]
    pub fn unite(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.parents[a.max(b) as usize] = a.min(b);
    }
}
