//! The solids of [`Shape`](crate::Shape) that are blended from several parts, as signed distance functions.
//!
//! Animals and organs are modeled from balls, cones with round ends and ellipsoids, joined with filled creases. Animals
//! look along x and stand along z; y mirrors left and right. Each is modeled at its own size, then scaled and moved so
//! that its bounding box has a longest side of 1 m and its center at the origin. The absolute value never exceeds the
//! distance. Constant time.

use glam::{DVec3, dvec3};

use crate::distance::{
    ball, cuboid, ellipsoid, round_cone, smooth_difference, smooth_intersection, smooth_union,
};

/// The liver: three blended ellipsoids without a ball.
pub(super) fn liver(p: DVec3) -> f64 {
    let right = ellipsoid(p, dvec3(-0.2, 0.043, 0.0), dvec3(0.3, 0.25, 0.26));
    let lower = ellipsoid(p, dvec3(-0.27, -0.077, -0.04), dvec3(0.17, 0.22, 0.2));
    let left = ellipsoid(p, dvec3(0.2, 0.123, 0.03), dvec3(0.3, 0.11, 0.16));
    let lobes = smooth_union(smooth_union(right, lower, 0.08), left, 0.16);
    let hollow = ball(p - dvec3(0.06, -0.217, 0.06), 0.2);
    smooth_difference(lobes, hollow, 0.08)
}

/// The bunny: a body with haunches, a head with a snout, two ears and a tail.
pub(super) fn bunny(p: DVec3) -> f64 {
    const SCALE: f64 = 1.22;
    const CENTER: DVec3 = dvec3(-0.005, 0.0, 0.28);
    let p = p * SCALE + CENTER;
    let p = dvec3(p.x, p.y.abs(), p.z);
    let part = |ends, radii| round_cone(p, ends, radii);

    let body = part(
        [dvec3(-0.16, 0.0, 0.0), dvec3(0.14, 0.0, 0.06)],
        [0.3, 0.23],
    );
    let haunch = part(
        [dvec3(-0.1, 0.17, -0.14), dvec3(0.06, 0.2, -0.24)],
        [0.16, 0.09],
    );
    let paw = part(
        [dvec3(0.24, 0.11, -0.08), dvec3(0.33, 0.11, -0.26)],
        [0.1, 0.07],
    );
    let head = part(
        [dvec3(0.32, 0.0, 0.34), dvec3(0.45, 0.0, 0.29)],
        [0.18, 0.11],
    );
    let ear = part(
        [dvec3(0.28, 0.08, 0.46), dvec3(0.16, 0.15, 0.82)],
        [0.085, 0.07],
    );
    let tail = ball(p - dvec3(-0.47, 0.0, 0.0), 0.1);

    let body = smooth_union(smooth_union(body, haunch, 0.08), paw, 0.08);
    let head = smooth_union(head, ear, 0.05);
    smooth_union(smooth_union(body, head, 0.12), tail, 0.04) / SCALE
}

/// The armadillo, upright: a torso with studs on its back, a head with snout and ears, thin arms and legs, a tail.
pub(super) fn armadillo(p: DVec3) -> f64 {
    /// Limbs of the left side: both ends and their radii.
    const LIMBS: [([DVec3; 2], [f64; 2]); 7] = [
        // Upper arm, forearm, hand.
        (
            [dvec3(0.0, 0.13, 0.21), dvec3(0.03, 0.29, 0.19)],
            [0.055, 0.042],
        ),
        (
            [dvec3(0.03, 0.29, 0.19), dvec3(0.13, 0.34, 0.3)],
            [0.042, 0.035],
        ),
        (
            [dvec3(0.13, 0.34, 0.3), dvec3(0.17, 0.34, 0.36)],
            [0.04, 0.032],
        ),
        // Thigh, shin, foot.
        (
            [dvec3(0.0, 0.1, -0.14), dvec3(0.06, 0.19, -0.3)],
            [0.085, 0.055],
        ),
        (
            [dvec3(0.06, 0.19, -0.3), dvec3(-0.01, 0.2, -0.46)],
            [0.055, 0.042],
        ),
        (
            [dvec3(-0.01, 0.2, -0.46), dvec3(0.12, 0.23, -0.48)],
            [0.048, 0.035],
        ),
        // Ear.
        (
            [dvec3(0.06, 0.07, 0.44), dvec3(-0.01, 0.13, 0.53)],
            [0.036, 0.03],
        ),
    ];
    /// Tail from root to tip, with radii.
    const TAIL: [(DVec3, f64); 4] = [
        (dvec3(-0.08, 0.0, -0.14), 0.08),
        (dvec3(-0.22, 0.0, -0.28), 0.06),
        (dvec3(-0.36, 0.0, -0.34), 0.045),
        (dvec3(-0.48, 0.0, -0.3), 0.032),
    ];
    /// Centers of the studs of the left side.
    const STUDS: [DVec3; 9] = [
        dvec3(-0.155, 0.04, 0.22),
        dvec3(-0.17, 0.045, 0.13),
        dvec3(-0.172, 0.05, 0.04),
        dvec3(-0.165, 0.045, -0.05),
        dvec3(-0.11, 0.115, 0.18),
        dvec3(-0.12, 0.125, 0.08),
        dvec3(-0.12, 0.125, -0.02),
        dvec3(-0.04, 0.165, 0.11),
        dvec3(-0.04, 0.17, 0.02),
    ];
    const SCALE: f64 = 1.075;
    const CENTER: DVec3 = dvec3(-0.116, 0.0, 0.0225);
    let p = p * SCALE + CENTER;
    let p = dvec3(p.x, p.y.abs(), p.z);

    let torso = round_cone(
        p,
        [dvec3(-0.01, 0.0, -0.06), dvec3(0.0, 0.0, 0.18)],
        [0.175, 0.14],
    );
    let head = round_cone(
        p,
        [dvec3(0.05, 0.0, 0.39), dvec3(0.24, 0.0, 0.36)],
        [0.095, 0.04],
    );
    let studs = STUDS.map(|center| ball(p - center, 0.032));
    let armored = studs
        .into_iter()
        .fold(torso, |all, stud| smooth_union(all, stud, 0.015));
    let tail = TAIL
        .windows(2)
        .map(|pair| round_cone(p, [pair[0].0, pair[1].0], [pair[0].1, pair[1].1]));
    let limbs = LIMBS
        .iter()
        .map(|&(ends, radii)| round_cone(p, ends, radii));
    let body = smooth_union(armored, head, 0.06);
    tail.chain(limbs)
        .fold(body, |all, limb| smooth_union(all, limb, 0.03))
        / SCALE
}

/// The gear: twelve teeth around a disk, with a bore.
///
/// Mirrors at multiples of 15 degrees map every tooth onto half of the one on the x axis.
pub(super) fn gear(p: DVec3) -> f64 {
    /// Cosine and sine of the mirrors at 30 and 15 degrees, after those at 0, 90 and 45 degrees.
    const MIRRORS: [[f64; 2]; 2] = [
        [0.866_025_403_784_438_6, 0.5],
        [0.965_925_826_289_068_3, 0.258_819_045_102_520_74],
    ];
    let from_axis = (p.x * p.x + p.y * p.y).sqrt();
    let (x, y) = (p.x.abs(), p.y.abs());
    let (mut x, mut y) = (x.max(y), x.min(y));
    for [cosine, sine] in MIRRORS {
        let beyond = (y * cosine - x * sine).max(0.0);
        (x, y) = (x + 2.0 * beyond * sine, y - 2.0 * beyond * cosine);
    }
    // The flank is inclined inward by about 16 degrees: 7, 24 and 25 are the sides of a right triangle.
    let flank = 0.28 * (x - 0.44) + 0.96 * (y - 0.056);
    let tooth = smooth_intersection(x - 0.5, flank, 0.02);
    let wheel = smooth_union(from_axis - 0.39, tooth, 0.03);
    let bored = wheel.max(0.15 - from_axis);
    smooth_intersection(bored, p.z.abs() - 0.1, 0.02)
}

/// The shell: a ball with a concentric void.
pub(super) fn shell(p: DVec3) -> f64 {
    (p.length() - 0.425).abs() - 0.075
}

/// The pair: a separate ball and cube.
pub(super) fn pair(p: DVec3) -> f64 {
    let offset = dvec3(0.275, 0.0, 0.0);
    ball(p + offset, 0.225).min(cuboid(p - offset, DVec3::splat(0.225)))
}
