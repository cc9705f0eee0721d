//! Scenes, comparison of pictures, and the device that all tests of this process share.

use incise::{Scene, Simulation};
use incise_render::{Camera, Image, RenderScene};

/// A simulation after some frames, and its render scene.
pub(crate) struct Shown {
    pub(crate) scene: Scene,
    pub(crate) simulation: Simulation,
    pub(crate) render_scene: RenderScene,
}

impl Shown {
    pub(crate) fn new(toml: &str, frames: usize) -> Self {
        let scene = Scene::from_toml(toml).unwrap();
        let simulation = Simulation::new(&scene).unwrap();
        let render_scene = RenderScene::new(&simulation, &scene);
        let mut shown = Self {
            scene,
            simulation,
            render_scene,
        };
        shown.advance(frames);
        shown
    }

    pub(crate) fn advance(&mut self, frames: usize) {
        for _ in 0..frames {
            self.simulation.step().unwrap();
            self.render_scene.sync(&self.simulation);
        }
    }

    /// A view of the present bodies and the floor.
    pub(crate) fn camera(&self) -> Camera {
        let [mut low, high] = self.render_scene.bounds(&self.simulation);
        if let Some(ground) = self.scene.world.ground {
            low.z = low.z.min(ground.height);
        }
        Camera::fit(low, high)
    }
}

/// A liver, sliced in frame 1, of which one part falls.
pub(crate) const LIVER: &str = r#"
[world]
gravity = [0.0, 0.0, -9.81]
ground = { height = -0.22 }
[solver]
time_step = 0.01
substeps = 8
[[body]]
shape = { kind = "liver", tets = 1500 }
scale = 0.25
young_modulus = 2.0e4
density = 1050.0
damping = 0.002
fixed = [{ half_space = { point = [-0.03, 0.0, 0.0], normal = [-1.0, 0.0, 0.0] } }]
[[stroke]]
kind = "plane"
frame = 1
point = [0.02, 0.0, 0.0]
normal = [1.0, -0.1, 0.1]
"#;

/// A ball and a ring on a floor, with obstacles of all kinds.
pub(crate) const TWO_BODIES: &str = r#"
[world]
gravity = [0.0, 0.0, -9.81]
ground = { height = -0.3 }
[solver]
time_step = 0.01
substeps = 4
[[body]]
shape = { kind = "sphere", tets = 600 }
scale = 0.4
position = [0.0, -0.3, 0.0]
young_modulus = 2.0e4
[[body]]
shape = { kind = "torus", tets = 900 }
scale = 0.5
position = [0.0, 0.3, -0.1]
young_modulus = 2.0e4
[[collider]]
kind = "sphere"
center = [0.45, 0.0, -0.2]
radius = 0.1
velocity = [0.5, 0.0, 0.0]
[[collider]]
kind = "capsule"
ends = [[-0.4, -0.3, -0.25], [-0.4, 0.3, -0.25]]
radius = 0.05
[[collider]]
kind = "box"
center = [0.0, 0.0, -0.25]
half_extents = [0.05, 0.1, 0.05]
rotation = { axis = [0.0, 0.0, 1.0], angle_degrees = 30.0 }
[[collider]]
kind = "plane"
point = [0.0, 0.8, 0.0]
normal = [0.0, -1.0, 0.0]
"#;

/// The difference of two pictures.
#[derive(Debug)]
pub(crate) struct Difference {
    /// Of a channel, from 0 to 255.
    pub(crate) mean: f64,
    /// The fraction of pixels of which a channel differs by more than what was asked for.
    pub(crate) share: f64,
}

impl Difference {
    pub(crate) fn of(a: &Image, b: &Image, more_than: u8) -> Self {
        assert_eq!((a.width, a.height), (b.width, b.height));
        let pixels = a.rgba.len() / 4;
        let (mut sum, mut count) = (0_u64, 0_usize);
        for (a, b) in a.rgba.chunks_exact(4).zip(b.rgba.chunks_exact(4)) {
            let apart = [0, 1, 2].map(|i| a[i].abs_diff(b[i]));
            sum += apart.iter().map(|&d| u64::from(d)).sum::<u64>();
            count += usize::from(apart.iter().any(|&d| d > more_than));
        }
        Self {
            mean: sum as f64 / (3 * pixels) as f64,
            share: count as f64 / pixels as f64,
        }
    }
}

#[cfg(feature = "gpu")]
pub(crate) use gpu::gpu;

#[cfg(feature = "gpu")]
mod gpu {
    use std::io::{Write, stderr};
    use std::sync::{Arc, OnceLock};

    use incise::gpu::{GpuContext, GpuError, GpuOptions};

    static CONTEXT: OnceLock<Result<Arc<GpuContext>, GpuError>> = OnceLock::new();

    /// The device, or `None` with a note on stderr on a machine without one.
    pub(crate) fn gpu(test: &str) -> Option<Arc<GpuContext>> {
        let open = || GpuContext::new(&GpuOptions::from_env()).map(Arc::new);
        match CONTEXT.get_or_init(open) {
            Ok(gpu) => Some(Arc::clone(gpu)),
            Err(error) => {
                let required = std::env::var_os("INCISE_REQUIRE_GPU").is_some();
                assert!(!required, "a GPU is required: {error}");
                // Not by `eprintln`, which is shown for tests that fail only.
                let line = format!("SKIPPED {test}: {error}\n");
                stderr().write_all(line.as_bytes()).unwrap();
                None
            }
        }
    }
}
