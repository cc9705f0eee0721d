//! Results go to the standard output.

use std::io::{ErrorKind, Write, stdout};

use anyhow::Context;

use crate::failure::Failure;

/// Prints a line. A reader that has seen enough, as `head` in a pipe, is no failure.
pub(crate) fn print(line: impl std::fmt::Display) -> Result<(), Failure> {
    match writeln!(stdout(), "{line}") {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            let failed = Err(error).context("cannot write to the standard output");
            failed.map_err(Failure::Run)
        }
        _ => Ok(()),
    }
}

/// A count with its noun, in singular or plural.
pub(crate) fn count(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}
