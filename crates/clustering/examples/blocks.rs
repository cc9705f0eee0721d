//! Two levels for a GPU: blocks of tets for workgroups, colors inside each block for threads.
//!
//! ```text
//! cargo run --release -p incise-clustering --example blocks -- liver.vtk
//! ```
//!
//! Without a mesh it takes a box of tets. Workgroups take the blocks of one color at the same time;
//! the threads of a workgroup take the tets of one step at the same time and wait for each other
//! after it.

#![expect(
    clippy::print_stdout,
    reason = "a report on the terminal is what it is for"
)]

use std::error::Error;
use std::num::NonZeroUsize;

use incise_clustering::pressure;
use incise_coloring::{Order, color_within_clusters, greedy};
use incise_graph::{BlockSchedule, Incidence};
use incise_mesh::generate::kuhn_box;
use incise_mesh::glam::DVec3;
use incise_mesh::io;

fn main() -> Result<(), Box<dyn Error>> {
    let mesh = match std::env::args().nth(1) {
        Some(path) => io::read(path)?,
        None => kuhn_box([12; 3], DVec3::ONE),
    };
    let incidence = Incidence::from_constraints(mesh.positions.len(), mesh.tets.iter().copied())?;
    println!("{} tets", incidence.constraint_count());
    for size in [64, 128, 256] {
        let blocks = pressure(&incidence, NonZeroUsize::new(size).ok_or("no size")?);
        let outer = greedy(&incidence.quotient(&blocks), Order::MaximumCardinality);
        let inner = color_within_clusters(&incidence, &blocks);
        let schedule = BlockSchedule::new(&blocks, &outer, &inner);
        schedule.check(&incidence)?;
        let longest = (0..schedule.block_count())
            .map(|block| schedule.steps(block).len())
            .max();
        println!(
            "blocks of up to {size}: {} blocks in {} colors, at most {} steps in a block",
            schedule.block_count(),
            schedule.color_count(),
            longest.unwrap_or(0)
        );
    }
    Ok(())
}
