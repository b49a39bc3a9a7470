//! Parts of HTML pages: self-contained documents for screens, phones and print, in well-formed XML.

use std::fmt::Write;

use super::{Size, escape};

/// Size of a figure across the page, readable at three quarters of its size on a phone.
pub(crate) const WHOLE: Size = Size { width_mm: 130.0, font_pt: 9.0 };
/// Size of one of two figures side by side.
pub(crate) const HALF: Size = Size { width_mm: 115.0, font_pt: 8.5 };

const STYLE: &str = include_str!("page.css");

/// A page with the given body.
pub(crate) fn document(title: &str, body: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"/><meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\
         <title>{}</title><style>\n{STYLE}</style></head><body>\n{body}</body></html>\n",
        escape(title)
    )
}

/// A figure element; `name`, unique on the page, prefixes the ids of its SVG.
pub(crate) fn figure(name: &str, class: &str, svg: &str, caption: &str) -> String {
    let svg = svg.replace(" id=\"", &format!(" id=\"{name}-")).replace("url(#", &format!("url(#{name}-"));
    let caption = if caption.is_empty() { String::new() } else { format!("<figcaption>{}</figcaption>", escape(caption)) };
    format!("<figure class=\"{class}\">{svg}{caption}</figure>\n")
}

/// A table. Numbers are right-aligned; on a narrow screen the table scrolls or stacks its cells.
pub(crate) struct Table {
    columns: Vec<(String, bool)>,
    stacks: bool,
    rows: String,
}

/// A cell.
#[derive(Debug, Clone, Default)]
pub(crate) struct Cell {
    text: String,
    is_bad: bool,
}

impl Cell {
    /// Marks the cell as bad.
    pub fn bad_if(mut self, is_bad: bool) -> Self {
        self.is_bad = is_bad;
        self
    }
}

impl<T: Into<String>> From<T> for Cell {
    fn from(text: T) -> Self {
        Self { text: text.into(), ..Self::default() }
    }
}

impl Table {
    /// A table with these columns; a `#` before a name marks a column of numbers.
    pub fn new(columns: &[&str]) -> Self {
        let columns =
            columns.iter().map(|name| name.strip_prefix('#').map_or(((*name).into(), false), |name| (name.into(), true)));
        Self { columns: columns.collect(), stacks: false, rows: String::new() }
    }

    /// Stacks the cells of a row on a narrow screen, for tables with text.
    pub fn stacking(mut self) -> Self {
        self.stacks = true;
        self
    }

    /// Adds a row, one cell for each column.
    pub fn row<const N: usize>(&mut self, cells: [Cell; N]) -> &mut Self {
        self.rows.push_str("<tr>");
        for (cell, (name, is_number)) in cells.iter().zip(&self.columns) {
            let class = match (is_number, cell.is_bad) {
                (true, true) => " class=\"n bad\"",
                (true, false) => " class=\"n\"",
                (false, true) => " class=\"bad\"",
                (false, false) => "",
            };
            let label = if self.stacks && !name.is_empty() { format!(" data-label=\"{}\"", escape(name)) } else { String::new() };
            let _ = write!(self.rows, "<td{class}{label}>{}</td>", escape(&cell.text));
        }
        self.rows.push_str("</tr>\n");
        self
    }

    /// The HTML of the table.
    pub fn html(&self) -> String {
        let head: String = self
            .columns
            .iter()
            .map(|(name, is_number)| format!("<th{}>{}</th>", if *is_number { " class=\"n\"" } else { "" }, escape(name)))
            .collect();
        let class = if self.stacks { " class=\"stack\"" } else { "" };
        format!("<div class=\"box\"><table{class}><thead><tr>{head}</tr></thead><tbody>\n{}</tbody></table></div>\n", self.rows)
    }
}
