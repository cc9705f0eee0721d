//! [`join_ends`]: strokes that end at each other at an angle are joined.
//!
//! A face opens where all three particles lie on one stroke. Where two strokes end at each other at an angle, as at the
//! corner of a square, no face has three of one, and a tet or two tie the parts on both sides.
//!
//! Near a meeting of two strokes their tangent planes make four quarters. Where a stroke is on both sides of the other
//! one, it divides them on both, else only on the side where it is. So two strokes that end at each other divide the
//! quarter between them from the rest, one that ends at the side of the other divides one side of it, and strokes that
//! cross divide all. A tet belongs to the quarter of its centroid. Faces between tets of divided quarters open, if they
//! are near both planes: no tet is split, and the cut runs along faces there.
//!
//! A tet with more area in open faces than in others then goes to the other side, so that the cut becomes smoother and
//! slivers do not hang by their small faces. Parts smaller than four mean tets do not come off. Stars separate as after any
//! cut, so an end that is near nothing stays as it is.
//!
//! Source: our own. Cost: a look at the stars of the particles that came to lie on strokes since the last call, and at the
//! particles around each face near a meeting.

use std::collections::{BTreeSet, HashMap, HashSet};

use foldhash::fast::FixedState;
use glam::DVec3;
use incise_mesh::{ParticleId, TetId, TetMesh};

use crate::blade::ALIGNED;
use crate::faces::{Behind, Face, sorted};
use crate::index::index;
use crate::operation::Operation;
use crate::surface::Tangent;
use crate::{CutDelta, CutOptions, CuttableMesh, StrokeRegistry};

/// Mean edges from both planes within which faces open. A stroke that goes on past the other by more crosses it.
const NEAR: f64 = 0.9;

/// Mean edges within which both strokes have a particle beside the plane of the other where they meet.
const CLOSE: f64 = 0.75;

/// Mean edges within which particles count alike for the plane of a stroke.
const CORE: f64 = 0.1;

/// Differences of distances that may come from rounding, in [`NEAR`].
const ROUNDING: f64 = 1e-6;

/// Parts of a smaller volume do not come off, in mean volumes.
const SMALLEST: f64 = 4.0;

/// Joins strokes at an angle that end within about half a mean edge of each other: opens the faces that tie the parts
/// on both sides. Looks at what the strokes of `registry` have cut since the last call, and applies the delta to it.
///
/// Call it between strokes. A [`crate::Sweep`] that is under way relies on the tets around its blade; if there is one,
/// pass it the delta with [`crate::Sweep::apply_delta`]. The opened faces get the tag `tag`.
///
/// # Determinism
/// Equal input gives the same bits on every machine and for any number of threads.
///
/// # Cost
/// In proportion to what was cut, and 8 bytes for each particle; nothing while there is one stroke.
///
/// # Example
/// ```
/// use glam::DVec3;
/// use incise_cutting::{
///     CutOptions, CuttableMesh, StrokeRegistry, TriangleSurface, cut_surface_joining, join_ends,
/// };
/// use incise_mesh::kuhn_box;
///
/// let mut body = CuttableMesh::new(kuhn_box([12, 12, 3], DVec3::new(1.0, 1.0, 0.25)))?;
/// let mut registry = StrokeRegistry::default();
/// let options = CutOptions::default();
/// // The four sides of a square, each from corner to corner.
/// for (center, along) in [
///     (DVec3::new(0.52, 0.27, 0.1), DVec3::X),
///     (DVec3::new(0.77, 0.52, 0.1), DVec3::Y),
///     (DVec3::new(0.52, 0.77, 0.1), DVec3::X),
///     (DVec3::new(0.27, 0.52, 0.1), DVec3::Y),
/// ] {
///     let side = TriangleSurface::rectangle(center, along * 0.25, DVec3::Z * 0.5)?;
///     let positions = body.mesh().positions.clone();
///     cut_surface_joining(&mut body, &positions, &side, &options, &mut registry)?;
/// }
/// assert_eq!(body.mesh().pieces().count, 1);
/// join_ends(&mut body, &mut registry, 4);
/// assert_eq!(body.mesh().pieces().count, 2);
/// # Ok::<(), incise_cutting::CutError>(())
/// ```
pub fn join_ends(cuttable: &mut CuttableMesh, registry: &mut StrokeRegistry, tag: u32) -> CutDelta {
    let _span = tracing::debug_span!("cutting::join_ends").entered();
    let fresh = registry.take_fresh();
    let mut open = if registry.has_one_stroke() {
        BTreeSet::new()
    } else {
        faces_to_open(cuttable, registry, &fresh)
    };
    smooth(cuttable, &mut open);
    keep_small_parts(cuttable, &mut open);
    // What is smaller stays already.
    let options = CutOptions {
        crumbs: 0.0,
        tag,
        ..CutOptions::default()
    };
    let mut seeds: Vec<ParticleId> = open.iter().flatten().copied().collect();
    seeds.sort_unstable();
    seeds.dedup();
    let mut operation = Operation::begin(cuttable, &options);
    operation.separate(
        &seeds,
        |_| true,
        |face| face.particles().is_some_and(|face| open.contains(&face)),
    );
    let delta = operation.finish(|_, _| true);
    registry.apply_delta(cuttable, &delta, &options);
    delta
}

/// The faces that tie strokes which end at each other, particles ascending.
fn faces_to_open(
    cuttable: &CuttableMesh,
    registry: &StrokeRegistry,
    fresh: &[ParticleId],
) -> BTreeSet<[ParticleId; 3]> {
    let mut surroundings = Surroundings::new(cuttable, registry);
    let mut open = BTreeSet::new();
    let tets = surroundings.tets_at_meetings(fresh);
    for &tet in &tets {
        for face in Face::of(tet) {
            let Behind::Twin(twin) = cuttable.faces.behind(face) else {
                continue;
            };
            // From the other side it is looked at, too.
            if twin.tet() < tet && tets.binary_search(&twin.tet()).is_ok() {
                continue;
            }
            let particles = sorted(face.particles(&cuttable.mesh));
            if surroundings.divide([tet, twin.tet()], particles) {
                open.insert(particles);
            }
        }
    }
    open
}

/// Takes faces out of `open` until no part smaller than [`SMALLEST`] comes off: such a part stays with what it shares the
/// largest area with, and its other faces open.
fn keep_small_parts(cuttable: &CuttableMesh, open: &mut BTreeSet<[ParticleId; 3]>) {
    let mesh = &cuttable.mesh;
    let corners: Vec<ParticleId> = open.iter().flatten().copied().collect();
    let mut due = cuttable.tets_around(&corners);
    due.retain(|tet| {
        Face::of(*tet)
            .into_iter()
            .any(|face| is_open(mesh, open, face))
    });
    let mut larger: HashSet<TetId, FixedState> = HashSet::default();
    while let Some(tet) = due.pop() {
        let Some(part) = small_part(cuttable, tet, &mut larger, |face| is_open(mesh, open, face))
        else {
            continue;
        };
        let faces = part.iter().flat_map(|tet| Face::of(*tet));
        let outside = faces.filter_map(|face| match cuttable.faces.behind(face) {
            Behind::Twin(twin) if is_open(mesh, open, face) => Some((face, twin.tet())),
            _ => None,
        });
        let outside: Vec<(Face, TetId)> = outside.collect();
        let corners: Vec<ParticleId> = part.iter().flat_map(|t| mesh.tets[t.index()]).collect();
        let touching = cuttable.tets_around(&corners);
        let groups = groups(cuttable, &touching, &outside, |face| {
            is_open(mesh, open, face)
        });
        let areas = groups.into_iter().map(|faces| {
            let area: f64 = faces.iter().map(|face| area(mesh, *face)).sum();
            (area, faces)
        });
        let best = areas.reduce(|best, next| if next.0 > best.0 { next } else { best });
        let Some((_, faces)) = best else { continue };
        for face in faces {
            open.remove(&sorted(face.particles(mesh)));
        }
        due.push(tet);
    }
}

/// Moves tets to the other side of the open faces while that makes the area of these smaller: a tet whose open faces lead to
/// one side and are larger than its others.
fn smooth(cuttable: &CuttableMesh, open: &mut BTreeSet<[ParticleId; 3]>) {
    let mesh = &cuttable.mesh;
    let corners: Vec<ParticleId> = open.iter().flatten().copied().collect();
    let mut due = cuttable.tets_around(&corners);
    while let Some(tet) = due.pop() {
        let (mut away, mut held) = (Vec::new(), Vec::new());
        for face in Face::of(tet) {
            if let Behind::Twin(twin) = cuttable.faces.behind(face) {
                let side = if is_open(mesh, open, face) {
                    &mut away
                } else {
                    &mut held
                };
                side.push((face, twin.tet()));
            }
        }
        let sum = |faces: &[(Face, TetId)]| faces.iter().map(|of| area(mesh, of.0)).sum::<f64>();
        if away.is_empty() || sum(&away) <= (1.0 + 1e-9) * sum(&held) {
            continue;
        }
        let touching = cuttable.tets_around(&mesh.tets[tet.index()]);
        let leads = groups(cuttable, &touching, &away, |face| {
            face.tet() == tet || is_open(mesh, open, face)
        });
        if leads.len() > 1 {
            continue;
        }
        for (face, other) in away.into_iter().chain(held) {
            let particles = sorted(face.particles(mesh));
            if !open.remove(&particles) {
                open.insert(particles);
            }
            due.push(other);
        }
    }
}

/// The faces that lead to the same part, which hangs together among the tets `near` without the open faces.
fn groups(
    cuttable: &CuttableMesh,
    near: &[TetId],
    faces: &[(Face, TetId)],
    is_open: impl Fn(Face) -> bool,
) -> Vec<Vec<Face>> {
    let mut groups = Vec::new();
    let mut seen: HashSet<TetId, FixedState> = HashSet::default();
    for &(_, first) in faces {
        if !seen.insert(first) {
            continue;
        }
        let mut part = vec![first];
        let mut next = 0;
        while let Some(&tet) = part.get(next) {
            next += 1;
            for face in Face::of(tet) {
                let Behind::Twin(twin) = cuttable.faces.behind(face) else {
                    continue;
                };
                let is_near = near.binary_search(&twin.tet()).is_ok();
                if is_near && !is_open(face) && !is_open(twin) && seen.insert(twin.tet()) {
                    part.push(twin.tet());
                }
            }
        }
        let of_part = faces.iter().filter(|(_, tet)| part.contains(tet));
        groups.push(of_part.map(|(face, _)| *face).collect());
    }
    groups
}

/// The tets that hang together with one without the open faces, if they are smaller than [`SMALLEST`]. Adds to `larger` those
/// of which it is known that they are not.
fn small_part(
    cuttable: &CuttableMesh,
    first: TetId,
    larger: &mut HashSet<TetId, FixedState>,
    is_open: impl Fn(Face) -> bool,
) -> Option<Vec<TetId>> {
    let smallest = SMALLEST * cuttable.mean_volume;
    let mut known: HashSet<TetId, FixedState> = HashSet::default();
    known.insert(first);
    let mut part = vec![first];
    let (mut next, mut volume) = (0, 0.0);
    while let Some(&tet) = part.get(next) {
        next += 1;
        volume += cuttable.mesh.volume(tet);
        if volume >= smallest || larger.contains(&tet) {
            larger.extend(part);
            return None;
        }
        for face in Face::of(tet) {
            if let Behind::Twin(twin) = cuttable.faces.behind(face)
                && !is_open(face)
                && known.insert(twin.tet())
            {
                part.push(twin.tet());
            }
        }
    }
    Some(part)
}

fn is_open(mesh: &TetMesh, open: &BTreeSet<[ParticleId; 3]>, face: Face) -> bool {
    open.contains(&sorted(face.particles(mesh)))
}

/// Twice the area of a face at rest in m².
fn area(mesh: &TetMesh, face: Face) -> f64 {
    let [a, b, c] = face.particles(mesh).map(|p| mesh.positions[p.index()]);
    DVec3::cross(b - a, c - a).length()
}

/// The strokes that are at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Strokes {
    None,
    One(u32),
    Several,
}

impl Strokes {
    fn and(self, other: Self) -> Self {
        match (self, other) {
            (one, Self::None) | (Self::None, one) => one,
            (Self::One(one), Self::One(other)) if one == other => self,
            _ => Self::Several,
        }
    }
}

/// What lies around faces near strokes. Its maps are never iterated.
struct Surroundings<'a> {
    cuttable: &'a CuttableMesh,
    registry: &'a StrokeRegistry,
    /// For each particle its place, once asked for.
    numbers: Vec<Option<u32>>,
    places: Vec<Place>,
    /// The strokes through the places, with their tangent planes there.
    tangents: Vec<(u32, Tangent)>,
    /// For each particle asked for, where in `near` the places that strokes pass in the tets around it are.
    around: HashMap<ParticleId, [u32; 2], FixedState>,
    near: Vec<u32>,
    /// Faces asked for.
    faces: u32,
    planes: Vec<MeanPlane>,
    /// For each place near a face and stroke through it, the number of its plane and the place.
    marks: Vec<(u32, u32)>,
}

/// A particle asked for.
struct Place {
    rest: DVec3,
    /// Start and end of its tangents; the same if no stroke passes it.
    tangents: [u32; 2],
    /// The last face near which it was.
    face: u32,
}

/// The plane of one stroke near a face: the weighted mean of those at its particles.
#[derive(Default)]
struct MeanPlane {
    stroke: u32,
    point: DVec3,
    normal: DVec3,
    weights: f64,
}

impl<'a> Surroundings<'a> {
    fn new(cuttable: &'a CuttableMesh, registry: &'a StrokeRegistry) -> Self {
        Self {
            cuttable,
            registry,
            numbers: vec![None; cuttable.mesh.positions.len()],
            places: Vec::new(),
            tangents: Vec::new(),
            around: HashMap::default(),
            near: Vec::new(),
            faces: 0,
            planes: Vec::new(),
            marks: Vec::new(),
        }
    }

    /// The place of a particle.
    fn number(&mut self, particle: ParticleId) -> u32 {
        if let Some(known) = self.numbers[particle.index()] {
            return known;
        }
        let number = index(self.places.len());
        let start = self.tangents.len();
        self.tangents
            .extend(self.registry.surfaces_through(particle));
        self.places.push(Place {
            rest: self.cuttable.mesh.positions[particle.index()],
            tangents: [start, self.tangents.len()].map(index),
            face: 0,
        });
        self.numbers[particle.index()] = Some(number);
        number
    }

    /// The tets around some particles for which several strokes come close: on a tet that touches theirs. Ascending.
    fn tets_at_meetings(&mut self, fresh: &[ParticleId]) -> Vec<TetId> {
        let cuttable = self.cuttable;
        let mut known: HashMap<ParticleId, Strokes, FixedState> = HashMap::default();
        let mut tets = cuttable.tets_around(fresh);
        tets.retain(|tet| {
            let corners = cuttable.mesh.tets[tet.index()].into_iter();
            let all = corners.fold(Strokes::None, |all, p| match all {
                Strokes::Several => all,
                _ => all.and(*known.entry(p).or_insert_with(|| self.strokes_around(p))),
            });
            all == Strokes::Several
        });
        tets
    }

    /// The strokes of the particles in the tets around one.
    fn strokes_around(&mut self, particle: ParticleId) -> Strokes {
        let tets = self.cuttable.around(particle);
        let corners = tets.flat_map(|tet| self.cuttable.mesh.tets[tet.index()]);
        let mut all = Strokes::None;
        for p in corners {
            let number = self.number(p) as usize;
            let [start, end] = self.places[number].tangents.map(|at| at as usize);
            for (stroke, _) in &self.tangents[start..end] {
                all = all.and(Strokes::One(*stroke));
            }
            if all == Strokes::Several {
                break;
            }
        }
        all
    }

    /// Whether two strokes near the face between two tets divide them.
    fn divide(&mut self, tets: [TetId; 2], face: [ParticleId; 3]) -> bool {
        let mesh = &self.cuttable.mesh;
        let [a, b, c] = face.map(|p| mesh.positions[p.index()]);
        let center = (a + b + c) / 3.0;
        self.look_around(tets, center);
        if self.planes.len() < 2 {
            return false;
        }
        let [near, close] = [NEAR, CLOSE].map(|edges| edges * self.cuttable.mean_edge());
        let planes = (0..).zip(&self.planes).filter_map(|(number, mean)| {
            let plane = mean.plane()?;
            (plane.distance(center).abs() <= near).then_some((number, plane))
        });
        let planes: Vec<(u32, Tangent)> = planes.collect();
        let centroids = tets.map(|tet| centroid(mesh, tet));
        planes.iter().enumerate().any(|(i, one)| {
            planes[..i].iter().any(|other| {
                let normals = [one, other].map(|stroke| stroke.1.normal);
                if normals[0].dot(normals[1]).abs() >= ALIGNED {
                    return false;
                }
                let quarters = centroids.map(|x| {
                    let [a, b] = [one, other].map(|stroke| stroke.1.distance(x) < 0.0);
                    quarter(a, b)
                });
                if quarters[0] == quarters[1] {
                    return false;
                }
                let distances = [(one, other), (other, one)].map(|((stroke, _), (_, plane))| {
                    let marks = self.marks.iter().filter(|(of, _)| of == stroke);
                    let rest = marks.map(|(_, place)| self.places[*place as usize].rest);
                    rest.map(|x| plane.distance(x)).collect::<Vec<f64>>()
                });
                let meet = distances
                    .iter()
                    .all(|of| of.iter().any(|distance| distance.abs() <= close));
                meet && are_divided(quarters, distances.map(|of| sides(&of, near)))
            })
        })
    }

    /// Finds `planes` and `marks` of the places in the tets that touch two tets. A place weighs by its distance from `x`
    /// squared, alike within [`CORE`].
    fn look_around(&mut self, tets: [TetId; 2], x: DVec3) {
        self.faces += 1;
        self.planes.clear();
        self.marks.clear();
        let least = (CORE * self.cuttable.mean_edge()).powi(2);
        for corner in tets
            .into_iter()
            .flat_map(|t| self.cuttable.mesh.tets[t.index()])
        {
            let [start, end] = self.places_around(corner).map(|at| at as usize);
            for &number in &self.near[start..end] {
                let place = &mut self.places[number as usize];
                if place.face == self.faces {
                    continue;
                }
                place.face = self.faces;
                let weight = 1.0 / (place.rest.distance_squared(x) + least);
                let [start, end] = place.tangents.map(|at| at as usize);
                for &(stroke, tangent) in &self.tangents[start..end] {
                    let known = self.planes.iter().position(|plane| plane.stroke == stroke);
                    let plane = known.unwrap_or_else(|| {
                        self.planes.push(MeanPlane {
                            stroke,
                            ..MeanPlane::default()
                        });
                        self.planes.len() - 1
                    });
                    self.planes[plane].add(weight, tangent);
                    self.marks.push((index(plane), number));
                }
            }
        }
    }

    /// Where in `near` the places that strokes pass in the tets around a particle are.
    fn places_around(&mut self, particle: ParticleId) -> [u32; 2] {
        if let Some(known) = self.around.get(&particle) {
            return *known;
        }
        let start = self.near.len();
        let tets = self.cuttable.around(particle);
        for p in tets.flat_map(|tet| self.cuttable.mesh.tets[tet.index()]) {
            let number = self.number(p);
            let [first, last] = self.places[number as usize].tangents;
            if first < last && !self.near[start..].contains(&number) {
                self.near.push(number);
            }
        }
        let range = [start, self.near.len()].map(index);
        self.around.insert(particle, range);
        range
    }
}

impl MeanPlane {
    fn add(&mut self, weight: f64, tangent: Tangent) {
        self.point += weight * tangent.point;
        self.normal += weight * tangent.normal;
        self.weights += weight;
    }

    fn plane(&self) -> Option<Tangent> {
        Some(Tangent {
            point: self.point / self.weights,
            normal: self.normal.try_normalize()?,
        })
    }
}

fn centroid(mesh: &TetMesh, tet: TetId) -> DVec3 {
    let corners = mesh.tets[tet.index()].into_iter();
    corners.map(|p| mesh.positions[p.index()]).sum::<DVec3>() / 4.0
}

/// On which sides of a plane particles are, by their distances from it: on one unless all lie in it, and on both if they
/// reach as far, or further than `near`, on both. Of the positive side first. Rounding does not choose one of two.
fn sides(distances: &[f64], near: f64) -> [bool; 2] {
    let least = distances.iter().copied().fold(0.0, f64::min);
    let most = distances.iter().copied().fold(0.0, f64::max);
    let further = f64::max(most, -least);
    let alike = ROUNDING * near;
    [most, -least].map(|reach| reach > near || (reach > alike && reach >= further - alike))
}

/// The number of a quarter, by whether it is on the negative sides of the first and of the second plane: neighbors
/// follow each other, and the first the last.
fn quarter(one: bool, other: bool) -> usize {
    match (one, other) {
        (false, false) => 0,
        (true, false) => 1,
        (true, true) => 2,
        (false, true) => 3,
    }
}

/// Whether two strokes divide two quarters: on both ways around there is one between them. `reach` says for each on which
/// sides of the other one it is.
fn are_divided(quarters: [usize; 2], reach: [[bool; 2]; 2]) -> bool {
    let [one, other] = reach;
    // Between each quarter and the next.
    let walls = [one[0], other[1], one[1], other[0]];
    let [from, to] = [quarters[0].min(quarters[1]), quarters[0].max(quarters[1])];
    let there = walls[from..to].contains(&true);
    let back = walls[to..].iter().chain(&walls[..from]).any(|wall| *wall);
    there && back
}
