//! [`Blade`]: something that cuts, as strokes use it, and [`CrossedEdge`]: where it crosses an edge at rest.

use glam::DVec3;

use crate::ccd::{EdgeHit, MovingSegment};
use crate::operation::Crossing;
use crate::surface::Tangent;

/// A meeting within this fraction of the edge's length from the tangent plane of an end is that same surface again,
/// bent to its particles; one further away is another sheet of a stroke that came back.
pub(crate) const SAME_SHEET: f64 = 0.25;
/// Surfaces whose normals have at least this cosine run the same way.
pub(crate) const ALIGNED: f64 = 0.9;
/// How much further from the surface than before a particle that it was bent to may be and stay on it: rounding between
/// two runs of the same stroke, and a body that moved a little in between.
pub(crate) const AGAIN: f64 = 1.01;

/// Something that cuts.
pub(crate) trait Blade: Sync {
    /// Whether it moves through the body, so that particles are put on a side before all edge hits are known.
    const IS_SWEPT: bool;

    /// The first hit on an edge that `keep` does not refuse, and how many there are.
    fn first_meeting(
        &self,
        edge: &MovingSegment,
        keep: impl Fn(&EdgeHit) -> bool,
    ) -> Option<(EdgeHit, usize)>;

    /// How often one edge can be met.
    fn most_meetings(&self) -> usize;

    /// On which side of it a point lies, if it can tell. `reach` is a guess at the distance, `drift` how the material
    /// there has moved in the frame.
    fn side(&self, x: DVec3, reach: f64, drift: DVec3) -> Option<bool>;

    /// True for one segment that moves: its surface turns only where its path does.
    fn is_straight(&self) -> bool;

    /// Whether a point is further than a distance from where it moves now; never if it stands.
    fn is_beyond(&self, x: DVec3, distance: f64) -> bool;

    /// Its normal, of any length, at a point that it touches while it stands. `length` is that of the longest edge
    /// there.
    fn touches(&self, x: DVec3, length: f64) -> Option<DVec3>;
}

/// An edge that the blade crosses, with the surface there.
pub(crate) struct CrossedEdge {
    pub(crate) crossing: Crossing,
    pub(crate) tangent: Tangent,
    /// On which side the ends were seen.
    pub(crate) sides: [Option<bool>; 2],
    /// The segment of the blade.
    pub(crate) segment: usize,
    /// Number of hits.
    pub(crate) meetings: usize,
}

impl CrossedEdge {
    /// Swaps the sides of the surface.
    pub(crate) fn turn(&mut self) {
        self.tangent.normal = -self.tangent.normal;
        self.sides = self.sides.map(|side| side.map(|side| !side));
    }
}
