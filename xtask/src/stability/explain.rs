//! Why a body has not come back: sentences by extreme and method.
//!
//! The first that fits is taken. Each is for some extremes, some methods and some verdicts, and says no more than what is
//! known of them: an outcome that none fits is a finding.

use super::methods::Method;
use super::outcome::{Outcome, Row, Verdict};

/// A reason, and where it holds.
pub(super) struct Explanation {
    /// Beginnings of the ids of extremes; an empty one begins all.
    extremes: &'static [&'static str],
    methods: &'static [Method],
    verdicts: &'static [Verdict],
    /// Kappa of the substep must be above this.
    kappa: f64,
    pub(super) text: &'static str,
}

const TABLE: &[Explanation] = &[];

/// The reason for what is not fine; `None` if it is fine or nobody knows.
pub(super) fn explain(row: &Row, outcome: &Outcome) -> Option<&'static Explanation> {
    let verdict = outcome.verdict(row.is_state);
    TABLE.iter().find(|e| {
        e.extremes.iter().any(|id| row.id.starts_with(id))
            && e.methods.contains(&outcome.column.method)
            && e.verdicts.contains(&verdict)
            && outcome.kappa > e.kappa
    })
}
