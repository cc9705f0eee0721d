//! A schedule holds every constraint once, in the order of the definition, and its check agrees
//! with the coloring's.

use incise_graph::{ClusterId, Clustering, ColorId, Coloring, Incidence, Schedule};
use proptest::collection::vec;
use proptest::prelude::*;

fn inputs() -> impl Strategy<Value = (Clustering, Coloring)> {
    (1u32..25).prop_flat_map(|n| {
        let labels = vec((0..n).prop_map(ClusterId), n as usize);
        (labels, vec((0u32..6).prop_map(ColorId), n as usize)).prop_map(|(labels, mut colors)| {
            let clustering = Clustering::from_labels(labels).unwrap();
            colors.truncate(clustering.cluster_count());
            (clustering, Coloring::new(colors))
        })
    })
}

proptest! {
    #[test]
    fn order_is_color_then_cluster_then_number((clustering, coloring) in inputs()) {
        let schedule = Schedule::new(&clustering, &coloring);
        let mut expected: Vec<(ColorId, ClusterId, u32)> = (0u32..)
            .zip(clustering.labels())
            .map(|(c, &k)| (coloring.color(k.index()), k, c))
            .collect();
        expected.sort_unstable();
        let order: Vec<u32> = expected.iter().map(|&(_, _, c)| c).collect();
        prop_assert_eq!(schedule.order(), &order[..]);
        let slots: Vec<u32> = (0..schedule.cluster_count())
            .flat_map(|s| schedule.constraints(s).to_vec())
            .collect();
        prop_assert_eq!(slots, &order[..]);
        let colors: Vec<u32> = (0..schedule.color_count())
            .flat_map(|c| schedule.color_constraints(c).to_vec())
            .collect();
        prop_assert_eq!(colors, order);
    }

    #[test]
    fn check_agrees_with_the_coloring(
        (clustering, coloring) in inputs(),
        arity in 1u32..4,
        particles in 4u32..30,
    ) {
        let rows = (0u32..)
            .zip(clustering.labels())
            .map(|(c, _)| (0..arity).map(move |i| (c * 7 + i) % particles));
        let incidence = Incidence::from_constraints(particles as usize, rows).unwrap();
        let proper = coloring.verify_incidence(&incidence.quotient(&clustering)).is_ok();
        prop_assert_eq!(Schedule::new(&clustering, &coloring).check(&incidence).is_ok(), proper);
    }

    #[test]
    fn a_schedule_can_be_used_again((first, colors) in inputs(), (second, others) in inputs()) {
        let mut schedule = Schedule::new(&first, &colors);
        schedule.rebuild(&second, &others);
        prop_assert_eq!(schedule, Schedule::new(&second, &others));
    }
}
