//! Shared parts of VTK's XML formats: data arrays in base64, and escaped names.
//!
//! Numbers are stored as little-endian binary, encoded in base64: exact, a third of the size of text, and valid XML.
//!
//! Source: "VTK XML Formats" (Kitware).

use std::fmt::{self, Display};
use std::io::{self, Write};

use glam::DVec3;

use crate::base64::base64;
use crate::{Field, Values};

/// The opening line of a file of the given type.
pub(super) fn open(out: &mut dyn Write, kind: &str) -> io::Result<()> {
    writeln!(out, "<?xml version=\"1.0\"?>")?;
    writeln!(
        out,
        "<VTKFile type=\"{kind}\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">"
    )
}

/// An array of integers; `kind` is `Int64`, `Int32` or `UInt8`.
pub(super) fn integers<const N: usize>(
    out: &mut dyn Write,
    kind: &str,
    name: &str,
    values: impl Iterator<Item = [u8; N]>,
) -> io::Result<()> {
    array(out, kind, name, 1, values)
}

/// The positions of a mesh.
pub(super) fn positions(
    out: &mut dyn Write,
    positions: impl Iterator<Item = DVec3>,
) -> io::Result<()> {
    writeln!(out, "<Points>")?;
    vectors(out, "Points", positions)?;
    writeln!(out, "</Points>")
}

/// A section of fields; `pick` chooses and orders the elements to write, `None` all of them.
pub(super) fn fields(
    out: &mut dyn Write,
    tag: &str,
    fields: &[Field<'_>],
    pick: Option<&[usize]>,
) -> io::Result<()> {
    writeln!(out, "<{tag}>")?;
    arrays(out, fields, pick)?;
    writeln!(out, "</{tag}>")
}

/// The arrays of a section of fields.
pub(super) fn arrays(
    out: &mut dyn Write,
    fields: &[Field<'_>],
    pick: Option<&[usize]>,
) -> io::Result<()> {
    for field in fields {
        match (field.values, pick) {
            (Values::Scalars(v), None) => scalars(out, field.name, v.iter().copied())?,
            (Values::Scalars(v), Some(pick)) => {
                scalars(out, field.name, pick.iter().map(|&i| v[i]))?;
            }
            (Values::Vectors(v), None) => vectors(out, field.name, v.iter().copied())?,
            (Values::Vectors(v), Some(pick)) => {
                vectors(out, field.name, pick.iter().map(|&i| v[i]))?;
            }
        }
    }
    Ok(())
}

fn scalars(out: &mut dyn Write, name: &str, values: impl Iterator<Item = f64>) -> io::Result<()> {
    array(out, "Float64", name, 1, values.map(f64::to_le_bytes))
}

fn vectors(out: &mut dyn Write, name: &str, values: impl Iterator<Item = DVec3>) -> io::Result<()> {
    array(
        out,
        "Float64",
        name,
        3,
        values.flat_map(|v| v.to_array()).map(f64::to_le_bytes),
    )
}

fn array<const N: usize>(
    out: &mut dyn Write,
    kind: &str,
    name: &str,
    components: usize,
    values: impl Iterator<Item = [u8; N]>,
) -> io::Result<()> {
    let data: Vec<u8> = values.flatten().collect();
    write!(
        out,
        "<DataArray type=\"{kind}\" Name=\"{}\" format=\"binary\"",
        Escaped(name)
    )?;
    // Some readers make a table with one column of an array with one component.
    if components > 1 {
        write!(out, " NumberOfComponents=\"{components}\"")?;
    }
    writeln!(out, ">")?;
    // One base64 text for the length and the data together.
    let mut bytes = (data.len() as u64).to_le_bytes().to_vec();
    bytes.extend(data);
    base64(out, &bytes)?;
    writeln!(out, "\n</DataArray>")
}

/// A text inside an XML attribute; control characters, which XML forbids, are replaced by spaces.
pub(super) struct Escaped<'a>(pub(super) &'a str);

impl Display for Escaped<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for c in self.0.chars() {
            match c {
                '&' => f.write_str("&amp;")?,
                '<' => f.write_str("&lt;")?,
                '>' => f.write_str("&gt;")?,
                '"' => f.write_str("&quot;")?,
                c if c.is_control() => f.write_str(" ")?,
                c => write!(f, "{c}")?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_escaped() {
        assert_eq!(
            Escaped("a<b> & \"c\"\n").to_string(),
            "a&lt;b&gt; &amp; &quot;c&quot; "
        );
    }
}
