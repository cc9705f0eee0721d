//! [`Reserve`]: how much of the skin is left since vertices were searched for.
//!
//! After a search, a vertex and a triangle that are no candidate stay further apart than the skin for the whole frame. From
//! then on, it is measured what each vertex moves beside its part, and what the motions as a whole of two parts near each
//! other differ by. A vertex and a triangle use up the skin at most while each of their particles has moved by less than
//! half of what their parts leave. Both the places at the start of a frame and those expected at its end are measured; by
//! convexity this bounds all between.
//!
//! A vertex that has used up its share is searched for again, and so are all that are near a triangle of it. Then it is
//! measured from where it is. So the particles of a contact may have been searched for at different times, and what is
//! measured has to bound the way since the later one: a [`Way`] remembers how far away the vertex was whenever others were
//! searched for. It is short for what shakes and comes back, as bodies at rest do. Two parts that have used up theirs start
//! over in the same way.

use glam::DVec3;

use crate::index::index;
use crate::parts::{Part, Rigid};

/// The part of the skin that the motion of a part as a whole may use up.
const OF_PART: f64 = 0.5;
/// Motions as a whole are compared where points are within so many times the reach of a search: those that were out of
/// reach in the update before were that near.
const BEFORE: f64 = 2.0;

/// A bound on how far something has moved in m since it was searched for, and since each time that others were.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Way {
    /// The sum of all ways.
    length: f64,
    /// How far it is from where it was searched for.
    now: f64,
    /// The most that it was when others were searched for.
    most: f64,
}

impl Way {
    /// Notes that it has gone on by some way, and is so far from where it was searched for.
    fn note(&mut self, by: f64, now: f64) {
        self.length += by;
        self.now = now;
    }

    /// Notes that others are searched for.
    fn mark(&mut self) {
        self.most = larger([self.most, self.now]);
    }

    fn bound(&self) -> f64 {
        let back_and_forth = self.now + self.most;
        if self.length > back_and_forth {
            back_and_forth
        } else {
            self.length
        }
    }
}

/// The larger number; what is no number stays.
fn larger([one, other]: [f64; 2]) -> f64 {
    if one > other || one.is_nan() {
        one
    } else {
        other
    }
}

/// A vertex beside its part.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Beside {
    /// From where the part alone would have brought it, at present and at the end of the frame.
    by: [DVec3; 2],
    way: Way,
}

/// Two parts near each other.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct PartPair {
    /// Ascending.
    parts: [usize; 2],
    /// Of each, at present and at the end of the frame, the map back to where it was when the pair was searched for.
    back: [[Rigid; 2]; 2],
    /// Of the motions of both relative to each other.
    way: Way,
}

#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Reserve {
    /// By surface vertex where it was at the last update, and where it was expected at the end of the frame.
    places: Vec<[DVec3; 2]>,
    /// By surface vertex what it has moved beside its part since it was searched for.
    beside: Vec<Beside>,
    /// Ascending; those that were near each other at the last update and since both were searched for.
    pairs: Vec<PartPair>,
    /// Those of the update before, while pairs are noted.
    #[cfg_attr(feature = "serde", serde(skip))]
    last_pairs: Vec<PartPair>,
    /// By part what it has moved relative to others near it in m, but for those of [`Self::used_up`].
    parts: Vec<f64>,
    /// The parts of each pair that has used up its share, both ways, ascending.
    #[cfg_attr(feature = "serde", serde(skip))]
    used_up: Vec<[u32; 2]>,
}

impl Reserve {
    /// Forgets all vertices.
    pub(crate) fn clear(&mut self) {
        self.places.clear();
        self.beside.clear();
        self.pairs.clear();
        self.parts.clear();
        self.used_up.clear();
    }

    /// Takes over new numbers of vertices and parts: for each vertex its number before, or where a new one is, and for each
    /// part the one that it came from, or [`NONE`]. Parts of the same origin are near each other from now on.
    pub(crate) fn keep(
        &mut self,
        vertices: impl Iterator<Item = (Option<usize>, [DVec3; 2])>,
        origins: &[u32],
    ) {
        let (places, beside) = (
            std::mem::take(&mut self.places),
            std::mem::take(&mut self.beside),
        );
        for (before, place) in vertices {
            let before = before.filter(|&i| i < places.len());
            self.places.push(before.map_or(place, |i| places[i]));
            self.beside
                .push(before.map_or_else(Beside::default, |i| beside[i]));
        }
        let of_origin = |origin: usize| {
            let numbers = origins.iter().enumerate();
            numbers.filter_map(move |(i, &from)| (from as usize == origin).then_some(i))
        };
        let pairs = std::mem::take(&mut self.pairs);
        for pair in &pairs {
            for one in of_origin(pair.parts[0]) {
                for other in of_origin(pair.parts[1]) {
                    let mut pair = PartPair {
                        parts: [one, other],
                        ..*pair
                    };
                    if one > other {
                        pair.parts.swap(0, 1);
                        pair.back.swap(0, 1);
                    }
                    self.pairs.push(pair);
                }
            }
        }
        self.pairs.sort_unstable_by_key(|pair| pair.parts);
        self.parts.clear();
    }

    /// What vertex `i` has moved by since the last update; nothing in the first one.
    pub(crate) fn moved(&self, i: usize, places: [DVec3; 2]) -> [DVec3; 2] {
        let before = self.places.get(i).copied().unwrap_or(places);
        [places[0] - before[0], places[1] - before[1]]
    }

    /// Notes the places of vertex `i` of a part, in ascending order.
    pub(crate) fn note(&mut self, i: usize, part: &Part, places: [DVec3; 2]) {
        if i >= self.places.len() {
            self.places.push(places);
            self.beside.push(Beside::default());
            return;
        }
        let rests = part.rests(places, self.moved(i, places));
        self.places[i] = places;
        let beside = &mut self.beside[i];
        for ((by, rest), motion) in beside.by.iter_mut().zip(rests).zip(&part.motions) {
            *by = motion.carry(*by, rest);
        }
        let longest = |ways: [DVec3; 2]| larger(ways.map(DVec3::length_squared)).sqrt();
        let (by, now) = (longest(rests), longest(beside.by));
        beside.way.note(by, now);
    }

    /// Starts to note which parts are near each other.
    pub(crate) fn begin_pairs(&mut self, parts: usize) {
        self.parts.resize(parts, 0.0);
        for moved in self
            .parts
            .iter_mut()
            .filter(|moved| **moved < f64::INFINITY)
        {
            *moved = 0.0;
        }
        std::mem::swap(&mut self.pairs, &mut self.last_pairs);
        self.pairs.clear();
    }

    /// Notes that two parts are near each other. Points of both that may be searched for are within `reach` of each other;
    /// `ahead` is the most that the frame brings such points closer by.
    pub(crate) fn note_pair(
        &mut self,
        mut numbers: [usize; 2],
        mut parts: [&Part; 2],
        reach: f64,
        ahead: f64,
    ) {
        if numbers[0] > numbers[1] {
            numbers.swap(0, 1);
            parts.swap(0, 1);
        }
        let known = self
            .last_pairs
            .binary_search_by_key(&numbers, |pair| pair.parts);
        let mut pair = known.map_or(
            PartPair {
                parts: numbers,
                back: [[Rigid::IDENTITY; 2]; 2],
                way: Way::default(),
            },
            |i| self.last_pairs[i],
        );
        let [one, other] = parts.map(|part| &part.motions);
        let reaches = [reach, reach + ahead].map(|reach| BEFORE * reach);
        let balls = [0, 1].map(|k| one[k].between(&other[k], reaches[k]));
        let by = [0, 1].map(|k| one[k].back().differs(&other[k].back(), balls[k]));
        for (back, part) in pair.back.iter_mut().zip(parts) {
            for (back, motion) in back.iter_mut().zip(&part.motions) {
                *back = back.after(&motion.back());
            }
        }
        let [one, other] = &pair.back;
        let now = [0, 1].map(|k| one[k].differs(&other[k], balls[k]));
        pair.way.note(larger(by), larger(now));
        self.pairs.push(pair);
    }

    /// Ends what [`Self::begin_pairs`] began. Pairs that have used up their share start over: what is near the other part has
    /// to be searched for in this update.
    pub(crate) fn end_pairs(&mut self, skin: f64) {
        let (parts, used_up) = (&mut self.parts, &mut self.used_up);
        used_up.clear();
        self.pairs.retain(|pair| {
            let moved = pair.way.bound();
            // What is no number is used up.
            let is_left = moved <= OF_PART * skin;
            if is_left {
                for part in pair.parts {
                    parts[part] = larger([parts[part], moved]);
                }
            } else {
                let [one, other] = pair.parts.map(index);
                used_up.extend([[one, other], [other, one]]);
            }
            is_left
        });
        self.pairs.sort_unstable_by_key(|pair| pair.parts);
        used_up.sort_unstable();
    }

    /// The pairs of parts that have used up their share, each as `[one, other]` and as `[other, one]`, ascending.
    pub(crate) fn used_up_pairs(&self) -> &[[u32; 2]] {
        &self.used_up
    }

    /// Whether the vertices of a part were left out of searches.
    pub(crate) fn is_part_empty(&self, part: usize) -> bool {
        self.parts[part] == f64::INFINITY
    }

    /// Whether vertex `i` has to be searched for again.
    pub(crate) fn is_used_up(&self, i: usize, part: usize, skin: f64) -> bool {
        let is_left = self.beside[i].way.bound() <= (skin - self.parts[part]) / 2.0;
        !is_left
    }

    /// Notes that some vertices are searched for, and are measured from now on.
    pub(crate) fn mark(&mut self) {
        self.beside.iter_mut().for_each(|beside| beside.way.mark());
        self.pairs.iter_mut().for_each(|pair| pair.way.mark());
    }

    /// Notes that vertex `i` is searched for.
    pub(crate) fn renew(&mut self, i: usize) {
        self.beside[i] = Beside::default();
    }

    /// Notes that all vertices of a part are searched for.
    pub(crate) fn renew_part(&mut self, part: usize) {
        self.parts[part] = 0.0;
        self.pairs.retain(|pair| !pair.parts.contains(&part));
    }

    /// Notes that the vertices of a part were not searched for.
    pub(crate) fn empty_part(&mut self, part: usize) {
        self.parts[part] = f64::INFINITY;
    }
}
