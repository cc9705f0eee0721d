//! Cameras: projection and rays agree, for any input.

use std::f64::consts::FRAC_PI_2;

use glam::DVec3;
use incise_render::Camera;
use proptest::prelude::*;

fn point(size: f64) -> impl Strategy<Value = DVec3> {
    (-size..size, -size..size, -size..size).prop_map(DVec3::from)
}

fn camera() -> impl Strategy<Value = Camera> {
    let angles = (-7.0..7.0, -1.55..1.55, 0.2..2.0);
    (point(1e4), 1e-2..1e3, angles).prop_map(|(target, distance, (azimuth, elevation, view))| {
        Camera {
            target,
            distance,
            azimuth,
            elevation,
            field_of_view: view,
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn projected_points_lie_on_the_view_ray(
        camera in camera(),
        pixel in (0.0..800.0, 0.0..600.0),
        depth in 0.1..10.0_f64,
    ) {
        let size = [800.0, 600.0];
        let (origin, direction) = camera.ray([pixel.0, pixel.1], size);
        prop_assert!((direction.length() - 1.0).abs() < 1e-12);
        let along = depth * camera.distance;
        let seen = camera.project(origin + direction * along, size).unwrap();
        // Targets are up to 1e4 away from the origin and distances down to 1e-2, so that rounding (1e-16 of the former)
        // is up to 1e-9 of the latter: a millionth of a pixel.
        prop_assert!((seen.x - pixel.0).abs() < 1e-5 && (seen.y - pixel.1).abs() < 1e-5, "{seen}");
        let forward = direction.dot(camera.forward());
        prop_assert!((seen.z - along * forward).abs() < 1e-7 * along);
        prop_assert!(camera.project(origin - direction * along, size).is_none());
    }

    #[test]
    fn the_whole_box_is_seen(
        low in point(100.0),
        sides in (1e-3..10.0, 1e-3..10.0, 1e-3..10.0),
        turn in (-3.0..3.0, -1.5..1.5),
        aspect in 0.3..2.5,
    ) {
        let high = low + DVec3::from(sides);
        let mut camera = Camera::fit(low, high);
        let size = [480.0 * aspect, 480.0];
        let corners = |camera: &Camera| (0..8).all(|i| {
            let pick = |bit: usize| if i >> bit & 1 == 0 { low } else { high };
            let corner = DVec3::new(pick(0).x, pick(1).y, pick(2).z);
            camera.project(corner, size).is_some_and(|seen| {
                (0.0..size[0]).contains(&seen.x) && (0.0..size[1]).contains(&seen.y)
            })
        });
        prop_assert!(aspect < 1.0 || corners(&camera));
        camera.orbit(turn.0, turn.1);
        camera.fit_distance(low, high, aspect);
        prop_assert!(corners(&camera));
        // Not from the moon: the box takes at least a fifth of the height or the width.
        let narrow = aspect.min(1.0);
        let spread = (high - low).length() / (2.0 * camera.distance * (camera.field_of_view / 2.0).tan() * narrow);
        prop_assert!(spread > 0.2, "{spread}");
    }

    #[test]
    fn camera_stays_valid_under_any_input(
        steps in prop::collection::vec((0..3, -1e3..1e3, -1e3..1e3), 1..40),
    ) {
        let mut camera = Camera::fit(DVec3::ZERO, DVec3::ONE);
        for (kind, a, b) in steps {
            match kind {
                0 => camera.orbit(a, b),
                1 => camera.pan(a * 1e-3, b * 1e-3),
                _ => camera.zoom(a),
            }
            prop_assert!(camera.eye().is_finite() && camera.distance > 0.0);
            prop_assert!(camera.elevation.abs() < FRAC_PI_2);
            let axes = [camera.right(), camera.up(), -camera.forward()];
            let volume = axes[0].cross(axes[1]).dot(axes[2]);
            prop_assert!((volume - 1.0).abs() < 1e-9, "right, up and back are a right-handed frame");
        }
    }
}

#[test]
fn directions_are_as_named() {
    let mut camera = Camera::fit(DVec3::ZERO, DVec3::ONE);
    let before = camera;
    camera.orbit(0.1, 0.0);
    // The eye moves to the right, the picture to the left.
    assert!((camera.eye() - before.eye()).dot(before.right()) > 0.0);
    camera = before;
    camera.orbit(0.0, 0.1);
    assert!(camera.eye().z > before.eye().z);
    camera = before;
    let size = [400.0, 400.0];
    camera.pan(0.25, 0.1);
    let seen = camera.project(before.target, size).unwrap();
    // A quarter of the height to the right and a tenth up.
    assert!(
        (seen.x - 300.0).abs() < 1e-9 && (seen.y - 160.0).abs() < 1e-9,
        "{seen}"
    );
    for nothing in [f64::NAN, f64::INFINITY, -1.0, 0.0] {
        camera = before;
        camera.zoom(nothing);
        assert!(
            camera.distance.is_finite() && camera.distance > 0.0,
            "{nothing}"
        );
    }
    camera.orbit(f64::NAN, f64::INFINITY);
    camera.pan(f64::NAN, 0.0);
    for aspect in [0.0, -1.0, f64::NAN] {
        let before = camera.distance;
        camera.fit_distance(DVec3::ZERO, DVec3::splat(7.0), aspect);
        assert_eq!(camera.distance, before, "{aspect}");
    }
    assert!(camera.eye().is_finite());
}
