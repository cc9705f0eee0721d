//! Against the motion and the equilibria of the same tets by implicit Euler and Newton, which shares no code with the
//! solver: a beam under gravity, a bar whose end is twisted, a block that is compressed; a bar stretched to a closed
//! form.
//!
//! The meshes are the same, so locking and other errors of the mesh do not count; what is left is the solver's own
//! error. It has two parts. One is of first order in the step: damping, as that of implicit Euler. The other is of the
//! order of kappa, which is of second order in the step, and displaces even a body at rest; it grows with Poisson's
//! ratio, nearly with `l/μ`, because kappa knows Young's modulus only: a beam's sag is off by 2 to 5 % of `kappa l/μ`.

use glam::{DQuat, DVec3, dvec3};
use incise_mesh::{ParticleId, TetMesh, kuhn_box};
use incise_reference::ReferenceBody;
use incise_xpbd::{
    CoarseCorrection, CoarseCorrectionSettings, Material, Solver, StepSettings, VbdSettings,
};

use crate::body::{body, plain, positions, within};
use crate::finite_elements;
use crate::vbd::stars;

/// States of a run that are compared, evenly spaced in time.
const CHECKPOINTS: usize = 4;

/// Angular frequency of the beam's slowest vibration in 1/s by Euler and Bernoulli, `1.875² √(E I / ρ A L⁴)`.
const BEAM_RATE: f64 = 3.6;
/// Angular frequency in 1/s of the slowest vibration of the bar held at both ends, roughly.
const BAR_RATE: f64 = 15.0;

/// How much the last extrapolation of the limit may change, in errors of the finest run. What is left of the limit's
/// own error is of the next order and several times smaller.
const EXTRAPOLATED: f64 = 0.5;

/// A body and what happens to it.
struct Scene {
    mesh: TetMesh,
    material: Material,
    gravity: DVec3,
    /// In s.
    duration: f64,
    /// Where a particle with this place at rest is held at a time, if it is.
    handle: fn(DVec3, f64) -> Option<DVec3>,
}

fn rubber(poisson_ratio: f64) -> Material {
    Material {
        young_modulus: 1e6,
        poisson_ratio,
        density: 1000.0,
        damping: 0.0,
    }
}

/// From 0 to 1 with no jump in velocity nor acceleration.
fn smooth(t: f64) -> f64 {
    t * t * t * (10.0 - 15.0 * t + 6.0 * t * t)
}

fn falling_beam(poisson_ratio: f64) -> Scene {
    Scene {
        mesh: kuhn_box([6, 2, 2], dvec3(3.0, 1.0, 1.0)),
        material: rubber(poisson_ratio),
        gravity: dvec3(0.0, 0.0, -9.81),
        duration: 0.25,
        handle: |x, _| (x.x == 0.0).then_some(x),
    }
}

/// The far end makes a third of a turn.
fn twisted_bar(poisson_ratio: f64) -> Scene {
    Scene {
        gravity: DVec3::ZERO,
        handle: |x, t| {
            let center = dvec3(x.x, 0.5, 0.5);
            let turn = DQuat::from_rotation_x(2.0 * smooth(t / 0.25));
            match x.x {
                0.0 => Some(x),
                3.0 => Some(center + turn * (x - center)),
                _ => None,
            }
        },
        ..falling_beam(poisson_ratio)
    }
}

/// The upper face is pushed down by a quarter of the height.
fn compressed_block(poisson_ratio: f64) -> Scene {
    Scene {
        mesh: kuhn_box([3, 3, 3], DVec3::ONE),
        gravity: DVec3::ZERO,
        handle: |x, t| match x.z {
            0.0 => Some(x),
            1.0 => Some(x - DVec3::Z * (0.25 * smooth(t / 0.25))),
            _ => None,
        },
        ..falling_beam(poisson_ratio)
    }
}

impl Scene {
    /// Runs in equal steps; `step` takes the time after it. Returns the states at all checkpoints, one after another.
    fn run(&self, steps: usize, mut step: impl FnMut(f64) -> Vec<DVec3>) -> Vec<DVec3> {
        assert_eq!(steps % CHECKPOINTS, 0);
        let mut states = Vec::new();
        for n in 1..=steps {
            let state = step(self.duration * n as f64 / steps as f64);
            if n % (steps / CHECKPOINTS) == 0 {
                states.extend(state);
            }
        }
        states
    }

    /// By XPBD with one iteration a step.
    fn by_xpbd(&self, steps: usize) -> Vec<DVec3> {
        let mut solver = self.solver();
        let schedule = plain(&self.mesh);
        let settings = StepSettings {
            gravity: Some(self.gravity),
            ..StepSettings::new(self.duration / steps as f64)
        };
        self.run(steps, |time| {
            for (p, &x) in self.mesh.positions.iter().enumerate() {
                if let Some(place) = (self.handle)(x, time) {
                    solver.set_position(p, place);
                }
            }
            assert_eq!(solver.step(&schedule, &settings).unwrap().repaired, 0);
            positions(&solver)
        })
    }

    fn solver(&self) -> Solver<f64> {
        let mut solver = body::<f64>(&self.mesh, self.material);
        for (p, &x) in self.mesh.positions.iter().enumerate() {
            solver.set_fixed(p, (self.handle)(x, 0.0).is_some());
        }
        solver
    }

    /// By VBD with corrections, each step to the end.
    fn by_vbd(&self, steps: usize) -> Vec<DVec3> {
        let mut solver = self.solver();
        let mut stars = stars(&solver);
        let mut correction =
            CoarseCorrection::new(&stars, CoarseCorrectionSettings::default()).unwrap();
        let mut settings = VbdSettings::new(self.duration / steps as f64, 100);
        settings.step.gravity = Some(self.gravity);
        settings.tolerance = Some(1e-10);
        self.run(steps, |time| {
            for (p, &x) in self.mesh.positions.iter().enumerate() {
                if let Some(place) = (self.handle)(x, time) {
                    solver.set_position(p, place);
                }
            }
            let report = solver
                .step_vbd_two_level(&mut stars, &mut correction, &settings)
                .unwrap();
            assert!(report.residual.unwrap() <= 1e-10, "{report:?}");
            positions(&solver)
        })
    }

    /// By implicit Euler.
    fn by_newton(&self, steps: usize) -> Vec<DVec3> {
        let mut body = self.body();
        self.run(steps, |time| {
            for (p, &x) in self.mesh.positions.iter().enumerate() {
                if let Some(place) = (self.handle)(x, time) {
                    body.positions[p] = place;
                }
            }
            body.step(self.duration / steps as f64, self.gravity)
                .unwrap();
            body.positions.clone()
        })
    }

    fn body(&self) -> ReferenceBody {
        let material = incise_reference::Material {
            young_modulus: self.material.young_modulus,
            poisson_ratio: self.material.poisson_ratio,
            density: self.material.density,
        };
        let tets: Vec<[u32; 4]> = self
            .mesh
            .tets
            .iter()
            .map(|t| t.map(|ParticleId(p)| p))
            .collect();
        let mut body = ReferenceBody::new(&self.mesh.positions, &tets, |_tet| material).unwrap();
        for (p, &x) in self.mesh.positions.iter().enumerate() {
            body.fixed[p] = (self.handle)(x, 0.0).is_some();
        }
        body
    }

    /// The motion in the limit of small steps: implicit Euler with 80, 160 and 320 steps, from which Richardson's
    /// extrapolation removes the first two orders of the error. Also what removing the second has changed, as a bound
    /// of what is left.
    fn limit(&self) -> (Vec<DVec3>, f64) {
        let combine = |a: f64, x: &[DVec3], b: f64, y: &[DVec3]| -> Vec<DVec3> {
            x.iter().zip(y).map(|(x, y)| *x * a + *y * b).collect()
        };
        let runs = [80, 160, 320].map(|steps| self.by_newton(steps));
        let coarse = combine(-1.0, &runs[0], 2.0, &runs[1]);
        let fine = combine(-1.0, &runs[1], 2.0, &runs[2]);
        let limit = combine(-1.0 / 3.0, &coarse, 4.0 / 3.0, &fine);
        let change = distance(&limit, &fine);
        (limit, change)
    }

    /// The distances of XPBD from the limit as fractions of the way that particles go, with the number of steps that
    /// gives this kappa, twice as many, and so on.
    fn errors(&self, kappa: f64) -> [f64; 4] {
        let (limit, change) = self.limit();
        let rest = self.mesh.positions.repeat(CHECKPOINTS);
        let way = distance(&limit, &rest);
        let steps = self.steps(kappa);
        let errors = [1, 2, 4, 8].map(|n| distance(&self.by_xpbd(n * steps), &limit) / way);
        within(
            "change by the last extrapolation",
            change / way,
            EXTRAPOLATED * errors[3],
        );
        errors
    }

    /// The steps that give a kappa of at most this.
    fn steps(&self, kappa: f64) -> usize {
        let longest = (kappa / self.solver().kappa(1.0)).sqrt();
        let mut steps = CHECKPOINTS;
        while self.duration / steps as f64 > longest {
            steps += CHECKPOINTS;
        }
        steps
    }
}

/// The root of the mean square distance of two lists of points.
fn distance(a: &[DVec3], b: &[DVec3]) -> f64 {
    assert_eq!(a.len(), b.len());
    let sum: f64 = a.iter().zip(b).map(|(x, y)| x.distance_squared(*y)).sum();
    (sum / a.len() as f64).sqrt()
}

/// Fails unless twice the steps divide each error by two to an order in `orders`, and the last is at most `error`.
#[track_caller]
fn assert_order(errors: [f64; 4], orders: std::ops::Range<f64>, error: f64) {
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!(orders.contains(&order), "order {order} in {errors:?}");
    }
    within("the finest run", errors[3], error);
}

/// Measured from kappa 0.5 on: 2.8, 1.5, 0.8, 0.4 % at Poisson's ratio 0.3; 2.6, 1.3, 0.7, 0.3 % at 0.45. At 0.49 it is
/// 8.5, 2.1, 0.6, 0.3 %: the part of second order; from kappa 1/128 on it is of first order again.
#[test]
fn falling_beam_approaches_the_limit_to_first_order() {
    for (nu, kappa, error) in [
        (0.3, 0.5, 0.006),
        (0.45, 0.5, 0.005),
        (0.49, 1.0 / 128.0, 0.0006),
    ] {
        assert_order(falling_beam(nu).errors(kappa), 0.7..1.5, error);
    }
    assert_order(falling_beam(0.49).errors(0.5), 0.7..2.3, 0.006);
}

/// Measured from kappa 0.5 on: 7.7, 4.2, 2.2, 1.1 % at Poisson's ratio 0.3, 7.3, 4.1, 2.2, 1.1 % at 0.45; 6.2, 2.9,
/// 1.7, 0.9 % at 0.49. Implicit Euler with the same step has the same errors to a fifth.
#[test]
fn twisted_bar_approaches_the_limit_to_first_order() {
    for nu in [0.3, 0.45, 0.49] {
        assert_order(twisted_bar(nu).errors(0.5), 0.65..1.4, 0.017);
    }
}

/// The block is compressed over a few of its periods and hardly swings, so there is little to damp, and the part of
/// second order rules. Measured from kappa 0.5 on: 4.4, 1.1, 0.3, 0.09 % at Poisson's ratio 0.3, 7.8, 1.9, 0.5, 0.12 %
/// at 0.45; 15, 5.9, 1.6, 0.4 % at 0.49, orders 1.39 to 2.02.
#[test]
fn compressed_block_approaches_the_limit_to_second_order() {
    for nu in [0.3, 0.45, 0.49] {
        assert_order(compressed_block(nu).errors(0.5), 1.3..2.2, 0.006);
    }
}

impl Scene {
    /// The state where XPBD comes to rest from `start`, with all velocities damped at twice `rate`, the angular
    /// frequency of the slowest vibration: nearly critical. At rest velocities are zero, so the damping does not move
    /// it.
    fn settled(&self, kappa: f64, rate: f64, start: &[DVec3]) -> Vec<DVec3> {
        let mut solver = self.solver();
        for (p, &x) in start.iter().enumerate() {
            solver.set_position(p, x);
        }
        let schedule = plain(&self.mesh);
        let time_step = (kappa / solver.kappa(1.0)).sqrt();
        let settings = StepSettings {
            gravity: Some(self.gravity),
            ..StepSettings::new(time_step)
        };
        let keep = 1.0 / (1.0 + 2.0 * rate * time_step);
        let mut last = positions(&solver);
        for _ in 0..200 {
            let mut time = 0.0;
            while time < 1.0 / rate {
                time += time_step;
                for p in 0..solver.particle_count() {
                    solver.set_velocity(p, solver.velocity(p) * keep);
                }
                assert_eq!(solver.step(&schedule, &settings).unwrap().repaired, 0);
            }
            let now = positions(&solver);
            let moved = distance(&now, &last);
            if moved < 1e-7 * distance(&now, &self.mesh.positions) {
                return now;
            }
            last = now;
        }
        panic!("the body does not settle");
    }
}

/// What a scene looks like in equilibrium, by Newton's method.
fn equilibrium(scene: &Scene) -> Vec<DVec3> {
    let mut body = scene.body();
    body.settle(scene.gravity).unwrap();
    assert_eq!(body.inverted(), 0);
    body.positions
}

/// Under a small load the nonlinear equilibrium is that of small-strain elasticity, up to the rotation, here 1e-4.
#[test]
fn small_loads_give_the_equilibrium_of_linear_elasticity() {
    for nu in [0.0, 0.3, 0.45, 0.49] {
        let scene = Scene {
            gravity: dvec3(1e-3, 2e-3, -3e-3),
            ..falling_beam(nu)
        };
        let body = scene.body();
        let load: Vec<DVec3> = body.masses().iter().map(|&m| scene.gravity * m).collect();
        let held = |p: usize| body.fixed[p];
        let linear = finite_elements::equilibrium(&scene.mesh, &scene.material, &load, held);
        let rest = scene.mesh.positions.iter();
        let linear: Vec<DVec3> = rest.zip(linear).map(|(x, u)| *x + u).collect();
        let gap = distance(&linear, &equilibrium(&scene));
        let way = distance(&linear, &scene.mesh.positions);
        within("gap", gap / way, 1e-4);
    }
}

/// The tip sinks by up to a third of the length. With `(1 - e⁻ʳ) / r` in place of `1 / (1 + r)` the part of the error
/// of first order in kappa cancels but for an eighth: measured at kappa 0.5, 0.25 and 0.125 1.7, 0.6 and 0.3 % at
/// Poisson's ratio 0, 2.5, 0.8 and 0.3 % at 0.3, 12.6, 4.2 and 1.3 % at 0.45, 62, 30 and 12 % at 0.49 (4 % at 1/16, 1.2
/// % at 1/32). The block form has 1.3, 3.5, 20 and 68 % at kappa 0.5.
#[test]
fn sag_under_a_large_load_approaches_equilibrium_with_kappa() {
    for (nu, kappa, at_start) in [
        (0.0, 0.5, 0.02),
        (0.3, 0.5, 0.03),
        (0.45, 0.5, 0.14),
        (0.49, 0.125, 0.14),
    ] {
        let scene = falling_beam(nu);
        let exact = equilibrium(&scene);
        let way = distance(&exact, &scene.mesh.positions);
        let error = |kappa| {
            let sag = scene.settled(kappa, BEAM_RATE, &scene.mesh.positions);
            distance(&sag, &exact) / way
        };
        let errors = [kappa, kappa / 2.0, kappa / 4.0].map(error);
        within("largest kappa", errors[0], at_start);
        for pair in errors.windows(2) {
            within("half the kappa", pair[1] / pair[0], 0.5);
        }
    }
}

/// Sideways stretch of a bar stretched by `s` with its sides free: no stress across is `μ t + l (J - γ) s t = 0`, which
/// gives `J = γ - μ / (l s)` and `t = √(J / s)`.
fn uniaxial(material: &Material, s: f64) -> f64 {
    let (mu, nu) = (material.mu(), material.poisson_ratio);
    let l = 2.0 * mu * nu / (1.0 - 2.0 * nu) + mu;
    ((1.0 + mu / l - mu / (l * s)) / s).sqrt()
}
/// The ends are put where the closed form says and the sides have to find their places. Measured at kappa 1/2048: 0.02
/// to 0.054 % of the way they have to go; at 1/16 it is 2.8 to 7 %.
#[test]
fn stretched_bar_is_the_closed_form() {
    for nu in [0.3, 0.45, 0.49] {
        for s in [0.8, 1.2] {
            let scene = Scene {
                gravity: DVec3::ZERO,
                handle: |x, _| (x.x == 0.0 || x.x == 3.0).then_some(x),
                ..falling_beam(nu)
            };
            let t = uniaxial(&scene.material, s);
            let exact = |x: DVec3| dvec3(s * x.x, 0.5 + t * (x.y - 0.5), 0.5 + t * (x.z - 0.5));
            let unmoved = |x: DVec3| dvec3(s * x.x, x.y, x.z);
            let rest = scene.mesh.positions.iter();
            let start: Vec<DVec3> = rest
                .clone()
                .map(|&x| (scene.handle)(x, 0.0).map_or(unmoved(x), exact))
                .collect();
            let exact: Vec<DVec3> = rest.map(|&x| exact(x)).collect();
            let way = distance(&start, &exact);
            let error = |kappa| {
                let place = scene.settled(kappa, BAR_RATE, &start);
                distance(&place, &exact) / way
            };
            let coarse = error(1.0 / 16.0);
            within("at kappa 1/16", coarse, 0.08);
            let fine = error(1.0 / 2048.0);
            within("at kappa 1/2048", fine, 1e-3);
            // In proportion to kappa; at 1/16 the next power of it is worth up to 2.8 %.
            within("ratio", (fine / coarse * 128.0 - 1.0).abs(), 0.05);
        }
    }
}

/// Two solvers that share no code take the same large steps of backward Euler, with kappa 31 and 70: positions agree to
/// 1e-6 of the body's size, which leaves room for both tolerances. (Measured: at most 5e-9.)
#[test]
fn vbd_iterated_to_convergence_is_backward_euler() {
    for poisson_ratio in [0.3, 0.45, 0.49] {
        for scene in [
            falling_beam(poisson_ratio),
            twisted_bar(poisson_ratio),
            compressed_block(poisson_ratio),
        ] {
            let (vbd, newton) = (scene.by_vbd(4), scene.by_newton(4));
            let apart = vbd.iter().zip(&newton).map(|(a, b)| a.distance(*b));
            let apart = apart.fold(0.0, f64::max);
            let moved = newton.iter().zip(scene.mesh.positions.iter().cycle());
            let moved = moved.map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
            assert!(moved > 0.05, "the body moves: {moved}");
            within("vbd from Newton", apart, 1e-6);
        }
    }
}

/// A beam whose far half is a hundred times stiffer, heavier and nearly incompressible: the large steps of VBD are
/// those of backward Euler, to the same tolerance as with one material.
#[test]
fn vbd_of_two_materials_is_backward_euler() {
    let scene = falling_beam(0.3);
    let stiff = Material {
        young_modulus: 1e8,
        density: 3000.0,
        ..rubber(0.49)
    };
    let of = |t: usize| {
        let corners = scene.mesh.corners(incise_mesh::TetId::new(t));
        let center = corners.iter().map(|x| x.x).sum::<f64>() / 4.0;
        if center > 1.5 { stiff } else { scene.material }
    };
    let tets: Vec<[u32; 4]> = scene
        .mesh
        .tets
        .iter()
        .map(|tet| tet.map(|ParticleId(p)| p))
        .collect();
    let mut newton = ReferenceBody::new(&scene.mesh.positions, &tets, |t| {
        incise_reference::Material {
            young_modulus: of(t).young_modulus,
            poisson_ratio: of(t).poisson_ratio,
            density: of(t).density,
        }
    })
    .unwrap();
    let mut solver = Solver::<f64>::new(&scene.mesh.positions);
    let materials = [scene.material, stiff].map(|m| solver.add_material(m).unwrap());
    for (t, &tet) in tets.iter().enumerate() {
        let material = materials[usize::from(of(t) == stiff)];
        solver.push_tet(
            tet,
            scene.mesh.corners(incise_mesh::TetId::new(t)),
            material,
        );
    }
    for (p, &mass) in newton.masses().to_vec().iter().enumerate() {
        solver.set_mass(p, mass);
        newton.fixed[p] = scene.mesh.positions[p].x == 0.0;
        solver.set_fixed(p, newton.fixed[p]);
    }
    let mut stars = stars(&solver);
    let mut correction =
        CoarseCorrection::new(&stars, CoarseCorrectionSettings::default()).unwrap();
    let mut settings = VbdSettings::new(0.05, 100);
    settings.step.gravity = Some(scene.gravity);
    settings.tolerance = Some(1e-10);
    for _ in 0..4 {
        let report = solver
            .step_vbd_two_level(&mut stars, &mut correction, &settings)
            .unwrap();
        assert!(report.residual.unwrap() <= 1e-10, "{report:?}");
        newton.step(0.05, scene.gravity).unwrap();
        let apart = positions(&solver)
            .iter()
            .zip(&newton.positions)
            .map(|(a, b)| a.distance(*b))
            .fold(0.0, f64::max);
        within("vbd from Newton", apart, 1e-6);
    }
    let moved = distance(&newton.positions, &scene.mesh.positions);
    assert!(moved > 0.05, "the body moves: {moved}");
}
