//! Bodies to cut, and the oracle for the number of pieces.

use std::collections::BTreeSet;

use glam::DVec3;
use incise_cutting::{
    BoundaryTriangle, CutDelta, CutError, CutOptions, CuttableMesh, FaceTag, TriangleSurface,
};
use incise_mesh::{ParticleId, TetId, TetMesh, kuhn_box};
use incise_meshing::{Shape, generate};

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
    // What an improvement deletes, other tets take over.
    let gone = delta.deleted.iter().filter(|_| !delta.is_improvement());
    let gone: f64 = gone.map(|t| before.volume(t.tet)).sum();
    let (old, new) = (before.total_volume() - gone, after.mesh().total_volume());
    assert!(
        (old - new).abs() <= 1e-12 * (old + gone),
        "volume {old} became {new}"
    );
    // What hangs together, hangs together by faces, unless parts touched in a particle or an edge before.
    let by_faces = |mesh: &TetMesh| mesh.face_pieces().count == mesh.pieces().count;
    assert!(by_faces(after.mesh()) || !by_faces(before));
    check_boundary(before, after, delta);
    check_undo(before, after, delta);
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
    if delta.deleted.is_empty() {
        assert_eq!(orphan, None, "no particle loses all its tets");
    }
}

/// The triangles that the delta names are those that the boundary lost and gained, and cut faces are those that were
/// inside before.
fn check_boundary(before: &TetMesh, after: &CuttableMesh, delta: &CutDelta) {
    type Triangle = (TetId, [ParticleId; 3]);
    let of = |mesh: &TetMesh| {
        let surface = mesh.surface();
        let pairs = surface.tets.into_iter().zip(surface.triangles);
        pairs.map(turned).collect::<BTreeSet<Triangle>>()
    };
    fn turned((tet, mut face): Triangle) -> Triangle {
        let least = (0..3).min_by_key(|&i| face[i]).unwrap();
        face.rotate_left(least);
        (tet, face)
    }
    let listed = |list: &[BoundaryTriangle]| {
        let triangles = list.iter().map(|t| turned((t.tet, t.particles)));
        let set: BTreeSet<Triangle> = triangles.collect();
        assert_eq!(set.len(), list.len(), "no triangle is named twice");
        set
    };
    let (removed, added) = (listed(&delta.surface_removed), listed(&delta.surface_added));
    let mut boundary = of(before);
    for triangle in &removed {
        assert!(
            boundary.remove(triangle),
            "{triangle:?} was on the boundary"
        );
    }
    let mut moved = BTreeSet::new();
    for (tet, face) in boundary {
        let found = delta.moved.iter().find(|m| m.from == tet);
        moved.insert((found.map_or(tet, |m| m.to), face));
    }
    for triangle in &added {
        assert!(
            moved.insert(*triangle),
            "{triangle:?} is new on the boundary"
        );
    }
    assert_eq!(moved, of(after.mesh()));
    let all: Vec<BoundaryTriangle> = after.boundary().collect();
    assert_eq!(listed(&all), moved);
    assert_eq!(all.len(), after.boundary_count());
    // Outer faces keep their area, cut faces come in pairs of equal area, but for a removal.
    let area = |mesh: &TetMesh, list: &[BoundaryTriangle], outer: bool| -> f64 {
        let of_kind = list.iter().filter(|t| (t.tag == FaceTag::Outer) == outer);
        of_kind
            .map(|t| {
                let [a, b, c] = t.particles.map(|p| mesh.positions[p.index()]);
                (b - a).cross(c - a).length() / 2.0
            })
            .sum()
    };
    if delta.deleted.is_empty() {
        let lost = area(before, &delta.surface_removed, true);
        let gained = area(after.mesh(), &delta.surface_added, true);
        assert!((lost - gained).abs() <= 1e-9 * (1.0 + lost));
    }
}

/// Undone, the mesh is what it was to the byte, everything derived too; done again, it is what it became.
fn check_undo(before: &TetMesh, after: &CuttableMesh, delta: &CutDelta) {
    let mut undone = after.clone();
    undone.undo(delta).unwrap();
    undone.check().unwrap();
    let bytes = |mesh: &TetMesh| {
        let xyz = mesh.positions.iter().flat_map(|x| x.to_array());
        let bits: Vec<u64> = xyz.map(f64::to_bits).collect();
        (bits, mesh.tets.clone())
    };
    assert_eq!(bytes(undone.mesh()), bytes(before));
    let tags = |body: &CuttableMesh| {
        let list = body.boundary().map(|t| (t.tet, t.opposite, t.tag));
        list.collect::<BTreeSet<_>>()
    };
    // Undone twice is refused, unless the delta changed nothing.
    if !delta.is_empty() {
        assert!(undone.undo(delta).is_err());
    }
    let mut expected = tags(after);
    for triangle in &delta.surface_added {
        assert!(expected.remove(&(triangle.tet, triangle.opposite, triangle.tag)));
    }
    let mut back = BTreeSet::new();
    for (tet, opposite, tag) in expected {
        let found = delta.moved.iter().find(|m| m.to == tet);
        back.insert((found.map_or(tet, |m| m.from), opposite, tag));
    }
    for triangle in &delta.surface_removed {
        back.insert((triangle.tet, triangle.opposite, triangle.tag));
    }
    assert_eq!(tags(&undone), back);
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

/// Renames the particles of a mesh at random; returns it with the new name of each particle.
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

/// An icosahedron whose triangles were quartered `times` times, on a sphere.
pub(crate) fn icosphere(center: DVec3, radius: f64, times: usize) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
    let mut points: Vec<DVec3> = Vec::new();
    for (a, b) in [
        (1.0, golden),
        (1.0, -golden),
        (-1.0, golden),
        (-1.0, -golden),
    ] {
        points.extend([
            DVec3::new(0.0, a, b),
            DVec3::new(a, b, 0.0),
            DVec3::new(b, 0.0, a),
        ]);
    }
    let mut triangles = Vec::new();
    let beside = |a: usize, b: usize| (points[a].distance(points[b]) - 2.0).abs() < 1e-9;
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if beside(a, b) && beside(b, c) && beside(c, a) {
                    triangles.push([a, b, c].map(|i| u32::try_from(i).unwrap()));
                }
            }
        }
    }
    for _ in 0..times {
        let mut finer = Vec::new();
        for [a, b, c] in triangles {
            let mut middle = |i: u32, j: u32| {
                let at = points[i as usize] + points[j as usize];
                let known = points.iter().position(|x| x.distance(at) < 1e-9);
                u32::try_from(known.unwrap_or_else(|| {
                    points.push(at);
                    points.len() - 1
                }))
                .unwrap()
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            finer.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        triangles = finer;
        points.iter_mut().for_each(|x| *x *= 0.5);
    }
    points
        .iter_mut()
        .for_each(|x| *x = center + x.normalize() * radius);
    (points, triangles)
}

/// The eight corners of a box and two triangles for each face.
pub(crate) fn cuboid(low: DVec3, high: DVec3) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let corner = |i: u32| {
        let pick = |axis: usize| {
            if i >> axis & 1 == 0 {
                low[axis]
            } else {
                high[axis]
            }
        };
        DVec3::new(pick(0), pick(1), pick(2))
    };
    let quads = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let triangles = quads
        .into_iter()
        .flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
    ((0..8).map(corner).collect(), triangles.collect())
}

/// The strip between two polylines of equally many points. Where they touch, it ends in a point.
pub(crate) fn strip(first: &[DVec3], second: &[DVec3]) -> Result<TriangleSurface, CutError> {
    let pairs = first.iter().zip(second);
    let points: Vec<DVec3> = pairs.flat_map(|(a, b)| [*a, *b]).collect();
    let numbers = (0..u32::try_from(points.len() - 2).unwrap()).step_by(2);
    let both = numbers.flat_map(|i| [[i, i + 2, i + 3], [i, i + 3, i + 1]]);
    let distinct = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|p| points[p as usize]);
        a != b && b != c && c != a
    };
    TriangleSurface::new(&points, &both.filter(distinct).collect::<Vec<_>>())
}
