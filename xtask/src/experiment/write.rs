//! Writes pages: Markdown with its plots as files beside it, all rows as JSON, and one HTML page of all in a folder.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::Context;
use pulldown_cmark::{Options, Parser, html};
use serde::Serialize;

use super::machine::Machine;
use super::page::{Page, Part};

/// Writes the page of an experiment and the page of all.
pub(super) fn write<R: Serialize>(
    out: &Path,
    name: &str,
    page: &Page,
    machines: &[Machine],
    rows: &[R],
) -> anyhow::Result<()> {
    let command = command(std::env::args().skip(1));
    let mut text = format!("# {}\n\n`cargo xtask {command}`", page.title);
    for machine in machines {
        write!(text, "; {}", machine.describe())?;
    }
    text += ".\n";
    let mut drawings = 0;
    for part in &page.parts {
        text += "\n";
        match part {
            Part::Text(markdown) => text += markdown.trim_end(),
            Part::Table(table) => text += &table.markdown(),
            Part::Plot(_) | Part::Picture { .. } => {
                let (caption, svg) = match part {
                    Part::Plot(plot) => (&plot.title, plot.svg()?),
                    Part::Picture { caption, svg } => (caption, svg.clone()),
                    _ => continue,
                };
                drawings += 1;
                let file = format!("{name}-{drawings}.svg");
                replace(&out.join(&file), &svg)?;
                write!(text, "![{caption}]({file})")?;
            }
        }
        text += "\n";
    }
    replace(&out.join(format!("{name}.md")), &text)?;
    replace(
        &out.join(format!("{name}.json")),
        &serde_json::to_string_pretty(rows)?,
    )?;
    index(out)
}

/// The command in a general form: without the folder that it writes to, and with names in place of other paths.
fn command(mut words: impl Iterator<Item = String>) -> String {
    let mut command = Vec::new();
    while let Some(word) = words.next() {
        match word.as_str() {
            "--out" => {
                words.next();
            }
            "--models" | "--peers" | "--python" => {
                words.next();
                command.push(format!("{word} {}", word[2..].to_uppercase()));
            }
            _ => command.push(word),
        }
    }
    command.join(" ")
}

/// One page of all pages of a folder.
fn index(out: &Path) -> anyhow::Result<()> {
    let mut names: Vec<_> = fs::read_dir(out)?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|ending| ending == "md"))
        .collect();
    names.sort();
    let mut body = String::new();
    for path in names {
        let text = fs::read_to_string(&path)?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        writeln!(body, "<section id=\"{name}\">")?;
        html::push_html(&mut body, Parser::new_ext(&text, Options::ENABLE_TABLES));
        body += "</section>\n";
    }
    let head = "<meta charset=\"utf-8\"><title>incise: experiments</title><style>\
        body { font-family: sans-serif; max-width: 70em; margin: 2em auto; padding: 0 1em; line-height: 1.4 }\
        table { border-collapse: collapse; font-size: 0.85em; display: block; overflow-x: auto }\
        td, th { border: 1px solid #ccc; padding: 0.2em 0.5em; text-align: left }\
        img { max-width: 100% } section { border-top: 2px solid #444; margin-top: 3em }</style>";
    replace(
        &out.join("index.html"),
        &format!(
            "<!doctype html>\n<html lang=\"en\"><head>{head}</head><body>\n{body}</body></html>\n"
        ),
    )
}

/// Writes a file beside its final name and renames it when it is complete.
pub(super) fn replace(path: &Path, text: &str) -> anyhow::Result<()> {
    let beside = path.with_extension("part");
    fs::write(&beside, text)
        .and_then(|()| fs::rename(&beside, path))
        .with_context(|| format!("cannot write {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::command;

    #[test]
    fn commands_name_no_place_on_this_machine() {
        let words = "paper all --models /data/meshes --out /tmp/x --quick".split(' ');
        assert_eq!(
            command(words.map(str::to_owned)),
            "paper all --models MODELS --quick"
        );
    }
}
