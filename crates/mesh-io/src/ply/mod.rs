//! Stanford's `.ply`: a text that declares elements and their properties, then the elements as text or binary.
//!
//! The elements `vertex` with `x`, `y`, `z` and `face` with a list `vertex_indices` or `vertex_index` are read, all
//! others skipped. All types have at most 32 bits or are `f64`, so reading a value as `f64` is exact. Text keeps the
//! digits of doubles even where `float` is declared. Source: G. Turk, "The PLY Polygon File Format" (1994). Linear.

mod header;
mod payload;

use std::io::{self, Write};
use std::path::Path;

use glam::DVec3;
use incise_mesh::{ParticleId, TriangleSurface};

use crate::polygon::fan;
use crate::text::Text;
use crate::{MeshIoError, write_atomically};
use header::{axis, header, is_corners};
use payload::Payload;

/// The encoding of the elements of a `.ply` file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlyEncoding {
    /// Text with enough digits to keep every bit.
    Ascii,
    /// Little-endian binary.
    LittleEndian,
    /// Big-endian binary.
    BigEndian,
}

/// Writes a `.ply` file in the given encoding; all keep every bit of the coordinates.
///
/// # Errors
/// [`MeshIoError::Io`] if the file cannot be written.
pub fn write_ply(
    path: impl AsRef<Path>,
    surface: &TriangleSurface,
    encoding: PlyEncoding,
) -> Result<(), MeshIoError> {
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

pub(crate) fn parse_ply(bytes: &[u8], path: &Path) -> Result<TriangleSurface, MeshIoError> {
    let text = Text::new(path, bytes);
    let (encoding, elements, header_lines) = header(&text)?;
    let mut payload = if encoding == PlyEncoding::Ascii {
        Payload::Ascii {
            text: &text,
            words: text.words(header_lines + 1),
            line: header_lines,
        }
    } else {
        let mut line_ends = (0..bytes.len()).filter(|&i| bytes[i] == b'\n');
        Payload::Binary {
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
        // Elements without properties have no data.
        if element.properties.is_empty() {
            continue;
        }
        if element.name == b"vertex" {
            let room = payload.room_for(element);
            surface.positions.reserve_exact(room);
        }
        if element.name == b"face"
            && let Some(property) = element.properties.iter().find(|p| is_corners(p))
        {
            // Polygons may need 12 bytes for each byte of the file. A growing list has two copies for a while, which
            // would exceed the limit.
            if encoding != PlyEncoding::Ascii && property.value.bytes() < 4 {
                let room = payload.most_values(property.value);
                surface.triangles.reserve_exact(room);
            }
        }
        for _ in 0..element.count {
            let mut position = DVec3::ZERO;
            for property in &element.properties {
                list.clear();
                let count = match property.count {
                    Some(kind) => payload.natural(kind, "the length of a list")?,
                    None => 1,
                };
                let corners = element.name == b"face" && is_corners(property);
                if corners {
                    let most = payload.most_values(property.value);
                    list.reserve(most.min(count as usize));
                }
                for _ in 0..count {
                    if corners {
                        let corner = ParticleId(payload.natural(property.value, "a corner")?);
                        let offset = payload.offset();
                        if largest.is_none_or(|(largest, _)| corner > largest) {
                            largest = Some((corner, offset));
                        }
                        list.push(corner);
                    } else {
                        let value = payload.number(property.value, "a value")?;
                        if element.name == b"vertex"
                            && let Some(axis) = axis(property)
                        {
                            if !value.is_finite() {
                                let message =
                                    format!("the coordinate {value} is not finite, correct it");
                                return Err(payload.error(payload.offset(), message));
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
        Some((corner, offset)) if corner.index() >= particles => {
            let message =
                format!("a face has the point {corner} but there are {particles}, from 0");
            Err(payload.error(offset, message))
        }
        _ if surface.triangles.is_empty() => Err(text.error(1, "the file has no faces")),
        _ => Ok(surface),
    }
}
