//! The graph of an incidence equals the relation "shares a particle", and quotients commute with
//! it.

use std::collections::BTreeSet;

use incise_graph::{ClusterId, Clustering, ConstraintGraph, GraphError, Incidence};
use proptest::collection::{btree_set, vec};
use proptest::prelude::*;

/// Up to 30 constraints of arity 0 to 5 on up to 12 particles.
fn incidences() -> impl Strategy<Value = Incidence> {
    (1u32..12).prop_flat_map(|particles| {
        let arity = 0..=5.min(particles as usize);
        vec(
            btree_set(0..particles, arity).prop_map(Vec::from_iter),
            0..30,
        )
        .prop_map(move |constraints| {
            Incidence::from_constraints(particles as usize, constraints).unwrap()
        })
    })
}

fn clustered() -> impl Strategy<Value = (Incidence, Clustering)> {
    incidences().prop_flat_map(|incidence| {
        let n = u32::try_from(incidence.constraint_count()).unwrap();
        let label = prop_oneof![9 => (0..n.max(1)).prop_map(ClusterId), 1 => Just(ClusterId::NONE)];
        vec(label, n as usize)
            .prop_map(move |labels| (incidence.clone(), Clustering::from_labels(labels).unwrap()))
    })
}

/// True if two constraints share a particle.
fn share(incidence: &Incidence, a: usize, b: usize) -> bool {
    incidence
        .particles_of(a)
        .iter()
        .any(|p| incidence.particles_of(b).contains(p))
}

proptest! {
    #[test]
    fn edges_are_shared_particles(incidence in incidences()) {
        let graph = ConstraintGraph::from_incidence(&incidence);
        let n = incidence.constraint_count();
        prop_assert_eq!(graph.vertex_count(), n);
        for a in 0..n {
            let expected: Vec<u32> = (0u32..)
                    .zip(0..n)
                    .filter(|&(_, b)| b != a && share(&incidence, a, b))
                    .map(|(id, _)| id)
                    .collect();
            prop_assert_eq!(graph.neighbors(a), &expected[..]);
        }
    }

    #[test]
    fn both_lists_of_an_incidence_say_the_same(incidence in incidences()) {
        for p in 0..incidence.particle_count() {
            let expected: Vec<u32> = (0u32..)
                .zip(0..incidence.constraint_count())
                .filter(|&(_, c)| incidence.particles_of(c).iter().any(|&q| q as usize == p))
                .map(|(id, _)| id)
                .collect();
            prop_assert_eq!(incidence.constraints_of(p), &expected[..]);
        }
    }

    #[test]
    fn quotients_commute((incidence, clustering) in clustered()) {
        let by_particles = ConstraintGraph::from_incidence(&incidence.quotient(&clustering));
        let by_edges = ConstraintGraph::from_incidence(&incidence).quotient(&clustering);
        prop_assert_eq!(by_particles, by_edges);
    }

    #[test]
    fn no_clusters_change_nothing(incidence in incidences()) {
        let graph = ConstraintGraph::from_incidence(&incidence);
        prop_assert_eq!(&graph.quotient(&Clustering::none(graph.vertex_count())), &graph);
    }

    #[test]
    fn edge_lists_make_the_same_graph(incidence in incidences()) {
        let graph = ConstraintGraph::from_incidence(&incidence);
        let mut edges: Vec<(u32, u32)> = graph.edges().map(|(a, b)| (b, a)).collect();
        edges.reverse();
        prop_assert_eq!(&ConstraintGraph::from_edges(graph.vertex_count(), &edges).unwrap(), &graph);
    }

    #[test]
    fn csr_rows_make_an_equal_graph_or_name_the_one_sided_edge(
        rows in (1u32..9).prop_flat_map(|n| vec(vec(0..n, 0..6), n as usize)),
        symmetric in any::<bool>(),
    ) {
        // No loops; half of the time each edge in both directions.
        let mut rows: Vec<Vec<u32>> = (0..)
            .zip(rows)
            .map(|(v, row)| row.into_iter().filter(|&u| u != v).collect())
            .collect();
        if symmetric {
            for v in 0..rows.len() {
                for u in rows[v].clone() {
                    rows[u as usize].push(u32::try_from(v).unwrap());
                }
            }
        }
        let listed: BTreeSet<(u32, u32)> = (0..)
            .zip(&rows)
            .flat_map(|(v, row)| row.iter().map(move |&u| (v, u)))
            .collect();
        let one_sided = listed
            .iter()
            .filter(|&&(from, to)| !listed.contains(&(to, from)))
            .min_by_key(|&&(from, to)| (from.min(to), from.max(to)));
        let expected = match one_sided {
            Some(&(from, to)) => Err(GraphError::OneSided { from, to }),
            None => ConstraintGraph::from_edges(rows.len(), &Vec::from_iter(listed)),
        };
        let mut offsets = vec![0];
        offsets.extend(rows.iter().scan(0, |sum, row| {
            *sum += u32::try_from(row.len()).unwrap();
            Some(*sum)
        }));
        prop_assert_eq!(ConstraintGraph::from_csr(offsets, rows.concat()), expected);
    }

    #[test]
    fn random_edits_keep_counts_right(
        (incidence, mut clustering) in clustered(),
        edits in vec((0usize..40, 0usize..40), 0..60),
    ) {
        let limit = incidence.constraint_count().max(40);
        for (constraint, other) in edits {
            let known = |c: usize| c < clustering.constraint_count();
            let joined = if known(other) { clustering.cluster_of(other) } else { None };
            if known(constraint) && clustering.cluster_of(constraint).is_some() {
                clustering.remove(constraint);
            } else if let Some(cluster) = joined {
                clustering.assign(constraint, cluster);
            } else {
                clustering.new_cluster(constraint);
            }
            clustering.check().unwrap();
            prop_assert!(clustering.cluster_count() <= limit);
        }
    }
}

#[cfg(feature = "petgraph")]
proptest! {
    #[test]
    fn graphs_come_back_from_petgraph(incidence in incidences()) {
        let graph = ConstraintGraph::from_incidence(&incidence);
        let outside = petgraph::graph::UnGraph::from(&graph);
        prop_assert_eq!(ConstraintGraph::try_from(&outside).unwrap(), graph);
    }
}
