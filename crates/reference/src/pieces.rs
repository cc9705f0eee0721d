//! Check that the fixed particles of each piece give it a unique equilibrium nearby.
//!
//! Pieces are connected by shared particles (union-find with path halving); a piece is held if three of its fixed
//! particles are not collinear. Cost: near O(tets).

use glam::DVec3;

/// Returns the lowest particle of a piece that can translate or rotate freely; `None` if all pieces are held.
pub(crate) fn first_not_held(
    positions: &[DVec3],
    tets: impl Iterator<Item = [u32; 4]>,
    held: &[bool],
) -> Option<usize> {
    let mut parent: Vec<usize> = (0..positions.len()).collect();
    for tet in tets {
        for p in &tet[1..] {
            let a = root(&mut parent, tet[0] as usize);
            let b = root(&mut parent, *p as usize);
            parent[a.max(b)] = a.min(b);
        }
    }
    let mut supports: Vec<Support> = vec![Support::None; positions.len()];
    for (p, &x) in positions.iter().enumerate() {
        if held[p] {
            supports[root(&mut parent, p)].add(x);
        }
    }
    (0..positions.len()).find(|&p| !held[p] && supports[root(&mut parent, p)] != Support::Held)
}

/// Span of the fixed particles of a piece.
#[derive(Clone, Copy, PartialEq)]
enum Support {
    None,
    Point(DVec3),
    Line(DVec3, DVec3),
    Held,
}

impl Support {
    fn add(&mut self, x: DVec3) {
        *self = match *self {
            Self::None => Self::Point(x),
            Self::Point(a) if a != x => Self::Line(a, x),
            // The angle has to exceed rounding.
            Self::Line(a, b)
                if (b - a).cross(x - a).length() > 1e-9 * (b - a).length() * (x - a).length() =>
            {
                Self::Held
            }
            same => same,
        };
    }
}

fn root(parent: &mut [usize], mut p: usize) -> usize {
    while parent[p] != p {
        parent[p] = parent[parent[p]];
        p = parent[p];
    }
    p
}
