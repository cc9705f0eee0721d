//! Stereolithography `.stl`: triangles, each with its own three corners, as text or binary.
//!
//! Bit-identical corners become one point, in the order of their first use. Normals and attributes are skipped, and the
//! triangles of several solids are combined. Many binary files start with the first word of text files, `solid`; a file
//! whose size matches its count is therefore read as binary. Binary coordinates are `f32`.
//!
//! Source: M. Burns, "Automated Fabrication" (1993), section 6.5. Linear in expectation, for the merging.

use std::collections::HashMap;
use std::io::{self, Write};
use std::path::Path;

use glam::{DVec3, Vec3};
use incise_mesh::{ParticleId, TriangleSurface};

use crate::text::{Text, Word, show};
use crate::{MeshIoError, write_atomically};

/// The bytes before the first triangle, and of each.
const HEADER: usize = 84;
const TRIANGLE: usize = 50;

/// Writes the text form.
pub(super) fn write(out: &mut dyn Write, surface: &TriangleSurface) -> io::Result<()> {
    writeln!(out, "solid surface")?;
    for triangle in &surface.triangles {
        let corners = triangle.map(|p| surface.positions[p.index()]);
        let n = normal(corners);
        writeln!(
            out,
            "facet normal {:?} {:?} {:?}\nouter loop",
            n.x, n.y, n.z
        )?;
        for p in corners {
            writeln!(out, "vertex {:?} {:?} {:?}", p.x, p.y, p.z)?;
        }
        writeln!(out, "endloop\nendfacet")?;
    }
    writeln!(out, "endsolid surface")
}

/// Writes the binary form of `.stl`: a fifth of the size of text, but coordinates are rounded to `f32`.
///
/// Points that are rounded to equal coordinates become one when read. [`write_surface`](crate::write_surface) keeps
/// every bit.
///
/// # Errors
/// [`MeshIoError::Io`] if the file cannot be written, or a coordinate is too large for an `f32`, or there are 2³²
/// triangles.
///
/// # Panics
/// If a corner has no position.
pub fn write_stl_binary(
    path: impl AsRef<Path>,
    surface: &TriangleSurface,
) -> Result<(), MeshIoError> {
    write_atomically(path, |out| write_binary(out, surface))
}

pub(super) fn write_binary(out: &mut dyn Write, surface: &TriangleSurface) -> io::Result<()> {
    let count = u32::try_from(surface.triangles.len()).map_err(io::Error::other)?;
    // The header must not start with "solid".
    out.write_all(&[b' '; 80])?;
    out.write_all(&count.to_le_bytes())?;
    for triangle in &surface.triangles {
        let corners = triangle.map(|p| surface.positions[p.index()]);
        for vector in [normal(corners), corners[0], corners[1], corners[2]] {
            let rounded: Vec3 = vector.as_vec3();
            if !rounded.is_finite() {
                let message = format!("the point {vector} is too far away for 32 bits");
                return Err(io::Error::other(message));
            }
            for coordinate in rounded.to_array() {
                out.write_all(&coordinate.to_le_bytes())?;
            }
        }
        out.write_all(&[0; 2])?;
    }
    Ok(())
}

/// The outward unit vector, or zero for a triangle that has none.
fn normal([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a).normalize_or_zero()
}

pub(crate) fn parse_stl(bytes: &[u8], path: &Path) -> Result<TriangleSurface, MeshIoError> {
    let count = bytes.get(80..).and_then(<[u8]>::first_chunk);
    let count = count.map(|&count| u32::from_le_bytes(count) as usize);
    let size = count.and_then(|count| count.checked_mul(TRIANGLE)?.checked_add(HEADER));
    let text = bytes.trim_ascii_start().starts_with(b"solid");
    if text && size != Some(bytes.len()) {
        return parse_text(&Text::new(path, bytes));
    }
    let error = |byte, message| MeshIoError::ParseBytes {
        path: path.to_owned(),
        byte,
        message,
    };
    // Some writers add padding at the end.
    if size.is_none_or(|size| size > bytes.len()) {
        let message = format!(
            "the file ends early: {} triangles announced, and text would start with solid",
            count.unwrap_or(0)
        );
        return Err(error(bytes.len(), message));
    }
    if count == Some(0) {
        return Err(error(80, "the file has no triangles".to_owned()));
    }
    let mut merger = Merger::default();
    let triangles = bytes[HEADER..].chunks_exact(TRIANGLE);
    for (i, triangle) in triangles.take(count.unwrap_or(0)).enumerate() {
        let mut corners = [DVec3::ZERO; 3];
        let (numbers, _) = triangle[12..].as_chunks::<4>();
        for (offset, &number) in numbers.iter().enumerate().take(9) {
            let number = f64::from(f32::from_le_bytes(number));
            if !number.is_finite() {
                let byte = HEADER + i * TRIANGLE + 12 + 4 * offset;
                let message = format!("the coordinate {number} is not finite, correct it");
                return Err(error(byte, message));
            }
            corners[offset / 3][offset % 3] = number;
        }
        merger.add(corners);
    }
    Ok(merger.surface)
}

fn parse_text(text: &Text<'_>) -> Result<TriangleSurface, MeshIoError> {
    let mut words = text.words(1).peekable();
    let mut merger = Merger::default();
    let mut inside = false;
    let mut last_line = 1;
    while let Some(word) = words.next() {
        last_line = word.line;
        let solid = is(word, "solid");
        if solid != inside && (solid || is(word, "endsolid")) {
            inside = solid;
            // The rest of the line is a name.
            while words.next_if(|word| !word.first).is_some() {}
            continue;
        }
        if !inside || !is(word, "facet") {
            let expected = if inside { "facet or endsolid" } else { "solid" };
            return Err(unexpected(text, word, expected));
        }
        expect(text, &mut words, "normal")?;
        for _ in 0..3 {
            // Normals are not used, and some writers put NaN where a triangle has none.
            next(text, &mut words, "a normal")?;
        }
        expect(text, &mut words, "outer")?;
        expect(text, &mut words, "loop")?;
        let mut corners = [DVec3::ZERO; 3];
        for corner in &mut corners {
            expect(text, &mut words, "vertex")?;
            for axis in 0..3 {
                let word = next(text, &mut words, "a coordinate")?;
                corner[axis] = text.coordinate(word)?;
            }
        }
        expect(text, &mut words, "endloop")?;
        expect(text, &mut words, "endfacet")?;
        merger.add(corners);
    }
    if inside {
        return Err(text.ends_early("endsolid"));
    }
    if merger.surface.triangles.is_empty() {
        return Err(text.error(last_line, "the file has no triangles"));
    }
    Ok(merger.surface)
}

fn next<'t>(
    text: &Text<'_>,
    words: &mut impl Iterator<Item = Word<'t>>,
    what: &str,
) -> Result<Word<'t>, MeshIoError> {
    words.next().ok_or_else(|| text.ends_early(what))
}

fn expect<'t>(
    text: &Text<'_>,
    words: &mut impl Iterator<Item = Word<'t>>,
    keyword: &str,
) -> Result<(), MeshIoError> {
    let word = next(text, words, keyword)?;
    if is(word, keyword) {
        Ok(())
    } else {
        Err(unexpected(text, word, keyword))
    }
}

fn unexpected(text: &Text<'_>, word: Word<'_>, expected: &str) -> MeshIoError {
    let message = format!("{expected} expected, not {:?}", show(word.text));
    text.error(word.line, message)
}

fn is(word: Word<'_>, keyword: &str) -> bool {
    word.text.eq_ignore_ascii_case(keyword.as_bytes())
}

/// Merges equal corners to one point.
#[derive(Default)]
struct Merger {
    surface: TriangleSurface,
    points: HashMap<[u64; 3], ParticleId>,
}

impl Merger {
    fn add(&mut self, corners: [DVec3; 3]) {
        let positions = &mut self.surface.positions;
        self.surface.triangles.push(corners.map(|corner| {
            *self
                .points
                .entry(corner.to_array().map(f64::to_bits))
                .or_insert_with(|| {
                    positions.push(corner);
                    ParticleId::new(positions.len() - 1)
                })
        }));
    }
}
