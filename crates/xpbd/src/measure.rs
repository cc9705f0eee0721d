//! Measurements of a state: energies, volume, kappa. Computed on request, in double precision.
//!
//! Sums are sequential in the order of particles and tets, so the numbers do not depend on the number of threads. Cost:
//! a pass over particles or tets.

use glam::{DMat3, DVec3};

use crate::{Float, Solver};

/// Energies in J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Kinetic energy.
    pub kinetic: f64,
    /// Elastic energy; 0 at rest.
    pub elastic: f64,
    /// Gravitational energy, relative to the origin of the world; 0 without gravity.
    pub gravity: f64,
}

/// Volumes of the present tets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Volume {
    /// Sum of the signed volumes in m³.
    pub total: f64,
    /// Sum of the volumes at rest in m³.
    pub rest: f64,
    /// The smallest volume of a tet as a fraction of its rest volume (1 without tets); negative means inverted.
    pub min_ratio: f64,
    /// Number of tets with no volume or a negative one.
    pub inverted: usize,
}

/// Tets that were made softer than their material by [`Solver::limit_kappa`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Softened {
    /// Number of softened tets.
    pub tets: usize,
    /// Share of the softened tets in the volume at rest.
    pub volume_fraction: f64,
    /// Largest factor by which the stiffness of a tet was divided.
    pub strongest: f64,
}

/// Tets of a smaller volume at rest, as a fraction of the mean, are slivers.
const SLIVER_VOLUME: f64 = 0.01;

impl<R: Float> Solver<R> {
    /// Returns the energies of the present state.
    #[must_use]
    pub fn energy(&self, gravity: Option<DVec3>) -> Energy {
        let mut energy = Energy::default();
        for p in 0..self.particle_count() {
            energy.kinetic += 0.5 * self.particles.masses[p] * self.velocity(p).length_squared();
            energy.gravity -=
                gravity.map_or(0.0, |g| self.particles.masses[p] * g.dot(self.position(p)));
        }
        for tet in &self.tets.list {
            let tet = tet.to_f64();
            energy.elastic += tet.energy(&tet.evaluate(self.particles.corners(tet.particles)));
        }
        energy
    }

    /// Returns the part of the elastic energy in J that tets of less than a hundredth of the mean volume hold. The thinner a
    /// tet, the stiffer it is, so an error of a thousandth of an edge in one of them can be more energy than all others hold.
    /// O(tets).
    #[must_use]
    pub fn sliver_energy(&self) -> f64 {
        let volumes = &self.tets.rest_volumes;
        let least = SLIVER_VOLUME * volumes.iter().sum::<f64>() / volumes.len() as f64;
        let slivers = self.tets.list.iter().zip(volumes);
        slivers
            .filter(|(_, volume)| **volume < least)
            .map(|(tet, _)| {
                let tet = tet.to_f64();
                tet.energy(&tet.evaluate(self.particles.corners(tet.particles)))
            })
            .sum()
    }

    /// Returns the volumes of the present state.
    #[must_use]
    pub fn volume(&self) -> Volume {
        let mut volume = Volume {
            total: 0.0,
            rest: 0.0,
            min_ratio: 1.0,
            inverted: 0,
        };
        for t in 0..self.tet_count() {
            let (rest, ratio) = (self.tets.rest_volumes[t], self.gradient(t).determinant());
            volume.rest += rest;
            volume.total += rest * ratio;
            volume.min_ratio = volume.min_ratio.min(ratio);
            volume.inverted += usize::from(ratio <= 0.0);
        }
        volume
    }

    /// Returns the fraction of the volume at rest in tets that have no volume or a negative one; 0 without tets. O(tets).
    #[must_use]
    pub fn inverted_fraction(&self) -> f64 {
        let volumes = &self.tets.rest_volumes;
        let inverted = (0..self.tet_count()).filter(|&t| self.gradient(t).determinant() <= 0.0);
        let volume: f64 = inverted.map(|t| volumes[t]).sum();
        let all: f64 = volumes.iter().sum();
        if all > 0.0 { volume / all } else { 0.0 }
    }

    /// Returns the largest speed of a particle in m/s.
    #[must_use]
    pub fn max_speed(&self) -> f64 {
        (0..self.particle_count())
            .map(|p| self.velocity(p).length())
            .fold(0.0, f64::max)
    }

    /// Returns the largest kappa of a tet, `E Δt² / (ρ h²)` with h the smallest altitude: the square of the number of
    /// tets that a stress wave crosses in a substep of `substep_time`. Up to about 0.5 a substep of one iteration is
    /// accurate. In the block and sequential forms a body at rest is stable up to 1 and unstable from 4 on.
    #[must_use]
    pub fn kappa(&self, substep_time: f64) -> f64 {
        (0..self.tet_count())
            .map(|t| self.kappa_of(t, substep_time))
            .fold(0.0, f64::max)
    }

    /// Returns the kappa of one tet: see [`Solver::kappa`].
    ///
    /// # Panics
    /// If the tet does not exist.
    #[must_use]
    pub fn kappa_of(&self, tet: usize, substep_time: f64) -> f64 {
        let material = self.tets.material(tet);
        self.tets.list[tet].kappa(material, substep_time)
    }

    /// Returns number and volume of the tets softened by [`Solver::limit_kappa`]. O(tets).
    #[must_use]
    pub fn softened(&self) -> Softened {
        let mut softened = Softened {
            tets: 0,
            volume_fraction: 0.0,
            strongest: 1.0,
        };
        for t in 0..self.tet_count() {
            let factor = self.softening(t);
            // Single precision keeps seven digits of it.
            if factor > 1.0 + 1e-5 {
                softened.tets += 1;
                softened.volume_fraction += self.tets.rest_volumes[t];
                softened.strongest = softened.strongest.max(factor);
            }
        }
        let volume = self.tets.rest_volumes.iter().sum::<f64>();
        softened.volume_fraction /= volume.max(f64::MIN_POSITIVE);
        softened
    }

    fn inverse_rest(&self, tet: usize) -> DMat3 {
        let q = self.tets.list[tet].inverse_rest.map(R::to_f64);
        DMat3::from_cols_array(&q).transpose()
    }

    fn gradient(&self, tet: usize) -> DMat3 {
        let [a, b, c, d] = self.particles.corners(self.tets.list[tet].particles);
        DMat3::from_cols(b - a, c - a, d - a) * self.inverse_rest(tet)
    }

    /// By how much a tet was softened: 1 if not at all, also if it is too flat to take part.
    fn softening(&self, tet: usize) -> f64 {
        let material = self.tets.material(tet);
        match self.tets.list[tet].stiffness.to_f64() {
            0.0 => 1.0,
            stiffness => material.mu() * self.tets.rest_volumes[tet] / stiffness,
        }
    }
}
