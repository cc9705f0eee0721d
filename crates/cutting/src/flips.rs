//! [`Flip`]: the tets around an edge inside in place of others with the same outline.
//!
//! The corners beside an edge with n tets around it form a ring. A triangulation of the ring gives two tets for each of its
//! triangles, one to each end of the edge: 2 in place of 3, or 4 in place of 4 with a diagonal of the ring in place of the
//! edge. Edges with more tets around them would give more than there were, and stay. No particle moves and no face on the
//! outline changes, so volume, cut faces and pieces stay. Source: edge removal in J. R. Shewchuk, "Two discrete
//! optimization algorithms for the topological improvement of tetrahedral meshes" (2002). Cost: constant.

use incise_mesh::{ParticleId, TetId};

use crate::CuttableMesh;
use crate::faces::{Behind, Face, sorted};

/// Most tets around an edge that is removed.
const MOST_AROUND: usize = 4;

/// Three or four tets around an edge and those that take their place.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Flip {
    /// The tets around the edge, in their order.
    pub(crate) removed: Vec<TetId>,
    /// Corners of the new tets.
    pub(crate) added: Vec<[ParticleId; 4]>,
    /// The ends of the edge.
    pub(crate) edge: [ParticleId; 2],
    /// The corners beside the edge, in their order.
    pub(crate) ring: Vec<ParticleId>,
    /// The ends of the new edge, if there were four tets.
    pub(crate) diagonal: Option<[ParticleId; 2]>,
}

impl Flip {
    /// The flips that remove an edge of a tet: none if the edge is on the boundary or has too many tets, one if it has three,
    /// two if it has four.
    pub(crate) fn of_edge(
        cuttable: &CuttableMesh,
        tet: TetId,
        edge: [ParticleId; 2],
    ) -> impl Iterator<Item = Self> + use<> {
        let around = around(cuttable, tet, edge);
        around.into_iter().flat_map(move |(removed, ring)| {
            let diagonals = if ring.len() == 3 { 0..1 } else { 0..2 };
            diagonals.map(move |first| {
                // The ring from a corner on: a fan of triangles around it.
                let fan = (1..ring.len() - 1).flat_map(|i| {
                    let [x, y, z] = [0, i, i + 1].map(|i| ring[(first + i) % ring.len()]);
                    [[x, y, z, edge[1]], [x, z, y, edge[0]]]
                });
                Self {
                    removed: removed.clone(),
                    added: fan.collect(),
                    edge,
                    diagonal: (ring.len() == 4).then(|| [ring[first], ring[first + 2]]),
                    ring: ring.clone(),
                }
            })
        })
    }

    /// Whether the mesh has the new edge or face already, which is so only where tets lie in each other.
    pub(crate) fn is_doubled(&self, cuttable: &CuttableMesh) -> bool {
        let new = match &self.diagonal {
            Some(diagonal) => &diagonal[..],
            None => &self.ring[..],
        };
        let has_all = |tet: TetId| {
            let corners = cuttable.mesh.tets[tet.index()];
            new.iter().all(|p| corners.contains(p))
        };
        cuttable.around(new[0]).any(has_all)
    }

    /// Puts the new tets in place of those around the edge, into their first slots. Returns the slot that is left.
    pub(crate) fn apply(&self, cuttable: &mut CuttableMesh) -> Option<TetId> {
        let CuttableMesh {
            mesh, stars, faces, ..
        } = cuttable;
        let mut outline: Vec<([ParticleId; 3], Behind)> = Vec::new();
        for face in self.removed.iter().flat_map(|tet| Face::of(*tet)) {
            let behind = faces.behind(face);
            match behind {
                Behind::Twin(twin) if self.removed.contains(&twin.tet()) => continue,
                Behind::Twin(_) => {}
                Behind::Nothing(_) => faces.close(face),
            }
            outline.push((sorted(face.particles(mesh)), behind));
        }
        for &tet in &self.removed {
            faces.clear(tet);
            stars.remove(tet, mesh.tets[tet.index()]);
        }
        let mut inside: Vec<([ParticleId; 3], Face)> = Vec::new();
        for (&tet, &corners) in self.removed.iter().zip(&self.added) {
            mesh.tets[tet.index()] = corners;
            stars.insert(tet, corners);
            for face in Face::of(tet) {
                let key = sorted(face.particles(mesh));
                match outline.iter().find(|(of, _)| *of == key) {
                    Some((_, Behind::Twin(twin))) => faces.join(face, *twin),
                    Some((_, Behind::Nothing(tag))) => faces.open(face, *tag),
                    None => inside.push((key, face)),
                }
            }
        }
        inside.sort_unstable();
        for pair in inside.chunk_by(|a, b| a.0 == b.0) {
            if let [(_, one), (_, other)] = *pair {
                faces.join(one, other);
            }
        }
        self.removed.get(self.added.len()).copied()
    }
}

/// The tets around the edge from `a` to `b` and the corners beside it, in their order: (a, b, ring[i], ring[i + 1]) are the
/// corners of tet i. `None` if the edge is on the boundary or has too many tets.
fn around(
    cuttable: &CuttableMesh,
    start: TetId,
    [a, b]: [ParticleId; 2],
) -> Option<(Vec<TetId>, Vec<ParticleId>)> {
    let mesh = &cuttable.mesh;
    let corners = mesh.tets[start.index()];
    let at = |p: ParticleId| corners.iter().position(|q| *q == p);
    let mut others = corners.into_iter().filter(|p| *p != a && *p != b);
    let (mut first, mut next) = (others.next()?, others.next()?);
    if !is_even([at(a)?, at(b)?, at(first)?, at(next)?]) {
        (first, next) = (next, first);
    }
    let (mut tets, mut ring) = (vec![start], vec![first]);
    loop {
        // Through the face opposite to the corner that the tet before has, too.
        let (tet, before) = (*tets.last()?, *ring.last()?);
        let opposite = mesh.tets[tet.index()].iter().position(|p| *p == before)?;
        let Behind::Twin(twin) = cuttable.faces.behind(Face::of(tet)[opposite]) else {
            return None;
        };
        if twin.tet() == start {
            break;
        }
        if tets.len() == MOST_AROUND {
            return None;
        }
        tets.push(twin.tet());
        ring.push(next);
        next = mesh.tets[twin.tet().index()][twin.opposite()];
    }
    (tets.len() >= 3).then_some((tets, ring))
}

/// Whether an order of four numbers has an even number of inversions.
fn is_even(order: [usize; 4]) -> bool {
    let pairs = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];
    let inversions = pairs.iter().filter(|(i, j)| order[*i] > order[*j]);
    inversions.count() % 2 == 0
}
