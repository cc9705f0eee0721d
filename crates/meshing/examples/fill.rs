//! Fills the boundaries of given meshes and prints how well the bodies fit: `fill MESH TETS [TETS ..]`.
//!
//! Distances are in spacings of the lattice, the cube root of twelve times the volume of a tet.

#![expect(clippy::print_stdout, reason = "prints what it measured")]

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use incise_mesh::{TetMesh, TriangleSurface};
use incise_meshing::{Solid, tetrahedralize};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [file, tets @ ..] = arguments.as_slice() else {
        return Err("give a mesh and numbers of tets, such as: bunny.vtk 20000 40000".into());
    };
    let surface = TriangleSurface::boundary_of(&incise_mesh_io::read(file)?);
    let solid = Solid::new(&surface)?;
    let name = Path::new(file).file_stem().unwrap_or_default().display();
    for tets in tets {
        let start = Instant::now();
        let mesh = tetrahedralize(&solid, tets.parse()?, 0)?;
        let seconds = start.elapsed().as_secs_f64();
        println!("| {name} {}", row(&solid, &surface, &mesh, seconds)?);
    }
    Ok(())
}

fn row(
    solid: &Solid,
    surface: &TriangleSurface,
    mesh: &TetMesh,
    seconds: f64,
) -> Result<String, Box<dyn Error>> {
    let spacing = (12.0 * mesh.total_volume() / mesh.tets.len() as f64).cbrt();
    let boundary = TriangleSurface::boundary_of(mesh);
    let quality = mesh.quality();
    Ok(format!(
        "| {} | {seconds:.2} | {:.2} | {:.2} | {:+.2} % | {} | {} | {:.1}° to {:.1}° |",
        mesh.tets.len(),
        solid.farthest(&boundary) / spacing,
        Solid::new(&boundary)?.farthest(surface) / spacing,
        100.0 * (mesh.total_volume() / solid.volume() - 1.0),
        mesh.surface().is_manifold(),
        mesh.face_pieces().count,
        quality.min_dihedral,
        quality.max_dihedral
    ))
}
