//! Wavefront `.obj`: `v` lines with positions, `vt` lines with texture coordinates and `f` lines with polygons.
//!
//! Corners count from 1, or backwards from the last point if negative; a number of texture coordinates may follow after a
//! slash, and that of a normal, which is skipped, and so are all other statements. Texture coordinates are kept if all
//! corners have some that exist. A backslash continues a line. Source: "Object Files (.obj)", Advanced
//! Visualizer manual, appendix B1 (Wavefront). Linear.

use std::io::{self, Write};
use std::path::Path;

use glam::DVec2;
use incise_mesh::ParticleId;

use crate::polygon::fan;
use crate::text::{Text, Word, show, without_comment, words_of};
use crate::{MeshIoError, SurfaceFile};

pub(super) fn write(out: &mut dyn Write, file: &SurfaceFile) -> io::Result<()> {
    let has_texture = file.texture_corners.len() == file.surface.triangles.len();
    for p in &file.surface.positions {
        writeln!(out, "v {:?} {:?} {:?}", p.x, p.y, p.z)?;
    }
    for pair in file.texture.iter().filter(|_| has_texture) {
        writeln!(out, "vt {:?} {:?}", pair.x, pair.y)?;
    }
    for (t, triangle) in file.surface.triangles.iter().enumerate() {
        let [a, b, c] = triangle.map(|p| u64::from(p.0) + 1);
        if has_texture {
            let [i, j, k] = file.texture_corners[t].map(|corner| u64::from(corner) + 1);
            writeln!(out, "f {a}/{i} {b}/{j} {c}/{k}")?;
        } else {
            writeln!(out, "f {a} {b} {c}")?;
        }
    }
    Ok(())
}

/// The statement of the present line; a line without words has none.
#[derive(Clone, Copy, PartialEq)]
enum Statement {
    None,
    Point,
    Texture,
    Face,
    Other,
}

pub(crate) fn parse_obj(bytes: &[u8], path: &Path) -> Result<SurfaceFile, MeshIoError> {
    let text = Text::new(path, bytes);
    let mut file = SurfaceFile::default();
    let surface = &mut file.surface;
    // The largest corner and its line: points may come after the polygons.
    let mut largest: Option<(ParticleId, usize)> = None;
    let mut largest_texture: Option<ParticleId> = None;
    let mut statement = Statement::None;
    let mut coordinates = [0.0; 3];
    // The number of words of the statement after the keyword.
    let mut length = 0;
    let mut polygon = Vec::new();
    let mut texture_polygon = Vec::new();
    let mut texture_triangles = Vec::new();
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
                        b"vt" => Statement::Texture,
                        b"f" => Statement::Face,
                        _ => Statement::Other,
                    };
                    continue;
                }
                // A weight or a color may follow.
                Statement::Point if length < 3 => coordinates[length] = text.coordinate(word)?,
                Statement::Texture if length < 2 => coordinates[length] = text.coordinate(word)?,
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
                    if let Some(corner) = texture_corner(word, file.texture.len()) {
                        largest_texture = largest_texture.max(Some(corner));
                        texture_polygon.push(corner);
                    }
                }
                Statement::Point | Statement::Texture | Statement::Other => {}
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
            Statement::Texture => {
                // Without a second coordinate the texture is a line.
                let v = if length < 2 { 0.0 } else { coordinates[1] };
                file.texture.push(DVec2::new(coordinates[0], v));
            }
            Statement::Face => {
                fan(&polygon, &mut surface.triangles);
                if texture_polygon.len() == polygon.len() {
                    fan(&texture_polygon, &mut texture_triangles);
                }
            }
            Statement::None | Statement::Other => {}
        }
        statement = Statement::None;
        length = 0;
        polygon.clear();
        texture_polygon.clear();
    }
    if statement != Statement::None {
        return Err(text.ends_early("the rest of a continued line"));
    }
    let Some((corner, line)) = largest else {
        return Err(text.error(last_line, "the file has no faces"));
    };
    if corner.index() >= surface.positions.len() {
        let message = format!(
            "a face has the point {} but there are {}, counted from 1",
            corner.index() + 1,
            surface.positions.len()
        );
        return Err(text.error(line, message));
    }
    let all_have_texture = texture_triangles.len() == surface.triangles.len();
    if all_have_texture && largest_texture.is_some_and(|t| t.index() < file.texture.len()) {
        file.texture_corners = texture_triangles
            .into_iter()
            .map(|triangle: [ParticleId; 3]| triangle.map(|corner| corner.0))
            .collect();
    } else {
        file.texture = Vec::new();
    }
    Ok(file)
}

/// The particle of a word like `3`, `3/1`, `3//2` or `-1/2/3` after this many points.
fn corner(word: Word<'_>, points: usize) -> Option<ParticleId> {
    numbered(word.text.split(|&b| b == b'/').next()?, points)
}

/// The texture coordinates of a word like `3/1` or `-1/2/3` after this many of them; `None` if it has none.
fn texture_corner(word: Word<'_>, count: usize) -> Option<ParticleId> {
    numbered(word.text.split(|&b| b == b'/').nth(1)?, count)
}

/// An element by its number from 1, or backwards from the last of `count` if negative.
fn numbered(text: &[u8], count: usize) -> Option<ParticleId> {
    let number: i64 = str::from_utf8(text).ok()?.parse().ok()?;
    let index = if number < 0 {
        i64::try_from(count).ok()?.checked_add(number)?
    } else {
        number - 1
    };
    u32::try_from(index).ok().map(ParticleId)
}
