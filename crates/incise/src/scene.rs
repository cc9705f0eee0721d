//! [`Scene`]: what is simulated, as written in a scene file.
//!
//! A scene names what it needs; what it does not name is not computed. Every key has a documented default, unknown
//! keys are errors that name the nearest known one. The format is TOML; the structs are the documentation of its keys.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::Error;
pub use crate::collider::{ColliderSpec, RotationSpec};
pub use crate::handle::{HandleSpec, TurnSpec};
pub use crate::link::{EndSpec, LinkSpec};
pub use crate::method::{Integrator, Method, TetSolve};
pub use crate::place::Backend;
pub use crate::preset::Preset;
pub use crate::recluster::ReclusterSpec;
pub use crate::region::Region;
pub use crate::sleep::SleepSpec;
pub use crate::stroke_spec::StrokeSpec;
pub use crate::substeps::Substeps;

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
    pub handle: Vec<HandleSpec>,
    /// Sutures and springs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub link: Vec<LinkSpec>,
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

/// How it is computed.
///
/// Some defaults depend on the method: see [`SolverSpec::of`]. Those and a preset's are applied when a scene is read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SolverSpec {
    /// Other defaults for the keys below: `paper`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub preset: Option<Preset>,
    /// Time of a frame in s.
    pub time_step: f64,
    /// The largest error wanted, as a fraction of the motion, above 0 and at most 1; absent: 0.1. Decides what
    /// `substeps = "auto"` and `method = "auto"` take, and, if given, ends the rounds of two-level VBD.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accuracy: Option<f64>,
    /// The time in ms that a frame may take on this machine, positive; absent: no limit. Substeps that are chosen, and the
    /// method, are fitted to it: with `accuracy` no more than that needs, without it as many as fit. Runs then differ from
    /// each other. Not on a GPU.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub budget_ms: Option<f64>,
    /// Equal parts of a frame: a number, or `auto`, which chooses for each body by the accuracy.
    pub substeps: Substeps,
    /// The most substeps that `auto` takes.
    pub max_substeps: u32,
    /// Passes over the constraints in a substep, or sweeps of VBD. With Gauss-Seidel 1 is what converges.
    pub iterations: u32,
    /// How a substep is solved: `auto`, `gauss-seidel`, `jacobi`, `chebyshev` or `vbd`.
    pub method: Method,
    /// How the elastic energy of a tet is solved. VBD has no constraints.
    pub tet_solve: TetSolve,
    /// Factor on each correction.
    pub relaxation: f64,
    /// For Chebyshev: the spectral radius of the Jacobi iteration, from 0 to below 1: the larger, the bolder. At 0.99
    /// the weights tend to 1.75, which they reach in some ten iterations; more pays only with hundreds of them.
    pub spectral_radius: f64,
    /// For Chebyshev: plain iterations before the first extrapolation, at least 1. They damp what extrapolation would
    /// blow up.
    pub delay: u32,
    /// For VBD: whether each sweep is followed by a correction of the whole body, which costs some 100 sweeps.
    #[serde(skip_serializing_if = "is_false")]
    pub two_level: bool,
    /// For VBD: how a substep advances in time, `bdf2` or `implicit-euler`.
    #[serde(skip_serializing_if = "Integrator::is_default")]
    pub integrator: Integrator,
    /// How constraints are put together: `none` or `serial:K`.
    pub clustering: String,
    /// Whether clusters that a cut leaves small are merged with neighbors. It makes a cut a little dearer, and all frames
    /// after many cuts cheaper; without it clusters shrink and colors grow with every cut, as in the paper.
    #[serde(skip_serializing_if = "is_true")]
    pub merge_clusters: bool,
    /// When clusters and colors that many cuts have worn are made anew, in the background; absent: never.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recluster: Option<ReclusterSpec>,
    /// How clusters are colored, by the name of an [`Algorithm`](incise_coloring::Algorithm). Clusters that cuts make are
    /// colored one by one, until they need more colors than they should; then all are colored anew, with `auto`.
    pub coloring: String,
    /// Width of the numbers.
    pub precision: Precision,
    /// Where it is computed: `cpu`, `gpu` or `auto`. On a GPU clusters of up to 32 tets are a thread's work each, larger
    /// ones, up to 256, that of a workgroup.
    #[serde(skip_serializing_if = "Backend::is_cpu")]
    pub backend: Backend,
    /// Largest kappa of a tet, positive: stiffer ones, as cuts leave them, are softened to it. `inf`, the default,
    /// softens none.
    pub kappa_limit: f64,
    /// Bodies at rest are not solved until they are cut or something moves them; absent: all are always solved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sleep: Option<SleepSpec>,
}

impl Default for SolverSpec {
    fn default() -> Self {
        Self {
            preset: None,
            time_step: 0.016,
            accuracy: None,
            budget_ms: None,
            substeps: Substeps::Auto,
            max_substeps: 200,
            iterations: 1,
            method: Method::Auto,
            tet_solve: TetSolve::Split,
            relaxation: 1.0,
            spectral_radius: 0.99,
            delay: 10,
            two_level: false,
            integrator: Integrator::Bdf2,
            clustering: "serial:10".to_owned(),
            merge_clusters: true,
            recluster: None,
            coloring: "auto".to_owned(),
            precision: Precision::Auto,
            backend: Backend::Cpu,
            kappa_limit: f64::INFINITY,
            sleep: None,
        }
    }
}

/// Width of the numbers the solver computes with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Precision {
    /// Single on a GPU and wherever the substep is long enough for it, else double; double also where `method = "auto"`
    /// takes VBD.
    #[default]
    Auto,
    /// Single: 32 bits.
    F32,
    /// Double: 64 bits.
    F64,
}

impl Precision {
    /// The name as written in a scene.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }
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
        let handles = self.handle.iter().map(|handle| handle.frames[1]);
        strokes
            .chain(handles)
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

fn is_false(flag: &bool) -> bool {
    !flag
}
fn is_true(flag: &bool) -> bool {
    *flag
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
