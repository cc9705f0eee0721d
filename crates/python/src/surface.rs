//! `Surface`: the boundary for renderers, with the ranges that changed since it was last read.
//!
//! A skin of `incise-cutting` exists from the first call on and applies the delta of every cut, so a simulation whose surface
//! is never read pays nothing.
//!
//! Cost: that of the deltas, and a copy of the arrays in each call.

use std::mem::take;

use incise::Simulation;
use incise::cutting::{FaceTag, Skin, SkinVertex};
use incise::mesh::glam::DVec3;
use pyo3::prelude::*;

use crate::array;

/// A skin and its changes since they were last read.
#[derive(Debug)]
pub(crate) struct TrackedSkin {
    skin: Skin,
    /// Numbers of changed triangles and vertices, unsorted.
    triangles: Vec<usize>,
    vertices: Vec<usize>,
}

impl TrackedSkin {
    /// The skin of a simulation, all of it changed.
    pub(crate) fn new(simulation: &Simulation) -> Self {
        let skin = Skin::new(simulation.boundary());
        Self {
            triangles: (0..skin.triangles().len()).collect(),
            vertices: (0..skin.vertices().len()).collect(),
            skin,
        }
    }

    /// Applies the cuts of the last frame.
    pub(crate) fn apply_deltas(&mut self, simulation: &Simulation) {
        for delta in simulation.deltas() {
            let change = self.skin.apply_delta(delta);
            self.triangles.extend(change.triangles);
            self.vertices.extend(change.vertices);
        }
    }

    /// Copies the skin and forgets its changes.
    pub(crate) fn read(&mut self, positions: &[DVec3]) -> SurfaceData {
        let skin = &self.skin;
        let vertices = skin.vertices();
        let count = skin.triangles().len();
        self.triangles.retain(|&triangle| triangle < count);
        SurfaceData {
            points: vertices
                .iter()
                .map(|v| positions[v.particle.index()])
                .collect(),
            normals: skin.normals(positions),
            vertices: vertices.to_vec(),
            triangles: skin.triangles().to_vec(),
            tags: (0..count).map(|t| tag(skin.tag(t))).collect(),
            tets: (0..count).map(|t| skin.tet(t).0).collect(),
            outer: skin.outer_triangles().end,
            changed_triangles: ranges(take(&mut self.triangles)),
            changed_vertices: ranges(take(&mut self.vertices)),
        }
    }
}

/// The number of a kind of boundary: -1 for the outer surface, otherwise that of the stroke.
pub(crate) fn tag(tag: FaceTag) -> i64 {
    match tag {
        FaceTag::Outer => -1,
        FaceTag::Cut(stroke) => i64::from(stroke),
    }
}

/// The ranges `[first, end)` of some numbers.
fn ranges(mut numbers: Vec<usize>) -> Vec<[u32; 2]> {
    numbers.sort_unstable();
    let mut ranges: Vec<[u32; 2]> = Vec::new();
    for number in numbers {
        let number = u32::try_from(number).expect("vertices and triangles are numbered in 32 bits");
        match ranges.last_mut() {
            Some([_, end]) if number < *end => {}
            Some([_, end]) if number == *end => *end += 1,
            _ => ranges.push([number, number + 1]),
        }
    }
    ranges
}

/// A copy of the skin.
#[derive(Debug)]
pub(crate) struct SurfaceData {
    points: Vec<DVec3>,
    normals: Vec<DVec3>,
    vertices: Vec<SkinVertex>,
    triangles: Vec<[u32; 3]>,
    tags: Vec<i64>,
    tets: Vec<u32>,
    outer: usize,
    changed_triangles: Vec<[u32; 2]>,
    changed_vertices: Vec<[u32; 2]>,
}

/// The boundary of all bodies as a triangle mesh for renderers: see ``Simulation.surface``.
///
/// A particle at the rim of a cut has a vertex for the outer surface and one for the cut, so that shading breaks there. The
/// triangles of the outer surface come first. Numbers of triangles and vertices stay the same from one call to the next,
/// except in the changed ranges. A vertex without triangles may be left over; its number is used again. All arrays are
/// read-only copies.
#[pyclass(frozen, get_all, module = "incise")]
#[derive(Debug)]
pub(crate) struct Surface {
    /// Present positions of the vertices in m, shape (v, 3), float64.
    points: Py<PyAny>,
    /// Unit normals of the vertices, shape (v, 3), float64; zero for vertices without triangles.
    normals: Py<PyAny>,
    /// The particle of each vertex, shape (v,), int64.
    particles: Py<PyAny>,
    /// Three numbers of vertices for each triangle, counterclockwise seen from outside, shape (t, 3), int64.
    triangles: Py<PyAny>,
    /// For each triangle -1 on the outer surface, or the number of the stroke that opened it, shape (t,), int64.
    tags: Py<PyAny>,
    /// The tet behind each triangle, shape (t,), int64.
    tets: Py<PyAny>,
    /// Number of triangles of the outer surface: ``triangles[:outer]`` are outside, ``triangles[outer:]`` are cut faces.
    outer: usize,
    /// Ranges of triangles that changed since the last call, shape (k, 2), int64: first one and one past the last.
    changed_triangles: Py<PyAny>,
    /// Ranges of vertices that are new or belong to another particle since the last call, shape (k, 2), int64.
    changed_vertices: Py<PyAny>,
}

impl Surface {
    pub(crate) fn new(py: Python<'_>, data: SurfaceData) -> PyResult<Self> {
        let particles = data.vertices.iter().map(|v| v.particle.0);
        Ok(Self {
            points: array::from_vectors(py, &data.points)?.unbind(),
            normals: array::from_vectors(py, &data.normals)?.unbind(),
            particles: array::from_indices(py, particles)?.unbind(),
            triangles: array::from_rows(py, data.triangles.into_iter())?.unbind(),
            tags: array::from_signed(py, data.tags.into_iter())?.unbind(),
            tets: array::from_indices(py, data.tets.into_iter())?.unbind(),
            outer: data.outer,
            changed_triangles: array::from_rows(py, data.changed_triangles.into_iter())?.unbind(),
            changed_vertices: array::from_rows(py, data.changed_vertices.into_iter())?.unbind(),
        })
    }
}
