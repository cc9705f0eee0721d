//! Sliver removal by local changes, each of which improves the worst tet it touches.
//!
//! For each bad tet: the best of all edge removals (the tets around an edge are replaced by two for each triangle of a
//! fan in the polygon around it) and face removals (two tets become three); otherwise small random moves of its
//! corners; otherwise, at the surface, removal of the tet if the topology does not change. Only bad tets and their
//! surroundings change, so that the mesh stays irregular.
//!
//! Source: L. A. Freitag and C. Ollivier-Gooch, "Tetrahedral mesh improvement using swapping and smoothing", 1997.
//! Quality is the smaller of two values: the smallest sine of the dihedral angles, which is small for angles near 0 and
//! near 180 degrees, and twice the radius ratio, which is small for needles too. Cost: linear in the number of bad tets
//! and of passes.

use glam::DVec3;
use incise_mesh::{outward_normals, signed_volume};

use super::adjacency_mesh::{AdjacencyMesh, NONE, Ring, other_two};
use super::sample::project;
use crate::Shape;
use crate::random::in_cube;

/// Largest number of tets around an edge that can be removed.
const LARGEST_RING: usize = 8;
/// Sizes of the random moves in spacings.
const MOVES: [f64; 4] = [0.2, 0.1, 0.05, 0.02];
const TRIES: u64 = 6;

/// Tet quality: the smaller of the smallest sine of the dihedral angles and twice the radius ratio; not positive for a
/// flat or inverted tet.
pub(super) fn quality(corners: [DVec3; 4]) -> f64 {
    let normals = outward_normals(corners);
    let volume = 6.0 * signed_volume(corners);
    if volume <= 0.0 {
        return volume.min(0.0);
    }
    let mut worst = f64::INFINITY;
    for i in 0..4 {
        for j in 0..i {
            // The faces opposite i and j share the edge between the other two corners.
            let [k, l] = other_two(i, j);
            let edge = (corners[k] - corners[l]).length_squared();
            let areas = normals[i].length_squared() * normals[j].length_squared();
            worst = (volume * volume * edge / areas).min(worst);
        }
    }
    worst
        .sqrt()
        .min(2.0 * radius_ratio(corners, volume, normals))
}

/// Radius ratio: three times the inscribed over the circumscribed radius, given six times the volume and twice the
/// areas.
fn radius_ratio([a, b, c, d]: [DVec3; 4], volume: f64, normals: [DVec3; 4]) -> f64 {
    let [u, v, w] = [b - a, c - a, d - a];
    let circum = u.length_squared() * v.cross(w)
        + v.length_squared() * w.cross(u)
        + w.length_squared() * u.cross(v);
    let areas: f64 = normals.iter().map(|n| n.length()).sum();
    6.0 * volume * volume / (areas * circum.length())
}

/// Improves all tets with a quality below `target`, in up to `passes` passes.
pub(super) fn improve(
    mesh: &mut AdjacencyMesh,
    shape: Shape,
    spacing: f64,
    target: f64,
    passes: u64,
) {
    let mut work = Work::default();
    for pass in 0..passes {
        let mut bad: Vec<(f64, u32)> = (0..mesh.end())
            .filter_map(|t| mesh.tet(t).map(|tet| (quality(mesh.corners(tet)), t)))
            .filter(|&(q, _)| q < target)
            .collect();
        if bad.is_empty() {
            break;
        }
        bad.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut changed = false;
        for (_, t) in bad {
            // An earlier change may have fixed or removed it.
            let Some(tet) = mesh
                .tet(t)
                .filter(|&tet| quality(mesh.corners(tet)) < target)
            else {
                continue;
            };
            let mut done = work.reconnect(mesh, t);
            if !done {
                for p in tet {
                    done |= work.relocate(mesh, shape, spacing, p, pass);
                }
            }
            done = done || peel(mesh, t, &mut work.ring);
            changed |= done;
        }
        if !changed {
            break;
        }
    }
}

/// Buffers reused between changes.
#[derive(Default)]
struct Work {
    ring: Ring,
    star: Vec<u32>,
    old: Vec<u32>,
    new: Vec<[u32; 4]>,
    best: Vec<[u32; 4]>,
}

impl Work {
    /// Applies the best edge or face removal at a tet, if any raises the worst quality.
    fn reconnect(&mut self, mesh: &mut AdjacencyMesh, t: u32) -> bool {
        let Some(tet) = mesh.tet(t) else {
            return false;
        };
        self.best.clear();
        let mut gain = 0.0;
        for i in 0..4 {
            for j in 0..i {
                if !mesh.ring(t, [i, j], &mut self.ring) {
                    continue;
                }
                let n = self.ring.tets.len();
                if n > LARGEST_RING {
                    continue;
                }
                let before = worst_of(mesh, &self.ring.tets);
                for hub in 0..n {
                    self.new.clear();
                    for k in 1..n - 1 {
                        let [p, q, r] =
                            [hub, hub + k, hub + k + 1].map(|at| self.ring.particles[at % n]);
                        self.new.push([p, q, r, tet[j]]);
                        self.new.push([p, r, q, tet[i]]);
                    }
                    self.keep_better(mesh, before, &mut gain, None);
                }
            }
        }
        for (i, &a) in tet.iter().enumerate() {
            let across = mesh.neighbor(t, i);
            let Some(other) = (across != NONE).then(|| mesh.tet(across / 4)).flatten() else {
                continue;
            };
            let b = other[across as usize % 4];
            // Counterclockwise seen from b: even permutations of all corners but i.
            let [p, q, r] = match i {
                0 => [tet[1], tet[2], tet[3]],
                1 => [tet[0], tet[3], tet[2]],
                2 => [tet[0], tet[1], tet[3]],
                _ => [tet[0], tet[2], tet[1]],
            };
            let pair = [t, across / 4];
            self.new.clear();
            self.new.extend([[a, b, p, q], [a, b, q, r], [a, b, r, p]]);
            self.keep_better(mesh, worst_of(mesh, &pair), &mut gain, Some(&pair));
        }
        if self.best.is_empty() {
            return false;
        }
        mesh.replace(&self.old, &self.best);
        true
    }

    /// Keeps the new tets as the best candidate if they gain more than the best so far.
    fn keep_better(
        &mut self,
        mesh: &AdjacencyMesh,
        before: f64,
        gain: &mut f64,
        pair: Option<&[u32]>,
    ) {
        let bound = before + *gain;
        let after = self.new.iter().try_fold(f64::INFINITY, |worst, &tet| {
            let worst = quality(mesh.corners(tet)).min(worst);
            (worst > bound && worst > 0.0).then_some(worst)
        });
        if let Some(after) = after {
            *gain = after - before;
            self.best.clone_from(&self.new);
            self.old.clear();
            self.old.extend(pair.unwrap_or(&self.ring.tets));
        }
    }

    /// Moves a particle at random if that raises the worst quality around it; surface particles stay on the surface.
    fn relocate(
        &mut self,
        mesh: &mut AdjacencyMesh,
        shape: Shape,
        spacing: f64,
        p: u32,
        pass: u64,
    ) -> bool {
        mesh.star(p, &mut self.star);
        let start = mesh.positions[p as usize];
        let (mut best, mut place) = (worst_of(mesh, &self.star), start);
        let before = best;
        for (size, length) in MOVES.into_iter().enumerate() {
            for attempt in 0..TRIES {
                let counter = (pass * 4 + size as u64) * TRIES + attempt;
                let mut to = place + length * spacing * in_cube(u64::from(p), counter);
                if mesh.on_surface[p as usize] {
                    let Some(on) = project(shape, to, spacing) else {
                        continue;
                    };
                    to = on;
                }
                mesh.positions[p as usize] = to;
                let after = worst_of(mesh, &self.star);
                if after > best {
                    (best, place) = (after, to);
                }
            }
        }
        mesh.positions[p as usize] = place;
        // A minimum gain prevents long runs of tiny improvements.
        best > before + 1e-3
    }
}

/// Worst quality of the given tets.
fn worst_of(mesh: &AdjacencyMesh, tets: &[u32]) -> f64 {
    tets.iter()
        .filter_map(|&t| mesh.tet(t))
        .map(|tet| quality(mesh.corners(tet)))
        .fold(f64::INFINITY, f64::min)
}

/// Removes a tet at the surface if the body and its surface stay manifolds of unchanged topology: with one boundary
/// face if the opposite corner is inside, with two if the opposite edge is, with three always.
fn peel(mesh: &mut AdjacencyMesh, t: u32, ring: &mut Ring) -> bool {
    let Some(tet) = mesh.tet(t) else {
        return false;
    };
    let bare: Vec<usize> = (0..4).filter(|&k| mesh.neighbor(t, k) == NONE).collect();
    let simple = match *bare {
        [i] => !mesh.on_surface[tet[i] as usize],
        [i, j] => mesh.ring(t, [i, j], ring),
        [_, _, _] => true,
        _ => false,
    };
    if simple {
        mesh.remove(t);
    }
    simple
}

#[cfg(test)]
mod tests {
    use super::*;
    use incise_mesh::{TetId, TetMesh, kuhn_box, tet_quality};

    fn worst(mesh: &TetMesh) -> f64 {
        (0..mesh.tets.len())
            .map(|t| quality(mesh.corners(TetId::new(t))))
            .fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn quality_agrees_with_the_measures() {
        for n in 0..2_000 {
            let mut corners = [0, 1, 2, 3].map(|k| in_cube(1, 4 * n + k));
            if signed_volume(corners) < 0.0 {
                assert!(quality(corners) < 0.0);
                corners.swap(0, 1);
            }
            let measured = tet_quality(corners);
            let sine = |angle: f64| angle.to_radians().sin();
            let expected = sine(measured.min_dihedral)
                .min(sine(measured.max_dihedral))
                .min(2.0 * measured.radius_ratio);
            // Random tets are as flat as 1e-5, which amplifies cancellation.
            assert!((quality(corners) - expected).abs() < 1e-9, "{n}");
        }
        assert!(quality([DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::X + DVec3::Y]) == 0.0);
    }

    #[test]
    fn a_crumpled_box_gets_well_shaped() {
        let mut mesh = kuhn_box([6, 6, 6], DVec3::ONE);
        let spacing = 1.0 / 6.0;
        for (n, p) in (0..).zip(&mut mesh.positions) {
            *p -= 0.5;
            if p.abs().max_element() < 0.499 {
                *p += 0.27 * spacing * in_cube(2, n);
            }
        }
        mesh.check().expect("not so much that tets turn over");
        let before = worst(&mesh);
        let mut adjacent = AdjacencyMesh::new(mesh);
        improve(&mut adjacent, Shape::Box, spacing, 0.3, 30);
        let mesh = adjacent.into_mesh();
        assert!(
            before < 0.25 && worst(&mesh) >= 0.3,
            "{before}, {}",
            worst(&mesh)
        );
        mesh.check().expect("sound");
        let surface = mesh.surface();
        assert!(surface.is_manifold() && surface.euler_characteristic() == 2);
        assert_eq!(mesh.face_pieces().count, 1);
        // The volume changes only where corners were cut or surface tets dropped.
        assert!(
            (0.98..1.0 + 1e-9).contains(&mesh.total_volume()),
            "{}",
            mesh.total_volume()
        );
    }

    #[test]
    fn peeling_keeps_the_topology() {
        let mut mesh = AdjacencyMesh::new(kuhn_box([4, 4, 4], DVec3::ONE));
        let mut ring = Ring::default();
        let mut peeled = 0;
        for t in (0..mesh.end()).rev() {
            peeled += usize::from(peel(&mut mesh, t, &mut ring));
        }
        let mesh = mesh.into_mesh();
        assert!(peeled > 100);
        assert_eq!(mesh.tets.len(), 6 * 64 - peeled);
        mesh.check().expect("sound");
        let surface = mesh.surface();
        assert!(surface.is_manifold() && surface.euler_characteristic() == 2);
        assert_eq!(mesh.face_pieces().count, 1);
    }
}
