//! Wrong files and files cut short give errors that name the place.

use glam::DVec3;
use incise_mesh::kuhn_box;

use super::{KINDS, TEXT_1, TEXT_22, TEXT_41, example, parse, written};
use crate::msh::write::{MshKind, write_content};
use crate::test_files::cut;
use crate::{MeshFile, MeshIoError};

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
            "a.msh:2: MSH version 4.0 is not read",
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
    assert!(matches!(parse(none), Err(MeshIoError::Empty)));
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
        cut(
            &bytes,
            |part| parse(part),
            |end, part| end == complete && part == file,
        );
    }
    // Sections of data may be missing, but are not read by halves.
    for kind in KINDS {
        let bytes = written(&full, kind);
        let mut good = 0;
        cut(
            &bytes,
            |part| parse(part),
            |length, part| {
                good += 1;
                let end = bytes[..length].trim_ascii_end();
                part.mesh == full.mesh && (end.ends_with(b"s") || end.ends_with(b"Data"))
            },
        );
        // With and without the line end after the elements and each of four fields, but for the whole file.
        assert_eq!(good, 9);
    }
}

#[test]
fn names_with_line_ends_are_refused() {
    let mut file = example();
    file.tets[0].name = "a\nb".to_owned();
    let error = write_content(&mut Vec::new(), &file, MshKind::default()).unwrap_err();
    assert!(error.to_string().contains("has a line end"));
}

#[test]
fn sparse_data_are_filled_up_to_a_limit() {
    let data = "$NodeData\n0\n0\n3\n0\n3\n1\n9 1 2 3\n$EndNodeData\n";
    // Each section fills in the three numbers of three nodes, for 45 bytes of its own.
    let sections = |count: usize| format!("{TEXT_1}{}", data.repeat(count));
    assert_eq!(parse(sections(20)).unwrap().particles.len(), 20);
    // Here the nodes are 100: each section asks for 297 numbers.
    let nodes: String = (10..106).map(|i| format!("{i} 0 0 0\n")).collect();
    let many = |count: usize| {
        let text = sections(count).replace("$NOD\n4\n", "$NOD\n100\n");
        text.replace("$ENDNOD", &format!("{nodes}$ENDNOD"))
    };
    assert_eq!(parse(many(2)).unwrap().particles.len(), 2);
    let error = parse(many(20)).unwrap_err().to_string();
    assert!(
        error.contains("have values for few of the nodes"),
        "{error}"
    );
}
