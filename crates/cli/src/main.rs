//! The command line of incise: cuts soft bodies, colors meshes, converts and generates them.
//!
//! This crate parses arguments, prints and writes files; everything else is in the `incise` library. Invalid input
//! gives a one-line message on stderr and exit code 2, a failed run exit code 1. Incomplete files never get their final
//! names.

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
mod scene;
mod share;
mod summary;
mod sweep;

#[cfg(all(unix, feature = "gpu"))]
use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;

use anyhow::Context;
use args::{Arguments, Command};
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{CommandFactory, Parser};
use failure::Failure;
use print::print;

fn main() -> ExitCode {
    #[cfg(all(unix, feature = "gpu"))]
    with_socket_folder();
    let arguments = Arguments::try_parse().unwrap_or_else(|error| with_tip(error).exit());
    let result = match arguments.command {
        None => run::run(&args::RunArguments::default()),
        Some(Command::Run(arguments)) => run::run(&arguments),
        Some(Command::Advise(arguments)) => advise::advise(&arguments),
        Some(Command::Color(arguments)) => color::color(&arguments),
        Some(Command::Scene(arguments)) => scene::scene(&arguments),
        Some(Command::Sweep(arguments)) => sweep::sweep(&arguments),
        Some(Command::Mesh { command }) => mesh::mesh(&command),
        Some(Command::Completions { shell }) => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Arguments::command(), "incise", &mut script);
            print(String::from_utf8_lossy(&script).trim_end())
        }
        Some(Command::Man { folder }) => manual(&folder),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}

/// Replaces this process by one with a folder for sockets, if there is none: without it, libraries of GPU drivers complain
/// on stderr. A process cannot change its own environment safely once libraries may read it.
#[cfg(all(unix, feature = "gpu"))]
fn with_socket_folder() {
    use std::os::unix::process::CommandExt;

    const FOLDER: &str = "XDG_RUNTIME_DIR";
    let is_set = |folder: OsString| Path::new(&folder).is_absolute();
    let Ok(program) = std::env::current_exe() else {
        return;
    };
    let mut arguments = std::env::args_os();
    let (Some(name), false) = (
        arguments.next(),
        std::env::var_os(FOLDER).is_some_and(is_set),
    ) else {
        return;
    };
    let mut again = std::process::Command::new(program);
    again
        .arg0(name)
        .args(arguments)
        .env(FOLDER, std::env::temp_dir());
    // Returns only if it fails; then the messages stay.
    let _ = again.exec();
}

/// Writes the manual pages.
fn manual(folder: &Path) -> Result<(), Failure> {
    let written = clap_mangen::generate_to(Arguments::command(), folder);
    let named = written.with_context(|| format!("{}: cannot write manual pages", folder.display()));
    named.map_err(Failure::Input)
}

/// Adds a hint to the error of an option that was given without its command.
fn with_tip(mut error: clap::Error) -> clap::Error {
    let option = std::env::args().nth(1).unwrap_or_default();
    let name = option.trim_start_matches("--").split('=').next();
    let mut all = Arguments::command();
    let of_run = all.find_subcommand_mut("run").into_iter();
    let is_of_run = of_run
        .flat_map(|run| run.get_arguments())
        .any(|argument| argument.get_long().is_some() && argument.get_long() == name);
    if error.kind() == ErrorKind::UnknownArgument && option.starts_with("--") && is_of_run {
        let tip = format!("options of a run follow its command: incise run {option}");
        let tips = ContextValue::StyledStrs(vec![tip.into()]);
        error.insert(ContextKind::Suggested, tips);
    }
    error
}
