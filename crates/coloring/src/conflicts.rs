//! The input of a coloring: which vertices conflict, from a graph or straight from incidence.
//!
//! A constraint graph lists the neighbors of every vertex, which for tetrahedra is about 65
//! neighbors each and costs more to build than to color. But the constraints themselves already say
//! everything: two of them are neighbors if they share a particle. So the algorithms of this crate
//! take either. Walking the neighbors of a constraint through its particles meets those that share
//! several particles several times; a walk that minds that, or the order, is better off with the
//! [`graph`](Conflicts::graph), which incidence then builds.
//!
//! **First fit without neighbors.** Constraints on one particle all differ in color, so a particle
//! only needs a bit per color for "taken here"; the colors around a constraint are the union of its
//! particles' bits. That is a handful of words instead of 65 neighbors. To need no limit on colors
//! and no more than one word per particle, [`first_fit`](Conflicts::first_fit) on an [`Incidence`]
//! works in windows of 64 colors: a first pass in the given order with colors 0 to 63 only, a
//! second pass over those left with colors 64 to 127, and so on. Whether a constraint fits into a
//! window depends only on constraints that got a color in it, so this gives exactly the colors of
//! one pass with all colors. Cost: O(entries) per window over the constraints that reach it.

use std::borrow::Cow;

use incise_graph::{ColorId, ConstraintGraph, Incidence};
use rayon::prelude::*;

use crate::clique::clique_of_hubs;
use crate::first_fit::FirstFit;

/// Vertices and their conflicts: [`ConstraintGraph`] (vertices and edges) or [`Incidence`]
/// (constraints, which conflict when they share a particle).
///
/// Conflicts are symmetric, and no vertex conflicts with itself. Both implementations of one problem
/// give equal results in every algorithm of this crate, except where [`degree_bound`](Self::degree_bound)
/// takes part.
///
/// ```
/// use incise_coloring::{Conflicts, Order, greedy};
/// use incise_graph::{ConstraintGraph, Incidence};
///
/// let springs = Incidence::from_constraints(4, [[0u32, 1], [1, 2], [2, 3], [3, 0]])?;
/// let graph = ConstraintGraph::from_incidence(&springs);
/// assert_eq!(springs.degrees(), graph.degrees());
/// assert_eq!(greedy(&springs, Order::LargestFirst), greedy(&graph, Order::LargestFirst));
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
pub trait Conflicts: Sync {
    /// Returns the number of vertices.
    fn vertex_count(&self) -> usize;

    /// Calls `visit` for every neighbor of `v`, for some of them perhaps several times, in a fixed
    /// order.
    ///
    /// # Panics
    /// If there is no vertex `v`.
    fn visit_neighbors(&self, v: u32, visit: impl FnMut(u32));

    /// Returns the number of distinct neighbors of every vertex.
    fn degrees(&self) -> Vec<u32>;

    /// Returns an upper bound of the degree of every vertex, which is cheap to compute.
    ///
    /// A graph has its degrees; incidence counts a neighbor once for every particle shared with it.
    fn degree_bound(&self) -> Vec<u32>;

    /// Returns all edges as a graph: borrowed if this is a graph, built from incidence otherwise.
    fn graph(&self) -> Cow<'_, ConstraintGraph>;

    /// Returns the incidence, if this is one: some queries are cheaper by particle.
    fn incidence(&self) -> Option<&Incidence>;

    /// Returns a lower bound on the number of colors: the size of a known clique, a set of vertices that all conflict
    /// with each other.
    ///
    /// From incidence, the largest number of constraints on one particle. From a graph, the size of the largest clique
    /// that a greedy search finds.
    fn clique_bound(&self) -> usize;

    /// Gives each vertex, in the given order, the smallest color that no neighbor has been given yet. Vertices not in
    /// `order` get none, which is written `ColorId(u32::MAX)`.
    ///
    /// # Panics
    /// If `order` names a vertex that does not exist.
    fn first_fit(&self, order: &[u32]) -> Vec<ColorId>;
}

/// The color of a vertex that has none yet: larger than any color that a vertex can have.
pub(crate) const UNCOLORED: ColorId = ColorId(u32::MAX);

impl Conflicts for ConstraintGraph {
    fn vertex_count(&self) -> usize {
        self.vertex_count()
    }

    fn visit_neighbors(&self, v: u32, visit: impl FnMut(u32)) {
        self.neighbors(v as usize).iter().copied().for_each(visit);
    }

    /// O(vertices).
    fn degrees(&self) -> Vec<u32> {
        self.offsets()
            .windows(2)
            .map(|pair| pair[1] - pair[0])
            .collect()
    }

    /// O(vertices).
    fn degree_bound(&self) -> Vec<u32> {
        self.degrees()
    }

    /// O(1).
    fn graph(&self) -> Cow<'_, ConstraintGraph> {
        Cow::Borrowed(self)
    }

    /// O(1).
    fn incidence(&self) -> Option<&Incidence> {
        None
    }

    /// O(vertices + largest degree squared).
    fn clique_bound(&self) -> usize {
        clique_of_hubs(self)
    }

    /// O(vertices + edges).
    fn first_fit(&self, order: &[u32]) -> Vec<ColorId> {
        let mut colors = vec![UNCOLORED; self.vertex_count()];
        let mut first_fit = FirstFit::default();
        for &v in order {
            let neighbors = self.neighbors(v as usize);
            let taken = neighbors.iter().map(|&u| colors[u as usize]);
            colors[v as usize] = first_fit.choose(neighbors.len(), taken);
        }
        colors
    }
}

impl Conflicts for Incidence {
    fn vertex_count(&self) -> usize {
        self.constraint_count()
    }

    fn visit_neighbors(&self, v: u32, mut visit: impl FnMut(u32)) {
        for &p in self.particles_of(v as usize) {
            for &u in self.constraints_of(p as usize) {
                if u != v {
                    visit(u);
                }
            }
        }
    }

    /// O(sum over particles of valence squared), in parallel in the current rayon thread pool.
    fn degrees(&self) -> Vec<u32> {
        let mut degrees = vec![0; self.constraint_count()];
        // A piece per thread, since each needs a stamp of its own for every constraint.
        let piece = degrees.len().div_ceil(rayon::current_num_threads()).max(1);
        let pieces = degrees.par_chunks_mut(piece).enumerate();
        pieces.for_each(|(index, degrees)| {
            let mut stamp = vec![u32::MAX; self.constraint_count()];
            for (v, degree) in (0..).skip(index * piece).zip(degrees) {
                self.visit_neighbors(v, |u| {
                    let stamp = &mut stamp[u as usize];
                    *degree += u32::from(*stamp != v);
                    *stamp = v;
                });
            }
        });
        degrees
    }

    /// O(entries).
    fn degree_bound(&self) -> Vec<u32> {
        let others = |&p: &u32| self.constraints_of(p as usize).len() as u64 - 1;
        let degree_bound = |v| self.particles_of(v).iter().map(others).sum::<u64>();
        (0..self.constraint_count())
            .map(|v| u32::try_from(degree_bound(v)).unwrap_or(u32::MAX))
            .collect()
    }

    /// O(sum over particles of valence squared).
    fn graph(&self) -> Cow<'_, ConstraintGraph> {
        Cow::Owned(ConstraintGraph::from_incidence(self))
    }

    /// O(1).
    fn incidence(&self) -> Option<&Incidence> {
        Some(self)
    }

    /// O(particles).
    fn clique_bound(&self) -> usize {
        // A constraint without particles still needs a color.
        self.clique_bound()
            .max(usize::from(self.constraint_count() > 0))
    }

    /// O(entries of `order`) per window of 64 colors, over the constraints that reach it.
    fn first_fit(&self, order: &[u32]) -> Vec<ColorId> {
        let mut colors = vec![UNCOLORED; self.constraint_count()];
        let mut taken = vec![0u64; self.particle_count()];
        let mut rest = Vec::new();
        let mut window = |order: &[u32], base: u32, rest: &mut Vec<u32>| {
            for &v in order {
                let particles = self.particles_of(v as usize);
                let union = particles
                    .iter()
                    .fold(0, |union, &p| union | taken[p as usize]);
                if union == u64::MAX {
                    rest.push(v);
                    continue;
                }
                let color = union.trailing_ones();
                colors[v as usize] = ColorId(base + color);
                for &p in particles {
                    taken[p as usize] |= 1 << color;
                }
            }
            // The next window starts with nothing taken around those that are left.
            for &v in &*rest {
                for &p in self.particles_of(v as usize) {
                    taken[p as usize] = 0;
                }
            }
        };
        window(order, 0, &mut rest);
        let mut base = 64;
        let mut left = Vec::new();
        while !rest.is_empty() {
            window(&rest, base, &mut left);
            rest.clear();
            std::mem::swap(&mut rest, &mut left);
            base += 64;
        }
        colors
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Windows: 200 constraints on one particle use three of them and part of a fourth.
    #[test]
    fn a_fan_passes_all_windows() {
        let fan = Incidence::from_constraints(201, (1u32..201).map(|i| [0, i])).unwrap();
        let order: Vec<u32> = (0..200).rev().collect();
        let colors = fan.first_fit(&order);
        assert_eq!(
            colors,
            (0..200).rev().map(ColorId).collect::<Vec<_>>(),
            "each the next color, in the order of the walk"
        );
        assert_eq!(
            colors,
            ConstraintGraph::from_incidence(&fan).first_fit(&order)
        );
    }

    #[test]
    fn bounds_count_the_lonely() {
        let lonely = Incidence::from_constraints(0, [[0u32; 0]; 3]).unwrap();
        assert_eq!(Conflicts::clique_bound(&lonely), 1);
        assert_eq!(lonely.first_fit(&[2]), [UNCOLORED, UNCOLORED, ColorId(0)]);
        let graph = ConstraintGraph::from_incidence(&lonely);
        assert_eq!(graph.clique_bound(), 1);
        let none = ConstraintGraph::from_edges(0, &[]).unwrap();
        assert_eq!(none.clique_bound(), 0);
    }
}
