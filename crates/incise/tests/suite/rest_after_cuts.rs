//! Bodies after random cuts, with the default settings: at rest they stay at rest, under load they stay bounded.

use incise::mesh_io;
use incise::meshing::{Shape, irregular};
use incise::scene::{Precision, Scene};
use incise::{Simulation, WarningCode};

/// Random numbers from 0 to below 1 (`SplitMix64`).
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn vector(&mut self, size: f64) -> [f64; 3] {
        [(); 3].map(|()| size * (2.0 * self.next() - 1.0))
    }
}

/// A free body of 25 cm without gravity, and random strokes of a blade through it, one in each frame.
fn scene(shape: &str, strokes: usize, snap: f64, precision: Precision, seed: u64) -> Scene {
    let text = format!(
        "{}[report]\nquantities = [\"speed\", \"volume\"]\n[solver]\ntime_step = 0.01\nprecision = \"{}\"\n\
         [[body]]\nshape = {{ kind = \"{shape}\", tets = 1500 }}\nscale = 0.25\nyoung_modulus = 1e5\n{}",
        improvement(snap),
        precision.name(),
        random_sweeps(strokes, snap, seed)
    );
    Scene::from_toml(&text).unwrap()
}

/// Improvement as by default, but off with a snap of 0, where in single precision corners of slivers move by 1 to 2 cm/s
/// after some frames with or without it.
fn improvement(snap: f64) -> &'static str {
    if snap == 0.0 {
        "[cutting]\nimprove = false\n"
    } else {
        ""
    }
}

/// Measured after 10 strokes: at most 2e-11 m/s in double and 2e-4 m/s in single precision, with snapping of 0, 0.1
/// and 0.2 each. With the block form and tets softened to kappa 1 bodies cut like this shook themselves apart at meters a
/// second.
#[test]
fn random_strokes_leave_a_body_at_rest_alone() {
    for (shape, snap, seed) in [("liver", 0.0, 1), ("sphere", 0.1, 2), ("box", 0.2, 3)] {
        for (precision, bound) in [(Precision::F64, 1e-9), (Precision::F32, 1e-2)] {
            let scene = scene(shape, 10, snap, precision, seed);
            let mut simulation = Simulation::new(&scene).unwrap();
            let (mut speeds, mut inverted) = ([0.0_f64; 2], 0);
            for frame in 0..80 {
                let report = simulation.step().unwrap();
                let part = &mut speeds[usize::from(frame >= 45)];
                *part = part.max(report.max_speed.unwrap());
                inverted += report.inverted_tets.unwrap();
                assert!(!report.warnings().iter().any(|w| w.is_failure()));
            }
            let what = format!("{shape}, snap {snap}, {}: {speeds:?}", precision.name());
            assert!(simulation.mesh().tets.len() > 2000, "{what}");
            assert_eq!(inverted, 0, "{what}");
            assert!(speeds[0] < bound && speeds[1] < bound, "{what}");
            // In these bodies it does not grow. In some others rounding keeps vibrations going: docs/solver.md, Limits.
            assert!(speeds[1] <= 2.0 * speeds[0], "{what}");
        }
    }
}

/// Random sweeps of a blade through a body of 25 cm, one in each of the first frames.
fn random_sweeps(count: usize, snap: f64, seed: u64) -> String {
    let mut random = Random(seed);
    let mut text = String::new();
    for frame in 0..count {
        let [a, b, path] = [0.15, 0.15, 0.2].map(|size| random.vector(size));
        text += &format!(
            "[[stroke]]\nkind = \"sweep\"\nframes = [{frame}, {}]\nblade = [{a:?}, {b:?}]\n\
             path = [[0.0, 0.0, 0.0], {path:?}]\nsnap = {snap}\n",
            frame + 1
        );
    }
    text
}

/// A Delaunay mesh of scattered points has no regular neighborhoods. All three snap distances in both precisions; the
/// full bar, 30 strokes and 500 frames, is `cargo xtask defaults`.
#[test]
fn an_irregular_body_stays_at_rest_at_every_snap_distance() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("irregular.vtk");
    mesh_io::write(&file, &irregular(Shape::Torus, 600, 5).unwrap()).unwrap();
    let (strokes, frames) = (12, 60);
    for snap in [0.0, 0.1, 0.2] {
        for (precision, bound) in [(Precision::F64, 1e-9), (Precision::F32, 1e-2)] {
            let text = format!(
                "{}[report]\nquantities = [\"speed\", \"volume\"]\n[solver]\nprecision = \"{}\"\n\
                 [[body]]\nmesh = {file:?}\nscale = 0.25\nyoung_modulus = 1e5\n{}",
                improvement(snap),
                precision.name(),
                random_sweeps(strokes, snap, 7)
            );
            let mut simulation = Simulation::new(&Scene::from_toml(&text).unwrap()).unwrap();
            let tets = simulation.mesh().tets.len();
            let (mut speeds, mut inverted) = ([0.0_f64; 2], 0);
            for frame in 0..strokes + frames {
                let report = simulation.step().unwrap();
                inverted += report.inverted_tets.unwrap();
                // The strokes end one frame after the last one begins.
                if frame > strokes {
                    let part = &mut speeds[usize::from(frame >= strokes + frames / 2)];
                    *part = part.max(report.max_speed.unwrap());
                }
            }
            let what = format!("snap {snap}, {}: {speeds:?}", precision.name());
            assert!(simulation.mesh().tets.len() > 3 * tets / 2, "{what}");
            assert_eq!(inverted, 0, "{what}");
            assert!(speeds[0] < bound && speeds[1] < bound, "{what}");
            assert!(speeds[1] <= 2.0 * speeds[0], "{what}");
        }
    }
}

/// Slivers of cuts under load, from a body that collapses under its weight to one that is rigid, by few and by many
/// substeps, nothing softened. All of E and substeps: `cargo xtask defaults`.
#[test]
fn a_cut_body_that_falls_on_a_ground_stays_bounded_at_every_stiffness() {
    for young_modulus in ["1e3", "1e6", "1e9", "1e12"] {
        for (substeps, precision) in [
            (5, Precision::F32),
            (5, Precision::F64),
            (20, Precision::F32),
            (20, Precision::F64),
        ] {
            let text = format!(
                "[report]\nquantities = [\"speed\", \"kappa\"]\n[world]\ngravity = [0.0, 0.0, -9.81]\n\
                 ground = {{ height = -0.15, friction = 0.5 }}\n[solver]\ntime_step = 0.01\nsubsteps = {substeps}\n\
                 precision = \"{}\"\n[[body]]\nshape = {{ kind = \"liver\", tets = 300 }}\nscale = 0.25\n\
                 young_modulus = {young_modulus}\n{}",
                precision.name(),
                random_sweeps(12, 0.0, 18)
            );
            let mut simulation = Simulation::new(&Scene::from_toml(&text).unwrap()).unwrap();
            let (mut fastest, mut at_end) = (0.0_f64, 0.0_f64);
            for frame in 0..80 {
                let report = simulation.step().unwrap();
                let what = format!("{young_modulus}, {substeps}, {}", precision.name());
                let speed = report.max_speed.unwrap();
                fastest = fastest.max(speed);
                if frame >= 50 {
                    at_end = at_end.max(speed);
                }
                assert_eq!(report.softened.map_or(0, |s| s.tets), 0, "{what}");
                assert!(!report.warnings().iter().any(|w| w.is_failure()), "{what}");
            }
            // A fall from the top of the body to the ground reaches 2.5 m/s.
            let what = format!(
                "{young_modulus}, {substeps}, {}: {fastest}, {at_end}",
                precision.name()
            );
            assert!(fastest < 25.0 && at_end < 8.0, "{what}");
        }
    }
}

/// Slivers in a body that hangs by one end over a ground, by VBD alone and with corrections, far from convergence. Before substeps
/// started below the potential of a safe start, runs like these ended as diverged.
#[test]
fn slivers_under_load_stay_bounded_by_vbd() {
    let two_level = "two_level = true\niterations = 5\n";
    for (keys, precision, seed) in [
        ("", Precision::F32, 1),
        ("", Precision::F32, 2),
        ("", Precision::F64, 2),
        (two_level, Precision::F32, 1),
    ] {
        let text = format!(
            "[report]\nquantities = [\"speed\", \"volume\"]\n[world]\ngravity = [0.0, 0.0, -9.81]\n\
                 ground = {{ height = -0.3, friction = 0.5 }}\n[solver]\nmethod = \"vbd\"\nprecision = \"{}\"\n\
                 {keys}[[body]]\nshape = {{ kind = \"liver\", tets = 600 }}\nscale = 0.2\nyoung_modulus = 1e5\n\
                 poisson_ratio = 0.49\nfixed = [{{ half_space = {{ point = [-0.08, 0.0, 0.0], normal = [-1.0, 0.0, 0.0] }} }}]\n{}",
            precision.name(),
            random_rectangles(24, seed)
        );
        let mut simulation = Simulation::new(&Scene::from_toml(&text).unwrap()).unwrap();
        let what = format!("{keys:?}, {}, seed {seed}", precision.name());
        let (mut fastest, mut volume) = (0.0_f64, 0.0_f64);
        for _ in 0..120 {
            let report = simulation.step().unwrap();
            fastest = fastest.max(report.max_speed.unwrap());
            volume = volume.max(report.volume_error.unwrap().abs());
            assert!(!report.warnings().iter().any(|w| w.is_failure()), "{what}");
        }
        assert!(simulation.mesh().tets.len() > 2000, "{what}");
        // A fall to the ground reaches 2.8 m/s.
        assert!(
            fastest < 28.0 && volume < 0.01,
            "{what}: {fastest} m/s, {volume}"
        );
    }
}

/// Random rectangles through a body of 20 cm without snapping, one in every third frame.
fn random_rectangles(count: usize, seed: u64) -> String {
    let mut random = Random(seed);
    let mut text = String::new();
    for stroke in 0..count {
        let [x, y, z] = random.vector(1.0);
        let center = [0.08 * x, 0.03 * y, 0.03 * z];
        let [half_u, half_v] = [0.03, 0.03].map(|size| random.vector(size));
        text += &format!(
            "[[stroke]]\nkind = \"rectangle\"\nframe = {}\ncenter = {center:?}\nhalf_u = {half_u:?}\n\
             half_v = {half_v:?}\nsnap = 0.0\n",
            2 + 3 * stroke
        );
    }
    text
}

/// Under load, after cuts without snapping, slivers hold much of the elastic energy: a warning says so, once, and only where
/// energy is reported. A body that is not cut has none.
#[test]
fn energy_of_slivers_is_told() {
    let warnings = |strokes: usize, quantity: &str| -> usize {
        let text = format!(
            "[world]\ngravity = [0.0, 0.0, -9.81]\n[report]\nquantities = [\"{quantity}\"]\n\
             [[body]]\nshape = {{ kind = \"liver\", tets = 1500 }}\nscale = 0.25\nyoung_modulus = 1e4\n\
             fixed = [{{ half_space = {{ point = [-0.08, 0.0, 0.0], normal = [-1.0, 0.0, 0.0] }} }}]\n{}",
            random_sweeps(strokes, 0.0, 3)
        );
        let mut simulation = Simulation::new(&Scene::from_toml(&text).unwrap()).unwrap();
        let frames = (0..40).map(|_| {
            let warnings = simulation.step().unwrap().warnings();
            let told = warnings
                .iter()
                .filter(|w| w.code == WarningCode::SliverEnergy);
            told.count()
        });
        frames.sum()
    };
    assert_eq!(warnings(12, "energy"), 1);
    assert_eq!(warnings(12, "volume"), 0);
    assert_eq!(warnings(0, "energy"), 0);
}
