//! Values printed in the paper, as data for comparison with the measurements.
//!
//! "Parallel Constraint Graph Partitioning and Coloring for Realtime Soft-Body Cutting", measured with CUDA on an RTX
//! 3090 and an i9-10900X (section 5). Names of algorithms and clusterings are ours. Figures 4, 7, 8, 10 and 11 print no
//! numbers.

/// A row of Table 1 (section 5.1.1): clusterings of the liver of 11,367 tets.
pub(super) struct Clustered {
    /// Ks or K.
    pub(super) size: u32,
    /// `greedy-k` or `serial`.
    pub(super) method: &'static str,
    pub(super) clusters: f64,
    pub(super) colors: f64,
    pub(super) cluster_ms: f64,
    pub(super) fps: f64,
}

const fn clustered(
    size: u32,
    method: &'static str,
    [clusters, colors, cluster_ms, fps]: [f64; 4],
) -> Clustered {
    Clustered {
        size,
        method,
        clusters,
        colors,
        cluster_ms,
        fps,
    }
}

pub(super) const TABLE_1: [Clustered; 10] = [
    clustered(5, "greedy-k", [2245.0, 26.0, 79084.0, 108.0]),
    clustered(5, "serial", [1972.0, 32.0, 11.0, 110.0]),
    clustered(10, "greedy-k", [1098.0, 19.0, 79476.0, 132.0]),
    clustered(10, "serial", [1177.0, 24.0, 11.0, 134.0]),
    clustered(15, "greedy-k", [711.0, 21.0, 78392.0, 109.0]),
    clustered(15, "serial", [909.0, 23.0, 8.0, 126.0]),
    clustered(20, "greedy-k", [527.0, 23.0, 114_426.0, 74.0]),
    clustered(20, "serial", [764.0, 23.0, 8.0, 101.0]),
    clustered(25, "greedy-k", [414.0, 24.0, 69107.0, 67.0]),
    clustered(25, "serial", [676.0, 22.0, 7.0, 91.0]),
];

/// A row of Table 2 (section 5.1).
#[derive(Clone, Copy)]
pub(super) struct Colored {
    pub(super) algorithm: &'static str,
    pub(super) colors: f64,
    pub(super) std: f64,
    pub(super) range: f64,
    pub(super) chi2: f64,
    pub(super) color_ms: f64,
    pub(super) solve_ms: f64,
    pub(super) fps: f64,
}

const fn colored(algorithm: &'static str, n: [f64; 7]) -> Colored {
    Colored {
        algorithm,
        colors: n[0],
        std: n[1],
        range: n[2],
        chi2: n[3],
        color_ms: n[4],
        solve_ms: n[5],
        fps: n[6],
    }
}

/// The part of Table 2 on one model.
pub(super) struct Model {
    /// Of ours that stands for it.
    pub(super) body: &'static str,
    pub(super) tets: usize,
    pub(super) clusters: usize,
    pub(super) cut_ms: f64,
    pub(super) rows: [Colored; 4],
}

pub(super) const TABLE_2: [Model; 4] = [
    Model {
        body: "liver_11k",
        tets: 11_376,
        clusters: 2071,
        cut_ms: 10.0,
        rows: [
            colored("vivace", [295.0, 2.31, 13.0, 31.93, 3.0, 63.0, 13.0]),
            colored("wlc", [50.0, 38.02, 161.0, 42.13, 9.0, 5.0, 40.0]),
            colored("ecl-gc", [50.0, 30.24, 91.0, 26.65, 1.5, 4.3, 63.0]),
            colored("scgc", [50.0, 30.24, 91.0, 26.65, 1.2, 4.3, 65.0]),
        ],
    },
    Model {
        body: "liver_89k",
        tets: 88_957,
        clusters: 11_391,
        cut_ms: 20.0,
        rows: [
            colored("vivace", [313.0, 5.83, 35.0, 8.03, 10.0, 70.0, 10.0]),
            colored("wlc", [51.0, 219.01, 917.0, 49.04, 16.0, 14.0, 20.0]),
            colored("ecl-gc", [48.0, 194.69, 538.0, 32.31, 4.0, 11.0, 28.0]),
            colored("scgc", [48.0, 194.69, 538.0, 32.31, 3.5, 9.8, 30.0]),
        ],
    },
    Model {
        body: "bunny_19k",
        tets: 19_378,
        clusters: 2988,
        cut_ms: 11.0,
        rows: [
            colored("vivace", [279.0, 2.92, 14.0, 20.67, 6.0, 54.0, 14.0]),
            colored("wlc", [49.0, 59.09, 263.0, 46.0, 14.0, 6.3, 32.0]),
            colored("ecl-gc", [48.0, 47.72, 149.0, 28.24, 2.0, 4.8, 56.0]),
            colored("scgc", [48.0, 47.72, 149.0, 28.24, 2.0, 4.5, 57.0]),
        ],
    },
    Model {
        body: "armadillo_55k",
        tets: 54_984,
        clusters: 6141,
        cut_ms: 15.0,
        rows: [
            colored("vivace", [313.0, 4.31, 26.0, 10.15, 8.0, 77.0, 10.0]),
            colored("wlc", [51.0, 156.72, 729.0, 42.13, 14.0, 6.7, 28.0]),
            colored("ecl-gc", [51.0, 132.84, 418.0, 41.42, 3.0, 4.2, 45.0]),
            colored("scgc", [51.0, 132.84, 418.0, 41.42, 2.6, 3.6, 47.0]),
        ],
    },
];

/// A row of Table 3 (section 5.2): to a residual of 1.5, liver of 11,367 tets.
pub(super) struct Converged {
    /// `gauss-seidel`, `jacobi` or `chebyshev`.
    pub(super) method: &'static str,
    /// Cluster size; 1 means without clustering.
    pub(super) cluster: u32,
    pub(super) iterations: f64,
    pub(super) ms: f64,
}

const fn converged(method: &'static str, cluster: u32, iterations: f64, ms: f64) -> Converged {
    Converged {
        method,
        cluster,
        iterations,
        ms,
    }
}

pub(super) const TABLE_3: [Converged; 8] = [
    converged("gauss-seidel", 1, 20128.0, 23062.0),
    converged("gauss-seidel", 5, 17383.0, 20538.0),
    converged("gauss-seidel", 10, 17157.0, 19710.0),
    converged("gauss-seidel", 15, 16861.0, 22751.0),
    converged("gauss-seidel", 20, 16288.0, 25212.0),
    converged("gauss-seidel", 25, 17051.0, 27940.0),
    converged("jacobi", 1, 378_702.0, 28897.0),
    converged("chebyshev", 1, 516_600.0, 49582.0),
];

/// The colors that Figure 9 prints below its pictures.
pub(super) struct Pictured {
    /// Of ours that stands for it.
    pub(super) body: &'static str,
    pub(super) tets: usize,
    pub(super) clusters: usize,
    /// In the order of [`FIGURE_9_ALGORITHMS`].
    pub(super) colors: [f64; 5],
}

pub(super) const FIGURE_9_ALGORITHMS: [&str; 5] = ["scgc", "vivace", "wlc", "mcs", "greedy"];

pub(super) const FIGURE_9: [Pictured; 3] = [
    Pictured {
        body: "liver_11k",
        tets: 11_367,
        clusters: 1177,
        colors: [24.0, 167.0, 29.0, 25.0, 39.0],
    },
    Pictured {
        body: "bunny_19k",
        tets: 19_379,
        clusters: 2077,
        colors: [28.0, 173.0, 34.0, 29.0, 20.0],
    },
    Pictured {
        body: "armadillo_121k",
        tets: 121_190,
        clusters: 12_807,
        colors: [33.0, 182.0, 36.0, 33.0, 47.0],
    },
];

/// The models of Figure 4 (section 5.1) and their tets.
pub(super) const FIGURE_4: [(&str, usize); 9] = [
    ("liver_5k", 4705),
    ("liver_11k", 11_367),
    ("liver_89k", 88_958),
    ("armadillo_55k", 54_985),
    ("armadillo_121k", 121_190),
    ("armadillo_227k", 226_840),
    ("sphere_7k", 6851),
    ("sphere_28k", 27_792),
    ("sphere_118k", 118_202),
];
