//! From tets to a verified coloring, beside other libraries: finding the conflicts is part of the work.
//!
//! All start from the same lists of particles and end with the same verification. The libraries take a graph; they get
//! it from `ConstraintGraph`, which is faster than any of them builds one. They take seconds to minutes on meshes of
//! 100,000 tets, and every measurement runs a dozen times. The number of colors of each is printed before its time.

use incise::coloring::{Order, auto, greedy};
use incise::graph::{ColorId, Coloring, ConstraintGraph};
use petgraph::graph::UnGraph;
use rustworkx_core::coloring::{ColoringStrategy, greedy_node_color_with_coloring_strategy};

#[expect(
    clippy::print_stderr,
    reason = "a time says nothing without the number of colors"
)]
fn main() {
    incise_benches::run("peers", |bench| {
        let case = bench.case;
        let mut measure = |name: &str, color: &dyn Fn() -> Coloring| {
            let verified = || {
                let coloring = color();
                let proof = coloring.verify_incidence(&case.incidence());
                assert!(proof.is_ok(), "{name}: {proof:?}");
                coloring.color_count()
            };
            eprintln!("{name}/{}: {} colors", case.name, verified());
            bench.measure(name, |b| b.iter(verified));
        };
        let graph = || ConstraintGraph::from_incidence(&case.incidence());
        let natural = |graph: &ConstraintGraph| greedy(graph, Order::Natural);
        measure("auto", &|| auto(&case.incidence()).coloring);
        measure("greedy-natural", &|| {
            greedy(&case.incidence(), Order::Natural)
        });
        measure("greedy-degree-bound", &|| {
            greedy(&case.incidence(), Order::DegreeBound)
        });
        measure("greedy-largest-first", &|| {
            greedy(&case.incidence(), Order::LargestFirst)
        });
        measure("csr-greedy-natural", &|| natural(&graph()));
        measure("csr-greedy-largest-first", &|| {
            greedy(&graph(), Order::LargestFirst)
        });
        measure("csr-greedy-smallest-last", &|| {
            greedy(&graph(), Order::SmallestLast)
        });
        let outside = || UnGraph::from(&graph());
        for (name, strategy) in [
            ("rustworkx-degree", ColoringStrategy::Degree),
            (
                "rustworkx-independent-set",
                ColoringStrategy::IndependentSet,
            ),
            ("rustworkx-saturation", ColoringStrategy::Saturation),
        ] {
            measure(name, &|| {
                let graph = outside();
                let none = |_| Ok::<Option<usize>, std::convert::Infallible>(None);
                let colors =
                    greedy_node_color_with_coloring_strategy(&graph, none, strategy.clone());
                let Ok(colors) = colors;
                let nodes = graph.node_indices();
                Coloring::new(nodes.map(|node| ColorId::new(colors[&node])).collect())
            });
        }
        measure("petgraph-dsatur", &|| {
            let graph = outside();
            let (colors, _) = petgraph::algo::coloring::dsatur_coloring(&graph);
            let nodes = graph.node_indices();
            Coloring::new(nodes.map(|node| ColorId::new(colors[&node])).collect())
        });
    });
}
