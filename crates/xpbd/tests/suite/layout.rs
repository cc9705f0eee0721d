//! A solver that follows edits step by step against one that rebuilds everything: the same to the bit.

use glam::{DVec3, dvec3};
use incise_graph::{ClusterId, Clustering, ColorId, Coloring, Schedule};
use incise_mesh::{TetMesh, kuhn_box};
use incise_xpbd::{Material, Real, Solver, StepSettings, XpbdError};

use crate::body::{GRAVITY, Noise, RUBBER};

const HEAVY: Material = Material {
    density: 3000.0,
    damping: 2e-3,
    ..RUBBER
};

/// A body that is cut by hand, its clusters and colors, and two solvers of it.
struct SolverPair<R: Real> {
    tets: Vec<[u32; 4]>,
    /// Positions at rest.
    rest: Vec<DVec3>,
    clustering: Clustering,
    coloring: Coloring,
    /// Follows.
    schedule: Schedule,
    follower: Solver<R>,
    /// Is told everything as if nothing could be known.
    other: Solver<R>,
    /// Of the present batch of edits.
    changed_tets: Vec<u32>,
    changed_clusters: Vec<ClusterId>,
    touched: Vec<u32>,
}

fn quarter(rest: [DVec3; 4], density: f64) -> f64 {
    let [a, b, c, d] = rest;
    density * (b - a).cross(c - a).dot(d - a) / 24.0
}

impl<R: Real> SolverPair<R> {
    /// Clusters of up to three tets, in the order of the mesh.
    fn new(mesh: &TetMesh, materials: &[Material]) -> Self {
        let tets: Vec<_> = mesh.tets.iter().map(|tet| tet.map(|p| p.0)).collect();
        let labels = (0..tets.len()).map(|t| ClusterId::new(t / 3)).collect();
        let clustering = Clustering::from_labels(labels).unwrap();
        let coloring = Coloring::new(vec![ColorId(u32::MAX); clustering.cluster_count()]);
        let solver = || {
            let mut solver = Solver::new(&mesh.positions);
            for material in materials {
                solver.add_material(*material).unwrap();
            }
            solver
        };
        let mut body = Self {
            rest: mesh.positions.clone(),
            schedule: Schedule::default(),
            follower: solver(),
            other: solver(),
            changed_tets: (0..).take(tets.len()).collect(),
            changed_clusters: (0..clustering.cluster_count())
                .map(ClusterId::new)
                .collect(),
            touched: (0..).take(mesh.positions.len()).collect(),
            clustering,
            coloring,
            tets: Vec::new(),
        };
        for (t, tet) in tets.into_iter().enumerate() {
            body.push(tet, u16::try_from(t % materials.len()).unwrap());
        }
        body.finish();
        body
    }

    fn corners(&self, tet: [u32; 4]) -> [DVec3; 4] {
        tet.map(|p| self.rest[p as usize])
    }

    fn both(&mut self) -> [&mut Solver<R>; 2] {
        [&mut self.follower, &mut self.other]
    }

    fn push(&mut self, tet: [u32; 4], material: u16) {
        let rest = self.corners(tet);
        for solver in self.both() {
            solver.push_tet(tet, rest, material);
        }
        self.tets.push(tet);
    }

    /// Takes a tet from its cluster.
    fn leave(&mut self, t: usize) {
        self.clustering.remove(t);
        self.changed_tets.push(u32::try_from(t).unwrap());
    }

    /// Gives tets a cluster of their own.
    fn gather(&mut self, tets: &[usize]) {
        let cluster = self.clustering.new_cluster(tets[0]);
        for &t in &tets[1..] {
            self.clustering.assign(t, cluster);
        }
        if cluster.index() == self.coloring.vertex_count() {
            self.coloring.push(ColorId(u32::MAX));
        }
        self.coloring.set(cluster.index(), ColorId(u32::MAX));
        self.changed_clusters.push(cluster);
        let changed = tets.iter().map(|&t| u32::try_from(t).unwrap());
        self.changed_tets.extend(changed);
    }

    /// Halves a tet through the middle of the edge from its first to its second corner. (Not its neighbors: the mesh
    /// has a hanging particle then, which a solver does not care about.)
    fn halve(&mut self, t: usize) {
        let tet @ [a, b, c, d] = self.tets[t];
        let m = u32::try_from(self.rest.len()).unwrap();
        self.rest
            .push((self.rest[a as usize] + self.rest[b as usize]) / 2.0);
        let material = self.follower.material_of(t);
        self.tets[t] = [a, m, c, d];
        let rest = self.corners(self.tets[t]);
        for solver in self.both() {
            solver.push_particle_between(a as usize, b as usize, 0.5);
            solver.replace_tet(t, [a, m, c, d], rest);
        }
        self.push([m, b, c, d], material);
        self.leave(t);
        self.gather(&[t, self.tets.len() - 1]);
        self.touched.extend(tet);
        self.touched.push(m);
    }

    /// Hangs a tet on a copy of its last corner.
    fn relink(&mut self, t: usize) {
        let old = self.tets[t][3];
        let copy = u32::try_from(self.rest.len()).unwrap();
        self.rest.push(self.rest[old as usize]);
        self.tets[t][3] = copy;
        let tet = self.tets[t];
        for solver in self.both() {
            solver.push_copy(old as usize);
            solver.relink_tet(t, tet);
        }
        self.touched.extend([old, copy]);
    }

    /// Deletes a tet; the last one takes its place.
    fn delete(&mut self, t: usize) {
        let last = self.tets.len() - 1;
        self.touched.extend(self.tets[t]);
        self.leave(t);
        if t != last {
            self.leave(last);
            self.gather(&[t]);
        }
        self.tets.swap_remove(t);
        for solver in self.both() {
            solver.move_tet(last, t);
            solver.truncate_tets(last);
        }
    }

    /// Takes the last halving back: the child goes, and its particle.
    fn join(&mut self, t: usize, before: [u32; 4]) {
        let last = self.tets.len() - 1;
        self.touched.extend(before);
        self.leave(last);
        self.leave(t);
        self.tets.pop();
        self.tets[t] = before;
        let rest = self.corners(before);
        self.rest.pop();
        let count = self.rest.len();
        for solver in self.both() {
            solver.replace_tet(t, before, rest);
            solver.truncate_tets(last);
            solver.truncate_particles(count);
        }
        self.gather(&[t]);
        self.touched.retain(|&p| (p as usize) < count);
    }

    /// Gives another color to a cluster.
    fn recolor(&mut self, t: usize) {
        if let Some(cluster) = self.clustering.cluster_of(t) {
            self.coloring.set(cluster.index(), ColorId(u32::MAX));
            self.changed_clusters.push(cluster);
        }
    }

    /// Ends a batch of edits: colors, schedule, masses.
    fn finish(&mut self) {
        let changed = std::mem::take(&mut self.changed_clusters);
        let members = self.clustering.members();
        let particles = |k: usize| {
            members
                .members(k)
                .iter()
                .flat_map(|&t| self.tets[t as usize])
        };
        for (i, cluster) in changed.iter().enumerate() {
            let mut taken = Vec::new();
            for k in 0..self.coloring.vertex_count() {
                let meets = |p: u32| particles(cluster.index()).any(|q| q == p);
                if k != cluster.index() && particles(k).any(meets) {
                    taken.push(self.coloring.color(k).0);
                }
            }
            // Not always the first one, so that clusters change their colors.
            let skip = u32::try_from(i % 3).unwrap();
            let color = (skip..).find(|color| !taken.contains(color)).unwrap();
            self.coloring.set(cluster.index(), ColorId(color));
        }
        self.schedule.update(
            &self.clustering,
            &self.coloring,
            &std::mem::take(&mut self.changed_tets),
            &changed,
        );
        self.schedule
            .check_partition(&self.clustering, &self.coloring)
            .unwrap();
        let mut touched = std::mem::take(&mut self.touched);
        touched.sort_unstable();
        touched.dedup();
        for p in touched {
            let has = |&t: &usize| self.tets[t].contains(&p);
            let star: Vec<usize> = (0..self.tets.len()).filter(has).collect();
            let masses = star.iter().map(|&t| {
                let density = self.other.density_of(t);
                quarter(self.corners(self.tets[t]), density)
            });
            let (particle, mass) = (p as usize, masses.sum());
            self.other.set_mass(particle, mass);
            self.follower.set_mass_in_star(particle, mass, star);
        }
    }

    /// Steps both solvers, the other one by a new schedule.
    fn step(&mut self, settings: &StepSettings) {
        self.follower.check_layout(&self.schedule).unwrap();
        let new = Schedule::new(&self.clustering, &self.coloring);
        self.follower
            .step_keeping_residuals(&self.schedule, settings)
            .unwrap();
        self.other.step_keeping_residuals(&new, settings).unwrap();
        self.follower.check_layout(&self.schedule).unwrap();
        for p in 0..self.rest.len() {
            assert_eq!(self.follower.position(p), self.other.position(p), "{p}");
            assert_eq!(self.follower.velocity(p), self.other.velocity(p), "{p}");
        }
        let time = settings.substep_time();
        assert_eq!(self.follower.residuals(time), self.other.residuals(time));
    }
}

fn settings() -> StepSettings {
    StepSettings {
        gravity: Some(GRAVITY),
        iterations: 2,
        ..StepSettings::new(1e-3)
    }
}

/// A number below another one.
fn below(noise: &mut Noise, count: usize) -> usize {
    let bits = noise.scalar().to_bits() >> 8;
    usize::try_from(bits % count as u64).unwrap()
}

/// Batches of random edits with a step after each. Sums of the stars are taken in the order of the tets for both.
fn edits<R: Real>(materials: &[Material], seed: u64) {
    let mesh = kuhn_box([4, 3, 2], dvec3(0.4, 0.3, 0.2));
    let mut body = SolverPair::<R>::new(&mesh, materials);
    body.follower.set_fixed(0, true);
    body.other.set_fixed(0, true);
    let mut noise = Noise(seed);
    let mut undo = None;
    for round in 0..60 {
        for _ in 0..1 + round % 4 {
            let t = below(&mut noise, body.tets.len());
            match below(&mut noise, 9) {
                0..4 => {
                    undo = Some((t, body.tets[t]));
                    body.halve(t);
                    continue;
                }
                4 => body.relink(t),
                5 | 6 => body.delete(t),
                7 => body.recolor(t),
                _ => {
                    if let Some((t, before)) = undo.take() {
                        body.join(t, before);
                    }
                }
            }
            undo = None;
        }
        body.finish();
        body.step(&settings());
    }
    assert!(body.tets.len() > mesh.tets.len());
}

#[test]
fn updated_and_rebuilt_layouts_are_equal() {
    edits::<f32>(&[RUBBER], 1);
    edits::<f64>(&[RUBBER], 2);
    edits::<f32>(&[RUBBER, HEAVY], 3);
    edits::<f64>(&[HEAVY, RUBBER], 4);
}

/// Several edits between two steps, and a follower that must rebuild because the schedule no longer knows the changes.
#[test]
fn a_solver_may_fall_behind() {
    let mesh = kuhn_box([3, 2, 2], dvec3(0.3, 0.2, 0.2));
    let mut body = SolverPair::<f64>::new(&mesh, &[RUBBER]);
    body.step(&settings());
    for round in 0..200 {
        body.recolor(round % body.tets.len());
        if round % 20 == 0 {
            body.halve(round % 7);
        }
        body.finish();
    }
    body.step(&settings());
}

/// All goes, then some comes back.
#[test]
fn an_empty_layout_is_valid() {
    let mesh = kuhn_box([1, 1, 1], DVec3::ONE);
    let mut body = SolverPair::<f32>::new(&mesh, &[RUBBER]);
    body.step(&settings());
    while !body.tets.is_empty() {
        body.delete(0);
        body.finish();
        body.step(&settings());
    }
    body.push([0, 1, 3, 7], 0);
    body.gather(&[0]);
    body.touched.extend([0, 1, 3, 7]);
    body.finish();
    body.step(&settings());
}

/// A star that is not named in full is solved with an old mass, and found out.
#[test]
fn a_forgotten_tet_is_found() {
    let mesh = kuhn_box([1, 1, 1], DVec3::ONE);
    let mut body = SolverPair::<f64>::new(&mesh, &[RUBBER]);
    body.step(&settings());
    let star = |tet: &&[u32; 4]| tet.contains(&0);
    let star: Vec<usize> = (0..)
        .zip(&body.tets)
        .filter(|(_, tet)| star(tet))
        .map(|(t, _)| t)
        .collect();
    assert!(star.len() > 1);
    let mass = 2.0 * body.follower.mass(0);
    body.follower
        .set_mass_in_star(0, mass, star[1..].iter().copied());
    let tet = XpbdError::Layout {
        what: "tet",
        number: star[0],
    };
    assert_eq!(body.follower.check_layout(&body.schedule), Err(tet));
    // The same mass again changes nothing; another one with the whole star puts it right.
    body.follower.set_mass_in_star(0, mass, star.clone());
    assert!(body.follower.check_layout(&body.schedule).is_err());
    body.follower.set_mass_in_star(0, 2.0 * mass, star);
    body.follower.check_layout(&body.schedule).unwrap();
}

/// So is a tet that a schedule still names although it is gone.
#[test]
#[should_panic(expected = "the schedule belongs to these tets")]
fn a_tet_that_is_gone_cannot_be_solved() {
    let mesh = kuhn_box([1, 1, 1], DVec3::ONE);
    let mut body = SolverPair::<f64>::new(&mesh, &[RUBBER]);
    body.step(&settings());
    body.follower.truncate_tets(mesh.tets.len() - 1);
    let _ = body.follower.step(&body.schedule, &settings());
}
