//! Sweeps a curved blade through a box and prints what each frame changes.
//!
//! `cargo run -p incise-cutting --example sweep`

#![expect(clippy::print_stdout, reason = "prints what it did")]

use glam::DVec3;
use incise_cutting::{CutOptions, CuttableMesh, PieceTracker, Sweep};
use incise_mesh::kuhn_box;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut body = CuttableMesh::new(kuhn_box([6, 6, 6], DVec3::ONE))?;
    let mut pieces = PieceTracker::new(&body);
    let volume = body.mesh().total_volume();
    let blade = |z: f64| [-0.5, 0.25, 0.75, 1.5].map(|y: f64| DVec3::new(0.4 + 0.2 * y * y, y, z));
    let start = body.mesh().positions.clone();
    let mut stroke = Sweep::new(&body, &start, &blade(1.1), CutOptions::default())?;
    for frame in 1..=13 {
        let positions = body.mesh().positions.clone(); // those of a simulation, where the body moves
        let delta = stroke.advance(&mut body, &positions, &blade(1.1 - 0.1 * f64::from(frame)))?;
        let came_off = pieces.apply_delta(&body, &delta).len();
        println!(
            "frame {frame:2}: {:3} tets split, {:3} new ones, {:3} new triangles, {came_off} piece(s) came off",
            delta.removed.len(),
            delta.added.len(),
            delta.surface_added.len(),
        );
    }
    body.check()?;
    let error = body.mesh().total_volume() / volume - 1.0;
    println!("{} pieces, volume kept to {error:.0e}", pieces.count());
    Ok(())
}
