//! [`Cursor`]: a read position in a legacy VTK file, for words, lines and arrays of numbers.
//!
//! An array is words in an ASCII file and big-endian bytes, from the next line on, in a binary one. Memory is reserved
//! only up to the size of the rest of the file. Errors have the line, or the byte of a binary file. Linear.

use std::path::Path;

use crate::MeshIoError;
use crate::text::{show, words_of};
use crate::vtk_kind::Kind;

/// A word, where it starts, and whether it is the first one of its line.
#[derive(Clone, Copy)]
pub(super) struct Word<'b> {
    pub(super) text: &'b [u8],
    pub(super) at: usize,
    pub(super) first: bool,
}

impl Word<'_> {
    pub(super) fn is(&self, keyword: &str) -> bool {
        self.text.eq_ignore_ascii_case(keyword.as_bytes())
    }
}

/// The treatment of numbers.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Wanted {
    /// Keeps them; an error unless all are finite.
    Finite,
    /// Keeps them unchanged.
    Any,
    /// Skips them.
    Not,
}

pub(super) struct Cursor<'b> {
    pub(super) path: &'b Path,
    pub(super) bytes: &'b [u8],
    pub(super) at: usize,
    pub(super) binary: bool,
}

impl<'b> Cursor<'b> {
    /// An error at the given byte.
    pub(super) fn error(&self, at: usize, message: impl Into<String>) -> MeshIoError {
        let (path, message) = (self.path.to_owned(), message.into());
        if self.binary {
            return MeshIoError::ParseBytes {
                path,
                byte: at,
                message,
            };
        }
        let before = &self.bytes[..at.min(self.bytes.len())];
        MeshIoError::Parse {
            path,
            line: 1 + before.iter().filter(|&&b| b == b'\n').count(),
            message,
        }
    }

    pub(super) fn ends_early(&self, missing: &str) -> MeshIoError {
        let last = self.bytes.len().saturating_sub(1);
        self.error(
            last,
            format!("the file ends early: {missing} expected, get the complete file"),
        )
    }

    fn rest(&self) -> &'b [u8] {
        &self.bytes[self.at..]
    }

    /// The rest of the line, without its end.
    pub(super) fn line(&mut self) -> Option<&'b [u8]> {
        let rest = self.rest();
        if rest.is_empty() {
            return None;
        }
        let end = rest.iter().position(|&b| b == b'\n');
        self.at += end.map_or(rest.len(), |end| end + 1);
        let line = &rest[..end.unwrap_or(rest.len())];
        Some(line.strip_suffix(b"\r").unwrap_or(line))
    }

    /// The words of the rest of the line.
    pub(super) fn line_words(&mut self) -> impl Iterator<Item = &'b [u8]> + use<'b> {
        words_of(self.line().unwrap_or_default())
    }

    /// The next word, without advancing.
    pub(super) fn peek(&self) -> Option<Word<'b>> {
        let rest = self.rest();
        let skipped = rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let word = &rest[skipped..];
        let end = word.iter().position(u8::is_ascii_whitespace);
        let at = self.at + skipped;
        let mut before = self.bytes[..at].iter().rev();
        let first = before
            .find(|&&b| b == b'\n' || !b.is_ascii_whitespace())
            .is_none_or(|&b| b == b'\n');
        Some(Word {
            text: &word[..end.unwrap_or(word.len())],
            at,
            first,
        })
    }

    pub(super) fn word(&mut self) -> Option<Word<'b>> {
        let word = self.peek()?;
        self.at = word.at + word.text.len();
        Some(word)
    }

    pub(super) fn expect(&mut self, what: &str) -> Result<Word<'b>, MeshIoError> {
        self.word().ok_or_else(|| self.ends_early(what))
    }

    /// Parses a word as a number from 0 on.
    pub(super) fn count(&mut self, what: &str) -> Result<usize, MeshIoError> {
        let word = self.expect(what)?;
        self.count_of(word, what)
    }

    pub(super) fn count_of(&self, word: Word<'_>, what: &str) -> Result<usize, MeshIoError> {
        let number = str::from_utf8(word.text).ok().and_then(|t| t.parse().ok());
        number.ok_or_else(|| {
            self.error(
                word.at,
                format!(
                    "{:?} is not {what}: a whole number expected",
                    show(word.text)
                ),
            )
        })
    }

    pub(super) fn kind(&mut self, what: &str) -> Result<Kind, MeshIoError> {
        let word = self.expect(what)?;
        Kind::of_legacy(word.text).ok_or_else(|| self.unknown_kind(word))
    }

    pub(super) fn unknown_kind(&self, word: Word<'_>) -> MeshIoError {
        let message = format!("the data type {:?} is not known", show(word.text));
        self.error(word.at, message)
    }

    /// The bytes of an array of a binary file, which starts at the cursor.
    pub(super) fn take(
        &mut self,
        size: Option<usize>,
        what: &str,
    ) -> Result<&'b [u8], MeshIoError> {
        let rest = self.rest();
        let taken = size.and_then(|size| rest.get(..size));
        let taken = taken.ok_or_else(|| {
            let message = format!(
                "the file ends early: {} bytes of {what} announced but {} left, get the complete file",
                size.map_or("too many".to_owned(), |size| size.to_string()),
                rest.len()
            );
            self.error(self.at, message)
        })?;
        self.at += taken.len();
        Ok(taken)
    }

    /// The capacity to reserve: the announced number of values, bounded by the size of the rest of the file.
    pub(super) fn room_for(&self, announced: usize) -> usize {
        let least_bytes = if self.binary { 4 } else { 2 };
        announced.min(self.rest().len() / least_bytes + 1)
    }

    /// Reads an array of numbers; empty if they are skipped. In a binary file the cursor is at the start of the data.
    pub(super) fn reals(
        &mut self,
        kind: Kind,
        count: Option<usize>,
        what: &str,
        wanted: Wanted,
    ) -> Result<Vec<f64>, MeshIoError> {
        let finite = wanted == Wanted::Finite;
        let start = self.at;
        if self.binary {
            let bytes = self.take(count.and_then(|count| kind.bytes(count)), what)?;
            if wanted == Wanted::Not {
                return Ok(Vec::new());
            }
            let values = kind.reals(bytes, count.unwrap_or(0), true);
            if finite && let Some(i) = values.iter().position(|value| !value.is_finite()) {
                let at = start + i * (bytes.len() / values.len());
                let message = format!("the {what} {} is not finite, correct it", values[i]);
                return Err(self.error(at, message));
            }
            return Ok(values);
        }
        let count =
            count.ok_or_else(|| self.error(start, format!("too many {what}s announced")))?;
        let mut values = Vec::new();
        if wanted != Wanted::Not {
            values.reserve_exact(self.room_for(count));
        }
        for i in 0..count {
            let Some(word) = self.word() else {
                let missing = format!("{count} numbers ({what}) announced but {i} found, more");
                return Err(self.ends_early(&missing));
            };
            let text = str::from_utf8(word.text).ok();
            let Some(value) = text.and_then(|text| text.parse::<f64>().ok()) else {
                let message = format!("{:?} is not a {what}: a number expected", show(word.text));
                return Err(self.error(word.at, message));
            };
            if finite && !value.is_finite() {
                let message = format!("the {what} {} is not finite, correct it", show(word.text));
                return Err(self.error(word.at, message));
            }
            if wanted != Wanted::Not {
                values.push(value);
            }
        }
        Ok(values)
    }

    /// Reads an array of numbers from 0 on; empty if they are skipped.
    pub(super) fn indices(
        &mut self,
        kind: Kind,
        count: usize,
        what: &str,
    ) -> Result<Vec<usize>, MeshIoError> {
        let start = self.at;
        if self.binary {
            let bytes = self.take(kind.bytes(count), what)?;
            return kind.indices(bytes, count, true).map_err(|i| {
                self.error(
                    start + i * (bytes.len() / count),
                    format!("a number is not {what}: it is negative or no integer"),
                )
            });
        }
        let mut numbers = Vec::with_capacity(self.room_for(count));
        for i in 0..count {
            let Some(word) = self.word() else {
                let missing = format!("{count} numbers ({what}) announced but {i} found, more");
                return Err(self.ends_early(&missing));
            };
            numbers.push(self.count_of(word, what)?);
        }
        Ok(numbers)
    }
}
