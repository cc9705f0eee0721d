//! Files of meshes for the tests of the formats.

use glam::dvec3;
use incise_mesh::kuhn_box;

use crate::{MeshFile, MeshIoError, NamedValues, OwnedValues};

/// A small mesh with regions and values.
pub(super) fn sample() -> MeshFile {
    let mesh = kuhn_box([1, 1, 1], dvec3(0.1, 0.7, 1.3));
    let named = |name: &str, values| NamedValues {
        name: name.to_owned(),
        values,
    };
    MeshFile {
        regions: vec![1, -2, 3, i32::MIN, i32::MAX, 0],
        particles: vec![
            named("speed", OwnedValues::Vectors(mesh.positions.clone())),
            named("a \"b\" <c> %20", OwnedValues::Scalars(vec![0.25; 8])),
        ],
        tets: vec![named("metadata", OwnedValues::Scalars(vec![-0.0; 6]))],
        mesh,
    }
}

/// Reads all prefixes of a file. A prefix must give an error with a position, or be `accepted` with
/// its length.
#[track_caller]
pub(super) fn cut<T>(
    whole: &[u8],
    read: impl Fn(&[u8]) -> Result<T, MeshIoError>,
    mut accepted: impl FnMut(usize, T) -> bool,
) {
    for length in 0..whole.len() {
        match read(&whole[..length]) {
            Err(MeshIoError::Parse { .. } | MeshIoError::ParseBytes { .. }) => {}
            Err(error) => panic!("{length} of {} bytes: {error}", whole.len()),
            Ok(part) => assert!(
                accepted(length, part),
                "{length} of {} bytes are taken for a file",
                whole.len()
            ),
        }
    }
}
