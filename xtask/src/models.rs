//! Meshes of a sweep: those in a folder, or generated ones.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use incise::mesh::TetMesh;
use incise::mesh_io;
use incise::meshing::{Shape, generate};
use incise::scene::{BodySpec, ShapeSpec};

/// A mesh and its source.
#[derive(Debug)]
pub(crate) struct Model {
    pub(crate) name: String,
    pub(crate) mesh: TetMesh,
    source: Source,
}

#[derive(Debug)]
enum Source {
    File(PathBuf),
    Shape(Shape, usize),
}

impl Model {
    /// Generates a shape.
    pub(crate) fn generated(shape: Shape, tets: usize) -> anyhow::Result<Self> {
        let name = format!("{shape} (generated)");
        Ok(Self {
            name,
            mesh: generate(shape, tets)?,
            source: Source::Shape(shape, tets),
        })
    }

    /// Reads and checks a mesh file.
    pub(crate) fn read(path: PathBuf) -> anyhow::Result<Self> {
        let mesh = mesh_io::read(&path)?;
        mesh.check().with_context(|| path.display().to_string())?;
        let name = path
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        Ok(Self {
            name,
            mesh,
            source: Source::File(path),
        })
    }

    /// Sets the mesh of `body`.
    pub(crate) fn put_into(&self, body: &mut BodySpec) {
        (body.mesh, body.shape) = match &self.source {
            Source::File(path) => (Some(path.clone()), None),
            Source::Shape(shape, tets) => (None, Some(ShapeSpec::new(shape.to_string(), *tets))),
        };
    }
}

/// The `.vtk` files of a folder by ascending size, at most `largest` tets each; without a folder, generated shapes.
pub(crate) fn models(
    folder: Option<&Path>,
    largest: usize,
    quick: bool,
) -> anyhow::Result<Vec<Model>> {
    let mut models = Vec::new();
    if let Some(folder) = folder {
        let entries = std::fs::read_dir(folder)
            .with_context(|| format!("cannot read {}", folder.display()))?;
        for entry in entries {
            let path = entry?.path();
            if path.extension().is_some_and(|ending| ending == "vtk") {
                models.push(Model::read(path)?);
            }
        }
        models.retain(|model| model.mesh.tets.len() <= largest);
        models.sort_by_key(|model| (model.mesh.tets.len(), model.name.clone()));
        ensure!(
            !models.is_empty(),
            "{} has no .vtk mesh of at most {largest} tets",
            folder.display()
        );
    } else if quick {
        models.push(Model::generated(Shape::Liver, 1500)?);
        models.push(Model::generated(Shape::Torus, 1500)?);
    } else {
        for shape in [Shape::Sphere, Shape::Torus, Shape::Liver] {
            models.push(Model::generated(shape, 11_000)?);
        }
        models.push(Model::generated(Shape::Liver, 90_000)?);
    }
    Ok(models)
}
