//! The limit on the work of chains and flips.
//!
//! A question about the classes around a vertex costs about what coloring that vertex costs. Work is counted in
//! questions, not in time, so results do not depend on the machine.

/// Questions per vertex that chains and flips may ask in total.
const QUESTIONS: u64 = 4;

/// Questions beside these, so that small graphs are balanced to the end.
const FIRST_QUESTIONS: u64 = 1 << 14;

/// The number of questions left.
#[derive(Debug)]
pub(super) struct Work {
    left: u64,
}

impl Work {
    /// The work allowed for a number of vertices.
    pub(super) fn for_vertices(vertices: usize) -> Self {
        Self {
            left: FIRST_QUESTIONS + QUESTIONS.saturating_mul(vertices as u64),
        }
    }

    /// Counts questions; returns whether there was work left for them.
    pub(super) fn spend(&mut self, questions: usize) -> bool {
        let is_left = self.left > 0;
        self.left = self.left.saturating_sub(questions as u64);
        is_left
    }

    /// Whether no work is left.
    pub(super) fn is_spent(&self) -> bool {
        self.left == 0
    }
}
