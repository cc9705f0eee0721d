//! [`line_of`] and [`line_of_message`]: the line that an error about the text of a scene is about.
//!
//! Cost: that of reading the text once more.

use std::ops::Range;
use std::path::Path;

use toml::de::{DeTable, DeValue};

use crate::Error;

/// The line, counted from 1, of a key such as `body[0].young_modulus` in the TOML text of a scene; that of the table or list
/// around it if the text does not name the key itself, since its default applies. `None` if nothing of it is there. O(text).
///
/// # Example
/// ```
/// use incise::scene::line_of;
///
/// let text = "[world]\n\n[[body]]\nyoung_modulus = -1.0\n";
/// assert_eq!(line_of(text, "body[0].young_modulus"), Some(4));
/// assert_eq!(line_of(text, "body[0].density"), Some(3));
/// assert_eq!(line_of(text, "body[1].density"), None);
/// ```
#[must_use]
pub fn line_of(text: &str, key: &str) -> Option<usize> {
    let root = DeTable::parse(text).ok()?;
    let mut at = None;
    let mut table = root.get_ref();
    'names: for segment in key.split('.') {
        let (name, indices) = segment.split_once('[').unwrap_or((segment, ""));
        let found = table.iter().find(|(key, _)| key.get_ref() == name);
        let Some((key, value)) = found else {
            break;
        };
        let mut start = key.span().start;
        let mut value = value;
        for index in indices.split(['[', ']']).filter(|index| !index.is_empty()) {
            let (DeValue::Array(items), Ok(index)) = (value.get_ref(), index.parse::<usize>())
            else {
                break 'names;
            };
            // A list that is too short does not have it.
            value = items.get(index)?;
            start = value.span().start;
        }
        at = Some(start);
        match value.get_ref() {
            DeValue::Table(inside) => table = inside,
            _ => break,
        }
    }
    let before = text.get(..at?)?;
    Some(1 + before.matches('\n').count())
}

/// What an error about a part of a text is about: where that is the heading of a table, all of the table.
pub(super) fn named(text: &str, span: Range<usize>) -> &str {
    let (before, from) = text.split_at_checked(span.start).unwrap_or_default();
    let is_line = before.is_empty() || before.ends_with('\n');
    let end = match from.find("\n[") {
        Some(next) if is_line && from.starts_with('[') => next,
        None if is_line && from.starts_with('[') => from.len(),
        _ => span.len(),
    };
    from.get(..end).unwrap_or_default()
}

/// Where in a scene file the key of an error is, as `scene.toml: line 6`; `None` if the error is about no key or the file
/// has no trace of it. Reads the file.
#[must_use]
pub fn location(path: &Path, error: &Error) -> Option<String> {
    let text = std::fs::read_to_string(path).ok()?;
    let line = line_of(&text, &error.key()?)?;
    Some(format!("{}: line {line}", path.display()))
}

/// The line, counted from 1, of a message of the TOML reader about the text from `start` on. Of a list of tables with kinds the
/// reader knows the first line only, so an unknown key is looked for below it; it counts if only one line has it. O(text).
pub(super) fn line_of_message(text: &str, start: usize, message: &str) -> usize {
    let before = text.get(..start).unwrap_or(text);
    let first = before.matches('\n').count();
    let mut lines = text.lines().map(str::trim_start).skip(first);
    let is_head = lines.next().is_some_and(|line| line.starts_with('['));
    let unknown = message.strip_prefix("unknown field `").filter(|_| is_head);
    let Some((key, _)) = unknown.and_then(|names| names.split_once('`')) else {
        return first + 1;
    };
    let is_key = |line: &str| {
        let rest = line.strip_prefix(key).map(str::trim_start);
        rest.is_some_and(|rest| rest.starts_with('='))
    };
    let mut with_key = (first + 2..).zip(lines).filter(|(_, line)| is_key(line));
    match (with_key.next(), with_key.next()) {
        (Some((line, _)), None) => line,
        _ => first + 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_have_lines() {
        let text = "\
[solver]
substeps = 5

[[body]]
shape = { kind = \"box\", tets = 10 }
fixed = [
  { sphere = { center = [0, 0, 0], radius = 1 } },
  { sphere = { center = [0, 0, 0], radius = -1 } },
]
[[body]]
# nothing here
density = 0
[[stroke]]
kind = \"plane\"
";
        for (key, line) in [
            ("solver.substeps", Some(2)),
            ("solver.accuracy", Some(1)),
            ("solver", Some(1)),
            ("body[0].shape", Some(5)),
            ("body[0].shape.tets", Some(5)),
            ("body[0].fixed[1].sphere.radius", Some(8)),
            ("body[1].density", Some(12)),
            ("body[1].young_modulus", Some(10)),
            ("stroke[0].normal", Some(13)),
            ("stroke[1].normal", None),
            ("world.gravity", None),
            ("body", Some(4)),
            ("", None),
            ("body[x].a", None),
        ] {
            assert_eq!(line_of(text, key), line, "{key}");
        }
        assert_eq!(line_of("not [ toml", "a"), None);
    }
}
