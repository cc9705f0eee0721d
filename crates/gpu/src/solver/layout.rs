//! [`Layout`]: the slot of each tet on the device, and the patches to send after a change.
//!
//! There are two mappings of a schedule. [`ClusterMapping::Threads`] is the paper's: a thread solves a cluster, tet
//! after tet, and 64 clusters of a color are a workgroup. [`ClusterMapping::Workgroups`] is for clusters of up to 256
//! tets: a workgroup solves one cluster, with its particles in workgroup memory and its tets in steps that share no
//! particle. A small body then needs few colors and thus few dispatches. In both a cluster has a slot (`slots.rs`), and
//! its tets have the tet slots within it.
//!
//! Cost: O(tets of changed clusters and changed tets); O(tets) for another schedule or other masses.

use incise_graph::{ClusterId, Schedule};
use incise_xpbd::{Changes, OrderedTet, Solver};

use super::gpu_types::TetPatch;
use super::slots::{Moved, Slots};
use super::tile::{self, Tile};
use crate::GpuError;
use crate::index::index;

/// Threads of a workgroup, and tets whose numbers are adjacent in memory.
pub(crate) const THREADS: usize = 64;

/// The slot of a tet that has none.
const NONE: u32 = u32::MAX;

/// The unit of the device that solves a cluster.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ClusterMapping {
    /// A thread, tet after tet (paper section 4.1).
    #[default]
    Threads,
    /// A workgroup, its tets in steps: for clusters of up to 256 tets, worthwhile from [`ClusterMapping::LARGE`] tets
    /// on. Tiles have room for 64, 128 or 256 tets, chosen by the largest cluster.
    Workgroups,
}

impl ClusterMapping {
    /// The size limit of a clustering from which on workgroups are faster than threads.
    pub const LARGE: usize = 33;

    /// The mapping for clusters of at most this many tets.
    #[must_use]
    pub fn for_clusters_of(limit: usize) -> Self {
        if limit < Self::LARGE {
            Self::Threads
        } else {
            Self::Workgroups
        }
    }
}

/// The slots of clusters and tets on the device.
#[derive(Debug)]
pub(crate) struct Layout {
    pub(crate) mapping: ClusterMapping,
    /// Tet slots per cluster slot.
    depth: usize,
    pub(crate) slots: Slots,
    /// Slot -> number of its tets.
    filled: Vec<u32>,
    /// Tet -> tet slot.
    tet_slots: Vec<u32>,
    /// Tet slot -> tet and the order of its corners, in occupied slots.
    tets: Vec<OrderedTet>,
    /// Tet slot -> corners on the device, in occupied slots.
    corners: Vec<[u32; 4]>,
}

/// Changes to send to the device.
#[derive(Debug, Default)]
pub(crate) struct Patch {
    /// True if all data on the device are outdated.
    pub(crate) is_rebuilt: bool,
    /// Patches of distinct tet slots.
    pub(crate) tets: Vec<TetPatch>,
    /// Tiles by number.
    pub(crate) tiles: Vec<(u32, Tile)>,
    /// True if the groups of colors have changed.
    pub(crate) regrouped: bool,
}

impl Layout {
    pub(crate) fn new(mapping: ClusterMapping) -> Self {
        let width = match mapping {
            ClusterMapping::Threads => THREADS,
            ClusterMapping::Workgroups => 1,
        };
        Self {
            mapping,
            depth: 1,
            slots: Slots::new(width),
            filled: Vec::new(),
            tet_slots: Vec::new(),
            tets: Vec::new(),
            corners: Vec::new(),
        }
    }

    /// Tet slots on the device.
    pub(crate) fn tet_slot_count(&self) -> usize {
        self.slots.slot_count() * self.depth
    }

    /// Tets that the schedule solves.
    pub(crate) fn tet_count(&self) -> usize {
        self.filled.iter().map(|&tets| tets as usize).sum()
    }

    /// Rows of 64 tet slots per group.
    pub(crate) fn depth(&self) -> usize {
        self.depth
    }

    /// Tets for which a tile has room; 0 without tiles.
    pub(crate) fn tile(&self) -> u32 {
        match self.mapping {
            ClusterMapping::Threads => 0,
            ClusterMapping::Workgroups => index(self.depth),
        }
    }

    /// The tet slot of a tet, if the schedule solves it.
    pub(crate) fn tet_slot(&self, tet: usize) -> Option<usize> {
        let tet_slot = self.tet_slots.get(tet).copied();
        tet_slot
            .filter(|&tet_slot| tet_slot != NONE)
            .map(|tet_slot| tet_slot as usize)
    }

    /// The tet in an occupied tet slot, with the order of its corners.
    pub(crate) fn tet(&self, tet_slot: usize) -> OrderedTet {
        self.tets[tet_slot]
    }

    /// The tet slot of the `k`-th tet of a slot.
    fn tet_slot_of(&self, slot: u32, k: usize) -> usize {
        let slot = slot as usize;
        match self.mapping {
            ClusterMapping::Threads => {
                ((slot / THREADS) * self.depth + k) * THREADS + slot % THREADS
            }
            ClusterMapping::Workgroups => slot * self.depth + k,
        }
    }

    /// Updates the layout to a schedule over the tets of a solver, given the changes since the last call.
    ///
    /// # Errors
    /// If a cluster is larger than a tile.
    pub(crate) fn sync(
        &mut self,
        schedule: &Schedule,
        solver: &Solver<f32>,
        changes: &Changes,
    ) -> Result<Patch, GpuError> {
        if changes.all_tets {
            self.slots.forget();
        }
        let mut patch = Patch::default();
        let mut moved = self.slots.sync(schedule);
        if let Moved::Slots(slots) = &moved
            && self.largest(slots, schedule)? > self.depth
        {
            self.slots.forget();
            moved = self.slots.sync(schedule);
        }
        let slots = match moved {
            Moved::All => {
                patch.is_rebuilt = true;
                let slots: Vec<u32> = (0..index(self.slots.slot_count())).collect();
                let largest = self.largest(&slots, schedule)?;
                self.depth = match self.mapping {
                    ClusterMapping::Threads => largest.max(1),
                    ClusterMapping::Workgroups => tile::room_for(largest),
                };
                self.filled.clear();
                self.tet_slots.clear();
                slots
            }
            Moved::Slots(slots) => self.with_changed(slots, changes, solver, &mut patch),
        };
        patch.regrouped = patch.is_rebuilt || !slots.is_empty();
        self.filled.resize(self.slots.slot_count(), 0);
        self.tets.resize(self.tet_slot_count(), in_order(NONE));
        self.corners.resize(self.tet_slot_count(), [NONE; 4]);
        self.tet_slots
            .resize(solver.tet_count().max(self.tet_slots.len()), NONE);
        // All slots are emptied before any is filled: a tet may have changed its slot.
        for &slot in &slots {
            self.empty(slot);
        }
        for &slot in &slots {
            self.fill(slot, schedule, solver, &mut patch);
        }
        Ok(patch)
    }

    /// The tets of the largest cluster in these slots.
    fn largest(&mut self, slots: &[u32], schedule: &Schedule) -> Result<usize, GpuError> {
        let clusters = slots.iter().filter_map(|&slot| self.slots.cluster(slot));
        let sized = clusters.map(|cluster| (schedule.constraints(cluster).len(), cluster));
        let (tets, cluster) = sized.max().unwrap_or((0, ClusterId(0)));
        if self.mapping == ClusterMapping::Workgroups && tets > tile::LARGEST {
            self.slots.forget();
            return Err(GpuError::Block {
                cluster: cluster.0,
                tets,
                limit: tile::LARGEST,
            });
        }
        Ok(tets)
    }

    /// Patches changed tets in their slots. Clusters of which a tet has other corners may have another order, so they are
    /// filled in again, and so are tiles with a changed tet.
    fn with_changed(
        &mut self,
        mut slots: Vec<u32>,
        changes: &Changes,
        solver: &Solver<f32>,
        patch: &mut Patch,
    ) -> Vec<u32> {
        let mut changed = changes.tets.clone();
        changed.sort_unstable();
        changed.dedup();
        let known = slots.len();
        let mut alone = Vec::new();
        for tet in changed {
            let Some(tet_slot) = self.tet_slot(tet as usize) else {
                continue;
            };
            let slot = index(match self.mapping {
                ClusterMapping::Threads => {
                    tet_slot / (self.depth * THREADS) * THREADS + tet_slot % THREADS
                }
                ClusterMapping::Workgroups => tet_slot / self.depth,
            });
            if slots[..known].binary_search(&slot).is_ok() {
                continue;
            }
            match self.mapping {
                // A removed tet is in no schedule, so its slot is among those already patched.
                ClusterMapping::Threads => {
                    let filled = filled_in(tet_slot, self.tets[tet_slot], solver);
                    if filled.corners == self.corners[tet_slot] {
                        alone.push((slot, filled));
                    } else {
                        slots.push(slot);
                    }
                }
                ClusterMapping::Workgroups => slots.push(slot),
            }
        }
        slots.sort_unstable();
        slots.dedup();
        alone.retain(|(slot, _)| slots.binary_search(slot).is_err());
        patch
            .tets
            .extend(alone.into_iter().map(|(_, filled)| filled));
        slots
    }

    /// Removes the tets of a slot.
    fn empty(&mut self, slot: u32) {
        for k in 0..self.filled[slot as usize] as usize {
            let tet_slot = self.tet_slot_of(slot, k);
            let tet = &mut self.tet_slots[self.tets[tet_slot].tet as usize];
            if *tet == index(tet_slot) {
                *tet = NONE;
            }
        }
    }

    fn put(&mut self, tet: OrderedTet, filled: &TetPatch) {
        let tet_slot = filled.tet_slot as usize;
        self.tet_slots[tet.tet as usize] = filled.tet_slot;
        self.tets[tet_slot] = tet;
        self.corners[tet_slot] = filled.corners;
    }

    /// Fills a cluster slot with the tets of its cluster, and clears the tet slots behind them.
    fn fill(&mut self, slot: u32, schedule: &Schedule, solver: &Solver<f32>, patch: &mut Patch) {
        let cluster = self.slots.cluster(slot);
        let tets = cluster.map_or(&[][..], |cluster| schedule.constraints(cluster));
        match self.mapping {
            ClusterMapping::Threads => {
                for (k, tet) in solver.solving_order(tets).into_iter().enumerate() {
                    let filled = filled_in(self.tet_slot_of(slot, k), tet, solver);
                    self.put(tet, &filled);
                    patch.tets.push(filled);
                }
            }
            ClusterMapping::Workgroups if tets.is_empty() => {}
            ClusterMapping::Workgroups => {
                let tile = Tile::new(tets, |tet| solver.tet_particles(tet as usize));
                for (k, (tet, corners)) in tile.tets().enumerate() {
                    let tet = in_order(tet);
                    let filled = filled_in(self.tet_slot_of(slot, k), tet, solver);
                    self.put(tet, &filled);
                    patch.tets.push(TetPatch { corners, ..filled });
                }
                patch.tiles.push((slot, tile));
            }
        }
        for k in tets.len()..self.filled[slot as usize] as usize {
            patch.tets.push(TetPatch {
                tet_slot: index(self.tet_slot_of(slot, k)),
                ..TetPatch::default()
            });
        }
        self.filled[slot as usize] = index(tets.len());
    }
}

/// A tet with its corners in their own order.
pub(crate) fn in_order(tet: u32) -> OrderedTet {
    let slots = [0, 1, 2, 3];
    OrderedTet { tet, slots }
}

fn filled_in(tet_slot: usize, tet: OrderedTet, solver: &Solver<f32>) -> TetPatch {
    let data = solver.ordered_tet_data(tet);
    let [ratio, gamma, damping] = data.constants;
    TetPatch {
        tet_slot: index(tet_slot),
        unused: [0; 3],
        corners: data.corners,
        rest: data.rest,
        constants: [ratio, gamma, damping, slope(data.constants)],
    }
}

/// Slope of the elastic energy at rest that remains because ratio and γ are rounded, for measurements of the energy.
#[expect(
    clippy::cast_possible_truncation,
    reason = "the device computes in single precision"
)]
pub(crate) fn slope([ratio, gamma, _]: [f32; 3]) -> f32 {
    (1.0 + f64::from(ratio) * (1.0 - f64::from(gamma))) as f32
}
