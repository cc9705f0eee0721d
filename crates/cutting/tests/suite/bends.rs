//! Bent blades: polylines swept through a body, against the strip of triangles that they trace.

use glam::DVec3;
use incise_cutting::{CuttableMesh, Sweep, cut_surface};
use incise_mesh::{TetMesh, kuhn_box};
use proptest::prelude::*;

use crate::bodies::{check_cut, jittered_box, options, strip, volumes};

/// Moves a blade along a straight path in so many frames.
fn swept(
    mesh: &TetMesh,
    blade: &[DVec3],
    path: [DVec3; 2],
    frames: usize,
    snap: f64,
) -> CuttableMesh {
    let mut body = CuttableMesh::new(mesh.clone()).unwrap();
    let pose = |frame: usize| -> Vec<DVec3> {
        let offset = path[0].lerp(path[1], frame as f64 / frames as f64);
        blade.iter().map(|x| *x + offset).collect()
    };
    let mut stroke = Sweep::new(&body, &mesh.positions, &pose(0), options(snap)).unwrap();
    for frame in 1..=frames {
        let before = body.mesh().clone();
        let delta = stroke
            .advance(&mut body, &before.positions, &pose(frame))
            .unwrap();
        if !delta.is_empty() {
            check_cut(&before, &body, &delta);
        }
    }
    body
}

/// Cuts with the strip that the blade traces.
fn traced(mesh: &TetMesh, blade: &[DVec3], path: [DVec3; 2], snap: f64) -> CuttableMesh {
    let mut body = CuttableMesh::new(mesh.clone()).unwrap();
    let [first, second] = path.map(|offset| blade.iter().map(|x| *x + offset).collect::<Vec<_>>());
    let surface = strip(&first, &second).unwrap();
    cut_surface(&mut body, &mesh.positions, &surface, &options(snap)).unwrap();
    body
}

/// Blades in the plane y = 0 between `a` and `b`: open to the top, a corner, a step, and a closed tunnel.
fn shapes(a: f64, b: f64) -> [Vec<DVec3>; 4] {
    let points = |xz: &[[f64; 2]]| xz.iter().map(|[x, z]| DVec3::new(*x, 0.0, *z)).collect();
    [
        points(&[[a, 1.5], [a, a], [b, a], [b, 1.5]]),
        points(&[[a, 1.5], [a, a], [1.5, a]]),
        points(&[[a, 1.5], [a, a], [b, b], [b, -0.5]]),
        points(&[[a, b], [a, a], [b, a], [b, b], [a, b]]),
    ]
}

/// The sides of the blade run in layers of a lattice, through particles, edges and faces only.
#[test]
fn bends_on_lattice_layers() {
    for n in [4, 6] {
        let mesh = kuhn_box([n; 3], DVec3::ONE);
        let h = 1.0 / n as f64;
        for mut blade in shapes(h, 1.0 - h) {
            for reversed in [false, true] {
                if reversed {
                    blade.reverse();
                }
                for snap in [0.0, 0.1, 0.2] {
                    let path = [DVec3::Y * -0.3, DVec3::Y * 1.3];
                    let expected = volumes(&traced(&mesh, &blade, path, snap));
                    assert_eq!(expected.len(), 2);
                    for frames in [3, 13, 40] {
                        let volumes = volumes(&swept(&mesh, &blade, path, frames, snap));
                        assert_eq!(volumes.len(), 2, "{blade:?}, snap {snap}, {frames} frames");
                        let pairs = volumes.iter().zip(&expected);
                        pairs.for_each(|(v, w)| assert!((v - w).abs() < 1e-12, "{v} for {w}"));
                    }
                }
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// Wherever the bends are and however the blade moves, what the strip parts, the blade parts: at most crumbs are left
    /// on the bends.
    #[test]
    fn a_bent_blade_cuts_like_its_strip(
        n in 4_usize..7, jitter in prop::sample::select(vec![0.0, 0.1, 0.2]), seed in any::<u64>(),
        shape in 0_usize..4, reversed in prop::bool::ANY, a in 0.15..0.3_f64, slant in -0.1..0.1_f64,
        frames in 2_usize..40, snap in prop::sample::select(vec![0.0, 0.1, 0.2]),
    ) {
        let mesh = jittered_box(n, jitter, seed);
        let mut blade = shapes(a, 1.0 - a)[shape].clone();
        if reversed {
            blade.reverse();
        }
        let path = [DVec3::new(0.0, -0.3, 0.0), DVec3::new(slant, 1.3, 0.0)];
        let traced = volumes(&traced(&mesh, &blade, path, snap));
        let cut = volumes(&swept(&mesh, &blade, path, frames, snap));
        prop_assert_eq!(traced.len(), 2);
        prop_assert!(cut.len() >= 2);
        let (crumbs, parts) = cut.split_at(cut.len() - 2);
        prop_assert!(crumbs.iter().sum::<f64>() < 0.01, "{:?}", &cut);
        // The blade is at most three long, and snapping moves each surface by a fraction of an edge.
        let most = 0.02 + 3.0 * snap / n as f64;
        for (part, traced) in parts.iter().zip(&traced) {
            prop_assert!((part - traced).abs() < most, "{:?} {:?}", &cut, &traced);
        }
    }
}
