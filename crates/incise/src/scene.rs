//! [`Scene`]: the contents of a scene file.
//!
//! A scene names what it needs; features that it does not name cost nothing. Every key has a documented default, and an
//! unknown key is an error that names the nearest known one. The format is TOML. The structs are the only place that
//! documents keys, with units and ranges: `docs/scene.md` and the JSON Schema are generated from them. All of them are
//! `non_exhaustive`, so that a new key breaks no program: structs start from their defaults and are changed by assignment
//! or `with`, variants have constructors.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Error;

mod attachment;
mod check;
mod collider;
mod contact;
mod cutting;
mod distance;
mod lines;
mod method;
mod preset;
mod region;
mod schema;
mod solver;
mod stroke;
mod substeps;
mod wording;

pub use attachment::{AttachmentSpec, PathRotationSpec};
pub(crate) use check::check;
pub use collider::{ColliderSpec, RotationSpec};
pub use contact::{ContactPairs, ContactSpec};
pub use cutting::CuttingSpec;
pub use distance::{DistanceSpec, EndSpec};
pub use lines::{line_of, location};
use lines::{line_of_message, named};
pub use method::{Integrator, Method, TetSolve};
pub use preset::Preset;
pub use region::Region;
pub use schema::schema;
pub use solver::{Backend, Precision, ReclusterSpec, SleepSpec, SolverSpec};
pub use stroke::{SolidBladeSpec, StrokeSpec};
pub(crate) use stroke::{along, pose};
pub use substeps::Substeps;

use wording::in_scene_words;

pub use crate::names::suggestion;

/// A scene: TOML text, or the defaults with changes.
///
/// ```
/// use incise::Scene;
/// use incise::scene::{BodySpec, Region, ShapeSpec, StrokeSpec};
///
/// let mut scene = Scene::default();
/// scene.world.gravity = Some([0.0, 0.0, -9.81]);
/// scene.solver.substeps = 20.into();
/// scene.body.push(BodySpec::default().with(|body| {
///     body.shape = Some(ShapeSpec::new("beam", 1000));
///     body.fixed = vec![Region::half_space([-0.49, 0.0, 0.0], [-1.0, 0.0, 0.0])];
/// }));
/// scene.stroke.push(StrokeSpec::plane(10, [0.0; 3], [1.0, 0.0, 0.0]));
/// assert_eq!(scene.body[0].young_modulus, 1e5); // a default
/// ```
///
/// ```
/// let scene = incise::Scene::from_toml(
///     r#"
///     [world]
///     gravity = [0.0, 0.0, -9.81]
///
///     [[body]]
///     shape = { kind = "beam", tets = 1000 }
///     young_modulus = 1e5
///     "#,
/// )?;
/// assert_eq!(scene.body.len(), 1);
/// assert_eq!(scene.solver.substeps, incise::scene::Substeps::Auto);
/// # Ok::<(), incise::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Scene {
    /// Reported quantities beside times and counts.
    #[serde(default, skip_serializing_if = "ReportSpec::is_default")]
    pub report: ReportSpec,
    /// Forces and obstacles that act on all bodies.
    #[serde(default)]
    pub world: WorldSpec,
    /// Settings of the solver.
    #[serde(default)]
    pub solver: SolverSpec,
    /// The bodies.
    #[serde(default)]
    pub body: Vec<BodySpec>,
    /// Contact between bodies and their pieces; absent: none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("optional" = true))]
    pub contact: Option<ContactSpec>,
    /// Obstacles.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub collider: Vec<ColliderSpec>,
    /// Parts of bodies that are held or moved.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub attachment: Vec<AttachmentSpec>,
    /// Sutures, springs and rods.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub distance: Vec<DistanceSpec>,
    /// Settings of all cuts.
    #[serde(default, skip_serializing_if = "CuttingSpec::is_default")]
    pub cutting: CuttingSpec,
    /// The cuts.
    #[serde(default)]
    pub stroke: Vec<StrokeSpec>,
}

/// Reported quantities and how often they are computed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ReportSpec {
    /// Frames from one report to the next.
    #[serde(default = "one")]
    #[schemars(range(min = 1))]
    pub every: u64,
    /// Quantities, which cost time only in the frames that report them.
    #[serde(default)]
    pub quantities: Vec<Quantity>,
}

impl ReportSpec {
    fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

impl Default for ReportSpec {
    fn default() -> Self {
        Self {
            every: 1,
            quantities: Vec::new(),
        }
    }
}

/// A quantity that is computed for reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Quantity {
    /// Primal and dual residual of the last substep.
    Residual,
    /// Kinetic, elastic and gravitational energy.
    Energy,
    /// Volume, its error, the smallest volume ratio of a tet and the number of inverted tets.
    Volume,
    /// The largest speed.
    Speed,
    /// Squared Courant number of the substep (see `incise_xpbd::Solver::kappa`) and the tets softened to keep its limit,
    /// in all and by body; in a frame with a cut also the values before it.
    Kappa,
    /// Mean force and torque of the frame on attachments, colliders, the ground, grabs and what fixed particles are fixed
    /// to, and between bodies that touch. Not on a GPU, nor with method `chebyshev`.
    Force,
}

/// Forces and obstacles that act on all bodies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct WorldSpec {
    /// Acceleration of gravity; absent: none.
    #[schemars(extend("unit" = "m/s²"))]
    pub gravity: Option<[f64; 3]>,
    /// A floor; absent: none.
    pub ground: Option<GroundSpec>,
}

/// A horizontal floor; up is z.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct GroundSpec {
    /// Height of the floor.
    #[schemars(extend("unit" = "m"), range(min = -1e9, max = 1e9))]
    pub height: f64,
    /// Coefficient of friction.
    #[serde(default)]
    #[schemars(range(min = 0.0, max = 1e3))]
    pub friction: f64,
}

/// A body: mesh, position and material.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct BodySpec {
    /// A mesh file, relative to the scene file. Either this or `shape`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mesh: Option<PathBuf>,
    /// A generated shape of longest side 1. Either this or `mesh`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shape: Option<ShapeSpec>,
    /// Factor on the mesh's coordinates.
    #[serde(default = "unit")]
    #[schemars(range(min = 1e-9, max = 1e9))]
    pub scale: f64,
    /// Position of the mesh's origin.
    #[serde(default)]
    #[schemars(extend("unit" = "m"))]
    pub position: [f64; 3],
    /// Velocity at the start, of all particles that are not fixed.
    #[serde(default)]
    #[schemars(extend("unit" = "m/s"))]
    pub velocity: [f64; 3],
    /// Young's modulus.
    #[serde(default = "soft")]
    #[schemars(extend("unit" = "Pa"), range(min = 1e-6, max = 1e15))]
    pub young_modulus: f64,
    /// Poisson's ratio.
    #[serde(default = "nearly_incompressible")]
    #[schemars(extend("exclusiveMaximum" = 0.5), range(min = 0.0))]
    pub poisson_ratio: f64,
    /// Mass density.
    #[serde(default = "water")]
    #[schemars(extend("unit" = "kg/m³"), range(min = 1e-6, max = 1e9))]
    pub density: f64,
    /// Damping time τ: a vibration of angular frequency ω is damped by the fraction τω/2 of critical. Moves no equilibrium.
    #[serde(default)]
    #[schemars(extend("unit" = "s"), range(min = 0.0, max = 1e6))]
    pub damping: f64,
    /// Additional volume constraint of each tet: one over a bulk modulus; 0 is incompressible, absent: none.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "1/Pa"), range(min = 0.0, max = 1e9))]
    pub volume_compliance: Option<f64>,
    /// Substeps of this body in place of the solver's. Bodies that are solved together take the largest number of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub substeps: Option<Substeps>,
    /// Particles that do not move.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fixed: Vec<Region>,
    /// Parts with another material.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub material: Vec<MaterialSpec>,
}

/// The material of a part of a body. Absent keys have the body's values.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct MaterialSpec {
    /// The part: tets whose centers at rest lie in any of these regions. Where parts overlap, the last one counts.
    pub regions: Vec<Region>,
    /// Young's modulus.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "Pa"), range(min = 1e-6, max = 1e15))]
    pub young_modulus: Option<f64>,
    /// Poisson's ratio.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMaximum" = 0.5), range(min = 0.0))]
    pub poisson_ratio: Option<f64>,
    /// Mass density.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "kg/m³"), range(min = 1e-6, max = 1e9))]
    pub density: Option<f64>,
    /// Damping time.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("unit" = "s"), range(min = 0.0, max = 1e6))]
    pub damping: Option<f64>,
}

impl Default for BodySpec {
    /// A body without geometry.
    fn default() -> Self {
        Self {
            mesh: None,
            shape: None,
            scale: unit(),
            position: [0.0; 3],
            velocity: [0.0; 3],
            young_modulus: soft(),
            poisson_ratio: nearly_incompressible(),
            density: water(),
            damping: 0.0,
            volume_compliance: None,
            substeps: None,
            fixed: Vec::new(),
            material: Vec::new(),
        }
    }
}

/// A generated shape.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ShapeSpec {
    /// Name of the shape.
    #[schemars(extend("enum" = incise_meshing::Shape::NAMES))]
    pub kind: String,
    /// Wanted number of tets; the result is within 2%.
    #[schemars(range(min = 1))]
    pub tets: usize,
}

impl ShapeSpec {
    /// A shape by name, with about this number of tets.
    #[must_use]
    pub fn new(kind: impl Into<String>, tets: usize) -> Self {
        Self {
            kind: kind.into(),
            tets,
        }
    }
}

impl Default for ShapeSpec {
    /// A box of about 1000 tets.
    fn default() -> Self {
        Self::new("box", 1000)
    }
}

/// Gives each struct of a scene the method `with`.
macro_rules! with {
    ($($name:ident),*) => {$(
        impl $name {
            /// Returns the value after a change of its fields. The struct is `non_exhaustive`, so that a program still
            /// compiles when a key is added; other crates change a default instead of naming all fields.
            #[must_use]
            pub fn with(mut self, change: impl FnOnce(&mut Self)) -> Self {
                change(&mut self);
                self
            }
        }
    )*};
}

with!(
    Scene,
    ReportSpec,
    WorldSpec,
    GroundSpec,
    BodySpec,
    MaterialSpec,
    ShapeSpec,
    AttachmentSpec,
    PathRotationSpec,
    RotationSpec,
    ContactSpec,
    CuttingSpec,
    DistanceSpec,
    EndSpec,
    SolverSpec,
    ReclusterSpec,
    SleepSpec,
    SolidBladeSpec
);

impl Scene {
    /// The built-in scene: a generated liver held at one side, sliced by a moving blade.
    ///
    /// # Panics
    /// Never: a test reads it.
    #[must_use]
    pub fn built_in() -> Self {
        Self::from_toml(include_str!("../scenes/liver.toml")).expect("the built-in scene is valid")
    }

    /// Reads a scene from a file; paths of mesh files are relative to the file.
    ///
    /// # Errors
    /// If the file cannot be read or is not a valid scene.
    pub fn load(path: &Path) -> Result<Self, Error> {
        let text = std::fs::read_to_string(path).map_err(|source| Error::Read {
            path: path.to_owned(),
            source,
        })?;
        let mut scene = Self::from_toml(&text)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        for mesh in scene.body.iter_mut().filter_map(|body| body.mesh.as_mut()) {
            *mesh = folder.join(&mesh);
        }
        Ok(scene)
    }

    /// Reads a scene from TOML.
    ///
    /// # Errors
    /// If it is not valid TOML, or a key is unknown or of the wrong type: the message names the line and, for an
    /// unknown key, the nearest known one.
    pub fn from_toml(text: &str) -> Result<Self, Error> {
        let mut scene: Self = toml::from_str(text).map_err(|error| {
            let message = error.message();
            let line = error
                .span()
                .map(|span| line_of_message(text, span.start, message));
            let named = error.span().map(|span| named(text, span));
            Error::Parse {
                line,
                message: in_scene_words(message, named.unwrap_or_default()),
            }
        })?;
        scene.solver = scene.solver.with_defaults(text)?;
        Ok(scene)
    }

    /// The scene as TOML.
    ///
    /// # Errors
    /// If a path in it is not valid UTF-8.
    pub fn to_toml(&self) -> Result<String, Error> {
        toml::to_string(self).map_err(|error| Error::Parse {
            line: None,
            message: error.to_string(),
        })
    }

    /// Returns the first frame after all strokes and attachments.
    #[must_use]
    pub fn frames_needed(&self) -> u64 {
        let strokes = self.stroke.iter().map(StrokeSpec::last_frame);
        let attachments = self
            .attachment
            .iter()
            .map(|attachment| attachment.frames[1]);
        strokes
            .chain(attachments)
            .map(|last| last.saturating_add(1))
            .max()
            .unwrap_or(0)
    }
}

fn one() -> u64 {
    1
}
fn unit() -> f64 {
    1.0
}
fn soft() -> f64 {
    1e5
}
fn nearly_incompressible() -> f64 {
    0.45
}
fn water() -> f64 {
    1000.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn built_in_scene_survives_a_round_trip() {
        let scene = Scene::built_in();
        assert_eq!(Scene::from_toml(&scene.to_toml().unwrap()).unwrap(), scene);
    }
}
