//! [`Partition`]: clusters, colors and the schedule of a simulation, and their local update after a cut.

use std::num::NonZeroUsize;

use incise_clustering::{MergeLists, Method, cluster, merge_small, update_local};
use incise_coloring::{Algorithm, Recoloring, color};
use incise_cutting::{CutDelta, CuttableMesh};
use incise_graph::{ClusterId, Clustering, Coloring, Incidence, Schedule};
use incise_mesh::{TetId, TetMesh};
use web_time::Instant;

use crate::report::{Milliseconds, milliseconds};
use crate::scene::SolverSpec;
use crate::{Error, Scene};

/// Number of colors that cuts may add before all clusters are recolored.
///
/// Each color is a barrier in every iteration, but a full coloring with its new schedule costs more than a frame. A
/// smaller slack causes more full colorings: with 4 a stroke through 89k tets in 14 colors met one, three frames long. A
/// larger one leaves a less dense layout.
const SLACK: usize = 8;

/// The clusters of a mesh, their colors, and the schedule in which they are solved.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Partition {
    pub(crate) clustering: Clustering,
    recoloring: Recoloring,
    pub(crate) schedule: Schedule,
    settings: PartitionSettings,
    /// Number of colors and mean cluster size after the last complete rebuild.
    rebuilt: [f64; 2],
    #[cfg_attr(feature = "save", serde(skip))]
    lists: Lists,
}

/// Settings of a partition: clustering, coloring, merging.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "save", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct PartitionSettings {
    method: Method,
    algorithm: Algorithm,
    /// Whether clusters that a cut leaves small are merged.
    merges: bool,
}

/// Work lists of an update, kept to avoid allocations in a frame.
#[derive(Debug, Default)]
struct Lists {
    /// Pairs of a cluster and a particle that are no more, one for each tet.
    removed: Vec<(u32, u32)>,
    /// Those that are new.
    added: Vec<(u32, u32)>,
    /// The clusters of the relinked tets before.
    relinked: Vec<ClusterId>,
    /// Tets in no cluster.
    loose: Vec<u32>,
    /// Tets whose clusters may be small.
    seeds: Vec<u32>,
    merging: MergeLists,
}

/// Copies are empty: the contents are only used during an update.
impl Clone for Lists {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl PartitionSettings {
    /// Reads the settings of a partition from those of the solver.
    pub(crate) fn new(solver: &SolverSpec) -> Result<Self, Error> {
        Ok(Self {
            method: solver.clustering.parse()?,
            algorithm: solver.coloring.parse()?,
            merges: solver.merge_clusters,
        })
    }

    /// The largest size of a cluster.
    fn limit(self) -> NonZeroUsize {
        self.method.max_size()
    }
}

impl Partition {
    pub(crate) fn new(scene: &Scene, mesh: &TetMesh) -> Result<Self, Error> {
        Self::of(PartitionSettings::new(&scene.solver)?, mesh)
    }

    /// Clusters and colors a mesh.
    pub(crate) fn of(settings: PartitionSettings, mesh: &TetMesh) -> Result<Self, Error> {
        let _span = tracing::debug_span!("incise::partition").entered();
        let incidence = incidence(mesh)?;
        let clustering = cluster(settings.method, &incidence);
        let coloring = color(settings.algorithm, &incidence.quotient(&clustering), 0)?.coloring;
        let schedule = Schedule::new(&clustering, &coloring);
        let tets = mesh.tets.iter().zip(clustering.labels());
        let pairs = tets.flat_map(|(corners, cluster)| corners.map(|p| (cluster.0, p.0)));
        let recoloring = Recoloring::with_coloring(pairs, coloring, SLACK)?;
        let mut partition = Self {
            clustering,
            recoloring,
            schedule,
            settings,
            rebuilt: [1.0; 2],
            lists: Lists::default(),
        };
        partition.rebuilt = partition.measures();
        Ok(partition)
    }

    pub(crate) fn settings(&self) -> PartitionSettings {
        self.settings
    }

    /// Degradation by cuts: its number of colors over that when it was rebuilt, or the mean size of its clusters then
    /// over that now, whichever is larger. O(1).
    pub(crate) fn degradation(&self) -> f64 {
        let ([colors, size], now) = (self.rebuilt, self.measures());
        (now[0] / colors).max(size / now[1])
    }

    /// The number of colors and the mean size of the clusters, both 1 if there are none. O(1).
    fn measures(&self) -> [f64; 2] {
        let clusters = self.clustering.occupied().max(1) as f64;
        let tets = self.clustering.constraint_count() as f64;
        let colors = self.recoloring.color_count() as f64;
        [colors.max(1.0), (tets / clusters).max(1.0)]
    }

    /// The color of each cluster.
    pub(crate) fn coloring(&self) -> &Coloring {
        self.recoloring.coloring()
    }

    /// Updates clusters, colors and schedule after a cut. Cut and deleted tets leave their clusters, the children join
    /// small clusters around or become new ones, clusters that stay small are merged, and clusters with new particles
    /// get a color; everything else stays. Without merging the children on each side of a cut tet become clusters of
    /// their own. `cuttable` is the mesh after the cut.
    pub(crate) fn apply_delta(
        &mut self,
        delta: &CutDelta,
        cuttable: &CuttableMesh,
        ms: &mut Milliseconds,
    ) -> Result<(), Error> {
        let start = Instant::now();
        self.take_out(delta);
        if self.settings.merges {
            let Lists { loose, seeds, .. } = &mut self.lists;
            loose.clear();
            loose.extend(delta.added.iter().map(|tet| delta.slot_after(tet.tet).0));
            // What is left of a cluster has a face at a child of what was cut, or in the new boundary.
            seeds.clear();
            seeds.extend(delta.surface_added.iter().map(|triangle| triangle.tet.0));
            self.merge(cuttable);
        } else {
            self.add_groups(delta)?;
        }
        let clustered = Instant::now();
        self.relink(delta);
        if self.settings.merges {
            self.link_merged(delta, cuttable);
        } else {
            self.link_groups(delta);
        }
        let all = self.recolor()?;
        let colored = Instant::now();
        self.reschedule(delta, all);
        ms.cluster += milliseconds(clustered - start);
        ms.color += milliseconds(colored - clustered);
        ms.schedule += milliseconds(colored.elapsed());
        Ok(())
    }

    /// Applies several deltas at once, the last of which left the mesh as `cuttable`. If clusters are merged, children
    /// stay loose until the end. Costs what the cuts changed, and O(tets).
    pub(crate) fn catch_up(
        &mut self,
        deltas: &[CutDelta],
        cuttable: &CuttableMesh,
    ) -> Result<(), Error> {
        if deltas.is_empty() {
            return Ok(());
        }
        let mut is_touched = vec![false; self.clustering.cluster_count()];
        for delta in deltas {
            self.take_out(delta);
            if self.settings.merges {
                for &(cluster, _) in &self.lists.removed {
                    is_touched[cluster as usize] = true;
                }
                self.relink(delta);
            } else {
                self.add_groups(delta)?;
                self.relink(delta);
                self.link_groups(delta);
            }
            self.recolor()?;
        }
        if self.settings.merges {
            let Lists { loose, seeds, .. } = &mut self.lists;
            loose.clear();
            seeds.clear();
            let labels = self.clustering.labels();
            for tet in 0..cuttable.mesh().tets.len() {
                let id = TetId::new(tet).0;
                match labels.get(tet) {
                    None | Some(&ClusterId::NONE) => loose.push(id),
                    Some(cluster) if is_touched[cluster.index()] => seeds.push(id),
                    Some(_) => {}
                }
            }
            self.merge(cuttable);
            self.link_merged(&CutDelta::default(), cuttable);
            self.recolor()?;
        }
        self.schedule
            .rebuild(&self.clustering, self.recoloring.coloring());
        self.rebuilt = self.measures();
        Ok(())
    }

    /// The cluster of a tet, if it is in one; it may be past the end.
    fn cluster_of(&self, tet: TetId) -> Option<ClusterId> {
        let label = self.clustering.labels().get(tet.index()).copied();
        label.filter(|&cluster| cluster != ClusterId::NONE)
    }

    /// Whether the tets that a delta gives other corners stay in their clusters: those of an improvement, unless clusters
    /// are merged around them. By themselves they would be clusters of one tet each.
    fn keeps(&self, delta: &CutDelta) -> bool {
        delta.is_improvement() && !self.settings.merges
    }

    /// Takes cut and deleted tets out of their clusters, and notes their pairs and the clusters of relinked tets.
    fn take_out(&mut self, delta: &CutDelta) {
        self.lists.relinked.clear();
        for tet in &delta.relinked {
            let cluster = self.cluster_of(tet.tet).unwrap_or(ClusterId::NONE);
            self.lists.relinked.push(cluster);
        }
        let keeps = self.keeps(delta);
        let removed = delta.removed.iter().map(|tet| (tet, keeps));
        let deleted = delta.deleted.iter().map(|tet| (tet, false));
        for (tet, keeps) in removed.chain(deleted) {
            if let Some(cluster) = self.cluster_of(tet.tet) {
                if !keeps {
                    self.clustering.remove(tet.tet.index());
                }
                let pairs = tet.corners.map(|p| (cluster.0, p.0));
                self.lists.removed.extend(pairs);
            }
        }
        for tet in &delta.moved {
            if tet.from.index() < self.clustering.constraint_count() {
                self.clustering.renumber(tet.from.index(), tet.to.index());
            }
        }
        self.clustering.truncate(delta.tets_after());
    }

    /// Makes clusters of the children on each side of each cut tet.
    fn add_groups(&mut self, delta: &CutDelta) -> Result<(), Error> {
        let _span = tracing::debug_span!("incise::cluster").entered();
        if self.keeps(delta) {
            return Ok(());
        }
        let mut children: Vec<_> = delta
            .added
            .iter()
            .map(|tet| (tet.parent, tet.positive, delta.slot_after(tet.tet).0))
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
        let limit = self.settings.limit();
        update_local(&mut self.clustering, &[], &offsets, &values, limit)?;
        Ok(())
    }

    /// Puts loose tets into clusters and merges the small ones around.
    fn merge(&mut self, cuttable: &CuttableMesh) {
        let _span = tracing::debug_span!("incise::merge").entered();
        merge_small(
            &mut self.lists.merging,
            &mut self.clustering,
            &self.lists.loose,
            &self.lists.seeds,
            self.settings.limit(),
            |tet| {
                let neighbors = cuttable.neighbors(TetId(tet)).into_iter();
                neighbors.flatten().map(|tet| tet.0)
            },
        );
    }

    /// Notes the pairs of tets with other corners, which may be in another cluster now.
    fn relink(&mut self, delta: &CutDelta) {
        let Lists {
            removed,
            added,
            relinked,
            ..
        } = &mut self.lists;
        for (tet, before) in delta.relinked.iter().zip(relinked) {
            if *before == ClusterId::NONE {
                continue;
            }
            let after = self.clustering.labels()[delta.slot_after(tet.tet).index()];
            for (p, q) in tet.before.into_iter().zip(tet.after) {
                if (*before, p) != (after, q) {
                    removed.push((before.0, p.0));
                    added.push((after.0, q.0));
                }
            }
        }
    }

    /// Notes the pairs of tets that were loose or moved.
    fn link_merged(&mut self, delta: &CutDelta, cuttable: &CuttableMesh) {
        let Lists {
            removed,
            added,
            merging,
            ..
        } = &mut self.lists;
        let (tets, labels) = (&cuttable.mesh().tets, self.clustering.labels());
        for moved in merging.moved() {
            let tet = TetId(moved.constraint);
            let before = slot_before(delta, tet);
            let relinked = delta.relinked.binary_search_by_key(&before, |tet| tet.tet);
            if relinked.is_err() {
                let corners = tets[tet.index()];
                removed.extend(corners.map(|p| (moved.from.0, p.0)));
                added.extend(corners.map(|p| (labels[tet.index()].0, p.0)));
            }
        }
        for &tet in merging.assigned() {
            let cluster = labels[tet as usize].0;
            added.extend(tets[tet as usize].map(|p| (cluster, p.0)));
        }
    }

    /// Notes the pairs of the children, where they are clusters of their own.
    fn link_groups(&mut self, delta: &CutDelta) {
        let labels = self.clustering.labels();
        for tet in &delta.added {
            let cluster = labels[delta.slot_after(tet.tet).index()].0;
            let pairs = tet.corners.map(|p| (cluster, p.0));
            self.lists.added.extend(pairs);
        }
    }

    /// Colors new clusters, and old ones that have new particles. Returns whether all clusters have been recolored.
    fn recolor(&mut self) -> Result<bool, Error> {
        let _span = tracing::debug_span!("incise::color").entered();
        // A new cluster may have been merged away at once, but its number is in use.
        self.recoloring.reserve(self.clustering.cluster_count());
        let Lists { removed, added, .. } = &mut self.lists;
        let full = self.recoloring.apply(removed, added)?.full;
        removed.clear();
        added.clear();
        Ok(full)
    }

    /// Updates the schedule after clusters and colors.
    fn reschedule(&mut self, delta: &CutDelta, all: bool) {
        let coloring = self.recoloring.coloring();
        if all {
            self.schedule.rebuild(&self.clustering, coloring);
            return;
        }
        let removed = delta.removed.iter().chain(&delta.deleted);
        // Empty if nothing is ever merged.
        let merged = self.lists.merging.moved();
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
        if self.clustering.max_size() > self.settings.limit().get() {
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
            .check_partition(&self.clustering, self.coloring())?;
        Ok(())
    }
}

/// The slot before the cut of a tet that is in this one now.
fn slot_before(delta: &CutDelta, tet: TetId) -> TetId {
    // Both ends of the moves ascend.
    let moved = delta.moved.binary_search_by_key(&tet, |moved| moved.to);
    moved.map_or(tet, |i| delta.moved[i].from)
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
    use incise_cutting::{MovedTet, RemovedTet};
    use incise_mesh::kuhn_box;

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
            let mut partition = Partition::new(&scene, &mesh).unwrap();
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
                partition.apply_delta(&delta, &cuttable, &mut ms).unwrap();
                partition.check(&mesh).unwrap();
                assert_eq!(partition.clustering.constraint_count(), mesh.tets.len());
            }
            assert!(moved > 50 && bite > 5, "{moved} moved in {bite} bites");
        }
    }
}
