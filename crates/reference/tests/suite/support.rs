//! What the tests share.

use glam::{DMat3, DVec3};
use incise_mesh::{ParticleId, TetMesh};
use incise_reference::{Material, ReferenceBody};
use proptest::prelude::*;

/// Rubber of a density that keeps numbers plain.
pub(crate) const RUBBER: Material = Material {
    young_modulus: 1e6,
    poisson_ratio: 0.45,
    density: 1000.0,
};

/// A mesh as a body of one material.
pub(crate) fn body(mesh: &TetMesh, material: Material) -> ReferenceBody {
    let tets: Vec<[u32; 4]> = mesh.tets.iter().map(|t| t.map(|ParticleId(p)| p)).collect();
    ReferenceBody::new(&mesh.positions, &tets, |_tet| material).unwrap()
}

/// Fails unless `value` is a number of at most `tolerance`.
#[track_caller]
pub(crate) fn within(what: &str, value: f64, tolerance: f64) {
    assert!(
        value <= tolerance,
        "{what}: {value:e} is more than {tolerance:e}"
    );
}

/// The largest distance between two lists of points.
pub(crate) fn largest_distance(a: &[DVec3], b: &[DVec3]) -> f64 {
    assert_eq!(a.len(), b.len());
    let distances = a.iter().zip(b).map(|(x, y)| x.distance(*y));
    distances.fold(0.0, f64::max)
}

/// Any vector in the cube from -1 to 1.
pub(crate) fn vector() -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-1.0..1.0).prop_map(DVec3::from_array)
}

/// Any matrix with entries up to `size`; half of them are inversions.
pub(crate) fn matrix(size: f64) -> impl Strategy<Value = DMat3> {
    prop::array::uniform3(vector()).prop_map(move |[a, b, c]| DMat3::from_cols(a, b, c) * size)
}

/// Any rotation.
pub(crate) fn rotation() -> impl Strategy<Value = DMat3> {
    (vector(), -3.0..3.0f64)
        .prop_filter("no axis", |(axis, _)| axis.length() > 0.1)
        .prop_map(|(axis, angle)| DMat3::from_axis_angle(axis.normalize(), angle))
}

/// Seeded noise in the cube from -1 to 1 (`SplitMix64`), the same everywhere.
pub(crate) struct Noise(pub(crate) u64);

impl Noise {
    fn scalar(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    pub(crate) fn vector(&mut self) -> DVec3 {
        DVec3::new(self.scalar(), self.scalar(), self.scalar())
    }
}
