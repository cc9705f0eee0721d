//! The matrix as a drawing: a box for each cell, green, yellow or red, with its words.

use std::fmt::Write;

use super::outcome::{Color, Row};

/// Width of a box, height of a line and width of the names in pixels.
const BOX: usize = 104;
const LINE: usize = 18;
const NAMES: usize = 250;

pub(super) fn draw(rows: &[Row]) -> String {
    let columns = Row::columns(rows);
    let place = |column| columns.iter().position(|&other| other == column);
    let (width, height) = (NAMES + BOX * columns.len() + 4, LINE * (rows.len() + 2) + 4);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         height=\"{height}\" font-family=\"sans-serif\" font-size=\"11\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    let mut line = |x: usize, y: usize, weight: &str, text: &str| {
        let (y, text) = (LINE * y + 13, escaped(text));
        // Writing to a string does not fail.
        let _ = writeln!(
            svg,
            "<text x=\"{x}\" y=\"{y}\" font-weight=\"{weight}\">{text}</text>"
        );
    };
    for (c, column) in columns.iter().enumerate() {
        let x = NAMES + BOX * c + 4;
        line(x, 0, "bold", column.method.name());
        line(x, 1, "normal", column.place());
    }
    for (r, row) in rows.iter().enumerate() {
        line(4, r + 2, "normal", &row.name);
    }
    for (r, row) in rows.iter().enumerate() {
        for outcome in &row.outcomes {
            let Some(c) = place(outcome.column) else {
                continue;
            };
            let fill = match outcome.verdict(row.is_state).color() {
                Color::Green => "#b7e1b0",
                Color::Yellow => "#f6e58d",
                Color::Red => "#f0a099",
            };
            let (x, y) = (NAMES + BOX * c, LINE * (r + 2));
            let _ = writeln!(
                svg,
                "<rect x=\"{x}\" y=\"{y}\" width=\"{}\" height=\"{}\" fill=\"{fill}\"/>\
                 <text x=\"{}\" y=\"{}\">{}</text>",
                BOX - 1,
                LINE - 1,
                x + 4,
                y + 13,
                escaped(&outcome.words(row.is_state))
            );
        }
    }
    svg + "</svg>\n"
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}
