//! Bytes as base64 and back, for text formats.
//!
//! Source: RFC 4648, section 4. Linear.

use std::io::{self, Write};

/// Writes bytes as base64, padded with `=`.
pub(crate) fn base64(out: &mut dyn Write, bytes: &[u8]) -> io::Result<()> {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for group in bytes.chunks(3) {
        let byte = |i: usize| u32::from(group.get(i).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        let mut digits = [18, 12, 6, 0].map(|shift| DIGITS[(bits >> shift) as usize % 64]);
        digits[group.len() + 1..].fill(b'=');
        out.write_all(&digits)?;
    }
    Ok(())
}

/// The next four digits, without blanks and line ends.
pub(crate) fn next_group(text: &mut &[u8]) -> Option<[u8; 4]> {
    let mut group = [0; 4];
    let mut found = 0;
    while found < 4 {
        let (&byte, rest) = text.split_first()?;
        *text = rest;
        if !byte.is_ascii_whitespace() {
            group[found] = byte;
            found += 1;
        }
    }
    Some(group)
}

/// Four digits as up to three bytes.
pub(crate) fn decode(group: [u8; 4]) -> Option<([u8; 3], usize)> {
    let padding = group
        .iter()
        .rev()
        .take_while(|&&digit| digit == b'=')
        .count();
    if padding > 2 {
        return None;
    }
    let mut bits = 0_u32;
    for &digit in &group[..4 - padding] {
        let value = match digit {
            b'A'..=b'Z' => digit - b'A',
            b'a'..=b'z' => digit - b'a' + 26,
            b'0'..=b'9' => digit - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        };
        bits = bits << 6 | u32::from(value);
    }
    bits <<= 6 * padding;
    let [_, a, b, c] = bits.to_be_bytes();
    Some(([a, b, c], 3 - padding))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_of_the_standard() {
        for (plain, encoded) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("foobar", "Zm9vYmFy"),
        ] {
            let mut out = Vec::new();
            base64(&mut out, plain.as_bytes()).unwrap();
            assert_eq!(out, encoded.as_bytes());
            let mut text = encoded.as_bytes();
            let mut back: Vec<u8> = Vec::new();
            while let Some(group) = next_group(&mut text) {
                let (bytes, count) = decode(group).unwrap();
                back.extend(&bytes[..count]);
            }
            assert_eq!(back, plain.as_bytes());
        }
    }
}
