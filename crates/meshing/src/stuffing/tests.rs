//! Tests of angles, faces and samples of stuffing, for functions of all kinds.

use std::sync::atomic::{AtomicUsize, Ordering};

use super::*;
use crate::Shape;

/// Continuous random function: random values, interpolated between the nodes of a unit grid.
fn noise(p: DVec3, seed: u64) -> f64 {
    let hash = |at: [i64; 3]| {
        let mut h = seed;
        for c in at {
            h = (h ^ c.cast_unsigned()).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            h ^= h >> 29;
        }
        (h.wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    let cell = p.floor();
    let t = p - cell;
    #[expect(clippy::cast_possible_truncation, reason = "small integers")]
    let low = cell.to_array().map(|c| c as i64);
    (0..8)
        .map(|corner| {
            let far = [corner & 1, corner >> 1 & 1, corner >> 2];
            let weight: f64 = (0..3)
                .map(|a| if far[a] == 1 { t[a] } else { 1.0 - t[a] })
                .product();
            weight * hash([low[0] + far[0], low[1] + far[1], low[2] + far[2]])
        })
        .sum()
}

#[test]
fn samples_left_out_far_from_the_surface_change_nothing() {
    for shape in Shape::ALL {
        for (spacing, shift) in [(0.03, 0.3), (0.11, 0.8)] {
            let half = shape.half_extent();
            let lattice =
                Lattice::covering(-half, half, spacing, DVec3::splat(shift)).expect("fits");
            let samples = [Slope::Any, Slope::AtMostOne].map(|slope| {
                let count = AtomicUsize::new(0);
                let grid = Grid::new(&lattice, slope, &|p| {
                    count.fetch_add(1, Ordering::Relaxed);
                    shape.signed_distance(p)
                });
                let grid = grid.expect("the box around the shape holds it");
                let mesh = grid.extract(grid.tet_count());
                assert_eq!(mesh.tets.len(), grid.tet_count());
                (count.into_inner(), mesh)
            });
            assert!(samples[0].1 == samples[1].1, "{shape} {spacing}");
            assert!(samples[1].0 < samples[0].0, "{shape} {spacing}");
        }
    }
}

#[test]
fn dihedral_angles_keep_the_bound_for_any_function() {
    for (seed, scale) in [(0, 0.7), (1, 1.0), (2, 1.7), (3, 0.7), (4, 1.0), (5, 1.7)] {
        let region = |p: DVec3| noise(p / scale, seed).max((p.abs() - 9.0).max_element());
        let lattice = Lattice::covering(
            DVec3::splat(-9.0),
            DVec3::splat(9.0),
            1.0,
            DVec3::splat(0.3),
        )
        .expect("fits");
        let mesh = stuff(&lattice, region).expect("is inside");
        mesh.check().expect("stuffing gives sound meshes");
        assert!(mesh.surface().is_closed());
        let quality = mesh.quality();
        assert!(
            quality.min_dihedral > 9.3 && quality.max_dihedral < 161.7,
            "{quality:?}"
        );
    }
}
