//! Blades and grabs in any order, with cuts between them: everything stays sound and finite.

use incise::mesh::glam::DVec3;
use incise::scene::{Precision, SleepSpec, StrokeSpec};
use incise::{Grab, Simulation};
use proptest::prelude::*;

use crate::support::{body, scene, simulation};

/// What a user does between two frames.
#[derive(Clone, Debug)]
enum Act {
    Begin([f64; 3], [f64; 3]),
    Move(usize, [f64; 3]),
    End(usize),
    Cut([f64; 3], [f64; 3]),
    Grab([f64; 3], f64, f64),
    Pull(usize, [f64; 3]),
    Release(usize),
    Step,
}

fn act() -> impl Strategy<Value = Act> {
    let point = || proptest::array::uniform3(-0.8..0.8);
    let compliance = prop_oneof![Just(0.0), 1e-5..1e-2];
    prop_oneof![
        1 => (point(), point()).prop_map(|(a, b)| Act::Begin(a, b)),
        4 => (0..4_usize, point()).prop_map(|(i, by)| Act::Move(i, by)),
        1 => (0..4_usize).prop_map(Act::End),
        1 => (point(), point()).prop_map(|(x, n)| Act::Cut(x, n)),
        2 => (point(), 0.1..0.6, compliance).prop_map(|(x, r, c)| Act::Grab(x, r, c)),
        4 => (0..4_usize, point()).prop_map(|(i, to)| Act::Pull(i, to)),
        1 => (0..4_usize).prop_map(Act::Release),
        6 => Just(Act::Step),
    ]
}

/// Carries a user's doings out, those that name nothing as well; everything is checked after every frame.
fn play(simulation: &mut Simulation, acts: &[Act]) {
    let vector = DVec3::from_array;
    let (mut strokes, mut grabs): (Vec<(u32, [DVec3; 2])>, Vec<Grab>) = (Vec::new(), Vec::new());
    for act in acts {
        match *act {
            Act::Begin(a, b) => {
                let blade = [vector(a), vector(b)];
                strokes.push((simulation.begin_stroke(&blade, 0.1).unwrap(), blade));
            }
            Act::Move(i, by) => {
                if let Some((stroke, blade)) = strokes.get_mut(i) {
                    // A third of the way a frame.
                    *blade = blade.map(|x| x + vector(by) / 3.0);
                    simulation.move_blade(*stroke, &*blade).unwrap();
                }
            }
            Act::End(i) if i < strokes.len() => {
                let (stroke, _) = strokes.remove(i);
                simulation.end_stroke(stroke).unwrap();
                assert!(simulation.end_stroke(stroke).is_err());
            }
            Act::Cut(point, normal) => {
                let plane = StrokeSpec::plane(0, point, (vector(normal) + DVec3::X).to_array());
                simulation.cut(plane).unwrap();
            }
            Act::Grab(point, radius, compliance) => {
                let grab = simulation.grab(vector(point), radius, compliance);
                grabs.extend(grab.unwrap());
            }
            Act::Pull(i, to) => {
                if let Some(&grab) = grabs.get(i) {
                    simulation.move_grab(grab, vector(to)).unwrap();
                }
            }
            Act::Release(i) if i < grabs.len() => {
                let grab = grabs.remove(i);
                simulation.release(grab).unwrap();
                assert!(simulation.release(grab).is_err());
            }
            Act::End(_) | Act::Release(_) => {}
            Act::Step => {
                simulation.step().unwrap();
            }
        }
        simulation.check().unwrap();
        assert!(simulation.positions().iter().all(|x| x.is_finite()));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever is done in whatever order leaves everything sound and finite.
    #[test]
    fn any_sequence_leaves_everything_sound(
        acts in proptest::collection::vec(act(), 10..40),
        single in any::<bool>(),
        sleepy in any::<bool>(),
    ) {
        let bodies = body("box", 200, [0.0; 3]) + &body("sphere", 200, [0.9, 0.0, 0.0]);
        let world = "[world]\ngravity = [0.0, 0.0, -9.81]\nground = { height = -0.6, friction = 0.5 }\n";
        let mut scene = scene(&format!("{world}{bodies}"));
        scene.solver.precision = if single { Precision::F32 } else { Precision::F64 };
        if sleepy {
            scene.solver.sleep = Some(SleepSpec::new(0.5, 0.05));
        }
        play(&mut simulation(&scene), &acts);
    }
}
