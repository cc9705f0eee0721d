//! Candidates against the slow search, on random bodies, after random cuts.

use glam::DVec3;
use incise_contact::{BodyPairs, ContactDetector, ContactSettings, FaceContact};
use incise_cutting::{CutOptions, Sweep, remove_tets};
use incise_mesh::{ParticleId, TetId, TetMesh, kuhn_box};
use incise_meshing::{Shape, generate};
use proptest::prelude::*;

use crate::oracle::{compare, found, key_of};
use crate::scene::{Scene, below, direction, jittered_box, noise};

fn shape(kind: usize, seed: u64) -> TetMesh {
    match kind % 4 {
        0 => kuhn_box([3; 3], DVec3::ONE),
        1 => jittered_box(3, 0.2, seed),
        2 => kuhn_box([6, 6, 1], DVec3::new(1.0, 1.0, 0.15)),
        _ => {
            let mut mesh = generate(Shape::Sphere, 400).unwrap();
            for x in &mut mesh.positions {
                *x = *x * 0.5 + 0.5;
            }
            mesh
        }
    }
}

/// Bodies that overlap a little, at random places and turned at random.
fn bodies(kinds: &[usize], seed: u64) -> Vec<TetMesh> {
    let mut bodies = Vec::new();
    for (i, &kind) in kinds.iter().enumerate() {
        let mut mesh = shape(kind, seed);
        let turn = glam::DQuat::from_axis_angle(direction(seed, i), 3.0 * noise(seed, 77 + i));
        let by = direction(seed ^ 5, i) * if i == 0 { 0.0 } else { 0.9 };
        for x in &mut mesh.positions {
            *x = turn * (*x - 0.5) + by;
        }
        bodies.push(mesh);
    }
    bodies
}

/// Moves everything a little.
fn shake(scene: &mut Scene, seed: u64, by: f64) {
    for (i, x) in scene.positions.iter_mut().enumerate() {
        *x += direction(seed, i) * by * noise(seed ^ 9, i);
    }
}

fn settings(self_contact: bool, skin: f64) -> ContactSettings {
    ContactSettings {
        self_contact,
        skin,
        ..ContactSettings::default()
    }
}

#[test]
fn of_a_box_on_a_box() {
    let below = kuhn_box([3; 3], DVec3::ONE);
    let mut above = below.clone();
    for x in &mut above.positions {
        x.z += 1.0 + 1e-3;
    }
    let mut scene = Scene::new(&[below, above], ContactSettings::default());
    scene.update();
    let expected = compare(&scene);
    assert!(expected.inside.is_empty());
    assert_eq!(
        scene.contacts.faces().len(),
        32,
        "each vertex of both sides once"
    );
    for contact in scene.contacts.faces() {
        let normal = contact.normal_at(&scene.positions);
        assert!((normal.z.abs() - 1.0).abs() < 1e-12, "at the rim, too");
        assert!((contact.gap(&scene.positions) - 1e-3).abs() < 1e-12);
    }
    // Exactly touching, and a little inside.
    for depth in [0.0, 1e-9, 1e-3, 0.1] {
        let by = scene.positions[64].z - 1.0 + depth;
        scene.shift(1, DVec3::new(0.0, 0.0, -by));
        scene.shift(1, DVec3::new(0.05, 0.02, 0.0));
        scene.search();
        compare(&scene);
        let near = scene.contacts.faces().iter().filter(|contact| {
            let gap = contact.gap(&scene.positions);
            (gap + depth).abs() < 1e-12 && contact.normal_at(&scene.positions).z.abs() > 0.999
        });
        assert!(near.count() >= 18, "at depth {depth}");
        assert_eq!(scene.contacts.buried(), 0);
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 30,
        max_shrink_iters: 12,
        ..ProptestConfig::default()
    })]

    #[test]
    fn of_random_bodies(
        seed in any::<u64>(),
        kinds in prop::collection::vec(0_usize..4, 1..4),
        cuts in 0_u32..3,
        self_contact in any::<bool>(),
    ) {
        let mut scene = Scene::new(&bodies(&kinds, seed), settings(self_contact, 0.8));
        shake(&mut scene, seed ^ 4, 0.03);
        scene.update();
        compare(&scene);
        for tag in 0..cuts {
            let point = direction(seed ^ 2, tag as usize) * 0.3;
            scene.cut(tag, point, direction(seed ^ 3, tag as usize));
            scene.update();
            // Where the sides of a cut coincide, what is nearest is a matter of rounding.
            shake(&mut scene, seed ^ u64::from(tag), 0.08);
            scene.search();
            compare(&scene);
        }
    }
}

/// After many small cuts and removals the result is that of a detector built from the mesh as it is.
#[test]
fn after_200_deltas() {
    let shapes = [jittered_box(3, 0.2, 1), {
        let mut other = jittered_box(3, 0.2, 2);
        for x in &mut other.positions {
            *x += DVec3::new(0.1, 0.2, 0.93);
        }
        other
    }];
    let mut scene = Scene::new(&shapes, settings(true, 0.2));
    let mut deltas = 0;
    let mut inside = 0;
    for stroke in 0_u32.. {
        let seed = u64::from(stroke);
        let at = 0.2 + 0.6 * noise(seed, 1).abs();
        let along = direction(seed, 4).with_z(0.0).normalize();
        let blade = |z: f64| {
            let middle = DVec3::new(at, at, z);
            [middle - along * 0.25, middle, middle + along * 0.25]
        };
        let options = CutOptions {
            tag: stroke,
            ..CutOptions::default()
        };
        let start = &scene.positions;
        let mut sweep = Sweep::new(&scene.body, start, &blade(2.1), options).unwrap();
        for frame in 1..=12 {
            let pose = blade(2.1 - 0.1 * f64::from(frame));
            let delta = sweep
                .advance(&mut scene.body, &scene.positions, &pose)
                .unwrap();
            deltas += usize::from(!delta.is_empty());
            scene.apply(&delta);
            scene.update();
        }
        let count = scene.body.mesh().tets.len();
        let tets: Vec<TetId> = (0..6).map(|i| TetId::new(below(count, seed, i))).collect();
        let delta = remove_tets(&mut scene.body, &tets, stroke).unwrap();
        deltas += 1;
        scene.apply(&delta);
        shake(&mut scene, seed, 0.01);
        scene.search();
        if stroke % 8 == 0 {
            inside += compare(&scene).inside.len();
        }
        if deltas >= 200 {
            break;
        }
    }
    let expected = compare(&scene);
    inside += expected.inside.len();
    assert!(inside > 0 && scene.contacts.faces().len() > 100);

    // A new one has no pairs, looks for deep vertices everywhere, does not know which tets were inverted and does not reach
    // quite as far: only vertices outside are compared.
    let body_of = scene.contacts.body_of().to_vec();
    let mut fresh = ContactDetector::new(&scene.body, body_of, settings(true, 0.2)).unwrap();
    fresh.update(&scene.state());
    let reach = scene.reach(&[], &[]);
    let pairs = scene.contacts.fresh_pairs();
    let compared = |contact: &&FaceContact| {
        let vertex = ParticleId(contact.particles[0]);
        contact.gap(&scene.positions).abs() < 0.3 * reach
            && pairs.partners(vertex).next().is_none()
            && !expected.deep.contains(&vertex.0)
            && !expected.inside.contains(&vertex.0)
            && scene.contacts.inverted().binary_search(&vertex.0).is_err()
    };
    let known: Vec<_> = found(&scene).into_iter().collect();
    let near: Vec<_> = fresh.faces().iter().filter(compared).collect();
    assert!(near.len() > 50);
    for contact in near {
        assert!(
            known.binary_search(&key_of(contact.particles)).is_ok(),
            "{contact:?}"
        );
    }
}

/// Where nothing has moved nothing overlaps, whatever was cut: crossing and thin slices, tips of cuts, removed tets.
#[test]
fn at_rest_nothing_is_inside() {
    for kind in 0..16 {
        let seed = kind as u64;
        let mut scene = Scene::new(&[shape(kind, seed)], settings(true, 0.8));
        for tag in 0..24 {
            let number = 10 * tag as usize;
            let middle = DVec3::splat(0.5) + direction(seed, number) * 0.4;
            let (along, down) = (direction(seed, number + 1), direction(seed, number + 2));
            let blade = |part: f64| [-0.2, 0.2].map(|t| middle + along * t + down * part);
            if tag % 5 == 4 {
                let count = scene.body.mesh().tets.len();
                let tets: Vec<TetId> = (0..4)
                    .map(|i| TetId::new(below(count, seed, number + i)))
                    .collect();
                let delta = remove_tets(&mut scene.body, &tets, tag).unwrap();
                scene.apply(&delta);
                scene.search();
            }
            let start = &scene.positions;
            let options = CutOptions {
                tag,
                snap: 0.1 * f64::from(tag % 3),
                ..CutOptions::default()
            };
            let mut sweep = Sweep::new(&scene.body, start, &blade(-0.3), options).unwrap();
            for part in [-0.1, 0.1, 0.3] {
                let delta = sweep
                    .advance(&mut scene.body, &scene.positions, &blade(part))
                    .unwrap();
                scene.apply(&delta);
                scene.search();
                let edge = scene.contacts.mean_edge();
                for contact in scene.contacts.edges() {
                    let gap = contact.gap(&scene.positions) / edge;
                    assert!(
                        gap > -1e-6,
                        "edges {seed}, {tag}: {gap} of an edge, {contact:?}"
                    );
                }
                for contact in scene.contacts.faces() {
                    let gap = contact.gap(&scene.positions) / edge;
                    assert!(gap > -1e-6, "{seed}, {tag}: {gap} of an edge, {contact:?}");
                }
                assert_eq!(scene.contacts.buried(), 0);
            }
        }
    }
}

/// Only bodies that may touch do; pieces of a body and the sides of a cut always do.
#[test]
fn what_may_touch() {
    let shifted = |by: f64| {
        let mut mesh = kuhn_box([2; 3], DVec3::ONE);
        for x in &mut mesh.positions {
            x.x += by;
        }
        mesh
    };
    let row = [shifted(0.0), shifted(1.001), shifted(2.002)];
    let with = |bodies: BodyPairs| {
        let settings = ContactSettings {
            bodies,
            self_contact: false,
            ..ContactSettings::default()
        };
        let mut scene = Scene::new(&row, settings);
        scene.update();
        compare(&scene);
        let mut touching: Vec<[u32; 2]> = Vec::new();
        for contact in scene.contacts.faces() {
            let [a, b, ..] = contact
                .particles
                .map(|p| scene.contacts.body_of()[p as usize]);
            touching.push([a.min(b), a.max(b)]);
        }
        touching.sort_unstable();
        touching.dedup();
        touching
    };
    assert_eq!(with(BodyPairs::All), [[0, 1], [1, 2]]);
    assert_eq!(with(BodyPairs::Only(vec![[2, 1]])), [[1, 2]]);
    assert_eq!(with(BodyPairs::Only(vec![[0, 2]])), Vec::<[u32; 2]>::new());
    assert_eq!(with(BodyPairs::Only(Vec::new())), Vec::<[u32; 2]>::new());

    let alone = ContactSettings {
        bodies: BodyPairs::Only(Vec::new()),
        self_contact: false,
        ..ContactSettings::default()
    };
    let mut scene = Scene::new(&[kuhn_box([4; 3], DVec3::ONE)], alone);
    scene.cut(0, DVec3::splat(0.4), DVec3::X);
    scene.update();
    assert!(!scene.contacts.pairs().is_empty());
    scene.shift(1, DVec3::new(0.0, 0.3, 0.0));
    scene.update();
    compare(&scene);
    assert!(scene.contacts.pairs().is_empty() && scene.contacts.faces().len() > 20);
}
