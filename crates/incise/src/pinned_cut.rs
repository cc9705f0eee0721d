//! [`PinnedCut`]: whether a stroke has cut where pinned particles keep both sides together.
//!
//! A copy of a particle is fixed, or attached to the frame of an attachment, if the particle is. Cut faces inside a
//! pinned region therefore cannot open. Two cases are reported:
//!
//! - *Closed*: more than half of the area that the stroke has opened, at rest, is in faces with at least two pinned
//!   corners, which can at most turn about an edge.
//! - *Rim*: the stroke separates parts, each of them is pinned, and one of them only by particles of the tets along the
//!   cut. A plane just inside a pinned region leaves such a rim, whose teeth are the particles between plane and border.
//!
//! Grabs and attachments with compliance do not pin. Cost: a look at the new cut faces of each frame; at the end of a
//! stroke with a pinned one O(particles + boundary), else nothing.

use std::collections::BTreeMap;

use glam::DVec3;
use incise_cutting::{BoundaryTriangle, CutDelta, FaceTag};
use incise_mesh::{Bounds, ParticleId};

use crate::island::Island;
use crate::text::counted;
use crate::warning::{Warning, WarningCode, box_text};

/// A cut that pinned particles keep closed.
#[derive(Clone, Debug)]
pub(crate) struct PinnedCut {
    kind: Kind,
    /// What pins, as in `body[0].fixed, attachment[1]`.
    by: String,
    /// Box of the pinned particles along the cut, at present.
    bounds: Bounds,
}

impl PinnedCut {
    /// The warning about it, for the stroke at a place like `stroke[0]`.
    pub(crate) fn warning(&self, field: &str) -> Warning {
        let Self { kind, by, bounds } = self;
        let what = match kind {
            Kind::Closed { fraction } => {
                let percent = 100.0 * fraction;
                format!("{percent:.0}% of the cut's area is pinned on both sides and cannot open")
            }
            Kind::Rim { particles, tets } => {
                let particles = counted(*particles, "particle");
                let tets = counted(*tets, "tet");
                format!(
                    "a part of {tets} that the stroke separates stays pinned by {particles} along the cut"
                )
            }
        };
        Warning {
            code: WarningCode::PinnedCut,
            message: format!(
                "{what}: {by} pins it, in {}; move the stroke out of the pinned region by more than a tet, or shrink the \
                 region",
                box_text(bounds)
            ),
            location: field.to_owned(),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// The part of the cut's area whose faces are pinned.
    Closed { fraction: f64 },
    /// A part that only particles along the cut pin: their number and that of its tets.
    Rim { particles: usize, tets: usize },
}

/// The faces of a delta that a stroke of a number has opened.
fn opened(delta: &CutDelta, stroke: u32) -> impl Iterator<Item = &BoundaryTriangle> {
    let faces = delta.surface_added.iter();
    faces.filter(move |face| face.tag == FaceTag::Cut(stroke))
}

/// Whether a stroke has opened a face with a pinned corner.
pub(crate) fn meets_pinned(island: &Island, delta: &CutDelta, stroke: u32) -> bool {
    let mut corners = opened(delta, stroke).flat_map(|face| face.particles);
    corners.any(|p| is_pinned(island, p))
}

/// Looks at the faces that a stroke has opened in an island.
pub(crate) fn find(island: &Island, stroke: u32) -> Option<PinnedCut> {
    let mesh = island.cuttable.mesh();
    let faces: Vec<BoundaryTriangle> = island
        .cuttable
        .boundary()
        .filter(|face| face.tag == FaceTag::Cut(stroke))
        .collect();
    let (mut area, mut closed) = (0.0, 0.0);
    for face in &faces {
        let [a, b, c] = face.particles.map(|p| mesh.positions[p.index()]);
        let twice = DVec3::cross(b - a, c - a).length();
        area += twice;
        if face
            .particles
            .iter()
            .filter(|p| is_pinned(island, **p))
            .count()
            > 1
        {
            closed += twice;
        }
    }
    let corners = faces.iter().flat_map(|face| face.particles);
    let along: Vec<ParticleId> = {
        let tets = corners.flat_map(|p| island.cuttable.around(p));
        let mut along: Vec<_> = tets.flat_map(|tet| mesh.tets[tet.index()]).collect();
        along.sort_unstable();
        along.dedup();
        along.retain(|p| is_pinned(island, *p));
        along
    };
    let kind = if closed > 0.5 * area {
        Kind::Closed {
            fraction: closed / area,
        }
    } else {
        rim(island, &faces, &along)?
    };
    let mut by: Vec<String> = along.iter().filter_map(|p| pinned_by(island, *p)).collect();
    by.sort_unstable();
    by.dedup();
    Some(PinnedCut {
        kind,
        by: by.join(", "),
        bounds: Bounds::around(along.iter().map(|p| island.positions[p.index()])),
    })
}

/// The largest of the parts on the cut that only particles `along` it pin, if all parts are pinned.
fn rim(island: &Island, faces: &[BoundaryTriangle], along: &[ParticleId]) -> Option<Kind> {
    /// Pinned particles of a part.
    #[derive(Default)]
    struct Pinned {
        along: usize,
        elsewhere: usize,
    }
    let pieces = faces.iter().map(|face| island.pieces.piece_of(face.tet));
    let mut parts: BTreeMap<u32, Pinned> = pieces.map(|piece| (piece, Pinned::default())).collect();
    if parts.len() < 2 {
        return None;
    }
    for p in (0..island.positions.len()).map(ParticleId::new) {
        if !is_pinned(island, p) {
            continue;
        }
        let piece = island.piece_of(p.index());
        if let Some(part) = piece.and_then(|piece| parts.get_mut(&piece)) {
            match along.binary_search(&p) {
                Ok(_) => part.along += 1,
                Err(_) => part.elsewhere += 1,
            }
        }
    }
    if parts.values().any(|part| part.along + part.elsewhere == 0) {
        return None;
    }
    let rims = parts.iter().filter(|(_, part)| part.elsewhere == 0);
    let rims = rims.filter_map(|(&piece, part)| {
        let tets = island.pieces.piece(piece)?.tets;
        Some((tets, part.along))
    });
    let (tets, particles) = rims.max()?;
    Some(Kind::Rim { particles, tets })
}

/// Whether a particle is fixed or rigidly attached, and not by a grab.
fn is_pinned(island: &Island, p: ParticleId) -> bool {
    !island.solver.host().is_free(p.index()) && pinned_by(island, p).is_some()
}

/// The key of the scene that pins a particle.
fn pinned_by(island: &Island, p: ParticleId) -> Option<String> {
    let solver = island.solver.host();
    if solver.is_fixed(p.index()) {
        let tet = island.cuttable.around(p).next()?;
        return Some(format!("body[{}].fixed", island.body_of_tet(tet)));
    }
    let handle = solver.handle_of(p.index());
    let mut attachments = island.constraints.attachments.iter();
    let of_handle = attachments.find(|attachment| Some(attachment.number) == handle)?;
    Some(of_handle.field().to_owned())
}
