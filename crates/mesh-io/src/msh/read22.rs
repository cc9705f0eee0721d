//! Nodes and elements of MSH versions 1 and 2.
//!
//! Version 1 is a text: `$NOD` and `$ELM`, each element with its physical group, its entity and the number of its
//! nodes. Version 2 has a list of tags for each element, of which the first is the physical group and the second the
//! entity; in binary files elements are in batches of one type. Gmsh may write `$ParametricNodes` instead of `$Nodes`,
//! which the manual does not mention. Linear.

use glam::DVec3;

use super::content::{Content, Tet};
use super::source::{Encoding, Source};
use crate::MeshIoError;

/// Section `$Nodes` or `$NOD`, or `$ParametricNodes` if `parametric`, after its name.
pub(super) fn read_nodes(
    source: &mut Source<'_>,
    content: &mut Content,
    parametric: bool,
) -> Result<(), MeshIoError> {
    let count: usize = source.number("the number of nodes")?;
    source.line();
    content.nodes.reserve(source.room_for(count, 8));
    content.positions.reserve(source.room_for(count, 8));
    for _ in 0..count {
        content
            .nodes
            .push(source.short_tag("the number of a node")?);
        let position = [
            source.coordinate()?,
            source.coordinate()?,
            source.coordinate()?,
        ];
        content.positions.push(DVec3::from(position));
        if parametric {
            // Nodes on lines and surfaces are followed by their parameters.
            let dimension = source.int("the dimension of an entity")?;
            source.int("the number of an entity")?;
            let parameters = if dimension == 3 { 0 } else { dimension };
            for _ in 0..parameters {
                source.double("a parameter of a node")?;
            }
        }
    }
    Ok(())
}

/// Section `$ELM`, after its name.
pub(super) fn read_elements_1(
    source: &mut Source<'_>,
    content: &mut Content,
) -> Result<(), MeshIoError> {
    let count: usize = source.number("the number of elements")?;
    content.tets.reserve(source.room_for(count, 18));
    for _ in 0..count {
        let tag = source.short_tag("the number of an element")?;
        let offset = source.offset();
        let skip = Content::nodes_to_skip(source)?;
        let physical = source.int("a physical group")?;
        let entity = source.int("an entity")?;
        let nodes: usize = source.number("the number of nodes of an element")?;
        if nodes != skip.unwrap_or(4) {
            return Err(source.error(format!(
                "element {tag} has {nodes} nodes instead of {}, correct it",
                skip.unwrap_or(4)
            )));
        }
        read_corners(source, content, skip, |corners| Tet {
            tag,
            corners,
            entity,
            physical,
            offset,
        })?;
    }
    Ok(())
}

/// Section `$Elements`, after its name.
pub(super) fn read_elements_2(
    source: &mut Source<'_>,
    content: &mut Content,
) -> Result<(), MeshIoError> {
    let count: usize = source.number("the number of elements")?;
    source.line();
    content.tets.reserve(source.room_for(count, 14));
    let mut left = count;
    while left > 0 {
        if source.encoding == Encoding::Text {
            let tag = source.short_tag("the number of an element")?;
            let offset = source.offset();
            let skip = Content::nodes_to_skip(source)?;
            let tags = source.int("the number of tags")?;
            read_element_2(source, content, skip, tags, (tag, offset))?;
            left -= 1;
            continue;
        }
        let skip = Content::nodes_to_skip(source)?;
        let batch = source.int("the number of elements of a type")?;
        let batch = usize::try_from(batch).unwrap_or(0);
        if batch == 0 || batch > left {
            return Err(source.error(format!(
                "{left} more elements are announced but {batch} follow, correct the section $Elements"
            )));
        }
        let tags = source.int("the number of tags")?;
        for _ in 0..batch {
            let tag = source.short_tag("the number of an element")?;
            let offset = source.offset();
            read_element_2(source, content, skip, tags, (tag, offset))?;
        }
        left -= batch;
    }
    Ok(())
}

/// The tags and nodes of an element.
fn read_element_2(
    source: &mut Source<'_>,
    content: &mut Content,
    skip: Option<usize>,
    tags: i32,
    (tag, offset): (u64, usize),
) -> Result<(), MeshIoError> {
    // An element without tags belongs to entity 1 and no group.
    let (mut physical, mut entity) = (0, 1);
    for i in 0..tags {
        let value = source.int("a tag")?;
        match i {
            0 => physical = value,
            1 => entity = value,
            _ => {}
        }
    }
    read_corners(source, content, skip, |corners| Tet {
        tag,
        corners,
        entity,
        physical,
        offset,
    })
}

fn read_corners(
    source: &mut Source<'_>,
    content: &mut Content,
    skip: Option<usize>,
    tet: impl FnOnce([u64; 4]) -> Tet,
) -> Result<(), MeshIoError> {
    let mut corners = [0; 4];
    if let Some(nodes) = skip {
        for _ in 0..nodes {
            source.short_tag("a node of an element")?;
        }
    } else {
        for corner in &mut corners {
            *corner = source.short_tag("a node of an element")?;
        }
        content.tets.push(tet(corners));
    }
    content.elements += 1;
    Ok(())
}
