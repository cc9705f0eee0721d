//! [`repair`]: repairs common faults of meshes from other programs, as selected, and reports them item by item.
//!
//! Only selected repairs are made, and each is counted. The order is such that later steps fix the consequences of
//! earlier ones: coincident particles are merged, which may degenerate tets; degenerate tets are removed; inverted tets
//! are flipped; repeated tets are removed but for the first; all pieces but the largest are removed; unused particles
//! are removed. Overlapping bodies and holes are not repaired: [`TetMesh::check`] finds them.
//!
//! Particles within a distance are merged by a sweep along x with union-find, so chains of close particles become one.
//! Cost: O(n log n), and O(n times the particles within the distance in x) to merge across a distance.

use std::fmt;

use crate::{DisjointSets, ParticleId, TetId, TetMesh, orientation};

/// The repairs to make; none by default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RepairOptions {
    /// Merges particles that are at most this far apart, in m; 0 merges coincident ones.
    pub merge_within: Option<f64>,
    /// Removes tets without volume and tets with a corner that is repeated, missing or not finite.
    pub remove_degenerate: bool,
    /// Flips inverted tets.
    pub flip_inverted: bool,
    /// Removes all but the first of tets with the same corners.
    pub remove_duplicates: bool,
    /// Keeps only the piece of the largest volume; ties go to the first.
    pub keep_largest_piece: bool,
    /// Removes particles that no tet uses.
    pub drop_unused: bool,
}

impl RepairOptions {
    /// All repairs, with coincident particles merged.
    pub const ALL: Self = Self {
        merge_within: Some(0.0),
        remove_degenerate: true,
        flip_inverted: true,
        remove_duplicates: true,
        keep_largest_piece: true,
        drop_unused: true,
    };
}

/// The numbers of repairs made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct RepairReport {
    /// Particles merged into another.
    pub merged: usize,
    /// Tets removed because they have no volume.
    pub degenerate: usize,
    /// Tets flipped.
    pub flipped: usize,
    /// Tets removed because an earlier one has the same corners.
    pub duplicates: usize,
    /// Pieces removed.
    pub pieces: usize,
    /// Tets of removed pieces.
    pub tets_of_pieces: usize,
    /// Particles removed because no tet uses them, without merged ones.
    pub unused: usize,
}

impl fmt::Display for RepairReport {
    /// One line per item with a count above 0; `nothing` if all are 0.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let items = [
            (self.merged, "particle", "merged with another"),
            (self.degenerate, "tet", "without volume removed"),
            (self.flipped, "tet", "turned from inside out"),
            (self.duplicates, "repeated tet", "removed"),
            (self.pieces, "piece", "removed beside the largest"),
            (self.tets_of_pieces, "tet", "removed with it"),
            (self.unused, "particle", "removed that no tet uses"),
        ];
        let items = items.map(|(count, noun, what)| {
            let ending = if count == 1 { "" } else { "s" };
            (count, format!("{noun}{ending} {what}"))
        });
        let mut lines = items.into_iter().filter(|(count, _)| *count > 0);
        match lines.next() {
            None => f.write_str("nothing"),
            Some((count, what)) => {
                write!(f, "{count} {what}")?;
                lines.try_for_each(|(count, what)| write!(f, "\n{count} {what}"))
            }
        }
    }
}

/// A repaired mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Repaired {
    /// The mesh.
    pub mesh: TetMesh,
    /// The repairs made.
    pub report: RepairReport,
    /// Particle -> its number in the original mesh.
    pub particles: Vec<ParticleId>,
    /// Tet -> its number in the original mesh.
    pub tets: Vec<TetId>,
}

/// Repairs a mesh. Remaining items keep their order.
///
/// # Panics
/// If tets are to be flipped or pieces to be counted while a corner of a tet does not exist (removing degenerate tets
/// removes such tets first), or if the distance to merge within is NaN.
///
/// # Example
/// ```
/// use incise_mesh::{RepairOptions, glam::DVec3, kuhn_box, repair};
///
/// let mut mesh = kuhn_box([2, 1, 1], DVec3::ONE);
/// mesh.tets[0].swap(0, 1); // inside out
/// mesh.positions.push(DVec3::ZERO); // used by no tet
/// let repaired = repair(&mesh, &RepairOptions::ALL);
/// assert_eq!(repaired.mesh, kuhn_box([2, 1, 1], DVec3::ONE));
/// assert_eq!((repaired.report.flipped, repaired.report.merged), (1, 1));
/// ```
#[must_use]
pub fn repair(mesh: &TetMesh, options: &RepairOptions) -> Repaired {
    let mut report = RepairReport::default();
    let mut tets: Vec<(TetId, [ParticleId; 4])> = (0..mesh.tets.len())
        .map(TetId::new)
        .zip(mesh.tets.iter().copied())
        .collect();
    let mut merged = vec![false; mesh.positions.len()];
    if let Some(distance) = options.merge_within {
        let stand_ins = stand_ins(mesh, distance);
        for (p, &stand_in) in stand_ins.iter().enumerate() {
            merged[p] = stand_in.index() != p;
            report.merged += usize::from(merged[p]);
        }
        let known = |p: ParticleId| stand_ins.get(p.index()).copied().unwrap_or(p);
        for (_, corners) in &mut tets {
            *corners = corners.map(known);
        }
    }
    if options.remove_degenerate {
        let before = tets.len();
        tets.retain(|(_, corners)| side(mesh, *corners).is_some_and(|side| side != 0.0));
        report.degenerate = before - tets.len();
    }
    if options.flip_inverted {
        for (_, corners) in &mut tets {
            if side(mesh, *corners).is_some_and(|side| side < 0.0) {
                corners.swap(0, 1);
                report.flipped += 1;
            }
        }
    }
    if options.remove_duplicates {
        report.duplicates = remove_duplicates(&mut tets);
    }
    if options.keep_largest_piece {
        (report.pieces, report.tets_of_pieces) = keep_largest_piece(mesh, &mut tets);
    }
    let keeps = kept(mesh, &tets, &merged, options.drop_unused);
    let particles: Vec<ParticleId> = (0..mesh.positions.len())
        .filter(|&p| keeps[p])
        .map(ParticleId::new)
        .collect();
    report.unused = mesh.positions.len() - particles.len() - gone(&merged, &keeps);
    let mut numbers = vec![ParticleId(u32::MAX); mesh.positions.len()];
    for (number, p) in particles.iter().enumerate() {
        numbers[p.index()] = ParticleId::new(number);
    }
    let number = |p: ParticleId| numbers.get(p.index()).copied().unwrap_or(p);
    let sources = tets.iter().map(|(tet, _)| *tet).collect();
    Repaired {
        mesh: TetMesh {
            positions: particles
                .iter()
                .map(|p| mesh.positions[p.index()])
                .collect(),
            tets: tets
                .iter()
                .map(|(_, corners)| corners.map(number))
                .collect(),
        },
        report,
        particles,
        tets: sources,
    }
}

/// True for each particle that stays: all, or those of tets; merged particles are removed unless a tet still uses them.
fn kept(
    mesh: &TetMesh,
    tets: &[(TetId, [ParticleId; 4])],
    merged: &[bool],
    drop_unused: bool,
) -> Vec<bool> {
    let mut keeps: Vec<bool> = merged
        .iter()
        .map(|&merged| !merged && !drop_unused)
        .collect();
    for p in tets.iter().flat_map(|(_, corners)| corners) {
        if p.index() < mesh.positions.len() {
            keeps[p.index()] = true;
        }
    }
    keeps
}

/// The number of merged particles that are removed.
fn gone(merged: &[bool], keeps: &[bool]) -> usize {
    let pairs = merged.iter().zip(keeps);
    pairs.filter(|&(&merged, &keeps)| merged && !keeps).count()
}

/// The sign of the volume of a tet; `None` if a corner is missing, repeated or not finite.
fn side(mesh: &TetMesh, corners: [ParticleId; 4]) -> Option<f64> {
    let repeated = (0..4).any(|i| corners[..i].contains(&corners[i]));
    if repeated {
        return None;
    }
    let mut positions = [mesh.positions.first().copied()?; 4];
    for (position, p) in positions.iter_mut().zip(corners) {
        *position = *mesh.positions.get(p.index())?;
        if !position.is_finite() {
            return None;
        }
    }
    Some(orientation(positions))
}

/// For each particle the first one with which it is merged; itself if there is none.
fn stand_ins(mesh: &TetMesh, distance: f64) -> Vec<ParticleId> {
    assert!(
        !distance.is_nan(),
        "the distance to merge within is a number"
    );
    let positions = &mesh.positions;
    let mut order: Vec<usize> = (0..positions.len())
        .filter(|&p| positions[p].is_finite())
        .collect();
    order.sort_unstable_by(|&p, &q| positions[p].x.total_cmp(&positions[q].x).then(p.cmp(&q)));
    let mut sets = DisjointSets::new(positions.len());
    for (i, &p) in order.iter().enumerate() {
        for &q in &order[i + 1..] {
            if positions[q].x - positions[p].x > distance {
                break;
            }
            if positions[p].distance(positions[q]) <= distance {
                sets.unite(ParticleId::new(p).0, ParticleId::new(q).0);
            }
        }
    }
    (0..positions.len())
        .map(|p| ParticleId(sets.root(ParticleId::new(p).0)))
        .collect()
}

/// Removes tets with the corners of an earlier one; returns their number.
fn remove_duplicates(tets: &mut Vec<(TetId, [ParticleId; 4])>) -> usize {
    let mut sorted: Vec<([ParticleId; 4], usize)> = tets
        .iter()
        .enumerate()
        .map(|(place, &(_, mut corners))| {
            corners.sort_unstable();
            (corners, place)
        })
        .collect();
    sorted.sort_unstable();
    let mut keeps = vec![true; tets.len()];
    for pair in sorted.windows(2) {
        if pair[0].0 == pair[1].0 {
            keeps[pair[1].1] = false;
        }
    }
    let before = tets.len();
    let mut keeps = keeps.into_iter();
    tets.retain(|_| keeps.next().unwrap_or(true));
    before - tets.len()
}

/// Removes all pieces but the largest; returns the numbers of pieces and of their tets.
fn keep_largest_piece(mesh: &TetMesh, tets: &mut Vec<(TetId, [ParticleId; 4])>) -> (usize, usize) {
    let rest = TetMesh {
        positions: mesh.positions.clone(),
        tets: tets.iter().map(|(_, corners)| *corners).collect(),
    };
    let pieces = rest.pieces();
    let volumes = pieces.volumes(&rest);
    let mut largest = 0;
    for (piece, volume) in volumes.iter().enumerate() {
        if *volume > volumes[largest] {
            largest = piece;
        }
    }
    let before = tets.len();
    let mut labels = pieces.labels.iter();
    tets.retain(|_| labels.next().is_none_or(|&label| label as usize == largest));
    (pieces.count.saturating_sub(1), before - tets.len())
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use proptest::prelude::*;

    use super::*;
    use crate::kuhn_box;

    #[test]
    fn only_selected_repairs_are_made() {
        let mut mesh = kuhn_box([2, 2, 1], DVec3::ONE);
        mesh.tets[3].swap(1, 2);
        mesh.positions.push(DVec3::ONE);
        let repaired = repair(&mesh, &RepairOptions::default());
        assert_eq!(
            (repaired.mesh, repaired.report.to_string()),
            (mesh, "nothing".into())
        );
    }

    #[test]
    fn a_tet_soup_is_merged_to_a_body() {
        let body = kuhn_box([3, 2, 2], DVec3::ONE);
        let positions = body
            .tets
            .iter()
            .flatten()
            .map(|p| body.positions[p.index()])
            .collect();
        let tets = (0..body.tets.len()).map(|t| [0, 1, 2, 3].map(|k| ParticleId::new(4 * t + k)));
        let soup = TetMesh {
            positions,
            tets: tets.collect(),
        };
        assert_eq!(soup.pieces().count, body.tets.len());
        let repaired = repair(&soup, &RepairOptions::ALL);
        assert_eq!(repaired.mesh.pieces().count, 1);
        assert_eq!(repaired.mesh.positions.len(), body.positions.len());
        assert_eq!(
            repaired.report.merged,
            soup.positions.len() - body.positions.len()
        );
        assert!(repaired.mesh.check().is_ok());
        // Across a distance, after each corner was moved by less.
        let mut rough = soup.clone();
        for (p, x) in rough.positions.iter_mut().enumerate() {
            *x += DVec3::splat(1e-9 * (p % 7) as f64);
        }
        assert_eq!(repair(&rough, &RepairOptions::ALL).mesh.positions.len(), {
            let exact = RepairOptions {
                merge_within: Some(0.0),
                ..RepairOptions::ALL
            };
            repair(&rough, &exact).mesh.positions.len()
        });
        let options = RepairOptions {
            merge_within: Some(1e-6),
            ..RepairOptions::ALL
        };
        let repaired = repair(&rough, &options);
        assert_eq!(repaired.mesh.positions.len(), body.positions.len());
        assert_eq!(repaired.mesh.pieces().count, 1);
    }

    #[test]
    fn degenerate_tets_are_removed() {
        let mut mesh = kuhn_box([1, 1, 1], DVec3::ONE);
        let sound = mesh.clone();
        let [a, b, c, _] = mesh.tets[0];
        mesh.positions.push(DVec3::splat(f64::NAN));
        mesh.tets.push([a, b, c, a]);
        mesh.tets.push([a, b, c, ParticleId(99)]);
        mesh.tets
            .push([a, b, c, ParticleId::new(mesh.positions.len() - 1)]);
        mesh.tets.push(sound.tets[2]);
        let repaired = repair(&mesh, &RepairOptions::ALL);
        assert_eq!(repaired.mesh, sound);
        let report = repaired.report;
        assert_eq!(
            (report.degenerate, report.duplicates, report.unused),
            (3, 1, 1)
        );
        assert_eq!(
            report.to_string(),
            "3 tets without volume removed\n1 repeated tet removed\n1 particle removed that no tet uses"
        );
    }

    #[test]
    fn the_largest_piece_stays() {
        let mut mesh = kuhn_box([1, 1, 1], DVec3::ONE);
        let small = mesh.positions.len();
        let large = kuhn_box([2, 1, 1], DVec3::splat(2.0));
        mesh.positions
            .extend(large.positions.iter().map(|x| *x + 5.0));
        let shifted = large
            .tets
            .iter()
            .map(|tet| tet.map(|p| ParticleId::new(p.index() + small)));
        mesh.tets.extend(shifted);
        let repaired = repair(&mesh, &RepairOptions::ALL);
        assert_eq!(
            (repaired.report.pieces, repaired.report.tets_of_pieces),
            (1, 6)
        );
        assert_eq!(repaired.mesh.tets, large.tets);
        assert_eq!(repaired.tets[0], TetId(6));
        assert_eq!(repaired.particles[0], ParticleId::new(small));
    }

    proptest! {
        /// For any input, the result satisfies the selected rules, a second repair changes nothing, and the returned
        /// numbers match the original items.
        #[test]
        fn repairing_twice_is_repairing_once(
            coordinates in prop::collection::vec(prop::array::uniform3(0..3i32), 4..30),
            corners in prop::collection::vec(prop::array::uniform4(0..32u32), 0..40),
            merge in prop::sample::select(vec![None, Some(0.0), Some(1.0)]),
        ) {
            let positions = coordinates.iter().map(|c| DVec3::from_array(c.map(f64::from)));
            let mesh = TetMesh {
                positions: positions.collect(),
                tets: corners.iter().map(|tet| tet.map(ParticleId)).collect(),
            };
            let options = RepairOptions { merge_within: merge, ..RepairOptions::ALL };
            let once = repair(&mesh, &options);
            let twice = repair(&once.mesh, &options);
            prop_assert_eq!(&twice.mesh, &once.mesh);
            prop_assert_eq!(twice.report, RepairReport::default());
            for (tet, source) in once.mesh.tets.iter().zip(&once.tets) {
                prop_assert!(side(&once.mesh, *tet).is_some_and(|side| side > 0.0));
                prop_assert!(source.index() < mesh.tets.len());
            }
            for (x, source) in once.mesh.positions.iter().zip(&once.particles) {
                prop_assert_eq!(*x, mesh.positions[source.index()]);
            }
            prop_assert!(once.mesh.pieces().count <= 1);
        }
    }
}
