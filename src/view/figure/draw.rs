//! Drawing a figure by its layout.

use super::super::canvas::{Anchor, Area, Canvas, HATCH};
use super::super::panel::LINE;
use super::super::series::{Series, Style};
use super::super::text::{shorten, width, wrap};
use super::layout::{EDGE, Layout, SAMPLE};

impl<'a> Layout<'a> {
    fn draw_legend(&self, canvas: &mut Canvas, entries: &[(&'a Series, Style)], mut top: f64) -> f64 {
        let (column, rows) = self.legend_rows(entries);
        let Some(first) = rows.first() else { return top };
        // Centred over the axes, within the page.
        let across = first.len() as f64 * column - 1.2 * self.size;
        let middle = (self.left + self.right()) / 2.0;
        let begin = (middle - across / 2.0).min(self.width - EDGE - across).max(EDGE);
        canvas.out.push_str("<g class=\"legend\">\n");
        for row in rows {
            for (i, (series, style, text)) in row.into_iter().enumerate() {
                let (x, y) = (begin + i as f64 * column, top + 0.5 * LINE * self.size);
                series.sample(&mut canvas.out, &style, x, y, SAMPLE);
                canvas.text(x + SAMPLE + 4.0, y, self.size, Anchor::Start, &text);
            }
            top += LINE * self.size;
        }
        canvas.out.push_str("</g>\n");
        top + 0.3 * self.size
    }

    /// The SVG document.
    pub(super) fn draw(mut self) -> String {
        let (size, figure) = (self.size, self.figure);
        let mut canvas = Canvas::default();
        let mut top = EDGE;
        let most = self.width - 2.0 * EDGE;
        let enlarged = format!("heights drawn {} times larger than lengths", self.enlarged);
        let below = [figure.setting.as_str(), if self.enlarged > 1.0 { &enlarged } else { "" }];
        let below = below.into_iter().filter(|text| !text.is_empty()).collect::<Vec<_>>().join("; ");
        for (text, size) in [(&figure.title, 1.15 * size), (&below, size)] {
            for line in wrap(text, size, most) {
                canvas.text(self.width / 2.0, top + 0.5 * LINE * size, size, Anchor::Middle, &line);
                top += LINE * size;
            }
        }
        top += 0.4 * size;
        top = self.draw_legend(&mut canvas, &self.shared_legend(), top);
        if let Some(key) = &figure.key {
            top = key.draw(&mut canvas, self.left, self.right(), top, size) + 0.3 * size;
        }
        let mut bottom = top;
        let mut extents = Vec::new();
        for row in 0..self.rows() {
            if row > 0 {
                top += self.gap(row - 1);
            }
            top += self.head(row);
            extents.push(top);
            for column in 0..self.columns {
                let index = row * self.columns + column;
                if index < figure.panels.len() {
                    bottom = bottom.max(self.draw_panel(&mut canvas, index, top));
                }
            }
            top += self.row_height(row);
        }
        for (first, count, lines) in self.y_labels() {
            let end = first + count - 1;
            let middle = (extents[first] + extents[end] + self.row_height(end)) / 2.0;
            for (i, line) in lines.iter().enumerate() {
                canvas.upright(EDGE + (i as f64 + 0.5) * LINE * size, middle, size, line);
            }
        }
        let label = wrap(&figure.x_label, size, most);
        for line in label {
            let middle = (self.left + self.right()) / 2.0;
            let half = width(&line, size) / 2.0;
            let middle = middle.min(self.width - EDGE - half).max(EDGE + half);
            canvas.text(middle, bottom + 0.5 * LINE * size, size, Anchor::Middle, &line);
            bottom += LINE * size;
        }
        canvas.document(figure.size, bottom + EDGE, &figure.title)
    }

    /// Draws one panel with its title and numbers; returns its lower edge (pt).
    fn draw_panel(&mut self, canvas: &mut Canvas, index: usize, top: f64) -> f64 {
        let (size, panel) = (self.size, &self.figure.panels[index]);
        let (row, column) = (index / self.columns, index % self.columns);
        let across = self.panel_width();
        let left = self.left + column as f64 * (across + size);
        let area = Area { left, top, right: left + across, bottom: top + self.heights[index] };
        self.draw_legend(canvas, &self.own_legend(index), top - self.head(row));
        let lines = self.panel_title(index);
        for (i, line) in lines.iter().enumerate() {
            let middle = top - ((lines.len() - i) as f64 - 0.5) * LINE * size;
            canvas.text((area.left + area.right) / 2.0, middle, size, Anchor::Middle, line);
        }
        let (mut x, mut y) = (self.x, self.y[index]);
        x.place(area.left, area.right);
        let lanes = panel.lanes.len() as f64;
        if lanes > 0.0 {
            (y.low, y.high) = (0.0, lanes);
        }
        y.place(area.bottom, area.top);
        canvas.out.push_str("<g class=\"panel\">\n");
        panel.draw(canvas, &x, &y, area, &self.styles[index], size, self.room, &self.figure.x_texts);
        if column == 0 || !self.figure.multiples {
            for (at, text) in panel.y_ticks(&y, area.height(), size) {
                let text = shorten(&text, size, 0.35 * self.width);
                canvas.text(area.left - 3.0, y.at(at), size, Anchor::End, &text);
            }
        }
        let mut bottom = area.bottom + if panel.floor { HATCH + 1.0 } else { 0.0 };
        // The lowest panel of each column has the numbers of the x axis.
        if index + self.columns >= self.figure.panels.len() {
            for (at, text) in panel.x_ticks(&x, across, size, &self.figure.x_texts) {
                canvas.text(x.at(at), bottom + 1.1 * size, size, Anchor::Middle, &text);
            }
            bottom += 1.8 * size;
        }
        canvas.out.push_str("</g>\n");
        bottom
    }
}
