//! The classes while they are balanced: the members and the load of each one.
//!
//! Classes are the colors that carry weight, numbered without gaps. A color that only vertices of
//! weight 0 have is not a class: no vertex enters or leaves it. Members are listed by links through
//! the vertices, so that one can change class in O(1).

use incise_graph::{ColorId, Coloring};

/// No vertex, or no class.
pub(super) const NONE: u32 = u32::MAX;

/// The class of every vertex and the load of every class.
#[derive(Debug)]
pub(super) struct Partition<'a> {
    pub(super) weights: &'a [u32],
    /// Vertex -> class, [`NONE`] for those whose color is no class.
    pub(super) class: Vec<u32>,
    /// Class -> total weight.
    pub(super) loads: Vec<u64>,
    /// Class -> color.
    labels: Vec<ColorId>,
}

impl<'a> Partition<'a> {
    pub(super) fn new(coloring: &Coloring, weights: &'a [u32]) -> Self {
        let mut loads = vec![0u64; coloring.color_count()];
        for (color, &weight) in coloring.colors().iter().zip(weights) {
            loads[color.index()] += u64::from(weight);
        }
        let mut number = vec![NONE; loads.len()];
        let mut labels = Vec::new();
        let occupied = (0..)
            .map(ColorId)
            .zip(&loads)
            .filter(|(_, load)| **load > 0);
        for (class, (color, _)) in (0..).zip(occupied) {
            number[color.index()] = class;
            labels.push(color);
        }
        loads.retain(|&load| load > 0);
        let class = coloring.colors().iter().map(|color| number[color.index()]);
        Self {
            weights,
            class: class.collect(),
            loads,
            labels,
        }
    }

    /// The number of classes.
    pub(super) fn count(&self) -> usize {
        self.loads.len()
    }

    /// Heaviest less lightest; 0 if there are no classes.
    pub(super) fn range(&self) -> u64 {
        let min = self.loads.iter().min().copied().unwrap_or(0);
        self.loads.iter().max().map_or(0, |max| max - min)
    }

    /// Takes the class of `v`, with the weight of `v`, to `to`.
    pub(super) fn shift(&mut self, v: u32, to: u32) {
        let weight = u64::from(self.weights[v as usize]);
        let from = std::mem::replace(&mut self.class[v as usize], to);
        self.loads[from as usize] -= weight;
        self.loads[to as usize] += weight;
    }

    /// Writes the classes back as colors; returns how many vertices have another one than before.
    pub(super) fn store(&self, coloring: &mut Coloring) -> usize {
        let mut changed = 0;
        for (v, &class) in self.class.iter().enumerate() {
            if class != NONE && coloring.color(v) != self.labels[class as usize] {
                coloring.set(v, self.labels[class as usize]);
                changed += 1;
            }
        }
        changed
    }
}

/// The members of every class, in a ring.
#[derive(Debug)]
pub(super) struct Members {
    first: Vec<u32>,
    next: Vec<u32>,
    previous: Vec<u32>,
}

impl Members {
    /// No members.
    pub(super) fn new(vertices: usize, classes: usize) -> Self {
        Self {
            first: vec![NONE; classes],
            next: vec![NONE; vertices],
            previous: vec![NONE; vertices],
        }
    }

    /// Inserts `v` at the end of a class.
    pub(super) fn link(&mut self, v: u32, class: u32) {
        let first = self.first[class as usize];
        if first == NONE {
            self.first[class as usize] = v;
            (self.next[v as usize], self.previous[v as usize]) = (v, v);
            return;
        }
        let last = std::mem::replace(&mut self.previous[first as usize], v);
        self.next[last as usize] = v;
        (self.next[v as usize], self.previous[v as usize]) = (first, last);
    }

    /// Removes `v` from its class. If it was the first, the next one is.
    pub(super) fn unlink(&mut self, v: u32, class: u32) {
        let (next, previous) = (self.next[v as usize], self.previous[v as usize]);
        self.next[v as usize] = NONE;
        if next == v {
            self.first[class as usize] = NONE;
            return;
        }
        self.previous[next as usize] = previous;
        self.next[previous as usize] = next;
        if self.first[class as usize] == v {
            self.first[class as usize] = next;
        }
    }

    /// Whether `v` is a member of a class.
    pub(super) fn contains(&self, v: u32) -> bool {
        self.next[v as usize] != NONE
    }

    /// Makes `v` the first member of its class; the order around the ring stays.
    pub(super) fn start_at(&mut self, v: u32, class: u32) {
        self.first[class as usize] = v;
    }

    /// The members of a class, first to last.
    pub(super) fn of(&self, class: u32) -> impl Iterator<Item = u32> {
        let first = self.first[class as usize];
        let following = move |&v: &u32| {
            let next = self.next[v as usize];
            (next != first).then_some(next)
        };
        std::iter::successors((first != NONE).then_some(first), following)
    }
}
