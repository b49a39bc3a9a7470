//! The layout of a figure: scales, margins, heights of panels, legend columns.

use super::super::axis::Scale;
use super::super::canvas::HATCH;
use super::super::panel::{LINE, Panel};
use super::super::series::{Series, Style};
use super::super::text::{shorten, width, wrap};
use super::Figure;

/// Margin of the page (pt).
pub(super) const EDGE: f64 = 3.0;
/// Length of a sample in a legend (pt).
pub(super) const SAMPLE: f64 = 22.0;
/// Largest enlargement of heights against lengths.
const MOST_ENLARGED: f64 = 10.0;

/// A series in a legend, its style and its text.
type Entry<'a> = (&'a Series, Style, String);

/// Positions and scales of a figure's parts (pt).
pub(super) struct Layout<'a> {
    pub(super) figure: &'a Figure,
    pub(super) size: f64,
    pub(super) width: f64,
    pub(super) columns: usize,
    /// Labels of the legend for all panels.
    pub(super) labels: Vec<String>,
    pub(super) styles: Vec<Vec<Style>>,
    pub(super) x: Scale,
    pub(super) y: Vec<Scale>,
    pub(super) left: f64,
    pub(super) room: f64,
    pub(super) heights: Vec<f64>,
    /// Enlargement of heights against lengths (–).
    pub(super) enlarged: f64,
}

impl<'a> Layout<'a> {
    /// Computes the layout of a figure.
    pub(super) fn of(figure: &'a Figure) -> Self {
        let (size, width) = (figure.size.font_pt, figure.size.width());
        let labels = figure.shared_labels();
        let styles = figure.panels.iter().map(|panel| panel.styles(&labels)).collect();
        let flat = figure.panels.iter().any(|p| p.cells.is_some() || !p.lanes.is_empty() || p.equal_aspect);
        let margin = if figure.panels.iter().any(|p| p.cells.is_some()) {
            0.0
        } else if flat {
            0.02
        } else {
            0.04
        };
        let mut x = Scale::over(figure.panels.iter().flat_map(Panel::x_values), margin);
        let shapes = figure.panels.iter().any(|p| p.equal_aspect);
        if !shapes && x.low < 0.0 && figure.panels.iter().flat_map(Panel::x_values).all(|x| x >= 0.0) {
            x.low = 0.0;
        }
        let own = |panel: &Panel| panel.y_scale(panel.y_values());
        let y = match figure.panels.first().filter(|_| figure.multiples) {
            Some(first) => vec![first.y_scale(figure.panels.iter().flat_map(Panel::y_values)); figure.panels.len()],
            None => figure
                .panels
                .iter()
                .map(|panel| {
                    let alike = |other: &&Panel| other.enlarged && other.y_label == panel.y_label;
                    match panel.enlarged {
                        true => panel.y_scale(figure.panels.iter().filter(alike).flat_map(Panel::y_values)),
                        false => own(panel),
                    }
                })
                .collect(),
        };
        let room = figure.panels.iter().map(|p| p.right_room(size, 0.45 * width)).fold(0.0, f64::max);
        let columns = figure.columns();
        let mut layout = Self {
            figure,
            size,
            width,
            columns,
            labels,
            styles,
            x,
            y,
            left: 3.0 * size,
            room,
            heights: Vec::new(),
            enlarged: 1.0,
        };
        // The left margin depends on the heights of the panels, and these on their widths.
        for _ in 0..3 {
            layout.measure();
        }
        layout
    }

    /// Right edge of the axes (pt).
    pub(super) fn right(&self) -> f64 {
        self.width - EDGE - self.room.max(1.6 * self.size)
    }

    /// Width of a panel's axes (pt).
    pub(super) fn panel_width(&self) -> f64 {
        let gaps = self.size * (self.columns - 1) as f64;
        ((self.right() - self.left - gaps) / self.columns as f64).max(20.0)
    }

    /// Updates the heights of the panels and the left margin.
    fn measure(&mut self) {
        let across = self.panel_width();
        let figure = self.figure;
        self.heights.clear();
        for (panel, y) in figure.panels.iter().zip(&mut self.y) {
            let mut height = panel.share * across;
            if panel.equal_aspect {
                // Before the axes are placed, a range is that of the data.
                let wanted = y.range() / self.x.range() * across;
                height = wanted.clamp(3.0 * self.size, 1.2 * across);
                if wanted < height && panel.enlarged {
                    let times = (height / wanted).ceil().min(MOST_ENLARGED);
                    height = wanted * times;
                    self.enlarged = times;
                } else if wanted < height {
                    y.widen(self.x.range() * height / across, panel.floor || panel.from_zero);
                } else if wanted > 1.001 * height {
                    self.x.widen(y.range() * across / height, false);
                }
            }
            if !panel.lanes.is_empty() {
                height = 0.0;
            }
            self.heights.push(height.max(panel.least_height(self.size)));
        }
        let texts = figure.panels.iter().zip(&self.y).zip(&self.heights);
        let widest = texts.flat_map(|((panel, y), height)| panel.y_ticks(y, *height, self.size));
        let widest = widest.map(|(_, text)| width(&text, self.size)).fold(0.0, f64::max).min(0.35 * self.width);
        let lines = self.y_labels().iter().map(|(_, _, lines)| lines.len()).max().unwrap_or(0);
        let left = EDGE + lines as f64 * LINE * self.size + 3.0 + widest + 3.0;
        self.left = left.max(self.left.min(left + 0.1)).max(1.6 * self.size);
    }

    /// Number of rows of panels.
    pub(super) fn rows(&self) -> usize {
        self.figure.panels.len().div_ceil(self.columns)
    }

    /// Height of a row's axes (pt).
    pub(super) fn row_height(&self, row: usize) -> f64 {
        self.heights.iter().skip(row * self.columns).take(self.columns).copied().fold(0.0, f64::max)
    }

    /// Height of panel titles and legends above the axes of a row (pt).
    pub(super) fn head(&self, row: usize) -> f64 {
        let panels = || row * self.columns..((row + 1) * self.columns).min(self.figure.panels.len());
        let title = panels().map(|i| self.panel_title(i).len()).max().unwrap_or(0);
        let legend = panels().map(|i| self.legend_rows(&self.own_legend(i)).1.len()).max().unwrap_or(0);
        (title + legend) as f64 * LINE * self.size
    }

    /// The lines of a panel's title.
    pub(super) fn panel_title(&self, index: usize) -> Vec<String> {
        wrap(&self.figure.panels[index].title, self.size, self.panel_width())
    }

    /// Gap between a row and the next (pt).
    pub(super) fn gap(&self, row: usize) -> f64 {
        let floor = self.figure.panels.get(row * self.columns).is_some_and(|p| p.floor);
        self.size + if floor { HATCH } else { 0.0 }
    }

    /// First row, number of rows and lines of each label of the y axis.
    pub(super) fn y_labels(&self) -> Vec<(usize, usize, Vec<String>)> {
        let label = |row: usize| self.figure.panels.get(row * self.columns).map_or("", |p| p.y_label.as_str());
        let mut groups: Vec<(usize, usize, Vec<String>)> = Vec::new();
        for row in 0..self.rows() {
            match groups.last_mut() {
                Some((first, count, _)) if label(*first) == label(row) => *count += 1,
                _ => groups.push((row, 1, Vec::new())),
            }
        }
        for (first, count, lines) in &mut groups {
            let rows = *first..*first + *count;
            let extent: f64 =
                rows.map(|row| self.row_height(row) + if row > *first { self.gap(row) + self.head(row) } else { 0.0 }).sum();
            *lines = wrap(label(*first), self.size, extent.max(5.0 * self.size));
        }
        groups
    }

    /// Series of a panel's own legend.
    pub(super) fn own_legend(&self, index: usize) -> Vec<(&'a Series, Style)> {
        let panel = &self.figure.panels[index];
        if !self.labels.is_empty() || panel.ends_are_labelled() {
            return Vec::new();
        }
        panel.series.iter().zip(&self.styles[index]).filter(|(s, _)| !s.label.is_empty()).map(|(s, t)| (s, t.clone())).collect()
    }

    /// Series of the legend for all panels.
    pub(super) fn shared_legend(&self) -> Vec<(&'a Series, Style)> {
        let find = |label: &String| {
            self.figure.panels.iter().zip(&self.styles).filter(|(p, _)| !p.ends_are_labelled()).find_map(|(panel, styles)| {
                panel.series.iter().zip(styles).find(|(s, _)| s.label == *label).map(|(s, t)| (s, t.clone()))
            })
        };
        self.labels.iter().filter_map(find).collect()
    }

    /// Width of a column (pt), and the entries of a legend by rows, with as many columns as fit.
    pub(super) fn legend_rows(&self, entries: &[(&'a Series, Style)]) -> (f64, Vec<Vec<Entry<'a>>>) {
        let most = self.width - 2.0 * EDGE;
        let texts: Vec<_> = entries.iter().map(|(s, _)| shorten(&s.label, self.size, most - SAMPLE - 4.0)).collect();
        let widest = texts.iter().map(|text| width(text, self.size)).fold(0.0, f64::max);
        let column = SAMPLE + 4.0 + widest + 1.2 * self.size;
        let columns = (((most + 1.2 * self.size) / column) as usize).clamp(1, entries.len().max(1));
        // Balances the rows.
        let columns = entries.len().div_ceil(entries.len().div_ceil(columns).max(1)).max(1);
        let entries: Vec<_> = entries.iter().zip(texts).map(|((series, style), text)| (*series, style.clone(), text)).collect();
        (column, entries.chunks(columns).map(<[_]>::to_vec).collect())
    }
}
