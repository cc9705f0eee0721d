//! [`SolverBackend`]: the interface of the runtime to a solver on the CPU or on a GPU.

use std::ops::Range;

use glam::DVec3;
use incise_graph::Schedule;
use incise_xpbd::{Energy, ErasedSolver, Pose, Residuals, StepReport, StepSettings, Volume};

use crate::Error;
use crate::report::Milliseconds;
use crate::scene::{Quantity, SolverSpec};

/// Residuals of the last substep; XPBD has more of them than VBD.
#[derive(Clone, Copy, Debug)]
pub(crate) enum LastSubstep {
    Constraints(Residuals),
    Vbd { force: f64, potential: f64 },
}

/// Measured quantities of an island's state; `None` for those that were not requested.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Measures {
    pub(crate) energy: Option<Energy>,
    /// The elastic energy of slivers; unknown on a device.
    pub(crate) sliver_energy: Option<f64>,
    pub(crate) volume: Option<Volume>,
    pub(crate) max_speed: Option<f64>,
}

/// A solver on the CPU in one precision, by XPBD or VBD, or one on a device. Functions that only one kind needs do
/// nothing by default.
pub(crate) trait SolverBackend {
    /// The solver on the CPU, to be read. That of a device has the state of the last readback.
    fn host(&self) -> &dyn ErasedSolver;

    /// The solver on the CPU, to be edited. The state of a device is read back first; its next step takes the edits over.
    fn edit(&mut self) -> Result<&mut dyn ErasedSolver, Error>;

    /// Prepares the data of VBD, if the settings ask for it.
    fn prepare(&mut self, _spec: &SolverSpec) -> Result<(), Error> {
        Ok(())
    }

    /// Advances by some of the substeps of a frame, of VBD by the whole frame, keeping what
    /// [`SolverBackend::last_substep`] needs on request. The state of a device stays there.
    fn step(
        &mut self,
        schedule: &Schedule,
        settings: &StepSettings,
        part: Range<u32>,
        keep: bool,
    ) -> Result<StepReport, Error>;

    /// Brings the layout up to date with the schedule, or sends a device what has changed; the next step would do it
    /// otherwise. VBD has none.
    fn lay_out(&mut self, schedule: &Schedule, ms: &mut Milliseconds) -> Result<(), Error>;

    /// Measures the requested quantities of the state; on a device without fetching it.
    fn state(&mut self, gravity: Option<DVec3>, quantities: &[Quantity])
    -> Result<Measures, Error>;

    /// The residuals of the last substep, if they were kept.
    fn last_substep(&self, substep_time: f64) -> Option<LastSubstep> {
        let residuals = self.host().residuals(substep_time);
        residuals.map(LastSubstep::Constraints)
    }

    /// Turns the measurement of forces on or off from the next frame on. A device measures none.
    fn measure_forces(&mut self, _measuring: bool) {}

    /// Sets the pose of a handle at the end of the next frame, without a readback.
    fn move_handle(&mut self, handle: u32, pose: Pose);

    /// Bytes of a copy.
    fn bytes(&self) -> usize {
        self.host().bytes()
    }

    /// Updates what VBD keeps after a cut, once tets and volume constraints have been.
    fn update_vbd(
        &mut self,
        _changed: Option<&[u32]>,
        _ms: &mut Milliseconds,
    ) -> Result<(), Error> {
        Ok(())
    }

    /// The error that the last frame of two-level VBD left over.
    fn vbd_error(&self) -> Option<f64> {
        None
    }

    /// Drops the data of VBD.
    fn end_vbd(&mut self) {}

    /// Makes the state of a device known here; returns how many particles it had to put back since the last time.
    fn read_back(&mut self) -> Result<usize, Error> {
        Ok(0)
    }

    /// Returns how many particles a device had to put back since the last call, as of the last readback or measurement.
    fn take_repaired(&mut self) -> usize {
        0
    }

    /// Recomputes the data of VBD or of a device and compares.
    fn check(&self, schedule: &Schedule) -> Result<(), Error>;
}
