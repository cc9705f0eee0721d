//! [`Recuts`]: where strokes cut tets that earlier strokes have made.
//!
//! Cuts of cuts make ever smaller tets, so meshes are improved there. What a single stroke leaves stays as it is. A stroke
//! gives each tet that it cuts a new particle, so the number of the stroke that made a particle tells which tets it has cut.
//! A stroke that crosses its own path does not count, because a moving blade cuts the same tet in several frames.
//!
//! Cost: 8 bytes a particle from the first stroke on, and work in proportion to the tets cut.

use std::collections::BTreeSet;

use incise_cutting::{CutDelta, ImproveQueue, RemovedTet};
use incise_mesh::{ParticleId, TetId};

/// The places of an island where strokes have cut what earlier ones had cut.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Recuts {
    /// The corners of the new tets there, until the mesh around them is improved.
    pub(crate) queue: ImproveQueue,
    /// For each particle the stroke that made it, if one did; may end early.
    makers: Vec<Option<u32>>,
}

impl Recuts {
    /// Follows a cut by a stroke, or a change by something else, which cuts no tets.
    pub(crate) fn apply_delta(&mut self, delta: &CutDelta, stroke: Option<u32>) {
        let corners = self.follow(delta, stroke);
        self.queue.extend(corners);
    }

    /// Notes the new particles, and returns the corners of the new tets whose parent another stroke had made.
    fn follow(&mut self, delta: &CutDelta, stroke: Option<u32>) -> BTreeSet<ParticleId> {
        self.makers.resize(delta.particles_before, None);
        let is_recut = |tet: &&RemovedTet| {
            let mut makers = tet.corners.iter().map(|p| self.makers[p.index()]);
            makers.any(|maker| maker.is_some() && maker != stroke)
        };
        let recut = delta.removed.iter().filter(is_recut);
        let parents: BTreeSet<TetId> = recut.map(|tet| tet.tet).collect();
        delta.extend_with(&mut self.makers, |_, _, _| stroke);
        let children = delta.added.iter();
        let children = children.filter(|tet| parents.contains(&tet.parent));
        children.flat_map(|tet| tet.corners).collect()
    }

    /// Appends those of a mesh that is appended to one with so many particles.
    pub(crate) fn append(&mut self, other: &Self, particles: usize) {
        self.queue.append(&other.queue, particles);
        self.makers.resize(particles, None);
        self.makers.extend_from_slice(&other.makers);
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use incise_cutting::{CutOptions, CuttableMesh, Plane, StrokeRegistry, Sweep, cut_plane};
    use incise_mesh::kuhn_box;
    use proptest::prelude::*;

    use super::*;

    fn options(snap: f64) -> CutOptions {
        CutOptions {
            snap,
            crumbs: 0.0,
            ..CutOptions::default()
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

        /// Without snapping what planes have made lies on them, and nothing else does: the corners waiting are those of the
        /// parts of tets that have a corner on an earlier plane.
        #[test]
        fn what_waits_is_what_earlier_planes_have_met(
            planes in proptest::collection::vec(
                (proptest::array::uniform3(-1.0..1.0_f64), 0.2..0.8_f64),
                1..6,
            ),
        ) {
            let mut cuttable = CuttableMesh::new(kuhn_box([2; 3], DVec3::ONE)).unwrap();
            let mut recuts = Recuts::default();
            let mut earlier: Vec<Plane> = Vec::new();
            for (stroke, (normal, at)) in (0..).zip(planes) {
                let normal = DVec3::from(normal);
                prop_assume!(normal.length() > 0.1);
                let plane = Plane { point: DVec3::splat(at), normal: normal.normalize() };
                let rest = cuttable.mesh().positions.clone();
                let delta = cut_plane(&mut cuttable, &rest, &plane, &options(0.0)).unwrap();
                let is_met = |tet: &RemovedTet| {
                    tet.corners.iter().any(|p| {
                        let on = |plane: &Plane| (rest[p.index()] - plane.point).dot(plane.normal).abs() < 1e-9;
                        earlier.iter().any(on)
                    })
                };
                let mut expected = BTreeSet::new();
                for parent in delta.removed.iter().filter(|tet| is_met(tet)) {
                    let children = delta.added.iter().filter(|tet| tet.parent == parent.tet);
                    expected.extend(children.flat_map(|tet| tet.corners));
                }
                prop_assert_eq!(recuts.follow(&delta, Some(stroke)), expected);
                earlier.push(plane);
            }
        }
    }

    /// A blade cuts the tets at its front frame by frame, also where a part is cut again; that is one stroke. Another one that
    /// goes on where it stopped cuts its tets again.
    #[test]
    fn a_stroke_of_many_frames_waits_for_nothing() {
        let mut cuttable = CuttableMesh::new(kuhn_box([3; 3], DVec3::ONE)).unwrap();
        let (mut recuts, mut registry) = (Recuts::default(), StrokeRegistry::default());
        let (mut cut, mut again) = (0, 0);
        for stroke in 0..2 {
            let blade = |z: f64| [DVec3::new(0.47, -0.2, z), DVec3::new(0.53, 1.2, z)];
            let top = if stroke == 0 { 1.1 } else { 0.52 };
            let positions = cuttable.mesh().positions.clone();
            let mut sweep = Sweep::new(&cuttable, &positions, &blade(top), options(0.1)).unwrap();
            for frame in 1..=12 {
                let positions = cuttable.mesh().positions.clone();
                let pose = blade(top - 0.05 * f64::from(frame));
                let delta = sweep
                    .advance_joining(&mut cuttable, &positions, &pose, &mut registry)
                    .unwrap();
                let makers = |p: &ParticleId| recuts.makers.get(p.index()).copied().flatten();
                let made = |tet: &&RemovedTet| tet.corners.iter().any(|p| makers(p).is_some());
                again += delta.removed.iter().filter(made).count();
                cut += delta.removed.len();
                recuts.apply_delta(&delta, Some(stroke));
            }
            assert!(cut > 20 && again > 5, "{cut}, {again}");
            assert_eq!(recuts.queue.is_empty(), stroke == 0);
        }
    }
}
