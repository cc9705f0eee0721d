//! Simulations from meshes in memory: the same as from a scene, and mistakes refused by name.

use incise::mesh::glam::DVec3;
use incise::mesh::{ParticleId, TetMesh};
use incise::meshing::{Shape, generate};
use incise::scene::{ColliderSpec, Region, SolverSpec, StrokeSpec};
use incise::{Body, Simulation, SimulationBuilder};

use crate::support::scene;

fn stroke() -> StrokeSpec {
    StrokeSpec::plane(3, [0.1, 0.0, 0.0], [1.0, 0.0, 0.2])
}

/// Two bodies, an obstacle and a cut, given both ways.
#[test]
fn meshes_in_memory_move_as_those_of_a_scene() {
    let text = r#"
        [world]
        gravity = [0.0, 0.0, -9.81]
        ground = { height = -0.4, friction = 0.3 }
        [solver]
        accuracy = 0.2
        [[body]]
        shape = { kind = "beam", tets = 300 }
        young_modulus = 3e4
        poisson_ratio = 0.3
        fixed = [{ half_space = { point = [-0.4, 0.0, 0.0], normal = [-1.0, 0.0, 0.0] } }]
        [[body]]
        shape = { kind = "sphere", tets = 200 }
        scale = 0.3
        position = [0.0, 0.0, 0.6]
        density = 500.0
        damping = 0.01
        [[collider]]
        kind = "sphere"
        center = [0.0, 0.0, 0.3]
        radius = 0.05
        [[stroke]]
        kind = "plane"
        frame = 3
        point = [0.1, 0.0, 0.0]
        normal = [1.0, 0.0, 0.2]
        snap = 0.1
    "#;
    let mut expected = Simulation::new(&scene(text)).unwrap();
    let mut builder = Simulation::builder();
    builder
        .gravity(DVec3::new(0.0, 0.0, -9.81))
        .ground(-0.4, 0.3)
        .solver(SolverSpec::default().with(|spec| spec.accuracy = Some(0.2)))
        .threads(2);
    let beam = Body::new(generate(Shape::Beam, 300).unwrap())
        .young_modulus(3e4)
        .poisson_ratio(0.3)
        .pinned(|x| x.x <= -0.4);
    let ball = Body::new(generate(Shape::Sphere, 200).unwrap())
        .scale(0.3)
        .position(DVec3::Z * 0.6)
        .density(500.0)
        .damping(0.01);
    let handles = [beam, ball].map(|body| builder.add_body(body).index());
    assert_eq!(handles, [0, 1]);
    let collider: Vec<ColliderSpec> = scene(text).collider;
    for collider in collider {
        builder.add_collider(collider);
    }
    builder.add_stroke(stroke());
    let mut found = builder.build().unwrap();
    for _ in 0..8 {
        expected.step().unwrap();
        found.step().unwrap();
        assert_eq!(found.positions(), expected.positions());
    }
    assert!(found.report().pieces > 2);
    found.check().unwrap();
}

/// Bodies are added to those of a scene.
#[test]
fn a_scene_and_a_mesh_together() {
    let text = "[[body]]\nshape = { kind = \"box\", tets = 300 }";
    let mut builder = SimulationBuilder::from_scene(scene(text));
    let mesh = generate(Shape::Sphere, 200).unwrap();
    let particles = mesh.positions.len();
    let far = Body::new(mesh)
        .position(DVec3::X * 3.0)
        .pinned_particles([0, 1]);
    assert_eq!(builder.add_body(far).index(), 1);
    let simulation = builder.build().unwrap();
    let added = simulation.positions().iter().filter(|x| x.x > 2.0).count();
    assert_eq!(added, particles);
    assert_eq!(simulation.report().pieces, 2);
}

#[test]
fn mistakes_are_named() {
    let error = |change: &dyn Fn(&mut SimulationBuilder)| {
        let mut builder = Simulation::builder();
        change(&mut builder);
        builder.build().map(|_| ()).unwrap_err().to_string()
    };
    let ball = || Body::new(generate(Shape::Sphere, 200).unwrap());
    assert!(error(&|_| {}).contains("at least one"));
    let found = error(&|b| {
        b.add_body(ball());
        b.add_body(ball().young_modulus(-1.0));
    });
    assert!(found.starts_with("body[1].young_modulus"), "{found}");
    let found = error(&|b| {
        b.add_body(ball().pinned_particles([99_999]));
    });
    assert!(found.contains("body[0].fixed[0].particles"), "{found}");
    let found = error(&|b| {
        b.threads(0).add_body(ball());
    });
    assert!(found.contains("threads"), "{found}");
    let flat = TetMesh {
        positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::ONE.with_z(0.0)],
        tets: vec![[0, 1, 2, 3].map(ParticleId::new)],
    };
    let found = error(&|b| {
        b.add_body(Body::new(flat.clone()));
    });
    assert!(found.starts_with("body[0].mesh"), "{found}");
    let region = Region::sphere([0.0; 3], -1.0);
    let mut scene = scene("[[body]]\nshape = { kind = \"box\", tets = 300 }");
    scene.body[0].fixed = vec![region];
    let found = SimulationBuilder::from_scene(scene).build().unwrap_err();
    assert!(found.to_string().contains("body[0].fixed[0].sphere.radius"));
}
