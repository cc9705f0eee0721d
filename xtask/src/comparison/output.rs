//! Output of a script: one JSON object on a line of its own, among other lines.

use anyhow::Context;
use serde::{Deserialize, Serialize};

/// Values reported by a system; each script reports some of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct PeerResult {
    pub(super) peer: String,
    pub(super) version: Option<String>,
    pub(super) tets: usize,
    pub(super) precision: String,
    pub(super) colors: Option<usize>,
    /// Time of an additional iteration in ms, the fastest.
    #[serde(alias = "ms_per_iter_min")]
    pub(super) ms_per_iter: f64,
    /// Time in ms of 20 substeps of one iteration.
    pub(super) ms_frame_20sub_1it: Option<f64>,
    pub(super) setup_cpu_ms: Option<f64>,
    /// Displacement of the beam's end in m, downward, at the end of the script's run.
    pub(super) tip: Option<f64>,
    pub(super) finite: Option<bool>,
    /// Largest coordinate in m.
    pub(super) max_abs: Option<f64>,
    /// Other relevant output.
    #[serde(default)]
    pub(super) note: Option<String>,
}

/// Finds the result in the output of a script.
pub(super) fn result(text: &str) -> anyhow::Result<PeerResult> {
    let line = text.lines().rev().find(|line| line.starts_with('{'));
    let line = line.context("it printed no result")?;
    let mut result: PeerResult =
        serde_json::from_str(line).with_context(|| format!("no result: {line}"))?;
    if text.contains("gravity not set") {
        result.note = Some(
            "the script could not set gravity in this version: it has its own default".to_owned(),
        );
    }
    Ok(result)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_object_is_the_result() {
        let text = "Module loaded\n{\"peer\":\"a\",\"tets\":6,\"precision\":\"f32\",\"ms_per_iter_min\":0.5,\"tip\":-1e-3}\n";
        let a = result(text).unwrap();
        assert_eq!((a.peer.as_str(), a.tets, a.ms_per_iter), ("a", 6, 0.5));
        assert_eq!((a.tip, a.version, a.note), (Some(-1e-3), None, None));
        let more = "gravity not set: no such name\n{\"peer\": \"b\", \"version\": \"2\", \"tets\": 6, \"precision\": \"f64\", \"colors\": 3, \"ms_per_iter\": 2.0, \"finite\": true, \"one\": {\"wall_min\": 1}}";
        let b = result(&format!("{text}{more}")).unwrap();
        assert_eq!(
            (b.peer.as_str(), b.ms_per_iter, b.colors),
            ("b", 2.0, Some(3))
        );
        assert!(b.note.is_some());
    }

    #[test]
    fn invalid_results_are_refused() {
        assert!(result("").is_err());
        assert!(result("Traceback").is_err());
        assert!(result("{\"peer\": \"a\"}").is_err());
        // JSON has no infinity and no NaN.
        assert!(
            result("{\"peer\":\"a\",\"tets\":6,\"precision\":\"f32\",\"ms_per_iter\":NaN}")
                .is_err()
        );
    }
}
