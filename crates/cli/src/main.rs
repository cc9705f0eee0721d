//! The command line of incise: cuts soft bodies, colors meshes, converts and generates them.
//!
//! This crate reads arguments, prints and writes files; everything else is the facade's. Bad input ends with one
//! sentence on the error stream and exit code 2, a failed run with exit code 1; nothing half-written keeps its name.

mod advise;
mod args;
mod color;
mod failure;
mod files;
mod mesh;
mod output;
mod pictures;
mod print;
mod run;
mod summary;

use std::process::ExitCode;

use args::{Arguments, Command};
use clap::Parser;

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    let result = match arguments.command {
        None => run::run(&args::RunArguments::default()),
        Some(Command::Run(arguments)) => run::run(&arguments),
        Some(Command::Advise(arguments)) => advise::advise(&arguments),
        Some(Command::Color(arguments)) => color::color(&arguments),
        Some(Command::Mesh { command }) => mesh::mesh(&command),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}
