//! Bytes, allocations, instructions and device traffic of one scene.
//!
//! Bytes are those that the scene holds on the heap after some frames, including unused capacity; allocations are those
//! of later frames. Both are measured on a separate thread by a counting allocator. Traffic is the commands and bytes
//! sent to a device, possibly a software one, in later frames. All values are exactly reproducible.

use std::cell::OnceCell;
use std::path::Path;
use std::rc::Rc;
use std::sync::Arc;

use anyhow::Context;
use incise::cutting::{CuttableMesh, PieceTracker};
use incise::gpu::{GpuContext, GpuOptions};
use incise::{Scene, Simulation};
use rayon::ThreadPoolBuilder;
use serde::{Deserialize, Serialize};

use super::callgrind::{self, Counts};
use super::probe::{FIRST, Run, Way, run};

/// Frames that are counted.
pub(crate) const FRAMES: u32 = 4;

/// Cost of a scene in one size.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Measured {
    pub(crate) tets: usize,
    pub(crate) particles: usize,
    pub(crate) memory: Memory,
    /// Instructions of [`FRAMES`] frames; `None` without valgrind.
    pub(crate) counts: Option<Counts>,
    /// `None` if there is no device, or it does not support the scene.
    pub(crate) device: Option<Device>,
}

/// Heap use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Memory {
    /// Bytes held after some frames.
    pub(crate) bytes: i64,
    /// Part of these bytes for cutting: neighbors, boundary and pieces.
    pub(crate) ready_to_cut: i64,
    /// Allocations in [`FRAMES`] frames.
    pub(crate) allocations: u64,
}

/// Device traffic of [`FRAMES`] frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Device {
    /// Bytes held in buffers of the solver.
    pub(crate) bytes: u64,
    pub(crate) dispatches: u64,
    pub(crate) passes: u64,
    pub(crate) submits: u64,
    pub(crate) uploaded: u64,
    pub(crate) readbacks: u64,
    pub(crate) read: u64,
}

/// Device, opened on first use.
#[derive(Clone, Debug, Default)]
pub(crate) struct Gpu(Rc<OnceCell<Option<Arc<GpuContext>>>>);

impl Gpu {
    fn context(&self) -> Option<Arc<GpuContext>> {
        let open = || GpuContext::new(&GpuOptions::from_env()).ok().map(Arc::new);
        self.0.get_or_init(open).clone()
    }
}

/// Measures a scene. Device traffic is measured only if the scene is run as a simulation.
pub(crate) fn measure(
    scene: &Scene,
    way: Way,
    valgrind: bool,
    gpu: Option<&Gpu>,
) -> anyhow::Result<Measured> {
    let simulation = Simulation::new(scene)?;
    let (tets, particles) = match way {
        Way::Empty => (0, 0),
        Way::Facade | Way::Hand => {
            let mesh = simulation.mesh();
            (mesh.tets.len(), mesh.positions.len())
        }
    };
    drop(simulation);
    let folder = tempfile::tempdir()?;
    let counts = match valgrind {
        true => Some(instructions(scene, way, folder.path())?),
        false => None,
    };
    let device = match (way, gpu.and_then(Gpu::context)) {
        (Way::Facade, Some(gpu)) => traffic(scene, &gpu)?,
        _ => None,
    };
    Ok(Measured {
        tets,
        particles,
        memory: memory(scene, way)?,
        counts,
        device,
    })
}

fn instructions(scene: &Scene, way: Way, folder: &Path) -> anyhow::Result<Counts> {
    let path = folder.join("scene.toml");
    std::fs::write(&path, scene.to_toml()?)?;
    let path = path.to_str().context("the temporary folder has a name")?;
    let frames = FRAMES.to_string();
    let arguments = ["overhead-probe", "--scene", path, "--way", way.name()];
    callgrind::count(&[&arguments[..], &["--frames", &frames]].concat(), folder)
}

/// Measures the heap use of a scene.
///
/// A simulation keeps the scene description for later changes of settings. Its size depends on the text of the scene,
/// not on the simulation, and is not counted.
pub(crate) fn memory(scene: &Scene, way: Way) -> anyhow::Result<Memory> {
    let pool = ThreadPoolBuilder::new().num_threads(1).build()?;
    pool.install(|| {
        // Warm-up, so that allocations made once per process are not counted.
        let mut result = run(scene, way).map(drop);
        let frames = |run: &mut anyhow::Result<Run>, count| {
            for _ in 0..count {
                let frame = run.as_mut().map(Run::frame);
                if let Ok(Err(error)) = frame {
                    *run = Err(error);
                }
            }
        };
        let mut kept = None;
        let held = allocation_counter::measure(|| {
            let mut run = run(scene, way);
            frames(&mut run, FIRST);
            kept = Some(run);
        });
        let mut kept = kept.context("it was run")?;
        let later = allocation_counter::measure(|| frames(&mut kept, FRAMES));
        if let Err(error) = kept {
            result = Err(error);
        }
        result?;
        Ok(Memory {
            bytes: held.bytes_current + later.bytes_current - description(scene, way),
            ready_to_cut: match way {
                Way::Facade => ready_to_cut(scene)?,
                Way::Hand | Way::Empty => 0,
            },
            allocations: later.count_total,
        })
    })
}

/// Bytes of lists and strings in the description of a scene, of which a simulation keeps a copy.
fn description(scene: &Scene, way: Way) -> i64 {
    if way != Way::Facade {
        return 0;
    }
    let mut copy = None;
    let held = allocation_counter::measure(|| copy = Some(scene.clone()));
    drop(copy);
    held.bytes_current
}

/// Bytes of a mesh in addition to its positions and tets that keep it ready for cuts.
fn ready_to_cut(scene: &Scene) -> anyhow::Result<i64> {
    let mesh = Simulation::new(scene)?.mesh().clone();
    let mut made = None;
    let held = allocation_counter::measure(|| {
        let cuttable = CuttableMesh::new(mesh);
        made = Some(cuttable.map(|cuttable| (PieceTracker::new(&cuttable), cuttable)));
    });
    made.context("it was made")??;
    Ok(held.bytes_current)
}

/// Measures device traffic; `None` if the device does not support the scene.
pub(crate) fn traffic(scene: &Scene, gpu: &Arc<GpuContext>) -> anyhow::Result<Option<Device>> {
    let Ok(mut simulation) = Simulation::on_device(scene, Arc::clone(gpu)) else {
        return Ok(None);
    };
    for _ in 0..FIRST {
        simulation.step()?;
    }
    let before = gpu.traffic();
    for _ in 0..FRAMES {
        simulation.step()?;
    }
    gpu.wait()?;
    let told = gpu.traffic().since(before);
    Ok(Some(Device {
        bytes: simulation
            .device_solvers()
            .map(|solver| solver.bytes())
            .sum(),
        dispatches: told.dispatches,
        passes: told.passes,
        submits: told.submits,
        uploaded: told.uploaded_bytes,
        readbacks: told.readbacks,
        read: told.read_bytes,
    }))
}
