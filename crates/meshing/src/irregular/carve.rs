//! Which Delaunay tets lie inside a solid, chosen so that their surface is a manifold.
//!
//! A tet is inside when its centroid is. Flat tets between surface particles can lie on either side, and where the
//! choice leaves an edge or a particle at which the surface touches itself, those at hand are dropped or taken in by
//! turns until none is left. Cost: O(n log n) a round; rounds after the first are rarely more than three.

use std::cmp::Reverse;

use glam::DVec3;
use incise_mesh::{ParticleId, Surface, TetId, TetMesh};

use crate::Shape;

/// Points with a smaller distance are on the surface; they are put there to 1e-9 m.
const ON_SURFACE: f64 = 1e-7;
/// Tets between surface particles with centroids no farther from the surface, in spacings, can be on either side.
const SHALLOW: f64 = 0.2;
/// Rounds of dropping and taking in.
const ROUNDS: usize = 12;

/// Keeps the tets of a Delaunay mesh that lie inside; none if their surface is not of the shape's topology.
pub(super) fn carve(mut mesh: TetMesh, shape: Shape, spacing: f64) -> Option<TetMesh> {
    let distances: Vec<f64> = (0..mesh.tets.len())
        .map(|t| shape.signed_distance(0.25 * mesh.corners(TetId::new(t)).iter().sum::<DVec3>()))
        .collect();
    let on_surface: Vec<bool> = mesh
        .positions
        .iter()
        .map(|&p| shape.signed_distance(p).abs() < ON_SURFACE)
        .collect();
    // Rounding errors on a flat side are neither inside nor to be taken in.
    let mut kept: Vec<bool> = distances.iter().map(|&d| d < -ON_SURFACE).collect();
    let all = std::mem::take(&mut mesh.tets);
    for round in 0..ROUNDS {
        let indices: Vec<usize> = (0..all.len()).filter(|&t| kept[t]).collect();
        mesh.tets = indices.iter().map(|&t| all[t]).collect();
        let pieces = mesh.face_pieces();
        if pieces.count > shape.pieces() {
            let sizes = pieces.sizes();
            let mut order: Vec<usize> = (0..sizes.len()).collect();
            order.sort_by_key(|&piece| Reverse(sizes[piece]));
            order.truncate(shape.pieces());
            for (&t, &label) in indices.iter().zip(&pieces.labels) {
                kept[t] &= order.contains(&(label as usize));
            }
            continue;
        }
        let surface = mesh.surface();
        let pinched = pinched(&surface, mesh.positions.len());
        if !pinched.contains(&true) {
            return Some(mesh).filter(|_| {
                surface.is_manifold()
                    && surface.euler_characteristic() == shape.euler_characteristic()
            });
        }
        let take = round % 3 == 2;
        for (t, tet) in all.iter().enumerate() {
            let any = |flags: &[bool]| tet.iter().any(|p| flags[p.index()]);
            let shallow = distances[t].abs() < SHALLOW * spacing
                && (!take || distances[t].abs() > ON_SURFACE)
                && tet.iter().all(|p| on_surface[p.index()]);
            if shallow && any(&pinched) {
                kept[t] = take;
            }
        }
    }
    None
}

/// The particles at which a closed surface touches itself: those with triangles that are not one fan.
fn pinched(surface: &Surface, particles: usize) -> Vec<bool> {
    // A corner (p; a, b) of a triangle is followed around p by the corner (p; b, c).
    let mut corners: Vec<[ParticleId; 3]> = Vec::with_capacity(3 * surface.triangles.len());
    for &[a, b, c] in &surface.triangles {
        corners.extend([[a, b, c], [b, c, a], [c, a, b]]);
    }
    corners.sort_unstable();
    let mut pinched = vec![false; particles];
    for fan in corners.chunk_by(|x, y| x[0] == y[0]) {
        let [particle, first, mut at] = fan[0];
        let mut steps = 1;
        while at != first && steps < fan.len() {
            let Ok(next) = fan.binary_search_by_key(&at, |corner| corner[1]) else {
                break;
            };
            at = fan[next][2];
            steps += 1;
        }
        let twice = fan.windows(2).any(|pair| pair[0][1] == pair[1][1]);
        pinched[particle.index()] = twice || at != first || steps < fan.len();
    }
    pinched
}

#[cfg(test)]
mod tests {
    use super::*;
    use incise_mesh::kuhn_box;

    #[test]
    fn pinches_are_found() {
        let pinches = |mesh: &TetMesh| {
            let flags = pinched(&mesh.surface(), mesh.positions.len());
            flags.iter().filter(|&&flag| flag).count()
        };
        let mut mesh = kuhn_box([2, 2, 1], DVec3::ONE);
        assert_eq!(pinches(&mesh), 0);
        // Two columns that share the edge between them, with its three particles of which it has two.
        let columns: Vec<_> = [0..6, 18..24]
            .into_iter()
            .flatten()
            .map(|t| mesh.tets[t])
            .collect();
        mesh.tets = columns;
        assert_eq!(pinches(&mesh), 2);
        // Two cells of a cube that share a corner.
        let mut mesh = kuhn_box([2, 2, 2], DVec3::ONE);
        let cells: Vec<_> = [0..6, 42..48]
            .into_iter()
            .flatten()
            .map(|t| mesh.tets[t])
            .collect();
        mesh.tets = cells;
        assert_eq!(pinches(&mesh), 1);
    }
}
