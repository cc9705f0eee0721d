//! [`Particles`]: positions, velocities and masses, and the two passes over them that begin and end a substep.
//!
//! A position shares a cell with the inverse mass, which is 0 for a particle that constraints do not move: fixed,
//! rigidly attached or without mass. Cells are atomic ([`Float::Particle`]), so constraints move particles through a
//! shared reference. Cost: one pass each over the particles.

use glam::DVec3;
use rayon::prelude::*;

use crate::Float;
use crate::float::{finite, load, store, weight};

/// Particles a thread takes at a time.
pub(crate) const PARALLEL_PARTICLES: usize = 4096;

/// The particles of a solver.
#[derive(Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = ""))]
pub(crate) struct Particles<R: Float> {
    /// What positions are relative to.
    pub(crate) origin: DVec3,
    /// The longest side of the bounding box at the start in m.
    pub(crate) size: f64,
    /// Position and inverse mass of each particle, together in one cache line part.
    pub(crate) cells: Vec<R::Particle>,
    /// Positions at the start of the substep.
    pub(crate) previous: Vec<R::Vector>,
    pub(crate) velocities: Vec<R::Vector>,
    pub(crate) masses: Vec<f64>,
    pub(crate) fixed: Vec<bool>,
    /// While forces are measured, of each particle with an inverse mass of 0: the sum of the products of mass and motion
    /// that constraints would have moved it by. Else empty.
    #[cfg_attr(feature = "serde", serde(skip))]
    pub(crate) refused: Vec<R::Particle>,
}

impl<R: Float> Clone for Particles<R> {
    fn clone(&self) -> Self {
        let cells = self.cells.iter().map(|cell| R::particle(R::read(cell)));
        Self {
            origin: self.origin,
            size: self.size,
            cells: cells.collect(),
            previous: self.previous.clone(),
            velocities: self.velocities.clone(),
            masses: self.masses.clone(),
            fixed: self.fixed.clone(),
            refused: Vec::new(),
        }
    }
}

impl<R: Float> Particles<R> {
    /// No particles yet; `size` is the longest side of the bounding box of those to come.
    pub(crate) fn new(origin: DVec3, size: f64) -> Self {
        Self {
            origin,
            size,
            cells: Vec::new(),
            previous: Vec::new(),
            velocities: Vec::new(),
            masses: Vec::new(),
            fixed: Vec::new(),
            refused: Vec::new(),
        }
    }

    /// Number of particles.
    pub(crate) fn len(&self) -> usize {
        self.cells.len()
    }

    /// Bytes of all arrays.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(&*self.cells)
            + size_of_val(&*self.previous)
            + size_of_val(&*self.velocities)
            + size_of_val(&*self.masses)
            + size_of_val(&*self.fixed)
    }

    /// Appends a particle without mass and returns its number.
    ///
    /// # Panics
    /// If the position is not finite.
    pub(crate) fn push(&mut self, x: R::Vector, velocity: R::Vector, fixed: bool) -> usize {
        assert!(finite::<R>(x), "positions are finite");
        let [a, b, c] = R::components(x);
        self.cells.push(R::particle([a, b, c, R::ZERO]));
        self.previous.push(x);
        self.velocities.push(velocity);
        self.masses.push(0.0);
        self.fixed.push(fixed);
        self.cells.len() - 1
    }

    /// Removes the particles from number `count` on.
    pub(crate) fn truncate(&mut self, count: usize) {
        self.cells.truncate(count);
        self.previous.truncate(count);
        self.velocities.truncate(count);
        self.masses.truncate(count);
        self.fixed.truncate(count);
    }

    /// The position of a particle relative to the origin.
    #[inline]
    pub(crate) fn vector(&self, particle: usize) -> R::Vector {
        load::<R>(&self.cells[particle])
    }

    /// The position of a particle relative to the origin, in double precision.
    pub(crate) fn local(&self, particle: usize) -> DVec3 {
        R::to_dvec3(self.vector(particle))
    }

    /// The position of a particle in the world.
    pub(crate) fn position(&self, particle: usize) -> DVec3 {
        self.origin + self.local(particle)
    }

    /// The positions of the corners of a tet relative to the origin, in double precision.
    pub(crate) fn corners(&self, tet: [u32; 4]) -> [DVec3; 4] {
        tet.map(|p| self.local(p as usize))
    }

    /// The inverse mass of a particle in 1/kg; 0 if forces do not move it.
    #[inline]
    pub(crate) fn weight(&self, particle: usize) -> R {
        weight::<R>(&self.cells[particle])
    }

    /// Whether forces move a particle.
    #[inline]
    pub(crate) fn is_free(&self, particle: usize) -> bool {
        self.weight(particle) > R::ZERO
    }

    /// Begins to keep what held particles are refused.
    pub(crate) fn keep_refused(&mut self) {
        self.refused.clear();
        self.refused
            .resize_with(self.cells.len(), || R::particle([R::ZERO; 4]));
    }

    /// Whether what held particles are refused is kept.
    #[inline]
    pub(crate) fn keeps_refused(&self) -> bool {
        !self.refused.is_empty()
    }

    /// Keeps what a constraint would have moved a particle by, times its mass, if that is held.
    #[cold]
    pub(crate) fn refuse(&self, particle: u32, impulse: R::Vector) {
        if !self.is_free(particle as usize) {
            add_to::<R>(&self.refused[particle as usize], impulse);
        }
    }

    /// Recomputes the inverse mass of a particle, which is 0 where it is held; returns whether it has changed.
    pub(crate) fn update_weight(&mut self, particle: usize, attached: bool) -> bool {
        let inverse = R::from_f64(1.0 / self.masses[particle]);
        // A mass so small that its inverse overflows belongs to a speck that could only do harm if it moved.
        let free = !(self.fixed[particle] || attached) && inverse.is_finite();
        let [x, y, z, before] = R::read(&self.cells[particle]);
        let weight = if free { inverse } else { R::ZERO };
        R::write(&self.cells[particle], [x, y, z, weight]);
        weight != before
    }

    /// Particles that a thread is given at once: all of them unless they are `shared` by several threads.
    fn chunk(&self, shared: bool) -> usize {
        match shared {
            true => PARALLEL_PARTICLES,
            false => self.cells.len().max(1),
        }
    }

    /// Moves every free particle by its velocity for `time`, after gravity has changed that by `change`. `shared` says
    /// whether on several threads.
    pub(crate) fn predict(&mut self, change: Option<R::Vector>, time: R, shared: bool) {
        let chunk = self.chunk(shared);
        let cells = self.cells.par_chunks_mut(chunk);
        cells
            .zip(self.previous.par_chunks_mut(chunk))
            .zip(self.velocities.par_chunks_mut(chunk))
            .for_each(|((cells, previous), velocities)| {
                for ((cell, previous), velocity) in cells.iter_mut().zip(previous).zip(velocities) {
                    let [x, y, z, weight] = R::read_alone(cell);
                    *previous = R::vector(x, y, z);
                    if weight > R::ZERO {
                        if let Some(change) = change {
                            *velocity += change;
                        }
                        let [x, y, z] = R::components(*previous + *velocity * time);
                        R::write_alone(cell, [x, y, z, weight]);
                    }
                }
            });
    }

    /// Adds the corrections to the velocities; returns how many particles had to be put back. `shared` says whether on
    /// several threads.
    ///
    /// In exact numbers the velocity is the motion over the time. But positions are rounded, and a velocity taken from
    /// them would be wrong by their last digit over the time: in single precision a body in free fall would lose a
    /// hundredth of its speed, and far from the origin it would hang in the air. The prediction, computed again to the
    /// same bits, tells what part of the motion is correction; without correction the velocity stays as it is.
    pub(crate) fn update_velocities(&mut self, time: R, per_time: R, shared: bool) -> usize {
        let chunk = self.chunk(shared);
        let cells = self.cells.par_chunks_mut(chunk);
        cells
            .zip(self.previous.par_chunks(chunk))
            .zip(self.velocities.par_chunks_mut(chunk))
            .map(|((cells, previous), velocities)| {
                let mut repaired = 0;
                for ((cell, previous), velocity) in cells.iter_mut().zip(previous).zip(velocities) {
                    let [x, y, z, weight] = R::read_alone(cell);
                    let x = R::vector(x, y, z);
                    if weight <= R::ZERO {
                        *velocity = R::Vector::default();
                        // Held, it gets no share of any correction, but no share of an infinite one is not a number.
                        if !finite::<R>(x) {
                            store::<R>(cell, *previous);
                            repaired += 1;
                        }
                        continue;
                    }
                    let predicted = *previous + *velocity * time;
                    let speed = *velocity + (x - predicted) * per_time;
                    let finite = finite::<R>(speed);
                    *velocity = if finite { speed } else { R::Vector::default() };
                    if !finite {
                        store::<R>(cell, *previous);
                        repaired += 1;
                    }
                }
                repaired
            })
            .sum()
    }
}

/// Adds to the vector of a cell.
#[inline]
pub(crate) fn add_to<R: Float>(cell: &R::Particle, change: R::Vector) {
    let ([x, y, z, w], [a, b, c]) = (R::read(cell), R::components(change));
    R::write(cell, [x + a, y + b, z + c, w]);
}

/// The number of a particle, tet or constraint in 32 bits.
///
/// # Panics
/// With 2³² of them or more.
pub(crate) fn number(index: usize) -> u32 {
    u32::try_from(index).expect("particles, tets and constraints are numbered in 32 bits")
}
