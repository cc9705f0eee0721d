//! [`Motion`]: positions of a scene's particles after each frame, and times; [`Deviation`]: the difference of two
//! motions.
//!
//! Motions are compared at the particles that the scene starts with: cuts do not change their numbers, and the
//! particles that cuts add depend on the position of the body. Cost: a copy of the positions and a pass over the tets
//! after each frame, not counted as time of the frame.

use glam::DVec3;
use incise_mesh::{TetId, TetMesh, signed_volume};
use serde::{Deserialize, Serialize};
use web_time::Instant;

use crate::report::milliseconds;
use crate::{Error, Scene, Simulation};

/// A scene's motion over some frames.
#[derive(Clone, Debug)]
pub struct Motion {
    /// The longest side of the box around all particles at rest, in m.
    pub size: f64,
    /// The positions of the compared particles in m at the start.
    pub start: Vec<DVec3>,
    /// Their positions in m, frame by frame.
    pub positions: Vec<DVec3>,
    /// The volume after each frame, as a part of that at rest.
    pub volumes: Vec<f64>,
    /// Time of each frame in ms; empty for an extrapolated motion.
    pub ms: Vec<f64>,
}

/// Difference of two motions in %.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Deviation {
    /// Root mean square distance of all particles in all frames, relative to the displacements from the start in the
    /// motion compared with.
    pub motion: f64,
    /// Largest root mean square distance of the particles in a frame, relative to the size of the scene.
    pub largest: f64,
    /// Root mean square distance of the particles in the last frame, relative to the size of the scene.
    pub end: f64,
    /// Largest difference of the volume in a frame, relative to the volume at rest.
    pub volume: f64,
}

impl Motion {
    /// Runs a scene for some frames, on `threads` threads or on rayon's pool.
    ///
    /// The time of a frame is that of [`Simulation::step`] and [`Simulation::read_back`]; on a device it includes
    /// reading the positions back.
    ///
    /// # Errors
    /// If the scene or one of its strokes is invalid.
    pub fn of(scene: &Scene, frames: u32, threads: Option<usize>) -> Result<Self, Error> {
        let mut simulation = match threads {
            Some(threads) => Simulation::with_threads(scene, threads)?,
            None => Simulation::new(scene)?,
        };
        let particles = simulation.positions().len();
        let mut motion = Self::still(simulation.mesh(), particles);
        for _ in 0..frames {
            let start = Instant::now();
            simulation.step()?;
            simulation.read_back()?;
            let ms = milliseconds(start.elapsed());
            let positions = simulation.positions();
            motion.push(
                &positions[..particles],
                volume(simulation.mesh(), positions),
            );
            motion.ms.push(ms);
        }
        Ok(motion)
    }

    /// Returns a motion without frames, of the first `particles` of a mesh.
    pub(super) fn still(mesh: &TetMesh, particles: usize) -> Self {
        let low = mesh
            .positions
            .iter()
            .fold(DVec3::INFINITY, |a, x| a.min(*x));
        let high = mesh
            .positions
            .iter()
            .fold(DVec3::NEG_INFINITY, |a, x| a.max(*x));
        Self {
            size: (high - low).max_element(),
            start: mesh.positions[..particles].to_vec(),
            positions: Vec::new(),
            volumes: Vec::new(),
            ms: Vec::new(),
        }
    }

    pub(super) fn push(&mut self, positions: &[DVec3], volume: f64) {
        self.positions.extend_from_slice(positions);
        self.volumes.push(volume);
    }

    /// Mean time of a frame in ms; 0 without timed frames.
    #[must_use]
    pub fn ms_per_frame(&self) -> f64 {
        self.ms.iter().sum::<f64>() / self.ms.len().max(1) as f64
    }

    /// The time of the fastest frame in ms.
    #[must_use]
    pub fn fastest_ms(&self) -> f64 {
        self.ms.iter().copied().reduce(f64::min).unwrap_or(0.0)
    }

    /// The time of the slowest frame in ms.
    #[must_use]
    pub fn slowest_ms(&self) -> f64 {
        self.ms.iter().copied().fold(0.0, f64::max)
    }

    /// Keeps for each frame the shorter time, of another run of the same scene.
    pub fn keep_fastest(&mut self, other: &Self) {
        for (ms, &again) in self.ms.iter_mut().zip(&other.ms) {
            *ms = ms.min(again);
        }
    }

    /// Returns the deviation from another motion. A diverged motion gives a finite value, too.
    ///
    /// # Panics
    /// If the motions are not of the same particles and frames.
    #[must_use]
    pub fn deviation(&self, from: &Self) -> Deviation {
        assert!(
            self.positions.len() == from.positions.len()
                && self.volumes.len() == from.volumes.len(),
            "motions of the same particles over the same frames are compared"
        );
        let frames = self.volumes.len().max(1);
        let particles = (self.positions.len() / frames).max(1);
        let pairs = self
            .positions
            .chunks(particles)
            .zip(from.positions.chunks(particles));
        let percent = |part: f64| (100.0 * part).min(f64::MAX);
        let distance = |(a, b): (&[DVec3], &[DVec3])| {
            percent((squares(a, b) / particles as f64).sqrt() / from.size)
        };
        let volumes = self.volumes.iter().zip(&from.volumes);
        let moved = from.positions.chunks(particles);
        let moved: f64 = moved.map(|frame| squares(frame, &from.start)).sum();
        let off = squares(&self.positions, &from.positions);
        let mut deviation = Deviation {
            motion: if off > 0.0 {
                percent((off / moved).sqrt())
            } else {
                0.0
            },
            volume: volumes.fold(0.0, |most, (v, w)| f64::max(most, percent((v - w).abs()))),
            ..Deviation::default()
        };
        for distance in pairs.map(distance) {
            deviation.largest = deviation.largest.max(distance);
            deviation.end = distance;
        }
        deviation
    }

    /// Returns a linear combination of two motions, without times.
    pub(super) fn combined(&self, a: f64, other: &Self, b: f64) -> Self {
        let positions = self.positions.iter().zip(&other.positions);
        let volumes = self.volumes.iter().zip(&other.volumes);
        Self {
            size: self.size,
            start: self.start.clone(),
            positions: positions.map(|(x, y)| *x * a + *y * b).collect(),
            volumes: volumes.map(|(v, w)| v * a + w * b).collect(),
            ms: Vec::new(),
        }
    }
}

/// The sum of the squared distances of particles.
fn squares(a: &[DVec3], b: &[DVec3]) -> f64 {
    let pairs = a.iter().zip(b);
    pairs.map(|(x, y)| x.distance_squared(*y)).sum()
}

/// The volume of a mesh at some positions, as a part of that at rest; 1 if nothing is left.
pub(super) fn volume(mesh: &TetMesh, positions: &[DVec3]) -> f64 {
    let now = mesh
        .tets
        .iter()
        .map(|tet| signed_volume(tet.map(|p| positions[p.index()])));
    let rest: f64 = (0..mesh.tets.len())
        .map(|t| mesh.volume(TetId::new(t)))
        .sum();
    if rest > 0.0 {
        now.sum::<f64>() / rest
    } else {
        1.0
    }
}
