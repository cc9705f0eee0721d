//! The edits that a cut consists of, each alone and together: nothing is lost.

use glam::{DVec3, dvec3};
use incise_xpbd::{Material, Pose, Real, Solver};

use crate::body::{RUBBER, within};

/// Two tets on a common face: corners 0 1 2 3 and 1 4 2 3.
const REST: [DVec3; 5] = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE];
const TETS: [[u32; 4]; 2] = [[0, 1, 2, 3], [1, 4, 2, 3]];

fn volume([a, b, c, d]: [DVec3; 4]) -> f64 {
    (b - a).cross(c - a).dot(d - a) / 6.0
}

/// What a cut must not change.
struct Sums {
    mass: f64,
    momentum: DVec3,
    center: DVec3,
    elastic: f64,
}

fn sums<R: Real>(solver: &Solver<R>) -> Sums {
    let mut sums = Sums {
        mass: 0.0,
        momentum: DVec3::ZERO,
        center: DVec3::ZERO,
        elastic: solver.energy(None).elastic,
    };
    for p in 0..solver.particle_count() {
        sums.mass += solver.mass(p);
        sums.momentum += solver.velocity(p) * solver.mass(p);
        sums.center += solver.position(p) * solver.mass(p);
    }
    sums.center /= sums.mass;
    sums
}

#[track_caller]
fn assert_same(a: &Sums, b: &Sums, tolerance: f64) {
    within("mass", (a.mass / b.mass - 1.0).abs(), tolerance);
    within(
        "momentum",
        a.momentum.distance(b.momentum) / b.momentum.length(),
        tolerance,
    );
    within("center", a.center.distance(b.center), tolerance);
    within(
        "elastic energy",
        (a.elastic / b.elastic - 1.0).abs(),
        tolerance,
    );
}

/// Gives each particle a quarter of the mass of the tets around it, as their rest corners say.
fn weigh<R: Real>(solver: &mut Solver<R>, rest: &[[DVec3; 4]]) {
    let mut masses = vec![0.0; solver.particle_count()];
    for (t, &corners) in rest.iter().enumerate() {
        for p in solver.tet_particles(t) {
            masses[p as usize] += solver.density_of(t) * volume(corners) / 4.0;
        }
    }
    for (p, mass) in masses.into_iter().enumerate() {
        solver.set_mass(p, mass);
    }
}

/// The two tets, affinely strained (so that linear interpolation is exact everywhere) and moving the same way.
fn two_tets<R: Real>() -> Solver<R> {
    let mut solver = Solver::new(&REST);
    let rubber = solver.add_material(RUBBER).unwrap();
    let rest = TETS.map(|tet| tet.map(|p| REST[p as usize]));
    for (tet, rest) in TETS.into_iter().zip(rest) {
        solver.push_tet(tet, rest, rubber);
    }
    for (p, &x) in REST.iter().enumerate() {
        let at = dvec3(
            1.2 * x.x + 0.1 * x.y,
            0.9 * x.y - 0.2 * x.z,
            1.1 * x.z + 0.05 * x.x,
        );
        solver.set_position(p, at);
        solver.set_velocity(p, dvec3(1.0, 2.0, 3.0) + at * 0.5);
    }
    weigh(&mut solver, &rest);
    solver
}

/// Halves both tets through the middle of their common edge 2-3; then the lower half separates from the upper one.
fn cut<R: Real>(tolerance: f64) {
    let mut solver = two_tets::<R>();
    let before = sums(&solver);
    solver.push_particle_between(2, 3, 0.5);
    let middle = (REST[2] + REST[3]) / 2.0;
    let at = |p: u32| if p < 5 { REST[p as usize] } else { middle };
    // Children: 3 replaced by the middle in place, 2 replaced by it at the end.
    let children = [[0, 1, 2, 5], [1, 4, 2, 5], [0, 1, 5, 3], [1, 4, 5, 3]];
    for (t, child) in children.into_iter().enumerate() {
        if t < 2 {
            solver.replace_tet(t, child, child.map(at));
        } else {
            solver.push_tet(child, child.map(at), solver.material_of(t - 2));
        }
    }
    let rest = children.map(|child| child.map(at));
    weigh(&mut solver, &rest);
    assert_same(&sums(&solver), &before, tolerance);

    // The children with corner 3 move to copies of the particles 0, 1, 4 and of the middle.
    for p in [0, 1, 4, 5] {
        solver.push_copy(p);
    }
    solver.relink_tet(2, [6, 7, 9, 3]);
    solver.relink_tet(3, [7, 8, 9, 3]);
    weigh(&mut solver, &rest);
    assert_same(&sums(&solver), &before, tolerance);
    assert_eq!((solver.particle_count(), solver.tet_count()), (10, 4));
    assert_eq!(solver.tet_particles(3), [7, 8, 9, 3]);
    assert_eq!(solver.volume().inverted, 0);
}

/// Mass, momentum and energy come out as they were up to rounding, because the children inherit the deformation.
#[test]
fn a_cut_by_hand_loses_nothing() {
    cut::<f64>(1e-13);
    cut::<f32>(1e-5);
}

#[test]
fn a_particle_between_two_others_is_interpolated() {
    let mut solver = two_tets::<f64>();
    solver.push_particle_between(1, 4, 0.25);
    let mix = |a: DVec3, b: DVec3| a + (b - a) * 0.25;
    assert_eq!(
        solver.position(5),
        mix(solver.position(1), solver.position(4))
    );
    assert_eq!(
        solver.velocity(5),
        mix(solver.velocity(1), solver.velocity(4))
    );
    assert_eq!(solver.mass(5), 0.0);
    assert!(!solver.is_fixed(5));
    // Fixed only between fixed ends: otherwise a cut would nail down what hangs.
    solver.set_fixed(0, true);
    solver.push_particle_between(0, 1, 0.5);
    assert!(!solver.is_fixed(6));
    solver.set_fixed(1, true);
    solver.push_particle_between(0, 1, 0.5);
    assert!(solver.is_fixed(7));
    assert_eq!(solver.velocity(7), DVec3::ZERO);
}

#[test]
fn a_copy_has_the_state_of_the_original() {
    let mut solver = two_tets::<f32>();
    solver.set_fixed(3, true);
    for p in 0..5 {
        solver.push_copy(p);
        assert_eq!(solver.position(5 + p), solver.position(p));
        assert_eq!(solver.velocity(5 + p), solver.velocity(p));
        assert_eq!(solver.is_fixed(5 + p), p == 3);
        assert_eq!(solver.mass(5 + p), 0.0);
    }
}

#[test]
fn a_replaced_tet_keeps_its_material() {
    let mut solver = two_tets::<f64>();
    let stiff = Material {
        density: 2000.0,
        ..RUBBER
    };
    let number = solver.add_material(stiff).unwrap();
    solver.push_tet(TETS[0], TETS[0].map(|p| REST[p as usize]), number);
    solver.replace_tet(2, TETS[1], TETS[1].map(|p| REST[p as usize]));
    assert_eq!(
        (solver.material_of(2), solver.density_of(2)),
        (number, 2000.0)
    );
    assert_eq!(solver.tet_particles(2), TETS[1]);
    within(
        "volume",
        (solver.volume().rest - (1.0 / 6.0 + 2.0 / 3.0)).abs(),
        1e-14,
    );
}

/// What counts is the volume at rest, whatever tets have become.
#[test]
fn the_inverted_fraction_is_that_of_the_volume_at_rest() {
    let mut solver = two_tets::<f64>();
    let volumes = [0, 1].map(|t| volume(TETS[t].map(|p| REST[p as usize])).abs());
    let all = volumes[0] + volumes[1];
    assert_eq!(solver.inverted_fraction(), 0.0);
    solver.set_position(0, DVec3::ONE);
    within(
        "the first",
        (solver.inverted_fraction() - volumes[0] / all).abs(),
        1e-14,
    );
    solver.set_position(4, DVec3::ZERO);
    assert_eq!(solver.inverted_fraction(), 1.0);
}

/// Lists of all particles are what the functions of one particle say: of a fixed one, an attached one, one without mass,
/// and free ones.
#[test]
fn lists_of_all_particles() {
    fn check<R: Real>() {
        let mut solver = Solver::<R>::new(&REST);
        for p in 0..REST.len() {
            let number = f64::from(u8::try_from(p).unwrap());
            solver.set_mass(p, f64::from(u8::from(p != 2)));
            solver.set_velocity(p, dvec3(0.1, -number, 2.0 * number));
        }
        solver.set_fixed(0, true);
        let handle = solver.add_handle(Pose::at(DVec3::ZERO));
        solver.attach(1, handle, 0.0, 0.0).unwrap();
        let (mut positions, mut velocities, mut held) = (vec![DVec3::NAN], Vec::new(), vec![true]);
        solver.positions(&mut positions);
        solver.velocities(&mut velocities);
        solver.held(&mut held);
        let each = 0..solver.particle_count();
        let one_by_one: (Vec<_>, Vec<_>) = each
            .clone()
            .map(|p| (solver.position(p), solver.velocity(p)))
            .unzip();
        assert_eq!((positions, velocities), one_by_one);
        assert_eq!(held, each.map(|p| !solver.is_free(p)).collect::<Vec<_>>());
        assert_eq!(held, [true, true, true, false, false]);
    }
    check::<f32>();
    check::<f64>();
}
