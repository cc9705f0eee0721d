//! Pieces by number: what a frame took off, whose it is, and what it weighs.

use incise::Simulation;
use incise::report::PieceReport;
use incise::scene::Precision;

use crate::support::{body, plane, scene, simulation, sweep};

/// Steps, checks, and compares the pieces before and after with what the report says came off.
fn step(simulation: &mut Simulation) -> usize {
    let before = simulation.pieces();
    let report = simulation.step().unwrap().clone();
    simulation.check().unwrap();
    let after = simulation.pieces();
    assert_eq!(report.pieces, after.len());
    let mut expected: Vec<u32> = before.iter().map(|piece| piece.id).collect();
    for detached in &report.detached {
        assert_eq!(
            detached.piece as usize,
            expected.len(),
            "numbers are given in the order of events"
        );
        expected.push(detached.piece);
        let piece = &after[detached.piece as usize];
        let parent = &after[detached.from as usize];
        assert_eq!((piece.parent, piece.body), (Some(parent.id), parent.body));
        // It may have lost a part itself in the same frame.
        assert!(piece.tets <= detached.tets && piece.volume <= detached.volume);
        assert!(piece.mass <= detached.mass);
    }
    // Nothing vanishes here, so numbers and places are the same.
    let ids: Vec<u32> = after.iter().map(|piece| piece.id).collect();
    assert_eq!(ids, expected);
    let stays = |(b, a): (&PieceReport, &PieceReport)| (b.parent, b.body) == (a.parent, a.body);
    assert!(before.iter().zip(&after).all(stays));
    report.detached.len()
}

/// The mass of each body, of three.
fn masses(pieces: &[PieceReport]) -> [f64; 3] {
    let of = |body| pieces.iter().filter(move |piece| piece.body == body);
    [0, 1, 2].map(|body| of(body).map(|piece| piece.mass).sum())
}

#[test]
fn separated_pieces_are_reported_with_their_mass() {
    let text = body("box", 600, [0.0; 3]) + "density = 700.0\n";
    let cut = plane(1, [0.2, 0.0, 0.0], [1.0, 0.0, 0.0]);
    let mut simulation = simulation(&scene(&(text + &cut)));
    let [whole] = simulation.pieces()[..] else {
        panic!("one piece before the cut")
    };
    assert_eq!((whole.id, whole.parent, whole.body), (0, None, 0));
    let weight = 700.0 * simulation.mesh().total_volume();
    assert!((whole.mass / weight - 1.0).abs() < 1e-12);
    assert_eq!(step(&mut simulation), 0);
    assert_eq!(step(&mut simulation), 1);
    let detached = simulation.report().detached[0];
    assert_eq!((detached.piece, detached.from), (1, 0));
    // 0.3 of a cube of 1 m whose edges are blunt, less or more by the snap distance of a tenth of a cell.
    assert!((detached.mass / weight - 0.3).abs() < 0.02, "{detached:?}");
    assert_eq!(detached.mass, 700.0 * detached.volume);
    let pieces = simulation.pieces();
    assert_eq!(pieces[1].volume, detached.volume);
    assert!(((pieces[0].mass + pieces[1].mass) / weight - 1.0).abs() < 1e-12);
    assert_eq!(step(&mut simulation), 0);
}

#[test]
fn numbers_are_unique_over_all_bodies_and_stay() {
    let bodies = [
        body("sphere", 300, [0.0, -1.2, 0.0]) + "density = 500.0\n",
        body("box", 250, [0.0; 3]) + "density = 900.0\n",
        body("torus", 500, [0.0, 1.2, 0.0]) + "density = 1300.0\n",
    ]
    .concat();
    let strokes = [
        plane(1, [0.03, 0.0, 0.0], [1.0, 0.1, 0.0]),
        sweep(
            [1, 4],
            [[-0.2, -3.0, 0.7], [0.2, 3.0, 0.7]],
            [0.0, 0.0, -1.4],
        ),
        plane(5, [0.0, 0.0, 0.1], [0.0, 0.1, 1.0]),
    ]
    .concat();
    let link = "[[distance]]\nfrom = { body = 2, point = [0, 0.8, 0] }\nto = { body = 0, point = [0, -0.8, 0] }\ncompliance = 1e-5\n";
    for (joined, first) in [("", [0, 1, 2]), (link, [0, 2, 1])] {
        for precision in [Precision::F32, Precision::F64] {
            let mut scene = scene(&format!("{bodies}{strokes}{joined}"));
            scene.solver.precision = precision;
            // It moves cut faces, so that a piece can be larger than when it came off.
            scene.cutting.improve = false;
            let mut simulation = simulation(&scene);
            let before = simulation.pieces();
            let bodies: Vec<usize> = before.iter().map(|piece| piece.body).collect();
            assert_eq!(bodies, first, "joined bodies are numbered together");
            let weights = masses(&before);
            let came_off: usize = (0..7).map(|_| step(&mut simulation)).sum();
            assert!(came_off >= 3 * 6, "{came_off} parts came off");
            for (weight, now) in weights.into_iter().zip(masses(&simulation.pieces())) {
                assert!((now / weight - 1.0).abs() < 1e-12, "{weight} became {now}");
            }
        }
    }
}

#[test]
fn reports_of_pieces_have_the_promised_keys() {
    let cut = plane(0, [0.1, 0.0, 0.0], [1.0, 0.0, 0.0]);
    let mut simulation = simulation(&scene(&(body("sphere", 300, [0.0; 3]) + &cut)));
    simulation.step().unwrap();
    let text = serde_json::to_string(&simulation.pieces()).unwrap();
    let pieces: Vec<serde_json::Map<String, serde_json::Value>> =
        serde_json::from_str(&text).unwrap();
    let keys = |i: usize| pieces[i].keys().map(String::as_str).collect::<Vec<_>>();
    let mut first = keys(0);
    first.sort_unstable();
    assert_eq!(first, ["body", "id", "mass", "tets", "volume"]);
    assert_eq!(pieces[1]["parent"], 0);
}
