//! Files of meshes for the tests of the formats.

use glam::{DVec3, dvec3};
use proptest::prelude::*;

use super::{MeshFile, NamedValues, OwnedValues};
use crate::generate::kuhn_box;
use crate::{MeshError, ParticleId, TetMesh};

/// A small mesh with everything.
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

fn number() -> impl Strategy<Value = f64> {
    any::<u64>()
        .prop_map(f64::from_bits)
        .prop_filter("finite", |c| c.is_finite())
}

fn vector() -> impl Strategy<Value = DVec3> {
    [number(), number(), number()].prop_map(DVec3::from)
}

fn fields(count: usize) -> impl Strategy<Value = Vec<NamedValues>> {
    let values = prop_oneof![
        prop::collection::vec(number(), count).prop_map(OwnedValues::Scalars),
        prop::collection::vec(vector(), count).prop_map(OwnedValues::Vectors),
    ];
    let field = ("[ -~äπ]{1,12}", values).prop_map(|(name, values)| NamedValues { name, values });
    prop::collection::vec(field, 0..4)
}

/// Any mesh with any values; numbers are finite, all bit patterns alike.
pub(super) fn mesh_file() -> impl Strategy<Value = MeshFile> {
    (4..12_usize, 1..12_usize).prop_flat_map(|(particles, tets)| {
        let corner = (0..particles).prop_map(ParticleId::new);
        let corners = [corner.clone(), corner.clone(), corner.clone(), corner];
        let regions = prop_oneof![Just(Vec::new()), prop::collection::vec(any::<i32>(), tets),];
        (
            prop::collection::vec(vector(), particles),
            prop::collection::vec(corners, tets),
            regions,
            fields(particles),
            fields(tets),
        )
            .prop_map(|(positions, tets, regions, particles, of_tets)| MeshFile {
                mesh: TetMesh { positions, tets },
                regions,
                particles,
                tets: of_tets,
            })
    })
}

/// Reads all parts of a file that start where it does. A part must be an error that names the place, or is `accepted` with
/// its length.
#[track_caller]
pub(super) fn cut<T>(
    whole: &[u8],
    read: impl Fn(&[u8]) -> Result<T, MeshError>,
    mut accepted: impl FnMut(usize, T) -> bool,
) {
    for length in 0..whole.len() {
        match read(&whole[..length]) {
            Err(MeshError::Parse { .. } | MeshError::ParseBytes { .. }) => {}
            Err(error) => panic!("{length} of {} bytes: {error}", whole.len()),
            Ok(part) => assert!(
                accepted(length, part),
                "{length} of {} bytes are taken for a file",
                whole.len()
            ),
        }
    }
}

/// Equal, and -0 is not 0.
#[track_caller]
pub(super) fn assert_same(read: &MeshFile, expected: &MeshFile) {
    // The debug text of a double is its shortest exact one, with its sign.
    assert_eq!(read, expected);
    assert_eq!(format!("{read:?}"), format!("{expected:?}"));
}
