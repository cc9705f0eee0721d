//! The number of threads changes which thread computes what, never the result.

use incise::scene::Precision;
use incise::{Scene, Simulation};

use crate::support::{body, hash, plane, scene, state, sweep};

/// From this many tets on a color is solved by several threads: `PARALLEL_CONSTRAINTS` of the solver.
const PARALLEL: usize = 256;

/// A liver that falls onto the ground, is swept by a blade and halved by a plane.
fn falling_liver() -> Scene {
    let body = body("liver", 9000, [0.0, 0.0, 0.0]);
    let sweep = sweep(
        [1, 4],
        [[0.05, -1.0, 0.6], [0.1, 1.0, 0.6]],
        [0.0, 0.0, -1.2],
    );
    let plane = plane(3, [-0.1, 0.0, 0.0], [1.0, 0.2, 0.0]);
    scene(&format!(
        "[world]\ngravity = [0.0, 0.0, -9.81]\nground = {{ height = -0.3, friction = 0.4 }}\n\
         [solver]\nsubsteps = 4\nclustering = \"serial:20\"\n{body}damping = 0.001\n{sweep}{plane}"
    ))
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    for precision in [Precision::F32, Precision::F64] {
        let mut scene = falling_liver();
        scene.solver.precision = precision;
        let mut one = Simulation::with_threads(&scene, 1).unwrap();
        let mut other = Simulation::with_threads(&scene, 2).unwrap();
        let schedule = one.schedule();
        let sizes = (0..schedule.color_count()).map(|c| schedule.color_constraints(c).count());
        assert!(
            sizes.max().unwrap() >= PARALLEL,
            "no color is large enough to be shared among threads: the test proves nothing"
        );
        for frame in 0..6 {
            let cut = one.step().unwrap().cut;
            assert_eq!(cut, other.step().unwrap().cut);
            assert!(
                state(&one) == state(&other),
                "{precision:?}: frame {frame} depends on the number of threads"
            );
        }
        assert!(one.report().pieces > 1 && one.report().tets > 9500);
        one.check().unwrap();
    }
}

#[test]
fn the_global_pool_gives_the_same_bits() {
    let scene = falling_liver();
    let mut own = Simulation::with_threads(&scene, 1).unwrap();
    let mut global = Simulation::new(&scene).unwrap();
    for _ in 0..4 {
        own.step().unwrap();
        global.step().unwrap();
    }
    assert!(state(&own) == state(&global));
}

/// Another hash means another result for every user: change it only together with a line in the changelog.
#[test]
fn results_are_those_of_the_last_version() {
    let body = body("box", 600, [0.0, 0.0, 0.0]);
    let strokes = [
        plane(1, [0.1, 0.0, 0.0], [1.0, 0.3, 0.1]),
        sweep(
            [2, 5],
            [[-0.7, 0.11, 0.7], [0.7, 0.13, 0.7]],
            [0.0, 0.0, -1.4],
        ),
    ]
    .concat();
    let mut scene = scene(&format!(
        "[world]\ngravity = [0.0, 0.0, -9.81]\nground = {{ height = -0.6, friction = 0.5 }}\n\
         {body}damping = 0.001\n{strokes}"
    ));
    for (precision, improve, golden) in [
        (Precision::F32, false, 0x9a16_a3f2_afa1_cc04),
        (Precision::F64, false, 0x750c_1a65_c4df_bb87),
        (Precision::F32, true, 0x019f_b991_69df_d27d),
        (Precision::F64, true, 0x8dfe_c164_89ff_24ab),
    ] {
        scene.solver.precision = precision;
        scene.cutting.improve = improve;
        for threads in 1..=3 {
            let mut simulation = Simulation::with_threads(&scene, threads).unwrap();
            for _ in 0..10 {
                simulation.step().unwrap();
            }
            let hash = hash(state(&simulation));
            assert!(hash == golden, "{precision:?}, {improve}: {hash:#018x}");
        }
    }
}
