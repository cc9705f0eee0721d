//! Cutting a fresh body: by a whole plane at once, and by the frame of a stroke in which the blade is halfway through.

// The same reason as in the library.
#![expect(clippy::unwrap_used, reason = "benches stop at the first surprise")]

use criterion::BatchSize;
use incise::cutting::{CutOptions, CuttableMesh, Plane, Sweep, cut_plane};
use incise::mesh::glam::DVec3;

fn main() {
    incise_benches::run("cutting", |bench| {
        let case = bench.case;
        let body = CuttableMesh::new(case.mesh.clone()).unwrap();
        let plane = Plane {
            point: case.at([0.48, 0.5, 0.5]),
            normal: DVec3::new(1.0, 0.03, 0.02),
        };
        let options = CutOptions::default();
        bench.measure("plane", |b| {
            b.iter_batched_ref(
                || body.clone(),
                |body| {
                    let delta = cut_plane(body, &case.mesh.positions, &plane, &options);
                    assert!(!delta.unwrap().is_empty(), "the plane meets the body");
                },
                BatchSize::PerIteration,
            );
        });

        // Half a frame off, so that the measured frame passes the middle.
        let poses = (0..=12).map(|frame| case.blade(12.5 - f64::from(frame)));
        let mut halfway = body.clone();
        let mut stroke =
            Sweep::new(&body, &case.mesh.positions, &case.blade(13.5), options).unwrap();
        for pose in poses {
            let positions = halfway.mesh().positions.clone();
            stroke.advance(&mut halfway, &positions, &pose).unwrap();
        }
        let pose = case.blade(-0.5);
        let positions = halfway.mesh().positions.clone();
        bench.measure("sweep", |b| {
            b.iter_batched_ref(
                || (halfway.clone(), stroke.clone()),
                |(body, stroke)| {
                    let delta = stroke.advance(body, &positions, &pose);
                    assert!(!delta.unwrap().is_empty(), "the measured frame cuts");
                },
                BatchSize::PerIteration,
            );
        });
    });
}
