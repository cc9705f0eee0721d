//! Writing MSH files of versions 2.2 and 4.1, text and binary.
//!
//! Each region is a physical group with an entity, numbered from 1 in ascending order of the regions. Tets keep their
//! order: in version 4.1, where elements are in blocks of one entity, each run of tets of one region is a block.
//! Numbers in a text are the shortest that keep every bit. Cost: O(n log n).
//!
//! Source: the Gmsh reference manual, sections "MSH file format" and "MSH file format version 2".

use std::io::{self, Write};
use std::path::Path;

use glam::DVec3;
use incise_mesh::{Bounds, TetMesh};

use crate::{Field, MeshFile, MeshIoError, NamedValues, Values, write_atomically};

/// The kinds of Gmsh files that can be written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MshKind {
    /// Version 4.1 as text, Gmsh's default.
    #[default]
    Text41,
    /// Version 4.1, binary. Larger than text for coordinates of few digits, since numbers have 8 bytes.
    Binary41,
    /// Version 2.2 as text, for older programs.
    Text22,
    /// Version 2.2, binary.
    Binary22,
}

impl MshKind {
    const fn is_binary(self) -> bool {
        matches!(self, Self::Binary41 | Self::Binary22)
    }

    const fn is_41(self) -> bool {
        matches!(self, Self::Binary41 | Self::Text41)
    }
}

/// Writes a Gmsh file with regions as physical groups and fields as data of nodes and elements. Nodes and elements are
/// numbered from 1.
///
/// Group 0 means no group in Gmsh: a tet of region 0 is written without a group if other tets have one, and with entity
/// 0 instead of 1 otherwise, so that reading gives equal regions. Every bit is kept, except for the payload of NaN in a
/// text.
///
/// # Errors
/// [`MeshIoError::FieldLength`] for values or regions of the wrong number, [`MeshIoError::Io`] if the file cannot be
/// written or its format does not support the content: a field whose name has a line end, more than 2³¹ - 1 elements in
/// version 2.2.
///
/// # Example
/// ```
/// use incise_mesh_io::{MeshFile, MshKind, read_msh, write_msh};
/// use incise_mesh::{glam::DVec3, kuhn_box};
///
/// let path = std::env::temp_dir().join(format!("incise-doc-{}.msh", std::process::id()));
/// let mut file = MeshFile::from(kuhn_box([2, 2, 2], DVec3::splat(0.1)));
/// file.regions = (0..file.mesh.tets.len()).map(|t| if t < 24 { 7 } else { 9 }).collect();
/// write_msh(&path, &file, MshKind::Binary41)?;
/// assert_eq!(read_msh(&path)?, file);
/// # std::fs::remove_file(path).ok();
/// # Ok::<(), incise_mesh_io::MeshIoError>(())
/// ```
pub fn write_msh(
    path: impl AsRef<Path>,
    file: &MeshFile,
    kind: MshKind,
) -> Result<(), MeshIoError> {
    file.check()?;
    write_atomically(path, |out| write_content(out, file, kind))
}

/// Writes the content; all lengths must have been checked.
pub(super) fn write_content(out: &mut dyn Write, file: &MeshFile, kind: MshKind) -> io::Result<()> {
    let mut sink = Sink {
        out,
        binary: kind.is_binary(),
        in_line: false,
    };
    let version = if kind.is_41() { "4.1" } else { "2.2" };
    sink.line(&format!(
        "$MeshFormat\n{version} {} 8",
        u8::from(sink.binary)
    ))?;
    if sink.binary {
        sink.int(1)?;
        sink.line("")?;
    }
    sink.line("$EndMeshFormat")?;

    let regions = Regions::new(file);
    if kind.is_41() {
        write_entities(&mut sink, &file.mesh, &regions)?;
        write_nodes_41(&mut sink, &file.mesh, &regions)?;
        write_elements_41(&mut sink, &file.mesh, &regions)?;
    } else {
        write_nodes_22(&mut sink, &file.mesh)?;
        write_elements_22(&mut sink, &file.mesh, &regions)?;
    }
    for values in &file.particles {
        write_data(&mut sink, "NodeData", values)?;
    }
    for values in &file.tets {
        write_data(&mut sink, "ElementData", values)?;
    }
    Ok(())
}

/// The entities and physical groups of the regions.
struct Regions {
    /// The physical group of each entity, 0 for none.
    groups: Vec<i32>,
    /// The index of the entity of each tet.
    entities: Vec<usize>,
    /// The number of the first entity.
    first: i32,
}

impl Regions {
    fn new(file: &MeshFile) -> Self {
        let mut groups = file.regions.clone();
        groups.sort_unstable();
        groups.dedup();
        let entities = if groups.is_empty() {
            vec![0; file.mesh.tets.len()]
        } else {
            let index = |region| groups.partition_point(|&group| group < region);
            file.regions.iter().map(|&region| index(region)).collect()
        };
        let first = i32::from(groups != [0]);
        if groups.is_empty() {
            groups.push(0);
        }
        Self {
            groups,
            entities,
            first,
        }
    }

    fn number(&self, entity: usize) -> io::Result<i32> {
        Ok(self.first + short(entity)?)
    }
}

fn write_entities(sink: &mut Sink<'_>, mesh: &TetMesh, regions: &Regions) -> io::Result<()> {
    let mut boxes = vec![Bounds::EMPTY; regions.groups.len()];
    for (tet, &entity) in mesh.tets.iter().zip(&regions.entities) {
        let tet = Bounds::around(tet.iter().map(|corner| mesh.positions[corner.index()]));
        boxes[entity] = boxes[entity].union(tet);
    }
    sink.line("$Entities")?;
    for count in [0, 0, 0, regions.groups.len()] {
        sink.size(count)?;
    }
    sink.end()?;
    for (entity, &Bounds { low, high }) in boxes.iter().enumerate() {
        sink.int(regions.number(entity)?)?;
        for corner in [low, high] {
            // Without tets the bounding box is empty.
            sink.vector(if low.x <= high.x { corner } else { DVec3::ZERO })?;
        }
        let group = regions.groups[entity];
        sink.size(usize::from(group != 0))?;
        if group != 0 {
            sink.int(group)?;
        }
        sink.size(0)?;
        sink.end()?;
    }
    sink.finish("$EndEntities")
}

fn write_nodes_41(sink: &mut Sink<'_>, mesh: &TetMesh, regions: &Regions) -> io::Result<()> {
    let count = mesh.positions.len();
    sink.line("$Nodes")?;
    for number in [1, count, 1, count] {
        sink.size(number)?;
    }
    sink.end()?;
    for number in [3, regions.first, 0] {
        sink.int(number)?;
    }
    sink.size(count)?;
    sink.end()?;
    for node in 1..=count {
        sink.size(node)?;
        sink.end()?;
    }
    for &position in &mesh.positions {
        sink.vector(position)?;
        sink.end()?;
    }
    sink.finish("$EndNodes")
}

fn write_elements_41(sink: &mut Sink<'_>, mesh: &TetMesh, regions: &Regions) -> io::Result<()> {
    let count = mesh.tets.len();
    let runs = || regions.entities.chunk_by(|a, b| a == b);
    sink.line("$Elements")?;
    for number in [runs().count(), count, 1, count] {
        sink.size(number)?;
    }
    sink.end()?;
    let mut tets = mesh.tets.iter().enumerate();
    for run in runs() {
        for number in [3, regions.number(run[0])?, 4] {
            sink.int(number)?;
        }
        sink.size(run.len())?;
        sink.end()?;
        for (t, tet) in tets.by_ref().take(run.len()) {
            sink.size(t + 1)?;
            for corner in tet {
                sink.size(corner.index() + 1)?;
            }
            sink.end()?;
        }
    }
    sink.finish("$EndElements")
}

fn write_nodes_22(sink: &mut Sink<'_>, mesh: &TetMesh) -> io::Result<()> {
    sink.line(&format!("$Nodes\n{}", mesh.positions.len()))?;
    for (node, &position) in mesh.positions.iter().enumerate() {
        sink.int(short(node + 1)?)?;
        sink.vector(position)?;
        sink.end()?;
    }
    sink.finish("$EndNodes")
}

fn write_elements_22(sink: &mut Sink<'_>, mesh: &TetMesh, regions: &Regions) -> io::Result<()> {
    let count = mesh.tets.len();
    sink.line(&format!("$Elements\n{count}"))?;
    // In a binary file the type and the number of tags precede all elements.
    if sink.binary && count > 0 {
        for number in [4, short(count)?, 2] {
            sink.int(number)?;
        }
    }
    for (t, (tet, &entity)) in mesh.tets.iter().zip(&regions.entities).enumerate() {
        sink.int(short(t + 1)?)?;
        if !sink.binary {
            sink.int(4)?;
            sink.int(2)?;
        }
        sink.int(regions.groups[entity])?;
        sink.int(regions.number(entity)?)?;
        for corner in tet {
            sink.int(short(corner.index() + 1)?)?;
        }
        sink.end()?;
    }
    sink.finish("$EndElements")
}

fn write_data(sink: &mut Sink<'_>, section: &str, values: &NamedValues) -> io::Result<()> {
    let Field { name, values } = values.as_field();
    if name.contains(['\n', '\r']) {
        return Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            format!("the name of the field {name:?} has a line end, rename it"),
        ));
    }
    let (components, count) = match values {
        Values::Scalars(values) => (1, values.len()),
        Values::Vectors(values) => (3, values.len()),
    };
    // One name, one time, three whole numbers: time step, components, values.
    sink.line(&format!(
        "${section}\n1\n\"{name}\"\n1\n0.0\n3\n0\n{components}\n{count}"
    ))?;
    for i in 0..count {
        sink.int(short(i + 1)?)?;
        match values {
            Values::Scalars(values) => sink.double(values[i])?,
            Values::Vectors(values) => sink.vector(values[i])?,
        }
        sink.end()?;
    }
    sink.finish(&format!("$End{section}"))
}

/// A number as an offset of 32 bits.
fn short(number: usize) -> io::Result<i32> {
    i32::try_from(number).map_err(|_| {
        io::Error::new(
            io::ErrorKind::InvalidInput,
            format!("the number {number} does not fit in the 32 bits it has in the file"),
        )
    })
}

/// Numbers as words or bytes.
struct Sink<'a> {
    out: &'a mut dyn Write,
    binary: bool,
    /// True if the line already has a word.
    in_line: bool,
}

impl Sink<'_> {
    /// Writes words on a line of their own, in binary files too.
    fn line(&mut self, text: &str) -> io::Result<()> {
        writeln!(self.out, "{text}")
    }

    fn separate(&mut self) -> io::Result<()> {
        if self.in_line {
            write!(self.out, " ")?;
        }
        self.in_line = true;
        Ok(())
    }

    fn int(&mut self, number: i32) -> io::Result<()> {
        if self.binary {
            return self.out.write_all(&number.to_le_bytes());
        }
        self.separate()?;
        write!(self.out, "{number}")
    }

    fn size(&mut self, number: usize) -> io::Result<()> {
        if self.binary {
            return self.out.write_all(&(number as u64).to_le_bytes());
        }
        self.separate()?;
        write!(self.out, "{number}")
    }

    fn double(&mut self, number: f64) -> io::Result<()> {
        if self.binary {
            return self.out.write_all(&number.to_le_bytes());
        }
        self.separate()?;
        write!(self.out, "{number:?}")
    }

    fn vector(&mut self, vector: DVec3) -> io::Result<()> {
        vector
            .to_array()
            .into_iter()
            .try_for_each(|c| self.double(c))
    }

    /// Ends the line of a text.
    fn end(&mut self) -> io::Result<()> {
        if self.binary {
            return Ok(());
        }
        self.in_line = false;
        writeln!(self.out)
    }

    /// Ends a section.
    fn finish(&mut self, end: &str) -> io::Result<()> {
        if self.binary {
            writeln!(self.out)?;
        }
        self.line(end)
    }
}
