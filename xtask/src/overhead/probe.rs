//! Process run under Callgrind: some frames of a scene, by the library or by a handwritten loop.
//!
//! The handwritten loop is the least code for the given mesh and schedule: the solver of incise-xpbd, a step and a copy
//! of the positions. It has no scenes, strokes, pieces, handles, sleep or reports.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use incise::graph::Schedule;
use incise::mesh::TetMesh;
use incise::mesh::glam::DVec3;
use incise::xpbd::{Material, Solver, StepSettings};
use incise::{Scene, Simulation};
use rayon::ThreadPoolBuilder;

use crate::solver::body::body;

/// Part of the name of the function whose frames are counted.
pub(crate) const COUNTED: &str = "counted_frames";

/// Warm-up frames in which arrays get their sizes.
pub(crate) const FIRST: u32 = 3;

#[derive(Debug, Args)]
pub(crate) struct ProbeArguments {
    /// The scene.
    #[arg(long)]
    scene: PathBuf,
    /// Way to run the scene.
    #[arg(long, value_enum)]
    way: Way,
    /// Frames that are counted.
    #[arg(long)]
    frames: u32,
}

/// Way to run a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Way {
    /// By the facade, in a simulation.
    Facade,
    /// By the solver, without the facade.
    Hand,
    /// By the solver, without particles and tets.
    Empty,
}

impl Way {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Facade => "facade",
            Self::Hand => "hand",
            Self::Empty => "empty",
        }
    }
}

/// Runs the frames.
pub(crate) fn probe(arguments: &ProbeArguments) -> anyhow::Result<()> {
    // The current thread is the pool, so no thread wakes or waits.
    let pool = ThreadPoolBuilder::new().num_threads(1).use_current_thread();
    pool.build_global()?;
    let scene = Scene::load(&arguments.scene)?;
    let mut run = run(&scene, arguments.way)?;
    for _ in 0..FIRST {
        run.frame()?;
    }
    counted_frames(&mut run, arguments.frames)
}

/// Separate function, which Callgrind finds by its name.
#[inline(never)]
fn counted_frames(run: &mut Run, frames: u32) -> anyhow::Result<()> {
    for _ in 0..frames {
        run.frame()?;
    }
    Ok(())
}

/// Simulation or handwritten loop.
#[derive(Debug)]
pub(crate) enum Run {
    Facade(Box<Simulation>),
    Hand(Box<Hand>),
}

impl Run {
    pub(crate) fn frame(&mut self) -> anyhow::Result<()> {
        match self {
            Self::Facade(simulation) => {
                simulation.step()?;
            }
            Self::Hand(hand) => {
                hand.solver.step(&hand.schedule, &hand.settings)?;
                hand.solver.positions(&mut hand.positions);
            }
        }
        Ok(())
    }
}

/// A body and its solver.
#[derive(Debug)]
pub(crate) struct Hand {
    solver: Solver<f32>,
    schedule: Schedule,
    settings: StepSettings,
    positions: Vec<DVec3>,
}

impl Hand {
    /// Body of the bare scene, with the given mesh and schedule.
    pub(crate) fn new(scene: &Scene, mesh: &TetMesh, schedule: Schedule) -> anyhow::Result<Self> {
        let spec = &scene.body[0];
        let material = Material {
            young_modulus: spec.young_modulus,
            poisson_ratio: spec.poisson_ratio,
            density: spec.density,
            damping: spec.damping,
        };
        Ok(Self {
            solver: body(mesh, material, |_| false)?,
            schedule,
            settings: StepSettings {
                substeps: 2,
                ..StepSettings::new(scene.solver.time_step)
            },
            positions: Vec::new(),
        })
    }
}

pub(crate) fn run(scene: &Scene, way: Way) -> anyhow::Result<Run> {
    let simulation = Simulation::new(scene)?;
    Ok(match way {
        Way::Facade => Run::Facade(Box::new(simulation)),
        Way::Hand => {
            let schedule = simulation.schedule().into_owned();
            Run::Hand(Box::new(Hand::new(scene, simulation.mesh(), schedule)?))
        }
        Way::Empty => {
            let none = TetMesh::default();
            Run::Hand(Box::new(Hand::new(scene, &none, Schedule::default())?))
        }
    })
}
