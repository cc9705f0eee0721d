//! Stacks and piles in other systems: where their bodies are in the end, measured as ours are.
//!
//! A script for each system (`xtask/peers`) reads bodies, planes and settings from a JSON file, runs the scene and writes the
//! positions at the end. Depth is measured here, for this solver too: a vertex of one body inside a tet of another one is
//! as deep as it is far from that body's surface. Each vertex is compared with all tets of the other bodies, O(n²).

use std::path::Path;
use std::process::Command;

use anyhow::{Context, ensure};
use incise::mesh::glam::{DMat3, DVec3};
use incise::mesh::{TetMesh, TriangleSurface, closest_on_triangle};
use incise::scene::{ColliderSpec, ContactSpec};
use incise::{Body, Simulation, SimulationBuilder};
use serde::{Deserialize, Serialize};

use crate::experiment::Table;

/// Another system with one choice of settings: those that it recommends, or the best of those that were tried.
#[derive(Clone, Copy, Debug)]
pub(super) struct Peer {
    pub(super) id: &'static str,
    /// The Python module that it is.
    module: &'static str,
    /// The script that runs a scene; it imports [`COMMON`].
    script: &'static str,
    choice: &'static str,
}

const COMMON: &str = include_str!("../../peers/common.py");
const PBAT: &str = include_str!("../../peers/contact_pbat.py");
const NEWTON: &str = include_str!("../../peers/contact_newton.py");

pub(super) const PEERS: [Peer; 4] = [
    Peer::new("newton-recommended", "newton", NEWTON, "recommended"),
    Peer::new("newton-best", "newton", NEWTON, "best"),
    Peer::new("pbat-recommended", "pbatoolkit", PBAT, "recommended"),
    Peer::new("pbat-best", "pbatoolkit", PBAT, "best"),
];

impl Peer {
    const fn new(
        id: &'static str,
        module: &'static str,
        script: &'static str,
        choice: &'static str,
    ) -> Self {
        Self {
            id,
            module,
            script,
            choice,
        }
    }
}

/// A half-space, whose normal points to the free side.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Plane {
    point: DVec3,
    normal: DVec3,
    /// Other systems have one friction for all.
    #[serde(skip)]
    friction: f64,
}

impl Plane {
    pub(super) const fn new(point: DVec3, normal: DVec3, friction: f64) -> Self {
        Self {
            point,
            normal,
            friction,
        }
    }
}

/// A scene of equal bodies of one material above planes.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Scene {
    #[serde(skip)]
    pub(super) name: String,
    /// At rest, where they start.
    #[serde(serialize_with = "bodies")]
    pub(super) bodies: Vec<TetMesh>,
    pub(super) planes: Vec<Plane>,
    pub(super) young_modulus: f64,
    pub(super) poisson_ratio: f64,
    pub(super) density: f64,
    /// Of this solver only; the scripts choose their own.
    #[serde(skip)]
    pub(super) damping: f64,
    /// Between bodies; in other systems at planes, too.
    pub(super) friction: f64,
    pub(super) gravity: DVec3,
    /// Of a frame, in s.
    pub(super) time_step: f64,
    pub(super) substeps: u32,
    pub(super) frames: u32,
    /// Mean edges by which the center of a body moves at most, if the bodies do not fly apart.
    #[serde(skip)]
    pub(super) farthest: f64,
}

impl Scene {
    /// The scene for this solver.
    pub(super) fn builder(&self) -> SimulationBuilder {
        let mut builder = Simulation::builder();
        let solver = super::solver(self.substeps);
        builder
            .gravity(self.gravity)
            .solver(solver.with(|spec| spec.time_step = self.time_step));
        for mesh in &self.bodies {
            builder.add_body(
                Body::new(mesh.clone())
                    .young_modulus(self.young_modulus)
                    .poisson_ratio(self.poisson_ratio)
                    .density(self.density)
                    .damping(self.damping),
            );
        }
        for plane in &self.planes {
            let collider = ColliderSpec::plane(plane.point.to_array(), plane.normal.to_array());
            builder.add_collider(collider.with_friction(plane.friction));
        }
        builder.contact(ContactSpec::default().with(|spec| spec.friction = self.friction));
        builder
    }
}

/// Bodies as lists of positions and of corners.
fn bodies<S: serde::Serializer>(bodies: &[TetMesh], serializer: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct Listed<'a> {
        positions: &'a [DVec3],
        tets: Vec<[u32; 4]>,
    }
    serializer.collect_seq(bodies.iter().map(|mesh| Listed {
        positions: &mesh.positions,
        tets: mesh.tets.iter().map(|tet| tet.map(|p| p.0)).collect(),
    }))
}

/// What a script writes.
#[derive(Debug, Deserialize)]
struct Outcome {
    system: String,
    settings: String,
    positions: Vec<Vec<DVec3>>,
}

/// The end of a scene in a system.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct End {
    scene: String,
    system: String,
    settings: String,
    /// The deepest vertex in another body, in mean edges of the surface at rest, and the number of such vertices.
    depth: f64,
    inside: usize,
    /// The least distance of a vertex that is in no other body from one, in mean edges.
    gap: f64,
    /// The most that the center of a body moved, in mean edges.
    moved: f64,
    /// Bodies are farther from where they started than they can be if they stay together.
    apart: bool,
    /// Why there is none of it.
    missing: Option<String>,
}

impl End {
    fn of(scene: &Scene, outcome: &Outcome) -> anyhow::Result<Self> {
        ensure!(
            outcome.positions.len() == scene.bodies.len(),
            "the script returned {} bodies of {}",
            outcome.positions.len(),
            scene.bodies.len()
        );
        let edge = mean_edge(&scene.bodies[0]);
        let mut moved = Vec::new();
        let mut farthest = 0.0_f64;
        for (mesh, positions) in scene.bodies.iter().zip(&outcome.positions) {
            ensure!(
                positions.len() == mesh.positions.len(),
                "the script returned {} positions of {}",
                positions.len(),
                mesh.positions.len()
            );
            ensure!(
                positions.iter().all(|x| x.is_finite()),
                "positions are not finite at the end"
            );
            let center = |x: &[DVec3]| x.iter().sum::<DVec3>() / x.len() as f64;
            farthest = farthest.max(center(positions).distance(center(&mesh.positions)));
            moved.push(TetMesh {
                positions: positions.clone(),
                ..mesh.clone()
            });
        }
        let Overlap {
            deepest,
            inside,
            gap,
        } = overlap(&moved);
        Ok(Self {
            scene: scene.name.clone(),
            system: outcome.system.clone(),
            settings: outcome.settings.clone(),
            depth: deepest / edge,
            inside,
            gap: gap / edge,
            moved: farthest / edge,
            apart: farthest / edge > scene.farthest,
            missing: None,
        })
    }
}

/// Runs a scene in another system.
pub(super) fn run(peer: &Peer, scene: &Scene, python: &Path) -> End {
    outcome(peer, scene, python)
        .and_then(|outcome| End::of(scene, &outcome))
        .unwrap_or_else(|error| End {
            scene: scene.name.clone(),
            system: peer.module.to_owned(),
            settings: peer.choice.to_owned(),
            depth: 0.0,
            inside: 0,
            gap: 0.0,
            moved: 0.0,
            apart: false,
            missing: Some(format!("{error:#}")),
        })
}

fn outcome(peer: &Peer, scene: &Scene, python: &Path) -> anyhow::Result<Outcome> {
    let folder = tempfile::tempdir()?;
    let [script, input, output] =
        ["script.py", "in.json", "out.json"].map(|name| folder.path().join(name));
    std::fs::write(folder.path().join("common.py"), COMMON)?;
    std::fs::write(&script, peer.script)?;
    std::fs::write(&input, serde_json::to_string(scene)?)?;
    let run = Command::new(python)
        .args([&script, &input, &output])
        .arg(peer.choice)
        .output()
        .with_context(|| format!("{} cannot be run", python.display()))?;
    let message = String::from_utf8_lossy(&run.stderr);
    ensure!(
        run.status.success(),
        "{}",
        message.lines().last().unwrap_or("no message")
    );
    let text = std::fs::read_to_string(&output)?;
    serde_json::from_str(&text).context("the script wrote something else")
}

/// Runs a scene in this solver.
pub(super) fn ours(scene: &Scene) -> anyhow::Result<End> {
    let mut simulation = scene.builder().build()?;
    for _ in 0..scene.frames {
        simulation.step()?;
    }
    let mut rest = simulation.positions();
    let mut positions = Vec::new();
    for mesh in &scene.bodies {
        let (of_body, others) = rest.split_at(mesh.positions.len());
        positions.push(of_body.to_vec());
        rest = others;
    }
    let outcome = Outcome {
        system: "incise".to_owned(),
        settings: "as above, without thickness".to_owned(),
        positions,
    };
    End::of(scene, &outcome)
}

/// Mean length of the edges of a surface.
pub(super) fn mean_edge(mesh: &TetMesh) -> f64 {
    let surface = TriangleSurface::boundary_of(mesh);
    let lengths = surface.triangles.iter().flat_map(|corners| {
        let [a, b, c] = corners.map(|p| surface.positions[p.index()]);
        [a.distance(b), b.distance(c), c.distance(a)]
    });
    lengths.sum::<f64>() / (3 * surface.triangles.len()) as f64
}

/// How bodies lie to each other.
struct Overlap {
    /// Depth in m of the deepest vertex of a body in another one.
    deepest: f64,
    /// Number of vertices in another body.
    inside: usize,
    /// The least distance in m of another vertex from a body that is not its own.
    gap: f64,
}

fn overlap(bodies: &[TetMesh]) -> Overlap {
    let surfaces: Vec<_> = bodies.iter().map(TriangleSurface::boundary_of).collect();
    let mut overlap = Overlap {
        deepest: 0.0,
        inside: 0,
        gap: f64::INFINITY,
    };
    for (i, body) in bodies.iter().enumerate() {
        for x in &body.positions {
            let mut depth = None;
            for (j, (other, surface)) in bodies.iter().zip(&surfaces).enumerate() {
                if j == i {
                    continue;
                }
                let distance = distance(surface, *x);
                if contains(other, *x) {
                    depth = Some(depth.map_or(distance, |deeper: f64| deeper.max(distance)));
                } else {
                    overlap.gap = overlap.gap.min(distance);
                }
            }
            if let Some(depth) = depth {
                overlap.deepest = overlap.deepest.max(depth);
                overlap.inside += 1;
            }
        }
    }
    overlap
}

/// Whether a point lies strictly inside a tet.
fn contains(mesh: &TetMesh, x: DVec3) -> bool {
    mesh.tets.iter().any(|tet| {
        let [a, b, c, d] = tet.map(|p| mesh.positions[p.index()]);
        let weights = DMat3::from_cols(b - a, c - a, d - a).inverse() * (x - a);
        weights.min_element() > 0.0 && weights.element_sum() < 1.0
    })
}

/// The distance from a surface.
fn distance(surface: &TriangleSurface, x: DVec3) -> f64 {
    let triangles = surface.triangles.iter();
    let distances = triangles.map(|corners| {
        let corners = corners.map(|p| surface.positions[p.index()]);
        closest_on_triangle(corners, x).point.distance(x)
    });
    distances.fold(f64::INFINITY, f64::min)
}

/// The table of all ends.
pub(super) fn table<'a>(ends: impl Iterator<Item = &'a End>) -> Table {
    let mut table = Table::new(
        "Stack and pile in other systems: at the end, vertices of a body inside another one",
        [
            "scene",
            "system",
            "settings",
            "deepest, in mean edges",
            "vertices inside",
            "least distance of others, in mean edges",
            "farthest that a center moved, in mean edges",
        ],
    );
    for end in ends {
        let mut cells = vec![end.scene.clone(), end.system.clone()];
        match &end.missing {
            Some(why) => {
                cells.push(format!("{}: {why}", end.settings));
                cells.extend(["-"; 4].map(str::to_owned));
            }
            // Bodies that lie about have no depth to compare.
            None if end.apart => {
                cells.push(end.settings.clone());
                cells.extend(["fell apart", "-", "-"].map(str::to_owned));
                cells.push(format!("{:.2}", end.moved));
            }
            None => cells.extend([
                end.settings.clone(),
                format!("{:.3}%", 100.0 * end.depth),
                end.inside.to_string(),
                format!("{:.2}%", 100.0 * end.gap),
                format!("{:.2}", end.moved),
            ]),
        }
        table.push(cells);
    }
    table
}

#[cfg(test)]
mod tests {
    use incise::mesh::glam::dvec3;
    use incise::mesh::kuhn_box;

    use super::*;

    /// Two cubes of 8 cells: one reaches 0.1 into the other.
    #[test]
    fn depth_of_two_cubes() {
        let cube = kuhn_box([2; 3], DVec3::ONE);
        let mut other = cube.clone();
        other
            .positions
            .iter_mut()
            .for_each(|x| *x += dvec3(0.07, 0.03, 0.9));
        let Overlap {
            deepest, inside, ..
        } = overlap(&[cube.clone(), other]);
        assert!((deepest - 0.1).abs() < 1e-12, "{deepest}");
        // Of the upper cube four lowest ones, of the lower cube four highest ones.
        assert_eq!(inside, 8);
        let mut apart = cube.clone();
        apart.positions.iter_mut().for_each(|x| x.z += 1.1);
        let apart = overlap(&[cube, apart]);
        assert_eq!((apart.deepest, apart.inside), (0.0, 0));
        assert!((apart.gap - 0.1).abs() < 1e-12, "{}", apart.gap);
    }

    /// A system that is not there has a row that says why.
    #[test]
    fn an_absent_system_has_a_row() {
        let scene = Scene {
            name: "one cube".to_owned(),
            bodies: vec![kuhn_box([1; 3], DVec3::ONE)],
            planes: Vec::new(),
            young_modulus: 1e5,
            poisson_ratio: 0.45,
            density: 1e3,
            damping: 0.0,
            friction: 0.0,
            gravity: DVec3::ZERO,
            time_step: 0.016,
            substeps: 1,
            frames: 1,
            farthest: 5.0,
        };
        let end = run(&PEERS[0], &scene, Path::new("/no/python"));
        assert!(end.missing.as_ref().unwrap().contains("cannot be run"));
        assert_eq!(table([end].iter()).rows.len(), 1);
    }
}
