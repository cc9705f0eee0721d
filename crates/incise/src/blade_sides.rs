//! [`touching`]: which particles a solid blade pushes, and to which side.
//!
//! Just after a cut both sides are at one place, so positions cannot tell to which side a particle belongs. The triangles
//! of the cut can: each looks away from its tissue. A particle with triangles that look both ways is on the front of the
//! cut, where the sides are one, and is left alone: it is the edge that meets it, where the blade has a toughness
//! ([`edge_points`]). Cost: a pass over the boundary triangles in frames with such a blade.

use std::collections::BTreeMap;

use glam::DVec3;
use incise_cutting::FaceTag;

use crate::edge_points::edge_points;
use crate::island::Island;
use crate::solid_blade::FrameBlade;

/// How far a triangle may lean against the blade and still say which side it is on, as a cosine.
const LEANING: f64 = 0.3;

/// The blades of a frame that touch the cuts of an island or press on it, with the particles on each side and the uncut
/// tissue at the edge.
pub(crate) fn touching(
    island: &Island,
    blades: &[FrameBlade],
) -> Vec<(u32, incise_xpbd::SolidBlade)> {
    let with_sides = blades.iter().filter_map(|frame| {
        let mut blade = frame.blade.clone()?;
        blade.sides = sides(island, frame.stroke, &blade);
        if blade.toughness > 0.0 {
            blade.uncut = edge_points(island, frame.stroke, &blade, frame.owes);
        }
        let touches = !blade.sides.is_empty() || !blade.uncut.is_empty();
        touches.then_some((frame.stroke, blade))
    });
    with_sides.collect()
}

/// The particles on the faces of a stroke near a blade, ascending, and whether each is on the side that `edge × front`
/// points to.
fn sides(island: &Island, stroke: u32, blade: &incise_xpbd::SolidBlade) -> Vec<(u32, bool)> {
    let [a, b] = blade.edge[1];
    let length = a.distance(b);
    let normal = ((b - a).cross(blade.front)).normalize_or_zero();
    let way = blade.edge[0][0]
        .distance(a)
        .max(blade.edge[0][1].distance(b));
    let reach = blade.height + length + way;
    // Of each particle whether it has triangles of tissue on the negative and on the positive side.
    let mut votes: BTreeMap<u32, [bool; 2]> = BTreeMap::new();
    for triangle in island.cuttable.boundary() {
        if triangle.tag != FaceTag::Cut(stroke) {
            continue;
        }
        let [x, y, z] = triangle.particles.map(|p| island.positions[p.index()]);
        let is_far = |x: &DVec3| x.distance_squared(a) > reach * reach;
        if [x, y, z].iter().all(is_far) {
            continue;
        }
        let outward = (y - x).cross(z - x).normalize_or_zero();
        let looks = outward.dot(normal);
        if looks.abs() < LEANING {
            continue;
        }
        for p in triangle.particles {
            votes.entry(p.0).or_default()[usize::from(looks < 0.0)] = true;
        }
    }
    let clear = votes.into_iter().filter_map(|(p, votes)| match votes {
        [true, false] => Some((p, false)),
        [false, true] => Some((p, true)),
        _ => None,
    });
    clear.collect()
}
