//! Readers return the graph that was written, in all variants of a format, and an error with a line
//! for all other bytes.

use std::fmt::Write;

use incise_graph::{ConstraintGraph, GraphError, read_dimacs, read_matrix_market};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::{Index, select};

type Reader = fn(&[u8]) -> Result<ConstraintGraph, GraphError>;

const MATRIX: &str = "%%MatrixMarket matrix coordinate pattern symmetric\n% a path\n\n4 4 4\n\
                      2 1\n3 2\n3 3\n4 3\n";
const RING: &str = "c a ring\np edge 4 4\nn 1 7\ne 1 2\ne 2 3\ne 3 4\ne 4 1\n";

/// Vertices and edges, with repeats and both directions, without loops.
fn edge_lists() -> impl Strategy<Value = (u32, Vec<(u32, u32)>)> {
    (1u32..40).prop_flat_map(|n| {
        let edges = vec((0..n, 0..n), 0..120).prop_map(|mut edges| {
            edges.retain(|(a, b)| a != b);
            edges
        });
        (Just(n), edges)
    })
}

/// Reads any bytes; the result must be a consistent graph or an error of the reader.
fn survives(bytes: &[u8]) {
    for read in [(|bytes| read_dimacs(bytes)) as Reader, |bytes| {
        read_matrix_market(bytes)
    }] {
        match read(bytes) {
            Ok(graph) => {
                let (offsets, values) = (graph.offsets().to_vec(), graph.values().to_vec());
                assert_eq!(ConstraintGraph::from_csr(offsets, values), Ok(graph));
            }
            Err(GraphError::Malformed { line, message }) => {
                let lines = bytes.iter().filter(|&&b| b == b'\n').count() + 1;
                assert!((1..=lines).contains(&line), "{line}: {message}");
                assert!(!message.contains('\n'), "{message:?}");
            }
            Err(error) => panic!("{error}"),
        }
    }
}

proptest! {
    #[test]
    fn dimacs_files_are_read(
        (n, edges) in edge_lists(),
        word in select(&["edge", "col", "EDGE"][..]),
        count in 0usize..200,
        extra in select(&["", "\n", "c \u{fc}\n", "n 1 3\n", "d 2 3.5\nv 1 1\nx 1\n", " \t\r\n"][..]),
    ) {
        let mut text = format!("{extra}c made here\r\np {word} {n} {count}\n");
        for (i, (a, b)) in edges.iter().enumerate() {
            write!(text, "e {} {}\n{}", a + 1, b + 1, if i % 3 == 0 { extra } else { "" }).unwrap();
        }
        prop_assert_eq!(
            read_dimacs(text.as_bytes()),
            ConstraintGraph::from_edges(n as usize, &edges)
        );
        // The end of the last line is optional.
        prop_assert_eq!(
            read_dimacs(text.trim_end().as_bytes()),
            ConstraintGraph::from_edges(n as usize, &edges)
        );
    }

    #[test]
    fn matrices_are_read(
        (n, edges) in edge_lists(),
        (field, value) in select(&[
            ("pattern", ""),
            ("REAL", " -1.5e-3"),
            ("real", " 0"),
            ("integer", " -7"),
            ("Complex", " 1.0 -2"),
        ][..]),
        symmetry in select(&["general", "symmetric", "Skew-Symmetric", "hermitian"][..]),
        diagonal in any::<bool>(),
        extra in select(&["", "\n", "% \u{fc}\r\n", "  \n%\n"][..]),
    ) {
        let loops = if diagonal { n } else { 0 };
        let mut text = format!(
            "%%matrixMARKET Matrix coordinate {field} {symmetry}\n{extra} {n}\t{n} {}\n",
            edges.len() + loops as usize
        );
        for (i, (a, b)) in edges.iter().enumerate() {
            let extra = if i % 3 == 0 { extra } else { "" };
            write!(text, "{} {}{value}\n{extra}", a + 1, b + 1).unwrap();
        }
        for v in 1..=loops {
            writeln!(text, "{v} {v}{value}").unwrap();
        }
        prop_assert_eq!(
            read_matrix_market(text.as_bytes()),
            ConstraintGraph::from_edges(n as usize, &edges)
        );
    }

    #[test]
    fn any_bytes_give_a_graph_or_an_error(bytes in vec(any::<u8>(), 0..300)) {
        survives(&bytes);
        survives(&[b"p edge 9 9\n", &bytes[..]].concat());
        survives(&[b"p edge 9 9\ne ", &bytes[..]].concat());
        survives(&[b"%%MatrixMarket matrix coordinate real general\n", &bytes[..]].concat());
        survives(&[b"%%MatrixMarket matrix coordinate pattern general\n9 9 9\n", &bytes[..]].concat());
    }

    #[test]
    fn any_mutation_gives_a_graph_or_an_error(
        text in select(&[MATRIX, RING][..]),
        changes in vec((any::<Index>(), prop_oneof![
            any::<u8>().prop_map(|byte| vec![byte]),
            select(&b"0123456789 \n-%ecpx."[..]).prop_map(|byte| vec![byte]),
            Just(Vec::new()),
            Just(b"99999999999999999999".to_vec()),
            Just(b"4294967296".to_vec()),
            Just(b"\n\n".to_vec()),
        ]), 1..6),
    ) {
        let mut bytes = text.as_bytes().to_vec();
        for (place, change) in changes {
            let place = place.index(bytes.len());
            bytes.splice(place..=place, change);
            if bytes.is_empty() {
                break;
            }
        }
        survives(&bytes);
    }
}

/// Each mistake is an error with its line and message.
fn refused(read: Reader, cases: &[(&[u8], usize, &str)]) {
    for &(bytes, line, part) in cases {
        let text = String::from_utf8_lossy(bytes);
        let error = read(bytes).expect_err(&text).to_string();
        let start = format!("line {line}: ");
        assert!(
            error.starts_with(&start) && error.contains(part),
            "{text:?}: {error:?} has not {start:?} and {part:?}"
        );
    }
}

#[test]
fn matrices_with_a_mistake() {
    const HEAD: &str = "%%MatrixMarket matrix coordinate pattern general\n";
    refused(
        |bytes| read_matrix_market(bytes),
        &[
            (b"", 1, "\"%%MatrixMarket ...\" expected"),
            (b"\n%%MatrixMarket", 1, "the file begins with \"\""),
            (b"%MatrixMarket matrix", 1, "\"%MatrixMarket\""),
            (b"%%MatrixMarket matrix coordinate", 1, "found 3 word(s)"),
            (
                b"%%MatrixMarket vector coordinate real general",
                1,
                "\"vector\" is not a matrix",
            ),
            (
                b"%%MatrixMarket matrix array real general\n2 2\n1\n2\n3\n4",
                1,
                "dense",
            ),
            (
                b"%%MatrixMarket matrix list real general",
                1,
                "format \"list\"",
            ),
            (
                b"%%MatrixMarket matrix coordinate bool general",
                1,
                "field \"bool\"",
            ),
            (
                b"%%MatrixMarket matrix coordinate real upper",
                1,
                "symmetry \"upper\"",
            ),
            (HEAD.as_bytes(), 1, "ends early"),
        ],
    );
    for (body, line, part) in [
        ("%\n\n", 3, "rows, columns and entries expected"),
        ("3 3\n", 2, "found 2 word(s)"),
        ("3 3 0 0\n", 2, "found 4 word(s)"),
        ("3 4 0\n", 2, "3 rows and 4 columns"),
        ("3 99999999999999999999 0\n", 2, "too large"),
        ("4294967296 4294967296 0\n", 2, "too many"),
        (
            "4294967295 4294967295 0\n",
            2,
            "not believable with 0 edges",
        ),
        ("3 3 -1\n", 2, "\"-1\" is not a number of entries"),
        ("3 3 18446744073709551615\n1 2\n", 3, "found 1"),
        ("3 3 18446744073709551616\n1 2\n", 2, "too large"),
        ("3 3 2\n1 2\n", 3, "announces 2 entries, found 1"),
        (
            "3 3 1\n1 2\n\n2 3\n",
            5,
            "\"2\" stands after the last entry",
        ),
        ("3 3 1\n1 4\n", 3, "no vertex 4"),
        ("3 3 1\n0 1\n", 3, "numbered from 1"),
        ("3 3 1\n1 99999999999\n", 3, "no vertex 99999999999"),
        ("3 3 1\n1 -2\n", 3, "\"-2\" is not a vertex"),
        ("3 3 1\n1 +2\n", 3, "\"+2\" is not a vertex"),
        ("3 3 1\n1 2.0\n", 3, "\"2.0\" is not a vertex"),
        ("3 3 1\n1 b\n", 3, "\"b\" is not a vertex"),
        ("3 3 1\n1\n", 3, "row and column expected, found 1"),
        ("3 3 1\n1 2 3\n", 3, "found 3 word(s)"),
    ] {
        let text = HEAD.to_owned() + body;
        refused(
            |bytes| read_matrix_market(bytes),
            &[(text.as_bytes(), line, part)],
        );
    }
    for (field, entry, part) in [
        ("real", "1 2", "row, column and value"),
        ("real", "1 2 x", "\"x\" is not a value"),
        ("real", "1 2 \u{fc}", "is not a value"),
        ("integer", "1 2 1.5", "\"1.5\" is not a value"),
        ("integer", "1 2 -", "\"-\" is not a value"),
        ("complex", "1 2 3", "two values"),
        ("complex", "1 2 3 i", "\"i\" is not a value"),
    ] {
        let text = format!("%%MatrixMarket matrix coordinate {field} general\n3 3 1\n{entry}\n");
        refused(
            |bytes| read_matrix_market(bytes),
            &[(text.as_bytes(), 3, part)],
        );
    }
}

#[test]
fn dimacs_files_with_a_mistake() {
    refused(
        |bytes| read_dimacs(bytes),
        &[
            (b"", 1, "\"p edge VERTICES EDGES\" expected"),
            (b"c nothing\n\n", 2, "\"p edge VERTICES EDGES\" expected"),
            (b"c\ne 1 2\np edge 2 1\n", 2, "before"),
            (b"p edge 2 1\np edge 2 1\n", 2, "announced in line 1"),
            (b"p edge 2\n", 1, "found 3 word(s)"),
            (b"p edge 2 1 0\n", 1, "found 5 word(s)"),
            (b"p cnf 2 1\n", 1, "format \"cnf\""),
            (b"p edge two 1\n", 1, "\"two\" is not a number of vertices"),
            (b"p edge 2 -1\n", 1, "\"-1\" is not a number of edges"),
            (b"p edge 99999999999999999999 0\n", 1, "too large"),
            (b"p edge 4294967296 0\n", 1, "too many"),
            (b"p edge 4294967295 0\n", 1, "not believable"),
            (b"p edge 4000000000 1\ne 1 2\n", 1, "with 1 edges"),
            (b"p edge 2 1\ne 1 3\n", 2, "no vertex 3"),
            (b"p edge 2 1\ne 0 1\n", 2, "numbered from 1"),
            (b"p edge 2 1\ne 1 1\n", 2, "vertex 1 to itself"),
            (b"p edge 2 1\ne 1 x\n", 2, "\"x\" is not a vertex"),
            (b"p edge 2 1\ne 1 -2\n", 2, "\"-2\""),
            (b"p edge 2 1\ne 1\n", 2, "found 2 word(s)"),
            (b"p edge 2 1\ne 1 2 5\n", 2, "found 4 word(s)"),
            (b"p edge 2 1\na 1 2\n", 2, "begins with \"a\""),
            (b"p edge 2 1\ne 1 \xff\n", 2, "is not a vertex"),
            (b"\x00\xff\xfe\n", 1, "begins with"),
        ],
    );
}

#[test]
fn comments_may_have_any_encoding() {
    let latin = b"%%MatrixMarket matrix coordinate pattern general\n% \xfc\n2 2 1\n1 2\n";
    assert_eq!(read_matrix_market(&latin[..]).unwrap().edge_count(), 1);
    let latin = b"c \xfc\np edge 2 1\ne 1 2\n";
    assert_eq!(read_dimacs(&latin[..]).unwrap().edge_count(), 1);
}

#[test]
fn nothing_is_a_graph() {
    let none = ConstraintGraph::from_edges(0, &[]);
    assert_eq!(read_dimacs(&b"p edge 0 0"[..]), none);
    let empty = b"%%MatrixMarket matrix coordinate pattern general\n0 0 0";
    assert_eq!(read_matrix_market(&empty[..]), none);
}
