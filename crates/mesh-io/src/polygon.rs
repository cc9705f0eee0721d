//! Conversion of polygons in surface files to triangles.

use incise_mesh::ParticleId;

/// Adds the triangles of a polygon; points and lines add none.
pub(crate) fn fan(polygon: &[ParticleId], triangles: &mut Vec<[ParticleId; 3]>) {
    if let [first, rest @ ..] = polygon {
        triangles.extend(rest.windows(2).map(|edge| [*first, edge[0], edge[1]]));
    }
}
