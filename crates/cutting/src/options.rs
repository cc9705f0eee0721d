//! [`CutOptions`]: snapping, separation and limits of a cut.

use crate::CutError;

/// Criterion by which a body separates at the particles on a cut.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Separation {
    /// Faces on the surface with tets on both sides are cut. Parts of a particle's star that no uncut face connects get
    /// a particle each. Correct for snapped particles, partial cuts, repeated cuts and edges where more than two parts
    /// of the boundary meet.
    #[default]
    CutFaces,
    /// The paper's criterion (section 4.3): two tets at a particle on the cut stay joined if they share a particle that
    /// was there before the cut. For an unsnapped cut of a sound mesh it equals [`Separation::CutFaces`]. It fails at
    /// snapped particles: they were there before, so both sides stay tied to them.
    SharedOriginal,
    /// Two tets at a particle on the cut stay joined if they share a particle off the surface. Correct with snapped
    /// particles, too. It fails for tets with all four particles on the surface, which come off, and where a surface
    /// grazes particles without crossing an edge, which tears the body there.
    SharedOffSurface,
}

/// Settings of a cut: snapping, limits on new tets, separation, tag.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CutOptions {
    /// A crossing within this fraction of its edge from one end moves to that end: the surface bends to the particle,
    /// the particle stays where it is. From 0 (off) to 0.25. Larger values give fewer and better shaped tets and a
    /// more jagged rim.
    pub snap: f64,
    /// A crossing within this fraction of its edge from one end moves to that end, even where `snap` is off: it keeps
    /// rounding from making zero-volume tets when a surface runs through particles. Use about 1e-9 for positions in
    /// double and 1e-5 for positions in single precision. Where cuts of cuts would leave tets thinner than a few units
    /// of the last digit of their coordinates at rest, crossings move to the nearer end, however far it is.
    pub tolerance: f64,
    /// Lower bound on the volume of children as a fraction of their parent's, from 0 (off) to 0.015. Where snapping
    /// alone does not guarantee it, crossings snap from farther away. A tet whose edges are crossed in several steps of
    /// one frame counts as several parents.
    pub min_volume_ratio: f64,
    /// Size of a crumb, from 0 (off) to 100: a part that would come off and has less than this times the mean volume of
    /// the original tets stays with the other side of the cut ([`crate::CutDelta::crumbs`] counts them).
    /// Only with [`Separation::CutFaces`].
    pub crumbs: f64,
    /// Criterion by which the body separates.
    pub separation: Separation,
    /// Number that opened faces are tagged with ([`crate::FaceTag::Cut`]).
    pub tag: u32,
    /// Largest number of tets of the mesh after a cut. A cut that would exceed it is an error and changes nothing.
    pub max_tets: usize,
}

impl Default for CutOptions {
    /// Snap 0.1, tolerance 1e-9, no further guard, crumbs below half a tet, separation by cut faces, tag 0, at most 2²⁶ tets.
    fn default() -> Self {
        Self {
            snap: 0.1,
            tolerance: 1e-9,
            min_volume_ratio: 0.0,
            crumbs: 0.5,
            separation: Separation::CutFaces,
            tag: 0,
            max_tets: 1 << 26,
        }
    }
}

impl CutOptions {
    /// Checks the ranges of the values.
    ///
    /// # Errors
    /// [`CutError::Snap`], [`CutError::Tolerance`], [`CutError::VolumeLimit`] or [`CutError::Crumbs`] if one lies outside its range.
    pub fn check(&self) -> Result<(), CutError> {
        if !(0.0..=0.25).contains(&self.snap) {
            return Err(CutError::Snap { value: self.snap });
        }
        if !(1e-12..=0.01).contains(&self.tolerance) {
            return Err(CutError::Tolerance {
                value: self.tolerance,
            });
        }
        if !(0.0..=0.015).contains(&self.min_volume_ratio) {
            return Err(CutError::VolumeLimit {
                value: self.min_volume_ratio,
            });
        }
        if !(0.0..=100.0).contains(&self.crumbs) {
            return Err(CutError::Crumbs { value: self.crumbs });
        }
        Ok(())
    }

    /// The effective snap distance as a fraction of an edge.
    ///
    /// A child is made by at most three bisections, since each takes away one of its parent's corners and needs two of
    /// them; each keeps at least this fraction of the volume. So its cube bounds the volume of children.
    pub(crate) fn reach(&self) -> f64 {
        self.snap
            .max(self.tolerance)
            .max(self.min_volume_ratio.cbrt())
    }
}
