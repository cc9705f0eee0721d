//! Several bodies: each moves and is cut as it would alone, whatever the others do.

use std::path::Path;

use incise::mesh::glam::DVec3;
use incise::mesh::kuhn_box;
use incise::scene::Precision;
use incise::{Body, Scene, Simulation};

use crate::support::{body, plane, scene, simulation, state, sweep};

const WORLD: &str =
    "[world]\ngravity = [0.0, 0.0, -9.81]\nground = { height = -0.8, friction = 0.4 }\n";

/// A plane and a sweep that cut whatever is around the x axis.
fn strokes() -> String {
    plane(2, [0.03, 0.0, 0.0], [1.0, 0.1, 0.0])
        + &sweep(
            [1, 4],
            [[-0.2, -3.0, 0.7], [0.2, 3.0, 0.7]],
            [0.0, 0.0, -1.4],
        )
}

/// Three bodies side by side.
fn three() -> [String; 3] {
    [
        body("sphere", 300, [0.0, -1.2, 0.0]),
        body("box", 250, [0.0, 0.0, 0.0]) + "damping = 0.001\n",
        body("torus", 400, [0.0, 1.2, 0.0]),
    ]
}

/// For each body the particles and tets of a mesh that it has at the start.
fn ranges(bodies: &[String]) -> Vec<[usize; 2]> {
    let sizes = bodies.iter().map(|text| {
        let simulation = simulation(&scene(text));
        let mesh = simulation.mesh();
        [mesh.positions.len(), mesh.tets.len()]
    });
    sizes.collect()
}

/// The positions of the tets' corners, sorted: what a body is, whatever the numbers.
fn shape(simulation: &Simulation, tets: impl Iterator<Item = usize>) -> Vec<[[u64; 3]; 4]> {
    let (mesh, x) = (simulation.mesh(), simulation.positions());
    let bits = |p: incise::mesh::ParticleId| x[p.index()].to_array().map(f64::to_bits);
    let mut shape: Vec<_> = tets.map(|t| mesh.tets[t].map(bits)).collect();
    shape.sort_unstable();
    shape
}

/// Which body each tet belongs to: pieces keep to bodies, and the first tets say which.
fn body_of_tets(simulation: &Simulation, sizes: &[[usize; 2]]) -> Vec<usize> {
    let mut body_of_particle = Vec::new();
    for (body, size) in sizes.iter().enumerate() {
        body_of_particle.resize(body_of_particle.len() + size[0], body);
    }
    // New particles are at rest where they were cut: nearest to their body, which are 1.2 m apart.
    for x in &simulation.mesh().positions[body_of_particle.len()..] {
        body_of_particle.push(if x.y < -0.6 {
            0
        } else {
            usize::from(x.y > 0.6) + 1
        });
    }
    let tets = simulation.mesh().tets.iter();
    tets.map(|tet| body_of_particle[tet[0].index()]).collect()
}

#[test]
fn a_body_moves_to_the_bit_as_alone() {
    let bodies = three();
    let sizes = ranges(&bodies);
    for precision in [Precision::F32, Precision::F64] {
        let with = |bodies: &str| {
            let mut scene = scene(&format!("{WORLD}{bodies}{}", strokes()));
            scene.solver.precision = precision;
            simulation(&scene)
        };
        let mut together = with(&bodies.concat());
        let mut alone: Vec<_> = bodies.iter().map(|body| with(body)).collect();
        for frame in 0..7 {
            let cut = together.step().unwrap().cut;
            let mut created = 0;
            for single in &mut alone {
                let cut = single.step().unwrap().cut;
                created += cut.map_or(0, |cut| cut.tets_created);
            }
            assert_eq!(cut.map_or(0, |cut| cut.tets_created), created);
            together.check().unwrap();
            let owner = body_of_tets(&together, &sizes);
            for (number, single) in alone.iter().enumerate() {
                let own = (0..owner.len()).filter(|t| owner[*t] == number);
                let all = 0..single.mesh().tets.len();
                assert!(
                    shape(&together, own) == shape(single, all),
                    "{precision:?}: body {number} differs in frame {frame}"
                );
            }
            let sum = |of: fn(&Simulation) -> usize| alone.iter().map(of).sum::<usize>();
            let report = together.report();
            assert_eq!(report.pieces, sum(|s| s.report().pieces));
            assert_eq!(report.clusters, sum(|s| s.report().clusters));
            assert_eq!(report.tets, sum(|s| s.report().tets));
            let colors = alone.iter().map(|s| s.report().colors).max().unwrap();
            assert_eq!(report.colors, colors);
        }
        assert!(together.report().pieces >= 6);
    }
}

/// Particles and tets are numbered body by body, and a cut gives no particle another number.
#[test]
fn numbers_are_those_of_the_scene_and_stay() {
    let bodies = three();
    let sizes = ranges(&bodies);
    let mut simulation = simulation(&scene(&(bodies.concat() + &strokes())));
    let start = simulation.mesh().clone();
    let mut first = [0, 0];
    for (text, size) in bodies.iter().zip(&sizes) {
        let single = crate::support::simulation(&scene(text));
        let alone = single.mesh();
        let positions = &start.positions[first[0]..first[0] + size[0]];
        assert_eq!(positions, alone.positions);
        let tets = &start.tets[first[1]..first[1] + size[1]];
        let back = tets
            .iter()
            .map(|tet| tet.map(|p| p.index() - first[0]))
            .collect::<Vec<_>>();
        let own: Vec<_> = alone
            .tets
            .iter()
            .map(|tet| tet.map(|p| p.index()))
            .collect();
        assert_eq!(back, own);
        first = [first[0] + size[0], first[1] + size[1]];
    }
    let mut before = start;
    for _ in 0..6 {
        simulation.step().unwrap();
        let mesh = simulation.mesh();
        assert_eq!(mesh.positions[..before.positions.len()], before.positions);
        assert_eq!(simulation.positions().len(), mesh.positions.len());
        assert!(simulation.on_cut().len() <= mesh.positions.len());
        before = mesh.clone();
    }
    // A triangle of a cut face lies on the plane or the sweep; none of the first surface's does.
    let surface = simulation.surface();
    let on_cut = simulation.on_cut();
    let marked = |p: &incise::mesh::ParticleId| on_cut.get(p.index()).copied().unwrap_or(false);
    let faces = surface.triangles.iter().filter(|t| t.iter().all(marked));
    assert!(faces.count() > 100);
}

#[test]
fn the_plan_of_the_whole_is_proper() {
    let mut simulation = simulation(&scene(&(three().concat() + &strokes())));
    for _ in 0..6 {
        let mesh = simulation.mesh();
        let incidence = incise::graph::Incidence::from_constraints(
            mesh.positions.len(),
            mesh.tets.iter().map(|tet| tet.map(|p| p.0)),
        )
        .unwrap();
        let (clustering, coloring) = (simulation.clustering(), simulation.coloring());
        clustering.check().unwrap();
        coloring
            .verify_incidence(&incidence.quotient(&clustering))
            .unwrap();
        simulation.schedule().check(&incidence).unwrap();
        assert_eq!(simulation.report().clusters, clustering.occupied());
        assert_eq!(
            simulation.report().colors,
            simulation.schedule().color_count()
        );
        simulation.step().unwrap();
    }
}

#[test]
fn threads_do_not_change_several_bodies() {
    let scene = scene(&format!("{WORLD}{}{}", three().concat(), strokes()));
    let [mut one, mut two, mut many] =
        [1, 2, 5].map(|threads| Simulation::with_threads(&scene, threads).unwrap());
    for _ in 0..6 {
        let cuts = [&mut one, &mut two, &mut many].map(|s| s.step().unwrap().cut);
        assert!(cuts[0] == cuts[1] && cuts[1] == cuts[2]);
        assert!(state(&one) == state(&two) && state(&two) == state(&many));
    }
}

/// Quantities of several bodies are the sums or extremes of each one's.
#[test]
fn quantities_are_those_of_all_bodies() {
    let report =
        "[report]\nquantities = [\"residual\", \"energy\", \"volume\", \"speed\", \"kappa\"]\n";
    let run = |bodies: &str| {
        let solver = "[solver]\nsubsteps = 5\nkappa_limit = 1.0\n";
        let mut simulation = simulation(&scene(&format!(
            "{report}{solver}{WORLD}{bodies}{}",
            strokes()
        )));
        (0..3).for_each(|_| drop(simulation.step().unwrap().clone()));
        simulation.report().clone()
    };
    let together = run(&three().concat());
    let alone = three().map(|body| run(&body));
    let near = |a: f64, b: f64| assert!((a - b).abs() <= 1e-12 * b.abs(), "{a} is not {b}");
    let sum = |of: &dyn Fn(&incise::FrameReport) -> f64| alone.iter().map(of).sum::<f64>();
    let max = |of: &dyn Fn(&incise::FrameReport) -> f64| alone.iter().map(of).fold(0.0, f64::max);
    near(together.volume.unwrap(), sum(&|r| r.volume.unwrap()));
    let energy = together.energy.unwrap();
    near(energy.kinetic, sum(&|r| r.energy.unwrap().kinetic));
    near(energy.elastic, sum(&|r| r.energy.unwrap().elastic));
    near(energy.gravity, sum(&|r| r.energy.unwrap().gravity));
    assert_eq!(together.max_speed.unwrap(), max(&|r| r.max_speed.unwrap()));
    assert_eq!(together.kappa.unwrap(), max(&|r| r.kappa.unwrap()));
    let residual = together.residual.unwrap();
    let square = |x: f64| x * x;
    let primal = sum(&|r| square(r.residual.unwrap().primal.unwrap()));
    near(square(residual.primal.unwrap()), primal);
    near(
        square(residual.dual.unwrap()),
        sum(&|r| square(r.residual.unwrap().dual.unwrap())),
    );
    let softened = together.softened.unwrap();
    let tets: usize = alone.iter().map(|r| r.softened.unwrap().tets).sum();
    assert!(tets > 0 && softened.tets == tets);
    let soft_volume = sum(&|r| r.softened.unwrap().volume_fraction * r.volume.unwrap());
    assert!((softened.volume_fraction * together.volume.unwrap() / soft_volume - 1.0).abs() < 0.01);
}

/// One stroke of the fixture halves a sphere and a torus.
#[test]
fn the_fixture_of_two_bodies_is_cut_in_one_stroke() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/two_bodies.toml");
    let mut scene = Scene::load(&path).unwrap();
    for body in &mut scene.body {
        body.shape.as_mut().unwrap().tets /= 3;
    }
    let mut simulation = simulation(&scene);
    let cuts = (0..6).filter(|_| simulation.step().unwrap().cut.is_some());
    assert_eq!(cuts.count(), 1);
    assert_eq!(simulation.report().pieces, 4);
    simulation.check().unwrap();
}

/// The third body of three is tied to the first: they are solved together, the second on its own and as alone.
#[test]
fn linked_bodies_share_an_island_and_others_do_not() {
    let bodies = three();
    let link = "[[distance]]\nfrom = { body = 2, point = [0, 0.8, 0] }\nto = { body = 0, point = [0, -0.8, 0] }\ncompliance = 1e-5\n";
    let report = "[report]\nquantities = [\"kappa\"]\n[solver]\nsubsteps = 2\n";
    let second = bodies[1].clone() + "substeps = 7\n";
    let with = |bodies: &str| simulation(&scene(&format!("{report}{WORLD}{bodies}{}", strokes())));
    let mut tied = with(&format!("{}{second}{}{link}", bodies[0], bodies[2]));
    let mut loose = with(&format!("{}{second}{}", bodies[0], bodies[2]));
    let mut alone = with(&second);
    let sizes = ranges(&bodies);
    for frame in 0..7 {
        for simulation in [&mut tied, &mut loose, &mut alone] {
            simulation.step().unwrap();
            simulation.check().unwrap();
        }
        let islands = |simulation: &Simulation| {
            let islands = simulation.report().bodies.iter();
            islands
                .map(|island| (island.bodies.clone(), island.substeps))
                .collect::<Vec<_>>()
        };
        assert_eq!(islands(&tied), [(vec![0, 2], 2), (vec![1], 7)]);
        assert_eq!(islands(&loose), [(vec![0], 2), (vec![1], 7), (vec![2], 2)]);
        let owner = body_of_tets(&tied, &sizes);
        let own = (0..owner.len()).filter(|t| owner[*t] == 1);
        let all = 0..alone.mesh().tets.len();
        assert!(
            shape(&tied, own) == shape(&alone, all),
            "the second body differs in frame {frame}"
        );
    }
    // The thread pulls: the first particles of the first body are elsewhere than without.
    assert!(tied.positions()[..50] != loose.positions()[..50]);
}

/// The second of two bodies is held and pulled away; the first falls as alone.
#[test]
fn a_handle_on_one_of_two_bodies_moves_that_one() {
    let bodies = [
        body("box", 200, [0.0; 3]),
        body("box", 200, [2.0, 0.0, 0.0]),
    ];
    let handle = "[[attachment]]\nbody = 1\nregions = [{ half_space = { point = [2, 0, 0.3], normal = [0, 0, 1] } }]\n\
        frames = [1, 5]\npath = [[0, 0, 0], [0, 0, 0.1]]\n";
    let with = |text: &str| {
        let mut scene = scene(&format!("{WORLD}{text}"));
        scene.solver.precision = Precision::F64;
        simulation(&scene)
    };
    let mut held = with(&format!("{}{handle}", bodies.concat()));
    let mut alone = with(&bodies[0]);
    for _ in 0..8 {
        held.step().unwrap();
        alone.step().unwrap();
        held.check().unwrap();
    }
    let first = alone.positions().len();
    assert!(held.positions()[..first] == *alone.positions());
    let second = held.mesh().positions.iter().zip(held.positions());
    let top: Vec<_> = second
        .skip(first)
        .filter(|(rest, _)| rest.z >= 0.3)
        .collect();
    assert!(top.len() > 10);
    for (rest, x) in top {
        // Rounding of a sum.
        assert!(x.distance(*rest + DVec3::Z * 0.1) < 1e-12);
    }
}

/// A body a thousand kilometers away moves as here, is cut as here, and the one here does not feel it.
#[test]
fn a_body_far_away_moves_and_is_cut_as_here() {
    let far = 1_048_576.0;
    let bodies = body("box", 200, [0.0; 3]) + &body("box", 200, [far, 0.0, 0.0]);
    let cuts = plane(1, [0.05, 0.0, 0.0], [1.0, 0.2, 0.0])
        + &plane(1, [far + 0.05, 0.0, 0.0], [1.0, 0.2, 0.0]);
    let mut simulation = simulation(&scene(&format!("{WORLD}{bodies}{cuts}")));
    let count = simulation.mesh().positions.len() / 2;
    for _ in 0..10 {
        simulation.step().unwrap();
        simulation.check().unwrap();
        let x = simulation.positions();
        let shift = DVec3::X * far;
        for p in 0..count {
            // The mesh is rounded by 1e-10 where it is far, single precision by 1e-7.
            let gap = (x[count + p] - shift).distance(x[p]);
            assert!(gap < 1e-5, "{gap}");
        }
    }
    assert_eq!(simulation.report().pieces, 4);
    assert!(simulation.positions()[0].z < simulation.mesh().positions[0].z - 0.05);
}

/// A body with a velocity flies on by it; what is fixed of it stays, and so does a body without one.
#[test]
fn bodies_start_with_their_velocities() {
    let velocity = DVec3::new(0.5, -0.25, 2.0);
    let fixed = "fixed = [{ half_space = { point = [0, 0, 0], normal = [0, 0, 1] } }]\n";
    let moving = |at| body("sphere", 300, at) + "velocity = [0.5, -0.25, 2.0]\n";
    let bodies = [
        moving([0.0; 3]),
        body("sphere", 300, [3.0, 0.0, 0.0]),
        moving([0.0, 5.0, 0.0]) + fixed,
    ];
    for precision in ["f32", "f64"] {
        let solver = format!("[solver]\nprecision = \"{precision}\"\nsubsteps = 40\n");
        let mut simulation = simulation(&scene(&(solver + &bodies.concat())));
        let start = simulation.positions().to_vec();
        let added = Body::new(kuhn_box([2; 3], DVec3::ONE))
            .position(DVec3::X * 6.0)
            .velocity(velocity);
        simulation.add_body(added).unwrap();
        let start_of_added = simulation.positions()[start.len()..].to_vec();
        for _ in 0..10 {
            simulation.step().unwrap();
        }
        let way = velocity * (10.0 * simulation.time_step());
        let now = simulation.positions();
        let third = start.len() / 3;
        for p in 0..third {
            assert!(now[p].distance(start[p] + way) < 1e-4, "{}", now[p]);
            assert!(now[third + p].distance(start[third + p]) < 1e-5);
            if start[2 * third + p].z >= 0.0 {
                assert_eq!(now[2 * third + p], start[2 * third + p]);
            }
        }
        for (x, from) in now[start.len()..].iter().zip(&start_of_added) {
            assert!(x.distance(*from + way) < 1e-4, "{x}");
        }
    }
    let wrong = "velocity = [1e10, 0, 0]\n";
    let error = Scene::from_toml(&(body("sphere", 300, [0.0; 3]) + wrong))
        .and_then(|scene| Simulation::new(&scene))
        .unwrap_err();
    assert!(error.to_string().contains("body[0].velocity"), "{error}");
}
