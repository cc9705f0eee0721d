//! Finding contacts on a body that a plane has cut in two, whose halves have slid past each other by an edge: a frame
//! that keeps its candidates, one that searches, the pairs of the fresh cut, and the update by the cut. In time per
//! vertex of the surface, per pair and per tet cut.

#![expect(clippy::unwrap_used, reason = "benches stop at the first surprise")]

use criterion::BatchSize;
use incise::cutting::{CutDelta, CutOptions, CuttableMesh, PieceTracker, Plane, cut_plane};
use incise::mesh::TetId;
use incise::mesh::glam::DVec3;
use incise_benches::Bench;
use incise_contact::{ContactDetector, ContactSettings, ContactState};

fn main() {
    incise_benches::run("contact", |bench| {
        let mut body = CuttableMesh::new(bench.case.mesh.clone()).unwrap();
        let body_of = vec![0; body.mesh().positions.len()];
        let mut before = ContactDetector::new(&body, body_of, ContactSettings::default()).unwrap();
        let mut pieces = PieceTracker::new(&body);
        let plane = Plane {
            point: bench.case.at([0.48, 0.5, 0.5]),
            normal: DVec3::new(1.0, 0.03, 0.02),
        };
        let positions = body.mesh().positions.clone();
        // With a tree over the body as it was.
        before.update(&ContactState {
            mesh: &body,
            pieces: &pieces,
            positions: &positions,
            velocities: &vec![DVec3::ZERO; positions.len()],
            fixed: &[],
            frame_time: 1.0 / 60.0,
        });
        let delta = cut_plane(&mut body, &positions, &plane, &CutOptions::default()).unwrap();
        pieces.apply_delta(&body, &delta);
        measure(bench, &body, &pieces, &delta, &before);
    });
}

fn measure(
    bench: &mut Bench<'_, '_>,
    body: &CuttableMesh,
    pieces: &PieceTracker,
    delta: &CutDelta,
    before: &ContactDetector,
) {
    let mut positions = body.mesh().positions.clone();
    let velocities = vec![DVec3::ZERO; positions.len()];
    let update = |contacts: &mut ContactDetector, positions: &[DVec3]| {
        contacts.update(&ContactState {
            mesh: body,
            pieces,
            positions,
            velocities: &velocities,
            fixed: &[],
            frame_time: 1.0 / 60.0,
        })
    };
    bench.measure_per("apply-delta", delta.removed.len(), |b| {
        b.iter_batched_ref(
            || before.clone(),
            |contacts| contacts.apply_delta(body, delta),
            BatchSize::PerIteration,
        );
    });
    let mut contacts = before.clone();
    contacts.apply_delta(body, delta);
    let followed = contacts.clone();
    bench.measure_per("search-after-cut", delta.removed.len(), |b| {
        b.iter_batched_ref(
            || followed.clone(),
            |contacts| update(contacts, &positions),
            BatchSize::PerIteration,
        );
    });
    update(&mut contacts, &positions);
    let pairs = contacts.pairs().len();
    assert!(pairs > 0, "the sides of the cut touch");
    bench.measure_per("pairs", pairs, |b| {
        b.iter(|| update(&mut contacts, &positions));
    });

    let edge = contacts.mean_edge();
    let mut slid = vec![false; positions.len()];
    for (tet, corners) in body.mesh().tets.iter().enumerate() {
        let moves = pieces.piece_of(TetId::new(tet)) == 1;
        corners.iter().for_each(|p| slid[p.index()] |= moves);
    }
    for (x, slid) in positions.iter_mut().zip(slid) {
        x.y += if slid { edge } else { 0.0 };
    }
    update(&mut contacts, &positions);
    assert!(contacts.faces().len() > 20, "the sides touch, slid apart");
    let vertices = contacts.surface().vertices().count();
    bench.measure_per("keep", vertices, |b| {
        b.iter(|| update(&mut contacts, &positions));
    });
    let settings = contacts.settings().clone();
    bench.measure_per("search", vertices, |b| {
        b.iter(|| {
            contacts.set_settings(settings.clone()).unwrap();
            update(&mut contacts, &positions)
        });
    });
}
