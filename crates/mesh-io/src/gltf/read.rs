//! Reads glTF: the triangles of all meshes of a scene, at the places that its nodes give them.
//!
//! The crate `gltf` reads and checks the text. Numbers are read here, with bounds that are checked first, because its
//! readers trust the lengths of views. A mesh that several nodes use is repeated; points that several parts of a mesh
//! share stay shared. Points are as in the file, which has several at an edge where normals or textures differ. Skins,
//! morph targets and animations are not applied. Linear.
//!
//! A short text can repeat a large mesh many times. The points and corners of all copies are limited to
//! [`COPIES`] times what fits in the bytes that were read.

use std::path::{Component, Path};

use glam::{DMat3, DVec2, DVec3};
use gltf::accessor::{DataType, Dimensions};
use gltf::mesh::Mode;
use gltf::scene::Transform;
use gltf::{Accessor, Document, Node, Primitive, Semantic};
use incise_mesh::{ParticleId, TriangleSurface};

use super::{BIN, JSON, MAGIC};
use crate::base64::{decode, next_group};
use crate::text::load;
use crate::{MeshIoError, SurfaceFile};

/// The largest ratio of the numbers after and before meshes are repeated.
const COPIES: usize = 4;

/// Reads a surface with its texture coordinates; buffers in files beside this one only if `beside` is true.
pub(crate) fn parse(bytes: &[u8], path: &Path, beside: bool) -> Result<SurfaceFile, MeshIoError> {
    let (text, blob) = if bytes.starts_with(MAGIC) {
        parts(bytes).map_err(|(byte, message)| MeshIoError::ParseBytes {
            path: path.to_owned(),
            byte,
            message: message.to_owned(),
        })?
    } else {
        (bytes, None)
    };
    let root = gltf::json::Root::from_slice(text).map_err(|error| match error.line() {
        0 => content(path, error.to_string()),
        line => MeshIoError::Parse {
            path: path.to_owned(),
            line,
            message: error.to_string(),
        },
    })?;
    // The check of the crate looks these up without a check.
    let accessors = root.accessors.len();
    for (m, mesh) in root.meshes.iter().enumerate() {
        let all = mesh.primitives.iter().enumerate();
        let beyond =
            all.flat_map(|(p, part)| part.attributes.values().map(move |a| (p, a.value())));
        if let Some((p, index)) = beyond.into_iter().find(|&(_, index)| index >= accessors) {
            let why =
                format!("meshes[{m}].primitives[{p}] has accessor {index}, there are {accessors}");
            return Err(content(path, why));
        }
    }
    let document = Document::from_json(root).map_err(|error| content(path, error.to_string()))?;
    let mut reader = Reader::new(path, &document, blob, beside)?;
    reader.limit = COPIES * (bytes.len() + reader.external);
    reader.read(&document)?;
    let Reader { mut file, .. } = reader;
    if file.surface.triangles.is_empty() {
        return Err(content(path, "the scene has no triangles".to_owned()));
    }
    // With some triangles only they describe no surface.
    if file.texture_corners.len() != file.surface.triangles.len() {
        file.texture.clear();
        file.texture_corners.clear();
    }
    Ok(file)
}

fn content(path: &Path, message: String) -> MeshIoError {
    MeshIoError::ParseContent {
        path: path.to_owned(),
        message,
    }
}

/// Byte and reason of an error.
type Wrong = (usize, &'static str);

/// Text and numbers of a binary file.
fn parts(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), Wrong> {
    let number = |at: usize| {
        let word = bytes.get(at..at + 4)?.try_into().ok()?;
        usize::try_from(u32::from_le_bytes(word)).ok()
    };
    let cut = (bytes.len(), "the file ends early, get the complete file");
    let version = number(4).ok_or(cut)?;
    if version != 2 {
        return Err((4, "only version 2 of glTF is supported, convert the file"));
    }
    let part = |at: usize, name: &[u8; 4]| {
        let length = number(at).ok_or(cut)?;
        let kind = bytes.get(at + 4..at + 8).ok_or(cut)?;
        if kind != name {
            return Ok(None);
        }
        let end = (at + 8).checked_add(length).ok_or(cut)?;
        Ok(Some((bytes.get(at + 8..end).ok_or(cut)?, end)))
    };
    let (text, end) = part(12, JSON)?.ok_or((16, "the first part is not JSON"))?;
    let numbers = if end < bytes.len() {
        part(end, BIN)?
    } else {
        None
    };
    Ok((text, numbers.map(|(numbers, _)| numbers)))
}

/// What is read so far.
struct Reader<'a> {
    path: &'a Path,
    buffers: Vec<Buffer<'a>>,
    /// Bytes that were loaded or decoded beside those of the file.
    external: usize,
    /// The largest number of points and corners.
    limit: usize,
    file: SurfaceFile,
}

/// The bytes of a buffer.
enum Buffer<'a> {
    Own(Vec<u8>),
    Blob(&'a [u8]),
}

impl Buffer<'_> {
    fn bytes(&self) -> &[u8] {
        match self {
            Self::Own(bytes) => bytes,
            Self::Blob(bytes) => bytes,
        }
    }
}

/// A linear map and an offset.
#[derive(Clone, Copy)]
struct Placement {
    linear: DMat3,
    offset: DVec3,
}

impl Placement {
    /// The axes of glTF in ours.
    const UPRIGHT: Self = Self {
        linear: DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y),
        offset: DVec3::ZERO,
    };

    fn of(node: &Node<'_>) -> Self {
        match node.transform() {
            Transform::Matrix { matrix } => {
                let [x, y, z, offset] =
                    matrix.map(|[x, y, z, _]| glam::Vec3::new(x, y, z).as_dvec3());
                Self {
                    linear: DMat3::from_cols(x, y, z),
                    offset,
                }
            }
            Transform::Decomposed {
                translation,
                rotation,
                scale,
            } => Self {
                linear: rotation_of(rotation.map(f64::from))
                    * DMat3::from_diagonal(DVec3::from(scale.map(f64::from))),
                offset: DVec3::from(translation.map(f64::from)),
            },
        }
    }

    fn then(self, inner: Self) -> Self {
        Self {
            linear: self.linear * inner.linear,
            offset: self.linear * inner.offset + self.offset,
        }
    }

    fn of_point(&self, point: DVec3) -> DVec3 {
        self.linear * point + self.offset
    }
}

/// The rotation of a quaternion of any length. Exact for quarter turns, whose components have no exact square root.
fn rotation_of([x, y, z, w]: [f64; 4]) -> DMat3 {
    let norm = x * x + y * y + z * z + w * w;
    if norm == 0.0 {
        return DMat3::IDENTITY;
    }
    // Divided last, so that equal squares cancel or give exactly 1.
    let diagonal = |own: f64, b: f64, c: f64| (w * w + own * own - b * b - c * c) / norm;
    let other = |a: f64, b: f64| 2.0 * (a + b) / norm;
    DMat3::from_cols(
        DVec3::new(diagonal(x, y, z), other(x * y, z * w), other(x * z, -y * w)),
        DVec3::new(other(x * y, -z * w), diagonal(y, z, x), other(y * z, x * w)),
        DVec3::new(other(x * z, y * w), other(y * z, -x * w), diagonal(z, x, y)),
    )
}

/// A list of numbers within a buffer.
struct Rows<'b> {
    bytes: &'b [u8],
    stride: usize,
    count: usize,
    kind: DataType,
}

impl Rows<'_> {
    /// A component of a row, as it is stored.
    fn number(&self, row: usize, component: usize) -> f64 {
        let at = row * self.stride + component * self.kind.size();
        let byte = |i: usize| self.bytes[at + i];
        match self.kind {
            DataType::I8 => f64::from(i8::from_le_bytes([byte(0)])),
            DataType::U8 => f64::from(byte(0)),
            DataType::I16 => f64::from(i16::from_le_bytes([byte(0), byte(1)])),
            DataType::U16 => f64::from(u16::from_le_bytes([byte(0), byte(1)])),
            DataType::U32 => f64::from(self.index(row)),
            DataType::F32 => f64::from(f32::from_le_bytes([byte(0), byte(1), byte(2), byte(3)])),
        }
    }

    /// The number in a row of whole numbers.
    fn index(&self, row: usize) -> u32 {
        let at = row * self.stride;
        let mut word = [0; 4];
        let size = self.kind.size();
        word[..size].copy_from_slice(&self.bytes[at..at + size]);
        u32::from_le_bytes(word)
    }
}

impl<'a> Reader<'a> {
    fn new(
        path: &'a Path,
        document: &Document,
        blob: Option<&'a [u8]>,
        beside: bool,
    ) -> Result<Self, MeshIoError> {
        let mut reader = Self {
            path,
            buffers: Vec::new(),
            external: 0,
            limit: 0,
            file: SurfaceFile::default(),
        };
        for buffer in document.buffers() {
            let bytes = match buffer.source() {
                gltf::buffer::Source::Bin => Buffer::Blob(blob.unwrap_or_default()),
                gltf::buffer::Source::Uri(uri) => Buffer::Own(reader.load(uri, beside)?),
            };
            let (found, expected) = (bytes.bytes().len(), buffer.length());
            if found < expected {
                let number = buffer.index();
                let why = format!(
                    "buffers[{number}] has {found} bytes instead of {expected}, get the complete file"
                );
                return Err(content(path, why));
            }
            if let Buffer::Own(bytes) = &bytes {
                reader.external += bytes.len();
            }
            reader.buffers.push(bytes);
        }
        Ok(reader)
    }

    /// The bytes that a URI has in itself or names.
    fn load(&self, uri: &str, beside: bool) -> Result<Vec<u8>, MeshIoError> {
        if let Some(data) = uri.strip_prefix("data:") {
            let (_, text) = data.split_once(";base64,").ok_or_else(|| {
                content(
                    self.path,
                    "a buffer is a data URI without base64".to_owned(),
                )
            })?;
            let mut text = text.as_bytes();
            let mut bytes = Vec::with_capacity(text.len() / 4 * 3);
            while let Some(group) = next_group(&mut text) {
                let (three, count) = decode(group).ok_or_else(|| {
                    let group = String::from_utf8_lossy(&group).into_owned();
                    content(self.path, format!("{group:?} in a buffer is no base64"))
                })?;
                bytes.extend(&three[..count]);
            }
            return Ok(bytes);
        }
        let name = unescaped(uri);
        let is_plain = Path::new(&name)
            .components()
            .all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
        if !beside || !is_plain || name.is_empty() {
            let why = format!(
                "a buffer is in another file, {uri:?}: it must lie in the folder of a file that is read from disk; \
                 a .glb has all in one file"
            );
            return Err(content(self.path, why));
        }
        load(&self.path.with_file_name(&name))
    }

    /// Reads the default scene, or without scenes all meshes.
    fn read(&mut self, document: &Document) -> Result<(), MeshIoError> {
        let scene = document
            .default_scene()
            .or_else(|| document.scenes().next());
        let Some(scene) = scene else {
            for mesh in document.meshes() {
                self.mesh(mesh.primitives(), mesh.index(), Placement::UPRIGHT)?;
            }
            return Ok(());
        };
        let mut is_visited = vec![false; document.nodes().len()];
        let mut waiting: Vec<(Node<'_>, Placement)> = scene
            .nodes()
            .map(|node| (node, Placement::UPRIGHT))
            .collect();
        // In the order of the file.
        waiting.reverse();
        while let Some((node, outer)) = waiting.pop() {
            if std::mem::replace(&mut is_visited[node.index()], true) {
                let why = format!("nodes[{}] is a child of two nodes", node.index());
                return Err(content(self.path, why));
            }
            let placement = outer.then(Placement::of(&node));
            if let Some(mesh) = node.mesh() {
                self.mesh(mesh.primitives(), mesh.index(), placement)?;
            }
            let first = waiting.len();
            waiting.extend(node.children().map(|child| (child, placement)));
            waiting[first..].reverse();
        }
        Ok(())
    }

    /// Adds the triangles of a mesh.
    fn mesh<'d>(
        &mut self,
        primitives: impl Iterator<Item = Primitive<'d>>,
        mesh: usize,
        placement: Placement,
    ) -> Result<(), MeshIoError> {
        // Parts often share their points: accessors that were read, and the numbers of their first rows.
        let mut points: Vec<(usize, usize)> = Vec::new();
        let mut textures: Vec<(usize, usize)> = Vec::new();
        for primitive in primitives {
            let here = format!("meshes[{mesh}].primitives[{}]", primitive.index());
            if !matches!(
                primitive.mode(),
                Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan
            ) {
                continue;
            }
            let positions = primitive
                .get(&Semantic::Positions)
                .ok_or_else(|| content(self.path, format!("{here} has no positions")))?;
            let count = positions.count();
            let first = match find(&points, positions.index()) {
                Some(first) => first,
                None => {
                    let first = self.points(&positions, placement, &here)?;
                    points.push((positions.index(), first));
                    first
                }
            };
            let texture = match primitive.get(&Semantic::TexCoords(0)) {
                None => None,
                Some(texture) if texture.count() < count => {
                    let why = format!("{here} has fewer texture coordinates than points");
                    return Err(content(self.path, why));
                }
                Some(texture) => Some(match find(&textures, texture.index()) {
                    Some(first) => first,
                    None => {
                        let first = self.texture(&texture, &here)?;
                        textures.push((texture.index(), first));
                        first
                    }
                }),
            };
            // A mirrored part has its triangles the other way round.
            let is_mirrored = placement.linear.determinant() < 0.0;
            self.triangles(&primitive, [first, count], texture, is_mirrored, &here)?;
        }
        Ok(())
    }

    /// Adds points; returns the number of the first.
    fn points(
        &mut self,
        accessor: &Accessor<'_>,
        placement: Placement,
        here: &str,
    ) -> Result<usize, MeshIoError> {
        let kinds: &[DataType] = &[DataType::F32];
        let at = format!("{here}: the positions");
        let rows = rows(
            self.path,
            &self.buffers,
            accessor,
            Dimensions::Vec3,
            kinds,
            &at,
        )?;
        let first = self.file.surface.positions.len();
        within(self.path, self.limit, 12 * (first + rows.count))?;
        self.file.surface.positions.reserve(rows.count);
        for row in 0..rows.count {
            let [x, y, z] = [0, 1, 2].map(|component| rows.number(row, component));
            let point = placement.of_point(DVec3::new(x, y, z));
            if !point.is_finite() {
                let why = format!("{here}: position {row} is {point}, give finite ones");
                return Err(content(self.path, why));
            }
            self.file.surface.positions.push(point);
        }
        Ok(first)
    }

    /// Adds texture coordinates; returns the number of the first.
    fn texture(&mut self, accessor: &Accessor<'_>, here: &str) -> Result<usize, MeshIoError> {
        let kinds: &[DataType] = match accessor.normalized() {
            true => &[DataType::F32, DataType::U8, DataType::U16],
            false => &[DataType::F32],
        };
        let at = format!("{here}: the texture coordinates");
        let rows = rows(
            self.path,
            &self.buffers,
            accessor,
            Dimensions::Vec2,
            kinds,
            &at,
        )?;
        let first = self.file.texture.len();
        within(self.path, self.limit, 2 * (first + rows.count))?;
        let unit = match rows.kind {
            DataType::U8 => f64::from(u8::MAX),
            DataType::U16 => f64::from(u16::MAX),
            _ => 1.0,
        };
        self.file.texture.extend((0..rows.count).map(|row| {
            let [u, v] = [0, 1].map(|component| rows.number(row, component) / unit);
            DVec2::new(u, 1.0 - v)
        }));
        Ok(first)
    }

    /// Adds the triangles of a part, whose points are `count` from `first` on.
    fn triangles(
        &mut self,
        primitive: &Primitive<'_>,
        [first, count]: [usize; 2],
        texture: Option<usize>,
        is_mirrored: bool,
        here: &str,
    ) -> Result<(), MeshIoError> {
        let indices = match primitive.indices() {
            None => None,
            Some(accessor) => {
                let kinds: &[DataType] = &[DataType::U8, DataType::U16, DataType::U32];
                let at = format!("{here}: the indices");
                let rows = rows(
                    self.path,
                    &self.buffers,
                    &accessor,
                    Dimensions::Scalar,
                    kinds,
                    &at,
                )?;
                if let Some(row) = (0..rows.count).find(|&row| rows.index(row) as usize >= count) {
                    let index = rows.index(row);
                    let why = format!("{here}: index {row} is {index}, there are {count} points");
                    return Err(content(self.path, why));
                }
                Some(rows)
            }
        };
        let corners = indices.as_ref().map_or(count, |rows| rows.count);
        let corner = |i: usize| match &indices {
            Some(rows) => rows.index(i) as usize,
            None => i,
        };
        let number = match primitive.mode() {
            Mode::Triangles => corners / 3,
            _ => corners.saturating_sub(2),
        };
        let SurfaceFile {
            surface: TriangleSurface { triangles, .. },
            texture_corners,
            ..
        } = &mut self.file;
        within(self.path, self.limit, 3 * (triangles.len() + number))?;
        for t in 0..number {
            let mut triangle = match primitive.mode() {
                Mode::Triangles => [3 * t, 3 * t + 1, 3 * t + 2],
                // Every second triangle of a strip is turned over.
                Mode::TriangleStrip if t % 2 == 1 => [t + 1, t, t + 2],
                Mode::TriangleStrip => [t, t + 1, t + 2],
                _ => [0, t + 1, t + 2],
            }
            .map(corner);
            // Strips are joined by triangles without area.
            let [a, b, c] = triangle;
            if primitive.mode() == Mode::TriangleStrip && (a == b || b == c || c == a) {
                continue;
            }
            if is_mirrored {
                triangle.swap(1, 2);
            }
            triangles.push(triangle.map(|corner| ParticleId::new(first + corner)));
            if let Some(first) = texture {
                texture_corners.push(triangle.map(|corner| ParticleId::new(first + corner).0));
            }
        }
        Ok(())
    }
}

/// The number that belongs to a key.
fn find(pairs: &[(usize, usize)], key: usize) -> Option<usize> {
    let pair = pairs.iter().find(|(known, _)| *known == key);
    pair.map(|&(_, number)| number)
}

/// An error if `bytes` are more than the limit.
fn within(path: &Path, limit: usize, bytes: usize) -> Result<(), MeshIoError> {
    if bytes <= limit {
        return Ok(());
    }
    let why = format!(
        "the scene repeats its meshes to more than {COPIES} times the size of the file: export the copies as one mesh, \
         or fewer of them"
    );
    Err(content(path, why))
}

/// The rows of an accessor, all of them within its buffer.
fn rows<'b>(
    path: &Path,
    buffers: &'b [Buffer<'_>],
    accessor: &Accessor<'_>,
    dimensions: Dimensions,
    kinds: &[DataType],
    at: &str,
) -> Result<Rows<'b>, MeshIoError> {
    let wrong = |why: &str| {
        Err(content(
            path,
            format!("{at} (accessors[{}]) {why}", accessor.index()),
        ))
    };
    let kind = accessor.data_type();
    if accessor.dimensions() != dimensions || !kinds.contains(&kind) {
        return wrong("have a type that glTF does not allow here");
    }
    let Some(view) = accessor.view().filter(|_| accessor.sparse().is_none()) else {
        return wrong("are sparse, which is not supported: export them in full");
    };
    let size = kind.size() * dimensions.multiplicity();
    let stride = view.stride().unwrap_or(size);
    if stride < size {
        return wrong("overlap: the stride is shorter than a row");
    }
    let count = accessor.count();
    let buffer = buffers[view.buffer().index()].bytes();
    let length = match count {
        0 => Some(0),
        _ => (count - 1)
            .checked_mul(stride)
            .and_then(|length| length.checked_add(size)),
    };
    let of_view = view
        .offset()
        .checked_add(view.length())
        .and_then(|end| buffer.get(view.offset()..end));
    let bytes = of_view.and_then(|view| {
        let end = accessor.offset().checked_add(length?)?;
        view.get(accessor.offset()..end)
    });
    match bytes {
        Some(bytes) => Ok(Rows {
            bytes,
            stride,
            count,
            kind,
        }),
        None => wrong("reach beyond their buffer, get the complete file"),
    }
}

/// A name without the escapes of a URI, such as `%20` for a blank.
fn unescaped(uri: &str) -> String {
    let bytes = uri.as_bytes();
    let mut plain = Vec::with_capacity(bytes.len());
    let mut at = 0;
    while at < bytes.len() {
        let digits = bytes.get(at + 1..at + 3).filter(|_| bytes[at] == b'%');
        let escaped = digits
            .and_then(|digits| str::from_utf8(digits).ok())
            .and_then(|digits| u8::from_str_radix(digits, 16).ok());
        plain.push(escaped.unwrap_or(bytes[at]));
        at += if escaped.is_some() { 3 } else { 1 };
    }
    String::from_utf8_lossy(&plain).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quarter_turns_are_exact() {
        let half = f64::from(0.5_f32.sqrt());
        let turn = rotation_of([-half, 0.0, 0.0, half]);
        assert_eq!(turn, DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y));
        assert_eq!(Placement::UPRIGHT.linear * turn, DMat3::IDENTITY);
        assert_eq!(rotation_of([0.0; 4]), DMat3::IDENTITY);
    }

    #[test]
    fn escapes_of_uris() {
        for (uri, name) in [("a%20b.bin", "a b.bin"), ("a%2", "a%2"), ("%zz%41", "%zzA")] {
            assert_eq!(unescaped(uri), name);
        }
    }
}
