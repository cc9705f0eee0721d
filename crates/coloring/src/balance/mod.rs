//! Even color classes at the same number of colors.
//!
//! Colors run one after the other, so a class that is smaller than the machine is wide wastes it,
//! and first fit makes the first classes large and the last ones tiny. Moving vertices repairs that
//! nearly for free. Three kinds of moves, each tried when the ones before have nothing left to do:
//!
//! 1. a vertex goes to the lightest class where it has no neighbor;
//! 2. a chain: a vertex goes from class a to b and another from b to c, and so on, for when no
//!    vertex of a heavy class fits into a light one directly;
//! 3. a flip: in a connected part of what two classes hold together, everybody goes to the other
//!    class (Kempe 1879).
//!
//! A move is made only if it lowers the sum of the squared class weights, so the search ends, and
//! the chi-squared of the classes only goes down. Cost: O(vertices * (degree + colors)) a round; a
//! handful of rounds on meshes.

mod chains;
mod flips;

use incise_graph::{ColorId, Coloring};

use crate::Conflicts;

/// What balancing did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct BalanceStats {
    /// Vertices that went straight to a lighter class.
    pub moves: usize,
    /// Chains of moves through other classes.
    pub chains: usize,
    /// Connected parts of two classes that changed places.
    pub flips: usize,
    /// Rounds over all vertices, for any of the three.
    pub rounds: usize,
    /// Whether no move of these kinds is left; else the rounds ran out.
    pub settled: bool,
}

/// More rounds than any mesh needed by far; each is linear.
const ROUNDS: usize = 200;

/// Makes the classes of a proper coloring as even as moves can, in number of vertices.
///
/// The coloring stays proper, the number of colors stays, and the chi-squared of the class sizes
/// never grows. Deterministic; a graph and the incidence it came from give the same. O(vertices *
/// (degree + colors)) a round.
///
/// # Panics
/// If the coloring has not one color per vertex.
///
/// ```
/// use incise_coloring::balance;
/// use incise_graph::{ColorId, Coloring, ColoringMetrics, ConstraintGraph};
///
/// // Three pairs; first fit had no use for color 1 except where it had to.
/// let pairs = ConstraintGraph::from_edges(8, &[(0, 1), (2, 3)])?;
/// let mut coloring = Coloring::new([0, 1, 0, 1, 0, 0, 0, 0].map(ColorId).to_vec());
/// assert_eq!(ColoringMetrics::by_vertices(&coloring).range, 4);
/// balance(&pairs, &mut coloring);
/// coloring.verify(&pairs)?;
/// assert_eq!(ColoringMetrics::by_vertices(&coloring).range, 0);
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
pub fn balance(conflicts: &impl Conflicts, coloring: &mut Coloring) -> BalanceStats {
    balance_weights(conflicts, coloring, &vec![1; coloring.vertex_count()])
}

/// The same by weight, for example the number of constraints of a cluster
/// ([`Clustering::sizes`](incise_graph::Clustering::sizes)): a class takes as long as its weight.
///
/// # Panics
/// If the coloring has not one color, or `weights` not one weight, per vertex.
pub fn balance_weights(
    conflicts: &impl Conflicts,
    coloring: &mut Coloring,
    weights: &[u32],
) -> BalanceStats {
    let vertices = conflicts.vertex_count();
    assert_eq!(coloring.vertex_count(), vertices, "one color per vertex");
    assert_eq!(weights.len(), vertices, "one weight per vertex");
    let mut state = State::new(conflicts, coloring, weights);
    while state.stats.rounds < ROUNDS {
        state.stats.rounds += 1;
        if !(state.improve_by_moves() || state.improve_by_chains() || state.improve_by_flips()) {
            state.stats.settled = true;
            break;
        }
    }
    *coloring = Coloring::new(state.colors);
    state.stats
}

/// The coloring while it is being balanced.
struct State<'a, C> {
    conflicts: &'a C,
    weights: &'a [u32],
    colors: Vec<ColorId>,
    /// The weight of each class.
    loads: Vec<u64>,
    /// Color -> the visit at which it was last seen around a vertex.
    seen: Vec<u64>,
    visit: u64,
    stats: BalanceStats,
}

impl<'a, C: Conflicts> State<'a, C> {
    fn new(conflicts: &'a C, coloring: &Coloring, weights: &'a [u32]) -> Self {
        let mut loads = vec![0; coloring.color_count()];
        for (color, &weight) in coloring.colors().iter().zip(weights) {
            loads[color.index()] += u64::from(weight);
        }
        Self {
            conflicts,
            weights,
            colors: coloring.colors().to_vec(),
            seen: vec![0; loads.len()],
            loads,
            visit: 0,
            stats: BalanceStats::default(),
        }
    }

    fn color(&self, v: u32) -> usize {
        self.colors[v as usize].index()
    }

    fn weight(&self, v: u32) -> u64 {
        u64::from(self.weights[v as usize])
    }

    fn vertices(&self) -> impl Iterator<Item = u32> + use<C> {
        (0..).take(self.conflicts.vertex_count())
    }

    /// Moves one vertex; the caller knows that it fits.
    fn shift(&mut self, v: u32, to: usize) {
        let weight = self.weight(v);
        let from = self.color(v);
        self.loads[from] -= weight;
        self.loads[to] += weight;
        self.colors[v as usize] = ColorId::new(to);
    }

    /// Marks the colors around `v`; [`fits`](Self::fits) then answers for `v`.
    fn look_around(&mut self, v: u32) {
        self.visit += 1;
        let (seen, colors, visit) = (&mut self.seen, &self.colors, self.visit);
        self.conflicts.visit_neighbors(v, |u| {
            seen[colors[u as usize].index()] = visit;
        });
    }

    /// Has the vertex looked around from no neighbor of this color?
    fn fits(&self, color: usize) -> bool {
        self.seen[color] != self.visit
    }

    /// One pass of straight moves; whether there was any.
    fn improve_by_moves(&mut self) -> bool {
        let before = self.stats.moves;
        let mut lightest = self.loads.iter().copied().min().unwrap_or(0);
        for v in self.vertices() {
            let weight = self.weight(v);
            let load = self.loads[self.color(v)];
            // Lower squares mean that the class it goes to stays lighter than its class was.
            if weight == 0 || lightest + weight >= load {
                continue;
            }
            self.look_around(v);
            let classes = (0..self.loads.len()).filter(|&class| self.fits(class));
            let best = classes.min_by_key(|&class| self.loads[class]);
            if let Some(to) = best.filter(|&to| self.loads[to] + weight < load) {
                self.shift(v, to);
                self.stats.moves += 1;
                lightest = self.loads.iter().copied().min().unwrap_or(0);
            }
        }
        self.stats.moves > before
    }
}
