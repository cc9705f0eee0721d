//! Errors name the mistake and its place.

use super::*;

/// What to replace, by what, and what the error says.
type Change = (&'static str, &'static str, &'static str);

#[test]
fn errors_name_the_place() {
    let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let off = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    let ply = format!("{PLY}{PLY_BODY}");
    let stl = "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n";
    let cases: &[(Parse, &str, &[Change])] = &[
        (
            parse_obj,
            obj,
            &[
                ("v 0 1 0", "v 0 1", "a:3: a point has less than 3"),
                (
                    "v 0 1 0",
                    "v 0 nan 0",
                    "a:3: the coordinate nan is not finite",
                ),
                ("f 1 2 3", "f 1 2", "a:4: a face has less than 3 corners"),
                (
                    "f 1 2 3",
                    "f 1 2 4",
                    "a:4: a face has the point 4 but there are 3",
                ),
                ("f 1 2 3", "f 1 2 0", "a:4: \"0\" is no corner"),
                ("f 1 2 3", "f 1 2 -4", "a:4: \"-4\" is no corner"),
                ("f 1 2 3", "f 1 2 -9223372036854775808", "is no corner"),
                ("f 1 2 3", "f 1 2 4294967297", "is no corner"),
                ("f 1 2 3", "f 1 2 /3", "a:4: \"/3\" is no corner"),
                ("f 1 2 3", "", "a:5: the file has no faces"),
                (
                    "f 1 2 3\n",
                    "f 1 2 3\\",
                    "a:4: the file ends early: the rest of a continued line",
                ),
            ],
        ),
        (
            off::parse_off,
            off,
            &[
                ("OFF", "4OFF", "a:1: \"4OFF\" is not the number of points"),
                ("OFF", "nOFF", "a:1: \"nOFF\" is no keyword"),
                (
                    "OFF",
                    "OFF BINARY",
                    "a:1: \"BINARY\" is not the number of points",
                ),
                (
                    "3 1 0",
                    "3",
                    "a:2: the line ends before the number of polygons",
                ),
                (
                    "3 1 0",
                    "9999999999999 1 0",
                    "a:6: the file ends early: a point expected",
                ),
                (
                    "3 1 0",
                    "3 9999999999999 0",
                    "a:6: the file ends early: a polygon expected",
                ),
                ("1 0 0", "1 0", "a:4: the line ends before a coordinate"),
                (
                    "3 0 1 2",
                    "3 0 1 3",
                    "a:6: a polygon has the point 3 but there are 3",
                ),
                (
                    "3 0 1 2",
                    "99999999999 0 1 2",
                    "a:6: the line ends before a corner",
                ),
                ("3 0 1 2", "2 0 1", "a:2: the file has no polygons"),
            ],
        ),
        (
            stl::parse_stl,
            stl,
            &[
                ("solid", "slid", "a at byte"),
                (
                    "facet",
                    "face",
                    "a:2: facet or endsolid expected, not \"face\"",
                ),
                (
                    "vertex 1 0 0",
                    "vertex 1 0 inf",
                    "a:5: the coordinate inf is not finite",
                ),
                (
                    "vertex 1 0 0\n",
                    "",
                    "a:6: vertex expected, not \"endloop\"",
                ),
                (
                    "endloop",
                    "vertex 1 1 1",
                    "a:7: endloop expected, not \"vertex\"",
                ),
                (
                    "endsolid",
                    "",
                    "a:9: the file ends early: endsolid expected",
                ),
                (
                    "\nendsolid",
                    "\nendsolid\nfacet",
                    "a:10: solid expected, not \"facet\"",
                ),
            ],
        ),
        (
            ply::parse_ply,
            &ply,
            &[
                ("ply", "plo", "a:1: the file does not start with ply"),
                (
                    "ascii",
                    "asci",
                    "a:2: ascii, binary_little_endian or binary_big_endian expected",
                ),
                ("format ascii 1.0\n", "", "a:16: a format expected"),
                (
                    "float x",
                    "float w",
                    "a:5: an element vertex with x, y and z expected",
                ),
                (
                    "vertex_index",
                    "vertices",
                    "a:14: an element face with a list",
                ),
                ("element face", "element faces", "a:17: an element face"),
                (
                    "float64 y",
                    "float64 x",
                    "a:5: an element vertex with x, y and z expected",
                ),
                (
                    "element edge",
                    "element vertex",
                    "a:11: another element expected",
                ),
                ("float64 y", "float80 y", "a:8: a type expected"),
                (
                    "element vertex 4",
                    "element vertex -4",
                    "a:5: \"-4\" is not the number of elements",
                ),
                (
                    "element vertex 4",
                    "element vertex 99999999999",
                    "a:23: the coordinate NaN is not finite",
                ),
                ("element vertex 4\n", "", "a:5: an element expected"),
                ("end_header", "end", "a:17: a line of a header expected"),
                (
                    "9 1 1 0 0",
                    "9 1 inf 0 0",
                    "a:20: the coordinate inf is not finite",
                ),
                ("9 1 1 0 0", "9 1 x 0 0", "a:20: \"x\" is not a value"),
                (
                    "9 1 1 0 0",
                    "9 1 1 0 -1",
                    "a:20: -1 is not the length of a list",
                ),
                (
                    "4 0 1 2 3",
                    "4 0 1 2 4",
                    "a:23: a face has the point 4 but there are 4",
                ),
                ("4 0 1 2 3", "4 0 1 2 2.5", "a:23: 2.5 is not a corner"),
                (
                    "4 0 1 2 3",
                    "4000000000 0 1 2 3",
                    "a:23: the file ends early: a corner expected",
                ),
                ("4 0 1 2 3", "2 0 1", "a:1: the file has no faces"),
            ],
        ),
    ];
    for &(reader, good, changes) in cases {
        parse(reader, good.as_bytes()).unwrap();
        for &(from, to, expected) in changes {
            let text = good.replacen(from, to, 1);
            let error = parse(reader, text.as_bytes()).expect_err(to).to_string();
            assert!(error.contains(expected), "{error} lacks {expected}");
        }
    }
    let (_, mut bytes) = forms(&tetrahedron())[0].clone();
    bytes[84 + 50 + 16 + 2..][..2].copy_from_slice(&[0xc0, 0x7f]);
    let error = parse(stl::parse_stl, &bytes).unwrap_err().to_string();
    assert!(error.contains("at byte 150: the coordinate NaN"), "{error}");
    bytes[80..84].fill(0xff);
    let error = parse(stl::parse_stl, &bytes).unwrap_err().to_string();
    assert!(
        error.contains("at byte 284: the file ends early: 4294967295"),
        "{error}"
    );
    bytes[80..84].fill(0);
    let error = parse(stl::parse_stl, &bytes).unwrap_err().to_string();
    assert!(
        error.contains("at byte 80: the file has no triangles"),
        "{error}"
    );
}
