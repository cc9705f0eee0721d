//! Colors rods of different lengths: constraints of mixed arity in one incidence.
//!
//! `cargo run --release -p incise-coloring --example rods`

#![expect(clippy::print_stdout, reason = "prints what it did")]

use incise_coloring::auto;
use incise_graph::Incidence;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A bundle of 100 elastic rods of 30 particles. Stretch holds 2 neighbors, bending 3, torsion 4.
    let (rods, length) = (100u32, 30u32);
    let mut constraints: Vec<Vec<u32>> = Vec::new();
    for rod in 0..rods {
        let first = rod * length;
        for arity in [2, 3, 4] {
            let starts = first..=first + length - arity;
            constraints.extend(starts.map(|p| (p..p + arity).collect()));
        }
    }
    // A ring that ties the first particles of all rods together.
    constraints.push((0..rods).map(|rod| rod * length).collect());

    let incidence = Incidence::from_constraints((rods * length) as usize, &constraints)?;
    let colored = auto(&incidence);
    colored.coloring.verify_incidence(&incidence)?;
    println!(
        "{} constraints of arity 2 to {rods}: {} colors, at least {}",
        constraints.len(),
        colored.coloring.color_count(),
        incidence.clique_bound()
    );
    for (color, members) in colored.coloring.classes().iter().enumerate() {
        println!(
            "color {color}: {} constraints at the same time",
            members.len()
        );
    }
    Ok(())
}
