//! [`Source`]: the numbers of an MSH file in sequence, from words or bytes.
//!
//! Both encodings have equal numbers in equal order, so the rest of the reader is independent of the encoding. Offsets
//! are bytes from the start; in a text, errors show lines. Linear.

use std::path::Path;
use std::str::FromStr;

use crate::MeshIoError;
use crate::text::show;

/// How the numbers of a file are stored.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Encoding {
    /// Words of text.
    Text,
    /// Bytes, little-endian.
    Little,
    /// Bytes, big-endian.
    Big,
}

/// A file in memory and the read position in it.
pub(super) struct Source<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    at: usize,
    /// The start of the last item.
    item: usize,
    pub(super) encoding: Encoding,
    /// The bytes of a tag or a count in a binary file of version 4.1: 4 or 8.
    pub(super) size_bytes: usize,
}

impl<'a> Source<'a> {
    pub(super) fn new(path: &'a Path, bytes: &'a [u8]) -> Self {
        Self {
            path,
            bytes,
            at: 0,
            item: 0,
            encoding: Encoding::Text,
            size_bytes: 8,
        }
    }

    /// The bytes of the file.
    pub(super) const fn len(&self) -> usize {
        self.bytes.len()
    }

    /// The start of the last item.
    pub(super) const fn offset(&self) -> usize {
        self.item
    }

    /// An error at the last item.
    pub(super) fn error(&self, message: impl Into<String>) -> MeshIoError {
        self.error_at(self.item, message)
    }

    /// An error at the given offset.
    pub(super) fn error_at(&self, offset: usize, message: impl Into<String>) -> MeshIoError {
        let (path, message) = (self.path.to_owned(), message.into());
        if self.encoding == Encoding::Text {
            let before = &self.bytes[..offset.min(self.bytes.len())];
            let line = 1 + before.iter().filter(|&&b| b == b'\n').count();
            MeshIoError::Parse {
                path,
                line,
                message,
            }
        } else {
            MeshIoError::ParseBytes {
                path,
                byte: offset,
                message,
            }
        }
    }

    /// An error at the last byte.
    pub(super) fn ends_early(&self, missing: &str) -> MeshIoError {
        self.error_at(
            self.bytes.len().saturating_sub(1),
            format!("the file ends early: {missing} expected, get the complete file"),
        )
    }

    /// The capacity to reserve: the announced number of elements, bounded by the size of the rest of the file.
    pub(super) fn room_for(&self, announced: usize, least_bytes_each: usize) -> usize {
        announced.min((self.bytes.len() - self.at) / least_bytes_each)
    }

    /// The next word, in a text or in the readable parts of a binary file.
    pub(super) fn word(&mut self, what: &str) -> Result<&'a [u8], MeshIoError> {
        self.skip_blanks();
        let rest = &self.bytes[self.at..];
        if rest.is_empty() {
            return Err(self.ends_early(what));
        }
        let end = rest.iter().position(u8::is_ascii_whitespace);
        let word = &rest[..end.unwrap_or(rest.len())];
        self.item = self.at;
        self.at += word.len();
        Ok(word)
    }

    /// Skips blanks; false at the end.
    pub(super) fn skip_blanks(&mut self) -> bool {
        let rest = &self.bytes[self.at..];
        let blanks = rest.iter().position(|b| !b.is_ascii_whitespace());
        self.at += blanks.unwrap_or(rest.len());
        self.at < self.bytes.len()
    }

    /// The rest of the line, without its end, which is skipped.
    pub(super) fn line(&mut self) -> &'a [u8] {
        let rest = &self.bytes[self.at..];
        self.item = self.at;
        let (line, passed) = match rest.iter().position(|&b| b == b'\n') {
            Some(end) => (&rest[..end], end + 1),
            None => (rest, rest.len()),
        };
        self.at += passed;
        line.strip_suffix(b"\r").unwrap_or(line)
    }

    /// Skips everything up to and including a line that starts with `end`.
    pub(super) fn skip_past(&mut self, end: &[u8]) -> Result<(), MeshIoError> {
        let rest = &self.bytes[self.at..];
        let mut from = 0;
        while let Some(dollar) = rest[from..].iter().position(|&b| b == b'$') {
            let offset = from + dollar;
            let starts_line = self.bytes[..self.at + offset]
                .last()
                .is_none_or(u8::is_ascii_whitespace);
            let after = rest[offset..].strip_prefix(end);
            if starts_line && after.is_some_and(|a| a.first().is_none_or(u8::is_ascii_whitespace)) {
                self.at += offset + end.len();
                return Ok(());
            }
            from = offset + 1;
        }
        Err(self.ends_early(&show(end)))
    }

    /// Reads the word that ends a section.
    pub(super) fn expect(&mut self, keyword: &str) -> Result<(), MeshIoError> {
        let word = self.word(keyword)?;
        if word == keyword.as_bytes() {
            return Ok(());
        }
        let found = show(word);
        Err(self.error(format!("{keyword} expected but {found:?} found")))
    }

    /// Parses a word as a number, in binary files too.
    pub(super) fn number<T: FromStr>(&mut self, what: &str) -> Result<T, MeshIoError> {
        let word = self.word(what)?;
        let number = str::from_utf8(word).ok().and_then(|text| text.parse().ok());
        number
            .ok_or_else(|| self.error(format!("{:?} is not {what}: a number expected", show(word))))
    }

    fn taken<const N: usize>(&mut self, what: &str) -> Result<[u8; N], MeshIoError> {
        let Some(&bytes) = self.bytes[self.at..].first_chunk::<N>() else {
            return Err(self.ends_early(what));
        };
        self.item = self.at;
        self.at += N;
        let mut bytes = bytes;
        if self.encoding == Encoding::Big {
            bytes.reverse();
        }
        Ok(bytes)
    }

    /// A whole number of 32 bits.
    pub(super) fn int(&mut self, what: &str) -> Result<i32, MeshIoError> {
        if self.encoding == Encoding::Text {
            return self.number(what);
        }
        Ok(i32::from_le_bytes(self.taken(what)?))
    }

    /// A node or element number of the older versions: 32 bits, not negative; a text may hold larger ones.
    pub(super) fn short_tag(&mut self, what: &str) -> Result<u64, MeshIoError> {
        if self.encoding == Encoding::Text {
            return self.number(what);
        }
        let tag = self.int(what)?;
        u64::try_from(tag).map_err(|_| self.error(format!("{tag} is not {what}: it is negative")))
    }

    /// A node or element number of version 4.1.
    pub(super) fn long_tag(&mut self, what: &str) -> Result<u64, MeshIoError> {
        match (self.encoding, self.size_bytes) {
            (Encoding::Text, _) => self.number(what),
            (_, 4) => Ok(u32::from_le_bytes(self.taken(what)?).into()),
            _ => Ok(u64::from_le_bytes(self.taken(what)?)),
        }
    }

    /// A count of version 4.1; too large ones become the largest `usize`.
    pub(super) fn count(&mut self, what: &str) -> Result<usize, MeshIoError> {
        Ok(usize::try_from(self.long_tag(what)?).unwrap_or(usize::MAX))
    }

    /// A floating-point number, which may be NaN or infinite.
    pub(super) fn double(&mut self, what: &str) -> Result<f64, MeshIoError> {
        if self.encoding == Encoding::Text {
            return self.number(what);
        }
        Ok(f64::from_le_bytes(self.taken(what)?))
    }

    /// A finite coordinate.
    pub(super) fn coordinate(&mut self) -> Result<f64, MeshIoError> {
        let coordinate = self.double("a coordinate")?;
        if coordinate.is_finite() {
            return Ok(coordinate);
        }
        Err(self.error(format!(
            "the coordinate {coordinate} is not finite, correct it"
        )))
    }
}
