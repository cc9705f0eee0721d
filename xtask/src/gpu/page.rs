//! The page: what a sweep found, as tables in Markdown.

use std::fmt::Write;

use super::report::Report;
use super::tables::{colorings, compared, frames, iterations, mebibytes, memory, recolorings};

pub(crate) fn page(report: &Report) -> anyhow::Result<String> {
    let mut text = head(report)?;
    writeln!(
        text,
        "## An iteration\n\n\
         The difference of frames of 24 and of 4 iterations, over 20; *recording* is the host's part of it. *GB/s* are the \
         bytes that an iteration has to move at least (rest shapes, corners, multipliers, the particles of each cluster \
         once) over the fastest time, *share* that of the bandwidth above: more than 100 % is a cache.\n\n{}\n",
        iterations(report)
    )?;
    let compared = compared(report);
    if compared.row_iter().next().is_some() {
        writeln!(
            text,
            "## Block form against the paper's cluster form\n\n\
             One step of 1/60 s from rest under gravity, a body 1 m long held at one end, E = 1e5 Pa, Poisson's ratio 0.45. \
             *dual* is the root mean square of what the constraints are off, *force* what is left of the equations of \
             motion over the weight, which no number of iterations brings to 0 since XPBD drops a part of them.\n\n{compared}\n"
        )?;
    }
    writeln!(
        text,
        "## Device memory\n\n\
         A kernel sees at most {} of one buffer here. *lean* is with one iteration a substep, without multipliers.\n\n{}\n",
        mebibytes(report.facts.buffer_limit),
        memory(report)
    )?;
    writeln!(
        text,
        "## Frames\n\n\
         The built-in scene on each mesh, 20 substeps of one iteration. *in a row*: many frames before a wait; *waited \
         for*: each. The rest are medians of the frames that cut, each waited for: the state is read back, cut, followed \
         and sent.\n\n{}\n",
        frames(report)
    )?;
    writeln!(
        text,
        "## Coloring\n\n\
         Each equals its twin on the host, color by color. *upload* is not in the time of a coloring. The host's time is \
         that of the twin, once, on {} threads.\n\n{}\n",
        report.facts.threads,
        colorings(report)
    )?;
    writeln!(
        text,
        "## Colors after a cut\n\n\
         *following* is what a frame with a cut does now: the host colors the clusters that changed. Coloring anew on the \
         device takes listing the particles of clusters, upload, coloring and reading back; from a graph, making the graph \
         as well. Medians in ms.\n\n{}\n",
        recolorings(report)
    )?;
    if !report.notes.is_empty() {
        writeln!(text, "## Left out\n")?;
        for note in &report.notes {
            writeln!(text, "- {note}")?;
        }
    }
    Ok(text)
}

fn head(report: &Report) -> anyhow::Result<String> {
    let facts = &report.facts;
    let mut text = format!("# The GPU path on {}", facts.adapter);
    if facts.software {
        text += ": software, its times say nothing about a GPU";
    }
    let build = if facts.debug { ", a debug build" } else { "" };
    writeln!(text, "\n\n```sh\n{}\n```\n", facts.command)?;
    writeln!(
        text,
        "{}, {}, driver {}, {} host threads{build}. Times are medians of several runs, the first left out.\n",
        facts.date, facts.backend, facts.driver, facts.threads
    )?;
    writeln!(text, "**Checks.** {}\n", report.checks)?;
    writeln!(
        text,
        "**Bandwidth.** {:.1} GB/s, read and written, from copies of {} from buffer to buffer.\n",
        report.bandwidth.bytes_per_second * 1e-9,
        mebibytes(report.bandwidth.bytes)
    )?;
    Ok(text)
}
