//! Cutting a fresh body, in time per tet cut: by a whole plane at once, and by the frame of a stroke in which the blade
//! is halfway through. Beside them a frame that cuts nothing (the search for tets near the blade, in tets that the next
//! frame cuts), and the updates after a cut: pieces and skin.

#![expect(clippy::unwrap_used, reason = "benches stop at the first surprise")]

use criterion::BatchSize;
use incise::cutting::{
    CutDelta, CutOptions, CuttableMesh, PieceTracker, Plane, Skin, Sweep, cut_plane,
};
use incise::mesh::glam::DVec3;
use incise_benches::{Bench, Source};

/// Cells a side of a grid of a million tets.
const LARGE: usize = 55;

fn main() {
    let large = [("grid-1m", Source::Grid(LARGE))];
    incise_benches::run_with("cutting", &large, |bench| {
        let body = CuttableMesh::new(bench.case.mesh.clone()).unwrap();
        plane(bench, &body);
        sweep(bench, &body);
    });
}

fn plane(bench: &mut Bench<'_, '_>, body: &CuttableMesh) {
    let case = bench.case;
    let plane = Plane {
        point: case.at([0.48, 0.5, 0.5]),
        normal: DVec3::new(1.0, 0.03, 0.02),
    };
    let cut = |body: &mut CuttableMesh| {
        let options = CutOptions::default();
        cut_plane(body, &case.mesh.positions, &plane, &options).unwrap()
    };
    let mut after = body.clone();
    let delta = cut(&mut after);
    let count = delta.removed.len();
    assert!(count > 0, "the plane meets the body");
    bench.measure_per("plane", count, |b| {
        b.iter_batched_ref(|| body.clone(), cut, BatchSize::PerIteration);
    });
    followers(bench, "plane", [body, &after], &delta);
}

fn sweep(bench: &mut Bench<'_, '_>, body: &CuttableMesh) {
    let case = bench.case;
    // Half a frame off, so that the measured frame passes the middle.
    let poses = (0..=12).map(|frame| case.blade(12.5 - f64::from(frame)));
    let mut halfway = body.clone();
    let options = CutOptions::default();
    let mut stroke = Sweep::new(body, &case.mesh.positions, &case.blade(13.5), options).unwrap();
    for pose in poses {
        let positions = halfway.mesh().positions.clone();
        stroke.advance(&mut halfway, &positions, &pose).unwrap();
    }
    let positions = halfway.mesh().positions.clone();
    let frame = |(body, stroke): &mut (CuttableMesh, Sweep), pose: [DVec3; 2]| {
        stroke.advance(body, &positions, &pose).unwrap()
    };
    let start = || (halfway.clone(), stroke.clone());
    let (still, next) = (case.blade(0.5), case.blade(-0.5));
    let mut after = start();
    let delta = frame(&mut after, next);
    let count = delta.removed.len();
    assert!(count > 0, "the measured frame cuts");
    bench.measure_per("search", count, |b| {
        b.iter_batched_ref(start, |state| frame(state, still), BatchSize::PerIteration);
    });
    bench.measure_per("sweep", count, |b| {
        b.iter_batched_ref(start, |state| frame(state, next), BatchSize::PerIteration);
    });
    followers(bench, "sweep", [&halfway, &after.0], &delta);
}

/// The updates after the cut of `delta`.
fn followers(
    bench: &mut Bench<'_, '_>,
    cut: &str,
    [before, after]: [&CuttableMesh; 2],
    delta: &CutDelta,
) {
    let count = delta.removed.len();
    let pieces = PieceTracker::new(before);
    bench.measure_per(&format!("{cut}-pieces"), count, |b| {
        b.iter_batched_ref(
            || pieces.clone(),
            |pieces| pieces.apply_delta(after, delta),
            BatchSize::PerIteration,
        );
    });
    let skin = Skin::new(before.boundary());
    bench.measure_per(&format!("{cut}-skin"), count, |b| {
        b.iter_batched_ref(
            || skin.clone(),
            |skin| skin.apply_delta(delta),
            BatchSize::PerIteration,
        );
    });
}
