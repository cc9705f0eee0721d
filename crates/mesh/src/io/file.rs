//! [`MeshFile`]: a mesh with what its file says beside it.
//!
//! Formats name values and number regions; a [`TetMesh`] knows neither. So what a reader finds is kept here, and a writer
//! puts in what its format has a place for. Cost: O(values).

use glam::DVec3;

use super::{Field, Fields, Values};
use crate::{MeshError, TetMesh};

/// What a file of a mesh has in it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshFile {
    /// The mesh.
    pub mesh: TetMesh,
    /// A number for each tet, such as its material; empty if the file has none.
    pub regions: Vec<i32>,
    /// Values with a name for each particle.
    pub particles: Vec<NamedValues>,
    /// Values with a name for each tet.
    pub tets: Vec<NamedValues>,
}

/// Values with a name, one for each element.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedValues {
    /// The name.
    pub name: String,
    /// The values.
    pub values: OwnedValues,
}

/// The values of a field that was read.
#[derive(Clone, Debug, PartialEq)]
pub enum OwnedValues {
    /// A number for each element.
    Scalars(Vec<f64>),
    /// A vector for each element.
    Vectors(Vec<DVec3>),
}

impl From<TetMesh> for MeshFile {
    fn from(mesh: TetMesh) -> Self {
        Self {
            mesh,
            ..Self::default()
        }
    }
}

impl NamedValues {
    /// The same, borrowed.
    #[must_use]
    pub fn as_field(&self) -> Field<'_> {
        Field {
            name: &self.name,
            values: match &self.values {
                OwnedValues::Scalars(values) => Values::Scalars(values),
                OwnedValues::Vectors(values) => Values::Vectors(values),
            },
        }
    }
}

impl MeshFile {
    /// Refuses values and regions of the wrong number.
    ///
    /// # Errors
    /// [`MeshError::FieldLength`] names the first field that has not one value for each element.
    pub fn check(&self) -> Result<(), MeshError> {
        let (particles, tets) = (self.mesh.positions.len(), self.mesh.tets.len());
        if !self.regions.is_empty() && self.regions.len() != tets {
            return Err(MeshError::FieldLength {
                name: "regions".to_owned(),
                expected: tets,
                found: self.regions.len(),
            });
        }
        let of_particles: Vec<_> = self.particles.iter().map(NamedValues::as_field).collect();
        let of_tets: Vec<_> = self.tets.iter().map(NamedValues::as_field).collect();
        let fields = Fields {
            particles: &of_particles,
            cells: &of_tets,
        };
        fields.check(particles, tets)
    }
}
