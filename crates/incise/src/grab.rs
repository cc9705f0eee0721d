//! [`Grabs`]: the interactive grabs of an island of bodies.
//!
//! A grab attaches particles to a handle of the solver that only this grab moves, and never turns. A released handle is
//! reused by the next grab, so the solver grows with the largest number of grabs held at a time, not with their total.
//!
//! Source: handles as in `incise_xpbd::Pose`. Cost: a pass over the particles for a grab, and one over all attachments
//! for a release. Rigid grabs and their releases change which masses count, so the next step rebuilds the layout of all
//! tets, O(tets); grabs with a compliance do not. A frame costs what its handles cost.

use glam::DVec3;
use incise_xpbd::Pose;

use crate::Error;
use crate::backend::AnySolver;

/// Handle of an interactive grab in the simulation that returned it: see [`Simulation::grab`](crate::Simulation::grab).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Grab(pub(crate) u64);

/// A grab and its handle in the solver.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
struct ActiveGrab {
    /// Its number in the solver.
    handle: u32,
    /// The present or last grab that has it.
    grab: u64,
    held: bool,
    /// The point that was grabbed, and where it is to be at the end of the next frame.
    point: DVec3,
    to: DVec3,
    /// Position of the handle when the grab began.
    start: DVec3,
    /// Whether `to` has changed since the last frame.
    moved: bool,
}

/// The grabs of an island.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Grabs {
    active: Vec<ActiveGrab>,
}

impl Grabs {
    /// Whether a grab moves in the next frame.
    pub(crate) fn moves(&self) -> bool {
        self.active.iter().any(|grab| grab.held && grab.moved)
    }

    /// Notes that a frame has been made.
    pub(crate) fn arrive(&mut self) {
        for grab in &mut self.active {
            grab.moved = false;
        }
    }

    /// The number of the frame of the solver that a grab has, and the target of its point, if it is held.
    pub(crate) fn held(&self, grab: Grab) -> Option<(u32, DVec3)> {
        let mut active = self.active.iter();
        let active = active.find(|active| active.held && active.grab == grab.0)?;
        Some((active.handle, active.to))
    }

    /// All grabs that are held.
    pub(crate) fn all_held(&self) -> impl Iterator<Item = Grab> + '_ {
        let held = self.active.iter().filter(|active| active.held);
        held.map(|active| Grab(active.grab))
    }

    /// Appends those of an island whose handles get numbers from `first` on.
    pub(crate) fn append(&mut self, other: &Self, first: u32) {
        let active = other.active.iter().map(|active| ActiveGrab {
            handle: first + active.handle,
            ..active.clone()
        });
        self.active.extend(active);
    }

    /// Sets the target of a grab for the end of the next frame; returns whether the grab exists.
    pub(crate) fn move_to(&mut self, solver: &mut AnySolver, grab: Grab, to: DVec3) -> bool {
        let Some(active) = self.find(grab) else {
            return false;
        };
        // A grab keeps its island awake only while it moves.
        active.moved |= active.to != to;
        active.to = to;
        let pose = Pose::at(active.start + (to - active.point));
        solver.backend_mut().move_handle(active.handle, pose);
        true
    }

    /// Releases all particles of a grab; returns whether the grab exists.
    pub(crate) fn release(&mut self, solver: &mut AnySolver, grab: Grab) -> Result<bool, Error> {
        let Some(active) = self.find(grab) else {
            return Ok(false);
        };
        solver.edit()?.detach_all(active.handle);
        // Handles go back to where they began, so that their ways do not add up from grab to grab.
        let start = Pose::at(DVec3::ZERO);
        solver.backend_mut().move_handle(active.handle, start);
        active.held = false;
        Ok(true)
    }

    fn find(&mut self, grab: Grab) -> Option<&mut ActiveGrab> {
        let mut active = self.active.iter_mut();
        active.find(|active| active.held && active.grab == grab.0)
    }

    /// Attaches particles to a free handle for a new grab.
    pub(crate) fn take(
        &mut self,
        grab: Grab,
        solver: &mut AnySolver,
        particles: &[usize],
        point: DVec3,
        compliance: f64,
    ) -> Result<(), Error> {
        let vacant = self.active.iter().position(|grab| !grab.held);
        let slot = vacant.unwrap_or(self.active.len());
        let solver = solver.edit()?;
        let known = self.active.get(slot).map(|grab| grab.handle);
        let handle = known.unwrap_or_else(|| solver.add_handle(Pose::at(DVec3::ZERO)));
        let pose = solver.handle(handle);
        // The handle may still be moving back.
        solver.move_handle(handle, pose);
        for &p in particles {
            let attached = solver.attach(p, handle, compliance, 0.0);
            attached.map_err(Error::xpbd("grab"))?;
        }
        let grab = ActiveGrab {
            handle,
            grab: grab.0,
            held: true,
            point,
            to: point,
            start: pose.position,
            moved: false,
        };
        match self.active.get_mut(slot) {
            Some(old) => *old = grab,
            None => self.active.push(grab),
        }
        Ok(())
    }

    /// Returns an error if a particle is attached to a released handle.
    pub(crate) fn check(&self, solver: &AnySolver) -> Result<(), Error> {
        let free = |handle| {
            let mut active = self.active.iter();
            active.any(|grab| grab.handle == handle && !grab.held)
        };
        let solver = solver.host();
        let is_left = |p: &usize| solver.handle_of(*p).is_some_and(free);
        let left = (0..solver.particle_count()).find(is_left);
        left.map_or(Ok(()), |p| {
            let what = format!("particle {p} is attached to a released handle");
            Err(Error::Inconsistent(what))
        })
    }
}
