//! A cut along the zero set of a function of the particles: the one implementation behind planes and level sets.
//!
//! Each particle has a value; edges between values of different signs are crossed, crossings close to a particle put
//! that particle on the surface, and everything else follows from the signs: which edges are split, which side a tet
//! is on, which faces open. Source: paper section 4.3. Cost: a pass over particles and tets to find the cut ones, then
//! the cut.

use incise_mesh::ParticleId;

use crate::blade::AGAIN;
use crate::operation::{Crossing, Operation, SplitError};
use crate::parallel;
use crate::{CutDelta, CutError, CutOptions, CuttableMesh, Separation};

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
    snapped += keep_bent(cuttable, &crossings, &values, &mut on_surface);
    let particles = values.len();
    let mut operation = Operation::begin(cuttable, options);
    let mut flagged = crossings;
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

/// Puts particles back on the surface that an earlier cut was bent to, where this one would only cut off what lies
/// between the two. Returns how many.
///
/// A particle is snapped because of one of its edges. After the cut that edge may belong to a copy, and nothing would
/// tell the other copies: the same cut again would take chips off. So particles that are no further from this surface
/// than from the one bent to them stay on it, if all their neighbors on the same side do as well.
fn keep_bent(
    cuttable: &CuttableMesh,
    crossings: &[Crossing],
    values: &[f64],
    on_surface: &mut [bool],
) -> usize {
    let ends = crossings.iter().flat_map(|crossing| crossing.ends);
    let close = |p: &ParticleId| {
        let bend = cuttable.bent.get(p);
        bend.is_some_and(|bend| values[p.index()].abs() <= AGAIN * bend)
    };
    let mut kept: Vec<ParticleId> = ends
        .filter(close)
        .filter(|p| !on_surface[p.index()])
        .collect();
    kept.sort_unstable();
    kept.dedup();
    loop {
        let alone = |p: &ParticleId| {
            let tets = cuttable.stars.around(*p);
            let mut others = tets.flat_map(|tet| cuttable.mesh.tets[tet.index()]);
            let side = values[p.index()] > 0.0;
            others.all(|q| {
                let value = values[q.index()];
                on_surface[q.index()]
                    || value == 0.0
                    || (value > 0.0) != side
                    || kept.binary_search(&q).is_ok()
            })
        };
        let next: Vec<ParticleId> = kept.iter().copied().filter(alone).collect();
        if next.len() == kept.len() {
            break;
        }
        kept = next;
    }
    for p in &kept {
        on_surface[p.index()] = true;
    }
    kept.len()
}
