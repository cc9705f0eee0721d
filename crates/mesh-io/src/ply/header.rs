//! The header: lines of words that declare elements and their properties. Linear.

use super::PlyEncoding;
use crate::MeshIoError;
use crate::text::{Text, Word, show, words_of};

#[derive(Clone, Copy)]
pub(super) enum Type {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Type {
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

pub(super) struct Property<'t> {
    pub(super) name: &'t [u8],
    /// For a list, the type of the number of its values.
    pub(super) count: Option<Type>,
    pub(super) value: Type,
}

pub(super) struct Element<'t> {
    pub(super) name: &'t [u8],
    line: usize,
    pub(super) count: usize,
    pub(super) properties: Vec<Property<'t>>,
}

/// The axis of a property that is a coordinate.
pub(super) fn axis(property: &Property<'_>) -> Option<usize> {
    let axis = [b"x", b"y", b"z"]
        .iter()
        .position(|axis| property.name == *axis)?;
    property.count.is_none().then_some(axis)
}

pub(super) fn is_corners(property: &Property<'_>) -> bool {
    property.count.is_some() && [&b"vertex_indices"[..], b"vertex_index"].contains(&property.name)
}

/// Reads the header; returns encoding, elements, and the number of its lines.
pub(super) fn header<'t>(
    text: &'t Text<'_>,
) -> Result<(PlyEncoding, Vec<Element<'t>>, usize), MeshIoError> {
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
                if [&b"vertex"[..], b"face"].contains(&name)
                    && elements.iter().any(|element| element.name == name)
                {
                    return Err(bad("another element expected"));
                }
                elements.push(Element {
                    name,
                    line,
                    count: text.count(Word::new(count, line), "the number of elements")?,
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
                element.properties.push(property);
            }
            [b"end_header"] => {
                let encoding = encoding.ok_or_else(|| bad("a format expected before the end"))?;
                let once = |name: &[u8], wanted: &dyn Fn(&Property<'_>) -> bool| {
                    let element = elements.iter().find(|element| element.name == name);
                    let found = element.map(|e| e.properties.iter().filter(|p| wanted(p)).count());
                    if found == Some(1) {
                        return Ok(());
                    }
                    let message = format!(
                        "an element {} with {} expected, once each",
                        show(name),
                        if name == b"face" {
                            "a list vertex_indices"
                        } else {
                            "x, y and z"
                        }
                    );
                    Err(text.error(element.map_or(line, |element| element.line), message))
                };
                for wanted in 0..3 {
                    once(b"vertex", &|property| axis(property) == Some(wanted))?;
                }
                once(b"face", &is_corners)?;
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
