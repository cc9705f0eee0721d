//! Interaction with a [`Session`]: cutting along drawn lines, and pulling with the pointer.
//!
//! The blade takes one pose a frame, line after line. Poses of a line that is drawn faster, or while the simulation is
//! paused or away, wait in a queue. Waiting poses on a straight line are merged into one, which keeps the queue short. Of
//! the targets of a grab the last one counts. Rays hit the body where the view shows it.

use std::collections::VecDeque;

use incise::RayHit;
use incise::mesh::glam::DVec3;

use super::Session;
use super::engine::{BladeMotion, Command};
use crate::tool::blade;

/// Largest distance from a straight line, in points of the window, of poses that are merged.
const STRAIGHT: f64 = 1.0;
/// Smallest motion of the pointer, in points of the window, that adds a pose.
const STILL: f64 = 2.0;

/// A position of the pointer with the blade there.
#[derive(Clone, Copy, Debug)]
struct BladePose {
    pixel: [f64; 2],
    ends: [DVec3; 2],
}

/// A drawn line.
#[derive(Debug)]
pub(super) struct Line {
    /// Poses that have not been cut yet.
    waiting: VecDeque<BladePose>,
    /// The last pose that was cut.
    last_cut: Option<BladePose>,
    /// Distance in m from the eye to the body where the view ray last hit it.
    surface: Option<f64>,
    /// True if the button is up: the line ends with its last pose.
    is_finished: bool,
}

/// A grab that follows the pointer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pull {
    /// Depth of the target along the camera's direction in m.
    depth: f64,
    /// Target of the grab.
    pub(super) to: DVec3,
}

impl Line {
    /// Adds a pose; the last one is replaced if it lies on a straight line to this one.
    fn push(&mut self, pose: BladePose) {
        let from = match self.waiting.len() {
            0 => None,
            1 => self.last_cut.map(|pose| pose.pixel),
            more => Some(self.waiting[more - 2].pixel),
        };
        if let (Some(from), Some(last)) = (from, self.waiting.back_mut())
            && distance_to_segment(last.pixel, from, pose.pixel) < STRAIGHT
        {
            *last = pose;
            return;
        }
        self.waiting.push_back(pose);
    }

    /// The last pointer position of the line.
    fn last(&self) -> Option<[f64; 2]> {
        self.waiting
            .back()
            .or(self.last_cut.as_ref())
            .map(|pose| pose.pixel)
    }
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Distance of a point from the segment between two others.
fn distance_to_segment(point: [f64; 2], from: [f64; 2], to: [f64; 2]) -> f64 {
    let way = [to[0] - from[0], to[1] - from[1]];
    let length = way[0] * way[0] + way[1] * way[1];
    if length == 0.0 {
        return distance(point, from);
    }
    let passed = ((point[0] - from[0]) * way[0] + (point[1] - from[1]) * way[1]) / length;
    let passed = passed.clamp(0.0, 1.0);
    distance(
        point,
        [from[0] + passed * way[0], from[1] + passed * way[1]],
    )
}

impl Session {
    /// Starts a line at a pixel of a picture of some size.
    pub(crate) fn press_blade(&mut self, pixel: [f64; 2], size: [f64; 2]) {
        self.lift_blade();
        self.message = None;
        let surface = self.hit(pixel, size).map(|hit| hit.distance);
        let ends = self.blade_under(pixel, size, surface);
        self.lines.push_back(Line {
            waiting: VecDeque::from([BladePose { pixel, ends }]),
            last_cut: None,
            surface,
            is_finished: false,
        });
        self.blade = Some(ends);
        self.show_blade();
    }

    /// Continues the line to a pixel; does nothing if none is being drawn.
    pub(crate) fn draw_blade(&mut self, pixel: [f64; 2], size: [f64; 2]) {
        let Some(line) = self.lines.back().filter(|line| !line.is_finished) else {
            return;
        };
        if line
            .last()
            .is_some_and(|last| distance(last, pixel) < STILL)
        {
            return;
        }
        let before = line.surface;
        let surface = self.hit(pixel, size).map(|hit| hit.distance).or(before);
        let ends = self.blade_under(pixel, size, surface);
        if let Some(line) = self.lines.back_mut() {
            line.surface = surface;
            line.push(BladePose { pixel, ends });
        }
        self.blade = Some(ends);
        self.show_blade();
    }

    /// Ends the line that is being drawn.
    pub(crate) fn lift_blade(&mut self) {
        if let Some(line) = self.lines.back_mut() {
            line.is_finished = true;
        }
        if self.blade.take().is_some() {
            self.view.render_scene.set_blade(None);
        }
    }

    /// Shows the blade under the pointer; while a line is drawn or cut, blades of the scene are hidden.
    pub(super) fn show_blade(&mut self) {
        if self.cuts() {
            let blade = self.blade.as_ref().map(<[DVec3; 2]>::as_slice);
            self.view.render_scene.set_blade(blade);
        }
    }

    /// True while a line is being drawn or cut.
    pub(crate) fn cuts(&self) -> bool {
        !self.lines.is_empty()
    }

    /// The drawn lines that are not cut yet, as points in the middle of the blade.
    pub(crate) fn waiting_lines(&self) -> impl Iterator<Item = Vec<DVec3>> + '_ {
        let middle = |pose: &BladePose| (pose.ends[0] + pose.ends[1]) / 2.0;
        let lines = self.lines.iter();
        lines.map(move |line| {
            let cut = line.last_cut.iter();
            cut.chain(&line.waiting).map(middle).collect()
        })
    }

    /// Drops all lines.
    pub(super) fn drop_lines(&mut self) {
        self.lift_blade();
        self.lines.clear();
    }

    /// Takes the motion of the blade in the next frame.
    pub(super) fn next_motion(&mut self) -> Option<BladeMotion> {
        let line = self.lines.front_mut()?;
        if let Some(pose) = line.waiting.pop_front() {
            let begins = line.last_cut.replace(pose).is_none();
            Some(if begins {
                BladeMotion::Begin(pose.ends, self.tool_settings.snap)
            } else {
                BladeMotion::Move(pose.ends)
            })
        } else if line.is_finished {
            self.lines.pop_front();
            Some(BladeMotion::End)
        } else {
            None
        }
    }

    fn blade_under(&self, pixel: [f64; 2], size: [f64; 2], surface: Option<f64>) -> [DVec3; 2] {
        let through = self.tool_settings.depth >= 1.0;
        let depth = (!through).then_some(self.tool_settings.depth * self.extent);
        blade(&self.camera, pixel, size, self.view.bounds, surface, depth)
    }

    /// The point of the body under a pixel, in the view.
    fn hit(&self, pixel: [f64; 2], size: [f64; 2]) -> Option<RayHit> {
        let (origin, direction) = self.camera.ray(pixel, size);
        let triangles = self.view.boundary.iter().copied();
        RayHit::first(triangles, &self.view.positions, origin, direction)
    }

    /// Grabs the body under a pixel. If nothing can be grabbed, [`Session::message`] is the reason, for pinned particles
    /// after the next job.
    pub(crate) fn grab_at(&mut self, pixel: [f64; 2], size: [f64; 2]) {
        self.release();
        self.message = None;
        let Some(hit) = self.hit(pixel, size) else {
            self.message = Some("Nothing to grab here");
            return;
        };
        // A radius smaller than a triangle grabs the nearest corner.
        let positions = &self.view.positions;
        let corners = hit
            .particles
            .map(|p| positions[p.index()].distance(hit.point));
        let nearest = corners.into_iter().fold(f64::INFINITY, f64::min);
        let (origin, _) = self.camera.ray(pixel, size);
        self.pull = Some(Pull {
            depth: (hit.point - origin).dot(self.camera.forward()),
            to: hit.point,
        });
        self.waiting.push(Command::Grab {
            point: hit.point,
            radius: (self.extent * self.tool_settings.radius).max(1.001 * nearest),
            compliance: self.tool_settings.compliance,
        });
    }

    /// Moves the grab's target under a pixel, at the depth at which it was grabbed.
    pub(crate) fn pull(&mut self, pixel: [f64; 2], size: [f64; 2]) {
        let (origin, direction) = self.camera.ray(pixel, size);
        let forward = self.camera.forward();
        if let Some(pull) = &mut self.pull {
            pull.to = origin + direction * (pull.depth / direction.dot(forward));
        }
    }

    /// Releases the grab, if there is one.
    pub(crate) fn release(&mut self) {
        if self.pull.take().is_some() {
            self.waiting.push(Command::Release);
        }
    }

    /// Target of the grab in use.
    pub(crate) fn grab_target(&self) -> Option<DVec3> {
        self.pull.map(|pull| pull.to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(pixels: &[[f64; 2]]) -> Line {
        let mut line = Line {
            waiting: VecDeque::new(),
            last_cut: Some(BladePose {
                pixel: [0.0, 0.0],
                ends: [DVec3::ZERO; 2],
            }),
            surface: None,
            is_finished: false,
        };
        for &pixel in pixels {
            let ends = [DVec3::ZERO; 2];
            line.push(BladePose { pixel, ends });
        }
        line
    }

    #[test]
    fn poses_on_a_straight_line_are_merged_and_corners_stay() {
        let along: Vec<[f64; 2]> = (1..50)
            .map(|x| [f64::from(x), 0.3 * f64::from(x % 2)])
            .collect();
        assert_eq!(line(&along).waiting.len(), 1);
        let corner = [&along[..], &[[49.0, 30.0], [49.0, 60.0]]].concat();
        let corner = line(&corner);
        assert_eq!(corner.waiting.len(), 2);
        assert_eq!(corner.last(), Some([49.0, 60.0]));
        // Back and forth is not a straight line.
        assert_eq!(line(&[[40.0, 0.0], [10.0, 0.0]]).waiting.len(), 2);
    }
}
