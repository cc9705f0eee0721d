//! `incise-viewer`: a window or a web page for cutting soft bodies.
//!
//! A scene is loaded in the background and simulated in real time. The mouse cuts, grabs and pulls; the panel shows stage
//! times and solver settings with the measured effect of each change. This crate is input and display only: `incise`
//! simulates and cuts, `incise-render` draws.

mod app;
mod canvas;
mod frame_clock;
mod graphics;
mod help;
mod history;
mod load;
#[cfg(not(target_family = "wasm"))]
mod native;
mod open_dialog;
#[cfg(target_family = "wasm")]
mod page;
mod panel;
mod sentence;
mod session;
mod setting_effects;
mod settings;
mod times;
mod tool;
#[cfg(target_family = "wasm")]
mod web;
mod worker;

#[cfg(not(target_family = "wasm"))]
fn main() -> std::process::ExitCode {
    native::main()
}

#[cfg(target_family = "wasm")]
fn main() {
    web::main();
}
