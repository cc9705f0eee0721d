//! Files written by hand read to the meshes they stand for.

use glam::{DVec3, dvec3};

use super::{TEXT_1, TEXT_22, TEXT_41, corners, parse};
use crate::OwnedValues;
use crate::msh::elements;

#[test]
fn numbers_with_gaps_groups_and_data_of_version_2() {
    for text in [TEXT_22.to_owned(), TEXT_22.replace('\n', "\r\n")] {
        let file = parse(text).unwrap();
        assert_eq!(file.mesh.positions.len(), 5);
        assert_eq!(file.mesh.positions[2], DVec3::Y);
        assert_eq!(file.mesh.tets, [corners([0, 1, 2, 3])]);
        assert_eq!(file.regions, [7]);
        let [young] = &file.tets[..] else {
            panic!("{:?}", file.tets)
        };
        assert_eq!(young.name, "young");
        assert_eq!(young.values, OwnedValues::Scalars(vec![2.5]));
        let [u] = &file.particles[..] else {
            panic!("{:?}", file.particles)
        };
        assert_eq!(u.name, "u v");
        let OwnedValues::Vectors(values) = &u.values else {
            panic!("{u:?}")
        };
        assert_eq!(values[3], dvec3(1.0, 2.0, 3.0));
        assert!(values[0].is_nan() && values.len() == 5);
    }
}

#[test]
fn entities_and_parameters_of_version_41() {
    let file = parse(TEXT_41).unwrap();
    assert_eq!(
        file.mesh.positions,
        [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::splat(9.0)]
    );
    assert_eq!(
        file.mesh.tets,
        [corners([0, 1, 2, 3]), corners([0, 1, 2, 4])]
    );
    assert_eq!(file.regions, [7, 0]);
    // Without groups the entities count.
    let file = parse(TEXT_41.replace("1 2 7 8 1 1\n", "1 0 1 1\n")).unwrap();
    assert_eq!(file.regions, [2, 5]);
}

#[test]
fn partitions_of_version_41() {
    let parts = "$EndEntities\n$PartitionedEntities\n2\n1\n7 2\n0 0 0 2
5 3 1 1 1 0 0 0 1 1 1 1 33 0\n2 3 1 2 1 2 0 0 0 1 1 1 0 1 -4\n$EndPartitionedEntities";
    let head = TEXT_41.split_once("$Entities").unwrap().0;
    let rest = TEXT_41.split_once("$EndEntities").unwrap().1;
    let text = format!("{head}$Entities\n0 0 0 0\n{parts}{rest}");
    assert_eq!(parse(&text).unwrap().regions, [0, 33]);
    // Without groups the volume counts that the parts are of.
    let text = text
        .replace(" 1 33 0\n", " 0 0\n")
        .replace("3 1 1 1", "3 4 1 1");
    assert_eq!(parse(&text).unwrap().regions, [1, 4]);
}

#[test]
fn parametric_nodes_of_version_2() {
    let nodes = "5\n40 0 0 0 0 6\n3 1 0 0 1 8 0.5\n1000000000000 0 1 0 2 1 0.5 0.5\n7 0 0 1 3 1\n8 9 9 9 3 1\n";
    let (head, rest) = TEXT_22.split_once("$Nodes\n").unwrap();
    let rest = rest.split_once("$EndNodes").unwrap().1;
    let text = format!("{head}$ParametricNodes\n{nodes}$EndParametricNodes{rest}");
    assert_eq!(parse(text).unwrap().mesh, parse(TEXT_22).unwrap().mesh);
}

#[test]
fn version_1() {
    let file = parse(TEXT_1).unwrap();
    assert_eq!(file.mesh.tets, [corners([0, 1, 2, 3])]);
    assert_eq!(file.regions, [6]);
    let file = parse(TEXT_1.replace("2 4 6 3", "2 4 0 3")).unwrap();
    assert_eq!(file.regions, [3]);
}

/// A binary file made here: version 4.1 with the highest bytes first and numbers of 4 bytes.
#[test]
fn high_bytes_first_and_short_numbers() {
    let mut bytes = b"$MeshFormat\n4.1 1 4\n".to_vec();
    let put = |bytes: &mut Vec<u8>, numbers: &[i32]| {
        for number in numbers {
            bytes.extend(number.to_be_bytes());
        }
    };
    put(&mut bytes, &[1]);
    bytes.extend(b"\n$EndMeshFormat\n$Other\n\x00$End\xff\n$EndOther\n$Nodes\n");
    put(&mut bytes, &[1, 4, 1, 4, 3, 9, 0, 4, 4, 3, 2, 1]);
    for position in [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z] {
        for c in position.to_array() {
            bytes.extend(c.to_be_bytes());
        }
    }
    bytes.extend(b"\n$EndNodes\n$Elements\n");
    put(&mut bytes, &[1, 1, 1, 1, 3, 9, 4, 1, 1, 4, 3, 2, 1]);
    bytes.extend(b"\n$EndElements\n");
    let file = parse(bytes).unwrap();
    assert_eq!(file.mesh.tets, [corners([0, 1, 2, 3])]);
    assert_eq!(file.mesh.positions[3], DVec3::Z);
    assert_eq!(file.regions, [9]);
}

#[test]
fn known_element_types() {
    // The numbers of nodes as the manual lists them, in the order of the types.
    let lower = [
        (1, 2),
        (2, 3),
        (3, 4),
        (8, 3),
        (9, 6),
        (10, 9),
        (15, 1),
        (16, 8),
        (20, 9),
    ];
    for (number, nodes) in lower {
        assert_eq!(elements::kind_of(number), elements::Kind::Lower(nodes));
    }
    assert_eq!(elements::kind_of(4), elements::Kind::Tet);
    assert_eq!(
        elements::kind_of(6),
        elements::Kind::Volume("prism (wedge)")
    );
    assert_eq!(elements::kind_of(-1), elements::Kind::Unknown);
}
