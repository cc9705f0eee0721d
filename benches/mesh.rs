//! Meshes: generating, checking, their surface and pieces, and VTK files (on the disk of the temporary folder).

// The same reason as in the library.
#![expect(clippy::unwrap_used, reason = "benches stop at the first surprise")]

use incise::mesh::io;
use incise_benches::Source;

fn main() {
    let folder = tempfile::tempdir().unwrap();
    incise_benches::run("mesh", |bench| {
        let case = bench.case;
        if !matches!(case.source, Source::File(_)) {
            bench.measure("generate", |b| b.iter(|| case.source.mesh()));
        }
        bench.measure("check", |b| b.iter(|| case.mesh.check_report()));
        bench.measure("surface", |b| b.iter(|| case.mesh.surface()));
        bench.measure("pieces", |b| b.iter(|| case.mesh.pieces()));

        let path = folder.path().join("case.vtk");
        // Written once beforehand, for runs that leave the next bench out.
        io::write(&path, &case.mesh).unwrap();
        bench.measure("write-vtk", |b| {
            b.iter(|| io::write(&path, &case.mesh).unwrap());
        });
        bench.measure("read-vtk", |b| b.iter(|| io::read(&path).unwrap()));
    });
}
