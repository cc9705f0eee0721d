//! [`cut_level_set`]: cuts along the zero set of any scalar field, such as a closed surface around a plug.
//!
//! The field is evaluated at the particles, where they are now; crossed edges search for the zero along themselves by
//! regula falsi with the Illinois rule (M. Dowell and P. Jarratt 1971), with bisection in the end. Everything else
//! follows from the signs (see the module `sign_split`). Cost: an evaluation a particle and some ten a crossed edge, and a
//! pass over the tets, then the cut.

use glam::DVec3;
use incise_mesh::ParticleId;

use crate::finite::require_positions;
use crate::parallel;
use crate::sign_split::{cut_by_signs, linear};
use crate::{CutDelta, CutError, CutOptions, CuttableMesh};

/// Steps of regula falsi before bisection takes over. Smooth fields need about six.
const FALSE_POSITIONS: usize = 16;
/// Width of the bracket, as a fraction of the edge, at which the search ends.
const RESOLUTION: f64 = 1e-15;

/// Cuts where a scalar field is zero.
///
/// # Arguments
/// `positions` are the particles' present positions in m, where the field is given; the mesh at rest is cut at the same
/// fractions of its edges. `field` is positive on one side and negative on the other, in any unit, such as a signed
/// distance. It should be continuous: where it jumps across zero, the jump is cut.
///
/// # Returns
/// Returns the changes; none if the field has one sign everywhere. The cut surface is straight within each tet. An edge
/// that the surface crosses twice has ends of one sign and is not cut, so parts thinner than a tet are missed. A
/// repeated cut changes nothing, except where snapping bends a strongly curved surface.
///
/// # Errors
/// If the field is not finite at a particle or on a crossed edge, if the options are not valid, or if `positions` has
/// another length than the mesh or is not finite; nothing is changed then.
///
/// # Determinism
/// Equal input gives the same bits for any number of threads, if the field itself does.
///
/// # Example
/// ```
/// use glam::DVec3;
/// use incise_cutting::{CutOptions, CuttableMesh, cut_level_set};
/// use incise_mesh::kuhn_box;
///
/// // A ball is carved out of a box.
/// let mut body = CuttableMesh::new(kuhn_box([6, 6, 6], DVec3::ONE))?;
/// let positions = body.mesh().positions.clone();
/// let ball = |x: DVec3| x.distance(DVec3::splat(0.5)) - 0.3;
/// cut_level_set(&mut body, &positions, ball, &CutOptions::default())?;
/// assert_eq!(body.mesh().pieces().count, 2);
/// # Ok::<(), incise_cutting::CutError>(())
/// ```
pub fn cut_level_set(
    cuttable: &mut CuttableMesh,
    positions: &[DVec3],
    field: impl Fn(DVec3) -> f64 + Sync,
    options: &CutOptions,
) -> Result<CutDelta, CutError> {
    let _span = tracing::debug_span!("cutting::level_set").entered();
    options.check()?;
    require_positions(cuttable.mesh(), positions)?;
    let values = parallel::map(positions, |&x| field(x));
    cut_by_signs(
        cuttable,
        values,
        "the field at a particle",
        options,
        |ends: [ParticleId; 2], values| {
            let [a, b] = ends.map(|p| positions[p.index()]);
            crossing(|t| field(a + (b - a) * t), values)
        },
    )
}

/// A zero of `f` in 0..=1, at whose ends it has the values given, of different signs. NaN if `f` is not finite.
fn crossing(f: impl Fn(f64) -> f64, [at_low, at_high]: [f64; 2]) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    let (mut below, mut above) = (at_low, at_high);
    let mut last_kept_high = None;
    for step in 0.. {
        if high - low <= RESOLUTION {
            break;
        }
        let fraction = if step < FALSE_POSITIONS {
            linear([below, above])
        } else {
            0.5
        };
        let mut at = low + (high - low) * fraction;
        if !(low < at && at < high) {
            // Rounding put the step on an end, or a value underflowed.
            at = 0.5 * (low + high);
            if !(low < at && at < high) {
                break;
            }
        }
        let value = f(at);
        if !value.is_finite() {
            return f64::NAN;
        }
        if value == 0.0 {
            return at;
        }
        // The end that stays twice in a row counts half, else it might stay for ever.
        let keeps_high = (value > 0.0) == (at_low > 0.0);
        if keeps_high {
            (low, below) = (at, value);
            if last_kept_high == Some(true) {
                above *= 0.5;
            }
        } else {
            (high, above) = (at, value);
            if last_kept_high == Some(false) {
                below *= 0.5;
            }
        }
        last_kept_high = Some(keeps_high);
    }
    low + (high - low) * linear([below, above])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_are_found() {
        // Straight, curved, flat at the root, steep, jumping, and of huge and tiny values.
        let cases: [(&dyn Fn(f64) -> f64, f64); 7] = [
            (&|t| 3.0 * (t - 0.3), 0.3),
            (&|t| t * t - 0.25, 0.5),
            (&|t| (t - 0.9).powi(3), 0.9),
            (&|t| ((t - 0.1) * 1e3).tanh(), 0.1),
            (&|t| if t < 0.7 { -1.0 } else { 1e-3 }, 0.7),
            (&|t| (t - 0.2) * 1e308, 0.2),
            (&|t| (t - 0.2) * 1e-300, 0.2),
        ];
        for (i, (f, root)) in cases.into_iter().enumerate() {
            let found = crossing(f, [f(0.0), f(1.0)]);
            // The triple root is flat to 1e-5 around in double precision values below 1e-15; all others are sharp.
            let slack = if i == 2 { 1e-5 } else { 1e-12 };
            assert!(
                (found - root).abs() <= slack,
                "case {i}: {found} for {root}"
            );
            let mirrored = crossing(|t| -f(t), [-f(0.0), -f(1.0)]);
            assert_eq!(found.to_bits(), mirrored.to_bits());
        }
    }

    #[test]
    fn a_hole_in_the_field_is_noticed() {
        let f = |t: f64| {
            if (t - 0.5).abs() < 0.2 {
                f64::NAN
            } else {
                t - 0.5
            }
        };
        assert!(crossing(f, [f(0.0), f(1.0)]).is_nan());
    }
}
