//! Rules that decide the claims, in the order of the paper.
//!
//! Each rule uses the rows of one table or figure, and holds for all, some or none of its cases.

use super::super::convergence::{PaperMethod, Setup};
use super::super::{fig4, fig8, table1, table2};
use super::{Claim, Evidence, Verdict};

/// All claims, in the order of the paper.
pub(in crate::paper) fn claims(rows: &[Evidence]) -> Vec<Claim> {
    let mut all = colorings(rows);
    all.extend(clusterings(rows));
    all.extend(convergence(rows));
    all.extend(cutting(rows));
    all
}

fn colorings(rows: &[Evidence]) -> Vec<Claim> {
    let table2 = || {
        rows.iter().filter_map(|row| match row {
            Evidence::Table2(row) => Some(row),
            _ => None,
        })
    };
    let ratios = |other: &str| -> Vec<f64> {
        let ratio = |row: &table2::Row| Some(row.of("scgc")?.color_ms / row.of(other)?.color_ms);
        table2().filter_map(ratio).collect()
    };
    let faster = |claim, other| {
        let ratios = ratios(other);
        let holds: Vec<bool> = ratios.iter().map(|&ratio| ratio <= 0.9).collect();
        Claim {
            claim,
            rule: "at least 10 % less time to color, Table 2, all readings",
            verdict: Verdict::of(&holds),
            measured: format!("SCGC takes {} of its time", spread(&ratios)),
        }
    };
    let fewest = |row: &table2::Row| {
        let scgc = row.of("scgc").map(|c| c.colors);
        let others = ["vivace", "wlc", "ecl-gc", "mcs", "greedy"];
        others
            .iter()
            .all(|name| scgc <= row.of(name).map(|c| c.colors))
    };
    let fewest: Vec<bool> = table2().map(fewest).collect();
    let least =
        |pick: fn(&super::super::colorings::Colored) -> f64, who: &'static str| -> Vec<bool> {
            let holds = |row: &table2::Row| {
                let best = row.of(who).map(pick);
                let others = ["vivace", "wlc", "ecl-gc", "scgc"];
                others.iter().all(|name| best <= row.of(name).map(pick))
            };
            table2().map(holds).collect()
        };
    let equal = |row: &table2::Row| {
        let pick = |name| row.of(name).map(|c| (c.colors, c.range, c.std));
        pick("scgc") == pick("ecl-gc")
    };
    let equal: Vec<bool> = table2().map(equal).collect();
    let chi2 = least(|c| c.chi2, "scgc");
    let std = least(|c| c.std, "vivace");
    let slower: Vec<f64> = table2()
        .filter_map(|row| Some(row.of("vivace")?.solve_ms / row.of("scgc")?.solve_ms))
        .collect();
    let slow: Vec<bool> = slower.iter().map(|&ratio| ratio >= 2.0).collect();
    vec![
        faster(
            "SCGC colors 10 to 20 % faster than ECL-GC (4.1, 5.1); ECL-GC here looks at all waiting neighbors in each pass",
            "ecl-gc",
        ),
        faster(
            "the same, of the third shortcut alone: SCGC beside itself without it",
            "scgc:12",
        ),
        Claim {
            claim: "SCGC has the fewest colors (5.1)",
            rule: "no more than Vivace, WLC, ECL-GC, MCS and greedy, Table 2, all readings",
            verdict: Verdict::of(&fewest),
            measured: count(&fewest),
        },
        Claim {
            claim: "SCGC and ECL-GC find the same colors and distribution (Table 2)",
            rule: "equal colors, range and STD in Table 2",
            verdict: Verdict::of(&equal),
            measured: count(&equal),
        },
        Claim {
            claim: "SCGC's chi-squared is the lowest (5.1.2; its own table has Vivace's lower in three of four)",
            rule: "no more than Vivace, WLC and ECL-GC, Table 2, all readings",
            verdict: Verdict::of(&chi2),
            measured: count(&chi2),
        },
        Claim {
            claim: "Vivace's STD is the smallest (5.1.2)",
            rule: "no more than WLC, ECL-GC and SCGC, Table 2, all readings",
            verdict: Verdict::of(&std),
            measured: count(&std),
        },
        Claim {
            claim: "Vivace's colors make solving slow (Table 2: 7 to 21 times)",
            rule: "at least twice SCGC's time to solve, Table 2, all readings",
            verdict: Verdict::of(&slow),
            measured: format!("{} times", spread(&slower)),
        },
    ]
}

fn clusterings(rows: &[Evidence]) -> Vec<Claim> {
    let fig4: Vec<&fig4::Row> = rows
        .iter()
        .filter_map(|row| match row {
            Evidence::Fig4(row) => Some(row),
            _ => None,
        })
        .collect();
    let mut lower = Vec::new();
    for plain in fig4
        .iter()
        .filter(|row| row.clustering == fig4::CLUSTERINGS[0])
    {
        let same = |row: &&&fig4::Row| row.body == plain.body && row.clustering != plain.clustering;
        for clustered in fig4.iter().filter(same) {
            for colored in &plain.colored {
                let other = clustered.of(&colored.algorithm).map(|c| c.colors as f64);
                lower.extend(other.map(|colors| colors / colored.colors as f64));
            }
        }
    }
    let fewer: Vec<bool> = lower.iter().map(|&ratio| ratio < 1.0).collect();
    let table1: Vec<&table1::Row> = rows
        .iter()
        .filter_map(|row| match row {
            Evidence::Table1(row) => Some(row),
            _ => None,
        })
        .collect();
    let times: Vec<f64> = table1
        .iter()
        .filter_map(|row| Some(row.of("greedy-k")?.cluster_ms / row.of("serial")?.cluster_ms))
        .collect();
    let thousand: Vec<bool> = times.iter().map(|&ratio| ratio >= 500.0).collect();
    let colors: Vec<f64> = table1
        .iter()
        .filter_map(|row| Some(row.of("serial")?.colors as f64 / row.of("greedy-k")?.colors as f64))
        .collect();
    let alike: Vec<bool> = colors.iter().map(|&ratio| ratio <= 1.1).collect();
    let mut best = Vec::new();
    for method in ["serial", "serial-loose", "greedy-k"] {
        let fps = |row: &table1::Row| row.of(method).map_or(0.0, table1::Clustered::fps);
        let fastest = table1.iter().max_by(|a, b| fps(a).total_cmp(&fps(b)));
        best.extend(fastest.map(|row| (method, row.size)));
    }
    let small: Vec<bool> = best
        .iter()
        .map(|(_, size)| (5..=10).contains(size))
        .collect();
    let list: Vec<String> = best
        .iter()
        .map(|(method, size)| format!("{method} {size}"))
        .collect();
    vec![
        Claim {
            claim: "clustering lowers the number of colors (5.1)",
            rule: "fewer for each algorithm on each model of Figure 4",
            verdict: Verdict::of(&fewer),
            measured: format!("{} of the colors", spread(&lower)),
        },
        Claim {
            claim: "serial neighbor clustering is about a thousand times faster than Greedy K-Neighbor (5.1.1)",
            rule: "at least 500 times at each size of Table 1",
            verdict: Verdict::of(&thousand),
            measured: format!(
                "{} times; Greedy K here keeps scores in a heap",
                spread(&times)
            ),
        },
        Claim {
            claim: "and needs nearly as few colors (5.1.1)",
            rule: "at most 10 % more at each size of Table 1",
            verdict: Verdict::of(&alike),
            measured: format!("{} of its colors", spread(&colors)),
        },
        Claim {
            claim: "frames are fastest with clusters of 5 to 10 (5.1.1, Table 1)",
            rule: "the size with most frames a second in Table 1, for each clustering",
            verdict: Verdict::of(&small),
            measured: list.join(", "),
        },
    ]
}

fn convergence(rows: &[Evidence]) -> Vec<Claim> {
    let mut claims = Vec::new();
    let last = |setup: Setup, solving: PaperMethod| {
        let mut found = rows.iter().filter_map(|row| match row {
            Evidence::Fig7(row) if (row.setup, row.solving) == (setup, solving) => Some(row),
            _ => None,
        });
        found.next()?.points.last().copied()
    };
    let sizes = [5, 10, 15, 20, 25].map(PaperMethod::GaussSeidel);
    for (norm, dual) in [("dual", true), ("force", false)] {
        let value = |setup, solving| {
            let point = last(setup, solving)?;
            Some(if dual { point.dual } else { point.force })
        };
        let (mut helps, mut beats, mut best) = (Vec::new(), Vec::new(), Vec::new());
        let (mut gains, mut leads) = (Vec::new(), Vec::new());
        for setup in Setup::ALL {
            let Some(plain) = value(setup, PaperMethod::GaussSeidel(1)) else {
                continue;
            };
            let clustered = sizes
                .iter()
                .filter_map(|&size| Some((size, value(setup, size)?)));
            let clustered: Vec<(PaperMethod, f64)> = clustered.collect();
            helps.extend(clustered.iter().map(|&(_, residual)| residual < plain));
            gains.extend(clustered.iter().map(|&(_, residual)| residual / plain));
            for other in [PaperMethod::Jacobi, PaperMethod::Chebyshev] {
                for residual in clustered.iter().map(|&(_, r)| r).chain([plain]) {
                    let other = value(setup, other).unwrap_or(f64::MAX);
                    beats.push(residual < other);
                    leads.push(residual / other);
                }
            }
            let least = clustered.iter().min_by(|a, b| a.1.total_cmp(&b.1));
            best.extend(least.map(|&(solving, _)| (setup, solving.parts().1)));
        }
        let small: Vec<bool> = best
            .iter()
            .map(|(_, size)| (5..=10).contains(size))
            .collect();
        let list: Vec<String> = best
            .iter()
            .map(|(setup, size)| format!("{}: {size}", setup.words()))
            .collect();
        let (faster, least, beaten) = if dual {
            (
                "clustering speeds convergence (5.1.1, 5.2), by what XPBD iterates on",
                "convergence is best with clusters of 5 or 10 (5.1.1, 5.2), by what XPBD iterates on",
                "Gauss-Seidel beats Jacobi and Chebyshev (5.2), by what XPBD iterates on",
            )
        } else {
            (
                "the same, by the force out of balance",
                "the same, by the force out of balance",
                "the same, by the force out of balance",
            )
        };
        claims.push((0, Claim {
            claim: faster,
            rule: "a smaller residual at the end of Figure 7 at each size of clusters, all setups",
            verdict: Verdict::of(&helps),
            measured: format!("{norm} residual {} of that without clusters", spread(&gains)),
        }));
        claims.push((
            1,
            Claim {
                claim: least,
                rule: "the size of clusters with the smallest residual at the end of Figure 7",
                verdict: Verdict::of(&small),
                measured: list.join(", "),
            },
        ));
        claims.push((
            2,
            Claim {
                claim: beaten,
                rule: "a smaller residual at the end of Figure 7, all sizes of clusters and setups",
                verdict: Verdict::of(&beats),
                measured: format!("{norm} residual {} of theirs", spread(&leads)),
            },
        ));
    }
    claims.sort_by_key(|(place, _)| *place);
    claims.into_iter().map(|(_, claim)| claim).collect()
}

fn cutting(rows: &[Evidence]) -> Vec<Claim> {
    let fig8: Vec<&fig8::Row> = rows
        .iter()
        .filter_map(|row| match row {
            Evidence::Fig8(row) => Some(row),
            _ => None,
        })
        .collect();
    let growth = |algorithm: &str| -> Vec<f64> {
        let growth = |row: &&fig8::Row| {
            let (_, ms) = fig8::quarters(row, algorithm);
            ms[1] / ms[0]
        };
        fig8.iter().map(growth).collect()
    };
    let (scgc, vivace) = (growth("scgc"), growth("vivace"));
    let flat: Vec<bool> = scgc.iter().map(|&ratio| ratio <= 1.25).collect();
    let rises: Vec<bool> = vivace.iter().map(|&ratio| ratio > 1.5).collect();
    let fewer: Vec<f64> = fig8
        .iter()
        .map(|row| fig8::quarters(row, "scgc").0[0] / fig8::quarters(row, "vivace").0[0])
        .collect();
    let forty: Vec<bool> = fewer.iter().map(|&ratio| ratio <= 0.65).collect();
    let shares: Vec<f64> = rows
        .iter()
        .filter_map(|row| match row {
            Evidence::Fig11(row) => Some(&row.paper),
            _ => None,
        })
        .map(|[cut, _, _, color, _, solve]| (cut, color, solve))
        .zip(rows.iter().filter_map(|row| match row {
            Evidence::Fig11(row) => Some(row.paper.iter().sum::<f64>()),
            _ => None,
        }))
        .map(|((cut, color, solve), sum)| (cut + color + solve) / sum)
        .collect();
    let most: Vec<bool> = shares.iter().map(|&share| share > 0.5).collect();
    vec![
        Claim {
            claim: "SCGC's time of a frame stays flat while cutting (5.3)",
            rule: "the last quarter of Figure 8 at most 1.25 times the first, each run",
            verdict: Verdict::of(&flat),
            measured: format!("{} times", spread(&scgc)),
        },
        Claim {
            claim: "Vivace's rises significantly (5.3)",
            rule: "the last quarter of Figure 8 more than 1.5 times the first, each run",
            verdict: Verdict::of(&rises),
            measured: format!("{} times", spread(&vivace)),
        },
        Claim {
            claim: "SCGC has about 40 % fewer colors than Vivace while cutting begins (5.3)",
            rule: "at least 35 % fewer in the first quarter of Figure 8, each run",
            verdict: Verdict::of(&forty),
            measured: format!("{} of Vivace's colors", spread(&fewer)),
        },
        Claim {
            claim: "cutting, coloring and solving take most of a frame (5.1, Figure 11)",
            rule: "more than half of a frame as the paper makes it; the rest is clusters, building the graph, sorting",
            verdict: Verdict::of(&most),
            measured: spread(&shares),
        },
    ]
}

/// Formats the lowest and highest value.
fn spread(values: &[f64]) -> String {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let number = super::super::compared::number;
    if low == high {
        number(low)
    } else {
        format!("{} to {}", number(low), number(high))
    }
}

/// Formats the number of cases that hold.
fn count(holds: &[bool]) -> String {
    let count = holds.iter().filter(|&&holds| holds).count();
    format!("in {count} of {} cases", holds.len())
}
