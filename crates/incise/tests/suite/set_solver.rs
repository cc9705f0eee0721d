//! Settings changed on a running simulation: equal to a simulation set up with them, and nothing else changes.

use incise::Simulation;
use incise::scene::{Method, Precision, Quantity, ReclusterSpec, SleepSpec, SolverSpec, Substeps};
use proptest::prelude::*;

use crate::settings::{settings, two_bodies, with};
use crate::snapshot::{everything, halving};
use crate::support::{body, scene, simulation};

/// The defaults with a number of substeps: a chosen one may rise with cuts, and later settings then start from that.
fn five() -> SolverSpec {
    SolverSpec::default().with(|spec| spec.substeps = 5.into())
}

#[test]
fn at_the_start_it_is_as_if_set_up_so() {
    let mut base = two_bodies();
    base.report.quantities = vec![Quantity::Residual, Quantity::Kappa, Quantity::Energy];
    let mut all = settings();
    // From a limit that softens half of the tets, too.
    let (_, low) = all.iter().find(|(name, _)| *name == "low limit").unwrap();
    let softened = simulation(&with(&base, low)).softened();
    assert!(softened.tets > 100, "{softened:?}");
    let starts = [five(), low.clone(), SolverSpec::of(Method::Vbd)];
    let three = |simulation: &mut Simulation| -> Vec<_> {
        let frames = (0..3).map(|_| {
            let words = everything(simulation);
            simulation.step().unwrap();
            words
        });
        frames.collect()
    };
    for precision in [Precision::F32, Precision::F64] {
        all.iter_mut()
            .for_each(|(_, solver)| solver.precision = precision);
        let expected: Vec<_> = all
            .iter()
            .map(|(_, solver)| three(&mut simulation(&with(&base, solver))))
            .collect();
        for start in &starts {
            let start = start.clone().with(|spec| spec.precision = precision);
            let mut simulation = simulation(&with(&base, &start));
            // Making its meshes takes longer than all else.
            let snapshot = simulation.snapshot().unwrap();
            for ((name, solver), expected) in all.iter().zip(&expected) {
                simulation.set_solver(solver).unwrap();
                assert_eq!(simulation.solver_spec(), solver);
                simulation.check().unwrap();
                assert!(three(&mut simulation) == *expected, "{name} {precision:?}");
                simulation.restore(&snapshot).unwrap();
            }
        }
    }
}

/// Where volumes, links and damping follow the plan, too.
#[test]
fn other_constraints_follow_from_the_start() {
    let beam = body("beam", 300, [0.0, 0.0, 0.0]);
    let cube = body("box", 200, [0.0, 1.2, 0.0]);
    let base = scene(&format!(
        "[world]\ngravity = [0.0, 0.0, -9.81]\n\
         {beam}damping = 0.01\nvolume_compliance = 1e-6\nsubsteps = \"auto\"\n{cube}\n\
         [[distance]]\nfrom = {{ body = 0, point = [0.0, 0.0, 0.0] }}\nto = {{ body = 1, point = [0.0, 1.2, 0.0] }}\n\
         compliance = 1e-4"
    ));
    for (name, solver) in settings() {
        let mut changed = simulation(&base);
        assert!(changed.set_solver(&solver).is_ok(), "{name}");
        let mut expected = simulation(&with(&base, &solver));
        for _ in 0..2 {
            expected.step().unwrap();
            changed.step().unwrap();
            assert!(
                everything(&mut changed) == everything(&mut expected),
                "{name}"
            );
        }
    }
}

/// Through all settings and back on a body that is cut meanwhile.
#[test]
fn a_cut_body_keeps_its_state() {
    let mut simulation = simulation(&two_bodies());
    (0..5).for_each(|_| assert!(simulation.step().is_ok()));
    let mut time = simulation.report().time_s;
    for (at, (name, solver)) in settings().into_iter().enumerate() {
        if at == 4 {
            simulation.cut(halving(0.3)).unwrap();
        }
        let before = (
            simulation.positions().to_vec(),
            simulation.pieces(),
            simulation.on_cut().to_vec(),
            simulation.mesh().clone(),
        );
        simulation.set_solver(&solver).unwrap();
        simulation.check().unwrap();
        let after = (
            simulation.positions().to_vec(),
            simulation.pieces(),
            simulation.on_cut().to_vec(),
            simulation.mesh().clone(),
        );
        assert!(before == after, "{name}");
        for _ in 0..2 {
            let report = simulation.step().unwrap();
            time += solver.time_step;
            // Sums of a few dozen time steps.
            assert!((report.time_s - time).abs() < 1e-12, "{name}");
            assert!(report.repaired == 0, "{name}");
            simulation.check().unwrap();
        }
        let low = simulation
            .positions()
            .iter()
            .fold(0.0_f64, |low, x| low.min(x.z));
        assert!(low > -0.7, "{name}: through the ground, to {low}");
    }
    assert!(simulation.report().pieces > 2);
}

/// A floor that rises by 1 m/s carries a body: it continues from where it is, and so does the time.
#[test]
fn obstacles_go_on_from_where_they_are() {
    let mut simulation = simulation(&scene(&format!(
        "{}[[collider]]\nkind = \"plane\"\npoint = [0.0, 0.0, -0.55]\nnormal = [0.0, 0.0, 1.0]\n\
         velocity = [0.0, 0.0, 1.0]",
        body("sphere", 200, [0.0, 0.0, 0.0])
    )));
    let mut floor = -0.55;
    for time_step in [0.016, 0.008, 0.016] {
        let solver = five().with(|spec| spec.time_step = time_step);
        simulation.set_solver(&solver).unwrap();
        for _ in 0..20 {
            simulation.step().unwrap();
            floor += time_step;
            let heights = simulation.positions().iter().map(|x| x.z);
            let low = heights.fold(f64::MAX, f64::min);
            // Single precision, and what penetrates is put onto the floor in each substep.
            assert!(low >= floor - 1e-5, "{low} below {floor}");
        }
        assert!((simulation.report().time_s - (floor + 0.55)).abs() < 1e-12);
    }
}

/// What was softened for one limit is not for another: as in a simulation that never knew the first.
#[test]
fn softened_tets_of_a_cut_body_are_restored() {
    let mut base = two_bodies();
    base.world = incise::scene::WorldSpec::default();
    base.collider.clear();
    base.attachment.clear();
    let limits = |kappa_limit, substeps: u32| {
        five().with(|spec| {
            spec.kappa_limit = kappa_limit;
            spec.substeps = substeps.into();
        })
    };
    // Nothing moves but by the cut, which is the same: so are the meshes.
    let [mut here, mut there] =
        [limits(0.05, 5), limits(1.0, 5)].map(|solver| simulation(&with(&base, &solver)));
    for simulation in [&mut here, &mut there] {
        (0..5).for_each(|_| assert!(simulation.step().is_ok()));
    }
    assert!(here.report().tets > 600);
    assert_eq!(here.mesh(), there.mesh());
    assert!(here.softened().tets > there.softened().tets);
    for solver in [
        limits(1.0, 5),
        limits(0.05, 4),
        limits(f64::INFINITY, 5),
        limits(0.5, 2),
    ] {
        here.set_solver(&solver).unwrap();
        there.set_solver(&solver).unwrap();
        assert_eq!(here.softened(), there.softened(), "{solver:?}");
        assert_eq!(here.kappa(), there.kappa());
        here.check().unwrap();
    }
}

/// On a cut body the settings that it comes from leave no trace, whatever they softened.
#[test]
fn detours_leave_no_trace() {
    let mut simulation = simulation(&two_bodies());
    (0..5).for_each(|_| assert!(simulation.step().is_ok()));
    let snapshot = simulation.snapshot().unwrap();
    // Except for clusters and colors, which are rebuilt only by settings that ask for others.
    let mut settings = settings();
    settings.retain(|(name, _)| !["clusters", "degradation"].contains(name));
    let mut end = |way: &[&SolverSpec]| {
        simulation.restore(&snapshot).unwrap();
        for solver in way {
            simulation.set_solver(solver).unwrap();
        }
        let before = simulation.softened();
        simulation.step().unwrap();
        (before, everything(&mut simulation))
    };
    let mut detours = settings.iter().map(|(_, solver)| solver).cycle().skip(3);
    for (name, solver) in &settings {
        if *name == "nothing" {
            // This one would not wake sleeping bodies.
            continue;
        }
        let straight = end(&[solver]);
        for _ in 0..3 {
            let detour = detours.next().unwrap();
            assert!(end(&[detour, solver]) == straight, "{name} by {detour:?}");
        }
    }
}

#[test]
fn auto_chooses_from_the_body_as_it_is() {
    let mut simulation = simulation(&two_bodies());
    (0..5).for_each(|_| assert!(simulation.step().is_ok()));
    let auto = |max_substeps| {
        five().with(|spec| {
            spec.method = Method::GaussSeidel;
            spec.substeps = Substeps::Auto;
            spec.max_substeps = max_substeps;
        })
    };
    simulation.set_solver(&auto(200)).unwrap();
    let chosen = |simulation: &mut Simulation| {
        let bodies = simulation.step().unwrap().bodies.clone();
        bodies
            .iter()
            .map(|body| (body.substeps, body.choice.unwrap()))
            .collect::<Vec<_>>()
    };
    let first = chosen(&mut simulation);
    assert!(
        first
            .iter()
            .all(|(substeps, choice)| *substeps == choice.substeps && *substeps > 2)
    );
    // Iterations have nothing to do with it.
    simulation
        .set_solver(&auto(200).with(|spec| spec.iterations = 2))
        .unwrap();
    assert_eq!(chosen(&mut simulation), first);
    simulation.set_solver(&auto(2)).unwrap();
    assert!(
        chosen(&mut simulation)
            .iter()
            .all(|(substeps, _)| *substeps == 2)
    );
    simulation.set_solver(&five()).unwrap();
    assert!(simulation.step().unwrap().bodies.is_empty());
}

/// Sleeping bodies would not show other settings.
#[test]
fn sleeping_bodies_wake_after_changed_settings() {
    let sleep = Some(SleepSpec::new(10.0, 0.03));
    let mut scene = scene(&body("sphere", 200, [0.0, 0.0, 0.0]));
    scene.solver.sleep = sleep;
    let mut simulation = simulation(&scene);
    let asleep =
        |simulation: &mut Simulation| simulation.step().unwrap().bodies[0].asleep == Some(true);
    assert_eq!(
        [(); 3].map(|()| asleep(&mut simulation)),
        [false, true, true]
    );
    simulation.set_solver(&scene.solver.clone()).unwrap();
    assert!(asleep(&mut simulation), "nothing differs");
    let more = scene.solver.clone().with(|spec| spec.iterations = 2);
    simulation.set_solver(&more).unwrap();
    assert_eq!([(); 2].map(|()| asleep(&mut simulation)), [false, true]);
}

#[test]
fn worn_clusters_are_renewed_once_that_is_asked_for() {
    let mut simulation = simulation(&two_bodies());
    (0..5).for_each(|_| assert!(simulation.step().is_ok()));
    let recluster = |threshold| {
        five().with(|spec| {
            spec.recluster = Some(ReclusterSpec::default().with(|recluster| {
                recluster.threshold = threshold;
                recluster.frames = std::num::NonZeroU32::MIN;
            }));
        })
    };
    simulation.set_solver(&recluster(1.01)).unwrap();
    assert_eq!(simulation.step().unwrap().reclustered, 0);
    assert!(
        simulation.step().unwrap().reclustered > 0,
        "no cluster is worn"
    );
    assert_eq!(simulation.step().unwrap().reclustered, 0);
    simulation.check().unwrap();
}

#[test]
fn refused_settings_change_nothing() {
    let mut scene = two_bodies();
    scene.body[0].damping = 0.01;
    let mut simulation = simulation(&scene);
    (0..3).for_each(|_| assert!(simulation.step().is_ok()));
    let mut other = {
        let snapshot = simulation.snapshot().unwrap();
        let mut other = Simulation::with_threads(&scene, 1).unwrap();
        other.restore(&snapshot).unwrap();
        other
    };
    let plain = five;
    let refused: [(SolverSpec, &str); 11] = [
        (
            plain().with(|spec| spec.precision = Precision::F64),
            "solver.precision",
        ),
        (plain().with(|spec| spec.time_step = f64::NAN), "time_step"),
        (plain().with(|spec| spec.substeps = 0.into()), "substeps"),
        (
            plain().with(|spec| spec.max_substeps = 0),
            "solver.max_substeps",
        ),
        (plain().with(|spec| spec.iterations = 0), "iterations"),
        (plain().with(|spec| spec.relaxation = 3.0), "relaxation"),
        (
            plain().with(|spec| spec.kappa_limit = -1.0),
            "solver.kappa_limit",
        ),
        (
            plain().with(|spec| spec.clustering = "round:3".into()),
            "solver.clustering",
        ),
        (
            plain().with(|spec| spec.coloring = "pink".into()),
            "solver.coloring",
        ),
        (
            plain().with(|spec| spec.two_level = true),
            "solver.two_level",
        ),
        (
            plain().with(|spec| spec.sleep = Some(SleepSpec::new(-1.0, 1.0))),
            "solver.sleep",
        ),
    ];
    for (solver, key) in refused {
        let error = simulation.set_solver(&solver).unwrap_err();
        assert!(error.to_string().contains(key), "{key}: {error}");
        assert_eq!(simulation.solver_spec(), &plain());
    }
    for _ in 0..3 {
        simulation.step().unwrap();
        other.step().unwrap();
        assert!(everything(&mut simulation) == everything(&mut other));
    }
}

#[cfg(not(feature = "gpu"))]
#[test]
fn a_device_is_refused_where_there_is_no_path_to_one() {
    use incise::Error;
    use incise::scene::Backend;
    let mut simulation = simulation(&two_bodies());
    let on = |backend| five().with(|spec| spec.backend = backend);
    let error = simulation.set_solver(&on(Backend::Gpu)).unwrap_err();
    assert!(matches!(error, Error::NoGpuPath), "{error}");
    assert!(simulation.backend_note().is_none());
    simulation.set_solver(&on(Backend::Auto)).unwrap();
    assert!(simulation.backend_note().unwrap().contains("no GPU path"));
    simulation.set_solver(&on(Backend::Cpu)).unwrap();
    assert!(simulation.backend_note().is_none());
}

/// The settings of a snapshot hold again; the present ones can be kept.
#[test]
fn a_snapshot_outlives_other_settings() {
    let mut simulation = simulation(&two_bodies());
    simulation.step().unwrap();
    let snapshot = simulation.snapshot().unwrap();
    let frames = |simulation: &mut Simulation| -> Vec<_> {
        let frames = (0..3).map(|_| {
            simulation.step().unwrap();
            everything(simulation)
        });
        frames.collect()
    };
    let then = frames(&mut simulation);
    for (name, solver) in settings() {
        simulation.set_solver(&solver).unwrap();
        simulation.step().unwrap();
        simulation.restore(&snapshot).unwrap();
        assert_eq!(simulation.solver_spec(), &five());
        assert!(frames(&mut simulation) == then, "{name}");
        simulation.restore(&snapshot).unwrap();
        simulation.set_solver(&solver).unwrap();
        simulation.step().unwrap();
        simulation.check().unwrap();
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Whatever is done in whatever order, everything derived agrees and nothing leaves the numbers.
    #[test]
    fn any_order_keeps_everything_sound(
        acts in prop::collection::vec((0..6_usize, any::<prop::sample::Index>(), -0.4..0.4f64), 4..20),
    ) {
        let mut simulation = simulation(&two_bodies());
        let settings = settings();
        let mut snapshots = Vec::new();
        for (act, which, at) in acts {
            match act {
                0 => simulation.cut(halving(at)).unwrap(),
                1 => simulation.set_solver(&settings[which.index(settings.len())].1).unwrap(),
                2 => snapshots.push(simulation.snapshot().unwrap()),
                3 if !snapshots.is_empty() => {
                    simulation.restore(&snapshots[which.index(snapshots.len())]).unwrap();
                }
                _ => {
                    simulation.step().unwrap();
                }
            }
            simulation.check().unwrap();
            prop_assert!(simulation.positions().iter().all(|x| x.is_finite()));
        }
    }
}
