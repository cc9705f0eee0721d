//! Every kind of stroke in a scene, on one body and on several, followed by everything that follows cuts.

use incise::cutting::{FaceTag, Skin};
use incise::mesh::glam::DVec3;
use incise::report::PieceReport;
use incise::{FrameReport, Scene, Simulation, Warning, WarningCode};

use crate::support::{body, plane, simulation, state, sweep};

/// All kinds of strokes on the first body of a scene.
const STROKES: &str = r#"
    [[stroke]]
    kind = "rectangle"
    frame = 1
    center = [0.03, 0.0, 0.3]
    half_u = [0.0, 0.6, 0.0]
    half_v = [0.0, 0.0, 0.3]

    [[stroke]]
    kind = "surface"
    frame = 2
    points = [[-1.0, -1.0, -0.11], [1.0, -1.0, -0.11], [1.0, 1.0, -0.11], [-1.0, 1.0, -0.12]]
    triangles = [[0, 1, 2], [0, 2, 3]]

    [[stroke]]
    kind = "punch"
    frame = 3
    region = { sphere = { center = [-0.2, 0.0, 0.2], radius = 0.15 } }

    [[stroke]]
    kind = "remove"
    frame = 4
    region = { box = { low = [-1.0, -1.0, -1.0], high = [1.0, 1.0, -0.3] } }

    [[stroke]]
    kind = "sweep"
    frames = [3, 8]
    blade = [[-1.0, 0.07, 0.6], [1.0, 0.07, 0.6]]
    path = [[0, 0, 0], [0, 0, -1.2]]

    [[stroke]]
    kind = "plane"
    frame = 9
    point = [0.1, 0.0, 0.0]
    normal = [1.0, 0.3, 0.1]
"#;

fn scene(bodies: usize, more: &str) -> Scene {
    let mut text =
        String::from("[report]\nquantities = [\"volume\", \"speed\", \"energy\", \"kappa\"]\n");
    text += "[solver]\nprecision = \"f64\"\n";
    for i in 0..bodies {
        text += &format!(
            "[[body]]\nshape = {{ kind = \"sphere\", tets = 700 }}\nposition = [{}.0, 0.0, 0.0]\n{more}\n",
            3 * i
        );
    }
    Scene::from_toml(&(text + STROKES)).unwrap()
}

/// Runs the scene; checks everything in every frame and follows it with a skin. Returns the number of pieces.
fn run(scene: &Scene) -> usize {
    let mut simulation = Simulation::new(scene).unwrap();
    let mut skin = Skin::new(simulation.boundary());
    let mut mesh = simulation.mesh().clone();
    let mut removed = 0;
    for frame in 0..11 {
        let report = simulation.step().unwrap().clone();
        simulation.check().unwrap();
        for delta in simulation.deltas() {
            delta.apply(&mut mesh);
            skin.apply_delta(delta);
        }
        assert_eq!(&mesh, simulation.mesh(), "the deltas say everything");
        let mut followed: Vec<_> = (0..skin.triangles().len())
            .map(|i| (skin.tet(i), skin.tag(i)))
            .collect();
        let mut expected: Vec<_> = simulation.boundary().map(|t| (t.tet, t.tag)).collect();
        followed.sort_unstable();
        expected.sort_unstable();
        assert_eq!(followed, expected, "frame {frame}");
        if let Some(cut) = report.cut {
            removed += cut.tets_removed;
            assert!(
                cut.dihedral
                    .is_none_or(|[a, b]| 0.0 < a && a < b && b < 180.0)
            );
        }
        assert!(simulation.positions().iter().all(|x| x.is_finite()));
        let line = serde_json::to_string(&report).unwrap();
        assert!(!line.contains("NaN"), "{line}");
    }
    assert!(removed > 10);
    let tags: std::collections::BTreeSet<FaceTag> = simulation.boundary().map(|t| t.tag).collect();
    for stroke in 0..6 {
        assert!(
            tags.contains(&FaceTag::Cut(stroke)),
            "stroke {stroke} laid faces bare"
        );
    }
    simulation.report().pieces
}

#[test]
fn all_kinds_on_one_body() {
    assert!(run(&scene(1, "")) > 4);
}

#[test]
fn all_kinds_on_one_of_two_bodies() {
    let alone = run(&scene(1, ""));
    assert_eq!(run(&scene(2, "")), alone + 1);
}

#[test]
fn all_kinds_with_volume_constraints() {
    assert!(run(&scene(1, "volume_compliance = 0.0")) > 4);
}

/// A simulation continues with nothing after its bodies are removed as a whole.
#[test]
fn everything_removed() {
    for bodies in [1, 2] {
        let mut scene = scene(bodies, "");
        scene.stroke.truncate(4);
        scene.stroke.drain(..3);
        let text = scene.to_toml().unwrap().replace("-0.3", "1.0");
        let mut simulation = Simulation::new(&Scene::from_toml(&text).unwrap()).unwrap();
        for _ in 0..8 {
            let report = simulation.step().unwrap();
            let line = serde_json::to_string(report).unwrap();
            assert!(
                !line.contains("NaN") && !line.contains("_error\":null"),
                "{line}"
            );
            simulation.check().unwrap();
        }
        assert_eq!(simulation.report().pieces, bodies - 1);
        assert_eq!(simulation.pieces().len(), bodies - 1);
    }
}

#[test]
fn mistakes_name_the_key() {
    let refuse = |stroke: &str, expected: &str| {
        let text =
            format!("[[body]]\nshape = {{ kind = \"sphere\", tets = 200 }}\n[[stroke]]\n{stroke}");
        let error = Simulation::new(&Scene::from_toml(&text).unwrap()).unwrap_err();
        assert!(error.to_string().contains(expected), "{error}");
    };
    refuse(
        "kind = \"rectangle\"\nframe = 1\ncenter = [0,0,0]\nhalf_u = [1,0,0]\nhalf_v = [2,0,0]",
        "stroke[0].half_u",
    );
    refuse(
        "kind = \"surface\"\nframe = 1\npoints = [[0,0,0],[1,0,0],[0,1,0]]\ntriangles = [[0,1,3]]",
        "stroke[0].triangles",
    );
    refuse(
        "kind = \"punch\"\nframe = 1\nregion = { sphere = { center = [0,0,0], radius = -1.0 } }",
        "stroke[0].region.sphere.radius",
    );
    refuse(
        "kind = \"remove\"\nframe = 1\nregion = { particles = [1] }",
        "stroke[0].region",
    );
    refuse(
        "kind = \"punch\"\nframe = 1\nsnap = 0.3\nregion = { sphere = { center = [0,0,0], radius = 1.0 } }",
        "stroke[0].snap",
    );
}

/// Bites out of a body leave parts that hang by a particle; these come apart, while the last tets move into the gaps.
#[test]
fn bites_that_leave_parts_hanging() {
    let mut came_apart = 0;
    for seed in 0..12_u32 {
        let mut text = String::from("[[body]]\nshape = { kind = \"sphere\", tets = 700 }\n");
        for bite in 0..6_u32 {
            // Anywhere in the ball, small enough to leave tets between bites.
            let at = |k: u32| {
                f64::from((seed * 7919 + bite * 104_729 + k * 1_299_709) % 97) / 97.0 - 0.5
            };
            text += &format!(
                "[[stroke]]\nkind = \"remove\"\nframe = {bite}\nregion = {{ sphere = {{ center = [{}, {}, {}], radius = 0.22 }} }}\n",
                at(1),
                at(2),
                at(3)
            );
        }
        let mut simulation = Simulation::new(&Scene::from_toml(&text).unwrap()).unwrap();
        for _ in 0..7 {
            simulation.step().unwrap();
            simulation.check().unwrap();
            let deltas = simulation.deltas().iter();
            came_apart += deltas
                .filter(|delta| !delta.copies.is_empty() && !delta.moved.is_empty())
                .count();
        }
    }
    assert!(came_apart > 5, "{came_apart} removals separated something");
}

/// A stroke beside the body is named in the frame in which it ends, one that cuts is not. A live blade is named if it was
/// moved.
#[test]
fn strokes_that_cut_nothing_are_named() {
    let text = format!(
        "{}{}{}{}",
        body("box", 300, [0.0; 3]),
        plane(1, [0.02, 0.0, 0.0], [1.0, 0.1, 0.0]),
        plane(2, [9.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
        sweep(
            [1, 3],
            [[9.0, -1.0, 0.6], [9.0, 1.0, 0.6]],
            [0.0, 0.0, -1.2]
        ),
    );
    let mut simulation = simulation(&Scene::from_toml(&text).unwrap());
    let blade = |z: f64| [DVec3::new(5.0, 0.0, z), DVec3::new(5.0, 1.0, z)];
    let [moved, unmoved] = [0.1, 0.1].map(|snap| simulation.begin_stroke(&blade(0.0), snap));
    let (moved, unmoved) = (moved.unwrap(), unmoved.unwrap());
    let mut named = Vec::new();
    for frame in 0..6 {
        if frame == 2 {
            simulation.move_blade(moved, &blade(0.5)).unwrap();
        }
        if frame == 4 {
            simulation.end_stroke(moved).unwrap();
            simulation.end_stroke(unmoved).unwrap();
        }
        let missed = missed(simulation.step().unwrap());
        let frame = simulation.report().frame;
        named.extend(missed.into_iter().map(|w| (frame, w.location)));
    }
    let expected = [(2, "stroke[1]"), (3, "stroke[2]"), (4, "stroke[3]")];
    assert_eq!(
        named,
        expected.map(|(frame, name)| (frame, name.to_owned()))
    );
}

fn missed(report: &FrameReport) -> Vec<Warning> {
    let missed = report.warnings().iter();
    let missed = missed.filter(|w| w.code == WarningCode::StrokeMissed);
    missed.cloned().collect()
}

/// The warning has the box that the stroke passed and that of the nearest body, in the numbers of the scene, and asks for
/// the units where sizes differ a lot.
#[test]
fn a_missed_stroke_names_its_box_and_that_of_the_body() {
    let text = |body: &str, stroke: &str| {
        let scene = format!(
            "{body}[[body]]\nshape = {{ kind = \"box\", tets = 300 }}\nposition = [0.0, 0.0, 40.0]\n{stroke}"
        );
        let mut simulation = simulation(&Scene::from_toml(&scene).unwrap());
        let frames = (0..4).map(|_| missed(simulation.step().unwrap()));
        let warnings: Vec<Warning> = frames.flatten().collect();
        assert_eq!(warnings.len(), 1, "{warnings:?}");
        warnings[0].message.clone()
    };
    let cube = body("box", 300, [0.0; 3]);
    let around = "the nearest body is body 0";
    // A path in mm.
    let blade = [[-1000.0, 1000.0, 600.0], [1000.0, 1000.0, 600.0]];
    let message = text(&cube, &sweep([1, 3], blade, [0.0, 500.0, -1200.0]));
    assert!(
        message.contains("the box from (-1000, 1000, -600) to (1000, 1500, 600) m"),
        "{message}"
    );
    assert!(
        message.contains(around)
            && message.contains("in the box from (-0.5, -0.5, -0.5) to (0.5, 0.5, 0.5) m"),
        "{message}"
    );
    assert!(
        message.contains("the stroke is 2000 times as large as the body: check that both are in m"),
        "{message}"
    );
    // A miss by a little says nothing of units.
    let blade = [[-1.0, 0.6, 0.6], [1.0, 0.6, 0.6]];
    let message = text(&cube, &sweep([1, 3], blade, [0.0, 0.0, -1.2]));
    assert!(
        message.contains("body 0 at a distance of 0.1 m"),
        "{message}"
    );
    assert!(!message.contains("times"), "{message}");
    // A body in mm.
    let large = cube
        .replace("young", "scale = 1000.0\nyoung")
        .replace("position = [0.0, 0.0, 0.0]", "position = [0.0, 0.0, 600.0]");
    let message = text(
        &large,
        &sweep(
            [1, 3],
            [[-1.0, 0.6, 38.0], [1.0, 0.6, 38.0]],
            [0.0, 0.0, -1.2],
        ),
    );
    assert!(message.contains("the nearest body is body 1"), "{message}");
    // Planes have no box; a far one is far in sizes of the body.
    let message = text(&cube, &plane(1, [90.0, 0.0, 0.0], [2.0, 0.0, 0.0]));
    assert!(
        message.contains("its plane passes (90, 0, 0) m with normal (1, 0, 0)"),
        "{message}"
    );
    assert!(
        message.contains("the distance is 89.5 times the size of the body"),
        "{message}"
    );
    // Other kinds.
    let rectangle = "[[stroke]]\nkind = \"rectangle\"\nframe = 1\ncenter = [2.0, 0.0, 0.0]\nhalf_u = [0.0, 0.6, 0.1]\nhalf_v = [0.0, -0.1, 0.6]\n";
    let message = text(&cube, rectangle);
    assert!(
        message.contains("the box from (2, -0.7, -0.7) to (2, 0.7, 0.7) m"),
        "{message}"
    );
    let punch = "[[stroke]]\nkind = \"punch\"\nframe = 1\nregion = { sphere = { center = [2.0, 0.0, 0.0], radius = 0.25 } }\n";
    let message = text(&cube, punch);
    assert!(
        message.contains("the box from (1.75, -0.25, -0.25) to (2.25, 0.25, 0.25) m"),
        "{message}"
    );
}

/// The warnings of planes across a body that is pinned below z = -0.2, in the frame after the cut.
fn pinned_cuts(pinned: &str, strokes: &str, shape: &str) -> Vec<Warning> {
    let text = format!(
        "{}{pinned}\n{strokes}",
        body(shape, 4000, [0.0; 3]).replace("[[body]]", "[[body]]\n")
    );
    let mut simulation = simulation(&Scene::from_toml(&text).unwrap());
    let mut warnings = Vec::new();
    for _ in 0..6 {
        let report = simulation.step().unwrap();
        let pinned = report.warnings().iter();
        let pinned = pinned.filter(|w| w.code == WarningCode::PinnedCut);
        warnings.extend(pinned.cloned());
    }
    simulation.check().unwrap();
    warnings
}

const BELOW: &str = "{ half_space = { point = [0, 0, -0.2], normal = [0, 0, -1] } }";

/// A plane in a pinned region, or so little inside that only a rim of particles is above it, frees nothing.
#[test]
fn planes_inside_a_pinned_region_are_named() {
    let fixed = format!("fixed = [{BELOW}]");
    for shape in ["box", "sphere"] {
        // A mean edge is about 0.1.
        for (depth, normal) in [
            (0.12, [0.0, 0.0, 1.0]),
            (0.05, [0.0, 0.05, 1.0]),
            (0.02, [0.0, 0.0, 1.0]),
            (0.01, [0.0, 0.05, 1.0]),
        ] {
            let stroke = plane(1, [0.0, 0.0, -0.2 - depth], normal);
            let warnings = pinned_cuts(&fixed, &stroke, shape);
            assert_eq!(warnings.len(), 1, "{shape}, depth {depth}: {warnings:?}");
            let Warning {
                message, location, ..
            } = &warnings[0];
            assert_eq!(location, "stroke[0]");
            assert!(
                message.contains("body[0].fixed") && message.contains("in the box from ("),
                "{message}"
            );
        }
    }
    // An attachment pins as well, and a sweep is judged when it ends.
    let attachment = format!(
        "[[attachment]]\nregions = [{BELOW}]\nframes = [0, 9]\npath = [[0, 0, 0], [0, 0, 0.1]]\n"
    );
    let stroke = sweep(
        [1, 3],
        [[-1.0, -0.7, -0.25], [1.0, -0.7, -0.25]],
        [0.0, 1.4, 0.0],
    );
    let warnings = pinned_cuts(&attachment, &stroke, "box");
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(
        warnings[0].message.contains("attachment[0] pins it"),
        "{}",
        warnings[0].message
    );
}

/// A rim is told from its teeth alone where most of the cut is free.
#[test]
fn a_rim_of_pinned_particles_is_counted() {
    let fixed = format!("fixed = [{BELOW}]");
    let stroke = plane(1, [0.0, 0.0, -0.2], [0.0, 0.05, 1.0]);
    let warnings = pinned_cuts(&fixed, &stroke, "sphere");
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    let message = &warnings[0].message;
    assert!(
        message.contains("stays pinned by") && message.contains("particles along the cut"),
        "{message}"
    );
}

/// Cuts that free a part, or run down into a pinned base, are no reason for a warning; nor are soft attachments and grabs.
#[test]
fn cuts_that_can_open_are_not_named() {
    let fixed = format!("fixed = [{BELOW}]");
    let soft = format!(
        "[[attachment]]\nregions = [{BELOW}]\ncompliance = 1e-3\nframes = [0, 9]\npath = [[0, 0, 0], [0, 0, 0.1]]\n"
    );
    let above = plane(1, [0.0, 0.0, -0.1], [0.0, 0.0, 1.0]);
    let inside = plane(1, [0.0, 0.0, -0.25], [0.0, 0.0, 1.0]);
    let down = plane(1, [0.02, 0.0, 0.0], [1.0, 0.0, 0.0]);
    let slit = sweep(
        [1, 3],
        [[0.02, -1.0, 0.7], [0.02, 1.0, 0.7]],
        [0.0, 0.0, -1.0],
    );
    // Only the lowest layer is pinned, all of it next to the cut, but the part above comes off.
    let layer = "fixed = [{ half_space = { point = [0, 0, -0.49], normal = [0, 0, -1] } }]";
    let near = plane(1, [0.0, 0.0, -0.45], [0.0, 0.0, 1.0]);
    for (pinned, stroke) in [
        (fixed.as_str(), &above),
        (&fixed, &down),
        (&fixed, &slit),
        (&soft, &inside),
        (layer, &near),
        ("", &inside),
    ] {
        let warnings = pinned_cuts(pinned, stroke, "box");
        assert!(warnings.is_empty(), "{pinned} {stroke}: {warnings:?}");
    }
}

/// Planes that cross at irregular angles leave parts below half a mean tet. By default those beside a larger part stay
/// with it and are counted; with `crumbs = 0` they come off. Volume is the same.
#[test]
fn crumbs_stay_with_larger_parts_unless_the_scene_turns_that_off() {
    let run = |cutting: &str| {
        let mut text = format!("{cutting}\n[[body]]\nshape = {{ kind = \"box\", tets = 2000 }}\n");
        for i in 0..12 {
            let angle = 0.5 + 1.7 * f64::from(i);
            let normal = [angle.cos(), angle.sin(), 0.3 * (2.0 * angle).sin()];
            text += &format!(
                "[[stroke]]\nkind = \"plane\"\nframe = {i}\npoint = [0.01, 0.02, 0.03]\nnormal = {normal:?}\nsnap = 0.0\n"
            );
        }
        let mut simulation = simulation(&Scene::from_toml(&text).unwrap());
        let mut crumbs = 0;
        for _ in 0..12 {
            let report = simulation.step().unwrap();
            crumbs += report.cut.as_ref().map_or(0, |cut| cut.crumbs);
        }
        simulation.check().unwrap();
        let pieces = simulation.pieces();
        let volume: f64 = pieces.iter().map(|piece| piece.volume).sum();
        let is_small = |piece: &&PieceReport| piece.volume < 0.5 * volume / 2000.0;
        (
            crumbs,
            pieces.len(),
            pieces.iter().filter(is_small).count(),
            volume,
        )
    };
    let (crumbs, pieces, small, volume) = run("");
    let (none, all, all_small, same) = run("[cutting]\ncrumbs = 0.0");
    assert!(crumbs > 0 && none == 0, "{crumbs} and {none} crumbs");
    assert!(
        pieces < all && 2 * small < all_small,
        "{small} of {pieces}, {all_small} of {all}"
    );
    assert!((volume / same - 1.0).abs() < 1e-12);
}

/// Three planes that cross at many offsets, with the largest snap distance, on every kind of generated body: a single tet
/// comes off by default only from a part of fewer than four mean tets, which is too small for crumbs to stay with. Without
/// the rule for crumbs single tets come off large parts.
#[test]
fn planes_at_the_largest_snap_distance_leave_no_single_tets() {
    let mut loose = 0;
    for shape in ["box", "sphere", "liver", "torus", "beam"] {
        for i in 0..20_u32 {
            let along = -0.48 + 0.048 * f64::from(i) + 1e-3;
            let tilt = 0.3 * f64::from(i % 3);
            let normals = [
                [1.0, tilt, 0.2 - tilt],
                [tilt, 1.0, 0.15],
                [0.1, -tilt, 1.0],
            ];
            let point = [0.5 * along, 0.3 * along, 0.2 * along];
            let strokes = normals.map(|normal| plane(0, point, normal) + "snap = 0.25\n");
            let run = |cutting: &str| {
                let body = body(shape, 1500, [0.0; 3]);
                let text = format!("{cutting}\n{body}{}", strokes.concat());
                let mut simulation = simulation(&Scene::from_toml(&text).unwrap());
                let mean = simulation.mesh().total_volume() / simulation.mesh().tets.len() as f64;
                simulation.step().unwrap();
                let pieces = simulation.pieces();
                let parent = |single: &PieceReport| {
                    let parent = single
                        .parent
                        .and_then(|id| pieces.iter().find(|piece| piece.id == id));
                    single.volume + parent.map_or(0.0, |parent| parent.volume)
                };
                let singles = pieces.iter().filter(|piece| piece.tets == 1);
                singles
                    .filter(|single| parent(single) >= 4.0 * mean)
                    .count()
            };
            assert_eq!(run(""), 0, "{shape} cut at {along}");
            loose += run("[cutting]\ncrumbs = 0.0");
        }
    }
    assert!(loose > 0, "no plane leaves a single tet to begin with");
}

/// Close slices of two bodies, with and without improvement: fewer tets and as many pieces, all derived data is current,
/// and a snapshot restores the state before.
#[test]
fn improvement_after_strokes_keeps_everything_current() {
    for contact in ["", "[contact]\n"] {
        let run = |cutting: &str| {
            let mut text = format!("{cutting}\n{contact}");
            for x in [0.0, 3.0] {
                text += &format!(
                    "[[body]]\nshape = {{ kind = \"box\", tets = 300 }}\nposition = [{x:?}, 0.0, 0.0]\n"
                );
            }
            for i in 0..4 {
                let at = 0.02 * f64::from(i) + 0.01;
                text += &format!(
                    "[[stroke]]\nkind = \"plane\"\nframe = {i}\npoint = [{at:?}, 0.02, 0.03]\nnormal = [1.0, 0.1, {at:?}]\nsnap = 0.0\n"
                );
            }
            text += "[[stroke]]\nkind = \"sweep\"\nframes = [5, 8]\nblade = [[-1.0, 0.07, 0.9], [1.0, 0.07, 0.9]]\npath = [[0, 0, 0], [0, 0, -1.8]]\n";
            let mut simulation = simulation(&Scene::from_toml(&text).unwrap());
            let (mut collapsed, mut merged) = (0, 0);
            for frame in 0..300 {
                let before = (frame == 3).then(|| simulation.snapshot().unwrap());
                let report = simulation.step().unwrap();
                collapsed += report.cut.as_ref().map_or(0, |cut| cut.collapsed);
                merged += report.cut.as_ref().map_or(0, |cut| cut.tets_merged);
                if frame < 20 || frame % 20 == 0 {
                    simulation.check().unwrap();
                }
                if let Some(before) = before {
                    let positions = simulation.positions().to_vec();
                    simulation.restore(&before).unwrap();
                    simulation.check().unwrap();
                    simulation.step().unwrap();
                    assert_eq!(simulation.positions(), positions);
                }
            }
            let volume: f64 = simulation.pieces().iter().map(|piece| piece.volume).sum();
            let tets = simulation.mesh().tets.len();
            (collapsed, merged, tets, simulation.pieces().len(), volume)
        };
        let (none, _, grown, pieces, volume) = run("[cutting]\nimprove = false");
        let (collapsed, merged, tets, same, kept) = run("");
        assert!(none == 0 && collapsed > 0 && merged > 0);
        assert!(
            5 * tets < 3 * grown,
            "{tets} of {grown}, {collapsed} taken out"
        );
        assert_eq!(pieces, same);
        assert!((kept / volume - 1.0).abs() < 1e-12);
    }
}

/// A slice thinner than the snap distance is not cut off: the stroke has met the body, so nothing is said of units.
#[test]
fn a_slice_that_is_too_thin_is_not_told_to_have_missed() {
    let body = body("box", 1500, [0.0; 3]);
    let strokes = [0.1, 0.101].map(|x| plane(1, [x, 0.0, 0.0], [1.0, 0.0, 0.0]) + "snap = 0.1\n");
    let mut simulation =
        simulation(&Scene::from_toml(&format!("{body}{}", strokes.concat())).unwrap());
    let mut told = Vec::new();
    for _ in 0..4 {
        let report = simulation.step().unwrap();
        told.extend(report.warnings().iter().map(ToString::to_string));
    }
    assert_eq!(simulation.pieces().len(), 2);
    let told: Vec<_> = told
        .iter()
        .filter(|text| text.contains("stroke[1]"))
        .collect();
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(told[0].contains("within the snap distance"), "{told:?}");
}

/// Without merging, tets that an improvement gives other corners stay in their clusters.
#[test]
fn improvement_without_merging_keeps_clusters() {
    let run = |improve: bool| {
        let mut text =
            format!("[cutting]\nimprove = {improve}\n[solver]\nmerge_clusters = false\n");
        text += &body("box", 1500, [0.0; 3]);
        for i in 0..4_u32 {
            let at = 0.02 * f64::from(i) + 0.01;
            text += &plane(i.into(), [at, 0.02, 0.03], [1.0, 0.1, at]);
        }
        let mut simulation = simulation(&Scene::from_toml(&text).unwrap());
        let mut collapsed = 0;
        for _ in 0..100 {
            let report = simulation.step().unwrap();
            collapsed += report.cut.as_ref().map_or(0, |cut| cut.collapsed);
        }
        simulation.check().unwrap();
        let report = simulation.report();
        (collapsed, report.tets as f64 / report.clusters as f64)
    };
    let ((none, plain), (collapsed, improved)) = (run(false), run(true));
    assert!(none == 0 && collapsed > 20, "{collapsed}");
    assert!(
        improved > 0.9 * plain,
        "{improved} tets a cluster, {plain} without improvement"
    );
}

/// A body without load and with contact, cut by a plane and by sweeps that end inside: improvement keeps the contact of the
/// sides of the cuts, and the body moves no further than without it.
#[test]
fn improvement_keeps_contact_across_fresh_cuts() {
    let run = |improve: bool| {
        let mut text = format!(
            "[cutting]\nimprove = {improve}\n[world]\ngravity = [0.0, 0.0, 0.0]\n[contact]\n[solver]\nprecision = \"f64\"\n"
        );
        text += &body("box", 800, [0.0; 3]);
        text += &plane(0, [0.02, 0.0, 0.0], [1.0, 0.2, 0.1]);
        text += &sweep(
            [1, 5],
            [[-1.0, 0.05, 0.9], [1.0, 0.05, 0.9]],
            [0.0, 0.02, -0.93],
        );
        text += &sweep(
            [6, 9],
            [[-1.0, 0.1, 0.9], [1.0, 0.1, 0.9]],
            [0.0, 0.02, -0.8],
        );
        let mut simulation = simulation(&Scene::from_toml(&text).unwrap());
        let start = simulation.positions().to_vec();
        let (mut collapsed, mut farthest): (usize, f64) = (0, 0.0);
        for _ in 0..60 {
            let report = simulation.step().unwrap();
            collapsed += report.cut.as_ref().map_or(0, |cut| cut.collapsed);
            simulation.check().unwrap();
            let moved = start
                .iter()
                .zip(simulation.positions())
                .map(|(x, y)| x.distance(*y));
            farthest = moved.fold(farthest, f64::max);
        }
        let candidates = simulation
            .report()
            .contact
            .map(|contact| contact.candidates);
        (collapsed, farthest, candidates)
    };
    let ((none, still, plain), (collapsed, moved, improved)) = (run(false), run(true));
    assert!(none == 0 && collapsed > 20, "{collapsed}");
    assert!(moved < still + 1e-9, "{still} {moved}");
    // Cut faces have fewer particles, but are not without contact.
    let [plain, improved] = [plain.unwrap(), improved.unwrap()];
    assert!(2 * improved > plain, "{plain} {improved}");
}

/// The corners of a square, to be cut corner by corner.
const SQUARE: [[f64; 3]; 5] = [
    [-0.2, -0.17, 0.0],
    [0.23, -0.17, 0.0],
    [0.23, 0.21, 0.0],
    [-0.2, 0.21, 0.0],
    [-0.2, -0.17, 0.0],
];

/// Four strokes from corner to corner of a square: it comes off when the last one has ended, in the same frame if it is one of
/// the scene, in the next if it is a live one. From a snapshot between the two it goes on with the same bits. With
/// `join_ends = false`, and with a stroke of `snap = 0`, it does not come off.
#[test]
fn strokes_that_end_at_each_other_are_joined() {
    let plate = "[world]\ngravity = [0.0, 0.0, 0.0]\n[contact]\n[cutting]\nimprove = false\n\
                 [[body]]\nshape = { kind = \"plate\", tets = 3000 }\n";
    let blade = [[0.0, 0.0, -0.4], [0.0, 0.0, 0.4]];
    let mut declared = plate.to_owned();
    for (i, path) in (0_u64..).zip(SQUARE.windows(2)) {
        let [from, to] = [path[0], path[1]].map(DVec3::from_array);
        let blade = blade.map(|x| (DVec3::from_array(x) + from).to_array());
        declared += &sweep([5 * i, 5 * i + 4], blade, (to - from).to_array());
    }
    let scene = Scene::from_toml(&declared).unwrap();
    let mut apart = scene.clone();
    apart.cutting.join_ends = false;
    // The text ends within the last stroke.
    let exact = Scene::from_toml(&format!("{declared}snap = 0.0\n")).unwrap();
    for (scene, at_end) in [(scene, 2), (apart, 1), (exact, 1)] {
        let mut declared = simulation(&scene);
        let mut pieces = Vec::new();
        for _ in 0..22 {
            declared.step().unwrap();
            pieces.push(declared.pieces().len());
        }
        assert_eq!(pieces[..19], [1; 19]);
        assert_eq!(pieces[19..], [at_end; 3]);
    }

    let mut live = simulation(&Scene::from_toml(plate).unwrap());
    for path in SQUARE.windows(2) {
        let [from, to] = [path[0], path[1]].map(DVec3::from_array);
        let pose = |t: f64| blade.map(|x| DVec3::from_array(x) + from.lerp(to, t));
        let stroke = live.begin_stroke(&pose(0.0), 0.1).unwrap();
        live.step().unwrap();
        for i in 1..=4 {
            live.move_blade(stroke, &pose(f64::from(i) / 4.0)).unwrap();
            live.step().unwrap();
        }
        assert_eq!(live.pieces().len(), 1);
        live.end_stroke(stroke).unwrap();
    }
    let between = live.snapshot().unwrap();
    let mut after = Vec::new();
    for _ in 0..2 {
        live.restore(&between).unwrap();
        let report = live.step().unwrap();
        assert_eq!(report.detached.len(), 1);
        let cut = report.cut.as_ref().unwrap();
        assert_eq!((cut.tets_cut, cut.particles_created > 0), (0, true));
        assert_eq!(live.pieces().len(), 2);
        for _ in 0..3 {
            live.step().unwrap();
        }
        after.push(state(&live));
    }
    assert!(after[0] == after[1]);
}
