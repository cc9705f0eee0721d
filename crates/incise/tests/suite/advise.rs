//! The references of `incise::advise` against what is known: orders of convergence, rigid motions, a body that is
//! stitched together.

use std::fmt::Write;

use incise::advise::{
    AdviseSettings, Measured, Motion, Reference, ReferenceKind, accurate_substeps, advise,
    default_frames, newton_motion, with,
};
use incise::mesh::glam::{DQuat, DVec3};
use incise::mesh::kuhn_box;
use incise::mesh_io;
use incise::scene::{Precision, SolverSpec};

use crate::support::{extent, scene};

/// A soft beam that falls, held at one end.
const BEAM: &str = r#"
[world]
gravity = [0.0, 0.0, -9.81]
[[body]]
shape = { kind = "beam", tets = 250 }
young_modulus = 1e4
poisson_ratio = 0.3
fixed = [{ half_space = { point = [-0.4, 0.0, 0.0], normal = [-1.0, 0.0, 0.0] } }]
"#;

/// Implicit Euler is of first order: each of the three runs halves the error, and little of it is left.
#[test]
fn the_reference_converges_at_its_order() {
    let reference = Reference::newton(&scene(BEAM), 5, 4).unwrap();
    assert_eq!(reference.kind, ReferenceKind::Newton);
    // Seen from steps that are not small yet the order is a little less than 1.
    assert!((0.7..1.2).contains(&reference.order), "{}", reference.order);
    let [a, b, c] = reference.errors.map(|e| e.largest);
    assert!(
        a > b && b > c && reference.left.largest < 0.3 * c,
        "{:?}",
        reference.errors
    );
}

/// XPBD goes where the reference goes: with each doubling of substeps the error is at most 0.6 of what it was, and
/// measured against itself it is the same to what is left.
#[test]
fn errors_fall_with_substeps() {
    let scene = scene(BEAM);
    let frames = 5;
    let reference = Reference::newton(&scene, frames, 4).unwrap();
    let n = accurate_substeps(&scene).unwrap();
    let error = |substeps: u32| {
        let solver = SolverSpec::default().with(|spec| {
            spec.substeps = substeps.into();
            spec.precision = Precision::F64;
        });
        let motion = Motion::of(&with(&scene, &solver), frames, Some(1)).unwrap();
        motion.deviation(&reference.motion).largest
    };
    let errors = [2, 4, 8].map(|k| error(k * n));
    assert!(
        errors[1] < 0.6 * errors[0] && errors[2] < 0.6 * errors[1],
        "{errors:?}"
    );
    let own = Reference::xpbd(&scene, frames, 4 * n).unwrap();
    let apart = own.motion.deviation(&reference.motion).largest;
    // The finest run is about as far from the limit as from the run before it: first order.
    assert!(
        apart < 2.0 * (own.left.largest + reference.left.largest),
        "{apart}, {:?}",
        own.left
    );
}

/// The table that is advised, pasted into the scene, gives the error that was promised, in % of the motion and of the size.
#[test]
fn the_advised_scene_is_as_accurate_as_it_says() {
    let frames = 6;
    let mut question = AdviseSettings::new(1e3, frames);
    question.threads = Some(1);
    let advice = advise(&scene(BEAM), &question).unwrap();
    assert_eq!(advice.reference.kind, ReferenceKind::Newton);
    let reference = Reference::newton(&scene(BEAM), frames, 4).unwrap();
    for m in &advice.measured {
        let advised = scene(&format!("{BEAM}{}", m.solver));
        let motion = Motion::of(&advised, frames, Some(1)).unwrap();
        assert_eq!(motion.deviation(&reference.motion), m.error, "{}", m.name);
        assert!(
            m.error.motion > m.error.largest,
            "a beam does not move by its size"
        );
    }
    let best = &advice.measured[advice.best.unwrap()];
    let least = |least: f64, m: &Measured| least.min(m.error.motion);
    let least = advice.measured.iter().fold(f64::MAX, least);
    assert!(best.error.motion <= least.max(advice.reference.left.motion));
    assert!(
        advice
            .measured
            .iter()
            .any(|m| m.name == "auto, accuracy 0.02")
    );
}

/// Half a second, or until the last stroke, but not for ever.
#[test]
fn advice_looks_far_enough() {
    let mut scene = scene(BEAM);
    assert_eq!(default_frames(&scene), 32);
    scene.solver.time_step = 0.1;
    assert_eq!(default_frames(&scene), 5);
    scene.solver.time_step = 1e-4;
    assert_eq!(default_frames(&scene), 100);
}

/// A body all of whose particles a handle turns moves as a rigid one.
#[test]
fn handles_move_the_reference_as_they_say() {
    let mut text = BEAM.to_owned();
    text.truncate(text.find("fixed").unwrap());
    text += "[[attachment]]\nregions = [{ half_space = { point = [0, 0, 9], normal = [0, 0, -1] } }]\nframes = [0, 4]\n\
             path = [[0, 0, 0], [0.4, 0, 0]]\nrotation = { axis = [1, 0, 0], angle_degrees = 80, center = [0, 0.1, 0] }\n";
    let scene = scene(&text);
    let rest = incise::Simulation::with_threads(&scene, 1)
        .unwrap()
        .mesh()
        .positions
        .clone();
    let motion = newton_motion(&scene, 2, 3).unwrap();
    let turned = DQuat::from_rotation_x(40f64.to_radians());
    let center = DVec3::new(0.0, 0.1, 0.0);
    for (x, rest) in motion.positions[rest.len()..].iter().zip(&rest) {
        let expected = center + DVec3::X * 0.2 + turned * (*rest - center);
        assert!(x.distance(expected) < 1e-12, "{x} {expected}");
    }
}

/// Two layers that stitches of no length join are for the reference the body that they make: the same tets, so the same
/// motion.
#[test]
fn stitched_layers_move_as_one_body() {
    let folder = tempfile::tempdir().unwrap();
    let size = DVec3::new(1.0, 0.25, 0.25);
    let [whole, layer] = [([4, 2, 2], size), ([4, 2, 1], DVec3::new(1.0, 0.25, 0.125))]
        .map(|(cells, size)| kuhn_box(cells, size));
    for (name, mesh) in [("whole.vtk", &whole), ("layer.vtk", &layer)] {
        mesh_io::write(folder.path().join(name), mesh).unwrap();
    }
    let body = |name: &str, z: f64| {
        let path = folder.path().join(name);
        format!(
            "[[body]]\nmesh = {path:?}\nposition = [0, 0, {z:?}]\nyoung_modulus = 1e4\npoisson_ratio = 0.3\n\
             fixed = [{{ half_space = {{ point = [0, 0, 0], normal = [-1, 0, 0] }} }}]\n"
        )
    };
    let gravity = "[world]\ngravity = [0, 0, -9.81]\n";
    let one = scene(&format!("{gravity}{}", body("whole.vtk", 0.0)));
    let mut text = format!(
        "{gravity}{}{}",
        body("layer.vtk", 0.0),
        body("layer.vtk", 0.125)
    );
    for x in layer.positions.iter().filter(|x| x.z == 0.125 && x.x > 0.0) {
        let point = x.to_array();
        writeln!(
            text,
            "[[distance]]\nfrom = {{ body = 0, point = {point:?} }}\nto = {{ body = 1, point = {point:?} }}"
        )
        .unwrap();
    }
    let two = scene(&text);
    let [one_motion, two_motion] = [&one, &two].map(|scene| newton_motion(scene, 2, 2).unwrap());
    let start = |scene| {
        incise::Simulation::with_threads(scene, 1)
            .unwrap()
            .mesh()
            .positions
            .clone()
    };
    let (one_start, two_start) = (start(&one), start(&two));
    assert!(two_start.len() > one_start.len());
    for (x, rest) in two_motion.positions[two_start.len()..]
        .iter()
        .zip(&two_start)
    {
        let same = one_start
            .iter()
            .position(|other| other.distance(*rest) < 1e-12)
            .unwrap();
        let expected = one_motion.positions[one_start.len() + same];
        // Newton's method ends at 1e-10 of the forces.
        assert!(x.distance(expected) < 1e-7, "{x} {expected}");
    }
    assert!((two_motion.volumes[1] - one_motion.volumes[1]).abs() < 1e-7);
}

/// A cut of frame 0 is the reference's, too: the part that comes off falls freely.
#[test]
fn the_reference_is_given_the_cut_mesh() {
    let cut = format!(
        "{BEAM}[[stroke]]\nkind = \"plane\"\nframe = 0\npoint = [0.013, 0, 0]\nnormal = [1, 0, 0]\n"
    );
    let scene = scene(&cut);
    let motion = newton_motion(&scene, 2, 2).unwrap();
    let (middle, half) = extent(&scene);
    let rest = incise::Simulation::with_threads(&scene, 1)
        .unwrap()
        .mesh()
        .positions
        .clone();
    let end = rest
        .iter()
        .position(|x| x.x > middle.x + 0.9 * half.x)
        .unwrap();
    let fallen = motion.positions[rest.len() + end] - rest[end];
    // Four steps of implicit Euler: g dt² (1 + 2 + 3 + 4).
    let expected = -9.81 * 0.008f64.powi(2) * 10.0;
    assert!(
        (fallen.z - expected).abs() < 1e-9 && fallen.x.abs() < 1e-9,
        "{fallen}"
    );
}

#[test]
fn features_unsupported_by_the_reference_are_named() {
    for (more, what) in [
        ("[world.ground]\nheight = -1.0\n", "a ground"),
        (
            "[[body]]\nshape = { kind = \"box\", tets = 300 }\ndamping = 0.1\n",
            "damping",
        ),
        (
            "[[stroke]]\nkind = \"plane\"\nframe = 1\npoint = [0, 0, 0]\nnormal = [1, 0, 0]\n",
            "strokes after frame 0",
        ),
    ] {
        let error = Reference::newton(&scene(&format!("{BEAM}{more}")), 1, 1).unwrap_err();
        assert!(error.to_string().contains(what), "{error}");
    }
}
