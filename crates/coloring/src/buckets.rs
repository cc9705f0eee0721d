//! Vertices sorted by a small number that goes up or down by one: a list per number.
//!
//! The queue behind smallest-last and maximum cardinality search. A list is doubly linked through
//! arrays, so that any vertex moves in O(1); the one added last is taken first. The first and last
//! occupied list are found by walking from where they were: since keys change by one, a take costs
//! O(1) amortized over the changes.

/// No vertex.
const NONE: u32 = u32::MAX;

/// Which end of the queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Extreme {
    Smallest,
    Largest,
}

/// All vertices, each in the list of its key until it is taken.
#[derive(Debug)]
pub(crate) struct Buckets {
    /// Key -> its first vertex.
    first: Vec<u32>,
    next: Vec<u32>,
    previous: Vec<u32>,
    /// Vertex -> its key; `NONE` once it is taken.
    key: Vec<u32>,
    /// No occupied list is below `low` or above `high`.
    low: usize,
    high: usize,
    left: usize,
}

impl Buckets {
    /// Every vertex `v` with key `keys[v]`; of equal ones the smallest number is taken first.
    pub(crate) fn new(keys: &[u32]) -> Self {
        let most = keys.iter().max().map_or(0, |&key| key as usize);
        let mut buckets = Self {
            first: vec![NONE; most + 1],
            next: vec![NONE; keys.len()],
            previous: vec![NONE; keys.len()],
            key: keys.to_vec(),
            low: 0,
            high: most,
            left: keys.len(),
        };
        for v in (0..)
            .take(keys.len())
            .collect::<Vec<u32>>()
            .into_iter()
            .rev()
        {
            buckets.link(v);
        }
        buckets
    }

    /// Takes a vertex with the smallest or largest key out.
    pub(crate) fn take(&mut self, extreme: Extreme) -> Option<u32> {
        if self.left == 0 {
            return None;
        }
        let list = match extreme {
            Extreme::Smallest => {
                while self.first[self.low] == NONE {
                    self.low += 1;
                }
                self.low
            }
            Extreme::Largest => {
                while self.first[self.high] == NONE {
                    self.high -= 1;
                }
                self.high
            }
        };
        let v = self.first[list];
        self.unlink(v);
        self.key[v as usize] = NONE;
        self.left -= 1;
        Some(v)
    }

    /// Raises the key of `v` by one, unless it was taken.
    pub(crate) fn increase(&mut self, v: u32) {
        if self.key[v as usize] != NONE {
            self.unlink(v);
            self.key[v as usize] += 1;
            let key = self.key[v as usize] as usize;
            if key == self.first.len() {
                self.first.push(NONE);
            }
            self.high = self.high.max(key);
            self.link(v);
        }
    }

    /// Lowers the key of `v` by one, unless it was taken. A key of 0 must not be lowered.
    pub(crate) fn decrease(&mut self, v: u32) {
        if self.key[v as usize] != NONE {
            self.unlink(v);
            self.key[v as usize] -= 1;
            self.low = self.low.min(self.key[v as usize] as usize);
            self.link(v);
        }
    }

    fn link(&mut self, v: u32) {
        let first = &mut self.first[self.key[v as usize] as usize];
        self.next[v as usize] = *first;
        self.previous[v as usize] = NONE;
        if *first != NONE {
            self.previous[*first as usize] = v;
        }
        *first = v;
    }

    fn unlink(&mut self, v: u32) {
        let (next, previous) = (self.next[v as usize], self.previous[v as usize]);
        if next != NONE {
            self.previous[next as usize] = previous;
        }
        if previous == NONE {
            self.first[self.key[v as usize] as usize] = next;
        } else {
            self.next[previous as usize] = next;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn takes_by_key_and_follows_changes() {
        let mut buckets = Buckets::new(&[2, 0, 2, 1]);
        assert_eq!(buckets.take(Extreme::Largest), Some(0));
        buckets.increase(3);
        buckets.increase(3);
        buckets.increase(0);
        assert_eq!(buckets.take(Extreme::Largest), Some(3));
        buckets.decrease(2);
        buckets.decrease(2);
        assert_eq!(
            buckets.take(Extreme::Smallest),
            Some(2),
            "the latest of its list"
        );
        assert_eq!(buckets.take(Extreme::Smallest), Some(1));
        assert_eq!(buckets.take(Extreme::Largest), None);
    }
}
