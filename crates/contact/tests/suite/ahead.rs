//! Which candidates are listed for a frame: those that its motion may bring together, and that something can move.

use std::collections::BTreeSet;

use glam::{DQuat, DVec3};
use incise_contact::{ContactDetector, ContactSettings, EdgeContact};
use incise_cutting::{
    CutDelta, CutOptions, ImproveOptions, ImproveQueue, StrokeRegistry, Sweep, improve,
};
use incise_mesh::{TetMesh, closest_on_triangle, kuhn_box};

use crate::edges::{placed, wedge_down};
use crate::oracle::compare;
use crate::scene::{FRAME, Scene, direction, jittered_box, noise};

fn two_boxes(gap: f64, settings: ContactSettings) -> Scene {
    let below = jittered_box(4, 0.0, 1);
    let above = placed(
        jittered_box(4, 0.0, 2),
        DQuat::IDENTITY,
        DVec3::new(0.11, 0.07, 1.0 + gap),
    );
    Scene::new(&[below, above], settings)
}

/// What is left out does not meet within the frame when all particles move on at their speeds, and what overlaps is
/// listed. Random bodies that fly, turn and shake, cut at random.
#[test]
fn what_is_left_out_does_not_meet() {
    let (mut left_out, mut listed) = (0, 0);
    for seed in 0..12 {
        let bodies: Vec<TetMesh> = (0..3)
            .map(|i| {
                let turn = DQuat::from_axis_angle(direction(seed, i), 2.0 * noise(seed, 70 + i));
                placed(
                    jittered_box(3, 0.2, seed),
                    turn,
                    direction(seed ^ 5, i) * 0.8,
                )
            })
            .collect();
        // All vertices have moved by more than that whenever one has, so that each search is one for all.
        let settings = ContactSettings {
            skin: 0.1,
            ..ContactSettings::default()
        };
        let mut scene = Scene::new(&bodies, settings);
        scene.cut(0, direction(seed, 9) * 0.2, direction(seed, 8));
        let edge = scene.contacts.mean_edge();
        for frame in 0..6 {
            let pieces: Vec<Vec<usize>> = (0..4).map(|piece| scene.particles_of(piece)).collect();
            for (i, particles) in pieces.iter().enumerate() {
                let spin = direction(seed ^ 3, i) * noise(seed, i);
                let drift = direction(seed ^ 4, i) * (0.2 * edge / FRAME);
                for &p in particles {
                    let shake = direction(seed ^ 7, 100 * frame + p) * (0.1 * edge / FRAME);
                    scene.velocities[p] = drift + spin.cross(scene.positions[p]) + shake;
                }
            }
            // Where the sides of a fresh cut coincide, what is nearest is a matter of rounding.
            if scene.update().searched && frame > 0 {
                compare(&scene);
            }
            let faces: BTreeSet<[u32; 4]> =
                scene.contacts.faces().iter().map(|c| c.particles).collect();
            let limit = scene.contacts.settings().reach * edge;
            for candidate in scene.contacts.face_candidates() {
                if faces.contains(&candidate.particles) {
                    listed += 1;
                    continue;
                }
                left_out += 1;
                assert!(
                    candidate.gap(&scene.positions) > 0.0,
                    "what overlaps is listed"
                );
                let moved = candidate
                    .particles
                    .map(|p| scene.velocities[p as usize] * FRAME);
                let most = moved[1..]
                    .iter()
                    .map(|by| by.distance(moved[0]))
                    .fold(0.0, f64::max);
                // Frames in which more approaches are divided.
                if most > limit {
                    continue;
                }
                for part in [0.25, 0.5, 0.75, 1.0] {
                    let at = |k: usize| {
                        scene.positions[candidate.particles[k] as usize] + moved[k] * part
                    };
                    let closest = closest_on_triangle([at(1), at(2), at(3)], at(0)).point;
                    let apart = closest.distance(at(0));
                    assert!(apart > 1e-3 * edge, "{candidate:?} meet: {apart}");
                }
            }
            let velocities = scene.velocities.clone();
            for (x, v) in scene.positions.iter_mut().zip(velocities) {
                *x += v * FRAME;
            }
        }
    }
    assert!(
        left_out > 200 && listed > 200,
        "{left_out} left out, {listed} listed"
    );
}

/// A vertex that moves fast brings its own contacts into the list and leaves those of others out.
#[test]
fn a_fast_vertex_looks_further_alone() {
    let settings = ContactSettings {
        skin: 0.2,
        ..ContactSettings::default()
    };
    // Within the skin, and beyond what is listed at rest.
    let mut scene = two_boxes(0.0, settings);
    let gap = 0.15 * scene.contacts.mean_edge();
    scene.shift(1, DVec3::Z * gap);
    scene.search();
    let all = compare(&scene).contacts.len();
    assert!(
        all > 30 && scene.contacts.faces().is_empty(),
        "nothing moves"
    );
    let inner = |x: DVec3| x.x > 0.3 && x.x < 0.9 && x.y > 0.3 && x.y < 0.9;
    let fast = (0..scene.positions.len())
        .find(|&p| (scene.positions[p].z - 1.0 - gap).abs() < 1e-9 && inner(scene.positions[p]))
        .unwrap();
    scene.velocities[fast] = DVec3::NEG_Z * (0.3 * scene.contacts.mean_edge() / FRAME);
    scene.search();
    let listed = scene.contacts.faces();
    assert!(
        !listed.is_empty() && listed.len() < all / 2,
        "{} of {all}",
        listed.len()
    );
    for contact in listed {
        assert!(
            contact.particles.map(|p| p as usize).contains(&fast),
            "{contact:?}"
        );
    }
    // All of the body: all is listed.
    for p in scene.particles_of(1) {
        scene.velocities[p] = DVec3::NEG_Z * (0.3 * scene.contacts.mean_edge() / FRAME);
    }
    scene.search();
    assert!(scene.contacts.faces().len() >= all);
}

/// Contacts of particles that nothing moves are not listed; those with one that moves are.
#[test]
fn contacts_that_nothing_moves_are_not_listed() {
    let mut scene = two_boxes(1e-3, ContactSettings::default());
    scene.search();
    let all = scene.contacts.faces().len();
    let contact = scene.contacts.faces()[0];
    let (edges, lower) = (scene.contacts.edges().len(), scene.particles_of(0).len());
    assert!(all > 30 && edges > 0);
    scene.fixed = (0..scene.positions.len()).map(|p| p < lower).collect();
    scene.search();
    compare(&scene);
    let counts = |scene: &Scene| (scene.contacts.faces().len(), scene.contacts.edges().len());
    assert_eq!(counts(&scene), (all, edges), "the upper one moves");
    scene.fixed.fill(true);
    scene.search();
    assert_eq!(counts(&scene), (0, 0));
    compare(&scene);
    // A particle that is let go of brings its contacts back, without a search.
    for p in contact.particles {
        scene.fixed.fill(true);
        scene.fixed[p as usize] = false;
        let update = scene.update();
        assert!(!update.searched && update.faces_changed);
        let listed = scene.contacts.faces();
        assert!(listed.contains(&contact) && listed.len() < all);
        assert!(listed.iter().all(|contact| contact.particles.contains(&p)));
        scene.fixed[p as usize] = true;
        scene.update();
    }
}

/// A long edge across a fine rim has four contacts, the deepest, and each of the fine edges its own.
#[test]
fn an_edge_has_its_nearest_contacts() {
    let long = placed(
        kuhn_box([1; 3], DVec3::splat(2.0)),
        DQuat::from_rotation_x(std::f64::consts::FRAC_PI_4),
        DVec3::ZERO,
    );
    let lowest = long
        .positions
        .iter()
        .fold(f64::INFINITY, |low, x| low.min(x.z));
    let long = placed(long, DQuat::IDENTITY, DVec3::new(-1.0, 0.0, 0.005 - lowest));
    // Many wedges side by side, each with its upper edge across.
    let mut bodies = vec![long];
    for number in 0..9_u32 {
        let at = DVec3::new(0.1 * f64::from(number) - 0.4, 0.013, 0.0);
        let lower = wedge_down(DVec3::new(0.4, 0.05, 0.05), DVec3::Y, DVec3::ZERO);
        let turn = DQuat::from_axis_angle(DVec3::Y, std::f64::consts::PI);
        let height = 5e-4 * f64::from(7 * number % 9);
        bodies.push(placed(lower, turn, at + DVec3::Z * height));
    }
    let settings = ContactSettings {
        skin: 1.0,
        ..ContactSettings::default()
    };
    let mut scene = Scene::new(&bodies, settings);
    scene.search();
    let expected = crate::oracle::expected_edges(&scene);
    let edges = scene.contacts.edge_candidates();
    let found: BTreeSet<[u32; 4]> = edges.iter().map(|contact| contact.particles).collect();
    let missing: Vec<_> = expected.difference(&found).collect();
    let more: Vec<_> = found.difference(&expected).collect();
    assert!(found == expected, "missing {missing:?}, more {more:?}");
    // The highest wedge is the nearest of all, and the lower edge of the box has it and three more.
    let gap = |contact: &EdgeContact| contact.gap(&scene.positions);
    let nearest = edges
        .iter()
        .min_by(|one, other| gap(one).total_cmp(&gap(other)))
        .unwrap();
    assert!((gap(nearest) - 1e-3).abs() < 1e-9, "{nearest:?}");
    let of_long = |contact: &&EdgeContact| contact.particles[..2] == nearest.particles[..2];
    assert_eq!(edges.iter().filter(of_long).count(), 4, "{edges:?}");
}

/// One vertex that moves is searched for, and those near its triangles, and no others.
#[test]
fn a_vertex_is_searched_for_alone() {
    let mut scene = two_boxes(0.01, ContactSettings::default());
    let edge = scene.contacts.mean_edge();
    assert!(scene.update().searched);
    assert!(!scene.update().searched);
    let inner = |x: DVec3| x.x > 0.3 && x.x < 0.9 && x.y > 0.3 && x.y < 0.9;
    let moved = (0..scene.positions.len())
        .find(|&p| (scene.positions[p].z - 1.01).abs() < 1e-9 && inner(scene.positions[p]))
        .unwrap();
    scene.positions[moved].z += 0.4 * edge;
    let update = scene.update();
    assert!(update.searched);
    let few = scene.contacts.searched_vertices();
    assert!((2..60).contains(&few), "{few}");
    // What it has moved by is known.
    assert!(!scene.update().searched);
    compare(&scene);
}

/// What shakes and comes back uses up no more of the skin than its farthest way, however long it goes on: vertices beside
/// their body, and a body as a whole.
#[test]
fn what_shakes_in_place_is_not_searched_for_again() {
    for turns in [false, true] {
        let mut scene = two_boxes(0.01, ContactSettings::default());
        let skin = scene.contacts.settings().skin * scene.contacts.mean_edge();
        let rest = scene.positions.clone();
        let above = scene.particles_of(1);
        assert!(scene.update().searched);
        let mut length = 0.0;
        for frame in 0..200 {
            let before = scene.positions.clone();
            for (i, rest) in rest.iter().enumerate() {
                let swing = (1.1 * f64::from(frame) + 6.0 * noise(1, i)).sin();
                scene.positions[i] = *rest + direction(1, i) * (0.04 * skin * swing);
            }
            for &i in above.iter().filter(|_| turns) {
                let swing = 0.02 * skin * (0.9 * f64::from(frame)).sin();
                let about = scene.positions[i] - DVec3::new(0.6, 0.6, 1.5);
                scene.positions[i] += swing * (DVec3::X + DVec3::Y.cross(about));
            }
            length += scene.positions[above[0]].distance(before[above[0]]);
            assert!(
                !scene.update().searched,
                "in frame {frame}, turning {turns}"
            );
        }
        assert!(length > 2.0 * skin, "{length}");
    }
}

/// Where vertices are searched for one by one, nothing is missed that may touch within the frame: bodies that shake all
/// over, a few vertices of them fast.
#[test]
fn nothing_is_missed_where_vertices_are_searched_for_alone() {
    let (mut some, mut compared) = (0, 0);
    let settings = ContactSettings {
        skin: 0.2,
        ..ContactSettings::default()
    };
    for seed in 0..4 {
        let mut scene = two_boxes(0.004, settings.clone());
        let count = scene.particles_of(0).len();
        let all = scene.contacts.surface().vertices().count();
        let rest = scene.positions.clone();
        for frame in 0..60 {
            let time = f64::from(frame) * FRAME;
            for (i, rest) in rest.iter().enumerate() {
                let is_fast = noise(seed, 500 + i) > 0.9;
                let most = if is_fast { 0.03 } else { 0.004 };
                let speed = 12.0 + 6.0 * noise(seed, i);
                let way = direction(seed, i) * most;
                scene.positions[i] = *rest + way * (speed * time).sin();
                scene.velocities[i] = way * (speed * (speed * time).cos());
                // The second body slides and rocks.
                if i >= count {
                    let slow = DVec3::new(0.02, 0.01, -0.002);
                    let about = DVec3::new(-0.7, 1.0, 0.2).cross(*rest - DVec3::splat(1.5)) * 0.01;
                    scene.positions[i] += slow * time + about * (9.0 * time).sin();
                    scene.velocities[i] += slow + about * (9.0 * (9.0 * time).cos());
                }
            }
            scene.update();
            let searched = scene.contacts.searched_vertices();
            some += u32::from(searched > 0 && searched < all);
            let fresh = scene.searched_anew();
            let skin = fresh.settings().skin * fresh.mean_edge();
            for contact in fresh.faces() {
                let [vertex, corners @ ..] = &contact.particles;
                let margin = scene.reach(&[*vertex], corners) - skin;
                if contact.gap(&scene.positions) > margin {
                    continue;
                }
                compared += 1;
                let is_known = scene.contacts.faces().iter().any(|known| {
                    known.particles[0] == *vertex
                        && (known.particles[1] as usize >= count) == (corners[0] as usize >= count)
                });
                assert!(is_known, "seed {seed}, frame {frame}: {contact:?}");
            }
        }
    }
    assert!(some > 100 && compared > 300, "{some} and {compared}");
}

/// How many contacts outside of the surface a search for all vertices would list, and how many of these are not known.
fn missed_and_compared(scene: &Scene) -> [u32; 2] {
    let (mut missed, mut compared) = (0, 0);
    let fresh = scene.searched_anew();
    let skin = fresh.settings().skin * fresh.mean_edge();
    let known: BTreeSet<u32> = (scene.contacts.faces().iter())
        .map(|contact| contact.particles[0])
        .collect();
    for contact in fresh.faces() {
        let [vertex, corners @ ..] = &contact.particles;
        let margin = scene.reach(&[*vertex], corners) - skin;
        if (0.0..=margin).contains(&contact.gap(&scene.positions)) {
            compared += 1;
            missed += u32::from(!known.contains(vertex));
        }
    }
    [missed, compared]
}

/// Moves all particles as if they shook.
fn shake(scene: &mut Scene, seed: u64, frame: i32) {
    for i in 0..scene.positions.len() {
        let place = |frame: i32| {
            let angle = 0.7 * f64::from(frame) + 6.0 * noise(seed, i);
            direction(seed, i) * (0.006 * angle.sin())
        };
        let by = place(frame) - place(frame - 1);
        scene.positions[i] += by;
        scene.velocities[i] = by / FRAME;
    }
}

/// Improves the mesh around the particles of a queue, with so much work.
fn improved(scene: &mut Scene, queue: &mut ImproveQueue, max_tets: usize) -> CutDelta {
    let options = ImproveOptions {
        max_tets,
        ..ImproveOptions::default()
    };
    let registry = StrokeRegistry::default();
    let (body, positions) = (&mut scene.body, &scene.positions);
    let delta = improve(body, positions, queue, &options, &registry, |_, _| false).unwrap();
    scene.apply(&delta);
    delta
}

/// After a cut, and where the mesh is improved, only what has changed is searched for, and what a search for all vertices
/// finds outside of the surface is known: bodies that shake and come apart beside one that is whole. A few vertices differ,
/// as in frames without a cut: whether a sliver at the front of a cut faces another one changes with less motion than the skin.
#[test]
fn nothing_is_missed_where_a_change_is_searched_for_alone() {
    let (mut cuts, mut improvements, mut pieces) = ([0; 3], [0; 3], 0);
    for seed in 0..4_u64 {
        let mut scene = two_boxes(0.004, ContactSettings::default());
        for stroke in 0_u8..6 {
            let number = usize::from(stroke);
            let at = 0.3 + 0.8 * noise(seed, number).abs();
            let along = direction(seed, number).with_z(0.0).normalize();
            // Every third one goes through both bodies.
            let depth = if stroke % 3 == 2 { 0.24 } else { 0.05 };
            let blade = |frame: i32| {
                let middle = DVec3::new(at, at, 2.6 - depth * f64::from(frame));
                [middle - along * 2.0, middle, middle + along * 2.0]
            };
            let options = CutOptions {
                tag: stroke.into(),
                ..CutOptions::default()
            };
            let mut sweep = Sweep::new(&scene.body, &scene.positions, &blade(0), options).unwrap();
            let mut queue = ImproveQueue::default();
            for frame in 1..=24 {
                let is_cut = frame <= 12;
                let delta = if is_cut {
                    let delta = sweep.advance(&mut scene.body, &scene.positions, &blade(frame));
                    let delta = delta.unwrap();
                    queue.extend(delta.created_particles());
                    scene.apply(&delta);
                    delta
                } else {
                    improved(&mut scene, &mut queue, 400)
                };
                shake(&mut scene, seed, frame);
                scene.update();
                let all = scene.contacts.surface().vertices().count();
                if delta.is_empty() || scene.contacts.searched_vertices() == all {
                    continue;
                }
                pieces = pieces.max(scene.pieces.count());
                let [missed, compared] = missed_and_compared(&scene);
                let sums = if is_cut { &mut cuts } else { &mut improvements };
                for (sum, by) in sums.iter_mut().zip([1, missed, compared]) {
                    *sum += by;
                }
            }
        }
    }
    assert!(pieces > 3, "{pieces}");
    for (what, [some, missed, compared]) in [("cuts", cuts), ("improvements", improvements)] {
        assert!(some > 40 && compared > 1000, "{what}: {some}, {compared}");
        assert!(
            missed <= compared / 250,
            "{what}: {missed} of {compared} in {some}"
        );
    }
}

/// Where an improvement takes tets away that contain vertices of another body, these are known to be inside as before. The
/// tets are large, so that most vertices have no triangle near them.
#[test]
fn vertices_in_improved_tets_are_not_lost() {
    let (mut deep, mut collapsed) = (0, 0);
    for seed in 0..3_u64 {
        // A coarse body with a fine one inside of it.
        let fine = placed(
            jittered_box(5, 0.0, 2),
            DQuat::IDENTITY,
            DVec3::new(0.31, 0.27, 0.35),
        );
        let coarse = jittered_box(2, 0.0, 1);
        let scaled = |mut mesh: TetMesh, by: f64| {
            mesh.positions.iter_mut().for_each(|x| *x *= by);
            mesh
        };
        let bodies = [scaled(coarse, 4.0), scaled(fine, 2.0)];
        let settings = ContactSettings {
            self_contact: false,
            skin: 0.05,
            ..ContactSettings::default()
        };
        let mut scene = Scene::new(&bodies, settings);
        let mut queue = ImproveQueue::default();
        for stroke in 0..4 {
            let number = stroke as usize;
            let point = DVec3::splat(2.0) + direction(seed, number) * 0.9;
            let delta = scene.cut(stroke, point, direction(seed, 10 + number));
            queue.extend(delta.created_particles());
        }
        // Without the pairs of the cuts, as in the detectors to compare with.
        let body_of = scene.contacts.body_of().to_vec();
        scene
            .contacts
            .rebuild(&scene.body, body_of.clone())
            .unwrap();
        scene.update();
        while !queue.is_empty() {
            collapsed += improved(&mut scene, &mut queue, 2000).collapsed;
            scene.update();
            let mut fresh = scene.contacts.clone();
            fresh.rebuild(&scene.body, body_of.clone()).unwrap();
            fresh.update(&scene.state());
            let [known, located] = [&scene.contacts, &fresh].map(ContactDetector::deep);
            deep += located;
            // Some are still known that a search for all would not find.
            assert!(
                100 * known >= 99 * located,
                "seed {seed}: {known} of {located}"
            );
        }
    }
    assert!(deep > 50 && collapsed > 100, "{deep}, {collapsed}");
}
