//! Scenes of the accuracy measurements: typical user scenes that Newton's method can solve too.
//!
//! A hanging beam bends far, at three of Poisson's ratios; a bar is twisted by a handle; a liver is pressed by a handle
//! (prescribed motion in place of contact, which the reference does not support); a liver opens along a plane cut made
//! before it moves; a stiff beam is stitched to a soft one. Frames are 1/60 s.

use std::fmt::Write;
use std::path::Path;

use anyhow::{Context, ensure};
use incise::Scene;
use incise::mesh::glam::DVec3;
use incise::mesh::kuhn_box;
use incise::mesh_io;

/// A measured scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Poisson's ratio in thousandths.
    HangingBeam(u32),
    TwistedBar,
    PressedLiver,
    CutLiver,
    Bilayer,
}

impl Kind {
    pub(super) const ALL: [Self; 7] = [
        Self::HangingBeam(300),
        Self::HangingBeam(450),
        Self::HangingBeam(490),
        Self::TwistedBar,
        Self::PressedLiver,
        Self::CutLiver,
        Self::Bilayer,
    ];

    /// Cell id of the scene.
    pub(super) fn id(self) -> String {
        match self {
            Self::HangingBeam(ratio) => format!("hanging-beam-0.{ratio}"),
            Self::TwistedBar => "twisted-bar".to_owned(),
            Self::PressedLiver => "pressed-liver".to_owned(),
            Self::CutLiver => "cut-liver".to_owned(),
            Self::Bilayer => "bilayer".to_owned(),
        }
    }

    /// Description as a sentence without its period.
    pub(super) fn title(self) -> String {
        match self {
            Self::HangingBeam(ratio) => {
                let ratio = f64::from(ratio) / 1000.0;
                format!("Hanging beam of E = 1e6 Pa and Poisson's ratio {ratio}, held at one end")
            }
            Self::TwistedBar => {
                "Bar of E = 3e5 Pa, twisted by 90 degrees by a handle, no gravity".to_owned()
            }
            Self::PressedLiver => {
                "Liver of 25 cm and E = 1e4 Pa that lies on held particles, pressed in by a handle"
                    .to_owned()
            }
            Self::CutLiver => {
                "Liver of 25 cm and E = 1e4 Pa, held at one side, cut by a plane before it falls"
                    .to_owned()
            }
            Self::Bilayer => {
                "Beam of E = 1e6 Pa, held at one end, stitched to one of 1e4 Pa below it".to_owned()
            }
        }
    }

    /// Scene; meshes and scene file are stored in a folder, so that `incise advise` can run on them.
    pub(super) fn scene(self, folder: &Path, quick: bool) -> anyhow::Result<Scene> {
        let mut text = "[solver]\ntime_step = 0.016666666666666666\n".to_owned();
        if self != Self::TwistedBar {
            text += "[world]\ngravity = [0.0, 0.0, -9.81]\n";
        }
        let held = "fixed = [{ half_space = { point = [0, 0, 0], normal = [-1, 0, 0] } }]\n";
        let cells = if quick { 2 } else { 4 };
        match self {
            Self::HangingBeam(ratio) => {
                text += &body(folder, "beam", [4 * cells, cells, cells], 0.25, quick, 1e6)?;
                write!(text, "poisson_ratio = 0.{ratio}\n{held}")?;
            }
            Self::TwistedBar => {
                text += &body(folder, "beam", [4 * cells, cells, cells], 0.25, quick, 3e5)?;
                let frames = frames(quick) * 4 / 5;
                write!(
                    text,
                    "poisson_ratio = 0.3\n{held}\
                     [[attachment]]\nregions = [{{ half_space = {{ point = [1, 0, 0], normal = [1, 0, 0] }} }}]\n\
                     frames = [0, {frames}]\npath = [[0, 0, 0], [0, 0, 0]]\n\
                     rotation = {{ axis = [1, 0, 0], angle_degrees = 90, center = [1, 0.125, 0.125] }}\n"
                )?;
            }
            Self::PressedLiver => {
                text += &liver(quick);
                let frames = frames(quick) * 4 / 5;
                write!(
                    text,
                    "fixed = [{{ half_space = {{ point = [0, 0, -0.03], normal = [0, 0, -1] }} }}]\n\
                     [[attachment]]\nregions = [{{ half_space = {{ point = [0, 0, 0.05], normal = [0, 0, 1] }} }}]\n\
                     frames = [0, {frames}]\npath = [[0, 0, 0], [0, 0, -0.02]]\n"
                )?;
            }
            Self::CutLiver => {
                text += &liver(quick);
                text += "fixed = [{ half_space = { point = [-0.03, 0, 0], normal = [-1, 0, 0] } }]\n\
                         [[stroke]]\nkind = \"rectangle\"\nframe = 0\ncenter = [0.02, 0, 0.15]\n\
                         half_u = [0, 0.3, 0]\nhalf_v = [0, 0, 0.15]\n";
            }
            Self::Bilayer => text += &bilayer(folder, quick)?,
        }
        std::fs::write(folder.join(format!("{}.toml", self.id())), &text)?;
        let path = folder.join(format!("{}.toml", self.id()));
        Ok(Scene::load(&path)?)
    }
}

/// Number of measured frames.
pub(super) fn frames(quick: bool) -> u32 {
    if quick { 5 } else { 30 }
}

/// Beam of 1 m, `thickness` high and 0.25 m deep, starting at the origin; its mesh is written to the folder.
fn body(
    folder: &Path,
    name: &str,
    cells: [usize; 3],
    thickness: f64,
    quick: bool,
    young_modulus: f64,
) -> anyhow::Result<String> {
    let mesh = kuhn_box(cells, DVec3::new(1.0, 0.25, thickness));
    let name = format!("{name}{}.vtk", if quick { "-quick" } else { "" });
    let path = folder.join(&name);
    mesh_io::write(&path, &mesh).with_context(|| path.display().to_string())?;
    Ok(format!(
        "[[body]]\nmesh = \"{name}\"\nyoung_modulus = {young_modulus:e}\n"
    ))
}

fn liver(quick: bool) -> String {
    let tets = if quick { 500 } else { 2500 };
    format!(
        "[[body]]\nshape = {{ kind = \"liver\", tets = {tets} }}\nscale = 0.25\nyoung_modulus = 1e4\n\
         poisson_ratio = 0.45\ndensity = 1050.0\n"
    )
}

/// A stiff layer on a soft one, each half as high as the beam; coincident particles are stitched together.
fn bilayer(folder: &Path, quick: bool) -> anyhow::Result<String> {
    let n = if quick { 2 } else { 4 };
    let cells = [4 * n, n, n / 2];
    let held = "poisson_ratio = 0.3\nfixed = [{ half_space = { point = [0, 0, 0], normal = [-1, 0, 0] } }]\n";
    let layer = |young_modulus| body(folder, "layer", cells, 0.125, quick, young_modulus);
    let mut text = format!(
        "{}{held}{}{held}position = [0, 0, 0.125]\n",
        layer(1e4)?,
        layer(1e6)?
    );
    let mesh = kuhn_box(cells, DVec3::new(1.0, 0.25, 0.125));
    let mut stitches = 0;
    for x in mesh.positions.iter().filter(|x| x.z == 0.125 && x.x > 0.0) {
        let point = format!("[{:?}, {:?}, {:?}]", x.x, x.y, x.z);
        write!(
            text,
            "[[distance]]\nfrom = {{ body = 0, point = {point} }}\nto = {{ body = 1, point = {point} }}\n"
        )?;
        stitches += 1;
    }
    ensure!(stitches > 0, "the layers do not meet");
    Ok(text)
}
