//! `incise-viewer`: a window to cut soft bodies in.
//!
//! A scene is loaded beside the window and advances in it at the pace of real time; what the mouse draws is a blade or a
//! hand, what the panel shows are the stages of a frame and the knobs that trade speed for accuracy, with what each turn
//! of them did. Everything here is input and picture: `incise` simulates and cuts, `incise-render` draws.

mod app;
mod canvas;
mod frame_clock;
mod graphics;
mod help;
mod history;
mod knobs;
mod load;
mod panel;
mod session;
mod setting_effects;
mod times;
mod tool;

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::anyhow;
use clap::{Parser, ValueEnum};
use eframe::egui;

use crate::app::Viewer;
use crate::load::Source;

/// A window to cut soft bodies in.
///
/// Left mouse button: the blade or the hand; right: turn, middle: move, wheel: come closer. F1 shows all keys. Drop a
/// scene, a mesh or a closed surface onto the window to load it.
///
/// Example: incise-viewer fixtures/crossing.toml
#[derive(Debug, Parser)]
#[command(version, verbatim_doc_comment)]
struct Arguments {
    /// A scene (.toml), a tet mesh or a closed triangle surface; absent: the built-in liver.
    file: Option<PathBuf>,
    /// Where to simulate; `auto` takes a real GPU if there is one.
    #[arg(long, value_enum, default_value_t = BackendName::Auto)]
    backend: BackendName,
    /// Waits for the space bar before the first frame.
    #[arg(long)]
    paused: bool,
    /// Tets to fill a closed surface with, about.
    #[arg(long, default_value_t = load::TETS, value_parser = clap::value_parser!(u32).range(100..=2_000_000))]
    tets: u32,
}

/// Where to simulate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum BackendName {
    /// On the processor.
    Cpu,
    /// On the window's GPU, whatever it is.
    Gpu,
    /// On the window's GPU if it is a real one that can.
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

fn main() -> ExitCode {
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
    eprintln!("incise-viewer: {error:#}");
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
    eframe::run_native(
        "incise",
        options,
        Box::new(move |creation| {
            Ok(Box::new(Viewer::new(
                creation, source, backend, tets, paused,
            )))
        }),
    )
    .map_err(|error| anyhow!("{}", graphics::why_no_window(&error)))
}
