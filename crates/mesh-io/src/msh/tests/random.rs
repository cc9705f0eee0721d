//! Written files read back equal, and no bytes make the reader panic.

use glam::DVec3;
use incise_mesh::{ParticleId, TetMesh};
use proptest::prelude::*;

use super::{KINDS, TEXT_1, TEXT_22, TEXT_41, example, parse, written};
use crate::{MeshFile, NamedValues, OwnedValues};

#[test]
fn regions_that_say_little_survive() {
    let mut file = example();
    let tets = file.mesh.tets.len();
    for regions in [
        vec![],
        vec![0; tets],
        vec![1; tets],
        vec![i32::MIN; tets],
        vec![0, 0, 5, 5, 0, i32::MAX],
    ] {
        file.regions = regions;
        for kind in KINDS {
            assert_eq!(parse(written(&file, kind)).unwrap(), file);
        }
    }
}

/// Any double that is a number; one NaN is written as another in a text.
fn value() -> impl Strategy<Value = f64> {
    any::<u64>()
        .prop_map(f64::from_bits)
        .prop_filter("no NaN", |c| !c.is_nan())
}

fn vector() -> impl Strategy<Value = DVec3> {
    [value(), value(), value()].prop_map(DVec3::from)
}

fn fields(count: usize) -> impl Strategy<Value = Vec<NamedValues>> {
    let values = prop_oneof![
        prop::collection::vec(value(), count).prop_map(OwnedValues::Scalars),
        prop::collection::vec(vector(), count).prop_map(OwnedValues::Vectors),
    ];
    let field = ("[^\r\n]{0,12}", values).prop_map(|(name, values)| NamedValues { name, values });
    prop::collection::vec(field, 0..3)
}

fn file() -> impl Strategy<Value = MeshFile> {
    let finite = vector().prop_filter("finite", |p| p.is_finite());
    (prop::collection::vec(finite, 1..20), 1..20_usize).prop_flat_map(|(positions, tets)| {
        let particles = positions.len();
        let corner = (0..particles).prop_map(ParticleId::new);
        let corners = [corner.clone(), corner.clone(), corner.clone(), corner];
        let regions = prop_oneof![
            Just(Vec::new()),
            prop::collection::vec(any::<i32>(), tets),
            prop::collection::vec(-1..3, tets),
        ];
        (
            prop::collection::vec(corners, tets),
            regions,
            fields(particles),
            fields(tets),
        )
            .prop_map(move |(tets, regions, of_particles, of_tets)| MeshFile {
                mesh: TetMesh {
                    positions: positions.clone(),
                    tets,
                },
                regions,
                particles: of_particles,
                tets: of_tets,
            })
    })
}

/// All doubles of a file as bits, for which 0 and -0 differ.
fn bits(file: &MeshFile) -> Vec<u64> {
    let fields = file.particles.iter().chain(&file.tets);
    let values = fields.flat_map(|field| match &field.values {
        OwnedValues::Scalars(values) => values.clone(),
        OwnedValues::Vectors(values) => values.iter().flat_map(|v| v.to_array()).collect(),
    });
    let positions = file.mesh.positions.iter().flat_map(|p| p.to_array());
    positions.chain(values).map(f64::to_bits).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 100, failure_persistence: None, ..Default::default() })]

    #[test]
    fn round_trips_keep_every_bit(file in file()) {
        for kind in KINDS {
            let read = parse(written(&file, kind)).unwrap();
            prop_assert_eq!(bits(&read), bits(&file));
            prop_assert_eq!(&read, &file);
        }
    }

    #[test]
    fn noise_is_no_reason_to_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let full = example();
        let texts = [TEXT_1, TEXT_22, TEXT_41].map(|text| text.as_bytes().to_vec());
        for mut bytes in KINDS.map(|kind| written(&full, kind)).into_iter().chain(texts) {
            for (place, byte) in &changes {
                *place.get_mut(&mut bytes) = *byte;
            }
            if let Some(cut) = cut {
                bytes.truncate(cut.index(bytes.len()));
            }
            if let Ok(file) = parse(&bytes) {
                prop_assert!(file.check().is_ok());
                let particles = file.mesh.positions.len();
                prop_assert!(file.mesh.positions.iter().all(|p| p.is_finite()));
                prop_assert!(file.mesh.tets.iter().flatten().all(|c| c.index() < particles));
            }
        }
    }
}
