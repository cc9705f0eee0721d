//! Scenes of contact with a known outcome: cuts under load, pieces of several cuts, and the cases that are hard for contact
//! of triangles by the names that Erleben gave them.

use incise::mesh::glam::{DQuat, DVec3, dvec3};
use incise::mesh::{ParticleId, TetMesh, kuhn_box};
use incise::meshing::{Shape, generate};
use incise::scene::{
    AttachmentSpec, ContactSpec, PathRotationSpec, Precision, Quantity, Region, ReportSpec,
    StrokeSpec,
};
use incise::{Body, Simulation, SimulationBuilder};

use crate::contact::{GRAVITY, center, cut, intruders, solver};

fn with_friction(friction: f64) -> ContactSpec {
    ContactSpec::default().with(|spec| spec.friction = friction)
}

/// Steps, with or without the warning that slivers of a cut are not as accurate as wanted.
fn steps(simulation: &mut Simulation, count: u32) {
    for _ in 0..count {
        assert_eq!(simulation.step().unwrap().repaired, 0);
    }
}

/// The mean over some frames of the force on the second of two pieces.
fn mean_force(simulation: &mut Simulation, pieces: [u32; 2], frames: u32) -> DVec3 {
    let mut sum = DVec3::ZERO;
    for _ in 0..frames {
        steps(simulation, 1);
        let contacts = simulation.contacts();
        let found = contacts.iter().find(|contact| contact.pieces == pieces);
        sum += found.map_or(DVec3::ZERO, |contact| contact.force);
    }
    sum / f64::from(frames)
}

/// The attachment, moved by a way in the first twenty frames.
fn moved(attachment: AttachmentSpec, by: DVec3) -> AttachmentSpec {
    attachment.with(|spec| {
        spec.frames = [0, 20];
        spec.path = vec![[0.0; 3], by.to_array()];
    })
}

fn half_space(point: DVec3, normal: DVec3) -> Region {
    Region::half_space(point.to_array(), normal.to_array())
}

/// A column cut across at tan φ = 1/2 holds for a friction above that and slides for one below.
#[test]
fn an_oblique_cut_holds_by_friction() {
    for (friction, slides) in [(0.48, true), (0.52, false)] {
        let mut builder = Simulation::builder();
        builder.gravity(GRAVITY).solver(solver(Precision::F64, 20));
        let column = kuhn_box([3, 3, 6], dvec3(0.25, 0.25, 0.5));
        let column = Body::new(column).pinned(|x| x.z == 0.0);
        builder.add_body(column.young_modulus(2e6).damping(0.01));
        builder.contact(with_friction(friction));
        builder.add_stroke(cut(1, dvec3(0.125, 0.125, 0.26), dvec3(-1.0, 0.0, 2.0)));
        let mut simulation = builder.build().unwrap();
        steps(&mut simulation, 10);
        let upper: Vec<usize> = (0..simulation.positions().len())
            .filter(|&p| simulation.mesh().positions[p].z > 0.4)
            .collect();
        let mean = |simulation: &Simulation| {
            let sum: DVec3 = upper.iter().map(|&p| simulation.positions()[p]).sum();
            sum / upper.len() as f64
        };
        let before = mean(&simulation);
        steps(&mut simulation, 30);
        let down = (mean(&simulation) - before).dot(-dvec3(2.0, 0.0, 1.0).normalize());
        // Free of acceleration by the shaking of the start: g (sin φ - μ cos φ) t² / 2 = 20 mm and more.
        assert_eq!(down > 5e-3, slides, "{down} m at {friction}");
        assert!(slides || down.abs() < 1e-3, "{down}");
        simulation.check().unwrap();
    }
}

/// Two crossing cuts: four pieces meet on a line, and they rest against each other without overlap.
#[test]
fn four_pieces_on_a_line() {
    let mut builder = Simulation::builder();
    builder
        .gravity(GRAVITY)
        .ground(0.0, 0.5)
        .solver(solver(Precision::F64, 20));
    let block = kuhn_box([5, 5, 3], dvec3(0.25, 0.25, 0.15));
    builder.add_body(Body::new(block).young_modulus(3e5).damping(0.01));
    builder.contact(with_friction(0.3));
    let middle = dvec3(0.126, 0.131, 0.07);
    builder.add_stroke(cut(2, middle, dvec3(1.0, 0.2, 0.3)));
    builder.add_stroke(cut(5, middle, dvec3(-0.2, 1.0, 0.25)));
    let mut simulation = builder.build().unwrap();
    for _ in 0..60 {
        steps(&mut simulation, 1);
        // 2% of an edge.
        assert_eq!(intruders(&simulation, 1e-3), 0);
    }
    assert_eq!(simulation.report().pieces, 4);
    // Each piece touches those on its sides; those across the line touch in a line at most.
    let contacts = simulation.contacts();
    assert!((4..=6).contains(&contacts.len()), "{contacts:?}");
    assert_eq!(simulation.report().contact.unwrap().buried, 0);
    simulation.check().unwrap();
}

fn pressed_bar(is_cut: bool) -> (Simulation, incise::AttachmentHandle) {
    let mut builder = Simulation::builder();
    builder
        .solver(solver(Precision::F64, 20))
        .report(ReportSpec::default().with(|spec| {
            spec.every = 1;
            spec.quantities = vec![Quantity::Force];
        }));
    let bar = kuhn_box([8, 3, 3], dvec3(0.4, 0.15, 0.15));
    builder.add_body(Body::new(bar).young_modulus(1e5).damping(0.02));
    builder.contact(with_friction(0.5));
    builder.add_attachment(AttachmentSpec::new(
        0,
        vec![half_space(DVec3::X * 0.01, DVec3::NEG_X)],
    ));
    let pressing = builder.add_attachment(moved(
        AttachmentSpec::new(0, vec![half_space(DVec3::X * 0.39, DVec3::X)]),
        DVec3::X * -0.02,
    ));
    if is_cut {
        builder.add_stroke(StrokeSpec::sweep(
            [30, 50],
            vec![[0.19, -0.1, 0.2], [0.19, 0.3, 0.2]],
            vec![[0.0; 3], [0.0, 0.0, -0.3]],
        ));
    }
    (builder.build().unwrap(), pressing)
}

/// A bar under pressure is cut across by a blade: the cut stays closed, carries the force of before, and its sides do not
/// overlap while the blade passes.
#[test]
fn a_stroke_through_a_pressed_bar() {
    let force = |is_cut: bool| {
        let (mut simulation, pressing) = pressed_bar(is_cut);
        for _ in 0..90 {
            steps(&mut simulation, 1);
            // 1% of an edge.
            assert_eq!(intruders(&simulation, 5e-4), 0);
        }
        assert_eq!(simulation.report().pieces, if is_cut { 2 } else { 1 });
        simulation.check().unwrap();
        let pressing = simulation.attachment_force(pressing).unwrap().force.x;
        let across = mean_force(&mut simulation, [0, 1], 5).x.abs();
        (pressing, across)
    };
    let ((whole, _), (pressing, across)) = (force(false), force(true));
    assert!(whole.abs() > 50.0, "{whole}");
    assert!(
        (pressing - whole).abs() < 0.02 * whole.abs(),
        "{pressing} after {whole}"
    );
    assert!(
        (across - whole.abs()).abs() < 0.02 * whole.abs(),
        "{across} of {whole}"
    );
}

/// A rod that is twisted by half a turn is sliced into twenty while it is: no slice ends inside of its neighbor.
#[test]
fn a_twisted_rod_is_sliced() {
    let mut builder = Simulation::builder();
    builder.solver(solver(Precision::F64, 20));
    let rod = kuhn_box([30, 2, 2], dvec3(0.6, 0.04, 0.04));
    builder.add_body(Body::new(rod).young_modulus(1e5).damping(0.005));
    builder.contact(with_friction(0.2));
    for side in [0.0, 0.6] {
        let outward = DVec3::X * if side == 0.0 { -1.0 } else { 1.0 };
        let end = half_space(DVec3::X * side - outward * 0.01, outward);
        let turn = PathRotationSpec::default().with(|spec| {
            spec.axis = [1.0, 0.0, 0.0];
            spec.angle_degrees = 90.0 * outward.x;
            spec.center = [0.0, 0.02, 0.02];
        });
        builder.add_attachment(AttachmentSpec::new(0, vec![end]).with(|spec| {
            spec.frames = [0, 60];
            spec.rotation = Some(turn);
        }));
    }
    for slice in 1..20_u32 {
        let at = 0.6 * f64::from(slice) / 20.0 + 0.0007;
        builder.add_stroke(cut(u64::from(20 + slice), DVec3::X * at, DVec3::X));
    }
    let mut simulation = builder.build().unwrap();
    for frame in 0..80 {
        let report = simulation.step().unwrap();
        assert_eq!(report.repaired, 0, "frame {frame}");
    }
    assert_eq!(simulation.report().pieces, 20);
    // 2% of an edge.
    assert_eq!(intruders(&simulation, 4e-4), 0);
    assert_eq!(simulation.report().contact.unwrap().buried, 0);
    simulation.check().unwrap();
}

/// The patch test of contact: two blocks with unlike meshes are pressed together along z, without sideways expansion.
/// Stress and strain are uniform, so all of the common plane stays plane, half way.
#[test]
fn unlike_meshes_press_uniformly() {
    let mut builder = Simulation::builder();
    builder.solver(solver(Precision::F64, 40));
    let lower = Body::new(kuhn_box([4, 4, 3], dvec3(0.2, 0.2, 0.1)));
    let upper = Body::new(kuhn_box([3, 3, 3], dvec3(0.2, 0.2, 0.1))).position(DVec3::Z * 0.1);
    for body in [lower, upper] {
        builder.add_body(body.young_modulus(1e5).poisson_ratio(0.0).damping(0.02));
    }
    builder.contact(with_friction(0.0));
    let bottom = half_space(DVec3::Z * 0.001, DVec3::NEG_Z);
    builder.add_attachment(AttachmentSpec::new(0, vec![bottom]));
    let press = 0.01;
    builder.add_attachment(moved(
        AttachmentSpec::new(1, vec![half_space(DVec3::Z * 0.199, DVec3::Z)]),
        DVec3::Z * -press,
    ));
    let mut simulation = builder.build().unwrap();
    steps(&mut simulation, 120);
    let rest = simulation.mesh().positions.clone();
    for (rest, x) in rest.iter().zip(simulation.positions()) {
        // The strain is the same all over: 1/20.
        let expected = rest.with_z(rest.z * (1.0 - press / 0.2));
        let off = x.distance(expected);
        assert!(off < 0.05 * press, "{rest} is {off} off");
    }
    let force = mean_force(&mut simulation, [0, 1], 5);
    let expected = 1e5 * 0.04 * press / 0.2;
    assert!(
        (force.z - expected).abs() < 0.02 * expected,
        "{force} {expected}"
    );
}

/// A tet with its tip down at the origin, and one with its tip up.
fn spike(is_up: bool, height: f64) -> TetMesh {
    let base = [0.0, 120.0, 240.0_f64].map(|degrees| {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        dvec3(0.5 * height * cosine, 0.5 * height * sine, height)
    });
    let mut mesh = TetMesh {
        positions: vec![DVec3::ZERO, base[0], base[1], base[2]],
        tets: vec![[0, 2, 1, 3].map(ParticleId::new)],
    };
    if is_up {
        mesh.positions
            .iter_mut()
            .for_each(|x| *x = dvec3(x.x, -x.y, -x.z));
    }
    let [a, b, c, d] = mesh.tets[0].map(|p| mesh.positions[p.index()]);
    if (b - a).dot((c - a).cross(d - a)) < 0.0 {
        mesh.tets[0].swap(1, 2);
    }
    mesh
}

/// A box on its edge along x: a wedge that points up.
fn wedge(length: f64) -> TetMesh {
    let mut mesh = kuhn_box([2, 1, 1], dvec3(length, 0.1, 0.1));
    let turn = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_4);
    for x in &mut mesh.positions {
        *x = turn * (*x - dvec3(0.5 * length, 0.1, 0.1));
    }
    mesh
}

/// What lies below is fixed, what is above falls on it.
fn falls_on(below: &[(TetMesh, DVec3)], above: (TetMesh, DVec3)) -> SimulationBuilder {
    let mut builder = Simulation::builder();
    builder.gravity(GRAVITY).solver(solver(Precision::F64, 20));
    for (mesh, at) in below {
        builder.add_body(Body::new(mesh.clone()).position(*at).pinned(|_| true));
    }
    let (mesh, at) = above;
    builder.add_body(
        Body::new(mesh)
            .position(at)
            .young_modulus(3e5)
            .damping(0.005),
    );
    builder.contact(with_friction(0.3));
    builder
}

/// Spike on spike, spike in a wedge-shaped groove, wedge across wedge, over the edge of a cliff, and on the crack
/// between two boxes: nothing passes through, nothing is inside of anything, nothing gains speed.
#[test]
fn hard_cases() {
    let cube = |at: DVec3| (kuhn_box([2; 3], DVec3::splat(0.1)), at);
    let small = |at: DVec3| (kuhn_box([1; 3], DVec3::splat(0.08)), at);
    let cases = [
        (
            "spike on spike",
            vec![(spike(true, 0.1), DVec3::ZERO)],
            (spike(false, 0.1), DVec3::Z * 0.002),
        ),
        (
            "spike in a groove",
            vec![
                (wedge(0.3), DVec3::Y * 0.075),
                (wedge(0.3), DVec3::NEG_Y * 0.075),
            ],
            (spike(false, 0.1), dvec3(0.01, 0.0, -0.05)),
        ),
        ("wedge across wedge", vec![(wedge(0.3), DVec3::ZERO)], {
            let mut above = wedge(0.3);
            above
                .positions
                .iter_mut()
                .for_each(|x| *x = dvec3(-x.y, -x.x, -x.z));
            (above, dvec3(0.0, 0.0, 0.002))
        }),
        (
            "cliff",
            vec![cube(DVec3::ZERO)],
            small(dvec3(0.07, 0.013, 0.101)),
        ),
        (
            "crack",
            vec![cube(DVec3::ZERO), cube(DVec3::X * 0.1)],
            (spike(false, 0.1), dvec3(0.1, 0.043, 0.102)),
        ),
    ];
    for (name, below, above) in cases {
        let mut simulation = falls_on(&below, above).build().unwrap();
        let count = simulation.positions().len();
        let falling: usize = count - below.iter().map(|b| b.0.positions.len()).sum::<usize>();
        let start = center(&simulation, count - falling..count).z;
        for frame in 0..60 {
            let report = simulation.step().unwrap();
            assert_eq!(report.repaired, 0, "{name}, frame {frame}");
            // 2% of the smallest edge.
            assert_eq!(intruders(&simulation, 1e-3), 0, "{name}, frame {frame}");
            let z = center(&simulation, count - falling..count).z;
            assert!(
                z < start + 1e-3,
                "{name}: thrown up to {z} in frame {frame}"
            );
        }
        simulation.check().unwrap();
    }
}

/// A block that slides over coplanar triangles of another density is stopped by friction alone: no inner edge is felt.
#[test]
fn inner_edges_are_not_felt() {
    let mut builder = Simulation::builder();
    builder.gravity(GRAVITY).solver(solver(Precision::F64, 20));
    let floor = kuhn_box([17, 5, 1], dvec3(1.0, 0.3, 0.05));
    builder.add_body(Body::new(floor).pinned(|_| true));
    let block = Body::new(kuhn_box([2, 3, 1], dvec3(0.1, 0.12, 0.05)));
    builder.add_body(
        block
            .position(dvec3(0.05, 0.083, 0.05))
            .young_modulus(1e6)
            .damping(0.01),
    );
    builder.contact(with_friction(0.0));
    let mut simulation = builder.build().unwrap();
    simulation
        .set_velocities(|x| if x.z > 0.049 { DVec3::X } else { DVec3::ZERO })
        .unwrap();
    let count = simulation.positions().len();
    let block = count - 3 * 4 * 2..count;
    let mut before = center(&simulation, block.clone());
    for frame in 0..40 {
        steps(&mut simulation, 1);
        let now = center(&simulation, block.clone());
        let speed = (now - before) / simulation.time_step();
        before = now;
        // 1% of the speed, and no bumps.
        assert!((speed.x - 1.0).abs() < 0.01, "{speed} in frame {frame}");
        assert!(
            speed.y.abs() < 0.01 && (frame < 5 || speed.z.abs() < 0.02),
            "{speed} in {frame}"
        );
    }
}

/// A block with a speed slides on a fixed sheet whose edges are as long as its own, half of them or a quarter: friction
/// stops it after the same way, though triangles of the block have up to sixteen times as many vertices below them, and more
/// colors.
#[test]
fn the_density_of_a_sheet_is_not_felt() {
    let slide = |density: usize| {
        let mut builder = Simulation::builder();
        builder.gravity(GRAVITY).solver(solver(Precision::F64, 20));
        let sheet = kuhn_box([10 * density, 4 * density, 1], dvec3(0.5, 0.2, 0.05));
        builder.add_body(Body::new(sheet).pinned(|_| true));
        let block = Body::new(kuhn_box([2, 2, 1], dvec3(0.1, 0.1, 0.05)));
        let block = block.position(dvec3(0.063, 0.047, 0.05));
        builder.add_body(block.young_modulus(1e6).damping(0.01));
        builder.contact(with_friction(0.3));
        let mut simulation = builder.build().unwrap();
        // It lies down first.
        steps(&mut simulation, 10);
        simulation
            .set_velocities(|x| if x.z > 0.049 { DVec3::X } else { DVec3::ZERO })
            .unwrap();
        let count = simulation.positions().len();
        let block = count - 3 * 3 * 2..count;
        let start = center(&simulation, block.clone());
        let mut colors = 0;
        for _ in 0..30 {
            steps(&mut simulation, 1);
            let contact = simulation.report().contact.unwrap();
            colors = colors.max(contact.colors);
        }
        (center(&simulation, block) - start, colors)
    };
    // The way until friction has taken the kinetic energy.
    let way = 1.0 / (2.0 * 0.3 * GRAVITY.length());
    let mut least = 0;
    for density in [1, 2, 4] {
        let (moved, colors) = slide(density);
        assert!((moved.x / way - 1.0).abs() < 0.02, "{moved} at {density}");
        assert!(moved.y.abs() < 0.02 * way, "{moved} at {density}");
        assert!(colors > least, "{colors} colors at {density}");
        least = colors;
    }
}

/// The sides of a cut slide past each other by several edges without friction: where their contact passes from pairs to
/// vertices and triangles, and from triangle to triangle, the speed does not jump.
#[test]
fn sides_of_a_cut_slide_past_each_other() {
    let mut builder = Simulation::builder();
    builder.gravity(GRAVITY).solver(solver(Precision::F64, 20));
    let block = kuhn_box([8, 4, 4], dvec3(0.4, 0.2, 0.2));
    let block = Body::new(block).pinned(|x| x.z < 0.06);
    builder.add_body(block.young_modulus(1e6).damping(0.01));
    builder.contact(with_friction(0.0));
    builder.add_stroke(cut(0, dvec3(0.2, 0.1, 0.113), DVec3::Z));
    let mut simulation = builder.build().unwrap();
    steps(&mut simulation, 5);
    let upper: Vec<usize> = (0..simulation.positions().len())
        .filter(|&p| simulation.mesh().positions[p].z > 0.14)
        .collect();
    // Where the particles of the upper piece are.
    let (mesh, pieces) = (simulation.mesh(), simulation.piece_numbers());
    let has_upper = |tet: &[ParticleId; 4]| tet.iter().any(|p| p.index() == upper[0]);
    let tet = mesh.tets.iter().position(has_upper).unwrap();
    let of_piece = mesh.tets.iter().zip(&pieces);
    let moving: Vec<DVec3> = of_piece
        .filter(|(_, piece)| **piece == pieces[tet])
        .flat_map(|(corners, _)| corners.map(|p| simulation.positions()[p.index()]))
        .collect();
    // Particles on both sides of the cut may be at one place: those of the lower one are let go of at once.
    simulation
        .set_velocities(|x| {
            if moving.contains(&x) {
                DVec3::X
            } else {
                DVec3::ZERO
            }
        })
        .unwrap();
    steps(&mut simulation, 1);
    let mean = |simulation: &Simulation| {
        let sum: DVec3 = upper.iter().map(|&p| simulation.positions()[p]).sum();
        sum / upper.len() as f64
    };
    let mut before = mean(&simulation);
    let start = before;
    for frame in 0..10 {
        steps(&mut simulation, 1);
        let now = mean(&simulation);
        let speed = (now - before) / simulation.time_step();
        before = now;
        assert!((speed.x - 1.0).abs() < 0.05, "{speed} in frame {frame}");
        assert!(
            speed.y.abs() < 0.05 && speed.z.abs() < 0.05,
            "{speed} in frame {frame}"
        );
    }
    // Three edges.
    assert!(before.x - start.x > 0.15);
    simulation.check().unwrap();
}

/// Two balls that collide never have more energy than at the start, with substeps that resolve the impact: with fewer,
/// tets that are not solved yet are strained more than they would be.
#[test]
fn a_collision_gains_no_energy() {
    let mut builder = Simulation::builder();
    builder
        .solver(solver(Precision::F64, 160))
        .report(ReportSpec::default().with(|spec| {
            spec.every = 1;
            spec.quantities = vec![Quantity::Energy];
        }));
    let ball = generate(Shape::Sphere, 600).unwrap();
    for at in [DVec3::ZERO, dvec3(0.21, 0.03, 0.02)] {
        let ball = Body::new(ball.clone()).scale(0.1).position(at);
        builder.add_body(ball.young_modulus(1e5));
    }
    builder.contact(with_friction(0.0));
    let mut simulation = builder.build().unwrap();
    simulation
        .set_velocities(|x| DVec3::X * if x.x < 0.105 { 1.0 } else { -1.0 })
        .unwrap();
    let mass: f64 = simulation.pieces().iter().map(|piece| piece.mass).sum();
    let (start, mut pressed) = (0.5 * mass, 0);
    for frame in 0..12 {
        steps(&mut simulation, 1);
        let energy = simulation.report().energy.unwrap();
        let sum = energy.kinetic + energy.elastic;
        assert!(sum < 1.001 * start, "{sum} of {start} in frame {frame}");
        pressed += simulation.report().contact.unwrap().active;
    }
    assert!(pressed > 10);
}
