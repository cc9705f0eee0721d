//! [`Masses`]: the masses of the particles of an island, kept up to date through cuts.
//!
//! Each tet gives a quarter of its mass to each of its corners. A cut leaves particles that have small tets only. What
//! presses on such a particle moves it by many heights of its tets, because it is light, and the tets pass next to nothing
//! on to the body behind it: an iteration of Gauss-Seidel passes on about the ratio of both masses. Such tets turn inside
//! out, and their energy is then larger than that of all others. So in a scene with contact heavy corners of tets at cuts
//! lend mass to light ones. Without contact they do not: in single precision a light corner absorbs what rounding does to a
//! sliver, while a heavier one passes it on, and bodies with slivers never come to rest.
//!
//! Of two corners i and j of a tet with a corner that a cut made, j lends i the mass `max(0, f mⱼ - mᵢ) / (3 max(nᵢ, nⱼ))`
//! in that tet. Here m is the sum of the quarters, n the number of tets around the particle, and f is one half. Over all
//! tets a particle borrows at most what it lacks to half the mean mass of its neighbors, and lends at most half its mass.
//! A second round lends the masses of the first one in the same way, since neighbors of a light particle are often light.
//! Mass moves by two edges at most; weight and linear momentum stay. A body without cuts has quarters.
//!
//! A light particle may be fast. With its velocity what it borrows would have a large energy, so borrowed mass comes with the
//! velocity of the neighbors, except for particles that the cut makes, whose velocity is interpolated.
//!
//! Source: mass scaling in explicit finite elements (Olovsson, Simonsson and Unosson 2005), which adds mass where elements
//! are small; here it is moved. Cost: some ten times as much as quarters alone, for the particles around a cut.

use std::ops::{Add, Sub};

use glam::{DMat3, DVec3};
use incise_cutting::{CutDelta, CuttableMesh};
use incise_mesh::{ParticleId, TetId};
use incise_xpbd::ErasedSolver;

use crate::Error;

/// The part of a neighbor's mass up to which a particle at a cut borrows.
const LENT: f64 = 0.5;
/// How often mass is lent.
const ROUNDS: usize = 2;

/// The masses of all particles. The solver has those that count.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Masses {
    /// In kg before each round in which mass is lent; in the first one the quarters of the tets. No rounds in a scene without
    /// contact.
    rounds: Vec<Vec<f64>>,
}

impl Masses {
    /// Sets the masses of the particles of a mesh without cuts. O(tets).
    pub(crate) fn new(
        cuttable: &CuttableMesh,
        solver: &mut dyn ErasedSolver,
        has_contact: bool,
    ) -> Self {
        let (mut star, all) = (Vec::new(), 0..cuttable.mesh().positions.len());
        let quarters: Vec<f64> = all
            .map(|p| quarters(solver, cuttable, ParticleId::new(p), &mut star))
            .collect();
        for (p, &mass) in quarters.iter().enumerate() {
            solver.set_mass(p, mass);
        }
        let rounds = if has_contact { ROUNDS } else { 0 };
        Self {
            rounds: vec![quarters; rounds],
        }
    }

    /// Appends the masses of another island, whose particles get the next numbers.
    pub(crate) fn append(&mut self, other: &Self) {
        for (masses, others) in self.rounds.iter_mut().zip(&other.rounds) {
            masses.extend(others);
        }
    }

    /// Sets the masses of the particles around a change; `cuttable` and the tets of the solver are those after it. Lending
    /// keeps linear momentum, and an improvement keeps angular momentum, too: the particles around get what is missing as a
    /// rigid motion. Where one of them is held, the holder takes it. Costs what the change touched.
    pub(crate) fn apply_delta(
        &mut self,
        delta: &CutDelta,
        cuttable: &CuttableMesh,
        solver: &mut dyn ErasedSolver,
    ) {
        for masses in &mut self.rounds {
            masses.resize(delta.particles_after(), 0.0);
        }
        // The particles whose masses each round changes. Neighbors of those of a round change in the next one.
        let (mut particles, mut at_cut) = (touched(delta), Vec::new());
        let mut of_rounds = Vec::with_capacity(self.rounds.len());
        for _ in &self.rounds {
            let more = with_neighbors(cuttable, &particles);
            of_rounds.push(std::mem::replace(&mut particles, more.0));
            at_cut = more.1;
        }

        let regions = if self.rounds.is_empty() && !delta.is_improvement() {
            Vec::new()
        } else {
            regions(delta, &at_cut, &particles)
        };
        let mut before = Vec::with_capacity(regions.len());
        for region in &regions {
            let mut frame = Frame::of(solver, region);
            if delta.is_improvement() {
                frame.velocity = DVec3::ZERO;
            }
            before.push((frame, self.kept(delta, solver, region, frame)));
        }
        let borrowed = |masses: &Self, solver: &dyn ErasedSolver, p: &ParticleId| {
            let quarters = masses.rounds.first().map(|quarters| quarters[p.index()]);
            quarters.map_or(0.0, |quarters| solver.mass(p.index()) - quarters)
        };
        let borrowed_before: Vec<f64> = particles
            .iter()
            .map(|p| borrowed(self, solver, p))
            .collect();
        let mut star = Vec::new();
        for (round, particles) in of_rounds.iter().enumerate() {
            for &p in particles {
                let mass = self.before_round(round, solver, cuttable, p, &mut star);
                self.rounds[round][p.index()] = mass;
            }
        }
        let mut velocities = Vec::new();
        for (&p, &before) in particles.iter().zip(&borrowed_before) {
            let known = solver.mass(p.index());
            let mass = self.before_round(self.rounds.len(), solver, cuttable, p, &mut star);
            solver.set_mass_in_star(p.index(), mass, &mut star.iter().map(|tet| tet.index()));
            let more = borrowed(self, solver, &p) - before;
            if more > 0.0 && known > 0.0 {
                let around = self.velocity_around(solver, cuttable, p);
                let own = solver.velocity(p.index());
                velocities.push((p, own + (around - own) * (more / (known + more))));
            }
        }
        // In a cut the quarters keep the momentum that they have by interpolation.
        for (region, (frame, kept)) in regions.iter().zip(&mut before) {
            if let (Some(quarters), false) = (self.rounds.first(), delta.is_improvement()) {
                *kept = *kept + Momentum::of(solver, region, *frame, |p| quarters[p]);
            }
        }
        for (p, velocity) in velocities {
            if solver.is_free(p.index()) {
                solver.set_velocity(p.index(), velocity);
            }
        }
        for (region, (frame, kept)) in regions.iter().zip(before) {
            let missing = kept - Momentum::of(solver, region, frame, |p| solver.mass(p));
            if delta.is_improvement() {
                missing.give(solver, region, frame.point);
            } else {
                missing.give_linear(solver, region);
            }
        }
    }

    /// The momentum of a region before a change that it must keep: of what is lent, or all of it in an improvement.
    fn kept(
        &self,
        delta: &CutDelta,
        solver: &dyn ErasedSolver,
        region: &[ParticleId],
        frame: Frame,
    ) -> Momentum {
        Momentum::of(solver, region, frame, |p| {
            let quarters = self.rounds.first().map_or(0.0, |quarters| quarters[p]);
            let left = if delta.is_improvement() {
                0.0
            } else {
                quarters
            };
            solver.mass(p) - left
        })
    }

    /// The mean velocity of the neighbors of a particle in tets at cuts, by the masses that they lend from.
    fn velocity_around(
        &self,
        solver: &dyn ErasedSolver,
        cuttable: &CuttableMesh,
        particle: ParticleId,
    ) -> DVec3 {
        let (mut momentum, mut mass) = (DVec3::ZERO, 0.0);
        let Some(masses) = self.rounds.last() else {
            return solver.velocity(particle.index());
        };
        let at_cut = cuttable
            .around(particle)
            .filter_map(|tet| corners_at_cut(cuttable, tet));
        for other in at_cut.flatten().filter(|q| *q != particle) {
            let of_other = masses[other.index()];
            mass += of_other;
            momentum += of_other * solver.velocity(other.index());
        }
        if mass > 0.0 {
            momentum / mass
        } else {
            solver.velocity(particle.index())
        }
    }

    /// Computes the mass of a particle before a round, or after the last one; `star` has the tets around it afterwards,
    /// ascending. O(tets around it and its neighbors).
    fn before_round(
        &self,
        round: usize,
        solver: &dyn ErasedSolver,
        cuttable: &CuttableMesh,
        particle: ParticleId,
        star: &mut Vec<TetId>,
    ) -> f64 {
        match round.checked_sub(1) {
            None => quarters(solver, cuttable, particle, star),
            Some(before) => lend(&self.rounds[before], cuttable, particle, star),
        }
    }

    /// Recomputes all masses and compares. O(tets).
    pub(crate) fn check(
        &self,
        cuttable: &CuttableMesh,
        solver: &dyn ErasedSolver,
    ) -> Result<(), Error> {
        let mut star = Vec::new();
        for p in 0..cuttable.mesh().positions.len() {
            for round in 0..=self.rounds.len() {
                let stored = match self.rounds.get(round) {
                    Some(masses) => masses.get(p).copied(),
                    None => Some(solver.mass(p)),
                };
                let particle = ParticleId::new(p);
                let fresh = self.before_round(round, solver, cuttable, particle, &mut star);
                let differs = |stored: f64| (stored - fresh).abs() > 1e-12 * fresh;
                if stored.is_none_or(differs) {
                    return Err(Error::Inconsistent(format!(
                        "particle {p} has mass {stored:?} instead of {fresh} before round {round}"
                    )));
                }
            }
        }
        Ok(())
    }

    /// Bytes of a copy.
    pub(crate) fn bytes(&self) -> usize {
        let bytes = |masses: &Vec<f64>| size_of_val(&**masses);
        self.rounds.iter().map(bytes).sum()
    }
}

/// Fills `star` with the tets around a particle, ascending.
fn find_star(cuttable: &CuttableMesh, particle: ParticleId, star: &mut Vec<TetId>) {
    star.clear();
    star.extend(cuttable.around(particle));
    star.sort_unstable();
}

/// A quarter of the mass of each tet around a particle, summed in the order of the tets, which `star` has afterwards.
fn quarters(
    solver: &dyn ErasedSolver,
    cuttable: &CuttableMesh,
    particle: ParticleId,
    star: &mut Vec<TetId>,
) -> f64 {
    find_star(cuttable, particle, star);
    let quarter = |t: &TetId| 0.25 * solver.density_of(t.index()) * cuttable.mesh().volume(*t);
    // Rounding can make the volume of a sliver negative.
    star.iter().map(quarter).sum::<f64>().max(0.0)
}

/// What a particle has of these masses after a round of lending; `star` has the tets around it afterwards, ascending.
fn lend(
    masses: &[f64],
    cuttable: &CuttableMesh,
    particle: ParticleId,
    star: &mut Vec<TetId>,
) -> f64 {
    find_star(cuttable, particle, star);
    let (own, tets) = (masses[particle.index()], star.len());
    let mut mass = own;
    for corners in star.iter().filter_map(|&tet| corners_at_cut(cuttable, tet)) {
        for other in corners.into_iter().filter(|q| *q != particle) {
            let others = masses[other.index()];
            let (lacks, spares) = (LENT * others - own, LENT * own - others);
            if lacks > 0.0 || spares > 0.0 {
                let tets = tets.max(cuttable.around(other).count());
                mass += (lacks.max(0.0) - spares.max(0.0)) / (3 * tets) as f64;
            }
        }
    }
    mass
}

/// Particles and their neighbors in tets at cuts, ascending, and the corners of these tets.
fn with_neighbors(
    cuttable: &CuttableMesh,
    particles: &[ParticleId],
) -> (Vec<ParticleId>, Vec<[ParticleId; 4]>) {
    let around = particles.iter().flat_map(|&p| cuttable.around(p));
    let mut tets: Vec<TetId> = around.collect();
    tets.sort_unstable();
    tets.dedup();
    let at_cut = tets.iter().filter_map(|&tet| corners_at_cut(cuttable, tet));
    let at_cut: Vec<[ParticleId; 4]> = at_cut.collect();
    let mut all = particles.to_vec();
    all.extend(at_cut.iter().flatten());
    all.sort_unstable();
    all.dedup();
    (all, at_cut)
}

/// The corners of a tet if a cut made one of them.
fn corners_at_cut(cuttable: &CuttableMesh, tet: TetId) -> Option<[ParticleId; 4]> {
    let corners = cuttable.mesh().tets[tet.index()];
    let is_made = |p: &ParticleId| !cuttable.is_original(*p);
    corners.iter().any(is_made).then_some(corners)
}

/// The particles whose tets changed, ascending.
fn touched(delta: &CutDelta) -> Vec<ParticleId> {
    let added = delta.added.iter().flat_map(|tet| tet.corners);
    let relinked = delta
        .relinked
        .iter()
        .flat_map(|tet| tet.before.into_iter().chain(tet.after));
    let removed = delta.removed.iter().chain(&delta.deleted);
    let removed = removed.flat_map(|tet| tet.corners);
    let mut touched: Vec<ParticleId> = added.chain(relinked).chain(removed).collect();
    touched.sort_unstable();
    touched.dedup();
    touched
}

/// Splits particles, ascending, into regions that are connected by the tets that a change reshaped, deleted or left at a cut.
/// Each region ascends.
fn regions(
    delta: &CutDelta,
    at_cut: &[[ParticleId; 4]],
    particles: &[ParticleId],
) -> Vec<Vec<ParticleId>> {
    let mut root: Vec<usize> = (0..particles.len()).collect();
    let find = |root: &mut Vec<usize>, mut i: usize| {
        while root[i] != i {
            root[i] = root[root[i]];
            i = root[i];
        }
        i
    };
    let before = delta.removed.iter().chain(&delta.deleted);
    let before = before.map(|tet| tet.corners);
    let after = delta.added.iter().map(|tet| tet.corners);
    let relinked = delta.relinked.iter();
    let relinked = relinked.flat_map(|tet| [tet.before, tet.after]);
    let at_cut = at_cut.iter().copied();
    for corners in before.chain(after).chain(relinked).chain(at_cut) {
        let indices = corners.map(|p| particles.partition_point(|q| *q < p));
        for index in indices {
            let [one, other] = [indices[0], index].map(|i| find(&mut root, i));
            root[one.max(other)] = one.min(other);
        }
    }
    let mut by_root: Vec<(usize, ParticleId)> = Vec::with_capacity(particles.len());
    for (i, &particle) in particles.iter().enumerate() {
        by_root.push((find(&mut root, i), particle));
    }
    by_root.sort_unstable();
    let regions = by_root.chunk_by(|a, b| a.0 == b.0);
    regions
        .map(|region| region.iter().map(|&(_, p)| p).collect())
        .collect()
}

/// A frame that moves with some particles.
#[derive(Clone, Copy, Default)]
struct Frame {
    point: DVec3,
    velocity: DVec3,
}

impl Frame {
    /// The mean position and velocity of particles.
    fn of(solver: &dyn ErasedSolver, particles: &[ParticleId]) -> Self {
        let mut sum = Self::default();
        for p in particles.iter().map(|p| p.index()) {
            sum.point += solver.position(p);
            sum.velocity += solver.velocity(p);
        }
        let count = particles.len().max(1) as f64;
        Self {
            point: sum.point / count,
            velocity: sum.velocity / count,
        }
    }
}

/// Linear and angular momentum in a frame, the latter about its point.
#[derive(Clone, Copy)]
struct Momentum {
    linear: DVec3,
    angular: DVec3,
}

impl Add for Momentum {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            linear: self.linear + other.linear,
            angular: self.angular + other.angular,
        }
    }
}

impl Sub for Momentum {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self {
            linear: self.linear - other.linear,
            angular: self.angular - other.angular,
        }
    }
}

impl Momentum {
    /// The momentum of particles with these masses. Those that are held have no velocity.
    fn of(
        solver: &dyn ErasedSolver,
        particles: &[ParticleId],
        frame: Frame,
        mass: impl Fn(usize) -> f64,
    ) -> Self {
        let (mut linear, mut angular) = (DVec3::ZERO, DVec3::ZERO);
        for p in particles.iter().map(|p| p.index()) {
            let momentum = mass(p) * (solver.velocity(p) - frame.velocity);
            linear += momentum;
            angular += (solver.position(p) - frame.point).cross(momentum);
        }
        Self { linear, angular }
    }

    /// Gives particles this momentum about `point` in addition, with a rigid motion. Where one of them is held, none.
    fn give(self, solver: &mut dyn ErasedSolver, particles: &[ParticleId], point: DVec3) {
        let Some((moves, total)) = movable(solver, particles) else {
            return;
        };
        let sum = moves
            .iter()
            .map(|&p| solver.mass(p) * (solver.position(p) - point));
        let center = sum.sum::<DVec3>() / total;
        let turn = self.angular - center.cross(self.linear);
        // Sum of m (r² 1 - r rᵀ).
        let mut inertia = DMat3::ZERO;
        for &p in &moves {
            let r = solver.position(p) - point - center;
            let outer = DMat3::from_cols(r * r.x, r * r.y, r * r.z);
            inertia +=
                (DMat3::from_diagonal(DVec3::splat(r.length_squared())) - outer) * solver.mass(p);
        }
        let rotation = inertia.inverse() * turn;
        let rotation = if rotation.is_finite() {
            rotation
        } else {
            DVec3::ZERO
        };
        for p in moves {
            let r = solver.position(p) - point - center;
            let change = self.linear / total + rotation.cross(r);
            solver.set_velocity(p, solver.velocity(p) + change);
        }
    }

    /// Gives particles the linear momentum in addition. Where one of them is held, none.
    fn give_linear(self, solver: &mut dyn ErasedSolver, particles: &[ParticleId]) {
        if self.linear == DVec3::ZERO {
            return;
        }
        let Some((moves, total)) = movable(solver, particles) else {
            return;
        };
        for p in moves {
            solver.set_velocity(p, solver.velocity(p) + self.linear / total);
        }
    }
}

/// The particles that have mass, and their mass in kg; `None` if one is held or none has mass.
fn movable(solver: &dyn ErasedSolver, particles: &[ParticleId]) -> Option<(Vec<usize>, f64)> {
    let particles = particles.iter().map(|p| p.index());
    let moves: Vec<usize> = particles.filter(|&p| solver.mass(p) > 0.0).collect();
    let total: f64 = moves.iter().map(|&p| solver.mass(p)).sum();
    let is_free = moves.iter().all(|&p| solver.is_free(p));
    (is_free && total > 0.0).then_some((moves, total))
}

#[cfg(test)]
mod tests {
    use incise_cutting::{
        CutOptions, ImproveOptions, ImproveQueue, Plane, StrokeRegistry, cut_plane, improve,
    };
    use incise_mesh::{TetMesh, kuhn_box};
    use incise_xpbd::Material;
    use proptest::prelude::*;

    use super::*;
    use crate::backend::AnySolver;
    use crate::scene::Precision;

    /// A twisted body with its solver.
    struct Body {
        cuttable: CuttableMesh,
        solver: AnySolver,
        masses: Masses,
    }

    impl Body {
        fn new(mesh: &TetMesh, velocity: impl Fn(DVec3) -> DVec3) -> Self {
            let cuttable = CuttableMesh::new(mesh.clone()).unwrap();
            let mut any = AnySolver::of_particles(Precision::F64, &mesh.positions);
            let solver = any.edit().unwrap();
            let material = Material {
                young_modulus: 1e5,
                poisson_ratio: 0.4,
                density: 1100.0,
                damping: 0.0,
            };
            solver.add_material(material).unwrap();
            for (t, tet) in mesh.tets.iter().enumerate() {
                solver.push_tet(tet.map(|p| p.0), mesh.corners(TetId::new(t)), 0);
            }
            for (p, x) in mesh.positions.iter().enumerate() {
                let (sin, cos) = (0.4 * x.z).sin_cos();
                let twisted = DVec3::new(cos * x.x - sin * x.y, sin * x.x + cos * x.y, x.z);
                solver.set_position(p, twisted);
                solver.set_velocity(p, velocity(twisted));
            }
            let masses = Masses::new(&cuttable, solver, true);
            Self {
                cuttable,
                solver: any,
                masses,
            }
        }

        fn positions(&self) -> Vec<DVec3> {
            let mut positions = Vec::new();
            self.solver.host().positions(&mut positions);
            positions
        }

        fn particles(&self) -> Vec<ParticleId> {
            let all = 0..self.solver.host().particle_count();
            all.map(ParticleId::new).collect()
        }

        fn mass(&self) -> f64 {
            let solver = self.solver.host();
            self.particles()
                .iter()
                .map(|p| solver.mass(p.index()))
                .sum()
        }

        fn momentum(&self) -> Momentum {
            let solver = self.solver.host();
            Momentum::of(solver, &self.particles(), Frame::default(), |p| {
                solver.mass(p)
            })
        }

        fn apply(&mut self, delta: &CutDelta) {
            let Self {
                cuttable,
                solver,
                masses,
            } = self;
            solver.apply_delta(delta, cuttable, masses).unwrap();
            masses.check(cuttable, solver.host()).unwrap();
        }

        fn cut(&mut self, plane: &Plane, snap: f64) -> CutDelta {
            let options = CutOptions {
                snap,
                ..CutOptions::default()
            };
            let positions = self.positions();
            let delta = cut_plane(&mut self.cuttable, &positions, plane, &options).unwrap();
            self.apply(&delta);
            delta
        }
    }

    fn differs(a: DVec3, b: DVec3) -> f64 {
        a.distance(b) / a.length()
    }

    fn tumble(x: DVec3) -> DVec3 {
        DVec3::new(0.3, -0.2, 1.0) + DVec3::new(2.0, 1.0, -3.0).cross(x)
    }

    /// A twisted, tumbling body is cut and improved: mass, linear and angular momentum stay to 1e-12.
    #[test]
    fn improvement_keeps_mass_and_momentum() {
        for snap in [0.0, 0.1] {
            let velocity = |x: DVec3| DVec3::new(x.y * x.z, 1.0 - x.x, (7.0 * x.x).sin());
            let mut body = Body::new(&kuhn_box([5; 3], DVec3::ONE), velocity);
            let mut queue = ImproveQueue::default();
            for (point, normal) in [(0.43, DVec3::X), (0.48, DVec3::new(1.0, 0.3, 0.1))] {
                let point = DVec3::splat(point);
                let delta = body.cut(&Plane { point, normal }, snap);
                queue.extend(delta.created_particles());
            }
            let (mass, before, positions) = (body.mass(), body.momentum(), body.positions());
            let options = ImproveOptions::default();
            let registry = StrokeRegistry::default();
            let mesh = &mut body.cuttable;
            let delta = improve(mesh, &positions, &mut queue, &options, &registry, |_, _| {
                false
            });
            let delta = delta.unwrap();
            assert!(delta.collapsed > 10);
            body.apply(&delta);
            let after = body.momentum();
            assert_eq!(positions, body.positions());
            assert!((body.mass() / mass - 1.0).abs() < 1e-12);
            assert!(differs(before.linear, after.linear) < 1e-12);
            assert!(differs(before.angular, after.angular) < 1e-12);
        }
    }

    /// Without cuts each particle has its quarters to the bit, also beside corners with a single tet.
    #[test]
    fn a_body_without_cuts_lends_nothing() {
        let body = Body::new(&kuhn_box([3; 3], DVec3::ONE), tumble);
        for (p, quarters) in body.masses.rounds[0].iter().enumerate() {
            assert_eq!(body.solver.host().mass(p), *quarters);
        }
    }

    /// A plane 1e-6 of an edge beside a layer of particles leaves particles with a millionth of the mean mass. The body is
    /// twisted about z, so its layers of z are planes.
    #[test]
    fn light_particles_borrow_a_percent_and_more() {
        let mut body = Body::new(&kuhn_box([4; 3], DVec3::ONE), |_| DVec3::ZERO);
        let point = DVec3::splat(0.5 + 0.25e-6);
        let normal = DVec3::Z;
        body.cut(&Plane { point, normal }, 0.0);
        let particles = body.particles();
        let mean = body.mass() / particles.len() as f64;
        let lightest = |mass: &dyn Fn(usize) -> f64| {
            let masses = particles.iter().map(|p| mass(p.index()));
            masses.fold(f64::INFINITY, f64::min) / mean
        };
        assert!(lightest(&|p| body.masses.rounds[0][p]) < 1e-6);
        assert!(lightest(&|p| body.solver.host().mass(p)) > 0.01);
    }

    /// The center of mass of a box of 10,000 tets that planes cut oblique moves by less than 1e-4 of its size.
    #[test]
    fn lending_hardly_moves_the_center_of_mass() {
        let mut body = Body::new(&kuhn_box([12; 3], DVec3::ONE), |_| DVec3::ZERO);
        for (point, normal) in [(0.42, [1.0, 0.3, 0.2]), (0.57, [0.1, -0.4, 1.0])] {
            let (point, normal) = (DVec3::splat(point), DVec3::from(normal));
            body.cut(&Plane { point, normal }, 0.1);
            let rest = &body.cuttable.mesh().positions;
            let center = |mass: &dyn Fn(usize) -> f64| {
                let moments = rest.iter().enumerate().map(|(p, x)| mass(p) * *x);
                moments.sum::<DVec3>() / body.mass()
            };
            let moved =
                center(&|p| body.solver.host().mass(p)) - center(&|p| body.masses.rounds[0][p]);
            assert!(moved.length() < 1e-4 && moved.length() > 0.0, "{moved}");
        }
    }

    /// Two particles beside held ones are thrown by a rigid motion: their inertia about the line through both is 0. A soak had
    /// speeds of 1e6 m/s after that.
    #[test]
    fn particles_beside_held_ones_get_no_momentum() {
        let mut body = Body::new(&kuhn_box([1; 3], DVec3::ONE), tumble);
        let particles = body.particles();
        let solver = body.solver.edit().unwrap();
        (2..particles.len()).for_each(|p| solver.set_fixed(p, true));
        let before = [0, 1].map(|p| solver.velocity(p));
        let momentum = Momentum {
            linear: DVec3::X,
            angular: DVec3::ONE,
        };
        momentum.give(solver, &particles, DVec3::ZERO);
        momentum.give_linear(solver, &particles);
        assert_eq!(before, [0, 1].map(|p| solver.velocity(p)));
    }

    /// A body that flies without turning keeps its velocity to rounding, wherever the origin is.
    #[test]
    fn lending_turns_nothing_that_flies() {
        let plane = Plane {
            point: DVec3::new(0.52, 0.3, 0.4),
            normal: DVec3::new(1.0, 0.2, 0.1),
        };
        let velocity = DVec3::new(3.0, -2.0, 7.0);
        let mut body = Body::new(&kuhn_box([5; 3], DVec3::ONE), |_| velocity);
        body.cut(&plane, 0.0);
        let solver = body.solver.host();
        for p in body.particles() {
            assert!(solver.velocity(p.index()).distance(velocity) < 1e-13);
        }
    }

    /// What particles have after two rounds, by the formula, tet after tet and for each pair of corners.
    fn lent(body: &Body) -> Vec<f64> {
        let mesh = body.cuttable.mesh();
        let mut tets = vec![0.0_f64; mesh.positions.len()];
        let mut masses = tets.clone();
        for (t, corners) in mesh.tets.iter().enumerate() {
            for p in corners.map(ParticleId::index) {
                tets[p] += 1.0;
                masses[p] += 0.25 * 1100.0 * mesh.volume(TetId::new(t));
            }
        }
        for _ in 0..2 {
            let own = masses.clone();
            for corners in &mesh.tets {
                if corners.iter().all(|p| body.cuttable.is_original(*p)) {
                    continue;
                }
                for i in corners.map(ParticleId::index) {
                    for j in corners.map(ParticleId::index) {
                        let lacks = (0.5 * own[j] - own[i]).max(0.0);
                        let moved = lacks / (3.0 * tets[i].max(tets[j]));
                        masses[i] += moved;
                        masses[j] -= moved;
                    }
                }
            }
        }
        masses
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        /// Cuts one after the other: masses are those of the slow version, none lends more than three quarters or borrows up
        /// to more than half of the heaviest; mass and momentum stay.
        #[test]
        fn cuts_lend_by_the_formula_and_keep_momentum(
            planes in prop::collection::vec((prop::array::uniform3(0.2..0.8), prop::array::uniform3(-1.0..1.0)), 1..4),
            snap in prop::sample::select(vec![0.0, 0.1]),
        ) {
            let mut body = Body::new(&kuhn_box([3; 3], DVec3::ONE), tumble);
            let (mass, linear) = (body.mass(), body.momentum().linear);
            for (point, normal) in planes {
                let normal = DVec3::from(normal);
                prop_assume!(normal.length() > 0.1);
                body.cut(&Plane { point: point.into(), normal }, snap);
                prop_assert!((body.mass() / mass - 1.0).abs() < 1e-12);
                prop_assert!(differs(linear, body.momentum().linear) < 1e-12);
                let slow = lent(&body);
                let heaviest = body.masses.rounds[0].iter().copied().fold(0.0, f64::max);
                for p in body.particles() {
                    let (own, now) = (body.masses.rounds[0][p.index()], body.solver.host().mass(p.index()));
                    prop_assert!((slow[p.index()] - now).abs() <= 1e-12 * now);
                    prop_assert!(now >= 0.25 * own * (1.0 - 1e-12));
                    prop_assert!(now <= own.max(0.5 * heaviest) * (1.0 + 1e-12));
                }
            }
        }
    }
}
