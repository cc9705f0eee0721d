//! Random strokes one after the other, everything checked after each: rows that overlap and cross, thin slices, the last
//! stroke once more, bent blades, tets taken away, undo. A body that has grown fourfold is replaced.

use glam::DVec3;
use incise_cutting::{
    CutDelta, CutError, CutOptions, CuttableMesh, PieceTracker, Plane, Skin, StrokeRegistry, Sweep,
    TriangleSurface, carve, cut_plane, cut_surface_joining,
};
use incise_mesh::TetMesh;
use incise_meshing::{Shape, generate};

use crate::bodies::{check_cut, noise};

/// Numbers in -1..1, one after the other.
struct Dice {
    seed: u64,
    thrown: usize,
}

impl Dice {
    fn next(&mut self) -> f64 {
        self.thrown += 1;
        noise(self.seed, self.thrown)
    }

    fn one_of<T: Copy>(&mut self, values: &[T]) -> T {
        let bits = noise(self.seed, self.thrown + 1_000_000).to_bits();
        self.thrown += 1;
        values[usize::try_from(bits % values.len() as u64).unwrap_or(0)]
    }

    fn direction(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next()).normalize_or(DVec3::Z)
    }
}

/// A stroke that can be made again.
#[derive(Clone, Debug)]
enum Stroke {
    Plane(Plane),
    /// The poses of a blade.
    Sweep(Vec<Vec<DVec3>>),
    Rectangle([DVec3; 3]),
    Carve(DVec3, f64),
}

/// A body with everything that follows it.
struct Soak {
    body: CuttableMesh,
    pieces: PieceTracker,
    skin: Skin,
    registry: StrokeRegistry,
    /// Crumbs kept so far.
    crumbs: usize,
}

impl Soak {
    fn new(mesh: &TetMesh) -> Self {
        let body = CuttableMesh::new(mesh.clone()).unwrap();
        Self {
            pieces: PieceTracker::new(&body),
            skin: Skin::new(body.boundary()),
            registry: StrokeRegistry::default(),
            crumbs: 0,
            body,
        }
    }

    /// Makes a cut and checks all that follows from it.
    fn cut(
        &mut self,
        cut: impl FnOnce(&mut Self, &TetMesh) -> Result<CutDelta, CutError>,
    ) -> CutDelta {
        let before = self.body.mesh().clone();
        let delta = cut(self, &before).unwrap();
        check_cut(&before, &self.body, &delta);
        self.crumbs += delta.crumbs;
        self.pieces.apply_delta(&self.body, &delta);
        self.pieces.check(&self.body).unwrap();
        self.skin.apply_delta(&delta);
        assert_eq!(self.skin.triangles().len(), self.body.boundary_count());
        delta
    }

    fn run(&mut self, stroke: &Stroke, options: &CutOptions) {
        match stroke {
            Stroke::Plane(plane) => {
                self.cut(|soak, rest| {
                    let delta = cut_plane(&mut soak.body, &rest.positions, plane, options)?;
                    soak.registry.apply_delta(&soak.body, &delta, options);
                    Ok(delta)
                });
            }
            Stroke::Rectangle([center, u, v]) => {
                let surface = TriangleSurface::rectangle(*center, *u, *v).unwrap();
                self.cut(|soak, rest| {
                    let (body, registry) = (&mut soak.body, &mut soak.registry);
                    cut_surface_joining(body, &rest.positions, &surface, options, registry)
                });
            }
            Stroke::Carve(center, radius) => {
                self.cut(|soak, rest| {
                    let near = |x: DVec3| x.distance(*center) < *radius;
                    let delta = carve(&mut soak.body, &rest.positions, near, options.tag)?;
                    soak.registry.apply_delta(&soak.body, &delta, options);
                    Ok(delta)
                });
            }
            Stroke::Sweep(poses) => {
                let rest = self.body.mesh().positions.clone();
                let mut sweep = Sweep::new(&self.body, &rest, &poses[0], *options).unwrap();
                for pose in &poses[1..] {
                    self.cut(|soak, rest| {
                        let (body, registry) = (&mut soak.body, &mut soak.registry);
                        sweep.advance_joining(body, &rest.positions, pose, registry)
                    });
                }
            }
        }
    }
}

/// A stroke a few edges large at a random place, or beside the last one.
fn random_stroke(mesh: &TetMesh, edge: f64, last: Option<&Stroke>, dice: &mut Dice) -> Stroke {
    let at = (0.5 + 0.5 * dice.next()) * (mesh.positions.len() - 1) as f64;
    let place = mesh.positions.iter().enumerate();
    let center = place.take_while(|(i, _)| *i as f64 <= at).last();
    let center = center.map_or(DVec3::ZERO, |(_, x)| *x);
    let (u, w) = (dice.direction(), dice.direction());
    let normal = u.cross(w).normalize_or(DVec3::X);
    let v = normal.cross(u);
    let size = edge * (2.0 + dice.next());
    match dice.one_of(&[0, 1, 2, 3, 4, 4, 5, 6, 7]) {
        // A slice beside the last plane or rectangle, thinner than an edge.
        0 | 1 => match last {
            Some(Stroke::Plane(plane)) => Stroke::Plane(Plane {
                point: plane.point + plane.normal.normalize() * 0.2 * edge * dice.next(),
                normal: plane.normal,
            }),
            Some(&Stroke::Rectangle([center, u, v])) => {
                let beside = u.cross(v).normalize() * 0.2 * edge * dice.next();
                Stroke::Rectangle([center + beside, u, v])
            }
            _ => Stroke::Plane(Plane {
                point: center,
                normal,
            }),
        },
        2 => Stroke::Rectangle([center, u * size, v * size]),
        3 => Stroke::Carve(center, 0.7 * edge),
        // Rows to and fro that overlap; a turned blade makes them cross.
        4 => {
            let turn = dice.one_of(&[0.0, 0.3]);
            let pose = |row: f64, along: f64| {
                let down = v + normal * turn * row;
                let start = center + v * (0.4 * row * size) + u * along;
                vec![start, start + down * size]
            };
            let rows = (0..4).flat_map(|row| {
                let side = if row % 2 == 0 { 1.0 } else { -1.0 };
                let steps = [-1.5, -0.7, 0.0, 0.8, 1.5];
                steps.map(|step| pose(f64::from(row), step * side * size))
            });
            Stroke::Sweep(rows.collect())
        }
        // A loop that crosses its own path.
        5 => {
            let turns = (0..10).map(|i| 0.8 * f64::from(i));
            let start = |angle: f64| center + (u * angle.cos() + v * angle.sin()) * size;
            let pose = |angle| vec![start(angle) - normal * size, start(angle) + normal * size];
            Stroke::Sweep(turns.map(pose).collect())
        }
        // A bent blade.
        _ => {
            let bend = [u * size, v * size * dice.next(), -u * size];
            let pose = |t: f64| {
                let points = bend.map(|x| center + x + normal * (t * size));
                points.to_vec()
            };
            Stroke::Sweep([-1.0, -0.4, 0.1, 0.5, 1.0].map(pose).to_vec())
        }
    }
}

#[test]
fn random_strokes() {
    let (mut strokes, mut bodies, mut crumbs) = (0, 0, 0);
    for (seed, shape) in [(1, Shape::Liver), (2, Shape::Torus), (3, Shape::Box)] {
        let mesh = generate(shape, 600).unwrap();
        let edge = (8.0 * mesh.total_volume() / mesh.tets.len() as f64).cbrt();
        let mut dice = Dice { seed, thrown: 0 };
        let mut soak = Soak::new(&mesh);
        let mut last = None;
        for _ in 0..25 {
            if soak.body.mesh().tets.len() > 4 * mesh.tets.len() || soak.body.mesh().tets.is_empty()
            {
                crumbs += soak.crumbs;
                soak = Soak::new(&mesh);
                bodies += 1;
            }
            let stroke = match &last {
                Some(stroke) if dice.next() > 0.75 => Stroke::clone(stroke),
                last => random_stroke(soak.body.mesh(), edge, last.as_ref(), &mut dice),
            };
            let options = CutOptions {
                snap: dice.one_of(&[0.0, 0.1, 0.1, 0.2, 0.25]),
                crumbs: dice.one_of(&[0.0, 0.5, 0.5, 3.0]),
                ..CutOptions::default()
            };
            soak.run(&stroke, &options);
            strokes += 1;
            last = Some(stroke);
            // Undone, a cut leaves the body to the byte.
            if dice.next() > 0.8 {
                let before = soak.body.clone();
                let (pieces, skin) = (soak.pieces.clone(), soak.skin.clone());
                let registry = soak.registry.clone();
                let plane = Plane {
                    point: DVec3::ZERO,
                    normal: dice.direction(),
                };
                let delta = soak
                    .cut(|soak, rest| cut_plane(&mut soak.body, &rest.positions, &plane, &options));
                soak.body.undo(&delta).unwrap();
                assert_eq!(soak.body.mesh(), before.mesh());
                (soak.pieces, soak.skin, soak.registry) = (pieces, skin, registry);
            }
        }
        crumbs += soak.crumbs;
    }
    assert!(
        strokes == 75 && bodies < 30 && crumbs > 0,
        "{strokes}, {bodies}, {crumbs}"
    );
}
