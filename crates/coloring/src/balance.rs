//! Even classes at the same number of colors: vertices change class until nothing helps any more.
//!
//! First fit crowds the first colors and leaves the last ones nearly empty, and a step with few
//! vertices cannot keep a machine busy. With k classes of load `L_c`, the total weight of class c,
//! the aim is to lower
//!
//! ```text
//! S = sum over classes c of L_c^2,
//! ```
//!
//! and with it the standard deviation and the chi-squared of the loads, as their number and their
//! sum stay. Every step lowers S, so there is an end:
//!
//! 1. *Moves.* A pass over the vertices takes each one in a class above the mean to the lightest
//!    class below the mean in which it has no neighbor, if that lowers S. This does nearly all the
//!    work, in time linear in the input (for a graph) or in the entries times k / 64.
//! 2. *Chains* of vertices of one weight through classes in between, found by breadth-first search;
//!    a vertex may also push its only neighbor in a class on to another one. One round costs about
//!    a pass over the edges and a search per chain.
//! 3. *Flips* of the alternating components of two classes, singly and in pairs, so that a heavy
//!    vertex can be exchanged for a lighter one. One round costs at most k passes over the input.
//!
//! Steps 2 and 3 alternate as long as they find something and the range is above 1, up to a limit of
//! four questions per vertex about the classes around it, which takes less than ten times a first fit. What they reach
//! without the limit is a local optimum: whether a graph has an even coloring with k colors at all is NP-hard to tell.
//!
//! Sources: moves within the given colors, the "shuffling" of Lu et al. (2015); paths in the graph
//! of classes, Kierstead, Kostochka, Mydlarz and Szemeredi (2010); alternating components, Kempe
//! (1879).

mod chains;
mod flips;
mod partition;
mod surroundings;
mod work;

use incise_graph::Coloring;

use crate::Conflicts;
use chains::Chains;
use flips::Flips;
use partition::Partition;
use surroundings::{Bits, Surroundings, Walk};
use work::Work;

/// Changes made by [`balance`]. Ranges are those of the colors that carry weight.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct BalanceStats {
    /// Number of moves of the first step.
    pub moves: usize,
    /// Number of chains of the second step.
    pub chains: usize,
    /// Number of pairs of classes that exchanged components in the third step.
    pub flips: usize,
    /// Number of vertices that changed their color.
    pub changed: usize,
    /// Whether the search for chains and flips ended at its limit of work, before it found no more.
    pub stopped: bool,
    /// Weight of the heaviest class minus that of the lightest before.
    pub range_before: u64,
    /// Weight of the heaviest class minus that of the lightest after.
    pub range: u64,
}

/// Balances the weights of the classes of a proper coloring, without an additional color.
///
/// `weights` has the weight of each vertex: 1 to balance the number of vertices, or the sizes of
/// clusters to balance the number of constraints. Only the colors that carry weight take part, and
/// each of them still does afterwards. Vertices of weight 0 (vacant clusters) are neither moved nor
/// counted. `std` and `chi2` of
/// [`ColoringMetrics::by_weights`](incise_graph::ColoringMetrics::by_weights) never rise, and fall
/// if anything changes. A proper coloring stays proper.
///
/// The range is not guaranteed: in a star, one class has one vertex and the other all leaves, in
/// any coloring. If vertices have few neighbors for the number of colors, as in meshes, expect a
/// range of at most 1 with weights of 1, and seldom more with sizes of clusters.
///
/// Sequential and deterministic; a graph and the incidence it came from give equal results. Usually
/// one or two passes over the input. The search for better exchanges ends after work that takes less than ten times
/// [`auto`](crate::auto); [`BalanceStats::stopped`] tells, and another call continues. Memory: O(n + k), from incidence
/// also k bits per particle.
///
/// # Panics
/// If there is not one color and one weight per vertex.
///
/// ```
/// use incise_coloring::{Order, balance, greedy};
/// use incise_graph::{ColoringMetrics, Incidence};
///
/// // Springs in a row, and a triangle of springs at its end: first fit uses color 2 once.
/// let ends = (0u32..9).map(|i| [i, i + 1]).chain([[9, 10], [10, 8]]);
/// let springs = Incidence::from_constraints(11, ends)?;
/// let mut coloring = greedy(&springs, Order::Natural);
/// assert_eq!(ColoringMetrics::by_vertices(&coloring).range, 4);
///
/// let stats = balance(&springs, &mut coloring, &[1; 11]);
/// coloring.verify_incidence(&springs)?;
/// let metrics = ColoringMetrics::by_vertices(&coloring);
/// assert_eq!((metrics.colors, metrics.range), (3, 1));
/// assert_eq!((stats.range_before, stats.range), (4, 1));
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
pub fn balance(
    conflicts: &impl Conflicts,
    coloring: &mut Coloring,
    weights: &[u32],
) -> BalanceStats {
    let vertices = conflicts.vertex_count();
    assert_eq!(coloring.vertex_count(), vertices, "one color per vertex");
    assert_eq!(weights.len(), vertices, "one weight per vertex");
    let mut partition = Partition::new(coloring, weights);
    let mut stats = BalanceStats {
        range_before: partition.range(),
        ..BalanceStats::default()
    };
    match conflicts.incidence() {
        // Nothing to do, so nothing to prepare.
        _ if stats.range_before <= 1 => {}
        Some(incidence) if Bits::fit(incidence, partition.count()) => {
            let bits = Bits::new(incidence, &partition.class, partition.count());
            level(&mut partition, bits, &mut stats);
        }
        _ => level(&mut partition, Walk(conflicts), &mut stats),
    }
    stats.range = partition.range();
    stats.changed = partition.store(coloring);
    stats
}

/// Moves while they find something, then chains and flips while they do.
fn level(partition: &mut Partition<'_>, mut around: impl Surroundings, stats: &mut BalanceStats) {
    while partition.range() > 1 {
        let moves = pass(partition, &mut around);
        stats.moves += moves;
        if moves == 0 {
            break;
        }
    }
    if partition.range() <= 1 {
        return;
    }
    let mut chains = Chains::new(partition);
    let mut flips = Flips::new(partition);
    let mut work = Work::for_vertices(partition.class.len());
    while partition.range() > 1 {
        let followed = chains.run(partition, &mut around, &mut work);
        let flipped = flips.run(partition, &mut around, &mut work);
        stats.chains += followed;
        stats.flips += flipped;
        if followed + flipped == 0 || work.is_spent() {
            break;
        }
    }
    stats.stopped = work.is_spent() && partition.range() > 1;
}

/// Takes vertices from classes above the mean to classes below it; returns how many.
fn pass(partition: &mut Partition<'_>, around: &mut impl Surroundings) -> usize {
    let classes = partition.count() as u64;
    let total: u64 = partition.loads.iter().sum();
    // For integers: load > mean exactly if load > floor, load < mean exactly if load < ceil.
    let (floor, ceil) = (total / classes, total.div_ceil(classes));
    let mut below = vec![0u64; partition.count().div_ceil(64)];
    for (class, &load) in partition.loads.iter().enumerate() {
        below[class / 64] |= u64::from(load < ceil) << (class % 64);
    }
    let mut taken = vec![0; below.len()];
    let mut moves = 0;
    for (v, index) in (0..).zip(0..partition.class.len()) {
        let weight = u64::from(partition.weights[index]);
        let from = partition.class[index];
        if weight == 0 || partition.loads[from as usize] <= floor {
            continue;
        }
        taken.fill(0);
        around.add_taken(v, &partition.class, &mut taken);
        let mut best = (partition.loads[from as usize], from);
        for (base, (below, taken)) in (0..).step_by(64).zip(below.iter().zip(&taken)) {
            let mut free = below & !taken;
            while free != 0 {
                let class: u32 = base + free.trailing_zeros();
                free &= free - 1;
                best = best.min((partition.loads[class as usize] + weight, class));
            }
        }
        let (load, to) = best;
        // Stay if no class is lighter with `v` than the present one is now.
        if load >= partition.loads[from as usize] {
            continue;
        }
        around.leave(v, from);
        around.enter(v, to);
        partition.shift(v, to);
        moves += 1;
        for class in [from, to] {
            let bit = 1 << (class % 64);
            let word = &mut below[class as usize / 64];
            if partition.loads[class as usize] < ceil {
                *word |= bit;
            } else {
                *word &= !bit;
            }
        }
    }
    moves
}
