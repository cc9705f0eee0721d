//! [`Solid`]: a region of a scene in space, and the particles of a body in it.

use glam::DVec3;
use incise_mesh::{TetId, TetMesh};

use crate::Error;
use crate::scene::Region;
use crate::validate::{coordinates, direction, value};

/// A part of space.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum Solid {
    HalfSpace { point: DVec3, normal: DVec3 },
    Box { low: DVec3, high: DVec3 },
    Sphere { center: DVec3, radius: f64 },
}

impl Solid {
    /// The region in space; `None` if it is a list.
    pub(crate) fn new(field: &str, region: &Region) -> Result<Option<Self>, Error> {
        Ok(Some(match region {
            Region::HalfSpace { point, normal } => Self::HalfSpace {
                point: coordinates(&format!("{field}.half_space.point"), *point)?,
                normal: direction(&format!("{field}.half_space.normal"), *normal)?,
            },
            Region::Box { low, high } => {
                let low = coordinates(&format!("{field}.box.low"), *low)?;
                let high = coordinates(&format!("{field}.box.high"), *high)?;
                if !low.cmple(high).all() {
                    let range = "such that low is at most high in all coordinates";
                    return Err(value(format!("{field}.box"), "inside out", range));
                }
                Self::Box { low, high }
            }
            Region::Sphere { center, radius } => {
                let center = coordinates(&format!("{field}.sphere.center"), *center)?;
                if !(radius.is_finite() && *radius >= 0.0) {
                    let field = format!("{field}.sphere.radius");
                    return Err(value(field, radius, "at least 0 and finite"));
                }
                let radius = *radius;
                Self::Sphere { center, radius }
            }
            Region::Particles(_) | Region::Tets(_) => return Ok(None),
        }))
    }

    /// Whether a point is in it, the boundary included.
    pub(crate) fn contains(&self, x: DVec3) -> bool {
        match *self {
            Self::HalfSpace { point, normal } => normal.dot(x - point) >= 0.0,
            Self::Box { low, high } => x.cmpge(low).all() && x.cmple(high).all(),
            Self::Sphere { center, radius } => x.distance(center) <= radius,
        }
    }

    /// The distance from its boundary in m, negative inside.
    pub(crate) fn distance(&self, x: DVec3) -> f64 {
        match *self {
            Self::HalfSpace { point, normal } => -normal.dot(x - point),
            Self::Box { low, high } => {
                let beyond = (low - x).max(x - high);
                beyond.max(DVec3::ZERO).length() + beyond.max_element().min(0.0)
            }
            Self::Sphere { center, radius } => x.distance(center) - radius,
        }
    }
}

/// The numbers of the particles at rest at `positions` that lie in a region, ascending.
pub(crate) fn particles(
    field: &str,
    region: &Region,
    positions: &[DVec3],
) -> Result<Vec<usize>, Error> {
    if let Some(solid) = Solid::new(field, region)? {
        let numbers = 0..positions.len();
        return Ok(numbers.filter(|&p| solid.contains(positions[p])).collect());
    }
    let Region::Particles(particles) = region else {
        let range = "half_space, box, sphere or particles";
        return Err(value(format!("{field}.tets"), "a list of tets", range));
    };
    listed(
        &format!("{field}.particles"),
        particles,
        positions.len(),
        "particles",
    )
}

/// The numbers of the tets of a mesh whose centers lie in a region, ascending.
pub(crate) fn tets(field: &str, region: &Region, mesh: &TetMesh) -> Result<Vec<usize>, Error> {
    if let Some(solid) = Solid::new(field, region)? {
        let center = |t: usize| mesh.corners(TetId::new(t)).iter().sum::<DVec3>() / 4.0;
        let numbers = 0..mesh.tets.len();
        return Ok(numbers.filter(|&t| solid.contains(center(t))).collect());
    }
    if let Region::Tets(tets) = region {
        return listed(&format!("{field}.tets"), tets, mesh.tets.len(), "tets");
    }
    let mut inside = vec![false; mesh.positions.len()];
    for p in particles(field, region, &mesh.positions)? {
        inside[p] = true;
    }
    let all = mesh.tets.iter().enumerate();
    let with_all = all.filter(|(_, tet)| tet.iter().all(|p| inside[p.index()]));
    Ok(with_all.map(|(t, _)| t).collect())
}

/// A list of numbers below `count`, ascending and each once.
fn listed(field: &str, list: &[u32], count: usize, what: &str) -> Result<Vec<usize>, Error> {
    if let Some(number) = list.iter().find(|number| **number as usize >= count) {
        let range = format!("below {count}, the body's number of {what}");
        return Err(value(field, number, range));
    }
    let mut numbers: Vec<usize> = list.iter().map(|&number| number as usize).collect();
    numbers.sort_unstable();
    numbers.dedup();
    Ok(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Known distances, inside and out.
    #[test]
    fn distances() {
        let solid = Solid::Box {
            low: DVec3::ZERO,
            high: DVec3::new(1.0, 2.0, 3.0),
        };
        for (x, distance) in [
            ([0.5, 1.0, 1.5], -0.5),
            ([0.5, 1.9, 1.5], -0.1),
            ([1.5, 1.0, 1.0], 0.5),
            ([-3.0, 6.0, 1.0], 5.0),
            ([1.0, 1.0, 1.0], 0.0),
        ] {
            let x = DVec3::from_array(x);
            assert!((solid.distance(x) - distance).abs() < 1e-15);
            assert_eq!(solid.contains(x), distance <= 0.0);
        }
        let (center, radius) = (DVec3::X, 2.0);
        let ball = Solid::Sphere { center, radius };
        assert_eq!(ball.distance(DVec3::new(1.0, 3.0, 0.0)), 1.0);
        let (point, normal) = (DVec3::Z, DVec3::Z);
        let above = Solid::HalfSpace { point, normal };
        assert_eq!(above.distance(DVec3::Z * 3.0), -2.0);
        assert!(above.contains(DVec3::Z * 3.0));
    }
}
