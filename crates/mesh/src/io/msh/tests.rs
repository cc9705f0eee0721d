//! Small files by hand, broken ones, and random ones.

use std::path::Path;

use glam::{DVec3, dvec3};
use proptest::prelude::*;

use super::write::{MshKind, write_content};
use super::{elements, parse_msh};
use crate::generate::kuhn_box;
use crate::io::{MeshFile, NamedValues, OwnedValues};
use crate::{MeshError, ParticleId, TetMesh};

const KINDS: [MshKind; 4] = [
    MshKind::Text41,
    MshKind::Binary41,
    MshKind::Text22,
    MshKind::Binary22,
];

fn parse(bytes: impl AsRef<[u8]>) -> Result<MeshFile, MeshError> {
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
fn errors_name_the_line() {
    let cases = [
        (
            TEXT_22,
            "2.2 0 8",
            "4.0 0 8",
            "a.msh:2: MSH version 4.0 is not read",
        ),
        (
            TEXT_22,
            "2.2 0 8",
            "4 0 8",
            "a.msh:2: MSH version 4 is not read",
        ),
        (TEXT_22, "2.2 0 8", "2.2 2 8", "a.msh:2: the file type is 2"),
        (
            TEXT_22,
            "2.2 0 8",
            "x",
            "a.msh:2: MSH version x is not read",
        ),
        (
            TEXT_22,
            "$MeshFormat",
            "MeshFormat",
            "a.msh:1: a section ($Name) expected",
        ),
        (
            TEXT_22,
            "40 0 0 0",
            "40 0 nan 0",
            "a.msh:10: the coordinate NaN is not finite",
        ),
        (
            TEXT_22,
            "40 0 0 0",
            "40 0 z 0",
            "a.msh:10: \"z\" is not a coordinate",
        ),
        (
            TEXT_22,
            "40 0 0 0",
            "-4 0 0 0",
            "a.msh:10: \"-4\" is not the number of a node",
        ),
        (
            TEXT_22,
            "40 0 0 0",
            "3 0 0 0",
            "two nodes have the number 3",
        ),
        (
            TEXT_22,
            "$Nodes\n5",
            "$Nodes\n4",
            "a.msh:14: $EndNodes expected but \"8\" found",
        ),
        (
            TEXT_22,
            "$Nodes\n5",
            "$Nodes\n6",
            "a.msh:15: \"$EndNodes\" is not the number of a node",
        ),
        (
            TEXT_22,
            "$Nodes\n5",
            "$Nodes\n99999999999999999999",
            "a.msh:9: ",
        ),
        (
            TEXT_22,
            "99 4 4",
            "99 5 4",
            "a.msh:19: the file has an element of type 5, a hexahedron",
        ),
        (
            TEXT_22,
            "99 4 4",
            "99 11 4",
            "type 11, a 10-node tetrahedron",
        ),
        (
            TEXT_22,
            "99 4 4",
            "99 777 4",
            "a.msh:19: the element type 777 is not known",
        ),
        (
            TEXT_22,
            " 3 1000000000000 7\n$E",
            " 3 11 7\n$E",
            "a.msh:19: element 99 uses node 11, which does not exist",
        ),
        (
            TEXT_22,
            "99 4 4 7 2 1 1 40 3 1000000000000 7",
            "99 2 2 1 1 40 3 7",
            "none of the 2 elements is a tetrahedron",
        ),
        (
            TEXT_22,
            "\n7 1 2 3\n",
            "\n6 1 2 3\n",
            "has a value for node 6, which does not exist",
        ),
        (
            TEXT_22,
            "3\n0\n1\n2\n12 1.5",
            "2\n0\n1\n12 1.5",
            "3 are needed",
        ),
        (
            TEXT_41,
            "3 5 3 44",
            "3 6 3 44",
            "the section ends but 1 more nodes are announced",
        ),
        (
            TEXT_41,
            "3 5 3 44",
            "3 4 3 44",
            "2 more nodes are announced but 3 follow",
        ),
        (
            TEXT_41,
            "2 1 1 2\n44",
            "4 1 1 2\n44",
            "a.msh:14: 4 is not a dimension",
        ),
        (
            TEXT_41,
            "3 3 1 9",
            "3 9 1 9",
            "the section ends but 6 more elements are announced",
        ),
        (TEXT_41, "3 2 4 1\n", "3 2 7 1\n", "type 7, a pyramid"),
        (
            TEXT_1,
            "2 4 6 3 4",
            "2 4 6 3 5",
            "a.msh:11: element 2 has 5 nodes instead of 4",
        ),
        (
            TEXT_1,
            "$NOD",
            "$Nodes",
            "a.msh:1: section $Nodes stands before $MeshFormat",
        ),
    ];
    for (text, from, to, expected) in cases {
        assert!(text.contains(from), "{from}");
        let error = parse(text.replacen(from, to, 1)).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}\nexpected: {expected}");
    }
    let twice = TEXT_22
        .replace("$Elements\n2", "$Elements\n3")
        .replace("\n$EndElements", "\n99 4 0 40 3 8 7\n$EndElements");
    let error = parse(twice).unwrap_err().to_string();
    assert!(
        error.contains("two tetrahedra have the number 99"),
        "{error}"
    );
    let none = "$NOD\n0\n$ENDNOD\n$ELM\n0\n$ENDELM\n";
    assert!(matches!(parse(none), Err(MeshError::Empty)));
}

#[test]
fn errors_in_binary_files_name_the_byte() {
    let file = MeshFile::from(kuhn_box([1, 1, 1], DVec3::ONE));
    for (kind, head) in [
        (MshKind::Binary22, "$Nodes\n8\n"),
        (MshKind::Binary41, "$Nodes\n"),
    ] {
        let mut bytes = written(&file, kind);
        let nodes = bytes
            .windows(head.len())
            .position(|w| w == head.as_bytes())
            .unwrap()
            + head.len();
        // The number before the first coordinate, or the head, the block's head and all numbers.
        let at = nodes
            + if kind == MshKind::Binary22 {
                4
            } else {
                32 + 20 + 64
            };
        bytes[at..at + 8].copy_from_slice(&f64::INFINITY.to_le_bytes());
        let error = parse(&bytes).unwrap_err().to_string();
        assert!(
            error.starts_with(&format!(
                "a.msh at byte {at}: the coordinate inf is not finite"
            )),
            "{error}"
        );
    }
    let bytes = written(&file, MshKind::Binary22);
    let wrong = [&bytes[..20], &[7, 0, 0, 0], &bytes[24..]].concat();
    let error = parse(wrong).unwrap_err().to_string();
    assert!(
        error.contains("at byte 20: the number 1, which tells"),
        "{error}"
    );
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

#[test]
fn every_prefix_errs_up_to_the_last_section() {
    let full = example();
    let bare = MeshFile {
        particles: Vec::new(),
        tets: Vec::new(),
        ..full.clone()
    };
    let texts = [TEXT_1, TEXT_41].map(|text| (text.as_bytes().to_vec(), parse(text).unwrap()));
    let files = KINDS.map(|kind| (written(&bare, kind), bare.clone()));
    for (bytes, file) in texts.into_iter().chain(files) {
        // Without the last line end the file is complete still.
        let complete = bytes.len() - 1;
        for length in 0..complete {
            assert!(parse(&bytes[..length]).is_err(), "{length}");
        }
        assert_eq!(parse(&bytes[..complete]).unwrap(), file);
    }
    // Sections of data may be missing, but are not read by halves.
    for kind in KINDS {
        let bytes = written(&full, kind);
        let good = (0..bytes.len()).filter(|&length| {
            parse(&bytes[..length]).is_ok_and(|file| {
                assert_eq!(file.mesh, full.mesh);
                assert!(
                    bytes[..length].trim_ascii_end().ends_with(b"s")
                        || bytes[..length].trim_ascii_end().ends_with(b"Data")
                );
                true
            })
        });
        // With and without the line end after the elements and each of four fields, but for the whole file.
        assert_eq!(good.count(), 9);
    }
}

#[test]
fn regions_that_say_little_survive() {
    let mut file = example();
    let tets = file.mesh.tets.len();
    for regions in [
        vec![],
        vec![0; tets],
        vec![1; tets],
        vec![i32::MIN; tets],
        vec![0, 0, 5, 5, 0, i32::MAX],
    ] {
        file.regions = regions;
        for kind in KINDS {
            assert_eq!(parse(written(&file, kind)).unwrap(), file);
        }
    }
}

#[test]
fn names_with_line_ends_are_refused() {
    let mut file = example();
    file.tets[0].name = "a\nb".to_owned();
    let error = write_content(&mut Vec::new(), &file, MshKind::default()).unwrap_err();
    assert!(error.to_string().contains("has a line end"));
}

/// Any double that is a number; one NaN is written as another in a text.
fn value() -> impl Strategy<Value = f64> {
    any::<u64>()
        .prop_map(f64::from_bits)
        .prop_filter("no NaN", |c| !c.is_nan())
}

fn vector() -> impl Strategy<Value = DVec3> {
    [value(), value(), value()].prop_map(DVec3::from)
}

fn fields(count: usize) -> impl Strategy<Value = Vec<NamedValues>> {
    let values = prop_oneof![
        prop::collection::vec(value(), count).prop_map(OwnedValues::Scalars),
        prop::collection::vec(vector(), count).prop_map(OwnedValues::Vectors),
    ];
    let field = ("[^\r\n]{0,12}", values).prop_map(|(name, values)| NamedValues { name, values });
    prop::collection::vec(field, 0..3)
}

fn file() -> impl Strategy<Value = MeshFile> {
    let finite = vector().prop_filter("finite", |p| p.is_finite());
    (prop::collection::vec(finite, 1..20), 1..20_usize).prop_flat_map(|(positions, tets)| {
        let particles = positions.len();
        let corner = (0..particles).prop_map(ParticleId::new);
        let corners = [corner.clone(), corner.clone(), corner.clone(), corner];
        let regions = prop_oneof![
            Just(Vec::new()),
            prop::collection::vec(any::<i32>(), tets),
            prop::collection::vec(-1..3, tets),
        ];
        (
            prop::collection::vec(corners, tets),
            regions,
            fields(particles),
            fields(tets),
        )
            .prop_map(move |(tets, regions, of_particles, of_tets)| MeshFile {
                mesh: TetMesh {
                    positions: positions.clone(),
                    tets,
                },
                regions,
                particles: of_particles,
                tets: of_tets,
            })
    })
}

/// All doubles of a file as bits, for which 0 and -0 differ.
fn bits(file: &MeshFile) -> Vec<u64> {
    let fields = file.particles.iter().chain(&file.tets);
    let values = fields.flat_map(|field| match &field.values {
        OwnedValues::Scalars(values) => values.clone(),
        OwnedValues::Vectors(values) => values.iter().flat_map(|v| v.to_array()).collect(),
    });
    let positions = file.mesh.positions.iter().flat_map(|p| p.to_array());
    positions.chain(values).map(f64::to_bits).collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 100, failure_persistence: None, ..Default::default() })]

    #[test]
    fn round_trips_keep_every_bit(file in file()) {
        for kind in KINDS {
            let read = parse(written(&file, kind)).unwrap();
            prop_assert_eq!(bits(&read), bits(&file));
            prop_assert_eq!(&read, &file);
        }
    }

    #[test]
    fn noise_is_no_reason_to_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in prop::option::of(any::<prop::sample::Index>()),
    ) {
        let full = example();
        let texts = [TEXT_1, TEXT_22, TEXT_41].map(|text| text.as_bytes().to_vec());
        for mut bytes in KINDS.map(|kind| written(&full, kind)).into_iter().chain(texts) {
            for (place, byte) in &changes {
                *place.get_mut(&mut bytes) = *byte;
            }
            if let Some(cut) = cut {
                bytes.truncate(cut.index(bytes.len()));
            }
            if let Ok(file) = parse(&bytes) {
                prop_assert!(file.check().is_ok());
                let particles = file.mesh.positions.len();
                prop_assert!(file.mesh.positions.iter().all(|p| p.is_finite()));
                prop_assert!(file.mesh.tets.iter().flatten().all(|c| c.index() < particles));
            }
        }
    }
}
