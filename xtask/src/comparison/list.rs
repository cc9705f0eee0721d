//! The other systems: what each solves, and how it is run.

use incise::scene::Precision;

/// A system that our solver is compared with.
#[derive(Clone, Copy, Debug)]
pub(super) struct Peer {
    pub(super) id: &'static str,
    /// What it solves.
    pub(super) what: &'static str,
    /// In what it is not the same as ours.
    pub(super) caveat: &'static str,
    /// Its own; ours is measured in the same.
    pub(super) precision: Precision,
    /// Whether its first run compiles for minutes.
    pub(super) compiles: bool,
    pub(super) program: Program,
}

/// How a system is run.
#[derive(Clone, Copy, Debug)]
pub(super) enum Program {
    /// A source file of this name, built and run.
    Cpp(&'static str),
    /// A script that needs a module.
    Python {
        module: &'static str,
        script: &'static str,
        arguments: &'static [&'static str],
    },
}

const SCALAR: &str = "the same constraints in the same form, in clusters of one tet; its iteration is the pass alone and \
    keeps multipliers, its frame is not measured";

pub(super) const PEERS: &[Peer] = &[
    Peer {
        id: "cpp-f32",
        what: "XPBD, stable neo-Hookean, block form; a scalar C++ kernel",
        caveat: SCALAR,
        precision: Precision::F32,
        compiles: false,
        program: Program::Cpp("ref_xpbd"),
    },
    Peer {
        id: "cpp-f64",
        what: "XPBD, stable neo-Hookean, block form; a scalar C++ kernel",
        caveat: SCALAR,
        precision: Precision::F64,
        compiles: false,
        program: Program::Cpp("ref_xpbd"),
    },
    Peer {
        id: "pbat",
        what: "XPBD, stable neo-Hookean, block form (pbatoolkit)",
        caveat: "the same energy and form; each step looks for contacts of one vertex, which is in its frame, not in its \
            iteration",
        precision: Precision::F64,
        compiles: false,
        program: Program::Python {
            module: "pbatoolkit",
            script: "bench_pbat_xpbd.py",
            arguments: &["--threads", "1", "--own-color"],
        },
    },
    Peer {
        id: "pbat-clustered",
        what: "the same in the clusters of the paper (pbatoolkit)",
        caveat: "as above; clusters by its own method, which also colors",
        precision: Precision::F64,
        compiles: false,
        program: Program::Python {
            module: "pbatoolkit",
            script: "bench_pbat_xpbd.py",
            arguments: &["--threads", "1", "--own-color", "--cluster"],
        },
    },
    Peer {
        id: "pypbd",
        what: "XPBD, St. Venant-Kirchhoff energy as one constraint a tet (pyPBD)",
        caveat: "another energy, one multiplier a tet instead of two; where its version takes no gravity from the \
            script, it moves by its own default",
        precision: Precision::F64,
        compiles: false,
        program: Program::Python {
            module: "pypbd",
            script: "bench_pypbd.py",
            arguments: &["--threads", "1"],
        },
    },
    Peer {
        id: "newton-vbd",
        what: "vertex block vbd, stable neo-Hookean (Newton on Warp)",
        caveat: "another method: a sweep solves each particle's 3 x 3 system, and visits each tet four times; what an \
            iteration is worth differs",
        precision: Precision::F32,
        compiles: true,
        program: Program::Python {
            module: "newton",
            script: "bench_newton.py",
            arguments: &["--solver", "vbd"],
        },
    },
    Peer {
        id: "newton-xpbd",
        what: "XPBD, Jacobi with atomic additions (Newton on Warp)",
        caveat: "not Gauss-Seidel: corrections are averaged, and more iterations are needed; watch whether its tip is \
            anywhere near the others'",
        precision: Precision::F32,
        compiles: true,
        program: Program::Python {
            module: "newton",
            script: "bench_newton.py",
            arguments: &["--solver", "xpbd"],
        },
    },
];
