//! The lines with content of a TetGen file, and the numbers on them. Linear.

use crate::MeshIoError;
use crate::text::{Text, Word, show, without_comment, words_of};

/// Each attribute becomes a named field, which takes far more memory than the two bytes of a number.
pub(super) const MOST_ATTRIBUTES: usize = 256;

/// A line with content.
pub(super) struct Row<'t, 'a, I> {
    text: &'t Text<'a>,
    words: I,
    pub(super) line: usize,
}

impl<'t, I: Iterator<Item = &'t [u8]>> Row<'t, '_, I> {
    pub(super) fn word(&mut self, what: &str) -> Result<Word<'t>, MeshIoError> {
        let line = self.line;
        let text = self.words.next().ok_or_else(|| {
            self.text
                .error(line, format!("the line ends before {what}"))
        })?;
        Ok(Word::new(text, line))
    }

    pub(super) fn count(&mut self, what: &str) -> Result<usize, MeshIoError> {
        let word = self.word(what)?;
        self.text.count(word, what)
    }

    /// Reads a count, or returns 0 if the row has ended, as in older files.
    pub(super) fn count_or_0(&mut self, what: &str) -> Result<usize, MeshIoError> {
        let line = self.line;
        self.words
            .next()
            .map_or(Ok(0), |text| self.text.count(Word::new(text, line), what))
    }

    /// Reads the number of attributes of each element; returns a column for each, with capacity for this many elements.
    pub(super) fn columns(&mut self, elements: usize) -> Result<Vec<Vec<f64>>, MeshIoError> {
        let count = self.count_or_0("the number of attributes")?;
        if count > MOST_ATTRIBUTES {
            let message =
                format!("{count} attributes announced, {MOST_ATTRIBUTES} at most are read");
            return Err(self.text.error(self.line, message));
        }
        let room = self.text.room_for(elements, 2 * count.max(1));
        Ok((0..count).map(|_| Vec::with_capacity(room)).collect())
    }

    /// Adds the attributes of an element to their columns.
    pub(super) fn attributes(&mut self, columns: &mut [Vec<f64>]) -> Result<(), MeshIoError> {
        for column in columns {
            column.push(self.parsed("an attribute")?);
        }
        Ok(())
    }

    pub(super) fn marker(&mut self) -> Result<i32, MeshIoError> {
        self.parsed("a boundary marker")
    }

    fn parsed<N: std::str::FromStr>(&mut self, what: &str) -> Result<N, MeshIoError> {
        let word = self.word(what)?;
        let number = str::from_utf8(word.text).ok().and_then(|w| w.parse().ok());
        number.ok_or_else(|| {
            let message = format!("{:?} is not {what}: a number expected", show(word.text));
            self.text.error(word.line, message)
        })
    }

    pub(super) fn coordinate(&mut self) -> Result<f64, MeshIoError> {
        let word = self.word("a coordinate")?;
        self.text.coordinate(word)
    }
}

pub(super) fn rows<'t, 'a>(
    text: &'t Text<'a>,
) -> impl Iterator<Item = Row<'t, 'a, impl Iterator<Item = &'t [u8]>>> {
    text.lines(1).filter_map(move |(line, content)| {
        let mut words = words_of(without_comment(content)).peekable();
        words.peek()?;
        Some(Row { text, words, line })
    })
}
