//! Figures for print: panels with lines and points on shared axes, as SVG.
//!
//! No text covers data: the legend is above the axes, end labels are beside them. A legend has at most five series, distinguished by dash, marker
//! and colour; a panel with more has labels at the ends of its series.

mod draw;
mod layout;

use super::canvas::Size;
use super::heatmap::{Categories, Cells, Key};
use super::panel::{Lane, Panel};
use super::series::{Look, Mark, STYLES, Series};
use layout::Layout;

/// Default height of a panel as a share of its width.
const SHARE: f64 = 0.62;

/// A builder of figures.
///
/// A figure begins with one panel; [`panel`](Self::panel) adds one below it on the same x axis, and [`small_multiple`](Self::small_multiple) one
/// of a grid of panels that share both axes. Data go to the last panel.
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
    /// An empty figure of [`Size::SCREEN`]; labels contain units.
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

    /// Sets the line below the title: what was simulated or measured, with which settings.
    pub fn setting(&mut self, setting: &str) -> &mut Self {
        self.setting = setting.into();
        self
    }

    /// Sets the physical size of the figure and its text.
    pub fn size(&mut self, size: Size) -> &mut Self {
        self.size = size;
        self
    }

    /// Adds a panel below, on the same x axis. Neighbours with equal labels share one label.
    pub fn panel(&mut self, y_label: &str) -> &mut Self {
        self.panels.push(Panel::new(y_label, 0.5 * SHARE));
        self
    }

    /// Adds a panel with a title to a grid whose panels share both axes and the legend. The first call titles the first panel.
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

    /// Sets the title of the panel.
    pub fn panel_title(&mut self, title: &str) -> &mut Self {
        self.last().title = title.into();
        self
    }

    /// Sets the height of the panel as a share of its width (ignored if both axes have the same scale).
    pub fn share(&mut self, share: f64) -> &mut Self {
        self.last().share = share;
        self
    }

    /// Adds a series in the next of five styles; points that are not finite interrupt a line. A series without a label is not in the legend; series
    /// with the same label in several panels have the same style.
    pub fn series(&mut self, label: &str, points: impl IntoIterator<Item = (f64, f64)>, mark: Mark) -> &mut Self {
        self.add(label, points, mark, Look::Styled)
    }

    /// Adds a band in the colour of the series that is added next: x, lower and upper end.
    pub fn band(&mut self, ends: impl IntoIterator<Item = (f64, f64, f64)>) -> &mut Self {
        let points = ends.into_iter().flat_map(|(x, low, high)| [(x, low), (x, high)]);
        self.add("", points, Mark::Line, Look::Band)
    }

    /// Adds a solid line of a given colour and width (pt).
    pub fn line(&mut self, label: &str, points: impl IntoIterator<Item = (f64, f64)>, colour: &str, width: f64) -> &mut Self {
        self.add(label, points, Mark::Line, Look::Plain { colour: colour.into(), width })
    }

    /// Adds a robot's shape as a thick line above its points: z of a recording is the height of the robot's lower face.
    pub fn robot(&mut self, label: &str, points: impl IntoIterator<Item = (f64, f64)>, colour: &str) -> &mut Self {
        self.add(label, points, Mark::Line, Look::Robot { colour: colour.into() })
    }

    fn add(&mut self, label: &str, points: impl IntoIterator<Item = (f64, f64)>, mark: Mark, look: Look) -> &mut Self {
        let points = points.into_iter().collect();
        self.last().series.push(Series { label: label.into(), points, mark, look });
        self
    }

    /// Adds a strip for one signal, with `name` to its left and `remark`, such as its range, to its right. The strips of a panel share one scale.
    pub fn strip(&mut self, name: &str, remark: &str, points: impl IntoIterator<Item = (f64, f64)>) -> &mut Self {
        let points = points.into_iter().collect();
        self.last().lanes.push(Lane { name: name.into(), remark: remark.into(), points });
        self
    }

    /// Turns the panel into a map of `values`, rows × columns from the bottom row, with a colour bar; missing values are hatched. The maps of a figure
    /// share one colour scale.
    pub fn map(&mut self, x: &Categories, y: &Categories, values: &[Option<f64>], label: &str) -> &mut Self {
        let cells = |key: Key| Cells { x: x.clone(), y: y.clone(), values: values.to_vec(), key };
        self.last().cells = Some(cells(Key::over(label, values)));
        let all: Vec<_> = self.panels.iter().filter_map(|p| p.cells.as_ref()).flat_map(|c| c.values.iter().copied()).collect();
        let key = Key::over(label, &all);
        self.panels.iter_mut().filter_map(|p| p.cells.as_mut()).for_each(|cells| cells.key = key.clone());
        self.key = Some(key);
        self
    }

    /// Labels 0, 1, 2 … of the x axis with these texts; an empty list restores the numbers.
    pub fn x_texts(&mut self, texts: &[String]) -> &mut Self {
        self.x_texts = texts.to_vec();
        self
    }

    /// Adds a text at a point, shifted to avoid other texts and the edges.
    pub fn note(&mut self, x: f64, y: f64, text: &str) -> &mut Self {
        self.last().notes.push((x, y, text.into()));
        self
    }

    /// Adds a grey horizontal line at `y`.
    pub fn horizontal(&mut self, y: f64) -> &mut Self {
        self.last().horizontals.push(y);
        self
    }

    /// Draws the floor at 0, hatched below; the y axis begins there.
    pub fn floor(&mut self) -> &mut Self {
        self.last().floor = true;
        self
    }

    /// Begins the y axis at 0, as for heights, shares and amplitudes.
    pub fn from_zero(&mut self) -> &mut Self {
        self.last().from_zero = true;
        self
    }

    /// Labels the ends of the series instead of a legend.
    pub fn end_labels(&mut self) -> &mut Self {
        self.last().end_labels = true;
        self
    }

    /// Gives both axes of the panel the same scale.
    pub fn equal_aspect(&mut self) -> &mut Self {
        self.last().equal_aspect = true;
        self
    }

    /// As [`equal_aspect`](Self::equal_aspect), but heights of a flat panel are enlarged by an integer factor, which the setting line states.
    /// Panels of one label share their scale.
    pub fn filled_aspect(&mut self) -> &mut Self {
        self.last().equal_aspect = true;
        self.last().enlarged = true;
        self
    }

    /// Omits the numbers of the y axis, for curves with offsets.
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

    /// Number of columns of the grid, so that panels have a readable width.
    fn columns(&self) -> usize {
        let most = ((self.size.width() - 6.0 * self.size.font_pt) / (11.0 * self.size.font_pt)) as usize;
        if self.multiples { self.panels.len().min(most.clamp(1, 4)) } else { 1 }
    }

    /// Labels of the legend for all panels; empty if there are too many.
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

/// A heat map of `values`, rows × columns from the bottom row, as SVG; missing values are hatched.
pub fn heat_map(title: &str, label: &str, x: &Categories, y: &Categories, values: &[Option<f64>]) -> String {
    let mut figure = Figure::new(title, &x.label, &y.label);
    figure.map(x, y, values, label);
    figure.size(Size::SCREEN).svg()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_map_has_a_cell_per_value_and_hatches_what_is_missing() {
        let axis = |label: &str, n: usize| Categories { label: label.into(), texts: (0..n).map(|i| i.to_string()).collect() };
        let svg = heat_map("t", "v (mm)", &axis("x (s)", 2), &axis("y <", 2), &[Some(0.0), Some(1.0), None, Some(f64::NAN)]);
        let document = roxmltree::Document::parse(&svg).unwrap();
        let cells = document.descendants().find(|node| node.attribute("class") == Some("cells")).unwrap();
        let fills: Vec<_> = cells.descendants().filter_map(|node| node.attribute("fill")).collect();
        assert_eq!(cells.descendants().filter(|node| node.attribute("class") == Some("missing")).count(), 2);
        assert!(fills.contains(&"#440154") && fills.contains(&"#fde725"));
        assert!(document.descendants().any(|node| node.text() == Some("no value")));
    }

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
