//! Bodies at rest sleep, stay where they are to the bit, and are woken by a stroke.

use incise::{Scene, Simulation};

use crate::support::{body, plane, scene, simulation};

/// A box that comes to lie on the ground, and one that falls without end beside it.
fn lying_and_falling(strokes: &str) -> Scene {
    let far_above = body("box", 200, [3.0, 0.0, 400.0]);
    // Ten centimeters: ringing ends the sooner the smaller a body is.
    let lying = body("box", 200, [0.0; 3]).replace("1e4", "1e5") + "scale = 0.1\ndamping = 0.01\n";
    scene(&format!(
        "[world]\ngravity = [0.0, 0.0, -9.81]\nground = {{ height = -0.05, friction = 0.5 }}\n\
         [solver]\nsubsteps = \"auto\"\nsleep = {{ speed = 2e-2, time = 0.1 }}\n{lying}{far_above}{strokes}"
    ))
}

/// Steps until the first body sleeps; the number of frames.
fn until_asleep(simulation: &mut Simulation) -> usize {
    let asleep = |s: &mut Simulation| s.step().unwrap().bodies[0].asleep == Some(true);
    (1..400)
        .find(|_| asleep(simulation))
        .expect("the box comes to rest")
}

#[test]
fn a_body_at_rest_sleeps_and_does_not_drift_and_others_go_on() {
    let mut simulation = simulation(&lying_and_falling(""));
    assert!(until_asleep(&mut simulation) > 6);
    let half = simulation.mesh().positions.len() / 2;
    let before = simulation.positions().to_vec();
    for _ in 0..5 {
        let report = simulation.step().unwrap();
        assert_eq!(report.bodies[0].asleep, Some(true));
        assert_eq!(report.bodies[1].asleep, Some(false));
    }
    let after = simulation.positions();
    assert_eq!(after[..half], before[..half]);
    assert!(after[half].z < before[half].z - 0.1);
    // It sags under its weight: it sleeps where it rests, not where it began.
    assert!(after[0] != simulation.mesh().positions[0]);
}

#[test]
fn a_stroke_wakes_what_it_cuts_and_nothing_else() {
    let mut simulation = simulation(&lying_and_falling(""));
    until_asleep(&mut simulation);
    // A stroke that is added late is due at once.
    let stroke = |x: f64| scene(&plane(0, [x, 0.0, 0.0], [1.0, 0.2, 0.1])).stroke[0].clone();
    // One that passes by.
    simulation.cut(stroke(-40.0)).unwrap();
    let report = simulation.step().unwrap();
    assert_eq!((report.cut, report.bodies[0].asleep), (None, Some(true)));
    simulation.cut(stroke(0.003)).unwrap();
    let report = simulation.step().unwrap();
    assert!(report.cut.is_some());
    assert_eq!(report.bodies[0].asleep, Some(false));
    let before = simulation.positions().to_vec();
    simulation.step().unwrap();
    assert_ne!(simulation.positions()[..50], before[..50]);
    simulation.check().unwrap();
    // It comes to rest again.
    until_asleep(&mut simulation);
}

/// Weightless boxes at rest sleep; a handle wakes the one it holds for as long as it moves.
#[test]
fn a_handle_wakes_what_it_holds_while_it_moves() {
    let solver = "[solver]\nsleep = { speed = 0.05, time = 0.05 }\n";
    let bodies = body("box", 200, [0.0; 3]) + &body("box", 200, [3.0, 0.0, 0.0]);
    let all = "[[attachment]]\nbody = 1\nregions = [{ half_space = { point = [0, 0, -9], normal = [0, 0, 1] } }]\n\
        frames = [10, 20]\npath = [[0, 0, 0], [0, 0, 1]]\n";
    let mut simulation = simulation(&scene(&format!("{solver}{bodies}{all}")));
    for frame in 0..30_u32 {
        let bodies = simulation.step().unwrap().bodies.clone();
        // 0.05 s are four frames.
        assert_eq!(bodies[0].asleep, Some(frame >= 3), "frame {frame}");
        // The handle moves in ten frames; what it holds is still from the frame after that.
        let awake = frame < 3 || (10..23).contains(&frame);
        assert_eq!(bodies[1].asleep, Some(!awake), "frame {frame}");
    }
    let rest = simulation.mesh().positions.last().unwrap();
    let x = simulation.positions().last().unwrap();
    // Single precision.
    assert!((x.z - rest.z - 1.0).abs() < 1e-6);
}

/// A wall comes from far: a body sleeps until it is near, and does not let it pass through.
#[test]
fn a_moving_collider_wakes_a_body_that_it_comes_near() {
    let solver = "[solver]\nsleep = { time = 0.05 }\n";
    let sphere = body("sphere", 200, [0.0; 3]);
    let wall = |velocity: f64| {
        format!(
            "[[collider]]\nkind = \"plane\"\npoint = [-1.6, 0, 0]\nnormal = [1, 0, 0]\nvelocity = [{velocity}, 0, 0]\n"
        )
    };
    let run = |velocity: f64| {
        let text = format!("{solver}{sphere}{}", wall(velocity));
        let mut simulation = simulation(&scene(&text));
        let mut slept = 0;
        for _ in 0..40 {
            let report = simulation.step().unwrap();
            slept += usize::from(report.bodies[0].asleep == Some(true));
        }
        let low = simulation.positions().iter().map(|x| x.x);
        let asleep = simulation.report().bodies[0].asleep;
        (slept, asleep, low.fold(f64::INFINITY, f64::min))
    };
    assert_eq!(run(0.0).1, Some(true));
    let (slept, asleep, low) = run(2.0);
    assert!(slept > 2, "{slept} frames");
    // The wall is at -1.6 + 2 · 40 · 0.016 m; single precision.
    assert_eq!(asleep, Some(false));
    assert!(low > -0.32 - 1e-6, "{low}");
}

#[test]
fn sleeping_is_the_same_for_any_number_of_threads() {
    let scene = lying_and_falling(&plane(12, [0.003, 0.0, 0.0], [1.0, 0.2, 0.1]));
    let [mut one, mut two] =
        [1, 2].map(|threads| Simulation::with_threads(&scene, threads).unwrap());
    for _ in 0..20 {
        one.step().unwrap();
        two.step().unwrap();
        assert_eq!(one.report().bodies, two.report().bodies);
    }
    assert!(one.positions() == two.positions());
}

/// A body in free fall starts at speed zero but is not at rest; without gravity it is.
#[test]
fn free_fall_is_no_rest_and_weightlessness_is() {
    let solver = "[solver]\nsleep = { time = 0.05 }\n";
    let sphere = body("sphere", 200, [0.0; 3]);
    let asleep = |world: &str| {
        let mut simulation = simulation(&scene(&format!("{world}{solver}{sphere}")));
        (0..6).for_each(|_| drop(simulation.step().unwrap().clone()));
        simulation.report().bodies[0].asleep
    };
    assert_eq!(asleep("[world]\ngravity = [0.0, 0.0, -1.0]\n"), Some(false));
    assert_eq!(asleep(""), Some(true));
}
