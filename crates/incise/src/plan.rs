//! [`Plan`]: clusters, colors and the schedule of a simulation, and their local update after a cut.

use std::num::NonZeroUsize;
use std::time::Instant;

use incise_clustering::{Method, cluster, update_local};
use incise_coloring::{Algorithm, color, extend_first_fit};
use incise_cutting::{CutDelta, CuttableMesh};
use incise_graph::{ClusterId, Clustering, Coloring, ConstraintGraph, Incidence, Schedule};
use incise_mesh::TetMesh;

use crate::report::{Milliseconds, milliseconds};
use crate::{Error, Scene};

/// Who is solved when.
#[derive(Debug)]
pub(crate) struct Plan {
    pub(crate) clustering: Clustering,
    pub(crate) coloring: Coloring,
    pub(crate) schedule: Schedule,
    /// The largest size of a cluster.
    limit: NonZeroUsize,
}

impl Plan {
    pub(crate) fn new(scene: &Scene, mesh: &TetMesh) -> Result<Self, Error> {
        let _span = tracing::debug_span!("incise::plan").entered();
        let method: Method = scene.solver.clustering.parse()?;
        let algorithm = Algorithm::from_name(&scene.solver.coloring)?;
        let incidence = incidence(mesh)?;
        let graph = ConstraintGraph::from_incidence(&incidence);
        let clustering = cluster(method, &incidence);
        let coloring = color(algorithm, &graph.quotient(&clustering));
        let schedule = Schedule::new(&clustering, &coloring);
        Ok(Self {
            clustering,
            coloring,
            schedule,
            limit: method.max_size(),
        })
    }

    /// Follows a cut: the cut tets leave their clusters, the children on each side of each become new clusters, and
    /// these get colors; everything else stays. Only the schedule is sorted anew as a whole.
    pub(crate) fn follow(
        &mut self,
        delta: &CutDelta,
        cuttable: &CuttableMesh,
        ms: &mut Milliseconds,
    ) -> Result<(), Error> {
        let start = Instant::now();
        let new = self.update_clusters(delta)?;
        let clustered = Instant::now();
        self.color_new(&new, delta, cuttable);
        let colored = Instant::now();
        self.schedule.rebuild(&self.clustering, &self.coloring);
        ms.cluster += milliseconds(clustered - start);
        ms.color += milliseconds(colored - clustered);
        ms.schedule += milliseconds(colored.elapsed());
        Ok(())
    }

    fn update_clusters(&mut self, delta: &CutDelta) -> Result<Vec<ClusterId>, Error> {
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
        Ok(update_local(
            &mut self.clustering,
            &removed,
            &offsets,
            &values,
            self.limit,
        )?)
    }

    /// Colors the new clusters against all that share a particle with them.
    fn color_new(&mut self, new: &[ClusterId], delta: &CutDelta, cuttable: &CuttableMesh) {
        let _span = tracing::debug_span!("incise::color").entered();
        let clustering = &self.clustering;
        let cluster_of = |tet: usize| {
            clustering
                .cluster_of(tet)
                .map_or(u32::MAX, |cluster| cluster.0)
        };
        let mut members: Vec<(u32, usize)> = delta
            .added
            .iter()
            .map(|tet| (cluster_of(tet.tet.index()), tet.tet.index()))
            .collect();
        members.sort_unstable();
        let new: Vec<u32> = new.iter().map(|cluster| cluster.0).collect();
        extend_first_fit(&mut self.coloring, &new, |cluster, neighbors| {
            let first = members.partition_point(|m| m.0 < cluster);
            for &(_, tet) in members[first..].iter().take_while(|m| m.0 == cluster) {
                for particle in cuttable.mesh().tets[tet] {
                    neighbors.extend(cuttable.around(particle).map(|t| cluster_of(t.index())));
                }
            }
        });
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
        self.coloring
            .verify_incidence(&incidence.quotient(&self.clustering))?;
        self.schedule.check(&incidence)?;
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
