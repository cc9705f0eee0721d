//! Wavefront `.obj`: `v` lines with positions and `f` lines with polygons.
//!
//! Corners count from 1, or backwards from the last point if negative; the part after a slash (texture, normal) is
//! skipped, and so are all other statements. A backslash continues a line. Source: "Object Files (.obj)", Advanced
//! Visualizer manual, appendix B1 (Wavefront). Linear.

use std::io::{self, Write};
use std::path::Path;

use incise_mesh::{ParticleId, TriangleSurface};

use crate::MeshIoError;
use crate::polygon::fan;
use crate::text::{Text, Word, show, without_comment, words_of};

pub(super) fn write(out: &mut dyn Write, surface: &TriangleSurface) -> io::Result<()> {
    for p in &surface.positions {
        writeln!(out, "v {:?} {:?} {:?}", p.x, p.y, p.z)?;
    }
    for triangle in &surface.triangles {
        let [a, b, c] = triangle.map(|p| u64::from(p.0) + 1);
        writeln!(out, "f {a} {b} {c}")?;
    }
    Ok(())
}

/// The statement of the present line; a line without words has none.
#[derive(Clone, Copy, PartialEq)]
enum Statement {
    None,
    Point,
    Face,
    Other,
}

pub(crate) fn parse_obj(bytes: &[u8], path: &Path) -> Result<TriangleSurface, MeshIoError> {
    let text = Text::new(path, bytes);
    let mut surface = TriangleSurface::default();
    // The largest corner and its line: points may come after the polygons.
    let mut largest: Option<(ParticleId, usize)> = None;
    let mut statement = Statement::None;
    let mut coordinates = [0.0; 3];
    // The number of words of the statement after the keyword.
    let mut length = 0;
    let mut polygon = Vec::new();
    let mut last_line = 1;
    for (line, content) in text.lines(1) {
        last_line = line;
        let content = without_comment(content);
        let content = content.trim_ascii_end();
        let continued = content.strip_suffix(b"\\");
        for word in words_of(continued.unwrap_or(content)).map(|text| Word::new(text, line)) {
            match statement {
                Statement::None => {
                    statement = match word.text {
                        b"v" => Statement::Point,
                        b"f" => Statement::Face,
                        _ => Statement::Other,
                    };
                    continue;
                }
                // A weight or a color may follow.
                Statement::Point if length < 3 => coordinates[length] = text.coordinate(word)?,
                Statement::Face => {
                    let corner = corner(word, surface.positions.len()).ok_or_else(|| {
                        let message = format!(
                            "{:?} is no corner: a number of a point expected, there are {} so far, from 1",
                            show(word.text),
                            surface.positions.len()
                        );
                        text.error(word.line, message)
                    })?;
                    if largest.is_none_or(|(largest, _)| corner > largest) {
                        largest = Some((corner, word.line));
                    }
                    polygon.push(corner);
                }
                Statement::Point | Statement::Other => {}
            }
            length += 1;
        }
        if continued.is_some() {
            continue;
        }
        match statement {
            Statement::Point if length < 3 => {
                return Err(text.error(line, "a point has less than 3 coordinates"));
            }
            Statement::Point => surface.positions.push(coordinates.into()),
            Statement::Face if length < 3 => {
                return Err(text.error(line, "a face has less than 3 corners"));
            }
            Statement::Face => fan(&polygon, &mut surface.triangles),
            Statement::None | Statement::Other => {}
        }
        statement = Statement::None;
        length = 0;
        polygon.clear();
    }
    if statement != Statement::None {
        return Err(text.ends_early("the rest of a continued line"));
    }
    match largest {
        Some((corner, line)) if corner.index() >= surface.positions.len() => {
            let message = format!(
                "a face has the point {} but there are {}, counted from 1",
                corner.index() + 1,
                surface.positions.len()
            );
            Err(text.error(line, message))
        }
        Some(_) => Ok(surface),
        None => Err(text.error(last_line, "the file has no faces")),
    }
}

/// The particle of a word like `3`, `3/1`, `3//2` or `-1/2/3` after this many points.
fn corner(word: Word<'_>, points: usize) -> Option<ParticleId> {
    let number = word.text.split(|&b| b == b'/').next()?;
    let number: i64 = str::from_utf8(number).ok()?.parse().ok()?;
    let index = if number < 0 {
        i64::try_from(points).ok()?.checked_add(number)?
    } else {
        number - 1
    };
    u32::try_from(index).ok().map(ParticleId)
}
