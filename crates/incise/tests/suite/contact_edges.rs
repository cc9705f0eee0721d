//! Sharp edges that cross between their vertices.

use incise::mesh::glam::{DQuat, DVec2, DVec3, dvec3};
use incise::mesh::{TetMesh, kuhn_box};
use incise::scene::{ContactSpec, Precision};
use incise::{Body, Simulation, SimulationBuilder};

use crate::contact::{GRAVITY, solver, steps};

/// A bar on one of its long edges, which runs along x or y and is lowest at z = 0.
fn bar(along_y: bool) -> TetMesh {
    let mut mesh = kuhn_box([4, 1, 1], dvec3(0.5, 0.125, 0.125));
    let turn = DQuat::from_rotation_z(if along_y {
        std::f64::consts::FRAC_PI_2
    } else {
        0.0
    }) * DQuat::from_rotation_x(std::f64::consts::FRAC_PI_4);
    for x in &mut mesh.positions {
        *x = turn * (*x - dvec3(0.25, 0.0, 0.0));
    }
    mesh
}

/// The lowest z of the segments of one line of particles above those of another one, where they cross as seen from above.
fn clearance(positions: &[DVec3], upper: &[usize], lower: &[usize]) -> f64 {
    let mut least = f64::INFINITY;
    for above in upper.windows(2) {
        for below in lower.windows(2) {
            let [a, b, c, d] = [above[0], above[1], below[0], below[1]].map(|p| positions[p]);
            let flat = |x: DVec3| DVec2::new(x.x, x.y);
            let (along, other, from) = (flat(b - a), flat(d - c), flat(c - a));
            let across = along.perp_dot(other);
            let (s, t) = (from.perp_dot(other) / across, from.perp_dot(along) / across);
            if (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t) {
                least = least.min(a.lerp(b, s).z - c.lerp(d, t).z);
            }
        }
    }
    least
}

/// The particles of a range on a line, in its direction.
fn on_edge(
    positions: &[DVec3],
    range: std::ops::Range<usize>,
    is_on: impl Fn(DVec3) -> bool,
    along: DVec3,
) -> Vec<usize> {
    let mut all: Vec<usize> = range.filter(|&p| is_on(positions[p])).collect();
    all.sort_by(|&p, &q| along.dot(positions[p]).total_cmp(&along.dot(positions[q])));
    all
}

fn crossing_bars(precision: Precision) -> SimulationBuilder {
    let mut builder = Simulation::builder();
    builder.gravity(GRAVITY).solver(solver(precision, 20));
    // Edge up: half a turn about y.
    let mut lower = bar(true);
    for x in &mut lower.positions {
        *x = dvec3(-x.x, x.y, -x.z);
    }
    builder.add_body(Body::new(lower).pinned(|x| x.z < -0.1).young_modulus(3e5));
    // Both edges cross between two particles each.
    let above = Body::new(bar(false)).position(dvec3(0.06, 0.06, 0.005));
    builder.add_body(above.young_modulus(3e5));
    builder.contact(ContactSpec::default().with(|spec| spec.friction = 0.5));
    builder
}

/// A bar lies on another one, edge across edge, far from all vertices, at a depth of less than a hundredth of an edge.
#[test]
fn a_bar_lies_across_another_one() {
    for precision in [Precision::F32, Precision::F64] {
        let mut simulation = crossing_bars(precision).build().unwrap();
        let rest = simulation.positions();
        let count = rest.len() / 2;
        let lower = on_edge(rest, 0..count, |x| x.z > -1e-9, DVec3::Y);
        let upper = on_edge(rest, count..2 * count, |x| x.z < 0.005 + 1e-9, DVec3::X);
        assert_eq!((lower.len(), upper.len()), (5, 5));
        assert!((clearance(rest, &upper, &lower) - 0.005).abs() < 1e-9);
        let mut landed = false;
        for frame in 0..40 {
            steps(&mut simulation, 1);
            let least = clearance(simulation.positions(), &upper, &lower);
            assert!(least > -1e-3, "{least} in frame {frame}");
            landed |= least < 1e-4;
        }
        assert!(landed);
        simulation.check().unwrap();
    }
}
