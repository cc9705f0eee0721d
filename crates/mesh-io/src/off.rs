//! Geomview's `.off`: a keyword, the numbers of points and polygons, a line for each.
//!
//! Points may have normals, colors and texture coordinates after the position (`STCNOFF`), polygons colors after the
//! corners; these are skipped. Comments start with `#`. Corners count from 0. Points in 4 or n dimensions and the
//! binary form are errors. Source: Geomview manual, "OFF Files". Linear.

use std::io::{self, Write};
use std::path::Path;

use glam::DVec3;
use incise_mesh::{ParticleId, TriangleSurface};

use crate::MeshIoError;
use crate::polygon::fan;
use crate::text::{Text, Word, show, without_comment, words_of};

pub(super) fn write(out: &mut dyn Write, surface: &TriangleSurface) -> io::Result<()> {
    let (points, triangles) = (surface.positions.len(), surface.triangles.len());
    writeln!(out, "OFF\n{points} {triangles} 0")?;
    for p in &surface.positions {
        writeln!(out, "{:?} {:?} {:?}", p.x, p.y, p.z)?;
    }
    for [a, b, c] in &surface.triangles {
        writeln!(out, "3 {a} {b} {c}")?;
    }
    Ok(())
}

pub(crate) fn parse_off(bytes: &[u8], path: &Path) -> Result<TriangleSurface, MeshIoError> {
    let text = Text::new(path, bytes);
    let mut rows = text.lines(1).filter_map(|(line, content)| {
        let content = without_comment(content).trim_ascii();
        (!content.is_empty()).then_some(Row {
            text: &text,
            content,
            line,
        })
    });
    let mut next = |what: &str| rows.next().ok_or_else(|| text.ends_early(what));

    let mut header = next("OFF")?;
    // The keyword is optional, and the counts may be on its line.
    if header.content[0].is_ascii_alphabetic() {
        let keyword = header.word("OFF")?;
        let known = ["", "C", "N", "CN", "ST", "STC", "STN", "STCN"];
        let prefix = keyword.text.strip_suffix(b"OFF");
        if !prefix.is_some_and(|prefix| known.iter().any(|k| k.as_bytes() == prefix)) {
            let message = format!(
                "{:?} is no keyword of a surface in space: OFF expected, with ST, C or N before it",
                show(keyword.text)
            );
            return Err(text.error(header.line, message));
        }
        if header.content.is_empty() {
            header = next("the number of points")?;
        }
    }
    let points = header.count("the number of points")?;
    let polygons = header.count("the number of polygons")?;

    let mut surface = TriangleSurface::default();
    surface.positions.reserve_exact(text.room_for(points, 6));
    for _ in 0..points {
        let mut row = next("a point")?;
        let mut position = DVec3::ZERO;
        for axis in 0..3 {
            let word = row.word("a coordinate")?;
            position[axis] = text.coordinate(word)?;
        }
        surface.positions.push(position);
    }
    surface.triangles.reserve_exact(text.room_for(polygons, 8));
    let mut polygon = Vec::new();
    for _ in 0..polygons {
        let mut row = next("a polygon")?;
        let corners = row.count("the number of corners")?;
        polygon.clear();
        for _ in 0..corners {
            let corner = row.count("a corner")?;
            if corner >= points {
                let message =
                    format!("a polygon has the point {corner} but there are {points}, from 0");
                return Err(text.error(row.line, message));
            }
            polygon.push(ParticleId::new(corner));
        }
        fan(&polygon, &mut surface.triangles);
    }
    if surface.triangles.is_empty() {
        return Err(text.error(header.line, "the file has no polygons"));
    }
    Ok(surface)
}

/// The rest of a line with content.
struct Row<'t, 'a> {
    text: &'t Text<'a>,
    content: &'t [u8],
    line: usize,
}

impl<'t> Row<'t, '_> {
    fn word(&mut self, what: &str) -> Result<Word<'t>, MeshIoError> {
        let Some(word) = words_of(self.content).next() else {
            let message = format!("the line ends before {what}");
            return Err(self.text.error(self.line, message));
        };
        self.content = self.content.trim_ascii_start()[word.len()..].trim_ascii_start();
        Ok(Word::new(word, self.line))
    }

    fn count(&mut self, what: &str) -> Result<usize, MeshIoError> {
        let word = self.word(what)?;
        self.text.count(word, what)
    }
}
