//! [`Places`]: the particles in an order in which neighbors in space are neighbors in memory.
//!
//! A thread that writes a particle takes the whole cache line, with three more particles, from the other threads. Where
//! each thread solves a part of space, and particles lie in this order, threads share lines along the borders of the parts
//! only. Particles are numbered by the user's mesh, so a pass on several threads works on a copy in this order.
//!
//! The order halves the body across its longest side, and so on with both halves. Particles that come later have the
//! next places, and those that are removed keep theirs. Cost: O(n log n) comparisons for all.

use glam::DVec3;

use super::{NONE, index};

/// Particles that are not divided further: some cache lines.
const FEW: usize = 16;

/// The order.
#[derive(Clone, Debug, Default)]
pub(crate) struct Places {
    /// Place -> particle.
    particles: Vec<u32>,
    /// Particle -> place.
    places: Vec<u32>,
}

impl Places {
    /// Puts all particles into the order of their positions.
    pub(super) fn reset(&mut self, positions: &[DVec3]) {
        self.particles.clear();
        self.particles.extend(0..index(positions.len()));
        halve(&mut self.particles, positions);
        self.places.clear();
        self.places.resize(positions.len(), NONE);
        for (place, &particle) in self.particles.iter().enumerate() {
            self.places[particle as usize] = index(place);
        }
    }

    /// Place -> particle.
    pub(crate) fn particles(&self) -> &[u32] {
        &self.particles
    }

    /// The place of a particle; a new one gets the next place.
    pub(super) fn place(&mut self, particle: u32) -> u32 {
        let number = particle as usize;
        if self.places.len() <= number {
            self.places.resize(number + 1, NONE);
        }
        if self.places[number] == NONE {
            self.places[number] = index(self.particles.len());
            self.particles.push(particle);
        }
        self.places[number]
    }

    /// Whether a particle has this place.
    pub(super) fn has(&self, particle: u32, place: u32) -> bool {
        self.places.get(particle as usize) == Some(&place)
            && self.particles.get(place as usize) == Some(&particle)
    }
}

/// Puts those on one side of the middle of the longest side first, and so on with both halves.
fn halve(particles: &mut [u32], positions: &[DVec3]) {
    if particles.len() <= FEW {
        return;
    }
    let at = |particle: u32| positions[particle as usize];
    let ends = particles.iter().fold((DVec3::MAX, DVec3::MIN), |ends, &p| {
        (ends.0.min(at(p)), ends.1.max(at(p)))
    });
    let axis = (ends.1 - ends.0).max_position();
    let middle = particles.len() / 2;
    particles.select_nth_unstable_by(middle, |&a, &b| {
        at(a)[axis].total_cmp(&at(b)[axis]).then(a.cmp(&b))
    });
    let (first, second) = particles.split_at_mut(middle);
    halve(first, positions);
    halve(second, positions);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each particle has a place; halves and quarters of the order are parts of space, also where points coincide or are
    /// no numbers.
    #[test]
    fn neighbors_in_space_have_near_places() {
        let mut places = Places::default();
        // A row of points in shuffled order, 613 being prime to the count.
        let count = 1024;
        let row: Vec<DVec3> = (0..count)
            .map(|i| DVec3::new(0.0, f64::from(i * 613 % count), 0.0))
            .collect();
        places.reset(&row);
        let ranks = places.particles().iter().map(|&p| row[p as usize].y);
        for (place, rank) in ranks.enumerate() {
            let part = |value: f64| (value / 16.0).floor();
            assert_eq!(part(rank), part(place as f64), "{place}: {rank}");
        }
        for positions in [vec![DVec3::ONE; 100], vec![DVec3::NAN; 100]] {
            places.reset(&positions);
            let mut all = places.particles().to_vec();
            all.sort_unstable();
            assert!(all.into_iter().eq(0..100));
        }
        assert_eq!(places.place(102), 100);
        assert_eq!(places.place(102), 100);
        assert!(places.has(102, 100) && !places.has(101, 101) && !places.has(102, 99));
    }
}
