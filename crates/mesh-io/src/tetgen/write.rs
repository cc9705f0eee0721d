//! Writing TetGen files: a line for each element in order. Linear.

use std::fmt::{self, Display};
use std::io;
use std::path::Path;

use incise_mesh::TetMesh;

use super::rows::MOST_ATTRIBUTES;
use super::{MARKER, all_whole};
use crate::{MeshFile, MeshIoError, NamedValues, OwnedValues, write_atomically};

/// Writes `.node` and `.ele` files with the stem of `path`, numbered from 0, with coordinates that keep every bit.
///
/// # Errors
/// [`MeshIoError::Io`] if a file cannot be written.
pub fn write_tetgen(path: impl AsRef<Path>, mesh: &TetMesh) -> Result<(), MeshIoError> {
    write_pair(path.as_ref(), mesh, &[], &[], &[])
}

/// Writes `.node` and `.ele` files with the stem of `path`, with the scalars of `file` as attributes, in their order,
/// and its regions as the last attribute of tets. The scalars `boundary marker` of particles are markers if they are
/// whole numbers of 32 bits. Vectors are not supported by the format and are left out.
///
/// # Errors
/// [`MeshIoError::FieldLength`] if regions or values are not one for each element, [`MeshIoError::Io`] if a file cannot
/// be written or has more than 256 attributes.
pub fn write_tetgen_file(path: impl AsRef<Path>, file: &MeshFile) -> Result<(), MeshIoError> {
    file.check()?;
    write_pair(
        path.as_ref(),
        &file.mesh,
        &file.regions,
        &file.particles,
        &file.tets,
    )
}

fn write_pair(
    path: &Path,
    mesh: &TetMesh,
    regions: &[i32],
    particles: &[NamedValues],
    tets: &[NamedValues],
) -> Result<(), MeshIoError> {
    let scalars = |values: &NamedValues| matches!(values.values, OwnedValues::Scalars(_));
    let markers = particles.iter().find_map(|values| match &values.values {
        OwnedValues::Scalars(scalars) if values.name == MARKER => all_whole(scalars),
        _ => None,
    });
    let of_particles: Vec<_> = particles
        .iter()
        .filter(|values| scalars(values) && !(markers.is_some() && values.name == MARKER))
        .collect();
    let of_tets: Vec<_> = tets.iter().filter(|values| scalars(values)).collect();
    let most = of_particles
        .len()
        .max(of_tets.len() + usize::from(!regions.is_empty()));
    if most > MOST_ATTRIBUTES {
        let message =
            format!("{most} attributes are more than the {MOST_ATTRIBUTES} that are read");
        return Err(MeshIoError::Io {
            action: "write",
            path: path.to_owned(),
            source: io::Error::new(io::ErrorKind::InvalidInput, message),
        });
    }
    write_atomically(path.with_extension("node"), |file| {
        let (points, attributes) = (mesh.positions.len(), of_particles.len());
        writeln!(
            file,
            "{points} 3 {attributes} {}",
            u8::from(markers.is_some())
        )?;
        for (i, p) in mesh.positions.iter().enumerate() {
            let marker = Optional(markers.as_ref().map(|markers| markers[i]));
            let attributes = Attributes(&of_particles, i);
            writeln!(
                file,
                "{i} {:?} {:?} {:?}{attributes}{marker}",
                p.x, p.y, p.z
            )?;
        }
        Ok(())
    })?;
    write_atomically(path.with_extension("ele"), |file| {
        let attributes = of_tets.len() + usize::from(!regions.is_empty());
        writeln!(file, "{} 4 {attributes}", mesh.tets.len())?;
        for (i, [a, b, c, d]) in mesh.tets.iter().enumerate() {
            let region = Optional(regions.get(i).copied());
            let attributes = Attributes(&of_tets, i);
            writeln!(file, "{i} {a} {b} {c} {d}{attributes}{region}")?;
        }
        Ok(())
    })
}

/// The attributes of one element, each after a space.
struct Attributes<'a>(&'a [&'a NamedValues], usize);

impl Display for Attributes<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for values in self.0 {
            if let OwnedValues::Scalars(scalars) = &values.values {
                write!(f, " {:?}", scalars[self.1])?;
            }
        }
        Ok(())
    }
}

/// A number after a space, or an empty text.
struct Optional(Option<i32>);

impl Display for Optional {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.map_or(Ok(()), |number| write!(f, " {number}"))
    }
}
