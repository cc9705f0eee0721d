//! [`Shape`]: named solids, each as a signed distance function.
//!
//! Each has a longest side of 1 m and is centered on the origin, so that scenes can exchange them. Together they cover
//! features that are hard for a simulation: thin parts, high curvature, sharp edges, a hole, a void, two pieces. Shapes
//! blended from several parts are in the module `solids`. Constant time per evaluation.

use std::fmt;

use glam::DVec3;

use crate::MeshingError;
use crate::distance::{ball, cuboid, torus};
use crate::solids::{armadillo, bunny, gear, liver, pair, shell};

/// A solid with longest side 1 m, centered on the origin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Shape {
    /// A ball of diameter 1.
    Sphere,
    /// A cube of side 1.
    Box,
    /// A bar of 1 x 0.25 x 0.25.
    Beam,
    /// A ring in the xy plane, 1 across, with a tube of diameter 0.3.
    Torus,
    /// A slab of 1 x 1 x 0.2.
    Plate,
    /// A liver: a large right lobe (negative x) tapering to a thin left one, with a hollow below for the gallbladder.
    Liver,
    /// A bunny: a body, a head with two ears, a tail.
    Bunny,
    /// An upright armadillo: thin arms, legs and ears, a long tail, a back full of studs.
    Armadillo,
    /// A toothed wheel with a bore, 1 across and 0.2 high, of twelve teeth.
    Gear,
    /// A ball of diameter 1 around a void: a closed wall of 0.15.
    Shell,
    /// Two bodies: a ball and a cube, both 0.45 across, 0.1 apart.
    Pair,
}

impl Shape {
    /// All shapes.
    pub const ALL: [Self; 11] = [
        Self::Sphere,
        Self::Box,
        Self::Beam,
        Self::Torus,
        Self::Plate,
        Self::Liver,
        Self::Bunny,
        Self::Armadillo,
        Self::Gear,
        Self::Shell,
        Self::Pair,
    ];

    /// Names of all shapes, in the order of [`ALL`](Self::ALL).
    pub const NAMES: [&str; 11] = [
        "sphere",
        "box",
        "beam",
        "torus",
        "plate",
        "liver",
        "bunny",
        "armadillo",
        "gear",
        "shell",
        "pair",
    ];

    /// Parses the name of a shape, in lower case.
    ///
    /// # Errors
    /// [`MeshingError::UnknownShape`] with the known names.
    ///
    /// # Example
    /// ```
    /// use incise_meshing::Shape;
    ///
    /// assert_eq!(Shape::from_name("torus")?, Shape::Torus);
    /// assert!(Shape::from_name("bagel").unwrap_err().to_string().contains("sphere, box, beam"));
    /// # Ok::<(), incise_meshing::MeshingError>(())
    /// ```
    pub fn from_name(name: &str) -> Result<Self, MeshingError> {
        Self::ALL
            .into_iter()
            .find(|shape| shape.name() == name)
            .ok_or_else(|| MeshingError::UnknownShape {
                name: name.to_owned(),
                known: Self::NAMES.join(", "),
            })
    }

    /// Name of the shape, in lower case.
    #[must_use]
    pub const fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }

    /// Distance from the surface in meters, negative inside. Exact for the simple solids; for the liver, the animals
    /// and the gear the sign is exact and the absolute value is at most the distance.
    ///
    /// The values at two points differ by no more than the distance between the points, up to rounding.
    #[must_use]
    pub fn signed_distance(self, p: DVec3) -> f64 {
        match self {
            Self::Sphere => ball(p, 0.5),
            Self::Box | Self::Beam | Self::Plate => cuboid(p, self.half_extent()),
            Self::Torus => torus(p, 0.35, 0.15),
            Self::Liver => liver(p),
            Self::Bunny => bunny(p),
            Self::Armadillo => armadillo(p),
            Self::Gear => gear(p),
            Self::Shell => shell(p),
            Self::Pair => pair(p),
        }
    }

    /// Half the sides of the bounding box, in meters.
    #[must_use]
    pub const fn half_extent(self) -> DVec3 {
        match self {
            Self::Sphere | Self::Box | Self::Shell => DVec3::splat(0.5),
            Self::Beam => DVec3::new(0.5, 0.125, 0.125),
            Self::Torus => DVec3::new(0.5, 0.5, 0.15),
            Self::Plate => DVec3::new(0.5, 0.5, 0.1),
            Self::Liver => DVec3::new(0.5, 0.3, 0.27),
            Self::Bunny => DVec3::new(0.464, 0.272, 0.5),
            Self::Armadillo => DVec3::new(0.369, 0.359, 0.5),
            Self::Gear => DVec3::new(0.5, 0.5, 0.1),
            Self::Pair => DVec3::new(0.5, 0.225, 0.225),
        }
    }

    /// Euler characteristic of the surface: 0 for the torus and the gear, 4 for the two surfaces of the shell and of
    /// the pair, 2 for the others.
    #[must_use]
    pub const fn euler_characteristic(self) -> isize {
        match self {
            Self::Torus | Self::Gear => 0,
            Self::Shell | Self::Pair => 4,
            _ => 2,
        }
    }

    /// Number of pieces: 2 for the pair, 1 for the others.
    #[must_use]
    pub const fn pieces(self) -> usize {
        match self {
            Self::Pair => 2,
            _ => 1,
        }
    }

    /// Smallest number of tets the shape can be generated with, found by experiment: 3,000 for the shell, whose wall
    /// breaks with fewer, 200 for the others.
    ///
    /// All parts of a shape are present from about 2,000 tets for the bunny, 3,000 for the armadillo and 600 for the
    /// gear. With fewer, ears, limbs and teeth may be short or missing; the topology is still correct.
    #[must_use]
    pub const fn smallest_tet_count(self) -> usize {
        match self {
            Self::Shell => 3_000,
            _ => 200,
        }
    }

    /// Volume in m³, to about one percent.
    pub(super) const fn volume(self) -> f64 {
        match self {
            Self::Sphere => 0.52,
            Self::Box => 1.0,
            Self::Beam => 0.0625,
            Self::Torus => 0.1554,
            Self::Plate => 0.2,
            Self::Liver => 0.112,
            Self::Bunny => 0.1281,
            Self::Armadillo => 0.0512,
            Self::Gear => 0.1107,
            Self::Shell => 0.344,
            Self::Pair => 0.1388,
        }
    }
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
