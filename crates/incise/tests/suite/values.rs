//! Every value outside its range is refused by an error that names its field; none panics.

use incise::scene::{Region, StrokeSpec};
use incise::{Scene, Simulation};

use crate::support::scene;

/// A scene that names everything, with sound values.
pub(crate) fn sound() -> Scene {
    let mut scene = scene(
        r#"
        [world]
        gravity = [0.0, 0.0, -9.81]
        ground = { height = -2.0, friction = 0.5 }
        [[body]]
        shape = { kind = "box", tets = 300 }
        fixed = [
            { half_space = { point = [0, 0, 0.4], normal = [0, 0, 1] } },
            { box = { low = [0, 0, 0], high = [1, 1, 1] } },
            { sphere = { center = [0, 0, 0], radius = 0.1 } },
            { particles = [0] },
        ]
        [[stroke]]
        kind = "plane"
        frame = 0
        point = [0, 0, 0]
        normal = [1, 0, 0]
        [[stroke]]
        kind = "sweep"
        frames = [0, 2]
        blade = [[0, -1, 1], [0.1, 1, 1]]
        path = [[0, 0, 0], [0, 0, -2]]
        "#,
    );
    scene.body[0].young_modulus = 1e4;
    scene
}

/// A number of the scene, and how an error calls it.
type Number = (&'static str, fn(&mut Scene) -> &mut f64);

/// The vectors of a stroke or region, for tests that know which kind it is.
pub(crate) fn plane(scene: &mut Scene) -> (&mut [f64; 3], &mut [f64; 3], &mut f64) {
    match &mut scene.stroke[0] {
        StrokeSpec::Plane {
            point,
            normal,
            snap,
            ..
        } => (point, normal, snap),
        _ => panic!("the first stroke is a plane"),
    }
}

/// The frames, blade, path and snap of a sweep.
type SweepParts<'a> = (
    &'a mut [u64; 2],
    &'a mut Vec<[f64; 3]>,
    &'a mut Vec<[f64; 3]>,
    &'a mut f64,
);

pub(crate) fn sweep(scene: &mut Scene) -> SweepParts<'_> {
    match &mut scene.stroke[1] {
        StrokeSpec::Sweep {
            frames,
            blade,
            path,
            snap,
            solid: None,
            ..
        } => (frames, blade, path, snap),
        _ => panic!("the second stroke is a sweep"),
    }
}

pub(crate) fn region(scene: &mut Scene, vector: usize) -> &mut f64 {
    let [half_space, low_high, sphere, _] = &mut scene.body[0].fixed[..] else {
        panic!("there are four regions")
    };
    match (half_space, low_high, sphere) {
        (
            Region::HalfSpace { point, normal, .. },
            Region::Box { low, high, .. },
            Region::Sphere { center, radius, .. },
        ) => match vector {
            0 => &mut point[1],
            1 => &mut normal[2],
            2 => &mut low[0],
            3 => &mut high[2],
            4 => &mut center[1],
            _ => radius,
        },
        _ => panic!("regions of another kind"),
    }
}

/// Numbers that may be any finite one of sensible size.
const COORDINATES: [Number; 12] = [
    ("world.gravity", |s| {
        &mut s.world.gravity.as_mut().unwrap()[1]
    }),
    ("world.ground.height", |s| {
        &mut s.world.ground.as_mut().unwrap().height
    }),
    ("body[0].position", |s| &mut s.body[0].position[2]),
    ("body[0].fixed[0].half_space.point", |s| region(s, 0)),
    ("body[0].fixed[0].half_space.normal", |s| region(s, 1)),
    ("body[0].fixed[1].box.low", |s| region(s, 2)),
    ("body[0].fixed[1].box.high", |s| region(s, 3)),
    ("body[0].fixed[2].sphere.center", |s| region(s, 4)),
    ("stroke[0].point", |s| &mut plane(s).0[0]),
    ("stroke[0].normal", |s| &mut plane(s).1[0]),
    ("stroke[1].blade", |s| &mut sweep(s).1[1][2]),
    ("stroke[1].path", |s| &mut sweep(s).2[1][0]),
];

/// Numbers that may not be negative.
const SIZES: [Number; 6] = [
    ("world.ground.friction", |s| {
        &mut s.world.ground.as_mut().unwrap().friction
    }),
    ("body[0].poisson_ratio", |s| &mut s.body[0].poisson_ratio),
    ("body[0].damping", |s| &mut s.body[0].damping),
    ("body[0].fixed[2].sphere.radius", |s| region(s, 5)),
    ("stroke[0].snap", |s| plane(s).2),
    ("stroke[1].snap", |s| sweep(s).3),
];

/// Numbers that must be positive.
const POSITIVES: [Number; 6] = [
    ("solver.time_step", |s| &mut s.solver.time_step),
    ("solver.relaxation", |s| &mut s.solver.relaxation),
    ("solver.kappa_limit", |s| &mut s.solver.kappa_limit),
    ("body[0].scale", |s| &mut s.body[0].scale),
    ("body[0].young_modulus", |s| &mut s.body[0].young_modulus),
    ("body[0].density", |s| &mut s.body[0].density),
];

/// Asserts that a scene is refused with the field's name.
pub(crate) fn refused(scene: &Scene, field: &str) {
    match Simulation::new(scene) {
        Ok(_) => panic!("{field} is not refused"),
        Err(error) => {
            let message = error.to_string();
            assert!(
                message.starts_with(field) && !message.contains('\n'),
                "{field}: {message}"
            );
        }
    }
}

fn with((_, number): Number, value: f64) -> Scene {
    let mut scene = sound();
    *number(&mut scene) = value;
    scene
}

#[test]
fn the_sound_scene_is_sound() {
    let mut simulation = Simulation::new(&sound()).unwrap();
    for _ in 0..3 {
        simulation.step().unwrap();
        simulation.check().unwrap();
    }
}

#[test]
fn numbers_outside_their_range_are_refused_by_name() {
    let all = || COORDINATES.into_iter().chain(SIZES).chain(POSITIVES);
    for number in all() {
        refused(&with(number, f64::NAN), number.0);
        refused(&with(number, f64::NEG_INFINITY), number.0);
        if number.0 != "solver.kappa_limit" {
            refused(&with(number, f64::INFINITY), number.0);
        }
    }
    for number in SIZES.into_iter().chain(POSITIVES) {
        for value in [-1e300, -1.0, -f64::MIN_POSITIVE] {
            refused(&with(number, value), number.0);
        }
    }
    for number in POSITIVES {
        refused(&with(number, 0.0), number.0);
        refused(&with(number, -0.0), number.0);
    }
    for value in [0.5, 0.7, 1e300] {
        refused(&with(SIZES[1], value), SIZES[1].0);
    }
    for value in [0.26, 1e9] {
        refused(&with(SIZES[4], value), SIZES[4].0);
        refused(&with(SIZES[5], value), SIZES[5].0);
    }
    refused(&with(POSITIVES[1], 2.1), POSITIVES[1].0);
}

/// Values that pass the type and the sign but belong to no scene: an error, or finite positions all the same.
#[test]
fn absurd_numbers_are_refused_or_survived() {
    let all = COORDINATES.into_iter().chain(SIZES).chain(POSITIVES);
    let mut troubles = Vec::new();
    for number in all {
        for value in [1e300, 1e40, 1e12, 1e-12, 1e-40, 5e-324] {
            for precision in ["f32", "f64"] {
                let mut scene = with(number, value);
                scene.solver.precision = precision_named(precision);
                if let Some(trouble) = trouble(&scene, number.0) {
                    troubles.push(format!(
                        "{} = {value:e} in {precision}: {trouble}",
                        number.0
                    ));
                }
            }
        }
    }
    assert!(troubles.is_empty(), "{}", troubles.join("\n"));
}

/// What is wrong with how a scene with an absurd field is taken.
fn trouble(scene: &Scene, field: &str) -> Option<String> {
    let mut simulation = match Simulation::new(scene) {
        Ok(simulation) => simulation,
        Err(error) => {
            let message = error.to_string();
            return (!message.starts_with(field)).then_some(message);
        }
    };
    for _ in 0..3 {
        if let Err(error) = simulation.step() {
            return Some(error.to_string());
        }
    }
    if !simulation.positions().iter().all(|x| x.is_finite()) {
        return Some("a position is not finite".into());
    }
    simulation.check().err().map(|error| error.to_string())
}

fn precision_named(name: &str) -> incise::scene::Precision {
    scene(&format!("[solver]\nprecision = \"{name}\""))
        .solver
        .precision
}
