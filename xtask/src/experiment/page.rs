//! [`Page`]: text, tables, plots and images, before conversion to Markdown and HTML.

use super::plot::Plot;

/// Result page of an experiment.
#[derive(Debug)]
pub(crate) struct Page {
    pub(crate) title: String,
    pub(crate) parts: Vec<Part>,
}

impl Page {
    /// True if a cell of one of the tables shows NaN.
    pub(super) fn has_nan(&self) -> bool {
        self.parts.iter().any(|part| match part {
            Part::Table(table) => table.rows.iter().flatten().any(|cell| cell.contains("NaN")),
            Part::Text(_) | Part::Plot(_) | Part::Picture { .. } => false,
        })
    }
}

/// A piece of a page.
#[derive(Debug)]
pub(crate) enum Part {
    /// Markdown.
    Text(String),
    Table(Table),
    Plot(Plot),
    /// A drawing.
    Picture {
        caption: String,
        svg: String,
    },
}

/// Rows under a header.
#[derive(Debug)]
pub(crate) struct Table {
    pub(crate) caption: String,
    pub(crate) header: Vec<String>,
    pub(crate) rows: Vec<Vec<String>>,
}

impl Table {
    pub(crate) fn new<S: Into<String>>(
        caption: impl Into<String>,
        header: impl IntoIterator<Item = S>,
    ) -> Self {
        Self {
            caption: caption.into(),
            header: header.into_iter().map(Into::into).collect(),
            rows: Vec::new(),
        }
    }

    /// Adds a row.
    ///
    /// # Panics
    /// If its length differs from that of the header.
    pub(crate) fn push<S: Into<String>>(&mut self, row: impl IntoIterator<Item = S>) {
        let row: Vec<String> = row.into_iter().map(Into::into).collect();
        assert_eq!(row.len(), self.header.len(), "{row:?}");
        self.rows.push(row);
    }

    /// Renders the table as Markdown.
    pub(super) fn markdown(&self) -> String {
        let mut table = crate::table(self.header.clone());
        table.add_rows(self.rows.clone());
        if self.caption.is_empty() {
            table.to_string()
        } else {
            format!("**{}**\n\n{table}", self.caption)
        }
    }
}
