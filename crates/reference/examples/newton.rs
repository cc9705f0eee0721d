//! What an iteration of Newton's method costs, as a table: a body is held where its x is smallest and falls under
//! gravity for eight frames of 1/60 s. The time is that of the fastest frame.
//!
//! ```text
//! cargo run --release -p incise-reference --example newton -- kuhn:4 kuhn:8 MESH.vtk ...
//! ```
//!
//! `kuhn:N` is a beam of 4 N × N × N cubes, each of them six tets; anything else is a file that `incise-mesh-io` reads.

use std::error::Error;
use std::time::Instant;

use glam::{DVec3, dvec3};
use incise_mesh::{ParticleId, TetMesh, kuhn_box};
use incise_reference::{Material, ReferenceBody};

const FRAMES: usize = 8;

#[expect(clippy::print_stdout, reason = "a table is what this is for")]
fn main() -> Result<(), Box<dyn Error>> {
    println!("| mesh | particles | tets | symbolic ms | iterations | ms per iteration |");
    println!("|---|---|---|---|---|---|");
    for name in std::env::args().skip(1) {
        let mesh = read(&name)?;
        let tets: Vec<[u32; 4]> = mesh.tets.iter().map(|t| t.map(|ParticleId(p)| p)).collect();
        let start = Instant::now();
        let mut body = ReferenceBody::new(&mesh.positions, &tets, |_tet| Material {
            young_modulus: 1e6,
            poisson_ratio: 0.45,
            density: 1000.0,
        })?;
        let symbolic = start.elapsed().as_secs_f64();
        let xs = mesh.positions.iter().map(|x| x.x);
        let (low, high) = xs.fold((f64::MAX, f64::MIN), |(a, b), x| (a.min(x), b.max(x)));
        for (p, x) in mesh.positions.iter().enumerate() {
            body.fixed[p] = x.x <= low + 0.1 * (high - low);
        }
        let (mut iterations, mut each) = (0, f64::MAX);
        for _ in 0..FRAMES {
            let start = Instant::now();
            let taken = body.step(1.0 / 60.0, DVec3::NEG_Z * 9.81)?.iterations();
            each = each.min(start.elapsed().as_secs_f64() / taken as f64);
            iterations += taken;
        }
        println!(
            "| {} | {} | {} | {:.1} | {iterations} | {:.1} |",
            name.rsplit('/').next().unwrap_or(&name),
            mesh.positions.len(),
            tets.len(),
            symbolic * 1e3,
            each * 1e3
        );
    }
    Ok(())
}

fn read(name: &str) -> Result<TetMesh, Box<dyn Error>> {
    match name.strip_prefix("kuhn:") {
        Some(count) => {
            let n: usize = count.parse()?;
            Ok(kuhn_box([4 * n, n, n], dvec3(4.0, 1.0, 1.0)))
        }
        None => Ok(incise_mesh_io::read(name)?),
    }
}
