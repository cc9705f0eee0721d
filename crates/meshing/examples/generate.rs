//! Generates a shape and prints the time: `generate SHAPE TETS`, such as `generate bunny 1000000`.
//!
//! What else is done takes little, so that the peak memory of the process is that of generating.

#![expect(clippy::print_stdout, reason = "prints what it measured")]

use std::error::Error;
use std::time::Instant;

use incise_meshing::{Shape, generate};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [shape, tets] = arguments.as_slice() else {
        return Err("give a shape and a number of tets, such as: bunny 1000000".into());
    };
    let (shape, tets) = (Shape::from_name(shape)?, tets.parse()?);
    let start = Instant::now();
    let mesh = generate(shape, tets)?;
    let seconds = start.elapsed().as_secs_f64();
    let quality = mesh.quality();
    println!(
        "{shape}: {} tets, {} particles in {seconds:.2} s, dihedral angles {:.1} to {:.1} degrees",
        mesh.tets.len(),
        mesh.positions.len(),
        quality.min_dihedral,
        quality.max_dihedral
    );
    Ok(())
}
