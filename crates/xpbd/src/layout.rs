//! [`Layout`]: the tets in the order and the grouping in which a processor solves them, several at a time.
//!
//! Clusters of one color share no particle, so as many of them as a processor has lanes are solved side by side: lane
//! by lane the first tet of each, then the second. A *group* is such a set of clusters, a *block* one tet of each.
//! Which cluster is in which group changes who computes, never what, since each sees only its own particles.
//!
//! A layout follows its schedule (`follow.rs`): groups keep their blocks, a changed cluster is taken from its lane and
//! put into one that is free, and a tet whose corners, rest shape or masses changed is marked and filled in again. So a
//! frame after a cut costs what the cut touched. Another schedule, another material or a changed mass of which nobody
//! said what hangs on it makes all anew.
//!
//! Cost: O(tets) to make, 80 bytes a tet in single precision; to follow, O(changed clusters and marked tets), amortized.

mod check;
mod follow;

use std::ops::Range;

use glam::DVec4;
use incise_graph::{ClusterId, Rows, Schedule};

use crate::Float;
use crate::neo_hookean::TetConstraint;

/// Numbers a lane has in [`Layout::rest`]: the inverse rest matrix, the Cholesky factor of the weighted metric, the stiffness.
pub(crate) const REST: usize = 9 + 6 + 1;
/// Numbers a lane has in [`Layout::constants`]: `l/μ`, `γ` and the damping time.
pub(crate) const CONSTANTS: usize = 3;
/// No place, no seat, no group.
const NONE: u32 = u32::MAX;

/// The tets of a schedule, block by block.
#[derive(Clone, Debug)]
pub(crate) struct Layout<R> {
    /// The revision of the schedule that this is the layout of; `None` if it is to be made anew.
    revision: Option<u64>,
    /// Lanes of a block.
    pub(crate) lanes: usize,
    /// Whether all tets have the same constants.
    uniform: bool,
    /// Color -> groups.
    colors: Rows<u32>,
    usages: Vec<Usage>,
    groups: Vec<Group>,
    /// Blocks -> groups of so many blocks that have no cluster.
    free: Rows<u32>,
    free_blocks: usize,
    /// Block -> a bit for each lane that has a tet.
    pub(crate) active: Vec<u16>,
    /// Block and lane -> corners; particle 0 in lanes without a tet.
    pub(crate) particles: Vec<[u32; 4]>,
    /// Block and lane -> tet, in lanes that have one.
    tets: Vec<u32>,
    /// Block, number, lane: what a tet is at rest.
    pub(crate) rest: Vec<R>,
    /// Block, number, lane: the material. Empty if all have the same, which is `constant` then.
    pub(crate) constants: Vec<R>,
    /// The material if all have the same.
    pub(crate) constant: [R; CONSTANTS],
    /// Tet -> block and lane.
    places: Vec<u32>,
    /// Cluster -> group and lane.
    seats: Vec<u32>,
    /// Tets in the layout that have changed since, and for each tet whether it is listed.
    dirty: Vec<u32>,
    marked: Vec<bool>,
    /// Work.
    clusters: Vec<ClusterId>,
}

/// Clusters that are solved side by side.
#[derive(Clone, Copy, Debug)]
struct Group {
    /// The first of its blocks, and their number.
    first: u32,
    depth: u32,
    color: u32,
    /// Where it is among the groups of its color.
    place: u32,
    /// A bit for each lane that has a cluster.
    occupied: u16,
}

/// How well the blocks of a color are used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Usage {
    tets: u32,
    blocks: u32,
    /// The most blocks of a group since the groups of the color were formed.
    depth: u32,
    /// The group that takes new clusters.
    open: u32,
}

impl Usage {
    const NONE: Self = Self {
        tets: 0,
        blocks: 0,
        depth: 0,
        open: NONE,
    };

    /// Whether forming the groups anew is worth it. Newly formed, a color has no more than `tets / lanes + depth`
    /// blocks, so in between at least half as many have become idle.
    fn is_wasteful(self, lanes: usize) -> bool {
        let lanes = u64::try_from(lanes).unwrap_or(u64::MAX);
        let [tets, blocks, depth] = [self.tets, self.blocks, self.depth].map(u64::from);
        2 * lanes * blocks > 3 * (tets + lanes * depth)
    }
}

/// What a tet of the layout is made of.
pub(crate) struct Ingredients<R> {
    pub(crate) tet: TetConstraint<R>,
    /// Inverse masses of its corners.
    pub(crate) weights: [R; 4],
    /// `l/μ`, `γ`, damping time.
    pub(crate) constants: [R; CONSTANTS],
}

impl<R: Float> Ingredients<R> {
    /// What is stored for the tet.
    pub(crate) fn rest(&self) -> [R; REST] {
        let mut rest = [self.tet.stiffness; REST];
        rest[..9].copy_from_slice(&self.tet.inverse_rest);
        rest[9..15].copy_from_slice(&metric_factor(&self.tet, self.weights));
        rest
    }
}

impl<R: Float> Default for Layout<R> {
    fn default() -> Self {
        Self {
            revision: None,
            lanes: 1,
            uniform: true,
            colors: Rows::default(),
            usages: Vec::new(),
            groups: Vec::new(),
            free: Rows::default(),
            free_blocks: 0,
            active: Vec::new(),
            particles: Vec::new(),
            tets: Vec::new(),
            rest: Vec::new(),
            constants: Vec::new(),
            constant: [R::ZERO; CONSTANTS],
            places: Vec::new(),
            seats: Vec::new(),
            dirty: Vec::new(),
            marked: Vec::new(),
            clusters: Vec::new(),
        }
    }
}

impl<R: Float> Layout<R> {
    /// Whether this is the layout of the schedule, and no tet has changed since.
    pub(crate) fn fits(&self, schedule: &Schedule) -> bool {
        self.revision == Some(schedule.revision()) && self.dirty.is_empty()
    }

    /// From now on nothing here is to be trusted.
    pub(crate) fn forget(&mut self) {
        self.revision = None;
    }

    /// Notes that the corners, the rest shape or the masses of a tet have changed. O(1).
    pub(crate) fn touch(&mut self, tet: usize) {
        if self.revision.is_some() && self.place(tet).is_some() && !self.marked[tet] {
            self.marked[tet] = true;
            self.dirty.push(index(tet));
        }
    }

    /// Fills in what a tet is.
    fn fill(&mut self, place: usize, tet: u32, ingredients: &Ingredients<R>) {
        let lanes = self.lanes;
        let (block, lane) = (place / lanes, place % lanes);
        self.particles[place] = ingredients.tet.particles;
        if self.uniform {
            self.constant = ingredients.constants;
        } else {
            let start = block * CONSTANTS * lanes + lane;
            for (k, value) in ingredients.constants.into_iter().enumerate() {
                self.constants[start + k * lanes] = value;
            }
        }
        let start = block * REST * lanes + lane;
        for (k, value) in ingredients.rest().into_iter().enumerate() {
            self.rest[start + k * lanes] = value;
        }
        self.marked[tet as usize] = false;
    }

    /// The groups of a color.
    pub(crate) fn groups(&self, color: usize) -> &[u32] {
        self.colors.row(color)
    }

    /// The blocks of a group.
    pub(crate) fn blocks(&self, group: u32) -> Range<usize> {
        let group = self.groups[group as usize];
        group.first as usize..(group.first + group.depth) as usize
    }

    /// The number of blocks of a color.
    pub(crate) fn blocks_of(&self, color: usize) -> usize {
        self.usages[color].blocks as usize
    }

    pub(crate) fn color_count(&self) -> usize {
        self.colors.row_count()
    }

    pub(crate) fn block_count(&self) -> usize {
        self.active.len()
    }

    /// The block and the lane of a tet; `None` if the schedule does not solve it.
    pub(crate) fn place(&self, tet: usize) -> Option<(usize, usize)> {
        let place = *self.places.get(tet)?;
        let place = (place != NONE).then_some(place as usize)?;
        Some((place / self.lanes, place % self.lanes))
    }
}

/// The lower triangle L of the Cholesky factorization `G = L Lᵀ` of `G = μV Σ w q qᵀ`, the sum over the corners with inverse
/// mass w and gradient q of the barycentric coordinate. In this order: its diagonal, then yx, zx, zy.
///
/// With it `Σ w |∇C|²` needs no gradients at the corners: it is `|A L|²` for `A = dC/dF`. A sum of squares loses nothing to
/// rounding; `G : AᵀA`, which is the same, loses all of a sliver whose steep direction A hardly sees. L comes from an
/// orthogonalization of the weighted gradients in double precision, since G itself would lose as much.
fn metric_factor<R: Float>(tet: &TetConstraint<R>, weights: [R; 4]) -> [R; 6] {
    let q = tet.inverse_rest.map(R::to_f64);
    let stiffness = tet.stiffness.to_f64();
    let roots = weights.map(|w| (w.to_f64() * stiffness).sqrt());
    let mut columns = [0, 1, 2].map(|axis| {
        let [a, b, c] = [q[axis], q[3 + axis], q[6 + axis]];
        DVec4::new(-(a + b + c), a, b, c) * DVec4::from_array(roots)
    });
    let mut triangle = [[0.0; 3]; 3];
    for j in 0..3 {
        let length = columns[j].length();
        triangle[j][j] = length;
        let direction = columns[j].normalize_or_zero();
        for i in j + 1..3 {
            triangle[i][j] = direction.dot(columns[i]);
            columns[i] -= direction * triangle[i][j];
        }
    }
    let [[xx, ..], [yx, yy, _], [zx, zy, zz]] = triangle;
    [xx, yy, zz, yx, zx, zy].map(R::from_f64)
}

fn index(value: usize) -> u32 {
    u32::try_from(value).expect("fewer than 2³² tets, lanes included")
}

#[cfg(test)]
mod tests;
