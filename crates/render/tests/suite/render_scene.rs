//! Render scenes: after any strokes the skin and its colors equal rebuilt ones, rays hit the right triangles, and
//! stretch equals a closed form.

use glam::{DMat3, DQuat, DVec3};
use incise::cutting::FaceTag;
use incise::mesh::{ParticleId, TetId};
use incise_render::{ColorBy, RenderError, RenderScene, normal_sums, stretch};
use proptest::prelude::*;

use crate::support::{LIVER, Shown, TWO_BODIES};

/// Two bodies, cut by a plane, a moving blade, a punch, and with a part taken away.
const STROKES: &str = r#"
[solver]
substeps = 2
[[body]]
shape = { kind = "box", tets = 500 }
[[body]]
shape = { kind = "sphere", tets = 500 }
position = [1.2, 0.0, 0.0]
[[stroke]]
kind = "plane"
frame = 1
point = [0.1, 0.0, 0.0]
normal = [1.0, 0.2, 0.0]
[[stroke]]
kind = "sweep"
frames = [2, 6]
blade = [[-1.0, 0.05, 1.0], [3.0, 0.1, 1.0]]
path = [[0.0, 0.0, 0.0], [0.0, 0.0, -2.0]]
[[stroke]]
kind = "punch"
frame = 4
region = { sphere = { center = [1.2, 0.2, 0.3], radius = 0.2 } }
[[stroke]]
kind = "remove"
frame = 7
region = { box = { low = [-1.0, -1.0, -1.0], high = [-0.2, 1.0, 0.0] } }
"#;

type Triangle = (TetId, [ParticleId; 3], FaceTag, Option<[u8; 3]>);

/// All triangles with their colors, in an order that does not depend on how they came about.
fn triangles(render_scene: &RenderScene) -> Vec<Triangle> {
    let skin = render_scene.skin();
    let triangle = |t: usize| {
        let mut corners = skin.triangles()[t].map(|v| skin.vertices()[v as usize].particle);
        let first = (0..3).min_by_key(|&i| corners[i]).unwrap();
        corners.rotate_left(first);
        (skin.tet(t), corners, skin.tag(t), render_scene.color_of(t))
    };
    let mut all: Vec<_> = (0..skin.triangles().len()).map(triangle).collect();
    all.sort_unstable_by_key(|triangle| (triangle.0, triangle.1));
    all
}

#[test]
fn updated_scenes_equal_rebuilt_ones() {
    for by in [
        ColorBy::Tissue,
        ColorBy::Color,
        ColorBy::Cluster,
        ColorBy::Stretch,
    ] {
        let mut shown = Shown::new(STROKES, 0);
        let before = triangles(&shown.render_scene).len();
        for _ in 0..9 {
            shown.advance(1);
            // A second time changes nothing.
            shown.render_scene.sync(&shown.simulation);
            let legend = shown
                .render_scene
                .color(&mut shown.simulation, by, None)
                .unwrap();
            assert_eq!(legend.is_some(), by == ColorBy::Stretch);
            let mut rebuilt = RenderScene::new(&shown.simulation, &shown.scene);
            rebuilt.color(&mut shown.simulation, by, None).unwrap();
            let all = triangles(&shown.render_scene);
            assert_eq!(all, triangles(&rebuilt), "{by}");
            assert!(all.iter().all(|t| t.3.is_some() == (by != ColorBy::Tissue)));
        }
        assert!(triangles(&shown.render_scene).len() > before);
        let followed = triangles(&shown.render_scene);
        shown.render_scene.reset(&shown.simulation);
        shown
            .render_scene
            .color(&mut shown.simulation, by, None)
            .unwrap();
        assert_eq!(followed, triangles(&shown.render_scene));
    }
}

#[test]
fn pieces_keep_their_colors_and_new_ones_get_others() {
    // Improvement would go on in the ball while the box loses tets.
    let scene = format!("[cutting]\nimprove = false\n{STROKES}");
    let mut shown = Shown::new(&scene, 0);
    let mut colors = Vec::new();
    let mut before = Vec::new();
    for frame in 0..9 {
        shown.advance(1);
        shown
            .render_scene
            .color(&mut shown.simulation, ColorBy::Piece, None)
            .unwrap();
        let ball = triangles_of_ball(&shown);
        if frame == 7 {
            // Only the box loses tets; those of the ball move into their slots.
            assert_eq!(ball, before);
        }
        before = ball;
        let labels = shown.simulation.mesh().pieces();
        // Each piece has one color, and each color one piece.
        let mut of_piece = vec![None; labels.count];
        for (tet, _, _, color) in triangles(&shown.render_scene) {
            let color = color.unwrap();
            let piece = labels.labels[tet.index()] as usize;
            assert_eq!(*of_piece[piece].get_or_insert(color), color);
        }
        let mut now: Vec<[u8; 3]> = of_piece.into_iter().flatten().collect();
        now.sort_unstable();
        assert!(now.windows(2).all(|pair| pair[0] != pair[1]));
        colors.push(now);
    }
    // Cuts add pieces; earlier ones are still visible. The last stroke takes some away.
    for pair in colors[..7].windows(2) {
        assert!(pair[0].iter().all(|color| pair[1].contains(color)));
    }
    assert!(colors[6].len() > 3, "{} pieces", colors[6].len());
}

/// The triangles of the second body, by their particles, which no cut renumbers, with their colors.
fn triangles_of_ball(shown: &Shown) -> Vec<([ParticleId; 3], Option<[u8; 3]>)> {
    let rest = &shown.simulation.mesh().positions;
    let mut all: Vec<_> = triangles(&shown.render_scene)
        .into_iter()
        .filter(|(_, corners, ..)| rest[corners[0].index()].x > 0.6)
        .map(|(_, corners, _, color)| (corners, color))
        .collect();
    all.sort_unstable();
    all
}

/// Of the larger body, less than the smaller one is left, whose tets are then where the larger one's were.
#[test]
fn a_piece_keeps_its_color_when_another_is_carved() {
    let mut shown = Shown::new(
        r#"
        [solver]
        substeps = 2
        [[body]]
        shape = { kind = "box", tets = 1000 }
        [[body]]
        shape = { kind = "sphere", tets = 200 }
        position = [1.2, 0.0, 0.0]
        [[stroke]]
        kind = "remove"
        frame = 1
        region = { box = { low = [-1.0, -1.0, -1.0], high = [0.35, 1.0, 1.0] } }
        "#,
        1,
    );
    let mut color = || {
        let simulation = &mut shown.simulation;
        let render_scene = &mut shown.render_scene;
        render_scene
            .color(simulation, ColorBy::Piece, None)
            .unwrap();
        let ball = triangles_of_ball(&shown);
        shown.advance(1);
        ball
    };
    let before = color();
    assert!(!before.is_empty());
    assert_eq!(before, color());
    assert_eq!(shown.simulation.report().pieces, 2);
}

#[test]
fn new_surfaces_have_no_color_until_recolored() {
    let mut shown = Shown::new(STROKES, 0);
    shown
        .render_scene
        .color(&mut shown.simulation, ColorBy::Color, None)
        .unwrap();
    assert!(triangles(&shown.render_scene).iter().all(|t| t.3.is_some()));
    shown.advance(2);
    let bare: Vec<_> = triangles(&shown.render_scene)
        .into_iter()
        .filter(|t| t.3.is_none())
        .collect();
    assert!(!bare.is_empty(), "what a cut made has no color yet");
    shown
        .render_scene
        .color(&mut shown.simulation, ColorBy::Color, None)
        .unwrap();
    assert!(triangles(&shown.render_scene).iter().all(|t| t.3.is_some()));
}

#[test]
fn residuals_are_one_a_tet() {
    let mut shown = Shown::new(STROKES, 1);
    let Shown {
        render_scene,
        simulation,
        ..
    } = &mut shown;
    let tets = simulation.mesh().tets.len();
    let missing = render_scene.color(simulation, ColorBy::Residual, None);
    assert!(matches!(missing, Err(RenderError::NoResiduals)));
    let few = render_scene.color(simulation, ColorBy::Residual, Some(&[1.0]));
    assert!(matches!(few, Err(RenderError::Residuals { given: 1, .. })));
    // Powers of ten, from 1e-9 on: the legend spans the upper six.
    let values: Vec<f64> = (0..tets)
        .map(|t| 10_f64.powi(i32::try_from(t % 9).unwrap() - 9))
        .collect();
    let legend = render_scene
        .color(simulation, ColorBy::Residual, Some(&values))
        .unwrap()
        .unwrap();
    assert!(legend.logarithmic && (legend.high / 0.1 - 1.0).abs() < 1e-9);
    assert!((legend.fraction(1e-4) - 0.5).abs() < 1e-9);
    assert_eq!(legend.fraction(1e-9), 0.0);
    for (tet, _, _, color) in triangles(render_scene) {
        let expected = legend.color(legend.fraction(values[tet.index()]));
        assert_eq!(color, Some(expected));
    }
    assert_eq!(legend.color(f64::NAN), legend.color(0.0));
    assert_eq!(legend.color(7.0), legend.color(1.0));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn stretch_is_the_largest_principal_one(
        corners in prop::array::uniform4(prop::array::uniform3(-1.0..1.0)),
        stretches in prop::array::uniform3(0.2..3.0),
        turns in prop::array::uniform2((prop::array::uniform3(-1.0..1.0), -3.0..3.0)),
        shift in prop::array::uniform3(-5.0..5.0),
    ) {
        let rest: [DVec3; 4] = corners.map(DVec3::from_array);
        let volume = (rest[1] - rest[0]).cross(rest[2] - rest[0]).dot(rest[3] - rest[0]);
        prop_assume!(volume.abs() > 1e-3);
        let [one, two] = turns.map(|(axis, angle)| {
            let axis = DVec3::from_array(axis).normalize_or(DVec3::X);
            DMat3::from_quat(DQuat::from_axis_angle(axis, angle))
        });
        let deformation = one * DMat3::from_diagonal(DVec3::from_array(stretches)) * two;
        let now = rest.map(|x| deformation * x + DVec3::from_array(shift));
        let expected = stretches.iter().copied().fold(0.0, f64::max);
        // The inverse of a tet of volume 1e-3 loses up to four digits, the root of a difference of eigenvalues half of
        // the rest.
        let found = stretch(rest, now);
        prop_assert!((found - expected).abs() < 1e-5 * expected, "{found} {expected}");
    }
}

#[test]
fn flat_tets_have_no_stretch() {
    let flat = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::X + DVec3::Y];
    assert_eq!(stretch(flat, flat.map(|x| x * 2.0)), 1.0);
    let point = [DVec3::ZERO; 4];
    let tet = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    assert_eq!(stretch(tet, point), 0.0);
}

#[test]
fn a_body_at_rest_is_not_stretched() {
    let mut shown = Shown::new(TWO_BODIES, 0);
    let legend = shown
        .render_scene
        .color(&mut shown.simulation, ColorBy::Stretch, None)
        .unwrap();
    let lowest = legend.unwrap().color(0.0);
    // Positions in the solver are single precision: one in ten million.
    let near = |color: [u8; 3]| (0..3).all(|i| color[i].abs_diff(lowest[i]) <= 1);
    assert!(
        triangles(&shown.render_scene)
            .iter()
            .all(|t| near(t.3.unwrap()))
    );
}

#[test]
fn normals_of_a_ball_point_away_from_its_middle() {
    let shown = Shown::new(
        "[[body]]\nshape = { kind = \"sphere\", tets = 2000 }\nscale = 1e-3\nposition = [5.0, 0.0, 0.0]",
        0,
    );
    let skin = shown.render_scene.skin();
    let middle = DVec3::new(5.0, 0.0, 0.0);
    let place = |v: usize| {
        (shown.simulation.positions()[skin.vertices()[v].particle.index()] - middle).as_vec3()
    };
    let places: Vec<_> = (0..skin.vertices().len()).map(place).collect();
    let sums = normal_sums(skin.triangles(), &places);
    for (sum, place) in sums.iter().zip(&places) {
        let normal = glam::Vec3::from_array(sum.map(|part| part as f32)).normalize();
        // Angles between neighbors are about 0.2; the weights make up for most of it.
        assert!(normal.dot(place.normalize()) > 0.99, "{normal} {place}");
    }
    let cut = Shown::new(LIVER, 2);
    let bounds = cut.render_scene.bounds(&cut.simulation);
    assert!(bounds[0].cmplt(bounds[1]).all());
}
