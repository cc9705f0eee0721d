//! Swaps of two classes along alternating components (Kempe chains).
//!
//! The vertices of two classes A and C fall into components of neighbors. In each of them the two
//! classes can be exchanged and the coloring stays proper. A component whose A part weighs d more
//! than its C part takes d from A to C. A vertex without neighbors in C is such a component of its
//! own; others move two vertices for one, or exchange a heavy one for a lighter one. Of the
//! components, and the pairs of them, the one is flipped that comes closest to equal loads, again
//! and again until none brings them closer. Cost: O(members * arity) a pair of classes, or
//! O(members * degree) from a graph, and O(components log components).

use super::partition::{Members, NONE, Partition};
use super::surroundings::Surroundings;
use super::work::Work;

/// A connected piece of two classes.
#[derive(Clone, Copy, Debug)]
struct Component {
    /// By how much its part in the heavy class outweighs that in the light one.
    surplus: i128,
    /// Index of its first vertex; [`NONE`] stands for no component at all.
    root: u32,
}

/// Arrays of the search, kept between calls.
#[derive(Debug)]
pub(super) struct Flips {
    /// The members of the heavy class, then those of the light one.
    vertices: Vec<u32>,
    /// Vertex -> its local index in `vertices`, for members of the two classes at hand.
    local: Vec<u32>,
    /// Local index -> an earlier one in the same component, or itself.
    parent: Vec<u32>,
    /// Local index of a root -> surplus of the component.
    surplus: Vec<i128>,
    /// Local index of a root -> whether the component to be flipped?
    chosen: Vec<bool>,
    /// By surplus.
    components: Vec<Component>,
}

impl Flips {
    pub(super) fn new(partition: &Partition<'_>) -> Self {
        Self {
            vertices: Vec::new(),
            local: vec![0; partition.class.len()],
            parent: Vec::new(),
            surplus: Vec::new(),
            chosen: Vec::new(),
            components: Vec::new(),
        }
    }

    /// Tries all pairs of a heavier and a lighter class, the heaviest first, each with the lightest
    /// first; returns how many pairs came closer.
    pub(super) fn run(
        &mut self,
        partition: &mut Partition<'_>,
        around: &mut impl Surroundings,
        work: &mut Work,
    ) -> usize {
        let mut members = Members::new(partition.class.len(), partition.count());
        for (v, &class) in (0..).zip(&partition.class) {
            if class != NONE {
                members.link(v, class);
            }
        }
        let mut order: Vec<u32> = (0..).take(partition.count()).collect();
        order.sort_by_key(|&class| partition.loads[class as usize]);
        let mut pairs = 0;
        for &heavy in order.iter().rev() {
            for &light in &order {
                if partition.loads[heavy as usize] > partition.loads[light as usize] + 1 {
                    if work.is_spent() {
                        return pairs;
                    }
                    self.split(heavy, light, partition, &members, around);
                    self.choose(partition.loads[heavy as usize] - partition.loads[light as usize]);
                    work.spend(self.vertices.len());
                    let flipped = self.flip(heavy, light, partition, &mut members, around);
                    pairs += usize::from(flipped);
                }
            }
        }
        pairs
    }

    /// Finds the components of two classes.
    fn split(
        &mut self,
        heavy: u32,
        light: u32,
        partition: &Partition<'_>,
        members: &Members,
        around: &mut impl Surroundings,
    ) {
        self.vertices.clear();
        self.vertices.extend(members.of(heavy));
        let border = self.vertices.len();
        self.vertices.extend(members.of(light));
        self.parent.clear();
        for (local, &v) in (0..).zip(&self.vertices) {
            self.local[v as usize] = local;
            self.parent.push(local);
        }
        let (vertices, local) = (&self.vertices, &self.local);
        let parent = &mut self.parent;
        let (first, second) = vertices.split_at(border);
        around.join([heavy, light], [first, second], &partition.class, |v, u| {
            let v = root(parent, local[v as usize]);
            let u = root(parent, local[u as usize]);
            parent[v.max(u) as usize] = v.min(u);
        });
        self.surplus.clear();
        self.surplus.resize(vertices.len(), 0);
        for (at, &v) in (0..).zip(vertices) {
            let weight = i128::from(partition.weights[v as usize]);
            let signed = if (at as usize) < border {
                weight
            } else {
                -weight
            };
            self.surplus[root(parent, at) as usize] += signed;
        }
    }

    /// Marks the components to flip when the heavy class is heavier by `difference`.
    fn choose(&mut self, difference: u64) {
        self.chosen.clear();
        self.chosen.resize(self.vertices.len(), false);
        self.components.clear();
        let surpluses = (0..)
            .zip(&self.surplus)
            .filter(|(_, surplus)| **surplus != 0);
        self.components
            .extend(surpluses.map(|(root, &surplus)| Component { surplus, root }));
        // A pair with this one is a component alone.
        self.components.push(Component {
            surplus: 0,
            root: NONE,
        });
        let mut difference = i128::from(difference);
        loop {
            self.components
                .sort_unstable_by_key(|component| (component.surplus, component.root));
            let Some((low, high)) = closest_pair(&self.components, difference) else {
                return;
            };
            for at in [low, high] {
                let component = &mut self.components[at];
                if let Some(chosen) = self.chosen.get_mut(component.root as usize) {
                    *chosen = !*chosen;
                    difference -= 2 * component.surplus;
                    component.surplus = -component.surplus;
                }
            }
        }
    }

    /// Exchanges the classes in the marked components; false if there is none.
    fn flip(
        &mut self,
        heavy: u32,
        light: u32,
        partition: &mut Partition<'_>,
        members: &mut Members,
        around: &mut impl Surroundings,
    ) -> bool {
        let Self {
            vertices,
            parent,
            chosen,
            ..
        } = self;
        let mut at = 0;
        vertices.retain(|_| {
            at += 1;
            chosen[root(parent, at - 1) as usize]
        });
        // All leave before any enters: neighbors exchange their classes.
        for &v in &*vertices {
            around.leave(v, partition.class[v as usize]);
        }
        for &v in &*vertices {
            let from = partition.class[v as usize];
            let to = if from == heavy { light } else { heavy };
            around.enter(v, to);
            members.unlink(v, from);
            members.link(v, to);
            partition.shift(v, to);
        }
        !vertices.is_empty()
    }
}

/// The first local index of the component, by path halving.
fn root(parent: &mut [u32], mut at: u32) -> u32 {
    while parent[at as usize] != at {
        let above = parent[parent[at as usize] as usize];
        parent[at as usize] = above;
        at = above;
    }
    at
}

/// Two entries of a list sorted by surplus whose sum is closest to half the difference, if flipping
/// both makes the difference smaller. O(length), by a pointer from each end.
fn closest_pair(components: &[Component], difference: i128) -> Option<(usize, usize)> {
    let (mut low, mut high) = (0, components.len() - 1);
    let mut best = None;
    let mut smallest = difference;
    while low < high {
        let left = difference - 2 * (components[low].surplus + components[high].surplus);
        if left.abs() < smallest {
            smallest = left.abs();
            best = Some((low, high));
        }
        if left > 0 {
            low += 1;
        } else {
            high -= 1;
        }
    }
    best
}
