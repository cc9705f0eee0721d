//! [`Crumbs`]: parts too small to come off, and what they stay with.
//!
//! Before a face is cut, the tets on both sides are followed through uncut faces until they are found to be more than a
//! crumb, or to be all of one. A crumb stays with the tet behind the largest of its faces that are to be cut, on the
//! other side of the cut, and with all others that it touches there where tets around it lead to them without passing
//! the cut. A crumb that touches only crumbs stays with one of these, by one face. Its faces to anything else are cut, so
//! a crumb never ties parts that the cut separates. Nothing is taken
//! away: volume, mass and momentum are kept, and the cut runs around the crumb instead. Crumbs stay only with something
//! several times larger, so that a body of a few tets can be cut.
//!
//! Faces are asked for as they were before separation, so the answers do not depend on how far that is. Cost: a search
//! ends as soon as it has found more than a crumb or comes to a tet known to be part of more, so along a cut it costs
//! little more than a look at each tet.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use foldhash::fast::FixedState;
use glam::DVec3;
use incise_mesh::{ParticleId, TetId};

use crate::faces::{Behind, Face};
use crate::operation::Operation;

/// What a tet is part of.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Part {
    /// The part of a number, all of which is known.
    Small(usize),
    /// Something larger.
    Larger,
}

/// A part that would come off whole. It is a crumb if it is too small to.
#[derive(Debug)]
struct SmallPart {
    tets: Vec<TetId>,
    is_crumb: bool,
    /// The faces to something larger, seen from its own tets, that are not cut; ascending. `None` before they are asked
    /// for.
    kept: Option<Vec<Face>>,
    /// The face to another crumb that is not cut. `None` before it is asked for.
    beside: Option<Option<Face>>,
}

impl SmallPart {
    fn is_kept(&self) -> bool {
        let stays = self.kept.as_ref().is_some_and(|kept| !kept.is_empty());
        stays || matches!(self.beside, Some(Some(_)))
    }
}

/// The known crumbs along a cut.
#[derive(Debug)]
pub(crate) struct Crumbs {
    /// Parts of a smaller volume at rest are crumbs, in m³; 0 if there are none.
    limit: f64,
    /// Never iterated.
    part_of: HashMap<TetId, Part, FixedState>,
    small: Vec<SmallPart>,
}

/// How many times the largest crumb a part must be for crumbs to stay with it: a body of a few tets has none, whatever is
/// cut off.
const LARGER: f64 = 8.0;

impl Crumbs {
    pub(crate) fn new(limit: f64) -> Self {
        Self {
            limit,
            part_of: HashMap::default(),
            small: Vec::new(),
        }
    }

    /// How many crumbs were kept from coming off, and their volume in m³.
    pub(crate) fn kept(&self, operation: &Operation<'_>) -> (usize, f64) {
        let kept = self.small.iter().filter(|part| part.is_kept());
        let mesh = &operation.cuttable.mesh;
        let volumes = kept.clone().flat_map(|part| &part.tets);
        (kept.count(), volumes.map(|&tet| mesh.volume(tet)).sum())
    }

    /// Whether a face that is to be cut stays because a crumb keeps it. `is_cut` says which faces are to be cut.
    pub(crate) fn keep(
        &mut self,
        operation: &Operation<'_>,
        face: Face,
        is_cut: &impl Fn(&Operation<'_>, Face) -> bool,
    ) -> bool {
        let Behind::Twin(twin) = operation.cuttable.faces.behind(face) else {
            return false;
        };
        if self.limit <= 0.0 {
            return false;
        }
        let parts = [face, twin].map(|side| self.part(operation, side.tet(), is_cut));
        let (crumb, own) = match parts {
            [Part::Small(crumb), Part::Larger] => (crumb, face),
            [Part::Larger, Part::Small(crumb)] => (crumb, twin),
            // Of two crumbs beside each other each stays with something larger, if it touches that.
            [Part::Small(one), Part::Small(other)] if one != other => {
                return self.face_beside(operation, one, is_cut) == Some(face)
                    || self.face_beside(operation, other, is_cut) == Some(twin);
            }
            _ => return false,
        };
        let kept = self.kept_faces(operation, crumb, is_cut);
        kept.binary_search(&own).is_ok()
    }

    /// The faces that tie a small part to something larger; none if it is no crumb.
    fn kept_faces(
        &mut self,
        operation: &Operation<'_>,
        crumb: usize,
        is_cut: &impl Fn(&Operation<'_>, Face) -> bool,
    ) -> &[Face] {
        if self.small[crumb].kept.is_none() {
            let kept = match self.small[crumb].is_crumb {
                true => self.faces_to_keep(operation, crumb, is_cut),
                false => Vec::new(),
            };
            self.small[crumb].kept = Some(kept);
        }
        self.small[crumb].kept.as_deref().unwrap_or_default()
    }

    /// The face that ties a crumb that touches nothing larger to one that does: the largest.
    fn face_beside(
        &mut self,
        operation: &Operation<'_>,
        crumb: usize,
        is_cut: &impl Fn(&Operation<'_>, Face) -> bool,
    ) -> Option<Face> {
        if let Some(known) = self.small[crumb].beside {
            return known;
        }
        let mut largest: Option<(f64, Face)> = None;
        if self.small[crumb].is_crumb && self.kept_faces(operation, crumb, is_cut).is_empty() {
            let mut faces = self.faces_of(crumb);
            faces.retain(|&face| is_cut(operation, face));
            for face in faces {
                let Behind::Twin(twin) = operation.cuttable.faces.behind(face) else {
                    continue;
                };
                let Part::Small(other) = self.part(operation, twin.tet(), is_cut) else {
                    continue;
                };
                let area = area(operation, face);
                let is_held = !self.kept_faces(operation, other, is_cut).is_empty();
                if is_held && largest.is_none_or(|(most, _)| area > most) {
                    largest = Some((area, face));
                }
            }
        }
        let beside = largest.map(|(_, face)| face);
        self.small[crumb].beside = Some(beside);
        beside
    }

    /// The faces of the tets of a part; ascending.
    fn faces_of(&self, part: usize) -> Vec<Face> {
        let tets = &self.small[part].tets;
        let mut faces: Vec<Face> = tets.iter().flat_map(|&tet| Face::of(tet)).collect();
        faces.sort_unstable();
        faces
    }

    /// What a tet is part of once the faces that are to be cut are.
    fn part(
        &mut self,
        operation: &Operation<'_>,
        tet: TetId,
        is_cut: &impl Fn(&Operation<'_>, Face) -> bool,
    ) -> Part {
        if let Some(&known) = self.part_of.get(&tet) {
            return known;
        }
        let this = Part::Small(self.small.len());
        self.part_of.insert(tet, this);
        let mut tets = vec![tet];
        let (mut next, mut volume, mut larger) = (0, 0.0, false);
        while let Some(&tet) = tets.get(next).filter(|_| !larger) {
            next += 1;
            volume += operation.cuttable.mesh.volume(tet);
            larger = volume > LARGER * self.limit;
            for twin in uncut_neighbors(operation, tet, is_cut) {
                match self.part_of.entry(twin) {
                    Entry::Vacant(entry) => {
                        entry.insert(this);
                        tets.push(twin);
                    }
                    Entry::Occupied(known) => larger |= *known.get() == Part::Larger,
                }
            }
        }
        if larger {
            for tet in tets {
                self.part_of.insert(tet, Part::Larger);
            }
            return Part::Larger;
        }
        let is_crumb = volume <= self.limit;
        self.small.push(SmallPart {
            tets,
            is_crumb,
            kept: None,
            beside: None,
        });
        this
    }

    /// The faces that tie a crumb to the part behind its largest face that is to be cut; ascending.
    fn faces_to_keep(
        &mut self,
        operation: &Operation<'_>,
        crumb: usize,
        is_cut: &impl Fn(&Operation<'_>, Face) -> bool,
    ) -> Vec<Face> {
        let mesh = &operation.cuttable.mesh;
        let tets = self.small[crumb].tets.clone();
        let mut largest: Option<(f64, TetId)> = None;
        let mut outside: Vec<(Face, TetId)> = Vec::new();
        for face in self.faces_of(crumb) {
            let Behind::Twin(twin) = operation.cuttable.faces.behind(face) else {
                continue;
            };
            if !is_cut(operation, face) || self.part(operation, twin.tet(), is_cut) != Part::Larger
            {
                continue;
            }
            let area = area(operation, face);
            if largest.is_none_or(|(most, _)| area > most) {
                largest = Some((area, twin.tet()));
            }
            outside.push((face, twin.tet()));
        }
        let Some((_, first)) = largest else {
            return Vec::new();
        };
        // Through the tets that touch the crumb.
        let particles = |tet: TetId| mesh.tets[tet.index()].map(|p| operation.source(p));
        let mut touched: Vec<ParticleId> = tets.iter().flat_map(|&tet| particles(tet)).collect();
        touched.sort_unstable();
        touched.dedup();
        let mut found: HashMap<TetId, (), FixedState> = HashMap::default();
        found.insert(first, ());
        let mut due = vec![first];
        while let Some(tet) = due.pop() {
            for twin in uncut_neighbors(operation, tet, is_cut) {
                let touches = |p: &ParticleId| touched.binary_search(p).is_ok();
                if particles(twin).iter().any(touches) && found.insert(twin, ()).is_none() {
                    due.push(twin);
                }
            }
        }
        outside.retain(|(_, tet)| found.contains_key(tet));
        outside.into_iter().map(|(face, _)| face).collect()
    }
}

/// Twice the area of a face at rest in m².
fn area(operation: &Operation<'_>, face: Face) -> f64 {
    let mesh = &operation.cuttable.mesh;
    let [a, b, c] = face.particles(mesh).map(|p| mesh.positions[p.index()]);
    DVec3::cross(b - a, c - a).length()
}

/// The tets behind the faces of a tet that are not to be cut.
fn uncut_neighbors(
    operation: &Operation<'_>,
    tet: TetId,
    is_cut: &impl Fn(&Operation<'_>, Face) -> bool,
) -> impl Iterator<Item = TetId> {
    let behind = Face::of(tet).map(|face| match operation.cuttable.faces.behind(face) {
        Behind::Twin(twin) if !is_cut(operation, face) => Some(twin.tet()),
        _ => None,
    });
    behind.into_iter().flatten()
}
