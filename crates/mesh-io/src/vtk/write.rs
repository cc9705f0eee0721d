//! Writing legacy VTK files.
//!
//! Text keeps every bit of finite numbers. A binary file has 64-bit offsets and connectivity (version 5.1), so all
//! sizes fit; a text is of version 3.0 or 4.2, which every reader supports. Linear.

use std::io::{self, Write};
use std::path::Path;

use incise_mesh::TetMesh;

use crate::vtk_grid::{REGIONS, TETRA};
use crate::{MeshFile, MeshIoError, NamedValues, OwnedValues, write_atomically};

/// Writes a legacy VTK file, version 3.0, ASCII, with coordinates that keep every bit.
///
/// # Errors
/// [`MeshIoError::Io`] if the file cannot be written.
pub fn write_vtk(path: impl AsRef<Path>, mesh: &TetMesh) -> Result<(), MeshIoError> {
    write_atomically(path, |file| text_mesh(file, "3.0", mesh))
}

/// Writes a legacy VTK file, version 4.2, ASCII, with regions (as a cell array `regions`) and fields.
///
/// Finite numbers keep every bit. A field without a name gets the name `values`.
///
/// # Errors
/// [`MeshIoError::FieldLength`] if the values or regions are of the wrong number, [`MeshIoError::Io`] if the file
/// cannot be written.
pub fn write_vtk_file(path: impl AsRef<Path>, file: &MeshFile) -> Result<(), MeshIoError> {
    file.check()?;
    write_atomically(path, |out| text(out, file))
}

/// Writes a legacy VTK file, version 5.1, binary, with regions (as a cell array `regions`) and fields; all numbers keep
/// every bit.
///
/// # Errors
/// The errors of [`write_vtk_file`].
pub fn write_vtk_binary(path: impl AsRef<Path>, file: &MeshFile) -> Result<(), MeshIoError> {
    file.check()?;
    write_atomically(path, |out| binary(out, file))
}

fn text_mesh(out: &mut dyn Write, version: &str, mesh: &TetMesh) -> io::Result<()> {
    writeln!(
        out,
        "# vtk DataFile Version {version}\ntetrahedral mesh\nASCII\nDATASET UNSTRUCTURED_GRID"
    )?;
    writeln!(out, "POINTS {} double", mesh.positions.len())?;
    for p in &mesh.positions {
        writeln!(out, "{:?} {:?} {:?}", p.x, p.y, p.z)?;
    }
    let tets = mesh.tets.len();
    writeln!(out, "CELLS {tets} {}", 5 * tets)?;
    for [a, b, c, d] in &mesh.tets {
        writeln!(out, "4 {a} {b} {c} {d}")?;
    }
    writeln!(out, "CELL_TYPES {tets}")?;
    for _ in 0..tets {
        writeln!(out, "{TETRA}")?;
    }
    Ok(())
}

pub(super) fn text(out: &mut dyn Write, file: &MeshFile) -> io::Result<()> {
    text_mesh(out, "4.2", &file.mesh)?;
    sections(
        out,
        file,
        "int",
        |out, regions| regions.iter().try_for_each(|r| writeln!(out, "{r}")),
        |out, values| match values {
            OwnedValues::Scalars(values) => values.iter().try_for_each(|v| writeln!(out, "{v:?}")),
            OwnedValues::Vectors(values) => values
                .iter()
                .try_for_each(|v| writeln!(out, "{:?} {:?} {:?}", v.x, v.y, v.z)),
        },
    )
}

pub(super) fn binary(out: &mut dyn Write, file: &MeshFile) -> io::Result<()> {
    let mesh = &file.mesh;
    writeln!(
        out,
        "# vtk DataFile Version 5.1\ntetrahedral mesh\nBINARY\nDATASET UNSTRUCTURED_GRID"
    )?;
    writeln!(out, "POINTS {} double", mesh.positions.len())?;
    for p in &mesh.positions {
        for axis in p.to_array() {
            out.write_all(&axis.to_be_bytes())?;
        }
    }
    let tets = mesh.tets.len();
    writeln!(out, "\nCELLS {} {}", tets + 1, 4 * tets)?;
    writeln!(out, "OFFSETS vtktypeint64")?;
    for offset in (0_i64..).step_by(4).take(tets + 1) {
        out.write_all(&offset.to_be_bytes())?;
    }
    writeln!(out, "\nCONNECTIVITY vtktypeint64")?;
    for corner in mesh.tets.iter().flatten() {
        out.write_all(&i64::from(corner.0).to_be_bytes())?;
    }
    writeln!(out, "\nCELL_TYPES {tets}")?;
    for _ in 0..tets {
        out.write_all(&10_i32.to_be_bytes())?;
    }
    writeln!(out)?;
    sections(
        out,
        file,
        // Not `int`, which has four bytes but is read as eight by meshio.
        "vtktypeint64",
        |out, regions| {
            for &region in regions {
                out.write_all(&i64::from(region).to_be_bytes())?;
            }
            writeln!(out)
        },
        |out, values| {
            let mut put = |v: &f64| out.write_all(&v.to_be_bytes());
            match values {
                OwnedValues::Scalars(values) => values.iter().try_for_each(&mut put)?,
                OwnedValues::Vectors(values) => values
                    .iter()
                    .try_for_each(|v| v.to_array().iter().try_for_each(&mut put))?,
            }
            writeln!(out)
        },
    )
}

/// Writes the point and cell data; the given functions write the numbers of regions (of that type) and of fields.
fn sections(
    out: &mut dyn Write,
    file: &MeshFile,
    region_type: &str,
    regions: impl Fn(&mut dyn Write, &[i32]) -> io::Result<()>,
    numbers: impl Fn(&mut dyn Write, &OwnedValues) -> io::Result<()>,
) -> io::Result<()> {
    let tets = file.mesh.tets.len();
    let has_regions = !file.regions.is_empty();
    let of_tets = file.tets.len() + usize::from(has_regions);
    if of_tets > 0 {
        writeln!(out, "CELL_DATA {tets}\nFIELD FieldData {of_tets}")?;
    }
    if has_regions {
        writeln!(out, "{REGIONS} 1 {tets} {region_type}")?;
        regions(out, &file.regions)?;
    }
    let arrays = |out: &mut dyn Write, fields: &[NamedValues], count: usize| {
        for field in fields {
            let components = match field.values {
                OwnedValues::Scalars(_) => 1,
                OwnedValues::Vectors(_) => 3,
            };
            writeln!(out, "{} {components} {count} double", encoded(field))?;
            numbers(out, &field.values)?;
        }
        Ok(())
    };
    arrays(out, &file.tets, tets)?;
    if file.particles.is_empty() {
        return Ok(());
    }
    let particles = file.mesh.positions.len();
    writeln!(
        out,
        "POINT_DATA {particles}\nFIELD FieldData {}",
        file.particles.len()
    )?;
    arrays(out, &file.particles, particles)
}

/// A name as one word, with `%` and two digits for blanks and special characters.
fn encoded(values: &NamedValues) -> String {
    if values.name.is_empty() {
        return "values".to_owned();
    }
    // These two words have another meaning in the position of a name.
    let keyword = ["METADATA", "NULL_ARRAY"]
        .iter()
        .any(|keyword| values.name.eq_ignore_ascii_case(keyword));
    let mut name = String::new();
    for byte in values.name.bytes() {
        if !keyword && byte.is_ascii_graphic() && byte != b'%' && byte != b'"' {
            name.push(char::from(byte));
        } else {
            name.push_str(&format!("%{byte:02X}"));
        }
    }
    name
}
