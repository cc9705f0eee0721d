//! The kernels of the solver, and [`Variant`]: which of their branches are compiled.
//!
//! A scene without damping, without multipliers to keep, of one material, gets kernels that know nothing of them. A
//! kernel is compiled when the first step needs it.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;

use super::layout::Form;
use crate::kernel::{Kernel, Use};
use crate::{GpuContext, GpuError};

/// The text of a kernel and how it uses its buffers.
#[derive(Debug)]
pub(crate) struct Source {
    pub(crate) name: &'static str,
    pub(crate) parts: &'static [&'static str],
    uses: &'static [Use],
}

macro_rules! text {
    ($($name:literal),*) => {
        &[$(include_str!(concat!("../../shader/", $name, ".wgsl"))),*]
    };
}

/// Bytes of a part.
const PART: u64 = 8;

/// What kernels that solve tets use.
const TETS: &[Use] = &[
    Use::Uniform,
    Use::Part(PART),
    Use::Write,
    Use::Read,
    Use::Read,
    Use::Read,
    Use::Read,
    Use::Write,
    Use::Read,
    Use::Write,
];

/// The same with tiles to read instead of corrections to write.
const TILES: &[Use] = &[
    Use::Uniform,
    Use::Part(PART),
    Use::Write,
    Use::Read,
    Use::Read,
    Use::Read,
    Use::Read,
    Use::Write,
    Use::Read,
    Use::Read,
];

pub(crate) const PREDICT: Source = Source {
    name: "predict",
    parts: text!("common", "settings", "predict"),
    uses: &[Use::Uniform, Use::Write, Use::Write, Use::Write],
};

pub(crate) const UPDATE_VELOCITIES: Source = Source {
    name: "update_velocities",
    parts: text!("common", "settings", "update_velocities"),
    uses: &[Use::Uniform, Use::Write, Use::Read, Use::Write, Use::Write],
};

const SOLVE_THREADS: Source = Source {
    name: "solve_threads",
    parts: text!(
        "common",
        "settings",
        "tet",
        "tets",
        "group",
        "solve_threads"
    ),
    uses: TETS,
};

const SOLVE_THREADS_TAIL: Source = Source {
    name: "solve_threads_tail",
    parts: text!(
        "common",
        "settings",
        "tet",
        "tets",
        "group",
        "solve_threads_tail"
    ),
    uses: TETS,
};

const SOLVE_WORKGROUPS: Source = Source {
    name: "solve_workgroups",
    parts: text!(
        "common",
        "settings",
        "tet",
        "tets",
        "tile",
        "solve_workgroups"
    ),
    uses: TILES,
};

const SOLVE_WORKGROUPS_TAIL: Source = Source {
    name: "solve_workgroups_tail",
    parts: text!(
        "common",
        "settings",
        "tet",
        "tets",
        "tile",
        "solve_workgroups_tail"
    ),
    uses: TILES,
};

pub(crate) const PATCH_TETS: Source = Source {
    name: "patch_tets",
    parts: text!("common", "settings", "patch_tets"),
    uses: &[Use::Uniform, Use::Read, Use::Write, Use::Write, Use::Write],
};

pub(crate) const PATCH_PARTICLES: Source = Source {
    name: "patch_particles",
    parts: text!("common", "settings", "patch_particles"),
    uses: &[Use::Uniform, Use::Read, Use::Write, Use::Write],
};

pub(crate) const CLEAR_MULTIPLIERS: Source = Source {
    name: "clear_multipliers",
    parts: text!("common", "settings", "clear_multipliers"),
    uses: &[Use::Uniform, Use::Write],
};

/// The shaders of the solver.
pub(crate) const SOURCES: &[Source] = &[
    PREDICT,
    UPDATE_VELOCITIES,
    SOLVE_THREADS,
    SOLVE_THREADS_TAIL,
    SOLVE_WORKGROUPS,
    SOLVE_WORKGROUPS_TAIL,
    PATCH_TETS,
    PATCH_PARTICLES,
    CLEAR_MULTIPLIERS,
];

/// The kernel that solves colors, or a row of colors of one group each.
pub(crate) fn solve(form: Form, tail: bool) -> &'static Source {
    match (form, tail) {
        (Form::Threads, false) => &SOLVE_THREADS,
        (Form::Threads, true) => &SOLVE_THREADS_TAIL,
        (Form::Workgroups, false) => &SOLVE_WORKGROUPS,
        (Form::Workgroups, true) => &SOLVE_WORKGROUPS_TAIL,
    }
}

/// Which branches of a kernel are compiled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Variant {
    pub(crate) damped: bool,
    pub(crate) sequential: bool,
    pub(crate) keeps: bool,
    pub(crate) jacobi: bool,
    /// Whether tets have materials of their own.
    pub(crate) various: bool,
}

/// Compiled kernels.
#[derive(Debug, Default)]
pub(crate) struct Kernels {
    compiled: BTreeMap<(&'static str, Variant), Arc<Kernel>>,
}

impl Kernels {
    /// Compiles a kernel that has no branches to choose, unless it is compiled.
    pub(crate) fn plain(
        &mut self,
        gpu: &GpuContext,
        source: &Source,
    ) -> Result<Arc<Kernel>, GpuError> {
        self.get(gpu, source, Variant::default(), &[])
    }

    /// The same for one that patches tets.
    pub(crate) fn patching(
        &mut self,
        gpu: &GpuContext,
        source: &Source,
        various: bool,
    ) -> Result<Arc<Kernel>, GpuError> {
        let variant = Variant {
            various,
            ..Variant::default()
        };
        self.get(gpu, source, variant, &[("UNIFORM", flag(!various))])
    }

    /// The same for one that solves tets.
    pub(crate) fn solving(
        &mut self,
        gpu: &GpuContext,
        source: &Source,
        variant: Variant,
    ) -> Result<Arc<Kernel>, GpuError> {
        let mut constants = vec![
            ("DAMPED", flag(variant.damped)),
            ("SEQUENTIAL", flag(variant.sequential)),
            ("KEEPS", flag(variant.keeps)),
            ("UNIFORM", flag(!variant.various)),
        ];
        if source.uses == TETS {
            constants.push(("JACOBI", flag(variant.jacobi)));
        }
        self.get(gpu, source, variant, &constants)
    }

    fn get(
        &mut self,
        gpu: &GpuContext,
        source: &Source,
        variant: Variant,
        constants: &[(&str, f64)],
    ) -> Result<Arc<Kernel>, GpuError> {
        let kernel = match self.compiled.entry((source.name, variant)) {
            Entry::Occupied(kernel) => kernel.into_mut(),
            Entry::Vacant(place) => {
                let kernel = Kernel::new(gpu, source.name, source.parts, source.uses, constants)?;
                place.insert(Arc::new(kernel))
            }
        };
        Ok(Arc::clone(kernel))
    }
}

fn flag(on: bool) -> f64 {
    f64::from(u8::from(on))
}
