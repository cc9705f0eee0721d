//! Attributes, markers and regions: kept, and errors where they are wrong.

use incise_mesh::kuhn_box;
use proptest::prelude::*;

use super::*;
use crate::test_files::{cut, sample};

fn parse(nodes: &str, elements: &str) -> Result<MeshFile, MeshIoError> {
    parse_tetgen("a.node", nodes.as_bytes(), elements.as_bytes())
}

fn scalars(name: &str, values: &[f64]) -> NamedValues {
    NamedValues {
        name: name.to_owned(),
        values: OwnedValues::Scalars(values.to_vec()),
    }
}

const NODES: &str =
    "# c\n4 3 2 1\n1 0 0 0 0.5 -1e9 1 # c\n2 1 0 0 nan 0 2\n3 0 1 0 0 0 0\n\n4 0 0 1 0 0 -3\n";

#[test]
fn attributes_markers_and_regions() {
    let file = parse(NODES, "1 4 2\n1 1 2 3 4 0.5 -7\n# end").unwrap();
    assert_eq!(file.mesh.tets, [[0, 1, 2, 3].map(ParticleId)]);
    assert_eq!(file.regions, [-7]);
    assert_eq!(file.tets, [scalars("attribute 1", &[0.5])]);
    assert_eq!(
        file.particles[1],
        scalars("attribute 2", &[-1e9, 0.0, 0.0, 0.0])
    );
    assert_eq!(file.particles[2], scalars(MARKER, &[1.0, 2.0, 0.0, -3.0]));
    // Not whole: no region. Points between, and no counts of attributes.
    let file = parse(NODES, "1 4 1\n1 1 2 3 4 0.5\n").unwrap();
    assert_eq!(
        (file.regions, file.tets),
        (vec![], vec![scalars("attribute 1", &[0.5])])
    );
    let file = parse(NODES, "1 10\n1 1 2 3 4 5 6 7 8 9 10\n").unwrap();
    assert!(file.regions.is_empty() && file.tets.is_empty());
}

#[test]
fn errors_name_the_line() {
    let elements = "1 4 1\n1 1 2 3 4 7\n";
    for (from, to, expected) in [
        (
            "4 3 2 1",
            "4 3 2 2",
            "a.node:2: 0 or 1 boundary markers expected, not 2",
        ),
        (
            "4 3 2 1",
            "4 3 3 1",
            "a.node:3: the line ends before a boundary marker",
        ),
        (
            "4 3 2 1",
            "4 3 99999999999999 1",
            "a.node:2: 99999999999999 attributes announced, 256 at most",
        ),
        (
            "4 3 2 1",
            "4 3 4 1",
            "a.node:3: the line ends before an attribute",
        ),
        (
            "4 3 2 1",
            "4 3 x 1",
            "a.node:2: \"x\" is not the number of attributes",
        ),
        (
            "0 0 -3",
            "0 0 1.5",
            "a.node:7: \"1.5\" is not a boundary marker",
        ),
        ("0.5", "x", "a.node:3: \"x\" is not an attribute"),
    ] {
        let error = parse(&NODES.replacen(from, to, 1), elements)
            .expect_err(to)
            .to_string();
        assert!(error.contains(expected), "{error} lacks {expected}");
    }
    for (to, expected) in [
        (
            "1 4 2\n1 1 2 3 4 7\n",
            "a.ele:2: the line ends before an attribute",
        ),
        (
            "1 10 0\n1 1 2 3 4 7\n",
            "a.ele:2: the line ends before a point between",
        ),
    ] {
        let error = parse(NODES, to).expect_err(to).to_string();
        assert!(error.contains(expected), "{error} lacks {expected}");
    }
}

#[test]
fn no_more_attributes_are_written_than_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.node");
    let mut file = sample();
    file.tets = vec![scalars("a", &[0.5; 6]); 255];
    write_tetgen_file(&path, &file).unwrap();
    assert_eq!(read_tetgen_file(&path).unwrap().tets.len(), 255);
    file.tets.push(scalars("a", &[0.5; 6]));
    let Err(MeshIoError::Io { source, .. }) = write_tetgen_file(&path, &file) else {
        panic!("257 attributes are written");
    };
    let message = source.to_string();
    assert!(
        message.contains("257 attributes are more than the 256"),
        "{message}"
    );
}

#[test]
fn parts_of_either_file_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.node");
    write_tetgen_file(&path, &sample()).unwrap();
    let [nodes, elements] = ["node", "ele"].map(|e| std::fs::read(path.with_extension(e)).unwrap());
    let whole = parse_tetgen("a", &nodes, &elements).unwrap();
    // A file that ends within its last word cannot be told from a complete one: its last value is another.
    let last_word = |file: &[u8]| {
        let text = file.trim_ascii_end();
        1 + text.iter().rposition(u8::is_ascii_whitespace).unwrap()
    };
    let read = |part: &[u8]| parse_tetgen("a", part, &elements);
    cut(&nodes, read, |end, part| {
        let (same, i) = (&whole.mesh.positions, whole.mesh.positions.len() - 1);
        end > last_word(&nodes)
            && part.mesh.positions[..i] == same[..i]
            && part.regions == whole.regions
    });
    let read = |part: &[u8]| parse_tetgen("a", &nodes, part);
    cut(&elements, read, |end, part| {
        end > last_word(&elements) && part.mesh == whole.mesh && part.tets == whole.tets
    });
    assert!(parse_tetgen("a", b"", &elements).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, failure_persistence: None, ..Default::default() })]

    #[test]
    fn round_trips_keep_every_value(
        regions in any::<[i32; 6]>(),
        attributes in any::<[f64; 8]>(),
        markers in any::<[i32; 8]>(),
        of_tets in any::<[f64; 6]>(),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let file = MeshFile {
            mesh: kuhn_box([1, 1, 1], DVec3::new(0.1, 0.7, 1.3)),
            regions: regions.to_vec(),
            particles: vec![
                scalars("attribute 1", &attributes),
                scalars(MARKER, &markers.map(f64::from)),
            ],
            tets: vec![scalars("attribute 1", &of_tets)],
        };
        write_tetgen_file(folder.path().join("a.node"), &file).unwrap();
        prop_assert_eq!(read_tetgen_file(folder.path().join("a.ele")).unwrap(), file);
    }

    #[test]
    fn noise_is_no_reason_to_panic(place: prop::sample::Index, byte in 0..128_u8) {
        let mut nodes = NODES.as_bytes().to_vec();
        nodes[place.index(NODES.len())] = byte;
        let mut elements = b"1 4 2\n1 1 2 3 4 0.5 -7\n".to_vec();
        let at = place.index(elements.len());
        elements[at] = byte;
        parse(str::from_utf8(&nodes).unwrap(), str::from_utf8(&elements).unwrap()).ok();
    }
}
