//! Small files that are written here, by hand or by the writer, and what the tests share.

mod broken;
mod by_hand;
mod random;

use std::path::Path;

use glam::{DVec3, dvec3};
use incise_mesh::{ParticleId, kuhn_box};

use super::parse_msh;
use super::write::{MshKind, write_content};
use crate::{MeshFile, MeshIoError, NamedValues, OwnedValues};

const KINDS: [MshKind; 4] = [
    MshKind::Text41,
    MshKind::Binary41,
    MshKind::Text22,
    MshKind::Binary22,
];

fn parse(bytes: impl AsRef<[u8]>) -> Result<MeshFile, MeshIoError> {
    parse_msh(bytes.as_ref(), Path::new("a.msh"))
}

fn written(file: &MeshFile, kind: MshKind) -> Vec<u8> {
    let mut bytes = Vec::new();
    write_content(&mut bytes, file, kind).unwrap();
    bytes
}

/// A box with a particle that no tet uses, two regions that alternate, and all kinds of fields.
fn example() -> MeshFile {
    let mut file = MeshFile::from(kuhn_box([1, 1, 1], dvec3(0.1, 0.7, 1.3)));
    file.mesh.positions.push(dvec3(5.0, -0.0, 5e-324));
    let (particles, tets) = (file.mesh.positions.len(), file.mesh.tets.len());
    file.regions = (0..tets).map(|t| [3, -8][t % 2]).collect();
    let named = |name: &str, values| NamedValues {
        name: name.to_owned(),
        values,
    };
    let scalars = |n: usize| OwnedValues::Scalars((0..n).map(|i| 0.1 * i as f64).collect());
    let vectors =
        |n: usize| OwnedValues::Vectors((0..n).map(|i| DVec3::splat(i as f64 / 3.0)).collect());
    file.particles = vec![
        named("heat", scalars(particles)),
        named("a \"quoted\" v", vectors(particles)),
    ];
    file.tets = vec![named("", scalars(tets)), named("stress", vectors(tets))];
    file
}

/// One tet and a triangle in version 2.2, with numbers that have gaps and no order.
const TEXT_22: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat
$PhysicalNames\n1\n3 7 \"tissue\"\n$EndPhysicalNames
$Nodes\n5\n40 0 0 0\n3 1 0 0\n1000000000000 0 1 0\n7 0 0 1\n8 9 9 9\n$EndNodes
$Elements\n2\n12 2 2 1 5 40 3 7\n99 4 4 7 2 1 1 40 3 1000000000000 7\n$EndElements
$ElementData\n1\n\"young\"\n1\n0.0\n3\n0\n1\n2\n12 1.5\n99 2.5\n$EndElementData
$NodeData\n2\n\"u v\"\n\"scheme\"\n1\n0.5\n4\n0\n3\n1\n0\n7 1 2 3\n$EndNodeData
$NodeData\n1\n\"tensor\"\n0\n3\n0\n9\n1\n7 1 2 3 4 5 6 7 8 9\n$EndNodeData
$ElementData\n1\n\"of triangles\"\n0\n3\n0\n1\n1\n12 1\n$EndElementData\n";

const TEXT_41: &str = "$MeshFormat\n4.1 0 8\n$EndMeshFormat
$Entities\n1 1 1 2\n4 0 0 0 1 9\n1 0 0 0 1 1 1 0 2 4 -4\n1 0 0 0 1 1 1 0 1 1
2 0 0 0 1 1 1 2 7 8 1 1\n5 0 0 0 1 1 1 0 0\n$EndEntities
$Nodes\n3 5 3 44\n2 1 1 2\n44\n3\n0 0 0 0.5 0.5\n1 0 0 0.5 0.5\n3 2 0 3\n9\n7\n8\n0 1 0\n0 0 1\n9 9 9\n0 1 0 0\n$EndNodes
$Elements\n3 3 1 9\n2 1 2 1\n1 44 3 9\n3 2 4 1\n9 44 3 9 7\n3 5 4 1\n4 44 3 9 8\n$EndElements\n";

const TEXT_1: &str = "$NOD\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n9 0 0 1\n$ENDNOD
$ELM\n2\n1 2 1 1 3 1 2 3\n2 4 6 3 4 1 2 3 9\n$ENDELM\n";

fn corners(tet: [u32; 4]) -> [ParticleId; 4] {
    tet.map(ParticleId)
}
