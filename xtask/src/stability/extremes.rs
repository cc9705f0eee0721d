//! The rows of the matrix that a solver alone can show: extreme states, materials, steps, masses, poses and sizes.
//!
//! Each is a beam of 1 m × 0.25 m × 0.25 m of E = 1e6 Pa and Poisson's ratio 0.45, with one thing changed. Extremes of
//! state are left alone, without gravity, one end held or none, so that the shape at rest is what they should come back
//! to. All others are held at one end and fall from rest under gravity, which no method that loses its stiffness
//! survives.

use incise::mesh::glam::DVec3;
use incise::mesh::{TetId, TetMesh, kuhn_box};
use incise::scene::{MaterialSpec, Quantity, Region, ReportSpec, SolverSpec};
use incise::xpbd::{KappaLimit, Material, Real, Solver};
use incise::{Body, Simulation};

use crate::random::Random;
use crate::solver::body::mixed_body;

/// In m/s².
const GRAVITY: f64 = 9.81;
/// In s.
const FRAME: f64 = 1.0 / 60.0;
/// The most frames of a run.
const MOST_FRAMES: f64 = 1000.0;

/// Start position of a particle.
type Deformation = fn(&mut Random, DVec3) -> DVec3;

/// A body, its surroundings and its start.
#[derive(Clone)]
pub(crate) struct Extreme {
    /// Names the cell: lower case, digits, dashes, dots.
    pub(crate) id: String,
    pub(crate) name: String,
    pub(crate) mesh: TetMesh,
    material: Material,
    /// Mass density of the half that is not held over that of the other.
    density_ratio: f64,
    pub(crate) held: bool,
    pub(crate) time_step: f64,
    /// Downward, in m/s²; 0 is none.
    gravity: f64,
    /// Simulated time in s.
    pub(crate) time: f64,
    /// Substeps per frame, for the columns that have more than one.
    pub(crate) substeps: Option<u32>,
    pose: Deformation,
}

/// The whole list; a coarser body if `quick`.
pub(crate) fn extremes(quick: bool) -> anyhow::Result<Vec<Extreme>> {
    let cells = if quick { [8, 2, 2] } else { [16, 4, 4] };
    let plain = Extreme {
        id: "rest".to_owned(),
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
        gravity: GRAVITY,
        time: 1.0,
        substeps: None,
        pose: |_, x| x,
    };
    let mut extremes = vec![plain.clone()];
    let mut add = |id: String, name: String, change: &dyn Fn(&mut Extreme)| {
        let mut extreme = Extreme {
            id,
            name,
            ..plain.clone()
        };
        change(&mut extreme);
        extremes.push(extreme);
    };
    for (how, held) in [("held", true), ("free", false)] {
        for (id, what, pose) in states() {
            add(format!("{id}-{how}"), format!("{what}, {how}"), &|e| {
                (e.held, e.pose, e.gravity) = (held, pose, 0.0);
            });
        }
    }
    for young_modulus in [1e1, 1e3, 1e5, 1e7, 1e9, 1e12] {
        let id = format!("young-{young_modulus:e}");
        add(id, format!("E = {young_modulus:e} Pa"), &|e| {
            e.material.young_modulus = young_modulus;
        });
    }
    for poisson_ratio in [0.0, 0.3, 0.49, 0.499, 0.4999] {
        let id = format!("poisson-{poisson_ratio}");
        add(id, format!("Poisson's ratio {poisson_ratio}"), &|e| {
            e.material.poisson_ratio = poisson_ratio;
        });
    }
    for (id, name, time_step) in [
        ("step-0.1", "frame of 1/10 s", 0.1),
        ("step-1e-3", "frame of 1/1,000 s", 1e-3),
        ("step-1e-4", "frame of 1/10,000 s", 1e-4),
    ] {
        add(id.to_owned(), name.to_owned(), &|e| e.time_step = time_step);
    }
    for damping in [0.01, 0.05] {
        let name = format!("damping time of {damping} s");
        add(format!("damping-{damping}"), name, &|e| {
            e.material.damping = damping;
        });
    }
    let substeps = if quick { 100 } else { 1000 };
    add(
        "many-substeps".to_owned(),
        format!("{substeps} substeps a frame (split and softened), 100 frames"),
        &|e| {
            (e.substeps, e.time) = (Some(substeps), 100.0 * FRAME);
        },
    );
    for ratio in [1e-6, 1e-3, 1e3, 1e6] {
        let name = format!("far half of {ratio:e} times the mass");
        add(format!("mass-{ratio:e}"), name, &|e| {
            e.density_ratio = ratio;
        });
    }
    add("far".to_owned(), "1e4 m from the origin".to_owned(), &|e| {
        for x in &mut e.mesh.positions {
            *x += DVec3::splat(1e4);
        }
    });
    for scale in [1e-6, 1e6] {
        let sized = |e: &mut Extreme| e.mesh.positions.iter_mut().for_each(|x| *x *= scale);
        let name = format!("{scale:e} times as large");
        add(format!("size-{scale:e}"), name, &sized);
        let name = format!("{scale:e} times as large, time as well");
        add(format!("units-{scale:e}"), name, &|e| {
            sized(e);
            e.time_step *= scale;
            e.time *= scale;
            e.gravity /= scale;
        });
    }
    for thickness in [1e-6, 1e-9] {
        let mesh = with_sliver(&plain.mesh, thickness)?;
        let name = format!("a sliver of {thickness:e} of its volume");
        add(format!("sliver-{thickness:e}"), name, &|e| {
            e.mesh = mesh.clone();
        });
    }
    add(
        "gravity-1e3".to_owned(),
        "gravity of 1e3 m/s²".to_owned(),
        &|e| {
            e.gravity = 1e3;
        },
    );
    Ok(extremes)
}

fn states() -> [(&'static str, &'static str, Deformation); 8] {
    [
        ("point", "on a point", |_, _| DVec3::new(0.3, 0.1, 0.1)),
        ("speck", "within 1e-6 m", |noise, _| noise.vector() * 1e-6),
        ("plane", "on a plane", |_, x| DVec3::new(x.x, x.y, 0.0)),
        ("line", "on a line", |_, x| DVec3::new(x.x, 0.125, 0.125)),
        ("mirrored", "inverted", |_, x| DVec3::new(x.x, x.y, -x.z)),
        ("scrambled", "scrambled", |noise, _| {
            (noise.vector() + DVec3::ONE) * 0.5 * DVec3::new(1.0, 0.25, 0.25)
        }),
        ("doubled", "twice its size", |_, x| x * 2.0),
        ("stretched", "twice its length", |_, x| {
            DVec3::new(2.0 * x.x, x.y, x.z)
        }),
    ]
}

/// Moves a particle inside the mesh to a face opposite of it, but for a part of the way.
fn with_sliver(mesh: &TetMesh, thickness: f64) -> anyhow::Result<TetMesh> {
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
    *x = center + (*x - center) * thickness;
    let flat = (0..mesh.tets.len()).find(|&t| mesh.volume(TetId::new(t)) <= 0.0);
    anyhow::ensure!(flat.is_none(), "tet {flat:?} has no volume");
    Ok(mesh)
}

impl Extreme {
    /// The body at its start, softened to a limit.
    pub(crate) fn solver<R: Real>(&self, limit: Option<KappaLimit>) -> anyhow::Result<Solver<R>> {
        let (low, high) = self.ends();
        let far = Material {
            density: self.material.density * self.density_ratio,
            ..self.material
        };
        let middle = 0.5 * (low + high);
        let center = |t| self.mesh.corners(t).into_iter().sum::<DVec3>() / 4.0;
        let mut solver = mixed_body::<R>(
            &self.mesh,
            &[self.material, far],
            |t| usize::from(center(t).x > middle),
            |x| self.held && x.x == low,
        )?;
        if limit.is_some() {
            solver.limit_kappa(limit);
            for t in 0..solver.tet_count() {
                solver.replace_tet(t, solver.tet_particles(t), self.mesh.corners(TetId::new(t)));
            }
        }
        let mut noise = Random(17);
        for (p, &x) in self.mesh.positions.iter().enumerate() {
            if !solver.is_fixed(p) {
                solver.set_position(p, (self.pose)(&mut noise, x));
            }
        }
        Ok(solver)
    }

    /// The body at its start as a simulation. Of extremes of state it is the body at rest.
    pub(crate) fn simulation(&self, solver: SolverSpec) -> Result<Simulation, incise::Error> {
        let (low, high) = self.ends();
        let far = MaterialSpec::default().with(|spec| {
            spec.regions = vec![Region::half_space(
                [0.5 * (low + high), 0.0, 0.0],
                [1.0, 0.0, 0.0],
            )];
            spec.density = Some(self.material.density * self.density_ratio);
        });
        let body = Body::new(self.mesh.clone())
            .young_modulus(self.material.young_modulus)
            .poisson_ratio(self.material.poisson_ratio)
            .density(self.material.density)
            .damping(self.material.damping)
            .pinned(|x| self.held && x.x == low);
        let mut builder = Simulation::builder();
        builder.gravity(self.gravity().unwrap_or(DVec3::ZERO));
        builder.solver(solver.with(|spec| spec.time_step = self.time_step));
        builder.report(ReportSpec::default().with(|spec| {
            spec.quantities = vec![Quantity::Energy, Quantity::Volume, Quantity::Kappa];
        }));
        builder.add_body(match self.density_ratio {
            1.0 => body,
            _ => body.material(far),
        });
        builder.build()
    }

    /// The smallest and the largest x at rest.
    fn ends(&self) -> (f64, f64) {
        let along = self.mesh.positions.iter().map(|x| x.x);
        along.fold((f64::MAX, f64::MIN), |(low, high), x| {
            (low.min(x), high.max(x))
        })
    }

    /// Work of gravity over the length of the body, in J: the unit of energies.
    pub(crate) fn work(&self) -> f64 {
        let (low, high) = self.ends();
        let middle = 0.5 * (low + high);
        let tets = (0..self.mesh.tets.len()).map(TetId::new);
        let mass = tets.map(|t| {
            let center = self.mesh.corners(t).into_iter().sum::<DVec3>() / 4.0;
            let is_far = center.x > middle;
            let ratio = if is_far { self.density_ratio } else { 1.0 };
            self.mesh.volume(t) * self.material.density * ratio
        });
        mass.sum::<f64>() * self.gravity * (high - low)
    }

    pub(crate) fn gravity(&self) -> Option<DVec3> {
        (self.gravity > 0.0).then(|| DVec3::NEG_Z * self.gravity)
    }

    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "there are from 1 to 1000 frames"
    )]
    pub(crate) fn frames(&self) -> usize {
        (self.time / self.time_step).round().clamp(1.0, MOST_FRAMES) as usize
    }
}
