//! [`ColoringKernels`]: compiled kernels and work arrays kept between colorings, and the list of all coloring shaders.
//!
//! Compiling a shader is slow in most drivers, so a kernel is compiled once, when it is first needed. Work arrays grow
//! to the size of the largest graph and are kept.

use std::collections::BTreeMap;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use wgpu::{BindGroup, Buffer, BufferUsages};

use crate::array::Array;
use crate::kernel::{BindingKind, Kernel};
use crate::{GpuContext, GpuError};

/// `Round` in the shaders.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct Round {
    pub(crate) vertices: u32,
    pub(crate) parity: u32,
}

/// The binding of a [`Round`] uniform.
const PART: BindingKind = BindingKind::DynamicUniform(size_of::<Round>() as u64);

/// The text of a kernel and the kinds of its bindings.
#[derive(Debug)]
pub(crate) struct Source {
    pub(crate) name: &'static str,
    pub(crate) parts: &'static [&'static str],
    uses: &'static [BindingKind],
}

/// Compiled kernels and work arrays of all colorings, for one device.
///
/// Keep it as long as the device: the first coloring with an algorithm compiles its kernels, later ones reuse them. The
/// arrays are as large as the largest input so far needs: for [`scgc`](super::scgc()) 24 bytes per vertex and a little
/// more than 8 per edge, for all algorithms together about 70 bytes per vertex.
#[derive(Debug, Default)]
pub struct ColoringKernels {
    compiled: BTreeMap<&'static str, Arc<Kernel>>,
    arrays: BTreeMap<&'static str, Array<u32>>,
}

/// A kernel with its buffers.
#[derive(Debug)]
pub(super) struct BoundKernel {
    pub(super) kernel: Arc<Kernel>,
    pub(super) group: BindGroup,
}

impl ColoringKernels {
    /// Binds the kernel of a source to its buffers, and compiles it first if necessary.
    pub(super) fn bind(
        &mut self,
        gpu: &GpuContext,
        source: &Source,
        buffers: &[&Buffer],
    ) -> Result<BoundKernel, GpuError> {
        let kernel = match self.compiled.get(source.name) {
            Some(kernel) => Arc::clone(kernel),
            None => {
                let kernel = Kernel::new(gpu, source.name, source.parts, source.uses, &[])?;
                let kernel = Arc::new(kernel);
                self.compiled.insert(source.name, Arc::clone(&kernel));
                kernel
            }
        };
        let group = kernel.bind(gpu, buffers);
        Ok(BoundKernel { kernel, group })
    }

    /// The work array `what` for storage, with room for at least `len` numbers of undefined values.
    pub(super) fn array(
        &mut self,
        gpu: &GpuContext,
        what: &'static str,
        len: usize,
    ) -> Result<Buffer, GpuError> {
        self.array_for(gpu, what, len, BufferUsages::STORAGE)
    }

    /// The work array `what` for `usage`, with room for at least `len` numbers of undefined values.
    pub(super) fn array_for(
        &mut self,
        gpu: &GpuContext,
        what: &'static str,
        len: usize,
        usage: BufferUsages,
    ) -> Result<Buffer, GpuError> {
        if let Some(array) = self.arrays.get_mut(what) {
            if array.len() < len {
                array.resize(gpu, len)?;
            }
            return Ok(array.buffer().clone());
        }
        let array = Array::with_usage(gpu, what, len, usage)?;
        let buffer = array.buffer().clone();
        self.arrays.insert(what, array);
        Ok(buffer)
    }

    /// Waits for the device and reads the first numbers of a work array.
    pub(super) fn read(
        &self,
        gpu: &GpuContext,
        what: &'static str,
        len: usize,
    ) -> Result<Vec<u32>, GpuError> {
        self.arrays[what].read_first(gpu, len)
    }

    /// Writes the first numbers of a work array.
    pub(super) fn write(&self, gpu: &GpuContext, what: &'static str, values: &[u32]) {
        self.arrays[what].write(gpu, 0, values);
    }
}

macro_rules! text {
    ($name:literal) => {
        include_str!(concat!("../../shader/", $name, ".wgsl"))
    };
}

/// A kernel: its name, the shared parts in front of its own text, and the kinds of its bindings.
macro_rules! source {
    ($constant:ident, $name:literal, [$($part:literal),*], [$($usage:expr),*]) => {
        pub(super) const $constant: Source = Source {
            name: $name,
            parts: &[$(text!($part),)* text!($name)],
            uses: &[$($usage),*],
        };
    };
}

use BindingKind::{Read, Uniform, Write};

source!(
    NEXT,
    "next",
    ["common", "grid", "round", "worklist"],
    [PART, Write, Write]
);
source!(
    ALL,
    "all",
    ["common", "round", "worklist"],
    [PART, Write, Write]
);
source!(
    JONES_PLASSMANN,
    "jones_plassmann",
    ["common", "round", "worklist", "priority", "first_fit"],
    [PART, Write, Read, Read, Write, Write]
);
source!(
    HIGHER,
    "higher",
    [
        "common", "round", "worklist", "priority", "search", "palettes"
    ],
    [PART, Write, Read, Read, Write, Write, Write]
);
source!(
    SCGC,
    "scgc",
    ["common", "round", "worklist", "search", "palettes"],
    [PART, Write, Read, Read, Write, Write, Write, Write]
);
source!(
    ECL_GC_LARGE_START,
    "ecl_gc_large_start",
    ["common", "round", "worklist"],
    [PART, Write, Read, Write]
);
source!(
    ECL_GC_LARGE,
    "ecl_gc_large",
    ["common", "round", "worklist", "search", "palettes"],
    [PART, Write, Read, Read, Read, Write, Write]
);
source!(
    ECL_GC_SMALL_START,
    "ecl_gc_small_start",
    ["common", "round", "worklist", "search"],
    [PART, Write, Read, Read, Read, Write, Write]
);
source!(
    ECL_GC_SMALL,
    "ecl_gc_small",
    ["common", "round", "worklist"],
    [PART, Write, Read, Read, Write, Write, Write]
);
source!(
    VIVACE_START,
    "vivace_start",
    ["common", "round", "worklist", "vivace_options", "palettes"],
    [PART, Write, Uniform, Read, Write, Write]
);
source!(
    VIVACE_PICK,
    "vivace_pick",
    [
        "common",
        "round",
        "worklist",
        "vivace_options",
        "palettes",
        "random"
    ],
    [PART, Write, Uniform, Read, Write, Write]
);
source!(
    VIVACE_KEEP,
    "vivace_keep",
    ["common", "round", "worklist", "vivace_options"],
    [PART, Write, Uniform, Read, Read, Read, Write]
);
source!(
    VIVACE_RENEW,
    "vivace_renew",
    [
        "common",
        "round",
        "worklist",
        "vivace_options",
        "palettes",
        "first_fit"
    ],
    [PART, Write, Read, Read, Read, Read, Write]
);
source!(
    WLC_START,
    "wlc_start",
    ["common", "grid", "round", "wlc_work"],
    [PART, Write, Uniform, Write, Write, Write]
);
source!(
    WLC_CHOOSE,
    "wlc_choose",
    ["common", "round", "wlc_work", "first_fit"],
    [PART, Read, Read, Read, Write, Read]
);
source!(
    WLC_LOSE,
    "wlc_lose",
    ["common", "round", "wlc_work"],
    [PART, Read, Read, Read, Read, Write]
);
source!(
    WLC_GATHER,
    "wlc_gather",
    ["common", "grid", "round", "wlc_work"],
    [PART, Write, Write, Read, Write, Write]
);
source!(
    LABELS_MARK,
    "labels_mark",
    ["common", "round", "labels"],
    [PART, Write, Read]
);
source!(
    LABELS_NUMBER,
    "labels_number",
    ["common", "round", "labels"],
    [PART, Write]
);
source!(
    LABELS_RENAME,
    "labels_rename",
    ["common", "round", "labels"],
    [PART, Write, Write]
);
source!(
    INCIDENCE_DEGREES,
    "incidence_degrees",
    ["common", "round", "worklist", "incidence"],
    [PART, Write, Read, Read, Write]
);
source!(
    SCGC_INCIDENCE,
    "scgc_incidence",
    [
        "common",
        "round",
        "worklist",
        "priority",
        "incidence",
        "waits"
    ],
    [PART, Write, Read, Read, Read, Write, Write, Write]
);
source!(
    SCGC_INCIDENCE_WINDOW,
    "scgc_incidence_window",
    ["common", "round", "worklist", "waits"],
    [PART, Write, Read, Write]
);

/// All coloring kernels.
pub(crate) const SOURCES: &[Source] = &[
    NEXT,
    ALL,
    JONES_PLASSMANN,
    HIGHER,
    SCGC,
    ECL_GC_LARGE_START,
    ECL_GC_LARGE,
    ECL_GC_SMALL_START,
    ECL_GC_SMALL,
    VIVACE_START,
    VIVACE_PICK,
    VIVACE_KEEP,
    VIVACE_RENEW,
    WLC_START,
    WLC_CHOOSE,
    WLC_LOSE,
    WLC_GATHER,
    LABELS_MARK,
    LABELS_NUMBER,
    LABELS_RENAME,
    INCIDENCE_DEGREES,
    SCGC_INCIDENCE,
    SCGC_INCIDENCE_WINDOW,
];
