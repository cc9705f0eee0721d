//! glTF 2.0 (`.glb` and `.gltf`): surfaces for viewers, engines and browsers. Written only.
//!
//! One mesh with positions, smooth normals (the mean over the triangles around a point, weighted by area) and 32-bit
//! indices; points without triangles are left out. glTF stores floats: coordinates are rounded to 24 bits, 6e-8 of
//! their size. The second axis of glTF points up, ours is the third: a rotation of the node converts between them, so
//! the numbers are unchanged. Both forms are one file; `.gltf` has the numbers in base64 and is a third larger.
//!
//! The writer is our own, because the file is one text with a dozen numbers; the crate `gltf-json` would add
//! `serde_json` and derived types for all of glTF. Source: "glTF 2.0 Specification" (Khronos). Linear.

use std::io::{self, Write};

use glam::{DVec3, Vec3};
use incise_mesh::TriangleSurface;

use crate::base64::base64;
use crate::used_particles::UsedParticles;

/// The numbers that mark a binary file and its two parts.
const MAGIC: &[u8; 4] = b"glTF";
const JSON: &[u8; 4] = b"JSON";
const BIN: &[u8; 4] = b"BIN\0";

/// Writes the binary form: a header of 12 bytes, then the text and the numbers, each after its length and type.
pub(super) fn write_glb(out: &mut dyn Write, surface: &TriangleSurface) -> io::Result<()> {
    let numbers = Numbers::new(surface)?;
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
pub(super) fn write_gltf(out: &mut dyn Write, surface: &TriangleSurface) -> io::Result<()> {
    let numbers = Numbers::new(surface)?;
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
    indices: Vec<u32>,
}

impl Numbers {
    fn new(surface: &TriangleSurface) -> io::Result<Self> {
        if surface.triangles.is_empty() {
            return Err(invalid("the surface has no triangles, which glTF needs"));
        }
        let used = UsedParticles::new(&surface.triangles, surface.positions.len());
        let mut positions = Vec::with_capacity(used.particles.len());
        for &particle in &used.particles {
            let position = surface.positions[particle];
            let rounded = position.as_vec3();
            if !rounded.is_finite() {
                let message = format!("the point {position} is too far away for 32 bits");
                return Err(invalid(&message));
            }
            positions.push(rounded);
        }
        let mut sums = vec![DVec3::ZERO; positions.len()];
        let mut indices = Vec::with_capacity(3 * surface.triangles.len());
        for triangle in &surface.triangles {
            let [a, b, c] = triangle.map(|p| surface.positions[p.index()]);
            let normal = (b - a).cross(c - a);
            for corner in triangle {
                let index = used.indices[corner.index()];
                sums[index as usize] += normal;
                indices.push(index);
            }
        }
        // Normals must have length 1, also at points without a direction.
        let unit = |sum: &DVec3| sum.normalize_or(DVec3::Z).as_vec3();
        Ok(Self {
            normals: sums.iter().map(unit).collect(),
            positions,
            indices,
        })
    }

    fn bytes(&self) -> Vec<u8> {
        let vectors = self.positions.iter().chain(&self.normals);
        let floats = vectors.flat_map(|v| v.to_array()).map(f32::to_le_bytes);
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
        write!(
            out,
            "{{\"asset\":{{\"version\":\"2.0\",\"generator\":\"incise-mesh\"}},\
            \"scene\":0,\"scenes\":[{{\"nodes\":[0]}}],\
            \"nodes\":[{{\"mesh\":0,\"rotation\":[-0.7071067811865476,0,0,0.7071067811865476]}}],\
            \"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":0,\"NORMAL\":1}},\"indices\":2,\"material\":0}}]}}],\
            \"materials\":[{{\"doubleSided\":true,\"pbrMetallicRoughness\":{{\"metallicFactor\":0,\"roughnessFactor\":0.8}}}}],\
            \"accessors\":[\
            {{\"bufferView\":0,\"componentType\":5126,\"count\":{points},\"type\":\"VEC3\",\"min\":{low},\"max\":{high}}},\
            {{\"bufferView\":1,\"componentType\":5126,\"count\":{points},\"type\":\"VEC3\"}},\
            {{\"bufferView\":2,\"componentType\":5125,\"count\":{corners},\"type\":\"SCALAR\"}}],\
            \"bufferViews\":[\
            {{\"buffer\":0,\"byteOffset\":0,\"byteLength\":{vectors},\"target\":34962}},\
            {{\"buffer\":0,\"byteOffset\":{vectors},\"byteLength\":{vectors},\"target\":34962}},\
            {{\"buffer\":0,\"byteOffset\":{two_vectors},\"byteLength\":{triangles},\"target\":34963}}],\
            \"buffers\":[{{\"byteLength\":{all}",
            vectors = 12 * points,
            two_vectors = 24 * points,
            triangles = 4 * corners,
            all = 24 * points + 4 * corners,
        )?;
        index(out)?;
        write!(out, "}}]}}")
    }
}

fn invalid(message: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, message)
}
