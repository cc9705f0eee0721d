//! Bodies of all sizes at the limits of threads, workgroups and rows of them, compared with the CPU twin.

use glam::DVec3;
use incise_gpu::{ClusterMapping, GpuSolver};
use incise_graph::{ClusterId, Clustering, ColorId, Coloring, Incidence, Schedule};
use incise_xpbd::{Solver, StepSettings};
use proptest::prelude::*;

use crate::solver::{SOFT, share};
use crate::support::gpu;

fn settings() -> StepSettings {
    StepSettings {
        substeps: 2,
        iterations: 2,
        gravity: Some(DVec3::new(0.0, 1.0, -9.81)),
        ..StepSettings::new(0.01)
    }
}

/// Tets on their corners, each of the same mass, a little out of shape; `pinned` particles do not move.
fn solver(positions: &[DVec3], tets: &[[u32; 4]], pinned: usize) -> Solver<f32> {
    let mut solver = Solver::new(positions);
    solver.add_material(SOFT).unwrap();
    for tet in tets {
        let rest = tet.map(|p| positions[p as usize] * 1.01);
        solver.push_tet(*tet, rest, 0);
    }
    for p in 0..positions.len() {
        solver.set_mass(p, 1.0);
        solver.set_fixed(p, p < pinned);
    }
    solver
}

/// Solves both ways; the twin's order is that of the device if clusters are single tets.
fn compare(test: &str, make: impl Fn() -> Solver<f32>, colors: &[u32], form: ClusterMapping) {
    let Some(gpu) = gpu(test) else { return };
    let coloring = Coloring::new(colors.iter().map(|&color| ColorId(color)).collect());
    let schedule = Schedule::new(&Clustering::none(colors.len()), &coloring);
    let (mut twin, mut device) = (make(), GpuSolver::new(share(gpu), make(), form).unwrap());
    for _ in 0..2 {
        twin.step(&schedule, &settings()).unwrap();
        device.step(&schedule, &settings()).unwrap();
    }
    device.check(&schedule).unwrap();
    let host = device.host().unwrap();
    for p in 0..twin.particle_count() {
        // A few roundings of coordinates of the order of 1.
        let far = host.position(p).distance(twin.position(p));
        assert!(
            far < 1e-5,
            "{test}, {} tets: particle {p} is {far} off",
            colors.len()
        );
    }
}

/// So many tets that share nothing.
fn apart(test: &str, count: u32, form: ClusterMapping) {
    let corners = [DVec3::ZERO, DVec3::Y, DVec3::X, DVec3::NEG_Z].map(|x| x * 0.1);
    let tets: Vec<[u32; 4]> = (0..count)
        .map(|t| [0, 1, 2, 3].map(|k| 4 * t + k))
        .collect();
    let grid = |t: u32| {
        DVec3::new(
            f64::from(t % 16),
            f64::from(t / 16 % 16),
            f64::from(t / 256),
        ) / 16.0
    };
    let positions: Vec<DVec3> = (0..count)
        .flat_map(|t| corners.map(|x| x + grid(t)))
        .collect();
    compare(
        test,
        || solver(&positions, &tets, 1),
        &vec![0; count as usize],
        form,
    );
}

#[test]
fn threads_and_workgroups_of_all_sizes() {
    for count in [0, 1, 63, 64, 65, 255, 256, 257] {
        apart(
            "threads_and_workgroups_of_all_sizes",
            count,
            ClusterMapping::Threads,
        );
        apart(
            "threads_and_workgroups_of_all_sizes",
            count,
            ClusterMapping::Workgroups,
        );
    }
}

/// So many tets around particle 0 that share nothing else.
fn fan(count: u32) -> (Vec<DVec3>, Vec<[u32; 4]>) {
    let mut positions = vec![DVec3::ZERO];
    for t in 0..count {
        let angle = f64::from(t) * std::f64::consts::TAU / f64::from(count);
        let (sin, cos) = angle.sin_cos();
        let across = DVec3::new(-sin, cos, 0.0) * 0.02;
        let out = DVec3::new(cos, sin, 0.0);
        positions.extend([out - across, out + across, out + DVec3::Z * 0.3]);
    }
    let tets: Vec<[u32; 4]> = (0..count)
        .map(|t| [0, 3 * t + 1, 3 * t + 2, 3 * t + 3])
        .collect();
    (positions, tets)
}

/// All tets on one particle: as many colors as tets, and all of them in one dispatch.
#[test]
fn a_fan_has_a_color_for_each_tet() {
    let test = "a_fan_has_a_color_for_each_tet";
    for count in [64u32, 360] {
        let (positions, tets) = fan(count);
        let colors: Vec<u32> = (0..count).collect();
        for form in [ClusterMapping::Threads, ClusterMapping::Workgroups] {
            compare(test, || solver(&positions, &tets, 1), &colors, form);
        }
    }
}

/// More particles than a row of workgroups has threads.
#[test]
fn particles_beyond_one_row_of_workgroups() {
    let Some(gpu) = gpu("particles_beyond_one_row_of_workgroups") else {
        return;
    };
    let count = 65_535 * 64 + 100;
    let positions: Vec<DVec3> = (0..count)
        .map(|p| DVec3::X * (p % 1000) as f64 / 1000.0)
        .collect();
    let mut falling = Solver::<f32>::new(&positions);
    for p in 0..count {
        falling.set_mass(p, 1.0);
    }
    let mut device = GpuSolver::new(share(gpu), falling, ClusterMapping::Threads).unwrap();
    let settings = StepSettings {
        gravity: Some(DVec3::NEG_Z),
        ..StepSettings::new(0.1)
    };
    device.step(&Schedule::default(), &settings).unwrap();
    let host = device.host().unwrap();
    for p in (0..count).step_by(997).chain(count - 200..count) {
        // z = -g t² of one step.
        assert!((host.position(p).z + 0.01).abs() < 1e-7, "particle {p}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Tets on random particles, in colors that a greedy pass gives them.
    #[test]
    fn random_bodies(
        points in prop::collection::vec(prop::array::uniform3(-1.0..1.0f64), 4..80),
        picks in prop::collection::vec(prop::array::uniform4(any::<prop::sample::Index>()), 0..120),
        pinned in 0..4usize,
    ) {
        let positions: Vec<DVec3> = points.into_iter().map(DVec3::from_array).collect();
        let corners = |pick: [prop::sample::Index; 4]| pick.map(|i| i.index(positions.len()));
        let sound = |tet: &[usize; 4]| {
            let [a, b, c, d] = tet.map(|p| positions[p]);
            // Slivers would blow rounding up.
            (b - a).cross(c - a).dot(d - a) > 0.05
        };
        let tets: Vec<[u32; 4]> = picks
            .into_iter()
            .map(corners)
            .filter(sound)
            .map(|tet| tet.map(|p| u32::try_from(p).unwrap()))
            .collect();
        let incidence = Incidence::from_constraints(positions.len(), tets.iter().copied()).unwrap();
        let coloring = incise_coloring::greedy(&incidence, incise_coloring::Order::LargestFirst);
        let colors: Vec<u32> = coloring.colors().iter().map(|color| color.0).collect();
        for form in [ClusterMapping::Threads, ClusterMapping::Workgroups] {
            compare("random_bodies", || solver(&positions, &tets, pinned), &colors, form);
        }
    }
}

/// A fan of as many tets as a tile of each size holds, and one more: a step for each tet, in one tile.
#[test]
fn tiles_full_to_the_last_step() {
    let Some(gpu) = gpu("tiles_full_to_the_last_step") else {
        return;
    };
    for count in [63u32, 64, 65, 128, 129, 255, 256] {
        let (positions, tets) = fan(count);
        let together = Clustering::from_labels(vec![ClusterId(0); tets.len()]).unwrap();
        let schedule = Schedule::new(&together, &Coloring::new(vec![ColorId(0)]));
        let make = || solver(&positions, &tets, 1);
        let (mut twin, mut device) = (
            make(),
            GpuSolver::new(share(gpu), make(), ClusterMapping::Workgroups).unwrap(),
        );
        twin.step(&schedule, &settings()).unwrap();
        device.step(&schedule, &settings()).unwrap();
        device.check(&schedule).unwrap();
        let host = device.host().unwrap();
        for p in 0..twin.particle_count() {
            let far = host.position(p).distance(twin.position(p));
            assert!(far < 1e-5, "{count} tets: particle {p} is {far} off");
        }
    }
}
