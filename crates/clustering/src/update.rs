//! The local update after a cut: removed constraints leave their clusters, new ones form new
//! clusters (paper section 4.3).
//!
//! The paper turns the elements that replace one cut element into one new cluster. Here a group
//! becomes as many clusters as the size limit requires, of sizes that differ by at most one,
//! because the time of a color is that of its largest cluster. All other clusters keep members and
//! numbers, except for members that left. The edit is checked before any change. Cost: O(e log e)
//! for e constraints in the edit, independent of the size of the mesh.

use std::num::NonZeroUsize;

use incise_graph::{ClusterId, Clustering};

use crate::ClusteringError;

/// Removes the constraints `removed` from their clusters and puts each group of new constraints
/// into new clusters.
///
/// Group `g` is `values[offsets[g]..offsets[g + 1]]`; it is split, in the given order, into the
/// smallest number of clusters of at most `max_size` constraints. A new constraint may reuse a
/// removed number or be past the end. Returns the new clusters in order; they reuse vacated
/// numbers, the latest first, before new ones. Deterministic; O(e log e) for an edit of e
/// constraints.
///
/// # Errors
/// A removed constraint that is in no cluster, a new one that is in one, a repeated one in either
/// list, or invalid offsets. The clustering is then unchanged.
///
/// ```
/// use std::num::NonZeroUsize;
///
/// use incise_clustering::update_local;
/// use incise_graph::{ClusterId, Clustering};
///
/// // Tets 0 to 3 in two clusters. Tet 1 is cut into four, tet 2 into three; both numbers are
/// // used again.
/// let mut clustering = Clustering::from_labels([0, 0, 1, 1].map(ClusterId).to_vec())?;
/// let limit = NonZeroUsize::MIN.saturating_add(3);
/// let new = update_local(&mut clustering, &[1, 2], &[0, 4, 7], &[1, 4, 5, 6, 2, 7, 8], limit)?;
/// assert_eq!(new, [ClusterId(2), ClusterId(3)]);
/// assert_eq!([ClusterId(0), new[0], new[1]].map(|k| clustering.size(k)), [1, 4, 3]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn update_local(
    clustering: &mut Clustering,
    removed: &[u32],
    offsets: &[u32],
    values: &[u32],
    max_size: NonZeroUsize,
) -> Result<Vec<ClusterId>, ClusteringError> {
    check(clustering, removed, offsets, values)?;
    for &c in removed {
        clustering.remove(c as usize);
    }
    let mut new = Vec::with_capacity(offsets.len() - 1);
    for pair in offsets.windows(2) {
        let mut group = &values[pair[0] as usize..pair[1] as usize];
        // Equal parts: each takes its share of the rest.
        for parts in (1..=group.len().div_ceil(max_size.get())).rev() {
            let (part, rest) = group.split_at(group.len().div_ceil(parts));
            let cluster = clustering.new_cluster(part[0] as usize);
            for &c in &part[1..] {
                clustering.assign(c as usize, cluster);
            }
            new.push(cluster);
            group = rest;
        }
    }
    Ok(new)
}

/// An error unless the edit fits the clustering.
fn check(
    clustering: &Clustering,
    removed: &[u32],
    offsets: &[u32],
    values: &[u32],
) -> Result<(), ClusteringError> {
    let ends = offsets.first() == Some(&0)
        && offsets.last().map(|&end| end as usize) == Some(values.len());
    if !ends || !offsets.is_sorted() {
        return Err(ClusteringError::BadOffsets {
            values: values.len(),
        });
    }
    let is_clustered = |c: u32| {
        let c = c as usize;
        c < clustering.constraint_count() && clustering.cluster_of(c).is_some()
    };
    let removed =
        sorted(removed).map_err(|constraint| ClusteringError::NotClustered { constraint })?;
    if let Some(&constraint) = removed.iter().find(|&&c| !is_clustered(c)) {
        return Err(ClusteringError::NotClustered { constraint });
    }
    let values = sorted(values).map_err(|constraint| ClusteringError::NotNew { constraint })?;
    let stays = |c: u32| is_clustered(c) && removed.binary_search(&c).is_err();
    match values.into_iter().find(|&c| stays(c)) {
        Some(constraint) => Err(ClusteringError::NotNew { constraint }),
        None => Ok(()),
    }
}

/// A sorted copy, or the first constraint that is repeated.
fn sorted(list: &[u32]) -> Result<Vec<u32>, u32> {
    let mut sorted = list.to_vec();
    sorted.sort_unstable();
    match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(pair[0]),
        None => Ok(sorted),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn limit(size: usize) -> NonZeroUsize {
        NonZeroUsize::new(size).unwrap()
    }

    #[test]
    fn groups_are_cut_evenly() {
        let mut clustering = Clustering::default();
        let values: Vec<u32> = (0..11).collect();
        let new = update_local(&mut clustering, &[], &[0, 0, 6, 11], &values, limit(5)).unwrap();
        let sizes: Vec<usize> = new.iter().map(|&k| clustering.size(k)).collect();
        assert_eq!(sizes, [3, 3, 5]);
        assert_eq!(clustering.cluster_of(3), Some(new[1]));
        clustering.check().unwrap();
    }

    #[test]
    fn a_refused_edit_changes_nothing() {
        let mut clustering = Clustering::none(4);
        clustering.remove(3);
        let before = clustering.clone();
        let mut refuse = |removed: &[u32], offsets: &[u32], values: &[u32]| {
            let error =
                update_local(&mut clustering, removed, offsets, values, limit(4)).unwrap_err();
            assert_eq!(clustering, before);
            error
        };
        assert_eq!(
            refuse(&[0, 3], &[0], &[]),
            ClusteringError::NotClustered { constraint: 3 }
        );
        assert_eq!(
            refuse(&[0, 9], &[0], &[]),
            ClusteringError::NotClustered { constraint: 9 }
        );
        assert_eq!(
            refuse(&[0, 0], &[0], &[]),
            ClusteringError::NotClustered { constraint: 0 }
        );
        assert_eq!(
            refuse(&[0], &[0, 2], &[0, 1]),
            ClusteringError::NotNew { constraint: 1 }
        );
        assert_eq!(
            refuse(&[0], &[0, 2], &[8, 8]),
            ClusteringError::NotNew { constraint: 8 }
        );
        for offsets in [&[][..], &[1, 1], &[0, 2, 1], &[0, 0]] {
            assert_eq!(
                refuse(&[], offsets, &[8]),
                ClusteringError::BadOffsets { values: 1 }
            );
        }
    }
}
