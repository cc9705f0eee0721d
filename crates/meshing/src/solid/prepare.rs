//! Repair of a surface so that it has an inside: welded, without degenerate triangles, consistently oriented, closed.
//!
//! A surface has an inside if each directed edge of its triangles is matched by one in the opposite direction.
//! Duplicated points along seams and flipped triangles are common in files and are repaired. An open or non-orientable
//! surface is an error that names the first such edge.
//!
//! Cost: O(n log n).

use glam::DVec3;
use incise_mesh::{DisjointSets, ParticleId, TriangleSurface};

use crate::MeshingError;
use crate::index::index;

/// Repairs of a surface used as the boundary of a solid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Prepared {
    /// Points merged into an earlier coincident one.
    pub welded: usize,
    /// Triangles with fewer than three different corners.
    pub degenerate: usize,
    /// Triangles flipped to face like their neighbors.
    pub turned: usize,
    /// True if all triangles were flipped afterwards because they enclosed a negative volume.
    pub inside_out: bool,
    /// Parts of the surface that share no point; the surface of a cavity counts.
    pub shells: usize,
}

/// Corners of all triangles that are kept, in a consistent orientation that encloses a positive volume.
pub(super) struct Triangles {
    pub(super) corners: Vec<[DVec3; 3]>,
    /// Index of each in the surface.
    pub(super) numbers: Vec<u32>,
}

/// Repairs a surface.
pub(super) fn prepare(surface: &TriangleSurface) -> Result<(Prepared, Triangles), MeshingError> {
    let positions = &surface.positions;
    if let Some(p) = positions.iter().position(|p| !p.is_finite()) {
        return fault(format!(
            "point {p} is at {}, give finite positions",
            positions[p]
        ));
    }
    let mut prepared = Prepared::default();
    let same = weld(positions);
    prepared.welded = (0..same.len()).filter(|&p| same[p] as usize != p).count();
    let mut triangles = Vec::with_capacity(surface.triangles.len());
    let mut numbers = Vec::with_capacity(surface.triangles.len());
    for (t, triangle) in surface.triangles.iter().enumerate() {
        if let Some(p) = triangle.iter().find(|p| p.index() >= positions.len()) {
            let count = positions.len();
            return fault(format!("triangle {t} has point {}, there are {count}", p.0));
        }
        let [a, b, c] = triangle.map(|p| same[p.index()]);
        if a == b || b == c || c == a {
            prepared.degenerate += 1;
        } else {
            triangles.push([a, b, c]);
            numbers.push(t);
        }
    }
    if triangles.is_empty() {
        return fault("there is no triangle with three different corners".to_owned());
    }
    if triangles.len() >= 1 << 31 {
        return fault(format!("{} triangles are more than 2^31", triangles.len()));
    }
    prepared.shells = shells(&triangles, positions.len());
    if first_unmatched(&triangles).is_some() {
        prepared.turned = orient(&mut triangles);
    }
    if let Some([a, b]) = first_unmatched(&triangles) {
        return fault(describe(&triangles, positions, [a, b]));
    }
    let mut corners: Vec<[DVec3; 3]> = triangles
        .iter()
        .map(|t| t.map(|p| positions[p as usize]))
        .collect();
    if super::volume(&corners) < 0.0 {
        prepared.inside_out = true;
        for triangle in &mut corners {
            triangle.swap(1, 2);
        }
    }
    let numbers = numbers.into_iter().map(index).collect();
    Ok((prepared, Triangles { corners, numbers }))
}

fn fault<T>(message: String) -> Result<T, MeshingError> {
    Err(MeshingError::Surface(message))
}

/// First point with equal coordinates, for each point.
fn weld(positions: &[DVec3]) -> Vec<u32> {
    // Zeros of either sign are equal.
    let location = |p: u32| {
        positions[p as usize]
            .to_array()
            .map(|x| (x + 0.0).to_bits())
    };
    let mut order: Vec<u32> = (0..ParticleId::new(positions.len()).0).collect();
    order.sort_unstable_by_key(|&p| (location(p), p));
    let mut same = vec![0; positions.len()];
    for group in order.chunk_by(|&p, &q| location(p) == location(q)) {
        for &p in group {
            same[p as usize] = group[0];
        }
    }
    same
}

/// Number of sets of triangles that share points.
fn shells(triangles: &[[u32; 3]], points: usize) -> usize {
    let mut sets = DisjointSets::new(points);
    for &[a, b, c] in triangles {
        sets.unite(a, b);
        sets.unite(b, c);
    }
    let mut roots: Vec<u32> = triangles.iter().map(|t| sets.root(t[0])).collect();
    roots.sort_unstable();
    roots.dedup();
    roots.len()
}

fn directed_edges([a, b, c]: [u32; 3]) -> [[u32; 2]; 3] {
    [[a, b], [b, c], [c, a]]
}

/// Smallest directed edge without an equal number of opposite ones.
fn first_unmatched(triangles: &[[u32; 3]]) -> Option<[u32; 2]> {
    let mut forward: Vec<_> = triangles.iter().flat_map(|&t| directed_edges(t)).collect();
    let mut backward: Vec<_> = forward.iter().map(|&[a, b]| [b, a]).collect();
    forward.sort_unstable();
    backward.sort_unstable();
    let differ = forward.iter().zip(&backward).find(|(f, b)| f != b);
    differ.map(|(&f, &b)| f.min(b))
}

/// Flips triangles to face like the first of those connected through edges of two triangles; returns their number.
fn orient(triangles: &mut [[u32; 3]]) -> usize {
    // Each edge with its triangle, and whether the triangle traverses it in ascending order.
    let mut sides: Vec<([u32; 2], u32, bool)> = Vec::with_capacity(3 * triangles.len());
    for (t, &triangle) in (0_u32..).zip(triangles.iter()) {
        for [a, b] in directed_edges(triangle) {
            sides.push(([a.min(b), a.max(b)], t, a < b));
        }
    }
    sides.sort_unstable();
    let mut neighbors: Vec<(u32, u32, bool)> = Vec::with_capacity(sides.len());
    for pair in sides.chunk_by(|s, t| s.0 == t.0) {
        if let [(_, s, up), (_, t, also_up)] = *pair {
            // Neighbors that traverse the edge in one direction have opposite orientations.
            neighbors.extend([(s, t, up == also_up), (t, s, up == also_up)]);
        }
    }
    neighbors.sort_unstable();
    let mut turned: Vec<Option<bool>> = vec![None; triangles.len()];
    let mut waiting = Vec::new();
    for first in 0..triangles.len() {
        if turned[first].is_some() {
            continue;
        }
        turned[first] = Some(false);
        waiting.push((first, false));
        while let Some((at, turn)) = waiting.pop() {
            let start = neighbors.partition_point(|n| (n.0 as usize) < at);
            let of_this = neighbors[start..].iter().take_while(|n| n.0 as usize == at);
            for &(_, to, opposite) in of_this {
                let to = to as usize;
                if turned[to].is_none() {
                    turned[to] = Some(turn != opposite);
                    waiting.push((to, turn != opposite));
                }
            }
        }
    }
    let mut count = 0;
    for (triangle, _) in triangles
        .iter_mut()
        .zip(&turned)
        .filter(|t| *t.1 == Some(true))
    {
        triangle.swap(1, 2);
        count += 1;
    }
    count
}

/// Describes the defect at an edge.
fn describe(triangles: &[[u32; 3]], positions: &[DVec3], [a, b]: [u32; 2]) -> String {
    let at_edge: Vec<usize> = (0..triangles.len())
        .filter(|&t| triangles[t].contains(&a) && triangles[t].contains(&b))
        .collect();
    let location = format!(
        "the edge from point {a} at {} to point {b} at {}",
        positions[a as usize], positions[b as usize]
    );
    match at_edge.as_slice() {
        [_] => format!("{location} has one triangle: the surface is open there, close it"),
        [_, _] => {
            format!("{location} joins triangles that face opposite ways: the surface has no inside")
        }
        odd if odd.len() % 2 == 1 => {
            format!(
                "{location} has {} triangles, an odd number: the surface has no inside",
                odd.len()
            )
        }
        many => format!(
            "{location} has {} triangles, not as many in either direction: turn or separate them",
            many.len()
        ),
    }
}
