//! The slow search: each vertex against each triangle, without a tree, fans or walks.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use glam::{DMat3, DVec3};
use incise_contact::ContactState;
use incise_cutting::{BoundaryTriangle, FaceTag};
use incise_mesh::{ParticleId, TetId, TrianglePart, closest_on_triangle, signed_volume};

use crate::scene::Scene;

/// A vertex and the corners of a triangle, the least of these first.
pub(crate) type Key = [u32; 4];

pub(crate) fn key_of([vertex, a, b, c]: [u32; 4]) -> Key {
    let turned = [[vertex, a, b, c], [vertex, b, c, a], [vertex, c, a, b]];
    turned.into_iter().min().unwrap()
}

/// What the slow search finds.
#[derive(Default)]
pub(crate) struct Expected {
    pub(crate) contacts: BTreeSet<Key>,
    /// Vertices inside a tet of another part, or nearly so, without a valid triangle near them, for which the
    /// detector may have one contact more.
    pub(crate) deep: BTreeSet<u32>,
    /// Vertices inside of a triangle with a valid way to them.
    pub(crate) inside: BTreeSet<u32>,
}

struct Slow<'a> {
    scene: &'a Scene,
    state: ContactState<'a>,
    triangles: Vec<BoundaryTriangle>,
    normals: Vec<DVec3>,
    /// By particle the places of its triangles.
    fans: Vec<Vec<usize>>,
    partners: BTreeMap<u32, BTreeSet<u32>>,
    /// Corners of inverted tets with a triangle.
    inverted: BTreeSet<u32>,
}

/// All candidates of edges at the present positions: each feature edge against each other one, and of these the four
/// nearest of both.
pub(crate) fn expected_edges(scene: &Scene) -> BTreeSet<[u32; 4]> {
    let all = slow(scene).edges();
    let is_near = |(key, by): (&[u32; 4], &f64)| {
        let ends = [&key[..2], &key[2..]];
        ends.into_iter().all(|ends| {
            let of_edge = all
                .iter()
                .filter(|(k, _)| k[..2] == *ends || k[2..] == *ends);
            let nearer = of_edge.filter(|(k, b)| b.total_cmp(by).then(k.cmp(&key)).is_lt());
            nearer.count() < 4
        })
    };
    let near = all.iter().filter(|&candidate| is_near(candidate));
    near.map(|(key, _)| *key).collect()
}

/// All candidates at the present positions.
pub(crate) fn expected(scene: &Scene) -> Expected {
    let slow = slow(scene);
    let all: Vec<BoundaryTriangle> = scene.body.boundary().collect();
    let mut vertices: BTreeMap<u32, Vec<BoundaryTriangle>> = BTreeMap::new();
    for triangle in &all {
        for p in triangle.particles {
            vertices.entry(p.0).or_default().push(*triangle);
        }
    }
    let mut expected = Expected::default();
    for (vertex, fan) in vertices {
        slow.vertex(vertex, &fan, &mut expected);
    }
    expected
}

fn slow(scene: &Scene) -> Slow<'_> {
    let state = scene.state();
    let mut partners: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
    for [a, b] in scene.contacts.fresh_pairs().iter() {
        partners.entry(a.0).or_default().insert(b.0);
        partners.entry(b.0).or_default().insert(a.0);
    }
    let mut slow = Slow {
        scene,
        state,
        triangles: Vec::new(),
        normals: Vec::new(),
        fans: vec![Vec::new(); scene.positions.len()],
        partners,
        inverted: BTreeSet::new(),
    };
    let least = -1e-3 * scene.contacts.mean_edge().powi(3);
    for triangle in scene.body.boundary() {
        if 6.0 * signed_volume(slow.tet(triangle.tet)) < least {
            let corners = scene.body.mesh().tets[triangle.tet.index()];
            slow.inverted.extend(corners.map(|p| p.0));
        }
    }
    slow.triangles = scene.body.boundary().filter(|t| slow.is_sound(t)).collect();
    slow.triangles.sort_by_key(|t| (t.tet, t.opposite));
    slow.normals = slow
        .triangles
        .iter()
        .map(|t| slow.area(t).normalize())
        .collect();
    for (i, triangle) in slow.triangles.iter().enumerate() {
        for p in triangle.particles {
            slow.fans[p.index()].push(i);
        }
    }
    slow
}

impl Slow<'_> {
    fn at(&self, p: ParticleId) -> DVec3 {
        self.state.positions[p.index()]
    }

    fn corners(&self, triangle: &BoundaryTriangle) -> [DVec3; 3] {
        triangle.particles.map(|p| self.at(p))
    }

    fn area(&self, triangle: &BoundaryTriangle) -> DVec3 {
        let [a, b, c] = self.corners(triangle);
        (b - a).cross(c - a)
    }

    fn tet(&self, tet: TetId) -> [DVec3; 4] {
        self.scene.body.mesh().tets[tet.index()].map(|p| self.at(p))
    }

    fn is_sound(&self, triangle: &BoundaryTriangle) -> bool {
        let rest = triangle
            .particles
            .map(|p| self.scene.body.mesh().positions[p.index()]);
        let [a, b, c] = rest;
        let at_rest = (b - a).cross(c - a).length();
        self.area(triangle).length() > 1e-3 * at_rest && signed_volume(self.tet(triangle.tet)) > 0.0
    }

    /// Whether both are of one part that does not touch itself there, because of an inverted tet at one of these particles.
    fn is_held_off(&self, own: TetId, tet: TetId, particles: &[u32]) -> bool {
        let pieces = &self.scene.pieces;
        let is_inverted = particles.iter().any(|p| self.inverted.contains(p));
        is_inverted && pieces.piece_of(own) == pieces.piece_of(tet)
    }

    fn may_touch(&self, vertex: u32, own: TetId, tet: TetId) -> bool {
        let body = |p: ParticleId| self.scene.contacts.body_of()[p.index()];
        let other = body(self.scene.body.mesh().tets[tet.index()][0]);
        let settings = self.scene.contacts.settings();
        if body(ParticleId(vertex)) == other {
            let pieces = &self.scene.pieces;
            settings.self_contact || pieces.piece_of(own) != pieces.piece_of(tet)
        } else {
            settings.bodies.allow(body(ParticleId(vertex)), other)
        }
    }

    /// The contact with a triangle, or with the one beyond the nearest edge, if only that can be met.
    fn key(&self, vertex: u32, fan: &[BoundaryTriangle], i: usize) -> Option<Key> {
        let x = self.at(ParticleId(vertex));
        let triangle = &self.triangles[i];
        let (p, corners) = (triangle.particles, self.corners(triangle));
        // How far inside of each side the foot of the vertex is, times the length of the side.
        let inside = |k: usize| {
            let along = corners[(k + 1) % 3] - corners[k];
            self.normals[i].cross(along).dot(x - corners[k])
        };
        let sides = match closest_on_triangle(corners, x).part {
            TrianglePart::Face => vec![0, 1, 2],
            TrianglePart::Side(k) => vec![usize::from(k)],
            TrianglePart::Corner(k) => vec![usize::from(k), usize::from(k + 2) % 3],
        };
        let nearest = |k: &usize, l: &usize| inside(*k).total_cmp(&inside(*l));
        let k = sides.into_iter().min_by(nearest).unwrap();
        let [from, to] = [p[k], p[(k + 1) % 3]];
        let own = key_of([vertex, p[0].0, p[1].0, p[2].0]);
        let beyond = (0..self.triangles.len()).find(|&j| {
            let other = self.triangles[j].particles;
            j != i && other.contains(&from) && other.contains(&to)
        });
        let Some(j) = beyond else { return Some(own) };
        let other = self.triangles[j].particles;
        let far = *other.iter().find(|c| **c != from && **c != to).unwrap();
        let way = self.at(far) - self.at(from);
        let faces = |normal: DVec3| {
            let sound = fan.iter().filter(|t| self.is_sound(t));
            let dots = sound.map(|t| self.area(t).normalize().dot(normal));
            dots.fold(1.0, f64::min)
        };
        let (to_own, to_other) = (faces(self.normals[i]), faces(self.normals[j]));
        let closest = closest_on_triangle(self.corners(&self.triangles[j]), x).point;
        let is_swapped = self.normals[i].dot(way) < -1e-3 * way.length()
            && to_own > -0.1
            && to_other < -0.3
            && far.0 != vertex
            && closest.distance(x) <= self.scene.reach(&[vertex], &p.map(|p| p.0));
        if !is_swapped {
            return Some(own);
        }
        // A pair holds the vertex at the cut face that it was parted from.
        let tag = self.triangles[j].tag;
        let partners = self.partners.get(&vertex).into_iter().flatten();
        let is_of_pair = |partner: &u32| {
            let mut all = self.scene.body.boundary();
            all.any(|t| t.tag == tag && t.particles.contains(&ParticleId(*partner)))
        };
        let is_held = partners.copied().any(|partner| is_of_pair(&partner));
        (!is_held).then(|| key_of([vertex, other[0].0, other[1].0, other[2].0]))
    }

    fn vertex(&self, vertex: u32, fan: &[BoundaryTriangle], expected: &mut Expected) {
        let x = self.at(ParticleId(vertex));
        let mut by_tag: BTreeMap<FaceTag, DVec3> = BTreeMap::new();
        for triangle in fan {
            *by_tag.entry(triangle.tag).or_default() += self.area(triangle);
        }
        let by_tag: Vec<DVec3> = by_tag.values().map(|n| n.normalize_or_zero()).collect();
        let facing = |i: usize| {
            let dots = by_tag.iter().map(|n| n.dot(self.normals[i]));
            dots.fold(f64::INFINITY, f64::min)
        };
        let own = fan.iter().min_by_key(|t| (t.tet, t.opposite)).unwrap().tet;
        // One that was inverted and has not come out since is held off, too.
        let was_inverted = self.scene.contacts.inverted().contains(&vertex);
        let is_held_off = |tet: TetId| {
            let pieces = &self.scene.pieces;
            self.is_held_off(own, tet, &[vertex])
                || was_inverted && pieces.piece_of(own) == pieces.piece_of(tet)
        };
        let eligible = |triangle: &BoundaryTriangle| {
            let corners = triangle.particles.map(|p| p.0);
            !triangle.particles.contains(&ParticleId(vertex))
                && self.may_touch(vertex, own, triangle.tet)
                && !self.is_held_off(own, triangle.tet, &corners)
                && !is_held_off(triangle.tet)
        };
        let (mut outside, mut inside) = (Vec::new(), Vec::new());
        for (i, triangle) in self.triangles.iter().enumerate() {
            if facing(i) >= 0.2 || !eligible(triangle) {
                continue;
            }
            let closest = closest_on_triangle(self.corners(triangle), x);
            let distance = closest.point.distance(x);
            let p = triangle.particles;
            if distance > self.scene.reach(&[vertex], &p.map(|p| p.0)) {
                continue;
            }
            let feature: Vec<ParticleId> = match closest.part {
                TrianglePart::Face => p.to_vec(),
                TrianglePart::Side(k) => vec![p[usize::from(k)], p[usize::from(k + 1) % 3]],
                TrianglePart::Corner(k) => vec![p[usize::from(k)]],
            };
            let shares = |i: &usize| {
                let particles = self.triangles[*i].particles;
                feature.iter().all(|p| particles.contains(p))
            };
            let around: Vec<usize> = match closest.part {
                TrianglePart::Face => vec![i],
                _ => self.fans[feature[0].index()]
                    .iter()
                    .copied()
                    .filter(shares)
                    .collect(),
            };
            let distances = around.iter().map(|&i| {
                let corners = self.corners(&self.triangles[i]);
                closest_on_triangle(corners, x).point.distance(x)
            });
            let nearest = distances.fold(f64::INFINITY, f64::min);
            if nearest < distance - 1e-9 * self.scene.contacts.mean_edge() {
                continue;
            }
            let eligible = around.iter().filter(|i| eligible(&self.triangles[**i]));
            // In one plane they face alike but for rounding.
            let rank = |i: usize| (1e6 * facing(i)).round();
            let first =
                eligible.min_by(|&&i, &&j| rank(i).partial_cmp(&rank(j)).unwrap().then(i.cmp(&j)));
            if first != Some(&i) {
                continue;
            }
            let partners = self.partners.get(&vertex);
            if partners.is_some_and(|held| p.iter().any(|p| held.contains(&p.0))) {
                continue;
            }
            let weighted = around.iter().map(|&i| {
                let particles = self.triangles[i].particles;
                let k = particles.iter().position(|q| *q == feature[0]).unwrap();
                let corners = self.corners(&self.triangles[i]);
                let [a, b, c] = [0, 1, 2].map(|i| corners[(k + i) % 3]);
                let is_corner = matches!(closest.part, TrianglePart::Corner(_));
                let angle = (b - a).angle_between(c - a);
                self.normals[i] * if is_corner { angle } else { 1.0 }
            });
            let side: DVec3 = weighted.sum();
            if side.dot(x - closest.point) >= 0.0 {
                outside.push((distance, i));
            } else if self.moved_through(vertex, triangle) >= 0.5 * distance {
                inside.push((distance, i, closest, around));
            }
        }
        let key = |i: usize| self.key(vertex, fan, i);
        outside.sort_by(|one, other| one.0.total_cmp(&other.0).then(one.1.cmp(&other.1)));
        expected
            .contacts
            .extend(outside.iter().take(3).filter_map(|o| key(o.1)));

        inside.sort_by(|one, other| one.0.total_cmp(&other.0).then(one.1.cmp(&other.1)));
        let touching = 0.01 * self.scene.contacts.mean_edge();
        let ends = |closest: DVec3, around: &[usize], to: DVec3| {
            let starts = around.iter().map(|&i| self.triangles[i].tet);
            let ends = starts.flat_map(|tet| self.reached(tet, closest, to));
            ends.collect::<Vec<TetId>>()
        };
        let is_own =
            |tet: &TetId| self.scene.body.mesh().tets[tet.index()].contains(&ParticleId(vertex));
        // The nearest with a way, if that is shallow.
        let valid = inside
            .iter()
            .take(8)
            .find(|(_, _, closest, around)| {
                let ends = ends(closest.point, around, x);
                ends.iter().any(|tet| !is_own(tet))
            })
            .filter(|(distance, i, closest, around)| {
                let normal = if closest.part == TrianglePart::Face || *distance <= touching {
                    self.normals[*i]
                } else {
                    (closest.point - x) / distance
                };
                let depth = normal.dot(closest.point - x);
                let twice = closest.point - normal * (2.0 * depth);
                !ends(closest.point, around, twice).is_empty()
            });
        if let Some((_, i, ..)) = valid {
            expected.contacts.extend(key(*i));
            expected.inside.insert(vertex);
            return;
        }
        let tets = self.scene.body.mesh().tets.iter().enumerate();
        let others = tets.filter(|(_, corners)| !corners.contains(&ParticleId(vertex)));
        let mut others = others.map(|(t, _)| TetId::new(t));
        let contains = |tet: TetId| {
            let inside = || {
                let coordinates = barycentric(self.tet(tet), x);
                coordinates.into_iter().all(|b| b > -1e-2)
            };
            self.may_touch(vertex, own, tet)
                && !is_held_off(tet)
                && signed_volume(self.tet(tet)) > 0.0
                && inside()
        };
        if others.any(contains) {
            expected.deep.insert(vertex);
        }
    }

    /// How far a vertex has moved since rest, in the frame of a triangle; infinite for one of another body.
    fn moved_through(&self, vertex: u32, triangle: &BoundaryTriangle) -> f64 {
        let body_of = self.scene.contacts.body_of();
        if body_of[vertex as usize] != body_of[triangle.particles[0].index()] {
            return f64::INFINITY;
        }
        let seen = |positions: &[DVec3]| {
            let [a, b, c] = triangle.particles.map(|p| positions[p.index()]);
            let x = (b - a).normalize();
            let z = x.cross((c - a).normalize()).normalize();
            let axes = DMat3::from_cols(x, z.cross(x), z);
            axes.transpose() * (positions[vertex as usize] - a)
        };
        seen(&self.scene.positions).distance(seen(&self.scene.body.mesh().positions))
    }

    /// All candidates of edges, each with its gap if that is negative, otherwise the distance.
    fn edges(&self) -> BTreeMap<[u32; 4], f64> {
        let positions = &self.state.positions;
        // Both triangles of each edge, first the one in which it runs upward.
        let mut around: BTreeMap<[u32; 2], [Option<BoundaryTriangle>; 2]> = BTreeMap::new();
        for triangle in self.scene.body.boundary() {
            let p = triangle.particles.map(|p| p.0);
            for k in 0..3 {
                let [from, to] = [p[k], p[(k + 1) % 3]];
                let side = usize::from(from > to);
                around.entry([from.min(to), from.max(to)]).or_default()[side] = Some(triangle);
            }
        }
        let rest = &self.scene.body.mesh().positions;
        let normal_of = |triangle: &BoundaryTriangle, at: &[DVec3]| {
            let [a, b, c] = triangle.particles.map(|p| at[p.index()]);
            (b - a).cross(c - a).normalize()
        };
        let mut features = Vec::new();
        for (ends, triangles) in around {
            let [Some(one), Some(two)] = triangles else {
                continue;
            };
            let at_rest = normal_of(&one, rest).angle_between(normal_of(&two, rest));
            let is_feature = one.tag != two.tag || at_rest.cos() < 0.766;
            let is_sound = self.is_sound(&one) && self.is_sound(&two);
            let far = |triangle: &BoundaryTriangle| {
                let mut corners = triangle.particles.into_iter();
                let far = corners.find(|p| !ends.contains(&p.0)).unwrap();
                let [a, b] = ends.map(|p| positions[p as usize]);
                (self.at(far) - a).reject_from(b - a).normalize()
            };
            if !(is_feature && is_sound) {
                continue;
            }
            let n = normal_of(&one, positions);
            if n.dot(far(&two)) < -1e-3 {
                features.push((ends, [one, two], [far(&one), far(&two)]));
            }
        }
        let mut found = BTreeMap::new();
        for (i, (ends, tets, far)) in features.iter().enumerate() {
            for (others, other_tets, other_far) in &features[i + 1..] {
                let none = BTreeSet::new();
                let held = |p: &u32| self.partners.get(p).unwrap_or(&none).clone();
                let meets =
                    |p: &u32| others.contains(p) || held(p).iter().any(|q| others.contains(q));
                if ends.iter().any(meets)
                    || !self.may_touch(ends[0], tets[0].tet, other_tets[0].tet)
                    || self.is_held_off(tets[0].tet, other_tets[0].tet, &[*ends, *others].concat())
                {
                    continue;
                }
                let [a, b] = ends.map(|p| positions[p as usize]);
                let [c, d] = others.map(|p| positions[p as usize]);
                let across = (b - a).normalize().cross((d - c).normalize());
                if across.length() <= 0.05 {
                    continue;
                }
                // Where both lines are closest, in coordinates along them.
                let lines = DMat3::from_cols(b - a, c - d, across).inverse() * (c - a);
                let clamped = |p: f64| p.clamp(0.0, 1.0);
                let to = |x: DVec3, from: DVec3, end: DVec3| {
                    let t = (x - from).dot(end - from) / (end - from).length_squared();
                    from.lerp(end, clamped(t)).distance(x)
                };
                let meet = [lines.x, lines.y].iter().all(|p| (0.0..=1.0).contains(p));
                let (p, q) = (a.lerp(b, clamped(lines.x)), c.lerp(d, clamped(lines.y)));
                let mut distance = to(a, c, d)
                    .min(to(b, c, d))
                    .min(to(c, a, b))
                    .min(to(d, a, b));
                if meet {
                    distance = distance.min(p.distance(q));
                }
                if distance > self.scene.reach(ends, others) {
                    continue;
                }
                let is_above = |n: DVec3| {
                    far.iter().all(|far| far.dot(n) >= -0.1)
                        && other_far.iter().all(|far| far.dot(n) <= 0.1)
                };
                let n = across.normalize();
                let n = match [is_above(n), is_above(-n)] {
                    [true, false] => n,
                    [false, true] => -n,
                    _ => continue,
                };
                let gap = n.dot(p - q);
                let body_of = self.scene.contacts.body_of();
                if gap < 0.0 && body_of[ends[0] as usize] == body_of[others[0] as usize] {
                    let [a, b] = ends.map(|p| rest[p as usize]);
                    let [c, d] = others.map(|p| rest[p as usize]);
                    let turned = (b - a).normalize().cross((d - c).normalize());
                    let lines = DMat3::from_cols(b - a, c - d, turned).inverse() * (c - a);
                    let (p, q) = (a.lerp(b, clamped(lines.x)), c.lerp(d, clamped(lines.y)));
                    let before = turned.normalize().dot(p - q) * across.dot(n).signum();
                    if turned.length() > 0.05 && before < 0.5 * gap {
                        continue;
                    }
                }
                // From one edge to the other through the tets behind the one, and as far again.
                let has_way =
                    |tets: &[BoundaryTriangle; 2], [from, to]: [DVec3; 2], own: &[u32; 2]| {
                        let ways = |to: DVec3| -> Vec<TetId> {
                            let starts = tets.iter().map(|triangle| triangle.tet);
                            starts.flat_map(|tet| self.reached(tet, from, to)).collect()
                        };
                        let is_other = |tet: &TetId| {
                            let corners = self.scene.body.mesh().tets[tet.index()];
                            own.iter().all(|p| !corners.contains(&ParticleId(*p)))
                        };
                        ways(to).iter().any(is_other) && !ways(from + (to - from) * 2.0).is_empty()
                    };
                let room = |part: f64, a: DVec3, b: DVec3| part.min(1.0 - part) * a.distance(b);
                let is_inside = room(lines.x, a, b).min(room(lines.y, c, d)) >= -0.1 * gap;
                let is_valid = if gap >= 0.0 {
                    true
                } else if is_inside {
                    has_way(other_tets, [q, p], ends) || has_way(tets, [p, q], others)
                } else {
                    gap > -0.01 * self.scene.contacts.mean_edge()
                };
                if is_valid {
                    let by = if gap < 0.0 { gap } else { distance };
                    found.insert([ends[0], ends[1], others[0], others[1]], by);
                }
            }
        }
        found
    }

    /// The tets that contain the end of a segment and are reached from a tet along it: each tet that the segment passes
    /// through is entered from a neighbor that it passes through at the same place.
    fn reached(&self, start: TetId, from: DVec3, to: DVec3) -> Vec<TetId> {
        let passed = |tet: TetId| -> Option<[f64; 2]> {
            if signed_volume(self.tet(tet)) <= 0.0 {
                return None;
            }
            let [first, last] = [from, to].map(|x| barycentric(self.tet(tet), x));
            let mut range = [0.0_f64, 1.0_f64];
            for (a, b) in first.into_iter().zip(last) {
                // Not outside of this face.
                let (a, b) = (a + 1e-9, b + 1e-9);
                if a < 0.0 && b < 0.0 {
                    return None;
                }
                if a < 0.0 {
                    range[0] = range[0].max(a / (a - b));
                } else if b < 0.0 {
                    range[1] = range[1].min(a / (a - b));
                }
            }
            (range[0] <= range[1]).then_some(range)
        };
        let mut seen = BTreeSet::from([start]);
        let mut due = VecDeque::from([start]);
        let mut ends = Vec::new();
        while let Some(tet) = due.pop_front() {
            let Some(range) = passed(tet) else { continue };
            if barycentric(self.tet(tet), to)
                .into_iter()
                .all(|b| b >= -1e-9)
            {
                ends.push(tet);
            }
            // Only by a face that the way leaves this tet by: tets that are folded over each other share places, too.
            let last = from + (to - from) * range[1];
            let [leaving, beyond] = [last, to].map(|x| barycentric(self.tet(tet), x));
            for (k, next) in self.scene.body.neighbors(tet).into_iter().enumerate() {
                let is_left = leaving[k] < 1e-8 && beyond[k] < -1e-9;
                let Some(next) = next.filter(|_| is_left) else {
                    continue;
                };
                let Some(other) = passed(next) else { continue };
                let meet = other[0] - 1e-6 <= range[1] && range[1] <= other[1] + 1e-6;
                if meet && seen.insert(next) {
                    due.push_back(next);
                }
            }
        }
        ends
    }
}

fn barycentric(corners: [DVec3; 4], x: DVec3) -> [f64; 4] {
    let whole = signed_volume(corners);
    [0, 1, 2, 3].map(|k| {
        let mut part = corners;
        part[k] = x;
        signed_volume(part) / whole
    })
}

/// The candidates of the detector.
pub(crate) fn found(scene: &Scene) -> BTreeSet<Key> {
    let contacts = scene.contacts.face_candidates().iter();
    let found: BTreeSet<Key> = contacts.map(|contact| key_of(contact.particles)).collect();
    let count = scene.contacts.face_candidates().len();
    assert_eq!(found.len(), count, "each once");
    found
}

/// Compares with the slow search after an update that searched; returns what that found.
pub(crate) fn compare(scene: &Scene) -> Expected {
    let (found, expected) = (found(scene), expected(scene));
    // A vertex outside, beside a concave edge, may lie below the plane of a triangle. It is not held by it if it is where it
    // is at rest.
    let rest = &scene.body.mesh().positions;
    let body = |p: u32| scene.contacts.body_of()[p as usize];
    let height = |key: &Key, positions: &[DVec3]| {
        let [x, a, b, c] = key.map(|p| positions[p as usize]);
        (b - a).cross(c - a).normalize().dot(x - a)
    };
    let is_left_out = |key: &Key| {
        let (before, now) = (height(key, rest), height(key, &scene.positions));
        body(key[0]) == body(key[1]) && now < 0.0 && (before - now).abs() < -0.5 * now
    };
    let missing = expected.contacts.difference(&found);
    let missing: Vec<&Key> = missing.filter(|key| !is_left_out(key)).collect();
    assert!(
        missing.is_empty(),
        "not found: {}",
        described(scene, &missing)
    );
    let mut more: BTreeSet<u32> = BTreeSet::new();
    for key in found.difference(&expected.contacts) {
        let vertex = key[0];
        let is_deep = expected.deep.contains(&vertex);
        assert!(is_deep, "no contact: {}", described(scene, &[key]));
        assert!(more.insert(vertex), "{vertex} has several ways out");
    }
    expected
}

/// Where the vertices are to their triangles, for messages.
fn described(scene: &Scene, keys: &[&Key]) -> String {
    let describe = |key: &&Key| {
        let [x, a, b, c] = key.map(|p| scene.positions[p as usize]);
        let closest = closest_on_triangle([a, b, c], x);
        let height = (b - a).cross(c - a).normalize().dot(x - closest.point);
        let distance = closest.point.distance(x);
        format!("{key:?} {:?} at {distance}, height {height}", closest.part)
    };
    keys.iter().map(describe).collect::<Vec<_>>().join("; ")
}
