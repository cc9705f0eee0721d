//! [`rims`]: where the outer surface ends at a cut.
//!
//! A cut that is closed cannot be seen by its faces, so pictures draw a line along its rim. An edge of an outer triangle is
//! on a rim if a cut face has the same edge in the other direction. Cost: a pass over the triangles, and a hash for each
//! edge whose ends are on both kinds of faces.

use std::collections::HashSet;

use incise::cutting::Skin;
use incise::mesh::ParticleId;

/// For each triangle its edges on a rim: bit k for the edge opposite to corner k. Only triangles of the outer surface have
/// any.
pub(crate) fn rims(skin: &Skin) -> Vec<u32> {
    let triangles = skin.triangles();
    let mut rims = vec![0; triangles.len()];
    if skin.cut_triangles().is_empty() {
        return rims;
    }
    let particles =
        |triangle: usize| triangles[triangle].map(|v| skin.vertices()[v as usize].particle);
    let edges = |[a, b, c]: [ParticleId; 3]| [[b, c], [c, a], [a, b]];
    let count = skin
        .vertices()
        .iter()
        .map(|vertex| vertex.particle.index() + 1);
    let mut is_outer = vec![false; count.max().unwrap_or(0)];
    for p in skin.outer_triangles().flat_map(particles) {
        is_outer[p.index()] = true;
    }
    let ends_outside = |edge: &[ParticleId; 2]| edge.iter().all(|p| is_outer[p.index()]);
    let of_cuts: HashSet<[ParticleId; 2]> = skin
        .cut_triangles()
        .flat_map(|triangle| edges(particles(triangle)))
        .filter(ends_outside)
        .collect();
    for triangle in skin.outer_triangles() {
        for (k, [from, to]) in edges(particles(triangle)).into_iter().enumerate() {
            if of_cuts.contains(&[to, from]) {
                rims[triangle] |= 1 << k;
            }
        }
    }
    rims
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use incise::cutting::{CutOptions, CuttableMesh, Plane, Sweep, cut_plane};
    use incise::mesh::kuhn_box;
    use proptest::prelude::*;

    use super::*;

    /// The slow way, from the other side: an edge of an outer triangle is on a rim if no other outer triangle has it.
    fn slow(skin: &Skin) -> Vec<u32> {
        let outer = skin.outer_triangles();
        let particles = |triangle: usize| {
            skin.triangles()[triangle].map(|v| skin.vertices()[v as usize].particle)
        };
        let mut rims = vec![0; skin.triangles().len()];
        for triangle in outer.clone() {
            let p = particles(triangle);
            for k in 0..3 {
                let ends = [p[(k + 1) % 3], p[(k + 2) % 3]];
                let has = |other: usize| ends.iter().all(|end| particles(other).contains(end));
                let goes_on = outer.clone().any(|other| other != triangle && has(other));
                rims[triangle] |= u32::from(!goes_on) << k;
            }
        }
        rims
    }

    fn body() -> CuttableMesh {
        CuttableMesh::new(kuhn_box([5; 3], DVec3::ONE)).unwrap()
    }

    #[test]
    fn a_body_without_a_cut_has_none() {
        let rims = rims(&Skin::new(body().boundary()));
        assert!(!rims.is_empty() && rims.iter().all(|bits| *bits == 0));
    }

    #[test]
    fn cuts_through_and_into_a_body_have_the_rims_of_the_slow_way() {
        let mut body = body();
        let options = CutOptions {
            snap: 0.0,
            ..CutOptions::default()
        };
        let plane = Plane {
            point: DVec3::splat(0.43),
            normal: DVec3::new(1.0, 0.2, 0.1),
        };
        let rest = body.mesh().positions.clone();
        cut_plane(&mut body, &rest, &plane, &options).unwrap();
        let skin = Skin::new(body.boundary());
        assert_eq!(rims(&skin), slow(&skin));
        let through = rims(&skin).iter().filter(|bits| **bits != 0).count();

        // A blade that stops inside of the right half.
        let options = CutOptions { tag: 1, ..options };
        let blade = |y: f64| [DVec3::new(0.81, y, 0.5), DVec3::new(0.81, y, 1.3)];
        let rest = body.mesh().positions.clone();
        let mut sweep = Sweep::new(&body, &rest, &blade(-0.1), options).unwrap();
        sweep.advance(&mut body, &rest, &blade(0.6)).unwrap();
        let skin = Skin::new(body.boundary());
        assert_eq!(rims(&skin), slow(&skin));
        let both = rims(&skin).iter().filter(|bits| **bits != 0).count();
        assert!(through > 40 && both > through + 10, "{through}, {both}");
    }

    fn direction() -> impl Strategy<Value = DVec3> {
        let any = prop::array::uniform3(-1.0..1.0_f64).prop_map(DVec3::from_array);
        any.prop_filter("a direction", |v| v.length() > 0.1)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn planes_across_each_other_have_the_rims_of_the_slow_way(
            normals in prop::collection::vec(direction(), 2..4),
            snap in prop::sample::select(vec![0.0, 0.1, 0.25]),
        ) {
            let mut body = body();
            for (tag, normal) in (0..).zip(normals) {
                let rest = body.mesh().positions.clone();
                let plane = Plane { point: DVec3::splat(0.48), normal };
                let options = CutOptions { snap, tag, ..CutOptions::default() };
                cut_plane(&mut body, &rest, &plane, &options).unwrap();
            }
            let skin = Skin::new(body.boundary());
            prop_assert_eq!(rims(&skin), slow(&skin));
        }
    }
}
