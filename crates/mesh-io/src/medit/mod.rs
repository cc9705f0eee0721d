//! Medit's `.mesh` (ASCII) and `.meshb` (binary) files: points and cells, each with an integer called its reference.
//!
//! A file is a list of sections, each a keyword, a count and that many lines. The keyword `End` is required, because a
//! truncated file would be read without an error otherwise. The references of tets are the regions, those of points the
//! values named `reference`. If all references are 0, there are none. Points are numbered from 1. Sections other than
//! points and volume cells are skipped.
//!
//! Source: P. Frey, "Medit: An interactive mesh visualization software" (INRIA RT-0253, 2001); the binary layout and
//! the codes of the keywords after L. Maréchal's libMeshb 7. Linear.

mod ascii;
mod binary;

use std::path::Path;

use glam::DVec3;
use incise_mesh::{ParticleId, TetMesh};

use crate::endings::ending;
use crate::fields::whole;
use crate::text::load;
use crate::{MeshFile, MeshIoError, NamedValues, OwnedValues, write_atomically};

/// The name of the values with the references of points.
const REFERENCE: &str = "reference";

/// Volume cells other than tets, as ASCII keyword and binary code.
const OTHER_VOLUMES: [(&str, i32); 15] = [
    ("Prisms", 9),
    ("Hexahedra", 10),
    ("TetrahedraP2", 30),
    ("HexahedraQ2", 33),
    ("Pyramids", 49),
    ("PrismsP2", 86),
    ("PyramidsP2", 87),
    ("TetrahedraP3", 96),
    ("TetrahedraP4", 97),
    ("HexahedraQ3", 98),
    ("HexahedraQ4", 99),
    ("PyramidsP3", 100),
    ("PyramidsP4", 101),
    ("PrismsP3", 102),
    ("PrismsP4", 103),
];

/// Reads a Medit file, ASCII or binary depending on its first byte.
///
/// Tets keep their orientation, also negative ones. References of tets become [`MeshFile::regions`] and references of
/// points the scalars `reference`, unless all are 0.
///
/// # Errors
/// [`MeshIoError::Io`] if the file cannot be read, [`MeshIoError::Parse`] or [`MeshIoError::ParseBytes`] if its
/// content is wrong or has volume cells other than tets, [`MeshIoError::Empty`] without any cell.
///
/// # Example
/// ```
/// use incise_mesh::{glam::DVec3, kuhn_box};
///
/// let path = std::env::temp_dir().join(format!("incise-doc-{}.meshb", std::process::id()));
/// let mut file = incise_mesh_io::MeshFile::from(kuhn_box([2, 2, 2], DVec3::splat(0.1)));
/// file.regions = (0..).take(file.mesh.tets.len()).collect();
/// incise_mesh_io::write_medit(&path, &file)?;
/// assert_eq!(incise_mesh_io::read_medit(&path)?, file);
/// # std::fs::remove_file(path).ok();
/// # Ok::<(), incise_mesh_io::MeshIoError>(())
/// ```
pub fn read_medit(path: impl AsRef<Path>) -> Result<MeshFile, MeshIoError> {
    let path = path.as_ref();
    parse_medit(&load(path)?, path)
}

/// Parses a Medit file in memory, ASCII or binary depending on its first byte.
pub(crate) fn parse_medit(bytes: &[u8], path: &Path) -> Result<MeshFile, MeshIoError> {
    // A binary file starts with the number 1, in either byte order.
    if matches!(bytes.first(), Some(0 | 1)) {
        binary::parse(bytes, path)
    } else {
        ascii::parse(bytes, path)
    }
}

/// Writes a Medit file: binary if the name ends with `.meshb`, else ASCII. Both keep every bit of the coordinates.
///
/// Regions become the references of tets, and the scalars named `reference` those of points if all are whole numbers of
/// 32 bits; otherwise references are 0. Other values are not written. The binary version is the lowest that is large
/// enough: 2, from 2 GiB on 3, from 2³¹ points or tets on 4.
///
/// # Errors
/// [`MeshIoError::FieldLength`] if regions or values are not one for each element, [`MeshIoError::Io`] if the file
/// cannot be written.
pub fn write_medit(path: impl AsRef<Path>, file: &MeshFile) -> Result<(), MeshIoError> {
    file.check()?;
    let path = path.as_ref();
    let binary = ending(path) == "meshb";
    write_atomically(path, |out| {
        if binary {
            binary::write(out, file, binary::lowest_version(&file.mesh))
        } else {
            ascii::write(out, file)
        }
    })
}

/// The content read so far.
#[derive(Default)]
struct Contents {
    /// True after a section of points, and of tets.
    seen: [bool; 2],
    positions: Vec<DVec3>,
    point_references: Vec<i32>,
    tets: Vec<[ParticleId; 4]>,
    tet_references: Vec<i32>,
    /// The largest corner and its line or byte: tets may come before the points.
    largest: Option<(ParticleId, usize)>,
}

impl Contents {
    /// The particle of a corner numbered from 1, if it can exist.
    fn corner(&mut self, number: i64, place: usize) -> Option<ParticleId> {
        let particle = ParticleId(u32::try_from(number.checked_sub(1)?).ok()?);
        if self.largest.is_none_or(|(largest, _)| particle > largest) {
            self.largest = Some((particle, place));
        }
        Some(particle)
    }

    /// Makes the checks that need the whole file; `error` makes an error of a line or byte and a message.
    fn finish(self, error: impl Fn(usize, String) -> MeshIoError) -> Result<MeshFile, MeshIoError> {
        if self.tets.is_empty() {
            return Err(MeshIoError::Empty);
        }
        let particles = self.positions.len();
        match self.largest {
            Some((corner, place)) if corner.index() >= particles => {
                let message = format!(
                    "a tet has the point {} but there are {particles}, counted from 1",
                    corner.index() + 1
                );
                return Err(error(place, message));
            }
            _ => {}
        }
        let says_something =
            |references: &[i32]| references.iter().any(|&reference| reference != 0);
        let mut file = MeshFile::from(TetMesh {
            positions: self.positions,
            tets: self.tets,
        });
        if says_something(&self.tet_references) {
            file.regions = self.tet_references;
        }
        if says_something(&self.point_references) {
            file.particles.push(NamedValues {
                name: REFERENCE.to_owned(),
                values: OwnedValues::Scalars(
                    self.point_references.into_iter().map(f64::from).collect(),
                ),
            });
        }
        Ok(file)
    }
}

/// The reference of each point; `None` without fitting values.
fn point_references(file: &MeshFile) -> Option<Vec<i32>> {
    let values = file.particles.iter().find(|v| v.name == REFERENCE)?;
    let OwnedValues::Scalars(values) = &values.values else {
        return None;
    };
    values.iter().map(|&value| whole(value)).collect()
}

/// The reference of element `i`; 0 without references.
fn reference(references: &[i32], i: usize) -> i32 {
    references.get(i).copied().unwrap_or(0)
}

#[cfg(test)]
mod tests;
