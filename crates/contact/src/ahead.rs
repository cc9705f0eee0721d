//! How far two things near each other may come closer in a frame.
//!
//! A *step* is the way that a particle goes in the frame at its present velocity. Two particles come closer by no more
//! than the length of the difference of their steps, so a fast corner of a sliver looks far ahead, and what falls or
//! bends side by side does not.
//!
//! A vertex and a triangle are searched for if their distance is at most that of the skin and the thickness, and what
//! they may come closer by: their approach, up to a limit. A tree bounds it from a box around the steps below each node.

use glam::{DVec3, Vec4};

use crate::tree::{Box32, Boxes, Children};

/// What rounding to single precision adds to a coordinate and to a distance at most, as a part of it.
const ROUNDING: f32 = 1e-6;

/// How far two groups of particles may come closer to each other in m.
pub(crate) fn approach(steps: &[DVec3], one: &[u32], other: &[u32]) -> f64 {
    let squared = one.iter().flat_map(|&p| {
        let others = other.iter();
        others.map(move |&q| steps[q as usize].distance_squared(steps[p as usize]))
    });
    squared.fold(0.0, larger).sqrt()
}

/// The larger number; what is no number stays.
fn larger(most: f64, value: f64) -> f64 {
    if value <= most { most } else { value }
}

/// How far away a search looks.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Reach {
    /// The distance in m at which two things are looked at that do not approach each other.
    pub(crate) still: f64,
    /// The most in m that is added for an approach.
    pub(crate) limit: f64,
}

impl Reach {
    /// How far apart two things may be that approach each other by `approach`.
    pub(crate) fn of(&self, approach: f64) -> f64 {
        // A value that is no number counts as the limit.
        let by = if approach <= self.limit {
            approach
        } else {
            self.limit
        };
        self.still + by
    }
}

/// What is searched around: a box with its steps, in single precision with room for rounding.
pub(crate) struct Lookout {
    low: Vec4,
    high: Vec4,
    step_low: Vec4,
    step_high: Vec4,
    still: f32,
    limit: f32,
}

impl Lookout {
    /// Around a box whose steps are in another.
    pub(crate) fn new(bounds: &Box32, steps: &Box32, reach: &Reach) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "with room for rounding")]
        let single = |x: f64| x as f32 * (1.0 + ROUNDING);
        let vectors = [bounds.low(), bounds.high(), steps.low(), steps.high()];
        let [low, high, step_low, step_high] = vectors;
        let largest = vectors.map(|v| v.abs().max_element());
        let rounding = ROUNDING * largest.into_iter().fold(0.0, f32::max);
        Self {
            low,
            high,
            step_low,
            step_high,
            still: single(reach.still) + rounding,
            limit: single(reach.limit),
        }
    }

    /// A bound on how far apart something in a box with these steps may be to be found.
    #[inline]
    pub(crate) fn reach(&self, steps: &Box32) -> f32 {
        let by = (self.step_high - steps.low())
            .max(steps.high() - self.step_low)
            .length();
        let by = by * (1.0 + ROUNDING);
        self.still + if by <= self.limit { by } else { self.limit }
    }

    /// The children of a node where something may be found, as bits.
    #[inline]
    pub(crate) fn reached(&self, children: &Children) -> u32 {
        let mut squared = Vec4::ZERO;
        for k in 0..3 {
            let apart = (children.bounds.low(k) - Vec4::splat(self.high[k]))
                .max(Vec4::splat(self.low[k]) - children.bounds.high(k))
                .max(Vec4::ZERO);
            squared += apart * apart;
        }
        // Most boxes are far away, and most others near.
        let within = |reach: Vec4| squared.cmple(reach * reach * (1.0 + ROUNDING)).bitmask();
        let far = within(Vec4::splat(self.still + self.limit));
        if far == 0 {
            return 0;
        }
        let near = within(Vec4::splat(self.still));
        if far == near {
            return near;
        }
        near | far & within(self.reaches_of(&children.steps))
    }

    /// A bound on how far apart something in each of four boxes with these steps may be to be found.
    #[inline]
    fn reaches_of(&self, steps: &Boxes) -> Vec4 {
        let mut squared = Vec4::ZERO;
        for k in 0..3 {
            let by = (Vec4::splat(self.step_high[k]) - steps.low(k))
                .max(steps.high(k) - Vec4::splat(self.step_low[k]));
            squared += by * by;
        }
        let by = squared.sqrt() * (1.0 + ROUNDING);
        let limit = Vec4::splat(self.limit);
        self.still + Vec4::select(by.cmple(limit), by, limit)
    }
}

/// Decides which contacts a frame may bring together.
#[derive(Clone, Copy)]
pub(crate) struct Near<'a> {
    pub(crate) fixed: &'a [bool],
    /// By particle.
    pub(crate) steps: &'a [DVec3],
    pub(crate) reach: Reach,
}

impl Near<'_> {
    /// Whether the particles of one side may meet those of the other in the frame, and one of them can move. An overlap is
    /// near in any case, so that reports tell of one that nothing can part.
    pub(crate) fn of(&self, one: &[u32], other: &[u32], gap: f64) -> bool {
        let is_fixed = |p: &u32| self.fixed.get(*p as usize).copied().unwrap_or_default();
        if one.iter().chain(other).all(is_fixed) {
            return gap < 0.0;
        }
        // What is no number is kept.
        let is_apart =
            gap > self.reach.still && gap > self.reach.of(approach(self.steps, one, other));
        !is_apart
    }
}

#[cfg(test)]
mod tests {
    use incise_mesh::Bounds;

    use super::*;

    fn noise(number: u32) -> f64 {
        (f64::from(number) * 12.9898).sin() * 43_758.545 % 1.0
    }

    fn point(number: u32) -> DVec3 {
        DVec3::from_array([0, 1, 2].map(|k| noise(3 * number + k)))
    }

    /// A box is reached if anything in it is.
    #[test]
    fn a_box_is_reached_if_a_point_in_it_is() {
        let (mut reached, mut left_out) = (0, 0);
        for i in 0..20_000 {
            let scale = [1.0, 1e-3, 1e3][i as usize % 3];
            let [x, s, y, t] = [0, 1, 2, 3].map(|k| point(4 * i + k) * scale);
            let x = 1e3 * scale + x;
            let (y, s, t) = (x + 0.3 * y, 0.2 * s, 0.2 * t);
            let reach = Reach {
                still: 0.05 * scale,
                limit: 0.2 * scale,
            };
            let of = |x: DVec3| Box32::around(&Bounds::around([x]));
            let lookout = Lookout::new(&of(x), &of(s), &reach);
            let further = |x: DVec3, k: u32| Bounds::around([x, x + 0.1 * scale * point(i ^ k)]);
            let (bounds, steps) = (further(y, 91), further(t, 92));
            let mut children = Children::NONE;
            let child = i as usize % 4;
            children.bounds.set(child, &Box32::around(&bounds));
            children.steps.set(child, &Box32::around(&steps));
            let bits = lookout.reached(&children);
            let is_reached = bits == 1 << child;
            assert!(is_reached || bits == 0, "{i}: {bits}");
            if x.distance(y) <= reach.of(s.distance(t)) {
                assert!(is_reached, "{i}");
                reached += 1;
            }
            left_out += u32::from(!is_reached);
        }
        assert!(reached > 100 && left_out > 1000, "{reached} and {left_out}");
        let reach = Reach {
            still: 1.0,
            limit: 1e9,
        };
        let lookout = Lookout::new(&Box32::POINT, &Box32::POINT, &reach);
        assert_eq!(lookout.reached(&Children::NONE), 0);
    }
}
