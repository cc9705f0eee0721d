//! [`Plan`]: clusters, colors and the schedule of a simulation, and their local update after a cut.

use std::num::NonZeroUsize;
use std::time::Instant;

use incise_clustering::{Method, cluster, update_local};
use incise_coloring::{Algorithm, Recoloring, color};
use incise_cutting::CutDelta;
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
    /// The largest size of a cluster.
    limit: NonZeroUsize,
}

impl Plan {
    pub(crate) fn new(scene: &Scene, mesh: &TetMesh) -> Result<Self, Error> {
        let _span = tracing::debug_span!("incise::plan").entered();
        let method: Method = scene.solver.clustering.parse()?;
        let algorithm: Algorithm = scene.solver.coloring.parse()?;
        let incidence = incidence(mesh)?;
        let clustering = cluster(method, &incidence);
        let coloring = color(algorithm, &incidence.quotient(&clustering), 0)?.coloring;
        let schedule = Schedule::new(&clustering, &coloring);
        let tets = mesh.tets.iter().zip(clustering.labels());
        let pairs = tets.flat_map(|(corners, cluster)| corners.map(|p| (cluster.0, p.0)));
        let recoloring = Recoloring::with_coloring(pairs, coloring, SLACK)?;
        Ok(Self {
            clustering,
            recoloring,
            schedule,
            limit: method.max_size(),
        })
    }

    /// The color of each cluster.
    pub(crate) fn coloring(&self) -> &Coloring {
        self.recoloring.coloring()
    }

    /// Follows a cut: the cut tets leave their clusters, the children on each side of each become new clusters, and
    /// these get colors; everything else stays.
    pub(crate) fn follow(&mut self, delta: &CutDelta, ms: &mut Milliseconds) -> Result<(), Error> {
        let start = Instant::now();
        let mut removed = Vec::with_capacity(4 * delta.removed.len());
        for tet in &delta.removed {
            self.pair_up(tet.tet, tet.corners, &mut removed);
        }
        self.update_clusters(delta)?;
        let clustered = Instant::now();
        let all = self.recolor(delta, removed)?;
        let colored = Instant::now();
        self.reschedule(delta, all);
        ms.cluster += milliseconds(clustered - start);
        ms.color += milliseconds(colored - clustered);
        ms.schedule += milliseconds(colored.elapsed());
        Ok(())
    }

    /// Lists the particles of a tet as pairs with its cluster.
    fn pair_up(&self, tet: TetId, corners: [ParticleId; 4], pairs: &mut Vec<(u32, u32)>) {
        if let Some(cluster) = self.clustering.cluster_of(tet.index()) {
            pairs.extend(corners.map(|p| (cluster.0, p.0)));
        }
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
            self.limit,
        )?;
        Ok(())
    }

    /// Colors the new clusters, and old ones where the cut brought them new particles; returns whether all clusters have
    /// been colored anew.
    fn recolor(&mut self, delta: &CutDelta, mut removed: Vec<(u32, u32)>) -> Result<bool, Error> {
        let _span = tracing::debug_span!("incise::color").entered();
        let mut added = Vec::with_capacity(4 * delta.added.len());
        for tet in &delta.added {
            self.pair_up(tet.tet, tet.corners, &mut added);
        }
        for tet in &delta.relinked {
            self.pair_up(tet.tet, tet.before, &mut removed);
            self.pair_up(tet.tet, tet.after, &mut added);
        }
        Ok(self.recoloring.apply(&removed, &added)?.full)
    }

    /// Lets the schedule follow clusters and colors.
    fn reschedule(&mut self, delta: &CutDelta, all: bool) {
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
            .collect();
        let changed = self.recoloring.changed().iter();
        let clusters: Vec<ClusterId> = changed.copied().map(ClusterId).collect();
        self.schedule
            .update(&self.clustering, coloring, &tets, &clusters);
    }

    /// Proves clusters, colors and schedule against the mesh, from scratch.
    pub(crate) fn check(&self, mesh: &TetMesh) -> Result<(), Error> {
        self.clustering.check()?;
        if self.clustering.max_size() > self.limit.get() {
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
