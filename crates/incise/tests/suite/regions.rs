//! Regions fix the particles inside them, no others, of their own body only.

use incise::Simulation;
use incise::mesh::glam::{DVec3, dvec3};

use crate::support::{body, plane, scene, simulation};

/// Lets a box fall while a region holds some of it; every particle but those moves at once.
fn held(region: &str, inside: impl Fn(usize, DVec3) -> bool) {
    for precision in ["f32", "f64"] {
        let text = format!(
            "[world]\ngravity = [0.0, 0.0, -9.81]\n[solver]\nprecision = \"{precision}\"\n{}fixed = [{region}]\n",
            body("box", 400, [0.5, 0.0, 0.0])
        );
        let mut simulation = simulation(&scene(&text));
        let start = simulation.positions().to_vec();
        let expected: Vec<bool> = (0..start.len())
            .map(|p| inside(p, simulation.mesh().positions[p]))
            .collect();
        let count = expected.iter().filter(|held| **held).count();
        assert!(
            count > 0 && count < start.len(),
            "{region} holds {count} of {}",
            start.len()
        );
        for _ in 0..5 {
            simulation.step().unwrap();
            for (p, held) in expected.iter().enumerate() {
                let moved = simulation.positions()[p] != start[p];
                assert_eq!(moved, !held, "{region}: particle {p} at {}", start[p]);
            }
        }
    }
}

#[test]
fn a_half_space_holds_what_its_normal_points_to() {
    held(
        "{ half_space = { point = [0.4, 0, 0], normal = [-3, 0, 1] } }",
        |_, x| dvec3(-3.0, 0.0, 1.0).dot(x - dvec3(0.4, 0.0, 0.0)) >= 0.0,
    );
}

#[test]
fn a_box_holds_what_lies_inside() {
    held(
        "{ box = { low = [0.3, -0.3, 0.0], high = [9, 0.2, 9] } }",
        |_, x| x.x >= 0.3 && x.y >= -0.3 && x.y <= 0.2 && x.z >= 0.0,
    );
}

#[test]
fn a_sphere_holds_what_lies_inside() {
    held(
        "{ sphere = { center = [0.3, 0.1, 0.5], radius = 0.4 } }",
        |_, x| x.distance(dvec3(0.3, 0.1, 0.5)) <= 0.4,
    );
}

#[test]
fn numbers_hold_these_particles() {
    held("{ particles = [0, 3, 17] }", |p, _| [0, 3, 17].contains(&p));
}

#[test]
fn several_regions_hold_what_any_of_them_holds() {
    held(
        "{ particles = [2] }, { sphere = { center = [0.5, 0, 0], radius = 0.3 } }, { particles = [2, 5] }",
        |p, x| p == 2 || p == 5 || x.distance(dvec3(0.5, 0.0, 0.0)) <= 0.3,
    );
}

#[test]
fn a_region_holds_its_own_body_only() {
    let first = body("box", 300, [0.0, 0.0, 0.0]);
    let second = body("sphere", 200, [2.0, 0.0, 0.0])
        + "fixed = [{ half_space = { point = [-9, 0, 0], normal = [1, 0, 0] } }]\n";
    let text = format!("[world]\ngravity = [0.0, 0.0, -9.81]\n{first}{second}");
    let mut simulation = simulation(&scene(&text));
    let start = simulation.positions().to_vec();
    simulation.step().unwrap();
    for (x, from) in simulation.positions().iter().zip(&start) {
        assert_eq!(x == from, from.x > 1.0, "{from}");
    }
}

/// Particles that a cut puts between two held ones, and copies of held ones, are held as well.
#[test]
fn a_cut_through_held_particles_keeps_holding() {
    let text = format!(
        "[world]\ngravity = [0.0, 0.0, -9.81]\n{}{}{}",
        body("box", 400, [0.0, 0.0, 0.0]),
        "fixed = [{ half_space = { point = [0, 0, 0.0], normal = [0, 0, 1] } }]\n",
        plane(1, [0.03, 0.0, 0.0], [1.0, 0.0, 0.0])
    );
    let mut simulation = simulation(&scene(&text));
    let held =
        |s: &Simulation| -> Vec<bool> { s.mesh().positions.iter().map(|x| x.z >= 0.25).collect() };
    for _ in 0..6 {
        simulation.step().unwrap();
        for (p, _) in held(&simulation)
            .iter()
            .enumerate()
            .filter(|(_, held)| **held)
        {
            let way = simulation.positions()[p].distance(simulation.mesh().positions[p]);
            assert!(way < 1e-6, "particle {p} moved by {way}");
        }
    }
    assert_eq!(simulation.report().pieces, 2);
}

/// A region that misses the body, as with a forgotten `scale`, is named in the first frame only; other regions are not.
#[test]
fn regions_that_contain_nothing_are_named_once() {
    let text = format!(
        "{}fixed = [{{ sphere = {{ center = [9.0, 0.0, 0.0], radius = 1.0 }} }}, {{ particles = [3] }}]\n\
         [[body.material]]\nyoung_modulus = 2e5\nregions = [{{ sphere = {{ center = [0.0, 9.0, 0.0], radius = 1.0 }} }}]\n\
         [[attachment]]\nbody = 0\nregions = [{{ sphere = {{ center = [0.0, 0.0, 9.0], radius = 1.0 }} }}]\n",
        body("box", 300, [0.0; 3])
    );
    let mut simulation = simulation(&scene(&text));
    let named = |report: &incise::FrameReport| -> Vec<String> {
        let empty = report.warnings().iter();
        let empty = empty.filter(|w| w.code == incise::WarningCode::EmptyRegion);
        empty.map(|w| w.location.clone()).collect()
    };
    let report = simulation.step().unwrap();
    assert_eq!(
        named(report),
        [
            "body[0].fixed[0]",
            "body[0].material[0].regions[0]",
            "attachment[0].regions"
        ]
    );
    assert!(named(simulation.step().unwrap()).is_empty());
}
