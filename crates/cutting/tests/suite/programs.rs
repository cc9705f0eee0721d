//! Programs: any bytes read as a body and a list of strokes, to be run with every invariant checked after each.
//!
//! The property test here runs random ones; the fuzz target (`fuzz/` at the top) lets a fuzzer search for bad ones.
//! Coordinates are mostly eighths, so that strokes run exactly through particles, edges and faces of lattices,
//! sometimes a rounding error off that, and now and then absurd.

use glam::DVec3;
use incise_cutting::{
    CutDelta, CutError, CutOptions, CuttableMesh, Plane, Separation, Skin, StrokeRegistry, Sweep,
    TriangleSurface, carve, cut_level_set, cut_plane, cut_surface, cut_surface_joining,
};
use incise_mesh::{ParticleId, TetMesh, kuhn_box};

/// Larger meshes would only make the search slow.
const LARGEST: usize = 6_000;

/// The bytes that are left; zeros after the end.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    fn next(&mut self) -> u8 {
        match self.0.split_first() {
            Some((&first, rest)) => {
                self.0 = rest;
                first
            }
            None => 0,
        }
    }

    fn number(&mut self) -> f64 {
        let byte = self.next();
        let eighth = f64::from(i16::from(byte % 64) - 24) / 16.0;
        match byte / 64 {
            0 | 1 => eighth,
            2 => eighth + f64::from(i16::from(self.next()) - 128) / 1000.0,
            _ => match byte % 16 {
                0 => f64::NAN,
                1 => f64::INFINITY,
                2 => 1e300,
                3 => -1e9,
                4 => 1e-300,
                5..=8 => eighth + 1e-13,
                9..=12 => eighth - 1e-9,
                _ => eighth + 1e-5,
            },
        }
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.number(), self.number(), self.number())
    }

    fn options(&mut self, tag: u32) -> CutOptions {
        let byte = self.next();
        CutOptions {
            snap: [0.0, 0.05, 0.1, 0.2, 0.25][usize::from(byte % 5)],
            tolerance: [1e-9, 1e-5][usize::from(byte / 5 % 2)],
            min_volume_ratio: [0.0, 0.0, 1e-4, 1e-2][usize::from(byte / 10 % 4)],
            crumbs: [0.0, 0.5, 5.0][usize::from(byte / 40 % 3)],
            separation: Separation::CutFaces,
            tag,
            max_tets: LARGEST,
        }
    }
}

fn body(kind: u8) -> TetMesh {
    let corner = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    let mut pair = TetMesh {
        positions: vec![
            corner(0.0, 0.0, 0.0),
            corner(1.0, 0.0, 0.0),
            corner(0.0, 1.0, 0.0),
            corner(0.0, 0.0, 1.0),
            corner(-1.0, 0.25, 0.25),
            corner(-1.0, 0.5, 1.0),
            corner(-1.0, -1.0, 0.0),
        ],
        tets: Vec::new(),
    };
    let tets = |tets: &[[u32; 4]]| tets.iter().map(|t| t.map(ParticleId)).collect();
    match kind % 8 {
        0 => pair.tets = tets(&[[0, 1, 2, 3]]),
        // By a face, an edge, a particle.
        1 => pair.tets = tets(&[[0, 1, 2, 3], [2, 0, 3, 4]]),
        2 => pair.tets = tets(&[[0, 1, 2, 3], [0, 3, 4, 5]]),
        3 => pair.tets = tets(&[[0, 1, 2, 3], [0, 4, 5, 6]]),
        4 => return kuhn_box([1; 3], DVec3::ONE),
        5 => return kuhn_box([3; 3], DVec3::ONE),
        6 => return kuhn_box([4, 4, 1], DVec3::new(1.0, 1.0, 0.125)),
        _ => return crate::bodies::jittered_box(3, 0.3, 5),
    }
    for tet in &mut pair.tets {
        let corners = tet.map(|p| pair.positions[p.index()]);
        if incise_mesh::signed_volume(corners) < 0.0 {
            tet.swap(0, 1);
        }
    }
    pair
}

/// Everything that follows the body.
struct State {
    cuttable: CuttableMesh,
    /// Where the particles are.
    positions: Vec<DVec3>,
    skin: Skin,
    /// With the positions and the registry before.
    journal: Vec<(CutDelta, Vec<DVec3>, Option<StrokeRegistry>)>,
    /// If the strokes of this program join.
    registry: Option<StrokeRegistry>,
}

impl State {
    /// Follows a stroke, before which the registry was `registry`, and checks everything. Errors must have changed nothing.
    fn apply_delta_from(
        &mut self,
        before: &TetMesh,
        registry: Option<StrokeRegistry>,
        result: Result<CutDelta, CutError>,
    ) {
        let Ok(delta) = result else {
            assert_eq!(
                self.cuttable.mesh(),
                before,
                "a refused stroke changes nothing"
            );
            self.cuttable.check().unwrap();
            return;
        };
        crate::bodies::check_cut(before, &self.cuttable, &delta);
        let earlier = self.positions.clone();
        delta.extend_particles(&mut self.positions);
        self.skin.apply_delta(&delta);
        assert_eq!(self.skin.triangles().len(), self.cuttable.boundary_count());
        self.journal.push((delta, earlier, registry));
    }

    fn undo(&mut self) {
        if let Some((delta, earlier, registry)) = self.journal.pop() {
            self.cuttable.undo(&delta).unwrap();
            self.cuttable.check().unwrap();
            self.positions = earlier;
            self.registry = registry;
            self.skin = Skin::new(self.cuttable.boundary());
        }
    }
}

/// Runs the program.
pub(crate) fn run(program: &[u8]) {
    let mut bytes = Bytes(program);
    let kind = bytes.next();
    let mesh = body(kind);
    let cuttable = CuttableMesh::new(mesh).unwrap();
    let mut state = State {
        positions: cuttable.mesh().positions.clone(),
        skin: Skin::new(cuttable.boundary()),
        cuttable,
        journal: Vec::new(),
        registry: (kind / 64 == 3).then(StrokeRegistry::default),
    };
    for tag in 0..12 {
        if bytes.is_empty() || state.cuttable.mesh().tets.len() > LARGEST / 2 {
            break;
        }
        step(&mut state, &mut bytes, tag);
    }
}

fn step(state: &mut State, bytes: &mut Bytes<'_>, tag: u32) {
    let before = state.cuttable.mesh().clone();
    let State {
        cuttable,
        positions,
        ..
    } = state;
    let operation = bytes.next();
    if operation >= 192 {
        return step_more(state, bytes, operation, tag);
    }
    match operation % 8 {
        0 | 1 => {
            let options = bytes.options(tag);
            let plane = Plane {
                point: bytes.vector(),
                normal: bytes.vector(),
            };
            let result = cut_plane(cuttable, positions, &plane, &options);
            state.followed_by_memory(&before, &options, result);
        }
        2 | 3 => sweep(state, bytes, tag),
        4 => {
            let (center, radius) = (bytes.vector(), bytes.number().abs());
            let result = carve(cuttable, positions, |x| x.distance(center) < radius, tag);
            state.followed_by_memory(&before, &CutOptions::default(), result);
        }
        5 => state.undo(),
        // The body moves: turned, stretched, even inverted or crushed flat; or rounded to single precision.
        6 => {
            let [x, y, z] = [bytes.vector(), bytes.vector(), bytes.vector()];
            let matrix = glam::DMat3::from_cols(x, y, z);
            let moved = positions.iter().map(|p| matrix * *p);
            let moved: Vec<DVec3> = moved.collect();
            if moved.iter().all(|p| p.is_finite()) {
                *positions = moved;
            }
        }
        _ => {
            for x in positions
                .iter_mut()
                .filter(|x| x.abs().max_element() < 1e30)
            {
                *x = x.as_vec3().as_dvec3();
            }
        }
    }
}

/// The operations of high bytes.
fn step_more(state: &mut State, bytes: &mut Bytes<'_>, operation: u8, tag: u32) {
    let before = state.cuttable.mesh().clone();
    match operation % 4 {
        0 => {
            let options = bytes.options(tag);
            let (center, radius) = (bytes.vector(), bytes.number());
            let ball = |x: DVec3| x.distance(center) - radius;
            let result = cut_level_set(&mut state.cuttable, &state.positions, ball, &options);
            state.followed_by_memory(&before, &options, result);
        }
        1 | 2 => {
            let options = bytes.options(tag);
            let Ok(surface) = surface(bytes) else {
                return;
            };
            let State {
                cuttable,
                positions,
                registry,
                ..
            } = state;
            let earlier = registry.clone();
            let result = match registry {
                Some(registry) => {
                    cut_surface_joining(cuttable, positions, &surface, &options, registry)
                }
                None => cut_surface(cuttable, positions, &surface, &options),
            };
            state.apply_delta_from(&before, earlier, result);
        }
        _ => two_sweeps(state, bytes, tag),
    }
}

impl State {
    /// Follows a cut that the registry did not see.
    fn followed_by_memory(
        &mut self,
        before: &TetMesh,
        options: &CutOptions,
        result: Result<CutDelta, CutError>,
    ) {
        let earlier = self.registry.clone();
        if let (Some(registry), Ok(delta)) = (&mut self.registry, &result) {
            registry.apply_delta(&self.cuttable, delta, options);
        }
        self.apply_delta_from(before, earlier, result);
    }

    /// One step of a stroke.
    fn advance(&mut self, stroke: &mut Sweep, blade: &[DVec3]) -> Option<CutDelta> {
        let before = self.cuttable.mesh().clone();
        let earlier = self.registry.clone();
        let result = match &mut self.registry {
            Some(registry) => {
                stroke.advance_joining(&mut self.cuttable, &self.positions, blade, registry)
            }
            None => stroke.advance(&mut self.cuttable, &self.positions, blade),
        };
        let delta = result.as_ref().ok().cloned();
        self.apply_delta_from(&before, earlier, result);
        delta
    }
}

/// A ball of 20 or 80 triangles, a box, a rectangle, a strip, or triangles anywhere.
fn surface(bytes: &mut Bytes<'_>) -> Result<TriangleSurface, CutError> {
    let shape = bytes.next();
    let (a, b) = (bytes.vector(), bytes.vector());
    let of = |(points, triangles): (Vec<DVec3>, Vec<[u32; 3]>)| {
        TriangleSurface::new(&points, &triangles)
    };
    match shape % 6 {
        0 => of(crate::bodies::icosphere(a, b.x, usize::from(shape > 127))),
        1 | 2 => of(crate::bodies::cuboid(a, a + b)),
        3 => TriangleSurface::rectangle(a, b, bytes.vector()),
        4 => {
            let count = 2 + usize::from(shape / 6 % 4);
            let first: Vec<DVec3> = std::iter::once(a)
                .chain((1..count).map(|_| bytes.vector()))
                .collect();
            let second: Vec<DVec3> = first.iter().map(|x| *x + b).collect();
            crate::bodies::strip(&first, &second)
        }
        _ => {
            let mut points = vec![a, b];
            points.extend((0..1 + shape / 6 % 6).map(|_| bytes.vector()));
            let count = u32::try_from(points.len()).unwrap_or(3);
            let fan: Vec<[u32; 3]> = (2..count).map(|i| [i - 2, i - 1, i]).collect();
            TriangleSurface::new(&points, &fan)
        }
    }
}

/// Two blades step by step in turn, with now and then tets taken away, each following what the other did.
fn two_sweeps(state: &mut State, bytes: &mut Bytes<'_>, tag: u32) {
    let options = bytes.options(tag);
    let shape = bytes.next();
    let mut strokes: Vec<(Sweep, Vec<DVec3>)> = Vec::new();
    for _ in 0..2 {
        let blade = vec![bytes.vector(), bytes.vector()];
        let Ok(stroke) = Sweep::new(&state.cuttable, &state.positions, &blade, options) else {
            return;
        };
        strokes.push((stroke, blade));
    }
    for step in 0..2 + usize::from(shape % 5) {
        if step == 2 && shape > 191 {
            let (center, before) = (bytes.vector(), state.cuttable.mesh().clone());
            let near = |x: DVec3| x.distance(center) < 0.3;
            let result = carve(&mut state.cuttable, &state.positions, near, tag);
            if let Ok(delta) = &result {
                for (stroke, _) in &mut strokes {
                    stroke.apply_delta(&state.cuttable, delta);
                }
            }
            state.followed_by_memory(&before, &options, result);
        }
        let (stroke, blade) = &mut strokes[step % 2];
        let shift = bytes.vector();
        for point in blade.iter_mut() {
            *point += shift;
        }
        let Some(delta) = state.advance(stroke, blade) else {
            return;
        };
        strokes[1 - step % 2].0.apply_delta(&state.cuttable, &delta);
    }
}

/// A blade of two or three points in up to five poses, the body at rest or drifting.
fn sweep(state: &mut State, bytes: &mut Bytes<'_>, tag: u32) {
    let options = bytes.options(tag);
    let shape = bytes.next();
    let mut blade: Vec<DVec3> = (0..2 + shape % 2).map(|_| bytes.vector()).collect();
    let Ok(mut stroke) = Sweep::new(&state.cuttable, &state.positions, &blade, options) else {
        return;
    };
    for _ in 0..1 + shape / 2 % 5 {
        let shift = bytes.vector();
        for point in &mut blade {
            *point += shift;
        }
        if shape > 127 {
            let drift = bytes.vector();
            let moved: Vec<DVec3> = state.positions.iter().map(|x| *x + drift).collect();
            if moved.iter().all(|p| p.is_finite()) {
                state.positions = moved;
            }
        }
        if state.advance(&mut stroke, &blade).is_none() {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    /// A bent blade that zigzags through one tet opens a face at a particle that the frame does not name; the tets at
    /// the face's other particles then hung together by that particle alone.
    #[test]
    fn a_blade_that_crosses_its_own_path() {
        super::run(&[
            144, 238, 0, 0, 0, 0, 0, 0, 0, 0, 224, 126, 64, 128, 0, 0, 34, 190, 69, 44, 174, 111,
            30, 235, 130, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 42, 40, 37, 113, 153, 0, 220, 157, 218,
            36, 149, 105, 70, 0, 174, 158, 7, 76, 62, 100, 253, 4, 0, 6, 0, 0, 0, 0, 0, 0, 0, 0, 0,
        ]);
    }

    /// Found by the fuzzer: strokes that cut the same slivers again and again made tets that rounding left no volume.
    #[test]
    fn slivers_of_slivers_keep_a_volume() {
        super::run(&[
            5, 6, 40, 24, 211, 218, 24, 40, 218, 218, 218, 24, 40, 218, 218, 24, 218, 218, 180,
            218, 24, 40, 218, 218, 218, 218, 218, 24, 218, 218, 218, 18, 32, 28,
        ]);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]

        #[test]
        fn random_programs(program in prop::collection::vec(any::<u8>(), 0..120)) {
            super::run(&program);
        }
    }
}
