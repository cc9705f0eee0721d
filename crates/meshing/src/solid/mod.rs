//! [`Solid`]: the inside of a closed triangle surface, for point queries.
//!
//! A point is inside by its winding number, which is computed exactly (module `winding`), also for points on edges, in
//! the planes of triangles and at any distance. It is defined for every surface in which each directed edge is matched
//! by an opposite one, including surfaces that intersect themselves, touch themselves or consist of many shells. Module
//! `prepare` brings a surface into that form or returns an error. Queries use a tree of boxes (module `tree`).
//!
//! Cost: O(n log n) to build for n triangles; usually O(log n) per query.

mod nearest;
mod prepare;
mod tree;
mod winding;

use glam::DVec3;
use incise_mesh::TriangleSurface;

use crate::MeshingError;
use tree::Tree;

pub use prepare::Prepared;

/// Inside of a closed surface: the points with a positive winding number.
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
    /// Index in the given surface of each triangle that the tree was built from.
    numbers: Vec<u32>,
    prepared: Prepared,
    volume: f64,
    area: f64,
}

impl Solid {
    /// Creates the solid bounded by a surface.
    ///
    /// Coincident points are merged, triangles with repeated corners are dropped, triangles that face the opposite way
    /// to their neighbors are flipped, and all are flipped if they enclose a negative volume.
    /// [`prepared`](Self::prepared) reports the changes.
    ///
    /// # Errors
    /// [`MeshingError::Surface`] if a position is missing or not finite, if there are no triangles, or if the surface
    /// is open or not orientable; the message names the first such edge.
    pub fn new(surface: &TriangleSurface) -> Result<Self, MeshingError> {
        let (prepared, triangles) = prepare::prepare(surface)?;
        let volume = volume(&triangles.corners);
        let areas = triangles.corners.iter();
        let area = areas
            .map(|[a, b, c]| 0.5 * (*b - *a).cross(*c - *a).length())
            .sum();
        Ok(Self {
            tree: Tree::new(&triangles.corners),
            numbers: triangles.numbers,
            prepared,
            volume,
            area,
        })
    }

    /// Repairs that were made to the surface.
    #[must_use]
    pub const fn prepared(&self) -> &Prepared {
        &self.prepared
    }

    /// Number of triangles.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.tree.triangles().len()
    }

    /// Low corner of the bounding box.
    #[must_use]
    pub fn low(&self) -> DVec3 {
        self.tree.bounds().low
    }

    /// High corner of the bounding box.
    #[must_use]
    pub fn high(&self) -> DVec3 {
        self.tree.bounds().high
    }

    /// Enclosed volume in m³; each part counts as often as the surface winds around it.
    #[must_use]
    pub const fn volume(&self) -> f64 {
        self.volume
    }

    /// Area of the surface in m².
    #[must_use]
    pub const fn area(&self) -> f64 {
        self.area
    }

    /// Winding number of the surface around a point: 1 inside a simple surface, 0 outside. Exact; a point on the
    /// surface is assigned to one of its sides.
    #[must_use]
    pub fn winding_number(&self, point: DVec3) -> i32 {
        winding::winding_number(&self.tree, point)
    }

    /// Distance from a point to the surface in meters, up to rounding.
    #[must_use]
    pub fn distance(&self, point: DVec3) -> f64 {
        self.distance_within(point, f64::INFINITY)
    }

    /// Distance to the surface in meters, negative inside. The sign is exact.
    #[must_use]
    pub fn signed_distance(&self, point: DVec3) -> f64 {
        self.signed_distance_within(point, f64::INFINITY)
    }

    /// Signed distance clamped to `reach` in absolute value: much faster than the exact distance of far points.
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

    /// Index of a triangle of the given surface that is nearest to a point. Deterministic; usually O(log n).
    ///
    /// # Example
    /// ```
    /// use incise_mesh::{TriangleSurface, glam::{DVec3, dvec3}, kuhn_box};
    /// use incise_meshing::Solid;
    ///
    /// let surface = TriangleSurface::boundary_of(&kuhn_box([1, 1, 1], DVec3::ONE));
    /// let above = Solid::new(&surface)?.nearest_triangle(dvec3(0.7, 0.4, 3.0));
    /// let corners = surface.triangles[above].map(|p| surface.positions[p.index()]);
    /// assert!(corners.iter().all(|p| p.z == 1.0));
    /// # Ok::<(), incise_meshing::MeshingError>(())
    /// ```
    #[must_use]
    pub fn nearest_triangle(&self, point: DVec3) -> usize {
        let found = nearest::nearest_triangle(&self.tree, point);
        self.numbers[self.tree.number(found)] as usize
    }

    /// Largest distance from points of `surface` to this solid's surface, in meters: a one-sided Hausdorff distance,
    /// sampled at the corners, edge midpoints and centroids of its triangles.
    #[must_use]
    pub fn farthest(&self, surface: &TriangleSurface) -> f64 {
        self.farthest_point(surface).1
    }

    /// The point of `surface` that is farthest from this solid's surface, and its distance in meters, sampled like
    /// [`farthest`](Self::farthest). The origin and 0 for a surface without triangles. Usually O(log n) for a sample.
    ///
    /// # Example
    /// ```
    /// use incise_mesh::{TriangleSurface, glam::{DVec3, dvec3}, kuhn_box};
    /// use incise_meshing::Solid;
    ///
    /// let cube = TriangleSurface::boundary_of(&kuhn_box([1, 1, 1], DVec3::ONE));
    /// let mut other = cube.clone();
    /// other.positions.iter_mut().filter(|p| **p == DVec3::ONE).for_each(|p| p.x = 1.5);
    /// let (point, distance) = Solid::new(&cube)?.farthest_point(&other);
    /// assert_eq!((point, distance), (dvec3(1.5, 1.0, 1.0), 0.5));
    /// # Ok::<(), incise_meshing::MeshingError>(())
    /// ```
    #[must_use]
    pub fn farthest_point(&self, surface: &TriangleSurface) -> (DVec3, f64) {
        let mut farthest = (DVec3::ZERO, 0.0);
        for triangle in &surface.triangles {
            let [a, b, c] = triangle.map(|p| surface.positions[p.index()]);
            let middle = (a + b + c) / 3.0;
            for point in [a, b, c, middle, a.midpoint(b), b.midpoint(c), c.midpoint(a)] {
                let distance = self.distance_within(point, f64::INFINITY);
                if distance > farthest.1 {
                    farthest = (point, distance);
                }
            }
        }
        farthest
    }
}

/// Volume enclosed by triangles, by the divergence theorem, relative to a point nearby.
fn volume(triangles: &[[DVec3; 3]]) -> f64 {
    let origin = triangles.first().map_or(DVec3::ZERO, |t| t[0]);
    let terms = triangles.iter().map(|corners| {
        let [a, b, c] = corners.map(|p| p - origin);
        a.cross(b).dot(c)
    });
    terms.sum::<f64>() / 6.0
}
