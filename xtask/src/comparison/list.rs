//! Other systems: the problem that each solves, and the command that runs it.

use incise::scene::Precision;

/// A system that is compared with this solver.
#[derive(Clone, Copy, Debug)]
pub(super) struct Peer {
    pub(super) id: &'static str,
    /// Solved problem.
    pub(super) what: &'static str,
    /// Difference from this solver's problem.
    pub(super) caveat: &'static str,
    /// Precision of the system; this solver is measured in it too.
    pub(super) precision: Precision,
    /// True if its first run compiles for minutes.
    pub(super) compiles: bool,
    pub(super) program: Program,
}

/// Way to run a system.
#[derive(Clone, Copy, Debug)]
pub(super) enum Program {
    /// A C++ source file, built and run.
    Cpp(&'static str),
    /// A Python script and the module it needs.
    Python {
        module: &'static str,
        script: &'static str,
        arguments: &'static [&'static str],
    },
}

const SCALAR: &str = "the block form of the same constraints, in clusters of one tet; its iteration is the pass alone and \
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
        caveat: "the same energy, in block form; each step looks for contacts of one vertex, which is in its frame, not in its \
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
        what: "vertex block descent, stable neo-Hookean (Newton on Warp)",
        caveat: "another method: a sweep solves each particle's 3 x 3 system, and visits each tet four times; the \
        gain of an iteration differs",
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
        caveat: "not Gauss-Seidel: corrections are averaged, and more iterations are needed; compare its tip with \
        those of the others",
        precision: Precision::F32,
        compiles: true,
        program: Program::Python {
            module: "newton",
            script: "bench_newton.py",
            arguments: &["--solver", "xpbd"],
        },
    },
];
