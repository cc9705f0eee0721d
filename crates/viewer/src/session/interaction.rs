//! Interaction with a [`Session`]: cutting along drawn lines, and pulling with the pointer.
//!
//! The body meets one pose of the blade a frame, line after line, so what is drawn faster than frames go, or while time
//! stands still, is cut when they have come. Poses that wait on a straight line become one, so that it does not take long.

use std::collections::VecDeque;

use incise::mesh::glam::DVec3;

use super::{Hold, Session};
use crate::history::UndoPoint;
use crate::tool::blade;

/// Points of the window within which places count as on a straight line.
const STRAIGHT: f64 = 1.0;
/// Points of the window within which the pointer has not moved.
const STILL: f64 = 2.0;

/// A place of the pointer, and the blade there.
#[derive(Clone, Copy, Debug)]
struct Place {
    pixel: [f64; 2],
    pose: [DVec3; 2],
}

/// A drawn line.
#[derive(Debug)]
pub(super) struct Line {
    /// Places that the body has not met yet.
    waiting: VecDeque<Place>,
    /// The last place that it has met.
    met: Option<[f64; 2]>,
    /// Where the view ray last met the body, in m from the eye.
    surface: Option<f64>,
    /// Whether the button is up: the line ends with its last place.
    lifted: bool,
    /// Its number among the strokes, once the body meets it.
    pub(super) stroke: Option<u32>,
    /// The moment before that, until it has cut something.
    before: Option<UndoPoint>,
}

impl Line {
    /// Adds a place; one on the way to it from the one before becomes this one.
    fn push(&mut self, place: Place) {
        let from = match self.waiting.len() {
            0 => None,
            1 => self.met,
            more => Some(self.waiting[more - 2].pixel),
        };
        if let (Some(from), Some(last)) = (from, self.waiting.back_mut())
            && off(last.pixel, from, place.pixel) < STRAIGHT
        {
            *last = place;
            return;
        }
        self.waiting.push_back(place);
    }

    /// The last place that was drawn.
    fn last(&self) -> Option<[f64; 2]> {
        self.waiting.back().map(|place| place.pixel).or(self.met)
    }
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// How far a place is from the straight way between two others.
fn off(place: [f64; 2], from: [f64; 2], to: [f64; 2]) -> f64 {
    let way = [to[0] - from[0], to[1] - from[1]];
    let length = way[0] * way[0] + way[1] * way[1];
    if length == 0.0 {
        return distance(place, from);
    }
    let passed = ((place[0] - from[0]) * way[0] + (place[1] - from[1]) * way[1]) / length;
    let passed = passed.clamp(0.0, 1.0);
    distance(
        place,
        [from[0] + passed * way[0], from[1] + passed * way[1]],
    )
}

impl Session {
    /// Puts the blade on a pixel of a picture of some size.
    pub(crate) fn press_blade(&mut self, pixel: [f64; 2], size: [f64; 2]) -> anyhow::Result<()> {
        self.lift_blade();
        let surface = self.surface_at(pixel, size)?;
        let pose = self.pose(pixel, size, surface);
        self.lines.push_back(Line {
            waiting: VecDeque::from([Place { pixel, pose }]),
            met: None,
            surface,
            lifted: false,
            stroke: None,
            before: None,
        });
        self.painting.set_blade(Some(&pose));
        Ok(())
    }

    /// Moves the blade to a pixel; nothing if it is not pressed.
    pub(crate) fn draw_blade(&mut self, pixel: [f64; 2], size: [f64; 2]) -> anyhow::Result<()> {
        let Some(line) = self.lines.back().filter(|line| !line.lifted) else {
            return Ok(());
        };
        if line
            .last()
            .is_some_and(|last| distance(last, pixel) < STILL)
        {
            return Ok(());
        }
        let before = line.surface;
        let surface = self.surface_at(pixel, size)?.or(before);
        let pose = self.pose(pixel, size, surface);
        if let Some(line) = self.lines.back_mut() {
            line.surface = surface;
            line.push(Place { pixel, pose });
        }
        self.painting.set_blade(Some(&pose));
        Ok(())
    }

    /// Takes the blade away once the body has met its last place.
    pub(crate) fn lift_blade(&mut self) {
        if let Some(line) = self.lines.back_mut() {
            line.lifted = true;
        }
        self.painting.set_blade(None);
    }

    /// Whether a blade is in use or has places left.
    pub(crate) fn cuts(&self) -> bool {
        !self.lines.is_empty()
    }

    /// Forgets all lines, and ends the one that is being met where it is.
    pub(super) fn drop_lines(&mut self) {
        for line in std::mem::take(&mut self.lines) {
            if let Some(stroke) = line.stroke {
                // One that a jump in time has ended already is ended.
                let _ = self.simulation.end_stroke(stroke);
            }
        }
        self.painting.set_blade(None);
    }

    /// Brings the blade to its place of the next frame.
    pub(super) fn move_blade(&mut self) -> anyhow::Result<()> {
        let Some(line) = self.lines.front_mut() else {
            return Ok(());
        };
        if let Some(place) = line.waiting.pop_front() {
            line.met = Some(place.pixel);
            match line.stroke {
                Some(stroke) => self.simulation.move_blade(stroke, &place.pose)?,
                None => {
                    let before = self.moment(false)?;
                    let stroke = self.simulation.begin_stroke(&place.pose, self.grip.snap)?;
                    if let Some(line) = self.lines.front_mut() {
                        (line.stroke, line.before) = (Some(stroke), Some(before));
                    }
                }
            }
        } else if line.lifted {
            let stroke = line.stroke;
            self.lines.pop_front();
            if let Some(stroke) = stroke {
                self.simulation.end_stroke(stroke)?;
            }
        }
        Ok(())
    }

    /// Keeps the moment before the line that is being met, once it has cut something: what cuts nothing is not taken back.
    pub(super) fn note_cut(&mut self) {
        if let Some(before) = self.lines.front_mut().and_then(|line| line.before.take()) {
            self.history.keep(before);
        }
    }

    fn pose(&self, pixel: [f64; 2], size: [f64; 2], surface: Option<f64>) -> [DVec3; 2] {
        let bounds = self.painting.bounds(&self.simulation);
        let through = self.grip.depth >= 1.0;
        let depth = (!through).then_some(self.grip.depth * self.extent);
        blade(&self.camera, pixel, size, bounds, surface, depth)
    }

    /// Where the view ray of a pixel meets the body, in m from the eye.
    fn surface_at(&mut self, pixel: [f64; 2], size: [f64; 2]) -> anyhow::Result<Option<f64>> {
        self.simulation.read_back()?;
        let (origin, direction) = self.camera.ray(pixel, size);
        let hit = self.simulation.ray_cast(origin, direction);
        Ok(hit.map(|hit| hit.distance))
    }

    /// Takes hold of the body under a pixel; tells whether there is something to hold.
    pub(crate) fn take(&mut self, pixel: [f64; 2], size: [f64; 2]) -> anyhow::Result<bool> {
        self.let_go();
        self.simulation.read_back()?;
        let (origin, direction) = self.camera.ray(pixel, size);
        let positions = self.simulation.positions();
        let Some(hit) = self.simulation.ray_cast(origin, direction) else {
            return Ok(false);
        };
        // A hand that is smaller than a triangle takes its nearest corner.
        let corners = hit
            .particles
            .map(|p| positions[p.index()].distance(hit.point));
        let nearest = corners.into_iter().fold(f64::INFINITY, f64::min);
        let radius = (self.extent * self.grip.radius).max(1.001 * nearest);
        let grab = self
            .simulation
            .grab(hit.point, radius, self.grip.compliance)?;
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

    /// Releases the grab, if there is one.
    pub(crate) fn let_go(&mut self) {
        if let Some(hold) = self.hold.take() {
            // A jump in time may have released it already.
            let _ = self.simulation.release(hold.grab);
        }
    }

    /// Where the hand pulls to, if it holds something.
    pub(crate) fn hand(&self) -> Option<DVec3> {
        self.hold.map(|hold| hold.to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(pixels: &[[f64; 2]]) -> Line {
        let mut line = Line {
            waiting: VecDeque::new(),
            met: Some([0.0, 0.0]),
            surface: None,
            lifted: false,
            stroke: None,
            before: None,
        };
        for &pixel in pixels {
            let pose = [DVec3::ZERO; 2];
            line.push(Place { pixel, pose });
        }
        line
    }

    #[test]
    fn places_on_a_straight_line_become_one_and_corners_stay() {
        let along: Vec<[f64; 2]> = (1..50)
            .map(|x| [f64::from(x), 0.3 * f64::from(x % 2)])
            .collect();
        assert_eq!(line(&along).waiting.len(), 1);
        let corner = [&along[..], &[[49.0, 30.0], [49.0, 60.0]]].concat();
        let corner = line(&corner);
        assert_eq!(corner.waiting.len(), 2);
        assert_eq!(corner.last(), Some([49.0, 60.0]));
        // There and back again is not straight.
        assert_eq!(line(&[[40.0, 0.0], [10.0, 0.0]]).waiting.len(), 2);
    }
}
