//! [`Hit`]: the first triangle on a ray.
//!
//! Every triangle is tried: O(triangles), some ten nanoseconds each, which a click can afford and a hierarchy that follows
//! cuts would not repay. Source: T. Möller and B. Trumbore, "Fast, minimum storage ray/triangle intersection", 1997.

use glam::DVec3;
use incise::cutting::{FaceTag, Skin};
use incise::mesh::{ParticleId, TetId};

/// Where a ray meets a body first.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Hit {
    /// The triangle of the skin.
    pub triangle: usize,
    /// The tet behind it.
    pub tet: TetId,
    /// The particles at its corners.
    pub particles: [ParticleId; 3],
    /// The place in m.
    pub point: DVec3,
    /// From the ray's origin in m, if its direction is of length 1.
    pub distance: f64,
    /// What the triangle is.
    pub tag: FaceTag,
}

/// The first triangle of a skin that a ray meets, from whichever side; of those at the same distance the first.
pub(crate) fn pick(
    skin: &Skin,
    positions: &[DVec3],
    origin: DVec3,
    direction: DVec3,
) -> Option<Hit> {
    let mut first: Option<(usize, f64)> = None;
    for (t, corners) in skin.triangles().iter().enumerate() {
        let at = |v: u32| positions[skin.vertices()[v as usize].particle.index()];
        let Some(distance) = meet(corners.map(at), origin, direction) else {
            continue;
        };
        if first.is_none_or(|(_, nearest)| distance < nearest) {
            first = Some((t, distance));
        }
    }
    first.map(|(triangle, distance)| Hit {
        triangle,
        tet: skin.tet(triangle),
        particles: skin.triangles()[triangle].map(|v| skin.vertices()[v as usize].particle),
        point: origin + direction * distance,
        distance,
        tag: skin.tag(triangle),
    })
}

/// How far along a ray it meets a triangle.
fn meet([a, b, c]: [DVec3; 3], origin: DVec3, direction: DVec3) -> Option<f64> {
    let (ab, ac) = (b - a, c - a);
    let across = direction.cross(ac);
    let determinant = ab.dot(across);
    if determinant == 0.0 {
        return None;
    }
    let from_a = origin - a;
    let u = from_a.dot(across) / determinant;
    if !(0.0..=1.0).contains(&u) {
        return None;
    }
    let around = from_a.cross(ab);
    let v = direction.dot(around) / determinant;
    if v < 0.0 || u + v > 1.0 {
        return None;
    }
    let distance = ac.dot(around) / determinant;
    (distance > 0.0 && distance.is_finite()).then_some(distance)
}
