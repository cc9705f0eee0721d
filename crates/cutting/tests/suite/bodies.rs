//! Bodies to cut, and the oracle for the number of pieces.

use glam::DVec3;
use incise_cutting::{CutDelta, CutOptions, CuttableMesh};
use incise_mesh::generate::{Shape, generate, kuhn_box};
use incise_mesh::{ParticleId, TetMesh};

/// A hash of a seed and a number, in -1..1.
pub(crate) fn noise(seed: u64, number: usize) -> f64 {
    let mut x = seed ^ (number as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    for _ in 0..2 {
        x = (x ^ (x >> 31)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    }
    (x >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

/// A grid of `n`³ cells with its inner particles displaced.
pub(crate) fn jittered_box(n: usize, amount: f64, seed: u64) -> TetMesh {
    let mut mesh = kuhn_box([n; 3], DVec3::ONE);
    for (i, x) in mesh.positions.iter_mut().enumerate() {
        if x.to_array().into_iter().all(|c| c > 1e-9 && c < 1.0 - 1e-9) {
            let shift = DVec3::from_array([0, 1, 2].map(|k| noise(seed, 3 * i + k)));
            *x += shift * amount / n as f64;
        }
    }
    mesh
}

/// A single tet, a grid, a jittered grid, a thin plate, a sphere or a torus.
pub(crate) fn body(kind: usize, seed: u64) -> TetMesh {
    let id = ParticleId;
    match kind % 6 {
        0 => TetMesh {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z],
            tets: vec![[id(0), id(1), id(2), id(3)]],
        },
        1 => kuhn_box([3; 3], DVec3::ONE),
        2 => jittered_box(4, 0.2, seed),
        3 => kuhn_box([8, 8, 1], DVec3::new(1.0, 1.0, 0.1)),
        4 => generate(Shape::Sphere, 800).unwrap(),
        _ => generate(Shape::Torus, 1200).unwrap(),
    }
}

/// The body moved and bent by a smooth map, as positions.
pub(crate) fn bend(mesh: &TetMesh, amount: f64) -> Vec<DVec3> {
    let map = |x: &DVec3| {
        let swing = DVec3::new(x.y * x.z, 0.5 * x.x * x.x, x.x - 0.3 * x.y * x.y);
        *x + swing * amount
    };
    mesh.positions.iter().map(map).collect()
}

/// The number of pieces that a signed function cuts a mesh into, by walking the edges between particles of one sign:
/// each side of each tet holds at least one particle, so this counts pieces without splitting anything.
pub(crate) fn pieces_by_sign(mesh: &TetMesh, sign: impl Fn(usize) -> bool) -> usize {
    let mut label: Vec<usize> = (0..mesh.positions.len()).collect();
    loop {
        let mut changed = false;
        for tet in &mesh.tets {
            for a in tet.map(|p| p.index()) {
                for b in tet.map(|p| p.index()) {
                    if sign(a) == sign(b) && label[b] < label[a] {
                        label[a] = label[b];
                        changed = true;
                    }
                }
            }
        }
        if !changed {
            break;
        }
    }
    let mut used: Vec<usize> = mesh
        .tets
        .iter()
        .flatten()
        .map(|p| label[p.index()])
        .collect();
    used.sort_unstable();
    used.dedup();
    used.len()
}

/// Everything that must hold after a cut that turned `before` into `after`.
pub(crate) fn check_cut(before: &TetMesh, after: &CuttableMesh, delta: &CutDelta) {
    after.check().unwrap();
    let mut replayed = before.clone();
    delta.apply(&mut replayed);
    assert_eq!(&replayed, after.mesh(), "the delta says everything");
    let (old, new) = (before.total_volume(), after.mesh().total_volume());
    assert!(
        (old - new).abs() <= 1e-12 * old,
        "volume {old} became {new}"
    );
    assert_eq!(
        after.mesh().pieces().count,
        after.mesh().face_pieces().count
    );
    assert_eq!(delta.tets_after(), after.mesh().tets.len());
    assert_eq!(delta.particles_after(), after.mesh().positions.len());
    let mut used = vec![false; after.mesh().positions.len()];
    after
        .mesh()
        .tets
        .iter()
        .flatten()
        .for_each(|p| used[p.index()] = true);
    let before_used = before
        .tets
        .iter()
        .flatten()
        .fold(vec![false; used.len()], |mut u, p| {
            u[p.index()] = true;
            u
        });
    let orphan =
        (0..used.len()).find(|&p| !used[p] && (before_used[p] || p >= before.positions.len()));
    assert_eq!(orphan, None, "no particle loses all its tets");
}

/// The default options with another snap distance.
pub(crate) fn options(snap: f64) -> CutOptions {
    CutOptions {
        snap,
        ..CutOptions::default()
    }
}

/// The volumes of the pieces, ascending.
pub(crate) fn volumes(body: &CuttableMesh) -> Vec<f64> {
    let mut volumes = body.mesh().pieces().volumes(body.mesh());
    volumes.sort_by(f64::total_cmp);
    volumes
}

/// The same mesh with its particles renamed at random, and the new name of each particle.
pub(crate) fn relabelled(mesh: &TetMesh, seed: u64) -> (TetMesh, Vec<usize>) {
    let mut order: Vec<usize> = (0..mesh.positions.len()).collect();
    order.sort_by(|&a, &b| noise(seed, a).total_cmp(&noise(seed, b)));
    let mut name = vec![0; order.len()];
    for (new, &old) in order.iter().enumerate() {
        name[old] = new;
    }
    let renamed = TetMesh {
        positions: order.iter().map(|&old| mesh.positions[old]).collect(),
        tets: mesh
            .tets
            .iter()
            .map(|tet| tet.map(|p| ParticleId::new(name[p.index()])))
            .collect(),
    };
    (renamed, name)
}
