//! Builds a layout and updates it with its schedule.
//!
//! New groups take the clusters of a color by size, so that few lanes are idle, and those of one size by place, so that
//! each thread solves one part of space. Later a changed cluster stays in its lane if its color is the same and its group
//! has enough blocks. Otherwise it goes to the group of its color that was opened last, or opens one.
//!
//! Where nothing has changed for some frames, one color a frame is rebuilt that has a sixteenth more blocks than it needs, until
//! none has: cuts leave a third of the lanes idle.
//!
//! Bounds: a color is rebuilt if its blocks exceed three halves of what a rebuilt one can need; all is rebuilt if
//! groups without clusters have half of all blocks. Both rebuilds cost at most what caused them, up to a factor of the
//! lanes times the size of a cluster.

use std::cmp::Reverse;

use glam::DVec3;
use incise_graph::{ClusterId, LaneGroup, Schedule};

use super::groups::Usage;
use super::{Ingredients, Layout, NONE, index};
use crate::Float;

/// Calls without a change before colors are rebuilt that have some blocks too many: cuts go on for a while.
pub(super) const CALM: u32 = 4;
/// A color is rebuilt in calm frames if one of so many blocks too many is there.
pub(super) const SPARE: usize = 16;

impl<R: Float> Layout<R> {
    /// Makes this the layout of a schedule; returns how many tets were filled in. `uniform` says that all tets have the
    /// same constants; `positions` gives those of all particles, if all is rebuilt.
    pub(crate) fn update(
        &mut self,
        schedule: &Schedule,
        lanes: usize,
        uniform: bool,
        positions: impl Fn() -> Vec<DVec3>,
        ingredients: impl Fn(u32) -> Ingredients<R>,
    ) -> usize {
        let _span = tracing::debug_span!("xpbd::layout").entered();
        let revision = self.revision;
        let changes = revision.and_then(|revision| schedule.changes_since(revision));
        let mut filled = match changes {
            Some(changes) => self.patch(schedule, changes, &ingredients),
            None => self.rebuild(schedule, lanes, uniform, &positions(), &ingredients),
        };
        if 2 * self.groups.free_blocks > self.blocks.len() {
            filled += self.rebuild(schedule, lanes, uniform, &positions(), &ingredients);
        }
        self.revision = Some(schedule.revision());
        filled
    }

    fn rebuild(
        &mut self,
        schedule: &Schedule,
        lanes: usize,
        uniform: bool,
        positions: &[DVec3],
        ingredients: &impl Fn(u32) -> Ingredients<R>,
    ) -> usize {
        self.places.reset(positions);
        self.blocks.reset(lanes, uniform);
        self.groups.reset(lanes, schedule.color_count());
        self.slots.clear();
        self.dirty.clear();
        self.marked.clear();
        (0..schedule.color_count())
            .map(|color| self.build_color(color, schedule, ingredients))
            .sum()
    }

    /// Applies the changes of clusters and the marks of tets.
    fn patch(
        &mut self,
        schedule: &Schedule,
        changes: &[ClusterId],
        ingredients: &impl Fn(u32) -> Ingredients<R>,
    ) -> usize {
        let colors = self.color_count().max(schedule.color_count());
        self.groups.set_color_count(colors);
        let mut changed = std::mem::take(&mut self.clusters);
        changed.clear();
        changed.extend_from_slice(changes);
        changed.sort_unstable();
        changed.dedup();

        // First all lanes are emptied, since tets may have gone from one cluster to another.
        let mut touched = Vec::new();
        for &cluster in &changed {
            let Some((group, _)) = self.groups.lanes.slot(cluster) else {
                continue;
            };
            self.empty(cluster);
            let LaneGroup { color, depth, .. } = *self.groups.lanes.group(group);
            touched.push(color as usize);
            let stays = schedule.color(cluster).is_some_and(|c| c.0 == color);
            if !stays || schedule.constraints(cluster).len() > depth as usize {
                self.groups.release(cluster);
            }
        }
        let mut filled = 0;
        let mut unassigned = Vec::new();
        for &cluster in &changed {
            let Some(color) = schedule.color(cluster) else {
                continue;
            };
            if self.groups.lanes.slot(cluster).is_some() {
                filled += self.fill_lane(cluster, schedule, ingredients);
            } else {
                let length = schedule.constraints(cluster).len();
                unassigned.push((color.index(), Reverse(length), cluster));
            }
        }
        unassigned.sort_unstable();
        for &(color, Reverse(length), cluster) in &unassigned {
            touched.push(color);
            let with_room = self.groups.with_room(color, length);
            let group = with_room.unwrap_or_else(|| self.open(color, length));
            self.groups.lanes.assign(cluster, group);
            filled += self.fill_lane(cluster, schedule, ingredients);
        }
        self.clusters = changed;

        let mut dirty = std::mem::take(&mut self.dirty);
        for tet in dirty.drain(..) {
            if std::mem::take(&mut self.marked[tet as usize]) {
                let slot = self.slots[tet as usize];
                if slot == NONE {
                    continue;
                }
                let now = ingredients(tet);
                if self.blocks.has_corners(slot as usize, now.tet.particles) {
                    self.blocks.fill(slot as usize, &now);
                    filled += 1;
                } else if let Some(cluster) = schedule.cluster(tet as usize) {
                    // Other corners may give its cluster another order.
                    self.empty(cluster);
                    filled += self.fill_lane(cluster, schedule, ingredients);
                }
            }
        }
        self.dirty = dirty;

        touched.sort_unstable();
        touched.dedup();
        for color in touched {
            if self.groups.usages[color].is_wasteful(self.blocks.lanes) {
                filled += self.rebuild_color(color, schedule, ingredients);
            } else {
                self.groups.usages[color].is_settled = false;
            }
        }
        self.calm = 0;
        self.groups.set_color_count(schedule.color_count());
        self.groups.lanes.tidy();
        filled
    }

    /// Rebuilds a color that has more blocks than it needs, after some calls without a change; returns how many tets were
    /// filled in.
    pub(crate) fn compact(
        &mut self,
        schedule: &Schedule,
        ingredients: impl Fn(u32) -> Ingredients<R>,
    ) -> usize {
        self.calm = self.calm.saturating_add(1);
        if self.calm < CALM {
            return 0;
        }
        for color in 0..schedule.color_count() {
            if self.groups.usages[color].is_settled {
                continue;
            }
            let needed = self.blocks_needed(schedule.clusters(color), schedule);
            if SPARE * self.block_count_of(color) > (SPARE + 1) * needed {
                return self.rebuild_color(color, schedule, &ingredients);
            }
            self.groups.usages[color].is_settled = true;
        }
        0
    }

    /// The blocks of clusters that are put into groups by size.
    pub(super) fn blocks_needed(&mut self, clusters: &[ClusterId], schedule: &Schedule) -> usize {
        let mut by_size = std::mem::take(&mut self.clusters);
        by_size.clear();
        by_size.extend_from_slice(clusters);
        let size = |cluster: ClusterId| schedule.constraints(cluster).len();
        by_size.sort_unstable_by_key(|&cluster| Reverse(size(cluster)));
        let groups = by_size.chunks(self.blocks.lanes);
        let blocks = groups.map(|group| size(group[0])).sum();
        self.clusters = by_size;
        blocks
    }

    /// Removes the groups of a color and makes new ones.
    fn rebuild_color(
        &mut self,
        color: usize,
        schedule: &Schedule,
        ingredients: &impl Fn(u32) -> Ingredients<R>,
    ) -> usize {
        self.close_color(color, schedule);
        let filled = self.build_color(color, schedule, ingredients);
        self.groups.lanes.tidy();
        filled
    }

    /// Makes groups of the clusters of a color, which has none.
    fn build_color(
        &mut self,
        color: usize,
        schedule: &Schedule,
        ingredients: &impl Fn(u32) -> Ingredients<R>,
    ) -> usize {
        let mut clusters = std::mem::take(&mut self.clusters);
        clusters.clear();
        clusters.extend_from_slice(schedule.clusters(color));
        clusters.sort_by_cached_key(|&cluster| {
            let tets = schedule.constraints(cluster);
            let corner = tets.first().map(|&tet| ingredients(tet).tet.particles[0]);
            let place = corner.map(|corner| self.places.place(corner));
            (Reverse(tets.len()), place)
        });
        let mut filled = 0;
        for together in clusters.chunks(self.blocks.lanes) {
            let group = self.open(color, schedule.constraints(together[0]).len());
            for &cluster in together {
                self.groups.lanes.assign(cluster, group);
                filled += self.fill_lane(cluster, schedule, ingredients);
            }
        }
        self.clusters = clusters;
        filled
    }

    /// Adds a group of so many blocks to a color.
    fn open(&mut self, color: usize, depth: usize) -> usize {
        let group = self.groups.open(color, depth, self.blocks.len());
        let end = self.groups.blocks(group).end;
        self.blocks.grow(end.max(self.blocks.len()));
        group
    }

    /// Fills in the tets of a cluster that has an empty lane.
    fn fill_lane(
        &mut self,
        cluster: ClusterId,
        schedule: &Schedule,
        ingredients: &impl Fn(u32) -> Ingredients<R>,
    ) -> usize {
        let (group, lane) = self.groups.lanes.slot(cluster).expect("it has a lane");
        let (blocks, color) = (
            self.groups.blocks(group),
            self.groups.lanes.group(group).color,
        );
        let tets = schedule.constraints(cluster);
        let first = blocks.start;
        let order = self.order.of(tets, |tet| ingredients(tet).tet.particles);
        for (block, &ordered) in blocks.zip(order) {
            let slot = block * self.blocks.lanes + lane;
            let tet = ordered.tet as usize;
            if self.slots.len() <= tet {
                self.slots.resize(tet + 1, NONE);
                self.marked.resize(tet + 1, false);
            }
            self.slots[tet] = index(slot);
            self.marked[tet] = false;
            let ingredients = ingredients(ordered.tet);
            self.blocks.put(
                slot,
                ordered,
                block == first,
                &ingredients,
                &mut self.places,
            );
        }
        self.groups.usages[color as usize].tets += index(tets.len());
        tets.len()
    }

    /// Removes the tets of a cluster from its lane.
    fn empty(&mut self, cluster: ClusterId) {
        let (group, lane) = self.groups.lanes.slot(cluster).expect("it has a lane");
        let color = self.groups.lanes.group(group).color;
        for block in self.groups.blocks(group) {
            if self.blocks.active[block] & (1 << lane) == 0 {
                break;
            }
            let slot = block * self.blocks.lanes + lane;
            self.blocks.clear(slot);
            self.slots[self.blocks.tets[slot] as usize] = NONE;
            self.groups.usages[color as usize].tets -= 1;
        }
    }

    /// Removes all groups of a color.
    fn close_color(&mut self, color: usize, schedule: &Schedule) {
        for &cluster in schedule.clusters(color) {
            self.empty(cluster);
            self.groups.release(cluster);
        }
        self.groups.usages[color] = Usage::NONE;
    }
}
