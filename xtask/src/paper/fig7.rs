//! Figure 7: the residual over 500 iterations by method and cluster size.

use serde::{Deserialize, Serialize};

use super::convergence::{PaperMethod, Point, Setup, Trial};
use crate::experiment::{
    Axis, Cell, Experiment, ExperimentArguments, Page, Part, Plot, Series, Style, Table,
};

const COUNTS: [u32; 13] = [1, 2, 4, 8, 15, 30, 60, 100, 150, 200, 300, 400, 500];
const QUICK_COUNTS: [u32; 5] = [1, 2, 4, 8, 15];

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Row {
    pub(super) setup: Setup,
    pub(super) solving: PaperMethod,
    pub(super) points: Vec<Point>,
}

pub(super) fn experiment(arguments: &ExperimentArguments) -> Experiment<Row> {
    let mut cells = Vec::new();
    for setup in Setup::ALL {
        for solving in PaperMethod::ALL {
            let arguments = arguments.clone();
            let id = format!("{}-{}", setup.id(), solving.id());
            cells.push(Cell::new(id, move || {
                let trial = Trial::new(setup, solving, &arguments)?;
                let counts: &[u32] = if arguments.quick {
                    &QUICK_COUNTS
                } else {
                    &COUNTS
                };
                let points = counts.iter().map(|&count| trial.point(count));
                Ok(Row {
                    setup,
                    solving,
                    points: points.collect::<anyhow::Result<_>>()?,
                })
            }));
        }
    }
    Experiment {
        name: "paper-fig7",
        cells,
        page,
    }
}

/// Plotted quantity of a point.
type Quantity = fn(&Point) -> f64;

fn page(rows: &[Row]) -> anyhow::Result<Page> {
    let mut parts = vec![Part::Text(
        "The step of Table 3 (see there), in all three setups, up to the paper's 500 iterations of the first frame; each point is a \
         run of its own. The paper does not say which norm it plots: first what XPBD iterates on, `‖C + α̃ λ‖`, then the force \
         out of balance as a part of that at the start. Points beyond 1e12 are left out of the plots and are in the table."
            .to_owned(),
    )];
    for setup in Setup::ALL {
        let of_this: Vec<&Row> = rows.iter().filter(|row| row.setup == setup).collect();
        let quantities: [(&str, Quantity); 2] = [
            ("dual residual", |p| p.dual),
            ("force, relative", |p| p.force),
        ];
        for (what, value) in quantities {
            let series = of_this.iter().map(|row| Series {
                name: row.solving.words(),
                points: row
                    .points
                    .iter()
                    .map(|p| (f64::from(p.iterations), value(p)))
                    .filter(|&(_, y)| y > 0.0 && y < 1e12)
                    .collect(),
                labels: Vec::new(),
                style: Style::Line,
            });
            parts.push(Part::Plot(Plot {
                title: format!("The body {}: {what}", setup.words()),
                x: Axis::linear("iterations"),
                y: Axis::log(what),
                series: series.filter(|series| !series.points.is_empty()).collect(),
            }));
        }
        let mut head = vec!["method".to_owned(), "norm".to_owned()];
        let counts = of_this.first().map_or(&[][..], |row| &row.points);
        head.extend(counts.iter().map(|p| p.iterations.to_string()));
        let mut table = Table::new(format!("The body {}", setup.words()), head);
        for row in &of_this {
            for (what, value) in quantities {
                let mut cells = vec![row.solving.words(), what.to_owned()];
                cells.extend(row.points.iter().map(|p| format!("{:.2e}", value(p))));
                table.push(cells);
            }
        }
        parts.push(Part::Table(table));
    }
    Ok(Page {
        title: "Figure 7: residual by iterations".to_owned(),
        parts,
    })
}
