//! Reading legacy VTK files section by section.
//!
//! In a binary file every section must be known, since its length is needed to find the next one.
//! In an ASCII file, lines that do not start with a keyword are skipped. Linear.

use std::path::Path;

use incise_mesh::TetMesh;

use super::cursor::{Cursor, Wanted, Word};
use crate::text::{show, words_of};
use crate::vtk_grid::{Grid, positions};
use crate::vtk_kind::Kind;
use crate::{MeshFile, MeshIoError};

/// Parses only the mesh; point and cell data are skipped.
pub(crate) fn parse_vtk_mesh(bytes: &[u8], path: &Path) -> Result<TetMesh, MeshIoError> {
    Ok(parse(bytes, path, false)?.mesh)
}

/// Parses the mesh with its point and cell data.
pub(crate) fn parse_vtk(bytes: &[u8], path: &Path) -> Result<MeshFile, MeshIoError> {
    parse(bytes, path, true)
}

fn parse(bytes: &[u8], path: &Path, with_data: bool) -> Result<MeshFile, MeshIoError> {
    let mut cursor = Cursor {
        path,
        bytes,
        at: 0,
        binary: false,
    };
    header(&mut cursor)?;
    let mut reader = Reader {
        cursor,
        grid: Grid::default(),
        tets_at: CellSource::Cells(0),
        has: [false; 3],
        target: Target::None,
        of_particles: Announced::default(),
        of_cells: Announced::default(),
    };
    reader.sections(with_data)?;
    reader.finish()
}

fn header(cursor: &mut Cursor<'_>) -> Result<(), MeshIoError> {
    let magic = cursor
        .line()
        .ok_or_else(|| cursor.ends_early("# vtk DataFile Version"))?;
    if !magic
        .to_ascii_lowercase()
        .starts_with(b"# vtk datafile version")
    {
        return Err(cursor.error(
            0,
            "the file does not start with \"# vtk DataFile Version\": no legacy VTK file",
        ));
    }
    cursor.line();
    let start = cursor.at;
    let encoding = cursor
        .line()
        .ok_or_else(|| cursor.ends_early("a title and the line ASCII or BINARY"))?;
    match words_of(encoding).next().unwrap_or_default() {
        word if word.eq_ignore_ascii_case(b"ASCII") => {}
        word if word.eq_ignore_ascii_case(b"BINARY") => cursor.binary = true,
        word => {
            let message = format!("ASCII or BINARY expected but {:?} found", show(word));
            return Err(cursor.error(start, message));
        }
    }
    let dataset = cursor.expect("DATASET UNSTRUCTURED_GRID")?;
    let kind = cursor.expect("UNSTRUCTURED_GRID")?;
    if !dataset.is("DATASET") || !kind.is("UNSTRUCTURED_GRID") {
        let found = format!("{} {}", show(dataset.text), show(kind.text));
        return Err(cursor.error(
            dataset.at,
            format!("DATASET UNSTRUCTURED_GRID expected but {found:?} found"),
        ));
    }
    Ok(())
}

/// The owner of the next arrays.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Target {
    None,
    Particles,
    Cells,
}

/// The number of elements in `POINT_DATA` or `CELL_DATA`, and its position.
#[derive(Clone, Copy, Default)]
pub(super) struct Announced {
    pub(super) count: usize,
    at: Option<usize>,
}

/// The position of the cells in the file.
enum CellSource {
    /// The start of a list with the number of points before each cell.
    Cells(usize),
    /// The start of the list of all points of cells, and the type of its numbers.
    Connectivity(usize, Kind),
}

pub(super) struct Reader<'b> {
    pub(super) cursor: Cursor<'b>,
    pub(super) grid: Grid,
    tets_at: CellSource,
    /// True for points, cells and cell types that have been read.
    has: [bool; 3],
    pub(super) target: Target,
    pub(super) of_particles: Announced,
    pub(super) of_cells: Announced,
}

impl Reader<'_> {
    fn sections(&mut self, with_data: bool) -> Result<(), MeshIoError> {
        while let Some(word) = self.cursor.word() {
            // Other words at the start of a line belong to a section that is skipped.
            if !word.first && !self.cursor.binary {
                continue;
            }
            match word.text.to_ascii_uppercase().as_slice() {
                b"POINTS" => self.points()?,
                b"CELLS" => self.cells()?,
                b"CELL_TYPES" => self.types()?,
                b"POINT_DATA" | b"CELL_DATA" if !with_data && self.has == [true; 3] => {
                    return Ok(());
                }
                b"POINT_DATA" => {
                    self.of_particles = self.announced(word, self.of_particles)?;
                    self.target = Target::Particles;
                }
                b"CELL_DATA" => {
                    self.of_cells = self.announced(word, self.of_cells)?;
                    self.target = Target::Cells;
                }
                b"METADATA" => {
                    self.cursor.line();
                    while self.cursor.line_words().next().is_some() {}
                }
                b"FIELD" => self.field()?,
                b"LOOKUP_TABLE" => {
                    self.cursor.expect("the name of a table")?;
                    let colors = self.cursor.count("the size of a table")?;
                    self.array(Kind::U8, Some(4), Some(colors), None)?;
                }
                keyword => self.attribute(word, keyword)?,
            }
        }
        Ok(())
    }

    fn announced(&mut self, word: Word<'_>, before: Announced) -> Result<Announced, MeshIoError> {
        let count = self.cursor.count("the number of elements with data")?;
        if before.at.is_some() && before.count != count {
            let message = format!(
                "there are data of {count} elements but of {} before, give one for each",
                before.count
            );
            return Err(self.cursor.error(word.at, message));
        }
        Ok(Announced {
            count,
            at: Some(word.at),
        })
    }

    /// Binary data starts on the line after its keyword.
    pub(super) fn start_data(&mut self) {
        if self.cursor.binary {
            self.cursor.line();
        }
    }

    fn points(&mut self) -> Result<(), MeshIoError> {
        let count = self.cursor.count("the number of points")?;
        let word = self.cursor.expect("the data type of the points")?;
        let kind = Kind::of_legacy(word.text).filter(|kind| kind.is_real());
        let Some(kind) = kind else {
            let message = format!(
                "points of type {:?} are not read: float or double expected",
                show(word.text)
            );
            return Err(self.cursor.error(word.at, message));
        };
        self.start_data();
        let values = self
            .cursor
            .reals(kind, count.checked_mul(3), "coordinate", Wanted::Finite)?;
        self.grid.positions = positions(&values);
        self.has[0] = true;
        Ok(())
    }

    fn cells(&mut self) -> Result<(), MeshIoError> {
        let count = self.cursor.count("the number of cells")?;
        let size = self.cursor.count("the size of the cell list")?;
        self.start_data();
        self.grid.offsets.clear();
        self.grid.points.clear();
        self.has[1] = true;
        if self.cursor.peek().is_some_and(|word| word.is("OFFSETS")) {
            return self.cells_with_offsets(count, size);
        }
        self.tets_at = CellSource::Cells(self.cursor.at);
        // A list of this many numbers has one for each cell and one for each point of a cell.
        let numbers = self.cursor.room_for(size);
        let cells = count.min(numbers);
        self.grid.offsets.reserve_exact(cells + 1);
        self.grid.points.reserve_exact(numbers - cells);
        self.grid.offsets.push(0);
        for i in 0..count {
            let start = self.next_place();
            let Some(corners) = self.cell_number("the number of points of a cell")? else {
                let missing = format!("{count} cells announced but {i} found, more");
                return Err(self.cursor.ends_early(&missing));
            };
            let used = i + 1 + self.grid.points.len();
            if corners > size.saturating_sub(used) {
                let message = format!(
                    "the cells need more than the {size} numbers announced, correct the section CELLS"
                );
                return Err(self.cursor.error(start, message));
            }
            for _ in 0..corners {
                let Some(point) = self.cell_number("a point of a cell")? else {
                    return Err(self.cursor.ends_early("a point of a cell"));
                };
                self.grid.points.push(point);
            }
            self.grid.offsets.push(self.grid.points.len());
        }
        Ok(())
    }

    /// A number of the list of cells.
    fn cell_number(&mut self, what: &str) -> Result<Option<usize>, MeshIoError> {
        if self.cursor.binary {
            let at = self.cursor.at;
            let bytes = self.cursor.take(Some(4), "the list of cells")?;
            let number = bytes
                .iter()
                .fold(0_u32, |n, &byte| n << 8 | u32::from(byte));
            if number > i32::MAX.cast_unsigned() {
                let message = format!("a number is not {what}: it is negative");
                return Err(self.cursor.error(at, message));
            }
            return Ok(usize::try_from(number).ok());
        }
        let Some(word) = self.cursor.word() else {
            return Ok(None);
        };
        self.cursor.count_of(word, what).map(Some)
    }

    /// The start of the next number.
    fn next_place(&self) -> usize {
        if self.cursor.binary {
            return self.cursor.at;
        }
        self.cursor.peek().map_or(self.cursor.at, |word| word.at)
    }

    fn cells_with_offsets(&mut self, count: usize, size: usize) -> Result<(), MeshIoError> {
        let keyword = self.cursor.expect("OFFSETS")?;
        let kind = self.cursor.kind("the data type of the offsets")?;
        self.start_data();
        let offsets = self.cursor.indices(kind, count, "an offset")?;
        let runs = offsets.first().is_none_or(|&first| first == 0)
            && offsets.last().is_none_or(|&last| last == size)
            && offsets.is_sorted();
        if !runs {
            return Err(self.cursor.error(
                keyword.at,
                format!("the offsets do not run from 0 up to {size}, correct the section OFFSETS"),
            ));
        }
        let word = self.cursor.expect("CONNECTIVITY")?;
        if !word.is("CONNECTIVITY") {
            return Err(self.cursor.error(
                word.at,
                format!("CONNECTIVITY expected but {:?} found", show(word.text)),
            ));
        }
        let kind = self.cursor.kind("the data type of the connectivity")?;
        self.start_data();
        self.tets_at = CellSource::Connectivity(self.cursor.at, kind);
        self.grid.points = self.cursor.indices(kind, size, "a point of a cell")?;
        self.grid.offsets = offsets;
        Ok(())
    }

    fn types(&mut self) -> Result<(), MeshIoError> {
        let count = self.cursor.count("the number of cell types")?;
        self.start_data();
        self.grid.types = self.cursor.indices(Kind::I32, count, "a cell type")?;
        self.has[2] = true;
        Ok(())
    }

    /// An error at a cell, given the number of points of cells before it.
    fn cell_error(&self, cell: usize, points_before: usize, message: String) -> MeshIoError {
        let (start, kind, before) = match self.tets_at {
            CellSource::Cells(start) => (start, Kind::I32, cell + points_before),
            CellSource::Connectivity(start, kind) => (start, kind, points_before),
        };
        let mut words = Cursor {
            at: start,
            ..self.cursor
        };
        let at = if words.binary {
            start + kind.bytes(before).unwrap_or(0)
        } else {
            let word = (0..=before).map_while(|_| words.word()).last();
            word.map_or(start, |word| word.at)
        };
        self.cursor.error(at, message)
    }

    fn finish(mut self) -> Result<MeshFile, MeshIoError> {
        let (cursor, grid) = (&self.cursor, &self.grid);
        for (has, section) in self.has.into_iter().zip(["POINTS", "CELLS", "CELL_TYPES"]) {
            if !has {
                return Err(cursor.ends_early(&format!("a section {section}")));
            }
        }
        let cells = grid.offsets.len().saturating_sub(1);
        if grid.types.len() != cells {
            let message = format!(
                "there are {cells} cells but {} cell types, give one for each",
                grid.types.len()
            );
            let last = cells.saturating_sub(1);
            let before = grid.offsets.get(last).copied().unwrap_or(0);
            return Err(self.cell_error(last, before, message));
        }
        for (announced, elements, what) in [
            (self.of_particles, grid.positions.len(), "points"),
            (self.of_cells, grid.types.len(), "cells"),
        ] {
            if let Some(at) = announced.at
                && announced.count != elements
            {
                let message = format!(
                    "there are data of {} {what} but {elements} {what}, give one for each",
                    announced.count
                );
                return Err(cursor.error(at, message));
            }
        }
        let grid = std::mem::take(&mut self.grid);
        grid.into_file(|cell, points_before, message| self.cell_error(cell, points_before, message))
    }
}
