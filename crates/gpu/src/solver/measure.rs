//! [`GpuSolver::measure`]: energies, volume and speed of the state, computed on the device.
//!
//! At most 256 workgroups sum over tets and particles in trees of a fixed order; the host adds their sums in double
//! precision. Large values that do not change stay on the host: volumes at rest and the origin's height. Twins:
//! `Solver::energy`, `Solver::volume`, `Solver::max_speed` of incise-xpbd. Memory: 12 kB and 4 bytes per particle from
//! the first call on. Cost: two dispatches, a wait for the device, 12 kB read; 4 bytes per particle sent and O(tets) on
//! the host after edits.

use glam::DVec3;
use incise_xpbd::{Energy, Solver, Volume};
use wgpu::BufferUsages;

use super::GpuSolver;
use super::gpu_types::{ParticleSums, TetSums, Units};
use super::kernels::{MEASURE_PARTICLES, MEASURE_TETS, Variant};
use super::layout::{THREADS, slope};
use crate::array::Array;
use crate::kernel::Recorder;
use crate::{GpuContext, GpuError};

/// Largest number of workgroups, each of which writes a sum.
const GROUPS: usize = 256;

/// Energies, volumes and largest speed of a state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measures {
    /// Energies in J.
    pub energy: Energy,
    /// Volumes in m³.
    pub volume: Volume,
    /// The largest speed of a particle in m/s.
    pub max_speed: f64,
}

impl Measures {
    /// Measures a solver on the host, in double precision.
    fn of(solver: &Solver<f32>, gravity: Option<DVec3>) -> Self {
        Self {
            energy: solver.energy(gravity),
            volume: solver.volume(),
            max_speed: solver.max_speed(),
        }
    }

    fn are_finite(&self) -> bool {
        let Self {
            energy,
            volume,
            max_speed,
        } = self;
        let energies = energy.kinetic + energy.elastic + energy.gravity;
        (energies + volume.total + volume.min_ratio + max_speed).is_finite()
    }
}

/// Data of measurements beside the body.
#[derive(Debug)]
pub(crate) struct Measuring {
    /// True if tets or particles have changed since the last measurement.
    pub(crate) stale: bool,
    units: Array<Units>,
    sent: Option<Units>,
    /// Masses of the particles, in units of the mean.
    masses: Array<f32>,
    tet_sums: Array<TetSums>,
    particle_sums: Array<ParticleSums>,
    constants: Constants,
}

/// Constants that the host adds.
#[derive(Clone, Copy, Debug, Default)]
struct Constants {
    /// Mass of all particles in kg.
    mass: f64,
    mean_mass: f64,
    /// Volume of all tets in m³.
    volume: f64,
    /// Volume at rest, in m³, of the tets that are measured.
    taking_part: f64,
    mean_volume: f64,
}

impl Constants {
    fn of(solver: &Solver<f32>) -> Self {
        let (particles, tets) = (solver.particle_count(), solver.tet_count());
        let mass: f64 = (0..particles).map(|p| solver.mass(p)).sum();
        let (mut volume, mut taking_part, mut number) = (0.0, 0.0, 0usize);
        for tet in 0..tets {
            let of_tet = solver.rest_volume(tet);
            volume += of_tet;
            if solver.takes_part(tet) {
                taking_part += of_tet;
                number += 1;
            }
        }
        // With no mass or volume the unit does not matter.
        let mean = |sum: f64, number: usize| match sum > 0.0 {
            true => sum / number as f64,
            false => 1.0,
        };
        Self {
            mass,
            mean_mass: mean(mass, particles),
            volume,
            taking_part,
            mean_volume: mean(taking_part, number),
        }
    }
}

impl Measuring {
    fn new(gpu: &GpuContext) -> Result<Self, GpuError> {
        Ok(Self {
            stale: true,
            units: Array::with_usage(gpu, "units", 1, BufferUsages::UNIFORM)?,
            sent: None,
            masses: Array::zeros(gpu, "masses", 0)?,
            tet_sums: Array::zeros(gpu, "sums over tets", GROUPS)?,
            particle_sums: Array::zeros(gpu, "sums over particles", GROUPS)?,
            constants: Constants::default(),
        })
    }

    pub(crate) fn bytes(&self) -> u64 {
        let sums = self.tet_sums.buffer().size() + self.particle_sums.buffer().size();
        sums + self.masses.buffer().size() + self.units.buffer().size()
    }

    /// Sends the data of the kernels, unless the device has them.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the device computes in single precision"
    )]
    fn sync(
        &mut self,
        gpu: &GpuContext,
        solver: &Solver<f32>,
        tet_slots: usize,
    ) -> Result<(), GpuError> {
        if self.stale {
            let constants = Constants::of(solver);
            let masses = (0..solver.particle_count()).map(|p| solver.mass(p));
            let masses: Vec<f32> = masses.map(|m| (m / constants.mean_mass) as f32).collect();
            self.masses.replace(gpu, &masses)?;
            self.constants = constants;
            self.stale = false;
        }
        let units = Units {
            tet_slots: u32::try_from(tet_slots).expect("tet_slots are numbered by 32 bits"),
            length: self.constants.mean_volume.cbrt() as f32,
            slope: match solver.tet_count() {
                0 => 0.0,
                _ => slope(solver.tet_data(0).constants),
            },
            unused: 0,
        };
        if self.sent != Some(units) {
            self.units.write(gpu, 0, &[units]);
            self.sent = Some(units);
        }
        Ok(())
    }

    /// The total of the sums of all workgroups.
    fn total(
        &self,
        of_tets: &[TetSums],
        of_particles: &[ParticleSums],
        origin: DVec3,
        gravity: Option<DVec3>,
    ) -> Measures {
        let constants = &self.constants;
        let (mut energy, mut change) = (Energy::default(), 0.0);
        let mut volume = Volume {
            total: 0.0,
            rest: constants.volume,
            min_ratio: 1.0,
            inverted: 0,
        };
        for sums in of_tets {
            energy.elastic += f64::from(sums.energy);
            change += f64::from(sums.change);
            volume.min_ratio = volume.min_ratio.min(f64::from(sums.least));
            volume.inverted += sums.inverted as usize;
        }
        volume.total = constants.taking_part + change * constants.mean_volume;
        let (mut moment, mut speed_squared) = (DVec3::ZERO, 0.0_f64);
        for sums in of_particles {
            energy.kinetic += f64::from(sums.kinetic) * constants.mean_mass;
            moment += DVec3::from_array(sums.moment.map(f64::from)) * constants.mean_mass;
            speed_squared = speed_squared.max(f64::from(sums.speed_squared));
        }
        let moment = origin * constants.mass + moment;
        energy.gravity = gravity.map_or(0.0, |gravity| -gravity.dot(moment));
        Measures {
            energy,
            volume,
            max_speed: speed_squared.sqrt(),
        }
    }
}

impl GpuSolver {
    /// Computes energies, volume and largest speed of the present state on the device; waits for it and reads some kB,
    /// whatever the size of the body. Also updates [`GpuSolver::repaired`].
    ///
    /// The device computes in single precision, relative to rest. Kinetic energy, speed, volume and smallest ratio
    /// differ from [`Solver::energy`], [`Solver::volume`] and [`Solver::max_speed`] by about 1e-7, the elastic energy
    /// by 3e-6 at a strain of 4e-4. Errors of small strains are largest in slivers, since a strain has a rounding error
    /// of about 2e-8. For more precision, use the solver of [`GpuSolver::host`]. A tet whose volume is within rounding
    /// of zero may count as inverted here but not on the host. Where single precision overflows and where the schedule
    /// does not solve all tets, the state is fetched and the host's values are returned; without a step since the last
    /// fetch, the device is not used.
    /// # Example
    /// A particle of 2 kg falls for a tenth of a second.
    /// ```
    /// # use std::sync::Arc;
    /// # use glam::DVec3;
    /// # use incise_gpu::{ClusterMapping, GpuContext, GpuError, GpuOptions, GpuSolver};
    /// # use incise_graph::{Clustering, Coloring, Schedule};
    /// # use incise_xpbd::{Solver, StepSettings};
    /// # let gpu = match GpuContext::new(&GpuOptions::from_env()) {
    /// #     Ok(gpu) => Arc::new(gpu),
    /// #     Err(GpuError::NoAdapter { .. }) => return Ok(()),
    /// #     Err(other) => return Err(other.into()),
    /// # };
    /// # let schedule = Schedule::new(&Clustering::none(0), &Coloring::new(vec![]));
    /// let mut solver = Solver::new(&[DVec3::ZERO]);
    /// solver.set_mass(0, 2.0);
    /// let mut device = GpuSolver::new(gpu, solver, ClusterMapping::Threads)?;
    /// let gravity = Some(DVec3::new(0.0, 0.0, -10.0));
    /// device.step(&schedule, &StepSettings { gravity, ..StepSettings::new(0.1) })?;
    /// let measures = device.measure(gravity)?;
    /// assert!((measures.max_speed - 1.0).abs() < 1e-6);
    /// assert!((measures.energy.kinetic - 1.0).abs() < 1e-6);
    /// assert!((measures.energy.gravity + 2.0).abs() < 1e-6);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// If the device is lost or out of memory.
    ///
    /// # Determinism
    /// Bit-identical on the same device and driver.
    pub fn measure(&mut self, gravity: Option<DVec3>) -> Result<Measures, GpuError> {
        let _span = tracing::debug_span!("gpu::measure").entered();
        if self.ahead && self.body.layout.tet_count() == self.host.tet_count() {
            let measures = self.measure_there(gravity)?;
            if measures.are_finite() {
                return Ok(measures);
            }
        }
        Ok(Measures::of(self.host()?, gravity))
    }

    fn measure_there(&mut self, gravity: Option<DVec3>) -> Result<Measures, GpuError> {
        let Self {
            gpu,
            host,
            kernels,
            body,
            frame,
            ..
        } = self;
        let measuring = match &mut self.measuring {
            Some(measuring) => measuring,
            none => none.insert(Measuring::new(gpu)?),
        };
        let tet_slots = body.layout.tet_slot_count();
        measuring.sync(gpu, host, tet_slots)?;
        let variant = Variant {
            various: !host.is_uniform(),
            tile: body.layout.tile(),
            ..Variant::default()
        };
        let (settings, particles) = (frame.settings(), body.particles.buffer());
        let buffers = [
            settings,
            measuring.units.buffer(),
            particles,
            body.corners.buffer(),
            body.rest.buffer(),
            body.constants.buffer(),
            body.tiles.buffer(),
            measuring.tet_sums.buffer(),
        ];
        let tets = kernels.bind(gpu, &MEASURE_TETS, variant, &buffers)?;
        let buffers = [
            settings,
            particles,
            body.velocities.buffer(),
            measuring.masses.buffer(),
            measuring.particle_sums.buffer(),
        ];
        let plain = Variant::default();
        let of_particles = kernels.bind(gpu, &MEASURE_PARTICLES, plain, &buffers)?;
        let groups = |number: usize| number.div_ceil(THREADS).min(GROUPS);
        let (over_tets, over_particles) = (groups(tet_slots), groups(host.particle_count()));
        let mut encoder = gpu.encoder("measure");
        let mut pass = Recorder::new(gpu, &mut encoder, "measure", None);
        tets.run(&mut pass, &[], over_tets);
        of_particles.run(&mut pass, &[], over_particles);
        drop(pass);
        let of_tets = measuring.tet_sums.copy_out(gpu, &mut encoder, over_tets)?;
        let sums = &measuring.particle_sums;
        let of_particles = sums.copy_out(gpu, &mut encoder, over_particles)?;
        let repaired = self.repaired.copy_out(gpu, &mut encoder, 1)?;
        let submission = gpu.submit(encoder)?;
        let of_tets = of_tets.handed_over(&submission);
        let of_particles = of_particles.handed_over(&submission);
        let repaired = repaired.handed_over(&submission);
        let (of_tets, of_particles) = (of_tets.collect(gpu)?, of_particles.collect(gpu)?);
        self.known_repaired = repaired.collect(gpu)?[0];
        Ok(measuring.total(&of_tets, &of_particles, host.origin(), gravity))
    }
}
