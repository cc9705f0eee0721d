//! The kernels of the solver, [`Variant`]: their compiled branches, and [`BoundKernel`]: a kernel with its buffers.
//!
//! Branches that a scene does not need (kept multipliers, several materials, damped constraints) are not compiled. A
//! kernel is compiled when a step first needs it.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;

use incise_xpbd::TetSolve;
use wgpu::{BindGroup, Buffer};

use super::layout::ClusterMapping;
use crate::kernel::{BindingKind, Kernel, Recorder};
use crate::{GpuContext, GpuError};

/// The kind of a scalar constraint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Distance,
    Volume,
}

/// The text of a kernel and the kinds of its bindings.
#[derive(Debug)]
pub(crate) struct Source {
    pub(crate) name: &'static str,
    pub(crate) parts: &'static [&'static str],
    pub(crate) uses: &'static [BindingKind],
    /// The overrides that it has.
    flags: &'static [Flag],
}

/// A constant fixed when a kernel is compiled: a branch or a size.
#[derive(Clone, Copy, Debug)]
enum Flag {
    Damped,
    TetSolve,
    Iterated,
    Keeps,
    Jacobi,
    Uniform,
    Tiled,
    TileTets,
}

macro_rules! text {
    ($($name:literal),*) => {
        &[$(include_str!(concat!("../../shader/", $name, ".wgsl"))),*]
    };
}

/// Bytes of a dispatch range and of an iteration uniform.
const DISPATCH_RANGE: u64 = 8;
const ITERATION_UNIFORM: u64 = 16;

/// Bindings of the kernels that solve tets in threads; the last one is the sums of Jacobi corrections.
const TETS: &[BindingKind] = &[
    BindingKind::Uniform,
    BindingKind::DynamicUniform(DISPATCH_RANGE),
    BindingKind::Read,
    BindingKind::Read,
    BindingKind::Read,
    BindingKind::Read,
    BindingKind::Write,
    BindingKind::Write,
    BindingKind::Write,
];

/// Bindings of the kernels that solve tets in workgroups; the last one is the tiles.
const TILES: &[BindingKind] = &[
    BindingKind::Uniform,
    BindingKind::DynamicUniform(DISPATCH_RANGE),
    BindingKind::Read,
    BindingKind::Read,
    BindingKind::Read,
    BindingKind::Read,
    BindingKind::Write,
    BindingKind::Write,
    BindingKind::Read,
];

/// Bindings of the kernels that damp tets in threads.
const DAMPED_TETS: &[BindingKind] = &[
    BindingKind::Uniform,
    BindingKind::DynamicUniform(DISPATCH_RANGE),
    BindingKind::Read,
    BindingKind::Read,
    BindingKind::Read,
    BindingKind::Read,
    BindingKind::Read,
    BindingKind::Write,
];

/// Bindings of the kernels that damp tets in workgroups; the last one is the tiles.
const DAMPED_TILES: &[BindingKind] = &[
    BindingKind::Uniform,
    BindingKind::DynamicUniform(DISPATCH_RANGE),
    BindingKind::Read,
    BindingKind::Read,
    BindingKind::Read,
    BindingKind::Read,
    BindingKind::Read,
    BindingKind::Write,
    BindingKind::Read,
];

const TETS_FLAGS: &[Flag] = &[
    Flag::TetSolve,
    Flag::Iterated,
    Flag::Keeps,
    Flag::Uniform,
    Flag::Jacobi,
];

const TILES_FLAGS: &[Flag] = &[
    Flag::TetSolve,
    Flag::Iterated,
    Flag::Keeps,
    Flag::Uniform,
    Flag::TileTets,
];

pub(crate) const PREDICT: Source = Source {
    name: "predict",
    parts: text!("common", "settings", "predict"),
    uses: &[
        BindingKind::Uniform,
        BindingKind::Write,
        BindingKind::Write,
        BindingKind::Write,
    ],
    flags: &[],
};

pub(crate) const UPDATE_VELOCITIES: Source = Source {
    name: "update_velocities",
    parts: text!("common", "settings", "update_velocities"),
    uses: &[
        BindingKind::Uniform,
        BindingKind::Write,
        BindingKind::Read,
        BindingKind::Write,
        BindingKind::Write,
    ],
    flags: &[],
};

const SOLVE_THREADS: Source = Source {
    name: "solve_threads",
    parts: text!(
        "common",
        "settings",
        "tet",
        "tets",
        "tet_solve",
        "group",
        "solve_threads"
    ),
    uses: TETS,
    flags: TETS_FLAGS,
};

const SOLVE_THREADS_TAIL: Source = Source {
    name: "solve_threads_tail",
    parts: text!(
        "common",
        "settings",
        "tet",
        "tets",
        "tet_solve",
        "group",
        "solve_threads_tail"
    ),
    uses: TETS,
    flags: TETS_FLAGS,
};

const SOLVE_WORKGROUPS: Source = Source {
    name: "solve_workgroups",
    parts: text!(
        "common",
        "settings",
        "tet",
        "tets",
        "tiles",
        "tet_solve",
        "tile",
        "solve_workgroups"
    ),
    uses: TILES,
    flags: TILES_FLAGS,
};

const SOLVE_WORKGROUPS_TAIL: Source = Source {
    name: "solve_workgroups_tail",
    parts: text!(
        "common",
        "settings",
        "tet",
        "tets",
        "tiles",
        "tet_solve",
        "tile",
        "solve_workgroups_tail"
    ),
    uses: TILES,
    flags: TILES_FLAGS,
};

const DAMP_THREADS: Source = Source {
    name: "damp_threads",
    parts: text!(
        "common",
        "settings",
        "tet",
        "tets",
        "tet_damping",
        "damp_group",
        "solve_threads"
    ),
    uses: DAMPED_TETS,
    flags: &[Flag::Uniform],
};

const DAMP_THREADS_TAIL: Source = Source {
    name: "damp_threads_tail",
    parts: text!(
        "common",
        "settings",
        "tet",
        "tets",
        "tet_damping",
        "damp_group",
        "solve_threads_tail"
    ),
    uses: DAMPED_TETS,
    flags: &[Flag::Uniform],
};

const DAMP_WORKGROUPS: Source = Source {
    name: "damp_workgroups",
    parts: text!(
        "common",
        "settings",
        "tet",
        "tets",
        "tiles",
        "tet_damping",
        "damp_tile",
        "solve_workgroups"
    ),
    uses: DAMPED_TILES,
    flags: &[Flag::Uniform, Flag::TileTets],
};

const DAMP_WORKGROUPS_TAIL: Source = Source {
    name: "damp_workgroups_tail",
    parts: text!(
        "common",
        "settings",
        "tet",
        "tets",
        "tiles",
        "tet_damping",
        "damp_tile",
        "solve_workgroups_tail"
    ),
    uses: DAMPED_TILES,
    flags: &[Flag::Uniform, Flag::TileTets],
};

pub(crate) const PATCH_TETS: Source = Source {
    name: "patch_tets",
    parts: text!("common", "settings", "patch_tets"),
    uses: &[
        BindingKind::Uniform,
        BindingKind::Read,
        BindingKind::Write,
        BindingKind::Write,
        BindingKind::Write,
    ],
    flags: &[Flag::Uniform],
};

pub(crate) const PATCH_PARTICLES: Source = Source {
    name: "patch_particles",
    parts: text!("common", "settings", "patch_particles"),
    uses: &[
        BindingKind::Uniform,
        BindingKind::Read,
        BindingKind::Write,
        BindingKind::Write,
    ],
    flags: &[],
};

pub(crate) const CLEAR: Source = Source {
    name: "clear",
    parts: text!("common", "clear"),
    uses: &[BindingKind::Write],
    flags: &[],
};

pub(crate) const PROJECT_TO_COLLIDERS: Source = Source {
    name: "project_to_colliders",
    parts: text!(
        "common",
        "settings",
        "iteration",
        "direction",
        "project_to_colliders"
    ),
    uses: &[
        BindingKind::Uniform,
        BindingKind::DynamicUniform(ITERATION_UNIFORM),
        BindingKind::Write,
        BindingKind::Read,
        BindingKind::Read,
    ],
    flags: &[],
};

pub(crate) const MOVE_RIGID_ATTACHMENTS: Source = Source {
    name: "move_rigid_attachments",
    parts: text!(
        "common",
        "settings",
        "iteration",
        "attachments",
        "move_rigid_attachments"
    ),
    uses: &[
        BindingKind::Uniform,
        BindingKind::DynamicUniform(ITERATION_UNIFORM),
        BindingKind::Write,
        BindingKind::Read,
        BindingKind::Read,
        BindingKind::Write,
    ],
    flags: &[],
};

pub(crate) const SOLVE_ATTACHMENTS: Source = Source {
    name: "solve_attachments",
    parts: text!(
        "common",
        "settings",
        "iteration",
        "attachments",
        "solve_attachments"
    ),
    uses: &[
        BindingKind::Uniform,
        BindingKind::DynamicUniform(ITERATION_UNIFORM),
        BindingKind::Write,
        BindingKind::Read,
        BindingKind::Read,
        BindingKind::Read,
        BindingKind::Write,
    ],
    flags: &[Flag::Keeps],
};

pub(crate) const UPDATE_RIGID_ATTACHMENTS: Source = Source {
    name: "update_rigid_attachments",
    parts: text!(
        "common",
        "settings",
        "attachments",
        "update_rigid_attachments"
    ),
    uses: &[
        BindingKind::Uniform,
        BindingKind::Read,
        BindingKind::Read,
        BindingKind::Write,
        BindingKind::Read,
    ],
    flags: &[],
};

pub(crate) const APPLY_CORRECTIONS: Source = Source {
    name: "apply_corrections",
    parts: text!("common", "settings", "iteration", "apply_corrections"),
    uses: &[
        BindingKind::Uniform,
        BindingKind::DynamicUniform(ITERATION_UNIFORM),
        BindingKind::Write,
        BindingKind::Write,
        BindingKind::Write,
    ],
    flags: &[Flag::Keeps],
};

pub(crate) const EXTRAPOLATE_MULTIPLIERS: Source = Source {
    name: "extrapolate_multipliers",
    parts: text!("common", "iteration", "extrapolate_multipliers"),
    uses: &[
        BindingKind::Write,
        BindingKind::DynamicUniform(ITERATION_UNIFORM),
        BindingKind::Write,
    ],
    flags: &[],
};

pub(crate) const MEASURE_TETS: Source = Source {
    name: "measure_tets",
    parts: text!("common", "settings", "measure_tets"),
    uses: &[
        BindingKind::Uniform,
        BindingKind::Uniform,
        BindingKind::Read,
        BindingKind::Read,
        BindingKind::Read,
        BindingKind::Read,
        BindingKind::Read,
        BindingKind::Write,
    ],
    flags: &[Flag::Uniform, Flag::Tiled, Flag::TileTets],
};

pub(crate) const MEASURE_PARTICLES: Source = Source {
    name: "measure_particles",
    parts: text!("common", "settings", "measure_particles"),
    uses: &[
        BindingKind::Uniform,
        BindingKind::Read,
        BindingKind::Read,
        BindingKind::Read,
        BindingKind::Write,
    ],
    flags: &[],
};

/// Bindings of the kernels that solve scalar constraints.
const SCALARS: &[BindingKind] = &[
    BindingKind::Uniform,
    BindingKind::DynamicUniform(DISPATCH_RANGE),
    BindingKind::Write,
    BindingKind::Read,
    BindingKind::Read,
    BindingKind::Read,
    BindingKind::Read,
    BindingKind::Write,
    BindingKind::Read,
];

const SOLVE_DISTANCES: Source = Source {
    name: "solve_distances",
    parts: text!(
        "common",
        "settings",
        "direction",
        "scalar",
        "distance",
        "solve_threads"
    ),
    uses: SCALARS,
    flags: &[Flag::Damped, Flag::Keeps],
};

const SOLVE_DISTANCES_TAIL: Source = Source {
    name: "solve_distances_tail",
    parts: text!(
        "common",
        "settings",
        "direction",
        "scalar",
        "distance",
        "solve_threads_tail"
    ),
    uses: SCALARS,
    flags: &[Flag::Damped, Flag::Keeps],
};

const SOLVE_VOLUMES: Source = Source {
    name: "solve_volumes",
    parts: text!("common", "settings", "scalar", "volume", "solve_threads"),
    uses: SCALARS,
    flags: &[Flag::Damped, Flag::Keeps],
};

const SOLVE_VOLUMES_TAIL: Source = Source {
    name: "solve_volumes_tail",
    parts: text!(
        "common",
        "settings",
        "scalar",
        "volume",
        "solve_threads_tail"
    ),
    uses: SCALARS,
    flags: &[Flag::Damped, Flag::Keeps],
};

/// Bindings of the kernels that solve contacts.
const CONTACTS: &[BindingKind] = &[
    BindingKind::Uniform,
    BindingKind::DynamicUniform(DISPATCH_RANGE),
    BindingKind::Write,
    BindingKind::Read,
    BindingKind::Read,
    BindingKind::Read,
    BindingKind::Uniform,
    BindingKind::Write,
    BindingKind::Write,
    BindingKind::Read,
];

pub(crate) const SOLVE_CONTACTS: Source = Source {
    name: "solve_contacts",
    parts: text!(
        "common",
        "settings",
        "direction",
        "contact",
        "solve_threads"
    ),
    uses: CONTACTS,
    flags: &[Flag::Keeps],
};

pub(crate) const SOLVE_CONTACTS_TAIL: Source = Source {
    name: "solve_contacts_tail",
    parts: text!(
        "common",
        "settings",
        "direction",
        "contact",
        "solve_threads_tail"
    ),
    uses: CONTACTS,
    flags: &[Flag::Keeps],
};

/// The shaders of the solver.
pub(crate) const SOURCES: &[Source] = &[
    PREDICT,
    UPDATE_VELOCITIES,
    SOLVE_THREADS,
    SOLVE_THREADS_TAIL,
    SOLVE_WORKGROUPS,
    SOLVE_WORKGROUPS_TAIL,
    DAMP_THREADS,
    DAMP_THREADS_TAIL,
    DAMP_WORKGROUPS,
    DAMP_WORKGROUPS_TAIL,
    PATCH_TETS,
    PATCH_PARTICLES,
    CLEAR,
    PROJECT_TO_COLLIDERS,
    MOVE_RIGID_ATTACHMENTS,
    SOLVE_ATTACHMENTS,
    UPDATE_RIGID_ATTACHMENTS,
    SOLVE_DISTANCES,
    SOLVE_DISTANCES_TAIL,
    SOLVE_VOLUMES,
    SOLVE_VOLUMES_TAIL,
    SOLVE_CONTACTS,
    SOLVE_CONTACTS_TAIL,
    APPLY_CORRECTIONS,
    EXTRAPOLATE_MULTIPLIERS,
    MEASURE_TETS,
    MEASURE_PARTICLES,
];

/// The kernels that solve one color of tets, and several colors of one group each.
pub(crate) fn solve_tets(mapping: ClusterMapping) -> [&'static Source; 2] {
    match mapping {
        ClusterMapping::Threads => [&SOLVE_THREADS, &SOLVE_THREADS_TAIL],
        ClusterMapping::Workgroups => [&SOLVE_WORKGROUPS, &SOLVE_WORKGROUPS_TAIL],
    }
}

/// The kernels that damp one color of tets, and several colors of one group each.
pub(crate) fn damp_tets(mapping: ClusterMapping) -> [&'static Source; 2] {
    match mapping {
        ClusterMapping::Threads => [&DAMP_THREADS, &DAMP_THREADS_TAIL],
        ClusterMapping::Workgroups => [&DAMP_WORKGROUPS, &DAMP_WORKGROUPS_TAIL],
    }
}

/// The kernels that solve one color of scalar constraints, and several small colors.
pub(crate) fn solve_scalars(kind: Kind) -> [&'static Source; 2] {
    match kind {
        Kind::Distance => [&SOLVE_DISTANCES, &SOLVE_DISTANCES_TAIL],
        Kind::Volume => [&SOLVE_VOLUMES, &SOLVE_VOLUMES_TAIL],
    }
}

/// The branches of a kernel to compile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Variant {
    /// True if scalar constraints are damped.
    pub(crate) damped: bool,
    /// A constant of `tet_solve.wgsl`; see [`Variant::with_tet_solve`].
    pub(crate) tet_solve: u32,
    /// True if the split form accumulates multipliers.
    pub(crate) iterated: bool,
    pub(crate) keeps: bool,
    pub(crate) jacobi: bool,
    /// True if the tets have several materials.
    pub(crate) various: bool,
    /// Tets of a tile; 0 if corners are not numbered within tiles.
    pub(crate) tile: u32,
}

impl Variant {
    /// Selects the form of solving a tet. `iterated` says that a substep has several iterations.
    pub(crate) fn with_tet_solve(self, form: TetSolve, iterated: bool) -> Self {
        let tet_solve = match form {
            TetSolve::Split => 0,
            TetSolve::Block => 1,
            TetSolve::Sequential => 2,
        };
        Self {
            tet_solve,
            // The other forms have one kernel for both.
            iterated: iterated && form == TetSolve::Split,
            ..self
        }
    }

    /// Name and value of the override of a flag.
    fn value(self, flag: Flag) -> (&'static str, f64) {
        let (name, on) = match flag {
            Flag::Damped => ("DAMPED", self.damped),
            Flag::TetSolve => return ("TET_SOLVE", f64::from(self.tet_solve)),
            Flag::Iterated => ("ITERATED", self.iterated),
            Flag::Keeps => ("KEEPS", self.keeps),
            Flag::Jacobi => ("JACOBI", self.jacobi),
            Flag::Uniform => ("UNIFORM", !self.various),
            Flag::Tiled => ("TILED", self.tile > 0),
            // Never 0: a compiler must not divide by 0, even in code that does not run.
            Flag::TileTets => return ("TILE_TETS", f64::from(self.tile.max(1))),
        };
        (name, f64::from(u8::from(on)))
    }
}

/// Compiled kernels.
#[derive(Debug, Default)]
pub(crate) struct Kernels {
    compiled: BTreeMap<(&'static str, Variant), Arc<Kernel>>,
}

impl Kernels {
    /// Returns a kernel, compiled at the first call.
    pub(crate) fn get(
        &mut self,
        gpu: &GpuContext,
        source: &Source,
        variant: Variant,
    ) -> Result<Arc<Kernel>, GpuError> {
        let kernel = match self.compiled.entry((source.name, variant)) {
            Entry::Occupied(kernel) => kernel.into_mut(),
            Entry::Vacant(tet_slot) => {
                let constants: Vec<_> = source.flags.iter().map(|f| variant.value(*f)).collect();
                let (name, parts, uses) = (source.name, source.parts, source.uses);
                tet_slot.insert(Arc::new(Kernel::new(gpu, name, parts, uses, &constants)?))
            }
        };
        Ok(Arc::clone(kernel))
    }

    /// Binds a kernel, compiled at the first call.
    pub(crate) fn bind(
        &mut self,
        gpu: &GpuContext,
        source: &Source,
        variant: Variant,
        buffers: &[&Buffer],
    ) -> Result<BoundKernel, GpuError> {
        let kernel = self.get(gpu, source, variant)?;
        let group = kernel.bind(gpu, buffers);
        Ok(BoundKernel { kernel, group })
    }
}

/// A kernel with its buffers.
#[derive(Debug)]
pub(crate) struct BoundKernel {
    kernel: Arc<Kernel>,
    group: BindGroup,
}

impl BoundKernel {
    pub(crate) fn run(&self, pass: &mut Recorder<'_>, offsets: &[u32], groups: usize) {
        pass.dispatch(&self.kernel, &self.group, offsets, groups);
    }
}
