//! [`Part`]: a piece of a body, and how its surface moves beside a rigid motion.
//!
//! What the vertices of a part have moved by is a rigid motion and a rest: `d(x) = x − c + d₀ − R⁻¹ (x − c) + r`. A
//! rotation moves each point by `w × m`, where `m` is the middle of its way and `w` twice the tangent of half the angle (A.
//! Cayley's form), so that `d₀` and `w` by least squares are exact for a rigid motion of any angle. The rigid motion brings
//! no two of its points closer to each other, so they come closer by the rests of both at most. Points of two parts also
//! come closer by what the rigid motions differ by where the parts are near each other. A bound by displacements alone
//! would ask for a search in each frame in which something turns.
//!
//! Any rigid motion gives a bound, so a large part is fitted to some of its vertices only.
//!
//! Cost: two passes over the vertices, and a few dozen operations for two parts that are near each other.

use glam::{DMat3, DQuat, DVec3};
use incise_mesh::Bounds;

use crate::index::NONE;

/// A rotation, then a shift.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Rigid {
    turn: DQuat,
    shift: DVec3,
}

impl Rigid {
    pub(crate) const IDENTITY: Self = Self {
        turn: DQuat::IDENTITY,
        shift: DVec3::ZERO,
    };

    fn of(&self, x: DVec3) -> DVec3 {
        self.turn * x + self.shift
    }

    /// This map after another one.
    pub(crate) fn after(&self, first: &Self) -> Self {
        Self {
            turn: (self.turn * first.turn).normalize(),
            shift: self.of(first.shift),
        }
    }

    /// A bound on what two maps differ by in a ball.
    pub(crate) fn differs(&self, other: &Self, ball: Ball) -> f64 {
        // The largest stretch of the difference of two rotations.
        let turned = 2.0 * (self.turn * other.turn.inverse()).xyz().length();
        self.of(ball.middle).distance(other.of(ball.middle)) + turned * ball.radius
    }
}

/// Where points of two parts may meet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ball {
    middle: DVec3,
    radius: f64,
}

/// A rigid motion near the displacements of points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion {
    /// Around the points.
    pub(crate) bounds: Bounds,
    /// A point, from which sums are taken.
    origin: DVec3,
    count: f64,
    /// The sum of places relative to the origin, while points are added; then the center.
    center: DVec3,
    /// The sum of the squares of places relative to the origin.
    squares: DMat3,
    /// The sum of displacements, while points are added; then that of the center.
    at: DVec3,
    /// The sum of the moments, while points are added; then twice the tangent of half the angle.
    spin: DVec3,
    /// The rotation back.
    back: DQuat,
    /// [`Self::back`] as a matrix.
    turn: DMat3,
}

impl Motion {
    pub(crate) const NONE: Self = Self {
        bounds: Bounds::EMPTY,
        origin: DVec3::ZERO,
        count: 0.0,
        center: DVec3::ZERO,
        squares: DMat3::ZERO,
        at: DVec3::ZERO,
        spin: DVec3::ZERO,
        back: DQuat::IDENTITY,
        turn: DMat3::IDENTITY,
    };

    /// Adds a point to what the bounds are around.
    pub(crate) fn cover(&mut self, x: DVec3) {
        self.bounds = self.bounds.union(Bounds::around([x]));
    }

    /// Adds a point that has moved by some way to those that the motion is fitted to.
    pub(crate) fn add(&mut self, x: DVec3, by: DVec3) {
        let middle = x - by / 2.0;
        if self.count == 0.0 {
            self.origin = middle;
        }
        let from = middle - self.origin;
        self.count += 1.0;
        self.center += from;
        let [a, b, c] = from.to_array();
        self.squares += DMat3::from_cols(from * a, from * b, from * c);
        self.at += by;
        self.spin += from.cross(by);
    }

    /// Fits the rigid motion to what was added.
    pub(crate) fn fit(&mut self) {
        if self.count == 0.0 {
            return;
        }
        let center = self.center / self.count;
        // Σ |r|² 1 − r rᵀ about the center.
        let [a, b, c] = center.to_array();
        let of_center = DMat3::from_cols(center * a, center * b, center * c) * self.count;
        let squares = self.squares - of_center;
        let trace = squares.x_axis.x + squares.y_axis.y + squares.z_axis.z;
        let inertia = DMat3::from_diagonal(DVec3::splat(trace)) - squares;
        self.at /= self.count;
        self.center = self.origin + center + self.at / 2.0;
        let moment = self.spin - center.cross(self.at) * self.count;
        let spin = inertia.inverse() * moment;
        // A part on a line has no rotation about it: any other motion will do, it leaves larger rests.
        self.spin = if spin.is_finite() { spin } else { DVec3::ZERO };
        self.back = DQuat::from_vec4((-self.spin / 2.0).extend(1.0)).normalize();
        self.turn = DMat3::from_quat(self.back);
    }

    /// The displacement of a place by the rigid motion.
    pub(crate) fn of(&self, x: DVec3) -> DVec3 {
        let from = x - self.center;
        self.at + from - self.turn * from
    }

    /// The map from present places to those before the motion.
    pub(crate) fn back(&self) -> Rigid {
        Rigid {
            turn: self.back,
            shift: self.center - self.at - self.back * self.center,
        }
    }

    /// What has moved beside this motion by `rest`, on top of `before`, since a time before.
    pub(crate) fn carry(&self, before: DVec3, rest: DVec3) -> DVec3 {
        self.turn.transpose_mul_vec3(before + rest)
    }

    /// A bound on what displacements of two motions differ by, so small that rotations are linear, where points of both are
    /// within `reach` of each other.
    fn differs_linearly(&self, other: &Self, reach: f64) -> f64 {
        let Ball { middle, radius } = self.between(other, reach);
        let at = |motion: &Self| motion.at + motion.spin.cross(middle - motion.center);
        at(self).distance(at(other)) + (self.spin - other.spin).length() * radius
    }

    /// Around all points that are within `reach` of points of both.
    pub(crate) fn between(&self, other: &Self, reach: f64) -> Ball {
        let low = self.bounds.low.max(other.bounds.low) - reach;
        let high = self.bounds.high.min(other.bounds.high) + reach;
        Ball {
            middle: (low + high) / 2.0,
            radius: (high - low).length() / 2.0,
        }
    }
}

/// A piece of a body and how its surface moves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part {
    pub(crate) body: u32,
    pub(crate) vertices: u32,
    /// The motion is fitted to one of so many of them.
    pub(crate) stride: u32,
    /// How many were looked at since the last one of these, while they are.
    pub(crate) skipped: u32,
    /// Whether another part that it may touch is near.
    pub(crate) is_near: bool,
    /// Around what its vertices go in the frame.
    pub(crate) steps: Bounds,
    /// What places and those expected at the end of the frame have moved by since the last update; or, of the first, by
    /// the velocities in a frame.
    pub(crate) motions: [Motion; 2],
}

impl Part {
    pub(crate) const EMPTY: Self = Self {
        body: NONE,
        vertices: 0,
        stride: 1,
        skipped: 0,
        is_near: false,
        steps: Bounds::EMPTY,
        motions: [Motion::NONE; 2],
    };

    pub(crate) fn bounds(&self) -> &Bounds {
        &self.motions[0].bounds
    }

    /// What a vertex has moved by beside the part, at present and at the end of the frame.
    pub(crate) fn rests(&self, places: [DVec3; 2], moved: [DVec3; 2]) -> [DVec3; 2] {
        let [present, expected] = &self.motions;
        [
            moved[0] - present.of(places[0]),
            moved[1] - expected.of(places[1]),
        ]
    }

    /// A bound on how much closer the frame brings any two points of two parts.
    pub(crate) fn fastest(&self, other: &Self) -> f64 {
        let (one, other) = (&self.steps, &other.steps);
        (one.high - other.low).max(other.high - one.low).length()
    }

    /// How far in m the frame may bring points of two parts together that may be `reach` apart at its end, of the motions as
    /// a whole.
    pub(crate) fn approach(&self, other: &Self, reach: f64) -> f64 {
        self.motions[0].differs_linearly(&other.motions[0], reach)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(number: u32) -> f64 {
        (f64::from(number) * 12.9898).sin() * 43_758.545 % 1.0
    }

    fn point(number: u32) -> DVec3 {
        DVec3::new(
            noise(3 * number),
            noise(3 * number + 1),
            noise(3 * number + 2),
        )
    }

    /// Points with the ways that they have moved by.
    type Moved = Vec<(DVec3, DVec3)>;

    /// Fitted to every so many of the points.
    fn motion(points: &Moved, every: usize) -> Motion {
        let mut motion = Motion::NONE;
        points.iter().for_each(|&(x, _)| motion.cover(x));
        let fitted = points.iter().step_by(every);
        fitted.for_each(|&(x, by)| motion.add(x, by));
        motion.fit();
        motion
    }

    fn differ(one: &Motion, other: &Motion, reach: f64) -> f64 {
        let ball = one.between(other, reach);
        one.back().differs(&other.back(), ball)
    }

    /// A part that turns as a whole does not approach itself, and a part that moves with another one does not approach it.
    #[test]
    fn a_rigid_motion_leaves_no_rest() {
        for angle in [0.0, 0.01, 0.1, 1.0] {
            let turn = DQuat::from_axis_angle(point(5).normalize(), angle);
            let points = |first: u32| -> Moved {
                let points = (first..first + 50).map(|i| 3.0 * point(i));
                points
                    .map(|x| (turn * x + point(7), turn * x + point(7) - x))
                    .collect()
            };
            let (one, other) = (points(10), points(100));
            let (of_one, of_other) = (motion(&one, 1), motion(&other, 7));
            for (x, by) in &one {
                assert!(of_one.of(*x).distance(*by) < 1e-12, "at {angle}");
            }
            assert!(differ(&of_one, &of_other, 0.5) < 1e-7, "at {angle}");
        }
    }

    /// Whatever moves how, no two points have come closer than the bounds say.
    #[test]
    fn bounds_hold() {
        let mut close = 0;
        for seed in 0..200 {
            let one = |offset: u32, at: DVec3| -> Moved {
                let number = |i: u32| 1000 * seed + 100 * offset + i;
                let turn = DQuat::from_scaled_axis(point(number(50)) * 0.2);
                let moved = (0..20).map(|i| {
                    let x = point(number(i)) + at;
                    let before = turn * x + point(number(51)) + 0.1 * point(number(60 + i));
                    (x, x - before)
                });
                moved.collect()
            };
            let reach = 0.3;
            let (first, second) = (one(0, DVec3::ZERO), one(1, 1.2 * point(seed)));
            let every = [1, 3, 20][seed as usize % 3];
            let (a, b) = (motion(&first, every), motion(&second, 1));
            let cases = [(&first, &a, 0.0), (&second, &b, differ(&a, &b, reach))];
            for (others, motion, differs) in cases {
                for (x, d) in &first {
                    for (y, e) in others {
                        let now = x.distance(*y);
                        if now > reach {
                            continue;
                        }
                        let rests = a.of(*x).distance(*d) + motion.of(*y).distance(*e);
                        let before = (*x - *d).distance(*y - *e);
                        close += 1;
                        assert!(before <= now + rests + differs + 1e-12);
                    }
                }
            }
        }
        assert!(close > 1000);
    }
}
