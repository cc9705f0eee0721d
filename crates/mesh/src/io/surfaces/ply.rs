//! Stanford's `.ply`: a text that declares elements and their properties, then the elements as text or binary.
//!
//! Needed are the elements `vertex` with `x`, `y`, `z` and `face` with a list `vertex_indices` or `vertex_index`; all else
//! is skipped. All types have at most 32 bits or are `f64`, so that each value is read as an `f64` without loss. Text
//! keeps the digits of doubles even where `float` is declared. Source: G. Turk, "The PLY Polygon File Format" (1994).
//! Linear.

use std::io::{self, Write};
use std::path::Path;

use glam::DVec3;

use super::super::text::{Text, Word, show, words_of};
use super::super::write_atomically;
use super::{TriangleSurface, fan};
use crate::{MeshError, ParticleId};

/// How the elements of a `.ply` file are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlyEncoding {
    /// Text; the digits give the same bits back.
    Ascii,
    /// Binary with the low byte first.
    LittleEndian,
    /// Binary with the high byte first.
    BigEndian,
}

/// Writes a `.ply` file in the given encoding; all keep every bit of the coordinates.
///
/// # Errors
/// [`MeshError::Io`] if the file cannot be written.
pub fn write_ply(
    path: impl AsRef<Path>,
    surface: &TriangleSurface,
    encoding: PlyEncoding,
) -> Result<(), MeshError> {
    write_atomically(path, |out| write(out, surface, encoding))
}

pub(super) fn write(
    out: &mut dyn Write,
    surface: &TriangleSurface,
    encoding: PlyEncoding,
) -> io::Result<()> {
    let name = match encoding {
        PlyEncoding::Ascii => "ascii",
        PlyEncoding::LittleEndian => "binary_little_endian",
        PlyEncoding::BigEndian => "binary_big_endian",
    };
    writeln!(out, "ply\nformat {name} 1.0")?;
    writeln!(out, "element vertex {}", surface.positions.len())?;
    writeln!(
        out,
        "property double x\nproperty double y\nproperty double z"
    )?;
    writeln!(out, "element face {}", surface.triangles.len())?;
    writeln!(out, "property list uchar uint vertex_indices\nend_header")?;
    for p in &surface.positions {
        match encoding {
            PlyEncoding::Ascii => writeln!(out, "{:?} {:?} {:?}", p.x, p.y, p.z)?,
            PlyEncoding::LittleEndian => {
                out.write_all(p.to_array().map(f64::to_le_bytes).as_flattened())?;
            }
            PlyEncoding::BigEndian => {
                out.write_all(p.to_array().map(f64::to_be_bytes).as_flattened())?;
            }
        }
    }
    for &triangle in &surface.triangles {
        let [a, b, c] = triangle;
        match encoding {
            PlyEncoding::Ascii => writeln!(out, "3 {a} {b} {c}")?,
            PlyEncoding::LittleEndian => {
                out.write_all(&[3])?;
                out.write_all(triangle.map(|p| p.0.to_le_bytes()).as_flattened())?;
            }
            PlyEncoding::BigEndian => {
                out.write_all(&[3])?;
                out.write_all(triangle.map(|p| p.0.to_be_bytes()).as_flattened())?;
            }
        }
    }
    Ok(())
}

#[derive(Clone, Copy)]
enum Type {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

struct Property<'t> {
    name: &'t [u8],
    /// The type of the number of values, of a list.
    count: Option<Type>,
    value: Type,
}

struct Element<'t> {
    name: &'t [u8],
    line: usize,
    count: usize,
    properties: Vec<Property<'t>>,
}

pub(crate) fn parse_ply(bytes: &[u8], path: &Path) -> Result<TriangleSurface, MeshError> {
    let text = Text::new(path, bytes);
    let (encoding, elements, header_lines) = header(&text)?;
    let mut body = if encoding == PlyEncoding::Ascii {
        Body::Ascii {
            text: &text,
            words: text.words(header_lines + 1),
            line: header_lines,
        }
    } else {
        let mut line_ends = (0..bytes.len()).filter(|&i| bytes[i] == b'\n');
        Body::Binary {
            path,
            bytes,
            last: 0,
            at: line_ends
                .nth(header_lines - 1)
                .map_or(bytes.len(), |end| end + 1),
            big_endian: encoding == PlyEncoding::BigEndian,
        }
    };
    let mut surface = TriangleSurface::default();
    let mut largest: Option<(ParticleId, usize)> = None;
    let mut list = Vec::new();
    for element in &elements {
        // Nothing to read, whatever the count.
        if element.properties.is_empty() {
            continue;
        }
        for _ in 0..element.count {
            let mut position = DVec3::ZERO;
            for property in &element.properties {
                list.clear();
                let count = match property.count {
                    Some(kind) => body.natural(kind, "the length of a list")?,
                    None => 1,
                };
                let corners = element.name == b"face" && is_corners(property);
                for _ in 0..count {
                    if corners {
                        let corner = ParticleId(body.natural(property.value, "a corner")?);
                        let place = body.place();
                        if largest.is_none_or(|(largest, _)| corner > largest) {
                            largest = Some((corner, place));
                        }
                        list.push(corner);
                    } else {
                        let value = body.number(property.value, "a value")?;
                        if element.name == b"vertex"
                            && let Some(axis) = axis(property)
                        {
                            if !value.is_finite() {
                                let message =
                                    format!("the coordinate {value} is not finite, correct it");
                                return Err(body.error(body.place(), message));
                            }
                            position[axis] = value;
                        }
                    }
                }
                fan(&list, &mut surface.triangles);
            }
            if element.name == b"vertex" {
                surface.positions.push(position);
            }
        }
    }
    let particles = surface.positions.len();
    match largest {
        Some((corner, place)) if corner.index() >= particles => {
            let message =
                format!("a face has the point {corner} but there are {particles}, from 0");
            Err(body.error(place, message))
        }
        _ if surface.triangles.is_empty() => Err(text.error(1, "the file has no faces")),
        _ => Ok(surface),
    }
}

/// The axis that a property is the coordinate of.
fn axis(property: &Property<'_>) -> Option<usize> {
    let axis = [b"x", b"y", b"z"]
        .iter()
        .position(|axis| property.name == *axis)?;
    property.count.is_none().then_some(axis)
}

fn is_corners(property: &Property<'_>) -> bool {
    property.count.is_some() && [&b"vertex_indices"[..], b"vertex_index"].contains(&property.name)
}

/// Reads the header: encoding, elements, and how many lines it has.
fn header<'t>(text: &'t Text<'_>) -> Result<(PlyEncoding, Vec<Element<'t>>, usize), MeshError> {
    let mut encoding = None;
    let mut elements: Vec<Element<'t>> = Vec::new();
    for (line, content) in text.lines(1) {
        let words: Vec<&[u8]> = words_of(content).take(6).collect();
        let bad = |message: &str| {
            let message = format!("{message}, not {:?}", show(content));
            text.error(line, message)
        };
        let kind = |word| kind(word).ok_or_else(|| bad("a type expected"));
        match words[..] {
            [b"ply"] if line == 1 => {}
            _ if line == 1 => return Err(bad("the file does not start with ply")),
            [] | [b"comment" | b"obj_info", ..] => {}
            [b"format", name, b"1.0"] => {
                encoding = Some(match name {
                    b"ascii" => PlyEncoding::Ascii,
                    b"binary_little_endian" => PlyEncoding::LittleEndian,
                    b"binary_big_endian" => PlyEncoding::BigEndian,
                    _ => {
                        return Err(bad(
                            "ascii, binary_little_endian or binary_big_endian expected",
                        ));
                    }
                });
            }
            [b"element", name, count] => {
                let word = Word {
                    text: count,
                    line,
                    first: false,
                };
                if elements.iter().any(|element| element.name == name) {
                    return Err(bad("another element expected"));
                }
                elements.push(Element {
                    name,
                    line,
                    count: text.count(word, "the number of elements")?,
                    properties: Vec::new(),
                });
            }
            [b"property", ref rest @ ..] => {
                let property = match *rest {
                    [b"list", count, value, name] => Property {
                        name,
                        count: Some(kind(count)?),
                        value: kind(value)?,
                    },
                    [value, name] => Property {
                        name,
                        count: None,
                        value: kind(value)?,
                    },
                    _ => {
                        return Err(bad(
                            "property TYPE NAME or property list TYPE TYPE NAME expected",
                        ));
                    }
                };
                let element = elements
                    .last_mut()
                    .ok_or_else(|| bad("an element expected"))?;
                if element.properties.iter().any(|p| p.name == property.name) {
                    return Err(bad("another property expected"));
                }
                element.properties.push(property);
            }
            [b"end_header"] => {
                let encoding = encoding.ok_or_else(|| bad("a format expected before the end"))?;
                for (name, what, least) in [
                    (&b"vertex"[..], "x, y and z", 3),
                    (b"face", "a list vertex_indices", 1),
                ] {
                    let element = elements.iter().find(|element| element.name == name);
                    let found = element.map_or(0, |e| {
                        let wanted = |p: &&Property<'_>| {
                            if least == 3 {
                                axis(p).is_some()
                            } else {
                                is_corners(p)
                            }
                        };
                        e.properties.iter().filter(wanted).count()
                    });
                    if found < least {
                        let message = format!("there is no element {} with {what}", show(name));
                        return Err(text.error(element.map_or(line, |e| e.line), message));
                    }
                }
                return Ok((encoding, elements, line));
            }
            _ => return Err(bad("a line of a header expected")),
        }
    }
    Err(text.ends_early("end_header"))
}

fn kind(word: &[u8]) -> Option<Type> {
    Some(match word {
        b"char" | b"int8" => Type::I8,
        b"uchar" | b"uint8" => Type::U8,
        b"short" | b"int16" => Type::I16,
        b"ushort" | b"uint16" => Type::U16,
        b"int" | b"int32" => Type::I32,
        b"uint" | b"uint32" => Type::U32,
        b"float" | b"float32" => Type::F32,
        b"double" | b"float64" => Type::F64,
        _ => return None,
    })
}

/// What follows the header.
enum Body<'b, 't, I> {
    Ascii {
        text: &'b Text<'b>,
        words: I,
        /// The line of the last value.
        line: usize,
    },
    Binary {
        path: &'t Path,
        bytes: &'t [u8],
        /// Where the last value started, and where the next one does.
        last: usize,
        at: usize,
        big_endian: bool,
    },
}

impl<'b, I: Iterator<Item = Word<'b>>> Body<'b, '_, I> {
    /// The next value; of text, whatever number is there.
    fn number(&mut self, kind: Type, what: &str) -> Result<f64, MeshError> {
        match self {
            Body::Ascii { text, words, line } => {
                let word = words.next().ok_or_else(|| text.ends_early(what))?;
                *line = word.line;
                let number = str::from_utf8(word.text).ok().and_then(|w| w.parse().ok());
                number.ok_or_else(|| {
                    let message = format!("{:?} is not {what}: a number expected", show(word.text));
                    text.error(word.line, message)
                })
            }
            Body::Binary { .. } => Ok(match kind {
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

    /// The next value as a whole number from 0 on.
    fn natural(&mut self, kind: Type, what: &str) -> Result<u32, MeshError> {
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
        Err(self.error(self.place(), message))
    }

    /// The next bytes, turned to little-endian order.
    fn take<const N: usize>(&mut self, what: &str) -> Result<[u8; N], MeshError> {
        if let Body::Binary {
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
        Err(self.error(self.place(), message))
    }

    /// The line or byte of the last value.
    fn place(&self) -> usize {
        match self {
            Body::Ascii { line, .. } => *line,
            Body::Binary { last, .. } => *last,
        }
    }

    fn error(&self, place: usize, message: String) -> MeshError {
        match self {
            Body::Ascii { text, .. } => text.error(place, message),
            Body::Binary { path, .. } => MeshError::ParseBytes {
                path: path.to_path_buf(),
                byte: place,
                message,
            },
        }
    }
}
