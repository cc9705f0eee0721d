//! Chains of moves: from a heavy class to a light one through classes in between.
//!
//! Say that class a *gives* to class b if some vertex of a has no neighbor in b. Along a path of
//! giving classes every vertex moves one class on, which leaves the weights in between as they are
//! if the vertices weigh the same. The vertices of one path never get in each other's way: whoever
//! enters a class meets nobody there that was not there before, and whoever leaves makes room. A
//! round finds a giver for every pair of classes in one pass over all vertices, and then takes
//! shortest paths, checking each giver again, since earlier paths of the round have changed things.
//! Cost: O(vertices * (degree + colors) + paths * colors^2).

use crate::Conflicts;

use super::State;

/// Nobody.
const NONE: u32 = u32::MAX;

impl<C: Conflicts> State<'_, C> {
    /// One round of chains; whether there was any.
    pub(super) fn improve_by_chains(&mut self) -> bool {
        let before = self.stats.chains;
        let count = self.loads.len();
        if self.spread() < 2 {
            return false;
        }
        let mut givers = self.givers();
        let mut heavy: Vec<usize> = (0..count).collect();
        heavy.sort_by_key(|&class| (std::cmp::Reverse(self.loads[class]), class));
        for from in heavy {
            while self.chain(from, &mut givers) {
                self.stats.chains += 1;
            }
        }
        self.stats.chains > before
    }

    /// The heaviest less the lightest class.
    pub(super) fn spread(&self) -> u64 {
        let most = self.loads.iter().max().copied().unwrap_or(0);
        most - self.loads.iter().min().copied().unwrap_or(0)
    }

    /// For each pair of classes the lightest vertex of the first that fits into the second, row by
    /// row.
    fn givers(&mut self) -> Vec<u32> {
        let count = self.loads.len();
        let mut givers = vec![NONE; count * count];
        for v in self.vertices() {
            if self.weight(v) == 0 {
                continue;
            }
            self.look_around(v);
            let from = self.color(v);
            for to in (0..count).filter(|&to| to != from) {
                let giver = &mut givers[from * count + to];
                if self.fits(to) && (*giver == NONE || self.weight(v) < self.weight(*giver)) {
                    *giver = v;
                }
            }
        }
        givers
    }

    /// Takes the first path from class `from`, in order of length, that lowers the sum of squares.
    fn chain(&mut self, from: usize, givers: &mut [u32]) -> bool {
        let count = self.loads.len();
        // Breadth first; `parent` leads back.
        let mut parent = vec![usize::MAX; count];
        parent[from] = from;
        let mut queue = vec![from];
        let mut next = 0;
        while next < queue.len() {
            let class = queue[next];
            next += 1;
            for to in 0..count {
                if parent[to] != usize::MAX || !self.still_gives(class, to, givers) {
                    continue;
                }
                parent[to] = class;
                queue.push(to);
                let path = path_to(to, &parent, givers, count);
                if self.lowers(&path) {
                    for &(v, class) in &path {
                        self.shift(v, class);
                    }
                    return true;
                }
            }
        }
        false
    }

    /// Is there still a known vertex to go from one class to the other?
    fn still_gives(&mut self, from: usize, to: usize, givers: &mut [u32]) -> bool {
        let giver = &mut givers[from * self.loads.len() + to];
        if *giver == NONE {
            return false;
        }
        let v = *giver;
        if self.color(v) == from {
            self.look_around(v);
            if self.fits(to) {
                return true;
            }
        }
        *giver = NONE;
        false
    }

    /// Would these moves lower the sum of squared class weights?
    fn lowers(&self, path: &[(u32, usize)]) -> bool {
        let mut change = 0i128;
        for (index, &(v, to)) in path.iter().enumerate() {
            let weight = i128::from(self.weight(v));
            if index == 0 {
                change += squares(self.loads[self.color(v)], -weight);
            }
            let leaving = path.get(index + 1);
            let leaving = leaving.map_or(0, |&(u, _)| i128::from(self.weight(u)));
            change += squares(self.loads[to], weight - leaving);
        }
        change < 0
    }
}

/// The change of the square of `load` when it changes by `by`.
fn squares(load: u64, by: i128) -> i128 {
    (2 * i128::from(load) + by) * by
}

/// The moves that lead to class `to`: each vertex with the class it goes to.
fn path_to(to: usize, parent: &[usize], givers: &[u32], count: usize) -> Vec<(u32, usize)> {
    let mut path = Vec::new();
    let mut to = to;
    while parent[to] != to {
        path.push((givers[parent[to] * count + to], to));
        to = parent[to];
    }
    path.reverse();
    path
}
