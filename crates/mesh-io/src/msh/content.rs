//! The content of an MSH file with the numbers of the file, and its conversion to a mesh.
//!
//! Nodes and elements have arbitrary numbers in any order, and sections may come in any order, too. All are kept until
//! the end; then the numbers are sorted once and looked up. Cost: O(n log n).

use glam::DVec3;
use incise_mesh::{ParticleId, TetMesh};

use super::elements::{Kind, kind_of};
use super::source::Source;
use crate::{MeshFile, MeshIoError, NamedValues, OwnedValues};

/// The sections read so far.
#[derive(Default)]
pub(super) struct Content {
    /// The number of each node.
    pub(super) nodes: Vec<u64>,
    pub(super) positions: Vec<DVec3>,
    /// The number of elements of all types.
    pub(super) elements: usize,
    pub(super) tets: Vec<Tet>,
    /// The volumes of version 4.1.
    pub(super) volumes: Vec<Volume>,
    pub(super) data: Vec<Data>,
}

/// A tet with the file's numbers.
pub(super) struct Tet {
    pub(super) tag: u64,
    pub(super) corners: [u64; 4],
    /// The elementary entity.
    pub(super) entity: i32,
    /// The physical group, 0 for none.
    pub(super) physical: i32,
    pub(super) offset: usize,
}

/// A volume of section `$Entities` or `$PartitionedEntities`.
pub(super) struct Volume {
    pub(super) tag: i32,
    /// The volume of which it is a part, or itself.
    pub(super) whole: i32,
    /// The first physical group, 0 for none.
    pub(super) physical: i32,
}

/// A section `$NodeData` or `$ElementData`.
pub(super) struct Data {
    pub(super) name: String,
    pub(super) of_nodes: bool,
    pub(super) components: usize,
    /// The number of each node or element, and its position in the file.
    pub(super) tags: Vec<(u64, usize)>,
    pub(super) values: Vec<f64>,
}

impl Content {
    /// Reads an element type; returns the number of nodes to skip, `None` for a tet. Other volume elements are an
    /// error.
    pub(super) fn nodes_to_skip(source: &mut Source<'_>) -> Result<Option<usize>, MeshIoError> {
        let number = source.int("an element type")?;
        match kind_of(number) {
            Kind::Tet => Ok(None),
            Kind::Lower(nodes) => Ok(Some(nodes)),
            Kind::Volume(name) => Err(source.error(format!(
                "the file has an element of type {number}, a {name}: only tetrahedra with 4 nodes are read, mesh the \
                 volume with these alone"
            ))),
            Kind::Unknown => Err(source.error(format!(
                "the element type {number} is not known, mesh the volume with tetrahedra of 4 nodes (type 4)"
            ))),
        }
    }

    /// The mesh, its regions and its fields.
    pub(super) fn finish(mut self, source: &Source<'_>) -> Result<MeshFile, MeshIoError> {
        if self.elements == 0 {
            return Err(MeshIoError::Empty);
        }
        if self.tets.is_empty() {
            return Err(source.error(format!(
                "none of the {} elements is a tetrahedron (type 4), mesh the volume",
                self.elements
            )));
        }
        let nodes = Numbers::new(self.nodes.iter().copied());
        if let Some(tag) = nodes.repeated() {
            return Err(source.error(format!("two nodes have the number {tag}, renumber them")));
        }
        let mut tets = Vec::with_capacity(self.tets.len());
        for tet in &self.tets {
            let mut corners = [ParticleId(0); 4];
            for (corner, &tag) in corners.iter_mut().zip(&tet.corners) {
                *corner = ParticleId::new(nodes.index(tag).ok_or_else(|| {
                    let message = format!(
                        "element {} uses node {tag}, which does not exist, correct it",
                        tet.tag
                    );
                    source.error_at(tet.offset, message)
                })?);
            }
            tets.push(corners);
        }
        let regions = self.regions();

        let mut file = MeshFile {
            mesh: TetMesh {
                positions: self.positions,
                tets,
            },
            regions,
            ..MeshFile::default()
        };
        let elements = if self.data.iter().any(|data| !data.of_nodes) {
            Numbers::new(self.tets.iter().map(|tet| tet.tag))
        } else {
            Numbers::default()
        };
        if let Some(tag) = elements.repeated() {
            return Err(source.error(format!(
                "two tetrahedra have the number {tag}, so that its values belong to neither, renumber them"
            )));
        }
        // Data of a few elements become fields of all elements, so a file of many such sections would fill the memory.
        // One number is allowed for each byte of the file.
        let mut allowed = source.len();
        for data in self.data {
            let of_nodes = data.of_nodes;
            let numbers = if of_nodes { &nodes } else { &elements };
            let field = data.resolve(numbers, &mut allowed, source)?;
            if of_nodes {
                file.particles.extend(field);
            } else {
                file.tets.extend(field);
            }
        }
        Ok(file)
    }

    /// The physical groups if any tet has one, otherwise the entities, unless all are 1.
    fn regions(&mut self) -> Vec<i32> {
        // The sort is stable: of two volumes with one number the first is used.
        self.volumes.sort_by_key(|volume| volume.tag);
        self.volumes.dedup_by_key(|volume| volume.tag);
        for tet in &mut self.tets {
            let found = self.volumes.binary_search_by_key(&tet.entity, |v| v.tag);
            if let Ok(found) = found {
                tet.physical = self.volumes[found].physical;
                tet.entity = self.volumes[found].whole;
            }
        }
        if self.tets.iter().any(|tet| tet.physical != 0) {
            self.tets.iter().map(|tet| tet.physical).collect()
        } else if self.tets.iter().any(|tet| tet.entity != 1) {
            self.tets.iter().map(|tet| tet.entity).collect()
        } else {
            Vec::new()
        }
    }
}

impl Data {
    /// The values in the order of the mesh, NaN for missing ones; `None` without any value. The number of NaN is at
    /// most `allowed`, which is reduced by it.
    fn resolve(
        self,
        numbers: &Numbers,
        allowed: &mut usize,
        source: &Source<'_>,
    ) -> Result<Option<NamedValues>, MeshIoError> {
        let mut found = 0;
        for &(tag, offset) in &self.tags {
            match numbers.index(tag) {
                Some(_) => found += 1,
                None if self.of_nodes => {
                    let message = format!(
                        "the data {:?} has a value for node {tag}, which does not exist, correct it",
                        self.name
                    );
                    return Err(source.error_at(offset, message));
                }
                // An element of lower dimension that was skipped.
                None => {}
            }
        }
        if found == 0 {
            return Ok(None);
        }
        let count = numbers.0.len();
        let missing = count.saturating_sub(found) * self.components;
        *allowed = allowed.checked_sub(missing).ok_or_else(|| {
            source.error(format!(
                "the data {:?} and others have values for few of the nodes or elements, give one for each",
                self.name
            ))
        })?;
        let tags = self.tags.iter().map(|&(tag, _)| numbers.index(tag));
        let values = if self.components == 1 {
            let mut values = vec![f64::NAN; count];
            for (index, &value) in tags.zip(&self.values) {
                index.into_iter().for_each(|index| values[index] = value);
            }
            OwnedValues::Scalars(values)
        } else {
            let mut values = vec![DVec3::NAN; count];
            let (triples, _) = self.values.as_chunks::<3>();
            for (index, &value) in tags.zip(triples) {
                index
                    .into_iter()
                    .for_each(|index| values[index] = value.into());
            }
            OwnedValues::Vectors(values)
        };
        Ok(Some(NamedValues {
            name: self.name,
            values,
        }))
    }
}

/// The file's numbers of its nodes or elements, sorted, each with its index.
#[derive(Default)]
struct Numbers(Vec<(u64, usize)>);

impl Numbers {
    fn new(tags: impl Iterator<Item = u64>) -> Self {
        let mut sorted: Vec<_> = tags.enumerate().map(|(i, tag)| (tag, i)).collect();
        sorted.sort_unstable();
        Self(sorted)
    }

    fn repeated(&self) -> Option<u64> {
        let pair = self.0.windows(2).find(|pair| pair[0].0 == pair[1].0)?;
        Some(pair[0].0)
    }

    fn index(&self, tag: u64) -> Option<usize> {
        let offset = self.0.binary_search_by_key(&tag, |&(tag, _)| tag).ok()?;
        Some(self.0[offset].1)
    }
}
