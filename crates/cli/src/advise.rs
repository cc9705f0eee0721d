//! `incise advise`: the most accurate settings of a scene's solver that meet a time budget on this machine.

use std::time::Duration;

use comfy_table::Table;
use comfy_table::presets::UTF8_FULL_CONDENSED;
use incise::advise::{
    Advice, AdviseSettings, Measured, ReferenceKind, ReferenceSummary, advise_with, default_frames,
};
use indicatif::{ProgressBar, ProgressStyle};

use crate::args::AdviseArguments;
use crate::failure::Failure;
use crate::print::print;
use crate::run::{load, located};

pub(crate) fn advise(arguments: &AdviseArguments) -> Result<(), Failure> {
    let scene = load(arguments.scene.as_deref())?;
    let frames = arguments.frames.unwrap_or_else(|| default_frames(&scene));
    let mut question = AdviseSettings::new(arguments.budget_ms, frames);
    question.threads = arguments.threads.map(usize::from);
    let spinner = ProgressBar::new_spinner();
    let style = ProgressStyle::with_template("{spinner} {msg}  {elapsed}");
    spinner.set_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()));
    spinner.enable_steady_tick(Duration::from_millis(200));
    let advice = advise_with(&scene, &question, &mut |step: &str| {
        spinner.set_message(step.to_owned());
    });
    spinner.finish_and_clear();
    let advice = advice.map_err(|error| located(error, arguments.scene.as_deref()))?;
    if arguments.json {
        let json = serde_json::to_string(&advice).map_err(|error| Failure::Run(error.into()))?;
        return print(json);
    }
    print(reference(&advice))?;
    print(table(&advice))?;
    for left_out in &advice.left_out {
        print(format_args!("not measured: {left_out}"))?;
    }
    if scene.body.iter().any(|body| body.substeps.is_some()) {
        print("these settings apply to all bodies; remove `substeps` from each [[body]]")?;
    }
    let last = scene.frames_needed();
    if last > u64::from(advice.frames) {
        print(format_args!(
            "strokes and attachments end in frame {last}; --frames {last} measures all of them"
        ))?;
    }
    print(words(&advice))
}

/// Description of the reference solution.
fn reference(advice: &Advice) -> String {
    let ReferenceSummary {
        kind,
        why_not_newton,
        steps: [a, b, c],
        order,
        left,
        ..
    } = &advice.reference;
    let mut text = format!(
        "{} tets, {} frames; errors are measured against ",
        advice.tets, advice.frames
    );
    text += &match kind {
        ReferenceKind::Newton => {
            format!("Newton's method with {a}, {b} and {c} steps a frame, extrapolated")
        }
        ReferenceKind::Xpbd => format!(
            "the solver itself in double precision with {c} substeps a frame ({a} and {b} for its error)"
        ),
        _ => format!("references of {a}, {b} and {c} steps a frame"),
    };
    if let Some(order) = order {
        text += &format!(" (order {order:.1})");
    }
    text += &format!(
        "; its own error is about {}% of the motion and {}% of the volume",
        digits(left.motion),
        digits(left.volume)
    );
    if let Some(why) = why_not_newton {
        text += &format!("\nNewton's method was not used: {why}");
    }
    text
}

fn table(advice: &Advice) -> Table {
    let mut table = Table::new();
    table.load_style(UTF8_FULL_CONDENSED);
    table.set_header([
        "setting",
        "ms/frame",
        "worst frame (ms)",
        "error (% of motion)",
        "largest (% of size)",
        "at the end (%)",
        "volume (%)",
        "",
    ]);
    for (i, row) in advice.measured.iter().enumerate() {
        let mut notes = Vec::new();
        if row.is_scene_setting {
            notes.push("the scene");
        }
        if advice.best == Some(i) {
            notes.push("best within budget");
        } else if row.non_dominated {
            notes.push("Pareto optimal");
        }
        let error = row.error;
        let numbers = [
            row.ms,
            row.slowest_ms,
            error.motion,
            error.largest,
            error.end,
            error.volume,
        ];
        let mut cells = vec![row.name.clone()];
        cells.extend(numbers.map(digits));
        cells.push(notes.join(", "));
        table.add_row(cells);
    }
    table
}

/// Text report, with the `[solver]` table for the scene file.
fn words(advice: &Advice) -> String {
    let budget = advice.budget_ms;
    let row = |i: Option<usize>| i.and_then(|i| advice.measured.get(i));
    let what = |m: &Measured| {
        format!(
            "{}: {} ms/frame, error {}% of the motion, {}% of the size, {}% of the volume",
            m.name,
            digits(m.ms),
            digits(m.error.motion),
            digits(m.error.largest),
            digits(m.error.volume)
        )
    };
    match (row(advice.best), row(advice.next)) {
        (Some(best), next) => {
            let mut text = format!("\nwithin {budget} ms: {}\n\n{}", what(best), best.solver);
            text += &match next {
                Some(next) => format!("\nmore accurate: {}", what(next)),
                None => "\nno measured setting is more accurate".to_owned(),
            };
            text
        }
        (None, Some(fastest)) => format!(
            "\nno measured setting meets {budget} ms; the fastest is {}\n\n{}\nuse a smaller mesh or a GPU",
            what(fastest),
            fastest.solver
        ),
        (None, None) => format!("\nno measured setting meets {budget} ms"),
    }
}

/// Formats a value with two or three digits.
fn digits(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        ..0.001 => format!("{value:.1e}"),
        ..0.1 => format!("{value:.4}"),
        ..10.0 => format!("{value:.2}"),
        ..1e5 => format!("{value:.0}"),
        _ => format!("{value:.1e}"),
    }
}
