//! Chains of moves through classes in between: v from A to B, u from B to C, and so on.
//!
//! A class can give to another if one of its members has no neighbor there. A shortest path in that
//! graph of classes, from a heavy class to a light one, moves one vertex along each step. All of
//! these moves can be made: a vertex enters a class where it has no neighbor, so it has none among
//! those that stay either. If all of them have the same weight w, the classes in between keep their
//! loads, and the sum of squares falls exactly if the light class and w together are lighter than
//! the heavy one.
//!
//! Where that leads to no light class, a *detour* may: v takes the place of its only neighbor u in
//! a class B, and u moves to C. B keeps its load. A chain has at most one detour, and passes by B
//! only there, so that its moves still do not meet.
//!
//! The graph of classes is never built: a search asks the members of the classes that it reaches. Only *loose* vertices
//! are asked, those with a class that none of their neighbors has; they are listed once and updated around every move.
//! In a mesh whose colors are as few as its densest particle allows, loose vertices lie near the border. A failed search
//! proves that no direct moves lead from the classes it has reached before its detours to one light enough for this
//! class, or for a lighter one. Later searches of the round stop there. A round in which all fail costs a question per
//! loose vertex for direct moves, and for detours one per neighbor of its neighbors.

use super::partition::{Members, NONE, Partition};
use super::surroundings::Surroundings;
use super::work::Work;

/// How a chain enters a class.
#[derive(Clone, Copy, Debug)]
struct Step {
    /// The vertex that enters it.
    mover: u32,
    /// The vertex that takes the place of the mover, if it is pushed away, else [`NONE`].
    pusher: u32,
    /// The class of a mover that was pushed away, here or before in the chain, else [`NONE`].
    detour: u32,
}

impl Default for Step {
    fn default() -> Self {
        Self {
            mover: NONE,
            pusher: NONE,
            detour: NONE,
        }
    }
}

/// Arrays of the search, kept between calls.
#[derive(Debug)]
pub(super) struct Chains {
    /// Vertices of positive weight, heavy ones first.
    by_weight: Vec<u32>,
    /// Classes in the order they were reached.
    queue: Vec<u32>,
    /// Class -> how it was reached.
    steps: Vec<Step>,
    /// A bit per class: those reached in this search.
    seen: Vec<u64>,
    /// Those reached by direct moves alone, and `dead`.
    closed: Vec<u64>,
    /// Those from which direct moves lead nowhere in this round.
    dead: Vec<u64>,
    /// Those light enough for the source at hand.
    targets: Vec<u64>,
    /// Those that the vertex at hand cannot or need not enter.
    taken: Vec<u64>,
    /// Neighbors of the vertex at hand that may push it away.
    pushers: Vec<u32>,
    /// Neighbors of a vertex that moved.
    neighbors: Vec<u32>,
}

impl Chains {
    pub(super) fn new(partition: &Partition<'_>) -> Self {
        let words = vec![0; partition.count().div_ceil(64)];
        let ids = (0..)
            .zip(partition.weights)
            .filter(|(_, weight)| **weight > 0);
        let mut by_weight: Vec<u32> = ids.map(|(v, _)| v).collect();
        by_weight.sort_by_key(|&v| std::cmp::Reverse(partition.weights[v as usize]));
        Self {
            by_weight,
            queue: Vec::new(),
            steps: vec![Step::default(); partition.count()],
            seen: words.clone(),
            closed: words.clone(),
            dead: words.clone(),
            targets: words.clone(),
            taken: words,
            pushers: Vec::new(),
            neighbors: Vec::new(),
        }
    }

    /// Follows chains of each weight in turn, heavy ones first, until a round finds none; returns
    /// their number.
    pub(super) fn run(
        &mut self,
        partition: &mut Partition<'_>,
        around: &mut impl Surroundings,
        work: &mut Work,
    ) -> usize {
        let mut members = Members::new(partition.class.len(), partition.count());
        let by_weight = std::mem::take(&mut self.by_weight);
        let mut total = 0;
        let same =
            |a: &u32, b: &u32| partition.weights[*a as usize] == partition.weights[*b as usize];
        for group in by_weight.chunk_by(same) {
            for &v in group {
                if self.is_loose(v, partition, around) {
                    members.link(v, partition.class[v as usize]);
                }
            }
            let weight = u64::from(partition.weights[group[0] as usize]);
            loop {
                let chains = self.round(weight, partition, &mut members, around, work);
                total += chains;
                if chains == 0 {
                    break;
                }
            }
            for &v in group {
                if members.contains(v) {
                    members.unlink(v, partition.class[v as usize]);
                }
            }
        }
        self.by_weight = by_weight;
        total
    }

    /// Searches from every class, heavy ones first, until each has failed.
    fn round(
        &mut self,
        weight: u64,
        partition: &mut Partition<'_>,
        members: &mut Members,
        around: &mut impl Surroundings,
        work: &mut Work,
    ) -> usize {
        let mut chains = 0;
        self.dead.fill(0);
        loop {
            let alive = (0..)
                .zip(&partition.loads)
                .filter(|&(class, _)| !has(&self.dead, class));
            let Some((source, &load)) = alive.max_by_key(|&(class, load)| (load, !class)) else {
                return chains;
            };
            self.targets.fill(0);
            for (class, &other) in (0..).zip(&partition.loads) {
                if other + weight < load {
                    self.targets[class / 64] |= 1 << (class % 64);
                }
            }
            if self.targets.iter().all(|&word| word == 0) {
                return chains;
            }
            if let Some(target) = self.search(source, partition, members, around, work) {
                chains += 1;
                self.shift_along_path(source, target, partition, members, around);
            } else if work.is_spent() {
                return chains;
            } else {
                self.dead.copy_from_slice(&self.closed);
            }
        }
    }

    /// Breadth first from `source` to a target, by direct moves; if there is none, once more from
    /// where detours lead. Of several targets that one vertex can enter, the lightest is found.
    fn search(
        &mut self,
        source: u32,
        partition: &Partition<'_>,
        members: &Members,
        around: &impl Surroundings,
        work: &mut Work,
    ) -> Option<u32> {
        self.seen.copy_from_slice(&self.dead);
        self.seen[source as usize / 64] |= 1 << (source % 64);
        self.queue.clear();
        self.queue.push(source);
        self.steps[source as usize] = Step::default();
        let target = self.search_direct(0, partition, members, around, work);
        if target.is_some() {
            return target;
        }
        self.closed.copy_from_slice(&self.seen);
        let reached = self.queue.len();
        let target = self.search_detours(partition, members, around, work);
        target.or_else(|| self.search_direct(reached, partition, members, around, work))
    }

    /// Follows direct moves from the classes of the queue, beginning at place `at`.
    fn search_direct(
        &mut self,
        mut at: usize,
        partition: &Partition<'_>,
        members: &Members,
        around: &impl Surroundings,
        work: &mut Work,
    ) -> Option<u32> {
        while let Some(&class) = self.queue.get(at) {
            at += 1;
            let detour = self.steps[class as usize].detour;
            for mover in members.of(class) {
                if !work.spend(1) {
                    return None;
                }
                let step = Step {
                    mover,
                    pusher: NONE,
                    detour,
                };
                let target = self.open(step, partition, around);
                if target.is_some() {
                    return target;
                }
            }
        }
        None
    }

    /// Finds what detours reach from the classes of the queue.
    fn search_detours(
        &mut self,
        partition: &Partition<'_>,
        members: &Members,
        around: &impl Surroundings,
        work: &mut Work,
    ) -> Option<u32> {
        let class_of = |v: u32| partition.class[v as usize];
        let weight_of = |v: u32| partition.weights[v as usize];
        let reached = self.closed.iter().zip(&self.dead);
        let reached: Vec<u64> = reached.map(|(closed, dead)| closed & !dead).collect();
        let mut pushers = std::mem::take(&mut self.pushers);
        for (detour, _) in (0..).zip(&partition.loads) {
            // No chain continues from a closed class.
            if has(&self.closed, detour) {
                continue;
            }
            for mover in members.of(detour) {
                pushers.clear();
                around.visit_neighbors(mover, |v| {
                    let class = class_of(v);
                    if class != NONE && has(&reached, class) && weight_of(v) == weight_of(mover) {
                        pushers.push(v);
                    }
                });
                // A graph and its incidence list neighbors in different orders, an incidence some of them twice.
                pushers.sort_unstable();
                pushers.dedup();
                if !work.spend(1 + pushers.len()) {
                    self.pushers = pushers;
                    return None;
                }
                let pusher = pushers.iter().copied().find(|&pusher| {
                    let mut is_sole = true;
                    around.visit_neighbors(pusher, |u| {
                        is_sole &= u == mover || class_of(u) != detour;
                    });
                    is_sole
                });
                if let Some(pusher) = pusher {
                    let step = Step {
                        mover,
                        pusher,
                        detour,
                    };
                    let target = self.open(step, partition, around);
                    if target.is_some() {
                        self.pushers = pushers;
                        return target;
                    }
                }
            }
        }
        self.pushers = pushers;
        None
    }

    /// Whether there is a class that a vertex could enter.
    fn is_loose(&mut self, v: u32, partition: &Partition<'_>, around: &impl Surroundings) -> bool {
        self.taken.fill(0);
        around.add_taken(v, &partition.class, &mut self.taken);
        let own = partition.class[v as usize];
        self.taken[own as usize / 64] |= 1 << (own % 64);
        let taken: u32 = self.taken.iter().map(|word| word.count_ones()).sum();
        (taken as usize) < partition.count()
    }

    /// Adds to the queue the classes that the mover of `step` can enter; the lightest target among
    /// them.
    fn open(
        &mut self,
        step: Step,
        partition: &Partition<'_>,
        around: &impl Surroundings,
    ) -> Option<u32> {
        self.taken.copy_from_slice(&self.seen);
        around.add_taken(step.mover, &partition.class, &mut self.taken);
        if step.detour != NONE {
            self.taken[step.detour as usize / 64] |= 1 << (step.detour % 64);
        }
        let start = self.queue.len();
        for (base, word) in (0..).step_by(64).zip(0..self.taken.len()) {
            // The last word has bits beyond the last class.
            let classes = (partition.count() - 64 * word).min(64);
            let mut free = !self.taken[word] & (u64::MAX >> (64 - classes));
            self.seen[word] |= free;
            while free != 0 {
                let class: u32 = base + free.trailing_zeros();
                free &= free - 1;
                self.steps[class as usize] = step;
                self.queue.push(class);
            }
        }
        let opened = self.queue[start..].iter().copied();
        opened
            .filter(|&class| has(&self.targets, class))
            .min_by_key(|&class| (partition.loads[class as usize], class))
    }

    /// Makes the moves that lead to `target`, the last one first.
    fn shift_along_path(
        &mut self,
        source: u32,
        target: u32,
        partition: &mut Partition<'_>,
        members: &mut Members,
        around: &mut impl Surroundings,
    ) {
        let mut to = target;
        while to != source {
            let Step { mover, pusher, .. } = self.steps[to as usize];
            to = self.shift(mover, to, partition, members, around);
            if pusher != NONE {
                to = self.shift(pusher, to, partition, members, around);
            }
        }
    }

    /// Moves a vertex to a class, and updates which vertices around it are loose; returns the class that it left.
    fn shift(
        &mut self,
        v: u32,
        to: u32,
        partition: &mut Partition<'_>,
        members: &mut Members,
        around: &mut impl Surroundings,
    ) -> u32 {
        let from = partition.class[v as usize];
        around.leave(v, from);
        around.enter(v, to);
        if members.contains(v) {
            // The next search goes on behind this vertex: those before it had no way out.
            members.start_at(v, from);
            members.unlink(v, from);
        }
        partition.shift(v, to);
        let mut neighbors = std::mem::take(&mut self.neighbors);
        neighbors.clear();
        neighbors.push(v);
        around.visit_neighbors(v, |u| neighbors.push(u));
        neighbors.sort_unstable();
        neighbors.dedup();
        let weight = partition.weights[v as usize];
        for &u in &neighbors {
            let class = partition.class[u as usize];
            if class == NONE || partition.weights[u as usize] != weight {
                continue;
            }
            match (members.contains(u), self.is_loose(u, partition, around)) {
                (false, true) => members.link(u, class),
                (true, false) => members.unlink(u, class),
                _ => {}
            }
        }
        self.neighbors = neighbors;
        from
    }
}

fn has(words: &[u64], class: u32) -> bool {
    words[class as usize / 64] >> (class % 64) & 1 == 1
}
