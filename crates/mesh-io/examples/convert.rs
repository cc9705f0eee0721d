//! Converts a mesh or a surface to another format: `convert FROM TO`, such as `convert liver.msh liver.vtu`.
//!
//! A mesh written to a surface format leaves its boundary there. Without arguments a small box goes to the folder of
//! temporary files and back.

#![expect(clippy::print_stdout, reason = "prints what it did")]

use std::error::Error;
use std::path::Path;

use incise_mesh::glam::DVec3;
use incise_mesh::{TriangleSurface, kuhn_box};
use incise_mesh_io as io;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.as_slice() {
        [] => {
            let folder = std::env::temp_dir();
            let [from, to] = ["vtk", "stl"].map(|ending| {
                folder.join(format!("incise-convert-{}.{ending}", std::process::id()))
            });
            io::write(&from, &kuhn_box([4, 2, 2], DVec3::new(2.0, 1.0, 1.0)))?;
            let result = convert(&from, &to);
            std::fs::remove_file(&from)?;
            std::fs::remove_file(&to)?;
            result
        }
        [from, to] => convert(Path::new(from), Path::new(to)),
        _ => Err("give two files, such as: liver.msh liver.vtu".into()),
    }
}

fn convert(from: &Path, to: &Path) -> Result<(), Box<dyn Error>> {
    let (from_surface, to_surface) = (io::is_surface(from), io::is_surface(to));
    if from_surface {
        let surface = io::read_surface(from)?;
        io::write_surface(to, &surface)?;
        println!("{} triangles", surface.triangles.len());
        return Ok(());
    }
    let file = io::read_file(from)?;
    if to_surface {
        io::write_surface(to, &TriangleSurface::boundary_of(&file.mesh))?;
    } else {
        io::write_file(to, &file)?;
    }
    let fields = file.particles.len() + file.tets.len();
    println!("{} tets, {fields} fields", file.mesh.tets.len());
    Ok(())
}
