//! What happens after a cut: which parts fall, which hold, which spring back.

use incise::mesh::glam::DVec3;
use incise::mesh::{ParticleId, TetId, TetMesh};
use incise::scene::Precision;
use incise::{Simulation, Warning, WarningCode};

use crate::support::{body, plane, scene, simulation};

/// The center of mass of the tets that `belongs` picks by their center at rest, with particles at `x`; the density is
/// the same everywhere.
fn center(mesh: &TetMesh, x: &[DVec3], belongs: impl Fn(DVec3) -> bool) -> DVec3 {
    let (mut sum, mut volume) = (DVec3::ZERO, 0.0);
    for (t, tet) in mesh.tets.iter().enumerate() {
        let mean = |x: &[DVec3]| tet.iter().map(|p| x[p.index()]).sum::<DVec3>() / 4.0;
        if belongs(mean(&mesh.positions)) {
            let of_tet = mesh.volume(TetId::new(t));
            sum += mean(x) * of_tet;
            volume += of_tet;
        }
    }
    sum / volume
}

/// Cut off what holds it, the lower part falls freely from the first moment on, and the upper one stays.
#[test]
fn a_part_that_was_cut_off_falls() {
    let mut scene = scene(&format!(
        "[world]\ngravity = [0.0, 0.0, -9.81]\n{}fixed = [{{ half_space = {{ point = [0.0, 0.0, 0.4], normal = [0.0, 0.0, 1.0] }} }}]\n{}",
        body("box", 900, [0.0; 3]).replace("1e4", "1e5"),
        plane(0, [0.0, 0.0, 0.1], [0.0, 0.0, 1.0]),
    ));
    scene.solver.precision = Precision::F64;
    let substeps = 5;
    scene.solver.substeps = substeps.into();
    let substep = scene.solver.time_step / f64::from(substeps);
    let mut simulation = simulation(&scene);
    simulation.step().unwrap();
    simulation.check().unwrap();
    assert_eq!(simulation.report().detached.len(), 1);
    let below = |x: DVec3| x.z < 0.1;
    let moved = |simulation: &Simulation, belongs: &dyn Fn(DVec3) -> bool| {
        let mesh = simulation.mesh();
        center(mesh, simulation.positions(), belongs) - center(mesh, &mesh.positions, belongs)
    };
    for frame in 1..=60_u32 {
        let way = moved(&simulation, &below);
        // Symplectic Euler: after n substeps of length h the way is g h² n (n + 1) / 2.
        let n = f64::from(frame * substeps);
        let exact = -9.81 * substep * substep * n * (n + 1.0) / 2.0;
        // Rounding of positions of 1 m, added up over 300 substeps.
        assert!((way.z - exact).abs() < 1e-11, "frame {frame}: {way}");
        assert!(way.truncate().length() < 1e-11, "frame {frame}: {way}");
        let time = n * substep;
        let continuous = -9.81 * time * time / 2.0;
        assert!((way.z / continuous - 1.0).abs() <= 1.001 / n);
        simulation.step().unwrap();
    }
    // What hangs above, 0.3 m long, is stretched by its weight by g ρ l² / 2 E = 4.4 mm, its center by less, and by up to
    // twice as much while it swings.
    let hanging = moved(&simulation, &|x| !below(x));
    assert!(hanging.length() < 0.009, "{hanging}");
}

/// A tongue cut out of the underside hangs down at its tip and holds at its hinge.
#[test]
fn a_flap_hangs_on_its_hinge() {
    let fixed = "fixed = [{ half_space = { point = [0.0, 0.0, -0.35], normal = [0.0, 0.0, -1.0] } }]\ndamping = 0.01\n";
    // Up is down here: the body stands on its head.
    let standing = format!(
        "[world]\ngravity = [0.0, 0.0, 9.81]\n{}{fixed}",
        body("box", 2500, [0.0; 3]).replace("1e4", "3e5")
    );
    let stroke = "[[stroke]]\nkind = \"sweep\"\nframes = [0, 10]\n\
        blade = [[-0.27, -0.6, 0.8], [-0.21, -0.6, 0.17], [0.21, -0.6, 0.16], [0.28, -0.6, 0.8]]\n\
        path = [[0.0, 0.0, 0.0], [0.0, 0.8, 0.0]]\n";
    let mut sag = Vec::new();
    for text in [standing.clone(), standing + stroke] {
        let mut simulation = simulation(&scene(&text));
        for _ in 0..60 {
            simulation.step().unwrap();
        }
        simulation.check().unwrap();
        assert_eq!(simulation.report().pieces, 1);
        let tongue = |x: &DVec3| x.x.abs() < 0.15 && x.z > 0.25;
        let mean = |inside: &dyn Fn(&DVec3) -> bool| {
            let rest = &simulation.mesh().positions;
            let picked: Vec<f64> = (0..rest.len())
                .filter(|&p| inside(&rest[p]))
                .map(|p| simulation.positions()[p].z - rest[p].z)
                .collect();
            picked.iter().sum::<f64>() / picked.len() as f64
        };
        sag.push([
            mean(&|x| tongue(x) && x.y < -0.35),
            mean(&|x| tongue(x) && x.y > 0.35),
        ]);
    }
    let [[whole_tip, whole_hinge], [tip, hinge]] = sag[..] else {
        panic!("two runs")
    };
    // Measured: the tip goes from 10 to 125 mm, the hinge from 11 to 6 mm.
    assert!(tip > whole_tip + 0.05, "{sag:?}");
    assert!(
        (hinge - whole_hinge).abs() < 0.2 * (tip - whole_tip),
        "{sag:?}"
    );
}

/// Stretched to twice its length and cut through, a beam springs back to its shape at rest on both sides.
#[test]
fn cut_while_stretched() {
    let text = format!(
        "{}damping = 0.002\nfixed = [{{ half_space = {{ point = [-0.45, 0.0, 0.0], normal = [-1.0, 0.0, 0.0] }} }}]\n\
         [[attachment]]\nregions = [{{ half_space = {{ point = [0.45, 0.0, 0.0], normal = [1.0, 0.0, 0.0] }} }}]\n\
         frames = [0, 60]\npath = [[0.0, 0.0, 0.0], [0.9, 0.0, 0.0]]\n\
         [report]\nquantities = [\"energy\", \"volume\", \"speed\"]\n{}",
        body("beam", 600, [0.0; 3]).replace("1e4", "1e5"),
        plane(80, [0.45, 0.0, 0.0], [1.0, 0.1, 0.2]),
    );
    for precision in [Precision::F32, Precision::F64] {
        let mut scene = scene(&text);
        scene.solver.precision = precision;
        let mut simulation = simulation(&scene);
        let volume = simulation.mesh().total_volume();
        for _ in 0..80 {
            simulation.step().unwrap();
        }
        let stretched = simulation.report().clone();
        let strain = stretched.energy.unwrap().elastic;
        let far = simulation
            .positions()
            .iter()
            .map(|x| x.x)
            .fold(0.0, f64::max);
        assert!(far > 1.3, "the beam is twice as long");
        for _ in 0..1000 {
            let report = simulation.step().unwrap();
            // Nothing adds energy any more. Waves in rubber go at sqrt(E / ρ) = 10 m/s, and so do released ends.
            assert!(report.energy.unwrap().elastic <= 1.01 * strain);
            assert!(report.max_speed.unwrap() < 50.0 && report.repaired == 0);
        }
        simulation.check().unwrap();
        assert_eq!(simulation.report().pieces, 2);
        assert!((simulation.mesh().total_volume() / volume - 1.0).abs() < 1e-12);
        let report = simulation.report();
        // After 16 s: measured 2.7e-7 of the energy, tets within 0.1 % of their volume, 5 mm/s.
        assert!(report.energy.unwrap().elastic < 1e-5 * strain);
        assert!((report.min_volume_ratio.unwrap() - 1.0).abs() < 0.01);
        assert!(report.max_speed.unwrap() < 0.05);
        // Every edge has its length again.
        let (rest, now) = (&simulation.mesh().positions, simulation.positions());
        for tet in &simulation.mesh().tets {
            let [a, b] = [tet[0], tet[1]].map(ParticleId::index);
            let ratio = now[a].distance(now[b]) / rest[a].distance(rest[b]);
            assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
        }
    }
}

/// A blade that stops half-way through a beam between two walls while it sags, and continues later.
#[test]
fn half_way_and_on() {
    let wall = |side: f64| {
        format!(
            "{{ half_space = {{ point = [{}, 0.0, 0.0], normal = [{side:?}, 0.0, 0.0] }} }}",
            0.4 * side
        )
    };
    let fixed = format!("fixed = [{}, {}]\n", wall(1.0), wall(-1.0));
    let stroke = "[[stroke]]\nkind = \"sweep\"\nframes = [2, 32]\nblade = [[0.1, -0.5, 0.4], [0.1, 0.5, 0.4]]\n\
        path = [[0.0, 0.0, 0.0], [0.0, 0.0, -0.42], [0.0, 0.0, -0.42], [0.0, 0.0, -1.2]]\n";
    let mut simulation = simulation(&scene(&format!(
        "[world]\ngravity = [0.0, 0.0, -9.81]\n{}{fixed}{stroke}",
        body("beam", 1500, [0.0; 3]).replace("1e4", "3e5")
    )));
    let mut cuts = [0; 3];
    for frame in 0..34 {
        let report = simulation.step().unwrap();
        let phase = usize::from(frame > 12) + usize::from(frame > 22);
        cuts[phase] += usize::from(report.cut.is_some());
        let pieces = report.pieces;
        simulation.check().unwrap();
        if frame <= 22 {
            assert_eq!(pieces, 1, "frame {frame}");
        }
    }
    assert!(cuts[0] > 2 && cuts[2] > 0, "{cuts:?}");
    let volumes: Vec<f64> = simulation
        .pieces()
        .iter()
        .map(|piece| piece.volume)
        .collect();
    // Cut at 0.6 of its length; chips may come off where it moved.
    let tip = volumes[1..].iter().fold(0.0, |a: f64, b| a.max(*b)) / volumes.iter().sum::<f64>();
    assert!((tip - 0.4).abs() < 0.02, "{volumes:?}");
}

/// A body that starts inside the ground or a collider is named with its depth, and rises without being torn: its fastest
/// particle goes at the depth over 20 ms, twice that where it bulges.
#[test]
fn bodies_that_start_inside_colliders_are_named_and_rise_slowly() {
    let body =
        "[[body]]\nshape = { kind = \"box\", tets = 300 }\nscale = 0.2\nyoung_modulus = 1e4\n";
    let ground = "[world]\nground = { height = -0.06 }\n";
    let ball = "[[collider]]\nkind = \"sphere\"\ncenter = [0.0, 0.0, -0.3]\nradius = 0.24\n";
    // The ball's top is between particles of the box, which lie less deep.
    for (text, place) in [
        (format!("{ground}{body}"), "0.04 m inside the ground"),
        (format!("{body}{ball}"), "0.0376 m inside collider[0]"),
    ] {
        let mut simulation = simulation(&scene(&text));
        let mut fastest = 0.0f64;
        for frame in 0..20 {
            let report = simulation.step().unwrap();
            let is_named = |w: &&Warning| w.code == WarningCode::StartsInside;
            let warning = report.warnings().iter().find(is_named);
            if frame == 0 {
                let warning = warning.unwrap_or_else(|| panic!("no warning: {text}"));
                assert_eq!(warning.location, "body 0");
                assert!(warning.message.contains(place), "{warning}");
            }
            let speeds = simulation.velocities().into_iter().map(DVec3::length);
            fastest = speeds.fold(fastest, f64::max);
        }
        assert!(fastest > 1.0 && fastest < 4.0, "{place}: {fastest} m/s");
    }
    let apart = simulation(&scene(&format!(
        "[world]\nground = {{ height = -0.1 }}\n{body}"
    )))
    .step()
    .unwrap()
    .warnings()
    .to_vec();
    assert!(
        apart.iter().all(|w| w.code != WarningCode::StartsInside),
        "{apart:?}"
    );
}

/// Bodies that start inside each other are named with the depth if they touch; bodies that lie on each other are not.
#[test]
fn bodies_that_start_inside_each_other_are_named() {
    let of = |depth: f64, contact: &str| {
        let text = |z: f64| {
            format!(
                "[[body]]\nshape = {{ kind = \"box\", tets = 300 }}\nscale = 0.2\nposition = [0.0, 0.0, {z}]\n"
            )
        };
        let mut simulation = simulation(&scene(&format!(
            "{contact}{}{}",
            text(0.0),
            text(0.2 - depth)
        )));
        let mut named = Vec::new();
        for _ in 0..3 {
            let warnings = simulation.step().unwrap().warnings().iter();
            named.extend(
                warnings
                    .filter(|w| w.code == WarningCode::StartsInside)
                    .cloned(),
            );
        }
        named
    };
    let named = of(0.03, "[contact]\n");
    assert_eq!(named.len(), 1, "{named:?}");
    assert_eq!(named[0].location, "bodies 0, 1");
    assert!(
        named[0].message.contains("up to 0.03 m inside each other"),
        "{}",
        named[0]
    );
    assert!(of(0.0, "[contact]\n").is_empty());
    assert!(of(0.03, "").is_empty());
}

/// A collider that fits between the particles of a body is named: across the way in which it moves.
#[test]
fn colliders_that_pass_between_particles_are_named() {
    let body = "[[body]]\nshape = { kind = \"box\", tets = 300 }\nscale = 0.2\n";
    let of = |collider: &str| {
        let text = format!("{body}[[collider]]\ncenter = [0.0, 0.0, 0.5]\n{collider}");
        let mut simulation = simulation(&scene(&text));
        let warnings = simulation.step().unwrap().warnings().to_vec();
        let thin = |w: &&Warning| w.code == WarningCode::ThinCollider;
        warnings.iter().find(thin).map(|w| w.message.clone())
    };
    let wall = |velocity: &str| {
        let sides = "kind = \"box\"\nhalf_extents = [0.3, 0.3, 0.005]\n";
        of(&format!("{sides}velocity = {velocity}\n"))
    };
    let needle = of("kind = \"sphere\"\nradius = 0.005\n").unwrap();
    assert!(
        needle.starts_with("collider[0] is 0.01 m thick"),
        "{needle}"
    );
    assert_eq!(of("kind = \"sphere\"\nradius = 0.1\n"), None);
    assert!(wall("[0.5, 0, 0]").is_some(), "edge on");
    assert_eq!(wall("[0, 0, -0.5]"), None);
    assert_eq!(wall("[0, 0, 0]"), None);
}

/// A body in mm without `scale` is a thousand times as large and collapses under its weight: it is named.
#[test]
fn a_body_that_its_weight_crushes_is_named() {
    let text = |scale: f64, young_modulus: f64, world: &str, more: &str| {
        format!(
            "[world]\n{world}\n[[body]]\nshape = {{ kind = \"box\", tets = 200 }}\nscale = {scale}\nyoung_modulus = {young_modulus}\n{more}"
        )
    };
    let fall = "gravity = [0.0, 0.0, -9.81]";
    let all = "fixed = [{ half_space = { point = [0.0, 0.0, -1e3], normal = [0.0, 0.0, 1.0] } }]";
    let stiff = "[[body.material]]\nyoung_modulus = 1e8\nregions = [{ half_space = { point = [0.0, 0.0, 0.0], normal = [0.0, 0.0, 1.0] } }]";
    for (text, weight) in [
        (
            text(200.0, 1e4, fall, ""),
            Some("200 m large, and the pressure of its weight is 196 times"),
        ),
        (text(200.0, 1e6, fall, ""), None),
        (
            text(200.0, 9e5, fall, ""),
            Some("200 m large, and the pressure of its weight is 2 times"),
        ),
        (text(0.2, 1e4, fall, ""), None),
        (text(200.0, 1e4, "", ""), None),
        (text(200.0, 1e4, fall, all), None),
        (text(200.0, 1e4, fall, stiff), None),
    ] {
        let mut simulation = simulation(&scene(&text));
        for frame in 0..2 {
            let report = simulation.step().unwrap();
            let is_named = |w: &&Warning| w.code == WarningCode::TooHeavy;
            let warning = report.warnings().iter().find(is_named);
            match (weight, frame) {
                (Some(weight), 0) => {
                    let warning = warning.unwrap_or_else(|| panic!("no warning: {text}"));
                    assert_eq!(warning.location, "body 0");
                    assert!(warning.message.contains(weight), "{warning}");
                    // A thousandth of the one that the scene has.
                    assert!(warning.message.contains("set scale = 0.2 if"), "{warning}");
                }
                _ => assert!(warning.is_none(), "{text}, frame {frame}"),
            }
        }
    }
}

/// A body that is too soft for what it has to hold is named once, a second after it turned over at the latest.
#[test]
fn a_body_that_stays_inverted_is_named() {
    for (young_modulus, expected) in [(6e3, 1), (2e4, 0)] {
        let text = format!(
            "[world]\ngravity = [0.0, 0.0, -9.81]\n[[body]]\nshape = {{ kind = \"box\", tets = 700 }}\nscale = 0.2\n\
             young_modulus = {young_modulus}\npoisson_ratio = 0.4\ndamping = 0.1\n\
             fixed = [{{ half_space = {{ point = [0.0, 0.0, -0.0998], normal = [0.0, 0.0, -1.0] }} }}]\n\
             [report]\nquantities = [\"volume\"]"
        );
        let mut simulation = simulation(&scene(&text));
        let (mut named, mut inverted) = (0, 0);
        for frame in 0..250 {
            let report = simulation.step().unwrap();
            let of_code = report
                .warnings()
                .iter()
                .filter(|w| w.code == WarningCode::Inverted);
            named += of_code.count();
            inverted = report.inverted_tets.unwrap();
            if named > 0 && frame < 30 {
                panic!("named in frame {frame}");
            }
        }
        assert_eq!(named, expected, "{young_modulus}");
        assert_eq!(inverted > 0, expected > 0, "{young_modulus}");
    }
}

/// A key that changes nothing is named once, and a method's own keys and those at their defaults are not.
#[test]
fn keys_without_effect_are_named() {
    let cases: [(&str, &[&str]); 13] = [
        ("integrator = \"implicit-euler\"", &["integrator"]),
        (
            "method = \"gauss-seidel\"\nspectral_radius = 0.5\nchebyshev_start = 3",
            &["spectral_radius", "chebyshev_start"],
        ),
        (
            "method = \"chebyshev\"\nspectral_radius = 0.5\nchebyshev_start = 3",
            &[],
        ),
        ("method = \"vbd\"\nintegrator = \"implicit-euler\"", &[]),
        ("method = \"vbd\"\nrelaxation = 0.5", &["relaxation"]),
        ("method = \"jacobi\"\nrelaxation = 0.2", &[]),
        ("relaxation = 0.8", &[]),
        ("substeps = 7\nbudget_ms = 4.0", &["budget_ms"]),
        ("substeps = 7\nmax_substeps = 20", &["max_substeps"]),
        ("budget_ms = 4.0\nmax_substeps = 20", &[]),
        (
            "substeps = 7\nmax_substeps = 200\nspectral_radius = 0.99",
            &[],
        ),
        ("preset = \"paper\"", &[]),
        ("time_step = 16", &["time_step"]),
    ];
    for (solver, keys) in cases {
        let text =
            format!("[solver]\n{solver}\n[[body]]\nshape = {{ kind = \"box\", tets = 200 }}\n");
        let mut simulation = simulation(&scene(&text));
        let expected: Vec<String> = keys.iter().map(|key| format!("solver.{key}")).collect();
        for frame in 0..2 {
            let report = simulation.step().unwrap();
            let of_keys = report
                .warnings()
                .iter()
                .filter(|w| matches!(w.code, WarningCode::UnusedKey | WarningCode::LongFrame));
            let named: Vec<&str> = of_keys.map(|w| w.location.as_str()).collect();
            let expected: &[String] = if frame == 0 { &expected } else { &[] };
            assert_eq!(named, expected, "{solver}, frame {frame}");
        }
    }
}

/// Nothing falls without gravity, which a newcomer with a ground does not expect; one who asks for none does.
#[test]
fn a_ground_without_gravity_is_named_once() {
    let text = |world: &str| {
        format!(
            "[world]\n{world}\n[[body]]\nshape = {{ kind = \"box\", tets = 200 }}\nposition = [0.0, 0.0, 1.0]\n"
        )
    };
    let ground = "ground = { height = 0.0 }";
    for (world, expected) in [
        (ground.to_owned(), true),
        (format!("{ground}\ngravity = [0.0, 0.0, 0.0]"), false),
        (format!("{ground}\ngravity = [0.0, 0.0, -9.81]"), false),
        (String::new(), false),
    ] {
        let mut simulation = simulation(&scene(&text(&world)));
        for frame in 0..2 {
            let report = simulation.step().unwrap();
            let mut warnings = report.warnings().iter();
            let warning = warnings.find(|w| w.code == WarningCode::NoGravity);
            assert_eq!(
                warning.is_some(),
                expected && frame == 0,
                "{world}, {frame}"
            );
        }
    }
}
