//! Hands on a GPU: blades and grabs do the same as on the processor, and what only moves fetches nothing.

use std::sync::Arc;

use incise::mesh::ParticleId;
use incise::mesh::glam::{DVec3, dvec3};
use incise::{Grab, Scene, Simulation};

use crate::gpu::{counting, farthest, gpu};
use crate::support::{body, plane, scene, state, sweep};

/// Two falling boxes of few substeps.
fn boxes(more: &str) -> Scene {
    let bodies = body("box", 300, [0.0; 3]) + &body("box", 300, [0.0, 0.0, 2.0]);
    let world = "[world]\ngravity = [0.0, 0.0, -9.81]\n[solver]\nsubsteps = 8\nclustering = \"serial:10\"\n";
    scene(&format!("{world}{bodies}{more}"))
}

fn handles(simulation: &Simulation) -> Vec<usize> {
    let solvers = simulation.device_solvers();
    let hosts = solvers.map(|solver| solver.cached_host().handle_poses(0.0).len());
    hosts.collect()
}

/// Takes hold, pulls, cuts through what is held, lets go, takes hold again: one rigidly, one by springs.
#[test]
fn grabs_on_a_device_equal_those_on_the_cpu() {
    let Some(gpu) = gpu("grabs_on_a_device_equal_those_on_the_cpu") else {
        return;
    };
    let gpu = counting(&gpu);
    let scene = boxes(&plane(9, [0.03, 0.0, 0.0], [1.0, 0.0, 0.0]));
    let mut here = Simulation::new(&scene).unwrap();
    let mut there = Simulation::on_device(&scene, Arc::clone(&gpu)).unwrap();
    let mut grabs: [Vec<Grab>; 2] = Default::default();
    let mut points = Vec::new();
    for frame in 0..16_u32 {
        if frame % 6 == 2 {
            points = vec![dvec3(0.0, 0.0, 0.4), dvec3(0.3, 0.0, 2.4)];
            for (simulation, grabs) in [&mut here, &mut there].into_iter().zip(&mut grabs) {
                for (&point, compliance) in points.iter().zip([0.0, 1e-4]) {
                    let grab = simulation.grab(point, 0.4, compliance).unwrap();
                    grabs.push(grab.expect("something is there"));
                }
            }
        }
        // A second hand on the same body.
        if frame == 10 {
            let below = dvec3(0.0, 0.0, -0.6);
            points.push(below);
            for (simulation, grabs) in [&mut here, &mut there].into_iter().zip(&mut grabs) {
                let grab = simulation.grab(below, 0.4, 0.0).unwrap();
                grabs.push(grab.expect("the box has fallen by less than its half"));
            }
        }
        if frame % 6 == 0 {
            for (simulation, grabs) in [&mut here, &mut there].into_iter().zip(&mut grabs) {
                for grab in grabs.drain(..) {
                    simulation.release(grab).unwrap();
                    assert!(simulation.release(grab).is_err());
                }
            }
        }
        let by = DVec3::new(0.01, 0.0, 0.02);
        points.iter_mut().for_each(|point| *point += by);
        let before = gpu.traffic();
        for (simulation, grabs) in [&mut here, &mut there].into_iter().zip(&grabs) {
            for (&grab, &point) in grabs.iter().zip(&points) {
                simulation.move_grab(grab, point).unwrap();
            }
            simulation.step().unwrap();
        }
        // The scene reports nothing that has to be fetched; the positions, where a blade is due.
        assert_eq!(gpu.traffic().since(before).readbacks > 0, frame == 9);
        assert_eq!(here.report().pieces, there.report().pieces, "{frame}");
        there.check().unwrap();
        if frame % 3 == 0 {
            there.read_back().unwrap();
            let far = farthest(here.positions(), there.positions());
            // Two or three digits beside the seven of single precision in a body of size 1: as in the other scenes.
            assert!(far < 1e-4, "frame {frame}: {far}");
        }
    }
    assert_eq!(here.report().pieces, 4);
    assert_eq!(handles(&there), [2, 1]);
    there.read_back().unwrap();
    assert!(there.positions().iter().all(|x| x.is_finite()));
}

/// A live blade and a sweep of the scene are bit-identical on the same device; once the stroke has ended nothing is
/// fetched any more.
#[test]
fn a_live_blade_does_the_same_as_a_sweep() {
    let Some(gpu) = gpu("a_live_blade_does_the_same_as_a_sweep") else {
        return;
    };
    let gpu = counting(&gpu);
    let blade = [[-1.0, 0.03, 0.7], [1.0, 0.05, 0.7]];
    let way = dvec3(0.0, 0.02, -1.5);
    let scripted = boxes(&sweep([1, 7], blade, way.to_array()));
    let on_gpu = |scene: &Scene| Simulation::on_device(scene, Arc::clone(&gpu)).unwrap();
    let (mut scripted, mut live) = (on_gpu(&scripted), on_gpu(&boxes("")));
    let mut stroke = None;
    for frame in 0..11_u32 {
        let fraction = f64::from(frame.clamp(1, 7) - 1) / 6.0;
        let pose = blade.map(|x| DVec3::from_array(x) + DVec3::ZERO.lerp(way, fraction));
        match stroke {
            None if frame == 1 => stroke = Some(live.begin_stroke(&pose, 0.1).unwrap()),
            Some(stroke) if frame <= 7 => {
                live.move_blade(stroke, &pose).unwrap();
                if frame == 7 {
                    live.end_stroke(stroke).unwrap();
                }
            }
            _ => {}
        }
        scripted.step().unwrap();
        let before = gpu.traffic();
        live.step().unwrap();
        let fetches = gpu.traffic().since(before).readbacks > 0;
        assert_eq!(fetches, (1..=7).contains(&frame), "{frame}");
        assert_eq!(scripted.report().cut, live.report().cut, "{frame}");
    }
    assert_eq!(live.report().pieces, 3);
    for simulation in [&mut scripted, &mut live] {
        simulation.read_back().unwrap();
        simulation.check().unwrap();
    }
    assert!(state(&scripted) == state(&live));

    // Each particle of the whole is where the solver says that has it.
    let solvers: Vec<_> = live.device_solvers().collect();
    for (p, x) in live.positions().iter().enumerate() {
        let (island, number) = live.location_of(ParticleId::new(p));
        assert_eq!(solvers[island].cached_host().position(number), *x);
    }
}
