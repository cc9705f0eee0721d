//! [`GpuSolver::check`]: compares the device's data with schedule, tets and masses.
//!
//! All derived data are read back and compared with values that the host recomputes, tet by tet. Apart from the numbers
//! of a tet, the check shares no code with the update by patches. Cost: reads all arrays, O(tets).

use incise_graph::Schedule;
use incise_xpbd::OrderedTet;

use super::GpuSolver;
use super::gpu_types::NUMBERS;
use super::layout::{ClusterMapping, THREADS, in_order};
use super::tile::number_count;
use crate::GpuError;

/// The data of the device, read back.
struct Copy {
    particles: Vec<[f32; 4]>,
    corners: Vec<[u32; 4]>,
    rest: Vec<f32>,
    constants: Vec<[f32; 4]>,
    tiles: Vec<u32>,
    lists: Vec<u32>,
    ranges: Vec<u32>,
}

impl GpuSolver {
    /// Checks that the data of the next step with this schedule equal schedule, tets and masses, bit for bit, and that
    /// every cluster is solved once, in the order of its color. O(tets); for tests and on request.
    ///
    /// # Errors
    /// [`GpuError::Inconsistent`] with the first difference, also if a change was not yet [sent](GpuSolver::send).
    pub fn check(&self, schedule: &Schedule) -> Result<(), GpuError> {
        let (gpu, body) = (&*self.gpu, &self.body);
        let copy = Copy {
            particles: body.particles.read(gpu)?,
            corners: body.corners.read(gpu)?,
            rest: body.rest.read(gpu)?,
            constants: body.constants.read(gpu)?,
            tiles: body.tiles.read(gpu)?,
            lists: body.colors.lists.array.read(gpu)?,
            ranges: body.colors.ranges.array.read(gpu)?,
        };
        self.check_particles(&copy)?;
        if let Some(contacts) = &body.contacts {
            contacts.check(gpu, &self.host)?;
        }
        for color in 0..schedule.color_count() {
            for &cluster in schedule.clusters(color) {
                let tets = schedule.constraints(cluster);
                let ordered = match self.cluster_mapping() {
                    ClusterMapping::Threads => self.host.solving_order(tets),
                    ClusterMapping::Workgroups => tets.iter().copied().map(in_order).collect(),
                };
                for &tet in &ordered {
                    self.check_tet(tet, &copy)?;
                }
                if self.cluster_mapping() == ClusterMapping::Threads {
                    self.check_cluster(&ordered)?;
                }
            }
        }
        self.check_order(schedule, &copy)
    }

    fn check_particles(&self, copy: &Copy) -> Result<(), GpuError> {
        if copy.particles.len() != self.host.particle_count() {
            return differs("the number of particles");
        }
        for (p, particle) in copy.particles.iter().enumerate() {
            let ([.., weight], _) = self.host.particle_data(p);
            if particle[3] != weight {
                return differs(&format!("the mass of particle {p}"));
            }
        }
        Ok(())
    }

    /// Whether a thread solves the tets of a cluster in this order.
    fn check_cluster(&self, ordered: &[OrderedTet]) -> Result<(), GpuError> {
        let tet_slot = |tet: OrderedTet| self.body.layout.tet_slot(tet.tet as usize);
        let first = ordered.first().and_then(|&tet| tet_slot(tet));
        for (k, &tet) in ordered.iter().enumerate() {
            if tet_slot(tet) != first.map(|first| first + k * THREADS) {
                return differs(&format!("the order of tet {}", tet.tet));
            }
        }
        Ok(())
    }

    fn check_tet(&self, ordered: OrderedTet, copy: &Copy) -> Result<(), GpuError> {
        let wrong = |what| differs(&format!("{what} of tet {}", ordered.tet));
        let Some(tet_slot) = self.body.layout.tet_slot(ordered.tet as usize) else {
            return wrong("the tet_slot");
        };
        let data = self.host.ordered_tet_data(ordered);
        let mut corners = copy.corners[tet_slot];
        if self.cluster_mapping() == ClusterMapping::Workgroups {
            let room = self.body.layout.depth();
            let list = tet_slot / room * number_count(room) + 2 + room;
            corners = corners.map(|p| copy.tiles[list + p as usize]);
        }
        if corners != data.corners {
            return wrong("the corners");
        }
        let start = tet_slot / THREADS * THREADS * NUMBERS + tet_slot % THREADS;
        for (k, number) in data.rest.iter().enumerate() {
            if copy.rest[start + k * THREADS].to_bits() != number.to_bits() {
                return wrong("the rest shape");
            }
        }
        if !self.host.is_uniform() && copy.constants[tet_slot][..3] != data.constants {
            return wrong("the material");
        }
        Ok(())
    }

    /// Visits the dispatches in the order of the device and checks when each tet is solved.
    fn check_order(&self, schedule: &Schedule, copy: &Copy) -> Result<(), GpuError> {
        // Colors without clusters have no dispatch.
        let colors = (0..schedule.color_count()).filter(|&c| !schedule.clusters(c).is_empty());
        let mut turn = vec![None; self.host.tet_count()];
        for (tet_slot, color) in colors.enumerate() {
            for tet in schedule.color_constraints(color) {
                turn[tet as usize] = Some(tet_slot);
            }
        }
        let mut now = 0;
        for run in &self.body.colors.runs {
            let at = run.offset as usize / size_of::<u32>();
            let [first, count] = [copy.ranges[at], copy.ranges[at + 1]].map(|n| n as usize);
            let groups = &copy.lists[first..first + count];
            for groups in groups.chunks(if run.tail { 1 } else { count }) {
                for tet_slot in groups.iter().flat_map(|&group| self.tet_slots(group, copy)) {
                    let tet = self.body.layout.tet(tet_slot).tet as usize;
                    if turn[tet].take() != Some(now) {
                        return differs(&format!("when tet {tet} is solved"));
                    }
                }
                now += 1;
            }
        }
        match turn.iter().position(Option::is_some) {
            Some(tet) => differs(&format!("that tet {tet} is not solved, which")),
            None => self.check_steps(copy),
        }
    }

    /// The slots of a group that have a tet.
    fn tet_slots(&self, group: u32, copy: &Copy) -> Vec<usize> {
        let group = group as usize;
        match self.cluster_mapping() {
            ClusterMapping::Threads => {
                let tet_slots = self.body.layout.depth() * THREADS;
                let all = group * tet_slots..(group + 1) * tet_slots;
                all.filter(|&p| copy.corners[p][0] != copy.corners[p][1])
                    .collect()
            }
            ClusterMapping::Workgroups => {
                let room = self.body.layout.depth();
                let (steps, ends) = steps(group, room, copy);
                let count = if steps == 0 {
                    0
                } else {
                    ends[steps - 1] as usize
                };
                (group * room..group * room + count).collect()
            }
        }
    }

    /// Checks that the tets of a step share no particle.
    fn check_steps(&self, copy: &Copy) -> Result<(), GpuError> {
        if self.cluster_mapping() == ClusterMapping::Threads {
            return Ok(());
        }
        let slots = &self.body.layout.slots;
        let room = self.body.layout.depth();
        for tile in 0..slots.slot_count() {
            // Data of a tile without cluster are outdated.
            if u32::try_from(tile).is_ok_and(|slot| slots.cluster(slot).is_none()) {
                continue;
            }
            let (steps, ends) = steps(tile, room, copy);
            let mut start = 0;
            for &end in &ends[..steps] {
                let tets = tile * room + start..tile * room + end as usize;
                let mut corners: Vec<u32> = copy.corners[tets].iter().flatten().copied().collect();
                let count = corners.len();
                corners.sort_unstable();
                corners.dedup();
                if corners.len() != count {
                    return differs(&format!("a step of tile {tile}"));
                }
                start = end as usize;
            }
        }
        Ok(())
    }
}

/// The number of steps of a tile, and their ends.
fn steps(tile: usize, room: usize, copy: &Copy) -> (usize, &[u32]) {
    let header = tile * number_count(room);
    let ends = &copy.tiles[header + 2..header + 2 + room];
    (copy.tiles[header] as usize, ends)
}

pub(crate) fn differs(what: &str) -> Result<(), GpuError> {
    Err(GpuError::Inconsistent {
        what: what.to_owned(),
    })
}
