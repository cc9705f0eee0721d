//! [`PieceNumbers`]: the pieces of all groups under one numbering.
//!
//! Each group follows its own pieces ([`incise_cutting::PieceTracker`]) and numbers them from 0. Here each gets a number
//! in the scene: at the start group by group, then as they come off, stroke by stroke and within a stroke group by
//! group. Numbers stay and none is used twice. A piece belongs to one body, as bodies share no particles, so its mass is
//! its volume times the body's density.
//!
//! Cost: a pass over the tets at the start, then a line for each piece that comes off.

use incise_cutting::PieceEvent;
use incise_mesh::TetId;

use crate::Error;
use crate::backend::each;
use crate::group::Group;
use crate::report::{DetachedReport, PieceReport};

/// A piece of the scene.
#[derive(Clone, Copy, Debug)]
struct Number {
    group: usize,
    /// Its number in the group.
    piece: u32,
    /// The number of its body in the scene.
    body: usize,
    /// In kg/m³.
    density: f64,
}

/// The pieces of all groups.
#[derive(Clone, Debug, Default)]
pub(crate) struct PieceNumbers {
    /// By number in the scene.
    pieces: Vec<Number>,
    /// For each group the numbers of its pieces in the scene, in the order of their own.
    of_group: Vec<Numbers>,
}

/// The numbers in the scene of a group's pieces.
#[derive(Clone, Debug, Default)]
struct Numbers(Vec<u32>);

impl PieceNumbers {
    /// The pieces before all cuts.
    pub(crate) fn new(groups: &[Group]) -> Self {
        let mut numbers = Self::default();
        for (g, group) in groups.iter().enumerate() {
            numbers.of_group.push(Numbers::default());
            let mut known = 0;
            for t in 0..group.cuttable.mesh().tets.len() {
                let piece = group.pieces.piece_of(TetId::new(t));
                // Pieces are numbered in the order of their first tets.
                if piece == known {
                    known += 1;
                    let (material, density) = each!(&group.solver, solver => {
                        (solver.material_of(t), solver.density_of(t))
                    });
                    numbers.add(Number {
                        group: g,
                        piece,
                        // Each body has a material of its own.
                        body: group.bodies[usize::from(material)],
                        density,
                    });
                }
            }
        }
        numbers
    }

    fn add(&mut self, number: Number) -> u32 {
        let id = u32::try_from(self.pieces.len()).expect("fewer pieces than particles");
        self.pieces.push(number);
        self.of_group[number.group].0.push(id);
        id
    }

    /// Notes what came off in a group; adds it to `detached`.
    pub(crate) fn follow(
        &mut self,
        group: usize,
        events: &[PieceEvent],
        detached: &mut Vec<DetachedReport>,
    ) {
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
            let from = self.of_group[group].0[from as usize];
            let parent = self.pieces[from as usize];
            detached.push(DetachedReport {
                piece: self.add(Number { piece, ..parent }),
                from,
                tets,
                volume,
                mass: parent.density * volume,
            });
        }
    }

    /// All pieces that exist, in the order of their numbers.
    pub(crate) fn report(&self, groups: &[Group]) -> Vec<PieceReport> {
        let reports = self.pieces.iter().zip(0..).filter_map(|(number, id)| {
            let piece = groups[number.group].pieces.piece(number.piece)?;
            let of_group = &self.of_group[number.group].0;
            Some(PieceReport {
                id,
                parent: piece.parent.map(|parent| of_group[parent as usize]),
                body: number.body,
                tets: piece.tets,
                volume: piece.volume,
                mass: number.density * piece.volume,
            })
        });
        reports.collect()
    }

    /// Compares with the groups: each of their pieces has one number, and it is on the body that its tets are of.
    pub(crate) fn check(&self, groups: &[Group]) -> Result<(), Error> {
        let differs = |what: String| Err(Error::Inconsistent(what));
        for (g, group) in groups.iter().enumerate() {
            for t in 0..group.cuttable.mesh().tets.len() {
                let piece = group.pieces.piece_of(TetId::new(t));
                let number = self.of_group[g].0.get(piece as usize);
                let Some(&Number {
                    group: of,
                    piece: own,
                    body,
                    density,
                }) = number.map(|&id| &self.pieces[id as usize])
                else {
                    return differs(format!("piece {piece} of group {g} has no number"));
                };
                let (material, dense) = each!(&group.solver, solver => {
                    (solver.material_of(t), solver.density_of(t))
                });
                let expected = (g, piece, group.bodies[usize::from(material)]);
                if (of, own, body) != expected || density.to_bits() != dense.to_bits() {
                    return differs(format!("piece {piece} of group {g} has another's number"));
                }
            }
        }
        Ok(())
    }
}
