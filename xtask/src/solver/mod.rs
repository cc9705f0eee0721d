//! `cargo xtask solver`: cost and accuracy of the solver's methods, as tables.

mod beam;
pub(crate) mod body;
mod convergence;
mod digits;
mod rest;
pub(crate) mod runner;
mod speed;

use std::path::PathBuf;

use clap::Args;

pub(crate) use digits::digits;

#[derive(Debug, Args)]
pub(crate) struct SolverArguments {
    /// Small bodies and few iterations: a minute instead of many. For tests; the figures mean nothing.
    #[arg(long)]
    quick: bool,
    /// Take the livers of this folder (`liver_11k.vtk`, `liver_89k.vtk`) instead of a generated one.
    #[arg(long, value_name = "DIR")]
    models: Option<PathBuf>,
    /// Only this table.
    #[arg(long, value_enum)]
    only: Option<Part>,
    /// Write the tables to this file as well.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// A table, or several that belong together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Part {
    /// Iterations and milliseconds to a residual, by method.
    Convergence,
    /// The error of a beam at rest by kappa. For errors in motion: `cargo xtask accuracy`.
    Rest,
    /// Nanoseconds a tet, on one thread and on two.
    Speed,
    /// Nanoseconds a tet on 1, 2, 4 threads and on to the number of cores.
    Threads,
}

#[expect(
    clippy::print_stdout,
    reason = "the tables are the result of the command"
)]
pub(crate) fn solver(arguments: &SolverArguments) -> anyhow::Result<()> {
    let text = tables(arguments)?;
    println!("{text}");
    if let Some(path) = &arguments.out {
        std::fs::write(path, text)?;
    }
    Ok(())
}

fn tables(arguments: &SolverArguments) -> anyhow::Result<String> {
    let mut parts = Vec::new();
    let wanted = |part| arguments.only.is_none_or(|only| only == part);
    if wanted(Part::Convergence) {
        let mesh = body::liver(arguments.models.as_deref(), arguments.quick)?;
        parts.push(convergence::convergence(&mesh, arguments.quick)?);
    }
    if wanted(Part::Rest) {
        parts.push(rest::at_rest(arguments.quick)?);
    }
    if wanted(Part::Speed) {
        let mesh = body::liver(arguments.models.as_deref(), arguments.quick)?;
        parts.push(speed::speed(
            &mesh,
            arguments.models.as_deref(),
            arguments.quick,
        )?);
    }
    if wanted(Part::Threads) {
        parts.push(speed::threads(
            arguments.models.as_deref(),
            arguments.quick,
        )?);
    }
    Ok(parts.join("\n"))
}

#[cfg(test)]
mod tests {
    use clap::ValueEnum;

    use super::*;

    fn quick(part: Part) -> String {
        let arguments = SolverArguments {
            quick: true,
            models: None,
            only: Some(part),
            out: None,
        };
        tables(&arguments).unwrap()
    }

    /// The cells of the first row whose first cell is `name`.
    fn row<'a>(text: &'a str, name: &str) -> Vec<&'a str> {
        let rows = text.lines().filter_map(|line| line.strip_prefix('|'));
        let mut rows = rows.map(|row| row.split('|').map(str::trim).collect::<Vec<_>>());
        rows.find(|row| row[0] == name).expect(name)
    }

    /// Every part that can be asked for makes tables whose rows are as long as their header, of finite numbers.
    #[test]
    fn every_part_makes_tables() {
        for &part in Part::value_variants() {
            let text = quick(part);
            let mut columns = None;
            let mut rows = 0;
            for line in text.lines() {
                let count = line.matches('|').count();
                if count == 0 {
                    columns = None;
                    continue;
                }
                assert_eq!(count, *columns.get_or_insert(count), "{line}");
                let cells = line.split('|').map(str::trim);
                let strange = cells.filter(|c| ["NaN", "inf"].iter().any(|s| c.contains(s)));
                assert_eq!(strange.count(), 0, "{line}");
                rows += 1;
            }
            assert!(rows > 5, "{part:?}: {text}");
        }
    }

    /// The first order of the error cancels, so half the kappa leaves less than half of it.
    #[test]
    fn the_error_at_rest_follows_kappa() {
        let text = quick(Part::Rest);
        let error = |name| row(&text, name)[3].parse::<f64>().unwrap();
        let halved = error("1/4") / error("1/2");
        assert!(halved.abs() < 0.6, "{halved}");
    }
}
