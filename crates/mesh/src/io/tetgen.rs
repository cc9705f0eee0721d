//! TetGen's pair of files: `.node` with the points and `.ele` with the tets.
//!
//! One item per line after a line with counts; `#` starts a comment; points are numbered from 0 or 1, which the first
//! one tells. The mid-edge points of 10-point tets are skipped. TetGen's own tets are mirror images of ours, other
//! programs write either kind, so that negative tets are turned on reading.
//!
//! Attributes have no names: they are called `attribute 1` and so on, and the markers of points `boundary marker`. The
//! last attribute of tets is where TetGen puts the region: it is the region if it is a whole number for all. Linear.
//!
//! Source: H. Si, "TetGen User's Manual", file formats.

use std::fmt::{self, Display};
use std::path::Path;

use glam::DVec3;

use super::text::{Text, Word, show, words_of};
use super::{MeshFile, NamedValues, OwnedValues, write_atomically};
use crate::{MeshError, ParticleId, TetMesh};

/// The name of the values that hold the boundary markers of points.
const MARKER: &str = "boundary marker";

/// Writes `.node` and `.ele` files with the stem of `path`, numbered from 0, with coordinates that keep every bit.
///
/// # Errors
/// [`MeshError::Io`] if a file cannot be written.
pub fn write_tetgen(path: impl AsRef<Path>, mesh: &TetMesh) -> Result<(), MeshError> {
    write_pair(path.as_ref(), mesh, &[], &[], &[])
}

/// The same with the scalars of a file as attributes, in their order, and its regions as the last attribute of tets.
/// The scalars `boundary marker` of particles are markers if whole numbers of 32 bits. Vectors have no place.
///
/// # Errors
/// [`MeshError::FieldLength`] if regions or values are not one for each element, [`MeshError::Io`] if a file cannot be
/// written.
pub fn write_tetgen_file(path: impl AsRef<Path>, file: &MeshFile) -> Result<(), MeshError> {
    file.check()?;
    write_pair(
        path.as_ref(),
        &file.mesh,
        &file.regions,
        &file.particles,
        &file.tets,
    )
}

fn write_pair(
    path: &Path,
    mesh: &TetMesh,
    regions: &[i32],
    particles: &[NamedValues],
    tets: &[NamedValues],
) -> Result<(), MeshError> {
    let scalars = |values: &NamedValues| matches!(values.values, OwnedValues::Scalars(_));
    let markers = particles.iter().find_map(|values| match &values.values {
        OwnedValues::Scalars(scalars) if values.name == MARKER => whole(scalars),
        _ => None,
    });
    let of_particles: Vec<_> = particles
        .iter()
        .filter(|values| scalars(values) && !(markers.is_some() && values.name == MARKER))
        .collect();
    let of_tets: Vec<_> = tets.iter().filter(|values| scalars(values)).collect();
    write_atomically(path.with_extension("node"), |file| {
        let (points, attributes) = (mesh.positions.len(), of_particles.len());
        writeln!(
            file,
            "{points} 3 {attributes} {}",
            u8::from(markers.is_some())
        )?;
        for (i, p) in mesh.positions.iter().enumerate() {
            let marker = Optional(markers.as_ref().map(|markers| markers[i]));
            let attributes = Attributes(&of_particles, i);
            writeln!(
                file,
                "{i} {:?} {:?} {:?}{attributes}{marker}",
                p.x, p.y, p.z
            )?;
        }
        Ok(())
    })?;
    write_atomically(path.with_extension("ele"), |file| {
        let attributes = of_tets.len() + usize::from(!regions.is_empty());
        writeln!(file, "{} 4 {attributes}", mesh.tets.len())?;
        for (i, [a, b, c, d]) in mesh.tets.iter().enumerate() {
            let region = Optional(regions.get(i).copied());
            let attributes = Attributes(&of_tets, i);
            writeln!(file, "{i} {a} {b} {c} {d}{attributes}{region}")?;
        }
        Ok(())
    })
}

/// The attributes of one element, a space before each.
struct Attributes<'a>(&'a [&'a NamedValues], usize);

impl Display for Attributes<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for values in self.0 {
            if let OwnedValues::Scalars(scalars) = &values.values {
                write!(f, " {:?}", scalars[self.1])?;
            }
        }
        Ok(())
    }
}

/// A number after a space, or nothing.
struct Optional(Option<i32>);

impl Display for Optional {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.map_or(Ok(()), |number| write!(f, " {number}"))
    }
}

/// The same numbers as integers, if all are.
fn whole(values: &[f64]) -> Option<Vec<i32>> {
    let integer = |value: &f64| {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "compared with the original"
        )]
        let number = *value as i32;
        (f64::from(number).to_bits() == value.to_bits()).then_some(number)
    };
    values.iter().map(integer).collect()
}

/// Reads the `.node` and `.ele` files with the stem of `path`; see [`read`](super::read). Tets are oriented positively.
///
/// # Errors
/// As for [`read`](super::read).
pub fn read_tetgen(path: impl AsRef<Path>) -> Result<TetMesh, MeshError> {
    read_tetgen_file(path).map(|file| file.mesh)
}

/// The same with attributes, boundary markers and regions.
///
/// # Errors
/// As for [`read`](super::read).
///
/// # Example
/// ```
/// use incise_mesh::{generate::kuhn_box, glam::DVec3, io};
///
/// let path = std::env::temp_dir().join(format!("incise-doc-file-{}.node", std::process::id()));
/// let mut file = io::MeshFile::from(kuhn_box([2, 2, 2], DVec3::splat(0.1)));
/// file.regions = (0..).take(file.mesh.tets.len()).collect();
/// io::write_tetgen_file(&path, &file)?;
/// assert_eq!(io::read_tetgen_file(&path)?, file);
/// # std::fs::remove_file(path.with_extension("ele")).ok();
/// # std::fs::remove_file(path).ok();
/// # Ok::<(), incise_mesh::MeshError>(())
/// ```
pub fn read_tetgen_file(path: impl AsRef<Path>) -> Result<MeshFile, MeshError> {
    let path = path.as_ref();
    let (node_path, ele_path) = (path.with_extension("node"), path.with_extension("ele"));
    let nodes = Text::read(&node_path)?;
    parse_tetgen(&nodes, || Text::read(&ele_path))
}

/// The same for files that are read already, or will be.
fn parse_tetgen<'a>(
    nodes: &Text<'_>,
    elements: impl FnOnce() -> Result<Text<'a>, MeshError>,
) -> Result<MeshFile, MeshError> {
    let (positions, particles, base) = read_nodes(nodes)?;
    let (tets, mut attributes) = read_tets(&elements()?, base, positions.len())?;
    if tets.is_empty() {
        return Err(MeshError::Empty);
    }
    let regions = attributes.last().and_then(|last| whole(last));
    if regions.is_some() {
        attributes.pop();
    }
    let mut mesh = TetMesh { positions, tets };
    mesh.orient_positively();
    Ok(MeshFile {
        mesh,
        regions: regions.unwrap_or_default(),
        particles,
        tets: named(attributes),
    })
}

/// Columns of attributes with the names they get.
fn named(columns: Vec<Vec<f64>>) -> Vec<NamedValues> {
    let values = (1..).zip(columns).map(|(i, column)| NamedValues {
        name: format!("attribute {i}"),
        values: OwnedValues::Scalars(column),
    });
    values.collect()
}

type Nodes = (Vec<DVec3>, Vec<NamedValues>, usize);

fn read_nodes(text: &Text<'_>) -> Result<Nodes, MeshError> {
    let mut rows = rows(text);
    let mut header = rows
        .next()
        .ok_or_else(|| text.ends_early("the number of points"))?;
    let count = header.count("the number of points")?;
    let dimension = header.count("the dimension")?;
    if dimension != 3 {
        return Err(text.error(
            header.line,
            format!("the points have {dimension} coordinates instead of 3"),
        ));
    }
    let attributes = header.count_or_0("the number of attributes")?;
    let marked = match header.count_or_0("whether there are markers")? {
        0 => false,
        1 => true,
        other => {
            let message = format!("0 or 1 boundary markers expected, not {other}");
            return Err(text.error(header.line, message));
        }
    };
    let mut positions = Vec::with_capacity(text.room_for(count, 8));
    let mut columns = Vec::new();
    let mut markers = Vec::new();
    let mut base = 0;
    for i in 0..count {
        let mut row = rows.next().ok_or_else(|| {
            text.ends_early(&format!("{count} points announced but {i} found, more"))
        })?;
        let number = row.count("the number of a point")?;
        if i == 0 && number == 1 {
            base = 1;
        }
        if number != base + i {
            let message = format!(
                "point {} expected but {number} found, number them without gaps from 0 or 1",
                base + i
            );
            return Err(text.error(row.line, message));
        }
        positions.push(DVec3::new(
            row.coordinate()?,
            row.coordinate()?,
            row.coordinate()?,
        ));
        row.attributes(attributes, i, &mut columns)?;
        if marked {
            markers.push(f64::from(row.marker()?));
        }
    }
    let mut particles = named(columns);
    if !markers.is_empty() {
        particles.push(NamedValues {
            name: MARKER.to_owned(),
            values: OwnedValues::Scalars(markers),
        });
    }
    Ok((positions, particles, base))
}

type Elements = (Vec<[ParticleId; 4]>, Vec<Vec<f64>>);

fn read_tets(text: &Text<'_>, base: usize, particles: usize) -> Result<Elements, MeshError> {
    let mut rows = rows(text);
    let mut header = rows
        .next()
        .ok_or_else(|| text.ends_early("the number of tets"))?;
    let count = header.count("the number of tets")?;
    let corners = header.count("the number of points of a tet")?;
    if corners != 4 && corners != 10 {
        return Err(text.error(
            header.line,
            format!("the tets have {corners} points instead of 4 or 10"),
        ));
    }
    let attributes = header.count_or_0("the number of attributes")?;
    let mut tets = Vec::with_capacity(text.room_for(count, 10));
    let mut columns = Vec::new();
    for i in 0..count {
        let mut row = rows.next().ok_or_else(|| {
            text.ends_early(&format!("{count} tets announced but {i} found, more"))
        })?;
        row.count("the number of a tet")?;
        let mut tet = [ParticleId(0); 4];
        for corner in &mut tet {
            let number = row.count("a point of a tet")?;
            if number < base || number - base >= particles {
                let message = format!(
                    "point {number} does not exist, there are {particles} counted from {base}"
                );
                return Err(text.error(row.line, message));
            }
            *corner = ParticleId::new(number - base);
        }
        for _ in 4..corners {
            row.word("a point between")?;
        }
        row.attributes(attributes, i, &mut columns)?;
        tets.push(tet);
    }
    Ok((tets, columns))
}

/// A line with content.
struct Row<'t, 'a, I> {
    text: &'t Text<'a>,
    words: I,
    line: usize,
}

impl<'t, I: Iterator<Item = &'t [u8]>> Row<'t, '_, I> {
    fn word(&mut self, what: &str) -> Result<Word<'t>, MeshError> {
        let line = self.line;
        let text = self.words.next().ok_or_else(|| {
            self.text
                .error(line, format!("the line ends before {what}"))
        })?;
        Ok(Word {
            text,
            line,
            first: false,
        })
    }

    fn count(&mut self, what: &str) -> Result<usize, MeshError> {
        let word = self.word(what)?;
        self.text.count(word, what)
    }

    /// The same where older files have nothing.
    fn count_or_0(&mut self, what: &str) -> Result<usize, MeshError> {
        let line = self.line;
        self.words.next().map_or(Ok(0), |text| {
            let first = false;
            self.text.count(Word { text, line, first }, what)
        })
    }

    /// Adds the attributes of element `i` to their columns, which element 0 makes.
    fn attributes(
        &mut self,
        count: usize,
        i: usize,
        columns: &mut Vec<Vec<f64>>,
    ) -> Result<(), MeshError> {
        for k in 0..count {
            let value: f64 = self.parsed("an attribute")?;
            if i == 0 {
                columns.push(Vec::new());
            }
            columns[k].push(value);
        }
        Ok(())
    }

    fn marker(&mut self) -> Result<i32, MeshError> {
        self.parsed("a boundary marker")
    }

    fn parsed<N: std::str::FromStr>(&mut self, what: &str) -> Result<N, MeshError> {
        let word = self.word(what)?;
        let number = str::from_utf8(word.text).ok().and_then(|w| w.parse().ok());
        number.ok_or_else(|| {
            let message = format!("{:?} is not {what}: a number expected", show(word.text));
            self.text.error(word.line, message)
        })
    }

    fn coordinate(&mut self) -> Result<f64, MeshError> {
        let word = self.word("a coordinate")?;
        self.text.coordinate(word)
    }
}

fn rows<'t, 'a>(
    text: &'t Text<'a>,
) -> impl Iterator<Item = Row<'t, 'a, impl Iterator<Item = &'t [u8]>>> {
    text.lines(1).filter_map(move |(line, content)| {
        let content = content.split(|&b| b == b'#').next().unwrap_or_default();
        let mut words = words_of(content).peekable();
        words.peek()?;
        Some(Row { text, words, line })
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::generate::kuhn_box;

    fn parse(nodes: &str, elements: &str) -> Result<MeshFile, MeshError> {
        let text = Text::new(Path::new("a.node"), nodes.as_bytes());
        parse_tetgen(&text, || {
            Ok(Text::new(Path::new("a.ele"), elements.as_bytes()))
        })
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
}
