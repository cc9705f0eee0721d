//! Energies, volume and speed as the device sums them up, against the host's of the same state in double precision.

use std::sync::Arc;

use glam::{DVec3, dvec3};
use incise_gpu::{ClusterMapping, GpuSolver, Measures};
use incise_graph::{Clustering, ColorId, Coloring, Schedule};
use incise_mesh::kuhn_box;
use incise_meshing::{Shape, generate};
use incise_xpbd::{Material, Pose, Solver};

use crate::solver::{SOFT, body, schedules, settings, share};
use crate::support::gpu;
use crate::twin::{FORMS, Twins, bar, free};

const GRAVITY: DVec3 = DVec3::new(1.0, 2.0, -9.81);

fn of_host(solver: &Solver<f32>) -> Measures {
    Measures {
        energy: solver.energy(Some(GRAVITY)),
        volume: solver.volume(),
        max_speed: solver.max_speed(),
    }
}

/// Measures on the device, fetches the state, measures that, and compares as [`GpuSolver::measure`] says.
pub(crate) fn agree(device: &mut GpuSolver) -> Measures {
    let there = device.measure(Some(GRAVITY)).unwrap();
    let host = device.host().unwrap();
    let here = of_host(host);
    let close = |what: &str, there: f64, here: f64, tolerance: f64| {
        assert!(
            (there - here).abs() <= tolerance,
            "{what}: {there:e} and {here:e}, tolerance {tolerance:e}"
        );
    };
    // Sums of positive numbers: some roundings of 6e-8 in a row of a tree and a loop. Here and below about ten times what
    // lavapipe shows.
    let kinetic = here.energy.kinetic;
    close("kinetic", there.energy.kinetic, kinetic, 5e-7 * kinetic);
    let speed = here.max_speed;
    close("speed", there.max_speed, speed, 5e-7 * speed);
    // What changes is rounded in units of the strain, which is below 1 or counted in the volume itself.
    let rest = here.volume.rest + here.volume.total.abs();
    close("rest", there.volume.rest, here.volume.rest, 1e-12 * rest);
    close("volume", there.volume.total, here.volume.total, 2e-7 * rest);
    let ratio = here.volume.min_ratio;
    close("ratio", there.volume.min_ratio, ratio, 1e-6);
    assert_eq!(there.volume.inverted, here.volume.inverted);
    // Positions are rounded relative to the origin.
    let particles = 0..host.particle_count();
    let (mut mass, mut far) = (0.0, 0.0_f64);
    for p in particles {
        mass += host.mass(p);
        far = far.max(host.position(p).distance(host.origin()));
    }
    let heavy = mass * GRAVITY.length() * far;
    close(
        "gravity",
        there.energy.gravity,
        here.energy.gravity,
        2e-7 * heavy,
    );
    // A strain has an error of some roundings, and the energy is half its square times the stiffness: by Cauchy and
    // Schwarz the sum's error is at most that of a strain times the root of twice the energy times all stiffness.
    let stiffness = |tet: u32| {
        let data = host.tet_data(tet);
        f64::from(data.rest[15]) * (1.0 + f64::from(data.constants[0]))
    };
    let tets = u32::try_from(host.tet_count()).unwrap();
    let stiffness: f64 = (0..tets).map(stiffness).sum();
    let (elastic, error) = (here.energy.elastic, 2e-7);
    let tolerance = error * (2.0 * elastic.max(0.0) * stiffness).sqrt() + error * error * stiffness;
    close("elastic", there.energy.elastic, elastic, tolerance);
    there
}

fn two() -> [Material; 2] {
    let stiff = Material {
        young_modulus: 4e5,
        poisson_ratio: 0.49,
        damping: 0.02,
        ..SOFT
    };
    [SOFT, stiff]
}

#[test]
fn a_body_in_motion() {
    let Some(gpu) = gpu("a_body_in_motion") else {
        return;
    };
    // More tets than 256 workgroups have threads.
    let mesh = generate(Shape::Sphere, 20_000).unwrap();
    for materials in [&two()[..1], &two()] {
        for (method, form) in FORMS {
            let (schedule, _) = schedules(&mesh, method);
            let mut device = GpuSolver::new(share(gpu), body(&mesh, materials), form).unwrap();
            for _ in 0..3 {
                device.step(&schedule, &settings()).unwrap();
                let measures = agree(&mut device);
                assert!(measures.energy.kinetic > 0.0 && measures.max_speed > 0.0);
            }
        }
    }
}

/// A body that turns has no energy of deformation but that of its own centrifugal force.
#[test]
fn a_body_that_turns_far_from_the_origin() {
    let Some(gpu) = gpu("a_body_that_turns_far_from_the_origin") else {
        return;
    };
    let mut mesh = bar();
    let away = dvec3(1e5, -3e5, 2e5);
    mesh.positions.iter_mut().for_each(|x| *x += away);
    for form in FORMS {
        let axis = dvec3(1.0, 2.0, -2.0);
        let mut twins = Twins::new(gpu, &mesh, SOFT, form, |solver| {
            free(solver);
            for p in 0..solver.particle_count() {
                let arm = solver.position(p) - away - dvec3(0.5, 0.25, 0.25);
                solver.set_velocity(p, axis.cross(arm));
            }
        });
        for _ in 0..30 {
            twins.step(&settings());
        }
        let measures = agree(&mut twins.device);
        assert!(measures.energy.elastic < 0.1 * measures.energy.kinetic);
        assert!((measures.volume.total / measures.volume.rest - 1.0).abs() < 0.01);
    }
}

/// Rigidly attached particles have no inverse mass, but a mass and a speed.
#[test]
fn attached_mass_is_measured() {
    let Some(gpu) = gpu("attached_mass_is_measured") else {
        return;
    };
    for form in FORMS {
        let mut twins = Twins::new(gpu, &bar(), SOFT, form, |solver| {
            let handle = solver.add_handle(Pose::at(DVec3::ZERO));
            for p in 0..solver.particle_count() {
                if solver.position(p).x > 0.9 {
                    solver.attach(p, handle, 0.0, 0.0).unwrap();
                }
            }
        });
        let motion = dvec3(0.032, 0.0, 0.0);
        twins.device.move_handle(0, Pose::at(motion));
        twins.host.move_handle(0, Pose::at(motion));
        twins.step(&settings());
        let measures = agree(&mut twins.device);
        // A layer of an eighth of the body at 2 m/s is part of it.
        let layer = 0.5 * (0.25 * 1000.0 / 8.0) * 4.0;
        assert!(measures.energy.kinetic > layer, "{measures:?}");
        assert!(measures.max_speed > 1.999);
    }
}

/// At rest nothing is deformed, mirrored everything is inverted, and a flat tet has no part in anything.
#[test]
fn rest_mirrored_and_flat() {
    let Some(gpu) = gpu("rest_mirrored_and_flat") else {
        return;
    };
    let mesh = bar();
    let still = incise_xpbd::StepSettings {
        gravity: None,
        ..settings()
    };
    for form in FORMS {
        let mut twins = Twins::new(gpu, &mesh, SOFT, form, |solver| {
            let last = solver.tet_count() - 1;
            let flat = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::ONE - DVec3::Z];
            solver.replace_tet(last, solver.tet_particles(last), flat);
            free(solver);
        });
        twins.step(&still);
        let measures = agree(&mut twins.device);
        assert_eq!(measures.volume.inverted, 1);
        assert!(measures.energy.elastic < 1e-6, "{measures:?}");
        // Fixed where they are, so that nothing moves them.
        twins.edit(|solver| {
            for p in 0..solver.particle_count() {
                let x = solver.position(p);
                solver.set_position(p, x * dvec3(1.1, 0.9, -1.2));
                solver.set_fixed(p, true);
            }
        });
        twins.step(&still);
        let measures = agree(&mut twins.device);
        assert_eq!(measures.volume.inverted, mesh.tets.len());
        assert!(measures.volume.total < 0.0 && measures.volume.min_ratio < -1.0);
    }
}

/// Values beyond single precision, and tets that no kernel visits, come from the host.
#[test]
fn the_host_measures_what_the_device_cannot() {
    let Some(gpu) = gpu("the_host_measures_what_the_device_cannot") else {
        return;
    };
    let mesh = kuhn_box([1, 1, 1], DVec3::ONE);
    let (schedule, _) = schedules(&mesh, "none");
    let mut solver = body(&mesh, &[SOFT]);
    free(&mut solver);
    let mut device = GpuSolver::new(share(gpu), solver, ClusterMapping::Threads).unwrap();
    let before = device.gpu().traffic();
    let measures = device.measure(Some(GRAVITY)).unwrap();
    assert_eq!(device.gpu().traffic().since(before).readbacks, 0);
    assert_eq!(measures, of_host(device.cached_host()));
    // Of a schedule for the first two tets, the others are in no place.
    let two = Coloring::new(vec![ColorId(0), ColorId(1)]);
    let part = Schedule::new(&Clustering::none(2), &two);
    device.step(&part, &settings()).unwrap();
    let measures = device.measure(Some(GRAVITY)).unwrap();
    assert_eq!(measures, of_host(device.host().unwrap()));
    // The square of a speed beyond all numbers.
    let fast = dvec3(0.0, 3e19, 0.0);
    let all = 0..device.host().unwrap().particle_count();
    all.for_each(|p| device.edit().unwrap().set_velocity(p, fast));
    let short = incise_xpbd::StepSettings {
        gravity: None,
        ..incise_xpbd::StepSettings::new(1e-20)
    };
    device.step(&schedule, &short).unwrap();
    let measures = device.measure(Some(GRAVITY)).unwrap();
    assert!(measures.max_speed > 2.9e19 && measures.energy.kinetic.is_finite());
    assert_eq!(measures, of_host(device.host().unwrap()));
}

/// Measuring reads the same few kB of a small and of a large body, sends nothing, and changes nothing.
#[test]
fn measuring_reads_little_and_sends_nothing() {
    let Some(gpu) = gpu("measuring_reads_little_and_sends_nothing") else {
        return;
    };
    for cells in [6, 20] {
        let mesh = kuhn_box([cells, cells, cells], DVec3::ONE);
        for (method, form) in FORMS {
            let gpu = share(gpu);
            let (schedule, _) = schedules(&mesh, method);
            let [mut measured, mut other] = [(); 2]
                .map(|()| GpuSolver::new(Arc::clone(&gpu), body(&mesh, &[SOFT]), form).unwrap());
            let bytes = {
                measured.step(&schedule, &settings()).unwrap();
                measured.bytes()
            };
            measured.measure(None).unwrap();
            let more = measured.bytes() - bytes;
            assert!(more >= 4 * mesh.positions.len() as u64 && more < 1 << 17);
            let before = gpu.traffic();
            let first = measured.measure(Some(GRAVITY)).unwrap();
            let spent = gpu.traffic().since(before);
            assert_eq!((spent.uploaded_bytes, spent.dispatches), (0, 2));
            // 48 bytes for each of 256 workgroups, and the count of repairs.
            assert!(spent.read_bytes <= 256 * 48 + 4, "{}", spent.read_bytes);
            // The same again, to the bit.
            assert_eq!(measured.measure(Some(GRAVITY)).unwrap(), first);
            other.step(&schedule, &settings()).unwrap();
            for device in [&mut measured, &mut other] {
                device.step(&schedule, &settings()).unwrap();
            }
            let (one, two) = (measured.host().unwrap(), other.host().unwrap());
            let mut all = 0..one.particle_count();
            assert!(all.all(|p| one.particle_data(p) == two.particle_data(p)));
        }
    }
}
