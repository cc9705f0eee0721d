//! Forces on what holds the bodies: switched on, and read after a frame. See [`Forces`]. Cost: that of the meter.

use super::Solver;
use crate::{Float, Forces};

impl<R: Float> Solver<R> {
    /// Measures forces in the frames to come, or ends that. A measured frame has the bits of any other. A solver that
    /// does not measure has neither memory nor a pass for it. A clone does not measure.
    ///
    /// # Example
    /// A particle of 2 kg hangs from a handle.
    /// ```
    /// use glam::{DVec3, dvec3};
    /// use incise_graph::Schedule;
    /// use incise_xpbd::{Pose, Solver, StepSettings};
    ///
    /// let mut solver = Solver::<f64>::new(&[DVec3::ZERO]);
    /// solver.set_mass(0, 2.0);
    /// let handle = solver.add_handle(Pose::at(DVec3::ZERO));
    /// solver.attach(0, handle, 0.0, 0.0)?;
    /// solver.measure_forces(true);
    /// let gravity = Some(dvec3(0.0, 0.0, -9.81));
    /// solver.step(&Schedule::default(), &StepSettings { gravity, ..StepSettings::new(0.016) })?;
    /// let forces = solver.forces().expect("they are measured");
    /// assert!((forces.handles[0].force.z + 2.0 * 9.81).abs() < 1e-12);
    /// # Ok::<(), incise_xpbd::XpbdError>(())
    /// ```
    pub fn measure_forces(&mut self, measuring: bool) {
        if !measuring {
            self.stepper.meter = None;
        } else if self.stepper.meter.is_none() {
            self.stepper.meter = Some(Box::default());
        }
    }

    /// Returns the mean forces of the last frame, from the bodies on handles, colliders and fixed particles; `None`
    /// unless [`Solver::measure_forces`] was on and a frame has been made since. In a frame of several parts they are
    /// complete after the last part. O(handles + colliders + fixed particles).
    ///
    /// With XPBD the sum of all of them, together with those of contacts, is exactly what changes the momentum of the
    /// bodies beside gravity. With VBD it is so up to the residual of its substeps. Chebyshev's extrapolation moves
    /// particles by no force; its frames are refused while forces are measured.
    #[must_use]
    pub fn forces(&self) -> Option<Forces> {
        let meter = self.stepper.meter.as_ref()?;
        meter.has_frame().then(|| meter.forces())
    }
}
