//! Printing of results to stdout.

use std::io::{ErrorKind, Write, stdout};

use anyhow::Context;

use crate::failure::Failure;

/// Prints a line. A closed pipe, as from `head`, is not an error.
pub(crate) fn print(line: impl std::fmt::Display) -> Result<(), Failure> {
    match writeln!(stdout(), "{line}") {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            let failed = Err(error).context("cannot write to the standard output");
            failed.map_err(Failure::Run)
        }
        _ => Ok(()),
    }
}

/// Formats a count with its noun, in singular or plural.
pub(crate) fn count(count: usize, one: &str, many: &str) -> String {
    format!("{count} {}", if count == 1 { one } else { many })
}
