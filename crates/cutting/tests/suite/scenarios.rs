//! Cuts with a known outcome: pieces, the Euler characteristic of the boundary (2 for a ball, 0 for a ring), volumes.
//!
//! Half-way and on, two strokes that meet, crossing strokes and slits are in the module `sweeps`; dicing off the
//! particles in `planes`.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, dvec3};
use incise_cutting::{CutOptions, CuttableMesh, PieceTracker, Plane, Sweep, cut_plane};
use incise_mesh::{ParticleId, TetId, TetMesh, kuhn_box};
use incise_meshing::{Shape, generate};

use crate::bodies::check_cut;

/// A body at rest whose mesh and pieces are checked after every cut.
struct TrackedMesh {
    cuttable: CuttableMesh,
    pieces: PieceTracker,
    snap: f64,
}

impl TrackedMesh {
    fn new(mesh: TetMesh, snap: f64) -> Self {
        let cuttable = CuttableMesh::new(mesh).unwrap();
        Self {
            pieces: PieceTracker::new(&cuttable),
            cuttable,
            snap,
        }
    }

    fn options(&self) -> CutOptions {
        CutOptions {
            snap: self.snap,
            ..CutOptions::default()
        }
    }

    fn plane(&mut self, point: DVec3, normal: DVec3) {
        let (before, options) = (self.cuttable.mesh().clone(), self.options());
        let plane = Plane { point, normal };
        let delta = cut_plane(&mut self.cuttable, &before.positions, &plane, &options).unwrap();
        check_cut(&before, &self.cuttable, &delta);
        self.pieces.apply_delta(&self.cuttable, &delta);
        self.pieces.check(&self.cuttable).unwrap();
    }

    /// Moves a blade through poses given by a time from 0 to 1.
    fn sweep(&mut self, pose: impl Fn(f64) -> Vec<DVec3>, frames: u32) {
        let rest = self.cuttable.mesh().positions.clone();
        let mut stroke = Sweep::new(&self.cuttable, &rest, &pose(0.0), self.options()).unwrap();
        for frame in 1..=frames {
            let pose = pose(f64::from(frame) / f64::from(frames));
            let before = self.cuttable.mesh().clone();
            let delta = stroke
                .advance(&mut self.cuttable, &before.positions, &pose)
                .unwrap();
            if !delta.is_empty() {
                check_cut(&before, &self.cuttable, &delta);
            }
            self.pieces.apply_delta(&self.cuttable, &delta);
        }
        self.pieces.check(&self.cuttable).unwrap();
    }

    /// Number of pieces and Euler characteristic of the whole boundary.
    fn topology(&self) -> (usize, isize) {
        let surface = self.cuttable.mesh().surface();
        assert!(surface.is_manifold());
        (self.pieces.count(), surface.euler_characteristic())
    }

    fn volumes(&self) -> Vec<f64> {
        self.pieces.iter().map(|piece| piece.volume).collect()
    }
}

/// A straight blade along z, far longer than a body, at a place in the plane.
fn same_orientation(x: f64, y: f64) -> Vec<DVec3> {
    vec![dvec3(x, y, -9.0), dvec3(x, y, 9.0)]
}

/// A square tube along z with walls of a third of its width.
fn tube(n: usize) -> TetMesh {
    let mut mesh = kuhn_box([3 * n, 3 * n, 4 * n], dvec3(1.0, 1.0, 4.0 / 3.0));
    let inside = n..2 * n;
    let mut cell = 0..;
    mesh.tets.retain(|_| {
        let cell = cell.next().unwrap() / 6;
        !(inside.contains(&(cell % (3 * n))) && inside.contains(&(cell / (3 * n) % (3 * n))))
    });
    // Without the particles that are left over.
    let mut number = vec![None; mesh.positions.len()];
    let mut positions = Vec::new();
    for p in mesh.tets.iter_mut().flatten() {
        *p = *number[p.index()].get_or_insert_with(|| {
            positions.push(mesh.positions[p.index()]);
            ParticleId::new(positions.len() - 1)
        });
    }
    mesh.positions = positions;
    mesh
}

/// A ball of radius 1/2 cut at height d: two caps, to second order in the size of the tets.
#[test]
fn a_sphere_in_two() {
    for tets in [1000, 8000] {
        for height in [0.0, 0.13, -0.31] {
            let mesh = generate(Shape::Sphere, tets).unwrap();
            let mut body = TrackedMesh::new(mesh, 0.0);
            body.plane(DVec3::Z * height, DVec3::Z);
            assert_eq!(body.topology(), (2, 4));
            let cap = |h: f64| PI * h * h * (0.5 - h / 3.0);
            let mut expected = [cap(0.5 - height), cap(0.5 + height)];
            let mut volumes = body.volumes();
            expected.sort_by(f64::total_cmp);
            volumes.sort_by(f64::total_cmp);
            // The edge of a cube that holds six tets.
            let h2 = (6.0 * (PI / 6.0) / tets as f64).powf(2.0 / 3.0);
            for (volume, cap) in volumes.into_iter().zip(expected) {
                assert!((volume - cap).abs() < h2, "{volume} against {cap}, h² {h2}");
            }
        }
    }
}

/// Cutting a ring once opens it: one piece, now a ball. Twice: two balls.
#[test]
fn a_torus_once_and_twice() {
    for snap in [0.0, 0.1] {
        let mut body = TrackedMesh::new(generate(Shape::Torus, 2000).unwrap(), snap);
        assert_eq!(body.topology(), (1, 0));
        let radial = |angle: f64| {
            move |t: f64| {
                let out = dvec3(angle.cos(), angle.sin(), 0.0);
                vec![DVec3::ZERO, out]
                    .into_iter()
                    .map(|x| x + DVec3::Z * (1.0 - 2.0 * t))
                    .collect()
            }
        };
        body.sweep(radial(0.3), 12);
        assert_eq!(body.topology(), (1, 2));
        body.sweep(radial(2.1), 12);
        assert_eq!(body.topology(), (2, 4));
        // A sector between the angles, whatever the ring's cross section.
        let ratio = body.volumes()[1] / body.volumes().iter().sum::<f64>();
        assert!((ratio - 1.8 / TAU).abs() < 0.02, "{ratio}");
    }
}

#[test]
fn a_box_in_slices() {
    for slices in [1_usize, 4, 9] {
        let mut body = TrackedMesh::new(kuhn_box([12, 3, 3], dvec3(4.0, 1.0, 1.0)), 0.0);
        for i in 1..=slices {
            body.plane(DVec3::X * 4.0 * i as f64 / (slices + 1) as f64, DVec3::X);
        }
        let pieces = slices + 1;
        assert_eq!(
            body.topology(),
            (pieces, 2 * isize::try_from(pieces).unwrap())
        );
        for volume in body.volumes() {
            assert!((volume - 4.0 / pieces as f64).abs() < 1e-12);
        }
    }
}

/// Along layers of particles nothing is split: a thousand cubes of six tets.
#[test]
fn a_cube_into_a_thousand_cubes() {
    let mut body = TrackedMesh::new(kuhn_box([10; 3], DVec3::ONE), 0.1);
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        for i in 1..10 {
            body.plane(DVec3::ONE * (0.1 * f64::from(i)), axis);
        }
    }
    assert_eq!(body.topology(), (1000, 2000));
    assert!(body.pieces.iter().all(|piece| piece.tets == 6));
    assert!(
        body.volumes()
            .iter()
            .all(|volume| (volume - 1e-3).abs() < 1e-15)
    );
    let sum: f64 = body.volumes().iter().sum();
    assert!((sum - 1.0).abs() < 1e-12);
}

/// A blade in the shape of a U cuts a tongue out of the top that hangs on at one end.
#[test]
fn a_flap() {
    for (n, snap) in [(10, 0.0), (10, 0.1), (12, 0.1)] {
        let mesh = kuhn_box([n; 3], DVec3::ONE);
        let tets = mesh.tets.len();
        let mut body = TrackedMesh::new(mesh, snap);
        let blade = [(0.23, 1.2), (0.31, 0.65), (0.71, 0.64), (0.78, 1.2)];
        let pose = |t: f64| blade.map(|(x, z)| dvec3(x, 0.75 * t - 0.1, z)).to_vec();
        body.sweep(pose, 30);
        assert_eq!(body.topology(), (1, 2));
        assert!(body.cuttable.mesh().tets.len() > tets + 500);
        // Cutting across the hinge sets its tip free.
        let across = |t: f64| {
            let z = 1.2 - 0.65 * t;
            vec![dvec3(0.0, 0.33, z), dvec3(1.0, 0.33, z)]
        };
        body.sweep(across, 20);
        assert_eq!(body.pieces.count(), 2);
        // The trapezoid between the blade's arms, below the height of the top.
        let [a, b, c, d] = blade.map(|(x, z)| DVec3::new(x, 0.0, z));
        let at = |from: DVec3, to: DVec3| from.lerp(to, (1.0 - from.z) / (to.z - from.z));
        let (left, right) = (at(b, a), at(c, d));
        let area = 0.5 * (c - left).cross(right - b).length();
        let tip = 0.33 * area;
        // Snapping moves faces by a tenth of a cell at most, some here, some there.
        let volume = body.volumes()[1];
        assert!((volume / tip - 1.0).abs() < 0.05, "{volume} against {tip}");
    }
}

/// Three turns through a plate that do not reach the rim: one piece, with a hole through it. A straight stroke out of
/// the middle crosses each turn and sets two rings free.
#[test]
fn a_spiral() {
    let mesh = kuhn_box([26, 26, 2], dvec3(1.0, 1.0, 0.08));
    let mut body = TrackedMesh::new(mesh, 0.1);
    let pose = |t: f64| {
        let (angle, radius) = (3.0 * TAU * t, 0.06 + 0.38 * t);
        same_orientation(0.5 + radius * angle.cos(), 0.5 + radius * angle.sin())
    };
    body.sweep(pose, 200);
    assert_eq!(body.topology(), (1, 0));
    body.sweep(|t| same_orientation(0.503, 0.5 + t * 0.6), 30);
    assert_eq!(body.topology(), (3, 6));
}

/// Across a tube: a plane leaves two tubes, a blade half-way through none, and a blade led around the axis closes its
/// own ring.
#[test]
fn a_tube() {
    for snap in [0.0, 0.1] {
        let mut body = TrackedMesh::new(tube(3), snap);
        assert_eq!(body.topology(), (1, 0));
        body.plane(dvec3(0.0, 0.0, 0.7), DVec3::Z);
        assert_eq!(body.topology(), (2, 0));

        let mut body = TrackedMesh::new(tube(3), snap);
        let across = |t: f64| {
            vec![
                dvec3(-1.0, 1.1 - 1.2 * t, 0.61),
                dvec3(2.0, 1.1 - 1.2 * t, 0.61),
            ]
        };
        body.sweep(|t| across(0.5 * t), 15);
        // A window in the wall: a ring with one more hole.
        assert_eq!(body.topology(), (1, -2));

        let mut body = TrackedMesh::new(tube(3), snap);
        let around = |turns: f64| {
            move |t: f64| {
                let (sin, cos) = (turns * t * TAU + 0.2).sin_cos();
                [0.05, 0.8]
                    .map(|r| dvec3(0.5 + r * cos, 0.5 + r * sin, 0.61))
                    .to_vec()
            }
        };
        body.sweep(around(0.9), 40);
        assert_eq!(body.topology(), (1, -2));
        let mut body = TrackedMesh::new(tube(3), snap);
        body.sweep(around(1.1), 50);
        assert_eq!(body.topology(), (2, 0));
        let lower = 0.61 / (4.0 / 3.0);
        let ratio = body.volumes()[1] / body.volumes().iter().sum::<f64>();
        assert!((ratio - lower).abs() < 0.01, "{ratio} against {lower}");
    }
}

/// Repeating a stroke changes nothing, in as many frames or in fewer. Where it stops inside it splits nothing either,
/// but may open a face at its front that stayed closed the first time.
#[test]
fn the_same_stroke_again() {
    for snap in [0.0, 0.1] {
        for (shape, tets, depth) in [
            (Shape::Sphere, 1500, 1.0),
            (Shape::Sphere, 1500, 1.4),
            (Shape::Liver, 2000, 1.4),
        ] {
            let mesh = generate(shape, tets).unwrap();
            let whole = mesh.tets.len();
            let mut body = TrackedMesh::new(mesh, snap);
            let pose = |t: f64| {
                [(0.04, -1.0), (0.07, 1.0)]
                    .map(|(x, y)| dvec3(x, y, 0.7 - depth * t))
                    .to_vec()
            };
            body.sweep(pose, 17);
            let (once, pieces) = (body.cuttable.mesh().clone(), body.pieces.count());
            assert!(once.tets.len() > whole + 100);
            assert_eq!(pieces > 1, depth > 1.0);
            for frames in [17, 5] {
                body.sweep(pose, frames);
                let again = body.cuttable.mesh();
                assert_eq!(
                    (again.tets.len(), body.pieces.count()),
                    (once.tets.len(), pieces)
                );
                assert!(depth == 1.0 || *again == once, "{shape:?}, snap {snap}");
            }
        }
    }
}

/// The lowest tet of a tube is where it was made.
#[test]
fn the_tube_is_one() {
    let mesh = tube(2);
    mesh.check().unwrap();
    assert_eq!(mesh.tets.len(), 6 * (36 - 4) * 8);
    assert!((mesh.volume(TetId(0)) * mesh.tets.len() as f64 - 8.0 / 9.0 * 4.0 / 3.0).abs() < 1e-12);
}
