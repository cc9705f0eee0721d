//! A body on the device and its twin on the host, with equal edits and steps.

use glam::DVec3;
use incise_gpu::{ClusterMapping, GpuContext, GpuSolver};
use incise_graph::Schedule;
use incise_mesh::{TetMesh, kuhn_box};
use incise_xpbd::{Material, Solver, StepSettings};

use crate::solver::{body, distance, schedules, share};

/// Both forms with a clustering for each.
pub(crate) const FORMS: [(&str, ClusterMapping); 2] = [
    ("serial:10", ClusterMapping::Threads),
    ("pressure:128", ClusterMapping::Workgroups),
];

/// A bar of 96 tets, 1 m long.
pub(crate) fn bar() -> TetMesh {
    kuhn_box([4, 2, 2], DVec3::new(1.0, 0.5, 0.5))
}

/// Device and host.
pub(crate) struct Twins {
    pub(crate) device: GpuSolver,
    pub(crate) host: Solver<f32>,
    pub(crate) schedule: Schedule,
    /// That of the host.
    pub(crate) order: Schedule,
}

impl Twins {
    /// A body that has been prepared.
    pub(crate) fn new(
        gpu: &'static GpuContext,
        mesh: &TetMesh,
        material: Material,
        (method, form): (&str, ClusterMapping),
        prepare: impl Fn(&mut Solver<f32>),
    ) -> Self {
        let (schedule, tiled) = schedules(mesh, method);
        let [there, host] = [(); 2].map(|()| {
            let mut solver = body(mesh, &[material]);
            prepare(&mut solver);
            solver
        });
        let order = match form {
            ClusterMapping::Threads => schedule.clone(),
            ClusterMapping::Workgroups => tiled,
        };
        Self {
            device: GpuSolver::new(share(gpu), there, form).unwrap(),
            host,
            schedule,
            order,
        }
    }

    /// Advances both by a frame.
    pub(crate) fn step(&mut self, settings: &StepSettings) {
        self.device.step(&self.schedule, settings).unwrap();
        self.host.step(&self.order, settings).unwrap();
    }

    /// Applies one edit to both.
    pub(crate) fn edit(&mut self, edit: impl Fn(&mut Solver<f32>)) {
        edit(self.device.edit().unwrap());
        edit(&mut self.host);
    }

    /// The largest distance of their particles, in units of the body's size of 1.
    pub(crate) fn apart(&mut self) -> f64 {
        let far = distance(self.device.host().unwrap(), &self.host);
        assert_eq!(self.device.repaired(), 0);
        far
    }
}

/// Frees all particles.
pub(crate) fn free(solver: &mut Solver<f32>) {
    (0..solver.particle_count()).for_each(|p| solver.set_fixed(p, false));
}
