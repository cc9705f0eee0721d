//! The elements after the header: a sequence of values, as words or bytes. Linear.

use std::path::Path;

use super::header::{Element, Type};
use crate::MeshIoError;
use crate::text::{Text, Word, show};

/// The content after the header.
pub(super) enum Payload<'b, 't, I> {
    Ascii {
        text: &'b Text<'b>,
        words: I,
        /// The line of the last value.
        line: usize,
    },
    Binary {
        path: &'t Path,
        bytes: &'t [u8],
        /// The starts of the last value and of the next one.
        last: usize,
        at: usize,
        big_endian: bool,
    },
}

impl<'b, I: Iterator<Item = Word<'b>>> Payload<'b, '_, I> {
    /// The next value; in text, any number.
    pub(super) fn number(&mut self, kind: Type, what: &str) -> Result<f64, MeshIoError> {
        match self {
            Payload::Ascii { text, words, line } => {
                let word = words.next().ok_or_else(|| text.ends_early(what))?;
                *line = word.line;
                let number = str::from_utf8(word.text).ok().and_then(|w| w.parse().ok());
                number.ok_or_else(|| {
                    let message = format!("{:?} is not {what}: a number expected", show(word.text));
                    text.error(word.line, message)
                })
            }
            Payload::Binary { .. } => Ok(match kind {
                Type::I8 => i8::from_le_bytes(self.take(what)?).into(),
                Type::U8 => u8::from_le_bytes(self.take(what)?).into(),
                Type::I16 => i16::from_le_bytes(self.take(what)?).into(),
                Type::U16 => u16::from_le_bytes(self.take(what)?).into(),
                Type::I32 => i32::from_le_bytes(self.take(what)?).into(),
                Type::U32 => u32::from_le_bytes(self.take(what)?).into(),
                Type::F32 => f32::from_le_bytes(self.take(what)?).into(),
                Type::F64 => f64::from_le_bytes(self.take(what)?),
            }),
        }
    }

    /// The capacity to reserve: the announced number of elements, bounded by the size of the rest
    /// of the file.
    pub(super) fn room_for(&self, element: &Element<'_>) -> usize {
        let numbers = || {
            element
                .properties
                .iter()
                .map(|p| p.count.unwrap_or(p.value))
        };
        let (left, least) = match self {
            Payload::Ascii { text, .. } => {
                return text.room_for(element.count, 2 * numbers().count());
            }
            Payload::Binary { bytes, at, .. } => {
                (bytes.len() - at, numbers().map(Type::bytes).sum())
            }
        };
        element.count.min(left.checked_div(least).unwrap_or(0))
    }

    /// The largest number of values of a type that the rest of the file can hold.
    pub(super) fn most_values(&self, kind: Type) -> usize {
        match self {
            Payload::Ascii { text, .. } => text.room_for(usize::MAX, 2),
            Payload::Binary { bytes, at, .. } => (bytes.len() - at) / kind.bytes(),
        }
    }

    /// The next value as a whole number from 0 on.
    pub(super) fn natural(&mut self, kind: Type, what: &str) -> Result<u32, MeshIoError> {
        let number = self.number(kind, what)?;
        if number >= 0.0 && number <= u32::MAX.into() && number.fract() == 0.0 {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "checked"
            )]
            return Ok(number as u32);
        }
        let message = format!("{number} is not {what}: a whole number from 0 expected");
        Err(self.error(self.offset(), message))
    }

    /// The next bytes in little-endian order.
    fn take<const N: usize>(&mut self, what: &str) -> Result<[u8; N], MeshIoError> {
        if let Payload::Binary {
            bytes,
            last,
            at,
            big_endian,
            ..
        } = self
        {
            *last = *at;
            if let Some(&(mut bytes)) = bytes[*at..].first_chunk() {
                *at += N;
                if *big_endian {
                    bytes.reverse();
                }
                return Ok(bytes);
            }
        }
        let message = format!("the file ends early: {what} expected, get the complete file");
        Err(self.error(self.offset(), message))
    }

    /// The line or byte of the last value.
    pub(super) fn offset(&self) -> usize {
        match self {
            Payload::Ascii { line, .. } => *line,
            Payload::Binary { last, .. } => *last,
        }
    }

    pub(super) fn error(&self, offset: usize, message: String) -> MeshIoError {
        match self {
            Payload::Ascii { text, .. } => text.error(offset, message),
            Payload::Binary { path, .. } => MeshIoError::ParseBytes {
                path: path.to_path_buf(),
                byte: offset,
                message,
            },
        }
    }
}
