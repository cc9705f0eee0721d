//! [`MeshFile`]: a mesh with the regions and fields of its file.
//!
//! Formats have named values and region numbers; a [`TetMesh`] has neither. A reader stores them
//! here, and a writer stores those that its format supports. Cost: O(values).

use glam::DVec3;
use incise_mesh::{Repaired, TetMesh};

use crate::{Field, Fields, MeshIoError, Values};

/// The content of a mesh file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshFile {
    /// The mesh.
    pub mesh: TetMesh,
    /// A number for each tet, such as its material; empty if the file has none.
    pub regions: Vec<i32>,
    /// Named values of the particles.
    pub particles: Vec<NamedValues>,
    /// Named values of the tets.
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
    /// Borrows name and values as a [`Field`].
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

impl NamedValues {
    /// The values of some elements.
    fn picked(&self, numbers: &[usize]) -> Self {
        let values = match &self.values {
            OwnedValues::Scalars(all) => {
                OwnedValues::Scalars(numbers.iter().map(|&i| all[i]).collect())
            }
            OwnedValues::Vectors(all) => {
                OwnedValues::Vectors(numbers.iter().map(|&i| all[i]).collect())
            }
        };
        Self {
            name: self.name.clone(),
            values,
        }
    }
}

impl MeshFile {
    /// True if the file has neither regions nor values.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        self.regions.is_empty() && self.particles.is_empty() && self.tets.is_empty()
    }

    /// Selects and reorders regions and values after a repair of the mesh.
    ///
    /// # Panics
    /// If the repair was that of another mesh.
    #[must_use]
    pub fn repaired(&self, repaired: Repaired) -> Self {
        let Repaired {
            mesh,
            particles,
            tets,
            ..
        } = repaired;
        let tet_numbers: Vec<usize> = tets.iter().map(|tet| tet.index()).collect();
        let particle_numbers: Vec<usize> = particles.iter().map(|p| p.index()).collect();
        let regions = match self.regions.is_empty() {
            true => Vec::new(),
            false => tet_numbers.iter().map(|&tet| self.regions[tet]).collect(),
        };
        let of = |all: &[NamedValues], numbers: &[usize]| {
            all.iter().map(|values| values.picked(numbers)).collect()
        };
        Self {
            mesh,
            regions,
            particles: of(&self.particles, &particle_numbers),
            tets: of(&self.tets, &tet_numbers),
        }
    }

    /// Checks that regions and values have the right number.
    ///
    /// # Errors
    /// [`MeshIoError::FieldLength`] with the first field whose length is not the number of
    /// elements.
    pub fn check(&self) -> Result<(), MeshIoError> {
        let (particles, tets) = (self.mesh.positions.len(), self.mesh.tets.len());
        if !self.regions.is_empty() && self.regions.len() != tets {
            return Err(MeshIoError::FieldLength {
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

#[cfg(test)]
mod tests {
    use super::*;
    use incise_mesh::{ParticleId, RepairOptions, kuhn_box, repair};

    #[test]
    fn regions_and_values_are_repaired_with_the_mesh() {
        let mut file = MeshFile::from(kuhn_box([2, 1, 1], DVec3::ONE));
        file.mesh.positions.insert(0, DVec3::splat(7.0));
        for p in file.mesh.tets.as_flattened_mut() {
            *p = ParticleId(p.0 + 1);
        }
        file.mesh.tets.insert(3, [ParticleId(1); 4]);
        let count = |n: usize| (0..n).map(|i| i as f64).collect::<Vec<_>>();
        let (particles, tets) = (file.mesh.positions.len(), file.mesh.tets.len());
        file.regions = (0..13).collect();
        file.particles.push(NamedValues {
            name: "number".to_owned(),
            values: OwnedValues::Scalars(count(particles)),
        });
        file.tets.push(NamedValues {
            name: "place".to_owned(),
            values: OwnedValues::Vectors(vec![DVec3::X; tets]),
        });
        assert!(file.check().is_ok());
        let mended = file.repaired(repair(&file.mesh, &RepairOptions::ALL));
        assert!(mended.check().is_ok());
        assert_eq!(mended.regions, [0, 1, 2, 4, 5, 6, 7, 8, 9, 10, 11, 12]);
        assert_eq!(
            mended.particles[0].values,
            OwnedValues::Scalars(count(particles)[1..].to_vec())
        );
        assert_eq!(mended.mesh, kuhn_box([2, 1, 1], DVec3::ONE));
    }
}
