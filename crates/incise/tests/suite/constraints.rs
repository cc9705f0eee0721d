//! Colliders, handles, links and volumes: scenes that name them do what they say, and refuse mistakes by name.

use incise::mesh::glam::{DVec3, dvec3};
use incise::scene::{ColliderSpec, EndSpec, Precision, Region};
use incise::{Scene, Simulation};

use crate::support::{body, plane, scene, simulation, state};
use crate::values::refused;

const GRAVITY: &str = "[world]\ngravity = [0.0, 0.0, -9.81]\n";

/// A scene that names every kind, with sound values.
fn everything() -> Scene {
    scene(&format!(
        r#"{GRAVITY}{}volume_compliance = 1e-5
        {}
        [[collider]]
        kind = "plane"
        point = [0, 0, -3]
        normal = [0, 0, 2]
        friction = 0.5
        [[collider]]
        kind = "sphere"
        center = [0, 0, -1]
        radius = 0.25
        velocity = [0, 0.1, 0]
        [[collider]]
        kind = "capsule"
        ends = [[-1, 0, -2], [1, 0, -2]]
        radius = 0.25
        [[collider]]
        kind = "box"
        center = [2, 0, -1]
        half_extents = [0.5, 0.5, 0.1]
        rotation = {{ axis = [0, 1, 0], angle_degrees = 20 }}
        [[attachment]]
        body = 1
        regions = [{{ half_space = {{ point = [2, 0, 0.3], normal = [0, 0, 1] }} }}]
        frames = [1, 4]
        path = [[0, 0, 0], [0, 0.1, 0], [0, 0.1, 0.1]]
        rotation = {{ axis = [0, 0, 1], angle_degrees = 30, center = [2, 0, 0] }}
        [[distance]]
        from = {{ body = 0, point = [0.5, 0, 0] }}
        to = {{ body = 1, point = [1.5, 0, 0] }}
        compliance = 1e-4
        tension_only = true
        [[distance]]
        from = {{ body = 0, point = [0, 0.5, 0.5] }}
        to = {{ body = 0, point = [0, 0.5, -0.5] }}
        length = 0.9
        {}"#,
        body("box", 400, [0.0, 0.0, 0.0]),
        body("sphere", 300, [2.0, 0.0, 0.0]),
        plane(2, [0.03, 0.0, 0.0], [1.0, 0.2, 0.0]),
    ))
}

#[test]
fn a_scene_of_everything_survives_a_round_trip_and_runs() {
    let mut scene = everything();
    assert_eq!(Scene::from_toml(&scene.to_toml().unwrap()).unwrap(), scene);
    assert_eq!(scene.frames_needed(), 5);
    for precision in [Precision::F32, Precision::F64] {
        for iterations in [1, 2] {
            (scene.solver.precision, scene.solver.iterations) = (precision, iterations);
            let [mut one, mut three] =
                [1, 3].map(|threads| Simulation::with_threads(&scene, threads).unwrap());
            for _ in 0..8 {
                one.step().unwrap();
                one.check().unwrap();
                three.step().unwrap();
                assert!(state(&one) == state(&three));
            }
            assert!(one.report().pieces > 2 && one.report().repaired == 0);
        }
    }
}

/// A mistake in a sound scene, and the field that an error names.
type Mistake = (&'static str, fn(&mut Scene));

fn sphere(scene: &mut Scene) -> (&mut [f64; 3], &mut f64, &mut f64, &mut [f64; 3]) {
    let ColliderSpec::Sphere {
        center,
        radius,
        friction,
        velocity,
        ..
    } = &mut scene.collider[1]
    else {
        panic!("the second collider is a sphere");
    };
    (center, radius, friction, velocity)
}

const MISTAKES: [Mistake; 35] = [
    ("collider[0].point", |s| {
        if let ColliderSpec::Plane { point, .. } = &mut s.collider[0] {
            point[1] = f64::NAN;
        }
    }),
    ("collider[0].normal", |s| {
        if let ColliderSpec::Plane { normal, .. } = &mut s.collider[0] {
            *normal = [0.0; 3];
        }
    }),
    ("collider[1].center", |s| sphere(s).0[0] = f64::INFINITY),
    ("collider[1].radius", |s| *sphere(s).1 = 0.0),
    ("collider[1].radius", |s| *sphere(s).1 = -1.0),
    ("collider[1].radius", |s| *sphere(s).1 = f64::NAN),
    ("collider[1].friction", |s| *sphere(s).2 = -0.1),
    ("collider[1].velocity", |s| sphere(s).3[2] = f64::NAN),
    ("collider[2].ends", |s| {
        if let ColliderSpec::Capsule { ends, .. } = &mut s.collider[2] {
            ends[1][0] = 1e300;
        }
    }),
    ("collider[2].radius", |s| {
        if let ColliderSpec::Capsule { radius, .. } = &mut s.collider[2] {
            *radius = 0.0;
        }
    }),
    ("collider[3].half_extents", |s| {
        if let ColliderSpec::Box { half_extents, .. } = &mut s.collider[3] {
            half_extents[2] = 0.0;
        }
    }),
    ("collider[3].rotation.axis", |s| {
        if let ColliderSpec::Box { rotation, .. } = &mut s.collider[3] {
            rotation.as_mut().unwrap().axis = [0.0; 3];
        }
    }),
    ("collider[3].rotation.angle_degrees", |s| {
        if let ColliderSpec::Box { rotation, .. } = &mut s.collider[3] {
            rotation.as_mut().unwrap().angle_degrees = f64::NAN;
        }
    }),
    ("attachment[0].body", |s| s.attachment[0].body = 2),
    ("attachment[0].regions[0].half_space.normal", |s| {
        if let Region::HalfSpace { normal, .. } = &mut s.attachment[0].regions[0] {
            *normal = [0.0; 3];
        }
    }),
    ("attachment[0].regions[1].particles", |s| {
        s.attachment[0]
            .regions
            .push(Region::Particles(vec![1_000_000]));
    }),
    ("attachment[0].frames", |s| s.attachment[0].frames = [3, 3]),
    ("attachment[0].path", |s| s.attachment[0].path.truncate(1)),
    ("attachment[0].path", |s| {
        s.attachment[0].path[1][2] = f64::NAN;
    }),
    ("attachment[0].rotation.axis", |s| {
        s.attachment[0].rotation.as_mut().unwrap().axis = [0.0; 3];
    }),
    ("attachment[0].rotation.angle_degrees", |s| {
        s.attachment[0].rotation.as_mut().unwrap().angle_degrees = 540.0;
    }),
    ("attachment[0].rotation.angle_degrees", |s| {
        s.attachment[0].rotation.as_mut().unwrap().angle_degrees = f64::INFINITY;
    }),
    ("attachment[0].rotation.center", |s| {
        s.attachment[0].rotation.as_mut().unwrap().center[0] = f64::NAN;
    }),
    ("attachment[0].compliance", |s| {
        s.attachment[0].compliance = -1.0;
    }),
    ("attachment[1].regions", |s| {
        s.attachment.push(s.attachment[0].clone());
    }),
    ("distance[0].from.body", |s| s.distance[0].from.body = 2),
    ("distance[0].to.body", |s| {
        s.distance[0].to.body = usize::MAX;
    }),
    ("distance[0].from.point", |s| {
        s.distance[0].from.point[0] = f64::NAN;
    }),
    ("distance[0].to.point", |s| {
        s.distance[0].to = s.distance[0].from;
    }),
    ("distance[1].length", |s| s.distance[1].length = Some(-1.0)),
    ("distance[1].length", |s| {
        s.distance[1].length = Some(f64::NAN);
    }),
    ("distance[0].compliance", |s| {
        s.distance[0].compliance = -1e-9;
    }),
    ("distance[0].compliance", |s| {
        s.distance[0].compliance = f64::INFINITY;
    }),
    ("body[0].volume_compliance", |s| {
        s.body[0].volume_compliance = Some(-1.0);
    }),
    ("body[0].volume_compliance", |s| {
        s.body[0].volume_compliance = Some(f64::NAN);
    }),
];

#[test]
fn mistakes_are_refused_by_name() {
    for (field, mistake) in MISTAKES {
        let mut scene = everything();
        mistake(&mut scene);
        refused(&scene, field);
    }
}

#[test]
fn unknown_keys_name_the_nearest() {
    for (text, known) in [
        ("[[collider]]\nkind = \"spere\"", "sphere"),
        (
            "[[collider]]\nkind = \"box\"\ncenter = [0, 0, 0]\nhalf_extnts = [1, 1, 1]",
            "half_extents",
        ),
        ("[[attachment]]\nregion = []", "regions"),
        ("[[distance]]\nform = 1", "from"),
        ("[[body]]\nvolume_complience = 1", "volume_compliance"),
        ("[[colider]]", "collider"),
    ] {
        let message = Scene::from_toml(text).unwrap_err().to_string();
        assert!(
            message.contains(&format!("did you mean '{known}'?")),
            "{message}"
        );
    }
}

/// The ground is a plane collider: both give the same bits.
#[test]
fn the_ground_is_a_plane() {
    let fall = |world: &str, collider: &str| {
        let text = format!(
            "{GRAVITY}{world}{}damping = 0.002\n{collider}",
            body("box", 300, [0.0, 0.0, 0.0])
        );
        let mut simulation = simulation(&scene(&text));
        for _ in 0..30 {
            simulation.step().unwrap();
        }
        state(&simulation)
    };
    let ground = fall("ground = { height = -0.55, friction = 0.5 }\n", "");
    let plane = "[[collider]]\nkind = \"plane\"\npoint = [3, 2, -0.55]\nnormal = [0, 0, 7]\nfriction = 0.5\n";
    assert!(ground == fall("", plane));
    assert!(ground != fall("", ""));
}

/// What a moving ball pushes does not enter it, wherever the ball is by then.
#[test]
fn a_moving_ball_pushes_a_body_away() {
    let text = format!(
        "[solver]\nprecision = \"f64\"\n{}{}",
        body("sphere", 300, [0.0, 0.0, 0.0]),
        "[[collider]]\nkind = \"sphere\"\ncenter = [0, 0, 0.8]\nradius = 0.25\nvelocity = [0, 0, -1]\n"
    );
    let mut simulation = simulation(&scene(&text));
    for frame in 1..=60 {
        simulation.step().unwrap();
        let center = dvec3(0.0, 0.0, 0.8 - 0.016 * f64::from(frame));
        for x in simulation.positions() {
            // Rounding of a position and a center near 1.
            assert!(x.distance(center) >= 0.25 - 1e-12);
        }
    }
    let lowest = simulation.positions().iter().map(|x| x.z);
    assert!(lowest.fold(f64::INFINITY, f64::min) < -0.6);
}

/// A held end goes where path and turn say, to rounding, through a cut as well, and stays there.
#[test]
fn a_handle_takes_what_it_holds_along() {
    let text = format!(
        "{GRAVITY}[solver]\nprecision = \"f64\"\n{}fixed = [{{ half_space = {{ point = [-0.4, 0, 0], normal = [-1, 0, 0] }} }}]\n\
         [[attachment]]\nregions = [{{ half_space = {{ point = [0.4, 0, 0], normal = [1, 0, 0] }} }}]\n\
         frames = [2, 12]\npath = [[0, 0, 1], [0.1, 0, 1], [0.1, 0.1, 1]]\n\
         rotation = {{ axis = [2, 0, 0], angle_degrees = 45, center = [0.4, 0.1, 0] }}\n{}",
        body("beam", 600, [0.0, 0.0, 0.0]),
        plane(5, [0.45, 0.013, 0.0], [0.0, 1.0, 0.0]),
    );
    let mut simulation = simulation(&scene(&text));
    let first = simulation.positions().len();
    for frame in 0..16_u32 {
        simulation.step().unwrap();
        simulation.check().unwrap();
        let way = (f64::from(frame + 1).clamp(2.0, 12.0) - 2.0) / 10.0;
        let offset = dvec3(
            0.1 * (2.0 * way).min(1.0),
            0.1 * (2.0 * way - 1.0).max(0.0),
            0.0,
        );
        let (sin, cos) = (way * 45.0).to_radians().sin_cos();
        let mut held = [0; 2];
        let now = simulation.positions().iter();
        for (p, (x, rest)) in now.zip(&simulation.mesh().positions).enumerate() {
            // What the cut puts between a held particle and a free one is free; edges are shorter than 0.06.
            if rest.x < if p < first { 0.4 } else { 0.46 } {
                continue;
            }
            held[usize::from(p >= first)] += 1;
            let arm = *rest - dvec3(0.4, 0.1, 0.0);
            let turned = dvec3(arm.x, cos * arm.y - sin * arm.z, sin * arm.y + cos * arm.z);
            let target = dvec3(0.4, 0.1, 0.0) + turned + offset;
            // What a cut puts between two held particles is interpolated as the mesh does it: rounding.
            assert!(x.distance(target) < 1e-12, "frame {frame}: {rest} at {x}");
        }
        assert!(held[0] > 10 && (frame < 5 || held[1] > 10), "{held:?}");
    }
    assert!(simulation.positions().len() > first);
}

/// A thread of a mesh's length holds a body under a fixed one: they hang by it and by no more.
#[test]
fn links_carry_a_body() {
    let text = format!(
        "{GRAVITY}[solver]\nprecision = \"f64\"\nsubsteps = 20\n{}fixed = [{{ half_space = {{ point = [0, 0, -9], normal = [0, 0, 1] }} }}]\n{}\
         [[distance]]\nfrom = {{ body = 0, point = [0, 0, -0.5] }}\nto = {{ body = 1, point = [0, 0, -1.5] }}\ntension_only = true\n",
        body("box", 300, [0.0, 0.0, 0.0]),
        body("box", 300, [0.0, 0.0, -2.0]),
    );
    let mut scene = scene(&text);
    scene.body.iter_mut().for_each(|b| b.young_modulus = 1e5);
    let nearest = |simulation: &Simulation, point: [f64; 3], second: bool| {
        let point = DVec3::from_array(point);
        let mut all = simulation.mesh().positions.iter().enumerate();
        let best = all.by_ref().filter(|(_, x)| (x.z < -1.2) == second);
        let best = best.min_by(|a, b| a.1.distance(point).total_cmp(&b.1.distance(point)));
        best.unwrap().0
    };
    let mut tied = simulation(&scene);
    let a = nearest(&tied, [0.0, 0.0, -0.5], false);
    let b = nearest(&tied, [0.0, 0.0, -1.5], true);
    let length = tied.positions()[a].distance(tied.positions()[b]);
    let lowest = |simulation: &Simulation| {
        let heights = simulation.positions().iter().map(|x| x.z);
        heights.fold(f64::INFINITY, f64::min)
    };
    for _ in 0..40 {
        tied.step().unwrap();
        // Solved last in each substep: as long as at rest, up to the square of the angle it turns in one.
        assert!(tied.positions()[a].distance(tied.positions()[b]) < length + 1e-4);
    }
    assert!(lowest(&tied) > -3.6, "{}", lowest(&tied));
    // Without the link it falls by 2 m.
    scene.distance.clear();
    let mut loose = simulation(&scene);
    for _ in 0..40 {
        loose.step().unwrap();
    }
    assert!(lowest(&loose) < -4.4, "{}", lowest(&loose));
}

#[test]
fn an_end_of_a_link_is_the_nearest_particle_of_its_body() {
    let mut scene = everything();
    scene.distance[0].to = EndSpec::new(1, scene.distance[0].from.point);
    // The other body's nearest particle is another one.
    simulation(&scene).step().unwrap();
}

/// A body hanging from its top is pulled long by its weight: with a volume compliance of 0 it keeps its volume, also
/// after a cut; without it does not.
#[test]
fn volume_constraints_keep_the_volume_through_a_cut() {
    let hang = |volume: &str| {
        let text = format!(
            "{GRAVITY}[report]\nquantities = [\"volume\"]\n[solver]\nsubsteps = 20\n{}poisson_ratio = 0.0\ndamping = 0.01\n{volume}\
             fixed = [{{ half_space = {{ point = [0, 0, 0.45], normal = [0, 0, 1] }} }}]\n{}",
            body("box", 400, [0.0, 0.0, 0.0]).replace("1e4", "2e4"),
            plane(10, [0.03, 0.0, 0.0], [1.0, 0.0, 0.1])
        );
        let mut simulation = simulation(&scene(&text));
        for _ in 0..40 {
            simulation.step().unwrap();
        }
        simulation.check().unwrap();
        assert_eq!(simulation.report().pieces, 2);
        simulation.report().volume_error.unwrap()
    };
    let free = hang("");
    assert!(free > 0.1, "{free}");
    // One pass a substep leaves the last tets of each color a little beside.
    let kept = hang("volume_compliance = 0.0\n");
    assert!(kept.abs() < 0.01, "{kept}");
}
