//! [`Solid`]: the inside of a closed triangle surface, asked point by point.
//!
//! What is inside is a matter of the winding number, which is decided exactly (module `winding`), so that points at any
//! distance from the surface, along its edges and in its planes are on the side they should be. It is well defined for
//! every surface in which each directed edge is matched by an opposite one: also for surfaces that cut through
//! themselves, touch themselves or consist of many shells. Module `prepare` brings a surface into that form or says
//! what keeps it from it. Questions go through a tree of boxes (module `tree`).
//!
//! Cost: O(n log n) to build for n triangles, O(log n) a question as a rule.

mod nearest;
mod prepare;
mod tree;
mod winding;

use glam::DVec3;
use incise_mesh::TriangleSurface;

use crate::MeshingError;
use tree::Tree;

pub use prepare::Prepared;

/// The inside of a closed surface: the points with a positive winding number.
///
/// # Example
/// ```
/// use incise_mesh::{TriangleSurface, glam::{DVec3, dvec3}, kuhn_box};
/// use incise_meshing::Solid;
///
/// let mesh = kuhn_box([2, 2, 2], DVec3::ONE);
/// let surface = TriangleSurface { triangles: mesh.surface().triangles, positions: mesh.positions };
/// let cube = Solid::new(&surface)?;
/// let center = cube.low().midpoint(cube.high());
/// assert_eq!(cube.winding_number(center), 1);
/// assert_eq!(cube.winding_number(center + dvec3(2.0, 0.0, 0.0)), 0);
/// assert!((cube.signed_distance(center) + 0.5).abs() < 1e-15);
/// # Ok::<(), incise_meshing::MeshingError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Solid {
    tree: Tree,
    prepared: Prepared,
    volume: f64,
}

impl Solid {
    /// Takes a surface as the boundary of a solid.
    ///
    /// Points at the same place become one, triangles without area by their corners are left out, triangles that face
    /// the other way than their neighbors are turned, and so is the whole if it would enclose a negative volume.
    /// [`prepared`](Self::prepared) tells what was done.
    ///
    /// # Errors
    /// [`MeshingError::Surface`] if a position is not finite or absent, if there is no triangle, or if the surface has
    /// a rim or cannot be oriented: with the first edge where that shows.
    pub fn new(surface: &TriangleSurface) -> Result<Self, MeshingError> {
        let (prepared, triangles) = prepare::prepare(surface)?;
        let volume = volume(&triangles);
        Ok(Self {
            tree: Tree::new(triangles),
            prepared,
            volume,
        })
    }

    /// What had to be repaired in the surface.
    #[must_use]
    pub const fn prepared(&self) -> &Prepared {
        &self.prepared
    }

    /// The number of triangles.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.tree.triangles().len()
    }

    /// The low corner of the smallest box around the surface.
    #[must_use]
    pub fn low(&self) -> DVec3 {
        self.tree.bounds().low
    }

    /// The high corner of the smallest box around the surface.
    #[must_use]
    pub fn high(&self) -> DVec3 {
        self.tree.bounds().high
    }

    /// The enclosed volume in m³, each part as often as the surface winds around it.
    #[must_use]
    pub const fn volume(&self) -> f64 {
        self.volume
    }

    /// How often the surface winds around a point: 1 inside a simple surface, 0 outside. Exact; a point on the surface
    /// counts to one of its sides.
    #[must_use]
    pub fn winding_number(&self, point: DVec3) -> i32 {
        winding::winding_number(&self.tree, point)
    }

    /// The distance of a point to the surface in meters, up to rounding.
    #[must_use]
    pub fn distance(&self, point: DVec3) -> f64 {
        self.distance_within(point, f64::INFINITY)
    }

    /// The distance to the surface, negative inside. The sign is exact.
    #[must_use]
    pub fn signed_distance(&self, point: DVec3) -> f64 {
        self.signed_distance_within(point, f64::INFINITY)
    }

    /// The signed distance where it is at most `reach` in size, and `reach` with its sign elsewhere: much faster than
    /// the distance of far points.
    #[must_use]
    pub fn signed_distance_within(&self, point: DVec3, reach: f64) -> f64 {
        let distance = self.distance_within(point, reach);
        if self.winding_number(point) > 0 {
            -distance
        } else {
            distance
        }
    }

    fn distance_within(&self, point: DVec3, reach: f64) -> f64 {
        nearest::distance_within(&self.tree, point, reach)
    }

    /// The largest distance of points of `surface` to this solid's surface, in meters: of its corners, the middles of
    /// its edges and of its triangles. Half a Hausdorff distance, sampled.
    #[must_use]
    pub fn farthest(&self, surface: &TriangleSurface) -> f64 {
        let mut farthest = 0.0_f64;
        for triangle in &surface.triangles {
            let [a, b, c] = triangle.map(|p| surface.positions[p.index()]);
            let middle = (a + b + c) / 3.0;
            for point in [a, b, c, middle, a.midpoint(b), b.midpoint(c), c.midpoint(a)] {
                // What is nearer than the farthest so far need not be known well.
                let distance = self.distance_within(point, f64::INFINITY);
                farthest = farthest.max(distance);
            }
        }
        farthest
    }
}

/// The volume that triangles enclose, by the divergence theorem, seen from a point nearby.
fn volume(triangles: &[[DVec3; 3]]) -> f64 {
    let origin = triangles.first().map_or(DVec3::ZERO, |t| t[0]);
    let terms = triangles.iter().map(|corners| {
        let [a, b, c] = corners.map(|p| p - origin);
        a.cross(b).dot(c)
    });
    terms.sum::<f64>() / 6.0
}
