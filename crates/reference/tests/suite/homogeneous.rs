//! Homogeneous deformations, which linear tets can represent exactly: patch test and uniaxial stretch.

use glam::{DMat3, DVec3, dvec3};
use incise_mesh::{TetMesh, kuhn_box};
use incise_reference::{Material, ReferenceBody};

use crate::support::{Noise, RUBBER, body, largest_distance, within};

const CELLS: usize = 3;

/// A cube of side 1 whose particles inside are moved a little, so that no tet is like another.
fn irregular() -> TetMesh {
    let mut mesh = kuhn_box([CELLS; 3], DVec3::ONE);
    let mut noise = Noise(5);
    let (low, high) = bounds(&mesh);
    for x in &mut mesh.positions {
        if x.cmpgt(low).all() && x.cmplt(high).all() {
            *x += noise.vector() * 0.05;
        }
    }
    mesh
}

fn bounds(mesh: &TetMesh) -> (DVec3, DVec3) {
    let each = mesh.positions.iter();
    (
        each.clone().fold(DVec3::INFINITY, |a, &x| a.min(x)),
        each.fold(DVec3::NEG_INFINITY, |a, &x| a.max(x)),
    )
}

/// With the boundary in the place of an affine map, and the inside anywhere, equilibrium is the affine map.
#[test]
fn patch_test() {
    let mesh = irregular();
    let (low, high) = bounds(&mesh);
    let map = DMat3::from_cols(
        dvec3(1.2, 0.1, 0.0),
        dvec3(-0.2, 0.9, 0.3),
        dvec3(0.1, 0.0, 1.1),
    );
    for nu in [0.0, 0.3, 0.45, 0.499] {
        let mut body = body(
            &mesh,
            Material {
                poisson_ratio: nu,
                ..RUBBER
            },
        );
        let expected: Vec<DVec3> = mesh.positions.iter().map(|x| map * *x).collect();
        let mut inside = 0;
        for (p, x) in mesh.positions.iter().enumerate() {
            body.fixed[p] = !(x.cmpgt(low).all() && x.cmplt(high).all());
            body.positions[p] = if body.fixed[p] { expected[p] } else { *x };
            inside += usize::from(!body.fixed[p]);
        }
        assert_eq!(inside, (CELLS - 1).pow(3));
        body.settle(DVec3::ZERO).unwrap();
        // 1e-10 of the forces, times at most the ratio l / μ of the stiffnesses, 500.
        within("patch", largest_distance(&body.positions, &expected), 1e-9);
        for t in 0..mesh.tets.len() {
            let error = (body.deformation(t) - map).to_cols_array();
            within(
                "gradient",
                error.into_iter().map(f64::abs).fold(0.0, f64::max),
                1e-8,
            );
        }
    }
}

/// Sideways stretch and axial stress when a bar is stretched by `s` with its sides free.
///
/// No stress across, `μ t + l (J - γ) s t = 0`, gives `J = γ - μ / (l s)` and `t = √(J / s)`; along it is
/// `μ s + l (J - γ) t²`.
fn uniaxial(material: &Material, s: f64) -> (f64, f64) {
    let mu = material.young_modulus / (2.0 * (1.0 + material.poisson_ratio));
    let lame = material.young_modulus * material.poisson_ratio
        / ((1.0 + material.poisson_ratio) * (1.0 - 2.0 * material.poisson_ratio));
    let l = lame + mu;
    let gamma = 1.0 + mu / l;
    let j = gamma - mu / (l * s);
    let t = (j / s).sqrt();
    (t, mu * s + l * (j - gamma) * t * t)
}

/// Both ends are put where the closed form says; the sides find their place alone, and the ends feel its stress.
#[test]
fn uniaxial_stretch_is_the_closed_form() {
    let mesh = irregular();
    let (low, high) = bounds(&mesh);
    for nu in [0.0, 0.3, 0.45, 0.49] {
        for s in [0.8, 0.999, 1.1, 1.5, 2.0] {
            let material = Material {
                poisson_ratio: nu,
                ..RUBBER
            };
            let (t, stress) = uniaxial(&material, s);
            let expected: Vec<DVec3> = mesh.positions.iter().map(|x| *x * dvec3(s, t, t)).collect();
            let mut body: ReferenceBody = body(&mesh, material);
            for (p, x) in mesh.positions.iter().enumerate() {
                body.fixed[p] = x.x == low.x || x.x == high.x;
                if body.fixed[p] {
                    body.positions[p] = expected[p];
                }
            }
            body.settle(DVec3::ZERO).unwrap();
            assert_eq!(body.inverted(), 0);
            let error = largest_distance(&body.positions, &expected);
            within("place", error, 1e-8);
            let forces = body.elastic_forces();
            let end = (0..forces.len()).filter(|&p| mesh.positions[p].x == high.x);
            let pull = -end.map(|p| forces[p].x).sum::<f64>();
            within("pull", (pull - stress).abs() / material.young_modulus, 1e-8);
        }
    }
}
