//! The proof that a layout is what its schedule and its tets say, to the bit.

use incise_graph::{ClusterId, Schedule};

use super::{CONSTANTS, Ingredients, Layout, REST, Usage};
use crate::{Float, XpbdError};

impl<R: Float> Layout<R> {
    /// Compares with the schedule that was followed and with the tets as they are. O(tets).
    pub(crate) fn check(
        &self,
        schedule: &Schedule,
        ingredients: impl Fn(u32) -> Ingredients<R>,
    ) -> Result<(), XpbdError> {
        let wrong = |what, number: usize| Err(XpbdError::Layout { what, number });
        // The color of each block; and no two groups on one.
        let mut owners = vec![usize::MAX; self.block_count()];
        let mut usages = vec![Usage::NONE; self.color_count()];
        if self.color_count() != schedule.color_count() {
            return wrong("number of colors", self.color_count());
        }
        for (color, usage) in usages.iter_mut().enumerate() {
            for (place, &group) in (0..).zip(self.groups(color)) {
                let known = self.groups[group as usize];
                if (known.color as usize, known.place) != (color, place) || known.occupied == 0 {
                    return wrong("group", group as usize);
                }
                for block in self.blocks(group) {
                    if std::mem::replace(&mut owners[block], color) != usize::MAX {
                        return wrong("block", block);
                    }
                }
                usage.blocks += known.depth;
            }
        }
        let (mut tets, mut taken) = (0, vec![0_u16; self.groups.len()]);
        for (color, usage) in usages.iter_mut().enumerate() {
            for &cluster in schedule.clusters(color) {
                let members = schedule.constraints(cluster);
                if !self.has_seat(cluster, color, members.len(), &mut taken) {
                    return wrong("cluster", cluster.index());
                }
                let (group, lane) = self.seat(cluster).unwrap_or_default();
                let first = self.groups[group].first as usize;
                for (block, &tet) in (first..).zip(members) {
                    if !self.holds(block, lane, tet, &ingredients(tet)) {
                        return wrong("tet", tet as usize);
                    }
                }
                usage.tets += u32::try_from(members.len()).unwrap_or(u32::MAX);
                tets += members.len();
            }
            let known = self.usages[color];
            if (known.tets, known.blocks) != (usage.tets, usage.blocks)
                || known.is_wasteful(self.lanes)
            {
                return wrong("color", color);
            }
        }
        // Each tet has been found in a lane of its own; nothing else is solved.
        let active: u32 = self.active.iter().map(|lanes| lanes.count_ones()).sum();
        if active as usize != tets {
            return wrong("number of active lanes", active as usize);
        }
        let occupied = self.groups.iter().map(|group| group.occupied);
        match occupied
            .zip(taken)
            .position(|(known, found)| known != found)
        {
            Some(group) => wrong("group", group),
            None => Ok(()),
        }
    }

    /// Whether a cluster has a lane for itself in its color, with blocks enough.
    fn has_seat(&self, cluster: ClusterId, color: usize, length: usize, taken: &mut [u16]) -> bool {
        let Some((group, lane)) = self.seat(cluster) else {
            return false;
        };
        let alone = taken[group] & (1 << lane) == 0;
        taken[group] |= 1 << lane;
        let group = self.groups[group];
        alone && group.color as usize == color && length <= group.depth as usize
    }

    /// Whether a lane has a tet, as it is now.
    fn holds(&self, block: usize, lane: usize, tet: u32, now: &Ingredients<R>) -> bool {
        let lanes = self.lanes;
        let place = block * lanes + lane;
        let same = |a: R, b: R| a.to_f64().to_bits() == b.to_f64().to_bits();
        let rest = now.rest().into_iter().enumerate();
        let constants = now.constants.into_iter().enumerate();
        self.active[block] & (1 << lane) != 0
            && self.tets[place] == tet
            && self.place(tet as usize) == Some((block, lane))
            && self.particles[place] == now.tet.particles
            && rest.fold(true, |held, (k, value)| {
                held && same(self.rest[(block * REST + k) * lanes + lane], value)
            })
            && constants.fold(true, |held, (k, value)| {
                let known = match self.uniform {
                    true => self.constant[k],
                    false => self.constants[(block * CONSTANTS + k) * lanes + lane],
                };
                held && same(known, value)
            })
    }
}
