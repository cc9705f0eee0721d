//! Writes glTF: one mesh for viewers, engines and browsers.
//!
//! It has positions, smooth normals (the mean over the triangles around a point, weighted by area), 32-bit indices, and
//! texture coordinates if there are any; points without triangles are left out. A point has a copy for each of its
//! texture coordinates. glTF stores floats: coordinates are rounded to 24 bits, 6e-8 of their size. A rotation of the
//! node turns the axes, so the numbers are unchanged. Both forms are one file; `.gltf` has the numbers in base64 and is a
//! third larger.
//!
//! The file is one text with a dozen numbers, so it is written directly. O(n log n).

use std::io::{self, Write};

use glam::{DVec3, Vec2, Vec3};

use super::{BIN, JSON, MAGIC};
use crate::SurfaceFile;
use crate::base64::base64;

/// Writes the binary form: a header of 12 bytes, then the text and the numbers, each after its length and type.
pub(crate) fn write_glb(out: &mut dyn Write, file: &SurfaceFile) -> io::Result<()> {
    let numbers = Numbers::new(file)?;
    let mut text = Vec::new();
    numbers.describe(&mut text, |_| Ok(()))?;
    text.resize(text.len().next_multiple_of(4), b' ');
    let size = |bytes: usize| {
        let size = u32::try_from(bytes).map_err(|_| invalid("the surface is too large for a .glb"));
        size.map(u32::to_le_bytes)
    };
    let bytes = numbers.bytes();
    out.write_all(MAGIC)?;
    out.write_all(&2_u32.to_le_bytes())?;
    out.write_all(&size(12 + 8 + text.len() + 8 + bytes.len())?)?;
    for (name, part) in [(JSON, &text), (BIN, &bytes)] {
        out.write_all(&size(part.len())?)?;
        out.write_all(name)?;
        out.write_all(part)?;
    }
    Ok(())
}

/// Writes the text form, with the numbers in base64.
pub(crate) fn write_gltf(out: &mut dyn Write, file: &SurfaceFile) -> io::Result<()> {
    let numbers = Numbers::new(file)?;
    numbers.describe(out, |out| {
        write!(out, ",\"uri\":\"data:application/octet-stream;base64,")?;
        base64(out, &numbers.bytes())?;
        write!(out, "\"")
    })
}

/// The stored arrays.
struct Numbers {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    /// Empty without a texture.
    texture: Vec<Vec2>,
    indices: Vec<u32>,
}

impl Numbers {
    fn new(file: &SurfaceFile) -> io::Result<Self> {
        let surface = &file.surface;
        if surface.triangles.is_empty() {
            return Err(invalid("the surface has no triangles, which glTF needs"));
        }
        let has_texture = !file.texture_corners.is_empty();
        if let Err(error) = file.check() {
            return Err(invalid(&error.to_string()));
        }
        // A vertex of glTF is a point with one pair of texture coordinates.
        let corners = surface
            .triangles
            .iter()
            .enumerate()
            .flat_map(|(t, triangle)| {
                let texture = file.texture_corners.get(t).copied().unwrap_or_default();
                [0, 1, 2].map(|i| (triangle[i].index(), texture[i]))
            });
        let mut vertices: Vec<(usize, u32)> = corners.clone().collect();
        vertices.sort_unstable();
        vertices.dedup();
        let mut sums = vec![DVec3::ZERO; surface.positions.len()];
        for triangle in &surface.triangles {
            let [a, b, c] = triangle.map(|p| surface.positions[p.index()]);
            let normal = (b - a).cross(c - a);
            for corner in triangle {
                sums[corner.index()] += normal;
            }
        }
        let mut numbers = Self {
            positions: Vec::with_capacity(vertices.len()),
            // Normals must have length 1, also at points without a direction.
            normals: vertices
                .iter()
                .map(|&(p, _)| sums[p].normalize_or(DVec3::Z).as_vec3())
                .collect(),
            texture: Vec::new(),
            indices: Vec::with_capacity(3 * surface.triangles.len()),
        };
        for &(particle, texture) in &vertices {
            let position = surface.positions[particle];
            let rounded = position.as_vec3();
            if !rounded.is_finite() {
                let message = format!("the point {position} is too far away for 32 bits");
                return Err(invalid(&message));
            }
            numbers.positions.push(rounded);
            if has_texture {
                let [u, v] = file.texture[texture as usize].to_array();
                let down = glam::DVec2::new(u, 1.0 - v).as_vec2();
                if !down.is_finite() {
                    let message = format!("the texture coordinates {u}, {v} are too large");
                    return Err(invalid(&message));
                }
                numbers.texture.push(down);
            }
        }
        for corner in corners {
            let index = vertices.partition_point(|vertex| *vertex < corner);
            let index = u32::try_from(index).map_err(|_| invalid("the surface has 2^32 points"))?;
            numbers.indices.push(index);
        }
        Ok(numbers)
    }

    fn bytes(&self) -> Vec<u8> {
        let vectors = self.positions.iter().chain(&self.normals);
        let pairs = self.texture.iter().flat_map(|pair| pair.to_array());
        let floats = vectors.flat_map(|v| v.to_array()).chain(pairs);
        let floats = floats.map(f32::to_le_bytes);
        let indices = self.indices.iter().map(|i| i.to_le_bytes());
        floats.chain(indices).flatten().collect()
    }

    /// Writes the text; `index` writes the object of the index array.
    fn describe(
        &self,
        out: &mut dyn Write,
        index: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> io::Result<()> {
        let (points, corners) = (self.positions.len(), self.indices.len());
        let low = self
            .positions
            .iter()
            .copied()
            .fold(Vec3::INFINITY, Vec3::min);
        let high = self
            .positions
            .iter()
            .copied()
            .fold(Vec3::NEG_INFINITY, Vec3::max);
        // As doubles, whose shortest text is exact for readers of doubles and of floats.
        let [low, high] =
            [low, high].map(|corner| format!("{:?}", corner.to_array().map(f64::from)));
        let (mut attribute, mut accessor, mut view) = (String::new(), String::new(), String::new());
        let pairs = 8 * self.texture.len();
        if pairs > 0 {
            attribute = ",\"TEXCOORD_0\":3".to_owned();
            accessor = format!(
                ",{{\"bufferView\":3,\"componentType\":5126,\"count\":{points},\"type\":\"VEC2\"}}"
            );
            view = format!(
                ",{{\"buffer\":0,\"byteOffset\":{},\"byteLength\":{pairs},\"target\":34962}}",
                24 * points
            );
        }
        write!(
            out,
            "{{\"asset\":{{\"version\":\"2.0\",\"generator\":\"incise-mesh\"}},\
            \"scene\":0,\"scenes\":[{{\"nodes\":[0]}}],\
            \"nodes\":[{{\"mesh\":0,\"rotation\":[-0.7071067811865476,0,0,0.7071067811865476]}}],\
            \"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":0,\"NORMAL\":1{attribute}}},\"indices\":2,\"material\":0}}]}}],\
            \"materials\":[{{\"doubleSided\":true,\"pbrMetallicRoughness\":{{\"metallicFactor\":0,\"roughnessFactor\":0.8}}}}],\
            \"accessors\":[\
            {{\"bufferView\":0,\"componentType\":5126,\"count\":{points},\"type\":\"VEC3\",\"min\":{low},\"max\":{high}}},\
            {{\"bufferView\":1,\"componentType\":5126,\"count\":{points},\"type\":\"VEC3\"}},\
            {{\"bufferView\":2,\"componentType\":5125,\"count\":{corners},\"type\":\"SCALAR\"}}{accessor}],\
            \"bufferViews\":[\
            {{\"buffer\":0,\"byteOffset\":0,\"byteLength\":{vectors},\"target\":34962}},\
            {{\"buffer\":0,\"byteOffset\":{vectors},\"byteLength\":{vectors},\"target\":34962}},\
            {{\"buffer\":0,\"byteOffset\":{before},\"byteLength\":{triangles},\"target\":34963}}{view}],\
            \"buffers\":[{{\"byteLength\":{all}",
            vectors = 12 * points,
            before = 24 * points + pairs,
            triangles = 4 * corners,
            all = 24 * points + pairs + 4 * corners,
        )?;
        index(out)?;
        write!(out, "}}]}}")
    }
}

fn invalid(message: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, message)
}
