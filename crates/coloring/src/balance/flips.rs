//! Flips: a connected part of two classes changes places.
//!
//! The vertices of two classes and the edges between them form a graph of one or more connected
//! parts. Exchanging the two colors within a part leaves the coloring proper (Kempe 1879), and
//! moves the difference of what the part holds of each. A round goes through pairs of a heavier and
//! a lighter class, finds the parts, and flips those that bring the two closer together. Cost:
//! O((members of the two classes) * degree) a pair, O(colors * vertices * degree) a round.

use incise_graph::Coloring;

use crate::Conflicts;

use super::State;

impl<C: Conflicts> State<'_, C> {
    /// One round of flips; whether there was any.
    pub(super) fn improve_by_flips(&mut self) -> bool {
        if self.spread() < 2 {
            return false;
        }
        let before = self.stats.flips;
        let count = self.loads.len();
        let mut visited = vec![0u32; self.colors.len()];
        let mut pair = 0;
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by_key(|&class| (std::cmp::Reverse(self.loads[class]), class));
        for heavy in 0..count {
            // A flip changes who is in the classes.
            let mut classes = Coloring::new(self.colors.clone()).classes();
            for light in (heavy + 1..count).rev() {
                let (heavy, light) = (order[heavy], order[light]);
                if self.loads[heavy] < self.loads[light] + 2 {
                    continue;
                }
                pair += 1;
                let flips = self.stats.flips;
                for &start in classes.members(heavy) {
                    if visited[start as usize] != pair {
                        self.flip(start, heavy, light, pair, &mut visited);
                    }
                }
                if self.stats.flips > flips {
                    classes = Coloring::new(self.colors.clone()).classes();
                }
            }
        }
        self.stats.flips > before
    }

    /// Flips the part around `start`, a member of the heavy class, if that brings the two classes
    /// closer together.
    fn flip(&mut self, start: u32, heavy: usize, light: usize, pair: u32, visited: &mut [u32]) {
        visited[start as usize] = pair;
        let mut part = vec![start];
        let mut next = 0;
        // What the heavy class would lose.
        let mut loss = 0i128;
        while let Some(&v) = part.get(next) {
            next += 1;
            let weight = i128::from(self.weight(v));
            let color = self.color(v);
            loss += if color == heavy { weight } else { -weight };
            let other = heavy + light - color;
            let colors = &self.colors;
            self.conflicts.visit_neighbors(v, |u| {
                let at = u as usize;
                if colors[at].index() == other && visited[at] != pair {
                    visited[at] = pair;
                    part.push(u);
                }
            });
        }
        let gap = i128::from(self.loads[heavy]) - i128::from(self.loads[light]);
        if 0 < loss && loss < gap {
            for v in part {
                let other = heavy + light - self.color(v);
                self.shift(v, other);
            }
            self.stats.flips += 1;
        }
    }
}
