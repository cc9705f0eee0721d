//! TetGen's pair of files: `.node` with the points and `.ele` with the tets.
//!
//! One item per line after a line with counts; `#` starts a comment; points are numbered from 0 or 1, depending on the
//! first one. The mid-edge points of 10-point tets are skipped. TetGen's own tets are mirror images of ours, other
//! programs write either kind, so negative tets are flipped on reading.
//!
//! Attributes have no names: they are called `attribute 1` and so on, and the markers of points `boundary marker`.
//! TetGen stores the region in the last attribute of tets: it is read as the region if all values are whole numbers. At
//! most 256 attributes are supported. Linear.
//!
//! Source: H. Si, "TetGen User's Manual", file formats.

mod rows;
mod write;

use std::path::Path;

use glam::DVec3;
use incise_mesh::{ParticleId, TetMesh};

use crate::fields::whole;
use crate::text::{Text, load};
use crate::{MeshFile, MeshIoError, NamedValues, OwnedValues};
use rows::rows;

pub use write::{write_tetgen, write_tetgen_file};

/// The name of the values with the boundary markers of points.
const MARKER: &str = "boundary marker";

/// Converts numbers to integers; `None` unless all are whole numbers of 32 bits.
fn all_whole(values: &[f64]) -> Option<Vec<i32>> {
    values.iter().map(|&value| whole(value)).collect()
}

/// Reads the `.node` and `.ele` files with the stem of `path`; see [`read`](crate::read). Tets are oriented positively.
///
/// # Errors
/// The errors of [`read`](crate::read).
pub fn read_tetgen(path: impl AsRef<Path>) -> Result<TetMesh, MeshIoError> {
    read_tetgen_file(path).map(|file| file.mesh)
}

/// Reads the `.node` and `.ele` files with the stem of `path`, with attributes, boundary markers and regions. Tets are
/// oriented positively.
///
/// # Errors
/// The errors of [`read`](crate::read).
///
/// # Example
/// ```
/// use incise_mesh::{glam::DVec3, kuhn_box};
///
/// let path = std::env::temp_dir().join(format!("incise-doc-file-{}.node", std::process::id()));
/// let mut file = incise_mesh_io::MeshFile::from(kuhn_box([2, 2, 2], DVec3::splat(0.1)));
/// file.regions = (0..).take(file.mesh.tets.len()).collect();
/// incise_mesh_io::write_tetgen_file(&path, &file)?;
/// assert_eq!(incise_mesh_io::read_tetgen_file(&path)?, file);
/// # std::fs::remove_file(path.with_extension("ele")).ok();
/// # std::fs::remove_file(path).ok();
/// # Ok::<(), incise_mesh_io::MeshIoError>(())
/// ```
pub fn read_tetgen_file(path: impl AsRef<Path>) -> Result<MeshFile, MeshIoError> {
    let path = path.as_ref();
    let [nodes, elements] = ["node", "ele"].map(|ending| load(&path.with_extension(ending)));
    parse_tetgen(path, &nodes?, &elements?)
}

/// Parses the content of a `.node` and an `.ele` file in memory, with attributes, boundary markers and regions. Errors
/// contain `path` with the ending `.node` or `.ele`.
///
/// # Errors
/// The errors of [`parse_file`](crate::parse_file).
///
/// # Example
/// ```
/// let nodes = b"4 3 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n";
/// let file = incise_mesh_io::parse_tetgen("a.node", nodes, b"1 4 0\n1 1 2 3 4\n")?;
/// assert_eq!(file.mesh.total_volume(), 1.0 / 6.0);
/// # Ok::<(), incise_mesh_io::MeshIoError>(())
/// ```
pub fn parse_tetgen(
    path: impl AsRef<Path>,
    nodes: &[u8],
    elements: &[u8],
) -> Result<MeshFile, MeshIoError> {
    let path = path.as_ref();
    let (node_path, ele_path) = (path.with_extension("node"), path.with_extension("ele"));
    let (positions, particles, base) = read_nodes(&Text::new(&node_path, nodes))?;
    let elements = Text::new(&ele_path, elements);
    let (tets, mut attributes) = read_tets(&elements, base, positions.len())?;
    if tets.is_empty() {
        return Err(MeshIoError::Empty);
    }
    let regions = attributes.last().and_then(|last| all_whole(last));
    if regions.is_some() {
        attributes.pop();
    }
    let mut mesh = TetMesh { positions, tets };
    mesh.orient_positively();
    Ok(MeshFile {
        mesh,
        regions: regions.unwrap_or_default(),
        particles,
        tets: named(attributes),
    })
}

/// Columns of attributes with their names.
fn named(columns: Vec<Vec<f64>>) -> Vec<NamedValues> {
    let values = (1..).zip(columns).map(|(i, column)| NamedValues {
        name: format!("attribute {i}"),
        values: OwnedValues::Scalars(column),
    });
    values.collect()
}

type Nodes = (Vec<DVec3>, Vec<NamedValues>, usize);

fn read_nodes(text: &Text<'_>) -> Result<Nodes, MeshIoError> {
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
    let mut columns = header.columns(count)?;
    let marked = match header.count_or_0("whether there are markers")? {
        0 => false,
        1 => true,
        other => {
            let message = format!("0 or 1 boundary markers expected, not {other}");
            return Err(text.error(header.line, message));
        }
    };
    let mut positions = Vec::with_capacity(text.room_for(count, 8));
    let mut markers = Vec::new();
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
        row.attributes(&mut columns)?;
        if marked {
            markers.push(f64::from(row.marker()?));
        }
    }
    let mut particles = named(columns);
    if !markers.is_empty() {
        particles.push(NamedValues {
            name: MARKER.to_owned(),
            values: OwnedValues::Scalars(markers),
        });
    }
    Ok((positions, particles, base))
}

type Elements = (Vec<[ParticleId; 4]>, Vec<Vec<f64>>);

fn read_tets(text: &Text<'_>, base: usize, particles: usize) -> Result<Elements, MeshIoError> {
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
    let mut columns = header.columns(count)?;
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
        for _ in 4..corners {
            row.word("a point between")?;
        }
        row.attributes(&mut columns)?;
        tets.push(tet);
    }
    Ok((tets, columns))
}

#[cfg(test)]
mod tests;
