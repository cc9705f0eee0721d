//! Explanations of bodies that do not recover: sentences by extreme and method.
//!
//! The first match is used. Each explanation applies to some extremes, methods and verdicts, and states only known
//! facts; an outcome without a match is reported as a finding.

use super::methods::Method;
use super::outcome::{Outcome, Row, Verdict};

/// An explanation and its conditions.
pub(super) struct Explanation {
    /// Ids of extremes, or their beginnings up to a dash; an empty one matches all.
    extremes: &'static [&'static str],
    methods: &'static [Method],
    verdicts: &'static [Verdict],
    /// Lower limit of the substep's kappa.
    kappa: f64,
    pub(super) text: &'static str,
}

use Method::{Block, Chebyshev, Corrected, Defaults, Jacobi, Paper, Softened, Split, Vbd};
use Verdict::{Bent, Collapsed, FewInverted, Gains, Inverted, Off, Refused, Repaired};

/// One step of twenty iterations through constraints.
const STEP: &[Method] = &[Block, Paper, Jacobi, Chebyshev];
const EVERY: &[Method] = &Method::ALL;

const TABLE: &[Explanation] = &[
    Explanation {
        extremes: &["units-1e6"],
        methods: &[Defaults],
        verdicts: &[Refused],
        kappa: -1.0,
        text: "A scene's frame is at most 1,000 s; this one would be 16,667 s.",
    },
    Explanation {
        extremes: &["point-free", "speck-free"],
        methods: EVERY,
        verdicts: &[Collapsed],
        kappa: 0.0,
        text: "A free body on a point stays there, whatever the method: below `μ / (l γ)` of its size (9 % at Poisson's \
            ratio 0.45) it is in a second minimum of this energy, and on the point itself F = 0 gives no direction.",
    },
    Explanation {
        extremes: &["cut-fast-body"],
        methods: EVERY,
        verdicts: &[Collapsed, Inverted, FewInverted, Off, Gains],
        kappa: 0.0,
        text: "The blade cuts a strip off a body in free fall at up to 100 m/s²; slivers at the strip turn over, softened \
            to the limit of kappa, so that they do not accelerate the particles around them.",
    },
    Explanation {
        extremes: &["sliver"],
        methods: &[Defaults],
        verdicts: &[Gains],
        kappa: 1.0,
        text: "The energy is that of the sliver alone, which is too stiff for the substep and is solved less accurately \
            than the rest: a displacement far smaller than an edge is a large strain of so flat a tet. Kinetic and \
            gravitational energy are the same for slivers of 1e-6 and 1e-9, so the sliver does not move the body.",
    },
    Explanation {
        extremes: &["cut"],
        methods: &[Defaults, Split, Softened, Block, Jacobi, Chebyshev],
        verdicts: &[Inverted, FewInverted, Off],
        kappa: 1.0,
        text: "Random strokes without snapping leave slivers. In the columns of the block form they are softened to kappa \
            1, in the default and split columns they are solved less accurately: in all they can be turned over by their neighbors. \
            Snapping avoids most of them.",
    },
    Explanation {
        extremes: &["cut"],
        methods: &[Paper],
        verdicts: &[Collapsed, Inverted, FewInverted, Off, Gains],
        kappa: 1.0,
        text: "The paper's setting softens nothing, so slivers that cuts without snapping leave have a kappa far above 1 \
            and turn over.",
    },
    Explanation {
        extremes: &["cut"],
        methods: &[Vbd, Corrected],
        verdicts: &[Inverted, FewInverted, Off, Gains],
        kappa: 0.0,
        text: "Vbd does not soften slivers: those that were turned over by a stroke's step may stay so, in a local \
            minimum. In single precision, where the last digit of a position is more than the height of the thinnest, what \
            rounding leaves of their energy may grow without end, though not to infinity; in double precision the same \
            strokes leave a body in shape.",
    },
    Explanation {
        extremes: &[""],
        methods: STEP,
        verdicts: &[Collapsed, Inverted, FewInverted, Gains, Off, Bent, Repaired],
        kappa: 1.0,
        text: "Kappa of the frame is above 1, and a frame is one step. Iterations drive the constraints to zero and not \
            the equations of motion, of which XPBD drops a part: shear is explicit in all but name, so stiff bodies go \
            soft, ring or collapse (Jacobi and Chebyshev as well, at the relaxation at which they do not diverge). Take \
            substeps, or vbd.",
    },
    Explanation {
        extremes: &["size-1e-6"],
        methods: &[Vbd, Corrected],
        verdicts: &[Collapsed, Inverted, FewInverted, Gains, Off, Repaired],
        kappa: 1e12,
        text: "A body of a micrometer in a frame of 1/60 s has a kappa of 1e14 (size alone is not the cause: with \
        time in proportion the run is stable). Its particles' inertia is then below the last digit of the stiffness \
        around them, in \
            single precision by far, so where tets have become flat nothing but rounding says where a particle is. It \
            stays finite. Take a time step that fits the body.",
    },
    Explanation {
        extremes: &[
            "size-1e-6",
            "young-1e12",
            "young-1e9",
            "sliver",
            "mass-1e-6",
            "mass-1e-3",
        ],
        methods: &[Split, Softened],
        verdicts: &[Collapsed, Inverted, FewInverted, Gains, Off, Bent],
        kappa: 0.6,
        text: "More than 200 substeps would be needed. At 200 the split form is softer than its material, and so are the \
            tets that the other column softens to kappa 1, so the body deforms more.",
    },
    Explanation {
        extremes: &["poisson-0.49", "poisson-0.499", "poisson-0.4999"],
        methods: &[Split, Softened],
        verdicts: &[Gains, Off],
        kappa: 0.0,
        text: "Kappa is computed from E and ignores how stiff a nearly incompressible body is against changes of volume: its error \
            grows about as `l / μ`, and so does the energy in errors of volume that are not visible. Take a smaller kappa or \
            four iterations a substep.",
    },
    Explanation {
        extremes: &[
            "young-1e1",
            "young-1e3",
            "mass-1e3",
            "mass-1e6",
            "gravity",
            "size-1e6",
        ],
        methods: EVERY,
        verdicts: &[Off, FewInverted],
        kappa: 0.0,
        text: "The load is not small beside E: the body sags and stretches as it must, and its volume with it. Tets that \
            are still inverted are those at the held end, which carry all of it.",
    },
    Explanation {
        extremes: STATES,
        methods: &[Split, Softened],
        verdicts: &[FewInverted, Off, Bent],
        kappa: 0.0,
        text: "Not at rest yet: so violent a start leaves vibrations, which substeps keep, and this body has no damping. Of a \
            coarse body single tets beside the held end may be caught inverted.",
    },
    Explanation {
        extremes: STATES,
        methods: &[Vbd, Corrected],
        verdicts: &[Inverted, FewInverted, Off, Bent],
        kappa: 1.0,
        text: "From so violent a start the potential of a step has many minima: vbd goes to the next one, where single \
            tets may stay inverted, above all at the held end; and with 20 sweeps a frame corrections spread slowly, \
            so the body straightens slowly.",
    },
    Explanation {
        extremes: &[""],
        methods: &[Vbd],
        verdicts: &[Inverted, FewInverted, Off, Gains],
        kappa: 1.0,
        text: "20 sweeps are far from the solution of a step at this kappa. What they leave over is elastic energy that \
            was not put in, the more the stiffer the body, and now and then an inverted tet at the held end. More sweeps, a \
            relaxation of 1.9, or a coarse correction.",
    },
    Explanation {
        extremes: &["sliver", "young-1e12", "young-1e9"],
        methods: &[Corrected],
        verdicts: &[Inverted, FewInverted, Off, Gains],
        kappa: 1e4,
        text: "The last digit of a position in single precision, times such a stiffness, is an energy larger than that of \
            the load. Take double precision.",
    },
];

/// The extremes of state.
const STATES: &[&str] = &[
    "point",
    "speck",
    "plane",
    "line",
    "mirrored",
    "scrambled",
    "doubled",
    "stretched",
];

/// Explanation of an outcome that is not fine; `None` if it is fine or there is no explanation.
pub(super) fn explain(row: &Row, outcome: &Outcome) -> Option<&'static Explanation> {
    let verdict = outcome.verdict(row.is_state);
    TABLE.iter().find(|e| {
        e.extremes.iter().any(|start| begins(&row.id, start))
            && e.methods.contains(&outcome.column.method)
            && e.verdicts.contains(&verdict)
            && outcome.kappa > e.kappa
    })
}

/// True if an id is `start` or continues with a dash after it, so that `young-1e1` is not the start of `young-1e12`.
fn begins(id: &str, start: &str) -> bool {
    let rest = id.strip_prefix(start);
    rest.is_some_and(|rest| start.is_empty() || rest.is_empty() || rest.starts_with('-'))
}
