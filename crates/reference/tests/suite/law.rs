//! Energy, stress and stiffness of a material point; the clamp of eigenvalues.

use glam::DMat3;
use incise_reference::{Material, Matrix9, StableNeoHookean, clamp_eigenvalues};
use proptest::prelude::*;

use crate::support::{RUBBER, matrix, rotation, within};

fn law() -> impl Strategy<Value = StableNeoHookean> {
    (1e2..1e9f64, 0.0..0.4999f64).prop_map(|(young_modulus, poisson_ratio)| {
        Material {
            young_modulus,
            poisson_ratio,
            ..RUBBER
        }
        .law()
    })
}

/// F with one entry moved.
fn moved(f: DMat3, i: usize, by: f64) -> DMat3 {
    let mut entries = f.to_cols_array();
    entries[i] += by;
    DMat3::from_cols_array(&entries)
}

proptest! {
    /// Energy is a cubic in each entry times itself, so central differences of step h are off by h² l at most; rounding
    /// leaves 1e-16 l / h. At h = 1e-5 both are below 1e-9 l times powers of |F| < 6.
    #[test]
    fn stress_is_the_slope_of_energy(law in law(), f in matrix(2.0)) {
        let stress = law.stress(f).to_cols_array();
        for (i, stress) in stress.into_iter().enumerate() {
            let step = 1e-5;
            let [low, high] = [-step, step].map(|s| law.energy_density(moved(f, i, s)));
            let error = ((high - low) / (2.0 * step) - stress).abs();
            prop_assert!(error < 1e-7 * law.l, "entry {i}: {error:e} of {stress:e}");
        }
    }

    /// The errors of central differences of the stress are bounded like those of the energy above.
    #[test]
    fn stiffness_is_the_slope_of_stress(law in law(), f in matrix(2.0)) {
        let stiffness = law.stiffness(f);
        for (i, row) in stiffness.iter().enumerate() {
            let step = 1e-5;
            let [low, high] = [-step, step].map(|s| law.stress(moved(f, i, s)).to_cols_array());
            for j in 0..9 {
                let error = ((high[j] - low[j]) / (2.0 * step) - row[j]).abs();
                prop_assert!(error < 1e-7 * law.l, "entry {i} {j}: {error:e}");
                prop_assert_eq!(row[j], stiffness[j][i]);
            }
        }
    }

    /// Rotating a body, before or after it is deformed, changes no energy. Rounding of terms up to l |F|⁶ / 2.
    #[test]
    fn energy_sees_no_rotation(law in law(), f in matrix(2.0), r in rotation()) {
        let energy = law.energy_density(f);
        let size = law.l * (1.0 + f.to_cols_array().iter().map(|v| v * v).sum::<f64>()).powi(3);
        prop_assert!((law.energy_density(r * f) - energy).abs() < 1e-14 * size);
        prop_assert!((law.energy_density(f * r) - energy).abs() < 1e-14 * size);
        let turned = r * law.stress(f) - law.stress(r * f);
        prop_assert!(turned.to_cols_array().into_iter().all(|v| v.abs() < 1e-14 * size));
    }

    /// Rest is the lowest state, up to rounding, and free of stress however it is turned.
    #[test]
    fn rest_is_the_minimum(law in law(), f in matrix(2.0), r in rotation()) {
        prop_assert!(law.energy_density(f) >= 0.0);
        prop_assert!(law.energy_density(r).abs() < 1e-14 * law.l);
        prop_assert!(law.stress(r).to_cols_array().into_iter().all(|v| v.abs() < 1e-14 * law.l));
    }

    /// A matrix made of known eigenvalues and eigenvectors (two random reflections of the axes).
    #[test]
    fn clamping_raises_eigenvalues_and_nothing_else(
        values in prop::array::uniform9(-1.0..1.0f64),
        mirrors in prop::array::uniform2(prop::array::uniform9(-1.0..1.0f64)),
        floor in 0.001..0.5f64,
    ) {
        let made_of = |values: [f64; 9]| -> Matrix9 {
            let mut h: Matrix9 = std::array::from_fn(|i| {
                std::array::from_fn(|j| if i == j { values[i] } else { 0.0 })
            });
            for mirror in mirrors {
                let square: f64 = mirror.iter().map(|v| v * v).sum();
                let reflect: Matrix9 = std::array::from_fn(|i| {
                    std::array::from_fn(|j| f64::from(i == j) - 2.0 * mirror[i] * mirror[j] / square)
                });
                h = product(&product(&reflect, &h), &reflect);
            }
            h
        };
        let mut clamped = made_of(values);
        let changed = clamp_eigenvalues(&mut clamped, floor);
        prop_assert_eq!(changed, values.into_iter().any(|v| v < floor));
        let expected = made_of(values.map(|v| v.max(floor)));
        for i in 0..9 {
            for j in 0..9 {
                // Entries of order one.
                prop_assert!((clamped[i][j] - expected[i][j]).abs() < 1e-13);
            }
        }
    }
}

fn product(a: &Matrix9, b: &Matrix9) -> Matrix9 {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..9).map(|k| a[i][k] * b[k][j]).sum()))
}

/// Double eigenvalues, zeros, and a stiffness as it really occurs: mirrored, at a point, flat.
#[test]
fn clamping_handles_the_degenerate() {
    let law = RUBBER.law();
    let diagonal = |x, y, z| DMat3::from_diagonal(glam::DVec3::new(x, y, z));
    for f in [
        diagonal(1.0, 1.0, -1.0),
        diagonal(1.0, 1.0, 0.0),
        diagonal(1.0, 0.0, 0.0),
        diagonal(-1.0, -1.0, -1.0),
        DMat3::ZERO,
    ] {
        let mut h = law.stiffness(f);
        let floor = 1e-3 * law.mu;
        clamp_eigenvalues(&mut h, floor);
        // What is left to raise is rounding of eigenvalues of the size of l.
        assert!(!clamp_eigenvalues(&mut h, floor - 1e-13 * law.l), "{f}");
    }
}

/// Young's modulus and Poisson's ratio are recovered: a small uniaxial stretch that leaves the sides free of stress has
/// the stress E times the strain, and contracts by ν times it. Second-order terms are of the size of the strain.
#[test]
fn small_stretches_follow_the_engineering_constants() {
    for nu in [0.0, 0.25, 0.3, 0.45, 0.49, 0.4999] {
        let law = Material {
            poisson_ratio: nu,
            ..RUBBER
        }
        .law();
        let strain = 1e-7;
        let side = 1.0 - nu * strain;
        let stress = law.stress(DMat3::from_diagonal(glam::DVec3::new(
            1.0 + strain,
            side,
            side,
        )));
        let expected = RUBBER.young_modulus * strain;
        // Second order is amplified by l / E, up to 1700; so is rounding, over the strain.
        let tolerance = 1e-4_f64.max(20.0 * strain * law.l / RUBBER.young_modulus);
        within("axial", (stress.x_axis.x / expected - 1.0).abs(), tolerance);
        within("lateral", (stress.y_axis.y / expected).abs(), tolerance);
    }
}
