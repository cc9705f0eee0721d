//! Compares all clustering methods on meshes: clusters, bound, colors, time.
//!
//! ```text
//! cargo run --release -p incise-clustering --example compare -- 5,10 liver.vtk kuhn:24
//! ```
//!
//! The first argument lists the cluster sizes; the others name mesh files, `kuhn:N` for a box of
//! N x N x N cubes cut into six tets each, or a generated shape and its number of tets, as
//! `sphere:10000`. The bound is the largest number of clusters at one
//! particle; colors are those of greedy coloring in maximum cardinality order; the time is the
//! shortest of five runs on one thread and covers clustering only.

#![expect(
    clippy::print_stdout,
    reason = "a table on the terminal is what it is for"
)]

use std::error::Error;
use std::num::NonZeroUsize;
use std::time::{Duration, Instant};

use incise_clustering::{Method, cluster, serial_neighbor};
use incise_coloring::{Order, greedy};
use incise_graph::{Clustering, ConstraintGraph, Incidence};
use incise_mesh::glam::DVec3;
use incise_mesh::kuhn_box;
use incise_meshing::{Shape, generate};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let sizes = arguments
        .next()
        .ok_or("give cluster sizes and meshes, as 5,10 mesh.vtk")?;
    let sizes: Vec<NonZeroUsize> = sizes.split(',').map(str::parse).collect::<Result<_, _>>()?;
    println!("| mesh | K | method | clusters | n / K | bound | colors | ms |");
    println!("|---|---|---|---|---|---|---|---|");
    for name in arguments {
        let mesh = match name.split_once(':') {
            Some(("kuhn", cells)) => kuhn_box([cells.parse()?; 3], DVec3::ONE),
            Some((shape, tets)) => generate(Shape::from_name(shape)?, tets.parse()?)?,
            None => incise_mesh_io::read(&name)?,
        };
        let tets = mesh.tets.iter().copied();
        let incidence = Incidence::from_constraints(mesh.positions.len(), tets)?;
        let short = name.rsplit('/').next().unwrap_or(&name);
        for &size in &sizes {
            let share = incidence.constraint_count().div_ceil(size.get());
            let row = |method: &str, (clustering, time): (Clustering, Duration)| {
                let clusters = incidence.quotient(&clustering);
                println!(
                    "| {short} | {size} | {method} | {} | {share} | {} | {} | {:.1} |",
                    clustering.occupied(),
                    clusters.clique_bound(),
                    greedy(&clusters, Order::MaximumCardinality).color_count(),
                    time.as_secs_f64() * 1e3
                );
            };
            row(
                "serial by graph",
                fastest(|| serial_neighbor(&ConstraintGraph::from_incidence(&incidence), size)),
            );
            for method in [
                Method::Serial(size),
                Method::GreedyK(size),
                Method::Pressure(size),
            ] {
                let name = method.to_string();
                let (name, _) = name.split_once(':').unwrap_or((&name, ""));
                row(name, fastest(|| cluster(method, &incidence)));
            }
        }
    }
    Ok(())
}

/// The result, and the shortest time of five runs.
fn fastest(run: impl Fn() -> Clustering) -> (Clustering, Duration) {
    let mut shortest = Duration::MAX;
    let mut clustering = Clustering::default();
    for _ in 0..5 {
        let start = Instant::now();
        clustering = run();
        shortest = shortest.min(start.elapsed());
    }
    (clustering, shortest)
}
