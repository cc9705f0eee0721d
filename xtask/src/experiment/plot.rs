//! [`Plot`]: curves and points over two axes, drawn as SVG by the crate `plotters`.

use anyhow::anyhow;
use plotters::coord::Shift;
use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::prelude::*;

/// Curves over two axes.
#[derive(Debug)]
pub(crate) struct Plot {
    pub(crate) title: String,
    pub(crate) x: Axis,
    pub(crate) y: Axis,
    pub(crate) series: Vec<Series>,
}

#[derive(Debug)]
pub(crate) struct Axis {
    pub(crate) label: String,
    /// Logarithmic axes. Values that are not positive are then omitted.
    pub(crate) log: bool,
}

impl Axis {
    pub(crate) fn linear(label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            log: false,
        }
    }

    pub(crate) fn log(label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            log: true,
        }
    }
}

#[derive(Debug)]
pub(crate) struct Series {
    pub(crate) name: String,
    pub(crate) points: Vec<(f64, f64)>,
    /// Labels of the points; may be empty.
    pub(crate) labels: Vec<String>,
    pub(crate) style: Style,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Style {
    Line,
    Points,
    Both,
}

const SIZE: (u32, u32) = (960, 480);
/// Width of the legend at the right in pixels.
const KEY: u32 = 210;
/// Eight colors that are distinguishable with color vision deficiency (Okabe and Ito 2008), then some more.
const COLORS: [RGBColor; 12] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(150, 140, 20),
    RGBColor(0, 0, 0),
    RGBColor(140, 86, 75),
    RGBColor(90, 90, 200),
    RGBColor(120, 190, 60),
    RGBColor(150, 150, 150),
];

impl Plot {
    /// Draws the plot as SVG.
    pub(super) fn svg(&self) -> anyhow::Result<String> {
        let mut svg = String::new();
        {
            let root = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
            root.fill(&WHITE).map_err(|e| anyhow!("{e}"))?;
            let x = self.range(0);
            let y = self.range(1);
            let drawn = match (self.x.log, self.y.log) {
                (false, false) => self.draw(&root, x.0..x.1, y.0..y.1),
                (true, false) => self.draw(&root, (x.0..x.1).log_scale(), y.0..y.1),
                (false, true) => self.draw(&root, x.0..x.1, (y.0..y.1).log_scale()),
                (true, true) => self.draw(&root, (x.0..x.1).log_scale(), (y.0..y.1).log_scale()),
            };
            drawn.map_err(|e| anyhow!("the plot {:?}: {e}", self.title))?;
            root.present().map_err(|e| anyhow!("{e}"))?;
        }
        Ok(svg)
    }

    fn axis(&self, which: usize) -> &Axis {
        [&self.x, &self.y][which]
    }

    /// True if a point can be drawn.
    fn shows(&self, point: (f64, f64)) -> bool {
        [point.0, point.1]
            .iter()
            .enumerate()
            .all(|(which, &v)| v.is_finite() && (!self.axis(which).log || v > 0.0))
    }

    /// Range of the points along an axis, with a margin.
    fn range(&self, which: usize) -> (f64, f64) {
        let points = self.series.iter().flat_map(|series| &series.points);
        let values = points
            .filter(|&&point| self.shows(point))
            .map(|&(x, y)| [x, y][which]);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(v), high.max(v))
        });
        if self.axis(which).log {
            if low > high {
                return (0.1, 10.0);
            }
            return (low / 1.3, high * 1.3);
        }
        if low > high {
            return (0.0, 1.0);
        }
        // Starts at zero if zero is near.
        let low = if low > 0.0 && low < 0.5 * high {
            0.0
        } else {
            low
        };
        let more = 0.05 * (high - low).max(1e-3 * high.abs()).max(1e-12);
        (if low == 0.0 { 0.0 } else { low - more }, high + more)
    }

    /// Draws the names of the curves next to the plot.
    fn key(
        &self,
        root: &DrawingArea<SVGBackend<'_>, Shift>,
    ) -> Result<(), DrawingAreaErrorKind<std::io::Error>> {
        let left = i32::try_from(SIZE.0 - KEY).unwrap_or(0) + 8;
        let named = self.series.iter().zip(COLORS.iter().cycle());
        for ((series, &color), y) in named.zip((48..).step_by(18)) {
            let corners = [(left, y - 2), (left + 16, y + 2)];
            root.draw(&Rectangle::new(corners, color.filled()))?;
            let font = ("sans-serif", FONT + 1).into_font();
            root.draw(&Text::new(series.name.clone(), (left + 22, y - 6), font))?;
        }
        Ok(())
    }

    fn draw<X, Y>(
        &self,
        root: &DrawingArea<SVGBackend<'_>, Shift>,
        x: X,
        y: Y,
    ) -> Result<(), Box<dyn std::error::Error>>
    where
        X: AsRangedCoord<Value = f64>,
        Y: AsRangedCoord<Value = f64>,
        X::CoordDescType: ValueFormatter<f64>,
        Y::CoordDescType: ValueFormatter<f64>,
    {
        let failed = |e: DrawingAreaErrorKind<_>| e.to_string();
        let mut chart = ChartBuilder::on(root)
            .caption(&self.title, ("sans-serif", 18))
            .margin(12)
            .margin_right(KEY)
            .x_label_area_size(44)
            .y_label_area_size(72)
            .build_cartesian_2d(x, y)
            .map_err(failed)?;
        chart
            .configure_mesh()
            .light_line_style(BLACK.mix(0.06))
            .bold_line_style(BLACK.mix(0.15))
            .x_desc(&self.x.label)
            .y_desc(&self.y.label)
            .x_label_formatter(&|v| number(*v))
            .y_label_formatter(&|v| number(*v))
            .draw()
            .map_err(failed)?;
        let mut words = Words::default();
        for (series, &color) in self.series.iter().zip(COLORS.iter().cycle()) {
            let points = || series.points.iter().copied().filter(|&p| self.shows(p));
            if series.style != Style::Points {
                chart
                    .draw_series(LineSeries::new(points(), color.stroke_width(2)))
                    .map_err(failed)?;
            }
            if series.style != Style::Line {
                let dots = points().map(|p| Circle::new(p, 3, color.filled()));
                chart.draw_series(dots).map_err(failed)?;
            }
            let labelled = series.points.iter().zip(&series.labels);
            for (&point, label) in labelled.filter(|(p, _)| self.shows(**p)) {
                let at = chart.backend_coord(&point);
                if let Some(free) = words.position(at, label) {
                    let font = ("sans-serif", FONT).into_font();
                    root.draw(&Text::new(label.clone(), free, font))
                        .map_err(failed)?;
                }
            }
        }
        self.key(root).map_err(failed)?;
        Ok(())
    }
}

/// Height of text in pixels.
const FONT: i32 = 11;

/// Occupied label positions, to avoid overlaps.
#[derive(Default)]
struct Words(Vec<[i32; 4]>);

impl Words {
    /// Free position for a label at a point, above it or below; `None` if both are occupied.
    fn position(&mut self, (x, y): (i32, i32), label: &str) -> Option<(i32, i32)> {
        let width = i32::try_from(label.chars().count()).unwrap_or(i32::MAX / 8) * 6;
        let positions = [(x + 5, y - 13), (x + 5, y + 4)];
        let free = positions.into_iter().find(|&(x, y)| {
            let clear = |&[left, right, top, bottom]: &[i32; 4]| {
                x >= right || x + width <= left || y >= bottom || y + FONT <= top
            };
            self.0.iter().all(clear)
        });
        if let Some((x, y)) = free {
            self.0.push([x, x + width, y, y + FONT]);
        }
        free
    }
}

/// Formats a number at an axis.
fn number(v: f64) -> String {
    if v != 0.0 && !(1e-3..1e5).contains(&v.abs()) {
        format!("{v:.0e}")
    } else if v.abs() >= 10.0 || v == v.round() {
        format!("{v:.0}")
    } else {
        let digits = if v.abs() < 0.1 { 3 } else { 2 };
        format!("{v:.digits$}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_stand_above_below_or_not_at_all() {
        let mut words = Words::default();
        assert_eq!(words.position((100, 100), "four"), Some((105, 87)));
        assert_eq!(words.position((110, 100), "four"), Some((115, 104)));
        assert_eq!(words.position((112, 100), "four"), None);
        assert_eq!(words.position((140, 100), "four"), Some((145, 87)));
    }

    #[test]
    fn numbers_at_axes_are_short() {
        let words = [0.0, 0.05, 0.5, 2.0, 12.3, 1e-7, 2e6].map(number);
        assert_eq!(words, ["0", "0.050", "0.50", "2", "12", "1e-7", "2e6"]);
    }
}
