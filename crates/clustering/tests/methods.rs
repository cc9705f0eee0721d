//! Guarantees of every method: a partition, the size limit, connected clusters, a deterministic
//! result; and the purpose of pressure clustering.

use std::num::NonZeroUsize;

use incise_clustering::{Method, cluster};
use incise_graph::{ClusterId, Clustering, Incidence};
use proptest::prelude::*;

use crate::inputs::{awkward, incidences};

fn all(size: usize) -> [Method; 4] {
    let size = NonZeroUsize::new(size).unwrap();
    [
        Method::Serial(size),
        Method::SerialLoose(size),
        Method::GreedyK(size),
        Method::Pressure(size),
    ]
}

/// True if every cluster is connected through shared particles.
fn is_connected(incidence: &Incidence, clustering: &Clustering) -> bool {
    clustering.members().iter().all(|members| {
        let mut reached = vec![members[0]];
        let mut next = 0;
        while let Some(&c) = reached.get(next) {
            next += 1;
            for &d in members {
                let others = incidence.particles_of(d as usize);
                let mut particles = incidence.particles_of(c as usize).iter();
                if !reached.contains(&d) && particles.any(|p| others.contains(p)) {
                    reached.push(d);
                }
            }
        }
        reached.len() == members.len()
    })
}

fn keeps_its_promises(method: Method, incidence: &Incidence) {
    let clustering = cluster(method, incidence);
    clustering.check().unwrap();
    let constraints = incidence.constraint_count();
    assert_eq!(clustering.constraint_count(), constraints);
    assert!(
        !clustering.labels().contains(&ClusterId::NONE),
        "{method}: a partition"
    );
    assert_eq!(
        clustering.occupied(),
        clustering.cluster_count(),
        "{method}: no gaps"
    );
    assert!(
        clustering.max_size() <= method.max_size().get(),
        "{method}: the limit"
    );
    assert!(is_connected(incidence, &clustering), "{method}: connected");
    assert_eq!(
        cluster(method, incidence),
        clustering,
        "{method}: the same again"
    );
}

proptest! {
    #[test]
    fn promises(incidence in incidences(), size in 1usize..40) {
        for method in all(size) {
            keeps_its_promises(method, &incidence);
        }
    }

    #[test]
    fn size_one_leaves_all_alone(incidence in incidences()) {
        let constraints = incidence.constraint_count();
        for method in ["none", "serial:1", "greedy-k:1", "pressure:1"] {
            let clustering = cluster(method.parse().unwrap(), &incidence);
            prop_assert_eq!(clustering.occupied(), constraints);
        }
    }

    /// Constraints without a common particle never share a cluster, so an unlimited size gives the
    /// components, except for serial clusters, which end at the neighbors of the seed.
    #[test]
    fn an_unlimited_size_gives_the_components(incidence in incidences()) {
        let greedy = cluster(Method::GreedyK(NonZeroUsize::MAX), &incidence);
        let quotient = incidence.quotient(&greedy);
        prop_assert!(quotient.clique_bound() <= 1);
        // Far above, but not so far that the share reserved for pockets matters.
        let pressure = cluster("pressure:100".parse().unwrap(), &incidence);
        prop_assert_eq!(pressure.occupied(), greedy.occupied());
    }
}

#[test]
fn awkward_inputs() {
    for incidence in awkward() {
        for size in [1, 2, 5, 15, 16, 17, 31, 32, 33, 64, 256, 1000, usize::MAX] {
            for method in all(size) {
                keeps_its_promises(method, &incidence);
            }
        }
    }
}

/// A fan needs as few clusters at its hub as its valence allows.
#[test]
fn fans_are_cut_evenly_enough() {
    let fan = Incidence::from_constraints(501, (1u32..501).map(|i| [0, i])).unwrap();
    for (size, clusters) in [(1, 500), (5, 100), (10, 50), (64, 8), (256, 2)] {
        let clustering = cluster(Method::Pressure(NonZeroUsize::new(size).unwrap()), &fan);
        let spare = if size < 16 { 0 } else { 1 };
        assert!(
            (clusters..=clusters + spare).contains(&clustering.occupied()),
            "{size}"
        );
    }
}

/// Tets around hubs: the case for which pressure clustering is designed.
#[test]
fn pressure_has_the_lowest_bound_among_hubs() {
    let tets = stacked(3000);
    for size in [3, 5, 10] {
        let [serial, _, greedy, pressure] =
            all(size).map(|method| tets.quotient(&cluster(method, &tets)).clique_bound());
        assert!(
            pressure < serial && pressure < greedy,
            "{serial} {greedy} {pressure}"
        );
    }
}

/// A tet split into four around a new particle, then one of all tets again, and so on: old
/// particles get a very high valence.
fn stacked(splits: u32) -> Incidence {
    let mut tets = vec![[0u32, 1, 2, 3]];
    let mut random = 1u32;
    for particle in 4..4 + splits {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let chosen = (random >> 8) as usize % tets.len();
        let [a, b, c, d] = tets[chosen];
        tets[chosen] = [a, b, c, particle];
        tets.extend([
            [a, b, particle, d],
            [a, particle, c, d],
            [particle, b, c, d],
        ]);
    }
    Incidence::from_constraints(4 + splits as usize, tets).unwrap()
}
