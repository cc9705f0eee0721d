//! [`PieceNumbers`]: numbers of pieces that stay while pieces come off.
//!
//! A mesh numbers its pieces in the order of their first tets, so a cut may give a piece another number and with it another
//! color. Here the piece that has the most tets of a former one keeps its number, and the others get new ones. Cost: a
//! sort of the tets, in frames whose topology changed and only while pieces are shown; the tets that cuts add or move in
//! every such frame from then on.

use incise::cutting::CutDelta;

/// The number of a tet that is newer than the last look.
const UNKNOWN: u32 = u32::MAX;

/// The numbers of the pieces when they were last looked at.
#[derive(Clone, Debug, Default)]
pub(crate) struct PieceNumbers {
    /// Of each tet then, in the slot that it has now; empty before the first look.
    of_tet: Vec<u32>,
    next: u32,
}

impl PieceNumbers {
    /// Forgets all numbers.
    pub(crate) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Follows the tets through a cut: the last ones may have moved into the slots of deleted ones.
    pub(crate) fn follow_cut(&mut self, delta: &CutDelta) {
        if self.of_tet.is_empty() {
            return;
        }
        let before_moves = delta.tets_before + delta.added.len() - delta.removed.len();
        self.of_tet.resize(before_moves, UNKNOWN);
        for moved in &delta.moved {
            self.of_tet[moved.to.index()] = self.of_tet[moved.from.index()];
        }
        self.of_tet.truncate(delta.tets_after());
    }

    /// The number of each tet's piece, for labels of `count` pieces.
    pub(crate) fn follow(&mut self, labels: &[u32], count: usize) -> &[u32] {
        let mut pairs: Vec<(u32, u32)> = labels
            .iter()
            .copied()
            .zip(self.of_tet.iter().copied())
            .filter(|(_, number)| *number != UNKNOWN)
            .collect();
        pairs.sort_unstable();
        let mut shared: Vec<(usize, u32, u32)> = pairs
            .chunk_by(|a, b| a == b)
            .map(|run| (run.len(), run[0].0, run[0].1))
            .collect();
        // Most tets first; then in the order of the mesh, so that the result is the same everywhere.
        shared.sort_unstable_by_key(|&(tets, label, number)| {
            (std::cmp::Reverse(tets), label, number)
        });
        let mut numbers = vec![None; count];
        let mut taken = vec![false; self.next as usize];
        for (_, label, number) in shared {
            let (place, taken) = (&mut numbers[label as usize], &mut taken[number as usize]);
            if place.is_none() && !*taken {
                (*place, *taken) = (Some(number), true);
            }
        }
        let mut fresh = || {
            self.next += 1;
            self.next - 1
        };
        let numbers: Vec<u32> = numbers
            .into_iter()
            .map(|number| number.unwrap_or_else(&mut fresh))
            .collect();
        self.of_tet.clear();
        let of_tet = labels.iter().map(|&label| numbers[label as usize]);
        self.of_tet.extend(of_tet);
        &self.of_tet
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_larger_part_keeps_its_number() {
        let mut numbers = PieceNumbers::default();
        assert_eq!(numbers.follow(&[0, 0, 0, 0, 1], 2), [0, 0, 0, 0, 1]);
        // The first tet comes off its piece; the mesh now calls it 0.
        assert_eq!(numbers.follow(&[0, 1, 1, 1, 2, 1], 3), [2, 0, 0, 0, 1, 0]);
        // Piece 1 is gone.
        assert_eq!(numbers.follow(&[0, 1, 1, 1], 2), [2, 0, 0, 0]);
    }
}
