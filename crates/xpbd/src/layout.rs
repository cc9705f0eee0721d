//! [`Layout`]: the tets in the order and the grouping in which a processor solves them, several at a time.
//!
//! Clusters of one color share no particle, so as many of them as a processor has lanes are solved side by side: lane
//! by lane the first tet of each, then the second. A *group* is such a set of clusters, a *block* one tet of each.
//! Within a color clusters are grouped by size, so that few lanes wait; which cluster is in which group changes who
//! computes, never what, since each sees only its own particles.
//!
//! Cost: O(tets) to make, 80 bytes a tet in single precision; made anew as a whole when the schedule, a tet, a mass or
//! what is fixed changes. A step compares the schedule with the last one, which costs a look at each of its numbers.

use glam::DVec3;
use incise_graph::Schedule;

use crate::Real;
use crate::neo_hookean::TetConstraint;

/// Numbers a lane has in [`Layout::rest`]: the inverse rest matrix, the weighted metric, the stiffness.
pub(crate) const REST: usize = 9 + 6 + 1;
/// Numbers a lane has in [`Layout::constants`]: `l/μ`, `γ` and the damping time.
pub(crate) const CONSTANTS: usize = 3;

/// The tets of a schedule, block by block.
#[derive(Debug)]
pub(crate) struct Layout<R> {
    /// What this was made for.
    schedule: Schedule,
    /// Whether a tet or a mass has changed since.
    pub(crate) stale: bool,
    /// Lanes of a block.
    pub(crate) lanes: usize,
    /// Color -> groups.
    color_offsets: Vec<u32>,
    /// Group -> blocks.
    group_offsets: Vec<u32>,
    /// Block -> lanes that have a tet; the others follow them.
    pub(crate) active: Vec<u8>,
    /// Block and lane -> corners. Lanes without a tet repeat the first one's.
    pub(crate) particles: Vec<[u32; 4]>,
    /// Block and lane -> tet.
    tets: Vec<u32>,
    /// Block, number, lane: what a tet is at rest.
    pub(crate) rest: Vec<R>,
    /// Block, number, lane: the material. Empty if there is but one, which is `constant` then.
    pub(crate) constants: Vec<R>,
    /// The material if there is but one.
    pub(crate) constant: [R; CONSTANTS],
    /// Tet -> block and lane.
    places: Vec<u32>,
}

/// What a tet of the layout is made of.
pub(crate) struct Ingredients<R> {
    pub(crate) tet: TetConstraint<R>,
    /// Inverse masses of its corners.
    pub(crate) weights: [R; 4],
    /// `l/μ`, `γ`, damping time.
    pub(crate) constants: [R; CONSTANTS],
}

impl<R: Real> Default for Layout<R> {
    fn default() -> Self {
        Self {
            schedule: Schedule::default(),
            stale: true,
            lanes: 1,
            color_offsets: Vec::new(),
            group_offsets: Vec::new(),
            active: Vec::new(),
            particles: Vec::new(),
            tets: Vec::new(),
            rest: Vec::new(),
            constants: Vec::new(),
            constant: [R::ZERO; CONSTANTS],
            places: Vec::new(),
        }
    }
}

impl<R: Real> Layout<R> {
    /// Whether this is the layout of the schedule, and nothing has changed since.
    pub(crate) fn fits(&self, schedule: &Schedule) -> bool {
        !self.stale && self.schedule == *schedule
    }

    /// Makes the layout of a schedule. `uniform` says that there is but one material.
    pub(crate) fn rebuild(
        &mut self,
        schedule: &Schedule,
        lanes: usize,
        uniform: bool,
        ingredients: impl Fn(u32) -> Ingredients<R>,
    ) {
        let _span = tracing::debug_span!("xpbd::layout").entered();
        self.schedule.clone_from(schedule);
        self.stale = false;
        self.lanes = lanes;
        self.color_offsets.clear();
        self.group_offsets.clear();
        self.active.clear();
        self.particles.clear();
        self.tets.clear();
        self.color_offsets.push(0);
        self.group_offsets.push(0);
        let mut slots: Vec<usize> = Vec::new();
        for color in 0..schedule.color_count() {
            slots.clear();
            slots.extend(schedule.clusters(color));
            slots.sort_by_key(|&slot| std::cmp::Reverse(schedule.constraints(slot).len()));
            for group in slots.chunks(lanes) {
                self.push_group(schedule, group);
            }
            self.color_offsets.push(index(self.group_offsets.len() - 1));
        }
        self.fill(uniform, ingredients);
    }

    /// Appends the blocks of clusters that are solved side by side, the largest first.
    fn push_group(&mut self, schedule: &Schedule, slots: &[usize]) {
        for step in 0..schedule.constraints(slots[0]).len() {
            let at = |&slot: &usize| schedule.constraints(slot).get(step).copied();
            let tets = slots.iter().map_while(at);
            let first = self.tets.len();
            self.tets.extend(tets);
            let active = self.tets.len() - first;
            self.tets.resize(first + self.lanes, self.tets[first]);
            self.active.push(u8::try_from(active).unwrap_or(u8::MAX));
        }
        self.group_offsets.push(index(self.active.len()));
    }

    /// Fills in what the tets are at rest.
    fn fill(&mut self, uniform: bool, ingredients: impl Fn(u32) -> Ingredients<R>) {
        let lanes = self.lanes;
        self.rest.clear();
        self.rest.resize(self.tets.len() * REST, R::ZERO);
        self.constants.clear();
        if !uniform {
            self.constants.resize(self.tets.len() * CONSTANTS, R::ZERO);
        }
        self.places.clear();
        for (place, &tet) in self.tets.iter().enumerate() {
            let (block, lane) = (place / lanes, place % lanes);
            let Ingredients {
                tet: constraint,
                weights,
                constants,
            } = ingredients(tet);
            self.particles.push(constraint.particles);
            if uniform {
                self.constant = constants;
            } else {
                let start = block * CONSTANTS * lanes + lane;
                for (k, value) in constants.into_iter().enumerate() {
                    self.constants[start + k * lanes] = value;
                }
            }
            if lane >= usize::from(self.active[block]) {
                continue;
            }
            let start = block * REST * lanes + lane;
            let metric = metric(&constraint, weights);
            let values = constraint.inverse_rest.into_iter().chain(metric);
            for (k, value) in values.chain([constraint.stiffness]).enumerate() {
                self.rest[start + k * lanes] = value;
            }
            if self.places.len() <= tet as usize {
                self.places.resize(tet as usize + 1, u32::MAX);
            }
            self.places[tet as usize] = index(place);
        }
    }

    /// The groups of a color.
    pub(crate) fn groups(&self, color: usize) -> std::ops::Range<usize> {
        self.color_offsets[color] as usize..self.color_offsets[color + 1] as usize
    }

    /// The blocks of some groups.
    pub(crate) fn blocks(&self, groups: std::ops::Range<usize>) -> std::ops::Range<usize> {
        self.group_offsets[groups.start] as usize..self.group_offsets[groups.end] as usize
    }

    pub(crate) fn color_count(&self) -> usize {
        self.color_offsets.len().saturating_sub(1)
    }

    pub(crate) fn block_count(&self) -> usize {
        self.active.len()
    }

    /// The block and the lane of a tet; `None` if the schedule does not solve it.
    pub(crate) fn place(&self, tet: usize) -> Option<(usize, usize)> {
        let place = *self.places.get(tet)? as usize;
        (place < self.tets.len()).then_some((place / self.lanes, place % self.lanes))
    }
}

/// `μV Σ w q qᵀ` over the corners with inverse mass w and gradient q of the barycentric coordinate; off the diagonal
/// twice. With it the matrix of a tet's 2×2 system needs no gradients at the corners: `Σ w |∇C|²` is `G : AᵀA` for
/// `A = dC/dF`. In double precision, since the masses of a cut tet's corners differ by orders.
fn metric<R: Real>(tet: &TetConstraint<R>, weights: [R; 4]) -> [R; 6] {
    let q = tet.inverse_rest.map(R::to_f64);
    let [a, b, c] = [0, 1, 2].map(|i| DVec3::new(q[3 * i], q[3 * i + 1], q[3 * i + 2]));
    let corners = [-(a + b + c), a, b, c];
    let stiffness = tet.stiffness.to_f64();
    let entry = |i: usize, j: usize, times: f64| {
        let sum: f64 = corners
            .iter()
            .zip(weights)
            .map(|(q, w)| w.to_f64() * q[i] * q[j])
            .sum();
        R::from_f64(sum * stiffness * times)
    };
    [
        entry(0, 0, 1.0),
        entry(1, 1, 1.0),
        entry(2, 2, 1.0),
        entry(0, 1, 2.0),
        entry(0, 2, 2.0),
        entry(1, 2, 2.0),
    ]
}

fn index(value: usize) -> u32 {
    u32::try_from(value).expect("fewer than 2³² tets, lanes included")
}
