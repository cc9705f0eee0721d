//! The search against a look at all tets: the cuts of whole runs, bit for bit.

use glam::DMat3;
use incise_mesh::kuhn_box;
use incise_meshing::{Shape, generate};
use proptest::prelude::*;

use super::*;
use crate::{CutOptions, Plane, Sweep, cut_plane, remove_tets};

/// Numbers in -1..1 from a seed.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        for _ in 0..2 {
            x = (x ^ (x >> 31)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        }
        (x >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next())
    }

    fn below(&mut self, count: usize) -> usize {
        usize::try_from(self.next().to_bits() % count as u64).unwrap()
    }
}

fn body(kind: usize) -> TetMesh {
    match kind {
        0 => kuhn_box([5; 3], DVec3::ONE),
        1 => kuhn_box([10, 10, 1], DVec3::new(1.0, 1.0, 0.1)),
        2 => generate(Shape::Sphere, 1500).unwrap(),
        3 => generate(Shape::Torus, 1500).unwrap(),
        // Two bodies in one mesh.
        _ => {
            let mut mesh = kuhn_box([4; 3], DVec3::ONE);
            let first = mesh.positions.len();
            let other = kuhn_box([3, 3, 5], DVec3::splat(0.8));
            let positions = other.positions.iter();
            mesh.positions
                .extend(positions.map(|x| *x + DVec3::new(1.1, 0.2, 0.1)));
            let tets = other.tets.iter();
            mesh.tets
                .extend(tets.map(|tet| tet.map(|p| ParticleId::new(p.index() + first))));
            mesh
        }
    }
}

/// What the strokes of one run share.
struct Run {
    cuttable: CuttableMesh,
    positions: Vec<DVec3>,
    strokes: Vec<Sweep>,
    deltas: Vec<CutDelta>,
}

impl Run {
    fn apply_delta(&mut self, delta: CutDelta, but: Option<usize>) {
        for (i, stroke) in self.strokes.iter_mut().enumerate() {
            if Some(i) != but {
                stroke.apply_delta(&self.cuttable, &delta);
            }
        }
        delta.extend_particles(&mut self.positions);
        self.deltas.push(delta);
    }
}

/// Strokes through a moving body, with other cuts and removals in between. `shake` displaces each particle by this
/// fraction of the body in each frame.
fn run(kind: usize, seed: u64, shake: f64, everywhere: bool) -> Run {
    let mut noise = Noise(seed);
    let mesh = body(kind);
    let rest = mesh.positions.clone();
    let mut blades: Vec<Vec<DVec3>> = Vec::new();
    for _ in 0..1 + noise.below(3) {
        // Every other blade starts inside.
        let start = rest[noise.below(rest.len())] + noise.vector() * 0.5 * noise.next().max(0.0);
        let mut blade = vec![start];
        for _ in 0..1 + noise.below(3) {
            blade.push(blade[blade.len() - 1] + noise.vector() * 0.6);
        }
        blades.push(blade);
    }
    let cuttable = CuttableMesh::new(mesh).unwrap();
    let options = CutOptions {
        snap: [0.0, 0.1][noise.below(2)],
        max_tets: 30_000,
        ..CutOptions::default()
    };
    let mut strokes: Vec<Sweep> = Vec::new();
    for blade in &blades {
        let mut stroke = Sweep::new(&cuttable, &rest, blade, options).unwrap();
        stroke.search_mut().everywhere = everywhere;
        strokes.push(stroke);
    }
    let mut run = Run {
        cuttable,
        positions: rest,
        strokes,
        deltas: Vec::new(),
    };
    let turn = noise.vector() * 0.1;
    let (step, frames) = (0.02 + 0.1 * noise.next().abs(), 3 + noise.below(10));
    let paths: Vec<DVec3> = blades.iter().map(|_| noise.vector() * step).collect();
    for _ in 0..frames {
        let spin =
            DMat3::from_rotation_y(turn.x) + DMat3::from_diagonal(DVec3::splat(turn.y * 0.1));
        for x in &mut run.positions {
            *x = spin * *x + turn * 0.2 * x.z * x.x;
        }
        for x in &mut run.positions {
            *x += noise.vector() * shake;
        }
        for (i, blade) in blades.iter_mut().enumerate() {
            for x in blade {
                *x += paths[i] + noise.vector() * 0.2 * step;
            }
        }
        for (i, blade) in blades.iter().enumerate() {
            let stroke = &mut run.strokes[i];
            let cut = stroke.advance(&mut run.cuttable, &run.positions, blade);
            if let Ok(delta) = cut {
                run.apply_delta(delta, Some(i));
            }
        }
        let count = run.cuttable.mesh().tets.len();
        let chance = noise.below(4);
        let delta = match chance {
            0 => {
                let tets = [(); 3].map(|()| run.cuttable.mesh().tets[noise.below(count)]);
                let corners = tets.into_iter().flatten();
                let around = corners.flat_map(|p| run.cuttable.around(p));
                let doomed: Vec<TetId> = around.collect();
                remove_tets(&mut run.cuttable, &doomed, 5)
            }
            1 => {
                let normal = noise.vector();
                let point = run.positions[noise.below(run.positions.len())];
                cut_plane(
                    &mut run.cuttable,
                    &run.positions,
                    &Plane { point, normal },
                    &options,
                )
            }
            _ => continue,
        };
        if let Ok(delta) = delta {
            run.apply_delta(delta, None);
        }
        if run.cuttable.mesh().tets.is_empty() {
            break;
        }
    }
    run
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// The cuts are those of a look at all tets, bit for bit.
    #[test]
    fn as_a_scan(kind in 0_usize..5, seed in any::<u64>(), shake in prop::sample::select(vec![0.0, 0.01])) {
        let [flood, scan] = [false, true].map(|everywhere| run(kind, seed, shake, everywhere));
        prop_assert_eq!(flood.deltas, scan.deltas);
        prop_assert_eq!(flood.cuttable.mesh(), scan.cuttable.mesh());
    }
}
