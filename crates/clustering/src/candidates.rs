//! [`Candidates`]: the constraints that may join the growing cluster, best first.
//!
//! Scores only rise while a cluster grows, so a heap with an entry per rise is enough: the entry
//! with the present score of a constraint is valid, older ones are dropped when they reach the top.
//! Touched constraints are listed, so clearing costs no more than the growth did. Cost: O(log
//! entries) per entry.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Scores of the constraints around one cluster.
#[derive(Debug)]
pub(crate) struct Candidates {
    /// The score of every constraint; 0 for constraints that are not candidates.
    scores: Vec<u64>,
    /// Constraints with a score above 0, each once, in the order of their first raise.
    touched: Vec<u32>,
    /// Constraints whose score rose since the last query, possibly repeated.
    raised: Vec<u32>,
    heap: BinaryHeap<(u64, Reverse<u32>)>,
}

impl Candidates {
    /// No candidates among `constraints` constraints.
    pub(crate) fn new(constraints: usize) -> Self {
        Self {
            scores: vec![0; constraints],
            touched: Vec::new(),
            raised: Vec::new(),
            heap: BinaryHeap::new(),
        }
    }

    /// Adds `amount`, at least 1, to the score of `c`.
    pub(crate) fn raise(&mut self, c: u32, amount: u64) {
        let score = &mut self.scores[c as usize];
        if *score == 0 {
            self.touched.push(c);
        }
        *score += amount;
        self.raised.push(c);
    }

    /// The candidate of highest score for which `is_free` holds; ties go to the smallest number.
    ///
    /// A candidate that is not free must not become free before [`clear`](Self::clear).
    pub(crate) fn best(&mut self, is_free: impl Fn(u32) -> bool) -> Option<u32> {
        for c in self.raised.drain(..) {
            self.heap.push((self.scores[c as usize], Reverse(c)));
        }
        while let Some((score, Reverse(c))) = self.heap.pop() {
            if is_free(c) && score == self.scores[c as usize] {
                return Some(c);
            }
        }
        None
    }

    /// All constraints that have been candidates since the last [`clear`](Self::clear), in the
    /// order of their first raise.
    pub(crate) fn touched(&self) -> &[u32] {
        &self.touched
    }

    /// Removes all candidates.
    pub(crate) fn clear(&mut self) {
        for c in self.touched.drain(..) {
            self.scores[c as usize] = 0;
        }
        self.raised.clear();
        self.heap.clear();
    }
}
