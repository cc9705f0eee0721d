//! Graph files with a mistake: one sentence that names file and line, exit code 2, no files left.

use crate::bad_input::refused_in_a_sentence;
use crate::support::Sandbox;

/// The first line of a matrix of edges.
const HEAD: &str = "%%MatrixMarket matrix coordinate pattern symmetric\n";

/// Content, line, and what the sentence says.
type Case<'a> = (&'a [u8], usize, &'a str);

fn refused(name: &str, cases: &[Case<'_>]) {
    let sandbox = Sandbox::new();
    for &(content, line, part) in cases {
        sandbox.write(name, content);
        let start = format!("error: {name}:{line}: ");
        let command = ["color", name, "--csv", "colors.csv", "--json"];
        refused_in_a_sentence(&sandbox, &command, &[&start, part]);
    }
}

#[test]
fn matrices() {
    refused(
        "graph.mtx",
        &[
            (b"", 1, "the file ends early"),
            (b"3 3 1\n1 2\n", 1, "\"%%MatrixMarket\" expected"),
            (
                b"%%MatrixMarket matrix array real general\n1 1\n1\n",
                1,
                "\"array\" is a dense matrix",
            ),
            (
                b"%%MatrixMarket graph coordinate real general\n",
                1,
                "\"graph\" is not a matrix",
            ),
            (b"\x7fELF\x02\x01\x00\xff\xfe\n\x00\n", 1, "begins with"),
        ],
    );
    for (body, line, part) in [
        ("", 1, "rows, columns and entries expected"),
        ("3 4 1\n2 1\n", 2, "only a square one is a graph"),
        ("3 3 1\n4 1\n", 3, "there is no vertex 4"),
        ("3 3 1\n1 0\n", 3, "vertices are numbered from 1"),
        ("3 3 3\n2 1\n3 1\n", 4, "announces 3 entries, found 2"),
        (
            "3 3 1\n2 1\nthe end\n",
            4,
            "\"the\" stands after the last entry",
        ),
        ("3 3 1\ntwo one\n", 3, "\"two\" is not a vertex"),
        ("3 3 1\n2 -1\n", 3, "\"-1\" is not a vertex"),
        ("-3 -3 1\n", 2, "\"-3\" is not a number of vertices"),
        ("3 3 18446744073709551615\n2 1\n", 3, "found 1"),
        ("3 3 99999999999999999999\n", 2, "too large"),
        ("4294967295 4294967295 1\n2 1\n", 2, "not believable"),
        ("9999999999 9999999999 1\n2 1\n", 2, "too many"),
    ] {
        refused(
            "graph.mtx",
            &[((HEAD.to_owned() + body).as_bytes(), line, part)],
        );
    }
}

#[test]
fn dimacs_files() {
    let long = "c\np edge 3 1\ne 1 ".to_owned() + &"9".repeat(100_000);
    refused(
        "graph.col",
        &[
            (b"", 1, "\"p edge VERTICES EDGES\" expected"),
            (b"c no graph\n", 1, "\"p edge VERTICES EDGES\" expected"),
            (b"e 1 2\np edge 3 1\n", 1, "an edge before the line"),
            (b"p edge 3 1\np edge 3 1\n", 2, "a second line \"p\""),
            (b"p cnf 3 1\n1 -2 0\n", 1, "\"cnf\""),
            (b"p edge 3\n", 1, "\"p edge VERTICES EDGES\" expected"),
            (b"p edge 3 1\ne 1 4\n", 2, "there is no vertex 4"),
            (b"p edge 3 1\ne 0 1\n", 2, "vertices are numbered from 1"),
            (b"p edge 3 1\ne 2 2\n", 2, "joins vertex 2 to itself"),
            (b"p edge 3 1\ne 1 two\n", 2, "\"two\" is not a vertex"),
            (b"p edge 3 1\ne 1 -2\n", 2, "\"-2\" is not a vertex"),
            (
                b"p edge 3 1\ne 1 2 3\n",
                2,
                "\"e\" and two vertices expected",
            ),
            (b"p edge 3 1\ne 1 2\nthe end\n", 3, "begins with \"the\""),
            (b"p edge 4294967295 9\ne 1 2\n", 1, "not believable"),
            (b"p edge 9999999999 9\n", 1, "too many"),
            (b"p edge 3 1\n\xff\xfe\x00\x80\n", 2, "begins with"),
            (long.as_bytes(), 3, "longer than"),
        ],
    );
}

#[test]
fn clusterings_and_places() {
    let sandbox = Sandbox::new();
    sandbox.write("ring.col", "p edge 3 3\ne 1 2\ne 2 3\ne 3 1\n");
    sandbox.write("ring.xyz", "p edge 3 3\ne 1 2\ne 2 3\ne 3 1\n");
    std::fs::create_dir(sandbox.path("folder.mtx")).unwrap();
    for (command, parts) in [
        (
            &["color", "ring.col", "--clustering", "greedy-k:4"][..],
            &["greedy-k:4", "serial:"][..],
        ),
        (&["color", "none.mtx"], &["cannot read none.mtx"]),
        (&["color", "folder.mtx"], &["cannot read folder.mtx"]),
        (
            &["color", "ring.xyz"],
            &["ring.xyz", ".vtk", ".mtx", ".col"],
        ),
    ] {
        refused_in_a_sentence(&sandbox, command, parts);
    }
}
