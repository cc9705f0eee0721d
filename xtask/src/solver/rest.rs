//! Error at rest by kappa: settled position of a beam under gravity by XPBD, compared with the equilibrium.
//!
//! With one iteration per substep XPBD has an error even at rest, proportional to kappa and, because kappa depends on
//! Young's modulus only, nearly proportional to `l/μ = 1 / (1 - 2 ν)`. The beam starts at the equilibrium found by
//! Newton's method, and velocities are damped at about the critical rate until it stops; damping has no effect at rest.
//! With a few more iterations the error hardly depends on Poisson's ratio until close to 1/2: the second table.

use comfy_table::Table;
use incise::mesh::glam::DVec3;
use incise::xpbd::StepSettings;
use rayon::prelude::*;

use super::beam::{Beam, FRAME, GRAVITY, RATE};
use super::body::schedule;
use super::digits;
use crate::table;

const RATIOS: [f64; 6] = [0.0, 0.3, 0.4, 0.45, 0.49, 0.499];
/// Multiples of `1 / RATE` after which a beam that still moves is a failure.
const PATIENCE: usize = 100;

pub(crate) fn at_rest(quick: bool) -> anyhow::Result<String> {
    let mut text = String::from(
        "## Accuracy at rest\n\nError of the tip of the same beam at rest in % of its sag, block form, double precision.\n",
    );
    for iterations in [1, 4] {
        let table = errors_at_rest(iterations, quick)?;
        text += &format!("\nIterations of a substep: {iterations}.\n\n{table}\n");
    }
    Ok(text)
}

fn errors_at_rest(iterations: u32, quick: bool) -> anyhow::Result<Table> {
    let kappas: Vec<f64> = (1..=if quick { 2 } else { 9 })
        .map(|k| 0.5f64.powi(k))
        .collect();
    let ratios = &RATIOS[..if quick { 2 } else { RATIOS.len() }];
    let errors: Vec<Vec<Option<f64>>> = ratios
        .par_iter()
        .map(|&nu| column(&Beam::new(nu, quick), &kappas, iterations))
        .collect::<anyhow::Result<_>>()?;
    let head = ["kappa", "substeps of a frame of 1/60 s"].map(str::to_owned);
    let columns = ratios.iter().map(|&nu| header(nu));
    let mut table = table(head.into_iter().chain(columns));
    let beam = Beam::new(0.3, quick).solver::<f64>()?;
    for (k, &kappa) in kappas.iter().enumerate() {
        let substeps = (FRAME * (beam.kappa(1.0) / kappa).sqrt()).ceil();
        let cells = errors
            .iter()
            .map(|column| column[k].map_or("does not settle".to_owned(), digits));
        let head = [format!("1/{}", 1.0 / kappa), substeps.to_string()];
        table.add_row(head.into_iter().chain(cells));
    }
    proportion(&mut table, &kappas, ratios, &errors);
    Ok(table)
}

fn header(nu: f64) -> String {
    format!("ν = {nu}, l/μ = {}", digits(1.0 / (1.0 - 2.0 * nu)))
}

/// Last row: the error of the smallest kappa relative to `kappa l/μ`.
fn proportion(table: &mut Table, kappas: &[f64], ratios: &[f64], errors: &[Vec<Option<f64>>]) {
    let smallest = kappas.last().copied().unwrap_or(1.0);
    let cells = ratios.iter().zip(errors).map(|(nu, column)| {
        let error = column.last().copied().flatten();
        error.map_or(String::new(), |e| digits(e * (1.0 - 2.0 * nu) / smallest))
    });
    let name = ["the last over kappa l/μ".to_owned(), String::new()];
    table.add_row(name.into_iter().chain(cells));
}

/// Errors in % for each kappa; `None` where the beam does not settle.
fn column(beam: &Beam, kappas: &[f64], iterations: u32) -> anyhow::Result<Vec<Option<f64>>> {
    let mut body = beam.reference()?;
    body.settle(GRAVITY)?;
    let exact = body.positions[beam.tip];
    let sag = exact.distance(beam.mesh.positions[beam.tip]);
    let settled = kappas
        .par_iter()
        .map(|&kappa| settle(beam, kappa, iterations, &body.positions, 1e-6 * sag));
    settled
        .map(|tip| Ok(tip?.map(|tip| 100.0 * tip.distance(exact) / sag)))
        .collect()
}

/// Rest position of the tip, to `tolerance` per time of `1 / RATE`.
fn settle(
    beam: &Beam,
    kappa: f64,
    iterations: u32,
    start: &[DVec3],
    tolerance: f64,
) -> anyhow::Result<Option<DVec3>> {
    let mut solver = beam.solver::<f64>()?;
    for (p, &x) in start.iter().enumerate() {
        solver.set_position(p, x);
    }
    let schedule = schedule(&beam.mesh, "none")?;
    let time_step = (kappa / solver.kappa(1.0)).sqrt();
    let settings = StepSettings {
        iterations,
        gravity: Some(GRAVITY),
        ..StepSettings::new(time_step)
    };
    let keep = 1.0 / (1.0 + 2.0 * RATE * time_step);
    let mut last = solver.position(beam.tip);
    for _ in 0..PATIENCE {
        let mut time = 0.0;
        while time < 1.0 / RATE {
            time += time_step;
            for p in 0..solver.particle_count() {
                solver.set_velocity(p, solver.velocity(p) * keep);
            }
            solver.step(&schedule, &settings)?;
        }
        let now = solver.position(beam.tip);
        if now.distance(last) < tolerance && solver.max_speed() < RATE * tolerance * 10.0 {
            return Ok(Some(now));
        }
        last = now;
    }
    Ok(None)
}
