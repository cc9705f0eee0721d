//! Meshes: generating, checking, their surface and pieces, and VTK files (on the disk of the temporary folder).
//!
//! Ten bodies are generated at sizes up to a million tets. Nothing else is measured on these.

#![expect(clippy::unwrap_used, reason = "benches stop at the first surprise")]

use incise::mesh_io;
use incise::meshing::Shape;
use incise_benches::Source;

/// All but the box, which the plate stands for: organic, thin-limbed, of genus 1, with a void, flat, convex, long, of
/// two pieces.
fn bodies() -> impl Iterator<Item = Shape> {
    let all = Shape::ALL.into_iter();
    all.filter(|&shape| shape != Shape::Box)
}

const SIZES: [(&str, usize); 4] = [
    ("5k", 5_000),
    ("50k", 50_000),
    ("500k", 500_000),
    ("1M", 1_000_000),
];

fn main() {
    let folder = tempfile::tempdir().unwrap();
    let mut cases = Vec::new();
    for (size, tets) in SIZES {
        let named = |shape| (format!("body-{shape}-{size}"), Source::Shape(shape, tets));
        cases.extend(bodies().map(named));
    }
    let cases: Vec<_> = cases
        .iter()
        .map(|(name, source)| (name.as_str(), source.clone()))
        .collect();
    incise_benches::run_with("mesh", &cases, |bench| {
        let case = bench.case;
        if !matches!(case.source, Source::File(_)) {
            bench.measure("generate", |b| b.iter(|| case.source.mesh()));
        }
        if case.name.starts_with("body-") {
            return;
        }
        bench.measure("check", |b| b.iter(|| case.mesh.check_report()));
        bench.measure("surface", |b| b.iter(|| case.mesh.surface()));
        bench.measure("pieces", |b| b.iter(|| case.mesh.pieces()));

        let path = folder.path().join("case.vtk");
        // Written once beforehand, for runs that leave the next bench out.
        mesh_io::write(&path, &case.mesh).unwrap();
        bench.measure("write-vtk", |b| {
            b.iter(|| mesh_io::write(&path, &case.mesh).unwrap());
        });
        bench.measure("read-vtk", |b| b.iter(|| mesh_io::read(&path).unwrap()));
    });
}
