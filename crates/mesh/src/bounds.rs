//! [`Bounds`]: a box along the axes.

use glam::DVec3;

/// A box along the axes; empty where `low` exceeds `high`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Bounds {
    /// The low corner.
    pub low: DVec3,
    /// The high corner.
    pub high: DVec3,
}

impl Bounds {
    /// The box without a point.
    pub const EMPTY: Self = Self {
        low: DVec3::INFINITY,
        high: DVec3::NEG_INFINITY,
    };

    /// The smallest box around points.
    ///
    /// # Example
    /// ```
    /// use incise_mesh::{Bounds, glam::DVec3};
    ///
    /// let bounds = Bounds::around([DVec3::X, -DVec3::Y]);
    /// assert_eq!((bounds.low, bounds.high), (-DVec3::Y, DVec3::X));
    /// assert!(bounds.overlaps(&Bounds::around([DVec3::X])));
    /// assert_eq!(bounds.distance_squared(3.0 * DVec3::X), 4.0);
    /// ```
    #[must_use]
    pub fn around(points: impl IntoIterator<Item = DVec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |bounds, p| Self {
            low: bounds.low.min(p),
            high: bounds.high.max(p),
        })
    }

    /// The smallest box around both.
    #[must_use]
    #[inline]
    pub fn union(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }

    /// The box and all within `distance`, along the axes, around it.
    #[must_use]
    #[inline]
    pub fn widened(self, distance: f64) -> Self {
        let distance = DVec3::splat(distance);
        Self {
            low: self.low - distance,
            high: self.high + distance,
        }
    }

    /// The sides.
    #[must_use]
    #[inline]
    pub fn size(&self) -> DVec3 {
        self.high - self.low
    }

    /// Whether the boxes share a point.
    #[must_use]
    #[inline]
    pub fn overlaps(&self, other: &Self) -> bool {
        self.low.cmple(other.high).all() && other.low.cmple(self.high).all()
    }

    /// The squared distance of a point to the box, 0 inside.
    #[must_use]
    #[inline]
    pub fn distance_squared(&self, point: DVec3) -> f64 {
        let beyond = (self.low - point).max(point - self.high).max(DVec3::ZERO);
        beyond.length_squared()
    }
}
