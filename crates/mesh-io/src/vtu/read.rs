//! Reading VTK XML unstructured grids.
//!
//! The elements are walked once, up to the appended data, which need not be XML. The positions of the arrays are
//! stored, and the arrays are decoded afterwards, when all counts are known. Errors have the line of the array, or the
//! byte of the appended data. Linear.

use std::path::Path;

use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};

use super::data::{Storage, Stream};
use crate::text::{show, words_of};
use crate::vtk_grid::{Grid, named_values, positions};
use crate::vtk_kind::Kind;
use crate::{MeshFile, MeshIoError, NamedValues};

/// The mesh with its regions and fields.
pub(crate) fn parse_vtu(bytes: &[u8], path: &Path) -> Result<MeshFile, MeshIoError> {
    // A byte order mark is not part of the text.
    let start = if bytes.starts_with(b"\xef\xbb\xbf") {
        3
    } else {
        0
    };
    let mut document = Document {
        input: Input { path, bytes },
        storage: None,
        piece: None,
        arrays: Vec::new(),
        appended: None,
        used: std::cell::Cell::new(0),
    };
    document.walk(start)?;
    document.finish()
}

/// The file, for positions in errors.
#[derive(Clone, Copy)]
struct Input<'b> {
    path: &'b Path,
    bytes: &'b [u8],
}

impl Input<'_> {
    /// An error on the line of the given byte.
    fn error(self, at: usize, message: impl Into<String>) -> MeshIoError {
        let before = &self.bytes[..at.min(self.bytes.len())];
        MeshIoError::Parse {
            path: self.path.to_owned(),
            line: 1 + before.iter().filter(|&&b| b == b'\n').count(),
            message: message.into(),
        }
    }

    fn ends_early(self, missing: &str) -> MeshIoError {
        self.error(
            self.bytes.len().saturating_sub(1),
            format!("the file ends early: {missing} expected, get the complete file"),
        )
    }
}

/// The owner of an array.
#[derive(Clone, Copy, PartialEq)]
enum Section {
    PointData,
    CellData,
    Points,
    Cells,
}

impl Section {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "PointData" => Self::PointData,
            "CellData" => Self::CellData,
            "Points" => Self::Points,
            "Cells" => Self::Cells,
            _ => return None,
        })
    }
}

/// The names of the arrays of cells.
const CELL_ARRAYS: [&str; 3] = ["offsets", "connectivity", "types"];

/// A data array that has not been decoded.
struct Array {
    section: Section,
    name: String,
    /// The type; `None` for an unknown one.
    kind: Option<Kind>,
    components: usize,
    format: Format,
    /// The start of its element.
    at: usize,
}

enum Format {
    Ascii(Vec<u8>),
    Inline(Vec<u8>),
    Appended(usize),
}

struct Document<'b> {
    input: Input<'b>,
    storage: Option<Storage>,
    /// The numbers of points and cells.
    piece: Option<[usize; 2]>,
    arrays: Vec<Array>,
    /// The start of the appended data, and true if they are raw.
    appended: Option<(usize, bool)>,
    /// Bytes of the appended data that have been used.
    used: std::cell::Cell<usize>,
}

impl Document<'_> {
    fn walk(&mut self, start: usize) -> Result<(), MeshIoError> {
        let input = self.input;
        let mut reader = quick_xml::Reader::from_reader(&input.bytes[start..]);
        reader.config_mut().expand_empty_elements = true;
        let mut section = None;
        // The number of open elements inside an array, including itself: text belongs to it at 1.
        let mut depth = 0_usize;
        // True if that array is kept; true after an array of points.
        let (mut kept, mut has_points) = (false, false);
        loop {
            let position = |reader: &quick_xml::Reader<&[u8]>| {
                usize::try_from(reader.buffer_position())
                    .map_or(input.bytes.len(), |position| start + position)
            };
            let at = position(&reader);
            let event = reader
                .read_event()
                .map_err(|error| input.error(at, format!("the file is no sound XML: {error}")))?;
            match event {
                Event::Start(_) if depth > 0 => depth += 1,
                Event::Start(element) => match element.name().as_ref() {
                    "VTKFile" => self.storage = Some(storage(&Element { element, input, at })?),
                    "Piece" => self.piece(&Element { element, input, at })?,
                    "AppendedData" => {
                        let element = Element { element, input, at };
                        let raw = element.text("encoding")?.is_some_and(|name| name == "raw");
                        self.appended = Some((position(&reader), raw));
                        return Ok(());
                    }
                    "DataArray" | "Array" => {
                        depth = 1;
                        kept = false;
                        if let Some(section) = section {
                            let array = array(&Element { element, input, at }, section)?;
                            // An array takes more memory here than in the file, so unused ones are skipped.
                            kept = match section {
                                Section::Points => !std::mem::replace(&mut has_points, true),
                                Section::Cells => CELL_ARRAYS.contains(&array.name.as_str()),
                                Section::PointData | Section::CellData => array.kind.is_some(),
                            };
                            if kept {
                                self.arrays.push(array);
                            }
                        }
                    }
                    name => section = Section::named(name).or(section),
                },
                Event::End(element) => {
                    let name = element.name();
                    if depth > 0 {
                        depth -= 1;
                    } else if Section::named(name.as_ref()).is_some() {
                        section = None;
                    } else if name.as_ref() == "VTKFile" {
                        return Ok(());
                    }
                }
                Event::Text(text) if depth == 1 && kept => self.text(text.as_bytes()),
                Event::CData(text) if depth == 1 && kept => self.text(text.as_bytes()),
                Event::Eof => return Err(input.ends_early("</VTKFile>")),
                _ => {}
            }
        }
    }

    fn text(&mut self, more: &[u8]) {
        if let Some(Array {
            format: Format::Ascii(text) | Format::Inline(text),
            ..
        }) = self.arrays.last_mut()
        {
            text.extend(more);
        }
    }

    fn piece(&mut self, element: &Element<'_>) -> Result<(), MeshIoError> {
        if self.piece.is_some() {
            return Err(element.error("there are several elements Piece, merge them into one"));
        }
        let count = |name| {
            element
                .number(name)?
                .ok_or_else(|| element.error(format!("the element Piece has no {name}")))
        };
        self.piece = Some([count("NumberOfPoints")?, count("NumberOfCells")?]);
        Ok(())
    }

    fn finish(self) -> Result<MeshFile, MeshIoError> {
        let input = self.input;
        let [points, cells] = self
            .piece
            .ok_or_else(|| input.ends_early("an element Piece"))?;
        let array = |section, name: Option<&str>| {
            self.arrays
                .iter()
                .find(|a| a.section == section && name.is_none_or(|name| a.name == name))
                .ok_or_else(|| {
                    let name = name.unwrap_or("Points");
                    input.ends_early(&format!("an array {name}"))
                })
        };
        let coordinates = array(Section::Points, None)?;
        let values = self.reals(coordinates, points.checked_mul(3))?;
        if let Some(value) = values.iter().find(|value| !value.is_finite()) {
            let message = format!("the coordinate {value} is not finite, correct it");
            return Err(input.error(coordinates.at, message));
        }
        let ends = array(Section::Cells, Some("offsets"))?;
        let mut offsets = vec![0];
        offsets.extend(self.indices(ends, cells)?);
        if !offsets.is_sorted() {
            return Err(input.error(ends.at, "the offsets are not in order, correct them"));
        }
        let connectivity = array(Section::Cells, Some("connectivity"))?;
        let size = offsets.last().copied().unwrap_or(0);
        let grid = Grid {
            positions: positions(&values),
            points: self.indices(connectivity, size)?,
            offsets,
            types: self.indices(array(Section::Cells, Some("types"))?, cells)?,
            particles: self.fields(Section::PointData, points)?,
            cells: self.fields(Section::CellData, cells)?,
        };
        grid.into_file(|_, _, message| input.error(connectivity.at, message))
    }

    fn fields(&self, section: Section, count: usize) -> Result<Vec<NamedValues>, MeshIoError> {
        let mut fields = Vec::new();
        for array in self.arrays.iter().filter(|a| a.section == section) {
            // A mesh file does not represent tensors.
            if matches!(array.components, 1 | 3) {
                let values = self.reals(array, count.checked_mul(array.components))?;
                fields.extend(named_values(array.name.clone(), array.components, values));
            }
        }
        Ok(fields)
    }

    fn reals(&self, array: &Array, count: Option<usize>) -> Result<Vec<f64>, MeshIoError> {
        let count = count.ok_or_else(|| self.input.error(array.at, "the counts are too large"))?;
        self.numbers(
            array,
            count,
            |word| str::from_utf8(word).ok()?.parse().ok(),
            |kind, bytes, big_endian| Some(kind.reals(bytes, count, big_endian)),
        )
    }

    fn indices(&self, array: &Array, count: usize) -> Result<Vec<usize>, MeshIoError> {
        self.numbers(
            array,
            count,
            |word| str::from_utf8(word).ok()?.parse().ok(),
            |kind, bytes, big_endian| kind.indices(bytes, count, big_endian).ok(),
        )
    }

    /// Parses an array of exactly this many numbers, from words or from bytes.
    fn numbers<T>(
        &self,
        array: &Array,
        count: usize,
        of_word: impl Fn(&[u8]) -> Option<T>,
        of_bytes: impl Fn(Kind, &[u8], bool) -> Option<Vec<T>>,
    ) -> Result<Vec<T>, MeshIoError> {
        let here = |message: String| {
            let message = format!("array {:?}: {message}", array.name);
            self.input.error(array.at, message)
        };
        let kind = array
            .kind
            .ok_or_else(|| here("its type is not known".to_owned()))?;
        let storage = self
            .storage
            .ok_or_else(|| self.input.error(0, "there is no element VTKFile"))?;
        let size = kind
            .bytes(count)
            .ok_or_else(|| here(format!("{count} numbers are too many")))?;
        let bytes = match &array.format {
            Format::Ascii(text) => {
                let mut numbers = Vec::with_capacity(count.min(text.len() / 2 + 1));
                let mut words = words_of(text);
                for i in 0..count {
                    let word = words
                        .next()
                        .ok_or_else(|| here(format!("{count} numbers expected but {i} found")))?;
                    numbers.push(of_word(word).ok_or_else(|| {
                        here(format!("{:?} is not the number expected", show(word)))
                    })?);
                }
                if words.next().is_some() {
                    return Err(here(format!(
                        "there are more than the {count} numbers expected"
                    )));
                }
                return Ok(numbers);
            }
            Format::Inline(text) => Stream::Base64(text, Vec::new())
                .array(size, storage)
                .map_err(here)?,
            Format::Appended(offset) => self.appended(array, *offset, size, storage)?,
        };
        of_bytes(kind, &bytes, storage.big_endian)
            .ok_or_else(|| here("a number is negative or no integer".to_owned()))
    }

    fn appended(
        &self,
        array: &Array,
        offset: usize,
        size: usize,
        storage: Storage,
    ) -> Result<Vec<u8>, MeshIoError> {
        let Some((start, raw)) = self.appended else {
            return Err(self.input.ends_early("an element AppendedData"));
        };
        let bytes = self.input.bytes;
        let rest = &bytes[start.min(bytes.len())..];
        let blanks = rest.iter().take_while(|b| b.is_ascii_whitespace()).count();
        if rest.get(blanks) != Some(&b'_') {
            return Err(self
                .input
                .error(start, "the appended data do not start with _"));
        }
        let start = start + blanks + 1;
        let data = bytes
            .get(start.saturating_add(offset)..)
            .unwrap_or_default();
        let mut stream = match raw {
            true => Stream::Raw(data),
            false => Stream::Base64(data, Vec::new()),
        };
        let error = |message: String| MeshIoError::ParseBytes {
            path: self.input.path.to_owned(),
            byte: start.saturating_add(offset).min(bytes.len()),
            message: format!("array {:?}: {message}", array.name),
        };
        let decoded = stream.array(size, storage).map_err(error)?;
        // Many arrays on shared bytes would need more memory than the size of the file justifies.
        self.used.set(self.used.get() + data.len() - stream.left());
        if self.used.get() > bytes.len() - start {
            return Err(error(
                "it overlaps others, give each its own offset".to_owned(),
            ));
        }
        Ok(decoded)
    }
}

/// An element with its attributes and its start.
struct Element<'b> {
    element: BytesStart<'b>,
    input: Input<'b>,
    at: usize,
}

impl Element<'_> {
    fn error(&self, message: impl Into<String>) -> MeshIoError {
        self.input.error(self.at, message)
    }

    fn text(&self, name: &str) -> Result<Option<String>, MeshIoError> {
        let unsound = |error: &dyn std::fmt::Display| {
            self.error(format!("the attribute {name} is no sound XML: {error}"))
        };
        let attribute = self
            .element
            .try_get_attribute(name)
            .map_err(|error| unsound(&error))?;
        attribute
            .map(|attribute| attribute.normalized_value(XmlVersion::Implicit1_0))
            .transpose()
            .map(|text| text.map(|text| text.into_owned()))
            .map_err(|error| unsound(&error))
    }

    fn number(&self, name: &str) -> Result<Option<usize>, MeshIoError> {
        let Some(text) = self.text(name)? else {
            return Ok(None);
        };
        text.trim().parse().map(Some).map_err(|_| {
            let text = show(text.as_bytes());
            self.error(format!("{name} is {text:?}: a whole number expected"))
        })
    }
}

/// The representation of numbers in the file, from its first element.
fn storage(element: &Element<'_>) -> Result<Storage, MeshIoError> {
    let attribute = |name, default: &str| {
        let text = element.text(name)?;
        Ok::<_, MeshIoError>(text.unwrap_or_else(|| default.to_owned()))
    };
    let unsupported = |name, found: &str, expected| {
        let found = show(found.as_bytes());
        Err(element.error(format!("{name} is {found:?}: {expected} expected")))
    };
    let kind = attribute("type", "")?;
    if kind != "UnstructuredGrid" {
        return unsupported("the type of the file", &kind, "UnstructuredGrid");
    }
    let order = attribute("byte_order", "LittleEndian")?;
    let header = attribute("header_type", "UInt32")?;
    let compressor = attribute("compressor", "")?;
    Ok(Storage {
        big_endian: match order.as_str() {
            "LittleEndian" => false,
            "BigEndian" => true,
            _ => return unsupported("byte_order", &order, "LittleEndian or BigEndian"),
        },
        header: match header.as_str() {
            "UInt32" => 4,
            "UInt64" => 8,
            _ => return unsupported("header_type", &header, "UInt32 or UInt64"),
        },
        compressed: match compressor.as_str() {
            "" => false,
            "vtkZLibDataCompressor" => true,
            _ => return unsupported("compressor", &compressor, "none or vtkZLibDataCompressor"),
        },
    })
}

fn array(element: &Element<'_>, section: Section) -> Result<Array, MeshIoError> {
    let format = element.text("format")?;
    let format = match format.as_deref() {
        None | Some("ascii") => Format::Ascii(Vec::new()),
        Some("binary") => Format::Inline(Vec::new()),
        Some("appended") => Format::Appended(
            element
                .number("offset")?
                .ok_or_else(|| element.error("an appended array has no offset"))?,
        ),
        Some(other) => {
            let other = show(other.as_bytes());
            let message = format!("format is {other:?}: ascii, binary or appended expected");
            return Err(element.error(message));
        }
    };
    Ok(Array {
        section,
        name: element.text("Name")?.unwrap_or_default(),
        kind: Kind::of_xml(&element.text("type")?.unwrap_or_default()),
        components: element.number("NumberOfComponents")?.unwrap_or(1),
        format,
        at: element.at,
    })
}
