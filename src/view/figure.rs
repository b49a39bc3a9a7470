//! One pair of axes with lines and points, as SVG.

use std::fmt::Write;

/// Size of a figure (px).
const WIDTH: f64 = 640.0;
const HEIGHT: f64 = 400.0;
/// Room for labels around the axes: left, right, top, bottom (px).
const MARGINS: [f64; 4] = [64.0, 18.0, 34.0, 50.0];
/// Okabe and Ito's palette, safe for the colour-blind, in an order that alternates dark and light.
const COLOURS: [&str; 7] = ["#000000", "#d55e00", "#0072b2", "#56b4e9", "#009e73", "#cc79a7", "#e69f00"];
/// Dashes tell lines apart in grey.
const DASHES: [&str; 7] = ["", "7 3", "2 2.5", "9 3 2 3", "14 3", "5 2 1 2 1 2", "3 5"];

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// A line.
    Line,
    /// Points.
    Points,
    /// A line with its points.
    Both,
}

#[derive(Debug, Clone)]
struct Series {
    label: String,
    points: Vec<(f64, f64)>,
    mark: Mark,
    colour: String,
    dash: &'static str,
    width: f64,
}

/// A figure that is being made.
///
/// # Examples
/// ```
/// use sfers::view::{Figure, Mark};
/// let mut figure = Figure::new("A parabola", "time (s)", "height (mm)");
/// figure.series("y = t²", (0..10).map(|t| (f64::from(t), f64::from(t * t))), Mark::Both);
/// assert!(figure.svg().starts_with("<svg"));
/// ```
#[derive(Debug, Clone)]
pub struct Figure {
    title: String,
    x_label: String,
    y_label: String,
    series: Vec<Series>,
    notes: Vec<(f64, f64, String)>,
    horizontals: Vec<f64>,
    equal_aspect: bool,
    y_ticks: bool,
}

impl Figure {
    /// An empty figure; labels carry their units.
    pub fn new(title: &str, x_label: &str, y_label: &str) -> Self {
        Self {
            title: title.into(),
            x_label: x_label.into(),
            y_label: y_label.into(),
            series: Vec::new(),
            notes: Vec::new(),
            horizontals: Vec::new(),
            equal_aspect: false,
            y_ticks: true,
        }
    }

    /// Adds a series in the next colour and dash; points that are not finite break a line. An empty label stays out of the legend.
    pub fn series(&mut self, label: &str, points: impl IntoIterator<Item = (f64, f64)>, mark: Mark) -> &mut Self {
        let next = self.series.len() % COLOURS.len();
        let points = points.into_iter().collect();
        self.series.push(Series {
            label: label.into(),
            points,
            mark,
            colour: COLOURS[next].into(),
            dash: DASHES[next],
            width: 1.8,
        });
        self
    }

    /// Adds a solid line of a colour of its own.
    pub fn line(&mut self, label: &str, points: impl IntoIterator<Item = (f64, f64)>, colour: &str, width: f64) -> &mut Self {
        let points = points.into_iter().collect();
        self.series.push(Series { label: label.into(), points, mark: Mark::Line, colour: colour.into(), dash: "", width });
        self
    }

    /// Writes a text at a point.
    pub fn note(&mut self, x: f64, y: f64, text: &str) -> &mut Self {
        self.notes.push((x, y, text.into()));
        self
    }

    /// Draws a grey line across at a height, such as the floor.
    pub fn horizontal(&mut self, y: f64) -> &mut Self {
        self.horizontals.push(y);
        self
    }

    /// Gives both axes the same scale.
    pub fn equal_aspect(&mut self) -> &mut Self {
        self.equal_aspect = true;
        self
    }

    /// Leaves the numbers of the y axis away, for curves that are drawn one above the other.
    pub fn without_y_numbers(&mut self) -> &mut Self {
        self.y_ticks = false;
        self
    }

    /// The figure as an SVG document.
    pub fn svg(&self) -> String {
        let all = || self.series.iter().flat_map(|s| &s.points).copied().filter(|p| shown(*p));
        let mut x = Scale::over(all().map(|p| p.0));
        let notes = self.notes.iter().filter(|note| shown((note.0, note.1))).map(|note| note.1);
        let mut y = Scale::over(all().map(|p| p.1).chain(self.horizontals.iter().copied()).chain(notes));
        let [left, mut right, top, bottom] = MARGINS;
        let mut height = HEIGHT;
        if self.equal_aspect {
            // Such figures are flat: the legend stands beside them.
            right += if self.legend_size().0 > 0.0 { self.legend_size().0 + 10.0 } else { 0.0 };
            // The width is given and the height follows, within reason.
            let width = WIDTH - left - right;
            let wanted = (y.high - y.low) / (x.high - x.low) * width;
            let inner = wanted.clamp(self.legend_size().1.max(90.0), 520.0);
            height = inner + top + bottom;
            if wanted < inner {
                y.widen((x.high - x.low) * inner / width);
            } else {
                x.widen((y.high - y.low) * width / inner);
            }
        }
        x.place(left, WIDTH - right);
        y.place(height - bottom, top);
        let mut out = String::new();
        open(&mut out, WIDTH, height, &self.title);
        self.axes(&mut out, &x, &y, [left, top, WIDTH - right, height - bottom]);
        let _ = writeln!(
            out,
            r#"<clipPath id="box"><rect x="{left}" y="{top}" width="{}" height="{}"/></clipPath><g clip-path="url(#box)">"#,
            WIDTH - left - right,
            height - top - bottom
        );
        for &at in &self.horizontals {
            let at = y.at(at);
            let _ = writeln!(
                out,
                r##"<line x1="{left}" x2="{}" y1="{at:.2}" y2="{at:.2}" stroke="#888" stroke-width="1.2"/>"##,
                WIDTH - right
            );
        }
        for (index, series) in self.series.iter().enumerate() {
            series.draw(&mut out, &x, &y, index);
        }
        out.push_str("</g>\n");
        for (at_x, at_y, text) in &self.notes {
            let _ =
                writeln!(out, r#"<text x="{:.1}" y="{:.1}" font-size="11">{}</text>"#, x.at(*at_x), y.at(*at_y), escape(text));
        }
        self.legend(&mut out, &x, &y, [left, top, WIDTH - right, height - bottom]);
        out.push_str("</svg>\n");
        out
    }

    fn axes(&self, out: &mut String, x: &Scale, y: &Scale, [left, top, x1, y1]: [f64; 4]) {
        let (x_ticks, x_digits) = x.ticks(9);
        for tick in x_ticks {
            let at = x.at(tick);
            let _ = writeln!(out, r##"<line x1="{at:.2}" x2="{at:.2}" y1="{top}" y2="{y1}" stroke="#e4e4e4"/>"##);
            let _ =
                writeln!(out, r#"<text x="{at:.2}" y="{:.1}" text-anchor="middle">{}</text>"#, y1 + 16.0, number(tick, x_digits));
        }
        let (y_ticks, y_digits) = y.ticks(if y1 - top < 140.0 { 4 } else { 7 });
        for tick in y_ticks.into_iter().filter(|_| self.y_ticks) {
            let at = y.at(tick);
            let _ = writeln!(out, r##"<line x1="{left}" x2="{x1}" y1="{at:.2}" y2="{at:.2}" stroke="#e4e4e4"/>"##);
            let _ = writeln!(
                out,
                r#"<text x="{:.1}" y="{:.2}" text-anchor="end">{}</text>"#,
                left - 7.0,
                at + 4.0,
                number(tick, y_digits)
            );
        }
        frame(out, [left, top, x1, y1], &self.x_label, &self.y_label);
    }

    /// Width and height of the legend (px), zero without labels.
    fn legend_size(&self) -> (f64, f64) {
        let labels = || self.series.iter().filter(|s| !s.label.is_empty()).map(|s| s.label.chars().count());
        labels().max().map_or((0.0, 0.0), |longest| (46.0 + 6.8 * longest as f64, 8.0 + 16.0 * labels().count() as f64))
    }

    /// A box with the labels, in the corner where it hides the fewest points.
    fn legend(&self, out: &mut String, x: &Scale, y: &Scale, [left, top, right, bottom]: [f64; 4]) {
        let labelled: Vec<&Series> = self.series.iter().filter(|s| !s.label.is_empty()).collect();
        let (width, height) = self.legend_size();
        if labelled.is_empty() {
            return;
        }
        let hidden = |corner: &(f64, f64)| {
            let inside = |(px, py): (f64, f64)| {
                (corner.0 - 4.0..corner.0 + width + 4.0).contains(&px) && (corner.1 - 4.0..corner.1 + height + 4.0).contains(&py)
            };
            // Lines count by points every few pixels along them.
            self.series
                .iter()
                .flat_map(|s| s.points.windows(2))
                .flat_map(|w| (0..8).map(move |k| (w[0], w[1], f64::from(k) / 8.0)))
                .filter(|(a, b, t)| inside((x.at(a.0 + t * (b.0 - a.0)), y.at(a.1 + t * (b.1 - a.1)))))
                .count()
        };
        let pad = 7.0;
        let (far, low) = (right - pad - width, bottom - pad - height);
        let beside = [(right + 10.0, top)];
        let inside = [(far, top + pad), (left + pad, top + pad), (far, low), (left + pad, low), ((left + far) / 2.0, top + pad)];
        let corners: &[_] = if self.equal_aspect { &beside } else { &inside };
        let Some(&(at_x, at_y)) = corners.iter().min_by_key(|corner| hidden(corner)) else { return };
        let _ = writeln!(
            out,
            r##"<rect x="{at_x:.1}" y="{at_y:.1}" width="{width:.1}" height="{height:.1}" fill="#fff" fill-opacity="0.85" stroke="#ccc"/>"##
        );
        for (i, series) in labelled.iter().enumerate() {
            let middle = at_y + 12.0 + 16.0 * i as f64;
            let index = self.series.iter().position(|s| std::ptr::eq(s, *series)).unwrap_or(0);
            series.sample(out, at_x + 6.0, middle, index);
            let _ = writeln!(out, r#"<text x="{:.1}" y="{:.1}">{}</text>"#, at_x + 38.0, middle + 4.0, escape(&series.label));
        }
    }
}

/// Whether a point can be drawn at all.
fn shown((x, y): (f64, f64)) -> bool {
    x.abs() < 1e100 && y.abs() < 1e100
}

impl Series {
    fn stroke(&self) -> String {
        format!(
            r#"fill="none" stroke="{}" stroke-width="{}" stroke-linejoin="round" stroke-dasharray="{}""#,
            self.colour, self.width, self.dash
        )
    }

    fn draw(&self, out: &mut String, x: &Scale, y: &Scale, index: usize) {
        if self.mark != Mark::Points {
            for part in self.points.split(|p| !shown(*p)).filter(|part| part.len() > 1) {
                let points: Vec<String> = part.iter().map(|p| format!("{:.2},{:.2}", x.at(p.0), y.at(p.1))).collect();
                let _ = writeln!(out, r#"<polyline points="{}" {}/>"#, points.join(" "), self.stroke());
            }
        }
        if self.mark != Mark::Line {
            for p in self.points.iter().filter(|p| shown(**p)) {
                self.marker(out, x.at(p.0), y.at(p.1), index);
            }
        }
    }

    fn sample(&self, out: &mut String, left: f64, middle: f64, index: usize) {
        if self.mark != Mark::Points {
            let _ = writeln!(
                out,
                r#"<line x1="{left:.1}" x2="{:.1}" y1="{middle:.1}" y2="{middle:.1}" {}/>"#,
                left + 26.0,
                self.stroke()
            );
        }
        if self.mark != Mark::Line {
            self.marker(out, left + 13.0, middle, index);
        }
    }

    /// Circle, square, triangle or diamond, by turns.
    fn marker(&self, out: &mut String, x: f64, y: f64, index: usize) {
        let c = &self.colour;
        let _ = match index % 4 {
            0 => writeln!(out, r#"<circle cx="{x:.2}" cy="{y:.2}" r="3" fill="{c}"/>"#),
            1 => writeln!(
                out,
                r##"<rect x="{:.2}" y="{:.2}" width="6" height="6" fill="#fff" stroke="{c}" stroke-width="1.6"/>"##,
                x - 3.0,
                y - 3.0
            ),
            2 => writeln!(out, r#"<path d="M{:.2} {:.2}h7l-3.5 -6.5z" fill="{c}"/>"#, x - 3.5, y + 3.0),
            _ => writeln!(
                out,
                r##"<path d="M{x:.2} {:.2}l4 4l-4 4l-4 -4z" fill="#fff" stroke="{c}" stroke-width="1.6"/>"##,
                y - 4.0
            ),
        };
    }
}

/// Begins a document and writes its title.
pub(super) fn open(out: &mut String, width: f64, height: f64, title: &str) {
    let _ = writeln!(
        out,
        r##"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height:.0}" font-family="Helvetica, Arial, sans-serif" font-size="12" fill="#111">
<rect width="{width}" height="{height:.0}" fill="#fff"/>
<text x="{}" y="21" font-size="14" text-anchor="middle">{}</text>"##,
        width / 2.0,
        escape(title)
    );
}

/// The box of the axes with its labels.
pub(super) fn frame(out: &mut String, [left, top, right, bottom]: [f64; 4], x_label: &str, y_label: &str) {
    let _ = writeln!(
        out,
        r##"<rect x="{left}" y="{top}" width="{:.1}" height="{:.1}" fill="none" stroke="#111"/>
<text x="{:.1}" y="{:.1}" text-anchor="middle" font-size="13">{}</text>
<text transform="translate(17 {:.1}) rotate(-90)" text-anchor="middle" font-size="13">{}</text>"##,
        right - left,
        bottom - top,
        (left + right) / 2.0,
        bottom + 37.0,
        escape(x_label),
        (top + bottom) / 2.0,
        escape(y_label)
    );
}

/// One axis: a range of values laid over a range of pixels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scale {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Scale {
    /// The range of the values, widened by a little, or around a single one.
    fn over(values: impl Iterator<Item = f64>) -> Self {
        let (mut low, mut high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        let (spread, size) = (high - low, high.abs().max(low.abs()));
        let pad = if spread > 1e-9 * size.max(1e-80) { 0.04 * spread } else { 0.5 * size.max(1e-9) };
        Self { low: low - pad, high: high + pad, from: 0.0, to: 1.0 }
    }

    /// Widens to `range`, about its middle.
    fn widen(&mut self, range: f64) {
        let middle = 0.5 * (self.low + self.high);
        (self.low, self.high) = (middle - 0.5 * range, middle + 0.5 * range);
    }

    fn place(&mut self, from: f64, to: f64) {
        (self.from, self.to) = (from, to);
    }

    fn at(&self, value: f64) -> f64 {
        self.from + (value - self.low) / (self.high - self.low) * (self.to - self.from)
    }

    /// About `count` round values, and the digits after the point that they need.
    fn ticks(&self, count: usize) -> (Vec<f64>, usize) {
        ticks(self.low, self.high, count)
    }
}

/// Multiples of 1, 2 or 5 times a power of ten within a range, at most `count` of them, and the digits after the point that they need.
pub(super) fn ticks(low: f64, high: f64, count: usize) -> (Vec<f64>, usize) {
    let rough = (high - low) / count as f64;
    let power = rough.log10().floor();
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * 10f64.powf(power)).find(|step| *step >= rough * (1.0 - 1e-9));
    let step = step.unwrap_or(rough);
    let digits = (-(step * (1.0 + 1e-9)).log10().floor()).max(0.0) as usize;
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    ((first..=last).map(|i| i as f64 * step).collect(), digits)
}

/// A number with a true minus sign.
pub(super) fn number(value: f64, digits: usize) -> String {
    if digits > 6 || value.abs() >= 1e7 {
        return format!("{value:.1e}").replace('-', "−");
    }
    let text = format!("{value:.digits$}");
    let zero = text.trim_start_matches('-').chars().all(|c| c == '0' || c == '.');
    if zero { text.trim_start_matches('-').to_owned() } else { text.replace('-', "−") }
}

/// Text as it may stand in XML. Control characters, which XML does not allow, are left out.
pub(crate) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c if c.is_control() => {}
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks(-0.4, 10.4, 6), (vec![0.0, 2.0, 4.0, 6.0, 8.0, 10.0], 0));
        let (values, digits) = ticks(0.0031, 0.0099, 8);
        assert_eq!(digits, 3);
        assert!(values.iter().zip([0.004, 0.005, 0.006, 0.007, 0.008, 0.009]).all(|(a, b)| (a - b).abs() < 1e-12));
        assert_eq!(number(-0.0, 2), "0.00");
        assert_eq!(number(-1.5, 1), "−1.5");
    }

    proptest! {
        #[test]
        fn any_figure_is_well_formed(title in ".{0,20}", points in prop::collection::vec((-1e9..1e9_f64, prop::num::f64::ANY), 0..20)) {
            let mut figure = Figure::new(&title, "x (mm)", &title);
            figure.series(&title, points.clone(), Mark::Both).series("", points, Mark::Line).note(0.0, 0.0, &title).horizontal(0.0);
            let plain = figure.svg();
            figure.equal_aspect();
            for svg in [plain, figure.svg()] {
                prop_assert!(roxmltree::Document::parse(&svg).is_ok());
                prop_assert!(!svg.contains("NaN") && !svg.contains("inf"));
            }
        }
    }
}
