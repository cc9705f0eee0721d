//! Aggregates: connected groups of particles for the coarse part of a correction.
//!
//! Aggregates grow one after the other, breadth first over the edges of the mesh, each from a particle next to the
//! previous ones. Only edges connect, so a cut that copies particles separates aggregates as well, and regrowing them
//! after every cut is cheap. Aggregates that remain too small join a neighbor. Cost: O(edges).

/// The aggregate of each row of a graph, numbered from 0 without gaps, and how many there are.
///
/// Row i is adjacent to `columns[offsets[i]..offsets[i + 1]]` (itself allowed). Each connected part of the graph has at
/// least one aggregate of its own; aggregates have up to `1.5 · size` rows.
pub(super) fn aggregates(offsets: &[usize], columns: &[u32], size: usize) -> (Vec<u32>, usize) {
    const NONE: u32 = u32::MAX;
    let rows = offsets.len() - 1;
    let neighbors = |i: usize| {
        columns[offsets[i]..offsets[i + 1]]
            .iter()
            .map(|&j| j as usize)
    };
    let mut of = vec![NONE; rows];
    let mut sizes: Vec<usize> = Vec::new();
    // Rows next to a lump, in the order in which they were met: the seeds to come.
    let mut border: Vec<u32> = Vec::new();
    let mut queue: Vec<u32> = Vec::new();
    let (mut met, mut first) = (0, 0);
    loop {
        let seed = loop {
            if met < border.len() {
                met += 1;
                if of[border[met - 1] as usize] == NONE {
                    break Some(border[met - 1]);
                }
            } else {
                while first < rows && of[first] != NONE {
                    first += 1;
                }
                break (first < rows)
                    .then(|| u32::try_from(first).expect("rows are numbered in 32 bits"));
            }
        };
        let Some(seed) = seed else { break };
        let lump = u32::try_from(sizes.len()).expect("there are no more lumps than rows");
        queue.clear();
        queue.push(seed);
        of[seed as usize] = lump;
        let mut next = 0;
        while next < queue.len() {
            for j in neighbors(queue[next] as usize) {
                if of[j] == NONE && queue.len() < size {
                    of[j] = lump;
                    queue.push(u32::try_from(j).expect("rows are numbered in 32 bits"));
                } else if of[j] == NONE {
                    border.push(u32::try_from(j).expect("rows are numbered in 32 bits"));
                }
            }
            next += 1;
        }
        // A remainder joins the smallest neighbor that has room.
        if queue.len() < size / 2 {
            let around = queue
                .iter()
                .flat_map(|&i| neighbors(i as usize))
                .map(|j| of[j]);
            let host = around
                .filter(|&other| other != NONE && other != lump)
                .filter(|&other| sizes[other as usize] + queue.len() <= size + size / 2)
                .min_by_key(|&other| (sizes[other as usize], other));
            if let Some(host) = host {
                queue.iter().for_each(|&i| of[i as usize] = host);
                sizes[host as usize] += queue.len();
                continue;
            }
        }
        sizes.push(queue.len());
    }
    (of, sizes.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two rows of points without an edge between them.
    #[test]
    fn unconnected_particles_are_not_coupled() {
        let (mut offsets, mut columns) = (vec![0], Vec::new());
        for i in 0..40u32 {
            let half = i / 20;
            columns.extend(
                [i.wrapping_sub(1), i, i + 1]
                    .into_iter()
                    .filter(|&j| j / 20 == half),
            );
            offsets.push(columns.len());
        }
        let (of, count) = aggregates(&offsets, &columns, 6);
        let mut sizes = vec![0; count];
        for (i, &a) in of.iter().enumerate() {
            sizes[a as usize] += 1;
            assert!(
                of.iter()
                    .enumerate()
                    .all(|(j, &b)| a != b || i / 20 == j / 20)
            );
        }
        assert!(
            sizes.iter().all(|&size| (2..=9).contains(&size)),
            "{sizes:?}"
        );
    }

    #[test]
    fn one_row_is_an_aggregate_and_none_is_none() {
        assert_eq!(aggregates(&[0, 0], &[], 10), (vec![0], 1));
        assert_eq!(aggregates(&[0], &[], 10), (vec![], 0));
    }
}
