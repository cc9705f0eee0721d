//! Cost of updates, counted in tets filled in, and occupancy of blocks.

use glam::{DQuat, DVec3};
use incise_graph::{ClusterId, Clustering, ColorId, Coloring, Schedule};

use super::blocks::metric_factor;
use super::update::{CALM, SPARE};
use super::*;
use crate::Material;
use crate::neo_hookean::TetConstraint;

const LANES: usize = 8;

/// Any tet will do; only its number tells it from others.
fn ingredients(tet: u32) -> Ingredients<f32> {
    let rubber = Material {
        young_modulus: 1e6,
        poisson_ratio: 0.45,
        density: 1e3,
        damping: 0.0,
    };
    let rest = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    Ingredients {
        tet: TetConstraint::new([tet, tet + 1, tet + 2, tet + 3], rest, &rubber),
        weights: [1.0, 2.0, 3.0, 4.0],
        constants: [1.0, 2.0, 3.0],
    }
}

/// Clusters of five in thirty colors, and what changed.
struct Plan {
    clustering: Clustering,
    coloring: Coloring,
    tets: Vec<u32>,
    clusters: Vec<ClusterId>,
    schedule: Schedule,
    layout: Layout<f32>,
}

impl Plan {
    fn new(clusters: u32) -> Self {
        let labels = (0..5 * clusters).map(|t| ClusterId(t / 5)).collect();
        let clustering = Clustering::from_labels(labels).unwrap();
        let coloring = Coloring::new((0..clusters).map(|k| ColorId(k % 30)).collect());
        let schedule = Schedule::new(&clustering, &coloring);
        let mut layout = Layout::default();
        let filled = layout.update(&schedule, LANES, true, Vec::new, ingredients);
        assert_eq!(filled, 5 * clusters as usize);
        Self {
            clustering,
            coloring,
            tets: Vec::new(),
            clusters: Vec::new(),
            schedule,
            layout,
        }
    }

    /// Replaces a tet by two in a cluster of its own number or a new one.
    fn replace(&mut self, tet: u32, color: u32) {
        let new = self.clustering.constraint_count();
        self.clustering.remove(tet as usize);
        let cluster = self.clustering.new_cluster(tet as usize);
        self.clustering.assign(new, cluster);
        if cluster.index() == self.coloring.vertex_count() {
            self.coloring.push(ColorId(color));
        }
        self.tets.extend([tet, u32::try_from(new).unwrap()]);
        self.recolor(cluster, color);
    }

    fn recolor(&mut self, cluster: ClusterId, color: u32) {
        self.coloring.set(cluster.index(), ColorId(color));
        self.clusters.push(cluster);
    }

    /// Updates and checks; returns the tets filled in.
    fn update(&mut self) -> usize {
        self.schedule.update(
            &self.clustering,
            &self.coloring,
            &std::mem::take(&mut self.tets),
            &std::mem::take(&mut self.clusters),
        );
        assert!(!self.layout.fits(&self.schedule));
        let filled = self
            .layout
            .update(&self.schedule, LANES, true, Vec::new, ingredients);
        assert!(self.layout.fits(&self.schedule));
        self.layout.check(&self.schedule, ingredients).unwrap();
        filled
    }
}

/// A cut of 20 tets changes up to 20 clusters of 5 and makes 20 of 2, whatever the size of the body. What is rebuilt
/// now and then is less than that in the long run.
#[test]
fn update_cost_is_proportional_to_the_cut() {
    for clusters in [2_000, 20_000] {
        let (mut plan, cuts, mut filled) = (Plan::new(clusters), 40, 0);
        for cut in 0..cuts {
            for i in 0..20 {
                plan.replace((cut * 20 + i) * 11, (7 * i + cut) % 32);
            }
            filled += plan.update();
        }
        assert!(
            filled <= 2 * 40 * 20 * (5 + 2),
            "{filled} of {clusters} clusters"
        );
    }
}

/// Clusters that wander leave holes everywhere: colors are rebuilt (the check proves that none is wasteful), and blocks
/// without clusters do not pile up.
#[test]
fn blocks_stay_well_used() {
    let clusters = 600;
    let (mut plan, mut filled, rounds) = (Plan::new(clusters), 0, 300);
    let first = plan.layout.blocks.len();
    for round in 0..rounds {
        for i in 0..20 {
            let k = (round * 20 + i) * 7 % clusters;
            // Most crowd into few colors, then into others.
            plan.recolor(ClusterId(k), (i * i + round / 10) % 40);
        }
        filled += plan.update();
        let used: usize = plan
            .layout
            .groups
            .usages
            .iter()
            .map(|u| u.blocks as usize)
            .sum();
        assert_eq!(
            used + plan.layout.groups.free_blocks,
            plan.layout.blocks.len()
        );
        assert!(plan.layout.groups.free_blocks <= used);
    }
    let last = plan.layout.blocks.len();
    assert!(last < 4 * first, "{last} blocks instead of {first}");
    // A cluster that moves takes its five tets; rebuilding colors costs no more than some times that.
    assert!(filled < 4 * 5 * 20 * rounds as usize, "{filled}");
}

/// Only the tets that were touched, each once.
#[test]
fn a_touched_tet_is_filled_in_once() {
    let mut plan = Plan::new(100);
    for tet in [3, 7, 3, 499, 1_000] {
        plan.layout.touch(tet);
    }
    assert!(!plan.layout.fits(&plan.schedule));
    let filled = plan
        .layout
        .update(&plan.schedule, LANES, true, Vec::new, ingredients);
    assert_eq!(filled, 3);
    // Also if its cluster moves at the same time.
    plan.layout.touch(7);
    plan.recolor(ClusterId(1), 31);
    assert_eq!(plan.update(), 5);
}

/// A tet with other corners may give its cluster another order.
#[test]
fn a_tet_with_other_corners_fills_in_its_cluster() {
    let mut plan = Plan::new(100);
    let relinked = |tet: u32| {
        let mut now = ingredients(tet);
        if tet == 7 {
            now.tet.particles = [7, 9, 1_000, 8];
        }
        now
    };
    plan.layout.touch(7);
    assert!(plan.layout.check(&plan.schedule, relinked).is_err());
    let filled = plan
        .layout
        .update(&plan.schedule, LANES, true, Vec::new, relinked);
    assert_eq!(filled, 5);
    plan.layout.check(&plan.schedule, relinked).unwrap();
    let mut rebuilt = Layout::default();
    rebuilt.update(&plan.schedule, LANES, true, Vec::new, relinked);
    assert_eq!(plan.layout.blocks.corners, rebuilt.blocks.corners);
    assert_eq!(plan.layout.blocks.changed, rebuilt.blocks.changed);
    assert_eq!(plan.layout.blocks.orders, rebuilt.blocks.orders);
}

/// The check finds each wrong bit of the masks, one corner in the slot of another, and a corner that is another particle.
#[test]
fn the_check_finds_corners_that_are_not_moved() {
    let plan = Plan::new(100);
    plan.layout.check(&plan.schedule, ingredients).unwrap();
    let moved = plan.layout.blocks.changed.iter();
    let moved: u32 = moved.map(|bits| bits.count_ones()).sum();
    // Clusters are strips of five.
    assert_eq!(moved, 4 * 100);
    for block in (0..plan.layout.blocks.len()).step_by(3) {
        for bit in 0..4 * LANES {
            let mut wrong = plan.layout.clone();
            wrong.blocks.changed[block] ^= 1 << bit;
            assert!(
                wrong.check(&plan.schedule, ingredients).is_err(),
                "{block} {bit}"
            );
            let mut wrong = plan.layout.clone();
            let corners = &mut wrong.blocks.corners[4 * LANES * block..4 * LANES * (block + 1)];
            corners.swap(bit, (bit + LANES) % (4 * LANES));
            let is_same = corners[bit] == corners[(bit + LANES) % (4 * LANES)];
            assert!(
                is_same || wrong.check(&plan.schedule, ingredients).is_err(),
                "{block} {bit}"
            );
        }
    }
}

/// Another schedule, even an equal one, rebuilds the layout.
#[test]
fn another_schedule_is_laid_out() {
    let mut plan = Plan::new(50);
    let copy = plan.schedule.clone();
    assert!(plan.layout.fits(&copy));
    let equal = Schedule::new(&plan.clustering, &plan.coloring);
    assert!(!plan.layout.fits(&equal));
    assert_eq!(
        plan.layout
            .update(&equal, LANES, true, Vec::new, ingredients),
        250
    );
    plan.layout.forget();
    assert!(!plan.layout.fits(&equal));
    assert_eq!(
        plan.layout
            .update(&equal, LANES, true, Vec::new, ingredients),
        250
    );
}

/// In calm frames each color comes to the blocks that it needs, a color a frame, and then nothing is done. Changes and calm
/// frames in turn do not rebuild all again and again.
#[test]
fn calm_frames_leave_no_idle_lanes() {
    let clusters = 600;
    let (mut plan, mut rebuilt) = (Plan::new(clusters), 0);
    for round in 0..40 {
        for i in 0..60 {
            let k = (round * 60 + i) * 7 % clusters;
            plan.recolor(ClusterId(k), (i * i + round) % 40);
            plan.replace((round * 60 + i) * 11 % (5 * clusters), (7 * i + round) % 32);
        }
        let all = plan.clustering.constraint_count();
        rebuilt += usize::from(plan.update() >= all);
        let blocks =
            |plan: &Plan| -> u32 { plan.layout.groups.usages.iter().map(|u| u.blocks).sum() };
        let (before, largest) = (blocks(&plan), |plan: &Plan| {
            let tets = plan.layout.groups.usages.iter().map(|u| u.tets);
            tets.max().unwrap_or(0) as usize
        });
        for call in 0.. {
            let filled = plan.layout.compact(&plan.schedule, ingredients);
            assert!(filled <= largest(&plan), "more than a color");
            plan.layout.check(&plan.schedule, ingredients).unwrap();
            if call >= CALM && filled == 0 {
                break;
            }
            assert!(
                call < CALM + 41 && (call + 1 >= CALM || filled == 0),
                "{call}"
            );
        }
        assert!(round > 20 || blocks(&plan) < before, "round {round}");
        for color in 0..plan.schedule.color_count() {
            let clusters = plan.schedule.clusters(color);
            let needed = plan.layout.blocks_needed(clusters, &plan.schedule);
            let found = plan.layout.block_count_of(color);
            assert!(found >= needed && SPARE * found <= (SPARE + 1) * needed);
        }
    }
    assert!(rebuilt <= 4, "{rebuilt} times");
}

/// A sliver a hundred thousand times as wide as thick does not move along its thin direction, in which its gradients
/// are that much longer. Computed as `G : AᵀA` in single precision, the sum was wrong by any factor, and even negative.
#[test]
fn the_metric_factor_bears_slivers_in_single_precision() {
    let rubber = Material {
        young_modulus: 1e6,
        poisson_ratio: 0.45,
        density: 1e3,
        damping: 0.0,
    };
    let turn = DQuat::from_axis_angle(DVec3::new(0.3, -0.5, 0.8).normalize(), 1.1);
    let flat = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(0.3, 0.3, 1e-5)];
    let tet = TetConstraint::<f32>::new([0, 1, 2, 3], flat.map(|x| turn * (x * 0.01)), &rubber);
    let weights = [1e6, 1.0, 1.0, 1e3];
    // The columns of a matrix that takes the thin direction to nothing, up to rounding.
    let thin = turn * DVec3::Z;
    let a = DVec3::AXES.map(|axis| (axis - thin * thin.dot(axis)).as_vec3());
    let [xx, yy, zz, yx, zx, zy] = metric_factor(&tet, weights);
    let factored = [
        a[0] * xx + a[1] * yx + a[2] * zx,
        a[1] * yy + a[2] * zy,
        a[2] * zz,
    ];
    let found: f32 = factored.iter().map(|column| column.length_squared()).sum();
    let q = tet.inverse_rest.map(f64::from);
    let gradients = [0, 1, 2].map(|k| DVec3::from_slice(&q[3 * k..3 * k + 3]));
    let first = -(gradients[0] + gradients[1] + gradients[2]);
    let corners = [first, gradients[0], gradients[1], gradients[2]];
    let exact: f64 = corners
        .into_iter()
        .zip(weights)
        .map(|(q, w)| {
            let moved = (0..3).map(|axis| a[axis].as_dvec3() * q[axis]);
            f64::from(w) * moved.sum::<DVec3>().length_squared()
        })
        .sum();
    let ratio = f64::from(found) / (exact * f64::from(tet.stiffness));
    assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
}
