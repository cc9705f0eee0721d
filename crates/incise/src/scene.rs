//! [`Scene`]: what is simulated, as written in a scene file.
//!
//! A scene names what it needs; what it does not name is not computed. Every key has a documented default, unknown
//! keys are errors that name the nearest known one. The format is TOML; the structs are the documentation of its keys.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::Error;

mod attachment;
mod check;
mod collider;
mod distance;
mod lines;
mod method;
mod preset;
mod region;
mod solver;
mod stroke;
mod substeps;

pub use attachment::{AttachmentSpec, PathRotationSpec};
pub(crate) use check::check;
pub use collider::{ColliderSpec, RotationSpec};
pub use distance::{DistanceSpec, EndSpec};
pub use lines::line_of;
pub use method::{Integrator, Method, TetSolve};
pub use preset::Preset;
pub use region::Region;
pub use solver::{Backend, Precision, ReclusterSpec, SleepSpec, SolverSpec};
pub use stroke::StrokeSpec;
pub(crate) use stroke::{along, pose};
pub use substeps::Substeps;

/// A scene.
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
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// What is reported beside times and counts.
    #[serde(default, skip_serializing_if = "ReportSpec::is_default")]
    pub report: ReportSpec,
    /// What acts on all bodies.
    #[serde(default)]
    pub world: WorldSpec,
    /// How it is computed.
    #[serde(default)]
    pub solver: SolverSpec,
    /// The bodies.
    #[serde(default)]
    pub body: Vec<BodySpec>,
    /// Obstacles.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub collider: Vec<ColliderSpec>,
    /// What holds parts of bodies and moves them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub attachment: Vec<AttachmentSpec>,
    /// Sutures and springs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub distance: Vec<DistanceSpec>,
    /// The cuts.
    #[serde(default)]
    pub stroke: Vec<StrokeSpec>,
}

/// What is reported, and how often.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReportSpec {
    /// Every how many frames, at least 1.
    #[serde(default = "one")]
    pub every: u64,
    /// Which quantities; they cost time only in the frames that report them.
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

/// Something to report that has to be computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Quantity {
    /// Primal and dual residual of the last substep.
    Residual,
    /// Kinetic, elastic and gravitational energy.
    Energy,
    /// Volume, its error, the smallest volume ratio of a tet and the number of inverted tets.
    Volume,
    /// The largest speed.
    Speed,
    /// The control number of the substep (see `incise_xpbd::Solver::kappa`) and what was softened to keep its limit, for
    /// all and by body, and in a frame with a cut also as it was before.
    Kappa,
}

/// What acts on all bodies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorldSpec {
    /// Acceleration in m/s²; absent: none.
    pub gravity: Option<[f64; 3]>,
    /// A floor; absent: none.
    pub ground: Option<GroundSpec>,
}

/// A horizontal floor; up is z.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GroundSpec {
    /// Its height in m.
    pub height: f64,
    /// Coefficient of friction.
    #[serde(default)]
    pub friction: f64,
}

/// A body: its mesh, where it is and what it is made of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodySpec {
    /// A mesh file, relative to the scene file. Either this or `shape`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mesh: Option<PathBuf>,
    /// A generated shape of longest side 1. Either this or `mesh`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shape: Option<ShapeSpec>,
    /// Factor on the mesh's coordinates.
    #[serde(default = "unit")]
    pub scale: f64,
    /// Where the mesh's origin goes, in m.
    #[serde(default)]
    pub position: [f64; 3],
    /// Young's modulus in Pa.
    #[serde(default = "soft")]
    pub young_modulus: f64,
    /// Poisson's ratio, at least 0 and below 0.5.
    #[serde(default = "nearly_incompressible")]
    pub poisson_ratio: f64,
    /// Mass density in kg/m³.
    #[serde(default = "water")]
    pub density: f64,
    /// Damping time in s: see `incise_xpbd::Material::damping`.
    #[serde(default)]
    pub damping: f64,
    /// Keeps the volume of each tet beyond what the material does: one over a bulk modulus, in 1/Pa; 0 is
    /// incompressible. Absent: not at all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume_compliance: Option<f64>,
    /// Substeps of this body in place of the solver's. Bodies that are solved together take the largest number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub substeps: Option<Substeps>,
    /// Particles that do not move, in m in the world.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fixed: Vec<Region>,
    /// Parts of another material.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub material: Vec<MaterialSpec>,
}

/// The material of a part of a body. What it does not name is that of the body.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialSpec {
    /// The part: the tets at rest whose centers lie in any of these regions, in m in the world. Where parts overlap, the
    /// last one counts.
    pub regions: Vec<Region>,
    /// Young's modulus in Pa.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub young_modulus: Option<f64>,
    /// Poisson's ratio, at least 0 and below 0.5.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub poisson_ratio: Option<f64>,
    /// Mass density in kg/m³.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub density: Option<f64>,
    /// Damping time in s.
    #[serde(skip_serializing_if = "Option::is_none")]
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShapeSpec {
    /// `box`, `beam`, `sphere`, `torus`, `plate`, `liver`, `bunny`, `armadillo`, `gear`, `shell` or `pair`.
    pub kind: String,
    /// Wanted number of tets; the result is within 2%.
    pub tets: usize,
}

impl Scene {
    /// The built-in scene: a generated liver held at one side, sliced by a moving blade.
    ///
    /// # Panics
    /// Never: a test reads it.
    #[must_use]
    pub fn built_in() -> Self {
        Self::from_toml(include_str!("../scenes/liver.toml")).expect("the built-in scene is valid")
    }

    /// Reads a scene from a file; mesh files named in it are relative to it.
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
            let line = error
                .span()
                .map(|span| text[..span.start.min(text.len())].matches('\n').count() + 1);
            Error::Parse {
                line,
                message: with_suggestion(error.message()),
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

    /// The first frame after all strokes and handles.
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

/// Adds the nearest known name to a message that lists what is known.
fn with_suggestion(message: &str) -> String {
    let message = message.trim_end().replace('\n', " ");
    let (unknown, known): (&str, Vec<&str>) =
        if let Some(names) = message.strip_prefix("unexpected keys in table: ") {
            // As of a table with one of several sets of keys: `unexpected keys in table: a, available keys: b, c`.
            let (unknown, known) = names
                .split_once(", available keys: ")
                .unwrap_or((names, ""));
            let first = unknown.split(", ").next().unwrap_or(unknown);
            (first, known.split(", ").collect())
        } else if message.starts_with("unknown") {
            // As in ``unknown field `a`, expected `b` or `c` ``.
            let mut names = message.split('`').skip(1).step_by(2);
            match names.next() {
                Some(unknown) => (unknown, names.collect()),
                None => return message,
            }
        } else {
            return message;
        };
    match nearest(unknown, known.into_iter().filter(|name| !name.is_empty())) {
        Some(name) => format!("unknown key or value '{unknown}': did you mean '{name}'?"),
        None => format!("unknown key or value '{unknown}'"),
    }
}

/// The known name most like `unknown`.
#[must_use]
pub fn nearest<'a>(unknown: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let likeness = |name: &&str| strsim::jaro_winkler(unknown, name);
    known
        .into_iter()
        .max_by(|a, b| likeness(a).total_cmp(&likeness(b)))
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

    #[test]
    fn unknown_keys_name_the_nearest() {
        let message = |text: &str| Scene::from_toml(text).unwrap_err().to_string();
        assert_eq!(
            message("[world]\ngravty = [0, 0, 0]"),
            "line 2: unknown key or value 'gravty': did you mean 'gravity'?"
        );
        assert!(message("[solver]\nmethod = \"gaus-seidel\"").contains("'gauss-seidel'"));
        assert!(message("[[stroke]]\nkind = \"plain\"").contains("'plane'"));
        assert!(message("[[body]]\nfixed = [{ halfspace = {} }]").contains("'half_space'"));
        assert!(
            message(
                "[[stroke]]\nkind = \"plane\"\nframe = 1\npoint=[0,0,0]\nnormal=[0,0,1]\nsnp=1"
            )
            .contains("'snap'")
        );
        assert!(message("[world\n").starts_with("line 1: "));
    }
}
