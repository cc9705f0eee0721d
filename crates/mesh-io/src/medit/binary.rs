//! The binary form: sections with a numbered keyword and the offset of the next one.
//!
//! | version | coordinates | offsets | counts, corners, references |
//! |---|---|---|---|
//! | 1 | f32 | 32 bits | 32 bits |
//! | 2 | f64 | 32 bits | 32 bits |
//! | 3 | f64 | 64 bits | 32 bits |
//! | 4 | f64 | 64 bits | 64 bits |
//!
//! The first number is 1 and shows the byte order; files are written little-endian. Offsets must
//! increase, so that reading ends. Linear.

use std::io::{self, Write};
use std::path::Path;

use glam::DVec3;
use incise_mesh::{ParticleId, TetMesh};

use super::{Contents, OTHER_VOLUMES, point_references, reference};
use crate::{MeshFile, MeshIoError};

const DIMENSION: i32 = 3;
const VERTICES: i32 = 4;
const TETRAHEDRA: i32 = 8;
const END: i32 = 54;

/// Bytes of an offset and of a whole number.
fn widths(version: i32) -> (u64, u64) {
    (
        if version < 3 { 4 } else { 8 },
        if version < 4 { 4 } else { 8 },
    )
}

/// The ends of the sections of a written file: dimension, points, tets.
fn ends(mesh: &TetMesh, version: i32) -> [u64; 3] {
    let (offset, whole) = widths(version);
    let points = mesh.positions.len() as u64;
    let tets = mesh.tets.len() as u64;
    let dimension = 8 + 4 + offset + 4;
    let vertices = dimension + 4 + offset + whole + points * (24 + whole);
    let tetrahedra = vertices + 4 + offset + whole + tets * 5 * whole;
    [dimension, vertices, tetrahedra]
}

/// The lowest version with double coordinates that is large enough for the mesh.
pub(super) fn lowest_version(mesh: &TetMesh) -> i32 {
    let fits = |number: u64| i32::try_from(number).is_ok();
    if !fits(mesh.positions.len().max(mesh.tets.len()) as u64) {
        4
    } else if !fits(ends(mesh, 2)[2]) {
        3
    } else {
        2
    }
}

/// Writes a file of a version from 2 on that is large enough.
pub(super) fn write(out: &mut dyn Write, file: &MeshFile, version: i32) -> io::Result<()> {
    let (mesh, points) = (&file.mesh, point_references(file).unwrap_or_default());
    let (offset, whole) = widths(version);
    let [dimension, vertices, tetrahedra] = ends(mesh, version);
    let number = |out: &mut dyn Write, number: i64, width: u64| {
        // The lower bytes suffice for a number that fits.
        out.write_all(&number.to_le_bytes()[..if width == 4 { 4 } else { 8 }])
    };
    let offset = |out: &mut dyn Write, code: i32, next: u64| {
        out.write_all(&code.to_le_bytes())?;
        number(out, next.cast_signed(), offset)
    };
    let count = |out: &mut dyn Write, count: usize| number(out, count as u64 as i64, whole);
    out.write_all(&1_i32.to_le_bytes())?;
    out.write_all(&version.to_le_bytes())?;
    offset(out, DIMENSION, dimension)?;
    out.write_all(&3_i32.to_le_bytes())?;

    offset(out, VERTICES, vertices)?;
    count(out, mesh.positions.len())?;
    for (i, position) in mesh.positions.iter().enumerate() {
        for coordinate in position.to_array() {
            out.write_all(&coordinate.to_le_bytes())?;
        }
        number(out, reference(&points, i).into(), whole)?;
    }
    offset(out, TETRAHEDRA, tetrahedra)?;
    count(out, mesh.tets.len())?;
    for (i, tet) in mesh.tets.iter().enumerate() {
        for corner in tet {
            number(out, i64::from(corner.0) + 1, whole)?;
        }
        number(out, reference(&file.regions, i).into(), whole)?;
    }
    offset(out, END, 0)
}

pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<MeshFile, MeshIoError> {
    let mut reader = Reader {
        path,
        bytes,
        at: 0,
        big_endian: bytes.first() == Some(&0),
        version: 1,
    };
    let contents = reader.sections()?;
    contents.finish(|byte, message| reader.error(byte, message))
}

struct Reader<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    at: usize,
    big_endian: bool,
    version: i32,
}

impl Reader<'_> {
    fn sections(&mut self) -> Result<Contents, MeshIoError> {
        if self.i32("the byte order")? != 1 {
            return Err(self.error(0, "the file does not start with 1: not a Medit file"));
        }
        self.version = self.i32("the version")?;
        if !(1..=4).contains(&self.version) {
            return Err(self.error(4, format!("version {} is not 1 to 4", self.version)));
        }
        let mut contents = Contents::default();
        let mut three = false;
        loop {
            let start = self.at;
            let code = self.i32("the keyword End")?;
            let next = if self.version < 3 {
                self.i32("the offset of the next keyword")?.into()
            } else {
                self.i64("the offset of the next keyword")?
            };
            let other = OTHER_VOLUMES.iter().find(|&&(_, other)| other == code);
            match code {
                END => return Ok(contents),
                DIMENSION => {
                    let dimension = self.i32("the dimension")?;
                    if dimension != 3 {
                        let message = format!("dimension 3 expected, not {dimension}");
                        return Err(self.error(self.at - 4, message));
                    }
                    three = true;
                }
                VERTICES if !three => {
                    return Err(self.error(start, "Vertices before Dimension 3"));
                }
                VERTICES => {
                    self.once(&mut contents.seen[0], start, "Vertices")?;
                    self.points(&mut contents)?;
                }
                TETRAHEDRA => {
                    self.once(&mut contents.seen[1], start, "Tetrahedra")?;
                    self.tets(&mut contents)?;
                }
                _ => {
                    if let Some((name, _)) = other {
                        let count = self.whole("the number of cells")?;
                        if count != 0 {
                            let message = format!("there are {count} {name}: only tets are read");
                            return Err(self.error(start, message));
                        }
                    }
                }
            }
            self.at = usize::try_from(next)
                .ok()
                .filter(|next| (self.at..=self.bytes.len()).contains(next))
                .ok_or_else(|| {
                    let message = format!(
                        "the next keyword cannot be at {next}: this one needs the bytes up to {} of {}",
                        self.at,
                        self.bytes.len()
                    );
                    self.error(start, message)
                })?;
        }
    }

    fn points(&mut self, contents: &mut Contents) -> Result<(), MeshIoError> {
        let coordinates = if self.version == 1 { 12 } else { 24 };
        let count = self.count("points", coordinates + self.whole_bytes())?;
        contents.positions.reserve_exact(count);
        contents.point_references.reserve_exact(count);
        for _ in 0..count {
            let mut position = DVec3::ZERO;
            for axis in 0..3 {
                position[axis] = self.coordinate()?;
            }
            contents.positions.push(position);
            contents.point_references.push(self.reference()?);
        }
        Ok(())
    }

    fn tets(&mut self, contents: &mut Contents) -> Result<(), MeshIoError> {
        let count = self.count("tets", 5 * self.whole_bytes())?;
        contents.tets.reserve_exact(count);
        contents.tet_references.reserve_exact(count);
        for _ in 0..count {
            let mut tet = [ParticleId(0); 4];
            for corner in &mut tet {
                let at = self.at;
                let number = self.whole("a point of a tet")?;
                *corner = contents.corner(number, at).ok_or_else(|| {
                    let message = format!("point {number} cannot be: points count from 1");
                    self.error(at, message)
                })?;
            }
            contents.tets.push(tet);
            contents.tet_references.push(self.reference()?);
        }
        Ok(())
    }

    /// A number of elements, checked against the rest of the file.
    fn count(&mut self, what: &str, bytes_each: usize) -> Result<usize, MeshIoError> {
        let at = self.at;
        let count = self.whole(&format!("the number of {what}"))?;
        let room = (self.bytes.len() - self.at) / bytes_each;
        usize::try_from(count)
            .ok()
            .filter(|&count| count <= room)
            .ok_or_else(|| {
                let message =
                    format!("{count} {what} announced but the file has room for {room} at most");
                self.error(at, message)
            })
    }

    fn coordinate(&mut self) -> Result<f64, MeshIoError> {
        let at = self.at;
        let value = if self.version == 1 {
            f32::from_bits(self.i32("a coordinate")?.cast_unsigned()).into()
        } else {
            f64::from_bits(self.i64("a coordinate")?.cast_unsigned())
        };
        if value.is_finite() {
            Ok(value)
        } else {
            Err(self.error(
                at,
                format!("the coordinate {value} is not finite, correct it"),
            ))
        }
    }

    fn reference(&mut self) -> Result<i32, MeshIoError> {
        let at = self.at;
        let number = self.whole("a reference")?;
        i32::try_from(number).map_err(|_| {
            let message = format!("the reference {number} does not fit in 32 bits");
            self.error(at, message)
        })
    }

    fn once(&self, seen: &mut bool, start: usize, name: &str) -> Result<(), MeshIoError> {
        if std::mem::replace(seen, true) {
            return Err(self.error(start, format!("a second section {name}")));
        }
        Ok(())
    }

    fn whole_bytes(&self) -> usize {
        if self.version < 4 { 4 } else { 8 }
    }

    fn whole(&mut self, what: &str) -> Result<i64, MeshIoError> {
        if self.version < 4 {
            self.i32(what).map(i64::from)
        } else {
            self.i64(what)
        }
    }

    fn i32(&mut self, what: &str) -> Result<i32, MeshIoError> {
        let bytes = self.take(what)?;
        Ok(if self.big_endian {
            i32::from_be_bytes(bytes)
        } else {
            i32::from_le_bytes(bytes)
        })
    }

    fn i64(&mut self, what: &str) -> Result<i64, MeshIoError> {
        let bytes = self.take(what)?;
        Ok(if self.big_endian {
            i64::from_be_bytes(bytes)
        } else {
            i64::from_le_bytes(bytes)
        })
    }

    fn take<const N: usize>(&mut self, what: &str) -> Result<[u8; N], MeshIoError> {
        let Some(&bytes) = self.bytes[self.at..].first_chunk() else {
            let message = format!("the file ends early: {what} expected, get the complete file");
            return Err(self.error(self.at, message));
        };
        self.at += N;
        Ok(bytes)
    }

    fn error(&self, byte: usize, message: impl Into<String>) -> MeshIoError {
        MeshIoError::ParseBytes {
            path: self.path.to_owned(),
            byte,
            message: message.into(),
        }
    }
}
