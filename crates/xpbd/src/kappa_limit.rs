//! [`KappaLimit`]: tets too stiff for the substep are softened.
//!
//! Nothing is softened in a solver without a limit. Cost: a comparison for each tet that comes.

use crate::{Float, Solver};

/// See [`Solver::limit_kappa`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KappaLimit {
    /// The largest kappa of a tet.
    pub kappa: f64,
    /// The time of a substep in s.
    pub substep_time: f64,
}

impl<R: Float> Solver<R> {
    /// From now on, softens every new tet whose [`Solver::kappa`] at `substep_time` would exceed `kappa`, so that it
    /// just meets it; `None` ends this.
    ///
    /// Cutting leaves tets so small that no affordable substep follows their vibrations; unsoftened, they do not
    /// vibrate but collapse and throw their neighbors about. What was softened: [`Solver::softened`].
    pub fn limit_kappa(&mut self, limit: Option<KappaLimit>) {
        self.kappa_limit = limit;
    }
}
