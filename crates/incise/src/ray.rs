//! [`RayHit`]: the first intersection of a ray with the skin of the bodies.
//!
//! Every boundary triangle is tested: O(triangles), some ten nanoseconds each. Rays are rare, so a hierarchy with
//! updates after cuts would not pay off. Source: T. Möller and B. Trumbore, "Fast, minimum storage ray/triangle
//! intersection", 1997.

use glam::DVec3;
use incise_cutting::{BoundaryTriangle, FaceTag};
use incise_mesh::{ParticleId, TetId};

/// First intersection of a ray with a body: see [`Simulation::ray_cast`](crate::Simulation::ray_cast).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct RayHit {
    /// The tet behind the triangle.
    pub tet: TetId,
    /// The particles at its corners, counterclockwise seen from outside.
    pub particles: [ParticleId; 3],
    /// Position of the intersection in m.
    pub point: DVec3,
    /// Distance from the ray's origin in lengths of its direction.
    pub distance: f64,
    /// The normal of the triangle, of unit length, pointing out of the body.
    pub normal: DVec3,
    /// Kind of the triangle: outer surface or the stroke that opened it.
    pub tag: FaceTag,
}

impl RayHit {
    /// Finds the first of some boundary triangles that a ray meets, from either side; of several at one distance the first
    /// in the list. The direction may have any length but 0. O(triangles).
    ///
    /// [`Simulation::ray_cast`](crate::Simulation::ray_cast) does this for the present state of a simulation, this
    /// function for a copy of its boundary and positions: a window can pick while the simulation steps on another thread.
    ///
    /// # Panics
    /// If a particle of a triangle has no position.
    ///
    /// # Example
    /// ```
    /// use incise::mesh::glam::DVec3;
    /// use incise::{RayHit, Scene, Simulation};
    ///
    /// let scene = Scene::from_toml("[[body]]\nshape = { kind = \"box\", tets = 200 }")?;
    /// let mut simulation = Simulation::new(&scene)?;
    /// let boundary: Vec<_> = simulation.boundary().collect();
    /// let positions = simulation.positions().to_vec();
    /// let (origin, direction) = (DVec3::new(0.1, 0.05, 5.0), DVec3::NEG_Z);
    /// let before = simulation.ray_cast(origin, direction);
    /// simulation.step()?;
    /// assert_eq!(RayHit::first(boundary, &positions, origin, direction), before);
    /// # Ok::<(), incise::Error>(())
    /// ```
    #[must_use]
    pub fn first(
        triangles: impl IntoIterator<Item = BoundaryTriangle>,
        positions: &[DVec3],
        origin: DVec3,
        direction: DVec3,
    ) -> Option<Self> {
        let mut first: Option<(BoundaryTriangle, f64)> = None;
        for triangle in triangles {
            let corners = triangle.particles.map(|p| positions[p.index()]);
            let Some(distance) = meet(corners, origin, direction) else {
                continue;
            };
            if first.is_none_or(|(_, nearest)| distance < nearest) {
                first = Some((triangle, distance));
            }
        }
        first.map(|(triangle, distance)| {
            let [a, b, c] = triangle.particles.map(|p| positions[p.index()]);
            Self {
                tet: triangle.tet,
                particles: triangle.particles,
                point: origin + direction * distance,
                distance,
                normal: (b - a).cross(c - a).normalize_or_zero(),
                tag: triangle.tag,
            }
        })
    }
}

/// Distance along a ray to a triangle, in lengths of its direction; `None` if it misses.
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
