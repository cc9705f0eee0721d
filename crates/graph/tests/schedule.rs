//! A schedule contains every constraint once, in the order of the definition, and its check agrees
//! with the coloring's; edits give the order of a new schedule, at a cost proportional to the edit.

use incise_graph::{ClusterId, Clustering, ColorId, Coloring, GraphError, Incidence, Schedule};
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

/// One random change of clusters and colors.
#[derive(Clone, Debug)]
enum Edit {
    /// Removes constraint (number modulo their count) from its cluster.
    Remove(usize),
    /// Puts a constraint without cluster, possibly past the end, into a new one.
    Start(usize),
    /// Puts it into the cluster of another constraint.
    Join(usize, usize),
    /// Gives a cluster a color.
    Recolor(usize, u32),
}

fn edits() -> impl Strategy<Value = Vec<Edit>> {
    let edit = prop_oneof![
        (0usize..100).prop_map(Edit::Remove),
        (0usize..100).prop_map(Edit::Start),
        (0usize..100, 0usize..100).prop_map(|(a, b)| Edit::Join(a, b)),
        (0usize..100, 0u32..8).prop_map(|(k, color)| Edit::Recolor(k, color)),
    ];
    vec(edit, 1..12)
}

/// Clusters and colors, and the changes since the last update of the schedule.
struct Plan {
    clustering: Clustering,
    coloring: Coloring,
    constraints: Vec<u32>,
    clusters: Vec<ClusterId>,
}

impl Plan {
    /// A constraint in no cluster: one of the present ones if possible, else the next number.
    fn loose(&self, start: usize) -> usize {
        let count = self.clustering.constraint_count();
        let mut all = (0..count).map(|i| (start + i) % count);
        all.find(|&c| self.clustering.cluster_of(c).is_none())
            .unwrap_or(count)
    }

    fn apply(&mut self, edit: &Edit) {
        let count = self.clustering.constraint_count();
        match *edit {
            Edit::Remove(c) => {
                self.clustering.remove(c % count);
                self.constraints.push(u32::try_from(c % count).unwrap());
            }
            Edit::Start(c) => {
                let c = self.loose(c);
                let cluster = self.clustering.new_cluster(c);
                if cluster.index() == self.coloring.vertex_count() {
                    self.coloring.push(ColorId(2));
                    self.clusters.push(cluster);
                }
                self.constraints.push(u32::try_from(c).unwrap());
            }
            Edit::Join(c, other) => {
                let c = self.loose(c);
                if let Some(cluster) = self.clustering.cluster_of(other % count) {
                    self.clustering.assign(c, cluster);
                    self.constraints.push(u32::try_from(c).unwrap());
                }
            }
            Edit::Recolor(k, color) => {
                let k = k % self.coloring.vertex_count();
                self.coloring.set(k, ColorId(color));
                self.clusters.push(ClusterId::new(k));
            }
        }
    }
}

/// Color -> clusters, sorted, -> members.
fn contents(schedule: &Schedule) -> Vec<Vec<(ClusterId, Vec<u32>)>> {
    let color = |color| {
        let clusters = schedule.clusters(color).iter();
        let mut clusters: Vec<_> = clusters
            .map(|&k| (k, schedule.constraints(k).to_vec()))
            .collect();
        clusters.sort_unstable();
        clusters
    };
    (0..schedule.color_count()).map(color).collect()
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
        prop_assert_eq!(schedule.order().collect::<Vec<_>>(), &order[..]);
        prop_assert_eq!(schedule.constraint_count(), order.len());
        let by_cluster: Vec<u32> = (0..schedule.color_count())
            .flat_map(|c| schedule.clusters(c))
            .flat_map(|&k| schedule.constraints(k).to_vec())
            .collect();
        prop_assert_eq!(by_cluster, &order[..]);
        let colors: Vec<u32> = (0..schedule.color_count())
            .flat_map(|c| schedule.color_constraints(c))
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
            .map(|(c, _)| Vec::from_iter((0..arity).map(|i| (c * 7 + i) % particles)));
        let incidence = Incidence::from_constraints(particles as usize, rows).unwrap();
        let proper = coloring.verify_incidence(&incidence.quotient(&clustering)).is_ok();
        prop_assert_eq!(Schedule::new(&clustering, &coloring).check(&incidence).is_ok(), proper);
    }

    #[test]
    fn a_schedule_can_be_used_again((first, colors) in inputs(), (second, others) in inputs()) {
        let mut schedule = Schedule::new(&first, &colors);
        schedule.rebuild(&second, &others);
        prop_assert_eq!(&schedule, &Schedule::new(&second, &others));
        schedule.check_partition(&second, &others).unwrap();
    }

    /// After every batch of edits the schedule equals a new one up to the order within a color, and
    /// the journal lists the differences from any earlier state.
    #[test]
    fn updates_give_what_a_new_schedule_is(
        (clustering, coloring) in inputs(),
        batches in vec(edits(), 1..12),
    ) {
        let mut schedule = Schedule::new(&clustering, &coloring);
        let mut plan = Plan { clustering, coloring, constraints: Vec::new(), clusters: Vec::new() };
        let mut past = vec![schedule.clone()];
        for batch in batches {
            plan.constraints.clear();
            plan.clusters.clear();
            batch.iter().for_each(|edit| plan.apply(edit));
            plan.clustering.check().unwrap();
            schedule.update(&plan.clustering, &plan.coloring, &plan.constraints, &plan.clusters);
            schedule.check_partition(&plan.clustering, &plan.coloring).unwrap();
            let new = Schedule::new(&plan.clustering, &plan.coloring);
            prop_assert_eq!(contents(&schedule), contents(&new));
            prop_assert_eq!(schedule.cluster_count(), plan.clustering.occupied());
            for earlier in &past {
                let Some(changes) = schedule.changes_since(earlier.revision()) else {
                    continue;
                };
                for k in (0..plan.clustering.cluster_count()).map(ClusterId::new) {
                    let same = earlier.constraints(k) == schedule.constraints(k)
                        && earlier.color(k) == schedule.color(k);
                    prop_assert!(same || changes.contains(&k), "cluster {} was kept quiet", k);
                }
            }
            past.push(schedule.clone());
        }
    }
}

/// Changes that were not reported are found.
#[test]
fn a_forgotten_edit_is_found() {
    let labels = [0, 0, 1, 1].map(ClusterId).to_vec();
    let mut clustering = Clustering::from_labels(labels).unwrap();
    let mut coloring = Coloring::new([0, 1].map(ColorId).to_vec());
    let mut schedule = Schedule::new(&clustering, &coloring);
    coloring.set(1, ColorId(0));
    schedule.update(&clustering, &coloring, &[], &[]);
    let misplaced = |k| {
        Err(GraphError::Misplaced {
            cluster: ClusterId(k),
        })
    };
    assert_eq!(
        schedule.check_partition(&clustering, &coloring),
        misplaced(1)
    );
    schedule.update(&clustering, &coloring, &[], &[ClusterId(1)]);
    schedule.check_partition(&clustering, &coloring).unwrap();
    clustering.remove(0);
    assert_eq!(
        schedule.check_partition(&clustering, &coloring),
        misplaced(0)
    );
}

/// Copies that have diverged share no changes.
#[test]
fn revisions_tell_schedules_apart() {
    let clustering = Clustering::none(2);
    let mut coloring = Coloring::new([0, 1].map(ColorId).to_vec());
    let first = Schedule::new(&clustering, &coloring);
    let mut second = first.clone();
    let mut third = first.clone();
    assert_eq!(second.changes_since(first.revision()), Some(&[][..]));
    coloring.set(1, ColorId(0));
    for copy in [&mut second, &mut third] {
        copy.update(&clustering, &coloring, &[], &[ClusterId(1)]);
        assert_eq!(
            copy.changes_since(first.revision()),
            Some(&[ClusterId(1)][..])
        );
    }
    assert_eq!(second, third);
    assert_eq!(second.changes_since(third.revision()), None);
    second.rebuild(&clustering, &coloring);
    assert_eq!(second.changes_since(first.revision()), None);
    let quiet = third.revision();
    third.update(&clustering, &coloring, &[0, 1], &[ClusterId(0)]);
    assert_eq!(third.revision(), quiet, "nothing has changed");
    assert_eq!(Schedule::default().revision(), 0);
}

/// The journal drops old changes, but never those after the last revision of a derived structure.
#[test]
fn changes_since_the_last_revision_are_kept() {
    let clustering = Clustering::none(5);
    let mut coloring = Coloring::new(vec![ColorId(0); 5]);
    let mut schedule = Schedule::new(&clustering, &coloring);
    let first = schedule.revision();
    for round in 1..20u32 {
        let before = schedule.revision();
        let k = ClusterId(round % 5);
        coloring.set(k.index(), ColorId(round));
        schedule.update(&clustering, &coloring, &[], &[k]);
        assert_eq!(schedule.changes_since(before), Some(&[k][..]));
    }
    assert_eq!(schedule.changes_since(first), None);
}

/// Counts instead of timing: the edits of a cut in a large schedule cost about as much as in a small one, and far less
/// than a rebuild. 20 constraints are each replaced by four in two clusters.
#[test]
fn the_cost_of_an_update_follows_the_edit() {
    for clusters in [2_000u32, 40_000] {
        let labels = (0..5 * clusters).map(|c| ClusterId(c / 5)).collect();
        let mut clustering = Clustering::from_labels(labels).unwrap();
        let colors = (0..clusters).map(|k| ColorId(k % 30)).collect();
        let mut coloring = Coloring::new(colors);
        let mut schedule = Schedule::new(&clustering, &coloring);
        let (cuts, mut total) = (60, 0);
        for cut in 0..cuts {
            let (mut constraints, mut changed) = (Vec::new(), Vec::new());
            for i in 0..20 {
                let parent = (cut * 20 + i) * 7;
                clustering.remove(parent as usize);
                for side in 0..2u32 {
                    let first = match side {
                        0 => parent as usize,
                        _ => clustering.constraint_count(),
                    };
                    let cluster = clustering.new_cluster(first);
                    let second = clustering.constraint_count();
                    clustering.assign(second, cluster);
                    if cluster.index() == coloring.vertex_count() {
                        coloring.push(ColorId(0));
                    }
                    coloring.set(cluster.index(), ColorId((3 * i + side) % 32));
                    changed.push(cluster);
                    constraints.extend([first, second].map(|c| u32::try_from(c).unwrap()));
                }
            }
            total += schedule.update(&clustering, &coloring, &constraints, &changed);
        }
        schedule.check_partition(&clustering, &coloring).unwrap();
        // 120 constraints and 60 clusters change in a cut; each moves a few others. Once in the run every color moves
        // to get room, which is the only cost that depends on the size of the schedule.
        let once = u64::from(clusters);
        let bound = u64::from(cuts) * 20 * 40 + once;
        assert!(total < bound, "{total} of {bound} for {clusters} clusters");
    }
}

/// Arrays do not grow under endless edits: vacated numbers are reused.
#[test]
fn memory_stays_in_proportion() {
    let mut clustering = Clustering::none(100);
    let mut coloring = Coloring::new((0..100).map(|k| ColorId(k % 7)).collect());
    let mut schedule = Schedule::new(&clustering, &coloring);
    let mut visited = 0;
    for round in 0..5_000u32 {
        let (c, k) = ((round * 37) % 100, ClusterId((round * 11) % 100));
        clustering.remove(c as usize);
        let target = clustering
            .cluster_of(((c + 1 + round % 5) % 100) as usize)
            .unwrap();
        clustering.assign(c as usize, target);
        coloring.set(k.index(), ColorId(round % 9));
        visited += schedule.update(&clustering, &coloring, &[c], &[k]);
    }
    schedule.check_partition(&clustering, &coloring).unwrap();
    // A round changes two numbers; clusters here grow to a few dozen members.
    assert!(visited < 5_000 * 120, "{visited}");
}
