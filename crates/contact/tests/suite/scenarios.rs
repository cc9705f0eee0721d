//! Named cases: thin walls, overlap, swallowed pieces, sides that slide past each other; what a frame costs and keeps.

use glam::{DQuat, DVec3};
use incise_contact::{BodyPairs, ContactDetector, ContactError, ContactSettings, FaceContact};
use incise_mesh::{ParticleId, TetMesh, kuhn_box};
use incise_meshing::{Shape, generate};

use crate::oracle::compare;
use crate::scene::{FRAME, Scene, direction, jittered_box, noise};

fn moved(mut mesh: TetMesh, by: DVec3) -> TetMesh {
    for x in &mut mesh.positions {
        *x += by;
    }
    mesh
}

/// A plate one tet thick, rolled up to a tube that is open by `gap` or overlaps itself by as much.
fn rolled(scene: &mut Scene, length: f64, gap: f64) {
    let radius = (length + gap) / std::f64::consts::TAU;
    for (x, rest) in scene.positions.iter_mut().zip(&scene.body.mesh().positions) {
        let angle = rest.x / radius;
        let r = radius + rest.z;
        *x = DVec3::new(r * angle.cos(), rest.y, -r * angle.sin());
    }
}

/// A flat, a bent and a squeezed plate of one layer of tets touches itself nowhere, although front and back are closer
/// to each other than the search reaches.
#[test]
fn a_thin_wall_does_not_touch_itself() {
    let plate = kuhn_box([12, 4, 1], DVec3::new(1.2, 0.4, 0.02));
    let mut scene = Scene::new(&[plate], ContactSettings::default());
    scene.update();
    assert!(scene.reach(&[], &[]) > 0.02);
    assert!(scene.contacts.faces().is_empty());
    for squeeze in [0.9, 0.5, 0.1] {
        for (x, rest) in scene.positions.iter_mut().zip(&scene.body.mesh().positions) {
            *x = *rest * DVec3::new(1.0, 1.0, squeeze);
        }
        scene.search();
        assert!(scene.contacts.faces().is_empty(), "squeezed to {squeeze}");
        assert_eq!((scene.contacts.deep(), scene.contacts.buried()), (0, 0));
    }
    rolled(&mut scene, 1.2, 0.3);
    scene.update();
    assert!(scene.contacts.faces().is_empty(), "rolled up but open");
    assert_eq!(scene.contacts.deep(), 0);
}

/// A plate of 1.6 by 0.4 by 0.02 m: two flat halves, the second turned over, joined by half a turn around the fold, with
/// a gap or an overlap between them.
fn fold(scene: &mut Scene, gap: f64) {
    let radius = 0.15;
    let fold = std::f64::consts::PI * radius;
    let straight = 0.5 * (1.6 - fold);
    for (x, rest) in scene.positions.iter_mut().zip(&scene.body.mesh().positions) {
        let s = rest.x - straight;
        *x = if s <= 0.0 {
            DVec3::new(s, rest.y, rest.z)
        } else if s < fold {
            let angle = s / radius;
            let r = radius - rest.z;
            DVec3::new(r * angle.sin(), rest.y, radius - r * angle.cos())
        } else {
            DVec3::new(fold - s, rest.y, 2.0 * radius - rest.z)
        };
        // The upper half comes down.
        if x.z > radius {
            let share = (-x.x / (0.4 * straight)).clamp(0.0, 1.0);
            let lowered = x.z - (2.0 * radius - 0.04 - gap);
            x.z += (lowered - x.z) * share;
        }
    }
}

/// A plate folded onto itself: what touches are the two inner faces, and nothing through a wall.
#[test]
fn a_folded_plate() {
    let plate = kuhn_box([16, 4, 1], DVec3::new(1.6, 0.4, 0.02));
    let mut scene = Scene::new(&[plate], ContactSettings::default());
    for gap in [0.01, 0.0, -0.004] {
        fold(&mut scene, gap);
        scene.search();
        compare(&scene);
        let rest = &scene.body.mesh().positions;
        assert!(scene.contacts.faces().len() > 10, "gap {gap}");
        for contact in scene.contacts.faces() {
            let [vertex, triangle @ ..] = contact.particles;
            let inner = |p: u32| (rest[p as usize].z - 0.02).abs() < 1e-9;
            let rim = |p: u32| {
                let x = rest[p as usize];
                x.x < 1e-9 || x.x > 1.6 - 1e-9 || x.y < 1e-9 || x.y > 0.4 - 1e-9
            };
            assert!(inner(vertex) || rim(vertex), "gap {gap}: {contact:?}");
            assert!(
                triangle.into_iter().all(|p| inner(p) || rim(p)),
                "{contact:?}"
            );
            let along = rest[vertex as usize].x - rest[triangle[0] as usize].x;
            assert!(
                along.abs() > 0.4,
                "gap {gap}: the other half, not its own wall"
            );
        }
        assert_eq!(scene.contacts.buried(), 0);
    }
}

/// A vertex that was pushed through its own tet is on the wrong side of its surface, where contact with its own part would
/// hold it. It touches nothing of that part until it is back and out of it, but other parts all the time.
#[test]
fn a_vertex_of_an_inverted_tet() {
    let plate = kuhn_box([16, 4, 1], DVec3::new(1.6, 0.4, 0.02));
    let block = moved(kuhn_box([2; 3], DVec3::splat(0.2)), DVec3::splat(5.0));
    let mut scene = Scene::new(&[plate, block], ContactSettings::default());
    let of_plate = 17 * 5 * 2;
    let block: Vec<DVec3> = scene.positions[of_plate..].to_vec();
    let touched = |scene: &Scene, vertex: u32| -> Vec<FaceContact> {
        let of_vertex = |contact: &&FaceContact| contact.particles.contains(&vertex);
        let faces = scene.contacts.face_candidates().iter();
        faces.filter(of_vertex).copied().collect()
    };
    let place = |scene: &mut Scene, gap: f64| {
        fold(scene, gap);
        scene.positions[of_plate..].copy_from_slice(&block);
    };
    place(&mut scene, -0.004);
    scene.search();
    compare(&scene);
    assert!(scene.contacts.inverted().is_empty());
    let rest = &scene.body.mesh().positions;
    let is_upper_inner = |p: &u32| {
        let x = rest[*p as usize];
        x.distance(DVec3::new(1.4, 0.2, 0.02)) < 1e-9
    };
    let vertex = (0..u32::try_from(of_plate).unwrap()).find(is_upper_inner);
    let vertex = vertex.unwrap();
    assert!(
        !touched(&scene, vertex).is_empty(),
        "it touches the lower half"
    );

    // Up through its own half, which is 0.02 m thick.
    scene.positions[vertex as usize].z += 0.1;
    scene.search();
    compare(&scene);
    assert!(scene.contacts.inverted().contains(&vertex));
    assert!(touched(&scene, vertex).is_empty());
    // A block there is touched by it.
    let shift = scene.positions[vertex as usize] - block[0] - DVec3::new(0.1, 0.1, 0.199);
    for (x, start) in scene.positions[of_plate..].iter_mut().zip(&block) {
        *x = *start + shift;
    }
    scene.search();
    compare(&scene);
    let with_block = touched(&scene, vertex);
    assert!(!with_block.is_empty());
    for contact in with_block {
        let [one, other, ..] = contact.particles.map(|p| p as usize);
        assert!(one.max(other) >= of_plate, "{contact:?}");
    }

    // Back, but still within the lower half; then out of it.
    for (gap, is_held_off) in [(-0.004, true), (0.001, false)] {
        place(&mut scene, gap);
        scene.search();
        assert_eq!(scene.contacts.inverted().contains(&vertex), is_held_off);
        let contacts = touched(&scene, vertex);
        let own = contacts.iter().filter(|c| c.particles[0] == vertex);
        assert_eq!(own.count() == 0, is_held_off, "gap {gap}");
    }
    // Without that past it touches the lower half again.
    place(&mut scene, -0.004);
    scene.search();
    compare(&scene);
    assert!(scene.contacts.inverted().is_empty());
    assert!(!touched(&scene, vertex).is_empty());
}

/// A block pressed into another one, by up to nearly a layer of tets, leaves by the face it came in by.
#[test]
fn pushed_into_another_body() {
    let lower = kuhn_box([4; 3], DVec3::ONE);
    let upper = moved(
        kuhn_box([2; 3], DVec3::splat(0.4)),
        DVec3::new(0.33, 0.31, 1.0),
    );
    for depth in [0.02, 0.1, 0.2] {
        let mut scene = Scene::new(&[lower.clone(), upper.clone()], ContactSettings::default());
        let steps = 10;
        for step in 0..=steps {
            if step > 0 {
                scene.shift(1, DVec3::new(0.0, 0.0, -depth / f64::from(steps)));
            }
            scene.update();
        }
        let bottom = |contact: &&FaceContact| {
            let vertex = contact.particles[0] as usize;
            vertex >= 125 && (scene.positions[vertex].z - (1.0 - depth)).abs() < 1e-9
        };
        let bottoms: Vec<_> = scene.contacts.faces().iter().filter(bottom).collect();
        assert_eq!(bottoms.len(), 9, "at depth {depth}");
        for contact in bottoms {
            let normal = contact.normal_at(&scene.positions);
            assert!(normal.z > 0.999, "at depth {depth}: {normal}");
            assert!((contact.gap(&scene.positions) + depth).abs() < 1e-9);
        }
        assert_eq!(scene.contacts.buried(), 0, "at depth {depth}");
    }
}

/// A small block that starts in the middle of a large one is counted, and so is one that gets there.
#[test]
fn swallowed() {
    let large = kuhn_box([10; 3], DVec3::ONE);
    let small = kuhn_box([1; 3], DVec3::splat(0.05));
    let inside = moved(small.clone(), DVec3::splat(0.47));
    let mut scene = Scene::new(&[large.clone(), inside], ContactSettings::default());
    scene.update();
    assert_eq!((scene.contacts.deep(), scene.contacts.buried()), (8, 8));
    assert!(scene.contacts.faces().is_empty(), "nothing pushes it out");

    let above = moved(small, DVec3::new(0.47, 0.47, 1.01));
    let mut scene = Scene::new(&[large, above], ContactSettings::default());
    let mut most_deep = 0;
    for _ in 0..60 {
        scene.update();
        most_deep = most_deep.max(scene.contacts.deep());
        scene.shift(1, DVec3::new(0.0, 0.0, -0.01));
    }
    scene.update();
    assert_eq!(
        (
            most_deep.min(8),
            scene.contacts.deep(),
            scene.contacts.buried()
        ),
        (8, 8, 8)
    );
    // It comes back out.
    for _ in 0..80 {
        scene.shift(1, DVec3::new(0.0, 0.0, 0.01));
        scene.update();
    }
    assert_eq!((scene.contacts.deep(), scene.contacts.buried()), (0, 0));
}

/// Halves of a cut that slide past each other by several edges: each vertex of a cut face that lies over the other side
/// is held by its pair or by candidates, in every frame, never by both and never by neither.
#[test]
fn sliding_past() {
    for (seed, self_contact) in [(1, true), (2, false)] {
        let settings = ContactSettings {
            self_contact,
            ..ContactSettings::default()
        };
        let mut scene = Scene::new(&[jittered_box(6, 0.15, seed)], settings);
        let options = incise_cutting::CutOptions {
            snap: 0.0,
            ..Default::default()
        };
        let normal = DVec3::new(0.0, 0.1, 1.0).normalize();
        scene.cut_with(&options, DVec3::splat(0.52), normal);
        let slide = normal.cross(DVec3::Y).normalize();
        let velocity = slide * 1.5;
        for p in scene.particles_of(1) {
            scene.velocities[p] = velocity;
        }
        let side: Vec<u32> = (0..scene.positions.len())
            .map(|p| {
                scene
                    .pieces
                    .piece_of(scene.body.around(ParticleId::new(p)).next().unwrap())
            })
            .collect();
        let is_cut = |scene: &Scene, p: usize| {
            let mut fan = scene.contacts.surface().fan(ParticleId::new(p));
            fan.any(|t| t.tag == incise_cutting::FaceTag::Cut(0))
        };
        let on_cut: Vec<usize> = (0..scene.positions.len())
            .filter(|&p| is_cut(&scene, p))
            .collect();
        let (mut by_pair, mut by_face) = (0, 0);
        for _ in 0..24 {
            scene.update();
            let offset = slide.dot(scene.positions[on_cut[0]])
                - slide.dot(scene.body.mesh().positions[on_cut[0]]);
            let offset = if side[on_cut[0]] == 1 {
                offset
            } else {
                let other = on_cut.iter().find(|&&p| side[p] == 1).unwrap();
                slide.dot(scene.positions[*other] - scene.body.mesh().positions[*other])
            };
            for &p in &on_cut {
                // Well over the other side's face, which spans the unit box moved along.
                let relative = if side[p] == 1 { offset } else { -offset };
                let over = scene.body.mesh().positions[p] + slide * relative;
                let margin = 0.02;
                let inside = over.x > margin
                    && over.x < 1.0 - margin
                    && over.y > margin
                    && over.y < 1.0 - margin;
                if !inside {
                    continue;
                }
                let pairs = scene.contacts.pairs().iter();
                let pairs = pairs
                    .filter(|pair| pair.particles.contains(&u32::try_from(p).unwrap()))
                    .count();
                let faces = scene.contacts.faces().iter();
                let faces = faces.filter(|contact| {
                    contact.particles[0] as usize == p
                        && side[contact.particles[1] as usize] != side[p]
                        && contact.gap(&scene.positions).abs() < 1e-6
                });
                let faces = faces.count();
                assert!(
                    (pairs > 0) != (faces > 0),
                    "{p}: {pairs} pairs, {faces} candidates at {offset}"
                );
                by_pair += pairs;
                by_face += faces;
            }
            for (x, v) in scene.positions.iter_mut().zip(&scene.velocities) {
                *x += *v * FRAME;
            }
        }
        assert!(by_pair > 20 && by_face > 500);
        assert_eq!(scene.contacts.buried(), 0);
    }
}

/// Two halves drawn apart, turned a little and pushed together again: the vertices that are inside the other half are
/// pushed back to their own side.
#[test]
fn pushed_together_again() {
    let options = incise_cutting::CutOptions {
        snap: 0.0,
        ..Default::default()
    };
    for shift in [0.0, 1.0 / 3.0, 0.5] {
        let mut scene = Scene::new(&[jittered_box(4, 0.15, 5)], ContactSettings::default());
        scene.cut_with(&options, DVec3::splat(0.45), DVec3::Z);
        scene.update();
        let up = scene.positions[scene.particles_of(1)[0]].z > 0.45;
        let away = if up { DVec3::Z } else { -DVec3::Z };
        for p in scene.particles_of(1) {
            let x = &mut scene.positions[p];
            *x = DQuat::from_rotation_z(0.05) * *x + away * 0.3 + DVec3::X * (shift * 0.25);
        }
        scene.update();
        let particles = scene.particles_of(1);
        for _ in 0..32 {
            particles
                .iter()
                .for_each(|&p| scene.positions[p] -= away * 0.01);
            scene.update();
        }
        // A list that was kept has all that may touch, but not all that is within reach.
        scene.search();
        compare(&scene);
        let mut held = 0;
        for contact in scene.contacts.faces() {
            let gap = contact.gap(&scene.positions);
            if (gap + 0.02).abs() < 1e-9 {
                held += 1;
                let normal = contact.normal_at(&scene.positions);
                let own = particles.contains(&(contact.particles[0] as usize));
                assert!(normal.dot(away) * if own { 1.0 } else { -1.0 } > 0.999);
            }
        }
        assert!(held > 20, "{held} at shift {shift}");
        assert_eq!(scene.contacts.buried(), 0);
    }
}

/// A vertex that has passed the middle of a thin plate is pushed out through the wide face that it came in by, also if
/// the narrow one at the rim faces it, too, and is less deep than half of the width there.
#[test]
fn a_thin_plate_is_left_by_the_nearest_way() {
    let plate = kuhn_box([12, 4, 1], DVec3::new(1.2, 0.4, 0.02));
    // A box that is turned so that its lowest corner points down and towards the rim at x = 0.
    let mut spike = kuhn_box([1; 3], DVec3::splat(0.3));
    let turn = DQuat::from_rotation_arc(
        DVec3::ONE.normalize(),
        DVec3::new(0.5, 0.0, 1.0).normalize(),
    );
    for x in &mut spike.positions {
        *x = turn * *x + DVec3::new(0.05, 0.21, 0.02 - 0.012);
    }
    let mut scene = Scene::new(&[plate, spike], ContactSettings::default());
    scene.update();
    compare(&scene);
    let tip = scene.positions.len() - 8;
    let at = DVec3::new(0.05, 0.21, 0.008);
    assert!(scene.positions[tip].distance(at) < 1e-12);
    let of_tip = |contact: &&FaceContact| contact.particles[0] as usize == tip;
    let contacts: Vec<_> = scene.contacts.faces().iter().filter(of_tip).collect();
    let inside = contacts.iter().filter(|c| c.gap(&scene.positions) < 0.0);
    let inside: Vec<_> = inside.map(|c| c.normal_at(&scene.positions)).collect();
    assert_eq!(inside.len(), 1, "{contacts:?}");
    assert!(inside[0].z > 0.999, "{inside:?}");
}

/// A vertex that jumps into an inner tet, past the middle of a plate, is as deep as one in an outer tet.
#[test]
fn a_jump_past_the_middle_of_a_plate() {
    let plate = kuhn_box([6, 6, 3], DVec3::new(0.6, 0.6, 0.06));
    let mut spike = kuhn_box([1; 3], DVec3::splat(0.3));
    let turn = DQuat::from_rotation_arc(DVec3::ONE.normalize(), DVec3::Z);
    for x in &mut spike.positions {
        *x = turn * *x + DVec3::new(0.31, 0.33, 0.2);
    }
    let mut scene = Scene::new(&[plate, spike], ContactSettings::default());
    scene.update();
    assert!(scene.contacts.faces().is_empty());
    let tip = scene.positions.len() - 8;
    for depth in [0.035, 0.033, 0.027] {
        scene.shift(1, DVec3::Z * (0.06 - depth - scene.positions[tip].z));
        scene.search();
        compare(&scene);
        let of_tip = |contact: &&FaceContact| contact.particles[0] as usize == tip;
        let contacts: Vec<_> = scene.contacts.faces().iter().filter(of_tip).collect();
        assert_eq!(contacts.len(), 1, "at depth {depth}");
        assert!(contacts[0].normal_at(&scene.positions).z > 0.999);
        assert!((contacts[0].gap(&scene.positions) + depth).abs() < 1e-9);
        scene.shift(1, DVec3::Z);
        scene.search();
    }
}

/// The ends of a rolled plate that overlap by up to three fifths of its thickness push each other back to where they came
/// from.
#[test]
fn a_roll_whose_ends_overlap() {
    for offset in [0.009, 0.012, 0.015] {
        let plate = kuhn_box([24, 4, 1], DVec3::new(1.2, 0.4, 0.02));
        let mut scene = Scene::new(&[plate], ContactSettings::default());
        rolled(&mut scene, 1.2, 0.3);
        scene.update();
        rolled(&mut scene, 1.2, -0.3);
        // The end lies further out, and a little beside the start.
        let rest = scene.body.mesh().positions.clone();
        let out = |x: DVec3| DVec3::new(x.x, 0.0, x.z).normalize();
        for (x, rest) in scene.positions.iter_mut().zip(&rest) {
            *x += out(*x) * (offset * rest.x / 1.2) + DVec3::Y * (0.033 * rest.x);
        }
        scene.search();
        compare(&scene);
        // Away from the sides, by whether it is of the end.
        let mut held = [0; 2];
        for contact in scene.contacts.faces() {
            let vertex = contact.particles[0] as usize;
            let (x, at_rest) = (scene.positions[vertex], rest[vertex]);
            let normal = contact.normal_at(&scene.positions).dot(out(x));
            let is_at_side = at_rest.y < 0.05 || at_rest.y > 0.35;
            if is_at_side || normal.abs() < 0.7 {
                continue;
            }
            let is_end = at_rest.x > 0.6;
            let is_inner = at_rest.z < 0.01;
            if is_inner == is_end {
                held[usize::from(is_end)] += 1;
                let away = if is_end { normal } else { -normal };
                assert!(away > 0.9, "offset {offset}: {contact:?}");
                assert!(contact.gap(&scene.positions) < offset - 0.02 + 0.005);
            }
        }
        assert_eq!(held, [18, 18], "offset {offset}");
    }
}

/// A way out through three thin layers of tets is found, although hundreds of tets are fewer steps away.
#[test]
fn the_nearest_way_out_of_thin_layers() {
    let layers = kuhn_box([3, 3, 10], DVec3::new(3.0, 3.0, 0.5));
    let probe = moved(
        kuhn_box([8; 3], DVec3::splat(0.04)),
        DVec3::new(1.4, 1.55, 0.33),
    );
    let settings = ContactSettings {
        skin: 0.2,
        ..ContactSettings::default()
    };
    let mut scene = Scene::new(&[layers, probe], settings);
    scene.update();
    assert!(scene.reach(&[], &[]) < 0.1, "no triangle is near");
    assert_eq!((scene.contacts.deep(), scene.contacts.buried()), (386, 0));
    let tops = scene.contacts.faces().iter();
    let tops = tops.filter(|c| c.normal_at(&scene.positions).z > 0.999);
    assert!(
        tops.count() >= 386 - 17 * 8,
        "all but those that only face downward"
    );
}

/// Past the rim of what they rest on, vertices are not held by its plane, whatever part of the surface is closest to
/// them: a plate lies over a box and its overhanging ends hang a little below the top of the box.
#[test]
fn past_a_rim_nothing_is_held() {
    for shift in [0.0, 0.07, 0.31] {
        let below = kuhn_box([3; 3], DVec3::ONE);
        let plate = moved(
            kuhn_box([12, 12, 1], DVec3::new(2.4, 2.4, 0.1)),
            DVec3::new(-0.7 + shift, -0.7 + shift, 1.0),
        );
        let settings = ContactSettings {
            skin: 1.0,
            ..ContactSettings::default()
        };
        let mut scene = Scene::new(&[below, plate], settings);
        for x in &mut scene.positions[64..] {
            let over = |c: f64| (-c).max(c - 1.0).max(0.0);
            x.z -= 0.1 * over(x.x).max(over(x.y)) + 1e-4;
        }
        let is_over =
            |x: DVec3| x.x >= -1e-9 && x.x <= 1.0 + 1e-9 && x.y >= -1e-9 && x.y <= 1.0 + 1e-9;
        let settled = scene.positions.clone();
        // Found where they are, and found a little aside and then moved there without another search.
        for aside in [
            DVec3::ZERO,
            DVec3::new(0.03, 0.02, 0.0),
            DVec3::new(-0.04, 0.01, 0.0),
        ] {
            scene.positions.clone_from(&settled);
            scene.shift(1, aside);
            scene.search();
            compare(&scene);
            scene.positions.clone_from(&settled);
            let (mut held, mut beside) = (0, 0);
            for contact in scene.contacts.face_candidates() {
                let x = scene.positions[contact.particles[0] as usize];
                if contact.particles[0] < 64 || contact.particles[1] >= 64 {
                    continue;
                }
                let gap = contact.gap(&scene.positions);
                // What touched the rim is held a quarter of an altitude past it.
                let margin = if aside == DVec3::ZERO { 0.0 } else { 0.09 };
                let near = x.clamp(DVec3::ZERO, DVec3::ONE).with_z(x.z);
                if is_over(x) {
                    held += usize::from(gap < 0.0);
                } else if x.distance(near) > margin {
                    beside += 1;
                    assert!(gap > 0.0, "{x} is held: {gap} by {contact:?}");
                }
            }
            assert!(held >= 16 && beside >= 8, "{held} held, {beside} beside");
        }
    }
}

/// Planes and limits turn with the triangle.
#[test]
fn contacts_turn_with_their_bodies() {
    let ball = generate(Shape::Sphere, 800).unwrap();
    let top = ball.positions.iter().fold(0.0_f64, |top, x| top.max(x.z));
    let above = moved(ball.clone(), DVec3::new(0.3, 0.2, 1.95) * top);
    let bodies = [ball, above];
    let settings = ContactSettings {
        skin: 1.0,
        ..ContactSettings::default()
    };
    let mut scene = Scene::new(&bodies, settings);
    scene.update();
    let rest = scene.positions.clone();
    let turn = DQuat::from_axis_angle(DVec3::new(0.48, 0.6, 0.64), 1.1);
    let turned: Vec<DVec3> = rest.iter().map(|x| turn * *x + DVec3::X).collect();
    let contacts = scene.contacts.face_candidates();
    for contact in contacts {
        assert!((contact.gap(&turned) - contact.gap(&rest)).abs() < 1e-12);
        let normal = turn * contact.normal_at(&rest);
        assert!(contact.normal_at(&turned).distance(normal) < 1e-9);
    }
    let with = |has: &dyn Fn(&FaceContact) -> bool| contacts.iter().filter(|c| has(c)).count();
    let counts = [with(&|c| c.beyond.is_some()), with(&|c| c.limit.is_some())];
    assert!(
        counts.iter().all(|count| *count > 3),
        "{counts:?} of {}",
        contacts.len()
    );
}

fn same(one: &ContactDetector, other: &ContactDetector) -> bool {
    one.faces() == other.faces()
        && one.edges() == other.edges()
        && one.pairs() == other.pairs()
        && one.deep() == other.deep()
}

/// Results have the same bits for any number of threads.
#[test]
fn on_several_threads() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let bodies = [
                jittered_box(8, 0.2, 1),
                moved(jittered_box(8, 0.2, 2), DVec3::new(0.1, 0.05, 0.98)),
            ];
            let mut scene = Scene::new(&bodies, ContactSettings::default());
            let mut seen = Vec::new();
            for frame in 0..4 {
                if frame == 1 {
                    scene.cut(0, DVec3::splat(0.5), DVec3::new(1.0, 0.1, 0.2));
                }
                scene.update();
                seen.push(scene.contacts.clone());
                let up = scene.positions.iter_mut().filter(|x| x.z > 1.0);
                up.for_each(|x| *x += DVec3::new(0.02, 0.0, -0.02));
            }
            seen
        })
    };
    let one = run(1);
    assert!(one.iter().all(|contacts| contacts.faces().len() > 50));
    assert!(one.iter().any(|contacts| contacts.edges().len() > 5));
    for threads in [2, 3] {
        let many = run(threads);
        assert!(one.iter().zip(&many).all(|(one, other)| same(one, other)));
    }
}

/// Once the memory is there, a frame with a search and one without ask for none.
#[test]
fn a_frame_asks_for_no_memory() {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    pool.install(|| {
        let bodies = [
            jittered_box(5, 0.2, 1),
            moved(jittered_box(5, 0.2, 2), DVec3::new(0.1, 0.05, 0.99)),
        ];
        let mut scene = Scene::new(&bodies, ContactSettings::default());
        scene.cut(0, DVec3::splat(0.5), DVec3::X);
        let rest = scene.positions.clone();
        let sway = |scene: &mut Scene, frame: u32| {
            let by = 0.1 * f64::from(frame % 4);
            for (x, rest) in scene.positions.iter_mut().zip(&rest) {
                x.x = if rest.z > 0.985 { rest.x + by } else { rest.x };
            }
        };
        let (mut searched, mut kept) = (0, 0);
        for frame in 0..16 {
            sway(&mut scene, frame);
            for again in 0..2 {
                let measured = allocation_counter::measure(|| {
                    let update = scene.update();
                    (searched, kept) = match update.searched {
                        true => (searched + 1, kept),
                        false => (searched, kept + 1),
                    };
                });
                assert!(
                    frame < 8 || measured.count_total == 0,
                    "frame {frame}, {again}"
                );
            }
        }
        assert!(searched >= 12 && kept >= 12, "{searched} and {kept}");
        assert!(scene.contacts.faces().len() > 50 && !scene.contacts.pairs().is_empty());
    });
}

/// The list is kept while nothing comes closer than the search has looked, however the whole moves.
#[test]
fn when_a_search_is_due() {
    let bodies = [
        kuhn_box([3; 3], DVec3::ONE),
        moved(kuhn_box([3; 3], DVec3::ONE), DVec3::new(0.0, 0.0, 1.02)),
    ];
    let mut scene = Scene::new(&bodies, ContactSettings::default());
    assert!(scene.update().searched);
    let first = scene.update();
    assert!(!first.searched && !first.faces_changed && !first.pairs_changed);
    // Falling together is no approach.
    scene.velocities.fill(DVec3::new(0.0, 0.0, -50.0));
    for _ in 0..5 {
        scene.positions.iter_mut().for_each(|x| x.z -= 50.0 * FRAME);
        assert!(!scene.update().searched);
    }
    assert_eq!(scene.intervals(), 1);
    // Coming closer is.
    scene.shift(1, DVec3::new(0.3, 0.0, 0.0));
    assert!(scene.update().searched);
    scene.update();
    // A fast body is looked for further away, and asks for shorter frames.
    for p in scene.particles_of(1) {
        scene.velocities[p].z -= 0.4 * scene.contacts.mean_edge() / FRAME;
    }
    assert!(scene.update().searched);
    // Those of the two sides at least.
    assert!(scene.contacts.searched_vertices() >= 32);
    assert_eq!(scene.intervals(), 1);
    // Whether both fall or only one of them moves.
    for fall in [50.0, 0.0] {
        scene.velocities.fill(DVec3::new(0.0, 0.0, -fall));
        for (speed, intervals) in [(0.1, 1), (0.5, 1), (1.0, 2), (3.0, 4), (30.0, 4)] {
            for p in scene.particles_of(1) {
                scene.velocities[p] =
                    DVec3::new(0.0, 0.0, -fall - speed * scene.contacts.mean_edge() / FRAME);
            }
            assert_eq!(scene.intervals(), intervals);
        }
    }
    // Velocities that are no numbers ask for nothing.
    scene.velocities.fill(DVec3::NAN);
    assert_eq!(scene.intervals(), 1);
}

/// Motion asks for a search only where it may bring surfaces together.
#[test]
fn what_asks_for_no_search() {
    let cube = |at: DVec3| moved(kuhn_box([3; 3], DVec3::ONE), at);
    let bodies = [
        cube(DVec3::ZERO),
        cube(DVec3::new(0.0, 0.0, 1.02)),
        cube(DVec3::new(50.0, 0.0, 0.0)),
    ];
    let settings = ContactSettings {
        self_contact: false,
        ..ContactSettings::default()
    };
    let mut scene = Scene::new(&bodies, settings);
    assert!(scene.update().searched);
    // A body far away flies off.
    for _ in 0..5 {
        scene.shift(2, DVec3::new(0.0, 3.0, 0.0));
        for p in scene.particles_of(2) {
            scene.velocities[p] = DVec3::new(0.0, 180.0, 0.0);
        }
        assert!(!scene.update().searched, "far away");
    }
    assert_eq!(scene.contacts.faces().len(), 32);
    // When it comes near, it matters.
    let back = scene.positions[128] - DVec3::new(0.0, 0.0, 2.05);
    scene.velocities.fill(DVec3::ZERO);
    scene.shift(2, -back);
    assert!(scene.update().searched);
    assert!(scene.contacts.faces().len() > 40, "it lies on the others");
    // What approaches by more than the search looks ahead at all asks for parts of a frame, not for a search in each.
    for p in scene.particles_of(1) {
        scene.velocities[p].x = 100.0;
    }
    assert!(scene.update().searched, "it reaches further now");
    for _ in 0..3 {
        assert!(!scene.update().searched, "nothing has moved");
    }
}

/// A body that tumbles does not approach itself.
#[test]
fn tumbling_asks_for_no_search() {
    let mut scene = Scene::new(&[jittered_box(4, 0.2, 7)], ContactSettings::default());
    assert!(scene.update().searched);
    let rest = scene.positions.clone();
    let spin = DVec3::new(0.6, -1.0, 0.8);
    for frame in 1..=8 {
        let turn = DQuat::from_scaled_axis(spin * FRAME * f64::from(frame));
        for (p, rest) in rest.iter().enumerate() {
            let from = turn * (*rest - 0.5);
            scene.positions[p] = from + DVec3::new(0.5, 0.5, 0.5 - 0.1 * f64::from(frame));
            scene.velocities[p] = spin.cross(from) - DVec3::Z * (0.1 / FRAME);
        }
        // What is left is half a square of the angle over the body.
        assert!(!scene.update().searched, "frame {frame}");
    }
}

/// A vertex that slides by half a barycentric coordinate on a sliver has hardly moved: no search.
#[test]
fn slivers_ask_for_no_search() {
    let mut below = kuhn_box([4, 4, 1], DVec3::new(1.0, 1.0, 0.25));
    // A row of slivers on the top.
    for x in &mut below.positions {
        if (x.y - 0.5).abs() < 1e-9 {
            x.y = 0.2505;
        }
    }
    let above = moved(
        kuhn_box([1; 3], DVec3::splat(0.2)),
        DVec3::new(0.3, 0.2502, 0.2501),
    );
    let mut scene = Scene::new(&[below, above], ContactSettings::default());
    assert!(scene.update().searched);
    assert!(scene.contacts.faces().len() >= 4);
    for _ in 0..4 {
        scene.shift(1, DVec3::new(0.0, 1e-3, 0.0));
        assert!(!scene.update().searched);
    }
    scene.shift(1, DVec3::new(0.0, 0.1, 0.0));
    assert!(scene.update().searched);
}

/// Between two searches no contact is missed: what a search would find that may touch within the frame, is known.
#[test]
fn kept_lists_are_complete() {
    let (mut kept, mut compared) = (0, 0);
    for seed in 0..6 {
        let ball = generate(Shape::Sphere, 300).unwrap();
        let top = ball.positions.iter().fold(0.0_f64, |top, x| top.max(x.z));
        let at = [
            DVec3::ZERO,
            DVec3::new(0.2, 0.1, 2.02),
            DVec3::new(2.05, 0.3, 0.9),
            DVec3::new(0.4, -2.1, 0.5),
        ];
        let bodies: Vec<_> = at.map(|at| moved(ball.clone(), at * top)).to_vec();
        let count = ball.positions.len();
        let mut scene = Scene::new(&bodies, ContactSettings::default());
        for _ in 0..40 {
            for (i, x) in scene.positions.iter_mut().enumerate() {
                let (body, center) = (i / count, at[i / count] * top);
                let spin = direction(seed, body) * 0.4 * noise(seed, body + 9);
                let drift = direction(seed ^ 3, body) * 0.3 * top;
                scene.velocities[i] = drift + spin.cross(*x - center);
                *x += scene.velocities[i] * FRAME;
            }
            if scene.update().searched {
                continue;
            }
            kept += 1;
            let fresh = scene.searched_anew();
            let skin = fresh.settings().skin * fresh.mean_edge();
            for contact in fresh.faces() {
                let [vertex, corner, ..] = contact.particles;
                let gap = contact.gap(&scene.positions);
                let margin = scene.reach(&[vertex], &contact.particles[1..]) - skin;
                if gap < -0.02 * fresh.mean_edge() || gap > margin + 0.5 * skin {
                    continue;
                }
                compared += 1;
                let same = |known: &&FaceContact| {
                    let [v, c, ..] = known.particles;
                    v == vertex && c as usize / count == corner as usize / count
                };
                let known = scene.contacts.faces().iter().find(same);
                assert!(known.is_some(), "{contact:?} at {gap} is not known");
            }
        }
    }
    assert!(kept > 100 && compared > 50, "{kept} and {compared}");
}

/// What degenerates is not touched and does no harm.
#[test]
fn collapsed_and_inverted() {
    let bodies = [
        kuhn_box([3; 3], DVec3::ONE),
        moved(kuhn_box([3; 3], DVec3::ONE), DVec3::new(0.01, 0.01, 1.001)),
    ];
    let mut scene = Scene::new(&bodies, ContactSettings::default());
    scene.update();
    let all = scene.contacts.faces().len();
    // The upper body is turned inside out, then flattened, then becomes a point.
    let rest = scene.positions.clone();
    for scale in [-1.0, 0.0] {
        for (x, rest) in scene.positions.iter_mut().zip(&rest).skip(64) {
            let raised = DVec3::Z * (2.5 - 1.5 * f64::abs(scale));
            *x = *rest * DVec3::new(1.0, 1.0, scale) + raised;
        }
        scene.search();
        for contact in scene.contacts.faces() {
            assert!(contact.particles[1] < 64, "no triangle of it is touched");
            assert!(contact.gap(&scene.positions).is_finite());
            assert!(contact.normal_at(&scene.positions).is_finite());
        }
    }
    scene.positions[64..].fill(DVec3::new(0.5, 0.5, 1.0));
    scene.search();
    assert!(
        scene
            .contacts
            .faces()
            .iter()
            .all(|contact| contact.particles[1] < 64)
    );
    scene.positions.clone_from(&rest);
    scene.search();
    assert_eq!(scene.contacts.faces().len(), all);
}

#[test]
fn what_is_refused() {
    let body = incise_cutting::CuttableMesh::new(kuhn_box([1; 3], DVec3::ONE)).unwrap();
    let error = ContactDetector::new(&body, vec![0; 3], ContactSettings::default());
    let bodies = ContactError::Bodies {
        given: 3,
        particles: 8,
    };
    assert_eq!(error.unwrap_err(), bodies);
    let plain = ContactSettings::default;
    for settings in [
        ContactSettings {
            thickness: -1.0,
            ..plain()
        },
        ContactSettings {
            thickness: f64::NAN,
            ..plain()
        },
        ContactSettings {
            skin: 0.0,
            ..plain()
        },
        ContactSettings {
            skin: 1.5,
            ..plain()
        },
        ContactSettings {
            reach: -0.1,
            ..plain()
        },
        ContactSettings {
            reach: f64::INFINITY,
            ..plain()
        },
    ] {
        let error = ContactDetector::new(&body, vec![0; 8], settings.clone());
        assert!(
            matches!(error, Err(ContactError::Setting { .. })),
            "{settings:?}"
        );
    }
    assert!(BodyPairs::Only(vec![[1, 2]]).allow(2, 1));
}
