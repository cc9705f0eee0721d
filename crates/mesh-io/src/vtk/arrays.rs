//! The point and cell data of a legacy VTK file: arrays with a keyword of their own, and fields of many arrays.
//!
//! Arrays of one or three components are kept; others are skipped. Linear.

use super::cursor::{Wanted, Word};
use super::read::{Reader, Target};
use crate::MeshIoError;
use crate::text::show;
use crate::vtk_grid::named_values;
use crate::vtk_kind::Kind;

impl Reader<'_> {
    /// Reads an array; it is kept if it has a name and an owner.
    pub(super) fn array(
        &mut self,
        kind: Kind,
        components: Option<usize>,
        tuples: Option<usize>,
        name: Option<&[u8]>,
    ) -> Result<(), MeshIoError> {
        self.start_data();
        let count = components
            .zip(tuples)
            .and_then(|(components, tuples)| components.checked_mul(tuples));
        let kept = self.target != Target::None && matches!(components, Some(1 | 3));
        let wanted = match name {
            Some(_) if kept => Wanted::Any,
            _ => Wanted::Not,
        };
        let values = self.cursor.reals(kind, count, "value", wanted)?;
        if let (Some(name), Some(components)) = (name, components) {
            let values = named_values(decoded(name), components, values);
            match self.target {
                Target::None => {}
                Target::Particles => self.grid.particles.extend(values),
                Target::Cells => self.grid.cells.extend(values),
            }
        }
        Ok(())
    }

    fn elements(&self) -> usize {
        match self.target {
            Target::None => 0,
            Target::Particles => self.of_particles.count,
            Target::Cells => self.of_cells.count,
        }
    }

    pub(super) fn field(&mut self) -> Result<(), MeshIoError> {
        self.cursor.expect("the name of the field data")?;
        let arrays = self.cursor.count("the number of arrays")?;
        // An array takes 12 bytes at least.
        let room = arrays.min((self.cursor.bytes.len() - self.cursor.at) / 12);
        match self.target {
            Target::None => {}
            Target::Particles => self.grid.particles.reserve(room),
            Target::Cells => self.grid.cells.reserve(room),
        }
        let mut read = 0;
        while read < arrays {
            let name = self.cursor.expect("an array of the field data")?;
            if name.is("METADATA") {
                self.cursor.line();
                while self.cursor.line_words().next().is_some() {}
                continue;
            }
            read += 1;
            // A missing array has this name and no numbers.
            if name.is("NULL_ARRAY") {
                continue;
            }
            let components = self.cursor.count("the number of components")?;
            let tuples = self.cursor.count("the number of tuples")?;
            let word = self.cursor.expect("the data type of an array")?;
            if self.target != Target::None && tuples != self.elements() {
                let message = format!(
                    "the array {:?} has {tuples} values but there are {} elements, give one for each",
                    show(name.text),
                    self.elements()
                );
                return Err(self.cursor.error(name.at, message));
            }
            if word.is("string") || word.is("utf8_string") {
                self.skip_strings(components.checked_mul(tuples))?;
                continue;
            }
            let kind = Kind::of_legacy(word.text).ok_or_else(|| self.cursor.unknown_kind(word))?;
            self.array(kind, Some(components), Some(tuples), Some(name.text))?;
        }
        Ok(())
    }

    /// Skips strings, which are on lines of their own, or, in a binary file, each after its length: a number of 1, 2, 4
    /// or 8 bytes, depending on its highest two bits.
    fn skip_strings(&mut self, count: Option<usize>) -> Result<(), MeshIoError> {
        self.cursor.line();
        let count = count.ok_or_else(|| {
            self.cursor
                .error(self.cursor.at, "too many strings announced")
        })?;
        for _ in 0..count {
            if !self.cursor.binary {
                if self.cursor.line().is_none() {
                    return Err(self.cursor.ends_early("a string"));
                }
                continue;
            }
            let first = self.cursor.take(Some(1), "a length")?[0];
            let more = [7, 3, 1, 0][usize::from(first >> 6)];
            let rest = self.cursor.take(Some(more), "a length")?;
            let length = rest
                .iter()
                .fold(u64::from(first & 63), |n, &byte| n << 8 | u64::from(byte));
            self.cursor.take(usize::try_from(length).ok(), "a string")?;
        }
        Ok(())
    }

    /// Data sets with a keyword of their own: `SCALARS name type components` and the like.
    pub(super) fn attribute(&mut self, word: Word<'_>, keyword: &[u8]) -> Result<(), MeshIoError> {
        let known: &[&[u8]] = &[
            b"SCALARS",
            b"COLOR_SCALARS",
            b"VECTORS",
            b"NORMALS",
            b"TEXTURE_COORDINATES",
            b"TENSORS",
            b"TENSORS6",
            b"GLOBAL_IDS",
            b"PEDIGREE_IDS",
            b"EDGE_FLAGS",
        ];
        if !known.contains(&keyword) {
            if self.cursor.binary {
                let message = format!("the section {:?} is not known", show(word.text));
                return Err(self.cursor.error(word.at, message));
            }
            return Ok(());
        }
        let tuples = Some(self.elements());
        let name = self.cursor.expect("the name of an array")?;
        let components = match keyword {
            b"COLOR_SCALARS" | b"TEXTURE_COORDINATES" => {
                Some(self.cursor.count("the number of components")?)
            }
            b"VECTORS" | b"NORMALS" => Some(3),
            b"TENSORS" => Some(9),
            b"TENSORS6" => Some(6),
            _ => Some(1),
        };
        // Colors have no type: they are bytes, or numbers from 0 to 1 in a text.
        let kind = match keyword {
            b"COLOR_SCALARS" => Kind::U8,
            _ => self.cursor.kind("the data type of an array")?,
        };
        if keyword != b"SCALARS" {
            return self.array(kind, components, tuples, Some(name.text));
        }
        let start = self.cursor.at;
        let components = match self.cursor.line_words().next() {
            None => Some(1),
            Some(text) => {
                let word = Word {
                    text,
                    at: start,
                    first: false,
                };
                Some(self.cursor.count_of(word, "the number of components")?)
            }
        };
        if let Some(table) = self.cursor.peek().filter(|word| word.is("LOOKUP_TABLE")) {
            self.cursor.at = table.at + table.text.len();
            self.cursor.expect("the name of a table")?;
            return self.array(kind, components, tuples, Some(name.text));
        }
        // Without the line of the table the data starts here, where `array` would skip a line.
        self.cursor.at -= usize::from(self.cursor.bytes[self.cursor.at - 1] == b'\n');
        self.array(kind, components, tuples, Some(name.text))
    }
}

/// A name after decoding of `%` and two digits, which writers use for blanks and special characters.
fn decoded(name: &[u8]) -> String {
    let mut bytes = Vec::with_capacity(name.len());
    let mut rest = name;
    while let Some((&byte, tail)) = rest.split_first() {
        let code = tail
            .get(..2)
            .filter(|digits| byte == b'%' && digits.iter().all(u8::is_ascii_hexdigit))
            .and_then(|digits| str::from_utf8(digits).ok())
            .and_then(|digits| u8::from_str_radix(digits, 16).ok());
        bytes.push(code.unwrap_or(byte));
        rest = if code.is_some() { &tail[2..] } else { tail };
    }
    String::from_utf8_lossy(&bytes).into_owned()
}
