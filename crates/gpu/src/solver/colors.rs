//! [`Colors`]: the dispatches of a pass over the tets.
//!
//! A color is a dispatch with a workgroup for each of its groups. Consecutive colors of a single group are one dispatch
//! of one workgroup, with a barrier between colors. The tail of a coloring consists of such colors, and so does all of
//! a small body. The lists leave every color room to grow, and only differences from the device's copy are sent.
//!
//! Cost: O(groups) on the host after a change, uploads in pieces of 256 bytes.

use incise_graph::Rows;

use crate::array::Array;
use crate::index::index;
use crate::kernel::{Recorder, STRIDE};
use crate::{GpuContext, GpuError};

use super::gpu_types::DispatchRange;
use super::kernels::BoundKernel;

/// Numbers compared and sent together.
const PIECE: usize = 64;

/// One dispatch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Run {
    /// The offset of its range in the buffer of ranges, in bytes.
    pub(crate) offset: u32,
    /// The number of workgroups of one color; 1 for several colors.
    pub(crate) groups: usize,
    /// True for several colors.
    pub(crate) tail: bool,
}

/// The dispatches of a pass.
#[derive(Debug)]
pub(crate) struct Colors {
    pub(crate) runs: Vec<Run>,
    /// The groups, color by color, then those of tails.
    pub(crate) lists: SyncedArray,
    /// The range of each dispatch, [`STRIDE`] bytes each.
    pub(crate) ranges: SyncedArray,
    /// Color -> capacity in the lists.
    rooms: Vec<usize>,
}

impl Colors {
    pub(crate) fn new(gpu: &GpuContext) -> Result<Self, GpuError> {
        let (storage, uniform) = (wgpu::BufferUsages::STORAGE, wgpu::BufferUsages::UNIFORM);
        Ok(Self {
            runs: Vec::new(),
            lists: SyncedArray::new(gpu, "lists of groups", storage)?,
            ranges: SyncedArray::new(gpu, "ranges of dispatches", uniform)?,
            rooms: Vec::new(),
        })
    }

    /// Applies the groups of all colors.
    pub(crate) fn sync(&mut self, gpu: &GpuContext, groups_of: &Rows<u32>) -> Result<(), GpuError> {
        let colors = groups_of.row_count();
        self.rooms.resize(colors, 0);
        let (mut lists, mut ranges) = (Vec::new(), Vec::new());
        self.runs.clear();
        let mut alone: Vec<u32> = Vec::new();
        let mut tails: Vec<(usize, Vec<u32>)> = Vec::new();
        for color in 0..colors {
            let groups = groups_of.row(color);
            if self.rooms[color] < groups.len() {
                self.rooms[color] = groups.len() + groups.len() / 2;
            }
            if groups.len() == 1 {
                alone.push(groups[0]);
            } else if !groups.is_empty() {
                self.close(&mut alone, &mut tails, &mut ranges);
                self.runs.push(Run {
                    offset: range(&mut ranges, lists.len(), groups.len()),
                    groups: groups.len(),
                    tail: false,
                });
            }
            let end = lists.len() + self.rooms[color];
            lists.extend_from_slice(groups);
            lists.resize(end, 0);
        }
        self.close(&mut alone, &mut tails, &mut ranges);
        for (at, groups) in tails {
            ranges[at] = index(lists.len());
            lists.extend(groups);
        }
        self.lists.set(gpu, lists)?;
        self.ranges.set(gpu, ranges)
    }

    /// Records a pass, with the kernel for one color and that for several.
    pub(crate) fn run(&self, pass: &mut Recorder<'_>, one: &BoundKernel, several: &BoundKernel) {
        for run in &self.runs {
            let solve = if run.tail { several } else { one };
            solve.run(pass, &[run.offset], run.groups);
        }
    }

    /// Ends a run of colors of one group each.
    fn close(
        &mut self,
        alone: &mut Vec<u32>,
        tails: &mut Vec<(usize, Vec<u32>)>,
        ranges: &mut Vec<u32>,
    ) {
        if alone.is_empty() {
            return;
        }
        let (at, groups) = (ranges.len(), std::mem::take(alone));
        self.runs.push(Run {
            offset: range(ranges, 0, groups.len()),
            groups: 1,
            tail: true,
        });
        tails.push((at, groups));
    }
}

/// Appends a range; returns its offset in bytes.
fn range(ranges: &mut Vec<u32>, first: usize, count: usize) -> u32 {
    let offset = index(ranges.len() * size_of::<u32>());
    let range = DispatchRange {
        first: index(first),
        count: index(count),
    };
    ranges.extend_from_slice(bytemuck::cast_slice(&[range]));
    ranges.resize((offset + STRIDE) as usize / size_of::<u32>(), 0);
    offset
}

/// Numbers on the device with a copy on the host, so that only differences are sent.
#[derive(Debug)]
pub(crate) struct SyncedArray {
    pub(crate) array: Array<u32>,
    host: Vec<u32>,
}

impl SyncedArray {
    pub(crate) fn new(
        gpu: &GpuContext,
        what: &'static str,
        usage: wgpu::BufferUsages,
    ) -> Result<Self, GpuError> {
        Ok(Self {
            array: Array::with_usage(gpu, what, 0, usage)?,
            host: Vec::new(),
        })
    }

    /// Replaces all values; pieces in a row that differ are sent together.
    pub(crate) fn set(&mut self, gpu: &GpuContext, values: Vec<u32>) -> Result<(), GpuError> {
        let known = self.host.len();
        self.array.resize(gpu, values.len())?;
        // The start of the pieces that differ and are not yet sent.
        let mut from = None;
        for start in (0..values.len()).step_by(PIECE) {
            let end = (start + PIECE).min(values.len());
            if end > known || self.host[start..end] != values[start..end] {
                from.get_or_insert(start);
            } else if let Some(from) = from.take() {
                self.array.write(gpu, from, &values[from..start]);
            }
        }
        if let Some(from) = from {
            self.array.write(gpu, from, &values[from..]);
        }
        self.host = values;
        Ok(())
    }
}
