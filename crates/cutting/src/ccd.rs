//! When a moving blade segment meets a moving edge.
//!
//! Both move on straight lines during a frame. They can only touch when their four ends are coplanar: a cubic in time.
//! Because the blade is followed in the same time as the material, there is no gap between one frame's sweep and the
//! next, however the body deformed meanwhile, and an edge missed by rounding at the end of a frame is found at the
//! start of the next (both judge the same configuration by the same expression). Cost: constant.

use glam::DVec3;

/// Slack on the extents of edge and blade, as a fraction: what passes through the end of one edge is caught by all.
const SLACK: f64 = 1e-9;
/// Halvings of a bracket: enough to reach neighboring floating-point numbers from any bracket in 0..=1.
const HALVINGS: usize = 60;

/// A segment whose ends move on straight lines.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct MovingSegment {
    pub(crate) before: [DVec3; 2],
    pub(crate) now: [DVec3; 2],
}

impl MovingSegment {
    pub(crate) fn at(&self, time: f64) -> [DVec3; 2] {
        // Exact at both ends of the frame, unlike `a + (b - a) * t`.
        [0, 1].map(|i| self.before[i] * (1.0 - time) + self.now[i] * time)
    }

    pub(crate) fn velocity(&self, parameter: f64) -> DVec3 {
        let [a, b] = [0, 1].map(|i| self.now[i] - self.before[i]);
        a + (b - a) * parameter
    }
}

/// Where and how an edge met the blade.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct EdgeHit {
    /// When in the frame: 0 at its start, 1 at its end.
    pub(crate) time: f64,
    /// Where on the edge: 0 at the first end, 1 at the second.
    pub(crate) parameter: f64,
    /// Blade direction × motion of the blade relative to the material: the surface's normal, not of unit length.
    pub(crate) normal: DVec3,
    /// Whether the edge runs from the negative side to the positive one.
    pub(crate) upwards: bool,
    /// The sides of the surface that the two ends are on, where this hit tells.
    pub(crate) sides: [Option<bool>; 2],
    /// The segment of the blade, from 0.
    pub(crate) segment: usize,
}

/// The meetings of an edge with a blade segment during a frame, in order of time; at most three.
pub(crate) fn meetings(
    edge: &MovingSegment,
    blade: &MovingSegment,
) -> impl Iterator<Item = EdgeHit> {
    times(edge, blade).into_iter().flatten().filter_map(|time| {
        let [[a, b], [p, q]] = [edge.at(time), blade.at(time)];
        let (along_edge, along_blade) = (b - a, q - p);
        let across = along_edge.cross(along_blade);
        let squared = across.length_squared();
        // Parallel lines have no single meeting point; the other edges at their ends decide.
        if squared <= 1e-24 * along_edge.length_squared() * along_blade.length_squared() {
            return None;
        }
        let parameter = (p - a).cross(along_blade).dot(across) / squared;
        let on_blade = (p - a).cross(along_edge).dot(across) / squared;
        let within = -SLACK..=1.0 + SLACK;
        let normal = along_blade.cross(blade.velocity(on_blade) - edge.velocity(parameter));
        let meets =
            within.contains(&parameter) && within.contains(&on_blade) && normal != DVec3::ZERO;
        let upwards = normal.dot(along_edge) > 0.0;
        meets.then_some(EdgeHit {
            time,
            parameter: parameter.clamp(0.0, 1.0),
            normal,
            upwards,
            sides: [Some(!upwards), Some(upwards)],
            segment: 0,
        })
    })
}

/// Twice the volume that the two segments span, times three: zero when they are coplanar.
fn span(edge: &MovingSegment, blade: &MovingSegment, time: f64) -> f64 {
    let [[a, b], [p, q]] = [edge.at(time), blade.at(time)];
    (b - a).cross(q - p).dot(p - a)
}

/// The times in 0..=1 at which the segments' lines are coplanar, ascending.
fn times(edge: &MovingSegment, blade: &MovingSegment) -> [Option<f64>; 3] {
    // Between the extrema of the cubic the span is monotone, so a change of sign brackets exactly one root.
    let cubic = Cubic::new(edge, blade);
    let mut ends = [0.0; 4];
    let mut count = 1;
    for time in cubic.extrema().into_iter().flatten() {
        if time > ends[count - 1] && time < 1.0 {
            ends[count] = time;
            count += 1;
        }
    }
    ends[count] = 1.0;
    let mut times = [None; 3];
    for i in 0..count {
        let near = |low, high, at| cubic.root_within(edge, blade, low, high, at);
        times[i] = bracketed(|t| span(edge, blade, t), near, ends[i], ends[i + 1]);
    }
    times
}

/// The span as a polynomial in time.
struct Cubic {
    constant: f64,
    linear: f64,
    square: f64,
    cube: f64,
}

impl Cubic {
    fn new(edge: &MovingSegment, blade: &MovingSegment) -> Self {
        let [e, s] = [edge, blade].map(|m| m.before[1] - m.before[0]);
        let [de, ds] = [edge, blade].map(|m| m.now[1] - m.now[0] - (m.before[1] - m.before[0]));
        let r = blade.before[0] - edge.before[0];
        let dr = blade.now[0] - edge.now[0] - r;
        // (e + t de) × (s + t ds) = c0 + t c1 + t² c2
        let (c0, c1, c2) = (e.cross(s), de.cross(s) + e.cross(ds), de.cross(ds));
        Self {
            constant: c0.dot(r),
            linear: c1.dot(r) + c0.dot(dr),
            square: c2.dot(r) + c1.dot(dr),
            cube: c2.dot(dr),
        }
    }

    /// The times at which the derivative of the span vanishes, ascending.
    fn extrema(&self) -> [Option<f64>; 2] {
        let &Self {
            linear,
            square,
            cube,
            ..
        } = self;
        // 3 cube t² + 2 square t + linear = 0, in the form that loses no digits.
        let discriminant = square * square - 3.0 * cube * linear;
        if discriminant < 0.0 || !discriminant.is_finite() {
            return [None, None];
        }
        let q = -(square + discriminant.sqrt().copysign(square));
        let roots = [q / (3.0 * cube), linear / q]
            .map(|t| (t.is_finite() && t > 0.0 && t < 1.0).then_some(t));
        match roots {
            [Some(a), Some(b)] if a > b => [Some(b), Some(a)],
            [None, one] => [one, None],
            sorted => sorted,
        }
    }

    /// Where alone [`span`] can have another sign than at the ends `low` and `high`, where its values are `at`: below
    /// this interval it has one sign and above it the other, rounding included. `None` if that is not known.
    fn root_within(
        &self,
        edge: &MovingSegment,
        blade: &MovingSegment,
        low: f64,
        high: f64,
        at: [f64; 2],
    ) -> Option<[f64; 2]> {
        let largest = |x: DVec3| x.abs().max_element();
        let [e, s] = [edge, blade].map(|m| {
            let (before, now) = (m.before[1] - m.before[0], m.now[1] - m.now[0]);
            largest(before).max(largest(now))
        });
        let [before, now] = [blade.before[0] - edge.before[0], blade.now[0] - edge.now[0]];
        let r = largest(before).max(largest(now));
        let points = [edge.before, edge.now, blade.before, blade.now];
        let farthest = points.as_flattened().iter().map(|x| largest(*x));
        let farthest = farthest.fold(0.0, f64::max);
        // Each component of the three vectors is off by at most 4 ε times the largest coordinate, each of six products
        // by 3 ε more: in all less than 40 ε times this.
        let rounding = 48.0 * f64::EPSILON * farthest * (e * s + s * r + r * e);
        // The coefficients are off by less than 1e-12 of the product.
        let (bend, doubt) = (
            2.0 * self.square.abs() + 3.0 * self.cube.abs(),
            1e-11 * e * s * r,
        );
        let slope = 0.999 * (self.linear.abs() - bend) - doubt;
        let in_range = slope > 0.0 && slope.is_finite() && rounding > 1e100 * f64::MIN_POSITIVE;
        if !in_range {
            return None;
        }
        let mut root = low + (high - low) * (at[0] / (at[0] - at[1]));
        for _ in 0..2 {
            let Self {
                constant,
                linear,
                square,
                cube,
            } = self;
            let value = constant + root * (linear + root * (square + root * cube));
            let slope = linear + root * (2.0 * square + root * (3.0 * cube));
            root = (root - value / slope).clamp(low, high);
        }
        // Once for the value here, once for any other, and once so that that is not zero.
        let within = (span(edge, blade, root).abs() + 3.0 * rounding) / slope;
        let within = 1.001 * within + 4.0 * f64::EPSILON;
        Some([root - within, root + within])
    }
}

/// The root of `f` between `low` and `high` if its sign changes there; a zero at an end counts.
///
/// By halving the bracket, since `f` is the judge to the last bit. `near` may tell where alone that needs a look, from
/// the bracket and the values at its ends.
fn bracketed(
    f: impl Fn(f64) -> f64,
    near: impl Fn(f64, f64, [f64; 2]) -> Option<[f64; 2]>,
    mut low: f64,
    mut high: f64,
) -> Option<f64> {
    let (at_low, at_high) = (f(low), f(high));
    if at_low == 0.0 && at_high == 0.0 {
        return None; // coplanar all the time: the blade slides along the edge
    }
    if at_low == 0.0 {
        return Some(low);
    }
    if at_high == 0.0 {
        return Some(high);
    }
    if (at_low > 0.0) == (at_high > 0.0) {
        return None;
    }
    let [below, above] = near(low, high, [at_low, at_high]).unwrap_or([low, high]);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break; // neighboring numbers
        }
        let as_at_low = if middle <= below {
            true
        } else if middle >= above {
            false
        } else {
            (f(middle) > 0.0) == (at_low > 0.0)
        };
        if as_at_low {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some(high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn still(a: DVec3, b: DVec3) -> MovingSegment {
        MovingSegment {
            before: [a, b],
            now: [a, b],
        }
    }

    #[test]
    fn blade_passes_a_resting_edge() {
        let edge = still(DVec3::ZERO, DVec3::X);
        let blade = MovingSegment {
            before: [DVec3::new(0.25, -1.0, -1.0), DVec3::new(0.25, -1.0, 1.0)],
            now: [DVec3::new(0.25, 1.0, -1.0), DVec3::new(0.25, 1.0, 1.0)],
        };
        let found: Vec<EdgeHit> = meetings(&edge, &blade).collect();
        assert_eq!(found.len(), 1);
        assert!((found[0].time - 0.5).abs() < 1e-12);
        assert!((found[0].parameter - 0.25).abs() < 1e-12);
        // Blade direction z × motion y = -x.
        assert!(found[0].normal.x < 0.0);
    }

    #[test]
    fn a_short_blade_misses() {
        let edge = still(DVec3::ZERO, DVec3::X);
        let blade = MovingSegment {
            before: [DVec3::new(0.25, -1.0, 0.1), DVec3::new(0.25, -1.0, 1.0)],
            now: [DVec3::new(0.25, 1.0, 0.1), DVec3::new(0.25, 1.0, 1.0)],
        };
        assert_eq!(meetings(&edge, &blade).count(), 0);
    }

    #[test]
    fn a_moving_edge_meets_a_resting_blade() {
        let edge = MovingSegment {
            before: [DVec3::new(-1.0, 1.0, 0.0), DVec3::new(1.0, 1.0, 0.0)],
            now: [DVec3::new(-1.0, -3.0, 0.0), DVec3::new(1.0, -3.0, 0.0)],
        };
        let blade = still(DVec3::NEG_Z, DVec3::Z);
        let found: Vec<EdgeHit> = meetings(&edge, &blade).collect();
        assert_eq!(found.len(), 1);
        assert!((found[0].time - 0.25).abs() < 1e-12);
        assert!((found[0].parameter - 0.5).abs() < 1e-12);
    }

    /// A turning edge is met, left and met again: all meetings come out, in order.
    #[test]
    fn all_roots_are_found() {
        let edge = still(DVec3::new(-1.0, 0.0, 0.0), DVec3::new(1.0, 0.0, 0.0));
        let blade = MovingSegment {
            before: [DVec3::new(0.0, -1.0, -1.0), DVec3::new(0.0, 0.5, 1.0)],
            now: [DVec3::new(0.0, 0.5, -1.0), DVec3::new(0.0, -1.0, 1.0)],
        };
        let found: Vec<EdgeHit> = meetings(&edge, &blade).collect();
        for m in &found {
            assert!(span(&edge, &blade, m.time).abs() < 1e-12);
        }
        assert!(found.windows(2).all(|w| w[0].time <= w[1].time));
    }
    proptest! {
        /// Where alone the span is looked at changes no bit of a root: segments near and far, slow, turning and almost
        /// parallel, and of small numbers.
        #[test]
        fn roots_are_those_of_plain_halving(
            corners in prop::array::uniform8(prop::array::uniform3(-1.0..1.0_f64)),
            exponents in prop::array::uniform5(0..24_i32),
        ) {
            let [turn, far, slow, flat, small] = exponents.map(|e| 0.1_f64.powi((e - 8).max(0)));
            let [a, b, c, d, e, f, g, h] = corners.map(DVec3::from_array);
            let away = DVec3::new(0.3, -0.7, 0.5) * (1e-3 / far).min(1e9) * small;
            let moving = |a: DVec3, b: DVec3, way: DVec3, other: DVec3| MovingSegment {
                before: [a, b].map(|x| x * small + away),
                now: [a + way * slow, b + (way + other * turn) * slow].map(|x| x * small + away),
            };
            let edge = moving(a, b, c, d);
            let blade = moving(e, e + (b - a) + (f - (b - a)) * flat, g, h);
            let cubic = Cubic::new(&edge, &blade);
            for [low, high] in [[0.0, 1.0], [0.0, 0.3], [0.3, 1.0]] {
                let judge = |time| span(&edge, &blade, time);
                let near = |low, high, at| cubic.root_within(&edge, &blade, low, high, at);
                let quick = bracketed(judge, near, low, high);
                prop_assert_eq!(quick, bracketed(judge, |_, _, _| None, low, high));
            }
        }
    }
}
