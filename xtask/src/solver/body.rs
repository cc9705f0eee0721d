//! Bodies of the tables.

use std::path::Path;

use anyhow::Context;
use incise::clustering::{Method as ClusteringMethod, cluster};
use incise::coloring::{Algorithm, color};
use incise::graph::{Clustering, Incidence, Schedule};
use incise::mesh::glam::DVec3;
use incise::mesh::{TetId, TetMesh};
use incise::mesh_io;
use incise::meshing::{Shape, generate};
use incise::xpbd::{Material, Real, Solver, VertexStars};

/// The liver of a folder of models, or a generated one of the same number of tets.
pub(crate) fn liver(models: Option<&Path>, quick: bool) -> anyhow::Result<TetMesh> {
    match models {
        Some(folder) => {
            let path = folder.join("liver_11k.vtk");
            mesh_io::read(&path).with_context(|| path.display().to_string())
        }
        None => Ok(generate(Shape::Liver, if quick { 1500 } else { 11_000 })?),
    }
}

/// The mesh with a longest side of `size` m and its lowest corner at the origin.
pub(crate) fn scaled(mesh: &TetMesh, size: f64) -> TetMesh {
    let ends = (DVec3::MAX, DVec3::MIN);
    let (low, high) = mesh
        .positions
        .iter()
        .fold(ends, |(low, high), &x| (low.min(x), high.max(x)));
    let scale = size / (high - low).max_element();
    let mut mesh = mesh.clone();
    for x in &mut mesh.positions {
        *x = (*x - low) * scale;
    }
    mesh
}

/// Body of one material; `held` selects the fixed particles.
pub(crate) fn body<R: Real>(
    mesh: &TetMesh,
    material: Material,
    held: impl Fn(DVec3) -> bool,
) -> anyhow::Result<Solver<R>> {
    mixed_body(mesh, &[material], |_tet| 0, held)
}

/// Body of several materials; `material_of` gives the index of each tet's material in the list.
pub(crate) fn mixed_body<R: Real>(
    mesh: &TetMesh,
    materials: &[Material],
    material_of: impl Fn(TetId) -> usize,
    held: impl Fn(DVec3) -> bool,
) -> anyhow::Result<Solver<R>> {
    let mut solver = Solver::new(&mesh.positions);
    let numbers: Vec<u16> = materials
        .iter()
        .map(|&m| solver.add_material(m))
        .collect::<Result<_, _>>()?;
    let mut masses = vec![0.0; mesh.positions.len()];
    for (t, tet) in mesh.tets.iter().enumerate() {
        let id = TetId::new(t);
        let material = material_of(id);
        solver.push_tet(tet.map(|p| p.0), mesh.corners(id), numbers[material]);
        for p in tet {
            masses[p.index()] += 0.25 * materials[material].density * mesh.volume(id);
        }
    }
    for (p, mass) in masses.into_iter().enumerate() {
        solver.set_mass(p, mass);
        solver.set_fixed(p, held(mesh.positions[p]));
    }
    Ok(solver)
}

/// The order of solving the tets in clusters by the method of that name.
pub(crate) fn schedule(mesh: &TetMesh, clustering: &str) -> anyhow::Result<Schedule> {
    let tets = mesh.tets.iter().copied();
    let incidence = Incidence::from_constraints(mesh.positions.len(), tets)?;
    let clusters = cluster(clustering.parse::<ClusteringMethod>()?, &incidence);
    let coloring = color(auto()?, &incidence.quotient(&clusters), 0)?.coloring;
    Ok(Schedule::new(&clusters, &coloring))
}

/// The particles in the order in which VBD visits them.
pub(crate) fn stars<R: Real>(solver: &Solver<R>) -> anyhow::Result<VertexStars<R>> {
    let incidence = solver.star_incidence();
    let coloring = color(auto()?, &incidence, 0)?.coloring;
    let clusters = Clustering::none(incidence.constraint_count());
    Ok(VertexStars::new(
        solver,
        &Schedule::new(&clusters, &coloring),
    )?)
}

fn auto() -> anyhow::Result<Algorithm> {
    Ok("auto".parse()?)
}
