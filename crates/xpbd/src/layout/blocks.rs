//! [`Blocks`]: the numbers of the tets as the kernel reads them, one tet in each lane.

use glam::DVec4;

use super::order::{OrderedTet, Slots, in_slots};
use super::places::Places;
use crate::Float;
use crate::neo_hookean::TetConstraint;

/// Numbers a lane has in [`Blocks::rest`]: the inverse rest matrix, the Cholesky factor of the weighted metric, the
/// stiffness.
pub(crate) const REST: usize = 9 + 6 + 1;
/// Numbers a lane has in [`Blocks::constants`]: `l/μ`, `γ` and the damping time.
pub(crate) const CONSTANTS: usize = 3;
/// No tet.
const NONE: u32 = u32::MAX;

/// Tets in blocks of as many lanes as the processor has. A *slot* is a block times the lanes plus a lane.
#[derive(Clone, Debug)]
pub(crate) struct Blocks<R> {
    /// Lanes of a block.
    pub(crate) lanes: usize,
    /// Whether all tets have the same constants.
    uniform: bool,
    /// Block -> a bit for each lane that has a tet.
    pub(crate) active: Vec<u16>,
    /// Block, corner, row: the particles at the corners; particle 0 where there is no tet.
    pub(crate) corners: Vec<u32>,
    /// Block, corner, row: the places of the corners; place 0 where there is no tet.
    pub(crate) places: Vec<u32>,
    /// Block -> a bit for each corner and row, in the order of `corners`, whose particle is another one than in the block
    /// before. None is set in the first tet of a lane.
    pub(crate) changed: Vec<u64>,
    /// Slot -> tet, where there is one.
    pub(super) tets: Vec<u32>,
    /// Slot -> the order of the corners of the tet.
    pub(super) orders: Vec<Slots>,
    /// Block, number, lane: what a tet is at rest.
    pub(crate) rest: Vec<R>,
    /// Block, number, lane: the material. Empty if all have the same, which is `constant` then.
    pub(crate) constants: Vec<R>,
    /// The material if all have the same.
    pub(crate) constant: [R; CONSTANTS],
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
    /// What is stored for the tet with its corners in these slots. F, its metric and the stiffness do not depend on the
    /// order of the corners; the gradients are those of the barycentric coordinates of the corners in slots 1 to 3.
    pub(crate) fn rest(&self, slots: Slots) -> [R; REST] {
        let mut rest = [self.tet.stiffness; REST];
        let [q1, q2, q3] =
            [0, 3, 6].map(|start| [0, 1, 2].map(|axis| self.tet.inverse_rest[start + axis]));
        let q0 = [0, 1, 2].map(|axis| {
            let sum = q1[axis].to_f64() + q2[axis].to_f64() + q3[axis].to_f64();
            R::from_f64(0.0 - sum)
        });
        let gradients = in_slots([q0, q1, q2, q3], slots);
        rest[..9].copy_from_slice(gradients[1..].as_flattened());
        rest[9..15].copy_from_slice(&metric_factor(&self.tet, self.weights));
        rest
    }
}

impl<R: Float> Default for Blocks<R> {
    fn default() -> Self {
        Self {
            lanes: 1,
            uniform: true,
            active: Vec::new(),
            corners: Vec::new(),
            places: Vec::new(),
            changed: Vec::new(),
            tets: Vec::new(),
            orders: Vec::new(),
            rest: Vec::new(),
            constants: Vec::new(),
            constant: [R::ZERO; CONSTANTS],
        }
    }
}

impl<R: Float> Blocks<R> {
    /// Number of blocks.
    pub(crate) fn len(&self) -> usize {
        self.active.len()
    }

    /// Removes all blocks. `uniform` says that all tets to come have the same constants.
    pub(super) fn reset(&mut self, lanes: usize, uniform: bool) {
        (self.lanes, self.uniform) = (lanes, uniform);
        self.active.clear();
        self.corners.clear();
        self.places.clear();
        self.changed.clear();
        self.tets.clear();
        self.orders.clear();
        self.rest.clear();
        self.constants.clear();
    }

    /// Extends to so many blocks.
    pub(super) fn grow(&mut self, blocks: usize) {
        let slots = blocks * self.lanes;
        self.active.resize(blocks, 0);
        self.corners.resize(4 * slots, 0);
        self.places.resize(4 * slots, 0);
        self.changed.resize(blocks, 0);
        self.tets.resize(slots, NONE);
        self.orders.resize(slots, [0; 4]);
        self.rest.resize(slots * REST, R::ZERO);
        if !self.uniform {
            self.constants.resize(slots * CONSTANTS, R::ZERO);
        }
    }

    /// Where the corners of a slot are in `corners` and `places`.
    pub(super) fn corners_of(&self, slot: usize) -> [usize; 4] {
        let lanes = self.lanes;
        let (block, lane) = (slot / lanes, slot % lanes);
        [0, 1, 2, 3].map(|k| (4 * block + k) * lanes + R::row(lane, lanes))
    }

    /// Whether the bit of a corner in `changed` is set.
    pub(super) fn is_changed(&self, corner: usize) -> bool {
        let corners = 4 * self.lanes;
        self.changed[corner / corners] & (1 << (corner % corners)) != 0
    }

    /// Whether the corners of the tet in a slot are these, in the order that they were filled in.
    pub(super) fn has_corners(&self, slot: usize, corners: [u32; 4]) -> bool {
        let known = self.corners_of(slot).map(|i| self.corners[i]);
        known == in_slots(corners, self.orders[slot])
    }

    /// Writes a tet into a slot of an active lane. `is_first` says that it is the first of its lane.
    pub(super) fn put(
        &mut self,
        slot: usize,
        ordered: OrderedTet,
        is_first: bool,
        ingredients: &Ingredients<R>,
        places: &mut Places,
    ) {
        let lanes = self.lanes;
        let block = slot / lanes;
        self.active[block] |= 1 << (slot % lanes);
        self.tets[slot] = ordered.tet;
        self.orders[slot] = ordered.slots;
        let corners = in_slots(ingredients.tet.particles, ordered.slots);
        for (i, corner) in self.corners_of(slot).into_iter().zip(corners) {
            self.corners[i] = corner;
            self.places[i] = places.place(corner);
            let bit = 1 << (i - 4 * block * lanes);
            if is_first || self.corners[i - 4 * lanes] == corner {
                self.changed[block] &= !bit;
            } else {
                self.changed[block] |= bit;
            }
        }
        self.fill(slot, ingredients);
    }

    /// Removes the tet of a slot. Without a rest shape F is 0 in its lane, which is near no rare branch of the kernel.
    pub(super) fn clear(&mut self, slot: usize) {
        let lanes = self.lanes;
        let (block, lane) = (slot / lanes, slot % lanes);
        self.active[block] &= !(1 << lane);
        for i in self.corners_of(slot) {
            // A particle that is there as long as any is.
            (self.corners[i], self.places[i]) = (0, 0);
            self.changed[block] &= !(1 << (i - 4 * block * lanes));
        }
        let rest = &mut self.rest[block * REST * lanes..(block + 1) * REST * lanes];
        for value in rest.iter_mut().skip(lane).step_by(lanes) {
            *value = R::ZERO;
        }
    }

    /// Writes the numbers of the tet in a slot, whose corners are there.
    pub(super) fn fill(&mut self, slot: usize, ingredients: &Ingredients<R>) {
        let lanes = self.lanes;
        let (block, lane) = (slot / lanes, slot % lanes);
        if self.uniform {
            self.constant = ingredients.constants;
        } else {
            let start = block * CONSTANTS * lanes + lane;
            for (k, value) in ingredients.constants.into_iter().enumerate() {
                self.constants[start + k * lanes] = value;
            }
        }
        let start = block * REST * lanes + lane;
        for (k, value) in ingredients.rest(self.orders[slot]).into_iter().enumerate() {
            self.rest[start + k * lanes] = value;
        }
    }

    /// Whether a slot has a tet, as it is now, to the bit.
    pub(super) fn has(&self, slot: usize, ordered: OrderedTet, now: &Ingredients<R>) -> bool {
        let lanes = self.lanes;
        let (block, lane) = (slot / lanes, slot % lanes);
        let same = |a: R, b: R| a.to_f64().to_bits() == b.to_f64().to_bits();
        let rest = now.rest(ordered.slots).into_iter().enumerate();
        let constants = now.constants.into_iter().enumerate();
        self.active[block] & (1 << lane) != 0
            && (self.tets[slot], self.orders[slot]) == (ordered.tet, ordered.slots)
            && self.has_corners(slot, now.tet.particles)
            && rest.fold(true, |all, (k, value)| {
                all && same(self.rest[(block * REST + k) * lanes + lane], value)
            })
            && constants.fold(true, |all, (k, value)| {
                let known = match self.uniform {
                    true => self.constant[k],
                    false => self.constants[(block * CONSTANTS + k) * lanes + lane],
                };
                all && same(known, value)
            })
    }
}

/// The lower triangle L of the Cholesky factorization `G = L Lᵀ` of `G = μV Σ w q qᵀ`, the sum over the corners with
/// inverse mass w and gradient q of the barycentric coordinate. In this order: its diagonal, then yx, zx, zy.
///
/// With it `Σ w |∇C|²` needs no gradients at the corners: it is `|A L|²` for `A = dC/dF`. A sum of squares loses
/// nothing to rounding; `G : AᵀA`, which is the same, loses all of a sliver whose steep direction A hardly sees. L
/// comes from an orthogonalization of the weighted gradients in double precision, since G itself would lose as much.
pub(super) fn metric_factor<R: Float>(tet: &TetConstraint<R>, weights: [R; 4]) -> [R; 6] {
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
