//! Pieces followed cut by cut against a full count.

use glam::DVec3;
use incise_cutting::{
    CutDelta, CutOptions, CuttableMesh, MovedTet, PieceEvent, PieceTracker, Plane, RemovedTet,
    Sweep, cut_plane,
};
use incise_mesh::{ParticleId, TetId, TetMesh, kuhn_box};
use incise_meshing::{Shape, generate};
use proptest::prelude::*;

use crate::bodies::{body, jittered_box, noise};

fn vector(seed: u64, first: usize) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|k| noise(seed, first + k)))
}

/// A mesh and another one, moved by `way`.
fn side_by_side(mut mesh: TetMesh, other: &TetMesh, way: DVec3) -> TetMesh {
    let first = mesh.positions.len();
    mesh.positions
        .extend(other.positions.iter().map(|x| *x + way));
    let shifted = |p: ParticleId| ParticleId::new(first + p.index());
    mesh.tets
        .extend(other.tets.iter().map(|tet| tet.map(shifted)));
    mesh
}

/// A body, its pieces, and its volume before all cuts.
struct Tracked {
    body: CuttableMesh,
    pieces: PieceTracker,
    volume: f64,
}

impl Tracked {
    fn new(mesh: TetMesh) -> Self {
        let body = CuttableMesh::new(mesh).unwrap();
        let pieces = PieceTracker::new(&body);
        pieces.check(&body).unwrap();
        Self {
            volume: body.mesh().total_volume(),
            body,
            pieces,
        }
    }

    /// Lets the pieces follow and compares everything with what the whole mesh says.
    fn apply_delta(&mut self, delta: &CutDelta) -> Vec<PieceEvent> {
        let before = self.pieces.clone();
        let events = self.pieces.apply_delta(&self.body, delta);
        self.pieces.check(&self.body).unwrap();

        // The events say what is new, and nothing else is.
        let known: Vec<u32> = before.iter().map(|piece| piece.id).collect();
        let mut expected = known.clone();
        let mut next = known.iter().max().map_or(0, |last| last + 1);
        for event in &events {
            match *event {
                PieceEvent::Detached {
                    piece,
                    from,
                    tets,
                    volume,
                } => {
                    assert!(piece >= next, "no number is used twice");
                    next = piece + 1;
                    let now = self.pieces.piece(piece).unwrap();
                    assert_eq!((now.parent, now.tets), (Some(from), tets));
                    assert_eq!(now.volume, volume);
                    assert!(known.contains(&from));
                    let rest = self.pieces.piece(from).unwrap();
                    assert!(
                        rest.tets >= tets,
                        "{rest:?} keeps the number, {now:?} came off"
                    );
                    if rest.tets == tets {
                        let mut labels = (0..).map(|t| self.pieces.piece_of(TetId::new(t)));
                        assert_eq!(
                            labels.find(|label| [piece, from].contains(label)),
                            Some(from)
                        );
                    }
                    expected.push(piece);
                }
                PieceEvent::Vanished { piece } => {
                    assert!(self.pieces.piece(piece).is_none());
                    expected.retain(|&id| id != piece);
                }
                other => panic!("unknown event {other:?}"),
            }
        }
        let ids: Vec<u32> = self.pieces.iter().map(|piece| piece.id).collect();
        assert_eq!(ids, expected);
        assert_eq!(ids.len(), self.pieces.count());
        if delta.deleted.is_empty() {
            // A tet stays on its piece or goes to one that came off it.
            for added in &delta.added {
                let (was, is) = (
                    before.piece_of(added.parent),
                    self.pieces.piece_of(added.tet),
                );
                let parent = self.pieces.piece(is).unwrap().parent;
                assert!(was == is || (!known.contains(&is) && parent == Some(was)));
            }
            // Sums of up to some thousand volumes, each rounded to 1e-16 of the whole.
            let sum: f64 = self.pieces.iter().map(|piece| piece.volume).sum();
            assert!((sum / self.volume - 1.0).abs() < 1e-12);
        }
        events
    }

    fn plane(&mut self, point: DVec3, normal: DVec3, snap: f64) -> Vec<PieceEvent> {
        let positions = self.body.mesh().positions.clone();
        let options = CutOptions {
            snap,
            ..CutOptions::default()
        };
        let plane = Plane { point, normal };
        let delta = cut_plane(&mut self.body, &positions, &plane, &options).unwrap();
        self.apply_delta(&delta)
    }

    /// Moves a blade by `way` in `frames` steps; returns how many pieces came off and the most visited tets of a frame.
    fn sweep(&mut self, blade: [DVec3; 2], way: DVec3, frames: u32) -> (usize, usize) {
        let rest = self.body.mesh().positions.clone();
        let mut stroke = Sweep::new(&self.body, &rest, &blade, CutOptions::default()).unwrap();
        let (mut came_off, mut visited) = (0, 0);
        for frame in 1..=frames {
            let pose = blade.map(|x| x + way * (f64::from(frame) / f64::from(frames)));
            let rest = self.body.mesh().positions.clone();
            let delta = stroke.advance(&mut self.body, &rest, &pose).unwrap();
            came_off += self.apply_delta(&delta).len();
            visited = visited.max(self.pieces.visited_tets());
        }
        (came_off, visited)
    }

    /// Takes away the tets that `gone` picks, the last ones taking over the free slots.
    fn delete(&mut self, gone: impl Fn(usize) -> bool) -> Vec<PieceEvent> {
        let mesh = self.body.mesh();
        let count = mesh.tets.len();
        let kept = (0..count).filter(|&t| !gone(t)).count();
        let slots = |wanted: bool, range: std::ops::Range<usize>| {
            let gone = &gone;
            range.filter(move |&t| gone(t) == wanted).map(TetId::new)
        };
        let removed = slots(true, 0..count).map(|tet| RemovedTet {
            tet,
            corners: mesh.tets[tet.index()],
        });
        let pairs = slots(false, kept..count).zip(slots(true, 0..kept));
        let delta = CutDelta {
            particles_before: mesh.positions.len(),
            tets_before: count,
            deleted: removed.collect(),
            moved: pairs
                .map(|(from, to)| MovedTet {
                    from,
                    to,
                    corners: mesh.tets[from.index()],
                })
                .collect(),
            worst_volume_ratio: 1.0,
            ..CutDelta::default()
        };
        let mut after = mesh.clone();
        delta.apply(&mut after);
        assert_eq!(after.tets.len(), kept);
        self.volume = after.total_volume();
        self.body = CuttableMesh::new(after).unwrap();
        self.apply_delta(&delta)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Planes, blades through everything and short blades that leave slits, on every kind of body.
    #[test]
    fn random_strokes(kind in 0_usize..6, seed in any::<u64>()) {
        let mut tracked = Tracked::new(body(kind, seed));
        let positions = &tracked.body.mesh().positions;
        let center = positions.iter().sum::<DVec3>() / positions.len() as f64;
        for stroke in 0..5 {
            let point = center + 0.3 * vector(seed, 20 * stroke);
            let (normal, along) = (vector(seed, 20 * stroke + 3), vector(seed, 20 * stroke + 6));
            prop_assume!(normal.length() > 0.1 && normal.cross(along).length() > 0.1);
            match (noise(seed, 20 * stroke + 9) * 2.0).floor() {
                -2.0 => {
                    tracked.plane(point, normal, 0.1);
                }
                -1.0 => {
                    tracked.plane(point, normal, 0.0);
                }
                which => {
                    let half = if which == 0.0 { 3.0 } else { 0.3 };
                    let along = along.normalize() * half;
                    let way = normal.cross(along).normalize();
                    tracked.sweep([point - along - 2.0 * way, point + along - 2.0 * way], way * 2.5, 6);
                }
            }
        }
    }

    /// Tets taken away at random, in crumbs and in slabs, until a single one is left.
    #[test]
    fn random_removals(kind in 0_usize..6, seed in any::<u64>()) {
        let mut tracked = Tracked::new(body(kind, seed));
        tracked.plane(tracked.body.mesh().positions[0] + vector(seed, 1) * 0.3, vector(seed, 4), 0.1);
        for round in 0..4 {
            let mesh = tracked.body.mesh().clone();
            let normal = vector(seed, 100 * round);
            let height = |t: usize| normal.dot(mesh.corners(TetId::new(t)).into_iter().sum::<DVec3>());
            let middle = height(mesh.tets.len() / 2);
            // A tet stays, since a mesh without tets is refused.
            tracked.delete(|t| {
                let slab = (height(t) - middle).abs() < 0.3 * normal.length();
                t > 0 && (slab || noise(seed, 1000 * round + t) > 0.7)
            });
        }
        tracked.delete(|t| t > 0);
        prop_assert_eq!(tracked.pieces.count(), 1);
    }
}

/// The larger part keeps the number; of equal parts the one with the lowest tet.
#[test]
fn who_keeps_the_number() {
    let mut tracked = Tracked::new(kuhn_box([10, 2, 2], DVec3::new(10.0, 1.0, 1.0)));
    let detached = |piece, from, tets, events: Vec<PieceEvent>| {
        let [
            PieceEvent::Detached {
                piece: p,
                from: f,
                tets: t,
                ..
            },
        ] = events[..]
        else {
            panic!("{events:?}")
        };
        assert_eq!((p, f, t), (piece, from, tets));
    };
    // 3 of 10 layers of 24 tets, off the low end, although it holds the lowest tet.
    detached(1, 0, 72, tracked.plane(DVec3::X * 3.0, DVec3::X, 0.0));
    detached(2, 0, 24, tracked.plane(DVec3::X * 9.0, DVec3::X, 0.0));
    // Six layers in halves, the same from both sides: what lies lower was first.
    detached(3, 0, 72, tracked.plane(DVec3::X * 6.0, DVec3::X, 0.0));
    let of_layer = |layer: usize| tracked.pieces.piece_of(TetId::new(6 * layer));
    assert_eq!([0, 3, 6, 9].map(of_layer), [1, 0, 3, 2]);
    let parents: Vec<_> = tracked.pieces.iter().map(|piece| piece.parent).collect();
    assert_eq!(parents, [None, Some(0), Some(0), Some(0)]);
    // The same again is nothing, and costs nothing.
    assert!(tracked.plane(DVec3::X * 6.0, DVec3::X, 0.0).is_empty());
    assert_eq!(tracked.pieces.visited_tets(), 0);
}

/// A cube on a bar that has fewer tets but more particles, so that its search ends last. A large piece beside them lets
/// the searches come to their ends.
#[test]
fn a_bar_with_more_particles_comes_off() {
    let mesh = kuhn_box([9, 2, 2], DVec3::new(9.0, 2.0, 2.0));
    let beside = kuhn_box([10; 3], DVec3::splat(10.0));
    let mut tracked = Tracked::new(side_by_side(mesh, &beside, DVec3::splat(20.0)));
    tracked.delete(|t| t < 6 * 36 && t / 6 % 9 >= 2 && t / 6 >= 9);
    let cube = tracked.pieces.piece(0).unwrap();
    assert_eq!(cube.tets, 6 * (8 + 7));
    let events = tracked.plane(DVec3::X * 2.0, DVec3::X, 0.0);
    let [PieceEvent::Detached { from: 0, tets, .. }] = events[..] else {
        panic!("{events:?}");
    };
    assert_eq!(tets, 6 * 7);
}

/// One cut takes parts off several pieces, and several parts off one.
#[test]
fn one_cut_through_many_pieces() {
    let mut tracked = Tracked::new(kuhn_box([4, 6, 2], DVec3::new(4.0, 6.0, 2.0)));
    for y in [1.0, 3.0] {
        tracked.plane(DVec3::Y * y, DVec3::Y, 0.0);
    }
    let events = tracked.plane(DVec3::X, DVec3::X, 0.0);
    let from: Vec<u32> = events
        .iter()
        .map(|event| match event {
            PieceEvent::Detached { from, .. } => *from,
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(from, [0, 1, 2]);
    assert_eq!(tracked.pieces.count(), 6);

    // A comb: cutting its back off sets all teeth free at once.
    let mut comb = Tracked::new(kuhn_box([9, 2, 1], DVec3::new(9.0, 2.0, 1.0)));
    comb.delete(|t| t % (6 * 9) / 6 % 2 == 1 && t / (6 * 9) == 1);
    assert_eq!(comb.pieces.count(), 1);
    assert_eq!(comb.plane(DVec3::Y, DVec3::Y, 0.0).len(), 5);
    let sizes: Vec<usize> = comb.pieces.iter().map(|piece| piece.tets).collect();
    assert_eq!(sizes, [54, 6, 6, 6, 6, 6]);
}

/// Taking away what holds two parts together sets one free; taking away a piece makes it vanish.
#[test]
fn removal() {
    let mut tracked = Tracked::new(kuhn_box([7, 1, 1], DVec3::new(7.0, 1.0, 1.0)));
    let events = tracked.delete(|t| t / 6 == 2);
    let [
        PieceEvent::Detached {
            piece: 1,
            from: 0,
            tets: 12,
            volume,
        },
    ] = events[..]
    else {
        panic!("{events:?}");
    };
    assert!((volume - 2.0).abs() < 1e-12);
    assert!((tracked.pieces.piece(0).unwrap().volume - 4.0).abs() < 1e-12);
    let gone = |piece| {
        let pieces = tracked.pieces.clone();
        move |t| pieces.piece_of(TetId::new(t)) == piece
    };
    let first = gone(1);
    assert_eq!(tracked.delete(first), [PieceEvent::Vanished { piece: 1 }]);
    let ids: Vec<u32> = tracked.pieces.iter().map(|piece| piece.id).collect();
    assert_eq!(ids, [0]);
    // Numbers are not used again.
    let events = tracked.plane(DVec3::X * 5.5, DVec3::X, 0.0);
    assert!(matches!(
        events[..],
        [PieceEvent::Detached { piece: 2, .. }]
    ));
}

/// Several parts of different size come off a large body at once: the search knows them all without going far.
#[test]
fn parts_that_come_off_together() {
    let n = 20;
    let mut tracked = Tracked::new(kuhn_box([n; 3], DVec3::ONE));
    let tets = tracked.body.mesh().tets.len();
    // Cubes of 1, 2 and 3 cells along an edge, with a hole around them.
    let hole = |t: usize| {
        let [x, y, z] = [t / 6 % n, t / 6 / n % n, t / 6 / n / n];
        let cube = |from: usize, size: usize| (from..from + size).contains(&x) && y.max(z) < size;
        x < 9 && y.max(z) < 4 && !(cube(0, 1) || cube(2, 2) || cube(5, 3))
    };
    let events = tracked.delete(hole);
    let mut sizes: Vec<usize> = events
        .iter()
        .map(|event| match event {
            PieceEvent::Detached { from: 0, tets, .. } => *tets,
            other => panic!("{other:?}"),
        })
        .collect();
    sizes.sort_unstable();
    assert_eq!(sizes, [6, 6 * 8, 6 * 27]);
    let visited = tracked.pieces.visited_tets();
    assert!(visited < tets / 4, "{visited} visited tets for {tets} tets");
}

/// A mesh of several bodies starts with as many pieces.
#[test]
fn pieces_before_all_cuts() {
    let mesh = kuhn_box([1; 3], DVec3::ONE);
    let other = kuhn_box([2, 1, 1], DVec3::ONE);
    let tracked = Tracked::new(side_by_side(mesh, &other, DVec3::Y * 3.0));
    let pieces: Vec<_> = tracked
        .pieces
        .iter()
        .map(|piece| (piece.id, piece.parent, piece.tets))
        .collect();
    assert_eq!(pieces, [(0, None, 6), (1, None, 12)]);
}

/// What does not follow is noticed.
#[test]
fn a_tracker_left_behind() {
    let mut body = CuttableMesh::new(kuhn_box([4; 3], DVec3::ONE)).unwrap();
    let tracker = PieceTracker::new(&body);
    let positions = body.mesh().positions.clone();
    let plane = Plane {
        point: DVec3::splat(0.5),
        normal: DVec3::X,
    };
    // Through a layer of particles: no tet is split, so only the pieces differ.
    cut_plane(&mut body, &positions, &plane, &CutOptions::default()).unwrap();
    let error = tracker.check(&body).unwrap_err().to_string();
    assert!(error.contains("pieces"), "{error}");
}

/// Opening a slit looks at tets near its front only; cutting a corner off looks at about what came off; halving looks
/// at about everything; and where the sides hang together far away the search goes there.
#[test]
fn looks_follow_the_cut() {
    // A short blade opens a slit from above, two cells deep into 24.
    let mut slit = Tracked::new(jittered_box(24, 0.1, 7));
    let tets = slit.body.mesh().tets.len();
    let blade = [DVec3::new(0.47, 0.3, 1.1), DVec3::new(0.47, 0.45, 1.1)];
    let (came_off, visited) = slit.sweep(blade, DVec3::NEG_Z * 0.5, 30);
    assert_eq!(came_off, 0);
    assert!(
        visited > 0 && visited < tets / 20,
        "{visited} visited tets for {tets} tets"
    );

    // A tet has 4 corners, each part is searched once and gathered once, and the other side is searched as far.
    let mut corner = Tracked::new(kuhn_box([24; 3], DVec3::ONE));
    let tets = corner.body.mesh().tets.len();
    let events = corner.plane(DVec3::ONE * 0.95, DVec3::ONE, 0.1);
    let [PieceEvent::Detached { tets: chip, .. }] = events[..] else {
        panic!("{events:?}");
    };
    let visited = corner.pieces.visited_tets();
    assert!(chip < tets / 100, "{chip} tets came off");
    // VertexStars at the boundary are smaller than inside, hence 20 instead of 12.
    assert!(
        visited < 20 * chip,
        "{visited} visited tets for a chip of {chip}"
    );

    // Halved bodies and rings cut once make it count all tets, after a search that looked at tets a quarter as often.
    let mut halved = Tracked::new(kuhn_box([12; 3], DVec3::ONE));
    assert_eq!(halved.plane(DVec3::X * 0.51, DVec3::X, 0.1).len(), 1);
    let mut ring = Tracked::new(generate(Shape::Torus, 3000).unwrap());
    let half = |angle: f64| [DVec3::ZERO, DVec3::new(angle.cos(), angle.sin(), 0.0) * 3.0];
    let pose = |angle: f64| half(angle).map(|x| x + DVec3::Z * 2.0);
    let (came_off, visited) = ring.sweep(pose(0.4), DVec3::NEG_Z * 4.0, 8);
    assert_eq!(came_off, 0);
    for (tracked, visited) in [(&halved, halved.pieces.visited_tets()), (&ring, visited)] {
        let tets = tracked.body.mesh().tets.len();
        // A round of the searches may go over the limit by the stars of all seeds.
        assert!(
            4 * visited > 5 * tets && visited < 2 * tets,
            "{visited} visited tets for {tets} tets"
        );
    }
    assert_eq!(ring.sweep(pose(2.4), DVec3::NEG_Z * 4.0, 8).0, 1);
}
