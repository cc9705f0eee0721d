//! Contacts alone: what the quick test leaves out is open.

use glam::DVec3;
use proptest::prelude::*;

use super::*;

/// A vector of components of any size up to 1, of which small ones are as likely.
fn vector() -> impl Strategy<Value = DVec3> {
    let component = (-1.0..1.0, 0..8).prop_map(|(x, digits): (f64, i32)| x * 10f64.powi(-digits));
    [component.clone(), component.clone(), component].prop_map(DVec3::from_array)
}

/// Positions as a solver holds them.
fn rounded<R: Float>(x: [DVec3; 4]) -> [R::Vector; 4] {
    x.map(R::from_dvec3)
}

/// Whether the contact does nothing at these positions; asserts that a clear one does not.
fn is_clear<R: Float>(contact: &SurfaceContact, x: [DVec3; 4], previous: [DVec3; 4]) -> bool {
    let surface = Surface::<R>::new(0, contact).expect("a contact");
    let (x, previous) = (rounded::<R>(x), rounded::<R>(previous));
    let is_clear = surface.is_clear(x);
    for kept in [0.0, 0.5, 1.0] {
        let gap = surface.gap(x, previous, R::from_f64(kept));
        let is_open = gap.is_none_or(|gap| gap.is_open());
        assert!(is_open || !is_clear, "{:?}", gap.map(|gap| gap.value));
    }
    is_clear
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// A vertex at any height over any triangle, slivers and heights within rounding included.
    #[test]
    fn clear_faces_are_open(
        corners in [vector(), vector(), vector()],
        foot in [-2.0..2.0, -2.0..2.0],
        height in -1.0..1.0,
        digits in 0..18_i32,
        before in [vector(), vector(), vector(), vector()],
        beyond in prop::option::of(vector()),
        thickness in prop::sample::select(vec![0.0, 0.0, 1e-6, 1e-2]),
        scale in -9..9_i32,
    ) {
        let scale = 10f64.powi(scale);
        let [a, b, c] = corners;
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let vertex = a + (b - a) * foot[0] + (c - a) * foot[1] + normal * (height * 10f64.powi(-digits));
        let x = [vertex, a, b, c].map(|x| x * scale);
        let contact = SurfaceContact::Face(FaceContact {
            particles: [0, 1, 2, 3],
            beyond: beyond.filter(|n| n.length() > 1e-7).map(|n| n.to_array()),
            limit: None,
            thickness: thickness * scale,
        });
        for previous in [x, before.map(|x| x * scale)] {
            is_clear::<f32>(&contact, x, previous);
            is_clear::<f64>(&contact, x, previous);
        }
    }

    /// Two edges at any distance.
    #[test]
    fn clear_edges_are_open(
        ends in [vector(), vector(), vector(), vector()],
        before in [vector(), vector(), vector(), vector()],
        away in -1.0..1.0,
        digits in 0..18_i32,
        direction in vector(),
        thickness in prop::sample::select(vec![0.0, 0.0, 1e-6, 1e-2]),
        scale in -9..9_i32,
    ) {
        let scale = 10f64.powi(scale);
        let normal = direction.normalize_or(DVec3::X);
        let [a, b, c, d] = ends;
        let off = normal * (away * 10f64.powi(-digits));
        let x = [a + off, b + off, c, d].map(|x| x * scale);
        let contact = SurfaceContact::Edges(EdgeContact {
            particles: [0, 1, 2, 3],
            normal,
            thickness: thickness * scale,
        });
        for previous in [x, before.map(|x| x * scale)] {
            is_clear::<f32>(&contact, x, previous);
            is_clear::<f64>(&contact, x, previous);
        }
    }
}

/// What is well apart is clear, what touches is not.
#[test]
fn what_is_apart_is_clear() {
    let (o, e1, e2) = (DVec3::ZERO, DVec3::X, DVec3::Y);
    for scale in [1e-3, 1.0, 1e3] {
        for (height, expected) in [(1e-3, true), (0.0, false), (-1e-3, false), (0.5, true)] {
            let vertex = DVec3::new(0.3, 0.3, height);
            let x = [vertex, o, e1, e2].map(|x| x * scale);
            let face = SurfaceContact::Face(FaceContact {
                particles: [0, 1, 2, 3],
                beyond: None,
                limit: None,
                thickness: 0.0,
            });
            assert_eq!(is_clear::<f32>(&face, x, x), expected, "{height}, {scale}");
            assert_eq!(is_clear::<f64>(&face, x, x), expected, "{height}, {scale}");
            let edges = SurfaceContact::Edges(EdgeContact {
                particles: [0, 1, 2, 3],
                normal: DVec3::Z,
                thickness: 0.0,
            });
            let up = DVec3::Z * height;
            let x = [up - e1, up + e1, -e2, e2].map(|x| x * scale);
            assert_eq!(is_clear::<f32>(&edges, x, x), expected, "{height}, {scale}");
            assert_eq!(is_clear::<f64>(&edges, x, x), expected, "{height}, {scale}");
        }
    }
}
