//! Sections `$NodeData` and `$ElementData` of MSH versions 2 and 4: a head in words, then a number and values each.
//!
//! Linear.

use super::content::{Content, Data};
use super::source::Source;
use crate::MeshIoError;

/// Reads such a section after its name. Values with other than 1 or 3 components are skipped.
pub(super) fn read_data(
    source: &mut Source<'_>,
    content: &mut Content,
    of_nodes: bool,
) -> Result<(), MeshIoError> {
    let strings: usize = source.number("the number of names")?;
    source.line();
    let mut name = String::new();
    for i in 0..strings {
        if !source.skip_blanks() {
            return Err(source.ends_early("a name"));
        }
        let line = source.line();
        if i == 0 {
            name = unquoted(&String::from_utf8_lossy(line));
        }
    }
    let reals: usize = source.number("the number of real tags")?;
    for _ in 0..reals {
        source.number::<f64>("a real tag")?;
    }
    let integers: usize = source.number("the number of whole tags")?;
    let [mut components, mut count] = [None; 2];
    for i in 0..integers {
        match i {
            1 => components = Some(source.number::<usize>("the number of components")?),
            2 => count = Some(source.number::<usize>("the number of values")?),
            _ => {
                source.number::<i64>("a whole tag")?;
            }
        }
    }
    let (Some(components), Some(count)) = (components, count) else {
        return Err(source.error(format!(
            "the data {name:?} have {integers} whole tags, but 3 are needed: time step, components, values"
        )));
    };
    source.line();

    let wanted = components == 1 || components == 3;
    let mut data = Data {
        name,
        of_nodes,
        components,
        tags: Vec::new(),
        values: Vec::new(),
    };
    if wanted {
        let room = source.room_for(count, 4);
        data.tags.reserve(room);
        data.values.reserve(source.room_for(room * components, 2));
    }
    for _ in 0..count {
        let tag = source.short_tag("the number of a node or element")?;
        let offset = source.offset();
        if wanted {
            data.tags.push((tag, offset));
        }
        for _ in 0..components {
            let value = source.double("a value")?;
            if wanted {
                data.values.push(value);
            }
        }
    }
    if wanted {
        content.data.push(data);
    }
    Ok(())
}

/// A name without its quotes.
fn unquoted(line: &str) -> String {
    let line = line.trim();
    let inner = line.strip_prefix('"').and_then(|l| l.strip_suffix('"'));
    inner.unwrap_or(line).to_owned()
}
