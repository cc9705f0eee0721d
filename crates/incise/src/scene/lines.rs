//! [`line_of`]: the line of a key in the text of a scene, for errors about its value.

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

/// Where in a scene file the key of an error is, as `scene.toml: line 6`; `None` if the error is about no key or the file
/// has no trace of it. Reads the file.
#[must_use]
pub fn location(path: &Path, error: &Error) -> Option<String> {
    let text = std::fs::read_to_string(path).ok()?;
    let line = line_of(&text, &error.key()?)?;
    Some(format!("{}: line {line}", path.display()))
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
