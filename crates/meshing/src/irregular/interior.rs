//! Selection of the Delaunay tets inside a solid such that their surface is a manifold.
//!
//! A tet is inside if its centroid is. Flat tets between surface particles can be on either side. Where the surface
//! touches itself at an edge or a particle, such tets are alternately dropped and added until no such place is left.
//! Cost: O(n log n) per round; there are rarely more than three rounds after the first.

use std::cmp::Reverse;

use glam::DVec3;
use incise_mesh::{ParticleId, Surface, TetId, TetMesh};

use crate::Shape;

/// Distance up to which points are on the surface; they are placed there to 1e-9 m.
const ON_SURFACE: f64 = 1e-7;
/// Distance from the surface, in spacings, up to which the centroids of tets between surface particles count as on
/// either side.
const SHALLOW: f64 = 0.2;
/// Largest number of rounds.
const ROUNDS: usize = 12;

/// Keeps the tets of a Delaunay mesh that lie inside; `None` if the topology of their surface is not that of the shape.
pub(super) fn keep_interior(mut mesh: TetMesh, shape: Shape, spacing: f64) -> Option<TetMesh> {
    let distances: Vec<f64> = (0..mesh.tets.len())
        .map(|t| shape.signed_distance(0.25 * mesh.corners(TetId::new(t)).iter().sum::<DVec3>()))
        .collect();
    let on_surface: Vec<bool> = mesh
        .positions
        .iter()
        .map(|&p| shape.signed_distance(p).abs() < ON_SURFACE)
        .collect();
    // Flat tets on a flat side come from rounding: they are not inside and are never added.
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

/// Marks the particles at which a closed surface touches itself: their triangles do not form one fan.
fn pinched(surface: &Surface, particles: usize) -> Vec<bool> {
    // Around p, corner (p; a, b) of a triangle is followed by corner (p; b, c).
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
        // Two columns that share the edge between them and its three particles.
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
