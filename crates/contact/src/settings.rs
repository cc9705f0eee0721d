//! [`ContactSettings`]: what may touch, and how far ahead contacts are searched.

use crate::ContactError;

/// Which bodies may touch each other.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum BodyPairs {
    /// Each body may touch each other one.
    #[default]
    All,
    /// Only these pairs of different bodies; the order within a pair does not matter.
    Only(Vec<[u32; 2]>),
}

impl BodyPairs {
    /// Whether two different bodies may touch. O(1) for all, O(pairs) for a list.
    #[must_use]
    pub fn allow(&self, one: u32, other: u32) -> bool {
        match self {
            Self::All => true,
            Self::Only(pairs) => pairs.contains(&[one, other]) || pairs.contains(&[other, one]),
        }
    }
}

/// What may touch, and how far ahead contacts are searched.
///
/// `skin` and `reach` are fractions of the mean edge of the surface at rest ([`crate::ContactDetector::mean_edge`]), so
/// that they fit meshes of any size; `thickness` is in m.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ContactSettings {
    /// Which different bodies may touch.
    pub bodies: BodyPairs,
    /// Whether a body touches itself everywhere: a plate folded over, a piece that bends back on itself.
    ///
    /// If not, different pieces of one body touch all the same, and so do the two sides of a cut where they were
    /// parted, as long as the sides have not slid apart (see [`crate::FreshPairs`]).
    pub self_contact: bool,
    /// A distance in m that is kept between surfaces; the search reaches further by as much. Usually 0.
    pub thickness: f64,
    /// How far surfaces may move towards each other, in mean edges, before contacts are searched again. More means
    /// fewer searches with more candidates. Above 0, at most 1.
    pub skin: f64,
    /// How far, in mean edges, a frame may bring surfaces together before it is divided, see
    /// [`crate::ContactDetector::intervals`]. The search looks ahead in time by four times as much, where something is that
    /// fast. At least 0, at most 2.
    pub reach: f64,
}

impl Default for ContactSettings {
    fn default() -> Self {
        Self {
            bodies: BodyPairs::All,
            self_contact: true,
            thickness: 0.0,
            skin: 0.4,
            reach: 0.5,
        }
    }
}

impl ContactSettings {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`ContactError::Setting`] names the first value outside its range.
    pub fn check(&self) -> Result<(), ContactError> {
        let setting = |what, value, range| Err(ContactError::Setting { what, value, range });
        if !(self.thickness >= 0.0 && self.thickness.is_finite()) {
            return setting("thickness", self.thickness, "at least 0 m and finite");
        }
        if !(self.skin > 0.0 && self.skin <= 1.0) {
            return setting("skin", self.skin, "above 0 and at most 1 mean edge");
        }
        if !(self.reach >= 0.0 && self.reach <= 2.0) {
            return setting("reach", self.reach, "at least 0 and at most 2 mean edges");
        }
        Ok(())
    }
}
