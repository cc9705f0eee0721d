//! [`Motion`]: the positions of the particles at the beginning and the end of a frame, which a moving blade needs.

use glam::DVec3;
use incise_mesh::ParticleId;

use crate::ccd::MovingSegment;
use crate::operation::Crossing;

/// The particles' positions at the beginning and the end of a frame.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Motion {
    pub(crate) before: Vec<DVec3>,
    pub(crate) now: Vec<DVec3>,
}

impl Motion {
    /// The motion of an edge.
    pub(crate) fn edge(&self, ends: [ParticleId; 2]) -> MovingSegment {
        MovingSegment {
            before: ends.map(|p| self.before[p.index()]),
            now: ends.map(|p| self.now[p.index()]),
        }
    }

    /// Appends the particle of a crossed edge.
    pub(crate) fn push(&mut self, crossing: &Crossing) {
        for values in [&mut self.before, &mut self.now] {
            let [a, b] = crossing.ends.map(|p| values[p.index()]);
            values.push(a + (b - a) * crossing.parameter);
        }
    }
}
