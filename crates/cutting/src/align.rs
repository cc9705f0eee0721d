//! [`CuttableMesh::align_sides`]: crosses both sides of an open cut at one place at rest.
//!
//! Each side is crossed by itself, at present positions that differ by rounding. Particles at one place can be merged
//! together later. Cost: a look-up for each crossing, and a pass over the tets around those on an open cut.

use std::collections::BTreeMap;

use glam::DVec3;
use incise_mesh::ParticleId;

use crate::CuttableMesh;
use crate::operation::Crossing;

/// How far apart the crossings of the two sides of an open cut may be to count as one, in edges of a mean tet. Positions in
/// single precision put them apart by some 1e-6; the sides of a cut that gapes are crossed at really different places.
const ONE_CROSSING: f64 = 1e-4;

impl CuttableMesh {
    /// Gives crossings of edges in one line the same rest position: that of the first one within [`ONE_CROSSING`], or of a
    /// particle that an earlier call created there.
    ///
    /// Edges coincide only along an open cut; all other crossings stay. Where particles were merged on one side only, edges
    /// there are longer than on the other side. Cost: two look-ups for each crossing, and for those
    /// along an open cut a pass over the tets around the ends on all sides.
    pub(crate) fn align_sides<'a>(&self, crossings: impl Iterator<Item = &'a mut Crossing>) {
        let close = ONE_CROSSING * self.mean_edge();
        #[expect(
            clippy::cast_possible_truncation,
            reason = "cells so far away that their numbers do not fit are one"
        )]
        let cell = |x: DVec3| (x / (4.0 * close)).to_array().map(|c| c.floor() as i64);
        // By the cells of a grid that each is close to: the places of the ends, and the position.
        let mut known: BTreeMap<[i64; 3], Vec<([ParticleId; 2], DVec3)>> = BTreeMap::new();
        for crossing in crossings {
            let ends = crossing.ends.map(|p| self.mesh.positions[p.index()]);
            let has_copy = |x: &DVec3| self.places.at(&self.mesh, *x).nth(1).is_some();
            if !ends.iter().any(has_copy) {
                continue;
            }
            let sides = ends.map(|x| self.places.at(&self.mesh, x).collect::<Vec<_>>());
            let [a, b] = [0, 1].map(|k| {
                let particles = sides[k].iter().copied();
                particles.fold(crossing.ends[k], ParticleId::min)
            });
            let places = [a.min(b), a.max(b)];
            let x = ends[0].lerp(ends[1], crossing.parameter);
            let is_close = |y: &DVec3| x.distance_squared(*y) <= close * close;
            let is_on_edge = |y: &DVec3| {
                let parameter = along(ends, *y);
                (0.0..=1.0).contains(&parameter)
                    && self.places.is_same(ends[0].lerp(ends[1], parameter), *y)
            };
            // One side of a cut may have other edges in the same line.
            let mut there = known.get(&cell(x)).into_iter().flatten();
            let before = there
                .find(|(of, y)| is_close(y) && (*of == places || is_on_edge(y)))
                .map(|(_, y)| *y);
            let made = || {
                let particles = sides.iter().flatten().chain(&crossing.ends);
                let around = particles.flat_map(|&p| self.around(p));
                let corners = around.flat_map(|tet| self.mesh.tets[tet.index()]);
                let made = corners.filter(|p| !self.is_original(*p));
                let at = |p: ParticleId| self.mesh.positions[p.index()];
                made.map(at).find(|y| is_close(y) && is_on_edge(y))
            };
            let aligned = before.or_else(made);
            if let Some(y) = aligned.filter(|y| !self.places.is_same(*y, x)) {
                crossing.parameter = along(ends, y);
            }
            if before.is_none() {
                let y = aligned.unwrap_or(x);
                let [low, high] = [cell(y - close), cell(y + close)];
                for i in low[0]..=high[0] {
                    for j in low[1]..=high[1] {
                        for k in low[2]..=high[2] {
                            known.entry([i, j, k]).or_default().push((places, y));
                        }
                    }
                }
            }
        }
    }
}

/// The parameter of a position on an edge: 0 at the first end, 1 at the second.
fn along([a, b]: [DVec3; 2], x: DVec3) -> f64 {
    (x - a).dot(b - a) / (b - a).length_squared()
}
