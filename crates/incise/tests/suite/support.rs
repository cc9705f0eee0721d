//! Scenes in a few words, and what several tests ask of a simulation.

use incise::mesh::glam::DVec3;
use incise::{Scene, Simulation};

/// A scene from TOML.
pub(crate) fn scene(text: &str) -> Scene {
    Scene::from_toml(text).unwrap()
}

/// A simulation of a scene on one thread.
pub(crate) fn simulation(scene: &Scene) -> Simulation {
    Simulation::with_threads(scene, 1).unwrap()
}

/// The text of a soft body; its origin goes to `position`.
pub(crate) fn body(kind: &str, tets: usize, position: [f64; 3]) -> String {
    format!(
        "[[body]]\nshape = {{ kind = \"{kind}\", tets = {tets} }}\nyoung_modulus = 1e4\nposition = {position:?}\n"
    )
}

/// The text of a plane stroke.
pub(crate) fn plane(frame: u64, point: [f64; 3], normal: [f64; 3]) -> String {
    format!(
        "[[stroke]]\nkind = \"plane\"\nframe = {frame}\npoint = {point:?}\nnormal = {normal:?}\n"
    )
}

/// The text of a sweep of a straight blade along a straight path.
pub(crate) fn sweep(frames: [u64; 2], blade: [[f64; 3]; 2], way: [f64; 3]) -> String {
    format!(
        "[[stroke]]\nkind = \"sweep\"\nframes = {frames:?}\nblade = {blade:?}\npath = [[0.0, 0.0, 0.0], {way:?}]\n"
    )
}

/// The center and the half extents of what a scene's bodies span at rest.
pub(crate) fn extent(scene: &Scene) -> (DVec3, DVec3) {
    let simulation = simulation(scene);
    let positions = simulation.positions();
    let low = positions.iter().copied().reduce(DVec3::min).unwrap();
    let high = positions.iter().copied().reduce(DVec3::max).unwrap();
    (0.5 * (low + high), 0.5 * (high - low))
}

/// FNV-1a over 64-bit words.
pub(crate) fn hash(words: impl IntoIterator<Item = u64>) -> u64 {
    words
        .into_iter()
        .flat_map(u64::to_le_bytes)
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        })
}

/// Everything a frame leaves behind, as words: positions to the bit, clusters, colors, the order of solving.
pub(crate) fn state(simulation: &Simulation) -> Vec<u64> {
    let coordinates = simulation.positions().iter().flat_map(|x| x.to_array());
    let clustering = simulation.clustering();
    coordinates
        .map(f64::to_bits)
        .chain(
            clustering
                .labels()
                .iter()
                .map(|cluster| u64::from(cluster.0)),
        )
        .chain(plan(simulation))
        .collect()
}

/// Colors and schedule as words: the order of solving with the clusters of each color sorted, which run at the same
/// time, and where each color and each cluster ends.
fn plan(simulation: &Simulation) -> Vec<u64> {
    let schedule = simulation.schedule();
    let coloring = simulation.coloring();
    let (mut order, mut colors, mut ends) = (Vec::new(), vec![0], vec![0]);
    for color in 0..schedule.color_count() {
        let mut clusters = schedule.clusters(color).to_vec();
        clusters.sort_unstable();
        for cluster in clusters {
            order.extend(schedule.constraints(cluster).iter().map(|&t| u64::from(t)));
            ends.push(order.len() as u64);
        }
        colors.push(ends.len() as u64 - 1);
    }
    coloring
        .colors()
        .iter()
        .map(|color| u64::from(color.0))
        .chain(order)
        .chain(colors)
        .chain(ends)
        .collect()
}

/// A hash of a seed and a number, in -1..1.
pub(crate) fn noise(seed: u64, number: usize) -> f64 {
    let mut x = seed ^ (number as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    for _ in 0..2 {
        x = (x ^ (x >> 31)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    }
    (x >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}
