//! Gmsh files (`.msh`), text and binary.
//!
//! Versions 1 (`$NOD` and `$ELM`, text), 2.0 to 2.2 and 4.1 are read; the rare versions 3 and 4.0 are an error. A file
//! is a sequence of sections `$Name` to `$EndName`; unknown ones are skipped. Tets are read and elements of lower
//! dimension skipped; other volume elements are an error.
//!
//! Regions are the physical groups of the tets (0 for a tet without one; the first one of several), or, if no tet has
//! one, the elementary entities. A single entity 1 without a group is Gmsh's default and not a region. The names of
//! groups (`$PhysicalNames`) are dropped: no other format stores them.
//!
//! `$NodeData` and `$ElementData` with 1 or 3 components are fields, one for each time step. Elements without a value
//! have NaN; a file that needs more than eight times its size for them is an error. Orientation is kept. Cost: O(n log
//! n), because the numbers of nodes may have gaps and be in any order.
//!
//! Source: the Gmsh reference manual, sections "MSH file format", "MSH file format version 2" and "version 1" (Geuzaine
//! and Remacle).

mod content;
mod data;
mod elements;
mod read22;
mod read41;
mod source;
#[cfg(test)]
mod tests;
mod write;

pub use write::{MshKind, write_msh};

use std::path::Path;

use self::content::Content;
use self::source::{Encoding, Source};
use crate::text::{load, show};
use crate::{MeshFile, MeshIoError};

/// Reads the tets of a Gmsh file, versions 1, 2 and 4.1, text or binary, with regions and fields.
///
/// # Errors
/// The errors of [`read`](crate::read); [`MeshIoError::ParseBytes`] for errors in a binary file.
pub fn read_msh(path: impl AsRef<Path>) -> Result<MeshFile, MeshIoError> {
    let path = path.as_ref();
    parse_msh(&load(path)?, path)
}

/// The supported versions.
#[derive(Clone, Copy, PartialEq)]
enum Version {
    V1,
    V2,
    V41,
}

/// Parses the content of a file; the path is used in errors.
pub(crate) fn parse_msh(bytes: &[u8], path: &Path) -> Result<MeshFile, MeshIoError> {
    let mut source = Source::new(path, bytes);
    let source = &mut source;
    let mut version = None;
    let mut content = Content::default();
    let (mut nodes, mut elements) = (false, false);
    while source.skip_blanks() {
        let name = source.word("a section")?;
        let Some(name) = name.strip_prefix(b"$") else {
            let message = format!("a section ($Name) expected but {:?} found", show(name));
            return Err(source.error(message));
        };
        let offset = source.offset();
        source.line();
        let needs = |wanted: Option<Version>| {
            wanted.ok_or_else(|| {
                let message = format!(
                    "section ${} stands before $MeshFormat: no file of Gmsh",
                    show(name)
                );
                source.error_at(offset, message)
            })
        };
        match name {
            b"MeshFormat" => version = Some(read_format(source)?),
            b"NOD" => {
                version = Some(Version::V1);
                nodes = true;
                read22::read_nodes(source, &mut content, false)?;
            }
            b"ELM" => {
                version = Some(Version::V1);
                elements = true;
                read22::read_elements_1(source, &mut content)?;
            }
            b"Nodes" => {
                nodes = true;
                match needs(version)? {
                    Version::V41 => read41::read_nodes(source, &mut content)?,
                    _ => read22::read_nodes(source, &mut content, false)?,
                }
            }
            b"ParametricNodes" if version == Some(Version::V2) => {
                nodes = true;
                read22::read_nodes(source, &mut content, true)?;
            }
            b"Elements" => {
                elements = true;
                match needs(version)? {
                    Version::V41 => read41::read_elements(source, &mut content)?,
                    _ => read22::read_elements_2(source, &mut content)?,
                }
            }
            b"Entities" if version == Some(Version::V41) => {
                read41::read_entities(source, &mut content, false)?;
            }
            b"PartitionedEntities" if version == Some(Version::V41) => {
                read41::read_entities(source, &mut content, true)?;
            }
            b"NodeData" => data::read_data(source, &mut content, true)?,
            b"ElementData" => data::read_data(source, &mut content, false)?,
            _ => {
                source.skip_past(&[b"$End", name].concat())?;
                continue;
            }
        }
        let name = show(name);
        if version == Some(Version::V1) && name.chars().all(|c| c.is_ascii_uppercase()) {
            source.expect(&format!("$END{name}"))?;
        } else {
            source.expect(&format!("$End{name}"))?;
        }
    }
    if !nodes {
        return Err(source.ends_early("a section $Nodes"));
    }
    if !elements {
        return Err(source.ends_early("a section $Elements"));
    }
    content.finish(source)
}

/// Section `$MeshFormat`, after its name.
fn read_format(source: &mut Source<'_>) -> Result<Version, MeshIoError> {
    let word = source.word("the version")?;
    let version = match word {
        b"2" | b"2.0" | b"2.1" | b"2.2" => Version::V2,
        b"4.1" => Version::V41,
        _ => {
            // Gmsh writes 4.0 as 4.
            let name = if word == b"4" { b"4.0" } else { word };
            return Err(source.error(format!(
                "MSH version {} is not read: save the mesh as version 4.1 or 2.2",
                show(name)
            )));
        }
    };
    let kind: i32 = source.number("the file type")?;
    if kind != 0 && kind != 1 {
        return Err(source.error(format!(
            "the file type is {kind}: 0 (text) or 1 (binary) expected"
        )));
    }
    let size: usize = source.number("the data size")?;
    let sound = size == 8 || (size == 4 && version == Version::V41);
    if kind == 1 && !sound {
        return Err(source.error(format!("binary files of data size {size} are not read")));
    }
    source.line();
    if kind == 1 {
        source.size_bytes = size;
        source.encoding = Encoding::Little;
        let one = source.int("the number 1")?;
        if one == 1_i32.swap_bytes() {
            source.encoding = Encoding::Big;
        } else if one != 1 {
            return Err(source.error("the number 1, which tells the order of bytes, is missing"));
        }
    }
    Ok(version)
}
