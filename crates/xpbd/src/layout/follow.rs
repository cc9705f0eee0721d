//! How a layout is made and how it follows its schedule.
//!
//! New groups take the clusters of a color by size, so that few lanes wait. Later a changed cluster stays in its lane if
//! its color is the same and its group has blocks enough; else it goes to the group of its color that was opened last,
//! or opens one. Groups keep their blocks wherever those lie; one without clusters waits for another of its length.
//!
//! Bounds: a color whose blocks exceed three halves of what forming them anew can need has that done; if groups without
//! clusters come to have half of all blocks, all is made anew. Both undo at least as much as they cost, up to a factor
//! of the lanes times the size of a cluster.

use std::cmp::Reverse;

use incise_graph::{ClusterId, Schedule};

use super::{CONSTANTS, Group, Ingredients, Layout, NONE, REST, Usage, index};
use crate::Float;

impl<R: Float> Layout<R> {
    /// Makes this the layout of a schedule; returns how many tets were filled in. `uniform` says that all tets have the
    /// same constants.
    pub(crate) fn follow(
        &mut self,
        schedule: &Schedule,
        lanes: usize,
        uniform: bool,
        ingredients: impl Fn(u32) -> Ingredients<R>,
    ) -> usize {
        let _span = tracing::debug_span!("xpbd::layout").entered();
        let revision = self.revision;
        let changes = revision.and_then(|revision| schedule.changes_since(revision));
        let mut filled = match changes {
            Some(changes) => self.patch(schedule, changes, &ingredients),
            None => self.rebuild(schedule, lanes, uniform, &ingredients),
        };
        if 2 * self.free_blocks > self.block_count() {
            filled += self.rebuild(schedule, lanes, uniform, &ingredients);
        }
        self.revision = Some(schedule.revision());
        filled
    }

    /// Makes all anew.
    fn rebuild(
        &mut self,
        schedule: &Schedule,
        lanes: usize,
        uniform: bool,
        ingredients: &impl Fn(u32) -> Ingredients<R>,
    ) -> usize {
        self.lanes = lanes;
        self.uniform = uniform;
        self.colors
            .refill(schedule.color_count(), std::iter::empty());
        self.usages.clear();
        self.usages.resize(schedule.color_count(), Usage::NONE);
        self.groups.clear();
        self.free.refill(0, std::iter::empty());
        self.free_blocks = 0;
        self.active.clear();
        self.particles.clear();
        self.tets.clear();
        self.rest.clear();
        self.constants.clear();
        self.places.clear();
        self.seats.clear();
        self.dirty.clear();
        self.marked.clear();
        (0..schedule.color_count())
            .map(|color| self.form(color, schedule, ingredients))
            .sum()
    }

    /// Takes over what has changed.
    fn patch(
        &mut self,
        schedule: &Schedule,
        changes: &[ClusterId],
        ingredients: &impl Fn(u32) -> Ingredients<R>,
    ) -> usize {
        let colors = self.colors.row_count().max(schedule.color_count());
        self.colors.set_row_count(colors);
        self.usages.resize(colors, Usage::NONE);
        let mut changed = std::mem::take(&mut self.clusters);
        changed.clear();
        changed.extend_from_slice(changes);
        changed.sort_unstable();
        changed.dedup();

        // First everybody leaves, since tets may have gone from one cluster to another.
        let mut touched = Vec::new();
        for &cluster in &changed {
            let Some((group, _)) = self.seat(cluster) else {
                continue;
            };
            self.empty(cluster);
            let Group { color, depth, .. } = self.groups[group];
            touched.push(color as usize);
            let stays = schedule.color(cluster).is_some_and(|c| c.0 == color);
            if !stays || schedule.constraints(cluster).len() > depth as usize {
                self.unseat(cluster);
            }
        }
        let mut filled = 0;
        let mut homeless = Vec::new();
        for &cluster in &changed {
            let Some(color) = schedule.color(cluster) else {
                continue;
            };
            if self.seat(cluster).is_some() {
                filled += self.fill_lane(cluster, schedule, ingredients);
            } else {
                let length = schedule.constraints(cluster).len();
                homeless.push((color.index(), Reverse(length), cluster));
            }
        }
        homeless.sort_unstable();
        for &(color, Reverse(length), cluster) in &homeless {
            touched.push(color);
            let open = self.usages[color].open;
            let fits = self.groups.get(open as usize).is_some_and(|group| {
                group.depth as usize >= length && self.free_lane(group).is_some()
            });
            let group = if fits {
                open as usize
            } else {
                self.open(color, length)
            };
            filled += self.sit(cluster, group, schedule, ingredients);
        }
        self.clusters = changed;

        let mut dirty = std::mem::take(&mut self.dirty);
        for tet in dirty.drain(..) {
            if std::mem::take(&mut self.marked[tet as usize]) {
                let place = self.places[tet as usize];
                if place != NONE {
                    self.fill(place as usize, tet, &ingredients(tet));
                    filled += 1;
                }
            }
        }
        self.dirty = dirty;

        touched.sort_unstable();
        touched.dedup();
        for color in touched {
            if self.usages[color].is_wasteful(self.lanes) {
                self.close_all(color, schedule);
                filled += self.form(color, schedule, ingredients);
            }
        }
        self.colors.set_row_count(schedule.color_count());
        self.usages.truncate(schedule.color_count());
        self.colors.tidy();
        self.free.tidy();
        filled
    }

    /// Makes groups of the clusters of a color, which has none.
    fn form(
        &mut self,
        color: usize,
        schedule: &Schedule,
        ingredients: &impl Fn(u32) -> Ingredients<R>,
    ) -> usize {
        let mut clusters = std::mem::take(&mut self.clusters);
        clusters.clear();
        clusters.extend_from_slice(schedule.clusters(color));
        clusters.sort_by_key(|&cluster| Reverse(schedule.constraints(cluster).len()));
        let mut filled = 0;
        for together in clusters.chunks(self.lanes) {
            let group = self.open(color, schedule.constraints(together[0]).len());
            for &cluster in together {
                filled += self.sit(cluster, group, schedule, ingredients);
            }
        }
        self.clusters = clusters;
        filled
    }

    /// Adds a group of so many blocks to a color.
    fn open(&mut self, color: usize, depth: usize) -> usize {
        let waiting = (depth < self.free.row_count()).then(|| self.free.pop(depth));
        let (number, first) = match waiting.flatten() {
            Some(number) => {
                self.free_blocks -= depth;
                (number as usize, self.groups[number as usize].first)
            }
            None => {
                let blocks = self.active.len() + depth;
                let first = index(self.active.len());
                self.active.resize(blocks, 0);
                self.particles.resize(blocks * self.lanes, [0; 4]);
                self.tets.resize(blocks * self.lanes, NONE);
                self.rest.resize(blocks * self.lanes * REST, R::ZERO);
                if !self.uniform {
                    let numbers = blocks * self.lanes * CONSTANTS;
                    self.constants.resize(numbers, R::ZERO);
                }
                (self.groups.len(), first)
            }
        };
        let group = Group {
            first,
            depth: index(depth),
            color: index(color),
            place: index(self.colors.row(color).len()),
            occupied: 0,
        };
        if number == self.groups.len() {
            self.groups.push(group);
        } else {
            self.groups[number] = group;
        }
        self.colors.push(color, index(number));
        let usage = &mut self.usages[color];
        usage.blocks += group.depth;
        usage.depth = usage.depth.max(group.depth);
        usage.open = index(number);
        number
    }

    /// The first lane of a group without a cluster.
    fn free_lane(&self, group: &Group) -> Option<usize> {
        let lane = group.occupied.trailing_ones() as usize;
        (lane < self.lanes).then_some(lane)
    }

    /// Group and lane of a cluster.
    pub(super) fn seat(&self, cluster: ClusterId) -> Option<(usize, usize)> {
        let seat = *self.seats.get(cluster.index())?;
        let seat = (seat != NONE).then_some(seat as usize)?;
        Some((seat / self.lanes, seat % self.lanes))
    }

    /// Puts a cluster into a free lane of a group, which has blocks enough.
    fn sit(
        &mut self,
        cluster: ClusterId,
        group: usize,
        schedule: &Schedule,
        ingredients: &impl Fn(u32) -> Ingredients<R>,
    ) -> usize {
        let lane = self.free_lane(&self.groups[group]);
        let lane = lane.expect("groups are opened before they are full");
        self.groups[group].occupied |= 1 << lane;
        if self.seats.len() <= cluster.index() {
            self.seats.resize(cluster.index() + 1, NONE);
        }
        self.seats[cluster.index()] = index(group * self.lanes + lane);
        self.fill_lane(cluster, schedule, ingredients)
    }

    /// Fills in the tets of a cluster that has an empty lane.
    fn fill_lane(
        &mut self,
        cluster: ClusterId,
        schedule: &Schedule,
        ingredients: &impl Fn(u32) -> Ingredients<R>,
    ) -> usize {
        let (group, lane) = self.seat(cluster).expect("it has a lane");
        let Group { first, color, .. } = self.groups[group];
        let tets = schedule.constraints(cluster);
        for (block, &tet) in (first as usize..).zip(tets) {
            let place = block * self.lanes + lane;
            if self.places.len() <= tet as usize {
                self.places.resize(tet as usize + 1, NONE);
                self.marked.resize(tet as usize + 1, false);
            }
            self.active[block] |= 1 << lane;
            self.tets[place] = tet;
            self.places[tet as usize] = index(place);
            self.fill(place, tet, &ingredients(tet));
        }
        self.usages[color as usize].tets += index(tets.len());
        tets.len()
    }

    /// Takes the tets of a cluster out of its lane.
    fn empty(&mut self, cluster: ClusterId) {
        let (group, lane) = self.seat(cluster).expect("it has a lane");
        let color = self.groups[group].color;
        for block in self.blocks(index(group)) {
            if self.active[block] & (1 << lane) == 0 {
                break;
            }
            self.active[block] &= !(1 << lane);
            let place = block * self.lanes + lane;
            // A particle that is there as long as any is.
            self.particles[place] = [0; 4];
            self.places[self.tets[place] as usize] = NONE;
            self.usages[color as usize].tets -= 1;
        }
    }

    /// Takes its lane, which is empty, from a cluster.
    fn unseat(&mut self, cluster: ClusterId) {
        let (group, lane) = self.seat(cluster).expect("it has a lane");
        self.seats[cluster.index()] = NONE;
        self.groups[group].occupied &= !(1 << lane);
        if self.groups[group].occupied == 0 {
            self.close(group);
        }
    }

    /// Takes a group without clusters from its color.
    fn close(&mut self, number: usize) {
        let group = self.groups[number];
        let color = group.color as usize;
        self.colors.swap_remove(color, group.place as usize);
        if let Some(&other) = self.colors.row(color).get(group.place as usize) {
            self.groups[other as usize].place = group.place;
        }
        let usage = &mut self.usages[color];
        usage.blocks -= group.depth;
        if usage.open == index(number) {
            usage.open = NONE;
        }
        let depth = group.depth as usize;
        self.free
            .set_row_count(self.free.row_count().max(depth + 1));
        self.free.push(depth, index(number));
        self.free_blocks += depth;
    }

    /// Takes all groups from a color.
    fn close_all(&mut self, color: usize, schedule: &Schedule) {
        for &cluster in schedule.clusters(color) {
            self.empty(cluster);
            self.unseat(cluster);
        }
        self.usages[color] = Usage::NONE;
    }
}
