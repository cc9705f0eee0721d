//! Contacts in lanes beside contacts one after the other: the same bits.

use glam::DVec3;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;

use super::*;
use crate::simd_kernel::tests::levels;

/// A contact with particles of its own.
#[derive(Clone, Debug)]
struct Case {
    kind: u32,
    x: [DVec3; 4],
    previous: [DVec3; 4],
    weights: [f64; 4],
    beyond: DVec3,
    limit: Option<(DVec3, f64)>,
    thickness: f64,
    /// Friction, the normal impulse and its plane.
    multiplier: Option<(DVec3, f64)>,
}

/// A vector of components of any size up to 1, of which small ones are as likely.
fn vector() -> impl Strategy<Value = DVec3> {
    let component = (-1.0..1.0, 0..8).prop_map(|(x, digits): (f64, i32)| x * 10f64.powi(-digits));
    [component.clone(), component.clone(), component].prop_map(DVec3::from_array)
}

/// A length of any size and sign.
fn small() -> impl Strategy<Value = f64> {
    (-1.0..1.0, 0..18_i32).prop_map(|(x, digits): (f64, i32)| x * 10f64.powi(-digits))
}

/// Contacts of any kind, near and far, of slivers and of triangles without an area.
fn case() -> impl Strategy<Value = Case> {
    let corners = [vector(), vector(), vector(), vector()];
    let place = (
        corners,
        [-2.0..2.0, -2.0..2.0],
        small(),
        -6..6_i32,
        any::<bool>(),
    );
    let way = prop_oneof![
        3 => [small(), small(), small()].prop_map(DVec3::from_array),
        1 => Just(DVec3::ZERO),
        1 => vector(),
    ];
    let weight = prop::sample::select(vec![0.0, 1.0, 1.0, 30.0, 1e-6, 1e30]);
    let weights = prop::array::uniform4(weight);
    let limit = prop::option::of((vector(), 0.0..0.1));
    let thickness = prop::sample::select(vec![0.0, 0.0, 1e-6, 1e-2]);
    let multiplier = prop::option::of((vector(), small()));
    let of_plane = (vector(), any::<bool>(), limit, thickness);
    let ways = prop::array::uniform4(way);
    (0..3_u32, place, ways, weights, of_plane, multiplier).prop_map(
        |(kind, place, ways, weights, of_plane, multiplier)| {
            let ([a, b, c, d], foot, height, scale, is_flat) = place;
            let (mut beyond, has_beyond, limit, thickness) = of_plane;
            let scale = 10f64.powi(scale);
            let c = if is_flat && height > 0.5 { b } else { c };
            let x = match kind {
                0 => [a, a + beyond.normalize_or_zero() * height, c, d],
                1 => {
                    let normal = (b - a).cross(c - a).normalize_or_zero();
                    let to = (b - a) * foot[0] + (c - a) * foot[1] + normal * height;
                    [a + to, a, b, c]
                }
                // The second edge crosses the first one.
                _ => {
                    let [p, q] = foot.map(|part| 0.5 + 0.4 * part);
                    let normal = (b - a).cross(d - c).normalize_or_zero();
                    let off = a.lerp(b, p) - c.lerp(d, q) - normal * height;
                    if normal.dot(beyond) < 0.0 {
                        beyond = -beyond;
                    }
                    [a, b, c + off, d + off]
                }
            };
            if kind == 1 && !has_beyond {
                beyond = DVec3::ZERO;
            } else if beyond.length() < 1e-7 {
                beyond = DVec3::Z;
            }
            let previous = [0, 1, 2, 3].map(|k| (x[k] + ways[k]) * scale);
            Case {
                kind,
                x: x.map(|x| x * scale),
                previous,
                weights,
                beyond,
                limit: limit.filter(|(n, _)| n.length() > 1e-7),
                thickness: thickness * scale,
                multiplier,
            }
        },
    )
}

/// What a pass leaves: positions and inverse masses, multipliers, impulses and what held particles were refused.
type Outcome<R> = [Vec<[R; 4]>; 4];

/// The contacts with their particles.
fn scene<R: Float>(cases: &[Case], is_iterated: bool) -> (Contacts<R>, Particles<R>) {
    let mut particles = Particles::new(DVec3::ZERO, 1.0);
    let mut contacts = Contacts::<R>::default();
    let mut cases = cases.to_vec();
    // Pairs come first, as they are numbered.
    cases.sort_by_key(|case| case.kind != 0);
    for case in &cases {
        let first = number(particles.len());
        let used = if case.kind == 0 { 2 } else { 4 };
        for k in 0..used {
            let i = particles.push(R::from_dvec3(case.x[k]), R::Vector::default(), false);
            let [x, y, z, _] = R::read(&particles.cells[i]);
            R::write(&particles.cells[i], [x, y, z, R::from_f64(case.weights[k])]);
            particles.previous[i] = R::from_dvec3(case.previous[k]);
        }
        let four = [first, first + 1, first + 2, first + 3];
        let contact = match case.kind {
            0 => {
                let pair = PairContact {
                    particles: [first, first + 1],
                    normal: case.beyond,
                };
                contacts.pairs.push(Pair::new(0, &pair).expect("a pair"));
                None
            }
            1 => Some(SurfaceContact::Face(FaceContact {
                particles: four,
                beyond: (case.beyond != DVec3::ZERO).then(|| case.beyond.to_array()),
                limit: case.limit.map(|(normal, distance)| FaceLimit {
                    normal: normal.to_array(),
                    distance,
                }),
                thickness: case.thickness,
            })),
            _ => Some(SurfaceContact::Edges(EdgeContact {
                particles: four,
                normal: case.beyond,
                thickness: case.thickness,
            })),
        };
        let surface = contact.map(|contact| Surface::new(0, &contact).expect("a contact"));
        contacts.surfaces.extend(surface);
        contacts.impulses.push(R::particle([R::ONE; 4]));
        if is_iterated {
            let (way, pressure) = case.multiplier.unwrap_or_default();
            let [x, y, z] = R::components(R::from_dvec3(way));
            let cell = R::particle([x, y, z, R::from_f64(pressure)]);
            contacts.multipliers.push(cell);
        }
    }
    particles.keep_refused();
    (contacts, particles)
}

fn outcome<R: Float>(contacts: &Contacts<R>, particles: &Particles<R>) -> Outcome<R> {
    [
        &particles.cells,
        &contacts.multipliers,
        &contacts.impulses,
        &particles.refused,
    ]
    .map(|cells| cells.iter().map(R::read).collect())
}

fn one_by_one<R: Float>(
    cases: &[Case],
    is_iterated: bool,
    factors: ContactFactors<R>,
) -> Outcome<R> {
    let (contacts, particles) = scene::<R>(cases, is_iterated);
    for (i, pair) in contacts.pairs.iter().enumerate() {
        contacts.solve_one(i, pair, &particles, factors);
    }
    let first = contacts.pairs.len();
    for (i, surface) in contacts.surfaces.iter().enumerate() {
        contacts.solve_one(first + i, surface, &particles, factors);
    }
    outcome(&contacts, &particles)
}

fn in_lanes<R: Float>(
    level: Level,
    cases: &[Case],
    is_iterated: bool,
    factors: ContactFactors<R>,
) -> Outcome<R> {
    let (contacts, particles) = scene::<R>(cases, is_iterated);
    for (is_pairs, count) in [
        (true, contacts.pairs.len()),
        (false, contacts.surfaces.len()),
    ] {
        lanes::solve(level, &contacts, is_pairs, 0..count, &particles, factors);
    }
    outcome(&contacts, &particles)
}

/// Whether all bits are equal, but for those of what is no number.
fn same<R: Float>(one: &Outcome<R>, other: &Outcome<R>) -> bool {
    let bits = |values: &Outcome<R>| {
        let values = values.iter().flatten().flatten();
        let of = |value: &R| {
            let value = value.to_f64();
            if value.is_nan() {
                u64::MAX
            } else {
                value.to_bits()
            }
        };
        values.map(of).collect::<Vec<_>>()
    };
    bits(one) == bits(other)
}

fn factors<R: Float>(friction: f64, kept: f64) -> ContactFactors<R> {
    ContactFactors {
        friction: R::from_f64(friction),
        kept: R::from_f64(kept),
        margin: R::from_f64(MARGIN),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    /// Contacts of a color give the bits of contacts one after the other, in both precisions and all instruction sets.
    #[test]
    fn lanes_give_the_bits_of_contacts_one_by_one(
        cases in prop::collection::vec(case(), 1..40),
        is_iterated in any::<bool>(),
        friction in prop::sample::select(vec![0.0, 0.3, 1e3]),
        kept in prop::sample::select(vec![0.0, 0.9, 1.0]),
    ) {
        let single = one_by_one::<f32>(&cases, is_iterated, factors(friction, kept));
        let double = one_by_one::<f64>(&cases, is_iterated, factors(friction, kept));
        for level in levels() {
            let found = in_lanes::<f32>(level, &cases, is_iterated, factors(friction, kept));
            prop_assert!(same(&found, &single), "{level:?}\n{found:?}\n{single:?}");
            let found = in_lanes::<f64>(level, &cases, is_iterated, factors(friction, kept));
            prop_assert!(same(&found, &double), "{level:?}\n{found:?}\n{double:?}");
        }
    }
}

/// The cases of the test above meet what contacts can do: each kind presses and stays open, a second plane acts, a limit
/// opens what would press, and a contact has pressed along another plane before.
#[test]
fn the_cases_meet_all_branches() {
    let mut runner = TestRunner::deterministic();
    let (mut press, mut open) = ([0; 3], [0; 3]);
    let (mut second, mut past, mut elsewhere) = (0, 0, 0);
    for _ in 0..2000 {
        let case = case().new_tree(&mut runner).expect("a case").current();
        let (contacts, particles) = scene::<f64>(std::slice::from_ref(&case), true);
        let x = [0, 1, 2, 3].map(|k| particles.cells.get(k).map(load::<f64>).unwrap_or_default());
        let old = [0, 1, 2, 3].map(|k| particles.previous.get(k).copied().unwrap_or_default());
        let kind = case.kind as usize;
        let gap = match (contacts.pairs.first(), contacts.surfaces.first()) {
            (Some(pair), _) => {
                let gap = pair.gap([x[0], x[1]], [old[0], old[1]], 0.9);
                gap.map(|gap| (gap.is_open(), gap.is_past, false))
            }
            (_, Some(surface)) => {
                let gap = surface.gap(x, old, 0.9);
                gap.map(|gap| (gap.is_open(), gap.is_past, gap.plane.is_second))
            }
            _ => None,
        };
        let Some((is_open, is_past, is_second)) = gap else {
            continue;
        };
        press[kind] += u32::from(!is_open);
        open[kind] += u32::from(is_open);
        second += u32::from(is_second && !is_open);
        past += u32::from(is_past && kind == 1);
        let before = case.multiplier.map_or(0.0, |(_, pressure)| pressure);
        let has_moved = before != 0.0 && is_second != (before < 0.0);
        elsewhere += u32::from(has_moved && kind == 1);
    }
    let all = [press, open, [second, past, elsewhere]];
    assert!(all.iter().flatten().all(|count| *count > 10), "{all:?}");
}
