//! The bytes of a data array of an XML file: raw or in base64, compressed or not.
//!
//! An array starts with a header of whole numbers: its length in bytes, or, if compressed, the number of blocks, their
//! length, the length of a shorter last block or 0, and the compressed length of each. Header and data may be one
//! base64 text or two, each with its padding, so padding is accepted at any group of four and decoding continues after
//! it; the crate `base64` does not support that. The expected length is known and checked before decompression, and
//! `miniz_oxide` stops at a limit. Memory is linear in the size of the file, but zlib can expand a byte to a thousand.
//! Linear.
//!
//! Source: "VTK XML Formats" (Kitware); RFC 4648, section 4.

use miniz_oxide::inflate::decompress_to_vec_zlib_with_limit;

use crate::base64::{decode, next_group};

/// The representation of numbers in the whole file.
#[derive(Clone, Copy)]
pub(super) struct Storage {
    pub(super) big_endian: bool,
    /// The bytes of a number in a header: 4 or 8.
    pub(super) header: usize,
    pub(super) compressed: bool,
}

/// A sequential reader of bytes.
pub(super) enum Stream<'b> {
    Raw(&'b [u8]),
    /// The remaining text, and decoded bytes that have not been taken.
    Base64(&'b [u8], Vec<u8>),
}

impl Stream<'_> {
    /// The number of unused bytes of the file.
    pub(super) fn left(&self) -> usize {
        match self {
            Self::Raw(bytes) => bytes.len(),
            Self::Base64(text, _) => text.len(),
        }
    }

    fn take(&mut self, size: usize) -> Result<Vec<u8>, String> {
        let missing =
            |left: usize| format!("{size} bytes expected but {left} left, get the complete file");
        match self {
            Self::Raw(bytes) => {
                let (taken, rest) = bytes
                    .split_at_checked(size)
                    .ok_or_else(|| missing(bytes.len()))?;
                *bytes = rest;
                Ok(taken.to_vec())
            }
            Self::Base64(text, decoded) => {
                let most = decoded.len() + text.len() / 4 * 3 + 3;
                if size > most {
                    return Err(missing(most));
                }
                decoded.reserve(size.saturating_sub(decoded.len()) + 3);
                while decoded.len() < size {
                    let group = next_group(text).ok_or_else(|| missing(decoded.len()))?;
                    let (bytes, count) = decode(group).ok_or_else(|| {
                        format!("{:?} is no base64", String::from_utf8_lossy(&group))
                    })?;
                    decoded.extend(&bytes[..count]);
                }
                let rest = decoded.split_off(size);
                Ok(std::mem::replace(decoded, rest))
            }
        }
    }

    fn number(&mut self, storage: Storage) -> Result<usize, String> {
        let bytes = self.take(storage.header)?;
        let fold = |n: u64, &byte: &u8| n << 8 | u64::from(byte);
        let number = if storage.big_endian {
            bytes.iter().fold(0, fold)
        } else {
            bytes.iter().rev().fold(0, fold)
        };
        usize::try_from(number).map_err(|_| format!("the length {number} is too large"))
    }

    /// The bytes of an array whose size must be `size`.
    pub(super) fn array(&mut self, size: usize, storage: Storage) -> Result<Vec<u8>, String> {
        // Writers disagree on the header of an empty array, and it has no data.
        if size == 0 {
            return Ok(Vec::new());
        }
        let wrong = |found: usize| {
            format!(
                "the array has {found} bytes instead of {size}, correct the header or the counts"
            )
        };
        if !storage.compressed {
            let found = self.number(storage)?;
            if found != size {
                return Err(wrong(found));
            }
            return self.take(size);
        }
        let blocks = self.number(storage)?;
        let [block, last] = [self.number(storage)?, self.number(storage)?];
        let whole = blocks.saturating_sub(usize::from(last > 0));
        let found = whole.saturating_mul(block).saturating_add(last);
        if found != size || blocks == 0 || last > block {
            return Err(wrong(found));
        }
        let mut lengths = Vec::new();
        for _ in 0..blocks {
            lengths.push(self.number(storage)?);
        }
        let mut data = Vec::new();
        for (i, length) in lengths.into_iter().enumerate() {
            let expected = if i < whole { block } else { last };
            let compressed = self.take(length)?;
            let plain = decompress_to_vec_zlib_with_limit(&compressed, expected)
                .map_err(|error| format!("the block {i} is damaged: {error}"))?;
            if plain.len() != expected {
                return Err(format!(
                    "the block {i} has {} bytes instead of {expected}",
                    plain.len()
                ));
            }
            data.extend(plain);
        }
        Ok(data)
    }
}
