//! Graphs from text files.
//!
//! Common parts of the formats: lines of words, a header with counts, vertices from 1. A reader
//! reserves no memory for announced counts, so memory is proportional to the length of the file. It
//! works on bytes, so comments may have any encoding. For any input the result is a graph or an
//! error with the line.
//!
//! Cost: one pass over the file and [`ConstraintGraph::from_edges`].

mod dimacs;
mod matrix_market;

use std::io::{BufRead, Read};

pub use dimacs::read_dimacs;
pub use matrix_market::read_matrix_market;

use crate::{ConstraintGraph, GraphError};

/// Longest line in bytes. Matrix Market allows 1024, but comments are often longer.
const LONGEST_LINE: u16 = u16::MAX;

/// Vertices accepted without any edge; each listed edge allows [`VERTICES_PER_EDGE`] more.
const FREE_VERTICES: u64 = 1 << 20;
/// See [`FREE_VERTICES`].
const VERTICES_PER_EDGE: u64 = 16;

/// A source, line by line.
struct Lines<R> {
    source: R,
    buffer: Vec<u8>,
    /// The number of lines read so far, which is the number of the current line.
    number: usize,
}

impl<R: BufRead> Lines<R> {
    fn new(source: R) -> Self {
        Self {
            source,
            buffer: Vec::new(),
            number: 0,
        }
    }

    /// The next line, `None` at the end.
    fn next(&mut self) -> Result<Option<Line<'_>>, GraphError> {
        self.buffer.clear();
        let limit = u64::from(LONGEST_LINE) + 1;
        let result = self
            .source
            .by_ref()
            .take(limit)
            .read_until(b'\n', &mut self.buffer);
        match result {
            Err(error) => Err(GraphError::Unreadable {
                line: self.number + 1,
                kind: error.kind(),
                message: error.to_string(),
            }),
            Ok(0) => Ok(None),
            Ok(bytes) => {
                self.number += 1;
                let line = Line {
                    number: self.number,
                    bytes: &self.buffer,
                };
                if bytes > usize::from(LONGEST_LINE) && line.bytes.last() != Some(&b'\n') {
                    return Err(line.malformed(format!(
                        "the line is longer than {LONGEST_LINE} bytes, break it"
                    )));
                }
                Ok(Some(line))
            }
        }
    }

    /// An error at the end of the file.
    fn ends_early(&self, missing: &str) -> GraphError {
        GraphError::Malformed {
            line: self.number.max(1),
            message: format!("the file ends early: {missing}"),
        }
    }
}

/// A line and its number, counted from 1.
#[derive(Clone, Copy)]
struct Line<'a> {
    number: usize,
    bytes: &'a [u8],
}

impl<'a> Line<'a> {
    /// The words between blanks; line ends of all systems count as blanks.
    fn words(self) -> impl Iterator<Item = &'a [u8]> {
        self.bytes
            .split(u8::is_ascii_whitespace)
            .filter(|word| !word.is_empty())
    }

    fn malformed(self, message: impl Into<String>) -> GraphError {
        GraphError::Malformed {
            line: self.number,
            message: message.into(),
        }
    }

    /// The words, if there are exactly `N`.
    fn exactly<const N: usize>(self, expected: &str) -> Result<[&'a [u8]; N], GraphError> {
        let mut words = self.words();
        let mut result = [&[][..]; N];
        let mut found = 0;
        for (slot, word) in result.iter_mut().zip(words.by_ref()) {
            *slot = word;
            found += 1;
        }
        found += words.count();
        if found == N {
            Ok(result)
        } else {
            Err(self.malformed(format!("{expected} expected, found {found} word(s)")))
        }
    }

    /// Parses a word as a whole number from 0 on.
    fn count(self, word: &[u8], what: &str) -> Result<u64, GraphError> {
        if !word.iter().all(u8::is_ascii_digit) {
            let word = show(word);
            return Err(self.malformed(format!("{word} is not {what}: a whole number expected")));
        }
        str::from_utf8(word)
            .ok()
            .and_then(|digits| digits.parse().ok())
            .ok_or_else(|| self.malformed(format!("{} is too large for {what}", show(word))))
    }

    /// Parses a word as the number of vertices of the graph.
    fn vertex_count(self, word: &[u8]) -> Result<u32, GraphError> {
        let count = self.count(word, "a number of vertices")?;
        u32::try_from(count).map_err(|_| {
            self.malformed(format!(
                "{count} vertices are too many: at most {} fit",
                u32::MAX
            ))
        })
    }

    /// Parses a word as a vertex: from 1 in the file, from 0 here.
    fn vertex(self, word: &[u8], vertices: u32) -> Result<u32, GraphError> {
        let number = self.count(word, "a vertex")?;
        match u32::try_from(number) {
            Ok(0) => Err(self.malformed("there is no vertex 0: vertices are numbered from 1")),
            Ok(number) if number <= vertices => Ok(number - 1),
            _ => Err(self.malformed(format!(
                "there is no vertex {number}: the header announces {vertices} vertices"
            ))),
        }
    }
}

/// A word for a message: quoted, printable, and shortened if it is long.
fn show(word: &[u8]) -> String {
    format!("{:?}", String::from_utf8_lossy(&word[..word.len().min(40)]))
}

/// Builds the graph, or an error if nearly all vertices have no edge: a header of a few bytes must
/// not fill the memory. `header` is the line with the counts, `listed` the number of edges or
/// entries found.
fn build(
    header: usize,
    vertices: u32,
    listed: u64,
    edges: &[(u32, u32)],
) -> Result<ConstraintGraph, GraphError> {
    if u64::from(vertices) > FREE_VERTICES + VERTICES_PER_EDGE * listed {
        return Err(GraphError::Malformed {
            line: header,
            message: format!(
                "{vertices} vertices are not believable with {listed} edges: correct the header or \
                 leave out vertices without edges"
            ),
        });
    }
    ConstraintGraph::from_edges(vertices as usize, edges)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufReader, Error, ErrorKind};

    /// A source that fails after its first bytes.
    struct Broken(&'static [u8]);

    impl Read for Broken {
        fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Error> {
            match self.0.read(buffer)? {
                0 => Err(Error::new(ErrorKind::TimedOut, "the line went dead")),
                count => Ok(count),
            }
        }
    }

    #[test]
    fn errors_of_the_source_are_returned() {
        let failed = GraphError::Unreadable {
            line: 3,
            kind: ErrorKind::TimedOut,
            message: "the line went dead".into(),
        };
        let broken = BufReader::new(Broken(b"p edge 2 1\nc\ne 1"));
        assert_eq!(read_dimacs(broken), Err(failed.clone()));
        let broken = b"%%MatrixMarket matrix coordinate pattern general\n%\n2";
        let broken = BufReader::new(Broken(broken));
        assert_eq!(read_matrix_market(broken), Err(failed));
    }

    #[test]
    fn the_longest_line_is_the_longest() {
        let longest = usize::from(LONGEST_LINE);
        for (length, end) in [(longest, ""), (longest, "\n"), (longest - 1, "\r\n")] {
            let text = "c".repeat(length) + end + "p col 3 0";
            let text = if end.is_empty() {
                "p col 3 0\n".to_owned() + &"c".repeat(length)
            } else {
                text
            };
            assert_eq!(read_dimacs(text.as_bytes()).unwrap().vertex_count(), 3);
        }
        let text = "p col 3 0\n".to_owned() + &"c".repeat(longest + 1);
        let error = read_dimacs(text.as_bytes()).unwrap_err();
        assert!(
            error
                .to_string()
                .starts_with("line 2: the line is longer than 65535"),
            "{error}"
        );
    }

    #[test]
    fn a_header_alone_reserves_no_memory() {
        let many = read_dimacs(&b"p edge 1048576 0"[..]).unwrap();
        assert_eq!(many.vertex_count(), 1 << 20);
        assert!(read_dimacs(&b"p edge 1048577 0"[..]).is_err());
        let with_edge = read_dimacs(&b"p edge 1048592 1\ne 1 1048592"[..]).unwrap();
        assert_eq!(with_edge.neighbors(0), [1_048_591]);
    }
}
