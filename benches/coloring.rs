//! Coloring the graph of the tets and the graph of their clusters of ten, one after the other and in parallel.
//!
//! The parallel ones run on as many threads as `RAYON_NUM_THREADS` says, else on all cores.

use std::num::NonZeroUsize;

use incise::clustering::serial_neighbor;
use incise::coloring::{Order, greedy, scgc};

fn main() {
    incise_benches::run("coloring", |bench| {
        let tets = bench.case.graph();
        let clusters = serial_neighbor(&tets, NonZeroUsize::MIN.saturating_add(9));
        let clusters = tets.quotient(&clusters);
        for (name, graph) in [("none", &tets), ("serial10", &clusters)] {
            bench.measure(&format!("greedy-{name}"), |b| {
                b.iter(|| greedy(graph, Order::LargestFirst));
            });
            bench.measure(&format!("scgc-{name}"), |b| b.iter(|| scgc(graph)));
        }
    });
}
