//! TetGen's pair of files: `.node` with the points and `.ele` with the tets.
//!
//! One item per line after a line with counts; `#` starts a comment; points are numbered from 0 or 1, which the first
//! one tells. Attributes, boundary markers and the mid-edge points of 10-point tets are skipped. TetGen's own tets are
//! mirror images of ours, other programs write either kind, so that negative tets are turned on reading. Linear.
//!
//! Source: H. Si, "TetGen User's Manual", file formats.

use std::path::Path;

use glam::DVec3;

use super::text::{Text, Word, words_of};
use super::write_atomically;
use crate::{MeshError, ParticleId, TetMesh};

/// Writes `.node` and `.ele` files with the stem of `path`, numbered from 0, with coordinates that keep every bit.
///
/// # Errors
/// [`MeshError::Io`] if a file cannot be written.
pub fn write_tetgen(path: impl AsRef<Path>, mesh: &TetMesh) -> Result<(), MeshError> {
    let path = path.as_ref();
    write_atomically(path.with_extension("node"), |file| {
        writeln!(file, "{} 3 0 0", mesh.positions.len())?;
        for (i, p) in mesh.positions.iter().enumerate() {
            writeln!(file, "{i} {:?} {:?} {:?}", p.x, p.y, p.z)?;
        }
        Ok(())
    })?;
    write_atomically(path.with_extension("ele"), |file| {
        writeln!(file, "{} 4 0", mesh.tets.len())?;
        for (i, [a, b, c, d]) in mesh.tets.iter().enumerate() {
            writeln!(file, "{i} {a} {b} {c} {d}")?;
        }
        Ok(())
    })
}

/// Reads the `.node` and `.ele` files with the stem of `path`; see [`read`](super::read). Tets are oriented positively.
///
/// # Errors
/// As for [`read`](super::read).
pub fn read_tetgen(path: impl AsRef<Path>) -> Result<TetMesh, MeshError> {
    let path = path.as_ref();
    let node_path = path.with_extension("node");
    let (positions, base) = read_nodes(&Text::read(&node_path)?)?;
    let ele_path = path.with_extension("ele");
    let tets = read_tets(&Text::read(&ele_path)?, base, positions.len())?;
    if tets.is_empty() {
        return Err(MeshError::Empty);
    }
    let mut mesh = TetMesh { positions, tets };
    mesh.orient_positively();
    Ok(mesh)
}

fn read_nodes(text: &Text<'_>) -> Result<(Vec<DVec3>, usize), MeshError> {
    let mut rows = rows(text);
    let mut header = rows
        .next()
        .ok_or_else(|| text.ends_early("the number of points"))?;
    let count = header.count("the number of points")?;
    let dimension = header.count("the dimension")?;
    if dimension != 3 {
        return Err(text.error(
            header.line,
            format!("the points have {dimension} coordinates instead of 3"),
        ));
    }
    let mut positions = Vec::with_capacity(text.room_for(count, 8));
    let mut base = 0;
    for i in 0..count {
        let mut row = rows.next().ok_or_else(|| {
            text.ends_early(&format!("{count} points announced but {i} found, more"))
        })?;
        let number = row.count("the number of a point")?;
        if i == 0 && number == 1 {
            base = 1;
        }
        if number != base + i {
            let message = format!(
                "point {} expected but {number} found, number them without gaps from 0 or 1",
                base + i
            );
            return Err(text.error(row.line, message));
        }
        positions.push(DVec3::new(
            row.coordinate()?,
            row.coordinate()?,
            row.coordinate()?,
        ));
    }
    Ok((positions, base))
}

fn read_tets(
    text: &Text<'_>,
    base: usize,
    particles: usize,
) -> Result<Vec<[ParticleId; 4]>, MeshError> {
    let mut rows = rows(text);
    let mut header = rows
        .next()
        .ok_or_else(|| text.ends_early("the number of tets"))?;
    let count = header.count("the number of tets")?;
    let corners = header.count("the number of points of a tet")?;
    if corners != 4 && corners != 10 {
        return Err(text.error(
            header.line,
            format!("the tets have {corners} points instead of 4 or 10"),
        ));
    }
    let mut tets = Vec::with_capacity(text.room_for(count, 10));
    for i in 0..count {
        let mut row = rows.next().ok_or_else(|| {
            text.ends_early(&format!("{count} tets announced but {i} found, more"))
        })?;
        row.count("the number of a tet")?;
        let mut tet = [ParticleId(0); 4];
        for corner in &mut tet {
            let number = row.count("a point of a tet")?;
            if number < base || number - base >= particles {
                let message = format!(
                    "point {number} does not exist, there are {particles} counted from {base}"
                );
                return Err(text.error(row.line, message));
            }
            *corner = ParticleId::new(number - base);
        }
        tets.push(tet);
    }
    Ok(tets)
}

/// A line with content.
struct Row<'t, 'a, I> {
    text: &'t Text<'a>,
    words: I,
    line: usize,
}

impl<'t, I: Iterator<Item = &'t [u8]>> Row<'t, '_, I> {
    fn word(&mut self, what: &str) -> Result<Word<'t>, MeshError> {
        let line = self.line;
        let text = self.words.next().ok_or_else(|| {
            self.text
                .error(line, format!("the line ends before {what}"))
        })?;
        Ok(Word { text, line })
    }

    fn count(&mut self, what: &str) -> Result<usize, MeshError> {
        let word = self.word(what)?;
        self.text.count(word, what)
    }

    fn coordinate(&mut self) -> Result<f64, MeshError> {
        let word = self.word("a coordinate")?;
        self.text.coordinate(word)
    }
}

fn rows<'t, 'a>(
    text: &'t Text<'a>,
) -> impl Iterator<Item = Row<'t, 'a, impl Iterator<Item = &'t [u8]>>> {
    text.lines(1).filter_map(move |(line, content)| {
        let content = content.split(|&b| b == b'#').next().unwrap_or_default();
        let mut words = words_of(content).peekable();
        words.peek()?;
        Some(Row { text, words, line })
    })
}
