//! Checks that a layout agrees bit for bit with its schedule and tets.

use incise_graph::{ClusterId, Schedule};

use super::groups::Usage;
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
        let (mut tets, mut taken) = (0, vec![0_u64; self.groups.lanes.group_count()]);
        for (color, usage) in usages.iter_mut().enumerate() {
            for &cluster in schedule.clusters(color) {
                let members = schedule.constraints(cluster);
                if !self.has_slot(cluster, color, members.len(), &mut taken) {
                    return wrong("cluster", cluster.index());
                }
                let (group, lane) = self.groups.lanes.slot(cluster).unwrap_or_default();
                for (block, &tet) in self.groups.blocks(group).zip(members) {
                    let slot = block * self.blocks.lanes + lane;
                    if self.slot(tet as usize) != Some((block, lane))
                        || !self.blocks.has(slot, tet, &ingredients(tet))
                        || !(0..4).all(|k| {
                            let corner = self.blocks.particles[slot][k];
                            self.places.has(corner, self.blocks.places[slot][k])
                        })
                    {
                        return wrong("tet", tet as usize);
                    }
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
        // Each tet has been found in a lane of its own; nothing else is solved.
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
