//! What is refused, and that it is refused before anything has moved.

use glam::DVec3;
use incise_reference::{Material, ReferenceBody, ReferenceError};

use crate::support::RUBBER;

const REST: [DVec3; 5] = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE];

fn two_tets() -> ReferenceBody {
    ReferenceBody::new(&REST, &[[0, 1, 2, 3], [1, 4, 2, 3]], |_tet| RUBBER).unwrap()
}

fn refused(material: Material) -> bool {
    let made = ReferenceBody::new(&REST, &[[0, 1, 2, 3]], |_tet| material);
    matches!(made, Err(ReferenceError::Material { .. }))
}

#[test]
fn materials_have_ranges() {
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(refused(Material {
            young_modulus: bad,
            ..RUBBER
        }));
        assert!(refused(Material {
            density: bad,
            ..RUBBER
        }));
    }
    for bad in [-0.1, 0.5, f64::NAN] {
        assert!(refused(Material {
            poisson_ratio: bad,
            ..RUBBER
        }));
    }
    assert!(!refused(Material {
        poisson_ratio: 0.0,
        ..RUBBER
    }));
    assert!(!refused(Material {
        poisson_ratio: 0.499_999,
        ..RUBBER
    }));
}

#[test]
fn tets_have_particles_and_a_volume() {
    let make = |tets: &[[u32; 4]]| ReferenceBody::new(&REST, tets, |_tet| RUBBER).unwrap_err();
    let missing = ReferenceError::NoParticle {
        tet: 1,
        particle: 5,
        particles: 5,
    };
    assert_eq!(make(&[[0, 1, 2, 3], [0, 1, 2, 5]]), missing);
    let inverted = ReferenceError::Volume {
        tet: 0,
        volume: -1.0 / 6.0,
    };
    assert_eq!(make(&[[0, 2, 1, 3]]), inverted);
    assert_eq!(
        make(&[[0, 1, 1, 3]]),
        ReferenceError::Volume {
            tet: 0,
            volume: 0.0
        }
    );
    let far = [DVec3::NAN, DVec3::X, DVec3::Y, DVec3::Z];
    let made = ReferenceBody::new(&far, &[[0, 1, 2, 3]], |_tet| RUBBER);
    assert_eq!(
        made.unwrap_err(),
        ReferenceError::NotFinite {
            what: "position",
            particle: 0
        }
    );
}

#[test]
fn steps_have_ranges() {
    let mut body = two_tets();
    for bad in [0.0, -0.1, f64::NAN, f64::INFINITY, 1e-200, 1e200] {
        let refused = body.step(bad, DVec3::ZERO).unwrap_err();
        assert!(
            matches!(
                refused,
                ReferenceError::Setting {
                    what: "time_step",
                    ..
                }
            ),
            "{bad}"
        );
    }
    for bad in [DVec3::NAN, DVec3::INFINITY] {
        for refused in [
            body.step(0.1, bad).unwrap_err(),
            body.settle(bad).unwrap_err(),
        ] {
            assert!(matches!(
                refused,
                ReferenceError::Setting {
                    what: "gravity",
                    ..
                }
            ));
        }
    }
    body.velocities[2].y = f64::NAN;
    let refused = body.step(0.1, DVec3::ZERO).unwrap_err();
    assert_eq!(
        refused,
        ReferenceError::NotFinite {
            what: "velocity",
            particle: 2
        }
    );
    body.velocities[2].y = 0.0;
    body.positions[1].z = f64::INFINITY;
    let refused = body.step(0.1, DVec3::ZERO).unwrap_err();
    assert_eq!(
        refused,
        ReferenceError::NotFinite {
            what: "position",
            particle: 1
        }
    );
    body.positions[1].z = 0.0;
    assert_eq!(body.positions, REST);
    assert_eq!(body.velocities, [DVec3::ZERO; 5]);
}

/// Numbers so large that energies overflow.
#[test]
fn states_beyond_double_precision_are_refused() {
    let mut body = two_tets();
    body.positions[4] *= 1e200;
    let before = body.positions.clone();
    assert_eq!(body.step(0.1, DVec3::ZERO), Err(ReferenceError::Range));
    assert_eq!(body.positions, before);
}

#[test]
fn a_body_that_can_drift_or_turn_has_no_equilibrium() {
    let mut body = two_tets();
    let not_held = |body: &mut ReferenceBody| match body.settle(DVec3::ZERO) {
        Err(ReferenceError::NotHeld { particle }) => Some(particle),
        other => {
            assert!(other.is_ok(), "{other:?}");
            None
        }
    };
    assert_eq!(not_held(&mut body), Some(0));
    body.fixed[0] = true;
    assert_eq!(not_held(&mut body), Some(1));
    body.fixed[1] = true;
    assert_eq!(not_held(&mut body), Some(2));
    body.fixed[2] = true;
    assert_eq!(not_held(&mut body), None);
    // A hinge: the third on the line of the other two.
    let rest = [REST[0], REST[1], REST[2], REST[3], DVec3::X * 2.0];
    let mut hinge =
        ReferenceBody::new(&rest, &[[0, 1, 2, 3], [1, 4, 2, 3]], |_tet| RUBBER).unwrap();
    for p in [0, 1, 4] {
        hinge.fixed[p] = true;
    }
    assert_eq!(not_held(&mut hinge), Some(2));
    // Of two pieces the second, until all of it is fixed.
    let rest: Vec<DVec3> = REST[..4]
        .iter()
        .flat_map(|&x| [x, x + DVec3::X * 5.0])
        .collect();
    let mut pieces =
        ReferenceBody::new(&rest, &[[0, 2, 4, 6], [1, 3, 5, 7]], |_tet| RUBBER).unwrap();
    for p in [0, 2, 4] {
        pieces.fixed[p] = true;
    }
    assert_eq!(not_held(&mut pieces), Some(1));
    for p in [1, 3, 5, 7] {
        pieces.fixed[p] = true;
    }
    assert_eq!(not_held(&mut pieces), None);
}

/// A particle of no tet neither moves nor troubles the matrix; a body may consist of such only.
#[test]
fn particles_without_mass_stay() {
    let mut body = ReferenceBody::new(&REST, &[[0, 1, 2, 3]], |_tet| RUBBER).unwrap();
    body.velocities[4] = DVec3::X;
    body.step(0.1, DVec3::NEG_Z).unwrap();
    assert_eq!(body.positions[4], REST[4]);
    assert_eq!(body.masses()[4], 0.0);
    for rest in [&REST[..], &[]] {
        let mut dust = ReferenceBody::new(rest, &[], |_tet| RUBBER).unwrap();
        assert_eq!(dust.step(0.1, DVec3::NEG_Z).unwrap().iterations(), 0);
        assert_eq!(dust.positions, rest);
    }
}

/// Materials by tet: masses and stiffness follow.
#[test]
fn each_tet_has_its_material() {
    let heavy = Material {
        density: 3000.0,
        ..RUBBER
    };
    let body = ReferenceBody::new(&REST, &[[0, 1, 2, 3], [1, 4, 2, 3]], |tet| {
        [RUBBER, heavy][tet]
    })
    .unwrap();
    let (light, heavy) = (1000.0 / 6.0 / 4.0, 3000.0 / 3.0 / 4.0);
    for (mass, expected) in
        body.masses()
            .iter()
            .zip([light, light + heavy, light + heavy, light + heavy, heavy])
    {
        assert!((mass - expected).abs() < 1e-12 * expected);
    }
}

#[test]
#[should_panic(expected = "for each particle")]
fn lists_of_another_length_panic() {
    let mut body = two_tets();
    body.velocities.pop();
    let _ = body.step(0.1, DVec3::ZERO);
}
