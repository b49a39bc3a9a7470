//! Figures for print: panels with lines and points on shared axes, as SVG.
//!
//! Nothing stands on the data: the legend is above the axes, labels at the ends of lines are beside them. A legend tells at most five
//! series apart, by dash and marker as well as by colour; a panel with more has labels at the ends of its series.

use super::axis::Scale;
use super::canvas::{Anchor, Area, Canvas, HATCH, Size};
use super::heatmap::{Categories, Cells, Key};
use super::panel::{LINE, Lane, Panel};
use super::series::{Look, Mark, STYLES, Series, Style};
use super::text::{shorten, width, wrap};

/// Room at the edges of the page (pt).
const EDGE: f64 = 3.0;
/// Length of a sample in a legend (pt).
const SAMPLE: f64 = 22.0;
/// Height of a panel as a share of its width, where nothing else decides.
const SHARE: f64 = 0.62;
/// Shapes are drawn this much higher than true at most.
const MOST_ENLARGED: f64 = 10.0;

/// A figure that is being made.
///
/// A figure begins with one panel; [`panel`](Self::panel) puts another below it, on the same x axis, and
/// [`small_multiple`](Self::small_multiple) begins one of a grid of panels that share both axes. What is added goes to the latest panel.
///
/// # Examples
/// ```
/// use sfers::view::{Figure, Mark, Size};
/// let mut figure = Figure::new("A parabola", "time (s)", "height (mm)");
/// figure.series("y = t²", (0..10).map(|t| (f64::from(t), f64::from(t * t))), Mark::Both);
/// figure.setting("thrown upwards at 3 m/s").from_zero().size(Size::SINGLE);
/// assert!(figure.svg().starts_with("<svg"));
/// ```
#[derive(Debug, Clone)]
pub struct Figure {
    title: String,
    setting: String,
    x_label: String,
    x_texts: Vec<String>,
    size: Size,
    panels: Vec<Panel>,
    key: Option<Key>,
    multiples: bool,
}

impl Figure {
    /// An empty figure of the size [`Size::SCREEN`]; labels carry their units.
    pub fn new(title: &str, x_label: &str, y_label: &str) -> Self {
        Self {
            title: title.into(),
            setting: String::new(),
            x_label: x_label.into(),
            x_texts: Vec::new(),
            size: Size::SCREEN,
            panels: vec![Panel::new(y_label, SHARE)],
            key: None,
            multiples: false,
        }
    }

    /// Replaces the title.
    pub fn title(&mut self, title: &str) -> &mut Self {
        self.title = title.into();
        self
    }

    /// A line below the title: what was simulated or measured, and under which settings.
    pub fn setting(&mut self, setting: &str) -> &mut Self {
        self.setting = setting.into();
        self
    }

    /// Physical size of the figure and its letters.
    pub fn size(&mut self, size: Size) -> &mut Self {
        self.size = size;
        self
    }

    /// Begins another panel below, on the same x axis. Neighbours with equal labels share one.
    pub fn panel(&mut self, y_label: &str) -> &mut Self {
        self.panels.push(Panel::new(y_label, 0.5 * SHARE));
        self
    }

    /// Begins a panel of a grid, with a title of its own; all panels of the grid share both axes and the legend. The first call names
    /// the panel that the figure begins with.
    pub fn small_multiple(&mut self, title: &str) -> &mut Self {
        if self.multiples {
            let label = self.last().y_label.clone();
            self.panels.push(Panel::new(&label, 0.8));
        }
        self.multiples = true;
        let panel = self.last();
        panel.title = title.into();
        panel.share = 0.8;
        self
    }

    /// A title of the panel alone, over its upper left corner.
    pub fn panel_title(&mut self, title: &str) -> &mut Self {
        self.last().title = title.into();
        self
    }

    /// Height of the panel as a share of its width (ignored where both axes have the same scale).
    pub fn share(&mut self, share: f64) -> &mut Self {
        self.last().share = share;
        self
    }

    /// Adds a series in the next of five styles; points that are not finite break a line. An empty label stays out of the legend.
    /// Series of the same label in several panels have the same style.
    pub fn series(&mut self, label: &str, points: impl IntoIterator<Item = (f64, f64)>, mark: Mark) -> &mut Self {
        self.add(label, points, mark, Look::Styled)
    }

    /// Adds a solid line of a colour and width (pt) of its own.
    pub fn line(&mut self, label: &str, points: impl IntoIterator<Item = (f64, f64)>, colour: &str, width: f64) -> &mut Self {
        self.add(label, points, Mark::Line, Look::Plain { colour: colour.into(), width })
    }

    /// Adds a robot's shape as a thick line that stands on its points: z of a recording is the height of the robot's lower face.
    pub fn robot(&mut self, label: &str, points: impl IntoIterator<Item = (f64, f64)>, colour: &str) -> &mut Self {
        self.add(label, points, Mark::Line, Look::Robot { colour: colour.into() })
    }

    fn add(&mut self, label: &str, points: impl IntoIterator<Item = (f64, f64)>, mark: Mark, look: Look) -> &mut Self {
        let points = points.into_iter().collect();
        self.last().series.push(Series { label: label.into(), points, mark, look });
        self
    }

    /// Adds a strip for one signal; the strips of a panel stand below one another and share one scale. `name` stands to the left,
    /// `remark`, such as the values that it takes, to the right.
    pub fn strip(&mut self, name: &str, remark: &str, points: impl IntoIterator<Item = (f64, f64)>) -> &mut Self {
        let points = points.into_iter().collect();
        self.last().lanes.push(Lane { name: name.into(), remark: remark.into(), points });
        self
    }

    /// Makes the panel a map of `values`, row after row from the bottom, with a colour bar; missing ones are hatched. Maps of one figure
    /// share the scale of colours.
    pub fn map(&mut self, x: &Categories, y: &Categories, values: &[Option<f64>], label: &str) -> &mut Self {
        let cells = |key: Key| Cells { x: x.clone(), y: y.clone(), values: values.to_vec(), key };
        self.last().cells = Some(cells(Key::over(label, values)));
        let all: Vec<_> = self.panels.iter().filter_map(|p| p.cells.as_ref()).flat_map(|c| c.values.iter().copied()).collect();
        let key = Key::over(label, &all);
        self.panels.iter_mut().filter_map(|p| p.cells.as_mut()).for_each(|cells| cells.key = key.clone());
        self.key = Some(key);
        self
    }

    /// Writes these texts at 0, 1, 2 … of the x axis instead of numbers; none leaves the numbers.
    pub fn x_texts(&mut self, texts: &[String]) -> &mut Self {
        self.x_texts = texts.to_vec();
        self
    }

    /// Writes a text at a point, shifted where it would stand on another one or outside the axes.
    pub fn note(&mut self, x: f64, y: f64, text: &str) -> &mut Self {
        self.last().notes.push((x, y, text.into()));
        self
    }

    /// Draws a grey line across at a height.
    pub fn horizontal(&mut self, y: f64) -> &mut Self {
        self.last().horizontals.push(y);
        self
    }

    /// Draws the floor at 0, hatched below; the axis begins there.
    pub fn floor(&mut self) -> &mut Self {
        self.last().floor = true;
        self
    }

    /// Lets the y axis begin at 0, as for heights, shares and amplitudes.
    pub fn from_zero(&mut self) -> &mut Self {
        self.last().from_zero = true;
        self
    }

    /// Writes the labels beside the ends of the series instead of in a legend.
    pub fn end_labels(&mut self) -> &mut Self {
        self.last().end_labels = true;
        self
    }

    /// Gives both axes of the panel the same scale.
    pub fn equal_aspect(&mut self) -> &mut Self {
        self.last().equal_aspect = true;
        self
    }

    /// As [`equal_aspect`](Self::equal_aspect), but a panel that would be flat is drawn some whole number of times higher than true,
    /// which the figure says below its title. Neighbouring panels of one label share their scale.
    pub fn filled_aspect(&mut self) -> &mut Self {
        self.last().equal_aspect = true;
        self.last().enlarged = true;
        self
    }

    /// Leaves the numbers of the y axis away, for curves that are drawn one above the other.
    pub fn without_y_numbers(&mut self) -> &mut Self {
        self.last().y_numbers = false;
        self
    }

    fn last(&mut self) -> &mut Panel {
        if self.panels.is_empty() {
            self.panels.push(Panel::new("", SHARE));
        }
        let last = self.panels.len() - 1;
        &mut self.panels[last]
    }

    /// The figure as an SVG document with its physical size.
    pub fn svg(&self) -> String {
        Layout::of(self).draw()
    }

    /// Columns of the grid: as many as leave every panel a readable width.
    fn columns(&self) -> usize {
        let most = ((self.size.width() - 6.0 * self.size.font_pt) / (11.0 * self.size.font_pt)) as usize;
        if self.multiples { self.panels.len().min(most.clamp(1, 4)) } else { 1 }
    }

    /// Labels of the legend that all panels share; none if there are too many for one.
    fn shared_labels(&self) -> Vec<String> {
        let mut labels: Vec<String> = Vec::new();
        for series in self.panels.iter().filter(|p| !p.ends_are_labelled()).flat_map(Panel::labelled) {
            if !labels.contains(&series.label) {
                labels.push(series.label.clone());
            }
        }
        if labels.len() > STYLES { Vec::new() } else { labels }
    }
}

/// A series in a legend, its style and its text.
type Entry<'a> = (&'a Series, Style, String);

/// Where everything of a figure goes.
struct Layout<'a> {
    figure: &'a Figure,
    size: f64,
    width: f64,
    columns: usize,
    /// Labels of a legend that all panels share.
    labels: Vec<String>,
    styles: Vec<Vec<Style>>,
    x: Scale,
    y: Vec<Scale>,
    left: f64,
    room: f64,
    heights: Vec<f64>,
    /// How much higher than true shapes are drawn.
    enlarged: f64,
}

impl<'a> Layout<'a> {
    fn of(figure: &'a Figure) -> Self {
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
        // The room for numbers at the left depends on the heights of the panels, and these on their width.
        for _ in 0..3 {
            layout.measure();
        }
        layout
    }

    fn right(&self) -> f64 {
        self.width - EDGE - self.room.max(1.6 * self.size)
    }

    fn panel_width(&self) -> f64 {
        let gaps = self.size * (self.columns - 1) as f64;
        ((self.right() - self.left - gaps) / self.columns as f64).max(20.0)
    }

    /// Heights of the panels and the left margin.
    fn measure(&mut self) {
        let across = self.panel_width();
        let figure = self.figure;
        self.heights.clear();
        for (panel, y) in figure.panels.iter().zip(&mut self.y) {
            let mut height = panel.share * across;
            if panel.equal_aspect {
                // Until the axes have places, a range is that of the data.
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

    fn rows(&self) -> usize {
        self.figure.panels.len().div_ceil(self.columns)
    }

    fn row_height(&self, row: usize) -> f64 {
        self.heights.iter().skip(row * self.columns).take(self.columns).copied().fold(0.0, f64::max)
    }

    /// What stands above the axes of a row: titles of panels, a legend of its own.
    fn head(&self, row: usize) -> f64 {
        let panels = || row * self.columns..((row + 1) * self.columns).min(self.figure.panels.len());
        let title = panels().map(|i| self.panel_title(i).len()).max().unwrap_or(0);
        let legend = panels().map(|i| self.legend_rows(&self.own_legend(i)).1.len()).max().unwrap_or(0);
        (title + legend) as f64 * LINE * self.size
    }

    /// The lines of a panel's title.
    fn panel_title(&self, index: usize) -> Vec<String> {
        wrap(&self.figure.panels[index].title, self.size, self.panel_width())
    }

    /// Room between a row and the next (pt).
    fn gap(&self, row: usize) -> f64 {
        let floor = self.figure.panels.get(row * self.columns).is_some_and(|p| p.floor);
        self.size + if floor { HATCH } else { 0.0 }
    }

    /// First row, number of rows and lines of each label of the y axis.
    fn y_labels(&self) -> Vec<(usize, usize, Vec<String>)> {
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

    /// Series that a legend shows over one panel alone.
    fn own_legend(&self, index: usize) -> Vec<(&'a Series, Style)> {
        let panel = &self.figure.panels[index];
        if !self.labels.is_empty() || panel.ends_are_labelled() {
            return Vec::new();
        }
        panel.series.iter().zip(&self.styles[index]).filter(|(s, _)| !s.label.is_empty()).map(|(s, t)| (s, t.clone())).collect()
    }

    fn shared_legend(&self) -> Vec<(&'a Series, Style)> {
        let find = |label: &String| {
            self.figure.panels.iter().zip(&self.styles).filter(|(p, _)| !p.ends_are_labelled()).find_map(|(panel, styles)| {
                panel.series.iter().zip(styles).find(|(s, _)| s.label == *label).map(|(s, t)| (s, t.clone()))
            })
        };
        self.labels.iter().filter_map(find).collect()
    }

    /// The entries in columns of one width, as many as fit: their texts, by rows.
    fn legend_rows(&self, entries: &[(&'a Series, Style)]) -> (f64, Vec<Vec<Entry<'a>>>) {
        let most = self.width - 2.0 * EDGE;
        let texts: Vec<_> = entries.iter().map(|(s, _)| shorten(&s.label, self.size, most - SAMPLE - 4.0)).collect();
        let widest = texts.iter().map(|text| width(text, self.size)).fold(0.0, f64::max);
        let column = SAMPLE + 4.0 + widest + 1.2 * self.size;
        let columns = (((most + 1.2 * self.size) / column) as usize).clamp(1, entries.len().max(1));
        // The same number in each row, as far as that goes.
        let columns = entries.len().div_ceil(entries.len().div_ceil(columns).max(1)).max(1);
        let entries: Vec<_> = entries.iter().zip(texts).map(|((series, style), text)| (*series, style.clone(), text)).collect();
        (column, entries.chunks(columns).map(<[_]>::to_vec).collect())
    }

    fn draw_legend(&self, canvas: &mut Canvas, entries: &[(&'a Series, Style)], mut top: f64) -> f64 {
        let (column, rows) = self.legend_rows(entries);
        let Some(first) = rows.first() else { return top };
        // Centred over the axes as far as the page allows.
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

    fn draw(mut self) -> String {
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

    /// Draws one panel with its heading and numbers; gives where it ends.
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
        // Numbers of the x axis stand below the lowest panel of each column.
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn any_figure_is_well_formed(title in ".{0,20}", points in prop::collection::vec((-1e9..1e9_f64, prop::num::f64::ANY), 0..20)) {
            let mut figure = Figure::new(&title, "x (mm)", &title);
            figure.series(&title, points.clone(), Mark::Both).series("", points.clone(), Mark::Line).note(0.0, 0.0, &title).horizontal(0.0);
            figure.strip("a", &title, points);
            let plain = figure.svg();
            figure.equal_aspect().floor().panel(&title).strip(&title, "", [(0.0, 1.0)]);
            for svg in [plain, figure.svg()] {
                prop_assert!(roxmltree::Document::parse(&svg).is_ok());
                prop_assert!(!svg.contains("NaN") && !svg.contains("inf"));
            }
        }
    }
}
