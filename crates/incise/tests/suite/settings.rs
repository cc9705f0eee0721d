//! A scene with strokes, attachments and obstacles, and settings to solve it with.

use incise::Scene;
use incise::scene::{Method, ReclusterSpec, SleepSpec, SolverSpec, Substeps, TetSolve};

use crate::support::{body, plane, scene, sweep};

/// A beam that is held and swept, and a box; both can be cut.
pub(crate) fn two_bodies() -> Scene {
    let beam = body("beam", 300, [0.0, 0.0, 0.0]);
    let cube = body("box", 200, [0.0, 2.0, 0.0]);
    let sweep = sweep(
        [1, 4],
        [[0.05, -1.0, 0.4], [0.1, 3.0, 0.4]],
        [0.0, 0.0, -0.8],
    );
    let plane = plane(3, [-0.1, 0.0, 0.0], [1.0, 0.2, 0.0]);
    scene(&format!(
        "[solver]\nsubsteps = 5\n[world]\ngravity = [0.0, 0.0, -9.81]\nground = {{ height = -0.6, friction = 0.4 }}\n\
         {beam}fixed = [{{ half_space = {{ point = [-0.45, 0.0, 0.0], normal = [-1.0, 0.0, 0.0] }} }}]\n\
         {cube}{sweep}{plane}\n\
         [[collider]]\nkind = \"sphere\"\ncenter = [0.2, 0.0, 0.5]\nradius = 0.1\nvelocity = [0.0, 0.0, -1.0]\n\
         [[attachment]]\nbody = 0\nregions = [{{ half_space = {{ point = [0.45, 0.0, 0.0], normal = [1.0, 0.0, 0.0] }} }}]\n\
         frames = [0, 6]\npath = [[0.0, 0.0, 0.0], [0.05, 0.0, 0.0]]"
    ))
}

/// Settings that differ from those of [`two_bodies`], each in something else, by name. The number of substeps is given:
/// a chosen one may rise with cuts, and later settings would start from that.
pub(crate) fn settings() -> Vec<(&'static str, SolverSpec)> {
    let of = |method| SolverSpec::of(method).with(|spec| spec.substeps = 5.into());
    let plain = || of(Method::GaussSeidel);
    vec![
        ("nothing", plain()),
        (
            "iterations",
            plain().with(|spec| {
                spec.iterations = 3;
                spec.relaxation = 0.9;
                spec.tet_solve = TetSolve::Sequential;
            }),
        ),
        ("jacobi", of(Method::Jacobi)),
        ("chebyshev", of(Method::Chebyshev)),
        ("vbd", of(Method::Vbd)),
        (
            "vbd with a limit",
            of(Method::Vbd).with(|spec| spec.kappa_limit = 0.02),
        ),
        (
            "corrected vbd with a limit",
            of(Method::Vbd).with(|spec| {
                spec.substeps = 1.into();
                spec.iterations = 3;
                spec.two_level = true;
                spec.kappa_limit = 0.05;
            }),
        ),
        ("substeps", plain().with(|spec| spec.substeps = 2.into())),
        (
            "auto",
            plain().with(|spec| {
                spec.substeps = Substeps::Auto;
                spec.max_substeps = 7;
            }),
        ),
        ("time step", plain().with(|spec| spec.time_step = 0.008)),
        ("low limit", plain().with(|spec| spec.kappa_limit = 0.02)),
        ("high limit", plain().with(|spec| spec.kappa_limit = 1.0)),
        (
            "clusters",
            plain().with(|spec| {
                spec.clustering = "none".into();
                spec.coloring = "scgc".into();
            }),
        ),
        (
            "degradation",
            plain().with(|spec| {
                spec.merge_clusters = false;
                spec.recluster = Some(ReclusterSpec::default().with(|recluster| {
                    recluster.threshold = 1.01;
                    recluster.frames = std::num::NonZeroU32::MIN.saturating_add(1);
                }));
            }),
        ),
        (
            "sleep",
            plain().with(|spec| spec.sleep = Some(SleepSpec::new(1.0, 0.02))),
        ),
    ]
}

/// The scene solved with other settings.
pub(crate) fn with(scene: &Scene, solver: &SolverSpec) -> Scene {
    let mut scene = scene.clone();
    scene.solver = solver.clone();
    scene
}
