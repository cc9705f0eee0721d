//! [`Plan`]: clusters, colors and the schedule of a simulation, and their local update after a cut.

use std::num::NonZeroUsize;
use std::time::Instant;

use incise_clustering::{Method, Moved, cluster, merge_small, update_local};
use incise_coloring::{Algorithm, Recoloring, color};
use incise_cutting::{CutDelta, CuttableMesh, RelinkedTet, RemovedTet};
use incise_graph::{ClusterId, Clustering, Coloring, Incidence, Schedule};
use incise_mesh::{ParticleId, TetId, TetMesh};

use crate::report::{Milliseconds, milliseconds};
use crate::{Error, Scene};

/// Colors that cuts may add before all clusters are colored anew: each color is a barrier in every iteration, but a
/// full coloring takes longer than a frame on a large body.
const SLACK: usize = 2;

/// Who is solved when.
#[derive(Debug)]
pub(crate) struct Plan {
    pub(crate) clustering: Clustering,
    recoloring: Recoloring,
    pub(crate) schedule: Schedule,
    recipe: Recipe,
}

/// How a plan is made and kept.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Recipe {
    method: Method,
    algorithm: Algorithm,
    /// Whether clusters that a cut leaves small are merged.
    merges: bool,
}

/// What a cut did to clusters, as they were before.
#[derive(Default)]
struct Edit<'a> {
    /// The tets that are no more.
    gone: Vec<(u32, &'a RemovedTet)>,
    /// Those with other corners.
    relinked: Vec<(u32, &'a RelinkedTet)>,
}

impl Recipe {
    /// The largest size of a cluster.
    fn limit(self) -> NonZeroUsize {
        self.method.max_size()
    }
}

impl Plan {
    pub(crate) fn new(scene: &Scene, mesh: &TetMesh) -> Result<Self, Error> {
        let recipe = Recipe {
            method: scene.solver.clustering.parse()?,
            algorithm: scene.solver.coloring.parse()?,
            merges: scene.solver.merge_clusters,
        };
        Self::of(recipe, mesh)
    }

    /// Clusters and colors a mesh.
    pub(crate) fn of(recipe: Recipe, mesh: &TetMesh) -> Result<Self, Error> {
        let _span = tracing::debug_span!("incise::plan").entered();
        let incidence = incidence(mesh)?;
        let clustering = cluster(recipe.method, &incidence);
        let coloring = color(recipe.algorithm, &incidence.quotient(&clustering), 0)?.coloring;
        let schedule = Schedule::new(&clustering, &coloring);
        let tets = mesh.tets.iter().zip(clustering.labels());
        let pairs = tets.flat_map(|(corners, cluster)| corners.map(|p| (cluster.0, p.0)));
        let recoloring = Recoloring::with_coloring(pairs, coloring, SLACK)?;
        Ok(Self {
            clustering,
            recoloring,
            schedule,
            recipe,
        })
    }

    pub(crate) fn recipe(&self) -> Recipe {
        self.recipe
    }

    /// The number of colors and the mean size of the clusters, both 1 if there are none. O(1).
    pub(crate) fn measures(&self) -> [f64; 2] {
        let clusters = self.clustering.occupied().max(1) as f64;
        let tets = self.clustering.constraint_count() as f64;
        let colors = self.recoloring.color_count() as f64;
        [colors.max(1.0), (tets / clusters).max(1.0)]
    }

    /// The color of each cluster.
    pub(crate) fn coloring(&self) -> &Coloring {
        self.recoloring.coloring()
    }

    /// Follows a cut: cut and deleted tets leave their clusters, the children on each side of a cut tet become new
    /// clusters, those around the cut that are small are merged, and who has new particles gets a color; everything else
    /// stays. `cuttable` is the mesh after the cut.
    pub(crate) fn follow(
        &mut self,
        delta: &CutDelta,
        cuttable: &CuttableMesh,
        ms: &mut Milliseconds,
    ) -> Result<(), Error> {
        let start = Instant::now();
        let edit = self.edit(delta)?;
        let merged = if self.recipe.merges {
            let seeds = self.seeds(delta, &edit.gone, cuttable);
            self.merge(&seeds, cuttable)
        } else {
            Vec::new()
        };
        let clustered = Instant::now();
        let all = self.recolor(delta, &edit, &merged, cuttable)?;
        let colored = Instant::now();
        self.reschedule(delta, &merged, all);
        ms.cluster += milliseconds(clustered - start);
        ms.color += milliseconds(colored - clustered);
        ms.schedule += milliseconds(colored.elapsed());
        Ok(())
    }

    /// Follows several cuts at once, whose last left the mesh as `cuttable`: each by itself first, then small clusters
    /// among all that they touched are merged. Costs what the cuts did, and O(tets).
    pub(crate) fn catch_up(
        &mut self,
        deltas: &[CutDelta],
        cuttable: &CuttableMesh,
    ) -> Result<(), Error> {
        if deltas.is_empty() {
            return Ok(());
        }
        let mut touched = Vec::new();
        for delta in deltas {
            let edit = self.edit(delta)?;
            touched.extend(edit.gone.iter().map(|(cluster, _)| *cluster));
            let labels = self.clustering.labels();
            touched.extend(delta.added.iter().map(|tet| labels[tet.tet.index()].0));
            self.recolor(delta, &edit, &[], cuttable)?;
        }
        if self.recipe.merges {
            let mut is_touched = vec![false; self.clustering.cluster_count()];
            for cluster in touched {
                is_touched[cluster as usize] = true;
            }
            let labels = (0..).zip(self.clustering.labels());
            let seeds = labels.filter(|(_, cluster)| is_touched[cluster.index()]);
            let seeds: Vec<u32> = seeds.map(|(tet, _)| tet).collect();
            let merged = self.merge(&seeds, cuttable);
            self.recolor(&CutDelta::default(), &Edit::default(), &merged, cuttable)?;
        }
        self.schedule
            .rebuild(&self.clustering, self.recoloring.coloring());
        Ok(())
    }

    /// Takes cut and deleted tets out of their clusters and makes clusters of the children.
    fn edit<'a>(&mut self, delta: &'a CutDelta) -> Result<Edit<'a>, Error> {
        let gone = delta.removed.iter().chain(&delta.deleted);
        let gone = gone
            .filter_map(|tet| Some((self.clustering.cluster_of(tet.tet.index())?.0, tet)))
            .collect();
        let relinked = delta.relinked.iter();
        let relinked = relinked
            .filter_map(|tet| Some((self.clustering.cluster_of(tet.tet.index())?.0, tet)))
            .collect();
        self.update_clusters(delta)?;
        Ok(Edit { gone, relinked })
    }

    fn update_clusters(&mut self, delta: &CutDelta) -> Result<(), Error> {
        let _span = tracing::debug_span!("incise::cluster").entered();
        let removed: Vec<u32> = delta.removed.iter().map(|tet| tet.tet.0).collect();
        let mut children: Vec<_> = delta
            .added
            .iter()
            .map(|tet| (tet.parent, tet.positive, tet.tet.0))
            .collect();
        children.sort_unstable();
        let mut offsets = vec![0];
        let mut values = Vec::with_capacity(children.len());
        for siblings in children.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            values.extend(siblings.iter().map(|child| child.2));
            offsets.push(
                u32::try_from(values.len())
                    .map_err(|_| Error::Inconsistent("too many tets".into()))?,
            );
        }
        update_local(
            &mut self.clustering,
            &removed,
            &offsets,
            &values,
            self.recipe.limit(),
        )?;
        for tet in &delta.deleted {
            self.clustering.remove(tet.tet.index());
        }
        for tet in &delta.moved {
            self.clustering.renumber(tet.from.index(), tet.to.index());
        }
        self.clustering.truncate(delta.tets_after());
        Ok(())
    }

    /// Tets of the clusters that a cut made or took from. Those that only come apart keep their size: they stay.
    fn seeds(
        &self,
        delta: &CutDelta,
        gone: &[(u32, &RemovedTet)],
        cuttable: &CuttableMesh,
    ) -> Vec<u32> {
        let mut shrunk: Vec<u32> = gone.iter().map(|(cluster, _)| *cluster).collect();
        shrunk.sort_unstable();
        shrunk.dedup();
        // What is left of a cluster hangs on particles of what is gone, or on copies of them.
        let corners = gone.iter().flat_map(|(_, tet)| tet.corners);
        let mut particles: Vec<ParticleId> = corners.collect();
        particles.sort_unstable();
        particles.dedup();
        let is_left = |tet: &TetId| {
            let cluster = self.clustering.cluster_of(tet.index());
            cluster.is_some_and(|cluster| shrunk.binary_search(&cluster.0).is_ok())
        };
        let around = particles.iter().flat_map(|&p| cuttable.around(p));
        let mut seeds: Vec<u32> = around.filter(is_left).map(|tet| tet.0).collect();
        seeds.extend(delta.added.iter().map(|tet| tet.tet.0));
        seeds
    }

    /// Merges the small ones of the clusters of some tets.
    fn merge(&mut self, seeds: &[u32], cuttable: &CuttableMesh) -> Vec<Moved> {
        let _span = tracing::debug_span!("incise::merge").entered();
        merge_small(
            &mut self.clustering,
            seeds,
            self.recipe.limit(),
            |tet| cuttable.mesh().tets[tet as usize].map(|p| p.0),
            |particle| cuttable.around(ParticleId(particle)).map(|tet| tet.0),
        )
    }

    /// Colors the new clusters, and old ones that the cut or a merger brought new particles. Returns whether all
    /// clusters have been colored anew.
    fn recolor(
        &mut self,
        delta: &CutDelta,
        edit: &Edit<'_>,
        merged: &[Moved],
        cuttable: &CuttableMesh,
    ) -> Result<bool, Error> {
        let _span = tracing::debug_span!("incise::color").entered();
        let label = |tet: TetId| self.clustering.labels()[tet.index()].0;
        let (mut removed, mut added) = (Vec::new(), Vec::new());
        for (cluster, tet) in &edit.gone {
            removed.extend(tet.corners.map(|p| (*cluster, p.0)));
        }
        for tet in &delta.added {
            let cluster = label(tet.tet);
            added.extend(tet.corners.map(|p| (cluster, p.0)));
        }
        for (before, tet) in &edit.relinked {
            let after = label(delta.slot_after(tet.tet));
            for (p, q) in tet.before.into_iter().zip(tet.after) {
                if (*before, p) != (after, q) {
                    removed.push((*before, p.0));
                    added.push((after, q.0));
                }
            }
        }
        let mut known: Vec<TetId> = delta.added.iter().map(|tet| tet.tet).collect();
        known.extend(delta.relinked.iter().map(|tet| delta.slot_after(tet.tet)));
        known.sort_unstable();
        for moved in merged {
            let tet = TetId(moved.constraint);
            if known.binary_search(&tet).is_err() {
                let corners = cuttable.mesh().tets[tet.index()];
                removed.extend(corners.map(|p| (moved.from.0, p.0)));
                added.extend(corners.map(|p| (label(tet), p.0)));
            }
        }
        // A new cluster may have been merged away at once, but its number is in use.
        self.recoloring.reserve(self.clustering.cluster_count());
        Ok(self.recoloring.apply(&removed, &added)?.full)
    }

    /// Lets the schedule follow clusters and colors.
    fn reschedule(&mut self, delta: &CutDelta, merged: &[Moved], all: bool) {
        let coloring = self.recoloring.coloring();
        if all {
            self.schedule.rebuild(&self.clustering, coloring);
            return;
        }
        let removed = delta.removed.iter().chain(&delta.deleted);
        let tets: Vec<u32> = removed
            .map(|tet| tet.tet)
            .chain(delta.added.iter().map(|tet| tet.tet))
            .chain(delta.moved.iter().flat_map(|tet| [tet.from, tet.to]))
            .map(|tet| tet.0)
            .chain(merged.iter().map(|moved| moved.constraint))
            .collect();
        let changed = self.recoloring.changed().iter();
        let clusters: Vec<ClusterId> = changed.copied().map(ClusterId).collect();
        self.schedule
            .update(&self.clustering, coloring, &tets, &clusters);
    }

    /// Proves clusters, colors and schedule against the mesh, from scratch.
    pub(crate) fn check(&self, mesh: &TetMesh) -> Result<(), Error> {
        self.clustering.check()?;
        if self.clustering.max_size() > self.recipe.limit().get() {
            return Err(Error::Inconsistent(format!(
                "a cluster has {} tets",
                self.clustering.max_size()
            )));
        }
        let incidence = incidence(mesh)?;
        self.recoloring.check()?;
        self.coloring()
            .verify_incidence(&incidence.quotient(&self.clustering))?;
        self.schedule.check(&incidence)?;
        self.schedule
            .check_plan(&self.clustering, self.coloring())?;
        Ok(())
    }
}

/// The particles of each tet as constraints.
pub(crate) fn incidence(mesh: &TetMesh) -> Result<Incidence, Error> {
    Ok(Incidence::from_constraints(
        mesh.positions.len(),
        mesh.tets.iter().copied(),
    )?)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use incise_cutting::MovedTet;
    use incise_mesh::generate::kuhn_box;

    use super::*;

    /// What taking some tets away changes; `gone` ascends.
    fn taking_away(mesh: &TetMesh, gone: &[usize]) -> CutDelta {
        let after = mesh.tets.len() - gone.len();
        let deleted = gone.iter().map(|&t| RemovedTet {
            tet: TetId::new(t),
            corners: mesh.tets[t],
        });
        let free = gone.iter().copied().filter(|&t| t < after);
        let last = (after..mesh.tets.len()).filter(|t| !gone.contains(t));
        let moved = last.zip(free).map(|(from, to)| MovedTet {
            from: TetId::new(from),
            to: TetId::new(to),
            corners: mesh.tets[from],
        });
        CutDelta {
            particles_before: mesh.positions.len(),
            tets_before: mesh.tets.len(),
            deleted: deleted.collect(),
            moved: moved.collect(),
            ..CutDelta::default()
        }
    }

    /// Bites of tets around one place after the other, down to a few tets, with and without merging.
    #[test]
    fn tets_taken_away_leave_clusters_and_others_take_over_their_numbers() {
        for merges in [true, false] {
            let mut scene = Scene::default();
            scene.solver.merge_clusters = merges;
            let mut mesh = kuhn_box([6, 6, 6], DVec3::ONE);
            let mut plan = Plan::new(&scene, &mesh).unwrap();
            let (mut moved, mut bite) = (0, 0);
            while mesh.tets.len() > 40 {
                let mut gone: Vec<usize> = if bite % 2 == 0 {
                    (0..mesh.tets.len()).skip(bite % 7).step_by(9).collect()
                } else {
                    (0..mesh.tets.len()).skip(10 * bite).take(30).collect()
                };
                gone.truncate(mesh.tets.len() - 1);
                bite += 1;
                let delta = taking_away(&mesh, &gone);
                moved += delta.moved.len();
                delta.apply(&mut mesh);
                let cuttable = CuttableMesh::new(mesh.clone()).unwrap();
                let mut ms = Milliseconds::default();
                plan.follow(&delta, &cuttable, &mut ms).unwrap();
                plan.check(&mesh).unwrap();
                assert_eq!(plan.clustering.constraint_count(), mesh.tets.len());
            }
            assert!(moved > 50 && bite > 5, "{moved} moved in {bite} bites");
        }
    }
}
