//! What hands do on a [`Stage`]: a blade that cuts along a drawn line, a hand that takes hold and pulls.
//!
//! The body meets one pose of the blade a frame, so a line that was drawn faster than frames go is cut when they have come.

use std::collections::VecDeque;

use incise::mesh::glam::DVec3;
use incise::scene::Method;

use super::{Hold, Stage, Stroke};
use crate::tool::blade;

impl Stage {
    /// Puts the blade on a pixel of a picture of some size.
    pub(crate) fn press_blade(&mut self, pixel: [f64; 2], size: [f64; 2]) -> anyhow::Result<()> {
        self.lift_at_once();
        self.remember(false)?;
        let surface = self.surface_at(pixel, size)?;
        let pose = self.pose(pixel, size, surface);
        let number = self.simulation.begin_stroke(&pose, self.grip.snap)?;
        self.stroke = Some(Stroke {
            number,
            poses: VecDeque::new(),
            surface,
            ends: false,
        });
        self.painting.set_blade(Some(&pose));
        Ok(())
    }

    /// Moves the blade to a pixel.
    pub(crate) fn draw_blade(&mut self, pixel: [f64; 2], size: [f64; 2]) -> anyhow::Result<()> {
        let at = self.surface_at(pixel, size)?;
        let Some(stroke) = &mut self.stroke else {
            return Ok(());
        };
        stroke.surface = at.or(stroke.surface);
        let surface = stroke.surface;
        let pose = self.pose(pixel, size, surface);
        if let Some(stroke) = &mut self.stroke {
            stroke.poses.push_back(pose);
        }
        self.painting.set_blade(Some(&pose));
        Ok(())
    }

    /// Takes the blade away once the body has met its last pose.
    pub(crate) fn lift_blade(&mut self) {
        if let Some(stroke) = &mut self.stroke {
            stroke.ends = true;
        }
        self.painting.set_blade(None);
    }

    /// Whether a blade is in use or has poses left.
    pub(crate) fn cuts(&self) -> bool {
        self.stroke.is_some()
    }

    /// Ends a stroke where it is.
    pub(super) fn lift_at_once(&mut self) {
        if let Some(stroke) = self.stroke.take() {
            // One that a jump in time has ended already is ended.
            let _ = self.simulation.end_stroke(stroke.number);
        }
        self.painting.set_blade(None);
    }

    /// Brings the blade to its pose of the next frame, and ends the stroke after the last one.
    pub(super) fn move_blade(&mut self) -> anyhow::Result<()> {
        let Some(stroke) = &mut self.stroke else {
            return Ok(());
        };
        if let Some(pose) = stroke.poses.pop_front() {
            self.simulation.move_blade(stroke.number, &pose)?;
        } else if stroke.ends {
            let number = stroke.number;
            self.stroke = None;
            self.simulation.end_stroke(number)?;
        }
        Ok(())
    }

    fn pose(&self, pixel: [f64; 2], size: [f64; 2], surface: Option<f64>) -> [DVec3; 2] {
        let bounds = self.painting.bounds(&self.simulation);
        blade(&self.camera, pixel, size, bounds, surface, &self.grip)
    }

    /// Where the view ray of a pixel meets the body, in m from the eye.
    fn surface_at(&mut self, pixel: [f64; 2], size: [f64; 2]) -> anyhow::Result<Option<f64>> {
        self.simulation.read_back()?;
        let (origin, direction) = self.camera.ray(pixel, size);
        let hit = self
            .painting
            .pick(self.simulation.positions(), origin, direction);
        Ok(hit.map(|hit| hit.distance))
    }

    /// Takes hold of the body under a pixel; tells whether there is something to hold.
    pub(crate) fn take(&mut self, pixel: [f64; 2], size: [f64; 2]) -> anyhow::Result<bool> {
        self.let_go();
        self.simulation.read_back()?;
        let (origin, direction) = self.camera.ray(pixel, size);
        let Some(hit) = self
            .painting
            .pick(self.simulation.positions(), origin, direction)
        else {
            return Ok(false);
        };
        let [low, high] = self.painting.bounds(&self.simulation);
        let radius = (high - low).length() * self.grip.radius;
        let compliance = match self.simulation.solver_spec().method {
            // It knows no springs.
            Method::Descent => 0.0,
            _ => self.grip.compliance,
        };
        let grab = self.simulation.grab(hit.point, radius, compliance)?;
        self.hold = grab.map(|grab| Hold {
            grab,
            depth: (hit.point - origin).dot(self.camera.forward()),
            to: hit.point,
        });
        Ok(self.hold.is_some())
    }

    /// Pulls what is held to under a pixel, as far from the eye as it was taken.
    pub(crate) fn pull(&mut self, pixel: [f64; 2], size: [f64; 2]) -> anyhow::Result<()> {
        let (origin, direction) = self.camera.ray(pixel, size);
        let forward = self.camera.forward();
        let Some(hold) = &mut self.hold else {
            return Ok(());
        };
        hold.to = origin + direction * (hold.depth / direction.dot(forward));
        Ok(self.simulation.move_grab(hold.grab, hold.to)?)
    }

    /// Lets go.
    pub(crate) fn let_go(&mut self) {
        if let Some(hold) = self.hold.take() {
            // What a jump in time has let go already is let go.
            let _ = self.simulation.release(hold.grab);
        }
    }

    /// Where the hand pulls to, if it holds something.
    pub(crate) fn hand(&self) -> Option<DVec3> {
        self.hold.map(|hold| hold.to)
    }
}
