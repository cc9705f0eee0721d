//! Colors inside each cluster: which members of one cluster may be solved at the same time.
//!
//! A cluster of 64 to 256 constraints is a block for one GPU workgroup or one core. Blocks of one
//! color run side by side, and inside a block its constraints run color by color with a barrier in
//! between. Members of different clusters are never compared here: the coloring of the clusters
//! keeps those apart.
//!
//! First fit in ascending order, cluster after cluster, with one word per particle for the colors
//! taken there by the cluster at hand. Colors from 64 on work by windows, as in the
//! [`first_fit`](crate::Conflicts::first_fit) of incidence: a constraint that finds no color in
//! one window tries the next, with all words cleared. Cost: O(entries) per window of 64 colors, over
//! the constraints that reach it.

use incise_graph::{Clustering, ColorId, Coloring, Incidence};

/// Gives every constraint the smallest color that no smaller constraint of its cluster on one of
/// its particles has.
///
/// Constraints of one cluster and one color share no particle. Every cluster uses its colors from 0
/// without gaps. Constraints in no cluster get color 0. No limit on the number of colors.
/// Deterministic; O(entries) for every 64 colors over those constraints that need so many.
///
/// # Panics
/// If `clustering` and `incidence` have different numbers of constraints.
///
/// ```
/// use incise_coloring::color_within_clusters;
/// use incise_graph::{ClusterId, Clustering, ColorId, Incidence};
///
/// // Five springs in a row, two blocks: {0, 1, 2} and {3, 4}.
/// let springs = Incidence::from_constraints(6, (0u32..5).map(|i| [i, i + 1]))?;
/// let blocks = Clustering::from_labels([0, 0, 0, 1, 1].map(ClusterId).to_vec())?;
/// let inner = color_within_clusters(&springs, &blocks);
/// assert_eq!(inner.colors(), [0, 1, 0, 0, 1].map(ColorId));
/// # Ok::<(), incise_graph::GraphError>(())
/// ```
#[must_use]
pub fn color_within_clusters(incidence: &Incidence, clustering: &Clustering) -> Coloring {
    assert_eq!(
        clustering.constraint_count(),
        incidence.constraint_count(),
        "one label per constraint"
    );
    let mut colors = vec![ColorId(0); incidence.constraint_count()];
    let mut taken = vec![0u64; incidence.particle_count()];
    let members = clustering.members();
    let (mut waiting, mut left) = (Vec::new(), Vec::new());
    for cluster in members.iter() {
        waiting.extend_from_slice(cluster);
        let mut base = 0;
        while !waiting.is_empty() {
            for &c in &waiting {
                let particles = incidence.particles_of(c as usize);
                let union = particles.iter().fold(0, |all, &p| all | taken[p as usize]);
                if union == u64::MAX {
                    left.push(c);
                    continue;
                }
                let color = union.trailing_ones();
                colors[c as usize] = ColorId(base + color);
                for &p in particles {
                    taken[p as usize] |= 1 << color;
                }
            }
            for &c in &waiting {
                for &p in incidence.particles_of(c as usize) {
                    taken[p as usize] = 0;
                }
            }
            waiting.clear();
            std::mem::swap(&mut waiting, &mut left);
            base += 64;
        }
    }
    Coloring::new(colors)
}
