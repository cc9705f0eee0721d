//! Typed results: the number of a cluster and the number of a color.
//!
//! Both are transparent `u32`s, so an array of them is an array of `u32` for a solver or a GPU
//! buffer, while the compiler distinguishes clusters, colors and constraints.

use std::fmt;

/// The number of a cluster, from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ClusterId(pub u32);

/// The number of a color, from 0. Colors are not limited to the bits of a machine word: a particle
/// with 600 constraints needs 600 colors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ColorId(pub u32);

impl ClusterId {
    /// The label of a constraint that is in no cluster, in the raw array of [`Clustering::labels`].
    ///
    /// [`Clustering::labels`]: crate::Clustering::labels
    pub const NONE: Self = Self(u32::MAX);

    /// Cluster number `index`.
    ///
    /// # Panics
    /// If `index` does not fit in 32 bits.
    #[must_use]
    pub fn new(index: usize) -> Self {
        Self(u32::try_from(index).expect("a cluster number fits in 32 bits"))
    }

    /// The number as an array index.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

impl ColorId {
    /// Color number `index`.
    ///
    /// # Panics
    /// If `index` does not fit in 32 bits.
    #[must_use]
    pub fn new(index: usize) -> Self {
        Self(u32::try_from(index).expect("a color number fits in 32 bits"))
    }

    /// The number as an array index.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

impl fmt::Display for ClusterId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl fmt::Display for ColorId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_keep_their_number() {
        assert_eq!(ClusterId::new(7).index(), 7);
        assert_eq!(ColorId::new(70_000).index(), 70_000);
        assert_eq!(ColorId::new(300).to_string(), "300");
        assert_eq!(size_of::<ColorId>(), 4);
    }
}
