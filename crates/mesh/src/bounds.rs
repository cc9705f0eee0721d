//! [`Bounds`]: an axis-aligned box.

use glam::DVec3;

/// An axis-aligned box; empty where `low` exceeds `high`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Bounds {
    /// The corner with the smallest coordinates.
    pub low: DVec3,
    /// The corner with the largest coordinates.
    pub high: DVec3,
}

impl Bounds {
    /// The empty box.
    pub const EMPTY: Self = Self {
        low: DVec3::INFINITY,
        high: DVec3::NEG_INFINITY,
    };

    /// The smallest box that contains the points.
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

    /// The smallest box that contains both.
    #[must_use]
    #[inline]
    pub fn union(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }

    /// The box extended by `distance` on all sides.
    #[must_use]
    #[inline]
    pub fn widened(self, distance: f64) -> Self {
        let distance = DVec3::splat(distance);
        Self {
            low: self.low - distance,
            high: self.high + distance,
        }
    }

    /// The lengths of the sides.
    #[must_use]
    #[inline]
    pub fn size(&self) -> DVec3 {
        self.high - self.low
    }

    /// True if the boxes share a point.
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
