//! Entities, nodes and elements of MSH version 4.1.
//!
//! Nodes and elements are in blocks that belong to a geometric entity (dimension and number); physical groups are those
//! of the entities. In partitioned meshes the entities are parts of others. Linear.

use glam::DVec3;

use super::content::{Content, Tet, Volume};
use super::source::Source;
use crate::MeshIoError;

/// Section `$Entities`, or `$PartitionedEntities` if `partitioned`, after its name.
pub(super) fn read_entities(
    source: &mut Source<'_>,
    content: &mut Content,
    partitioned: bool,
) -> Result<(), MeshIoError> {
    if partitioned {
        source.count("the number of partitions")?;
        let ghosts = source.count("the number of ghost entities")?;
        for _ in 0..ghosts {
            source.int("a ghost entity")?;
            source.int("a partition")?;
        }
    }
    let mut counts = [0; 4];
    for count in &mut counts {
        *count = source.count("the number of entities")?;
    }
    for (dimension, count) in counts.into_iter().enumerate() {
        for _ in 0..count {
            let tag = source.int("the number of an entity")?;
            let mut whole = tag;
            if partitioned {
                source.int("the dimension of an entity")?;
                whole = source.int("the number of an entity")?;
                let partitions = source.count("the number of partitions")?;
                for _ in 0..partitions {
                    source.int("a partition")?;
                }
            }
            let corners = if dimension == 0 { 3 } else { 6 };
            for _ in 0..corners {
                source.double("the extent of an entity")?;
            }
            let groups = source.count("the number of physical groups")?;
            let mut physical = 0;
            for i in 0..groups {
                let group = source.int("a physical group")?;
                if i == 0 {
                    physical = group;
                }
            }
            if dimension > 0 {
                let bounds = source.count("the number of bounding entities")?;
                for _ in 0..bounds {
                    source.int("a bounding entity")?;
                }
            }
            if dimension == 3 {
                content.volumes.push(Volume {
                    tag,
                    whole,
                    physical,
                });
            }
        }
    }
    Ok(())
}

/// Section `$Nodes`, after its name.
pub(super) fn read_nodes(
    source: &mut Source<'_>,
    content: &mut Content,
) -> Result<(), MeshIoError> {
    let (blocks, count) = read_counts(source, "nodes")?;
    content.nodes.reserve(source.room_for(count, 8));
    content.positions.reserve(source.room_for(count, 8));
    let mut left = count;
    for _ in 0..blocks {
        let dimension = source.int("the dimension of an entity")?;
        let offset = source.offset();
        source.int("the number of an entity")?;
        let parametric = source.int("whether the nodes have parameters")?;
        let parameters = match (parametric, dimension) {
            (0, _) => 0,
            (_, 0..=3) => dimension,
            _ => {
                let message = format!("{dimension} is not a dimension: 0 to 3 expected");
                return Err(source.error_at(offset, message));
            }
        };
        let nodes = read_block(source, &mut left, "nodes")?;
        for _ in 0..nodes {
            content.nodes.push(source.long_tag("the number of a node")?);
        }
        for _ in 0..nodes {
            let position = [
                source.coordinate()?,
                source.coordinate()?,
                source.coordinate()?,
            ];
            content.positions.push(DVec3::from(position));
            for _ in 0..parameters {
                source.double("a parameter of a node")?;
            }
        }
    }
    check_complete(source, left, "nodes")
}

/// Section `$Elements`, after its name.
pub(super) fn read_elements(
    source: &mut Source<'_>,
    content: &mut Content,
) -> Result<(), MeshIoError> {
    let (blocks, count) = read_counts(source, "elements")?;
    content.tets.reserve(source.room_for(count, 10));
    let mut left = count;
    for _ in 0..blocks {
        source.int("the dimension of an entity")?;
        let entity = source.int("the number of an entity")?;
        let skip = Content::nodes_to_skip(source)?;
        let elements = read_block(source, &mut left, "elements")?;
        for _ in 0..elements {
            let tag = source.long_tag("the number of an element")?;
            let offset = source.offset();
            content.elements += 1;
            if let Some(nodes) = skip {
                for _ in 0..nodes {
                    source.long_tag("a node of an element")?;
                }
                continue;
            }
            let mut corners = [0; 4];
            for corner in &mut corners {
                *corner = source.long_tag("a node of an element")?;
            }
            content.tets.push(Tet {
                tag,
                corners,
                entity,
                physical: 0,
                offset,
            });
        }
    }
    check_complete(source, left, "elements")
}

/// The head of a section: the numbers of blocks and of items. The smallest and largest number of an item are redundant.
fn read_counts(source: &mut Source<'_>, what: &str) -> Result<(usize, usize), MeshIoError> {
    let blocks = source.count("the number of blocks")?;
    let count = source.count(&format!("the number of {what}"))?;
    source.long_tag("the least number")?;
    source.long_tag("the largest number")?;
    Ok((blocks, count))
}

/// The number of items of a block, subtracted from `left`.
fn read_block(source: &mut Source<'_>, left: &mut usize, what: &str) -> Result<usize, MeshIoError> {
    let count = source.count(&format!("the number of {what} of a block"))?;
    match left.checked_sub(count) {
        Some(rest) => *left = rest,
        None => {
            return Err(source.error(format!(
                "{left} more {what} are announced but {count} follow, correct the counts of the section"
            )));
        }
    }
    Ok(count)
}

fn check_complete(source: &Source<'_>, left: usize, what: &str) -> Result<(), MeshIoError> {
    if left == 0 {
        return Ok(());
    }
    Err(source.error(format!(
        "the section ends but {left} more {what} are announced, correct its counts"
    )))
}
