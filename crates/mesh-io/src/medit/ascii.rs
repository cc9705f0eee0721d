//! The ASCII form: words, with `#` comments to the end of the line. Linear.

use std::io::{self, Write};
use std::iter::Peekable;
use std::path::Path;

use glam::DVec3;
use incise_mesh::ParticleId;

use super::{Contents, OTHER_VOLUMES, point_references, reference};
use crate::text::{Text, Word, show, without_comment, words_of};
use crate::{MeshFile, MeshIoError};

/// Writes a file of version 2: coordinates are doubles.
pub(super) fn write(out: &mut dyn Write, file: &MeshFile) -> io::Result<()> {
    let (mesh, points) = (&file.mesh, point_references(file).unwrap_or_default());
    writeln!(out, "MeshVersionFormatted 2\nDimension 3")?;
    writeln!(out, "Vertices\n{}", mesh.positions.len())?;
    for (i, p) in mesh.positions.iter().enumerate() {
        writeln!(
            out,
            "{:?} {:?} {:?} {}",
            p.x,
            p.y,
            p.z,
            reference(&points, i)
        )?;
    }
    writeln!(out, "Tetrahedra\n{}", mesh.tets.len())?;
    for (i, tet) in mesh.tets.iter().enumerate() {
        let [a, b, c, d] = tet.map(|p| u64::from(p.0) + 1);
        writeln!(out, "{a} {b} {c} {d} {}", reference(&file.regions, i))?;
    }
    writeln!(out, "End")
}

pub(super) fn parse(bytes: &[u8], path: &Path) -> Result<MeshFile, MeshIoError> {
    let text = Text::new(path, bytes);
    let words = text.lines(1).flat_map(|(line, content)| {
        words_of(without_comment(content)).map(move |text| Word::new(text, line))
    });
    let mut reader = Reader {
        text: &text,
        words: words.peekable(),
    };
    let contents = reader.sections()?;
    contents.finish(|line, message| text.error(line, message))
}

struct Reader<'t, 'a, I: Iterator<Item = Word<'t>>> {
    text: &'t Text<'a>,
    words: Peekable<I>,
}

impl<'t, I: Iterator<Item = Word<'t>>> Reader<'t, '_, I> {
    fn sections(&mut self) -> Result<Contents, MeshIoError> {
        let start = self.word("MeshVersionFormatted")?;
        if !is(start, "MeshVersionFormatted") {
            let message = "the file does not start with MeshVersionFormatted: not a Medit file";
            return Err(self.text.error(start.line, message));
        }
        // Numbers are read as doubles in all versions.
        let version = self.word("the version")?;
        if !(1..=4).contains(&self.integer(version, "a version")?) {
            let message = format!("version {} is not 1 to 4", show(version.text));
            return Err(self.text.error(version.line, message));
        }
        let mut contents = Contents::default();
        let mut three = false;
        loop {
            let keyword = self.word("the keyword End")?;
            if is(keyword, "End") {
                return Ok(contents);
            } else if is(keyword, "Dimension") {
                let dimension = self.word("the dimension")?;
                if dimension.text != b"3" {
                    let message = format!("dimension 3 expected, not {}", show(dimension.text));
                    return Err(self.text.error(dimension.line, message));
                }
                three = true;
            } else if is(keyword, "Vertices") {
                if !three {
                    let message = "Vertices before Dimension 3";
                    return Err(self.text.error(keyword.line, message));
                }
                self.once(&mut contents.seen[0], keyword)?;
                self.points(&mut contents)?;
            } else if is(keyword, "Tetrahedra") {
                self.once(&mut contents.seen[1], keyword)?;
                self.tets(&mut contents)?;
            } else if let Some((name, _)) = OTHER_VOLUMES.iter().find(|(n, _)| is(keyword, n)) {
                let count = self.count("the number of cells")?;
                if count > 0 {
                    let message = format!("there are {count} {name}: only tets are read");
                    return Err(self.text.error(keyword.line, message));
                }
            } else if keyword.text[0].is_ascii_alphabetic() {
                while self
                    .words
                    .next_if(|w| !w.text[0].is_ascii_alphabetic())
                    .is_some()
                {}
            } else {
                let message = format!("a keyword expected, not {:?}", show(keyword.text));
                return Err(self.text.error(keyword.line, message));
            }
        }
    }

    fn points(&mut self, contents: &mut Contents) -> Result<(), MeshIoError> {
        let count = self.count("the number of points")?;
        let room = self.text.room_for(count, 8);
        contents.positions.reserve_exact(room);
        contents.point_references.reserve_exact(room);
        for _ in 0..count {
            let mut position = DVec3::ZERO;
            for axis in 0..3 {
                let word = self.word("a coordinate")?;
                position[axis] = self.text.coordinate(word)?;
            }
            contents.positions.push(position);
            contents.point_references.push(self.reference()?);
        }
        Ok(())
    }

    fn tets(&mut self, contents: &mut Contents) -> Result<(), MeshIoError> {
        let count = self.count("the number of tets")?;
        let room = self.text.room_for(count, 10);
        contents.tets.reserve_exact(room);
        contents.tet_references.reserve_exact(room);
        for _ in 0..count {
            let mut tet = [ParticleId(0); 4];
            for corner in &mut tet {
                let word = self.word("a point of a tet")?;
                let number = self.integer(word, "a point of a tet")?;
                *corner = contents.corner(number, word.line).ok_or_else(|| {
                    let message = format!("point {number} cannot be: points count from 1");
                    self.text.error(word.line, message)
                })?;
            }
            contents.tets.push(tet);
            contents.tet_references.push(self.reference()?);
        }
        Ok(())
    }

    fn once(&self, seen: &mut bool, keyword: Word<'_>) -> Result<(), MeshIoError> {
        if std::mem::replace(seen, true) {
            let message = format!("a second section {}", show(keyword.text));
            return Err(self.text.error(keyword.line, message));
        }
        Ok(())
    }

    fn word(&mut self, what: &str) -> Result<Word<'t>, MeshIoError> {
        self.words.next().ok_or_else(|| self.text.ends_early(what))
    }

    fn count(&mut self, what: &str) -> Result<usize, MeshIoError> {
        let word = self.word(what)?;
        self.text.count(word, what)
    }

    fn integer(&self, word: Word<'_>, what: &str) -> Result<i64, MeshIoError> {
        let number = str::from_utf8(word.text).ok().and_then(|w| w.parse().ok());
        number.ok_or_else(|| {
            let message = format!(
                "{:?} is not {what}: a whole number expected",
                show(word.text)
            );
            self.text.error(word.line, message)
        })
    }

    fn reference(&mut self) -> Result<i32, MeshIoError> {
        let word = self.word("a reference")?;
        let number = self.integer(word, "a reference")?;
        i32::try_from(number).map_err(|_| {
            let message = format!("the reference {number} does not fit in 32 bits");
            self.text.error(word.line, message)
        })
    }
}

fn is(word: Word<'_>, keyword: &str) -> bool {
    word.text.eq_ignore_ascii_case(keyword.as_bytes())
}
