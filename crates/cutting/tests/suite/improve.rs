//! Improvement: what must hold after it, and how far it brings a much cut body back.

use glam::DVec3;
use incise_cutting::{
    CutDelta, CutError, CutOptions, CuttableMesh, FaceTag, ImproveOptions, ImproveQueue,
    PieceTracker, Plane, Skin, StrokeRegistry, Sweep, cut_plane, cut_surface, improve, remove_tets,
};
use incise_mesh::{ParticleId, TetId, TetMesh, closest_on_triangle, kuhn_box};
use proptest::prelude::*;

use crate::bodies::{bend, body, check_cut, jittered_box, noise, options, strip, volumes};

/// A body with its pieces and skin.
struct Patient {
    body: CuttableMesh,
    positions: Vec<DVec3>,
    pieces: PieceTracker,
    skin: Skin,
    queue: ImproveQueue,
    flipped: usize,
    registry: StrokeRegistry,
    /// The cut faces of each stroke before they were improved.
    opened: Vec<Vec<[DVec3; 3]>>,
}

impl Patient {
    fn new(mesh: &TetMesh, positions: Vec<DVec3>) -> Self {
        let body = CuttableMesh::new(mesh.clone()).unwrap();
        Self {
            positions,
            pieces: PieceTracker::new(&body),
            skin: Skin::new(body.boundary()),
            body,
            queue: ImproveQueue::default(),
            flipped: 0,
            registry: StrokeRegistry::default(),
            opened: Vec::new(),
        }
    }

    fn apply(&mut self, before: &TetMesh, delta: &CutDelta) {
        check_cut(before, &self.body, delta);
        delta.extend_particles(&mut self.positions);
        self.pieces.apply_delta(&self.body, delta);
        self.pieces.check(&self.body).unwrap();
        self.skin.apply_delta(delta);
        self.queue.extend(delta.created_particles());
    }

    /// Returns the number of faces that are recorded.
    fn plane(&mut self, point: DVec3, normal: DVec3, options: &CutOptions) -> usize {
        let before = self.body.mesh().clone();
        let plane = Plane { point, normal };
        let delta = cut_plane(&mut self.body, &self.positions, &plane, options).unwrap();
        self.apply(&before, &delta);
        delta.opened
    }

    /// Moves the blade of a stroke that joins earlier ones.
    fn advance(&mut self, stroke: &mut Sweep, blade: &[DVec3]) {
        let before = self.body.mesh().clone();
        let Self {
            body,
            positions,
            registry,
            ..
        } = self;
        let delta = stroke.advance_joining(body, positions, blade, registry);
        self.apply(&before, &delta.unwrap());
    }

    /// Improves and checks what must hold.
    fn improve(
        &mut self,
        options: &ImproveOptions,
        locked: impl Fn(ParticleId) -> bool,
    ) -> CutDelta {
        let before = self.body.mesh().clone();
        let sizes = volumes(&self.body);
        let outer_before = outer_area(&self.body);
        let count = self.pieces.count();
        let worst = sines(&before).fold(1.0, f64::min);
        let mut queue = std::mem::take(&mut self.queue);
        let delta = improve(
            &mut self.body,
            &self.positions,
            &mut queue,
            options,
            &self.registry,
            |_, p| locked(p),
        )
        .unwrap();
        assert!(queue.is_empty() || options.max_tets < usize::MAX);
        self.apply(&before, &delta);
        self.queue = queue;
        self.flipped += delta.flipped;
        assert_eq!(self.pieces.count(), count);
        let now = sines(self.body.mesh()).fold(1.0, f64::min);
        assert!(
            now >= worst.min(0.2) * (1.0 - 1e-9),
            "the worst angle does not become worse: {worst} {now}"
        );
        let inverted = |mesh: &TetMesh, positions: &[DVec3]| {
            let moved = TetMesh {
                positions: positions.to_vec(),
                tets: mesh.tets.clone(),
            };
            let count = (0..moved.tets.len()).filter(|&t| moved.volume(TetId::new(t)) <= 0.0);
            count.count()
        };
        let left = inverted(self.body.mesh(), &self.positions);
        assert!(
            left <= inverted(&before, &self.positions),
            "no tet is inverted"
        );
        // Two sides of a cut trade what they lose and gain.
        let total: f64 = sizes.iter().sum();
        let now: f64 = volumes(&self.body).iter().sum();
        assert!(
            (now - total).abs() <= 1e-12 * total,
            "volume {total} became {now}"
        );
        for (old, new) in sizes.iter().zip(volumes(&self.body)) {
            assert!((old - new).abs() <= 0.05 * total);
        }
        let outer = outer_area(&self.body);
        assert!((outer - outer_before).abs() <= 1e-9 * outer);
        for particle in (0..before.positions.len()).map(ParticleId::new) {
            if locked(particle) && before.tets.iter().flatten().any(|p| *p == particle) {
                assert!(
                    self.body.around(particle).next().is_some(),
                    "a locked particle stays"
                );
            }
        }
        let drawn = self.skin.triangles().len();
        assert_eq!(drawn, self.body.boundary_count());
        delta
    }
}

fn outer_area(body: &CuttableMesh) -> f64 {
    let outer = body.boundary().filter(|t| t.tag == FaceTag::Outer);
    let area = |particles: [ParticleId; 3]| {
        let [a, b, c] = particles.map(|p| body.mesh().positions[p.index()]);
        (b - a).cross(c - a).length() / 2.0
    };
    outer.map(|t| area(t.particles)).sum()
}

/// The smallest sine of a dihedral angle of each tet.
fn sines(mesh: &TetMesh) -> impl Iterator<Item = f64> + '_ {
    mesh.tets.iter().map(|tet| {
        let x = tet.map(|p| mesh.positions[p.index()]);
        let mut least = f64::INFINITY;
        for (i, j) in [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)] {
            let mut rest = (0..4).filter(|&k| k != i && k != j);
            let (k, l) = (rest.next().unwrap(), rest.next().unwrap());
            let along = (x[j] - x[i]).normalize();
            let across = |y: DVec3| (y - x[i] - along * along.dot(y - x[i])).normalize();
            least = least.min(across(x[k]).cross(across(x[l])).length());
        }
        least
    })
}

/// Tets with a dihedral angle below 5 or above 175 degrees.
fn slivers(mesh: &TetMesh) -> usize {
    let limit = 5.0_f64.to_radians().sin();
    sines(mesh).filter(|sine| *sine < limit).count()
}

/// A single plane through a grid: most of what the cut added goes again, and calls end with one that changes nothing.
#[test]
fn a_plane_through_a_grid() {
    for snap in [0.0, 0.1, 0.25] {
        let mesh = kuhn_box([5; 3], DVec3::ONE);
        let mut patient = Patient::new(&mesh, mesh.positions.clone());
        patient.plane(
            DVec3::splat(0.43),
            DVec3::new(1.0, 0.2, 0.1),
            &options(snap),
        );
        let added = patient.body.mesh().tets.len() - mesh.tets.len();
        let mut calls = 0;
        loop {
            let delta = patient.improve(&ImproveOptions::default(), |_| false);
            if delta.is_empty() {
                break;
            }
            calls += 1;
            patient.queue = ImproveQueue::default();
            let all = (0..delta.particles_after()).map(ParticleId::new);
            patient.queue.extend(all);
        }
        assert!((1..10).contains(&calls));
        let left = patient.body.mesh().tets.len() - mesh.tets.len();
        assert!(10 * left < 6 * added);
    }
}

#[test]
fn bad_tolerances_are_refused() {
    let mesh = kuhn_box([1; 3], DVec3::ONE);
    let mut body = CuttableMesh::new(mesh.clone()).unwrap();
    for tolerance in [-0.1, 0.3, f64::NAN] {
        let options = ImproveOptions {
            tolerance,
            ..ImproveOptions::default()
        };
        let refused = improve(
            &mut body,
            &mesh.positions,
            &mut ImproveQueue::default(),
            &options,
            &StrokeRegistry::default(),
            |_, _| false,
        );
        assert!(matches!(refused, Err(CutError::Improve { .. })));
    }
    let options = ImproveOptions::default();
    let registry = StrokeRegistry::default();
    let queue = &mut ImproveQueue::default();
    let refused = improve(&mut body, &[], queue, &options, &registry, |_, _| false);
    assert!(refused.is_err());
    assert_eq!(body.mesh(), &mesh);
}

/// Ten slices a tenth of a cell apart, or a quarter where crossings move by snapping, since edges become longer and crossings
/// move further along them: with improvement the body has less than a quarter of the tets, and as many pieces.
#[test]
fn ten_thin_slices() {
    for (snap, apart) in [(0.0, 0.1), (0.1, 0.25)] {
        let mesh = jittered_box(6, 0.1, 3);
        let run = |improves: bool| {
            let mut patient = Patient::new(&mesh, mesh.positions.clone());
            for i in 0..10 {
                let point = DVec3::new(0.35 + apart / 6.0 * f64::from(i), 0.0, 0.0);
                patient.plane(point, DVec3::new(1.0, 0.1, 0.05), &options(snap));
                if improves {
                    patient.improve(&ImproveOptions::default(), |_| false);
                }
            }
            patient
        };
        let [plain, improved] = [false, true].map(run);
        let counts = [&plain, &improved].map(|patient| {
            let mesh = patient.body.mesh();
            (mesh.tets.len(), slivers(mesh), patient.pieces.count())
        });
        let [(grown, bad, count), (tets, slivers, same)] = counts;
        assert_eq!((count, same), (11, 11), "{snap}");
        assert!(4 * tets < grown, "{snap}: {tets} of {grown}");
        assert!(2 * slivers < bad, "{snap}: {slivers} of {bad}");
    }
}

/// Short strokes across each other.
fn short_strokes(
    mesh: &TetMesh,
    count: usize,
    snap: f64,
    options: Option<&ImproveOptions>,
) -> Patient {
    let mut patient = Patient::new(mesh, mesh.positions.clone());
    let edge = (mesh.total_volume() / mesh.tets.len() as f64 * 8.0).cbrt();
    for i in 0..count {
        let direction =
            |k: usize| DVec3::from_array([0, 1, 2].map(|j| noise(3, 20 * i + 3 * k + j)));
        let center = DVec3::splat(0.5) + 0.3 * direction(0);
        let along = direction(1).normalize_or(DVec3::X) * 3.0 * edge;
        let path = direction(2).normalize_or(DVec3::Y) * 3.0 * edge;
        let pose = |t: f64| [center - along + path * t, center + along + path * t];
        let cut_options = CutOptions {
            tag: u32::try_from(i).unwrap(),
            ..crate::bodies::options(snap)
        };
        let mut stroke =
            Sweep::new(&patient.body, &patient.positions, &pose(-1.0), cut_options).unwrap();
        for t in [0.0, 1.0] {
            let before = patient.body.mesh().clone();
            let positions = patient.positions.clone();
            let delta = stroke
                .advance(&mut patient.body, &positions, &pose(t))
                .unwrap();
            patient.apply(&before, &delta);
        }
        patient
            .opened
            .push(faces_of(&patient.body, i.try_into().unwrap()));
        if let Some(options) = options {
            patient.improve(options, |_| false);
        }
    }
    patient
}

/// Where strokes cross, four parts and more meet at a place: with improvement the body has half of the tets and less
/// than half of the slivers, none of them away from features.
#[test]
fn strokes_across_each_other() {
    for snap in [0.0, 0.1] {
        let mesh = jittered_box(5, 0.1, 5);
        let options = ImproveOptions::default();
        let [plain, improved] = [None, Some(&options)].map(|options| {
            let patient = short_strokes(&mesh, 16, snap, options);
            (patient.body.mesh().tets.len(), slivers(patient.body.mesh()))
        });
        assert!(2 * improved.0 < plain.0, "{plain:?} {improved:?}");
        assert!(2 * improved.1 < plain.1, "{plain:?} {improved:?}");
    }
}

/// A cut across an open one crosses both of its sides at one place at rest, where positions in single precision put them
/// apart by rounding, so that both can be merged together.
#[test]
fn both_sides_are_crossed_at_one_place() {
    let mesh = jittered_box(5, 0.1, 5);
    let edge = edge_of(&mesh);
    for (snap, is_swept) in [(0.0, false), (0.1, false), (0.0, true), (0.1, true)] {
        let mut patient = Patient::new(&mesh, mesh.positions.clone());
        patient.plane(
            DVec3::splat(0.43),
            DVec3::new(1.0, 0.2, 0.1),
            &options(snap),
        );
        let shake = |patient: &mut Patient, seed: u64| {
            let rest = patient.body.mesh().positions.iter().enumerate();
            let by = |i: usize| DVec3::from_array([0, 1, 2].map(|k| noise(seed, 3 * i + k)));
            patient.positions = rest.map(|(i, x)| x + 1e-6 * edge * by(i)).collect();
        };
        shake(&mut patient, 7);
        if is_swept {
            let pose = |t: f64| {
                [
                    DVec3::new(-0.5, 0.47, t),
                    DVec3::new(1.5, 0.52 + 0.1 * t, t),
                ]
            };
            let mut stroke = Sweep::new(
                &patient.body,
                &patient.positions,
                &pose(-0.1),
                options(snap),
            )
            .unwrap();
            for i in 0_u32..5 {
                let before = patient.body.mesh().clone();
                let positions = patient.positions.clone();
                let to = pose(0.1 + 0.25 * f64::from(i));
                let delta = stroke.advance(&mut patient.body, &positions, &to).unwrap();
                patient.apply(&before, &delta);
                shake(&mut patient, 10 + u64::from(i));
            }
        } else {
            patient.plane(
                DVec3::splat(0.47),
                DVec3::new(0.1, 1.0, 0.2),
                &options(snap),
            );
        }
        assert_eq!(patient.pieces.count(), 4);
        check_places(&patient);
    }
}

/// One side of a cut has longer edges than the other, since particles on planes were merged there only: a cut across both
/// crosses them at one place.
#[test]
fn sides_with_different_edges_are_crossed_at_one_place() {
    let mesh = jittered_box(5, 0.1, 5);
    let edge = edge_of(&mesh);
    let normal = DVec3::new(1.0, 0.2, 0.1);
    let mut patient = Patient::new(&mesh, mesh.positions.clone());
    patient.plane(DVec3::splat(0.43), normal, &options(0.0));
    patient.plane(DVec3::splat(0.47), DVec3::new(0.1, 1.0, 0.2), &options(0.0));
    let is_behind = |tet: TetId, body: &CuttableMesh| {
        let center = body.mesh().corners(tet).iter().sum::<DVec3>() * 0.25;
        normal.dot(center - DVec3::splat(0.43)) < 0.0
    };
    let behind: Vec<ParticleId> = (0..patient.positions.len())
        .map(ParticleId::new)
        .filter(|p| {
            let mut around = patient.body.around(*p);
            around.any(|tet| is_behind(tet, &patient.body))
        })
        .collect();
    let delta = patient.improve(&ImproveOptions::default(), |p| {
        behind.binary_search(&p).is_ok()
    });
    assert!(delta.collapsed > 10);
    let rest = patient.body.mesh().positions.iter().enumerate();
    let by = |i: usize| DVec3::from_array([0, 1, 2].map(|k| noise(9, 3 * i + k)));
    patient.positions = rest.map(|(i, x)| x + 1e-6 * edge * by(i)).collect();
    patient.plane(DVec3::splat(0.45), DVec3::new(0.2, 0.1, 1.0), &options(0.0));
    assert_eq!(patient.pieces.count(), 8);
    check_places(&patient);
}

/// Particles of cut faces are at one place or clearly apart.
fn check_places(patient: &Patient) {
    let edge = edge_of(patient.body.mesh());
    let corners = patient.body.boundary().filter(|t| t.tag != FaceTag::Outer);
    let mut particles: Vec<ParticleId> = corners.flat_map(|t| t.particles).collect();
    particles.sort_unstable();
    particles.dedup();
    let rest = |p: ParticleId| patient.body.mesh().positions[p.index()];
    for (i, &one) in particles.iter().enumerate() {
        for &other in &particles[i + 1..] {
            let distance = rest(one).distance(rest(other)) / edge;
            assert!(
                !(1e-12..1e-4).contains(&distance),
                "{one:?} and {other:?} are {distance} edges apart"
            );
        }
    }
}

/// A call stops at its limit and leaves the rest: many small calls bring as much as a large one.
#[test]
fn limited_calls_continue() {
    let mesh = jittered_box(4, 0.1, 3);
    let run = |max_tets: usize| {
        let mut patient = Patient::new(&mesh, mesh.positions.clone());
        for i in 0..2 {
            let point = DVec3::splat(0.41 + 0.03 * f64::from(i));
            patient.plane(
                point,
                DVec3::new(1.0, 0.1 * f64::from(i), 0.05),
                &options(0.0),
            );
        }
        let options = ImproveOptions {
            max_tets,
            ..ImproveOptions::default()
        };
        let (mut calls, mut largest) = (0, 0);
        while !patient.queue.is_empty() {
            let delta = patient.improve(&options, |_| false);
            largest = largest.max(delta.collapsed);
            calls += 1;
        }
        (patient.body.mesh().tets.len(), calls, largest)
    };
    let (all, one, _) = run(usize::MAX);
    let (some, many, largest) = run(1000);
    assert!(
        one == 1 && many > 10 && largest < 40,
        "{many} calls, {largest}"
    );
    assert!(20 * some.abs_diff(all) < all, "{some} {all}");
}

/// However often cut faces are merged, and however closely another stroke runs beside or continues, all of a face stays
/// within the tolerance of what the stroke opened whose number it has.
#[test]
fn cut_faces_stay_with_their_stroke() {
    let mesh = jittered_box(5, 0.1, 5);
    let improves = ImproveOptions::default();
    let crossing = |snap: f64| short_strokes(&mesh, 16, snap, Some(&improves));
    // Through one line, nearly in each other.
    let turned = |snap: f64| {
        let mut patient = Patient::new(&mesh, mesh.positions.clone());
        for i in 0..8 {
            let turn = 0.03 * f64::from(i);
            let normal = DVec3::new(1.0, turn, 0.1 - turn);
            let options = CutOptions {
                tag: i,
                ..options(snap)
            };
            patient.plane(DVec3::splat(0.47), normal, &options);
            patient.opened.push(faces_of(&patient.body, i));
            patient.improve(&improves, |_| false);
        }
        patient
    };
    // Across the first one, which snapping has bent.
    let across = |snap: f64| {
        let mut patient = Patient::new(&mesh, mesh.positions.clone());
        for i in 0..12 {
            let turn = 0.7 * f64::from(i);
            let (point, normal) = match i {
                0 => (0.47, DVec3::new(1.0, 0.2, 0.1)),
                _ => (
                    0.4 + 0.015 * f64::from(i),
                    DVec3::new(0.1 * turn.sin(), turn.cos(), turn.sin()),
                ),
            };
            let options = CutOptions {
                tag: i,
                ..options(if i == 0 { 0.1 } else { snap })
            };
            patient.plane(DVec3::splat(point), normal, &options);
            patient.opened.push(faces_of(&patient.body, i));
            patient.improve(&improves, |_| false);
        }
        patient
    };
    // Many at one place, which join each other where they are nearly one surface.
    let dense = |snap: f64| {
        let mut patient = Patient::new(&mesh, mesh.positions.clone());
        for i in 0..16 {
            let direction =
                |k: usize| DVec3::from_array([0, 1, 2].map(|j| noise(1, 20 * i + 3 * k + j)));
            let center = DVec3::splat(0.5) + 0.1 * direction(0);
            let along = 0.5 * direction(1).normalize_or(DVec3::X);
            let path = 0.5 * direction(2).normalize_or(DVec3::Y);
            let pose = |t: f64| [center - along + path * t, center + along + path * t];
            let tag = u32::try_from(i).unwrap();
            let options = CutOptions {
                tag,
                ..options(snap)
            };
            let mut stroke =
                Sweep::new(&patient.body, &patient.positions, &pose(-1.0), options).unwrap();
            for t in [-0.5, 0.0, 0.5, 1.0] {
                patient.advance(&mut stroke, &pose(t));
            }
            patient.opened.push(faces_of(&patient.body, tag));
            patient.improve(&improves, |_| false);
        }
        patient
    };
    for snap in [0.0, 0.1] {
        for patient in [crossing(snap), turned(snap), across(snap), dense(snap)] {
            check_faces(&patient, improves.tolerance * edge_of(&mesh));
        }
    }
}

/// A stroke that stops in the body is improved at its front and continued later, on its plane and turned a little, or in
/// a second row over the first one: the body separates as it does without improvement.
#[test]
fn strokes_continue_across_improved_fronts() {
    let run = |case: usize, snap: f64, improves: bool| {
        let mesh = jittered_box(4, 0.15, case as u64);
        let mut patient = Patient::new(&mesh, mesh.positions.clone());
        let random = |k: usize| noise(case as u64, k);
        let normal = DVec3::new(1.0, 0.4 * random(0), 0.4 * random(1)).normalize();
        let along = normal.cross(DVec3::Y).normalize();
        let path = along.cross(normal);
        let center = DVec3::splat(0.5) + 0.2 * random(2) * normal;
        let middle = 0.3 * random(3);
        // Each with the blade, and its way along `path`.
        let turned = (path + 0.15 * random(4) * normal).normalize();
        let strokes = match case % 3 {
            0 => [
                ([-1.5, 1.5], path, [-1.5, middle]),
                ([-1.5, 1.5], path, [middle, 1.5]),
            ],
            1 => [
                ([-1.5, 1.5], path, [-1.5, middle]),
                ([-1.5, 1.5], turned, [middle, 1.5]),
            ],
            _ => [
                ([-1.5, middle + 0.2], path, [-1.5, 1.5]),
                ([middle - 0.2, 1.5], path, [1.5, -1.5]),
            ],
        };
        for (tag, (blade, way, span)) in (0..).zip(strokes) {
            let start = center + middle * (path - way);
            let pose = |t: f64| blade.map(|x| start + x * along + t * way);
            let options = CutOptions {
                tag,
                ..options(snap)
            };
            let (body, positions) = (&patient.body, &patient.positions);
            let mut stroke = Sweep::new(body, positions, &pose(span[0]), options).unwrap();
            for k in 1..=6 {
                let to = span[0] + (span[1] - span[0]) * f64::from(k) / 6.0;
                patient.advance(&mut stroke, &pose(to));
            }
            if improves {
                patient.improve(&ImproveOptions::default(), |_| false);
            }
        }
        patient.pieces.count()
    };
    for case in (0..12).chain([21]) {
        for snap in [0.0, 0.1] {
            let [plain, improved] = [false, true].map(|improves| run(case, snap, improves));
            assert_eq!(plain, improved, "case {case}, snap {snap}");
        }
    }
}

/// Cut faces of strokes that were not recorded stay in their planes, and nothing is kept of them.
#[test]
fn faces_that_were_not_recorded_stay_in_their_planes() {
    let mesh = jittered_box(5, 0.1, 5);
    let improves = ImproveOptions::default();
    let run = |records: bool| {
        let mut patient = Patient::new(&mesh, mesh.positions.clone());
        patient.body.record_opened_faces(records);
        let (mut opened, mut collapsed) = (0, 0);
        for i in 0..6 {
            let turn = 0.03 * f64::from(i);
            let options = CutOptions {
                tag: i,
                ..options(0.1)
            };
            let normal = DVec3::new(1.0, turn, 0.1 - turn);
            opened += patient.plane(DVec3::splat(0.47), normal, &options);
            patient.opened.push(faces_of(&patient.body, i));
            collapsed += patient.improve(&improves, |_| false).collapsed;
        }
        (patient, opened, collapsed)
    };
    let (patient, opened, collapsed) = run(false);
    check_faces(&patient, 1e-9 * edge_of(&mesh));
    assert_eq!(opened, 0);
    let (_, recorded, more) = run(true);
    assert!(
        recorded > 0 && more > collapsed && collapsed > 0,
        "{collapsed} of {more}"
    );
}

fn edge_of(mesh: &TetMesh) -> f64 {
    (mesh.total_volume() / mesh.tets.len() as f64 * 6.0 * 2.0_f64.sqrt()).cbrt()
}

/// Samples all cut faces: none is farther than `most` from what its stroke opened.
fn check_faces(patient: &Patient, most: f64) {
    for (stroke, opened) in (0..).zip(&patient.opened) {
        for [a, b, c] in faces_of(&patient.body, stroke) {
            let weights = (0..=4).flat_map(|i| (0..=4 - i).map(move |j| [i, j]));
            for [u, v] in weights.map(|w| w.map(|i| f64::from(i) / 4.0)) {
                let x = a + (b - a) * u + (c - a) * v;
                let is_near = |face: &[DVec3; 3]| {
                    closest_on_triangle(*face, x).point.distance(x) <= most * (1.0 + 1e-9)
                };
                assert!(
                    opened.iter().any(is_near),
                    "{x} is far from the faces of stroke {stroke}"
                );
            }
        }
    }
}

/// The corners of the cut faces of a stroke.
fn faces_of(body: &CuttableMesh, stroke: u32) -> Vec<[DVec3; 3]> {
    let faces = body.boundary().filter(|t| t.tag == FaceTag::Cut(stroke));
    faces
        .map(|t| t.particles.map(|p| body.mesh().positions[p.index()]))
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Cuts of all kinds in bent bodies, improved after each, with locked particles.
    #[test]
    fn random_cuts(
        kind in 1_usize..6, seed in any::<u64>(), snap in prop::sample::select(vec![0.0, 0.1, 0.25]),
        tolerance in prop::sample::select(vec![0.0, 0.05, 0.25]),
        locked in 1_usize..5, max_tets in prop::sample::select(vec![0, 300, usize::MAX]),
    ) {
        let mesh = body(kind, seed);
        let mut patient = Patient::new(&mesh, bend(&mesh, 0.2));
        let center = patient.positions.iter().sum::<DVec3>() / mesh.positions.len() as f64;
        let size = patient.positions.iter().map(|x| x.distance(center)).fold(0.0, f64::max);
        for i in 0..4 {
            let direction = |k: usize| DVec3::from_array([0, 1, 2].map(|j| noise(seed, 30 * i + 3 * k + j)));
            let point = center + 0.3 * size * direction(0);
            let before = patient.body.mesh().clone();
            if i % 2 == 0 {
                patient.plane(point, direction(1) + DVec3::splat(1e-3), &options(snap));
            } else {
                let bend = [direction(1), direction(2), direction(3)].map(|x| point + size * x);
                let further = bend.map(|x| x + 2.0 * size * direction(4));
                let Ok(surface) = strip(&bend, &further) else { continue };
                let positions = patient.positions.clone();
                let delta = cut_surface(&mut patient.body, &positions, &surface, &options(snap)).unwrap();
                patient.apply(&before, &delta);
            }
            let options = ImproveOptions { tolerance, max_tets };
            patient.improve(&options, |p| p.index() % 5 >= locked);
        }
        // What follows works on the mesh as it is.
        let before = patient.body.mesh().clone();
        let delta = remove_tets(&mut patient.body, &[TetId(0)], 9).unwrap();
        patient.apply(&before, &delta);
    }
}
