//! Generated shapes are sound, of the right topology, size and number of tets.

use std::f64::consts::PI;

use incise_mesh::MeshError;
use incise_mesh::generate::{Lattice, Shape, generate, stuff};
use incise_mesh::glam::DVec3;

#[test]
fn counts_topology_and_angles() {
    for shape in Shape::ALL {
        for tets in [shape.smallest_tet_count(), 500, 2_000, 11_000] {
            let mesh = generate(shape, tets).unwrap();
            assert!(
                50 * mesh.tets.len().abs_diff(tets) <= tets,
                "{shape}: {} for {tets}",
                mesh.tets.len()
            );
            mesh.check().unwrap();
            assert_eq!(mesh.pieces().count, 1);
            assert_eq!(mesh.face_pieces().count, 1);

            let surface = mesh.surface();
            assert!(surface.is_closed() && surface.is_manifold());
            assert_eq!(surface.euler_characteristic(), shape.euler_characteristic());
            let volume = mesh.total_volume();
            assert!((surface.volume(&mesh.positions) / volume - 1.0).abs() < 1e-12);

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
    }
}

#[test]
fn volumes_approach_the_solids() {
    for (shape, volume) in [
        (Shape::Sphere, PI / 6.0),
        (Shape::Box, 1.0),
        (Shape::Beam, 0.0625),
        (Shape::Torus, 2.0 * PI * PI * 0.35 * 0.15 * 0.15),
        (Shape::Plate, 0.2),
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
fn longest_side_is_one() {
    for shape in Shape::ALL {
        let mesh = generate(shape, 50_000).unwrap();
        let low = mesh.positions.iter().copied().reduce(DVec3::min).unwrap();
        let high = mesh.positions.iter().copied().reduce(DVec3::max).unwrap();
        assert!(
            ((high - low).max_element() - 1.0).abs() < 0.02,
            "{shape}: {low} to {high}"
        );
        assert!(
            (high + low).abs().max_element() < 0.03,
            "{shape}: {low} to {high}"
        );
    }
}

#[test]
fn particles_on_the_surface_lie_on_the_solid() {
    let mesh = generate(Shape::Liver, 5_000).unwrap();
    for p in mesh.surface().triangles.iter().flatten() {
        assert!(
            Shape::Liver
                .signed_distance(mesh.positions[p.index()])
                .abs()
                < 1e-5
        );
    }
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
    let hashes = Shape::ALL.map(|shape| hash(generate(shape, 1_000).unwrap()));
    assert_eq!(hashes, GOLDEN);
}

/// Changes only when the generators change: on every platform the numbers are these.
const GOLDEN: [u64; 6] = [
    0xc90b_024a_468b_faf0,
    0x76dc_0a5c_64e3_ea8b,
    0xf001_b4ff_52be_8341,
    0xa85b_c07e_e247_c96e,
    0xdb5b_925f_5986_6f87,
    0x98b6_84f4_0e86_5b9c,
];

#[test]
fn impossible_requests_are_refused() {
    for tets in [0, 3, 1_000_001] {
        let error = generate(Shape::Torus, tets).unwrap_err();
        assert!(matches!(error, MeshError::TetCount { .. }));
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
