//! [`CutOptions`]: how close to a particle a crossing may lie.

use crate::CutError;

/// How crossings close to a particle are treated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CutOptions {
    /// A crossing within this fraction of its edge from one end moves to that end: the surface bends to the particle,
    /// the particle stays where it is. From 0 (off) to 0.25. Larger values give fewer and better shaped tets and a
    /// more jagged rim.
    pub snap: f64,
    /// The same, never off: it keeps rounding from making zero-volume tets when a surface runs through particles.
    /// Use about 1e-9 for positions in double and 1e-5 for positions in single precision.
    pub tolerance: f64,
}

impl Default for CutOptions {
    /// Snap 0.1, tolerance 1e-9.
    fn default() -> Self {
        Self {
            snap: 0.1,
            tolerance: 1e-9,
        }
    }
}

impl CutOptions {
    /// Checks the ranges of both values.
    ///
    /// # Errors
    /// [`CutError::Snap`] or [`CutError::Tolerance`] if one lies outside its range.
    pub fn check(&self) -> Result<(), CutError> {
        if !(0.0..=0.25).contains(&self.snap) {
            return Err(CutError::Snap { value: self.snap });
        }
        if !(1e-12..=0.01).contains(&self.tolerance) {
            return Err(CutError::Tolerance {
                value: self.tolerance,
            });
        }
        Ok(())
    }

    /// The effective snap distance as a fraction of an edge.
    pub(crate) fn reach(&self) -> f64 {
        self.snap.max(self.tolerance)
    }
}
