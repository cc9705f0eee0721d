//! Pairs across fresh cuts against a slow search for faces at one place at rest that look in opposite directions.

use std::collections::BTreeSet;

use glam::DVec3;
use incise_contact::ContactSettings;
use incise_cutting::{
    BoundaryTriangle, CutOptions, CuttableMesh, FaceTag, Separation, Sweep, carve, remove_tets,
};
use incise_mesh::{ParticleId, TetId, kuhn_box};
use proptest::prelude::*;

use crate::scene::{Scene, below, direction, jittered_box};

/// Particles of cut faces that coincide at rest, corner by corner, and look in opposite directions.
fn by_rest_position(mesh: &CuttableMesh) -> BTreeSet<[ParticleId; 2]> {
    let rest = &mesh.mesh().positions;
    let cut = |t: &BoundaryTriangle| matches!(t.tag, FaceTag::Cut(_));
    let faces: Vec<[ParticleId; 3]> = mesh.boundary().filter(cut).map(|t| t.particles).collect();
    let mut pairs = BTreeSet::new();
    for (i, one) in faces.iter().enumerate() {
        for other in &faces[..i] {
            let at = |p: ParticleId| rest[p.index()];
            let turned = |k: usize| [0, 1, 2].map(|i| other[(k + 3 - i) % 3]);
            let same = (0..3).map(turned).find(|turned| {
                let mut corners = one.iter().zip(turned);
                // Points on edges of both sides are rounded in their own ways.
                corners.all(|(p, q)| at(*p).distance(at(*q)) < 1e-9)
            });
            if let Some(turned) = same {
                let corners = one.iter().zip(turned);
                let different = corners.filter(|(p, q)| *p != q);
                pairs.extend(different.map(|(&p, q)| [p.min(q), p.max(q)]));
            }
        }
    }
    pairs
}

fn known(scene: &Scene) -> BTreeSet<[ParticleId; 2]> {
    scene.contacts.fresh_pairs().iter().collect()
}

/// Compares at rest; returns how many pairs there are.
fn compare(scene: &Scene) -> usize {
    let (known, expected) = (known(scene), by_rest_position(&scene.body));
    assert_eq!(known, expected);
    known.len()
}

#[test]
fn of_one_cut() {
    let mut scene = Scene::new(&[kuhn_box([4; 3], DVec3::ONE)], ContactSettings::default());
    assert_eq!(compare(&scene), 0);
    let delta = scene.cut(0, DVec3::splat(0.4), DVec3::new(1.0, 0.2, 0.1));
    assert_eq!(compare(&scene), delta.copies.len());
    scene.update();
    assert_eq!(scene.contacts.pairs().len(), delta.copies.len());
    for pair in scene.contacts.pairs() {
        assert_eq!(pair.gap(&scene.positions).to_bits(), 0.0_f64.to_bits());
        assert!((pair.normal.length() - 1.0).abs() < 1e-12);
    }
    // What else is near each other across the cut is a way off.
    let mut others = scene.contacts.faces().iter();
    assert!(others.all(|contact| contact.gap(&scene.positions) > 0.02));
}

/// The normals of a plane cut are those of the plane, at the rim, too, and point from the first side into the second.
#[test]
fn normals_are_those_of_the_cut() {
    let mut scene = Scene::new(&[jittered_box(4, 0.2, 7)], ContactSettings::default());
    let normal = DVec3::new(1.0, 0.3, -0.2).normalize();
    // Without snapping, which bends the cut.
    let options = CutOptions {
        snap: 0.0,
        ..CutOptions::default()
    };
    scene.cut_with(&options, DVec3::splat(0.45), normal);
    scene.update();
    assert!(scene.contacts.pairs().len() > 20);
    for pair in scene.contacts.pairs() {
        assert!((pair.normal.dot(normal).abs() - 1.0).abs() < 1e-9);
        let second = ParticleId(pair.particles[1]);
        let tets = scene.body.around(second);
        let rest = &scene.body.mesh().positions;
        let centers = tets.map(|tet| scene.body.mesh().corners(tet).iter().sum::<DVec3>() / 4.0);
        for center in centers {
            assert!(pair.normal.dot(center - rest[second.index()]) > 0.0);
        }
    }
}

/// Where two cuts cross there are four copies and four pairs: one for each arm of the cross, none across it.
#[test]
fn of_crossing_cuts() {
    let mut scene = Scene::new(&[kuhn_box([4; 3], DVec3::ONE)], ContactSettings::default());
    scene.cut(0, DVec3::splat(0.4), DVec3::X);
    scene.cut(1, DVec3::splat(0.4), DVec3::Y);
    assert_eq!(scene.pieces.count(), 4);
    compare(&scene);
    scene.update();
    let rest = &scene.body.mesh().positions;
    let on_line = |p: u32| {
        let x = rest[p as usize];
        (x.x - 0.4).abs() < 1e-9 && (x.y - 0.4).abs() < 1e-9
    };
    let mut crossings = 0;
    for pair in scene.contacts.pairs() {
        let normal = pair.normal.abs();
        assert!(normal.x.max(normal.y) > 1.0 - 1e-9, "along one of the cuts");
        crossings += usize::from(on_line(pair.particles[0]));
    }
    let line = (0..scene.positions.len()).filter(|&p| on_line(u32::try_from(p).unwrap()));
    assert_eq!(
        crossings,
        line.count(),
        "as many pairs as copies: four each"
    );
    assert!(crossings >= 20);
}

/// A blade that goes through frame by frame copies the particles at its front one frame later.
#[test]
fn of_a_running_cut() {
    let mut scene = Scene::new(&[jittered_box(4, 0.2, 3)], ContactSettings::default());
    let blade = |z: f64| [-0.5, 0.25, 0.75, 1.5].map(|y: f64| DVec3::new(0.4 + 0.1 * y, y, z));
    let options = CutOptions::default();
    let mut stroke = Sweep::new(&scene.body, &scene.positions, &blade(1.1), options).unwrap();
    let mut last = 0;
    for frame in 1..=14 {
        let pose = blade(1.1 - 0.1 * f64::from(frame));
        let delta = stroke
            .advance(&mut scene.body, &scene.positions, &pose)
            .unwrap();
        scene.apply(&delta);
        let pairs = compare(&scene);
        assert!(pairs >= last);
        last = pairs;
        scene.update();
        assert_eq!(scene.contacts.pairs().len(), pairs);
        let gaps = scene.contacts.pairs().iter();
        assert!(
            gaps.map(|pair| pair.gap(&scene.positions))
                .all(|gap| gap == 0.0)
        );
    }
    assert!(last > 20 && scene.pieces.count() == 2);
}

/// One side of a cut is cut once more while the other is elsewhere.
#[test]
fn of_a_side_that_is_cut_again() {
    let mut scene = Scene::new(&[kuhn_box([4; 3], DVec3::ONE)], ContactSettings::default());
    scene.cut(0, DVec3::splat(0.4), DVec3::X);
    compare(&scene);
    scene.shift(1, DVec3::new(-3.0, 0.0, 3.0));
    let delta = scene.cut(1, DVec3::new(0.7, 0.4, 0.4), DVec3::new(0.0, 1.0, 0.3));
    compare(&scene);
    scene.update();
    let rest = &scene.body.mesh().positions;
    let points = (0..delta.points.len()).map(|i| ParticleId::new(delta.particles_before + i));
    let on_first = points.filter(|p| (rest[p.index()].x - 0.4).abs() < 1e-9);
    let alone = on_first.filter(|&p| {
        let mut partners = scene.contacts.fresh_pairs().partners(p);
        // Those it has are across the second cut.
        partners.all(|q| (scene.positions[p.index()] - scene.positions[q.index()]).length() < 1.0)
    });
    assert!(alone.count() > 4);
    for particle in scene.contacts.surface().vertices() {
        let partners = scene.contacts.fresh_pairs().partners(particle);
        for partner in partners {
            let at = |p: ParticleId| scene.body.mesh().positions[p.index()];
            assert!(at(particle).distance(at(partner)) < 1e-9);
        }
    }
}

/// Faces that are laid bare by taking tets away have no other side; those that lose one are no twins any more.
#[test]
fn of_tets_taken_away() {
    let mut scene = Scene::new(&[kuhn_box([4; 3], DVec3::ONE)], ContactSettings::default());
    scene.cut(0, DVec3::splat(0.4), DVec3::X);
    let before = compare(&scene);
    let drill = |x: DVec3| (x - DVec3::new(0.55, 0.5, 0.5)).length() < 0.25;
    let delta = carve(&mut scene.body, &scene.positions, drill, 1).unwrap();
    assert!(!delta.deleted.is_empty() && !delta.moved.is_empty());
    scene.apply(&delta);
    assert!(compare(&scene) < before);
    for step in 0..10_u64 {
        let count = scene.body.mesh().tets.len();
        let tets: Vec<TetId> = (0..8).map(|i| TetId::new(below(count, step, i))).collect();
        let delta = remove_tets(&mut scene.body, &tets, 2).unwrap();
        scene.apply(&delta);
        compare(&scene);
    }
}

/// A pair that has slid apart does not come back, not even when a cut changes its faces.
#[test]
fn what_has_ended_stays_so() {
    let mut scene = Scene::new(&[kuhn_box([4; 3], DVec3::ONE)], ContactSettings::default());
    scene.cut(0, DVec3::splat(0.4), DVec3::X);
    scene.update();
    scene.shift(1, DVec3::new(0.0, 0.2, 0.0));
    scene.update();
    assert_eq!(scene.contacts.fresh_pairs().count(), 0);
    assert!(scene.contacts.pairs().is_empty());
    scene.shift(1, DVec3::new(0.0, -0.2, 0.0));
    scene.update();
    assert_eq!(scene.contacts.fresh_pairs().count(), 0);
    assert!(!scene.contacts.faces().is_empty());
    scene.cut(1, DVec3::splat(0.4), DVec3::Y);
    scene.update();
    let rest = &scene.body.mesh().positions;
    let first_cut = (0..rest.len()).filter(|&p| (rest[p].x - 0.4).abs() < 1e-9);
    let pairs = known(&scene);
    for particle in first_cut.map(ParticleId::new) {
        let partners = pairs.iter().filter(|pair| pair.contains(&particle));
        for pair in partners.flatten().filter(|p| **p != particle) {
            assert!(rest[particle.index()].y > 0.0 && rest[pair.index()].y > 0.0);
        }
    }
}

/// Sides that are pulled apart sleep; when they come back they are held again.
#[test]
fn what_is_far_sleeps() {
    let mut scene = Scene::new(&[kuhn_box([4; 3], DVec3::ONE)], ContactSettings::default());
    scene.cut(0, DVec3::splat(0.4), DVec3::X);
    scene.update();
    let pairs = scene.contacts.pairs().to_vec();
    let away = pairs[0].normal
        * if scene
            .particles_of(1)
            .contains(&(pairs[0].particles[1] as usize))
        {
            1.0
        } else {
            -1.0
        };
    scene.shift(1, away);
    assert!(scene.update().pairs_changed);
    assert!(scene.contacts.pairs().is_empty());
    assert_eq!(scene.contacts.fresh_pairs().count(), pairs.len());
    scene.shift(1, -away);
    assert!(scene.update().pairs_changed);
    assert_eq!(scene.contacts.pairs().len(), pairs.len());
}

#[test]
fn taking_cuts_back() {
    let mut scene = Scene::new(&[jittered_box(3, 0.2, 11)], ContactSettings::default());
    let mut undone = Vec::new();
    for (tag, normal) in (0..).zip([DVec3::X, DVec3::Y, DVec3::new(1.0, 1.0, 0.5)]) {
        let pairs = known(&scene);
        undone.push((scene.cut(tag, DVec3::splat(0.45), normal), pairs));
        compare(&scene);
    }
    for (delta, before) in undone.into_iter().rev() {
        scene.undo(&delta);
        let now = known(&scene);
        // What the cut ended does not come back; what it made is gone.
        assert!(now.is_subset(&before));
        assert!(now.is_subset(&by_rest_position(&scene.body)));
        scene.update();
        scene.contacts.check(&scene.body).unwrap();
    }
    assert_eq!(scene.contacts.fresh_pairs().count(), 0);
    // A running cut copies and takes back, frame by frame.
    let blade = |z: f64| [-0.5, 1.5].map(|y: f64| DVec3::new(0.4, y, z));
    let options = CutOptions::default();
    let mut stroke = Sweep::new(&scene.body, &scene.positions, &blade(1.1), options).unwrap();
    let mut frames = Vec::new();
    for frame in 1..=8 {
        let pose = blade(1.1 - 0.1 * f64::from(frame));
        let delta = stroke
            .advance(&mut scene.body, &scene.positions, &pose)
            .unwrap();
        let pairs = known(&scene);
        scene.apply(&delta);
        compare(&scene);
        frames.push((delta, pairs));
    }
    for (delta, before) in frames.into_iter().rev() {
        scene.undo(&delta);
        assert!(known(&scene).is_subset(&before));
    }
}

/// The pairs within a piece of which a particle is on a triangle of an inverted tet.
fn pushed_through(scene: &Scene) -> BTreeSet<[ParticleId; 2]> {
    let least = -1e-3 * scene.contacts.mean_edge().powi(3);
    let place = |p: ParticleId| scene.positions[p.index()];
    let mut pushed = BTreeSet::new();
    for triangle in scene.body.boundary() {
        let [a, b, c, d] = scene.body.mesh().tets[triangle.tet.index()].map(place);
        if (b - a).dot((c - a).cross(d - a)) < least {
            pushed.extend(triangle.particles);
        }
    }
    let piece = |p: ParticleId| {
        let mut tets = scene.body.mesh().tets.iter();
        let tet = tets.position(|corners| corners.contains(&p)).unwrap();
        scene.pieces.piece_of(TetId::new(tet))
    };
    let pairs = known(scene).into_iter();
    pairs
        .filter(|[a, b]| piece(*a) == piece(*b) && (pushed.contains(a) || pushed.contains(b)))
        .collect()
}

fn listed(scene: &Scene) -> BTreeSet<[ParticleId; 2]> {
    let pairs = scene.contacts.pairs().iter();
    pairs.map(|pair| pair.particles.map(ParticleId)).collect()
}

/// A slit from above whose sides touch; in a body that it does not divide, or does.
fn slit(seed: u64, divides: bool) -> Scene {
    let mut scene = Scene::new(&[jittered_box(4, 0.2, seed)], ContactSettings::default());
    let blade = |z: f64| [-0.5, 1.5].map(|y: f64| DVec3::new(0.45, y, z));
    let options = CutOptions::default();
    let mut stroke = Sweep::new(&scene.body, &scene.positions, &blade(1.1), options).unwrap();
    let end = if divides { -0.1 } else { 0.3 };
    let delta = stroke
        .advance(&mut scene.body, &scene.positions, &blade(end))
        .unwrap();
    scene.apply(&delta);
    assert_eq!(scene.pieces.count(), if divides { 2 } else { 1 });
    scene
}

/// A particle behind one side of a slit is pushed out through it: the pairs of that side rest until it is back. Between
/// two pieces they do not.
#[test]
fn those_of_an_inverted_tet_rest() {
    for divides in [false, true] {
        let mut scene = slit(1, divides);
        scene.update();
        let pairs = listed(&scene);
        assert!(pairs == known(&scene) && pairs.len() > 20);
        let rest = scene.body.mesh().positions.clone();
        let behind = (0..rest.len()).find(|&p| rest[p].distance(DVec3::new(0.5, 0.5, 0.5)) < 0.1);
        scene.positions[behind.unwrap()].x -= 0.2;
        scene.update();
        let resting: BTreeSet<_> = pairs.difference(&listed(&scene)).copied().collect();
        assert_eq!(resting, pushed_through(&scene));
        assert_eq!(resting.is_empty(), divides);
        assert_eq!(known(&scene), pairs, "none has ended");
        scene.positions = rest;
        scene.update();
        assert_eq!(listed(&scene), pairs);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Inner particles are pushed anywhere; the sides of the slit stay where they are, so that every pair is near.
    #[test]
    fn of_random_inverted_tets_rest(seed in any::<u64>(), divides in any::<bool>(), count in 0_usize..12) {
        let mut scene = slit(seed, divides);
        let on_surface: BTreeSet<_> = scene.body.boundary().flat_map(|t| t.particles).collect();
        let inner: Vec<usize> = (0..scene.positions.len())
            .filter(|&p| !on_surface.contains(&ParticleId::new(p)))
            .collect();
        for number in 0..count {
            let p = inner[below(inner.len(), seed, number)];
            scene.positions[p] += 0.5 * direction(seed ^ 1, number);
        }
        scene.update();
        let expected = &known(&scene) - &pushed_through(&scene);
        prop_assert_eq!(listed(&scene), expected);
    }

    /// Random planes through random bodies, by both criteria of separation, with and without snapping.
    #[test]
    fn of_random_cuts(seed in any::<u64>(), cuts in 1_u32..4, by_particles in any::<bool>(), snap in 0.0..0.2) {
        let mut scene = Scene::new(&[jittered_box(3, 0.2, seed)], ContactSettings::default());
        for tag in 0..cuts {
            let options = CutOptions {
                tag,
                snap,
                separation: if by_particles { Separation::SharedOffSurface } else { Separation::CutFaces },
                ..CutOptions::default()
            };
            let point = DVec3::splat(0.5) + direction(seed, tag as usize) * 0.2;
            scene.cut_with(&options, point, direction(seed ^ 1, tag as usize));
            let (known, expected) = (known(&scene), by_rest_position(&scene.body));
            // Particles that a cut is bent to on one side only are no points of the other.
            prop_assert!(known.is_subset(&expected));
            if snap == 0.0 || tag == 0 {
                prop_assert_eq!(known, expected);
            }
        }
    }
}
