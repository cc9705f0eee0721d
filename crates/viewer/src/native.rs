//! The viewer as a program with a window: its arguments and exit codes.

use std::cell::OnceCell;
use std::path::PathBuf;
use std::process::ExitCode;
use std::rc::Rc;
use std::sync::Weak;
use std::thread::sleep;
use std::time::Duration;

use anyhow::anyhow;
use clap::{Parser, ValueEnum};
use eframe::egui;
use incise::gpu::GpuContext;

use crate::app::Viewer;
use crate::load::Source;
use crate::sentence::sentence;
use crate::{graphics, load};

/// A window to cut soft bodies in.
///
/// Mouse: left button cuts or grabs, right orbits, middle pans, wheel zooms. F1 shows all keys. Drop a scene, a mesh or a
/// closed surface onto the window to open it.
///
/// Example: incise-viewer fixtures/crossing.toml
#[derive(Debug, Parser)]
#[command(version, verbatim_doc_comment)]
struct Arguments {
    /// A scene (.toml), a tet mesh or a closed triangle surface; absent: the built-in liver.
    file: Option<PathBuf>,
    /// Backend of the simulation; `auto` takes a hardware GPU if there is one.
    #[arg(long, value_enum, default_value_t = BackendName::Auto)]
    backend: BackendName,
    /// Start paused; the space bar starts the simulation.
    #[arg(long)]
    paused: bool,
    /// Approximate number of tets that fill a closed surface.
    #[arg(long, default_value_t = load::TETS, value_parser = clap::value_parser!(u32).range(100..=2_000_000))]
    tets: u32,
}

/// Backend of the simulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum BackendName {
    /// The CPU.
    Cpu,
    /// The GPU of the window, of any kind.
    Gpu,
    /// The GPU of the window if it is a hardware one that supports the kernels, else the CPU.
    Auto,
}

impl From<BackendName> for incise::scene::Backend {
    fn from(name: BackendName) -> Self {
        match name {
            BackendName::Cpu => Self::Cpu,
            BackendName::Gpu => Self::Gpu,
            BackendName::Auto => Self::Auto,
        }
    }
}

/// Runs the program.
pub(crate) fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let source = match Source::new(arguments.file.as_deref(), arguments.tets) {
        Ok(source) => source,
        Err(error) => {
            complain(&error);
            return ExitCode::from(2);
        }
    };
    match open(source, &arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            complain(&error);
            ExitCode::FAILURE
        }
    }
}

#[expect(clippy::print_stderr, reason = "a program without a window yet")]
fn complain(error: &anyhow::Error) {
    eprintln!("incise-viewer: {}", sentence(error));
}

/// Opens the window and stays until it is closed.
fn open(source: Source, arguments: &Arguments) -> anyhow::Result<()> {
    let options = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_title("incise")
            .with_app_id("incise-viewer")
            .with_inner_size([1280.0, 800.0])
            .with_min_inner_size([480.0, 320.0])
            .with_drag_and_drop(true),
        renderer: eframe::Renderer::Wgpu,
        wgpu_options: graphics::configuration(),
        ..eframe::NativeOptions::default()
    };
    let (backend, tets, paused) = (arguments.backend.into(), arguments.tets, arguments.paused);
    let device: Rc<OnceCell<Weak<GpuContext>>> = Rc::default();
    let used = Rc::clone(&device);
    let shown = eframe::run_native(
        "incise",
        options,
        Box::new(move |creation| {
            let viewer = Viewer::new(creation, source, backend, tets, paused);
            // Set once: this function is called once.
            let _ = used.set(viewer.device());
            Ok(Box::new(viewer))
        }),
    );
    // Drivers crash if the process ends while another thread calls them: wait for frames that are computed on the device.
    while device.get().is_some_and(|it| Weak::strong_count(it) > 0) {
        sleep(Duration::from_millis(10));
    }
    shown.map_err(|error| anyhow!("{}", why_no_window(&error)))
}

/// The message shown if no window can be opened.
fn why_no_window(error: &eframe::Error) -> String {
    match error {
        eframe::Error::WinitEventLoop(error) => {
            // The text before the last colon is a location in winit.
            let error = error.to_string();
            let why = error.rsplit(": ").next().unwrap_or(&error);
            format!(
                "cannot open a window; a display is needed ({why}). Without one, `incise run` writes pictures"
            )
        }
        eframe::Error::Wgpu(error) => format!(
            "cannot open a window; no graphics adapter was found (Vulkan, Metal, Direct3D 12, OpenGL): {error}. Without one, \
             `incise run` writes pictures"
        ),
        other => format!("cannot open a window: {other}"),
    }
}
