//! Two levels of parallelism: blocks side by side, and inside a block constraints side by side.
//!
//! A block is a large cluster that one GPU workgroup or one core takes as a whole. Blocks of one
//! *outer* color share no particle and run at the same time. Inside a block, constraints of one
//! *inner* color share no particle; the workgroup solves them at the same time and waits at a
//! barrier before the next inner color. All is in flat arrays: outer color -> blocks -> inner
//! colors -> constraints. Cost: O(constraints log block size + clusters + colors).

use std::ops::Range;

use crate::csr::offset;
use crate::schedule::each_once;
use crate::{ClusterId, Clustering, ColorId, Coloring, GraphError, Incidence, Schedule};

/// Outer color -> blocks -> inner colors -> constraints.
///
/// ```
/// use incise_graph::{BlockSchedule, ClusterId, Clustering, ColorId, Coloring, Incidence};
///
/// // Six springs in a row, two blocks of three; in a block the middle one runs second.
/// let springs = Incidence::from_constraints(7, (0u32..6).map(|i| [i, i + 1]))?;
/// let blocks = Clustering::from_labels([0, 0, 0, 1, 1, 1].map(ClusterId).to_vec())?;
/// let outer = Coloring::new([0, 1].map(ColorId).to_vec());
/// let inner = Coloring::new([0, 1, 0, 0, 1, 0].map(ColorId).to_vec());
/// let schedule = BlockSchedule::new(&blocks, &outer, &inner);
/// schedule.check(&springs)?;
/// for color in 0..schedule.color_count() {
///     for block in schedule.blocks(color) {
///         // A workgroup each.
///         for step in schedule.steps(block) {
///             // A thread each; a barrier after every step.
///             let _springs = schedule.constraints(step);
///         }
///     }
/// }
/// assert_eq!(schedule.order(), [0, 2, 1, 3, 5, 4]);
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BlockSchedule {
    /// Outer color -> blocks.
    color_offsets: Vec<u32>,
    /// Block -> cluster.
    clusters: Vec<ClusterId>,
    /// Block -> steps.
    block_offsets: Vec<u32>,
    /// Step -> constraints.
    step_offsets: Vec<u32>,
    order: Vec<u32>,
}

impl BlockSchedule {
    /// The schedule of clusters colored by `outer` (a color per cluster) whose members are colored
    /// by `inner` (a color per constraint).
    ///
    /// Blocks of one color ascend by cluster, steps of a block by inner color, constraints of a
    /// step by number. Vacant clusters get no block and unused inner colors no step. Constraints in no
    /// cluster are left out. The colorings are taken as they are; [`check`](Self::check) proves the
    /// result. O(constraints log block size + clusters + colors).
    ///
    /// # Panics
    /// If there is not one outer color per cluster number and one inner color per constraint.
    #[must_use]
    pub fn new(clustering: &Clustering, outer: &Coloring, inner: &Coloring) -> Self {
        assert_eq!(
            inner.vertex_count(),
            clustering.constraint_count(),
            "one inner color per constraint"
        );
        let blocks = Schedule::new(clustering, outer);
        let mut schedule = Self {
            color_offsets: vec![0],
            clusters: Vec::with_capacity(blocks.cluster_count()),
            block_offsets: vec![0],
            step_offsets: vec![0],
            order: Vec::with_capacity(blocks.constraint_count()),
        };
        for color in 0..blocks.color_count() {
            schedule.clusters.extend_from_slice(blocks.clusters(color));
            let end = offset(schedule.clusters.len());
            schedule.color_offsets.push(end);
        }
        let color = |c: u32| inner.color(c as usize);
        for &cluster in &schedule.clusters {
            let start = schedule.order.len();
            schedule
                .order
                .extend_from_slice(blocks.constraints(cluster));
            let members = &mut schedule.order[start..];
            members.sort_unstable_by_key(|&c| (color(c), c));
            let mut end = start;
            for step in members.chunk_by(|&c, &d| color(c) == color(d)) {
                end += step.len();
                schedule.step_offsets.push(offset(end));
            }
            schedule
                .block_offsets
                .push(offset(schedule.step_offsets.len() - 1));
        }
        schedule
    }

    /// The number of outer colors.
    #[must_use]
    pub fn color_count(&self) -> usize {
        self.color_offsets.len() - 1
    }

    /// The number of blocks.
    #[must_use]
    pub fn block_count(&self) -> usize {
        self.clusters.len()
    }

    /// The number of steps of all blocks together.
    #[must_use]
    pub fn step_count(&self) -> usize {
        self.step_offsets.len() - 1
    }

    /// The blocks of one outer color, which may run at the same time.
    ///
    /// # Panics
    /// If there is no such color.
    #[must_use]
    pub fn blocks(&self, color: usize) -> Range<usize> {
        self.color_offsets[color] as usize..self.color_offsets[color + 1] as usize
    }

    /// The cluster that a block is.
    ///
    /// # Panics
    /// If there is no such block.
    #[must_use]
    pub fn cluster(&self, block: usize) -> ClusterId {
        self.clusters[block]
    }

    /// The steps of one block, to be run one after the other: one per inner color it uses.
    ///
    /// # Panics
    /// If there is no such block.
    #[must_use]
    pub fn steps(&self, block: usize) -> Range<usize> {
        self.block_offsets[block] as usize..self.block_offsets[block + 1] as usize
    }

    /// The constraints of one step, ascending, which may run at the same time.
    ///
    /// # Panics
    /// If there is no such step.
    #[must_use]
    pub fn constraints(&self, step: usize) -> &[u32] {
        &self.order[self.step_offsets[step] as usize..self.step_offsets[step + 1] as usize]
    }

    /// All constraints: block after block, step after step.
    #[must_use]
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// The raw offsets of outer color -> blocks, one more than there are colors.
    #[must_use]
    pub fn color_offsets(&self) -> &[u32] {
        &self.color_offsets
    }

    /// The raw offsets of block -> steps, one more than there are blocks.
    #[must_use]
    pub fn block_offsets(&self) -> &[u32] {
        &self.block_offsets
    }

    /// The raw offsets of step -> constraints into [`order`](Self::order), one more than there are
    /// steps.
    #[must_use]
    pub fn step_offsets(&self) -> &[u32] {
        &self.step_offsets
    }

    /// Proves that every constraint is solved once and that nothing that runs together, blocks of a
    /// color or constraints of a step, shares a particle. O(entries).
    ///
    /// A constraint without particles may be missing: that is the slot of a removed constraint.
    ///
    /// # Errors
    /// A constraint that is unknown, missing or there twice; two blocks of one color on one
    /// particle; two constraints of one step on one particle, named with the place of the step in
    /// its block as the color.
    pub fn check(&self, incidence: &Incidence) -> Result<(), GraphError> {
        each_once("block schedule", self.order.iter().copied(), incidence)?;
        // Who was at each particle last.
        let mut last: Vec<Option<Visit>> = vec![None; incidence.particle_count()];
        for color in 0..self.color_count() {
            for block in self.blocks(color) {
                for step in self.steps(block) {
                    for &constraint in self.constraints(step) {
                        let visit = Visit {
                            color,
                            block,
                            step,
                            constraint,
                        };
                        for &particle in incidence.particles_of(constraint as usize) {
                            let before = last[particle as usize].replace(visit);
                            if let Some(before) = before {
                                self.compare(before, visit, particle)?;
                            }
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// May both visit one particle?
    fn compare(&self, before: Visit, now: Visit, particle: u32) -> Result<(), GraphError> {
        if before.color == now.color && before.block != now.block {
            return Err(GraphError::ClustersCollide {
                first: self.clusters[before.block],
                second: self.clusters[now.block],
                color: ColorId::new(now.color),
                particle,
            });
        }
        if before.step == now.step {
            return Err(GraphError::SharedParticle {
                first: before.constraint,
                second: now.constraint,
                color: ColorId::new(now.step - self.steps(now.block).start),
                particle,
            });
        }
        Ok(())
    }
}

/// A constraint at work on a particle, and when.
#[derive(Clone, Copy, Debug)]
struct Visit {
    color: usize,
    block: usize,
    step: usize,
    constraint: u32,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn coloring(colors: &[u32]) -> Coloring {
        Coloring::new(colors.iter().copied().map(ColorId).collect())
    }

    /// Five springs in a row; clusters {0, 1}, {}, {3, 4}, {2}.
    fn row() -> (Incidence, Clustering) {
        let springs = Incidence::from_constraints(6, (0u32..5).map(|i| [i, i + 1])).unwrap();
        let clustering = Clustering::from_labels([0, 0, 3, 2, 2].map(ClusterId).to_vec()).unwrap();
        (springs, clustering)
    }

    #[test]
    fn vacant_blocks_and_unused_colors_are_skipped() {
        let (springs, clustering) = row();
        let inner = coloring(&[7, 2, 1, 0, 1]);
        let schedule = BlockSchedule::new(&clustering, &coloring(&[1, 9, 1, 0]), &inner);
        schedule.check(&springs).unwrap();
        assert_eq!((schedule.color_count(), schedule.block_count()), (2, 3));
        assert_eq!(schedule.step_count(), 5);
        assert_eq!(schedule.order(), [2, 1, 0, 3, 4]);
        assert_eq!(schedule.blocks(1), 1..3);
        assert_eq!(schedule.steps(1), 1..3);
        assert_eq!(schedule.cluster(1), ClusterId(0));
        assert_eq!(schedule.constraints(1), [1]);
    }

    #[test]
    fn check_refuses_each_mistake() {
        let (springs, mut clustering) = row();
        let (outer, inner) = (coloring(&[1, 0, 1, 0]), coloring(&[0, 1, 0, 0, 1]));
        let good = BlockSchedule::new(&clustering, &outer, &inner);
        good.check(&springs).unwrap();
        let side_by_side = BlockSchedule::new(&clustering, &coloring(&[0, 0, 1, 1]), &inner);
        assert_eq!(
            side_by_side.check(&springs),
            Err(GraphError::ClustersCollide {
                first: ClusterId(2),
                second: ClusterId(3),
                color: ColorId(1),
                particle: 3
            })
        );
        let together = BlockSchedule::new(&clustering, &outer, &coloring(&[0, 1, 0, 4, 4]));
        assert_eq!(
            together.check(&springs),
            Err(GraphError::SharedParticle {
                first: 3,
                second: 4,
                color: ColorId(0),
                particle: 4
            })
        );
        let mut twice = good.clone();
        twice.order[0] = twice.order[1];
        assert!(matches!(
            twice.check(&springs),
            Err(GraphError::ScheduledTwice { .. })
        ));
        let mut foreign = good;
        foreign.order[0] = 7;
        assert!(matches!(
            foreign.check(&springs),
            Err(GraphError::Length { .. })
        ));
        clustering.remove(1);
        assert_eq!(
            BlockSchedule::new(&clustering, &outer, &inner).check(&springs),
            Err(GraphError::Unscheduled { constraint: 1 })
        );
    }

    #[test]
    fn nothing() {
        let none = coloring(&[]);
        let schedule = BlockSchedule::new(&Clustering::none(0), &none, &none);
        assert_eq!((schedule.color_count(), schedule.step_count()), (0, 0));
        schedule
            .check(&Incidence::new(0, vec![0], vec![]).unwrap())
            .unwrap();
    }
}
