//! The data types of scheduling: incidence, the constraint graph, its quotient by clusters, the schedule.

use std::num::NonZeroUsize;

use incise::clustering::serial_neighbor;
use incise::coloring::{Order, greedy};
use incise::graph::{ConstraintGraph, Schedule};

fn main() {
    incise_benches::run("graph", |bench| {
        let case = bench.case;
        let incidence = case.incidence();
        let graph = ConstraintGraph::from_incidence(&incidence);
        let clustering = serial_neighbor(&graph, NonZeroUsize::MIN.saturating_add(9));
        let coloring = greedy(&graph.quotient(&clustering), Order::LargestFirst);

        bench.measure("incidence", |b| b.iter(|| case.incidence()));
        bench.measure("graph", |b| {
            b.iter(|| ConstraintGraph::from_incidence(&incidence));
        });
        bench.measure("quotient", |b| b.iter(|| graph.quotient(&clustering)));
        let mut schedule = Schedule::default();
        bench.measure("schedule", |b| {
            b.iter(|| schedule.rebuild(&clustering, &coloring));
        });
    });
}
