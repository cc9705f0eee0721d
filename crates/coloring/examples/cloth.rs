//! Colors the springs of a cloth, balances the colors, and tears the cloth.
//!
//! `cargo run --release -p incise-coloring --example cloth [SIDE]`

#![expect(clippy::print_stdout, reason = "prints what it did")]

use std::time::Instant;

use incise_coloring::{Recoloring, auto, balance};
use incise_graph::{ColoringMetrics, Incidence};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let side: u32 = match std::env::args().nth(1) {
        Some(side) => side.parse()?,
        None => 100,
    };
    let at = |x: u32, y: u32| side * y + x;
    let mut springs: Vec<[u32; 2]> = Vec::new();
    for (y, x) in (0..side).flat_map(|y| (0..side).map(move |x| (y, x))) {
        for (dx, dy) in [(1, 0), (0, 1), (1, 1)] {
            if x + dx < side && y + dy < side {
                springs.push([at(x, y), at(x + dx, y + dy)]);
            }
        }
    }
    let particles = (side * side) as usize;
    let incidence = Incidence::from_constraints(particles, &springs)?;

    let start = Instant::now();
    let mut coloring = auto(&incidence).coloring;
    let colored = start.elapsed();
    let before = ColoringMetrics::by_vertices(&coloring);
    let start = Instant::now();
    let stats = balance(&incidence, &mut coloring, &vec![1; springs.len()]);
    let balanced = start.elapsed();
    coloring.verify_incidence(&incidence)?;
    println!(
        "{} springs, {} colors in {colored:.1?}; largest minus smallest class {} -> {} in {balanced:.1?}",
        springs.len(),
        before.colors,
        before.range,
        stats.range,
    );

    // A tear along the middle: the springs across it go, and two stitches come.
    let middle = side / 2;
    let is_torn = |[a, b]: &[u32; 2]| a % side < middle && b % side >= middle;
    let torn: Vec<u32> = (0..)
        .zip(&springs)
        .filter(|(_, spring)| is_torn(spring))
        .map(|(number, _)| number)
        .collect();
    let mut cloth = Recoloring::new(&incidence, 1);
    let start = Instant::now();
    cloth.remove(&torn)?;
    let ends = [at(0, 0), at(0, side - 1)];
    let (stitches, report) = cloth.add(ends.map(|end| [end, end + middle]))?;
    println!(
        "{} springs torn, springs {stitches:?} added in {:.1?}; {} colors",
        torn.len(),
        start.elapsed(),
        report.colors
    );
    cloth.coloring().verify_incidence(&cloth.incidence())?;
    for springs in cloth.classes().iter() {
        // These share no particle: solve them in parallel.
        assert!(springs.len() <= particles / 2);
    }
    Ok(())
}
