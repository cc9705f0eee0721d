//! A cut along the zero set of a function of the particles: the one implementation behind planes and level sets.
//!
//! Each particle has a value; edges between values of different signs are crossed, crossings close to a particle put
//! that particle on the surface, and everything else follows from the signs: which edges are split, which side a tet
//! is on, which faces open. Source: paper section 4.3. Cost: a pass over particles and tets to find the cut ones, then
//! the cut.

use incise_mesh::ParticleId;

use crate::blade::AGAIN;
use crate::delta::FaceTag;
use crate::faces::{Behind, Face};
use crate::operation::{Crossing, Operation, SplitError};
use crate::parallel;
use crate::{CutDelta, CutError, CutOptions, CuttableMesh, Separation};

/// How many times thicker than the snap distance what is left of a slice that is mostly thinner may be.
const TATTER: f64 = 2.0;

/// Cuts where `values`, one a particle, change their sign. `what` they are is named if one is not finite.
///
/// `parameter` says where on an edge (smaller id first) between two values of different signs the zero lies, in 0..=1;
/// NaN makes an error. Nothing is changed on errors.
pub(crate) fn cut_by_signs(
    cuttable: &mut CuttableMesh,
    mut values: Vec<f64>,
    what: &'static str,
    options: &CutOptions,
    parameter: impl Fn([ParticleId; 2], [f64; 2]) -> f64 + Sync,
) -> Result<CutDelta, CutError> {
    if let Some(&value) = values.iter().find(|d| !d.is_finite()) {
        return Err(CutError::NonFinite { what, value });
    }
    let mut on_surface: Vec<bool> = values.iter().map(|&d| d == 0.0).collect();
    let crossings = parallel::map(&crossed(cuttable, &values), |&ends| Crossing {
        ends,
        parameter: parameter(ends, ends.map(|p| values[p.index()])),
    });
    if let Some(broken) = crossings.iter().find(|c| c.parameter.is_nan()) {
        return Err(CutError::NonFinite {
            what: "the field on an edge",
            value: broken.parameter,
        });
    }
    let mut snapped = snap(&crossings, &values, options, &mut on_surface);
    snapped += swallow(cuttable, &crossings, &values, options, &mut on_surface);
    let particles = values.len();
    let mut operation = Operation::begin(cuttable, options);
    let mut flagged = crossings;
    operation.cuttable.align_sides(flagged.iter_mut());
    loop {
        flagged.retain(|c| c.ends.iter().all(|p| !on_surface[p.index()]));
        match operation.split(&flagged) {
            Ok(_) => break,
            Err(SplitError::TooMany(error)) => return Err(error),
            Err(SplitError::TooThin(refused)) => {
                for c in refused {
                    let near = flagged[c].nearer_end().index();
                    snapped += usize::from(!std::mem::replace(&mut on_surface[near], true));
                }
            }
        }
    }
    operation.delta.snapped = snapped;
    let bent = (0..particles).filter(|&p| on_surface[p] && values[p] != 0.0);
    for p in bent {
        operation.bend(ParticleId::new(p), values[p].abs());
    }
    values.resize(values.len() + flagged.len(), 0.0);
    on_surface.resize(on_surface.len() + flagged.len(), true);

    let side = |corners: [ParticleId; 4]| {
        let off = corners
            .iter()
            .filter(|p| !on_surface[p.index()])
            .map(|p| values[p.index()])
            .sum::<f64>();
        let all = || corners.iter().map(|p| values[p.index()]).sum::<f64>();
        if off == 0.0 { all() >= 0.0 } else { off > 0.0 }
    };
    let seeds: Vec<ParticleId> = (0..on_surface.len())
        .filter(|&p| on_surface[p])
        .map(ParticleId::new)
        .collect();
    let on = |p: ParticleId| on_surface[p.index()];
    match options.separation {
        Separation::CutFaces => operation.separate(&seeds, on, |face| {
            let [one, other] = face.corners.map(side);
            one != other
        }),
        Separation::SharedOriginal => {
            operation.separate_by_particles(&seeds, |p| p.index() < particles);
        }
        Separation::SharedOffSurface => operation.separate_by_particles(&seeds, |p| !on(p)),
    }
    Ok(operation.finish(|_, corners| side(corners)))
}

/// The edges whose ends lie on different sides, smaller end first, ascending.
fn crossed(cuttable: &CuttableMesh, values: &[f64]) -> Vec<[ParticleId; 2]> {
    let tets = &cuttable.mesh.tets;
    let cut = parallel::filter_map_numbers(tets.len(), |t| {
        let d = tets[t].map(|p| values[p.index()]);
        let one_side = d.iter().all(|&d| d >= 0.0) || d.iter().all(|&d| d <= 0.0);
        (!one_side).then_some(tets[t])
    });
    let mut ends: Vec<[ParticleId; 2]> = Vec::with_capacity(4 * cut.len());
    for corners in cut {
        let d = corners.map(|p| values[p.index()]);
        for i in 0..4 {
            for j in i + 1..4 {
                if (d[i] < 0.0 && d[j] > 0.0) || (d[i] > 0.0 && d[j] < 0.0) {
                    ends.push([corners[i].min(corners[j]), corners[i].max(corners[j])]);
                }
            }
        }
    }
    ends.sort_unstable();
    ends.dedup();
    ends
}

/// Where on an edge the zero lies if the function is linear along it.
pub(crate) fn linear([a, b]: [f64; 2]) -> f64 {
    // Scaled, so that huge values do not overflow.
    let scale = a.abs().max(b.abs());
    (a / scale) / (a / scale - b / scale)
}

/// Puts particles on the surface that a crossing comes closer to than the options say; returns how many.
///
/// All crossings are judged before any is dropped, so the result does not depend on their order. A value that is next
/// to nothing against the other end's counts as well: it is that of a particle on the surface, from which the edge may
/// have left it and come back.
fn snap(
    crossings: &[Crossing],
    values: &[f64],
    options: &CutOptions,
    on_surface: &mut [bool],
) -> usize {
    let mut snapped = 0;
    let mut put = |p: ParticleId| {
        snapped += usize::from(!std::mem::replace(&mut on_surface[p.index()], true));
    };
    let reach = options.reach();
    for crossing in crossings {
        let straight = linear(crossing.ends.map(|p| values[p.index()]));
        if crossing.parameter < reach || straight < options.tolerance {
            put(crossing.ends[0]);
        } else if crossing.parameter > 1.0 - reach || straight > 1.0 - options.tolerance {
            put(crossing.ends[1]);
        }
    }
    snapped
}

/// Puts the particles of parts on the surface that are thinner than the snap distance throughout, so that what lies
/// between the surface and an earlier cut is not cut off at all. Returns how many.
///
/// A part is what the particles of one side that are not on the surface hold together. Deciding particle by particle
/// would leave a thin slice in tatters: where an earlier cut was bent away from its particles, or edges are short, bits
/// of it would come off. A part that borders on particles snapped on its side is such a bit, and may be thicker by
/// [`TATTER`]. It also makes a cut repeated change nothing: after the cut, the edge that a particle was
/// snapped for may belong to a copy, and nothing would tell the other copies.
///
/// Cost: the tets around the particles of such parts; each particle is looked at once.
fn swallow(
    cuttable: &CuttableMesh,
    crossings: &[Crossing],
    values: &[f64],
    options: &CutOptions,
    on_surface: &mut [bool],
) -> usize {
    let mut part_of = vec![0_u32; values.len()];
    let mut part: Vec<ParticleId> = Vec::new();
    let (mut number, mut swallowed) = (0, 0);
    for start in crossings.iter().flat_map(|crossing| crossing.ends) {
        if on_surface[start.index()] || part_of[start.index()] > 0 {
            continue;
        }
        number += 1;
        part_of[start.index()] = number;
        part.clear();
        part.push(start);
        let (mut next, mut is_thin, mut is_torn) = (0, true, false);
        let mut most = Surroundings::default();
        while let Some(&particle) = part.get(next).filter(|_| is_thin) {
            next += 1;
            most.add(cuttable, particle, values);
            is_thin = most.edges <= TATTER * options.snap;
            let around = cuttable.stars.around(particle);
            for other in around.flat_map(|tet| cuttable.mesh.tets[tet.index()]) {
                if values[other.index()] * values[particle.index()] <= 0.0 {
                    continue;
                }
                if on_surface[other.index()] {
                    is_torn = true;
                    continue;
                }
                match std::mem::replace(&mut part_of[other.index()], number) {
                    0 => part.push(other),
                    // Of a part that was found to be thicker.
                    known => is_thin &= known == number,
                }
            }
        }
        // What is as thick as the rest of the body is no slice of it: both sides would be swallowed.
        is_thin &= is_torn || most.edges <= options.snap;
        let is_slice = most.meets_cut || most.thickness == 0.0;
        if is_thin && is_slice && most.thickness <= 0.5 * most.beyond {
            swallowed += part.len();
            for p in &part {
                on_surface[p.index()] = true;
            }
        }
    }
    swallowed
}

/// What a part extends to on both sides of the surface, the most of all its particles.
#[derive(Default)]
struct Surroundings {
    /// How far it reaches from the surface, further than an earlier cut was bent to its particles.
    thickness: f64,
    /// That as a fraction of what a value changes by over the longest edge around.
    edges: f64,
    /// The largest distance from the surface on the other side.
    beyond: f64,
    /// Whether a face of an earlier cut bounds it.
    meets_cut: bool,
}

impl Surroundings {
    fn add(&mut self, cuttable: &CuttableMesh, particle: ParticleId, values: &[f64]) {
        let (mesh, value) = (&cuttable.mesh, values[particle.index()]);
        // Over an edge of any direction a value changes by at most the product.
        let (mut longest, mut steepest): (f64, f64) = (0.0, 0.0);
        for tet in cuttable.stars.around(particle) {
            let corners = mesh.tets[tet.index()];
            for (i, a) in corners.into_iter().enumerate() {
                if values[a.index()] * value < 0.0 {
                    self.beyond = self.beyond.max(values[a.index()].abs());
                }
                for b in corners.into_iter().skip(i + 1) {
                    let length = mesh.positions[a.index()].distance(mesh.positions[b.index()]);
                    longest = longest.max(length);
                    steepest = steepest.max((values[a.index()] - values[b.index()]).abs() / length);
                }
            }
        }
        let around = cuttable.stars.around(particle);
        let faces = around.flat_map(|tet| Face::of(tet).map(|face| cuttable.faces.behind(face)));
        let mut cut = faces.filter(|behind| matches!(behind, Behind::Nothing(FaceTag::Cut(_))));
        self.meets_cut |= cut.next().is_some();
        let bend = cuttable.bent.get(&particle).copied().unwrap_or(0.0);
        let thickness = (value.abs() - AGAIN * bend).max(0.0);
        self.thickness = self.thickness.max(thickness);
        if thickness > 0.0 {
            self.edges = self.edges.max(thickness / (longest * steepest));
        }
    }
}
