//! Coloring the tets and their clusters of ten: directly from particles, and from an existing graph.
//!
//! The parallel ones run on as many threads as `RAYON_NUM_THREADS` says, else on all cores.

use std::num::NonZeroUsize;

use incise::clustering::serial_neighbor_incidence;
use incise::coloring::{Order, auto, balance, dsatur, ecl_gc, greedy, jones_plassmann, scgc, wlc};
use incise::graph::ConstraintGraph;

fn main() {
    incise_benches::run("coloring", |bench| {
        let tets = bench.case.incidence();
        let limit = NonZeroUsize::MIN.saturating_add(9);
        let clusters = tets.quotient(&serial_neighbor_incidence(&tets, limit));
        for (name, incidence) in [("none", &tets), ("serial10", &clusters)] {
            let graph = &ConstraintGraph::from_incidence(incidence);
            let mut measure = |algorithm: &str, color: &dyn Fn()| {
                bench.measure(&format!("{algorithm}-{name}"), |b| b.iter(color));
            };
            let chunk = NonZeroUsize::MIN.saturating_add(2047);
            measure("auto", &|| drop(auto(incidence)));
            measure("degree-bound", &|| {
                drop(greedy(incidence, Order::DegreeBound));
            });
            measure("particles-greedy", &|| {
                drop(greedy(incidence, Order::LargestFirst));
            });
            measure("greedy", &|| drop(greedy(graph, Order::LargestFirst)));
            measure("smallest-last", &|| {
                drop(greedy(graph, Order::SmallestLast));
            });
            measure("mcs", &|| {
                drop(greedy(graph, Order::MaximumCardinality));
            });
            measure("dsatur", &|| drop(dsatur(graph)));
            measure("scgc", &|| drop(scgc(graph)));
            measure("jones-plassmann", &|| drop(jones_plassmann(graph)));
            measure("ecl-gc", &|| drop(ecl_gc(graph)));
            measure("wlc", &|| drop(wlc(graph, chunk)));
            let start = auto(incidence).coloring;
            let one_each = vec![1; incidence.constraint_count()];
            measure("balance", &|| {
                balance(incidence, &mut start.clone(), &one_each);
            });
        }
    });
}
