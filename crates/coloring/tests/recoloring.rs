//! A coloring updated by edits stays proper, close to a new one, and local.

use incise_coloring::{ColoringError, Recolored, Recoloring, auto};
use incise_graph::Incidence;
use proptest::collection::vec;
use proptest::prelude::*;

use crate::generators::kuhn;

/// A small generator of numbers, so that scripts repeat (Numerical Recipes' LCG, high bits).
struct Dice(u64);

impl Dice {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        ((self.0 >> 33) as usize) % end
    }
}

fn pairs(v: u32, particles: &[u32]) -> Vec<(u32, u32)> {
    particles.iter().map(|&particle| (v, particle)).collect()
}

/// Cuts tets at random: the tet is removed, and the three parts on each side are added as one cluster each, with
/// particles of their own where the cut separates.
struct Script {
    recoloring: Recoloring,
    /// Vertex -> its particles, one list for each constraint in it; empty if it is gone.
    tets: Vec<Vec<[u32; 4]>>,
    particles: u32,
    dice: Dice,
}

impl Script {
    fn new(incidence: &Incidence, slack: usize, seed: u64) -> Self {
        let tets = (0..incidence.constraint_count())
            .map(|c| vec![incidence.particles_of(c).try_into().unwrap()])
            .collect();
        Self {
            recoloring: Recoloring::new(incidence, slack),
            tets,
            particles: u32::try_from(incidence.particle_count()).unwrap(),
            dice: Dice(seed),
        }
    }

    /// One constraint out, two clusters of three in.
    fn cut(&mut self) -> Recolored {
        let v = loop {
            let v = self.dice.below(self.tets.len());
            if !self.tets[v].is_empty() {
                break v;
            }
        };
        let tet = self.tets[v].swap_remove(0);
        let number = u32::try_from(v).unwrap();
        let removed = pairs(number, &tet);
        let [a, b, c, d] = tet;
        let new: Vec<u32> = (self.particles..self.particles + 6).collect();
        self.particles += 6;
        // Two sides with particles of their own, as after a separating cut.
        let sides = [
            [
                [a, new[0], new[1], new[2]],
                [a, b, new[1], new[2]],
                [a, b, new[2], c],
            ],
            [
                [d, new[3], new[4], new[5]],
                [d, b, new[4], new[5]],
                [d, c, new[5], b],
            ],
        ];
        let mut added = Vec::new();
        for side in sides {
            let cluster = u32::try_from(self.tets.len()).unwrap();
            self.tets.push(side.to_vec());
            added.extend(side.iter().flat_map(|tet| pairs(cluster, tet)));
        }
        self.recoloring.apply(&removed, &added).unwrap()
    }

    /// The particles of each vertex, from the script's own books.
    fn incidence(&self) -> Incidence {
        let rows = self.tets.iter().map(|tets| {
            let mut particles: Vec<u32> = tets.iter().flatten().copied().collect();
            particles.sort_unstable();
            particles.dedup();
            particles
        });
        Incidence::from_constraints(self.particles as usize, rows).unwrap()
    }
}

/// A thousand cuts into a lattice of 3072 tets: proper after every one, never more colors than the
/// stated limit, within the slack of a fresh coloring, and local.
#[test]
fn a_thousand_cuts() {
    for (seed, slack) in [(11, 2), (12, 0)] {
        let mut script = Script::new(&kuhn(8), slack, seed);
        let mut visited = 0;
        let mut full = 0;
        let mut displaced = 0;
        let (mut steps, mut most_steps) = (0, 0);
        for cut in 1..=1000 {
            let report = script.cut();
            let incidence = script.incidence();
            script
                .recoloring
                .coloring()
                .verify_incidence(&incidence)
                .unwrap();
            assert_eq!(report.bound, incidence.clique_bound());
            assert!(report.colors <= script.recoloring.limit());
            assert!(report.full || report.colored == 2);
            visited += report.visited;
            full += usize::from(report.full);
            displaced += report.displaced;
            steps += report.steps;
            most_steps = most_steps.max(report.steps);
            if cut % 50 == 0 {
                script.recoloring.check().unwrap();
                let fresh = auto(&incidence).coloring.color_count();
                // The number of colors of `auto` varies by one as the constraints change.
                assert!(report.colors <= fresh + slack.max(1));
            }
        }
        // The two new clusters have twelve links each, at particles with up to some thirty links.
        assert!(visited < 1000 * 2 * 12 * 60, "{visited} links visited");
        // With slack, searches spread the work that full colorings would do at once.
        let most = if slack == 0 { 20 } else { 1 };
        assert!(full < most, "{full} full colorings with slack {slack}");
        assert!(steps > 0, "no search was made");
        assert!(
            most_steps <= 2 * 1000 + 300,
            "{most_steps} steps in an edit"
        );
        assert!(displaced > 0, "no neighbor ever had to move");
    }
}

/// The number of links that an edit visits does not grow with the mesh.
#[test]
fn work_is_local() {
    let visits = |cells: u32| {
        let mut script = Script::new(&kuhn(cells), usize::MAX, 5);
        let reports = (0..100).map(|_| script.cut().visited);
        reports.max().unwrap()
    };
    let (small, large) = (visits(4), visits(12));
    assert!(
        large <= 2 * small,
        "{small} visits at most in a small mesh, {large} in a large one"
    );
}

#[test]
fn edits_that_do_not_fit_change_nothing() {
    let springs = Incidence::from_constraints(4, [[0u32, 1], [1, 2], [2, 3]]).unwrap();
    let mut recoloring = Recoloring::new(&springs, 0);
    let before = recoloring.coloring().clone();
    for removed in [
        &[(0, 0), (0, 2)][..],
        &[(0, 0), (0, 0)],
        &[(9, 0)],
        &[(0, 99)],
    ] {
        let error = recoloring.apply(removed, &[(7, 0)]).unwrap_err();
        assert!(matches!(error, ColoringError::NoSuchPair { .. }), "{error}");
        recoloring.check().unwrap();
        assert_eq!(
            (recoloring.coloring(), recoloring.incidence()),
            (&before, springs.clone())
        );
    }
    let report = recoloring.apply(&[], &[]).unwrap();
    assert_eq!((report.colored, report.visited, report.full), (0, 0, false));
    assert_eq!(recoloring.coloring(), &before);
}

/// Sixty-five constraints on one particle one after the other, and away again.
#[test]
fn a_clique_grows_and_goes() {
    let none = Incidence::from_constraints(1, [[0u32; 0]; 0]).unwrap();
    let mut recoloring = Recoloring::new(&none, 0);
    for v in 0..65 {
        let report = recoloring.apply(&[], &[(v, 0), (v, v + 1)]).unwrap();
        assert_eq!(
            (report.colors, report.bound),
            (v as usize + 1, v as usize + 1)
        );
    }
    for v in (1..65).rev() {
        recoloring.apply(&[(v, 0)], &[]).unwrap();
        assert_eq!(recoloring.bound(), v as usize);
        recoloring.check().unwrap();
    }
    recoloring.recolor();
    assert_eq!(recoloring.color_count(), 1);
}

/// Skipped numbers are absent vertices; a cluster loses one of two constraints at a particle.
#[test]
fn numbers_may_be_skipped_and_pairs_repeat() {
    let none = Incidence::from_constraints(0, [[0u32; 0]; 0]).unwrap();
    let mut recoloring = Recoloring::new(&none, 0);
    recoloring.apply(&[], &[(5, 3), (5, 3), (6, 3)]).unwrap();
    recoloring.check().unwrap();
    assert_eq!(
        (recoloring.coloring().vertex_count(), recoloring.bound()),
        (7, 2)
    );
    recoloring.apply(&[(5, 3)], &[]).unwrap();
    assert_eq!(recoloring.bound(), 2);
    recoloring.apply(&[(5, 3)], &[]).unwrap();
    assert_eq!(recoloring.bound(), 1);
    recoloring.check().unwrap();
}

proptest! {
    /// Any pairs in and out, also ones that make colored neighbors.
    #[test]
    fn random_scripts(
        steps in vec((vec((0u32..12, 0u32..10), 0..8), vec(0usize..1000, 0..6)), 0..30),
        slack in 0usize..4,
    ) {
        let none = Incidence::from_constraints(0, [[0u32; 0]; 0]).unwrap();
        let mut recoloring = Recoloring::new(&none, slack);
        let mut present: Vec<(u32, u32)> = Vec::new();
        for (added, picks) in steps {
            let mut removed = Vec::new();
            for pick in picks {
                if !present.is_empty() {
                    removed.push(present.swap_remove(pick % present.len()));
                }
            }
            let report = recoloring.apply(&removed, &added).unwrap();
            present.extend(&added);
            recoloring.check().unwrap();
            prop_assert_eq!(report.colors, recoloring.coloring().color_count());
            prop_assert!(report.colors <= recoloring.limit());
            let mut expected: Vec<(u32, u32)> = present.clone();
            expected.sort_unstable();
            expected.dedup();
            let incidence = recoloring.incidence();
            let found: Vec<(u32, u32)> = (0..)
                .take(incidence.constraint_count())
                .flat_map(|v| pairs(v, incidence.particles_of(v as usize)))
                .collect();
            prop_assert_eq!(found, expected);
        }
    }
}

proptest! {
    /// Random additions and removals by number: numbers belong to one constraint at a time, the smallest vacant ones
    /// are given first, and the classes hold exactly the present constraints, each with particles of its own.
    #[test]
    fn constraints_are_added_and_removed_by_number(
        program in vec((any::<u8>(), vec(vec(0u32..20, 1..5), 0..6)), 1..30),
    ) {
        let nothing = Incidence::from_constraints(0, [[0u32; 0]; 0]).unwrap();
        let mut recoloring = Recoloring::new(&nothing, 2);
        let mut present = std::collections::BTreeMap::new();
        for (choice, constraints) in program {
            let (numbers, _) = recoloring.add(&constraints).unwrap();
            let vacant = (0..).filter(|number| !present.contains_key(number));
            prop_assert!(numbers.iter().copied().eq(vacant.take(constraints.len())));
            present.extend(numbers.into_iter().zip(constraints));
            let removed: Vec<u32> = present.keys().copied().filter(|n| (n * 7 + u32::from(choice)) % 3 == 0).collect();
            recoloring.remove(&removed).unwrap();
            for number in removed {
                present.remove(&number);
            }
            recoloring.check().unwrap();
            let mut listed = recoloring.classes().values().to_vec();
            listed.sort_unstable();
            prop_assert!(listed.iter().eq(present.keys()));
            for members in recoloring.classes().iter() {
                let mut particles: Vec<u32> = Vec::new();
                for number in members {
                    let mut own = present[number].clone();
                    own.sort_unstable();
                    own.dedup();
                    particles.extend(own);
                }
                let all = particles.len();
                particles.sort_unstable();
                particles.dedup();
                prop_assert_eq!(particles.len(), all);
            }
        }
    }
}

#[test]
fn a_large_number_adds_no_constraints_to_the_classes() {
    let springs = Incidence::from_constraints(5, [[0u32, 1], [1, 2], [2, 3], [3, 4]]).unwrap();
    let mut recoloring = Recoloring::new(&springs, 1);
    recoloring.apply(&[], &pairs(1000, &[0, 4])).unwrap();
    let mut listed = recoloring.classes().values().to_vec();
    listed.sort_unstable();
    assert_eq!(listed, [0, 1, 2, 3, 1000]);
    assert_eq!(recoloring.add([[0u32, 2]]).unwrap().0, [4]);
    let slices: Vec<&[u32]> = vec![&[1, 3, 4], &[0, 3]];
    assert_eq!(recoloring.add(&slices).unwrap().0, [5, 6]);
    recoloring.check().unwrap();
}

#[test]
fn edits_by_number_that_name_no_constraint_change_nothing() {
    let springs = Incidence::from_constraints(3, [[0u32, 1], [1, 2]]).unwrap();
    let mut recoloring = Recoloring::new(&springs, 1);
    let before = recoloring.coloring().clone();
    let none = |vertex| ColoringError::NoParticles { vertex };
    assert_eq!(recoloring.remove(&[0, 7]), Err(none(7)));
    assert!(matches!(
        recoloring.remove(&[1, 1]),
        Err(ColoringError::NoSuchPair { vertex: 1, .. })
    ));
    assert_eq!(recoloring.add([vec![0u32], vec![]]), Err(none(1)));
    assert_eq!(recoloring.coloring(), &before);
    recoloring.check().unwrap();
    assert_eq!(recoloring.remove(&[0]).unwrap().colored, 0);
    assert_eq!(recoloring.remove(&[0]), Err(none(0)));
}
