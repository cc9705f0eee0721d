//! What methods make of extremes: a table of start states, stiffnesses, steps, masses and places, by method.
//!
//! A beam of 1 m × 0.25 m × 0.25 m that is held at one end moves for a second under gravity; free ones move without.
//! The table is about shape, not about accuracy: a body that stretches far too much may well be "ok".

use incise::mesh::generate::kuhn_box;
use incise::mesh::glam::DVec3;
use incise::mesh::{TetId, TetMesh};
use incise::xpbd::{DescentSettings, Form, Material, Method, Real, Solver, StepSettings};
use rayon::prelude::*;

use super::beam::{FRAME, GRAVITY};
use super::body::mixed_body;
use super::digits;
use super::runner::{Recipe, Runner};
use crate::table;

/// Above this a substep of one iteration is not accurate.
const KAPPA: f64 = 0.5;
/// The most substeps of a frame.
const CAP: u32 = 200;
const METHODS: [&str; 6] = [
    "XPBD, substeps",
    "XPBD, 1 x 20",
    "paper, 1 x 20",
    "Jacobi, 1 x 20",
    "Chebyshev, 1 x 20",
    "descent, 1 x 20",
];
const LEGEND: &str = "\
After a second: `ok` and the volume over that at rest; `12 inv`, tets that are inverted; `collapsed`, less than half the
volume; `off`, a volume that differs by more than 5 % (rightly so where a body is very soft or very heavy); `frozen`,
nothing has moved at all; speeds above 20 m/s at the end; `repaired`, particles that would have become infinite or NaN
and were put back. Single and double precision apart where they differ. *XPBD, substeps* is the block form with one
iteration in each of the substeps of the third column, which bring kappa to 0.5 unless there would be more than 200.
*paper* is the sequential form with relaxation 0.8 and clusters of 10; Jacobi and Chebyshev (spectral radius 0.9) are the
block form with relaxation 0.1. `ok` speaks of the shape of tets, not of accuracy.
";

/// Where a particle is put at the start.
type Place = fn(&mut Noise, DVec3) -> DVec3;

/// A body, its surroundings and its start.
#[derive(Clone)]
struct Extreme {
    name: String,
    mesh: TetMesh,
    material: Material,
    /// Mass density of the half that is not held over that of the other.
    density_ratio: f64,
    held: bool,
    time_step: f64,
    place: Place,
}

pub(crate) fn stability(quick: bool) -> anyhow::Result<String> {
    let rows: Vec<Vec<String>> = extremes(quick)?
        .par_iter()
        .map(|extreme| row(extreme, quick))
        .collect::<anyhow::Result<_>>()?;
    let head = ["extreme", "kappa of a frame", "substeps"];
    let mut table = table(head.into_iter().chain(METHODS));

    table.add_rows(rows);
    Ok(format!("## Stability\n\n{LEGEND}\n{table}\n"))
}

fn extremes(quick: bool) -> anyhow::Result<Vec<Extreme>> {
    let cells = if quick { [8, 2, 2] } else { [16, 4, 4] };
    let plain = Extreme {
        name: "none".to_owned(),
        mesh: kuhn_box(cells, DVec3::new(1.0, 0.25, 0.25)),
        material: Material {
            young_modulus: 1e6,
            poisson_ratio: 0.45,
            density: 1000.0,
            damping: 0.0,
        },
        density_ratio: 1.0,
        held: true,
        time_step: FRAME,
        place: |_, x| x,
    };
    let mut extremes = vec![plain.clone()];
    let mut add = |name: String, change: &dyn Fn(&mut Extreme)| {
        let mut extreme = plain.clone();
        extreme.name = name;
        change(&mut extreme);
        extremes.push(extreme);
    };
    for (how, held) in [("held", true), ("free", false)] {
        for (what, place) in states() {
            add(format!("{what}, {how}"), &|e| {
                (e.held, e.place) = (held, place);
            });
        }
    }
    for young_modulus in [1e1, 1e3, 1e5, 1e7, 1e9, 1e12] {
        add(format!("E = {young_modulus:e} Pa"), &|e| {
            e.material.young_modulus = young_modulus;
        });
    }
    for poisson_ratio in [0.0, 0.3, 0.49, 0.499, 0.4999, 0.499_999] {
        add(format!("Poisson's ratio {poisson_ratio}"), &|e| {
            e.material.poisson_ratio = poisson_ratio;
        });
    }
    for (name, time_step) in [("1/10", 0.1), ("1e-3", 1e-3), ("1e-4", 1e-4)] {
        add(format!("frame of {name} s"), &|e| e.time_step = time_step);
    }
    for ratio in [1e-3, 1e3, 1e6] {
        add(format!("far half of {ratio:e} times the mass"), &|e| {
            e.density_ratio = ratio;
        });
    }
    for distance in [1e4, 1e6] {
        add(format!("{distance:e} m from the origin"), &|e| {
            for x in &mut e.mesh.positions {
                *x += DVec3::splat(distance);
            }
        });
    }
    let mesh = with_sliver(&plain.mesh)?;
    add("a sliver of 1e-6 of its height".to_owned(), &|e| {
        e.mesh = mesh.clone();
    });
    Ok(extremes)
}

fn states() -> [(&'static str, Place); 7] {
    [
        ("point", |_, _| DVec3::new(0.3, 0.1, 0.1)),
        ("point to 1e-6 m", |noise, _| noise.vector() * 1e-6),
        ("plane", |_, x| DVec3::new(x.x, x.y, 0.0)),
        ("line", |_, x| DVec3::new(x.x, 0.125, 0.125)),
        ("mirrored", |_, x| DVec3::new(x.x, x.y, -x.z)),
        ("scrambled", |noise, _| {
            (noise.vector() + DVec3::ONE) * 0.5 * DVec3::new(1.0, 0.25, 0.25)
        }),
        ("twice its size", |_, x| x * 2.0),
    ]
}

/// Moves a particle inside the mesh to a face opposite of it, but for a millionth of the way.
fn with_sliver(mesh: &TetMesh) -> anyhow::Result<TetMesh> {
    let middle = DVec3::new(0.5, 0.125, 0.125);
    let near = |t: usize| {
        let center: DVec3 = mesh.corners(TetId::new(t)).into_iter().sum();
        (center / 4.0).distance(middle)
    };
    let tet = (0..mesh.tets.len()).min_by(|&a, &b| near(a).total_cmp(&near(b)));
    let mut particles = mesh.tets[tet.unwrap_or(0)];
    particles.sort_by(|a, b| {
        let [a, b] = [a, b].map(|p| mesh.positions[p.index()].distance(middle));
        a.total_cmp(&b)
    });
    let [moved, face @ ..] = particles;
    let center: DVec3 = face.iter().map(|p| mesh.positions[p.index()] / 3.0).sum();
    let mut mesh = mesh.clone();
    let x = &mut mesh.positions[moved.index()];
    *x = center + (*x - center) * 1e-6;
    let flat = (0..mesh.tets.len()).find(|&t| mesh.volume(TetId::new(t)) <= 0.0);
    anyhow::ensure!(flat.is_none(), "tet {flat:?} has no volume");
    Ok(mesh)
}

impl Extreme {
    /// The body at its start.
    fn solver<R: Real>(&self) -> anyhow::Result<Solver<R>> {
        let low = self
            .mesh
            .positions
            .iter()
            .fold(DVec3::MAX, |a, b| a.min(*b));
        let far = Material {
            density: self.material.density * self.density_ratio,
            ..self.material
        };
        let center = |t| self.mesh.corners(t).into_iter().sum::<DVec3>() / 4.0 - low;
        let mut solver = mixed_body::<R>(
            &self.mesh,
            &[self.material, far],
            |t| usize::from(center(t).x > 0.5),
            |x| self.held && x.x == low.x,
        )?;
        let mut noise = Noise(17);
        for (p, &x) in self.mesh.positions.iter().enumerate() {
            if !solver.is_fixed(p) {
                solver.set_position(p, (self.place)(&mut noise, x));
            }
        }
        Ok(solver)
    }

    /// The substeps that kappa asks for.
    fn substeps(&self, kappa: f64) -> f64 {
        (kappa / KAPPA).sqrt().ceil().max(1.0)
    }

    fn recipes(&self, substeps: u32) -> [Recipe; 6] {
        let one = StepSettings {
            gravity: self.held.then_some(GRAVITY),
            ..StepSettings::new(self.time_step)
        };
        let twenty = StepSettings {
            iterations: 20,
            ..one.clone()
        };
        let jacobi = StepSettings {
            method: Method::Jacobi,
            relaxation: 0.1,
            ..twenty.clone()
        };
        let chebyshev = StepSettings {
            method: Method::Chebyshev {
                spectral_radius: 0.9,
                delay: 10,
            },
            ..jacobi.clone()
        };
        let paper = StepSettings {
            form: Form::Sequential,
            relaxation: 0.8,
            ..twenty.clone()
        };
        let descent = DescentSettings {
            step: twenty.clone(),
            ..DescentSettings::new(self.time_step, 20)
        };
        let xpbd = |clustering, settings| Recipe::Xpbd {
            clustering,
            settings,
        };
        [
            xpbd("none", StepSettings { substeps, ..one }),
            xpbd("none", twenty),
            xpbd("serial:10", paper),
            xpbd("none", jacobi),
            xpbd("none", chebyshev),
            Recipe::Descent(descent),
        ]
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "there are at most 200 substeps, and a second has some thousand frames"
)]
fn row(extreme: &Extreme, quick: bool) -> anyhow::Result<Vec<String>> {
    let kappa = extreme.solver::<f64>()?.kappa(extreme.time_step);
    let wanted = extreme.substeps(kappa);
    let substeps = wanted.min(f64::from(CAP)) as u32;
    let shown = match wanted > f64::from(CAP) {
        true => format!("{CAP} of {wanted:.0}"),
        false => substeps.to_string(),
    };
    let time = if quick { 0.01 } else { 1.0 };
    let frames = (time / extreme.time_step).round().max(1.0) as usize;
    let mut cells = vec![extreme.name.clone(), digits(kappa), shown];
    for recipe in extreme.recipes(substeps) {
        let single = outcome::<f32>(extreme, &recipe, frames)?;
        let double = outcome::<f64>(extreme, &recipe, frames)?;
        cells.push(match single == double {
            true => single,
            false => format!("f32 {single}; f64 {double}"),
        });
    }
    Ok(cells)
}

/// What became of the body after some frames.
fn outcome<R: Real>(extreme: &Extreme, recipe: &Recipe, frames: usize) -> anyhow::Result<String> {
    let mut runner = Runner::<R>::new(extreme.solver()?, &extreme.mesh, recipe)?;
    let (mut start, mut end) = (Vec::new(), Vec::new());
    runner.solver.positions(&mut start);
    let mut repaired = 0;
    for _ in 0..frames {
        repaired += runner.frame()?;
    }
    let solver = &runner.solver;
    solver.positions(&mut end);
    let finite = |p| solver.position(p).is_finite() && solver.velocity(p).is_finite();
    if !(0..solver.particle_count()).all(finite) {
        return Ok("NOT FINITE".to_owned());
    }
    let volume = solver.volume();
    let ratio = volume.total / volume.rest;
    let shown = match ratio.abs() {
        ..0.005 => "0.00".to_owned(),
        ..100.0 => format!("{ratio:.2}"),
        _ => format!("{ratio:.0e}"),
    };
    let mut text = match volume.inverted {
        _ if start == end && extreme.held => "frozen".to_owned(),
        _ if ratio < -0.5 => format!("collapsed {shown}"),
        _ if ratio < 0.5 => format!("collapsed {:.1}", ratio.abs()),
        0 if (ratio - 1.0).abs() > 0.05 => format!("off {shown}"),
        0 => format!("ok {shown}"),
        inverted => format!("{inverted} inv {shown}"),
    };
    let speed = solver.max_speed();
    match speed {
        ..=20.0 => {}
        ..1e5 => text += &format!(", {speed:.0} m/s"),
        _ => text += &format!(", {speed:.0e} m/s"),
    }
    if repaired > 0 {
        text += &format!(", {repaired} repaired");
    }
    Ok(text)
}

/// Seeded noise (`SplitMix64`), the same everywhere.
struct Noise(u64);

impl Noise {
    /// Uniform in -1 .. 1.
    fn scalar(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// Uniform in the cube from -1 to 1.
    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.scalar(), self.scalar(), self.scalar())
    }
}
