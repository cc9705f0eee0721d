//! A beam that is held at one end and falls under gravity from rest: its motion by any method, and what it should be.
//!
//! What it should be is the motion of the same tets in the limit of small steps, by the reference: implicit Euler with
//! Newton's method at three steps, from which Richardson's extrapolation removes the first two orders of the error. How
//! much removing the second has changed is an upper estimate of what is left.

use std::time::Instant;

use incise::mesh::generate::kuhn_box;
use incise::mesh::glam::DVec3;
use incise::mesh::{ParticleId, TetId, TetMesh};
use incise::xpbd::{Material, Real, Solver};
use incise_reference::Body;

use super::body::body;
use super::runner::{Recipe, Runner};

pub(crate) const GRAVITY: DVec3 = DVec3::new(0.0, 0.0, -9.81);
/// Time of a frame in s.
pub(crate) const FRAME: f64 = 1.0 / 60.0;
/// The angular frequency of the slowest vibration in 1/s by Euler and Bernoulli, `1.875² √(E I / ρ A L⁴)`.
pub(crate) const RATE: f64 = 8.0;

/// A soft beam of 1 m × 0.25 m × 0.25 m.
pub(crate) struct Beam {
    pub(crate) mesh: TetMesh,
    pub(crate) material: Material,
    /// The particle in the middle of the free end.
    pub(crate) tip: usize,
    frames: usize,
}

/// Where the tip is after each frame, what the volume is, and how long the frame has taken.
pub(crate) struct Motion {
    tips: Vec<DVec3>,
    /// As a fraction of the volume at rest.
    volumes: Vec<f64>,
    /// In s.
    pub(crate) times: Vec<f64>,
}

/// The largest differences of two motions over all frames, in %: of the tip as a part of its largest deflection, of the
/// volume as a part of that at rest.
#[derive(Clone, Copy)]
pub(crate) struct Difference {
    pub(crate) tip: f64,
    pub(crate) volume: f64,
}

impl Beam {
    pub(crate) fn new(poisson_ratio: f64, quick: bool) -> Self {
        let cells = if quick { [8, 2, 2] } else { [16, 4, 4] };
        let mesh = kuhn_box(cells, DVec3::new(1.0, 0.25, 0.25));
        let end = DVec3::new(1.0, 0.125, 0.125);
        let distances = mesh.positions.iter().map(|x| x.distance(end)).enumerate();
        let nearest = distances.min_by(|a, b| a.1.total_cmp(&b.1));
        Self {
            tip: nearest.map_or(0, |(p, _)| p),
            mesh,
            material: Material {
                young_modulus: 1e6,
                poisson_ratio,
                density: 1000.0,
                damping: 0.0,
            },
            frames: if quick { 6 } else { 30 },
        }
    }

    pub(crate) fn solver<R: Real>(&self) -> anyhow::Result<Solver<R>> {
        body(&self.mesh, self.material, |x| x.x == 0.0)
    }

    pub(crate) fn reference(&self) -> anyhow::Result<Body> {
        let material = incise_reference::Material {
            young_modulus: self.material.young_modulus,
            poisson_ratio: self.material.poisson_ratio,
            density: self.material.density,
        };
        let tets: Vec<[u32; 4]> = self
            .mesh
            .tets
            .iter()
            .map(|t| t.map(|ParticleId(p)| p))
            .collect();
        let mut body = Body::new(&self.mesh.positions, &tets, |_tet| material)?;
        for (fixed, x) in body.fixed.iter_mut().zip(&self.mesh.positions) {
            *fixed = x.x == 0.0;
        }
        Ok(body)
    }

    /// By a method of the solver.
    pub(crate) fn run<R: Real>(&self, recipe: &Recipe) -> anyhow::Result<Motion> {
        let runner = Runner::<R>::new(self.solver()?, &self.mesh, recipe)?;
        self.motion(runner, |runner| {
            let start = Instant::now();
            runner.frame()?;
            let time = start.elapsed().as_secs_f64();
            let volume = runner.solver.volume();
            let tip = runner.solver.position(self.tip);
            Ok((tip, volume.total / volume.rest, time))
        })
    }

    /// By implicit Euler and Newton's method.
    pub(crate) fn newton(&self, substeps: u32) -> anyhow::Result<Motion> {
        let rest: Vec<f64> = (0..self.mesh.tets.len())
            .map(|t| self.mesh.volume(TetId::new(t)))
            .collect();
        let all: f64 = rest.iter().sum();
        self.motion(self.reference()?, |body| {
            let start = Instant::now();
            for _ in 0..substeps {
                body.step(FRAME / f64::from(substeps), GRAVITY)?;
            }
            let time = start.elapsed().as_secs_f64();
            let ratio = |t: usize| body.deformation(t).determinant();
            let volume: f64 = rest.iter().enumerate().map(|(t, v)| v * ratio(t)).sum();
            Ok((body.positions[self.tip], volume / all, time))
        })
    }

    fn motion<S>(
        &self,
        mut state: S,
        mut frame: impl FnMut(&mut S) -> anyhow::Result<(DVec3, f64, f64)>,
    ) -> anyhow::Result<Motion> {
        let mut motion = Motion {
            tips: Vec::new(),
            volumes: Vec::new(),
            times: Vec::new(),
        };
        for _ in 0..self.frames {
            let (tip, volume, time) = frame(&mut state)?;
            motion.tips.push(tip);
            motion.volumes.push(volume);
            motion.times.push(time);
        }
        Ok(motion)
    }

    /// The motion in the limit of small steps, from runs with `substeps` a frame, twice and four times as many, and an
    /// upper estimate of its error.
    pub(crate) fn limit(&self, substeps: u32) -> anyhow::Result<(Motion, Difference)> {
        let [a, b, c] = [1, 2, 4].map(|n| self.newton(n * substeps));
        let (a, b, c) = (a?, b?, c?);
        let coarse = a.combined(-1.0, &b, 2.0);
        let fine = b.combined(-1.0, &c, 2.0);
        let limit = coarse.combined(-1.0 / 3.0, &fine, 4.0 / 3.0);
        let left = self.difference(&fine, &limit);
        Ok((limit, left))
    }

    /// How far a motion is from the one that it should be.
    pub(crate) fn difference(&self, motion: &Motion, limit: &Motion) -> Difference {
        let rest = self.mesh.positions[self.tip];
        let way = limit.tips.iter().map(|x| x.distance(rest));
        let tips = motion.tips.iter().zip(&limit.tips);
        let volumes = motion.volumes.iter().zip(&limit.volumes);
        Difference {
            tip: 100.0 * largest(tips.map(|(x, y)| x.distance(*y))) / largest(way),
            volume: 100.0 * largest(volumes.map(|(v, w)| (v - w).abs())),
        }
    }

    /// The largest distance of the tip from its place at rest in m.
    pub(crate) fn deflection(&self, motion: &Motion) -> f64 {
        let rest = self.mesh.positions[self.tip];
        largest(motion.tips.iter().map(|x| x.distance(rest)))
    }
}

impl Motion {
    /// A linear combination; it has taken no time.
    fn combined(&self, a: f64, other: &Self, b: f64) -> Self {
        let tips = self.tips.iter().zip(&other.tips);
        let volumes = self.volumes.iter().zip(&other.volumes);
        Self {
            tips: tips.map(|(x, y)| *x * a + *y * b).collect(),
            volumes: volumes.map(|(v, w)| v * a + w * b).collect(),
            times: Vec::new(),
        }
    }
}

/// The largest of some values that are not negative.
fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, f64::max)
}
