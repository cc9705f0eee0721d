//! A plane cuts the same whatever things are called, seen in a mirror, from its other side, and in single precision.

use glam::{DVec3, dvec3};
use incise_cutting::{CutDelta, CutOptions, CuttableMesh, Plane, cut_plane};
use incise_mesh::{ParticleId, TetMesh};
use proptest::prelude::*;

use crate::bodies::{bend, body, check_cut, noise};

/// A mesh, the present positions of its particles, and a plane that goes through it.
#[derive(Clone)]
struct Case {
    mesh: TetMesh,
    positions: Vec<DVec3>,
    plane: Plane,
}

/// What does not depend on names: pieces by volume, tets, particles.
#[derive(Debug)]
struct Outcome {
    volumes: Vec<f64>,
    tets: usize,
    particles: usize,
    /// Volume at rest of the children on the positive side and on the other one.
    sides: [f64; 2],
}

impl Case {
    fn new(kind: usize, seed: u64, bent: bool) -> Self {
        let mesh = body(kind, seed);
        let positions = if bent {
            bend(&mesh, 0.2)
        } else {
            mesh.positions.clone()
        };
        let normal = DVec3::from_array([0, 1, 2].map(|k| noise(seed, k)));
        let center = positions.iter().sum::<DVec3>() / positions.len() as f64;
        let point = center + 0.1 * DVec3::from_array([3, 4, 5].map(|k| noise(seed, k)));
        Self {
            mesh,
            positions,
            plane: Plane { point, normal },
        }
    }

    fn cut(&self, options: &CutOptions) -> (CuttableMesh, CutDelta) {
        let mut cuttable = CuttableMesh::new(self.mesh.clone()).unwrap();
        let delta = cut_plane(&mut cuttable, &self.positions, &self.plane, options).unwrap();
        check_cut(&self.mesh, &cuttable, &delta);
        (cuttable, delta)
    }

    fn outcome(&self, options: &CutOptions) -> Outcome {
        let (cuttable, delta) = self.cut(options);
        let mesh = cuttable.mesh();
        let mut volumes = mesh.pieces().volumes(mesh);
        volumes.sort_by(f64::total_cmp);
        let side = |positive: bool| {
            let children = delta.added.iter().filter(|tet| tet.positive == positive);
            children.map(|tet| mesh.volume(tet.tet)).sum()
        };
        Outcome {
            volumes,
            tets: mesh.tets.len(),
            particles: mesh.positions.len(),
            sides: [side(true), side(false)],
        }
    }

    /// Gives all particles and tets other numbers.
    fn renamed(&self, seed: u64) -> Self {
        let shuffled = |count: usize, seed: u64| {
            let mut order: Vec<usize> = (0..count).collect();
            order.sort_by(|&a, &b| noise(seed, a).total_cmp(&noise(seed, b)));
            order
        };
        let order = shuffled(self.positions.len(), seed);
        let mut number = vec![ParticleId(0); order.len()];
        for (new, &old) in order.iter().enumerate() {
            number[old] = ParticleId::new(new);
        }
        let tets = shuffled(self.mesh.tets.len(), seed ^ 1)
            .into_iter()
            .map(|t| {
                // A turn of three corners keeps the orientation.
                let [a, b, c, d] = self.mesh.tets[t].map(|p| number[p.index()]);
                if t.is_multiple_of(2) {
                    [a, c, d, b]
                } else {
                    [a, b, c, d]
                }
            });
        Self {
            mesh: TetMesh {
                positions: order.iter().map(|&p| self.mesh.positions[p]).collect(),
                tets: tets.collect(),
            },
            positions: order.iter().map(|&p| self.positions[p]).collect(),
            plane: self.plane,
        }
    }

    /// Mirrors mesh, positions and plane in x.
    fn mirrored(&self) -> Self {
        let flip = |x: &DVec3| *x * dvec3(-1.0, 1.0, 1.0);
        Self {
            mesh: TetMesh {
                positions: self.mesh.positions.iter().map(flip).collect(),
                tets: self
                    .mesh
                    .tets
                    .iter()
                    .map(|&[a, b, c, d]| [a, c, b, d])
                    .collect(),
            },
            positions: self.positions.iter().map(flip).collect(),
            plane: Plane {
                point: flip(&self.plane.point),
                normal: flip(&self.plane.normal),
            },
        }
    }
}

/// Volumes differ by rounding only: snapping decides by the same fractions, and the cut through a tet is flat.
fn same(a: &Outcome, b: &Outcome) -> Result<(), TestCaseError> {
    let total: f64 = a.volumes.iter().sum();
    prop_assert_eq!(
        (a.volumes.len(), a.tets, a.particles),
        (b.volumes.len(), b.tets, b.particles)
    );
    let pairs = a
        .volumes
        .iter()
        .chain(&a.sides)
        .zip(b.volumes.iter().chain(&b.sides));
    for (x, y) in pairs {
        prop_assert!((x - y).abs() <= 1e-12 * total, "{:?} and {:?}", a, b);
    }
    Ok(())
}

fn snaps() -> impl Strategy<Value = f64> {
    prop::sample::select(vec![0.0, 0.05, 0.1, 0.2])
}

fn options(snap: f64) -> CutOptions {
    CutOptions {
        snap,
        ..CutOptions::default()
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn names_do_not_matter(kind in 0_usize..6, seed in any::<u64>(), snap in snaps(), bent in any::<bool>()) {
        let case = Case::new(kind, seed, bent);
        prop_assume!(case.plane.normal.length() > 0.1);
        same(&case.outcome(&options(snap)), &case.renamed(seed).outcome(&options(snap)))?;
    }

    #[test]
    fn nor_does_a_mirror(kind in 0_usize..6, seed in any::<u64>(), snap in snaps(), bent in any::<bool>()) {
        let case = Case::new(kind, seed, bent);
        prop_assume!(case.plane.normal.length() > 0.1);
        same(&case.outcome(&options(snap)), &case.mirrored().outcome(&options(snap)))?;
    }

    /// The plane seen from its other side: the sides change places.
    #[test]
    fn nor_which_side_is_called_positive(
        kind in 0_usize..6, seed in any::<u64>(), snap in snaps(), bent in any::<bool>(),
    ) {
        let case = Case::new(kind, seed, bent);
        prop_assume!(case.plane.normal.length() > 0.1);
        let mut turned = case.clone();
        turned.plane.normal = -turned.plane.normal;
        let mut outcome = turned.outcome(&options(snap));
        outcome.sides.reverse();
        same(&case.outcome(&options(snap)), &outcome)?;
    }

    /// Positions as single precision leaves them, and the tolerance for them: a sound mesh, and with snapping, which
    /// keeps new edges longer than the rounding, the same plane again changes nothing. Where a particle lies closer to
    /// the plane than the rounding of its new neighbors, the two may be found on different sides of it: that case is
    /// left out.
    #[test]
    fn single_precision(kind in 0_usize..6, seed in any::<u64>(), snap in snaps(), bent in any::<bool>()) {
        let mut case = Case::new(kind, seed, bent);
        prop_assume!(case.plane.normal.length() > 0.1);
        #[expect(clippy::cast_possible_truncation, reason = "rounding is what is tested")]
        let rounded = |x: &DVec3| DVec3::from_array(x.to_array().map(|c| f64::from(c as f32)));
        case.positions = case.positions.iter().map(rounded).collect();
        let options = CutOptions { tolerance: 1e-5, ..options(snap) };
        let (mut cuttable, delta) = case.cut(&options);
        let mut positions = case.positions.clone();
        delta.extend_particles(&mut positions);
        positions = positions.iter().map(rounded).collect();
        let before = cuttable.mesh().clone();
        let again = cut_plane(&mut cuttable, &positions, &case.plane, &options).unwrap();
        check_cut(&before, &cuttable, &again);
        let height = |x: &DVec3| case.plane.normal.normalize().dot(*x - case.plane.point).abs();
        if snap > 0.0 && case.positions.iter().all(|x| height(x) > 1e-5) {
            prop_assert!(again.is_empty(), "{} tets were cut again", again.removed.len());
        }
    }
}
