//! Contact of curved, thin, sliced and pinned shapes: the law of Hertz, a folded plate, slices in a bowl, golden bits.

use incise::mesh::glam::{DVec3, dvec3};
use incise::mesh::{TetId, TetMesh, kuhn_box};
use incise::scene::{
    AttachmentSpec, ColliderSpec, ContactSpec, CuttingSpec, PathRotationSpec, Precision, Region,
};
use incise::{Body, Simulation};

use crate::contact::{GRAVITY, busy, cube, cut, intruders, mean_force, solver};
use crate::support::{hash, state};

fn with_friction(friction: f64) -> ContactSpec {
    ContactSpec::default().with(|spec| spec.friction = friction)
}

/// Steps, with or without the warning that thin tets are not as accurate as wanted.
fn steps(simulation: &mut Simulation, count: u32) {
    for _ in 0..count {
        assert_eq!(simulation.step().unwrap().repaired, 0);
    }
}

/// A block of height 1 m and width 2.8 m over z = 0, its bottom a paraboloid of this radius, with cells that get finer
/// towards the lowest point.
fn lens(radius: f64) -> TetMesh {
    let graded = |cell: usize| {
        let of = |cells: usize| 1.35_f64.powi(i32::try_from(cells).unwrap()) - 1.0;
        of(cell) / of(8)
    };
    let mut mesh = kuhn_box([16, 16, 8], dvec3(16.0, 16.0, 8.0));
    for x in &mut mesh.positions {
        let cell = |c: f64| (0..=16_usize).find(|i| *i as f64 >= c - 0.5).unwrap();
        let side = |c: f64| {
            let cell = cell(c);
            let from = graded(cell.abs_diff(8));
            1.4 * if cell < 8 { -from } else { from }
        };
        let (at, up) = (dvec3(side(x.x), side(x.y), 0.0), graded(cell(x.z)));
        let bottom = at.length_squared() / (2.0 * radius);
        *x = at.with_z(bottom + (1.0 - bottom) * up);
    }
    mesh
}

/// The law of Hertz for a paraboloid on a plane, `F = 4/3 E* √R d^(3/2)` with `E* = E / (1 - ν²)`, for a layer that is held
/// at a height H: E. Dimitriadis et al. 2002, equation 12, a series in `χ = √(R d) / H`.
fn hertz(young: f64, poisson: f64, radius: f64, depth: f64) -> f64 {
    let half_space =
        4.0 / 3.0 * young / (1.0 - poisson * poisson) * radius.sqrt() * depth.powf(1.5);
    let chi = (radius * depth).sqrt();
    let pi = std::f64::consts::PI;
    let a = -(1.2876 - 1.4678 * poisson + 1.3442 * poisson.powi(2)) / (1.0 - poisson);
    let b = (0.6387 - 1.0277 * poisson + 1.5164 * poisson.powi(2)) / (1.0 - poisson);
    let series = 1.0 - 2.0 * a / pi * chi + 4.0 * a * a / pi.powi(2) * chi.powi(2)
        - 8.0 / pi.powi(3) * (a.powi(3) + 4.0 * pi.powi(2) / 15.0 * b) * chi.powi(3)
        + 16.0 * a / pi.powi(4) * (a.powi(3) + 3.0 * pi.powi(2) / 5.0 * b) * chi.powi(4);
    half_space * series
}

/// A curved block is pressed on a plate of two triangles to three depths, at which the contact has a radius of two to four
/// cells. The force is that of Hertz to 12%: the block ends at its sides, where the layer of the closed form goes on, and
/// the rim of the contact is known to a cell. Both change little with depth, so the slope in a log-log plot is 3/2 to 0.05.
#[test]
fn a_curved_body_follows_the_law_of_hertz() {
    let (young, poisson, radius) = (1e4, 0.3, 4.0);
    let mut builder = Simulation::builder();
    builder.solver(solver(Precision::F64, 8));
    let plate = kuhn_box([1, 1, 1], dvec3(4.0, 4.0, 1.0));
    builder.add_body(
        Body::new(plate)
            .position(dvec3(-2.0, -2.0, -1.0))
            .pinned(|_| true),
    );
    let block = Body::new(lens(radius))
        .young_modulus(young)
        .poisson_ratio(poisson);
    builder.add_body(block.damping(0.05));
    builder.contact(with_friction(0.0));
    let depths = [0.002, 0.004, 0.008];
    let top = Region::half_space([0.0, 0.0, 0.999], [0.0, 0.0, 1.0]);
    builder.add_attachment(AttachmentSpec::new(1, vec![top]).with(|spec| {
        // Half of the time goes down, the other half waits.
        spec.frames = [0, 240];
        let stops = depths.iter().flat_map(|d| [[0.0, 0.0, -d]; 2]);
        spec.path = std::iter::once([0.0; 3]).chain(stops).collect();
    }));
    let mut simulation = builder.build().unwrap();
    let mut forces = Vec::new();
    for depth in depths {
        steps(&mut simulation, 72);
        let force = mean_force(&mut simulation, [0, 1], 8).z;
        let expected = hertz(young, poisson, radius, depth);
        forces.push(force / expected);
    }
    for (depth, ratio) in depths.iter().zip(&forces) {
        assert!(
            (ratio - 1.0).abs() < 0.12,
            "{ratio} of the force at {depth} m"
        );
    }
    let slope = 1.5 + (forces[2] / forces[0]).ln() / (depths[2] / depths[0]).ln();
    assert!((slope - 1.5).abs() < 0.05, "{slope}");
}

/// How many vertices of one side of a body at rest are inside of tets of the other side, deeper than `depth` m.
fn folded_through(simulation: &Simulation, side: impl Fn(DVec3) -> i32, depth: f64) -> usize {
    let (mesh, x) = (simulation.mesh(), simulation.positions());
    let of = |p: usize| side(mesh.positions[p]);
    let is_inside = |p: usize, t: usize| {
        let corners = mesh.tets[t];
        if corners.iter().any(|q| of(q.index()) * of(p) >= 0) {
            return false;
        }
        let at = corners.map(|q| x[q.index()]);
        (0..4).all(|k| {
            let [a, b, c] = [1, 2, 3].map(|i| at[(k + i) % 4]);
            let normal = (b - a).cross(c - a).normalize();
            let inward = normal * normal.dot(at[k] - a).signum();
            inward.dot(x[p] - a) > depth
        })
    };
    let all = 0..x.len();
    all.filter(|&p| (0..mesh.tets.len()).any(|t| is_inside(p, t)))
        .count()
}

/// A plate of one layer of tets, and one of two, is folded onto itself, and its ends are pressed together by a tenth of
/// their thickness: their inner sides touch, and nothing is held by the far side of a wall.
#[test]
fn a_plate_is_folded_onto_itself() {
    for layers in [1, 2] {
        let thick = 0.02;
        let mut builder = Simulation::builder();
        builder.solver(solver(Precision::F64, 20));
        let plate = Body::new(kuhn_box([20, 3, layers], dvec3(0.6, 0.09, thick)));
        let plate = plate.pinned(|x| x.x < 0.16 && x.z < 1e-9);
        builder.add_body(plate.young_modulus(2e5).poisson_ratio(0.3).damping(0.02));
        builder.contact(with_friction(0.3));
        // The outer side of the other end comes down on the pinned one.
        let outer = Region::axis_box([0.44, -1.0, -1e-3], [0.7, 1.0, 1e-3]);
        builder.add_attachment(AttachmentSpec::new(0, vec![outer]).with(|spec| {
            spec.frames = [0, 60];
            spec.path = vec![[0.0; 3], [0.0; 3], [0.0; 3], [0.0, 0.0, -0.008]];
            spec.rotation = Some(PathRotationSpec::default().with(|turn| {
                turn.axis = [0.0, -1.0, 0.0];
                turn.angle_degrees = 180.0;
                turn.center = [0.3, 0.0, thick + 2e-3];
            }));
        }));
        let mut simulation = builder.build().unwrap();
        let halves = |x: DVec3| {
            if x.x < 0.25 {
                -1
            } else {
                i32::from(x.x > 0.35)
            }
        };
        for frame in 0..120 {
            steps(&mut simulation, 1);
            // 2% of an edge.
            assert_eq!(
                folded_through(&simulation, halves, 6e-4),
                0,
                "{layers} layers, frame {frame}"
            );
            assert_eq!(simulation.report().contact.unwrap().buried, 0);
        }
        let contact = simulation.report().contact.unwrap();
        assert!(contact.active >= 20, "{layers} layers: {contact:?}");
        // No wall has collapsed to what a contact through it would make of it.
        let (mesh, x) = (simulation.mesh(), simulation.positions());
        for t in 0..mesh.tets.len() {
            let [a, b, c, d] = mesh.tets[t].map(|p| x[p.index()]);
            let volume = (b - a).dot((c - a).cross(d - a)) / 6.0;
            let rest = mesh.volume(TetId::new(t));
            assert!(volume > 0.3 * rest, "{layers} layers: {volume} of {rest}");
        }
        simulation.check().unwrap();
    }
}

/// A bar is cut into a hundred slices that fall into a flat bowl: no piece passes through it, none ends inside of another, and
/// contacts end less deep than a tenth of the mean edge. While they tumble, corners are deeper for some frames.
#[test]
fn a_hundred_slices_fall_into_a_bowl() {
    let mut builder = Simulation::builder();
    builder.gravity(GRAVITY).solver(solver(Precision::F32, 20));
    // A pyramid that stands on its tip.
    let sides = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];
    let sides = sides.map(|[x, y]| dvec3(x, y, 5.0).normalize());
    for normal in sides {
        let side = ColliderSpec::plane([0.0; 3], normal.to_array());
        builder.add_collider(side.with_friction(0.3));
    }
    let size = dvec3(1.0, 0.03, 0.03);
    let bar = Body::new(kuhn_box([100, 1, 1], size)).position(dvec3(-0.5, -0.015, 0.11));
    builder.add_body(bar.young_modulus(5e4).damping(0.01));
    builder.contact(with_friction(0.3));
    for slice in 1..100_u32 {
        // Through the middles of the cells.
        let at = DVec3::X * ((f64::from(slice) - 0.5) / 100.0 - 0.5);
        builder.add_stroke(cut(1, at, DVec3::X));
    }
    let mut simulation = builder.build().unwrap();
    let mut deepest = Vec::new();
    for frame in 0..80 {
        let report = simulation.step().unwrap();
        assert_eq!(report.repaired, 0, "frame {frame}");
        deepest.push(report.contact.unwrap().max_depth);
    }
    let contact = simulation.report().contact.unwrap();
    assert!(
        contact.max_depth < 0.1 && contact.buried == 0,
        "{contact:?} after {deepest:.2?}"
    );
    assert_eq!(simulation.report().pieces, 100, "{:?}", simulation.pieces());
    for x in simulation.positions() {
        let lowest = sides
            .map(|side| side.dot(*x))
            .into_iter()
            .fold(f64::INFINITY, f64::min);
        assert!(lowest > -1e-6, "{x} is {lowest} m below the bowl");
    }
    // A tenth of the thickness of a slice.
    assert_eq!(intruders(&simulation, 5e-4), 0);
    simulation.check().unwrap();
}

/// A block is cut across earlier cuts while it stands on the ground, its mesh is improved, and it falls apart: no vertex of a
/// piece ends inside of another one, and contacts are less deep than without improvement, which leaves thinner tets.
#[test]
fn improved_pieces_stay_out_of_each_other() {
    let run = |improve: bool, precision: Precision| {
        let mut builder = Simulation::builder();
        builder
            .gravity(GRAVITY)
            .ground(0.0, 0.3)
            .solver(solver(precision, 20))
            .contact(with_friction(0.2))
            .cutting(CuttingSpec::default().with(|spec| spec.improve = improve));
        builder.add_body(cube(DVec3::ZERO).young_modulus(3e4).damping(0.01));
        let center = DVec3::splat(0.12);
        let normals = [
            dvec3(1.0, 0.1, 0.7),
            dvec3(-0.2, 1.0, 0.6),
            dvec3(1.0, -0.1, -0.6),
            dvec3(0.1, 1.0, -0.8),
        ];
        for (frame, normal) in (2..).step_by(5).zip(normals) {
            builder.add_stroke(cut(frame, center + 0.03 * normal, normal));
        }
        let mut simulation = builder.build().unwrap();
        let (mut collapsed, mut deepest) = (0, 0.0_f64);
        for _ in 0..250 {
            let report = simulation.step().unwrap();
            assert_eq!(report.repaired, 0);
            collapsed += report.cut.as_ref().map_or(0, |cut| cut.collapsed);
            deepest = deepest.max(report.contact.unwrap().max_depth);
        }
        simulation.check().unwrap();
        let contact = simulation.report().contact.unwrap();
        assert!(contact.active > 10 && contact.buried == 0, "{contact:?}");
        if improve {
            // A twentieth of an edge of the cells.
            assert_eq!(intruders(&simulation, 3e-3), 0, "{precision:?}");
        }
        (collapsed, simulation.report().pieces, deepest)
    };
    for precision in [Precision::F32, Precision::F64] {
        let (none, pieces, plain) = run(false, precision);
        let (collapsed, same, improved) = run(true, precision);
        assert!(none == 0 && collapsed > 100, "{collapsed}");
        assert_eq!(pieces, same);
        assert!(improved < plain, "{improved} of an edge, {plain}");
    }
}

/// Pinned bodies beside each other have no contacts between them, and a free one rests on both.
#[test]
fn pinned_bodies_have_no_contacts_of_their_own() {
    let build = |with_free: bool| {
        let mut builder = Simulation::builder();
        builder.gravity(GRAVITY).solver(solver(Precision::F32, 20));
        builder.add_body(cube(DVec3::ZERO).pinned(|_| true));
        builder.add_body(cube(dvec3(0.251, 0.0, 0.0)).pinned(|_| true));
        if with_free {
            builder.add_body(cube(dvec3(0.11, 0.01, 0.251)).damping(0.05));
        }
        builder.contact(with_friction(0.5));
        builder.build().unwrap()
    };
    let mut alone = build(false);
    let before = alone.positions().to_vec();
    steps(&mut alone, 5);
    assert_eq!(alone.report().contact.unwrap().candidates, 0);
    assert_eq!(alone.positions(), before);
    let mut simulation = build(true);
    steps(&mut simulation, 60);
    assert_eq!(simulation.positions()[..before.len()], before);
    let pieces: Vec<[u32; 2]> = simulation
        .contacts()
        .iter()
        .map(|contact| contact.pieces)
        .collect();
    assert_eq!(pieces, [[0, 2], [1, 2]]);
    let contact = simulation.report().contact.unwrap();
    assert!(
        contact.active >= 10 && contact.max_depth < 1e-3,
        "{contact:?}"
    );
}

/// Another hash means another result for every user: change it only together with a line in the changelog.
#[test]
fn results_with_contact_are_those_of_the_last_version() {
    for (precision, improve, golden) in [
        (Precision::F32, false, 0x0140_99b8_5baf_bf27),
        (Precision::F64, false, 0x10bd_d113_106a_fc9d),
        (Precision::F32, true, 0x79bd_6efd_ec6c_e0e4),
        (Precision::F64, true, 0xfef7_12af_a4ca_f779),
    ] {
        for threads in [1, 3] {
            let mut builder = busy(precision, threads);
            builder.cutting(CuttingSpec::default().with(|spec| spec.improve = improve));
            let mut simulation = builder.build().unwrap();
            steps(&mut simulation, 25);
            assert!(simulation.report().contact.unwrap().active > 10);
            let hash = hash(state(&simulation));
            assert!(hash == golden, "{precision:?}, {improve}: {hash:#018x}");
        }
    }
}
