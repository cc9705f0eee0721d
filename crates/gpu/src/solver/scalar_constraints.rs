//! [`ScalarConstraints`]: distance or volume constraints on the device.
//!
//! Constraints are stored in solving order. As with tets, 64 clusters of a color are a group, with one dispatch for
//! each color and one for several small colors. Any change sends all of them again. Twin: `constraints/scalar.rs` of
//! incise-xpbd. Cost: 32 bytes per constraint and 8 per cluster.

use incise_graph::{Rows, Schedule};
use incise_xpbd::Solver;
use wgpu::Buffer;

use super::colors::Colors;
use super::kernels::{BoundKernel, CLEAR, Kernels, Kind, Variant, solve_scalars};
use super::layout::THREADS;
use crate::array::Array;
use crate::index::index;
use crate::kernel::Recorder;
use crate::{GpuContext, GpuError};

/// All constraints of a kind.
#[derive(Debug)]
pub(crate) struct ScalarConstraints {
    kind: Kind,
    damped: bool,
    corners: Array<[u32; 4]>,
    numbers: Array<[f32; 4]>,
    /// The constraints of each cluster: start and end of its range.
    ranges: Array<[u32; 2]>,
    colors: Colors,
    /// Multipliers; empty with one iteration.
    multipliers: Array<f32>,
}

impl ScalarConstraints {
    fn new(gpu: &GpuContext, kind: Kind) -> Result<Self, GpuError> {
        Ok(Self {
            kind,
            damped: false,
            corners: Array::zeros(gpu, "particles of constraints", 0)?,
            numbers: Array::zeros(gpu, "constraints", 0)?,
            ranges: Array::zeros(gpu, "clusters of constraints", 0)?,
            colors: Colors::new(gpu)?,
            multipliers: Array::zeros(gpu, "multipliers of constraints", 0)?,
        })
    }

    /// Applies changes of the constraints of a kind; without constraints no memory is kept.
    pub(crate) fn sync(
        this: &mut Option<Self>,
        gpu: &GpuContext,
        solver: &Solver<f32>,
        kind: Kind,
    ) -> Result<(), GpuError> {
        let schedule = match kind {
            Kind::Distance => solver.distance_schedule(),
            Kind::Volume => solver.volume_schedule(),
        };
        let Some(schedule) = schedule else {
            *this = None;
            return Ok(());
        };
        let scalars = match this {
            Some(scalars) => scalars,
            None => this.insert(Self::new(gpu, kind)?),
        };
        scalars.send(gpu, solver, schedule)
    }

    fn send(
        &mut self,
        gpu: &GpuContext,
        solver: &Solver<f32>,
        schedule: &Schedule,
    ) -> Result<(), GpuError> {
        let constraints = schedule.constraint_count();
        let mut corners = Vec::with_capacity(constraints);
        let mut numbers = Vec::with_capacity(constraints);
        let (mut ranges, mut groups) = (Vec::new(), Vec::new());
        for color in 0..schedule.color_count() {
            for clusters in schedule.clusters(color).chunks(THREADS) {
                groups.push((color, index(ranges.len() / THREADS)));
                for &cluster in clusters {
                    let first = index(corners.len());
                    for &constraint in schedule.constraints(cluster) {
                        let (particles, values) = self.kind.data(solver, constraint);
                        corners.push(particles);
                        numbers.push(values);
                    }
                    ranges.push([first, index(corners.len())]);
                }
                ranges.resize(ranges.len().next_multiple_of(THREADS), [0; 2]);
            }
        }
        self.damped = numbers.iter().any(|&[_, _, damping, _]| damping > 0.0);
        self.corners.replace(gpu, &corners)?;
        self.numbers.replace(gpu, &numbers)?;
        self.ranges.replace(gpu, &ranges)?;
        let mut rows = Rows::default();
        rows.refill(schedule.color_count(), groups.into_iter());
        self.colors.sync(gpu, &rows)
    }

    /// Allocates multipliers.
    pub(crate) fn keep_multipliers(&mut self, gpu: &GpuContext) -> Result<(), GpuError> {
        self.multipliers.resize(gpu, self.corners.len())
    }

    pub(crate) fn bind<'a>(
        &'a self,
        gpu: &GpuContext,
        kernels: &mut Kernels,
        [settings, particles, previous]: [&Buffer; 3],
        keeps: bool,
    ) -> Result<ScalarKernels<'a>, GpuError> {
        let variant = Variant {
            damped: self.damped,
            keeps,
            ..Variant::default()
        };
        let buffers = [
            settings,
            self.colors.ranges.array.buffer(),
            particles,
            previous,
            self.corners.buffer(),
            self.numbers.buffer(),
            self.ranges.buffer(),
            self.multipliers.buffer(),
            self.colors.lists.array.buffer(),
        ];
        let [one, several] = solve_scalars(self.kind);
        Ok(ScalarKernels {
            colors: &self.colors,
            one: kernels.bind(gpu, one, variant, &buffers)?,
            several: kernels.bind(gpu, several, variant, &buffers)?,
            clear: match keeps {
                true => {
                    let buffers = [self.multipliers.buffer()];
                    let clear = kernels.bind(gpu, &CLEAR, Variant::default(), &buffers)?;
                    Some((clear, self.multipliers.len().div_ceil(THREADS)))
                }
                false => None,
            },
        })
    }

    /// Bytes on the device.
    pub(crate) fn bytes(&self) -> u64 {
        let buffers = [
            self.corners.buffer(),
            self.numbers.buffer(),
            self.ranges.buffer(),
            self.multipliers.buffer(),
            self.colors.lists.array.buffer(),
            self.colors.ranges.array.buffer(),
        ];
        buffers.into_iter().map(Buffer::size).sum()
    }
}

impl Kind {
    /// Particles and numbers of a constraint in the layout of `scalar.wgsl`.
    fn data(self, solver: &Solver<f32>, constraint: u32) -> ([u32; 4], [f32; 4]) {
        match self {
            Self::Distance => {
                let data = solver.distance_data(constraint);
                let [a, b] = data.particles;
                let numbers = [data.length, data.compliance, data.damping, 0.0];
                ([a, b, u32::from(data.tension_only), 0], numbers)
            }
            Self::Volume => {
                let data = solver.volume_data(constraint);
                let numbers = [data.per_six_volumes, data.compliance, data.damping, 0.0];
                (data.particles, numbers)
            }
        }
    }
}

/// The kernels of a kind.
#[derive(Debug)]
pub(crate) struct ScalarKernels<'a> {
    colors: &'a Colors,
    one: BoundKernel,
    several: BoundKernel,
    /// Clears multipliers, if they are kept.
    clear: Option<(BoundKernel, usize)>,
}

impl ScalarKernels<'_> {
    /// Clears multipliers at the start of a substep.
    pub(crate) fn begin(&self, pass: &mut Recorder<'_>) {
        if let Some((clear, groups)) = &self.clear {
            clear.run(pass, &[], *groups);
        }
    }

    /// Solves the constraints in an iteration, after the attachments.
    pub(crate) fn solve(&self, pass: &mut Recorder<'_>) {
        self.colors.run(pass, &self.one, &self.several);
    }
}
