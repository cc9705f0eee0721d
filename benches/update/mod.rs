//! Cost of the updates of schedule and layout after a cut: twenty neighboring tets are halved, then joined again, in
//! turns all over the body. Both are edits of equal size; the body does not grow. Making the edit, its clusters, colors
//! and masses is not counted.

use std::num::NonZeroUsize;
use std::time::{Duration, Instant};

use incise::clustering::{serial_neighbor_incidence, update_local};
use incise::coloring::{Recoloring, auto};
use incise::graph::{ClusterId, Clustering, Incidence, Schedule};
use incise::mesh::glam::DVec3;
use incise::xpbd::Solver;
use incise_benches::Case;

const CUT: usize = 20;

/// The timed stages.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Stage {
    Schedule,
    Layout,
}

/// A body that is cut, with its schedule and the solver's layout.
#[derive(Debug)]
pub(crate) struct Updated {
    /// Whether everything is rebuilt instead of updated.
    rebuilds: bool,
    solver: Solver<f32>,
    rest: Vec<DVec3>,
    /// Particle -> tets.
    stars: Vec<Vec<usize>>,
    clustering: Clustering,
    recoloring: Recoloring,
    schedule: Schedule,
    /// Tets that are halved now, with their corners before.
    halved: Vec<(usize, [u32; 4])>,
    turn: usize,
    limit: NonZeroUsize,
}

impl Updated {
    pub(crate) fn new(case: &Case, solver: Solver<f32>, rebuilds: bool) -> Self {
        let tets = (0..solver.tet_count()).map(|t| solver.tet_particles(t));
        let count = solver.particle_count();
        let incidence = Incidence::from_constraints(count, tets.clone()).unwrap();
        let limit = NonZeroUsize::MIN.saturating_add(4);
        let clustering = serial_neighbor_incidence(&incidence, limit);
        let coloring = auto(&incidence.quotient(&clustering)).coloring;
        let schedule = Schedule::new(&clustering, &coloring);
        let mut stars = vec![Vec::new(); count];
        let mut pairs = Vec::new();
        for (t, tet) in tets.enumerate() {
            for p in tet {
                stars[p as usize].push(t);
                pairs.push((clustering.cluster_of(t).unwrap().0, p));
            }
        }
        assert_eq!(case.mesh.tets.len(), solver.tet_count());
        Self {
            rebuilds,
            rest: (0..count).map(|p| solver.position(p)).collect(),
            recoloring: Recoloring::with_coloring(pairs, coloring, usize::MAX).unwrap(),
            solver,
            stars,
            clustering,
            schedule,
            halved: Vec::new(),
            turn: 0,
            limit,
        }
    }

    /// Makes an edit and times the update of one stage.
    pub(crate) fn time(&mut self, stage: Stage) -> Duration {
        let (tets, clusters) = self.edit();
        let start = Instant::now();
        let coloring = self.recoloring.coloring();
        if self.rebuilds {
            self.schedule.rebuild(&self.clustering, coloring);
        } else {
            self.schedule
                .update(&self.clustering, coloring, &tets, &clusters);
        }
        let scheduled = Instant::now();
        self.solver.lay_out(&self.schedule);
        match stage {
            Stage::Schedule => scheduled - start,
            Stage::Layout => scheduled.elapsed(),
        }
    }

    /// Halves some tets, or joins them again; returns the tets and the clusters that changed.
    fn edit(&mut self) -> (Vec<u32>, Vec<ClusterId>) {
        let number = |t: usize| u32::try_from(t).unwrap();
        let mut touched = Vec::new();
        let (mut gone, mut new) = (Vec::new(), Vec::new());
        if self.halved.is_empty() {
            self.turn += 1;
            let start = self.turn * 7919 % (self.rest.len() - 1);
            // The tets around a particle and around a corner of one of these.
            let first = self.stars[start].iter();
            let next = self.solver.tet_particles(self.stars[start][0])[3] as usize;
            let mut tets: Vec<usize> = first.chain(&self.stars[next]).copied().collect();
            tets.sort_unstable();
            tets.dedup();
            tets.truncate(CUT);
            for t in tets {
                let tet @ [a, b, c, d] = self.solver.tet_particles(t);
                let m = number(self.rest.len());
                self.rest
                    .push((self.rest[a as usize] + self.rest[b as usize]) / 2.0);
                self.stars.push(Vec::new());
                self.solver
                    .push_particle_between(a as usize, b as usize, 0.5);
                gone.push((t, tet));
                new.push((t, [a, m, c, d]));
                new.push((self.solver.tet_count(), [m, b, c, d]));
                let rest = [m, b, c, d].map(|p| self.rest[p as usize]);
                self.solver.push_tet([m, b, c, d], rest, 0);
                self.halved.push((t, tet));
                touched.extend([a, b, c, d, m]);
            }
        } else {
            let count = self.solver.tet_count() - self.halved.len();
            let halved = std::mem::take(&mut self.halved);
            for (i, &(t, tet)) in halved.iter().enumerate() {
                gone.push((t, self.solver.tet_particles(t)));
                gone.push((count + i, self.solver.tet_particles(count + i)));
                new.push((t, tet));
                touched.extend(tet);
            }
            self.solver.truncate_tets(count);
        }
        for &(t, tet) in &new {
            let rest = tet.map(|p| self.rest[p as usize]);
            self.solver.replace_tet(t, tet, rest);
        }
        for &(t, tet) in &gone {
            for p in tet {
                self.stars[p as usize].retain(|&s| s != t);
            }
        }
        for &(t, tet) in &new {
            for p in tet {
                self.stars[p as usize].push(t);
            }
        }
        if self.halved.is_empty() {
            let count = self.rest.len() - gone.len() / 2;
            self.rest.truncate(count);
            self.stars.truncate(count);
            self.solver.truncate_particles(count);
        }
        touched.sort_unstable();
        touched.dedup();
        for &p in &touched {
            let p = p as usize;
            self.stars[p].sort_unstable();
            let star = self.stars[p].iter();
            let mass = star.map(|&t| {
                let corners = self.solver.tet_particles(t);
                let [a, b, c, d] = corners.map(|p| self.rest[p as usize]);
                self.solver.density_of(t) * (b - a).cross(c - a).dot(d - a) / 24.0
            });
            let mass = mass.sum();
            if self.rebuilds {
                self.solver.set_mass(p, mass);
            } else {
                let star = self.stars[p].iter().copied();
                self.solver.set_mass_in_star(p, mass, star);
            }
        }
        self.plan(&gone, &new)
    }

    /// Clusters and colors.
    fn plan(
        &mut self,
        gone: &[(usize, [u32; 4])],
        new: &[(usize, [u32; 4])],
    ) -> (Vec<u32>, Vec<ClusterId>) {
        let number = |t: usize| u32::try_from(t).unwrap();
        let pairs = |clustering: &Clustering, tets: &[(usize, [u32; 4])]| {
            let pairs = tets.iter().flat_map(|&(t, tet)| {
                let cluster = clustering.cluster_of(t).unwrap().0;
                tet.map(|p| (cluster, p))
            });
            pairs.collect::<Vec<_>>()
        };
        let removed = pairs(&self.clustering, gone);
        let gone: Vec<u32> = gone.iter().map(|tet| number(tet.0)).collect();
        let values: Vec<u32> = new.iter().map(|tet| number(tet.0)).collect();
        let pieces = new.len().div_ceil(2);
        let offsets: Vec<u32> = (0..=pieces)
            .map(|i| number((2 * i).min(new.len())))
            .collect();
        update_local(&mut self.clustering, &gone, &offsets, &values, self.limit).unwrap();
        let added = pairs(&self.clustering, new);
        self.recoloring.apply(&removed, &added).unwrap();
        let changed = self.recoloring.changed().iter();
        let clusters = changed.copied().map(ClusterId).collect();
        ([gone, values].concat(), clusters)
    }
}
