//! [`Text`]: the words of a text file with their lines, and the numbers among them.
//!
//! Works on bytes, so titles may have any encoding. Linear.

use std::fs;
use std::path::Path;

use crate::MeshIoError;

/// The content of a file, binary or text.
pub(super) fn load(path: &Path) -> Result<Vec<u8>, MeshIoError> {
    fs::read(path).map_err(|source| MeshIoError::Io {
        action: "read",
        path: path.to_owned(),
        source,
    })
}

/// A file in memory.
pub(super) struct Text<'a> {
    path: &'a Path,
    bytes: &'a [u8],
}

/// A word and its line, counted from 1.
#[derive(Clone, Copy)]
pub(super) struct Word<'t> {
    pub(super) text: &'t [u8],
    pub(super) line: usize,
    /// True for the first word of a line.
    pub(super) first: bool,
}

impl<'t> Word<'t> {
    /// A word whose position in the line does not matter.
    pub(super) fn new(text: &'t [u8], line: usize) -> Self {
        let first = false;
        Self { text, line, first }
    }
}

impl<'a> Text<'a> {
    pub(super) fn new(path: &'a Path, bytes: &'a [u8]) -> Self {
        Self { path, bytes }
    }

    /// The lines with their numbers, from the given one on; line ends of all systems are recognized.
    pub(super) fn lines(&self, from: usize) -> impl Iterator<Item = (usize, &[u8])> {
        let lines = self
            .bytes
            .split(|&b| b == b'\n')
            .enumerate()
            .map(|(i, line)| (i + 1, line));
        lines
            .skip(from - 1)
            .map(|(i, line)| (i, line.strip_suffix(b"\r").unwrap_or(line)))
    }

    /// The words from the given line on.
    pub(super) fn words(&self, from: usize) -> impl Iterator<Item = Word<'_>> {
        self.lines(from).flat_map(|(line, text)| {
            words_of(text).enumerate().map(move |(i, text)| Word {
                text,
                line,
                first: i == 0,
            })
        })
    }

    /// The capacity to reserve: the announced number of elements, bounded by the size of the file.
    pub(super) fn room_for(&self, announced: usize, least_bytes_each: usize) -> usize {
        announced.min(self.bytes.len() / least_bytes_each)
    }

    /// An error on the given line.
    pub(super) fn error(&self, line: usize, message: impl Into<String>) -> MeshIoError {
        MeshIoError::Parse {
            path: self.path.to_owned(),
            line,
            message: message.into(),
        }
    }

    /// An error on the last line.
    pub(super) fn ends_early(&self, missing: &str) -> MeshIoError {
        let line_ends = self.bytes.iter().filter(|&&b| b == b'\n').count();
        let last = line_ends + usize::from(self.bytes.last() != Some(&b'\n'));
        self.error(
            last.max(1),
            format!("the file ends early: {missing} expected, get the complete file"),
        )
    }

    /// Parses a word as a number from 0 on.
    pub(super) fn count(&self, word: Word<'_>, what: &str) -> Result<usize, MeshIoError> {
        let number = str::from_utf8(word.text)
            .ok()
            .and_then(|text| text.parse().ok());
        number.ok_or_else(|| {
            self.error(
                word.line,
                format!(
                    "{:?} is not {what}: a whole number expected",
                    show(word.text)
                ),
            )
        })
    }

    /// Parses a word as a finite coordinate.
    pub(super) fn coordinate(&self, word: Word<'_>) -> Result<f64, MeshIoError> {
        let number = str::from_utf8(word.text)
            .ok()
            .and_then(|text| text.parse::<f64>().ok());
        match number {
            Some(number) if number.is_finite() => Ok(number),
            Some(_) => Err(self.error(
                word.line,
                format!(
                    "the coordinate {} is not finite, correct it",
                    show(word.text)
                ),
            )),
            None => Err(self.error(
                word.line,
                format!(
                    "{:?} is not a coordinate: a number expected",
                    show(word.text)
                ),
            )),
        }
    }
}

/// A line up to its comment, which begins with `#`.
pub(super) fn without_comment(line: &[u8]) -> &[u8] {
    line.split(|&b| b == b'#').next().unwrap_or_default()
}

/// The words of one line.
pub(super) fn words_of(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace)
        .filter(|word| !word.is_empty())
}

/// A word for a message: printable, and shortened if it is long.
pub(super) fn show(word: &[u8]) -> String {
    String::from_utf8_lossy(&word[..word.len().min(40)]).into_owned()
}
