//! Page of a sweep: its results as tables in Markdown.

use std::fmt::Write;

use comfy_table::Table;

use super::report::Report;
use super::tables::{colorings, compared, frames, iterations, mebibytes, memory, recolorings};

pub(crate) fn page(report: &Report) -> anyhow::Result<String> {
    let mut text = head(report)?;
    let mut section = |heading: &str, words: &str, table: Table| -> anyhow::Result<()> {
        if !table.is_empty() {
            writeln!(text, "## {heading}\n\n{words}\n\n{table}\n")?;
        }
        Ok(())
    };
    section(
        "An iteration",
        "The difference of frames of 24 and of 4 iterations, over 20; *recording* is the host's part of it. *GB/s* are the \
         bytes that an iteration has to move at least (rest shapes, corners, multipliers, the particles of each cluster \
         once) over the fastest time, *share* that of the bandwidth above: more than 100 % is a cache. *MiB* is device \
         memory.",
        iterations(report),
    )?;
    section(
        "Workgroups and threads",
        "One step of 1/60 s from rest under gravity, a body 1 m long held at one end, E = 1e5 Pa, Poisson's ratio 0.45. \
         *dual* is the root mean square of what the constraints are off, *force* what is left of the equations of \
         motion over the weight, which no number of iterations brings to 0 since XPBD drops a part of them.",
        compared(report),
    )?;
    let words = format!(
        "A kernel sees at most {} of one buffer here. Without multipliers, which take 8 bytes a slot with several \
         iterations a substep.",
        mebibytes(report.facts.buffer_limit)
    );
    section("Device memory", &words, memory(report))?;
    section(
        "Frames",
        "The built-in scene on each mesh, 20 substeps of one iteration. *in a row*: many frames before a wait; *waited \
         for*: each. The rest are medians of the frames that cut, each waited for: the state is read back, cut, \
         updated and sent.",
        frames(report),
    )?;
    let words = format!(
        "Each equals its twin on the host, color by color. *upload* is not in the time of a coloring. The host's time is \
         that of the twin, once, on {} threads.",
        report.facts.threads
    );
    section("Coloring", &words, colorings(report))?;
    section(
        "Colors after a cut",
        "*following* is what a frame with a cut does now: the host colors the clusters that changed. A full coloring on the \
         device takes listing the particles of clusters, upload, coloring and reading back; from a graph, making the graph \
         as well. Medians in ms.",
        recolorings(report),
    )?;
    let left_out = left_out(report);
    if !left_out.is_empty() {
        writeln!(text, "## Left out\n")?;
        for what in left_out {
            writeln!(text, "- {what}")?;
        }
    }
    Ok(text)
}

/// Omitted parts of the sweep, with reasons.
fn left_out(report: &Report) -> Vec<String> {
    let mut lines = report.notes.clone();
    for row in report.passes.iter().filter(|row| !row.note.is_empty()) {
        lines.push(format!(
            "{}, {} tets, {}: {}.",
            row.mesh, row.tets, row.form, row.note
        ));
    }
    for row in report.memory.iter().filter(|row| row.used.is_none()) {
        lines.push(format!(
            "Memory of {} tets, {}: {}.",
            row.tets, row.form, row.note
        ));
    }
    for row in report.colorings.iter().filter(|row| row.run.is_none()) {
        lines.push(format!(
            "{}, {}, {}: the device has no room for it.",
            row.mesh, row.clustering, row.algorithm
        ));
    }
    lines
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

#[cfg(test)]
mod tests {
    use super::*;

    const SAMPLE: &str = include_str!("sample.json");

    fn sample() -> Report {
        serde_json::from_str(SAMPLE).unwrap()
    }

    /// The cells of the first row of a section that begins with these.
    fn row<'a>(text: &'a str, section: &str, begins: &str) -> Vec<&'a str> {
        let section = text.split("\n## ").find(|part| part.starts_with(section));
        let mut rows = section
            .unwrap()
            .lines()
            .filter(|line| line.starts_with('|'));
        let cells = |line: &'a str| line.split('|').map(str::trim).collect::<Vec<_>>();
        let row = rows.find(|line| cells(line)[1..].join(" ").starts_with(begins));
        cells(row.expect(begins))
    }

    #[test]
    fn a_report_comes_back_from_its_file() {
        let text = serde_json::to_string(&sample()).unwrap();
        assert_eq!(serde_json::from_str::<Report>(&text).unwrap(), sample());
    }

    #[test]
    fn a_page_shows_the_report() {
        let text = page(&sample()).unwrap();
        let first = text.lines().next().unwrap();
        assert!(first.contains("say nothing about a GPU"), "{first}");
        let mut columns = None;
        for line in text.lines() {
            match line.matches('|').count() {
                0 => columns = None,
                count => assert_eq!(count, *columns.get_or_insert(count), "{line}"),
            }
        }
        // A million bytes in a tenth of a millisecond are 10 GB/s, of 100.
        let iteration = row(&text, "An iteration", "ball 1000 threads");
        assert_eq!(iteration[10..13], ["100.00", "10.00", "10.0 %"]);
        let absent = row(&text, "An iteration", "ball 1000 Jacobi");
        assert_eq!(absent[6..14], ["-"; 8]);
        assert!(text.contains("- ball, 1000 tets, Jacobi: not done."));
        assert!(text.contains("- Memory of 1000 tets, workgroups: too large."));
        assert!(text.contains("- ball, none, vivace: the device has no room for it."));
        assert_eq!(
            row(&text, "Workgroups and threads", "ball, 1000 tets 12.0")[7],
            "1.00e-1"
        );
        assert_eq!(row(&text, "Device memory", "1000 300 threads")[4], "1.0");
        assert_eq!(row(&text, "Frames", "ball 1000 device")[9], "8.000");
        assert_eq!(
            row(&text, "Coloring", "ball none 1000 9000 scgc")[10],
            "0.250"
        );
        assert_eq!(
            row(&text, "Colors after a cut", "ball 1200 90 0.100")[14],
            "-"
        );
    }

    #[test]
    fn a_device_is_not_called_software() {
        let mut report = sample();
        report.facts.software = false;
        assert!(!page(&report).unwrap().contains("software"));
    }
}
