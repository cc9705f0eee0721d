//! Matrix Market exchange format (Boisvert, Pozo, Remington 1996): the graph of a sparse matrix.
//!
//! A square matrix is a graph: row and column i are vertex i, an entry in row i and column j is an
//! edge. The values are ignored. Cost: O(length of the file + edges log edges).

use std::io::BufRead;

use super::{Line, Lines, build, show};
use crate::{ConstraintGraph, GraphError};

/// Reads the graph of a sparse square matrix in Matrix Market coordinate format (`.mtx`).
///
/// Every entry off the diagonal is an edge, also one with a stored value of 0. The diagonal is
/// skipped: a graph has no loops, and most symmetric matrices store one. All fields (`pattern`,
/// `real`, `integer`, `complex`) and all symmetries (`general`, `symmetric`, `skew-symmetric`,
/// `hermitian`) are read, in any letter case and combination. The graph of a `general` matrix is
/// the structure of A + Aᵀ; other matrices may store either triangle. Repeated entries count once.
/// Blank lines and comments may appear anywhere after the header, comments in any encoding.
///
/// The file must have the number of entries in the header. Counts in the file reserve no memory; a
/// matrix of more than 2^20 rows must have at least one entry for every 16 rows above that.
///
/// Deterministic. O(length of the file + edges log edges), memory proportional to the length of the
/// file.
///
/// # Errors
/// [`GraphError::Malformed`] with the line: another header, the dense format `array`, a matrix that
/// is not square, an entry outside of the matrix, words that are not numbers, too few or too many
/// words, another number of entries than announced, lines of more than 65535 bytes.
/// [`GraphError::Unreadable`] if the source fails, [`GraphError::TooMany`] for 2^31 edges or more.
///
/// ```
/// use incise_graph::read_matrix_market;
///
/// let path = "%%MatrixMarket matrix coordinate real symmetric\n\
///             % the Laplacian of a path\n\
///             3 3 5\n1 1 1.0\n2 1 -1.0\n2 2 2.0\n3 2 -1.0\n3 3 1.0\n";
/// let graph = read_matrix_market(path.as_bytes())?;
/// assert_eq!(graph.edges().collect::<Vec<_>>(), [(0, 1), (1, 2)]);
///
/// let error = read_matrix_market(path.replace("2 1", "2 7").as_bytes()).unwrap_err();
/// assert_eq!(error.to_string(), "line 5: there is no vertex 7: the header announces 3 vertices");
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
pub fn read_matrix_market(source: impl BufRead) -> Result<ConstraintGraph, GraphError> {
    let mut lines = Lines::new(source);
    let field = match lines.next()? {
        None => return Err(lines.ends_early("a line \"%%MatrixMarket ...\" expected")),
        Some(line) => header(line)?,
    };
    let size = loop {
        match lines.next()? {
            None => return Err(lines.ends_early("a line with rows, columns and entries expected")),
            Some(line) if has_content(line) => break size(line)?,
            Some(_) => {}
        }
    };
    let mut edges = Vec::new();
    let mut found = 0;
    while let Some(line) = lines.next()? {
        if !has_content(line) {
            continue;
        }
        if found == size.entries {
            return Err(line.malformed(format!(
                "{} stands after the last entry: line {} announces {found} entries",
                line.words().next().map(show).unwrap_or_default(),
                size.line
            )));
        }
        found += 1;
        let (row, column) = entry(line, field, size.vertices)?;
        if row != column {
            edges.push((row, column));
        }
    }
    if found < size.entries {
        return Err(lines.ends_early(&format!(
            "line {} announces {} entries, found {found}",
            size.line, size.entries
        )));
    }
    build(size.line, size.vertices, found, &edges)
}

/// The values of an entry, after row and column.
#[derive(Clone, Copy)]
enum Field {
    Pattern,
    Real,
    Integer,
    Complex,
}

/// The line with the size of the matrix.
struct Size {
    line: usize,
    vertices: u32,
    entries: u64,
}

/// True unless the line is blank or a comment.
fn has_content(line: Line<'_>) -> bool {
    line.words().next().is_some_and(|word| word[0] != b'%')
}

/// `%%MatrixMarket matrix coordinate FIELD SYMMETRY`.
fn header(line: Line<'_>) -> Result<Field, GraphError> {
    let is = |word: &[u8], name: &str| word.eq_ignore_ascii_case(name.as_bytes());
    let first = line.words().next().unwrap_or_default();
    if !is(first, "%%MatrixMarket") {
        return Err(line.malformed(format!(
            "the file begins with {}: \"%%MatrixMarket\" expected",
            show(first)
        )));
    }
    let [_, object, format, field, symmetry] =
        line.exactly("\"%%MatrixMarket matrix coordinate FIELD SYMMETRY\"")?;
    if !is(object, "matrix") {
        return Err(line.malformed(format!(
            "{} is not a matrix: \"matrix\" expected",
            show(object)
        )));
    }
    if is(format, "array") {
        return Err(line.malformed(
            "\"array\" is a dense matrix: only the sparse format \"coordinate\" is a graph",
        ));
    }
    if !is(format, "coordinate") {
        return Err(line.malformed(format!(
            "there is no format {}: \"coordinate\" expected",
            show(format)
        )));
    }
    let symmetries = ["general", "symmetric", "skew-symmetric", "hermitian"];
    if !symmetries.iter().any(|name| is(symmetry, name)) {
        return Err(line.malformed(format!(
            "there is no symmetry {}: use one of {}",
            show(symmetry),
            symmetries.join(", ")
        )));
    }
    let fields = [
        ("pattern", Field::Pattern),
        ("real", Field::Real),
        ("integer", Field::Integer),
        ("complex", Field::Complex),
    ];
    match fields.iter().find(|(name, _)| is(field, name)) {
        Some(&(_, field)) => Ok(field),
        None => Err(line.malformed(format!(
            "there is no field {}: use one of {}",
            show(field),
            fields.map(|(name, _)| name).join(", ")
        ))),
    }
}

/// `ROWS COLUMNS ENTRIES`.
fn size(line: Line<'_>) -> Result<Size, GraphError> {
    let [rows, columns, entries] = line.exactly("rows, columns and entries")?;
    let vertices = line.vertex_count(rows)?;
    let columns = line.count(columns, "a number of columns")?;
    if columns != u64::from(vertices) {
        return Err(line.malformed(format!(
            "the matrix has {vertices} rows and {columns} columns: only a square one is a graph"
        )));
    }
    Ok(Size {
        line: line.number,
        vertices,
        entries: line.count(entries, "a number of entries")?,
    })
}

/// `ROW COLUMN`, followed by the numbers of the field.
fn entry(line: Line<'_>, field: Field, vertices: u32) -> Result<(u32, u32), GraphError> {
    let real = |word: &[u8]| {
        let number = str::from_utf8(word)
            .ok()
            .and_then(|word| word.parse::<f64>().ok());
        number.map(|_| ()).ok_or_else(|| {
            line.malformed(format!("{} is not a value: a number expected", show(word)))
        })
    };
    let (row, column) = match field {
        Field::Pattern => {
            let [row, column] = line.exactly("row and column")?;
            (row, column)
        }
        Field::Real => {
            let [row, column, value] = line.exactly("row, column and value")?;
            real(value)?;
            (row, column)
        }
        Field::Integer => {
            let [row, column, value] = line.exactly("row, column and value")?;
            let digits = value.strip_prefix(b"-").or(value.strip_prefix(b"+"));
            let digits = digits.unwrap_or(value);
            if digits.is_empty() || !digits.iter().all(u8::is_ascii_digit) {
                let value = show(value);
                return Err(
                    line.malformed(format!("{value} is not a value: a whole number expected"))
                );
            }
            (row, column)
        }
        Field::Complex => {
            let [row, column, re, im] = line.exactly("row, column and two values")?;
            real(re)?;
            real(im)?;
            (row, column)
        }
    };
    Ok((line.vertex(row, vertices)?, line.vertex(column, vertices)?))
}
