//! Which particles of a body lie in a [`Region`] of the scene.

use glam::DVec3;

use crate::Error;
use crate::limits::{coordinates, direction, value};
use crate::scene::Region;

/// The numbers of the particles at rest at `positions` that lie in a region, ascending.
pub(crate) fn particles(
    field: &str,
    region: &Region,
    positions: &[DVec3],
) -> Result<Vec<usize>, Error> {
    let all = |inside: &dyn Fn(DVec3) -> bool| {
        let numbers = 0..positions.len();
        Ok(numbers.filter(|&p| inside(positions[p])).collect())
    };
    match region {
        Region::HalfSpace { point, normal } => {
            let point = coordinates(&format!("{field}.half_space.point"), *point)?;
            let normal = direction(&format!("{field}.half_space.normal"), *normal)?;
            all(&|x| normal.dot(x - point) >= 0.0)
        }
        Region::Box { low, high } => {
            let low = coordinates(&format!("{field}.box.low"), *low)?;
            let high = coordinates(&format!("{field}.box.high"), *high)?;
            if !low.cmple(high).all() {
                let range = "such that low is at most high in all coordinates";
                return Err(value(format!("{field}.box"), "inside out", range));
            }
            all(&|x| x.cmpge(low).all() && x.cmple(high).all())
        }
        Region::Sphere { center, radius } => {
            let center = coordinates(&format!("{field}.sphere.center"), *center)?;
            if !(radius.is_finite() && *radius >= 0.0) {
                let field = format!("{field}.sphere.radius");
                return Err(value(field, radius, "at least 0 and finite"));
            }
            all(&|x| x.distance(center) <= *radius)
        }
        Region::Particles(particles) => {
            let count = positions.len();
            if let Some(p) = particles.iter().find(|p| **p as usize >= count) {
                let range = format!("below {count}, the body's number of particles");
                return Err(value(format!("{field}.particles"), p, range));
            }
            let mut numbers: Vec<usize> = particles.iter().map(|&p| p as usize).collect();
            numbers.sort_unstable();
            numbers.dedup();
            Ok(numbers)
        }
    }
}
