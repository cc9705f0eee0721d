//! [`Machine`]: where and when a cell was measured, and of what.

use std::fs;
use std::process::Command;

use serde::{Deserialize, Serialize};

use crate::gpu::measure::today;

#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(super) struct Machine {
    date: String,
    /// The name of the processor, and how many threads it gives this process.
    processor: String,
    /// The commit, with a word if files differ from it.
    commit: String,
}

impl Machine {
    pub(super) fn here() -> Self {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let name = fs::read_to_string("/proc/cpuinfo")
            .ok()
            .and_then(|text| {
                let line = text.lines().find(|line| line.starts_with("model name"))?;
                Some(line.split_once(':')?.1.trim().to_owned())
            })
            .unwrap_or_else(|| std::env::consts::ARCH.to_owned());
        let git = |arguments: &[&str]| {
            let output = Command::new("git").args(arguments).output().ok()?;
            let text = String::from_utf8(output.stdout).ok()?;
            output.status.success().then(|| text.trim().to_owned())
        };
        let commit = match git(&["rev-parse", "--short=12", "HEAD"]) {
            Some(commit) => match git(&["status", "--porcelain", "--untracked-files=no"]) {
                Some(changes) if !changes.is_empty() => format!("{commit} with changes"),
                _ => commit,
            },
            None => "unknown".to_owned(),
        };
        Self {
            date: today(),
            processor: format!("{name}, {threads} threads"),
            commit,
        }
    }

    /// In a line.
    pub(super) fn describe(&self) -> String {
        format!("{}, {}, commit {}", self.processor, self.date, self.commit)
    }
}
