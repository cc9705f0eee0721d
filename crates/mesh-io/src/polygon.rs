//! Polygons of surface files as triangles.

use incise_mesh::ParticleId;

/// Adds the triangles of a polygon; points and lines have none.
pub(crate) fn fan(polygon: &[ParticleId], triangles: &mut Vec<[ParticleId; 3]>) {
    if let [first, rest @ ..] = polygon {
        triangles.extend(rest.windows(2).map(|edge| [*first, edge[0], edge[1]]));
    }
}
