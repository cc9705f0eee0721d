//! Computes the solving order of a parallel solver from constraints: a net of springs with a
//! coloring by hand.
//!
//! `cargo run -p incise-graph --example schedule`

#![expect(clippy::print_stdout, reason = "prints what it did")]

use incise_graph::{
    Clustering, ColorId, Coloring, ConstraintGraph, GraphError, Incidence, Schedule,
};

fn main() -> Result<(), GraphError> {
    // A net of 30 × 20 particles, springs along both directions.
    let (width, height) = (30u32, 20u32);
    let particle = |x: u32, y: u32| width * y + x;
    let mut springs = Vec::new();
    let mut colors = Vec::new();
    for y in 0..height {
        for x in 0..width {
            if x + 1 < width {
                springs.push([particle(x, y), particle(x + 1, y)]);
                colors.push(ColorId(x % 2));
            }
            if y + 1 < height {
                springs.push([particle(x, y), particle(x, y + 1)]);
                colors.push(ColorId(2 + y % 2));
            }
        }
    }
    let incidence = Incidence::from_constraints((width * height) as usize, springs)?;
    let graph = ConstraintGraph::from_incidence(&incidence);
    let coloring = Coloring::new(colors);
    coloring.verify(&graph)?;

    let schedule = Schedule::new(&Clustering::none(incidence.constraint_count()), &coloring);
    schedule.check(&incidence)?;
    println!(
        "{} springs, {} particles",
        incidence.constraint_count(),
        width * height
    );
    for color in 0..schedule.color_count() {
        let springs = schedule.color_constraints(color).count();
        println!("color {color}: {springs} springs that share no particle");
    }
    Ok(())
}
