//! [`edge_points`]: the uncut tissue that the edge of a blade with a toughness meets in a frame.
//!
//! At the start of the frame a part of the edge lies in tets: each tet takes an interval of the edge, and the intervals
//! together are the length that resists. Where the edge is still outside, the triangles of the surface before it are met
//! within the frame: the plane of the blade cuts each of them in a segment. Both ends of an interval or a segment become a
//! point of the tet ([`EdgePoint`]) with half of its length: a tet deforms linearly, so these hold it along the whole edge.
//!
//! An edge that lies in a boundary triangle to rounding is outside: at an open cut both sides end there, and what it meets
//! next are triangles that it enters. Those of its own cut are none: it lies between them.
//!
//! A cut can run ahead of its edge by a part of a tet, because particles near the surface are put on it. Such an edge lies
//! between open faces that it has not paid for. While its stroke has opened more area than it has done work, the faces of
//! its own cut that it passes resist too, each side with half of the length.
//!
//! Cost: a pass over tets and boundary triangles in frames with such a blade, 10 operations for most.

use glam::{DMat3, DVec3};
use incise_cutting::{BoundaryTriangle, FaceTag};
use incise_mesh::{ParticleId, TetId};
use incise_xpbd::EdgePoint;

use crate::island::Island;

/// Share of a tet's height within which a point counts as on its face.
const ON_FACE: f64 = 1e-4;

/// How far a triangle of its own cut may lean against the blade, as a cosine.
const LEANING: f64 = 0.3;

/// The edge of a blade at the start of a frame.
struct Edge {
    start: DVec3,
    length: f64,
    along: DVec3,
    front: DVec3,
    normal: DVec3,
    /// How far it moves forward in the frame.
    way: f64,
}

impl Edge {
    fn new(blade: &incise_xpbd::SolidBlade) -> Option<Self> {
        let [[a, b], to] = blade.edge;
        let along = (b - a).try_normalize()?;
        let front = (blade.front - along * along.dot(blade.front)).try_normalize()?;
        let ways = [to[0] - a, to[1] - b].map(|way| way.dot(front));
        Some(Self {
            start: a,
            length: a.distance(b),
            along,
            front,
            normal: along.cross(front),
            way: ways[0].max(ways[1]).max(0.0),
        })
    }

    fn at(&self, along: f64) -> DVec3 {
        self.start + self.along * along
    }

    /// Whether all corners lie on one side of the blade's plane, or beside the edge, or clearly behind it.
    fn misses(&self, corners: &[DVec3]) -> bool {
        let slack = self.slack(corners);
        let all = |off: &dyn Fn(DVec3) -> bool| corners.iter().all(|x| off(*x - self.start));
        all(&|x| x.dot(self.normal) > 0.0)
            || all(&|x| x.dot(self.normal) < 0.0)
            || all(&|x| x.dot(self.along) < 0.0)
            || all(&|x| x.dot(self.along) > self.length)
            || all(&|x| x.dot(self.front) < -slack)
    }

    /// Whether all corners lie clearly before the edge.
    fn is_before(&self, corners: &[DVec3]) -> bool {
        let slack = self.slack(corners);
        let mut corners = corners.iter();
        corners.all(|x| (*x - self.start).dot(self.front) > slack)
    }

    /// Where a plane through the edge cuts a triangle: the start and the end along the edge, and how far it is there from
    /// the edge in the direction `within` of the plane. A corner in the plane counts as above it.
    fn section(
        &self,
        triangle: [DVec3; 3],
        normal: DVec3,
        within: DVec3,
    ) -> Option<(f64, f64, impl Fn(f64) -> f64)> {
        let local = triangle.map(|x| {
            let r = x - self.start;
            [self.along, within, normal].map(|axis| r.dot(axis))
        });
        let ends = [(0, 1), (1, 2), (2, 0)].map(|(i, j)| {
            let (low, high) = (local[i][2], local[j][2]);
            ((low < 0.0) != (high < 0.0)).then(|| {
                let share = low / (low - high);
                [0, 1].map(|k| local[i][k] + share * (local[j][k] - local[i][k]))
            })
        });
        let mut ends = ends.into_iter().flatten();
        let (from, to) = (ends.next()?, ends.next()?);
        let (from, to) = if from[0] < to[0] {
            (from, to)
        } else {
            (to, from)
        };
        let (low, high) = (from[0].max(0.0), to[0].min(self.length));
        let off = move |along: f64| {
            let share = (along - from[0]) / (to[0] - from[0]);
            from[1] + share * (to[1] - from[1])
        };
        (low < high).then_some((low, high, off))
    }

    /// A length above that within which a point counts as on a face.
    fn slack(&self, corners: &[DVec3]) -> f64 {
        10.0 * ON_FACE * corners[0].distance(corners[1])
    }
}

/// The points of uncut tissue at the edge of a blade, in a fixed order. `owes` says that the cut has run ahead of the edge.
pub(crate) fn edge_points(
    island: &Island,
    stroke: u32,
    blade: &incise_xpbd::SolidBlade,
    owes: bool,
) -> Vec<EdgePoint> {
    let Some(edge) = Edge::new(blade) else {
        return Vec::new();
    };
    let mut points = Vec::new();
    let intervals = inside(island, &edge, &mut points);
    for triangle in island.cuttable.boundary() {
        if triangle.tag != FaceTag::Cut(stroke) {
            entered(island, &edge, &triangle, &mut points);
        } else if owes {
            let reach = 0.5 * blade.thickness;
            passed(island, &edge, reach, &intervals, &triangle, &mut points);
        }
    }
    points
}

/// Barycentric coordinates in a tet: those of a point and their change per meter along a direction.
struct Coordinates {
    inverse: DMat3,
    last: DVec3,
}

impl Coordinates {
    /// `None` for a tet that is flat.
    fn new(corners: [DVec3; 4]) -> Option<Self> {
        let [a, b, c, d] = corners;
        let inverse = DMat3::from_cols(a - d, b - d, c - d).inverse();
        inverse.is_finite().then_some(Self { inverse, last: d })
    }

    fn of_point(&self, x: DVec3) -> [f64; 4] {
        let [a, b, c] = (self.inverse * (x - self.last)).to_array();
        [a, b, c, 1.0 - a - b - c]
    }

    fn of_direction(&self, v: DVec3) -> [f64; 4] {
        let [a, b, c] = (self.inverse * v).to_array();
        [a, b, c, -a - b - c]
    }
}

fn corners(island: &Island, tet: TetId) -> ([ParticleId; 4], [DVec3; 4]) {
    let particles = island.cuttable.mesh().tets[tet.index()];
    (particles, particles.map(|p| island.positions[p.index()]))
}

/// Adds the points of the tets that the edge lies in; returns the intervals of the edge that do, ascending.
fn inside(island: &Island, edge: &Edge, points: &mut Vec<EdgePoint>) -> Vec<[f64; 2]> {
    let mut intervals: Vec<(f64, f64, TetId)> = Vec::new();
    for tet in (0..island.cuttable.mesh().tets.len()).map(TetId::new) {
        let (_, x) = corners(island, tet);
        if edge.misses(&x) || edge.is_before(&x) {
            continue;
        }
        let Some(coordinates) = Coordinates::new(x) else {
            continue;
        };
        let (from, slope) = (
            coordinates.of_point(edge.start),
            coordinates.of_direction(edge.along),
        );
        let (mut low, mut high) = (0.0_f64, edge.length);
        for (from, slope) in from.into_iter().zip(slope) {
            // Where from + slope · s is at least -ON_FACE.
            let end = (-ON_FACE - from) / slope;
            if slope > 0.0 {
                low = low.max(end);
            } else if slope < 0.0 {
                high = high.min(end);
            } else if from < -ON_FACE {
                high = f64::NEG_INFINITY;
            }
        }
        if low < high {
            intervals.push((low, high, tet));
        }
    }
    intervals.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
    let mut taken: Vec<[f64; 2]> = Vec::new();
    for (low, high, tet) in intervals {
        let low = taken.last().map_or(low, |&[_, covered]| low.max(covered));
        if low >= high {
            continue;
        }
        let (particles, x) = corners(island, tet);
        let Some(coordinates) = Coordinates::new(x) else {
            continue;
        };
        let middle = coordinates.of_point(edge.at(0.5 * (low + high)));
        let behind = island.cuttable.neighbors(tet);
        let mut faces = middle.iter().zip(behind);
        if faces.any(|(height, behind)| *height < 2.0 * ON_FACE && behind.is_none()) {
            continue;
        }
        taken.push([low, high]);
        for along in [low, high] {
            points.push(EdgePoint {
                particles: particles.map(|p| p.0),
                weights: coordinates.of_point(edge.at(along)),
                along,
                length: 0.5 * (high - low),
            });
        }
    }
    taken
}

/// Adds the points of a boundary triangle that the edge may enter in the frame.
fn entered(island: &Island, edge: &Edge, triangle: &BoundaryTriangle, points: &mut Vec<EdgePoint>) {
    let x = triangle.particles.map(|p| island.positions[p.index()]);
    if edge.misses(&x) {
        return;
    }
    let outward = (x[1] - x[0]).cross(x[2] - x[0]);
    if outward.dot(edge.front) >= 0.0 {
        return;
    }
    let size = (x[1] - x[0]).length().max((x[2] - x[0]).length());
    let Some((low, high, ahead)) = edge.section(x, edge.normal, edge.front) else {
        return;
    };
    let middle = 0.5 * (low + high);
    let (particles, x) = corners(island, triangle.tet);
    let Some(coordinates) = Coordinates::new(x) else {
        return;
    };
    let depth = coordinates.of_point(edge.at(middle))[usize::from(triangle.opposite)];
    if depth >= 2.0 * ON_FACE || ahead(middle) > edge.way + size {
        return;
    }
    for along in [low, high] {
        points.push(EdgePoint {
            particles: particles.map(|p| p.0),
            weights: coordinates.of_point(edge.at(along) + edge.front * ahead(along)),
            along,
            length: 0.5 * (high - low),
        });
    }
}

/// Adds the points of a triangle of the edge's own cut that the edge lies on, beside the intervals in tets.
fn passed(
    island: &Island,
    edge: &Edge,
    reach: f64,
    intervals: &[[f64; 2]],
    triangle: &BoundaryTriangle,
    points: &mut Vec<EdgePoint>,
) {
    let x = triangle.particles.map(|p| island.positions[p.index()]);
    let outward = (x[1] - x[0]).cross(x[2] - x[0]).normalize_or_zero();
    if outward.dot(edge.normal).abs() < LEANING {
        return;
    }
    let Some((low, high, above)) = edge.section(x, edge.front, edge.normal) else {
        return;
    };
    let middle = 0.5 * (low + high);
    let after = intervals.partition_point(|&[_, end]| end <= middle);
    let is_inside = intervals
        .get(after)
        .is_some_and(|&[start, _]| start < middle);
    if is_inside || above(middle).abs() > reach + edge.slack(&x) {
        return;
    }
    let (particles, x) = corners(island, triangle.tet);
    let Some(coordinates) = Coordinates::new(x) else {
        return;
    };
    for along in [low, high] {
        points.push(EdgePoint {
            particles: particles.map(|p| p.0),
            weights: coordinates.of_point(edge.at(along) + edge.normal * above(along)),
            along,
            length: 0.25 * (high - low),
        });
    }
}
