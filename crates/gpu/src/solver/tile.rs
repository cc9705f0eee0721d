//! [`Tile`]: a cluster solved by a workgroup, with local numbers of particles and its tets in steps.
//!
//! Tets of one step share no particle. Steps are assigned by first fit in ascending order, with a bit for each step at
//! each particle, and equal those of `incise_coloring::color_within_clusters`. Cost: O(tets log tets).

use crate::index::index;
/// Capacities of tiles in tets. The particles of the largest, if its tets share none, fill the 16 KiB of workgroup
/// memory that WebGPU guarantees.
const ROOMS: [usize; 3] = [64, 128, 256];

/// Largest number of tets of a tile.
pub(crate) const LARGEST: usize = ROOMS[2];

/// The capacity of tiles for clusters of at most this many tets, at most [`LARGEST`].
pub(crate) fn room_for(tets: usize) -> usize {
    ROOMS
        .into_iter()
        .find(|&room| tets <= room)
        .unwrap_or(LARGEST)
}

/// Numbers of a tile on the device: steps, particles, the end of each step, and the particles.
pub(crate) fn number_count(room: usize) -> usize {
    2 + room + 4 * room
}

/// The particles and tets of a cluster in solving order.
#[derive(Debug)]
pub(crate) struct Tile {
    /// The particles, ascending.
    particles: Vec<u32>,
    /// Tets and their corners in `particles`, step after step.
    tets: Vec<(u32, [u32; 4])>,
    /// The end of each step in `tets`.
    ends: Vec<u32>,
}

impl Tile {
    /// The tile of at most [`LARGEST`] tets, in ascending order.
    pub(crate) fn new(tets: &[u32], corners: impl Fn(u32) -> [u32; 4]) -> Self {
        debug_assert!(tets.len() <= LARGEST, "a tile holds the cluster");
        let mut particles: Vec<u32> = tets.iter().flat_map(|&tet| corners(tet)).collect();
        particles.sort_unstable();
        particles.dedup();
        let number = |p: u32| {
            let found = particles.binary_search(&p);
            index(found.expect("the particles of all tets are listed"))
        };
        // Each neighbor excludes one step, so there are at most as many steps as tets: two words hold them.
        let mut taken = vec![[0u128; LARGEST / 128]; particles.len()];
        let mut steps = Vec::with_capacity(tets.len());
        for &tet in tets {
            let corners = corners(tet).map(number);
            let free = (0..LARGEST)
                .step_by(128)
                .enumerate()
                .find_map(|(word, first)| {
                    let union = corners
                        .iter()
                        .fold(0, |all, &p| all | taken[p as usize][word]);
                    (union != u128::MAX).then(|| (word, first, union.trailing_ones()))
                });
            let (word, first, bit) = free.expect("a tet has fewer neighbors than there are steps");
            for p in corners {
                taken[p as usize][word] |= 1 << bit;
            }
            let step = index(first) + bit;
            steps.push((step, tet, corners));
        }
        steps.sort_unstable();
        let mut ends = Vec::new();
        for (k, &(step, ..)) in steps.iter().enumerate() {
            ends.resize(step as usize + 1, 0);
            ends[step as usize] = index(k + 1);
        }
        Self {
            particles,
            tets: steps
                .into_iter()
                .map(|(_, tet, corners)| (tet, corners))
                .collect(),
            ends,
        }
    }

    /// The tets with local corners, in solving order.
    pub(crate) fn tets(&self) -> impl Iterator<Item = (u32, [u32; 4])> + '_ {
        self.tets.iter().copied()
    }

    /// The numbers of the tile on the device, in a tile with capacity `room`.
    pub(crate) fn numbers(&self, room: usize) -> Vec<u32> {
        let mut numbers = vec![0; number_count(room)];
        numbers[0] = index(self.ends.len());
        numbers[1] = index(self.particles.len());
        numbers[2..2 + self.ends.len()].copy_from_slice(&self.ends);
        let particles = &mut numbers[2 + room..];
        particles[..self.particles.len()].copy_from_slice(&self.particles);
        numbers
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_fan_needs_a_step_for_each_tet() {
        let tets: Vec<u32> = (0..256).collect();
        let tile = Tile::new(&tets, |t| [0, 3 * t + 1, 3 * t + 2, 3 * t + 3]);
        assert_eq!(tile.ends, (1..=256).collect::<Vec<u32>>());
        assert_eq!(tile.particles.len(), 3 * 256 + 1);
    }

    #[test]
    fn tets_apart_need_one_step_and_all_particles() {
        for room in ROOMS {
            assert_eq!((room_for(room), room_for(room - 1)), (room, room));
            let tets: Vec<u32> = (0..index(room)).collect();
            let tile = Tile::new(&tets, |t| [0, 1, 2, 3].map(|k| 4 * t + k));
            assert_eq!((tile.ends.len(), tile.particles.len()), (1, 4 * room));
            assert_eq!(tile.numbers(room).len(), number_count(room));
        }
    }

    proptest! {
        #[test]
        fn steps_are_proper_and_hold_every_tet(
            corners in prop::collection::vec(prop::array::uniform4(0..30u32), 0..256)
        ) {
            let corners: Vec<[u32; 4]> = corners
                .into_iter()
                .filter(|c| (0..4).all(|i| (0..i).all(|j| c[i] != c[j])))
                .collect();
            let tets: Vec<u32> = (0..index(corners.len())).map(|t| 2 * t).collect();
            let tile = Tile::new(&tets, |t| corners[t as usize / 2]);
            let mut all: Vec<u32> = tile.tets().map(|(tet, _)| tet).collect();
            for (tet, local) in tile.tets() {
                prop_assert_eq!(local.map(|p| tile.particles[p as usize]), corners[tet as usize / 2]);
            }
            let mut start = 0;
            for &end in &tile.ends {
                let mut step: Vec<u32> =
                    tile.tets[start..end as usize].iter().flat_map(|(_, local)| *local).collect();
                prop_assert!(!step.is_empty());
                let count = step.len();
                step.sort_unstable();
                step.dedup();
                prop_assert_eq!(step.len(), count);
                start = end as usize;
            }
            prop_assert_eq!(start, tets.len());
            all.sort_unstable();
            prop_assert_eq!(all, tets);
        }
    }
}
