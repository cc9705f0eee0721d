//! Legacy VTK files, ASCII, with an unstructured grid.
//!
//! Read are versions 1 to 5.1: the cells as lists with sizes, or (from 5.0 on) as offsets and connectivity. Keywords may
//! be in any case and sections in any order up to the point and cell data, which are skipped like everything unknown.
//! Of mixed cells the tets (type 10) are taken and the others left out, since meshing tools put boundary triangles into
//! the same list; a file without any tet is refused. Orientation is kept as it is. Linear.
//!
//! Source: "VTK File Formats for VTK Version 4.2" (Kitware) and the 5.1 format as the VTK library writes it.

use std::path::Path;

use glam::DVec3;

use super::text::{Text, Word, show, words_of};
use super::write_atomically;
use crate::{MeshError, ParticleId, TetMesh};

/// VTK's number for a tetrahedron.
const TETRA: usize = 10;

/// Writes a legacy VTK file, version 3.0, ASCII, with coordinates that keep every bit.
///
/// # Errors
/// [`MeshError::Io`] if the file cannot be written.
pub fn write_vtk(path: impl AsRef<Path>, mesh: &TetMesh) -> Result<(), MeshError> {
    write_atomically(path, |file| {
        writeln!(
            file,
            "# vtk DataFile Version 3.0\ntetrahedral mesh\nASCII\nDATASET UNSTRUCTURED_GRID"
        )?;
        writeln!(file, "POINTS {} double", mesh.positions.len())?;
        for p in &mesh.positions {
            writeln!(file, "{:?} {:?} {:?}", p.x, p.y, p.z)?;
        }
        let tets = mesh.tets.len();
        writeln!(file, "CELLS {tets} {}", 5 * tets)?;
        for [a, b, c, d] in &mesh.tets {
            writeln!(file, "4 {a} {b} {c} {d}")?;
        }
        writeln!(file, "CELL_TYPES {tets}")?;
        for _ in 0..tets {
            writeln!(file, "{TETRA}")?;
        }
        Ok(())
    })
}

/// Reads the tets of a legacy VTK file; see [`read`](super::read).
///
/// # Errors
/// As for [`read`](super::read); binary files are not read yet.
pub fn read_vtk(path: impl AsRef<Path>) -> Result<TetMesh, MeshError> {
    let text = Text::read(path.as_ref())?;
    check_header(&text)?;
    let mut reader = Reader {
        text: &text,
        words: text.words(4).peekable(),
    };
    let mut positions = None;
    let mut cells = None;
    let mut types = None;

    let dataset = reader.next("DATASET UNSTRUCTURED_GRID")?;
    let kind = reader.next("UNSTRUCTURED_GRID")?;
    if !is(dataset, "DATASET") || !is(kind, "UNSTRUCTURED_GRID") {
        let found = format!("{} {}", show(dataset.text), show(kind.text));
        return Err(text.error(
            dataset.line,
            format!("DATASET UNSTRUCTURED_GRID expected but {found:?} found"),
        ));
    }
    // What is no keyword at the start of a line belongs to a section of no interest.
    while let Some(word) = reader.words.next() {
        if !word.first {
            continue;
        }
        if is(word, "POINTS") {
            positions = Some(reader.points()?);
        } else if is(word, "CELLS") {
            cells = Some(reader.cells()?);
        } else if is(word, "CELL_TYPES") {
            types = Some(reader.types()?);
        } else if is(word, "POINT_DATA") || is(word, "CELL_DATA") {
            break;
        }
    }
    let positions = positions.ok_or_else(|| text.ends_early("a section POINTS"))?;
    let cells = cells.ok_or_else(|| text.ends_early("a section CELLS"))?;
    let types = types.ok_or_else(|| text.ends_early("a section CELL_TYPES"))?;
    let tets = select_tets(&text, &cells, &types, positions.len())?;
    Ok(TetMesh { positions, tets })
}

fn check_header(text: &Text<'_>) -> Result<(), MeshError> {
    let mut lines = text.lines(1);
    let (_, magic) = lines
        .next()
        .ok_or_else(|| text.ends_early("# vtk DataFile Version"))?;
    if !magic
        .to_ascii_lowercase()
        .starts_with(b"# vtk datafile version")
    {
        return Err(text.error(
            1,
            "the file does not start with \"# vtk DataFile Version\": no legacy VTK file",
        ));
    }
    let (_, encoding) = lines
        .nth(1)
        .ok_or_else(|| text.ends_early("a title and the line ASCII"))?;
    match words_of(encoding).next().unwrap_or_default() {
        word if word.eq_ignore_ascii_case(b"ASCII") => Ok(()),
        word if word.eq_ignore_ascii_case(b"BINARY") => Err(text.error(
            3,
            "binary legacy VTK is not read yet, convert the file to ASCII",
        )),
        word => Err(text.error(3, format!("ASCII expected but {:?} found", show(word)))),
    }
}

/// Cells of any kind: ragged lists of points, and the line each starts on.
#[derive(Default)]
struct Cells {
    offsets: Vec<usize>,
    points: Vec<usize>,
    lines: Vec<usize>,
}

struct Reader<'t, 'a, I: Iterator<Item = Word<'t>>> {
    text: &'t Text<'a>,
    words: std::iter::Peekable<I>,
}

impl<'t, I: Iterator<Item = Word<'t>>> Reader<'t, '_, I> {
    fn next(&mut self, expected: &str) -> Result<Word<'t>, MeshError> {
        self.words
            .next()
            .ok_or_else(|| self.text.ends_early(expected))
    }

    fn count(&mut self, what: &str) -> Result<usize, MeshError> {
        let word = self.next(what)?;
        self.text.count(word, what)
    }

    fn points(&mut self) -> Result<Vec<DVec3>, MeshError> {
        let count = self.count("the number of points")?;
        let kind = self.next("the data type of the points")?;
        if !is(kind, "float") && !is(kind, "double") {
            let message = format!(
                "points of type {:?} are not read: float or double expected",
                show(kind.text)
            );
            return Err(self.text.error(kind.line, message));
        }
        let mut positions = Vec::with_capacity(self.text.room_for(count, 6));
        for i in 0..count {
            let mut position = DVec3::ZERO;
            for axis in 0..3 {
                let Some(word) = self.words.next() else {
                    return Err(self
                        .text
                        .ends_early(&format!("{count} points announced but {i} found, more")));
                };
                position[axis] = self.text.coordinate(word)?;
            }
            positions.push(position);
        }
        Ok(positions)
    }

    fn cells(&mut self) -> Result<Cells, MeshError> {
        let count = self.count("the number of cells")?;
        let size = self.count("the size of the cell list")?;
        if self.words.peek().is_some_and(|&word| is(word, "OFFSETS")) {
            return self.cells_with_offsets(count, size);
        }
        let mut cells = Cells {
            offsets: vec![0],
            ..Cells::default()
        };
        cells.offsets.reserve(self.text.room_for(count, 4));
        cells.points.reserve(self.text.room_for(size, 2));
        for i in 0..count {
            let Some(word) = self.words.next() else {
                return Err(self
                    .text
                    .ends_early(&format!("{count} cells announced but {i} found, more")));
            };
            let corners = self.text.count(word, "the number of points of a cell")?;
            for _ in 0..corners {
                cells.points.push(self.count("a point of a cell")?);
            }
            cells.offsets.push(cells.points.len());
            cells.lines.push(word.line);
            if count.saturating_add(cells.points.len()) > size {
                let message = format!(
                    "the cells need more than the {size} numbers announced, correct the section CELLS"
                );
                return Err(self.text.error(word.line, message));
            }
        }
        Ok(cells)
    }

    fn cells_with_offsets(&mut self, count: usize, size: usize) -> Result<Cells, MeshError> {
        let mut cells = Cells::default();
        let keyword = self.next("OFFSETS")?;
        self.next("the data type of the offsets")?;
        cells.offsets.reserve(self.text.room_for(count, 2));
        for _ in 0..count {
            let word = self.next("an offset")?;
            let offset = self.text.count(word, "an offset")?;
            if offset < cells.offsets.last().copied().unwrap_or(0) || offset > size {
                let message = format!(
                    "the offset {offset} is out of order or beyond {size}, correct the section OFFSETS"
                );
                return Err(self.text.error(word.line, message));
            }
            cells.offsets.push(offset);
        }
        if cells.offsets.first().is_some_and(|&first| first != 0)
            || cells.offsets.last().is_some_and(|&l| l != size)
        {
            return Err(self.text.error(
                keyword.line,
                format!("the offsets do not run from 0 to {size}, correct them"),
            ));
        }
        let word = self.next("CONNECTIVITY")?;
        if !is(word, "CONNECTIVITY") {
            return Err(self.text.error(
                word.line,
                format!("CONNECTIVITY expected but {:?} found", show(word.text)),
            ));
        }
        self.next("the data type of the connectivity")?;
        cells.points.reserve(self.text.room_for(size, 2));
        let mut lines = Vec::with_capacity(self.text.room_for(size, 2));
        for _ in 0..size {
            let word = self.next("a point of a cell")?;
            cells
                .points
                .push(self.text.count(word, "a point of a cell")?);
            lines.push(word.line);
        }
        for pair in cells.offsets.windows(2) {
            cells
                .lines
                .push(lines.get(pair[0]).copied().unwrap_or(word.line));
        }
        Ok(cells)
    }

    fn types(&mut self) -> Result<Vec<usize>, MeshError> {
        let count = self.count("the number of cell types")?;
        let mut types = Vec::with_capacity(self.text.room_for(count, 2));
        for i in 0..count {
            let Some(word) = self.words.next() else {
                return Err(self
                    .text
                    .ends_early(&format!("{count} cell types announced but {i} found, more")));
            };
            types.push(self.text.count(word, "a cell type")?);
        }
        Ok(types)
    }
}

fn select_tets(
    text: &Text<'_>,
    cells: &Cells,
    types: &[usize],
    particles: usize,
) -> Result<Vec<[ParticleId; 4]>, MeshError> {
    if types.len() != cells.lines.len() {
        let message = format!(
            "there are {} cells but {} cell types, give one for each",
            cells.lines.len(),
            types.len()
        );
        return Err(text.error(cells.lines.last().copied().unwrap_or(1), message));
    }
    if types.is_empty() {
        return Err(MeshError::Empty);
    }
    let mut tets = Vec::with_capacity(types.len());
    for (cell, _) in types.iter().enumerate().filter(|&(_, &kind)| kind == TETRA) {
        let line = cells.lines[cell];
        let points = &cells.points[cells.offsets[cell]..cells.offsets[cell + 1]];
        let &[a, b, c, d] = points else {
            return Err(text.error(
                line,
                format!(
                    "the tet {cell} has {} points instead of 4, correct it",
                    points.len()
                ),
            ));
        };
        if let Some(corner) = [a, b, c, d].into_iter().find(|&corner| corner >= particles) {
            let message = format!(
                "the cell {cell} uses point {corner} but there are {particles}, counted from 0"
            );
            return Err(text.error(line, message));
        }
        tets.push([a, b, c, d].map(ParticleId::new));
    }
    if tets.is_empty() {
        let message = format!(
            "none of the {} cells is a tetrahedron (cell type {TETRA}), mesh the volume",
            types.len()
        );
        return Err(text.error(cells.lines[0], message));
    }
    Ok(tets)
}

fn is(word: Word<'_>, keyword: &str) -> bool {
    word.text.eq_ignore_ascii_case(keyword.as_bytes())
}
