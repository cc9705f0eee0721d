//! One step of the liver from a known state by each method: the basis of Table 3 and Figures 7 and 10.
//!
//! The paper gives material and time step (section 5.2), not density, size or the norm of its residual. Its start is
//! "the first frame after a 2.0x scaling-restoration cycle", taken here as the body at twice its size, released at
//! rest. Three setups: at organ size, where its parameters make the iteration of a large step hopeless (kappa of a
//! million); at a size where the step is well-posed near rest (kappa 1/2); and that size released closer to rest, where
//! the step is well-posed throughout. Intermediate iterations of a step are not accessible, so each count is a separate
//! run.

use std::time::Instant;

use incise::graph::Schedule;
use incise::mesh::TetMesh;
use incise::mesh::glam::DVec3;
use incise::xpbd::{Material, Method, Solver, StepSettings, TetSolve};
use serde::{Deserialize, Serialize};

use super::colorings::one_thread;
use super::paper_mesh::PaperMesh;
use crate::experiment::ExperimentArguments;
use crate::solver::body::{body, scaled, schedule};

/// Section 5.2. The density is chosen here; the meaning of the paper's damping of 0.05 is unknown, and no damping is
/// used.
pub(super) const MATERIAL: Material = Material {
    young_modulus: 1e7,
    poisson_ratio: 0.49,
    density: 1000.0,
    damping: 0.0,
};
/// Time step in s.
pub(super) const TIME_STEP: f64 = 0.016;
/// Size of the body, and its scale factor before release.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Setup {
    Organ,
    Large,
    Gentle,
}

impl Setup {
    pub(super) const ALL: [Self; 3] = [Self::Organ, Self::Large, Self::Gentle];

    pub(super) fn id(self) -> &'static str {
        match self {
            Self::Organ => "organ",
            Self::Large => "large",
            Self::Gentle => "gentle",
        }
    }

    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Organ => "0.2 m long, as an organ, let go at twice its size",
            Self::Large => "so large that kappa is 1/2, let go at twice its size",
            Self::Gentle => "so large that kappa is 1/2, let go at 1.1 times its size",
        }
    }

    fn scaled(self) -> f64 {
        match self {
            Self::Organ | Self::Large => 2.0,
            Self::Gentle => 1.1,
        }
    }
}

/// The methods of Table 3: all cluster sizes of Gauss-Seidel, Jacobi, Chebyshev; and what this project does by default.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum PaperMethod {
    /// In clusters of this size; 1 is none.
    GaussSeidel(u32),
    Jacobi,
    Chebyshev,
    /// Gauss-Seidel in split form with relaxation 1, in clusters of 10: not in the paper.
    Split,
}

impl PaperMethod {
    pub(super) const ALL: [Self; 9] = [
        Self::GaussSeidel(1),
        Self::GaussSeidel(5),
        Self::GaussSeidel(10),
        Self::GaussSeidel(15),
        Self::GaussSeidel(20),
        Self::GaussSeidel(25),
        Self::Jacobi,
        Self::Chebyshev,
        Self::Split,
    ];

    /// The method and its cluster size, as in the paper's table.
    pub(super) fn parts(self) -> (&'static str, u32) {
        match self {
            Self::GaussSeidel(size) => ("gauss-seidel", size),
            Self::Jacobi => ("jacobi", 1),
            Self::Chebyshev => ("chebyshev", 1),
            Self::Split => ("split", 10),
        }
    }

    pub(super) fn id(self) -> String {
        let (name, size) = self.parts();
        format!("{name}-{size}")
    }

    pub(super) fn words(self) -> String {
        match self {
            Self::GaussSeidel(1) => "Gauss-Seidel".to_owned(),
            Self::GaussSeidel(size) => format!("Gauss-Seidel, clusters of {size}"),
            Self::Jacobi => "Jacobi".to_owned(),
            Self::Chebyshev => "Chebyshev".to_owned(),
            Self::Split => "split form, clusters of 10 (not in the paper)".to_owned(),
        }
    }

    fn settings(self, iterations: u32) -> StepSettings {
        let (method, relaxation) = match self {
            Self::GaussSeidel(_) => (Method::GaussSeidel, 0.8),
            Self::Split => (Method::GaussSeidel, 1.0),
            Self::Jacobi => (Method::Jacobi, 0.1),
            // The paper names no radius.
            Self::Chebyshev => (
                Method::Chebyshev {
                    spectral_radius: 0.99,
                    chebyshev_start: 10,
                },
                0.1,
            ),
        };
        StepSettings {
            method,
            relaxation,
            iterations,
            tet_solve: match self {
                Self::Split => TetSolve::Split,
                _ => TetSolve::Sequential,
            },
            ..StepSettings::new(TIME_STEP)
        }
    }
}

/// Residuals after some iterations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Point {
    pub(super) iterations: u32,
    /// Time of the whole step in ms.
    pub(super) ms: f64,
    /// Norm of the residual that XPBD iterates on, `‖C + α̃ λ‖`.
    pub(super) dual: f64,
    /// Norm of the unbalanced force, `‖M (x - x̃) / Δt² + ∇U‖`, relative to its value before the first iteration.
    pub(super) force: f64,
}

impl Point {
    /// True if the values have diverged.
    pub(super) fn diverged(&self) -> bool {
        self.dual.max(self.force) > 1e100
    }
}

/// A body and its method.
pub(super) struct Trial {
    pub(super) mesh: TetMesh,
    schedule: Schedule,
    solving: PaperMethod,
    /// Scale factor before release.
    scaled: f64,
    /// Force at the start in N.
    start: f64,
}

impl Trial {
    pub(super) fn new(
        setup: Setup,
        solving: PaperMethod,
        arguments: &ExperimentArguments,
    ) -> anyhow::Result<Self> {
        let mesh = PaperMesh::named("liver_11k")?.mesh(arguments)?;
        let size = match setup {
            Setup::Organ => 0.2,
            // Kappa is proportional to the square of step over size.
            Setup::Large | Setup::Gentle => {
                let unit = body::<f64>(&scaled(&mesh, 1.0), MATERIAL, |_| false)?;
                (unit.kappa(TIME_STEP) / 0.5).sqrt()
            }
        };
        let mesh = scaled(&mesh, size);
        let clustering = match solving {
            PaperMethod::GaussSeidel(1) | PaperMethod::Jacobi | PaperMethod::Chebyshev => {
                "none".to_owned()
            }
            PaperMethod::GaussSeidel(_) | PaperMethod::Split => {
                format!("serial:{}", solving.parts().1)
            }
        };
        let schedule = schedule(&mesh, &clustering)?;
        let mut trial = Self {
            mesh,
            schedule,
            solving,
            scaled: setup.scaled(),
            start: 1.0,
        };
        trial.start = norm(&trial.forces(&trial.released()?)?);
        Ok(trial)
    }

    /// Scaled body at zero velocity.
    pub(super) fn released(&self) -> anyhow::Result<Solver<f64>> {
        let mut solver = body::<f64>(&self.mesh, MATERIAL, |_| false)?;
        for (p, &x) in self.mesh.positions.iter().enumerate() {
            solver.set_position(p, x * self.scaled);
        }
        Ok(solver)
    }

    /// Body after a step of `iterations` iterations, and the time in ms.
    pub(super) fn step(&self, iterations: u32) -> anyhow::Result<(Solver<f64>, f64)> {
        let mut solver = self.released()?;
        solver.lay_out(&self.schedule);
        let settings = self.solving.settings(iterations);
        let ms = one_thread(|| {
            let start = Instant::now();
            solver.step_keeping_residuals(&self.schedule, &settings)?;
            Ok(start.elapsed().as_secs_f64() * 1e3)
        })?;
        Ok((solver, ms))
    }

    pub(super) fn point(&self, iterations: u32) -> anyhow::Result<Point> {
        let (solver, ms) = self.step(iterations)?;
        let residuals = solver.residuals(TIME_STEP);
        let residuals = residuals.ok_or_else(|| anyhow::anyhow!("no residuals were kept"))?;
        Ok(Point {
            iterations,
            ms,
            dual: residuals.dual,
            force: residuals.force / self.start,
        })
    }

    /// The force on each particle that the implicit step leaves out of balance, in N: `M (x - x̃) / Δt² + ∇U(x)`, where
    /// the prediction x̃ is the state it was released in, as there is neither speed nor gravity.
    pub(super) fn forces(&self, solver: &Solver<f64>) -> anyhow::Result<Vec<DVec3>> {
        let tets: Vec<[u32; 4]> = self.mesh.tets.iter().map(|tet| tet.map(|p| p.0)).collect();
        let material = incise_reference::Material {
            young_modulus: MATERIAL.young_modulus,
            poisson_ratio: MATERIAL.poisson_ratio,
            density: MATERIAL.density,
        };
        let mut reference =
            incise_reference::ReferenceBody::new(&self.mesh.positions, &tets, |_| material)?;
        solver.positions(&mut reference.positions);
        let elastic = reference.elastic_forces();
        let forces = elastic.iter().enumerate().map(|(p, &elastic)| {
            let way = reference.positions[p] - self.mesh.positions[p] * self.scaled;
            way * reference.masses()[p] / (TIME_STEP * TIME_STEP) - elastic
        });
        Ok(forces.collect())
    }
}

pub(super) fn norm(forces: &[DVec3]) -> f64 {
    forces
        .iter()
        .map(|f| f.length_squared())
        .sum::<f64>()
        .sqrt()
}
