//! Instruction counts of some frames by Callgrind, in total and by function.
//!
//! This program runs itself under `valgrind --tool=callgrind` as a child that simulates a scene (`probe.rs`), and
//! counts only while the child is inside the function that runs the frames, so that set-up and first frames are
//! excluded. One thread computes the frames: counts are reproducible except for the allocator. Valgrind supports AVX 2
//! at most, so the kernel of that width is counted, on newer processors too.
//!
//! Format: Callgrind manual, "Callgrind Format Specification". Cost: a run under valgrind is some 50 times slower.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, bail, ensure};
use serde::{Deserialize, Serialize};

use super::probe::COUNTED;

/// Executed instructions of a number of frames.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Counts {
    pub(crate) instructions: u64,
    /// Conditional branches.
    pub(crate) branches: u64,
    /// Instructions by function, without those of called functions.
    pub(crate) functions: BTreeMap<String, u64>,
}

impl Counts {
    /// Instructions in functions whose name contains one of these parts.
    pub(crate) fn of(&self, parts: &[&str]) -> u64 {
        let named = |name: &str| parts.iter().any(|part| name.contains(part));
        let functions = self.functions.iter().filter(|(name, _)| named(name));
        functions.map(|(_, &instructions)| instructions).sum()
    }
}

/// The version of valgrind, or `None` if there is none.
pub(crate) fn version() -> Option<String> {
    let output = Command::new("valgrind").arg("--version").output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}

/// Runs this program with `arguments` under Callgrind.
pub(crate) fn count(arguments: &[&str], folder: &Path) -> anyhow::Result<Counts> {
    let file = folder.join("callgrind.out");
    let program = std::env::current_exe()?;
    let output = Command::new("valgrind")
        .args([
            "--tool=callgrind",
            "--branch-sim=yes",
            "--compress-strings=no",
        ])
        .args(["--compress-pos=no", "--quiet"])
        .arg(format!("--toggle-collect=*{COUNTED}*"))
        .arg(format!("--callgrind-out-file={}", file.display()))
        .arg(program)
        .args(arguments)
        .output()
        .context("cannot run valgrind")?;
    let message = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "valgrind failed: {message}");
    let text = std::fs::read_to_string(&file).with_context(|| file.display().to_string())?;
    let counts = parse(&text)?;
    ensure!(
        counts.instructions > 0,
        "Callgrind's output lacks the function {COUNTED}: was the program stripped?"
    );
    Ok(counts)
}

/// Parses the output of Callgrind with `--compress-strings=no --compress-pos=no`.
fn parse(text: &str) -> anyhow::Result<Counts> {
    let mut counts = Counts::default();
    let mut events: Vec<&str> = Vec::new();
    let mut function = None;
    let mut of_call = false;
    for line in text.lines() {
        if let Some(names) = line.strip_prefix("events: ") {
            events = names.split_whitespace().collect();
        } else if let Some(name) = line.strip_prefix("fn=") {
            function = Some(name.to_owned());
        } else if line.starts_with("calls=") {
            of_call = true;
        } else if line.starts_with(|c: char| c.is_ascii_digit()) {
            // The line after `calls=` is the cost of the called function.
            if std::mem::take(&mut of_call) {
                continue;
            }
            let numbers = line.split_whitespace().skip(1).map(str::parse::<u64>);
            let of = |wanted: &str| -> anyhow::Result<u64> {
                // Trailing zeros are omitted.
                let place = events.iter().position(|&event| event == wanted);
                let Some(place) = place else { return Ok(0) };
                Ok(numbers.clone().nth(place).transpose()?.unwrap_or(0))
            };
            let (instructions, branches) = (of("Ir")?, of("Bc")?);
            numbers
                .clone()
                .next()
                .context("a cost line without costs")??;
            let Some(function) = &function else {
                bail!("costs before the first function");
            };
            counts.instructions += instructions;
            counts.branches += branches;
            *counts.functions.entry(function.clone()).or_default() += instructions;
        }
    }
    ensure!(
        events.contains(&"Ir"),
        "Callgrind's file has no instruction counts"
    );
    Ok(counts)
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "\
# callgrind format
version: 1
positions: line
events: Ir Bc Bcm Bi Bim

ob=/program
fl=step.rs
fn=incise_xpbd::step::substep
12 100 10 1
fi=real.rs
3 20
fe=step.rs
cfn=incise_xpbd::attachment::move_rigid_attachments
calls=4 30
14 48 4
15 5 1

fn=incise_xpbd::attachment::move_rigid_attachments
30 48 4

totals: 173 15 1
";

    #[test]
    fn self_costs_are_summed_by_function() {
        let counts = parse(FILE).unwrap();
        assert_eq!((counts.instructions, counts.branches), (173, 15));
        assert_eq!(counts.functions["incise_xpbd::step::substep"], 125);
        assert_eq!(counts.of(&["attachment", "distance"]), 48);
        assert_eq!(counts.of(&["distance"]), 0);
    }

    #[test]
    fn other_files_than_callgrind_are_refused() {
        assert!(parse("").is_err());
        assert!(parse("events: Ir\n12 100\n").is_err());
        assert!(parse(&FILE.replace("12 100", "12 1x0")).is_err());
    }
}
