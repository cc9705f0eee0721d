//! Contact on a GPU: found on the host and solved on the device as on the processor, before and after cuts.

use std::sync::Arc;

use incise::gpu::GpuContext;
use incise::mesh::glam::{DVec3, dvec3};
use incise::mesh::kuhn_box;
use incise::meshing::{Shape, generate};
use incise::scene::{
    AttachmentSpec, Backend, ContactSpec, CuttingSpec, Method, Precision, Region, SleepSpec,
};
use incise::{Body, Event, Simulation, SimulationBuilder};

use crate::contact::{
    EDGE, GRAVITY, busy, center, cube, cut, intruders, mean_force, seen, solver, stack, steps,
    steps_of,
};
use crate::gpu::{counting, farthest, gpu, is_one_cut};

/// A simulation on the device.
fn on(gpu: &Arc<GpuContext>, mut builder: SimulationBuilder) -> Simulation {
    builder.device(Arc::clone(gpu));
    builder.build().unwrap()
}

/// Runs a scene on the processor and on the device; all that is to be seen is equal on lavapipe, and close elsewhere.
fn compare(gpu: &Arc<GpuContext>, builder: &dyn Fn() -> SimulationBuilder, frames: u32) {
    let exact = gpu.adapter().name.contains("llvmpipe");
    let mut here = builder().build().unwrap();
    let mut there = on(gpu, builder());
    let mut pressed = 0;
    for frame in 0..frames {
        let one = here.step().unwrap().clone();
        let other = there.step().unwrap().clone();
        assert_eq!(other.backend, "gpu");
        assert_eq!(
            (one.tets, one.pieces, one.repaired),
            (other.tets, other.pieces, other.repaired),
            "{frame}"
        );
        assert!(
            is_one_cut(gpu, &one, &other),
            "{frame}: {:?}, {:?}",
            one.cut,
            other.cut
        );
        if one.cut.is_some() {
            there.check().unwrap();
        }
        pressed += one.contact.unwrap().active;
        there.read_back().unwrap();
        if exact {
            assert!(seen(&here) == seen(&there), "{frame}");
        } else {
            // Rounding, which contacts carry on.
            let far = farthest(here.positions(), there.positions());
            assert!(far < 1e-3, "{frame}: {far}");
        }
    }
    assert!(pressed > 200, "{pressed}");
    there.check().unwrap();
}

#[test]
fn contact_is_that_of_the_processor() {
    let Some(gpu) = gpu("contact_is_that_of_the_processor") else {
        return;
    };
    compare(&gpu, &|| busy(Precision::F32, 1), 30);
    // With multipliers, and a frame that is divided.
    let iterated = || {
        let mut builder = busy(Precision::F32, 1);
        builder.solver(solver(Precision::F32, 5).with(|spec| spec.iterations = 2));
        builder
    };
    compare(&gpu, &iterated, 12);
}

/// What flies at 20 m/s is found several times a frame, as on the processor.
#[test]
fn frames_are_divided_on_a_device() {
    let Some(gpu) = gpu("frames_are_divided_on_a_device") else {
        return;
    };
    let run = |device: bool| {
        let mut builder = Simulation::builder();
        builder.solver(solver(Precision::F32, 40));
        let plate = Body::new(kuhn_box([8, 8, 1], dvec3(0.5, 0.5, 0.0625)));
        builder.add_body(
            plate
                .pinned(|x| x.x == 0.0 || x.x == 0.5)
                .young_modulus(1e6),
        );
        builder.add_body(cube(dvec3(0.13, 0.11, 0.2)).young_modulus(1e6));
        builder.contact(ContactSpec::default());
        if device {
            builder.device(Arc::clone(&gpu));
        }
        let mut simulation = builder.build().unwrap();
        let fast = |x: DVec3| {
            if x.z > 0.1 {
                DVec3::NEG_Z * 20.0
            } else {
                DVec3::ZERO
            }
        };
        simulation.set_velocities(fast).unwrap();
        let all = simulation.positions().len();
        for _ in 0..12 {
            assert_eq!(simulation.step().unwrap().repaired, 0);
            simulation.read_back().unwrap();
            let [plate, body] = [0..all - 125, all - 125..all].map(|r| center(&simulation, r).z);
            assert!(body - plate > 0.05, "{body} {plate}");
        }
        simulation.positions().to_vec()
    };
    let far = farthest(&run(true), &run(false));
    // 12 frames of rounding in bodies of half a meter.
    assert!(far < 1e-4, "{far}");
}

/// Cutting a body without load changes nothing about its motion on a device, too.
#[test]
fn a_fresh_cut_at_rest_is_silent_on_a_device() {
    let Some(gpu) = gpu("a_fresh_cut_at_rest_is_silent_on_a_device") else {
        return;
    };
    let run = |contact: bool| {
        let mut builder = Simulation::builder();
        builder
            .solver(solver(Precision::F32, 4))
            .cutting(CuttingSpec::default().with(|spec| spec.improve = false))
            .device(Arc::clone(&gpu));
        builder.add_body(cube(DVec3::ZERO));
        if contact {
            builder.contact(ContactSpec::default());
        }
        builder.add_stroke(cut(1, DVec3::splat(0.15625), DVec3::X));
        builder.add_stroke(cut(2, DVec3::splat(0.15625), DVec3::Z));
        let mut simulation = builder.build().unwrap();
        let mut states = Vec::new();
        for _ in 0..8 {
            simulation.step().unwrap();
            simulation.read_back().unwrap();
            states.push(simulation.positions().to_vec());
        }
        simulation.check().unwrap();
        assert_eq!(simulation.report().pieces, 4);
        let found = simulation.report().contact;
        assert_eq!(found.is_some_and(|found| found.candidates > 50), contact);
        assert_eq!(found.map_or(0, |found| found.active), 0);
        states
    };
    assert!(run(true) == run(false));
}

/// A cube carries another one, and a slab that is cut off a box rests on it.
#[test]
fn a_stack_and_a_slab_rest_on_a_device() {
    let Some(gpu) = gpu("a_stack_and_a_slab_rest_on_a_device") else {
        return;
    };
    let mut simulation = on(&gpu, stack(2, Precision::F32));
    steps(&mut simulation, 100);
    let weight = EDGE.powi(3) * 1000.0 * -GRAVITY.z;
    let force = mean_force(&mut simulation, [0, 1], 20);
    assert!((force.z - weight).abs() < 0.01 * weight, "{force} {weight}");
    let contact = simulation.report().contact.unwrap();
    assert!(
        contact.max_depth < 1e-3 && contact.active >= 8,
        "{contact:?}"
    );
    simulation.check().unwrap();

    let mut builder = Simulation::builder();
    builder
        .gravity(GRAVITY)
        .ground(0.0, 0.5)
        .solver(solver(Precision::F32, 20))
        .device(gpu);
    builder.add_body(cube(DVec3::ZERO).damping(0.02));
    builder.contact(ContactSpec::default());
    builder.add_stroke(cut(2, dvec3(0.0, 0.0, 0.15), DVec3::Z));
    let mut simulation = builder.build().unwrap();
    steps(&mut simulation, 120);
    let slab = simulation.pieces()[1];
    let force = mean_force(&mut simulation, [0, 1], 30);
    let weight = slab.mass * -GRAVITY.z;
    assert!(
        force.distance(DVec3::Z * weight) < 0.01 * weight,
        "{force} {weight}"
    );
    let contact = simulation.report().contact.unwrap();
    assert!(contact.active >= 25 && contact.buried == 0, "{contact:?}");
    assert!(contact.max_depth < 1e-3, "{contact:?}");
}

/// `a = g (sin θ - μ cos θ)` on a slope of tan θ = 1/2, and above that a block stays.
#[test]
fn a_block_slides_and_sticks_on_a_device() {
    let Some(gpu) = gpu("a_block_slides_and_sticks_on_a_device") else {
        return;
    };
    let (sine, cosine) = (1.0 / 5f64.sqrt(), 2.0 / 5f64.sqrt());
    for friction in [0.0, 0.3, 0.55] {
        let mut builder = Simulation::builder();
        builder
            .gravity(dvec3(1.0, 0.0, -2.0).normalize() * 9.81)
            .solver(solver(Precision::F32, 20))
            .device(Arc::clone(&gpu));
        let plate = Body::new(kuhn_box([12, 4, 1], dvec3(1.5, 0.5, 0.125)));
        builder.add_body(plate.pinned(|_| true));
        let block = Body::new(kuhn_box([3; 3], DVec3::splat(0.1875)));
        let block = block.position(dvec3(0.05, 0.15, 0.125));
        builder.add_body(block.young_modulus(2e5).damping(0.01));
        builder.contact(ContactSpec::default().with(|spec| spec.friction = friction));
        let mut simulation = builder.build().unwrap();
        let particles = simulation.positions().len();
        let mut at = |frames: u32| {
            steps(&mut simulation, frames);
            simulation.read_back().unwrap();
            center(&simulation, particles - 64..particles).x
        };
        // Three points of a parabola, 20 frames apart.
        let [a, b, c] = [15, 20, 20].map(&mut at);
        let found = (c - 2.0 * b + a) / (20.0_f64 * 0.016).powi(2);
        let expected = (9.81 * (sine - friction * cosine)).max(0.0);
        // As much as 0.02 in the coefficient; the block still shakes from its start.
        assert!(
            (found - expected).abs() < 0.02 * 9.81 * cosine,
            "{friction}: {found} {expected}"
        );
    }
}

/// Halves that are drawn apart and pushed together again do not overlap.
#[test]
fn halves_meet_again_on_a_device() {
    let Some(gpu) = gpu("halves_meet_again_on_a_device") else {
        return;
    };
    let mut builder = Simulation::builder();
    builder.solver(solver(Precision::F32, 20)).device(gpu);
    let ball = Body::new(generate(Shape::Sphere, 1500).unwrap()).scale(0.5);
    builder.add_body(ball.young_modulus(1e5).damping(0.005));
    builder.contact(ContactSpec::default());
    builder.add_stroke(cut(1, DVec3::ZERO, DVec3::X));
    for side in [-1.0, 1.0] {
        let cap = Region::half_space([0.2 * side, 0.0, 0.0], [side, 0.0, 0.0]);
        let path = [
            (0.0, 0.0),
            (0.1, 0.0),
            (0.1, 0.01),
            (0.0, 0.01),
            (-0.00625, 0.01),
        ];
        builder.add_attachment(AttachmentSpec::new(0, vec![cap]).with(|spec| {
            spec.frames = [2, 82];
            spec.path = path.map(|(x, y)| [x * side, y * side, 0.0]).to_vec();
        }));
    }
    let mut simulation = builder.build().unwrap();
    for _ in 0..110 {
        assert_eq!(simulation.step().unwrap().repaired, 0);
    }
    simulation.read_back().unwrap();
    let contact = simulation.report().contact.unwrap();
    assert!(contact.active > 20, "{contact:?}");
    // 1% of an edge of 55 mm.
    assert_eq!((contact.buried, intruders(&simulation, 5.5e-4)), (0, 0));
    simulation.check().unwrap();
}

/// Undo, another simulation, and the way to the device and back in the midst of contact.
#[test]
fn snapshots_and_settings_with_contact_on_a_device() {
    let Some(gpu) = gpu("snapshots_and_settings_with_contact_on_a_device") else {
        return;
    };
    let frames = |simulation: &mut Simulation, count: u32| {
        let mut seen = steps_of(simulation, count);
        simulation.read_back().unwrap();
        seen.push(crate::contact::seen(simulation));
        seen
    };
    let mut there = on(&gpu, busy(Precision::F32, 1));
    for count in [2, 8, 11] {
        steps_of(&mut there, count);
        let snapshot = there.snapshot().unwrap();
        let first = frames(&mut there, 6);
        there.restore(&snapshot).unwrap();
        assert!(frames(&mut there, 6) == first);
        there.check().unwrap();
        there.restore(&snapshot).unwrap();
    }
    // From the processor to the device at frame 8 and back at frame 16, beside one that stays.
    let mut here = busy(Precision::F32, 1).build().unwrap();
    let mut moving = busy(Precision::F32, 1).build().unwrap();
    moving.offer_device(Arc::clone(&gpu));
    for frame in 0..24 {
        if frame % 8 == 0 && frame > 0 {
            let backend = if frame == 8 {
                Backend::Gpu
            } else {
                Backend::Cpu
            };
            let spec = moving
                .solver_spec()
                .clone()
                .with(|spec| spec.backend = backend);
            moving.set_solver(&spec).unwrap();
        }
        here.step().unwrap();
        let backend = moving.step().unwrap().backend;
        assert_eq!(
            backend,
            if (8..16).contains(&frame) {
                "gpu"
            } else {
                "cpu"
            }
        );
    }
    let far = farthest(here.positions(), moving.positions());
    // Eight frames of rounding.
    assert!(far < 1e-4, "{far}");
}

/// Contacts begin and end; a body is removed, and cuts are made in what is left; friction changes; the rest sleeps.
#[test]
fn bodies_come_and_go_on_a_device() {
    let Some(gpu) = gpu("bodies_come_and_go_on_a_device") else {
        return;
    };
    let mut builder = Simulation::builder();
    builder
        .gravity(GRAVITY)
        .ground(0.0, 0.5)
        .device(gpu)
        .solver(
            solver(Precision::F32, 20).with(|spec| spec.sleep = Some(SleepSpec::new(1e-2, 0.2))),
        );
    let bodies = [0.0, 0.26, 0.52].map(|z| builder.add_body(cube(dvec3(0.0, 0.0, z)).damping(0.1)));
    builder.contact(ContactSpec::default());
    let mut simulation = builder.build().unwrap();
    let run = |simulation: &mut Simulation, frames: u32| {
        let mut events = Vec::new();
        for _ in 0..frames {
            simulation.step().unwrap();
            events.extend(simulation.events().to_vec());
        }
        events
    };
    let began = |a: u32, b: u32| Event::ContactBegan {
        pieces: [a, b],
        bodies: [a as usize, b as usize],
    };
    let ended = |a: u32, b: u32| Event::ContactEnded {
        pieces: [a, b],
        bodies: [a as usize, b as usize],
    };
    assert_eq!(run(&mut simulation, 150), [began(0, 1), began(1, 2)]);
    assert_eq!(simulation.report().bodies[0].asleep, Some(true));
    let smooth = ContactSpec::default().with(|spec| spec.friction = 0.0);
    simulation.set_contact(&smooth).unwrap();
    simulation.step().unwrap();
    assert_eq!(simulation.report().bodies[0].asleep, Some(false));
    assert_eq!(simulation.contacts().len(), 2);
    simulation.remove_body(bodies[1]).unwrap();
    assert_eq!(run(&mut simulation, 1), [ended(0, 1), ended(1, 2)]);
    simulation.check().unwrap();
    assert_eq!(run(&mut simulation, 60), [began(0, 2)]);
    for z in [0.1, 0.17] {
        simulation
            .cut(cut(0, dvec3(0.0, 0.0, z), DVec3::Z))
            .unwrap();
        simulation.step().unwrap();
        simulation.check().unwrap();
    }
    assert_eq!(simulation.report().pieces, 4);
    run(&mut simulation, 30);
    assert_eq!(simulation.report().repaired, 0);
    assert!(simulation.contacts().len() >= 3);
    simulation.remove_body(bodies[0]).unwrap();
    simulation.remove_body(bodies[2]).unwrap();
    run(&mut simulation, 2);
    assert_eq!(simulation.report().contact.unwrap().candidates, 0);
    simulation.check().unwrap();
}

/// A frame with contact reads positions, velocities, a count and the impulses once; without it nothing is read.
#[test]
fn contact_reads_the_state_once_a_frame() {
    let Some(gpu) = gpu("contact_reads_the_state_once_a_frame") else {
        return;
    };
    let gpu = counting(&gpu);
    for contact in [true, false] {
        let mut builder = Simulation::builder();
        builder
            .gravity(GRAVITY)
            .ground(0.0, 0.5)
            .solver(solver(Precision::F32, 10))
            .device(Arc::clone(&gpu));
        for z in [0.0, EDGE] {
            builder.add_body(cube(dvec3(0.0, 0.0, z)).damping(0.1));
        }
        if contact {
            builder.contact(ContactSpec::default());
        }
        let mut simulation = builder.build().unwrap();
        steps(&mut simulation, 40);
        let before = gpu.traffic();
        steps(&mut simulation, 1);
        let spent = gpu.traffic().since(before);
        let found = simulation
            .report()
            .contact
            .map_or(0, |found| found.candidates);
        if contact {
            assert_eq!((spent.readbacks, spent.submits, spent.passes), (4, 2, 1));
            assert_eq!(spent.buffers, 0);
            let particles = 32 * simulation.positions().len() as u64 + 4;
            // Colors are padded to whole groups of 64.
            let impulses = spent.read_bytes - particles;
            assert!(
                found > 0 && impulses >= 16 * found as u64,
                "{impulses} {found}"
            );
        } else {
            // Each of both bodies is an island of its own.
            assert_eq!(
                (spent.readbacks, spent.submits, spent.uploaded_bytes),
                (0, 2, 0)
            );
        }
    }
}

/// What does not solve contact is refused on a device as on the processor, by its key.
#[test]
fn methods_without_contact_are_refused_on_a_device() {
    let Some(gpu) = gpu("methods_without_contact_are_refused_on_a_device") else {
        return;
    };
    for method in [Method::Jacobi, Method::Chebyshev, Method::Vbd] {
        let mut builder = busy(Precision::F32, 1);
        builder
            .device(Arc::clone(&gpu))
            .solver(solver(Precision::F32, 4).with(|spec| spec.method = method));
        let error = builder.build().unwrap_err();
        assert_eq!(error.key().as_deref(), Some("solver.method"), "{error}");
    }
}
