//! Figure 10: power density spectra of the residual after 1, 15 and 500 iterations.
//!
//! The paper does not define the sequence of its spectrum. Two readings of the unbalanced force at the particles are
//! computed: over space, `|Σ_p f_p exp(2πi k·x_p)|² / N` with the rest positions, mean over 64 directions of wave
//! vectors of each length, which separates coarse from fine errors; and over the particle indices, as an array passed
//! to a Fourier transform, which depends on the numbering of the mesh. Each is relative to the mean square force at the
//! start.

use std::f64::consts::{PI, TAU};

use incise::mesh::glam::DVec3;
use serde::{Deserialize, Serialize};

use super::convergence::{PaperMethod, Setup, Trial, norm};
use crate::experiment::{
    Axis, Cell, Experiment, ExperimentArguments, Page, Part, Plot, Series, Style, Table,
};

const COUNTS: [u32; 3] = [1, 15, 500];
const QUICK_COUNTS: [u32; 3] = [1, 4, 15];
/// Lengths of wave vectors, or bands of frequencies.
const BANDS: usize = 24;
/// Directions of wave vectors, or frequencies in a band.
const WAVES: usize = 64;
const SOLVING: [PaperMethod; 7] = [
    PaperMethod::GaussSeidel(1),
    PaperMethod::GaussSeidel(5),
    PaperMethod::GaussSeidel(10),
    PaperMethod::GaussSeidel(15),
    PaperMethod::GaussSeidel(20),
    PaperMethod::Jacobi,
    PaperMethod::Chebyshev,
];

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Row {
    setup: Setup,
    solving: PaperMethod,
    spectra: Vec<Spectra>,
}

/// Spectra after a number of iterations.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Spectra {
    iterations: u32,
    /// Waves per length of the body, and power.
    space: Vec<(f64, f64)>,
    /// Cycles per particle, and power.
    index: Vec<(f64, f64)>,
}

pub(super) fn experiment(arguments: &ExperimentArguments) -> Experiment<Row> {
    let mut cells = Vec::new();
    for setup in Setup::ALL {
        for solving in SOLVING {
            let arguments = arguments.clone();
            let id = format!("{}-{}", setup.id(), solving.id());
            cells.push(Cell::new(id, move || measure(setup, solving, &arguments)));
        }
    }
    Experiment {
        name: "paper-fig10",
        cells,
        page,
    }
}

fn measure(
    setup: Setup,
    solving: PaperMethod,
    arguments: &ExperimentArguments,
) -> anyhow::Result<Row> {
    let trial = Trial::new(setup, solving, arguments)?;
    let start =
        norm(&trial.forces(&trial.released()?)?).powi(2) / trial.mesh.positions.len() as f64;
    let counts = if arguments.quick {
        QUICK_COUNTS
    } else {
        COUNTS
    };
    let mut spectra = Vec::new();
    for iterations in counts {
        let (solver, _) = trial.step(iterations)?;
        let forces = trial.forces(&solver)?;
        // Diverged forces have no spectrum.
        if !norm(&forces).is_finite() || norm(&forces) > 1e100 {
            break;
        }
        let relative = |spectrum: Vec<(f64, f64)>| {
            spectrum
                .into_iter()
                .map(|(x, power)| (x, power / start))
                .collect()
        };
        spectra.push(Spectra {
            iterations,
            space: relative(over_space(&trial.mesh.positions, &forces)),
            index: relative(over_index(&forces)),
        });
    }
    Ok(Row {
        setup,
        solving,
        spectra,
    })
}

/// Mean power over directions, by waves on the longest side of the body: from 1 to half a wave on the mean distance
/// between particles.
fn over_space(positions: &[DVec3], forces: &[DVec3]) -> Vec<(f64, f64)> {
    let low = positions.iter().copied().fold(DVec3::MAX, DVec3::min);
    let high = positions.iter().copied().fold(DVec3::MIN, DVec3::max);
    let length = (high - low).max_element();
    let finest = 0.5 * (positions.len() as f64).cbrt().max(4.0);
    let bands = (0..BANDS).map(|band| finest.powf(band as f64 / (BANDS - 1) as f64));
    bands
        .map(|waves| {
            let sum: f64 = (0..WAVES)
                .map(|n| {
                    let wave = direction(n) * (TAU * waves / length);
                    power(forces, |p| wave.dot(positions[p]))
                })
                .sum();
            (waves, sum / WAVES as f64)
        })
        .collect()
}

/// Mean power in bands of frequencies that are equal ratios, by cycles a particle up to 1/2.
fn over_index(forces: &[DVec3]) -> Vec<(f64, f64)> {
    let lowest = 1.0 / forces.len() as f64;
    let at = |part: f64| lowest * (0.5 / lowest).powf(part);
    (0..BANDS)
        .map(|band| {
            let frequency = |n: usize| at((band as f64 + n as f64 / WAVES as f64) / BANDS as f64);
            let sum: f64 = (0..WAVES)
                .map(|n| power(forces, |p| TAU * frequency(n) * p as f64))
                .sum();
            (frequency(WAVES / 2), sum / WAVES as f64)
        })
        .collect()
}

/// `|Σ_p f_p exp(iφ_p)|² / N`, summed over the three components.
fn power(forces: &[DVec3], phase: impl Fn(usize) -> f64) -> f64 {
    let (mut real, mut imaginary) = (DVec3::ZERO, DVec3::ZERO);
    for (p, &force) in forces.iter().enumerate() {
        let (sine, cosine) = phase(p).sin_cos();
        real += force * cosine;
        imaginary += force * sine;
    }
    (real.length_squared() + imaginary.length_squared()) / forces.len() as f64
}

/// Directions spread over a half sphere along a spiral of golden angles; the others give the same power.
fn direction(n: usize) -> DVec3 {
    let z = (n as f64 + 0.5) / WAVES as f64;
    let angle = PI * (3.0 - 5.0_f64.sqrt()) * n as f64;
    let radius = (1.0 - z * z).sqrt();
    DVec3::new(radius * angle.cos(), radius * angle.sin(), z)
}

/// One of the spectra.
type Pick = fn(&Spectra) -> &Vec<(f64, f64)>;

fn page(rows: &[Row]) -> anyhow::Result<Page> {
    let mut parts = vec![Part::Text(
        "The step of Table 3 (see there), in all three setups. The paper does not say of which sequence its spectrum is, so there are \
         two: the force out of balance over space, `|Σ f exp(2πi k·x)|² / N` with the rest positions, the mean over 64 \
         directions, by waves on the length of the body; and over the numbers of the particles. Both as a part of the mean \
         square force at the start: 1 is where a step begins. Methods that diverged are left out where they did."
            .to_owned(),
    )];
    for setup in Setup::ALL {
        let of_this: Vec<&Row> = rows.iter().filter(|row| row.setup == setup).collect();
        let mut head = vec!["method".to_owned(), "after".to_owned()];
        head.extend(["two_level third", "middle", "fine third"].map(str::to_owned));
        let caption = format!("The body {}: mean power over space", setup.words());
        let mut table = Table::new(caption, head);
        for place in 0..COUNTS.len() {
            let known = of_this
                .iter()
                .filter_map(|row| Some((row, row.spectra.get(place)?)));
            let known: Vec<_> = known.collect();
            let Some((_, first)) = known.first() else {
                continue;
            };
            let iterations = first.iterations;
            let quantities: [(&str, &str, Pick); 2] = [
                ("space", "waves on the length of the body", |s| &s.space),
                ("numbers", "cycles a particle", |s| &s.index),
            ];
            for (what, label, pick) in quantities {
                let series = known.iter().map(|(row, spectra)| Series {
                    name: row.solving.words(),
                    points: pick(spectra)
                        .iter()
                        .copied()
                        .filter(|p| p.1 > 0.0)
                        .collect(),
                    labels: Vec::new(),
                    style: Style::Line,
                });
                parts.push(Part::Plot(Plot {
                    title: format!("{}: over {what}, {iterations} iterations", setup.words()),
                    x: Axis::log(label),
                    y: Axis::log("power"),
                    series: series.collect(),
                }));
            }
            for (row, spectra) in &known {
                let mut cells = vec![row.solving.words(), iterations.to_string()];
                let thirds = spectra.space.chunks(BANDS / 3);
                cells.extend(thirds.map(|third| {
                    let mean = super::compared::mean(third.iter().map(|p| p.1));
                    format!("{mean:.2e}")
                }));
                table.push(cells);
            }
        }
        parts.push(Part::Table(table));
    }
    Ok(Page {
        title: "Figure 10: spectra of the residual".to_owned(),
        parts,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wave of known length over particles on a line has its power at that length.
    #[test]
    fn a_wave_is_found_at_its_length() {
        let line: Vec<DVec3> = (0..4096)
            .map(|i| DVec3::new(f64::from(i) / 4096.0, 0.0, 0.0))
            .collect();
        let wave = |waves: f64| {
            line.iter()
                .map(|x| DVec3::Y * (TAU * waves * x.x).cos())
                .collect::<Vec<_>>()
        };
        for waves in [16.0, 128.0, 900.0] {
            let spectrum = over_index(&wave(waves));
            let peak = spectrum.iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
            // A band is 2048^(1/24), or 1.37 times, wide.
            let ratio = peak.0 * 4096.0 / waves;
            assert!(ratio > 0.7 && ratio < 1.4, "{waves}: {ratio}");
        }
        // At the phase of the wave itself half of the particles' power comes together: (N/2)² / N.
        let power = power(&wave(16.0), |p| TAU * 16.0 * line[p].x);
        assert!((power - 1024.0).abs() < 1e-6, "{power}");
    }
}
