//! Bodies that a program adds and removes while a simulation runs, and bodies of several materials.

use incise::cutting::Skin;
use incise::mesh::glam::DVec3;
use incise::meshing::{Shape, generate};
use incise::scene::{
    AttachmentSpec, MaterialSpec, Precision, Region, SleepSpec, SolverSpec, StrokeSpec,
};
use incise::{Body, Simulation, SimulationBuilder};

use crate::support::state;

fn solved(precision: Precision) -> SimulationBuilder {
    let mut builder = Simulation::builder();
    builder.solver(SolverSpec::default().with(|spec| spec.precision = precision));
    builder.gravity(DVec3::NEG_Z * 9.81).ground(-0.6, 0.5);
    builder
}

fn ball(x: f64) -> Body {
    Body::new(generate(Shape::Sphere, 300).unwrap()).position(DVec3::X * x)
}

fn slab(x: f64) -> Body {
    Body::new(generate(Shape::Box, 250).unwrap()).position(DVec3::X * x)
}

fn halving(x: f64) -> StrokeSpec {
    StrokeSpec::plane(0, [x, 0.0, 0.0], [1.0, 0.1, 0.0])
}

/// Added before the first frame is declared, to the bit; so is a body beside one that was removed.
#[test]
fn a_body_added_at_the_start_is_one_declared() {
    for precision in [Precision::F32, Precision::F64] {
        let run = |declared: bool| {
            let mut builder = solved(precision);
            builder.add_body(ball(0.0));
            let mut simulation = if declared {
                builder.add_body(slab(2.0));
                builder.build().unwrap()
            } else {
                let mut simulation = builder.build().unwrap();
                let body = simulation.add_body(slab(2.0)).unwrap();
                assert_eq!(body.index(), 1);
                simulation
            };
            simulation.cut(halving(2.01)).unwrap();
            for _ in 0..8 {
                simulation.step().unwrap();
            }
            simulation.check().unwrap();
            state(&simulation)
        };
        assert!(run(true) == run(false));
    }
}

/// Bodies come and go between cuts and under a blade that moves. After each frame all that is derived is proved, a skin
/// made from the deltas is that of the boundary, and what a body does is what it does alone.
#[test]
fn bodies_come_and_go_among_cuts() {
    let mut builder = solved(Precision::F64);
    let first = builder.add_body(ball(0.0));
    let mut simulation = builder.build().unwrap();
    let alone = {
        let mut builder = solved(Precision::F64);
        builder.add_body(ball(0.0));
        let mut simulation = builder.build().unwrap();
        (0..24)
            .map(|_| {
                simulation.step().unwrap();
                simulation.positions().to_vec()
            })
            .collect::<Vec<_>>()
    };
    let particles = simulation.mesh().positions.len();
    let mut skin = Skin::new(simulation.boundary());
    let mut second = None;
    let mut saved = None;
    let blade = |x: f64| [DVec3::new(x, 0.0, 2.0), DVec3::new(x, 0.0, -2.0)];
    let stroke = simulation.begin_stroke(&blade(1.2), 0.1).unwrap();
    for frame in 0..24_u32 {
        match frame {
            3 => {
                second = Some(simulation.add_body(slab(2.0)).unwrap());
                skin = Skin::new(simulation.boundary());
            }
            12 => simulation.end_stroke(stroke).unwrap(),
            13 => simulation.cut(halving(2.0)).unwrap(),
            15 => saved = Some(simulation.snapshot().unwrap()),
            16 => simulation.remove_body(second.unwrap()).unwrap(),
            20 => {
                simulation.add_body(slab(4.0)).unwrap();
                skin = Skin::new(simulation.boundary());
            }
            _ => {}
        }
        if (4..12).contains(&frame) {
            let x = 1.2 + 0.2 * f64::from(frame - 3);
            simulation.move_blade(stroke, &blade(x)).unwrap();
        }
        simulation.step().unwrap();
        simulation.check().unwrap();
        for delta in simulation.deltas() {
            skin.apply_delta(delta);
        }
        let particle = |v: u32| skin.vertices()[v as usize].particle.0;
        let rotated = |[a, b, c]: [u32; 3]| [[a, b, c], [b, c, a], [c, a, b]].into_iter().min();
        let drawn = skin.triangles().iter().map(|t| rotated(t.map(particle)));
        let mut told: Vec<_> = drawn.collect();
        let boundary = simulation.boundary();
        let mut there: Vec<_> = boundary
            .map(|t| rotated(t.particles.map(|p| p.0)))
            .collect();
        told.sort_unstable();
        there.sort_unstable();
        assert!(told == there, "frame {frame}");
        // Numbers of tets and pieces fit together.
        let numbers = simulation.piece_numbers();
        for piece in simulation.pieces() {
            let tets = numbers.iter().filter(|&&number| number == piece.id).count();
            assert_eq!(tets, piece.tets, "frame {frame}");
        }
        let bits = |x: &[DVec3]| x.iter().map(|x| x.to_array()).collect::<Vec<_>>();
        let now = &simulation.positions()[..particles];
        assert!(bits(now) == bits(&alone[frame as usize]), "frame {frame}");
    }
    assert!(simulation.remove_body(second.unwrap()).is_err());
    let bodies: Vec<usize> = simulation.pieces().iter().map(|piece| piece.body).collect();
    assert_eq!(bodies, [0, 2]);
    // Back to where the second body was in pieces; what follows is the same again.
    simulation.restore(&saved.unwrap()).unwrap();
    simulation.check().unwrap();
    assert!(
        simulation
            .pieces()
            .iter()
            .filter(|piece| piece.body == 1)
            .count()
            >= 2
    );
    simulation.remove_body(second.unwrap()).unwrap();
    simulation.remove_body(first).unwrap();
    simulation.step().unwrap();
    simulation.check().unwrap();
    assert!(simulation.pieces().is_empty() && simulation.mesh().tets.is_empty());
    // An empty world continues, and takes bodies.
    simulation.step().unwrap();
    simulation.add_body(ball(0.0)).unwrap();
    assert_eq!(simulation.step().unwrap().pieces, 1);
    simulation.check().unwrap();
}

/// A body that is added with sleep on sleeps by itself; what is refused changes nothing.
#[test]
fn bad_bodies_are_refused() {
    let mut builder = solved(Precision::F32);
    builder.solver(SolverSpec::default().with(|spec| spec.sleep = Some(SleepSpec::new(1e-3, 0.1))));
    builder.add_body(ball(0.0));
    let mut simulation = builder.build().unwrap();
    simulation.step().unwrap();
    let before = state(&simulation);
    let mut torn = generate(Shape::Box, 200).unwrap();
    torn.positions[0].x = f64::NAN;
    for body in [
        ball(0.0).young_modulus(-1.0),
        ball(1e10),
        Body::new(torn),
        ball(0.0).pinned_particles([1_000_000]),
        ball(0.0).material(
            MaterialSpec::default().with(|spec| spec.regions = vec![Region::Tets(vec![1_000_000])]),
        ),
        ball(0.0).material(MaterialSpec::default().with(|spec| spec.poisson_ratio = Some(0.5))),
    ] {
        assert!(simulation.add_body(body).is_err());
    }
    assert!(state(&simulation) == before);
    simulation.add_body(ball(3.0)).unwrap();
    simulation.step().unwrap();
    simulation.check().unwrap();
}

/// Two springs in series: of a bar whose one half is ten times as stiff, the soft half takes ten elevenths of the stretch.
#[test]
fn materials_of_a_body_share_a_stretch_as_springs_in_series() {
    let mesh = generate(Shape::Beam, 1500).unwrap();
    let body = Body::new(mesh)
        .young_modulus(1e5)
        .poisson_ratio(0.0)
        .damping(0.05)
        .material(MaterialSpec::default().with(|spec| {
            spec.regions = vec![Region::half_space([0.0; 3], [1.0, 0.0, 0.0])];
            spec.young_modulus = Some(1e6);
            spec.density = Some(3000.0);
        }));
    let mut builder = Simulation::builder();
    builder.add_body(body);
    let end = |sign: f64| Region::half_space([0.499 * sign, 0.0, 0.0], [sign, 0.0, 0.0]);
    builder.add_attachment(AttachmentSpec::new(0, vec![end(-1.0)]));
    builder.add_attachment(AttachmentSpec::new(0, vec![end(1.0)]).with(|spec| {
        spec.frames = [0, 30];
        spec.path = vec![[0.0; 3], [0.02, 0.0, 0.0]];
    }));
    let mut simulation = builder.build().unwrap();
    for _ in 0..120 {
        simulation.step().unwrap();
    }
    let rest = &simulation.mesh().positions;
    let near = rest.iter().zip(simulation.positions());
    let near: Vec<f64> = near
        .filter(|(rest, _)| rest.x.abs() < 0.06)
        .map(|(rest, x)| {
            // On either side of the middle the stretch grows at the rate of its half.
            let [soft, stiff] = [10.0, 1.0].map(|share| 0.02 * share / 5.5);
            (x.x - rest.x) - rest.x * if rest.x < 0.0 { soft } else { stiff }
        })
        .collect();
    let middle = near.iter().sum::<f64>() / near.len() as f64;
    let expected = 0.02 * 10.0 / 11.0;
    assert!(
        (middle / expected - 1.0).abs() < 0.02,
        "{middle} for {expected}"
    );

    // Pieces weigh what their tets do, before a cut through both parts and after.
    let mass = |simulation: &Simulation| -> f64 {
        simulation.pieces().iter().map(|piece| piece.mass).sum()
    };
    let volume = simulation.mesh().total_volume();
    let whole = mass(&simulation);
    assert!((whole / (2000.0 * volume) - 1.0).abs() < 0.05, "{whole}");
    simulation
        .cut(StrokeSpec::plane(0, [0.0; 3], [0.3, 1.0, 0.0]))
        .unwrap();
    simulation.step().unwrap();
    let detached: f64 = simulation.report().detached.iter().map(|d| d.mass).sum();
    let pieces = simulation.pieces();
    assert_eq!(pieces.len(), 2);
    assert!((pieces[1].mass - detached).abs() < 1e-12);
    assert!((mass(&simulation) / whole - 1.0).abs() < 1e-9);
    simulation.check().unwrap();
}

/// Parts by region and by lists of tets are one and the same; the last part counts; `fixed` takes no tets.
#[test]
fn parts_are_regions_or_lists_of_tets() {
    let mesh = generate(Shape::Box, 300).unwrap();
    let upper = Region::half_space([0.0, 0.0, 0.1], [0.0, 0.0, 1.0]);
    let centers = mesh.tets.iter().map(|tet| {
        let corners = tet.map(|p| mesh.positions[p.index()]);
        corners.iter().sum::<DVec3>() / 4.0
    });
    let list: Vec<u32> = (0..)
        .zip(centers)
        .filter(|(_, x)| x.z >= 0.1)
        .map(|(t, _)| t)
        .collect();
    let part = |regions, young_modulus| {
        MaterialSpec::default().with(|spec| {
            spec.regions = regions;
            spec.young_modulus = Some(young_modulus);
        })
    };
    let run = |parts: Vec<MaterialSpec>| {
        let mut builder = solved(Precision::F64);
        let body = Body::new(mesh.clone()).young_modulus(1e4);
        builder.add_body(parts.into_iter().fold(body, Body::material));
        let mut simulation = builder.build().unwrap();
        for _ in 0..20 {
            simulation.step().unwrap();
        }
        simulation.positions().to_vec()
    };
    let by_region = run(vec![part(vec![upper.clone()], 1e6)]);
    assert!(by_region == run(vec![part(vec![Region::Tets(list.clone())], 1e6)]));
    let everything = part(vec![upper.clone()], 1e2);
    let again = part(vec![Region::Tets(list)], 1e6);
    let overlapping = run(vec![everything, again]);
    let off = by_region
        .iter()
        .zip(&overlapping)
        .map(|(a, b)| a.distance(*b));
    assert!(off.fold(0.0, f64::max) < 1e-9);
    assert!(by_region != run(vec![]));
    let text = "[[body]]\nshape = { kind = \"box\", tets = 200 }\nfixed = [{ tets = [0] }]";
    let scene = incise::Scene::from_toml(text).unwrap();
    let error = Simulation::new(&scene).unwrap_err().to_string();
    assert!(error.contains("body[0].fixed[0].tets"), "{error}");
}

/// A collider with a velocity moves on where the body that was first is gone, for those that are left and those to come.
#[test]
fn colliders_move_on_without_the_first_body() {
    let mut builder = solved(Precision::F64);
    let first = builder.add_body(ball(0.0));
    builder.add_body(slab(3.0));
    let plate = builder.add_collider(
        incise::scene::ColliderSpec::plane([0.0, 0.0, 5.0], [0.0, 0.0, -1.0])
            .with_velocity([0.0, 0.0, -1.0]),
    );
    let mut simulation = builder.build().unwrap();
    simulation.step().unwrap();
    simulation.remove_body(first).unwrap();
    for _ in 0..9 {
        simulation.step().unwrap();
    }
    let time = 10.0 * simulation.time_step();
    let height = simulation.collider_position(plate).unwrap().z;
    assert!((height - (5.0 - time)).abs() < 1e-12, "{height}");
    // The plate is below this one's top already, and holds it down.
    simulation
        .add_body(slab(6.0).position(DVec3::new(6.0, 0.0, 4.5)))
        .unwrap();
    let top = |simulation: &Simulation| {
        let heights = simulation.positions().iter().map(|x| x.z);
        heights.fold(f64::MIN, f64::max)
    };
    let above = top(&simulation) - height;
    assert!(above > 0.01, "{above}");
    for frame in 1..=20 {
        simulation.step().unwrap();
        let left = above * (-f64::from(frame) * simulation.time_step() / 0.02).exp();
        let height = simulation.collider_position(plate).unwrap().z;
        let top = top(&simulation);
        assert!(top <= height + left + 1e-9, "{top} above {height}");
    }
}
