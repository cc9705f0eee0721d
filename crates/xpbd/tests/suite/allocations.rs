//! After the first frames a step allocates nothing.

use glam::{DVec3, dvec3};
use incise_mesh::kuhn_box;
use incise_xpbd::{Collider, Method, Pose, Real, StepSettings, TetSolve};

use crate::body::{GRAVITY, RUBBER, body, plain};

/// Allocations of a frame on one thread. (On more, rayon takes a few words for each helper in each pass.)
fn allocations<R: Real>(settings: &StepSettings) -> u64 {
    let mesh = kuhn_box([6, 3, 3], dvec3(0.6, 0.3, 0.3));
    let mut solver = body::<R>(&mesh, RUBBER);
    let schedule = plain(&mesh);
    let handle = solver.add_handle(Pose::at(DVec3::ZERO));
    solver.attach(0, handle, 0.0, 0.0).unwrap();
    solver.attach(1, handle, 1e-4, 0.0).unwrap();
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .unwrap();
    pool.install(|| {
        // Chebyshev's iterates take turns in two lists.
        (0..2).for_each(|_| assert!(solver.step(&schedule, settings).is_ok()));
        let frame = || {
            solver.step(&schedule, settings).unwrap();
        };
        allocation_counter::measure(frame).count_total
    })
}

#[test]
fn a_frame_asks_for_no_memory() {
    let jacobi = StepSettings {
        method: Method::Jacobi,
        relaxation: 0.1,
        ..StepSettings::new(2e-3)
    };
    let chebyshev = StepSettings {
        method: Method::Chebyshev {
            spectral_radius: 0.9,
            chebyshev_start: 2,
        },
        ..jacobi.clone()
    };
    let sequential = StepSettings {
        tet_solve: TetSolve::Sequential,
        ..StepSettings::new(2e-3)
    };
    for mut settings in [StepSettings::new(2e-3), sequential, jacobi, chebyshev] {
        settings.gravity = Some(GRAVITY);
        settings.colliders = vec![Collider::ground(-0.01, 0.5), Collider::ground(-1.0, 0.0)];
        for (substeps, iterations) in [(1, 1), (4, 1), (2, 5)] {
            (settings.substeps, settings.iterations) = (substeps, iterations);
            assert_eq!(allocations::<f32>(&settings), 0, "{settings:?}");
            assert_eq!(allocations::<f64>(&settings), 0, "{settings:?}");
        }
    }
}

/// The count counts: the first frame lays the tets out.
#[test]
fn the_first_frame_does() {
    let mesh = kuhn_box([2, 1, 1], DVec3::ONE);
    let mut solver = body::<f32>(&mesh, RUBBER);
    let schedule = plain(&mesh);
    let settings = StepSettings::new(1e-3);
    let frame = || {
        solver.step(&schedule, &settings).unwrap();
    };
    assert!(allocation_counter::measure(frame).count_total > 0);
}
