//! Snapping of a stroke: which particles are put on the surface instead of being cut off beside it.
//!
//! Decided once a particle, when the first of its edges is met; see the head of [`super`]. A crossing within the
//! tolerance is always snapped, and so is one that a repeated stroke would only take a chip off with. Cost: for a
//! particle on a met edge the tets around it.

use incise_mesh::ParticleId;

use super::Stroke;
use crate::CuttableMesh;
use crate::blade::{AGAIN, CrossedEdge};
use crate::operation::Operation;
use crate::surface::Tangent;

/// A particle that the surface passed on both sides, and this time within this fraction of an edge, is put on it: the
/// body between the two sheets is thinner than a tet, and cutting both would leave it as a thread.
const BETWEEN: f64 = 0.5;

impl Stroke {
    /// Notes what the hits say of their ends, and puts those on the surface that it touches or passes closely.
    pub(super) fn snap(
        &mut self,
        operation: &mut Operation<'_>,
        hits: &[CrossedEdge],
        touched: Vec<(ParticleId, Tangent)>,
        foresee: bool,
    ) -> Vec<ParticleId> {
        let cuttable = &*operation.cuttable;
        for hit in hits {
            for (particle, side) in hit.crossing.ends.into_iter().zip(hit.sides) {
                if let Some(side) = side {
                    self.surface.see(particle, side);
                }
            }
        }
        let mut snapped = touched;
        for hit in hits {
            let at = hit.crossing.parameter;
            for (particle, fraction) in hit.crossing.ends.into_iter().zip([at, 1.0 - at]) {
                let undecided = !self.surface.is_decided(particle);
                let close = fraction < self.options.tolerance
                    || (undecided && fraction < self.options.snap)
                    || (undecided && self.was_bent(cuttable, particle, &hit.tangent))
                    || (undecided
                        && foresee
                        && self.passes_closely(cuttable, particle, &hit.tangent))
                    || (fraction < BETWEEN && self.surface.is_seen_on_both(particle));
                if close && !self.surface.contains(particle) {
                    snapped.push((particle, hit.tangent));
                }
            }
        }
        for particle in hits.iter().flat_map(|hit| hit.crossing.ends) {
            self.surface.decide(particle);
        }
        self.bend(operation, snapped)
    }

    /// Puts particles on the surface, each by the first of its planes; returns them ascending.
    pub(super) fn bend(
        &mut self,
        operation: &mut Operation<'_>,
        mut snapped: Vec<(ParticleId, Tangent)>,
    ) -> Vec<ParticleId> {
        snapped.sort_by_key(|(particle, _)| *particle);
        snapped.dedup_by_key(|(particle, _)| *particle);
        let rest = &operation.cuttable.mesh.positions;
        let bent = snapped
            .iter()
            .map(|(p, tangent)| tangent.distance(rest[p.index()]));
        let bent: Vec<f64> = bent.collect();
        for (&(particle, tangent), distance) in snapped.iter().zip(bent) {
            self.surface.put(particle, tangent);
            operation.bend(particle, distance.abs());
        }
        snapped.into_iter().map(|(particle, _)| particle).collect()
    }

    /// Whether an earlier stroke was bent to the particle over the distance it is from the plane now. Its edge that was
    /// crossed closely may belong to a copy now, and the others would be split to take a chip off.
    fn was_bent(&self, cuttable: &CuttableMesh, particle: ParticleId, plane: &Tangent) -> bool {
        let Some(&bent) = cuttable.bent.get(&particle) else {
            return false;
        };
        // Level sets note their values, which need not be lengths.
        let most = self.options.snap * cuttable.longest_edge_around([particle; 2]);
        let distance = plane.distance(cuttable.mesh.positions[particle.index()]);
        distance.abs() <= (AGAIN * bent).min(most)
    }

    /// Whether the plane crosses one of the particle's edges within the snap distance from it.
    fn passes_closely(
        &self,
        cuttable: &CuttableMesh,
        particle: ParticleId,
        plane: &Tangent,
    ) -> bool {
        let rest = &cuttable.mesh.positions;
        let here = plane.distance(rest[particle.index()]);
        cuttable.around(particle).any(|tet| {
            cuttable.mesh.tets[tet.index()].iter().any(|&other| {
                let there = plane.distance(rest[other.index()]);
                (here > 0.0) != (there > 0.0)
                    && here.abs() < self.options.snap * (here - there).abs()
            })
        })
    }
}
