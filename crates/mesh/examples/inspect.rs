//! Damages a mesh, prints the report of the checks, and repairs it: `inspect`.

#![expect(clippy::print_stdout, reason = "prints what it found")]

use incise_mesh::glam::DVec3;
use incise_mesh::{MeshError, ParticleId, RepairOptions, TetMesh, kuhn_box, repair};

fn main() -> Result<(), MeshError> {
    let mut mesh = kuhn_box([4, 2, 2], DVec3::new(2.0, 1.0, 1.0));
    show("a box", &mesh);

    // An inverted tet, a repeated tet, a flat one, and an unused particle.
    mesh.tets[7].swap(0, 1);
    mesh.tets.push(mesh.tets[3]);
    mesh.tets.push([0, 1, 2, 3].map(ParticleId));
    mesh.positions.push(DVec3::splat(5.0));
    show("broken", &mesh);

    let repaired = repair(&mesh, &RepairOptions::ALL);
    println!("{}", repaired.report);
    show("repaired", &repaired.mesh);
    repaired.mesh.check()
}

fn show(name: &str, mesh: &TetMesh) {
    let quality = mesh.quality();
    println!(
        "{name}: {} tets in {} pieces, {:.3} m³, smallest altitude {:.3} m; {}",
        mesh.tets.len(),
        mesh.pieces().count,
        mesh.total_volume(),
        quality.min_altitude,
        mesh.check_report()
    );
}
