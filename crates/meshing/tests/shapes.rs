//! Generated shapes are sound, of the right topology, size and number of tets.

use std::f64::consts::PI;

use incise_mesh::glam::DVec3;
use incise_meshing::{Lattice, MeshingError, Shape, generate, stuff};
use proptest::prelude::*;

#[test]
fn counts_topology_and_angles() {
    for shape in Shape::ALL {
        let smallest = shape.smallest_tet_count();
        for tets in [smallest, smallest + 300, smallest + 1_800, 11_000] {
            assert_sound(shape, tets);
        }
    }
}

/// Checks the guarantees of `generate`.
pub(crate) fn assert_sound(shape: Shape, tets: usize) {
    let mesh = generate(shape, tets).expect("the shape has a mesh of every size");
    assert!(
        50 * mesh.tets.len().abs_diff(tets) <= tets,
        "{shape}: {} for {tets}",
        mesh.tets.len()
    );
    mesh.check().expect("the mesh is sound");
    assert_eq!(mesh.pieces().count, shape.pieces());
    assert_eq!(mesh.face_pieces().count, shape.pieces());

    let surface = mesh.surface();
    assert!(surface.is_closed() && surface.is_manifold());
    assert_eq!(surface.euler_characteristic(), shape.euler_characteristic());
    let genus = usize::from(matches!(shape, Shape::Torus | Shape::Gear));
    assert_eq!(surface.genus(), Some(genus), "{shape}");
    let volume = mesh.total_volume();
    // Every term that is added may round the sum by one part in 2^53.
    let rounding = 1e-12 + mesh.tets.len() as f64 * f64::EPSILON;
    assert!((surface.volume(&mesh.positions) / volume - 1.0).abs() < rounding);

    let quality = mesh.quality();
    assert!(
        quality.min_dihedral > 10.7 && quality.max_dihedral < 164.8,
        "{shape} {tets}: {quality:?}"
    );

    let mut used = vec![false; mesh.positions.len()];
    mesh.tets
        .iter()
        .flatten()
        .for_each(|p| used[p.index()] = true);
    assert!(used.into_iter().all(|used| used), "no unused particles");
}

#[test]
fn volumes_approach_the_solids() {
    for (shape, volume) in [
        (Shape::Sphere, PI / 6.0),
        (Shape::Box, 1.0),
        (Shape::Beam, 0.0625),
        (Shape::Torus, 2.0 * PI * PI * 0.35 * 0.15 * 0.15),
        (Shape::Plate, 0.2),
        (Shape::Shell, PI / 6.0 * (1.0 - 0.7 * 0.7 * 0.7)),
        (Shape::Pair, (PI / 6.0 + 1.0) * 0.45 * 0.45 * 0.45),
    ] {
        let mesh = generate(shape, 11_000).unwrap();
        assert!(
            (mesh.total_volume() / volume - 1.0).abs() < 0.03,
            "{shape}: {}",
            mesh.total_volume()
        );
    }
}

#[test]
fn boxes_around_shapes_are_tight_and_a_meter_long() {
    for shape in Shape::ALL {
        let mesh = generate(shape, 50_000).unwrap();
        let low = mesh.positions.iter().copied().reduce(DVec3::min).unwrap();
        let high = mesh.positions.iter().copied().reduce(DVec3::max).unwrap();
        let half = shape.half_extent();
        assert_eq!(half.max_element(), 0.5);
        // The surface is located to 1e-6 of the values at the ends of an edge.
        assert!((high.max(-low) - half).max_element() < 1e-6, "{shape}");
        // The tip of the armadillo's tail and the points of curved parts lose the most.
        assert!(
            (half - high).max(half + low).max_element() < 0.015,
            "{shape}: {low} to {high}"
        );
    }
}

#[test]
fn particles_on_the_surface_lie_on_the_solid() {
    for shape in Shape::ALL {
        let mesh = generate(shape, 5_000).unwrap();
        for p in mesh.surface().triangles.iter().flatten() {
            let distance = shape.signed_distance(mesh.positions[p.index()]);
            assert!(distance.abs() < 1e-5, "{shape}: {distance}");
        }
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| generate(Shape::Armadillo, 5_000).unwrap())
    };
    assert_eq!(with(1), with(3));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn distances_change_no_faster_than_the_place(p in place(), q in place(), near in 0.0..1.0) {
        for q in [q, p + 1e-3 * near * (q - p)] {
            for shape in Shape::ALL {
                let change = shape.signed_distance(p) - shape.signed_distance(q);
                // Both values are rounded a dozen times.
                prop_assert!(change.abs() <= p.distance(q) + 1e-14, "{shape} {p} {q}: {change}");
            }
        }
    }
}

/// Places in and around the shapes.
fn place() -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-0.8..0.8).prop_map(DVec3::from_array)
}

#[test]
fn the_same_call_gives_the_same_bits() {
    let hash = |mesh: incise_mesh::TetMesh| {
        let words = mesh
            .positions
            .iter()
            .flat_map(|p| p.to_array())
            .map(f64::to_bits);
        let words = words.chain(mesh.tets.iter().flatten().map(|p| u64::from(p.0)));
        words.fold(0xcbf2_9ce4_8422_2325_u64, |hash, word| {
            (hash ^ word).wrapping_mul(0x0100_0000_01b3)
        })
    };
    let hashes = Shape::ALL
        .map(|shape| hash(generate(shape, shape.smallest_tet_count().max(1_000)).unwrap()));
    assert_eq!(hashes, GOLDEN);
}

/// Changes only when the generators change: on every platform the numbers are these.
const GOLDEN: [u64; 11] = [
    0xc90b_024a_468b_faf0,
    0x76dc_0a5c_64e3_ea8b,
    0xf001_b4ff_52be_8341,
    0xa85b_c07e_e247_c96e,
    0xdb5b_925f_5986_6f87,
    0x98b6_84f4_0e86_5b9c,
    0xa015_a022_2491_1558,
    0xc4af_1d9e_e6f8_afc4,
    0x1496_6ce4_13c7_391b,
    0xea49_4d26_7b66_8e6c,
    0x5893_e1fb_e049_6f8b,
];

#[test]
fn impossible_requests_are_refused() {
    for tets in [0, 3, 4_000_001] {
        let error = generate(Shape::Torus, tets).unwrap_err();
        assert!(matches!(error, MeshingError::TetCount { .. }));
        assert!(
            error
                .to_string()
                .starts_with(&format!("a torus cannot be made of {tets} tets: ask for "))
        );
    }
    let [low, high] = [-DVec3::ONE, DVec3::ONE];
    assert!(Lattice::covering(low, high, 0.0, DVec3::ZERO).is_err());
    assert!(Lattice::covering(low, high, f64::NAN, DVec3::ZERO).is_err());
    assert!(Lattice::covering(low, high, 1e-300, DVec3::ZERO).is_err());
    assert!(Lattice::covering(high, low, 0.1, DVec3::ZERO).is_err());
    assert!(Lattice::covering(low, DVec3::NAN, 0.1, DVec3::ZERO).is_err());
    assert!(matches!(
        generate(Shape::Shell, 2_999).unwrap_err(),
        MeshingError::TetCount {
            smallest: 3_000,
            ..
        }
    ));
    let lattice = Lattice::covering(low, high, 0.5, DVec3::ZERO).unwrap();
    assert!(stuff(&lattice, |_| f64::NAN).is_err());
    assert!(
        stuff(&lattice, |_| -1.0)
            .unwrap_err()
            .to_string()
            .contains("reaches its rim")
    );
    assert!(stuff(&lattice, |_| 1.0).unwrap().tets.is_empty());
}
