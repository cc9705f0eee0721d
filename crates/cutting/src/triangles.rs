//! [`TriangleSurface`] and [`cut_surface`]: a surface of triangles cuts where it stands.
//!
//! An edge is met where a triangle lies between its ends: the ends have different orientations with the triangle, and
//! the edge's line has the same orientation with all three of its sides. Orientations are exact, so triangles with a
//! common side decide alike on which of them is met, and being met on the side itself counts for both: nothing slips
//! through between them. An end on the surface, or next to it by the tolerance, counts as met and moves onto it. What
//! follows is the same as for a moving blade (see the module `stroke`), in one go.
//!
//! Source: orientations by J. R. Shewchuk 1997 (through `incise_mesh::orientation`); the sides of a line by
//! Segura and Feito 2001. A surface may stand anywhere in the body, so all tets are looked at, in parallel. Cost: a few
//! bit operations a tet, O(log m) for each in the box around m triangles, then the cut.

use std::cmp::Ordering;

use glam::DVec3;
use incise_mesh::{Bounds, TetId, TetMesh, orientation};

use crate::blade::{Blade, SAME_SHEET};
use crate::broad_phase::Slabs;
use crate::ccd::{EdgeHit, MovingSegment};
use crate::closest::Closest;
use crate::finite::{require_finite, require_positions};
use crate::motion::Motion;
use crate::parallel;
use crate::stroke::Stroke;
use crate::stroke_registry::StrokeRegistry;
use crate::tree::BoxTree;
use crate::{CutDelta, CutError, CutOptions, CuttableMesh};

/// A triangle is flat if its area is smaller than this fraction of its longest side squared: its normal would be noise.
const FLAT: f64 = 1e-12;

/// How far from a place on an edge its sides are asked, as a fraction of the edge.
const BESIDE: f64 = 1.0 / 64.0;

/// Triangles to cut along: a bounded plane, a strip, any open or closed surface.
///
/// Triangles that share a side get the same orientation where possible. A surface with one side (a Möbius strip) has a
/// seam, where tets may stay connected. Surfaces may intersect themselves; crossings within one tet may leave it uncut
/// there, as with two strokes at the same time.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TriangleSurface {
    points: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    /// Unit length.
    normals: Vec<DVec3>,
    tree: BoxTree,
}

impl TriangleSurface {
    /// Creates a surface from points in m, in the space of the deformed body, and three point indices for each
    /// triangle.
    ///
    /// # Errors
    /// If there is no triangle, a point is not finite or does not exist, or a triangle has no area.
    ///
    /// # Example
    /// ```
    /// use glam::DVec3;
    /// use incise_cutting::TriangleSurface;
    ///
    /// let points = [DVec3::ZERO, DVec3::X, DVec3::Y];
    /// assert!(TriangleSurface::new(&points, &[[0, 1, 2]]).is_ok());
    /// assert!(TriangleSurface::new(&points, &[[0, 1, 1]]).is_err());
    /// ```
    pub fn new(points: &[DVec3], triangles: &[[u32; 3]]) -> Result<Self, CutError> {
        if triangles.is_empty() {
            return Err(CutError::EmptySurface);
        }
        points
            .iter()
            .try_for_each(|&x| require_finite("a point of the surface", x))?;
        let mut normals = Vec::with_capacity(triangles.len());
        for (number, triangle) in triangles.iter().enumerate() {
            if let Some(&point) = triangle.iter().find(|&&p| p as usize >= points.len()) {
                return Err(CutError::TriangleIndex {
                    triangle: number,
                    point,
                    points: points.len(),
                });
            }
            normals.push(unit_normal(number, triangle.map(|p| points[p as usize]))?);
        }
        let mut triangles = triangles.to_vec();
        for i in turned(&triangles) {
            triangles[i].swap(1, 2);
            normals[i] = -normals[i];
        }
        let boxes = triangles
            .iter()
            .map(|t| Bounds::around(t.map(|p| points[p as usize])));
        let tree = BoxTree::new(boxes.collect());
        Ok(Self {
            points: points.to_vec(),
            triangles,
            normals,
            tree,
        })
    }

    /// Creates a parallelogram around `center` that extends by plus and minus `half_u` and `half_v`, all in m.
    ///
    /// # Errors
    /// If a number is not finite or the two directions are parallel.
    pub fn rectangle(center: DVec3, half_u: DVec3, half_v: DVec3) -> Result<Self, CutError> {
        let (low, high) = (half_u + half_v, half_u - half_v);
        let points = [center - low, center + high, center + low, center - high];
        Self::new(&points, &[[0, 1, 2], [0, 2, 3]])
    }

    fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.triangles[triangle].map(|p| self.points[p as usize])
    }

    /// Where a triangle meets the edge from `a` to `b`; ends within `tolerance` of the edge count as on it.
    fn meeting(&self, triangle: usize, [a, b]: [DVec3; 2], tolerance: f64) -> Option<EdgeHit> {
        let [p, q, r] = self.corners(triangle);
        let [at_a, at_b] = [a, b].map(|x| orientation([p, q, r, x]));
        let parameter = if at_a == 0.0 && at_b == 0.0 {
            return None; // in the triangle's plane: the edges across it decide
        } else if (at_a <= 0.0 && at_b >= 0.0) || (at_a >= 0.0 && at_b <= 0.0) {
            at_a / (at_a - at_b)
        } else if at_a.abs() <= tolerance * at_b.abs() {
            0.0
        } else if at_b.abs() <= tolerance * at_a.abs() {
            1.0
        } else {
            return None;
        };
        if !parameter.is_finite() {
            return None;
        }
        let sides = [[p, q], [q, r], [r, p]].map(|[x, y]| orientation([a, b, x, y]));
        let inside = sides.iter().all(|&s| s >= 0.0) || sides.iter().all(|&s| s <= 0.0);
        inside.then_some(EdgeHit {
            time: parameter,
            parameter,
            normal: self.normals[triangle],
            upwards: at_a < at_b,
            sides: [None; 2],
            segment: 0,
        })
    }

    /// The point closest to `x`; `reach` is a guess at its distance.
    fn closest(&self, x: DVec3, reach: f64) -> Option<Closest> {
        let (corners, normal) = (|t| self.corners(t), |t: usize| self.normals[t]);
        Closest::new(&self.tree, corners, normal, x, reach)
    }

    /// A box around the body's part that can be met: along the surface's mean normal, since most cuts are nearly plane.
    fn slabs(&self, positions: &[DVec3], tolerance: f64) -> Slabs {
        let corners = (0..self.triangles.len()).map(|t| self.corners(t));
        let normal: DVec3 = corners.map(|[a, b, c]| (b - a).cross(c - a)).sum();
        let normal = normal.normalize_or(DVec3::Z);
        let (u, v) = normal.any_orthonormal_pair();
        let body = Bounds::around(positions.iter().copied());
        let largest = |x: DVec3| x.abs().max_element();
        let scale = largest(body.low).max(largest(body.high));
        // Ends of edges count within the tolerance, as a fraction of the edge.
        let margin = 4.0 * tolerance * largest(body.high - body.low) + 1e-12 * scale;
        Slabs::around([normal, u, v], &self.points, margin)
    }

    /// The tets that a triangle comes near, ascending.
    fn near(&self, mesh: &TetMesh, positions: &[DVec3], tolerance: f64) -> Vec<TetId> {
        let slabs = self.slabs(positions, tolerance);
        let outside = parallel::map(positions, |x| slabs.outside(*x));
        parallel::filter_map_numbers(mesh.tets.len(), |t| {
            let bits = mesh.tets[t].map(|p| outside[p.index()]);
            if bits[0] & bits[1] & bits[2] & bits[3] != 0 {
                return None;
            }
            let tet = TetId::new(t);
            let corners = mesh.tets[tet.index()].map(|p| positions[p.index()]);
            let bounds = with_margin(Bounds::around(corners), tolerance);
            let size = bounds.high - bounds.low;
            // On one side of the plane by more than rounding and the tolerance.
            let apart = |&triangle: &usize| {
                let (point, normal) = (self.corners(triangle)[0], self.normals[triangle]);
                let distances = corners.map(|x| normal.dot(x - point));
                let scale = (corners[0] - point).abs().max_element() + size.max_element();
                let margin = 2.0 * tolerance * size.max_element() + 1e-12 * scale;
                distances.iter().all(|&d| d > margin) || distances.iter().all(|&d| d < -margin)
            };
            let mut triangles = self.tree.overlapping(bounds);
            triangles.any(|t| !apart(&t)).then_some(tet)
        })
    }
}

/// A surface in its place.
struct StandingBlade<'a> {
    surface: &'a TriangleSurface,
    tolerance: f64,
}

impl Blade for StandingBlade<'_> {
    const IS_SWEPT: bool = false;

    fn first_meeting(
        &self,
        edge: &MovingSegment,
        keep: impl Fn(&EdgeHit) -> bool,
    ) -> Option<(EdgeHit, usize)> {
        let bounds = with_margin(Bounds::around(edge.now), self.tolerance);
        let mut all: Vec<EdgeHit> = self
            .surface
            .tree
            .overlapping(bounds)
            .filter_map(|t| self.surface.meeting(t, edge.now, self.tolerance))
            .collect();
        all.sort_by(|m, n| {
            let by_normal = || m.normal.to_array().partial_cmp(&n.normal.to_array());
            m.time
                .total_cmp(&n.time)
                .then_with(|| m.upwards.cmp(&n.upwards))
                .then_with(|| by_normal().unwrap_or(Ordering::Equal))
        });
        let mut all = self.one_a_place(&all, edge.now);
        let sides = [!all.first()?.upwards, all.last()?.upwards].map(Some);
        all.retain(keep);
        without_returns(&mut all, edge.now, self.tolerance);
        let first = *all.first()?;
        Some((EdgeHit { sides, ..first }, all.len()))
    }

    fn most_meetings(&self) -> usize {
        self.surface.triangles.len()
    }

    fn side(&self, x: DVec3, reach: f64, _: DVec3) -> Option<bool> {
        self.surface.closest(x, reach)?.side()
    }

    fn is_straight(&self) -> bool {
        false
    }

    fn is_beyond(&self, _: DVec3, _: f64) -> bool {
        false
    }

    fn touches(&self, x: DVec3, length: f64) -> Option<DVec3> {
        let reach = self.tolerance * length;
        let closest = self.surface.closest(x, reach)?;
        (closest.offset.length() <= reach).then_some(closest.normal)
    }
}

impl StandingBlade<'_> {
    /// Leaves one meeting at each place: ties are those of triangles that share a side or a corner there. Where they
    /// run different ways, the surface may be crossed or only touched, which its sides before and behind the place say.
    /// `meetings` ascend.
    fn one_a_place(&self, meetings: &[EdgeHit], [a, b]: [DVec3; 2]) -> Vec<EdgeHit> {
        let same = |m: &EdgeHit, n: &EdgeHit| n.parameter - m.parameter <= self.tolerance;
        let places = meetings.chunk_by(same);
        places
            .filter_map(|place| {
                let first = place[0];
                if place.iter().all(|m| m.upwards == first.upwards) {
                    return Some(first);
                }
                let beside = |step: f64| {
                    let at = first.parameter + step;
                    let inside = self.tolerance < at && at < 1.0 - self.tolerance;
                    let side = || self.side(a.lerp(b, at), BESIDE * a.distance(b), DVec3::ZERO);
                    inside.then(side).flatten()
                };
                let upwards = match (beside(-BESIDE), beside(BESIDE)) {
                    (Some(before), Some(behind)) if before == behind => return None,
                    (_, Some(behind)) => behind,
                    (Some(before), None) => !before,
                    (None, None) => first.upwards,
                };
                place.iter().find(|m| m.upwards == upwards).copied()
            })
            .collect()
    }
}

/// Takes out where an edge goes through the surface and soon comes back: what lies between is thinner than a tet, and
/// cutting once would put the far end on the wrong side. `meetings` ascend; those next to an end stay, since they move
/// it onto the surface.
fn without_returns(meetings: &mut Vec<EdgeHit>, [a, b]: [DVec3; 2], tolerance: f64) {
    let inner = |m: &EdgeHit| m.parameter > tolerance && m.parameter < 1.0 - tolerance;
    let mut kept: Vec<EdgeHit> = Vec::with_capacity(meetings.len());
    for &meeting in meetings.iter() {
        let Some(last) = kept.last().filter(|last| inner(last) && inner(&meeting)) else {
            kept.push(meeting);
            continue;
        };
        let between = (b - a) * (meeting.parameter - last.parameter);
        if meeting.upwards == last.upwards {
            // On a common side of two triangles, or with a sheet in between that runs the other way and was taken out.
            if meeting.parameter > last.parameter {
                kept.push(meeting);
            }
        } else if last.normal.dot(between).abs() <= SAME_SHEET * a.distance(b) {
            kept.pop();
        } else {
            kept.push(meeting);
        }
    }
    *meetings = kept;
}

/// Cuts along a surface of triangles.
///
/// # Arguments
/// `positions` are the particles' present positions in m, where the surface is; the mesh at rest is cut at the same
/// fractions of its edges.
///
/// # Returns
/// Returns the changes. Where the surface ends inside the body, the cut ends in the tet before. Surfaces smaller than a
/// tet that meet no edge cut nothing.
///
/// # Errors
/// If the options are not valid or `positions` has another length than the mesh or is not finite; nothing is changed
/// then.
///
/// # Determinism
/// Equal input gives the same bits for any number of threads.
///
/// # Example
/// ```
/// use glam::DVec3;
/// use incise_cutting::{CutOptions, CuttableMesh, TriangleSurface, cut_surface};
/// use incise_mesh::kuhn_box;
///
/// // A slit from above, half as deep as the box.
/// let mut body = CuttableMesh::new(kuhn_box([4, 4, 4], DVec3::ONE))?;
/// let positions = body.mesh().positions.clone();
/// let center = DVec3::new(0.4, 0.5, 1.0);
/// let slit = TriangleSurface::rectangle(center, DVec3::Y, DVec3::Z * 0.5)?;
/// let delta = cut_surface(&mut body, &positions, &slit, &CutOptions::default())?;
/// assert!(!delta.is_empty());
/// assert_eq!(body.mesh().pieces().count, 1);
/// # Ok::<(), incise_cutting::CutError>(())
/// ```
pub fn cut_surface(
    cuttable: &mut CuttableMesh,
    positions: &[DVec3],
    surface: &TriangleSurface,
    options: &CutOptions,
) -> Result<CutDelta, CutError> {
    cut(cuttable, positions, surface, options, None)
}

/// Cuts along a surface of triangles that may continue an earlier stroke. `registry` holds the earlier strokes, and
/// this one is added to it: see [`StrokeRegistry`].
///
/// # Errors
/// The errors of [`cut_surface`].
pub fn cut_surface_joining(
    cuttable: &mut CuttableMesh,
    positions: &[DVec3],
    surface: &TriangleSurface,
    options: &CutOptions,
    registry: &mut StrokeRegistry,
) -> Result<CutDelta, CutError> {
    cut(cuttable, positions, surface, options, Some(registry))
}

fn cut(
    cuttable: &mut CuttableMesh,
    positions: &[DVec3],
    surface: &TriangleSurface,
    options: &CutOptions,
    registry: Option<&mut StrokeRegistry>,
) -> Result<CutDelta, CutError> {
    let _span = tracing::debug_span!("cutting::surface").entered();
    options.check()?;
    require_positions(cuttable.mesh(), positions)?;
    let tolerance = options.tolerance;
    let near = surface.near(cuttable.mesh(), positions, tolerance);
    let mut motion = Motion {
        before: positions.to_vec(),
        now: positions.to_vec(),
    };
    let blade = StandingBlade { surface, tolerance };
    Stroke::new(*options).cut(cuttable, &mut motion, near, &blade, registry)
}

/// The box and twice the tolerance around it.
fn with_margin(bounds: Bounds, tolerance: f64) -> Bounds {
    bounds.widened(2.0 * tolerance * bounds.size().max_element())
}

/// The direction of a triangle, if it has an area.
fn unit_normal(triangle: usize, [a, b, c]: [DVec3; 3]) -> Result<DVec3, CutError> {
    let sides = [b - a, c - b, a - c];
    // Scaled first, so that squares neither under- nor overflow.
    let longest = sides
        .iter()
        .map(|s| s.abs().max_element())
        .fold(0.0, f64::max);
    let flat = |area| CutError::FlatTriangle { triangle, area };
    if longest < f64::MIN_POSITIVE {
        return Err(flat(0.0));
    }
    let double = (sides[0] / longest).cross(-sides[2] / longest);
    let area = 0.5 * double.length();
    // Not `<=`: what is not a number is refused as well.
    if area > FLAT {
        Ok(double.normalize())
    } else {
        Err(flat(area * longest * longest))
    }
}

/// The triangles to turn around so that neighbors across a side run the same way where possible: each part of the
/// surface follows its first triangle. Sides of three and more triangles pass nothing on.
fn turned(triangles: &[[u32; 3]]) -> Vec<usize> {
    let mut sides: Vec<([u32; 2], usize, bool)> = Vec::with_capacity(3 * triangles.len());
    for (i, &[a, b, c]) in triangles.iter().enumerate() {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            sides.push(([from.min(to), from.max(to)], i, from < to));
        }
    }
    sides.sort_unstable();
    // Neighbors of each triangle and whether they run the other way, three places a triangle.
    let mut neighbors: Vec<[Option<(usize, bool)>; 3]> = vec![[None; 3]; triangles.len()];
    for shared in sides.chunk_by(|a, b| a.0 == b.0) {
        let [(_, i, up), (_, j, other_up)] = *shared else {
            continue;
        };
        for (one, other) in [(i, j), (j, i)] {
            if let Some(place) = neighbors[one].iter_mut().find(|place| place.is_none()) {
                *place = Some((other, up == other_up));
            }
        }
    }
    let mut turn: Vec<Option<bool>> = vec![None; triangles.len()];
    let mut queue = Vec::new();
    for start in 0..triangles.len() {
        if turn[start].is_some() {
            continue;
        }
        turn[start] = Some(false);
        queue.push((start, false));
        while let Some((i, this)) = queue.pop() {
            for (j, against) in neighbors[i].into_iter().flatten() {
                if turn[j].is_none() {
                    turn[j] = Some(this != against);
                    queue.push((j, this != against));
                }
            }
        }
    }
    (0..triangles.len())
        .filter(|&i| turn[i] == Some(true))
        .collect()
}
