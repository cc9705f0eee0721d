//! Cuts leave a sound mesh, the whole volume, a proper plan, and as many pieces as geometry says.

use incise::mesh::glam::DVec3;
use incise::scene::Precision;
use incise::{Scene, Simulation};

use crate::support::{body, extent, plane, scene, simulation, sweep};

const ORIGIN: [f64; 3] = [0.0, 0.0, 0.0];

/// Runs a scene, proving everything after every frame; the volume at rest stays that of the uncut mesh.
fn run(scene: &Scene, frames: u64) -> Simulation {
    let mut simulation = simulation(scene);
    simulation.check().unwrap();
    let volume = simulation.mesh().total_volume();
    for frame in 0..frames {
        let report = simulation.step().unwrap();
        if let Some(cut) = report.cut {
            assert!(cut.tets_created >= cut.tets_cut, "frame {frame}: {cut:?}");
            let ratio = cut.worst_volume_ratio;
            assert!(ratio > 0.0 && ratio <= 1.0, "frame {frame}: {cut:?}");
        }
        simulation
            .check()
            .unwrap_or_else(|error| panic!("frame {frame}: {error}"));
        let now = simulation.mesh().total_volume();
        assert!((now / volume - 1.0).abs() < 1e-12, "frame {frame}");
        assert!(simulation.positions().iter().all(|x| x.is_finite()));
    }
    simulation
}

/// The bodies' scene with strokes through its center: a number selects them.
fn with_strokes(bodies: &str, strokes: &[usize]) -> Scene {
    let (center, half) = extent(&scene(bodies));
    let at = |offset: [f64; 3]| (center + half * DVec3::from_array(offset)).to_array();
    let way = |z: f64| [0.0, 0.0, z * half.z];
    let text: String = strokes
        .iter()
        .map(|stroke| match stroke {
            0 => plane(1, at([0.07, 0.0, 0.0]), [1.0, 0.0, 0.0]),
            1 => plane(2, at([0.0, 0.05, 0.0]), [0.1, 1.0, 0.2]),
            // From above right through.
            2 => sweep(
                [1, 4],
                [at([-0.1, -1.3, 1.3]), at([0.2, 1.3, 1.3])],
                way(-2.6),
            ),
            // Across the one before, into the middle only.
            _ => sweep(
                [2, 5],
                [at([-1.3, 0.2, 1.3]), at([1.3, -0.1, 1.3])],
                way(-1.4),
            ),
        })
        .collect();
    scene(&format!(
        "[world]\ngravity = [0.0, 0.0, -9.81]\n{bodies}{text}"
    ))
}

#[test]
fn a_whole_plane_halves_what_it_meets() {
    let two = body("sphere", 400, ORIGIN) + &body("sphere", 300, [0.0, 1.5, 0.0]);
    for (bodies, strokes, pieces) in [
        (body("torus", 900, ORIGIN), &[0][..], 2),
        (body("box", 500, ORIGIN), &[0, 1], 4),
        (body("sphere", 500, ORIGIN), &[0, 1], 4),
        (two, &[0], 4),
    ] {
        for precision in [Precision::F32, Precision::F64] {
            let mut scene = with_strokes(&bodies, strokes);
            scene.solver.precision = precision;
            let simulation = run(&scene, 4);
            assert_eq!(simulation.report().pieces, pieces, "{bodies}{precision:?}");
        }
    }
}

#[test]
fn a_sweep_right_through_separates() {
    for shape in ["sphere", "box", "liver"] {
        let scene = with_strokes(&body(shape, 800, ORIGIN), &[2]);
        let simulation = run(&scene, 6);
        assert!(simulation.report().pieces >= 2, "{shape}");
        let tenth = 0.1 * simulation.mesh().total_volume();
        let volumes = simulation.mesh().pieces().volumes(simulation.mesh());
        let large = volumes.iter().filter(|volume| **volume > tenth).count();
        assert_eq!(large, 2, "{shape}: {volumes:?}");
    }
}

#[test]
fn a_sweep_into_the_middle_leaves_one_piece() {
    for shape in ["sphere", "box"] {
        let simulation = run(&with_strokes(&body(shape, 700, ORIGIN), &[3]), 7);
        assert_eq!(simulation.report().pieces, 1, "{shape}");
        assert!(simulation.on_cut().contains(&true));
    }
}

#[test]
fn every_clustering_and_coloring_survives_crossing_strokes() {
    for (shape, tets) in [("sphere", 500), ("liver", 900), ("torus", 700)] {
        for clustering in ["none", "serial:5", "serial:10"] {
            for coloring in ["scgc", "greedy"] {
                let mut scene = with_strokes(&body(shape, tets, ORIGIN), &[0, 3, 2, 1]);
                scene.solver.clustering = clustering.into();
                scene.solver.coloring = coloring.into();
                let simulation = run(&scene, 6);
                assert!(simulation.report().pieces >= 4, "{shape} {clustering}");
            }
        }
    }
}

#[test]
fn a_stroke_crosses_two_bodies_in_both_precisions() {
    let bodies = body("liver", 700, ORIGIN) + &body("box", 300, [0.0, 0.0, 0.9]);
    for precision in [Precision::F32, Precision::F64] {
        let mut scene = with_strokes(&bodies, &[2, 3]);
        scene.solver.precision = precision;
        assert!(run(&scene, 7).report().pieces >= 4);
    }
}

#[test]
fn the_same_plane_twice_cuts_once() {
    let mut scene = scene(
        &(body("box", 400, ORIGIN)
            + &plane(0, [0.03, 0.0, 0.0], [1.0, 0.0, 0.0])
            + &plane(1, [0.03, 0.0, 0.0], [-2.0, 0.0, 0.0])),
    );
    scene.solver.precision = Precision::F64;
    let mut simulation = run(&scene, 1);
    let tets = simulation.report().tets;
    assert_eq!(simulation.report().pieces, 2);
    // The cut faces lie on the plane: there is nothing left to cut.
    let report = simulation.step().unwrap();
    assert_eq!((report.tets, report.pieces), (tets, 2));
    simulation.check().unwrap();
}

#[test]
fn a_stroke_given_later_cuts_at_the_next_step() {
    let mut simulation = simulation(&scene(&body("sphere", 300, ORIGIN)));
    for _ in 0..3 {
        assert_eq!(simulation.step().unwrap().cut, None);
    }
    let late = scene(&(body("sphere", 300, ORIGIN) + &plane(0, ORIGIN, [0.0, 0.3, 1.0])));
    simulation.cut(late.stroke[0].clone()).unwrap();
    assert!(simulation.step().unwrap().cut.is_some());
    assert_eq!(simulation.report().pieces, 2);
    simulation.check().unwrap();
}

#[test]
fn a_stroke_that_misses_changes_nothing() {
    let miss = plane(0, [9.0, 0.0, 0.0], [1.0, 0.0, 0.0])
        + &sweep(
            [0, 2],
            [[5.0, -1.0, 1.0], [5.0, 1.0, 1.0]],
            [0.0, 0.0, -2.0],
        );
    let mut simulation = simulation(&scene(&(body("sphere", 300, ORIGIN) + &miss)));
    let mesh = simulation.mesh().clone();
    for _ in 0..4 {
        assert_eq!(simulation.step().unwrap().cut, None);
        assert!(simulation.on_cut().is_empty());
    }
    assert_eq!(*simulation.mesh(), mesh);
}
