//! `incise sweep`: runs a scene for all combinations of values of its keys, in shares if wanted, and writes one table.
//!
//! A combination is a cell. Each cell is written to a file when it is done, so that an interrupted study can continue,
//! and so that machines can share one: share 2/5 runs every fifth cell from the second on. The file has the scene that
//! was run; a cell of another scene is refused. The table is made from the files alone, so it is equal for any number of
//! shares, except for its times.
//!
//! A row has the last reported value of each quantity, the largest amount of each force, and medians and worst values of
//! times. Cost: that of the runs.

use std::collections::BTreeMap;
use std::fs;
use std::io::{IsTerminal, Write, stderr};
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, anyhow};
use incise::mesh_io::write_atomically;
use incise::report::ForceReport;
use incise::scene::Quantity;
use incise::{Error, FrameReport, Scene, Simulation};
use indicatif::{ProgressBar, ProgressStyle};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::args::SweepArguments;
use crate::failure::Failure;
use crate::print::{count, print};
use crate::run::{default_frames, in_pool};

/// A key of the scene and the values that it takes.
struct Setting {
    key: String,
    /// Each value as it is written and as it is.
    values: Vec<(String, toml::Value)>,
}

/// A combination of values.
struct Cell {
    /// The value of each setting, as it is written.
    values: Vec<String>,
    scene: Scene,
    /// The scene as text, which tells cells of other studies.
    text: String,
}

/// The file of a cell.
#[derive(Debug, Serialize, Deserialize)]
struct Done {
    scene: String,
    frames: u64,
    outcome: String,
    quantities: BTreeMap<String, Value>,
}

pub(crate) fn sweep(arguments: &SweepArguments) -> Result<(), Failure> {
    let cells = cells(arguments)?;
    if !arguments.merge.is_empty() {
        return merge(arguments, &cells);
    }
    in_pool(arguments.threads, || run(arguments, &cells))
}

/// Runs the missing cells, and writes the table if they are not those of one share.
fn run(arguments: &SweepArguments, cells: &[Cell]) -> Result<(), Failure> {
    let folder = arguments.out.join("cells");
    fs::create_dir_all(&folder)
        .with_context(|| format!("cannot make the folder {}", folder.display()))
        .map_err(Failure::Input)?;
    let share = arguments.shard;
    let mine: Vec<usize> = (0..cells.len())
        .filter(|&cell| share.is_none_or(|share| share.has(cell)))
        .collect();
    let progress = Progress::new(mine.len(), arguments.quiet);
    for &number in &mine {
        let cell = &cells[number];
        let start = Instant::now();
        let name = described(arguments, cell)?;
        let frames = frames(arguments, cell);
        let path = file(&arguments.out, number);
        let is_known = read(&path, cell, frames)?.is_some();
        if !is_known {
            let (outcome, quantities) = simulate(&cell.scene, frames).map_err(|error| {
                let input = anyhow::Error::from(error);
                Failure::Input(input.context(format!("{}: {name}", arguments.scene.display())))
            })?;
            let done = Done {
                scene: cell.text.clone(),
                frames,
                outcome,
                quantities,
            };
            let json = serde_json::to_string(&done).map_err(|error| Failure::Run(error.into()))?;
            write_atomically(&path, |out| out.write_all(json.as_bytes()))
                .map_err(|error| Failure::Run(error.into()))?;
        }
        let taken = match is_known {
            true => "known".to_owned(),
            false => format!("{:.1} s", start.elapsed().as_secs_f64()),
        };
        progress.done(&format!("{name}: {taken}"));
    }
    progress.finish();
    if let Some(share) = share {
        if !arguments.quiet {
            print(format!(
                "share {}/{}: {} of {} done in {}; with all shares done, `incise sweep` without --shard writes the table",
                share.index,
                share.count,
                mine.len(),
                count(cells.len(), "cell", "cells"),
                arguments.out.display()
            ))?;
        }
        return Ok(());
    }
    write_table(arguments, cells)
}

/// Copies the cells of other folders to the folder of the study, and writes the table.
fn merge(arguments: &SweepArguments, cells: &[Cell]) -> Result<(), Failure> {
    for from in &arguments.merge {
        if !from.join("cells").is_dir() {
            let why = format!("{} has no cells of a sweep", from.display());
            return Err(Failure::Input(anyhow!(why)));
        }
    }
    for (number, cell) in cells.iter().enumerate() {
        let to = file(&arguments.out, number);
        let frames = frames(arguments, cell);
        if read(&to, cell, frames)?.is_some() {
            continue;
        }
        for from in &arguments.merge {
            let path = file(from, number);
            if read(&path, cell, frames)?.is_none() {
                continue;
            }
            let copied = fs::create_dir_all(arguments.out.join("cells"))
                .and_then(|()| fs::read(&path))
                .with_context(|| format!("cannot copy {}", path.display()))
                .map_err(Failure::Run)?;
            write_atomically(&to, |out| out.write_all(&copied))
                .map_err(|error| Failure::Run(error.into()))?;
            break;
        }
    }
    write_table(arguments, cells)
}

/// The table of all cells; missing ones are an error unless `--partial` is given.
fn write_table(arguments: &SweepArguments, cells: &[Cell]) -> Result<(), Failure> {
    let mut rows = Vec::new();
    let mut missing = Vec::new();
    for (number, cell) in cells.iter().enumerate() {
        match read(&file(&arguments.out, number), cell, frames(arguments, cell))? {
            Some(done) => rows.push((number, done)),
            None => missing.push(number),
        }
    }
    if let (Some(&first), false) = (missing.first(), arguments.partial) {
        return Err(Failure::Run(anyhow!(
            "{} of {} missing, the first is cell {first} ({}): run the missing share, or give --partial for a table \
             without them",
            missing.len(),
            count(cells.len(), "cell is", "cells are"),
            described(arguments, &cells[first])?
        )));
    }
    let mut names: Vec<&String> = rows
        .iter()
        .flat_map(|(_, done)| done.quantities.keys())
        .collect();
    names.sort();
    names.dedup();
    let settings = settings(arguments)?;
    let header = settings.iter().map(|setting| setting.key.as_str());
    let header = header
        .chain(["outcome"])
        .chain(names.iter().map(|name| name.as_str()));
    let mut lines = vec![line(header)];
    for (number, done) in &rows {
        let quantities = names.iter().map(|name| match done.quantities.get(*name) {
            None => String::new(),
            Some(Value::String(text)) => text.clone(),
            Some(value) => value.to_string(),
        });
        let values = cells[*number].values.iter().cloned();
        let fields: Vec<String> = values
            .chain([done.outcome.clone()])
            .chain(quantities)
            .collect();
        lines.push(line(fields.iter().map(String::as_str)));
    }
    let path = arguments.out.join("sweep.csv");
    write_atomically(&path, |out| out.write_all(lines.concat().as_bytes()))
        .map_err(|error| Failure::Run(error.into()))?;
    if !arguments.quiet {
        print(format!(
            "{} in {}",
            count(rows.len(), "row", "rows"),
            path.display()
        ))?;
    }
    Ok(())
}

/// A line of a CSV file; fields with separators are quoted (RFC 4180).
fn line<'a>(fields: impl Iterator<Item = &'a str>) -> String {
    let quoted = fields.map(|field| match field.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", field.replace('"', "\"\"")),
        false => field.to_owned(),
    });
    quoted.collect::<Vec<_>>().join(",") + "\n"
}

/// Runs a scene; returns the outcome, the last value of each quantity, and the largest amount of each force.
fn simulate(scene: &Scene, frames: u64) -> Result<(String, BTreeMap<String, Value>), Error> {
    let mut simulation = Simulation::new(scene)?;
    let mut quantities = BTreeMap::new();
    let mut times: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    let mut outcome = "complete".to_owned();
    for _ in 0..frames {
        let report = simulation.step()?;
        note(report, &mut quantities, &mut times);
        if scene.report.quantities.contains(&Quantity::Force)
            && report.frame.is_multiple_of(scene.report.every)
        {
            note_forces(&report.forces, &mut quantities);
        }
        if let Some(warning) = report
            .warnings()
            .iter()
            .find(|warning| warning.is_failure())
        {
            outcome = format!("frame {}: {warning}", report.frame);
            break;
        }
    }
    for (name, mut values) in times {
        values.sort_by(f64::total_cmp);
        let numbers = [("median", values.len() / 2), ("worst", values.len() - 1)];
        for (which, at) in numbers {
            quantities.insert(format!("{name}.{which}"), Value::from(values[at]));
        }
    }
    Ok((outcome, quantities))
}

/// Notes what a frame reports: numbers and names by their keys in `frames.jsonl`, with dots between keys of objects.
fn note(
    report: &FrameReport,
    quantities: &mut BTreeMap<String, Value>,
    times: &mut BTreeMap<String, Vec<f64>>,
) {
    let Ok(Value::Object(report)) = serde_json::to_value(report) else {
        return;
    };
    for (name, value) in report {
        match value {
            Value::Object(parts) => {
                for (part, value) in parts {
                    let name = format!("{name}.{part}");
                    match value.as_f64() {
                        Some(time) if name.starts_with("ms.") => {
                            times.entry(name).or_default().push(time);
                        }
                        _ if is_plain(&value) => {
                            quantities.insert(name, value);
                        }
                        _ => {}
                    }
                }
            }
            value if is_plain(&value) => {
                quantities.insert(name, value);
            }
            _ => {}
        }
    }
}

/// Notes the forces of a frame in N: components, which are 0 for what no longer touches, and the largest amount so far.
fn note_forces(forces: &[ForceReport], quantities: &mut BTreeMap<String, Value>) {
    let old = quantities
        .iter_mut()
        .filter(|(name, _)| name.starts_with("force."));
    old.filter(|(name, _)| !name.ends_with(".largest"))
        .for_each(|(_, value)| *value = Value::from(0.0));
    for entry in forces {
        let kind = serde_json::to_value(entry.kind).unwrap_or_default();
        let mut name = format!(
            "force.{}.{}",
            kind.as_str().unwrap_or_default(),
            entry.index
        );
        if let Some(other) = entry.other {
            name += &format!(".{other}");
        }
        let force = entry.force.force;
        for (axis, component) in ["x", "y", "z"].into_iter().zip(force.to_array()) {
            quantities.insert(format!("{name}.{axis}"), Value::from(component));
        }
        let largest = quantities.entry(format!("{name}.largest")).or_default();
        *largest = Value::from(force.length().max(largest.as_f64().unwrap_or(0.0)));
    }
}

/// True for numbers, names and truth values; lists have no column.
fn is_plain(value: &Value) -> bool {
    value.is_number() || value.is_string() || value.is_boolean()
}

/// The file of a cell.
fn file(out: &Path, cell: usize) -> PathBuf {
    out.join("cells").join(format!("{cell:05}.json"))
}

/// Reads the file of a cell, if there is one; an error if it is of another study.
fn read(path: &Path, cell: &Cell, frames: u64) -> Result<Option<Done>, Failure> {
    let Ok(text) = fs::read_to_string(path) else {
        return Ok(None);
    };
    let done: Option<Done> = serde_json::from_str(&text).ok();
    match done.filter(|done| done.scene == cell.text && done.frames == frames) {
        Some(done) => Ok(Some(done)),
        None => Err(Failure::Input(anyhow!(
            "{} is of another study: remove it or choose another --out",
            path.display()
        ))),
    }
}

fn frames(arguments: &SweepArguments, cell: &Cell) -> u64 {
    arguments
        .frames
        .unwrap_or_else(|| default_frames(&cell.scene))
}

/// The values of a cell with their keys.
fn described(arguments: &SweepArguments, cell: &Cell) -> Result<String, Failure> {
    let settings = settings(arguments)?;
    let pairs = settings.iter().zip(&cell.values);
    let pairs: Vec<String> = pairs
        .map(|(setting, value)| format!("{}={value}", setting.key))
        .collect();
    Ok(pairs.join(" "))
}

/// All combinations, the values of the last setting next to each other.
fn cells(arguments: &SweepArguments) -> Result<Vec<Cell>, Failure> {
    let settings = settings(arguments)?;
    let path = &arguments.scene;
    let text = fs::read_to_string(path)
        .with_context(|| format!("cannot read {}", path.display()))
        .map_err(Failure::Input)?;
    // The scene as it is must be valid, so that its own errors have their lines.
    crate::run::load(Some(path))?;
    let table: toml::Table = toml::from_str(&text)
        .with_context(|| path.display().to_string())
        .map_err(Failure::Input)?;
    let number = settings
        .iter()
        .map(|setting| setting.values.len())
        .product();
    let mut cells = Vec::with_capacity(number);
    for cell in 0..number {
        let mut table = toml::Value::Table(table.clone());
        let mut rest = cell;
        let mut values = vec![String::new(); settings.len()];
        for (setting, written) in settings.iter().zip(&mut values).rev() {
            let (text, value) = &setting.values[rest % setting.values.len()];
            rest /= setting.values.len();
            written.clone_from(text);
            let set = set(&mut table, &setting.key, value.clone());
            set.map_err(|why| Failure::Input(anyhow!("--set {}={written}: {why}", setting.key)))?;
        }
        let changed = toml::to_string(&table).map_err(|error| Failure::Input(error.into()))?;
        let scene = Scene::from_toml(&changed).map_err(|error| {
            // Lines of the changed text are not those of the file.
            let why = match error {
                Error::Parse { message, .. } => anyhow!(message),
                error => error.into(),
            };
            let pairs = settings.iter().zip(&values);
            let pairs: Vec<String> = pairs
                .map(|(s, value)| format!("--set {}={value}", s.key))
                .collect();
            Failure::Input(why.context(pairs.join(" ")))
        })?;
        cells.push(Cell {
            values,
            scene: relative_to(scene, path),
            text: changed,
        });
    }
    Ok(cells)
}

/// Mesh files are relative to the file of the scene.
fn relative_to(mut scene: Scene, file: &Path) -> Scene {
    let folder = file.parent().unwrap_or(Path::new(""));
    for mesh in scene.body.iter_mut().filter_map(|body| body.mesh.as_mut()) {
        *mesh = folder.join(&mesh);
    }
    scene
}

/// The settings of the command line.
fn settings(arguments: &SweepArguments) -> Result<Vec<Setting>, Failure> {
    let mut settings: Vec<Setting> = Vec::new();
    for text in &arguments.set {
        let wrong =
            |why: &str| Failure::Input(anyhow!("--set {text}: {why}, as in solver.substeps=4,8"));
        let (key, values) = text
            .split_once('=')
            .ok_or_else(|| wrong("give a key and values"))?;
        let key = key.trim().to_owned();
        let values: Vec<&str> = split(values);
        if key.is_empty() || values.iter().any(|value| value.is_empty()) {
            return Err(wrong("give a key and values"));
        }
        if settings.iter().any(|other| other.key == key) {
            return Err(wrong("give a key once, with all its values"));
        }
        let read = |text: &str| match value(text) {
            toml::Value::String(name) => (name.clone(), toml::Value::String(name)),
            value => (text.to_owned(), value),
        };
        let values = values.into_iter().map(read).collect();
        settings.push(Setting { key, values });
    }
    Ok(settings)
}

/// Splits at commas outside of brackets, braces and quotes.
fn split(text: &str) -> Vec<&str> {
    let mut parts = Vec::new();
    let (mut depth, mut quote, mut start) = (0_usize, None, 0);
    for (at, c) in text.char_indices() {
        match (quote, c) {
            (Some(open), c) if open == c => quote = None,
            (Some(_), _) => {}
            (None, '"' | '\'') => quote = Some(c),
            (None, '[' | '{') => depth += 1,
            (None, ']' | '}') => depth = depth.saturating_sub(1),
            (None, ',') if depth == 0 => {
                parts.push(text[start..at].trim());
                start = at + 1;
            }
            _ => {}
        }
    }
    parts.push(text[start..].trim());
    parts
}

/// A value in TOML; what is none is a name.
fn value(text: &str) -> toml::Value {
    let table: Option<toml::Table> = toml::from_str(&format!("value = {text}")).ok();
    let value = table.and_then(|mut table| table.remove("value"));
    value.unwrap_or_else(|| toml::Value::String(text.to_owned()))
}

/// Sets a key such as `solver.substeps` or `body[0].young_modulus`. Missing tables are added, missing bodies are not.
fn set(scene: &mut toml::Value, key: &str, value: toml::Value) -> Result<(), String> {
    let plain = key.replace('[', ".").replace(']', "");
    let mut at = scene;
    let mut path = String::new();
    let mut parts = plain.split('.').peekable();
    while let Some(part) = parts.next() {
        let next = match at {
            toml::Value::Table(table) => table
                .entry(part.to_owned())
                .or_insert_with(|| toml::Value::Table(toml::Table::new())),
            toml::Value::Array(list) => {
                let length = list.len();
                let index: Option<usize> = part.parse().ok();
                let index = index.ok_or_else(|| {
                    format!("{path} is a list: write {path}[0].{part} for its first entry")
                })?;
                list.get_mut(index).ok_or_else(|| {
                    format!(
                        "{path} has {}, counted from 0",
                        count(length, "entry", "entries")
                    )
                })?
            }
            _ => return Err(format!("{path} is a value and has no key {part}")),
        };
        if parts.peek().is_none() {
            *next = value;
            return Ok(());
        }
        path = match part.parse::<usize>() {
            Ok(index) => format!("{path}[{index}]"),
            Err(_) if path.is_empty() => part.to_owned(),
            Err(_) => format!("{path}.{part}"),
        };
        at = next;
    }
    Ok(())
}

/// A bar on a terminal; elsewhere, as in the log of a cluster, a line for each cell.
struct Progress {
    bar: ProgressBar,
    lines: bool,
}

impl Progress {
    fn new(cells: usize, quiet: bool) -> Self {
        let style = ProgressStyle::with_template("{bar:40} cell {pos}/{len}  {msg}  {elapsed}");
        let bar = match quiet {
            true => ProgressBar::hidden(),
            false => ProgressBar::new(cells as u64),
        };
        bar.set_length(cells as u64);
        Self {
            bar: bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar())),
            lines: !quiet && !stderr().is_terminal(),
        }
    }

    fn done(&self, message: &str) {
        self.bar.inc(1);
        self.bar.set_message(message.to_owned());
        if self.lines {
            let (done, all) = (self.bar.position(), self.bar.length().unwrap_or(0));
            // A log that cannot be written does not stop the study.
            let _ = writeln!(stderr(), "cell {done}/{all}: {message}");
        }
    }

    fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_split_outside_of_lists_and_quotes() {
        assert_eq!(split("1, 2,3"), ["1", "2", "3"]);
        assert_eq!(split("[0,1],[2,[3,4]]"), ["[0,1]", "[2,[3,4]]"]);
        assert_eq!(split("\"a,b\",{x=1,y=2}"), ["\"a,b\"", "{x=1,y=2}"]);
        assert_eq!(value("0.5"), toml::Value::Float(0.5));
        assert_eq!(value("vbd"), toml::Value::String("vbd".to_owned()));
        assert_eq!(value("\"4\""), toml::Value::String("4".to_owned()));
        assert_eq!(value("1 2"), toml::Value::String("1 2".to_owned()));
    }

    #[test]
    fn keys_lead_through_tables_and_lists() {
        let text = "[[body]]\nscale = 1.0\n[[body]]\n[solver]\nsubsteps = 3\n";
        let mut scene: toml::Value = toml::from_str(text).unwrap();
        set(&mut scene, "body[1].scale", value("2.5")).unwrap();
        set(&mut scene, "body.0.scale", value("3")).unwrap();
        set(&mut scene, "world.ground.height", value("-1")).unwrap();
        assert_eq!(scene["body"][1]["scale"], value("2.5"));
        assert_eq!(scene["body"][0]["scale"], value("3"));
        assert_eq!(scene["world"]["ground"]["height"], value("-1"));
        let wrong = |scene: &mut toml::Value, key: &str| set(scene, key, value("1")).unwrap_err();
        assert!(wrong(&mut scene, "body.scale").contains("write body[0].scale"));
        assert!(wrong(&mut scene, "body[2].scale").contains("body has 2 entries"));
        assert!(wrong(&mut scene, "solver.substeps.x").contains("solver.substeps is a value"));
    }

    #[test]
    fn fields_with_separators_are_quoted() {
        let fields = ["a", "b,c", "d\"e", ""];
        assert_eq!(line(fields.into_iter()), "a,\"b,c\",\"d\"\"e\",\n");
    }
}
