//! [`Schedule`]: the order in which a solver visits constraints: color after color, the clusters of a color in
//! parallel, the constraints of a cluster one after the other.
//!
//! A schedule is two ragged arrays, color -> clusters and cluster -> constraints, built by two counting sorts. Both are
//! [`Rows`], which can change in place, so that after a cut [`Schedule::update`] costs O(changes): a constraint leaves
//! or enters a cluster, a cluster leaves or enters a color. A journal of the changed clusters lets structures derived
//! from the schedule be updated in turn. Cost: O(constraints + clusters + colors) for a new schedule, without
//! allocation once the arrays have grown; amortized O(members of the changed clusters) for an update.

mod check;
mod journal;

use crate::csr::offset;
use crate::{ClusterId, Clustering, ColorId, Coloring, Rows};
use journal::Journal;

/// The color of a cluster without one.
const NONE: u32 = u32::MAX;

/// Color -> clusters -> constraints in solving order. The example is in the [crate
/// documentation](crate).
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Schedule {
    /// Color -> clusters.
    colors: Rows<ClusterId>,
    /// Cluster -> constraints, ascending.
    members: Rows<u32>,
    /// Constraint -> its cluster in this schedule.
    labels: Vec<ClusterId>,
    /// Cluster -> its color in this schedule and its position among the clusters of that color.
    slots: Vec<Slot>,
    journal: Journal,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Slot {
    color: u32,
    position: u32,
}

impl Slot {
    const NONE: Self = Self {
        color: NONE,
        position: NONE,
    };
}

/// Two schedules are equal if they solve the same constraints in the same order; their revisions do not count.
impl PartialEq for Schedule {
    fn eq(&self, other: &Self) -> bool {
        self.colors.rows().eq(other.colors.rows())
            && (0..self.color_count()).all(|color| {
                let clusters = self.clusters(color).iter();
                clusters
                    .copied()
                    .all(|k| self.constraints(k) == other.constraints(k))
            })
    }
}

impl Eq for Schedule {}

impl Schedule {
    /// Builds the schedule of a clustering with colored clusters; `coloring.color(k)` is the color of
    /// cluster `k`.
    ///
    /// Without clusters, pass [`Clustering::none`]. Clusters of one color ascend, and so do the constraints of a
    /// cluster. The coloring is not checked here; [`check`](Self::check) verifies the result.
    ///
    /// # Panics
    /// If the number of colors is not the number of cluster numbers.
    #[must_use]
    pub fn new(clustering: &Clustering, coloring: &Coloring) -> Self {
        let mut schedule = Self::default();
        schedule.rebuild(clustering, coloring);
        schedule
    }

    /// Replaces the schedule, reusing its arrays. O(constraints + clusters + colors).
    ///
    /// # Panics
    /// If the number of colors is not the number of cluster numbers.
    pub fn rebuild(&mut self, clustering: &Clustering, coloring: &Coloring) {
        expect_colors(clustering, coloring);
        // Colors of vacant clusters are not counted.
        let occupied = (0..)
            .map(ClusterId)
            .zip(coloring.colors())
            .zip(clustering.sizes())
            .filter(|(_, size)| **size > 0)
            .map(|((cluster, color), _)| (color.index(), cluster));
        let colors = occupied.clone().map(|(color, _)| color + 1).max();
        self.colors.refill(colors.unwrap_or(0), occupied);
        let labels = (0..).zip(clustering.labels());
        let members = labels
            .filter(|(_, label)| **label != ClusterId::NONE)
            .map(|(constraint, label)| (label.index(), constraint));
        self.members.refill(clustering.cluster_count(), members);
        self.labels.clear();
        self.labels.extend_from_slice(clustering.labels());
        self.slots.clear();
        self.slots.resize(clustering.cluster_count(), Slot::NONE);
        for (color, clusters) in (0..).zip(self.colors.rows()) {
            for (position, cluster) in (0..).zip(clusters) {
                self.slots[cluster.index()] = Slot { color, position };
            }
        }
        self.journal.restart();
    }

    /// Applies an edit: afterwards each color has the same clusters, and each cluster the same constraints, as in a
    /// [new](Self::new) schedule. Only the order of the clusters in a color may differ, which has no effect. Returns
    /// the number of values read or moved.
    ///
    /// `constraints` must list every constraint whose cluster has changed since the last call, `clusters` every cluster
    /// whose color has changed; unchanged and repeated items are allowed. [`check_partition`](Self::check_partition) finds
    /// missing ones.
    ///
    /// Cost: amortized O(members of the changed clusters): the arrays are occasionally compacted.
    ///
    /// # Panics
    /// If the number of colors is not the number of cluster numbers.
    ///
    /// ```
    /// use incise_graph::{ClusterId, Clustering, ColorId, Coloring, Schedule};
    ///
    /// let mut clustering = Clustering::from_labels([0, 0, 1, 1].map(ClusterId).to_vec())?;
    /// let mut coloring = Coloring::new([0, 1].map(ColorId).to_vec());
    /// let mut schedule = Schedule::new(&clustering, &coloring);
    /// let revision = schedule.revision();
    /// // Constraint 1 is replaced by another one of its number and by number 4, as a new cluster.
    /// clustering.remove(1);
    /// let new = clustering.new_cluster(1);
    /// clustering.assign(4, new);
    /// coloring.push(ColorId(1));
    /// schedule.update(&clustering, &coloring, &[1, 4], &[new]);
    /// assert_eq!(schedule.constraints(new), [1, 4]);
    /// assert_eq!(schedule.clusters(1), [ClusterId(1), new]);
    /// assert_eq!(schedule.changes_since(revision), Some(&[ClusterId(0), new][..]));
    /// # Ok::<(), incise_graph::GraphError>(())
    /// ```
    pub fn update(
        &mut self,
        clustering: &Clustering,
        coloring: &Coloring,
        constraints: &[u32],
        clusters: &[ClusterId],
    ) -> u64 {
        expect_colors(clustering, coloring);
        let count = clustering.cluster_count().max(self.slots.len());
        self.members.set_row_count(count);
        self.slots.resize(count, Slot::NONE);
        let mut visited = constraints.len() + clusters.len();
        let mut changed = Vec::new();
        for &constraint in constraints {
            visited += self.relabel(constraint, clustering, &mut changed);
        }
        let recolored = |cluster: &&ClusterId| {
            let color = self.color_of(**cluster, coloring);
            self.slots[cluster.index()].color != color
        };
        changed.extend(clusters.iter().filter(recolored));
        changed.sort_unstable();
        changed.dedup();
        for &cluster in &changed {
            visited += 1 + self.set_color(cluster, self.color_of(cluster, coloring));
        }
        while self.colors.rows().last().is_some_and(<[_]>::is_empty) {
            self.colors.set_row_count(self.colors.row_count() - 1);
        }
        visited += self.colors.tidy() + self.members.tidy();
        self.journal.note(&changed, count);
        visited as u64
    }

    /// Moves a constraint to its present cluster.
    fn relabel(
        &mut self,
        constraint: u32,
        clustering: &Clustering,
        changed: &mut Vec<ClusterId>,
    ) -> usize {
        let index = constraint as usize;
        let labels = clustering.labels();
        if self.labels.len() <= index {
            self.labels.resize(index + 1, ClusterId::NONE);
        }
        let new = labels.get(index).copied().unwrap_or(ClusterId::NONE);
        let old = std::mem::replace(&mut self.labels[index], new);
        if old == new {
            return 0;
        }
        let mut visited = 0;
        for (cluster, enters) in [(old, false), (new, true)] {
            if cluster == ClusterId::NONE {
                continue;
            }
            let row = cluster.index();
            visited += match self.members.row(row).binary_search(&constraint) {
                Err(at) if enters => self.members.insert(row, at, constraint),
                Ok(at) if !enters => self.members.remove(row, at),
                _ => 0,
            };
            changed.push(cluster);
        }
        visited
    }

    /// The color of a cluster in this schedule; `NONE` if it has no members.
    fn color_of(&self, cluster: ClusterId, coloring: &Coloring) -> u32 {
        match self.members.row(cluster.index()) {
            [] => NONE,
            _ => coloring.color(cluster.index()).0,
        }
    }

    /// Moves a cluster to a color.
    fn set_color(&mut self, cluster: ClusterId, color: u32) -> usize {
        let old = self.slots[cluster.index()];
        if old.color == color {
            return 0;
        }
        if old.color != NONE {
            let (row, position) = (old.color as usize, old.position as usize);
            self.colors.swap_remove(row, position);
            if let Some(other) = self.colors.row(row).get(position) {
                self.slots[other.index()].position = old.position;
            }
        }
        self.slots[cluster.index()] = Slot::NONE;
        if color == NONE {
            return 1;
        }
        let row = color as usize;
        self.colors
            .set_row_count(self.colors.row_count().max(row + 1));
        let position = offset(self.colors.row(row).len());
        self.slots[cluster.index()] = Slot { color, position };
        1 + self.colors.push(row, cluster)
    }

    /// The revision of this schedule, which changes with every edit. No other schedule has an equal one, except that
    /// copies share it until they change and all empty [default](Self::default) schedules have 0.
    #[must_use]
    pub fn revision(&self) -> u64 {
        self.journal.revision()
    }

    /// The clusters whose members or color have changed since a revision, possibly repeated, including vacated ones;
    /// `None` if this schedule never had the revision, was rebuilt since, or no longer has the record: it keeps as many
    /// changes as there are clusters.
    #[must_use]
    pub fn changes_since(&self, revision: u64) -> Option<&[ClusterId]> {
        self.journal.since(revision)
    }

    /// The number of colors: the parallel steps of one sweep.
    #[must_use]
    pub fn color_count(&self) -> usize {
        self.colors.row_count()
    }

    /// The number of clusters with at least one constraint.
    #[must_use]
    pub fn cluster_count(&self) -> usize {
        self.colors.value_count()
    }

    /// The clusters of one color, which may run at the same time.
    ///
    /// # Panics
    /// If there is no such color.
    #[must_use]
    pub fn clusters(&self, color: usize) -> &[ClusterId] {
        self.colors.row(color)
    }

    /// The constraints of a cluster, ascending, to be solved one after the other; empty if the cluster is vacant or
    /// unknown.
    #[must_use]
    pub fn constraints(&self, cluster: ClusterId) -> &[u32] {
        if cluster.index() < self.members.row_count() {
            self.members.row(cluster.index())
        } else {
            &[]
        }
    }

    /// The cluster of a constraint; `None` if the schedule does not solve it.
    #[must_use]
    pub fn cluster(&self, constraint: usize) -> Option<ClusterId> {
        let label = self.labels.get(constraint).copied();
        label.filter(|&label| label != ClusterId::NONE)
    }

    /// The color of a cluster; `None` if it is vacant or unknown.
    #[must_use]
    pub fn color(&self, cluster: ClusterId) -> Option<ColorId> {
        let slot = self.slots.get(cluster.index())?;
        (slot.color != NONE).then_some(ColorId(slot.color))
    }

    /// All constraints in solving order.
    pub fn order(&self) -> impl Iterator<Item = u32> + Clone {
        (0..self.color_count()).flat_map(|color| self.color_constraints(color))
    }

    /// The number of constraints.
    #[must_use]
    pub fn constraint_count(&self) -> usize {
        self.members.value_count()
    }

    /// The constraints of one color, cluster after cluster.
    ///
    /// # Panics
    /// If there is no such color.
    pub fn color_constraints(&self, color: usize) -> impl Iterator<Item = u32> + Clone {
        let clusters = self.clusters(color).iter();
        clusters.flat_map(|&cluster| self.constraints(cluster).iter().copied())
    }
}

fn expect_colors(clustering: &Clustering, coloring: &Coloring) {
    assert_eq!(
        coloring.vertex_count(),
        clustering.cluster_count(),
        "one color per cluster number"
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{GraphError, Incidence};

    fn coloring(colors: &[u32]) -> Coloring {
        Coloring::new(colors.iter().copied().map(ColorId).collect())
    }

    /// Five springs in a row; clusters {0, 1}, {}, {3, 4}, {2}.
    fn row() -> (Incidence, Clustering) {
        let springs = Incidence::from_constraints(6, (0u32..5).map(|i| [i, i + 1])).unwrap();
        let clustering = Clustering::from_labels([0, 0, 3, 2, 2].map(ClusterId).to_vec()).unwrap();
        (springs, clustering)
    }

    #[test]
    fn vacant_clusters_and_their_colors_are_skipped() {
        let (springs, clustering) = row();
        let schedule = Schedule::new(&clustering, &coloring(&[1, 9, 1, 0]));
        schedule.check(&springs).unwrap();
        assert_eq!((schedule.color_count(), schedule.cluster_count()), (2, 3));
        assert!(schedule.order().eq([2, 0, 1, 3, 4]));
        assert_eq!(schedule.clusters(0), [ClusterId(3)]);
        assert_eq!(schedule.clusters(1), [0, 2].map(ClusterId));
        assert_eq!(schedule.constraints(ClusterId(2)), [3, 4]);
        assert_eq!(schedule.constraints(ClusterId(1)), [0; 0]);
        assert_eq!(schedule.constraints(ClusterId(7)), [0; 0]);
        assert_eq!(schedule.color(ClusterId(2)), Some(ColorId(1)));
        assert_eq!(schedule.color(ClusterId(1)), None);
        assert!(schedule.color_constraints(1).eq([0, 1, 3, 4]));
    }

    #[test]
    fn rebuilding_equals_building() {
        let (_, clustering) = row();
        let mut schedule = Schedule::new(&Clustering::none(9), &coloring(&[0; 9]));
        let colors = coloring(&[1, 0, 1, 0]);
        schedule.rebuild(&clustering, &colors);
        assert_eq!(schedule, Schedule::new(&clustering, &colors));
        schedule.rebuild(&Clustering::none(0), &coloring(&[]));
        assert_eq!(schedule, Schedule::default());
        assert_eq!(schedule.color_count(), 0);
    }

    #[test]
    fn check_refuses_collisions_and_omissions() {
        let (springs, mut clustering) = row();
        let collision = Schedule::new(&clustering, &coloring(&[0, 0, 1, 1]))
            .check(&springs)
            .unwrap_err();
        let (first, second) = (ClusterId(2), ClusterId(3));
        assert_eq!(
            collision,
            GraphError::ClustersCollide {
                first,
                second,
                color: ColorId(1),
                particle: 3
            }
        );
        let colors = coloring(&[1, 0, 1, 0]);
        clustering.remove(1);
        assert_eq!(
            Schedule::new(&clustering, &colors).check(&springs),
            Err(GraphError::Unscheduled { constraint: 1 })
        );
        let mut twice = Schedule::new(&clustering, &colors);
        twice.members.push(3, 0);
        assert!(matches!(
            twice.check(&springs),
            Err(GraphError::ScheduledTwice { .. })
        ));
        let mut foreign = Schedule::new(&clustering, &colors);
        foreign.members.push(3, 7);
        assert!(matches!(
            foreign.check(&springs),
            Err(GraphError::Length { .. })
        ));
    }
}
