//! Meshes of the paper: files of a folder, or generated stand-ins with similar shapes and sizes.
//!
//! A stand-in is irregular, with a valence distribution like that of TetGen meshes: colorings and clusterings behave
//! differently on a lattice. It is written to a file once, so that scenes can refer to it.

use std::path::PathBuf;

use anyhow::{Context, ensure};
use incise::graph::Incidence;
use incise::mesh::TetMesh;
use incise::mesh_io;
use incise::meshing::{Shape, irregular};

use crate::experiment::ExperimentArguments;

/// A mesh of the paper: the name of its file, the shape that stands for it and its number of tets in the paper.
#[derive(Clone, Copy, Debug)]
pub(super) struct PaperMesh {
    pub(super) name: &'static str,
    shape: Shape,
    tets: usize,
    quick_tets: usize,
}

const fn mesh(name: &'static str, shape: Shape, tets: usize, quick_tets: usize) -> PaperMesh {
    PaperMesh {
        name,
        shape,
        tets,
        quick_tets,
    }
}

/// By name. Those of `--quick` differ in size as little as the shapes allow.
const MESHES: [PaperMesh; 10] = [
    mesh("liver_5k", Shape::Liver, 4705, 1000),
    mesh("liver_11k", Shape::Liver, 11_367, 1500),
    mesh("liver_89k", Shape::Liver, 88_958, 3000),
    mesh("bunny_19k", Shape::Bunny, 19_379, 2000),
    mesh("armadillo_55k", Shape::Armadillo, 54_985, 3000),
    mesh("armadillo_121k", Shape::Armadillo, 121_190, 4000),
    mesh("armadillo_227k", Shape::Armadillo, 226_840, 5000),
    mesh("sphere_7k", Shape::Sphere, 6851, 1000),
    mesh("sphere_28k", Shape::Sphere, 27_792, 1500),
    mesh("sphere_118k", Shape::Sphere, 118_202, 2000),
];

impl PaperMesh {
    pub(super) fn named(name: &str) -> anyhow::Result<Self> {
        let mesh = MESHES.into_iter().find(|mesh| mesh.name == name);
        mesh.with_context(|| format!("the paper has no mesh {name}"))
    }

    /// Mesh file: from the folder of models, or generated under `--out`.
    pub(super) fn file(&self, arguments: &ExperimentArguments) -> anyhow::Result<PathBuf> {
        if let Some(folder) = &arguments.models {
            let path = folder.join(format!("{}.vtk", self.name));
            if path.exists() {
                return Ok(std::path::absolute(path)?);
            }
        }
        let tets = if arguments.quick {
            self.quick_tets
        } else {
            self.tets
        };
        let folder = arguments.out.join("meshes");
        std::fs::create_dir_all(&folder)?;
        let path = folder.join(format!("{}-of-{tets}.vtk", self.shape));
        if !path.exists() {
            mesh_io::write(&path, &irregular(self.shape, tets, 1)?)?;
        }
        Ok(std::path::absolute(path)?)
    }

    pub(super) fn mesh(&self, arguments: &ExperimentArguments) -> anyhow::Result<TetMesh> {
        let path = self.file(arguments)?;
        let mesh = mesh_io::read(&path).with_context(|| path.display().to_string())?;
        ensure!(!mesh.tets.is_empty(), "{} has no tets", path.display());
        Ok(mesh)
    }
}

/// Incidence of the tets of a mesh.
pub(super) fn incidence(mesh: &TetMesh) -> anyhow::Result<Incidence> {
    let tets = mesh.tets.iter().copied();
    Ok(Incidence::from_constraints(mesh.positions.len(), tets)?)
}
