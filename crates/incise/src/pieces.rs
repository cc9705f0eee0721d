//! [`PieceNumbers`]: the pieces of all islands under one numbering.
//!
//! Each island tracks its own pieces ([`incise_cutting::PieceTracker`]) and numbers them from 0. Here each gets a
//! number in the scene: at the start island by island, then in the order of detachment, stroke by stroke and within a
//! stroke island by island. Numbers never change, and none is used twice. A piece belongs to one body, since bodies
//! share no particles.
//!
//! Cost: a pass over the tets at the start, then O(1) for each detached piece. In islands with several densities masses
//! are summed over the tets: O(tets) when pieces are detached, and for a report.

use std::collections::BTreeMap;

use incise_cutting::PieceEvent;
use incise_mesh::TetId;

use crate::Error;
use crate::island::Island;
use crate::report::{DetachedReport, PieceReport};

/// A piece of the scene.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
struct Number {
    island: usize,
    /// Its number in the island.
    piece: u32,
    /// The number of its body in the scene.
    body: usize,
}

/// The pieces of all islands.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct PieceNumbers {
    /// Pieces by number in the scene.
    pieces: Vec<Number>,
    /// For each island the numbers of its pieces in the scene, in the order of their own.
    of_island: Vec<Numbers>,
}

/// The numbers in the scene of an island's pieces.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
struct Numbers(Vec<u32>);

impl PieceNumbers {
    /// The pieces before all cuts.
    pub(crate) fn new(islands: &[Island]) -> Self {
        let mut numbers = Self::default();
        for island in islands {
            numbers.add_island(island);
        }
        numbers
    }

    /// Numbers the pieces of an island that is added to those there are.
    pub(crate) fn add_island(&mut self, island: &Island) {
        let number = self.of_island.len();
        self.of_island.push(Numbers::default());
        let mut known = 0;
        for t in (0..island.cuttable.mesh().tets.len()).map(TetId::new) {
            let piece = island.pieces.piece_of(t);
            // Pieces are numbered in the order of their first tets.
            if piece == known {
                known += 1;
                self.add(Number {
                    island: number,
                    piece,
                    body: island.body_of_tet(t),
                });
            }
        }
    }

    /// Notes that the pieces of island `other` were appended to those of island `into`, and later islands moved up. No
    /// number in the scene changes. O(pieces).
    pub(crate) fn join(&mut self, into: usize, other: usize) {
        let of_other = self.of_island.remove(other);
        let first = u32::try_from(self.of_island[into].0.len()).expect("fewer than 2³² pieces");
        self.of_island[into].0.extend(of_other.0);
        for piece in &mut self.pieces {
            if piece.island == other {
                piece.island = into;
                piece.piece += first;
            } else if piece.island > other {
                piece.island -= 1;
            }
        }
    }

    fn add(&mut self, number: Number) -> u32 {
        let id = u32::try_from(self.pieces.len()).expect("fewer pieces than particles");
        self.pieces.push(number);
        self.of_island[number.island].0.push(id);
        id
    }

    /// Numbers the pieces detached in an island and adds them to `detached`.
    pub(crate) fn apply_delta(
        &mut self,
        number: usize,
        island: &Island,
        events: &[PieceEvent],
        detached: &mut Vec<DetachedReport>,
    ) {
        let new = |event: &PieceEvent| match *event {
            PieceEvent::Detached { piece, .. } => Some(piece),
            _ => None,
        };
        let density = island.density();
        let masses = match density {
            None if events.iter().any(|event| new(event).is_some()) => {
                island.masses(|piece| events.iter().any(|event| new(event) == Some(piece)))
            }
            _ => BTreeMap::new(),
        };
        for event in events {
            // A piece that vanished keeps its number and is no longer listed.
            let PieceEvent::Detached {
                piece,
                from,
                tets,
                volume,
            } = *event
            else {
                continue;
            };
            let from = self.of_island[number].0[from as usize];
            let parent = self.pieces[from as usize];
            detached.push(DetachedReport {
                piece: self.add(Number { piece, ..parent }),
                from,
                tets,
                volume,
                mass: mass_of(density, &masses, piece, volume),
            });
        }
    }

    /// The number in the scene of a piece of an island of a number, and that of its body.
    pub(crate) fn of_scene(&self, number: usize, piece: u32) -> (u32, usize) {
        let id = self.of_island[number].0[piece as usize];
        (id, self.pieces[id as usize].body)
    }

    /// All pieces that exist, in the order of their numbers.
    pub(crate) fn report(&self, islands: &[Island]) -> Vec<PieceReport> {
        let densities: Vec<_> = islands.iter().map(Island::density).collect();
        let masses = islands.iter().zip(&densities);
        let masses: Vec<_> = masses
            .map(|(island, density)| match density {
                Some(_) => BTreeMap::new(),
                None => island.masses(|_| true),
            })
            .collect();
        let reports = self.pieces.iter().zip(0..).filter_map(|(number, id)| {
            let piece = islands[number.island].pieces.piece(number.piece)?;
            let of_island = &self.of_island[number.island].0;
            Some(PieceReport {
                id,
                parent: piece.parent.map(|parent| of_island[parent as usize]),
                body: number.body,
                tets: piece.tets,
                volume: piece.volume,
                mass: {
                    let (density, masses) = (densities[number.island], &masses[number.island]);
                    mass_of(density, masses, number.piece, piece.volume)
                },
            })
        });
        reports.collect()
    }

    /// The number of the piece of each tet of an island of a number, in the order of its tets. O(tets).
    pub(crate) fn of_tets<'a>(
        &'a self,
        number: usize,
        island: &'a Island,
    ) -> impl ExactSizeIterator<Item = u32> + 'a {
        let tets = 0..island.cuttable.mesh().tets.len();
        tets.map(move |t| {
            let piece = island.pieces.piece_of(TetId::new(t));
            self.of_island[number].0[piece as usize]
        })
    }

    /// Compares with the islands: each of their pieces has one number, and it is on the body that its tets are of.
    pub(crate) fn check(&self, islands: &[Island]) -> Result<(), Error> {
        let differs = |what: String| Err(Error::Inconsistent(what));
        for (g, island) in islands.iter().enumerate() {
            for t in 0..island.cuttable.mesh().tets.len() {
                let piece = island.pieces.piece_of(TetId::new(t));
                let number = self.of_island[g].0.get(piece as usize);
                let Some(number) = number.map(|&id| &self.pieces[id as usize]) else {
                    return differs(format!("piece {piece} of island {g} has no number"));
                };
                let expected = (g, piece, island.body_of_tet(TetId::new(t)));
                if (number.island, number.piece, number.body) != expected {
                    return differs(format!("piece {piece} of island {g} has another's number"));
                }
            }
        }
        Ok(())
    }
}

/// The mass of a piece in kg: its volume times the density of its island, or the sum over its tets.
fn mass_of(density: Option<f64>, masses: &BTreeMap<u32, f64>, piece: u32, volume: f64) -> f64 {
    density.map_or_else(
        || masses.get(&piece).copied().unwrap_or(0.0),
        |density| density * volume,
    )
}
