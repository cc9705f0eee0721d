//! What the targets of the mesh files have in common: what must hold of whatever a reader accepts.

use incise_mesh::{ParticleId, TriangleSurface};
use incise_mesh_io::{MeshFile, MeshIoError};

/// A mesh must have tets with existing corners, finite coordinates and one value for each element.
///
/// # Panics
/// If it is not so.
pub fn check_mesh(file: Result<MeshFile, MeshIoError>) {
    match file {
        Ok(file) => {
            let mesh = &file.mesh;
            assert!(!mesh.tets.is_empty());
            file.check().expect("one value for each element");
            assert!(mesh.positions.iter().all(|p| p.is_finite()));
            check_corners(mesh.tets.as_flattened(), mesh.positions.len());
        }
        Err(error) => check_error(&error),
    }
}

/// A surface must have triangles with existing corners and finite coordinates.
///
/// # Panics
/// If it is not so.
pub fn check_surface(surface: Result<TriangleSurface, MeshIoError>) {
    match surface {
        Ok(surface) => {
            assert!(!surface.triangles.is_empty());
            assert!(surface.positions.iter().all(|p| p.is_finite()));
            check_corners(surface.triangles.as_flattened(), surface.positions.len());
        }
        Err(error) => check_error(&error),
    }
}

fn check_corners(corners: &[ParticleId], particles: usize) {
    assert!(corners.iter().all(|corner| corner.index() < particles));
}

/// What is wrong is said in a sentence or two, whatever the file has in it.
fn check_error(error: &MeshIoError) {
    let kinds = matches!(
        error,
        MeshIoError::Empty
            | MeshIoError::Parse { .. }
            | MeshIoError::ParseBytes { .. }
            | MeshIoError::ParseContent { .. }
    );
    assert!(kinds, "{error}");
}
