//! [`LiveBlade`]: a blade that is moved frame by frame, by a mouse or a haptic device.
//!
//! The blade gives its stroke a pose for each frame. The stroke cuts bit-identically to one with a path through these
//! poses. Cost: a copy of the points.

use glam::DVec3;
use incise_cutting::CutError;
use incise_mesh::Bounds;

use crate::Error;
use crate::validate::coordinates;

/// State of a live blade between two frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
enum Progress {
    /// A frame has carried out its pose, or it is its first one, which does not cut.
    Arrived,
    /// Its pose is that of the next frame.
    Moved,
    /// Its pose is that of the next frame, which is its last.
    Ended,
}

/// A blade that is moved interactively, frame by frame.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct LiveBlade {
    pose: Vec<DVec3>,
    /// Box of the poses that frames have carried out.
    swept: Bounds,
    has_moved: bool,
    progress: Progress,
}

impl LiveBlade {
    /// Creates a blade in its first pose.
    pub(crate) fn new(field: &str, pose: &[DVec3]) -> Result<Self, Error> {
        check(field, pose)?;
        long_enough(field, pose)?;
        Ok(Self {
            pose: pose.to_vec(),
            swept: Bounds::EMPTY,
            has_moved: false,
            progress: Progress::Arrived,
        })
    }

    /// Returns the pose at the start of the next frame.
    pub(crate) fn pose(&self) -> &[DVec3] {
        &self.pose
    }

    /// Sets the pose at the start of the next frame.
    pub(crate) fn go_to(&mut self, field: &str, pose: &[DVec3]) -> Result<(), Error> {
        let (before, now) = (self.pose.len(), pose.len());
        if before != now {
            return Err(Error::Cut {
                field: format!("{field}.blade"),
                source: CutError::BladeChanged { before, now },
            });
        }
        check(field, pose)?;
        self.pose.copy_from_slice(pose);
        self.progress = Progress::Moved;
        Ok(())
    }

    /// Ends the stroke; returns whether the next frame has a pose to carry out first.
    pub(crate) fn end(&mut self) -> bool {
        let cuts = self.progress == Progress::Moved;
        if cuts {
            self.progress = Progress::Ended;
        }
        cuts
    }

    /// Returns the box of its path, if it has moved.
    pub(crate) fn swept(&self) -> Option<Bounds> {
        self.has_moved.then_some(self.swept)
    }

    pub(crate) fn is_ended(&self) -> bool {
        self.progress == Progress::Ended
    }

    /// Notes that a frame has carried out its pose; tells whether its stroke continues.
    pub(crate) fn arrive(&mut self) -> bool {
        let goes_on = !self.is_ended();
        let pose = Bounds::around(self.pose.iter().copied());
        self.swept = self.swept.union(pose);
        self.has_moved |= self.progress != Progress::Arrived;
        self.progress = Progress::Arrived;
        goes_on
    }
}

fn check(field: &str, pose: &[DVec3]) -> Result<(), Error> {
    let field = format!("{field}.blade");
    pose.iter()
        .try_for_each(|x| coordinates(&field, x.to_array()).map(drop))
}

/// Refuses a blade that is a point.
pub(crate) fn long_enough(field: &str, blade: &[DVec3]) -> Result<(), Error> {
    let length: f64 = blade.windows(2).map(|ends| ends[0].distance(ends[1])).sum();
    if blade.len() < 2 || length == 0.0 {
        let points = blade.len();
        return Err(Error::Cut {
            field: format!("{field}.blade"),
            source: CutError::ShortBlade { points, length },
        });
    }
    Ok(())
}
