//! Colors the constraints of a cloth by every algorithm; prints the number of colors, their evenness, and the time.
//!
//! `cargo run --release -p incise-coloring --example algorithms`

#![expect(clippy::print_stdout, reason = "prints what it did")]

use std::time::Instant;

use incise_coloring::{Algorithm, color};
use incise_graph::Incidence;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Triangles of a cloth of 60 × 60 particles: each holds three.
    let side = 60u32;
    let mut triangles = Vec::new();
    for y in 0..side - 1 {
        for x in 0..side - 1 {
            let at = |dx, dy| side * (y + dy) + x + dx;
            triangles.push([at(0, 0), at(1, 0), at(0, 1)]);
            triangles.push([at(1, 0), at(1, 1), at(0, 1)]);
        }
    }
    let incidence = Incidence::from_constraints((side * side) as usize, triangles)?;
    println!("{} triangles", incidence.constraint_count());
    for name in ["auto", "greedy", "scgc", "ecl-gc", "dsatur", "vivace"] {
        let algorithm: Algorithm = name.parse()?;
        let start = Instant::now();
        let colored = color(algorithm, &incidence, 0)?;
        let ms = 1e3 * start.elapsed().as_secs_f64();
        colored.coloring.verify_incidence(&incidence)?;
        let sizes: Vec<usize> = colored
            .coloring
            .classes()
            .iter()
            .map(<[u32]>::len)
            .collect();
        println!("{name:8} {ms:6.2} ms, colors of {sizes:?} triangles");
    }
    Ok(())
}
