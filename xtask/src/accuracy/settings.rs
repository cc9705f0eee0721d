//! Settings measured for every scene, and the pairs of them that differ in one parameter.
//!
//! They cover stated accuracies; each setting varied alone around the split form with `n` substeps, the number that
//! brings kappa to 0.5; and numbers of substeps with each method and form.

use incise::scene::{Backend, Integrator, Method, Precision, SolverSpec, Substeps, TetSolve};

/// Compared settings, with the parameter that each varies: the curve it belongs to.
pub(super) struct Settings {
    pub(super) all: Vec<(&'static str, SolverSpec)>,
    pub(super) exchanges: Vec<Exchange>,
}

/// Two settings that differ in one parameter.
pub(super) struct Exchange {
    pub(super) setting: &'static str,
    /// Description of the change, as the start of a sentence.
    pub(super) what: &'static str,
    pub(super) from: SolverSpec,
    pub(super) to: SolverSpec,
}

pub(super) fn settings(substeps: u32, gpu: bool) -> Settings {
    let of = |method, eighths: u32, iterations| {
        SolverSpec::of(method).with(|spec| {
            spec.time_step = 1.0 / 60.0;
            spec.substeps = Substeps::Fixed((substeps * eighths).div_ceil(8));
            spec.iterations = iterations;
            spec.precision = Precision::F32;
        })
    };
    let xpbd = |eighths, iterations| of(Method::GaussSeidel, eighths, iterations);
    let double = |spec: SolverSpec| spec.with(|spec| spec.precision = Precision::F64);
    let clustered = |name: &str| xpbd(8, 1).with(|spec| spec.clustering = name.to_owned());
    let relaxed = |relaxation| xpbd(8, 1).with(|spec| spec.relaxation = relaxation);
    let sequential = |eighths| xpbd(eighths, 1).with(|spec| spec.tet_solve = TetSolve::Sequential);
    let block = |eighths| xpbd(eighths, 1).with(|spec| spec.tet_solve = TetSolve::Block);
    let accurate = |accuracy| {
        SolverSpec::default().with(|spec| {
            spec.accuracy = Some(accuracy);
            spec.time_step = 1.0 / 60.0;
        })
    };
    let jacobi = |eighths, iterations, relaxation| {
        of(Method::Jacobi, eighths, iterations).with(|spec| spec.relaxation = relaxation)
    };
    let chebyshev = |eighths, iterations| {
        of(Method::Chebyshev, eighths, iterations).with(|spec| spec.spectral_radius = 0.9)
    };
    let vbd = |substeps: u32, iterations, relaxation| {
        of(Method::Vbd, 8, iterations).with(|spec| {
            spec.substeps = Substeps::Fixed(substeps);
            spec.relaxation = relaxation;
        })
    };
    let coarse = |substeps: u32| double(vbd(substeps, 4, 1.0)).with(|spec| spec.two_level = true);
    let softened = |spec: SolverSpec| spec.with(|spec| spec.kappa_limit = 1.0);
    let on_gpu = |eighths| xpbd(eighths, 1).with(|spec| spec.backend = Backend::Gpu);

    let mut all: Vec<(&'static str, SolverSpec)> = Vec::new();
    let mut add = |curve, specs: Vec<SolverSpec>| {
        for spec in specs {
            if !all.iter().any(|(_, known)| *known == spec) {
                all.push((curve, spec));
            }
        }
    };
    add(
        "accuracy",
        [0.5, 0.2, 0.1, 0.05, 0.02, 0.01].map(accurate).into(),
    );
    let counts = [1, 2, 4, 8, 16, 32, 64];
    add(
        "substeps, f32",
        counts.iter().map(|&e| xpbd(e, 1)).collect(),
    );
    let counts = [4, 8, 16, 32, 64, 128];
    add(
        "substeps, f64",
        counts.iter().map(|&e| double(xpbd(e, 1))).collect(),
    );
    let counts = [1, 2, 4, 8, 16, 32, 64];
    add("substeps, block form", counts.map(block).into());
    let counts = [(8, 2), (8, 4), (8, 16), (16, 2), (16, 4), (32, 4)];
    add(
        "iterations",
        counts.iter().map(|&(e, i)| xpbd(e, i)).collect(),
    );
    add("relaxation", [0.5, 0.8, 0.9, 1.1, 1.3].map(relaxed).into());
    let clusterings = [
        "none",
        "serial:5",
        "serial:20",
        "serial:30",
        "greedy-k:10",
        "pressure:10",
    ];
    add("clusters", clusterings.map(clustered).into());
    add("the paper's form", [8, 32, 64].map(sequential).into());
    add(
        "jacobi",
        vec![
            jacobi(32, 1, 1.0),
            jacobi(64, 1, 1.0),
            jacobi(8, 4, 0.1),
            jacobi(8, 20, 0.1),
        ],
    );
    add(
        "chebyshev",
        vec![chebyshev(8, 12), chebyshev(8, 20), chebyshev(16, 20)],
    );
    add(
        "vbd",
        vec![
            vbd(1, 20, 1.0),
            vbd(1, 100, 1.0),
            vbd(1, 100, 1.9),
            vbd(4, 20, 1.0),
            vbd(4, 100, 1.9),
        ],
    );
    add(
        "vbd, coarse correction, f64",
        [1, 2, 4, 8].map(coarse).into(),
    );
    add(
        "softened, block form",
        [1, 2, 4].map(|e| softened(block(e))).into(),
    );
    if gpu {
        add("gpu", [4, 8, 16, 32].map(on_gpu).into());
    }

    let exchange = |setting, what, from: &SolverSpec, to: &SolverSpec| Exchange {
        setting,
        what,
        from: from.clone(),
        to: to.clone(),
    };
    let mut exchanges = vec![
        exchange(
            "accuracy",
            "Asking for an accuracy of 0.05 in place of 0.1",
            &accurate(0.1),
            &accurate(0.05),
        ),
        exchange(
            "accuracy",
            "Asking for an accuracy of 0.02 in place of 0.05",
            &accurate(0.05),
            &accurate(0.02),
        ),
        exchange(
            "substeps",
            "Doubling the substeps from n/2 to n",
            &xpbd(4, 1),
            &xpbd(8, 1),
        ),
        exchange(
            "substeps",
            "Doubling the substeps from n to 2 n",
            &xpbd(8, 1),
            &xpbd(16, 1),
        ),
        exchange(
            "substeps",
            "Doubling the substeps from 2 n to 4 n",
            &xpbd(16, 1),
            &xpbd(32, 1),
        ),
        exchange(
            "substeps",
            "Doubling the substeps from 4 n to 8 n",
            &xpbd(32, 1),
            &xpbd(64, 1),
        ),
        exchange(
            "iterations",
            "Going from 1 to 2 iterations at n substeps",
            &xpbd(8, 1),
            &xpbd(8, 2),
        ),
        exchange(
            "iterations",
            "Going from 1 to 4 iterations at n substeps",
            &xpbd(8, 1),
            &xpbd(8, 4),
        ),
        exchange(
            "iterations",
            "Taking n substeps of 4 iterations in place of 4 n of 1",
            &xpbd(32, 1),
            &xpbd(8, 4),
        ),
        exchange(
            "relaxation",
            "Lowering the relaxation from 1 to 0.8",
            &xpbd(8, 1),
            &relaxed(0.8),
        ),
        exchange(
            "relaxation",
            "Raising the relaxation from 1 to 1.1",
            &xpbd(8, 1),
            &relaxed(1.1),
        ),
        exchange(
            "clusters",
            "Clusters of 10 in place of none",
            &clustered("none"),
            &xpbd(8, 1),
        ),
        exchange(
            "clusters",
            "Clusters of 30 in place of 10",
            &xpbd(8, 1),
            &clustered("serial:30"),
        ),
        exchange(
            "clusters",
            "Clusters by pressure in place of serial ones",
            &xpbd(8, 1),
            &clustered("pressure:10"),
        ),
        exchange(
            "form",
            "The split form in place of the block form at n/4 substeps",
            &block(2),
            &xpbd(2, 1),
        ),
        exchange(
            "form",
            "The split form in place of the block form at n substeps",
            &block(8),
            &xpbd(8, 1),
        ),
        exchange(
            "form",
            "The split form in place of the block form at 4 n substeps",
            &block(32),
            &xpbd(32, 1),
        ),
        exchange(
            "form",
            "The split form in place of the paper's at n substeps",
            &sequential(8),
            &xpbd(8, 1),
        ),
        exchange(
            "precision",
            "Double precision at n substeps",
            &xpbd(8, 1),
            &double(xpbd(8, 1)),
        ),
        exchange(
            "precision",
            "Double precision at 8 n substeps",
            &xpbd(64, 1),
            &double(xpbd(64, 1)),
        ),
        exchange(
            "softening",
            "Softening the block form to kappa 1 at n/4 substeps",
            &block(2),
            &softened(block(2)),
        ),
        exchange(
            "method",
            "Jacobi (relaxation 1) in place of Gauss-Seidel at 8 n substeps",
            &xpbd(64, 1),
            &jacobi(64, 1, 1.0),
        ),
        exchange(
            "method",
            "Chebyshev with 20 iterations in place of Gauss-Seidel with 1",
            &xpbd(8, 1),
            &chebyshev(8, 20),
        ),
        exchange(
            "method",
            "Vbd, 1 step of 100 sweeps with relaxation 1.9, in place of Gauss-Seidel at n substeps",
            &xpbd(8, 1),
            &vbd(1, 100, 1.9),
        ),
        exchange(
            "method",
            "Vbd with coarse correction in 4 steps in place of Gauss-Seidel at n substeps",
            &xpbd(8, 1),
            &coarse(4),
        ),
        exchange(
            "method",
            "Doubling the steps of vbd with coarse correction from 4 to 8",
            &coarse(4),
            &coarse(8),
        ),
    ];
    if gpu {
        exchanges.push(exchange(
            "backend",
            "The GPU in place of a thread of the processor",
            &xpbd(8, 1),
            &on_gpu(8),
        ));
    }
    Settings { all, exchanges }
}

/// One substep of `iterations` iterations in double precision, to test the iteration alone.
pub(super) fn large_step(iterations: u32) -> SolverSpec {
    SolverSpec::of(Method::GaussSeidel).with(|spec| {
        spec.time_step = 1.0 / 60.0;
        spec.substeps = Substeps::Fixed(1);
        spec.iterations = iterations;
        spec.precision = Precision::F64;
    })
}

/// One large step of implicit Euler by VBD, each sweep with a coarse correction.
pub(super) fn large_vbd(iterations: u32) -> SolverSpec {
    large_step(iterations).with(|spec| {
        spec.method = Method::Vbd;
        spec.two_level = true;
        spec.integrator = Integrator::ImplicitEuler;
    })
}
