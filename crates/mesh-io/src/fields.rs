//! Named values per particle or per cell, written along with a mesh.

use glam::DVec3;

use crate::MeshIoError;

/// Values with a name, such as `velocity` in m/s. Values that are not finite are written unchanged.
#[derive(Clone, Copy, Debug)]
pub struct Field<'a> {
    /// The name shown in viewers.
    pub name: &'a str,
    /// One value for each element.
    pub values: Values<'a>,
}

/// The values of a field.
#[derive(Clone, Copy, Debug)]
pub enum Values<'a> {
    /// A number for each element.
    Scalars(&'a [f64]),
    /// A vector for each element.
    Vectors(&'a [DVec3]),
}

/// The fields of a file; none by default.
#[derive(Clone, Copy, Debug, Default)]
pub struct Fields<'a> {
    /// Fields with one value for each particle.
    pub particles: &'a [Field<'a>],
    /// Fields with one value for each cell: each tet of a mesh, each triangle of a surface.
    pub cells: &'a [Field<'a>],
}

/// Converts a number to an integer of 32 bits if it is one; -0 would lose its sign and is not
/// converted.
pub(super) fn whole(value: f64) -> Option<i32> {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the cast saturates, and a value that changed is no whole number of 32 bits"
    )]
    let number = value as i32;
    (f64::from(number).to_bits() == value.to_bits()).then_some(number)
}

impl Fields<'_> {
    /// An error if a field has the wrong length.
    pub(super) fn check(&self, particles: usize, cells: usize) -> Result<(), MeshIoError> {
        for (fields, expected) in [(self.particles, particles), (self.cells, cells)] {
            for field in fields {
                let found = match field.values {
                    Values::Scalars(values) => values.len(),
                    Values::Vectors(values) => values.len(),
                };
                if found != expected {
                    return Err(MeshIoError::FieldLength {
                        name: field.name.to_owned(),
                        expected,
                        found,
                    });
                }
            }
        }
        Ok(())
    }
}
