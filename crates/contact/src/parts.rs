//! [`Part`]: a piece of a body, and a bound on how close its surface may have come to others and to itself.
//!
//! The displacements of the vertices of a part, and their velocities, are a rigid motion and a rest:
//! `d(x) = d₀ + ω × (x − c) + r`, with `d₀` and `ω` by least squares and a box around all `r`. The motion as a whole brings
//! no two of its points closer to each other, so a part comes closer to itself by the size of that box at most; two
//! parts come closer to each other by what their fields differ where their boxes meet, or anywhere if that is less. A bound by the displacements alone
//! would ask for a search in each frame in which something turns.
//!
//! Cost: two passes over the vertices, and a few dozen operations for two parts that are near each other.

use glam::{DMat3, DVec3};
use incise_mesh::Bounds;

use crate::index::NONE;

/// A vector field along a part: its displacements or its velocities.
#[derive(Clone, Copy, Debug)]
struct Field {
    /// The sum, while vertices are added; then the value at the center.
    at: DVec3,
    /// The sum of the moments, while vertices are added; then the rotation.
    spin: DVec3,
    /// Around what the rigid motion leaves.
    rest: Bounds,
    /// Around all of it.
    whole: Bounds,
}

impl Field {
    const EMPTY: Self = Self {
        at: DVec3::ZERO,
        spin: DVec3::ZERO,
        rest: Bounds::EMPTY,
        whole: Bounds::EMPTY,
    };

    /// The rigid motion at a place relative to the center.
    fn rigid(&self, from_center: DVec3) -> DVec3 {
        self.at + self.spin.cross(from_center)
    }

    /// The length of the diagonal of the rest.
    fn spread(&self) -> f64 {
        self.rest.size().max(DVec3::ZERO).length()
    }
}

/// A piece of a body and how its surface moves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part {
    pub(crate) body: u32,
    /// Around it.
    pub(crate) bounds: Bounds,
    /// Whether another part that it may touch is near.
    pub(crate) is_near: bool,
    /// The largest speed in m/s of such a part relative to it, both as a whole, where they are near.
    approach: f64,
    /// A vertex, from which sums are taken.
    origin: DVec3,
    count: f64,
    /// The sum of places relative to the origin, while vertices are added; then the center.
    center: DVec3,
    /// The sum of the squares of places relative to the origin.
    squares: DMat3,
    /// Displacements since the last search, and velocities.
    fields: [Field; 2],
}

impl Part {
    pub(crate) const EMPTY: Self = Self {
        body: NONE,
        bounds: Bounds::EMPTY,
        is_near: false,
        approach: 0.0,
        origin: DVec3::ZERO,
        count: 0.0,
        center: DVec3::ZERO,
        squares: DMat3::ZERO,
        fields: [Field::EMPTY; 2],
    };

    /// Adds a vertex with its displacement and its velocity.
    pub(crate) fn add(&mut self, x: DVec3, moves: [DVec3; 2]) {
        if self.count == 0.0 {
            self.origin = x;
        }
        let from = x - self.origin;
        self.count += 1.0;
        self.center += from;
        let [a, b, c] = from.to_array();
        self.squares += DMat3::from_cols(from * a, from * b, from * c);
        self.bounds = self.bounds.union(Bounds::around([x]));
        for (field, by) in self.fields.iter_mut().zip(moves) {
            field.at += by;
            field.spin += from.cross(by);
        }
    }

    /// Fits the rigid motions to what was added.
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
        let inverse = inertia.inverse();
        self.center = self.origin + center;
        for field in &mut self.fields {
            field.at /= self.count;
            let moment = field.spin - center.cross(field.at) * self.count;
            let spin = inverse * moment;
            // A part on a line has no rotation about it: any other motion will do, it leaves a larger rest.
            field.spin = if spin.is_finite() { spin } else { DVec3::ZERO };
        }
    }

    /// Notes what the rigid motions leave of a vertex.
    pub(crate) fn leave(&mut self, x: DVec3, moves: [DVec3; 2]) {
        let from = x - self.center;
        for (field, by) in self.fields.iter_mut().zip(moves) {
            let rest = by - field.rigid(from);
            field.rest = field.rest.union(Bounds::around([rest]));
            field.whole = field.whole.union(Bounds::around([by]));
        }
    }

    /// How much closer two points of the part may have come to each other in m, and at which speed they may do so in m/s.
    pub(crate) fn within(&self) -> [f64; 2] {
        self.fields.map(|field| field.spread())
    }

    /// The angle that it has turned by: a rotation that is taken for small stretches distances by this part at most.
    pub(crate) fn turned(&self) -> f64 {
        self.fields[0].spin.length()
    }

    /// Notes another part near it that it may touch, and how fast the two may approach as a whole.
    pub(crate) fn meet(&mut self, approach: f64) {
        self.is_near = true;
        self.approach = self.approach.max(approach);
    }

    /// The largest speed that was noted, in m/s.
    pub(crate) fn approach_of_others(&self) -> f64 {
        self.approach
    }

    /// The speed of a vertex in m/s beside the motion of the part as a whole.
    pub(crate) fn beside(&self, x: DVec3, velocity: DVec3) -> f64 {
        let [_, velocities] = &self.fields;
        velocity.distance(velocities.rigid(x - self.center))
    }

    /// A bound on the speed in m/s of any point of one part relative to any of the other.
    pub(crate) fn fastest(&self, other: &Self) -> f64 {
        let [_, one] = &self.fields;
        furthest(&one.whole, &other.fields[1].whole, DVec3::ZERO)
    }

    /// The speed in m/s at which the motions of two parts as a whole may bring points together that are within `reach` of
    /// each other.
    pub(crate) fn approach(&self, other: &Self, reach: f64) -> f64 {
        self.whole(other, reach, 1).0
    }

    /// What the rigid motions of two fields differ by where the parts are near each other, and the difference there in the
    /// middle with what it varies by.
    fn whole(&self, other: &Self, reach: f64, k: usize) -> (f64, DVec3, f64) {
        let low = self.bounds.low.max(other.bounds.low) - reach;
        let high = self.bounds.high.min(other.bounds.high) + reach;
        let (middle, half) = ((low + high) / 2.0, (high - low).length() / 2.0);
        let (one, two) = (&self.fields[k], &other.fields[k]);
        let between = one.rigid(middle - self.center) - two.rigid(middle - other.center);
        let turned = (one.spin - two.spin).length() * half + two.spin.length() * reach;
        (between.length() + turned, between, turned)
    }

    /// How much closer points of two parts may have come to each other in m that are within `reach` of each other now, and
    /// at which speed they may do so in m/s.
    pub(crate) fn towards(&self, other: &Self, reach: f64) -> [f64; 2] {
        [0, 1].map(|k| {
            let (one, two) = (&self.fields[k], &other.fields[k]);
            let (_, between, turned) = self.whole(other, reach, k);
            let rest = furthest(&one.rest, &two.rest, between);
            (rest + turned).min(furthest(&one.whole, &two.whole, DVec3::ZERO))
        })
    }
}

/// The largest distance of a point of one box from a point of the other, when the first is moved by some way.
fn furthest(one: &Bounds, other: &Bounds, by: DVec3) -> f64 {
    let (high, low) = (by + one.high - other.low, by + one.low - other.high);
    high.abs().max(low.abs()).length()
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

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

    fn part(vertices: &[(DVec3, [DVec3; 2])]) -> Part {
        let mut part = Part::EMPTY;
        vertices.iter().for_each(|&(x, moves)| part.add(x, moves));
        part.fit();
        vertices.iter().for_each(|&(x, moves)| part.leave(x, moves));
        part
    }

    /// A part that turns a little as a whole does not approach itself.
    #[test]
    fn a_rigid_motion_is_none() {
        for angle in [0.0, 0.01, 0.1] {
            let turn = DQuat::from_axis_angle(point(5).normalize(), angle);
            let moved = |x: DVec3| turn * x + point(7) - x;
            let spin = point(8);
            let vertices: Vec<_> = (10..60)
                .map(|i| {
                    let x = 3.0 * point(i);
                    let now = x + moved(x);
                    (now, [moved(x), spin.cross(now) + point(9)])
                })
                .collect();
            let [moved, speed] = part(&vertices).within();
            // Of second order: half the square of the angle over a diameter of up to 11.
            assert!(moved <= 5.5 * angle * angle + 1e-12, "{moved} at {angle}");
            assert!(speed < 1e-12);
        }
    }

    /// Whatever moves how, no two points have come closer than the bounds say.
    #[test]
    fn bounds_hold() {
        let mut close = 0;
        for seed in 0..200 {
            let one = |offset: u32, at: DVec3| -> Vec<(DVec3, [DVec3; 2])> {
                let number = |i: u32| 1000 * seed + 100 * offset + i;
                (0..20)
                    .map(|i| {
                        let x = point(number(i)) + at;
                        let spin = point(number(50)) * 0.2;
                        let by = spin.cross(x) + point(number(51)) + 0.1 * point(number(60 + i));
                        (x, [by, by])
                    })
                    .collect()
            };
            let reach = 0.3;
            let [first, second] = [one(0, DVec3::ZERO), one(1, 1.2 * point(seed))];
            let (a, b) = (part(&first), part(&second));
            for (others, [bound, speed], turned) in [
                (&first, a.within(), a.turned()),
                (&second, a.towards(&b, reach), b.turned()),
            ] {
                assert_eq!(bound, speed, "equal fields");
                for (x, [d, _]) in &first {
                    for (y, [e, _]) in others {
                        let now = x.distance(*y);
                        if now > reach {
                            continue;
                        }
                        let before = (*x - *d).distance(*y - *e);
                        close += 1;
                        assert!(before <= now + bound + turned * now + 1e-12);
                    }
                }
            }
        }
        assert!(close > 1000);
    }
}
