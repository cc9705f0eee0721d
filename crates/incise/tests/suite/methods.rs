//! The methods a scene may name: what they default to, that each runs, and what does not go with it.

use incise::mesh::glam::DVec3;
use incise::scene::{Method, Precision, SolverSpec, StrokeSpec, TetSolve};
use incise::{Scene, Simulation};

use crate::support::{body, noise, plane, scene, simulation, state};
use crate::values::refused;

const NAMES: [(&str, Method); 4] = [
    ("gauss-seidel", Method::GaussSeidel),
    ("jacobi", Method::Jacobi),
    ("chebyshev", Method::Chebyshev),
    ("vbd", Method::Vbd),
];

/// A sphere that falls onto the ground and is cut, by the given keys of `[solver]`.
fn falling(keys: &str) -> Scene {
    scene(&format!(
        "[report]\nquantities = [\"residual\"]\n\
         [world]\ngravity = [0.0, 0.0, -9.81]\nground = {{ height = -0.55, friction = 0.4 }}\n\
         [solver]\n{keys}\n{}{}",
        body("sphere", 300, [0.0; 3]),
        plane(3, [0.03, 0.0, 0.0], [1.0, 0.1, 0.0]),
    ))
}

#[test]
fn each_method_has_its_defaults_and_named_keys_override_them() {
    for (name, method) in NAMES {
        let spec = |keys: &str| scene(&format!("[solver]\nmethod = \"{name}\"\n{keys}")).solver;
        assert_eq!(spec(""), SolverSpec::of(method));
        let (iterations, relaxation, limit) = match method {
            Method::GaussSeidel => (1, 1.0, f64::INFINITY),
            Method::Vbd => (20, 1.0, f64::INFINITY),
            _ => (20, 0.1, f64::INFINITY),
        };
        let given = spec("");
        assert_eq!(
            (given.iterations, given.relaxation, given.kappa_limit),
            (iterations, relaxation, limit)
        );
        assert_eq!(
            (
                given.tet_solve,
                given.spectral_radius,
                given.chebyshev_start,
                given.two_level
            ),
            (TetSolve::Split, 0.99, 10, false)
        );
        // Also a key whose value is that of the plain defaults.
        let given = spec("iterations = 1\nrelaxation = 1.0\nsubsteps = \"auto\"");
        assert_eq!(
            given,
            SolverSpec::default().with(|spec| spec.method = method)
        );
        let scene = falling(&format!("method = \"{name}\"\nrelaxation = 0.3"));
        assert_eq!(Scene::from_toml(&scene.to_toml().unwrap()).unwrap(), scene);
    }
}

#[test]
fn each_method_runs_through_a_cut_and_does_not_depend_on_threads() {
    let forms = ["block", "sequential"].map(|form| format!("tet_solve = \"{form}\""));
    let mut settings: Vec<String> = Vec::new();
    for (name, method) in NAMES {
        let variants = match method {
            Method::Vbd => [String::new(), "two_level = true".to_owned()],
            _ => forms.clone(),
        };
        settings.extend(variants.map(|keys| format!("method = \"{name}\"\n{keys}")));
    }
    let mut ends = Vec::new();
    for keys in settings {
        for precision in [Precision::F32, Precision::F64] {
            let mut scene = falling(&keys);
            scene.solver.precision = precision;
            let [mut one, mut three] =
                [1, 3].map(|threads| Simulation::with_threads(&scene, threads).unwrap());
            for _ in 0..8 {
                one.step().unwrap();
                three.step().unwrap();
                one.check().unwrap();
                assert!(one.positions().iter().all(|x| x.is_finite()));
                assert!(state(&one) == state(&three), "{keys}");
                assert_eq!(one.report().repaired, 0, "{keys}");
            }
            assert_eq!(one.report().pieces, 2);
            ends.push((keys.clone(), one.positions().to_vec()));
        }
    }
    // Each key changes something, or it would not be a key.
    for (i, (a, x)) in ends.iter().enumerate() {
        for (b, y) in &ends[..i] {
            assert!(x != y, "{a} gives the same as {b}");
        }
    }
}

/// A start as late as the last iteration, or a spectral radius of 0, makes Chebyshev equal to Jacobi.
#[test]
fn chebyshev_without_extrapolation_is_jacobi() {
    let run = |keys: &str| {
        let mut simulation = simulation(&falling(keys));
        // In free fall there is nothing to correct: up to the impact.
        for _ in 0..9 {
            simulation.step().unwrap();
        }
        simulation.positions().to_vec()
    };
    let jacobi = run("method = \"jacobi\"");
    assert!(jacobi == run("method = \"chebyshev\"\nchebyshev_start = 20"));
    assert!(jacobi == run("method = \"chebyshev\"\nspectral_radius = 0.0"));
    assert!(jacobi != run("method = \"chebyshev\"\nchebyshev_start = 5"));
    assert!(run("method = \"chebyshev\"\nspectral_radius = 0.5") != run("method = \"chebyshev\""));
}

/// Both follow the same equations, and at a small kappa one pass of Gauss-Seidel solves them nearly.
#[test]
fn vbd_and_gauss_seidel_agree_at_a_small_kappa() {
    let run = |keys: &str| {
        let text = format!(
            "[world]\ngravity = [0.0, 0.0, -9.81]\n[solver]\nprecision = \"f64\"\nsubsteps = 40\nkappa_limit = inf\n{keys}\n{}\
             fixed = [{{ half_space = {{ point = [-0.4, 0, 0], normal = [-1, 0, 0] }} }}]\n",
            body("beam", 300, [0.0; 3]),
        );
        let mut simulation = simulation(&scene(&text));
        for _ in 0..15 {
            simulation.step().unwrap();
        }
        assert!(simulation.kappa() < 0.1, "{}", simulation.kappa());
        simulation
    };
    let (xpbd, vbd) = (run(""), run("method = \"vbd\""));
    let corrected = run("method = \"vbd\"\ntwo_level = true");
    let distance = |a: &Simulation, b: &Simulation| {
        let pairs = a.positions().iter().zip(b.positions());
        pairs.map(|(x, y)| x.distance(*y)).fold(0.0, f64::max)
    };
    let moved = xpbd.positions().iter().zip(&xpbd.mesh().positions);
    let moved = moved.map(|(x, y)| x.distance(*y)).fold(0.0, f64::max);
    // The end sags by a third of the beam. Both VBD have converged; XPBD leaves out the primal residual.
    assert!(moved > 0.2, "{moved}");
    let [to_xpbd, to_corrected] = [&xpbd, &corrected].map(|other| distance(&vbd, other));
    assert!(to_xpbd < 0.02 * moved, "{to_xpbd} of {moved}");
    assert!(to_corrected < 1e-3 * moved, "{to_corrected} of {moved}");
}

/// Force and potential exist for VBD, primal and dual residuals do not; more sweeps leave less force.
#[test]
fn vbd_reports_the_residuals_that_it_has() {
    let run = |iterations: u32, two_level: bool| {
        let mut scene = scene(&format!(
            "[report]\nquantities = [\"residual\"]\n[world]\ngravity = [0.0, 0.0, -9.81]\n\
             [solver]\nmethod = \"vbd\"\nprecision = \"f64\"\n{}\
             fixed = [{{ half_space = {{ point = [-0.4, 0, 0], normal = [-1, 0, 0] }} }}]\n",
            body("beam", 300, [0.0; 3]),
        ));
        (scene.solver.iterations, scene.solver.two_level) = (iterations, two_level);
        let mut simulation = simulation(&scene);
        for _ in 0..3 {
            simulation.step().unwrap();
        }
        simulation.report().residual.unwrap()
    };
    let few = run(2, false);
    assert_eq!(
        (few.primal, few.primal_relative, few.dual, few.dual_rms),
        (None, None, None, None)
    );
    assert!(few.force > 0.0 && few.force_relative.unwrap() > 0.0 && few.potential.is_finite());
    let many = run(200, false);
    assert!(
        many.force < 0.1 * few.force,
        "{} after {}",
        many.force,
        few.force
    );
    let corrected = run(10, true);
    assert!(
        corrected.force < 1e-3 * few.force,
        "{} after {}",
        corrected.force,
        few.force
    );
}

/// A steel ball in one substep: kappa is beyond a million, and VBD neither inverts nor loses a tet.
#[test]
fn vbd_is_stable_at_any_stiffness() {
    let mut scene = falling("method = \"vbd\"\nsubsteps = 1");
    scene.body[0].young_modulus = 2e11;
    let mut simulation = simulation(&scene);
    assert!(simulation.kappa() > 1e6);
    for _ in 0..12 {
        simulation.step().unwrap();
    }
    let largest = simulation.positions().iter().map(|x| x.length());
    assert!(largest.fold(0.0, f64::max) < 1.0);
    assert_eq!(simulation.softened().tets, 0);
}

/// A handle moves what VBD solves as what XPBD solves.
#[test]
fn a_rigid_handle_goes_with_vbd() {
    let text = format!(
        "[solver]\nmethod = \"vbd\"\nprecision = \"f64\"\n{}\
         [[attachment]]\nregions = [{{ half_space = {{ point = [0, 0, 0.3], normal = [0, 0, 1] }} }}]\n\
         frames = [0, 4]\npath = [[0, 0, 0], [0, 0, 0.2]]\n{}",
        body("box", 300, [0.0; 3]),
        plane(2, [0.03, 0.0, 0.0], [1.0, 0.1, 0.0])
    );
    let mut simulation = simulation(&scene(&text));
    for _ in 0..6 {
        simulation.step().unwrap();
        simulation.check().unwrap();
    }
    let rest = simulation.mesh().positions.iter();
    let held: Vec<_> = rest
        .zip(simulation.positions())
        .filter(|(rest, _)| rest.z >= 0.499)
        .collect();
    assert!(held.len() > 10);
    for (rest, x) in held {
        // Rounding of a turn and two sums.
        assert!(x.distance(*rest + DVec3::Z * 0.2) < 1e-12);
    }
}

/// A damped body with volume constraints that a soft handle holds and a link ties to a second one, through a cut: VBD,
/// with and without corrections, stays near XPBD of many substeps.
#[test]
fn vbd_takes_damping_links_soft_handles_and_volumes() {
    let run = |keys: &str| {
        let body_keys = "damping = 0.01\nvolume_compliance = 1e-6\n";
        let text = format!(
            "[world]\ngravity = [0.0, 0.0, -9.81]\n[solver]\nprecision = \"f64\"\nkappa_limit = inf\n{keys}\n\
             {}{body_keys}{}{body_keys}\
             [[attachment]]\nregions = [{{ half_space = {{ point = [0, 0, 0.3], normal = [0, 0, 1] }} }}]\n\
             frames = [0, 4]\npath = [[0, 0, 0], [0, 0, 0.02]]\ncompliance = 1e-4\n\
             [[distance]]\nfrom = {{ body = 0, point = [0.5, 0, 0] }}\nto = {{ body = 1, point = [1.0, 0, 0] }}\n\
             compliance = 1e-4\n{}",
            body("box", 200, [0.0; 3]),
            body("box", 200, [1.5, 0.0, 0.0]),
            plane(3, [0.03, 0.0, -0.1], [0.1, 0.1, 1.0]),
        );
        let mut simulation = simulation(&scene(&text));
        for _ in 0..10 {
            simulation.step().unwrap();
            simulation.check().unwrap();
            assert_eq!(simulation.report().repaired, 0);
        }
        assert!(simulation.report().pieces > 2);
        simulation.positions().to_vec()
    };
    let reference = run("substeps = 100");
    let keys = "method = \"vbd\"\nsubsteps = 4\niterations = 50\n";
    for keys in [keys.to_owned(), format!("{keys}two_level = true\n")] {
        let vbd = run(&keys);
        assert_eq!(vbd.len(), reference.len());
        let apart = vbd.iter().zip(&reference).map(|(x, y)| x.distance(*y));
        let apart = apart.fold(0.0, f64::max);
        // The lower half falls by 0.2 m and more.
        assert!(apart < 0.03, "{apart}");
    }
}

/// A change of a sound scene of VBD, and the field that an error names.
type Mistake = (&'static str, fn(&mut Scene));

const MISTAKES: [Mistake; 6] = [
    ("solver.tet_solve is not split", |s| {
        s.solver.tet_solve = TetSolve::Sequential;
    }),
    ("solver.relaxation is 2", |s| s.solver.relaxation = 2.0),
    ("solver.two_level is true", |s| {
        (s.solver.method, s.solver.two_level) = (Method::GaussSeidel, true);
    }),
    ("solver.spectral_radius is 1", |s| {
        (s.solver.method, s.solver.spectral_radius) = (Method::Chebyshev, 1.0);
    }),
    ("solver.chebyshev_start is 0", |s| {
        (s.solver.method, s.solver.chebyshev_start) = (Method::Chebyshev, 0);
    }),
    ("solver.iterations is 0", |s| s.solver.iterations = 0),
];

#[test]
fn unsupported_features_of_a_method_are_named() {
    let sound = falling("method = \"vbd\"");
    simulation(&sound).step().unwrap();
    for (field, mistake) in MISTAKES {
        let mut scene = sound.clone();
        mistake(&mut scene);
        refused(&scene, field);
    }
}

/// Many cuts leave many pieces and ten times the tets: what two-level VBD keeps grows with the tets, not with the square of
/// the pieces.
#[test]
fn memory_of_two_level_vbd_follows_the_tets_through_many_cuts() {
    let mut scene = scene(&body("beam", 400, [0.0; 3]));
    scene.solver.method = Method::Vbd;
    scene.solver.two_level = true;
    scene.solver.iterations = 2;
    // It would take most of the tets out again.
    scene.cutting.improve = false;
    let mut simulation = simulation(&scene);
    simulation.step().unwrap();
    let bytes_per_tet = |simulation: &mut Simulation| {
        let bytes = simulation.snapshot().unwrap().bytes();
        bytes as f64 / simulation.mesh().tets.len() as f64
    };
    let before = bytes_per_tet(&mut simulation);
    let first = simulation.mesh().tets.len();
    for number in 0..20 {
        let at = |k: usize, size: f64| size * noise(5, 9 * number + k);
        simulation
            .cut(
                StrokeSpec::rectangle(
                    0,
                    [at(0, 0.5), at(1, 0.12), at(2, 0.12)],
                    [at(3, 0.2), at(4, 0.2), 0.2],
                    [at(6, 0.2), 0.2, at(8, 0.2)],
                )
                .with_snap(0.0),
            )
            .unwrap();
        // Stars, colors and the pattern of the matrix are those of a rebuild.
        simulation.check().unwrap();
        // The factor ages.
        for _ in 0..4 {
            simulation.step().unwrap();
        }
    }
    let (pieces, tets) = (simulation.pieces().len(), simulation.mesh().tets.len());
    assert!(
        pieces > 20 && tets > 5 * first,
        "{pieces} pieces, {tets} tets"
    );
    let after = bytes_per_tet(&mut simulation);
    assert!(after < 1.5 * before, "{before} bytes a tet, then {after}");
    simulation.check().unwrap();
}
