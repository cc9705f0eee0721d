//! [`ClusterOrder`]: the order in which a kernel solves the tets of a cluster, and the order of the corners of each.
//!
//! The next tet is the one that shares most corners with the last, and a shared corner has the same slot in both. So a
//! kernel keeps it from one tet to the next, and moves 1.5 to 2.2 corners a tet in clusters of 10 in place of 4. Both
//! orders depend on the corners of the cluster alone. Ties go to the tet with the fewest faces that unsolved tets share, so
//! that none is left behind, then to the first in the cluster. Several first tets are tried.
//!
//! Cost: O(n²) words of bits for up to 64 tets; larger clusters are ordered 64 tets at a time.

/// Tets that are ordered at a time, one a bit.
const WINDOW: usize = 64;

/// First tets that are tried.
const STARTS: usize = 8;

/// No corner.
const NONE: [u32; 4] = [u32::MAX; 4];

/// A tet in the order of its cluster.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OrderedTet {
    /// Its number.
    pub tet: u32,
    /// Slot -> which of its corners has this slot.
    pub slots: Slots,
}

/// A permutation of the corners of a tet: the corner that has each slot.
pub(crate) type Slots = [u8; 4];

/// The corners in the order of their slots.
pub(crate) fn in_slots<T: Copy>(corners: [T; 4], slots: Slots) -> [T; 4] {
    slots.map(|k| corners[usize::from(k)])
}

/// Orders clusters, and keeps memory for that.
#[derive(Clone, Debug, Default)]
pub(crate) struct ClusterOrder {
    tets: Vec<OrderedTet>,
    /// Of each tet: the tets that share 1, 2 and 3 or more corners with it, one a bit.
    sharing: Vec<[u64; 3]>,
    best: Vec<u8>,
    order: Vec<u8>,
}

impl ClusterOrder {
    /// The order of the tets of a cluster, given the corners of each.
    pub(crate) fn of(&mut self, tets: &[u32], corners: impl Fn(u32) -> [u32; 4]) -> &[OrderedTet] {
        self.tets.clear();
        let mut last = NONE;
        for window in tets.chunks(WINDOW) {
            self.order(window, &corners, last);
            for &k in &self.best {
                let tet = window[usize::from(k)];
                let own = corners(tet);
                let slots = kept_slots(own, last);
                last = in_slots(own, slots);
                self.tets.push(OrderedTet { tet, slots });
            }
        }
        &self.tets
    }

    /// Puts the order of up to [`WINDOW`] tets that follow a tet with the corners `last` into `best`.
    fn order(&mut self, tets: &[u32], corners: &impl Fn(u32) -> [u32; 4], last: [u32; 4]) {
        self.best.clear();
        let count = tets.len();
        if count < 2 {
            self.best.extend((0..).take(count));
            return;
        }
        self.sharing.clear();
        self.sharing.resize(count, [0; 3]);
        for (i, &tet) in tets.iter().enumerate() {
            let own = corners(tet);
            for (j, &other) in tets[..i].iter().enumerate() {
                let common = shared(own, corners(other)).min(3);
                if common > 0 {
                    self.sharing[i][common - 1] |= 1 << j;
                    self.sharing[j][common - 1] |= 1 << i;
                }
            }
        }
        let starts = if last == NONE { STARTS.min(count) } else { 1 };
        let mut most = None;
        for start in 0..starts {
            let first = if last == NONE {
                start * count / starts
            } else {
                let sharing = |k: usize| shared(last, corners(tets[k]));
                // The last of those that share most.
                (0..count).max_by_key(|&k| sharing(k)).unwrap_or(0)
            };
            let kept = self.walk(first);
            if most.is_none_or(|most| kept > most) {
                most = Some(kept);
                std::mem::swap(&mut self.best, &mut self.order);
            }
        }
    }

    /// Puts the order that starts with a tet into `order`; returns how many corners stay.
    fn walk(&mut self, first: usize) -> usize {
        let count = self.sharing.len();
        let mut left = u64::MAX >> (WINDOW - count);
        self.order.clear();
        let (mut now, mut kept) = (first, 0);
        loop {
            left &= !(1 << now);
            self.order.push(u8::try_from(now).unwrap_or(u8::MAX));
            let [one, two, three] = self.sharing[now].map(|tets| tets & left);
            let (candidates, common) = match (three, two, one) {
                (0, 0, 0) => (left, 0),
                (0, 0, _) => (one, 1),
                (0, _, _) => (two, 2),
                _ => (three, 3),
            };
            let faces = |&k: &usize| (self.sharing[k][2] & left).count_ones();
            let Some(next) = bits(candidates).min_by_key(faces) else {
                return kept;
            };
            kept += common;
            now = next;
        }
    }
}

/// The set bits, ascending.
fn bits(mut word: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (word != 0).then(|| word.trailing_zeros() as usize);
        word &= word.wrapping_sub(1);
        bit
    })
}

/// How many corners of a tet another one has.
fn shared(a: [u32; 4], b: [u32; 4]) -> usize {
    a.iter().filter(|corner| b.contains(corner)).count()
}

/// The slots of the corners of a tet: those that it shares with the tet before keep theirs, the others take what is left
/// in their order.
fn kept_slots(corners: [u32; 4], before: [u32; 4]) -> Slots {
    let mut is_free = [true; 4];
    let kept = before.map(|corner| {
        let k = (0..4).find(|&k| is_free[k] && corners[k] == corner)?;
        is_free[k] = false;
        Some(k)
    });
    let mut left = (0..4).filter(|&k| is_free[k]);
    kept.map(|k| {
        let k = k.or_else(|| left.next());
        u8::try_from(k.unwrap_or(0)).unwrap_or(0)
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Corners of tets that are in a strip: each shares three with the one before.
    fn strip(tet: u32) -> [u32; 4] {
        [tet, tet + 1, tet + 2, tet + 3]
    }

    fn moved(order: &[OrderedTet], corners: impl Fn(u32) -> [u32; 4]) -> usize {
        let mut held = NONE;
        let mut moved = 0;
        for tet in order {
            let now = in_slots(corners(tet.tet), tet.slots);
            moved += (0..4).filter(|&k| now[k] != held[k]).count();
            held = now;
        }
        moved
    }

    /// A strip in shuffled order is found again. One in its own order stays, also beyond a window.
    #[test]
    fn a_strip_moves_one_corner_a_tet() {
        let mut order = ClusterOrder::default();
        for count in [1, 2, 10, 64, 65, 300] {
            // 7 is prime to the first counts.
            let step = if count <= 64 { 7 } else { 1 };
            let tets: Vec<u32> = (0..count).map(|i| i * step % count).collect();
            let moves = moved(order.of(&tets, strip), strip);
            assert_eq!(moves, count as usize + 3, "{count} tets");
        }
    }

    proptest! {
        /// Any tets, degenerate ones included: each is there once, with its own corners, and a corner that stays keeps
        /// its slot.
        #[test]
        fn shared_corners_keep_their_slots(
            corners in prop::collection::vec(prop::array::uniform4(0u32..30), 0..80),
        ) {
            let tets: Vec<u32> = (0..).take(corners.len()).collect();
            let corners = |tet: u32| corners[tet as usize];
            let mut order = ClusterOrder::default();
            let order = order.of(&tets, corners);
            let mut seen: Vec<u32> = order.iter().map(|tet| tet.tet).collect();
            seen.sort_unstable();
            prop_assert_eq!(&seen, &tets);
            let mut held = NONE;
            for tet in order {
                let mut slots = tet.slots;
                slots.sort_unstable();
                prop_assert_eq!(slots, [0, 1, 2, 3]);
                let own = corners(tet.tet);
                let now = in_slots(own, tet.slots);
                for k in 0..4 {
                    // What is held and needed is not in another slot, up to corners that a tet has twice.
                    if now[k] != held[k] && own.iter().filter(|&&p| p == held[k]).count() == 1 {
                        let once = held.iter().filter(|&&p| p == held[k]).count() == 1;
                        prop_assert!(!once, "{held:?} to {now:?}");
                    }
                }
                held = now;
            }
        }
    }
}
