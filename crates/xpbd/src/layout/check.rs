//! Checks that a layout agrees bit for bit with its schedule and tets.

use std::collections::HashMap;

use incise_graph::{ClusterId, Schedule};

use super::groups::Usage;
use super::order::ClusterOrder;
use super::{Ingredients, Layout};
use crate::{Float, XpbdError};

impl<R: Float> Layout<R> {
    /// Compares with the schedule of the last update and with the tets as they are. O(tets).
    pub(crate) fn check(
        &self,
        schedule: &Schedule,
        ingredients: impl Fn(u32) -> Ingredients<R>,
    ) -> Result<(), XpbdError> {
        let wrong = |what, number: usize| Err(XpbdError::Layout { what, number });
        // The color of each block; and no two groups on one.
        let mut owners = vec![usize::MAX; self.blocks.len()];
        let mut usages = vec![Usage::NONE; self.color_count()];
        if self.color_count() != schedule.color_count() {
            return wrong("number of colors", self.color_count());
        }
        for (color, usage) in usages.iter_mut().enumerate() {
            for &group in self.groups_of(color) {
                let known = self.groups.lanes.group(group as usize);
                if known.color as usize != color || known.occupied == 0 {
                    return wrong("group", group as usize);
                }
                for block in self.blocks_of(group) {
                    if std::mem::replace(&mut owners[block], color) != usize::MAX {
                        return wrong("block", block);
                    }
                }
                usage.blocks += known.depth;
            }
        }
        let mut order = ClusterOrder::default();
        let (mut tets, mut taken) = (0, vec![0_u64; self.groups.lanes.group_count()]);
        for (color, usage) in usages.iter_mut().enumerate() {
            for &cluster in schedule.clusters(color) {
                let members = schedule.constraints(cluster);
                if !self.has_slot(cluster, color, members.len(), &mut taken) {
                    return wrong("cluster", cluster.index());
                }
                let (group, lane) = self.groups.lanes.slot(cluster).unwrap_or_default();
                let ordered = order.of(members, |tet| ingredients(tet).tet.particles);
                for (block, &ordered) in self.groups.blocks(group).zip(ordered) {
                    let (slot, tet) = (block * self.blocks.lanes + lane, ordered.tet as usize);
                    if self.slot(tet) != Some((block, lane))
                        || !self.blocks.has(slot, ordered, &ingredients(ordered.tet))
                        || !self.blocks.corners_of(slot).into_iter().all(|i| {
                            self.places
                                .has(self.blocks.corners[i], self.blocks.places[i])
                        })
                    {
                        return wrong("tet", tet);
                    }
                }
                if !self.moves_right_corners(group, lane, |tet| ingredients(tet).tet.particles) {
                    return wrong("corners of cluster", cluster.index());
                }
                usage.tets += u32::try_from(members.len()).unwrap_or(u32::MAX);
                tets += members.len();
            }
            let known = self.groups.usages[color];
            if (known.tets, known.blocks) != (usage.tets, usage.blocks)
                || known.is_wasteful(self.blocks.lanes)
            {
                return wrong("color", color);
            }
        }
        // Each tet has been found in a lane of its own; nothing else is solved or moved.
        let empty = |slot: &usize| {
            let (block, lane) = (slot / self.blocks.lanes, slot % self.blocks.lanes);
            self.blocks.active[block] & (1 << lane) == 0
        };
        let mut slots = (0..self.blocks.tets.len()).filter(empty);
        let moves = |&slot: &usize| {
            let at = self.blocks.corners_of(slot);
            at.into_iter()
                .any(|i| self.blocks.is_changed(i) || self.blocks.corners[i] != 0)
        };
        if let Some(slot) = slots.find(moves) {
            return wrong("lane without a tet", slot);
        }
        let active: u32 = self
            .blocks
            .active
            .iter()
            .map(|lanes| lanes.count_ones())
            .sum();
        if active as usize != tets {
            return wrong("number of active lanes", active as usize);
        }
        let groups = 0..self.groups.lanes.group_count();
        let occupied = groups.map(|group| self.groups.lanes.group(group).occupied);
        match occupied
            .zip(taken)
            .position(|(known, found)| known != found)
        {
            Some(group) => wrong("group", group),
            None => Ok(()),
        }
    }

    /// Whether a kernel that moves corners by the masks of a lane gives each tet its corners as the tets before left them,
    /// and all of them back to the particles.
    fn moves_right_corners(
        &self,
        group: usize,
        lane: usize,
        corners: impl Fn(u32) -> [u32; 4],
    ) -> bool {
        let blocks = &self.blocks;
        let is_active = |block: usize| blocks.active[block] & (1 << lane) != 0;
        let range = self.groups.blocks(group);
        // Particle -> one plus the block that moved it last, as memory has it and as it is.
        let (mut memory, mut latest) = (HashMap::new(), HashMap::new());
        let mut held = [None; 4];
        for block in range.clone() {
            let slot = block * blocks.lanes + lane;
            let at = blocks.corners_of(slot);
            let is_changed = at.map(|i| blocks.is_changed(i));
            if is_changed != [false; 4] && (block == range.start || !is_active(block)) {
                return false;
            }
            let is_other = |k: usize| held[k].is_some_and(|(p, _)| p != blocks.corners[at[k]]);
            if is_active(block) && (0..4).any(|k| is_other(k) != is_changed[k]) {
                return false;
            }
            let comes = |k: usize| is_changed[k] || block == range.start;
            let leaving = (0..4).filter(|&k| comes(k)).filter_map(|k| held[k]);
            memory.extend(leaving);
            for k in (0..4).filter(|&k| comes(k)) {
                let particle = blocks.corners[at[k]];
                held[k] = Some((particle, memory.get(&particle).copied().unwrap_or(0)));
            }
            if !is_active(block) {
                continue;
            }
            let mut own = corners(blocks.tets[slot]);
            let mut found = held.map(|held| held.map_or(u32::MAX, |(particle, _)| particle));
            own.sort_unstable();
            found.sort_unstable();
            let mut known = held.iter().flatten();
            if own != found
                || !known
                    .all(|(particle, time)| *time == latest.get(particle).copied().unwrap_or(0))
            {
                return false;
            }
            for (particle, time) in held.iter_mut().flatten() {
                *time = block + 1;
                latest.insert(*particle, *time);
            }
            if block + 1 == range.end || !is_active(block + 1) {
                memory.extend(held.iter().flatten().copied());
            }
        }
        memory == latest
    }

    /// Whether a cluster has a lane for itself in its color, with blocks enough.
    fn has_slot(&self, cluster: ClusterId, color: usize, length: usize, taken: &mut [u64]) -> bool {
        let Some((group, lane)) = self.groups.lanes.slot(cluster) else {
            return false;
        };
        let alone = taken[group] & (1 << lane) == 0;
        taken[group] |= 1 << lane;
        let group = self.groups.lanes.group(group);
        alone && group.color as usize == color && length <= group.depth as usize
    }
}
