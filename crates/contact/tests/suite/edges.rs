//! Edges against edges: the slow search, named cases, cuts.

use glam::{DQuat, DVec3};
use incise_contact::{ContactSettings, EdgeContact};
use incise_mesh::{TetMesh, kuhn_box};
use proptest::prelude::*;

use crate::oracle::expected_edges;
use crate::scene::{Scene, direction, jittered_box, noise};

pub(crate) fn placed(mut mesh: TetMesh, turn: DQuat, by: DVec3) -> TetMesh {
    for x in &mut mesh.positions {
        *x = turn * *x + by;
    }
    mesh
}

/// A box on one of its edges: a wedge whose lower edge runs along `along`, a unit vector across z, through `at`.
pub(crate) fn wedge_down(size: DVec3, along: DVec3, at: DVec3) -> TetMesh {
    let cells = [8, 2, 2];
    let turn = DQuat::from_rotation_z(along.y.atan2(along.x))
        * DQuat::from_rotation_x(std::f64::consts::FRAC_PI_4);
    placed(kuhn_box(cells, size), turn, DVec3::ZERO).shifted(at - along * (0.5 * size.x))
}

trait Shifted {
    fn shifted(self, by: DVec3) -> Self;
}

impl Shifted for TetMesh {
    fn shifted(self, by: DVec3) -> Self {
        placed(self, DQuat::IDENTITY, by)
    }
}

/// A wedge whose upper edge runs along `along` through `at`.
fn wedge_up(size: DVec3, along: DVec3, at: DVec3) -> TetMesh {
    let mut wedge = wedge_down(size, along, DVec3::ZERO);
    // Half a turn about the edge.
    let turn = DQuat::from_axis_angle(along, std::f64::consts::PI);
    for x in &mut wedge.positions {
        *x = turn * *x + at;
    }
    wedge
}

/// Compares with the slow search after an update that searched.
fn compare(scene: &Scene) -> usize {
    let edges = scene.contacts.edge_candidates();
    let found: Vec<[u32; 4]> = edges.iter().map(|contact| contact.particles).collect();
    let expected: Vec<[u32; 4]> = expected_edges(scene).into_iter().collect();
    let described = |key: &[u32; 4]| {
        let x = key.map(|p| scene.positions[p as usize]);
        let contact = EdgeContact {
            particles: *key,
            normal: (x[1] - x[0]).cross(x[3] - x[2]).normalize_or_zero(),
        };
        let (gap, distance) = (
            contact.gap(&scene.positions),
            contact.distance(&scene.positions),
        );
        format!("{key:?} {x:?} gap {gap} distance {distance}")
    };
    let missing: Vec<_> = expected.iter().filter(|key| !found.contains(key)).collect();
    // Of those that had passed each other at the search before, all are known, however deep.
    let is_deep = |key: &[u32; 4]| {
        let contact = edges.iter().find(|contact| contact.particles == *key);
        contact.is_some_and(|contact| {
            let reach = scene.reach(&key[..2], &key[2..]);
            contact.gap(&scene.positions) < 0.0 && contact.distance(&scene.positions) > reach
        })
    };
    let more: Vec<_> = found
        .iter()
        .filter(|key| !expected.contains(key) && !is_deep(key))
        .collect();
    if let Some(key) = missing.first().or(more.first()) {
        panic!(
            "{} missing, {} too many: {}",
            missing.len(),
            more.len(),
            described(key)
        );
    }
    assert!(found.is_sorted(), "in the order of their ends");
    for contact in edges {
        assert!((contact.normal.length() - 1.0).abs() < 1e-12);
    }
    found.len()
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 24,
        max_shrink_iters: 8,
        ..ProptestConfig::default()
    })]

    /// Bodies that overlap a little, cut at random, against the slow search.
    #[test]
    fn of_random_bodies(seed in any::<u64>(), cuts in 0_u32..3, self_contact in any::<bool>()) {
        let bodies: Vec<TetMesh> = (0..3)
            .map(|i| {
                let mesh = if i == 1 { jittered_box(3, 0.2, seed) } else { kuhn_box([4, 2, 2], DVec3::new(1.0, 0.5, 0.4)) };
                let turn = DQuat::from_axis_angle(direction(seed, i), 3.0 * noise(seed, 77 + i));
                placed(mesh, turn, direction(seed ^ 5, i) * 0.6)
            })
            .collect();
        let settings = ContactSettings { self_contact, skin: 0.8, ..ContactSettings::default() };
        let mut scene = Scene::new(&bodies, settings);
        scene.update();
        compare(&scene);
        for tag in 0..cuts {
            let point = direction(seed ^ 2, tag as usize) * 0.3;
            scene.cut(tag, point, direction(seed ^ 3, tag as usize));
            scene.update();
            for (i, x) in scene.positions.iter_mut().enumerate() {
                *x += direction(seed ^ u64::from(tag), i) * 0.05 * noise(seed ^ 9, i);
            }
            scene.search();
            compare(&scene);
        }
    }
}

/// Two wedges, edge across edge: one contact at the crossing with a vertical normal, on the right side however they pass
/// each other, and it is kept while they do.
#[test]
fn of_crossing_wedges() {
    let size = DVec3::new(1.0, 0.25, 0.25);
    // Their edges cross in the middle of two segments each.
    let along = [DVec3::X, DVec3::new(0.28, 0.96, 0.0)];
    let at = DVec3::new(0.06, 0.06, 0.0);
    for gap in [0.01, 0.0, -0.01, -0.03] {
        // The middle of a bar is a vertex.
        let [lower, upper] = [along[1], along[0]].map(|along| at + along * (0.5 / 8.0));
        let upper = wedge_down(size, along[0], upper + DVec3::Z * gap);
        let mut scene = Scene::new(
            &[wedge_up(size, along[1], lower), upper],
            ContactSettings {
                skin: 0.5,
                ..ContactSettings::default()
            },
        );
        scene.update();
        assert!(compare(&scene) >= 1, "at {gap}");
        let meet =
            |contact: &&EdgeContact| (contact.gap(&scene.positions).abs() - gap.abs()).abs() < 1e-9;
        let edges = scene.contacts.edges();
        let crossing: Vec<_> = edges.iter().filter(meet).collect();
        assert!(!crossing.is_empty(), "{edges:?}");
        // No vertex notices.
        for contact in scene.contacts.faces() {
            let held = contact.gap(&scene.positions);
            assert!(held > -1e-12, "{held} at {gap}: {contact:?}");
        }
        assert_eq!((scene.contacts.deep(), scene.contacts.buried()), (0, 0));
        for contact in crossing {
            assert!(contact.normal.z.abs() > 0.999);
            // The second body has the larger numbers, so the lower one comes first.
            assert!((contact.gap(&scene.positions) - gap).abs() < 1e-9);
            assert!(contact.normal.z < 0.0);
        }
    }
}

/// The side is that of the last search, also after the edges have passed each other.
#[test]
fn passing_each_other_keeps_the_side() {
    let size = DVec3::new(1.0, 0.25, 0.25);
    let at = DVec3::new(0.06, 0.06, 0.0);
    let upper = wedge_down(size, DVec3::X, at + DVec3::Z * 0.005);
    let lower = wedge_up(size, DVec3::Y, at);
    let mut scene = Scene::new(&[lower, upper], ContactSettings::default());
    scene.update();
    let gaps = |scene: &Scene| -> Vec<f64> {
        let edges = scene.contacts.edges().iter();
        edges.map(|contact| contact.gap(&scene.positions)).collect()
    };
    let before = gaps(&scene);
    assert!(before.iter().any(|gap| (gap - 0.005).abs() < 1e-9));
    scene.shift(1, DVec3::new(0.0, 0.0, -0.007));
    assert!(!scene.update().searched);
    for (now, before) in gaps(&scene).iter().zip(before) {
        assert!((now - before + 0.007).abs() < 1e-6, "{now} after {before}");
    }
}

/// Exactly aligned boxes touch at vertices, not at their parallel edges; a box across the rim of another touches at the
/// crossings with a gap of exactly 0.
#[test]
fn parallel_and_exactly_touching() {
    let cube = kuhn_box([2; 3], DVec3::ONE);
    let above = placed(cube.clone(), DQuat::IDENTITY, DVec3::Z);
    let mut scene = Scene::new(&[cube.clone(), above], ContactSettings::default());
    scene.update();
    compare(&scene);
    let parallel = |contact: &&EdgeContact| {
        let [a, b, c, d] = contact.particles.map(|p| scene.positions[p as usize]);
        (b - a).cross(d - c).length() < 1e-9
    };
    assert_eq!(scene.contacts.edges().iter().filter(parallel).count(), 0);
    for contact in scene.contacts.edges() {
        assert!(contact.gap(&scene.positions) >= 0.0);
    }

    let across = placed(
        kuhn_box([1; 3], DVec3::splat(0.5)),
        DQuat::IDENTITY,
        DVec3::new(0.7, 0.15, 1.0),
    );
    let mut scene = Scene::new(&[cube, across], ContactSettings::default());
    scene.update();
    compare(&scene);
    let touching = scene.contacts.edges().iter();
    let touching = touching.filter(|contact| contact.gap(&scene.positions) == 0.0);
    assert!(touching.count() >= 2, "both lower edges cross the rim");
}

/// A fresh cut has no contact of edges that its pairs hold; when its sides have slid apart, its rims are there.
#[test]
fn rims_of_a_cut() {
    // Further away, edges in one plane pass each other by rounding.
    let settings = ContactSettings {
        skin: 0.2,
        ..ContactSettings::default()
    };
    let mut scene = Scene::new(&[jittered_box(4, 0.15, 3)], settings);
    let (middle, normal) = (DVec3::splat(0.52), DVec3::new(0.1, 0.2, 1.0).normalize());
    scene.cut(0, middle, normal);
    scene.update();
    compare(&scene);
    for contact in scene.contacts.edges() {
        let gap = contact.gap(&scene.positions);
        assert!(gap >= -1e-12, "{gap}: nothing presses at a fresh cut");
    }
    let rims = scene.contacts.feature_edges();
    assert!(rims > 4 * 12 + 20, "{rims}");
    let particles = scene.particles_of(1);
    for p in particles {
        let x = scene.positions[p];
        scene.positions[p] = DQuat::from_axis_angle(normal, 0.4) * (x - middle) + middle;
    }
    scene.update();
    assert!(
        compare(&scene) >= 8,
        "turned against each other, the rims cross"
    );
}

/// Edges without length and collapsed triangles are no feature.
#[test]
fn degenerate_edges() {
    let size = DVec3::new(1.0, 0.25, 0.25);
    let lower = wedge_up(size, DVec3::Y, DVec3::ZERO);
    let count = lower.positions.len();
    let upper = wedge_down(size, DVec3::X, DVec3::Z * 0.01);
    let mut scene = Scene::new(&[lower, upper], ContactSettings::default());
    scene.update();
    assert!(!scene.contacts.edges().is_empty());
    let at = scene.positions[count];
    scene.positions[count..].fill(at);
    scene.search();
    assert!(scene.contacts.edges().is_empty());
}

/// A box that lies on the rim of another one and overhangs it has sunk in by a little. Its edges that stand on the top have
/// passed the rim by more, but its corners are what touches: pushed back over the rim it would slide off.
#[test]
fn an_overhanging_box_is_not_pushed_over_the_rim() {
    for sunk in [1e-9, 1e-5, 1e-3] {
        let below = kuhn_box([4; 3], DVec3::ONE);
        let at = DVec3::new(-0.97, 0.21, 1.0 - sunk);
        let above = placed(kuhn_box([2; 3], DVec3::ONE), DQuat::IDENTITY, at);
        let mut scene = Scene::new(&[below, above], ContactSettings::default());
        scene.search();
        compare(&scene);
        let edge = scene.contacts.mean_edge();
        for contact in scene.contacts.edge_candidates() {
            let gap = contact.gap(&scene.positions);
            assert!(gap > -0.01 * edge, "sunk by {sunk}: {contact:?} at {gap}");
        }
        assert!(scene.contacts.faces().len() > 2);
    }
}
