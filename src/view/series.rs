//! Series of points with lines, markers and robots; styles are distinguishable without colour.

use std::fmt::Write;

use super::axis::Scale;

/// Number of styles; a panel with more series has labels at their ends.
pub(super) const STYLES: usize = 5;
/// Colours of Okabe and Ito's colour-blind safe palette, alternately dark and light.
const COLOURS: [&str; STYLES] = ["#000000", "#d55e00", "#0072b2", "#009e73", "#cc79a7"];
/// Dashes (pt).
const DASHES: [&str; STYLES] = ["", "5 2", "1.4 1.4", "7 1.6 1.4 1.6", "10 3"];
/// Number of markers along a line without markers at its points.
const MARKERS: usize = 6;
/// Width of the bins in which a line keeps only first, last and extreme points (pt).
const BIN: f64 = 0.25;

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

/// Source of a series' colour and dash.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Look {
    /// One of the five styles, by its place among the styled series of the panel.
    Styled,
    /// A solid line of a given colour and width (pt).
    Plain { colour: String, width: f64 },
    /// A robot: a thick line with its lower face at the points.
    Robot { colour: String },
    /// A band of the colour of the styled series that follows; its points are pairs, lower and upper end.
    Band,
}

#[derive(Debug, Clone)]
pub(super) struct Series {
    pub label: String,
    pub points: Vec<(f64, f64)>,
    pub mark: Mark,
    pub look: Look,
}

/// Thickness of robots (pt).
pub(super) const ROBOT: f64 = 2.6;

/// True if a point can be scaled to the page.
pub(super) fn shown((x, y): (f64, f64)) -> bool {
    x.abs() < 1e100 && y.abs() < 1e100
}

/// Style of one series: marker, colour, dash and width (pt).
#[derive(Debug, Clone)]
pub(super) struct Style {
    pub index: usize,
    pub colour: String,
    pub dash: &'static str,
    pub width: f64,
    /// True if lines without points have some markers.
    pub sparse: bool,
}

impl Style {
    /// One of the five styles; `sparse`: with some markers along lines.
    pub fn of(index: usize, sparse: bool) -> Self {
        let index = index % STYLES;
        Self { index, colour: COLOURS[index].into(), dash: DASHES[index], width: 1.1, sparse }
    }

    /// A solid line of a colour and width (pt).
    pub fn solid(colour: &str, width: f64) -> Self {
        Self { index: 0, colour: colour.into(), dash: "", width, sparse: false }
    }

    fn stroke(&self) -> String {
        let dash = if self.dash.is_empty() { String::new() } else { format!(r#" stroke-dasharray="{}""#, self.dash) };
        format!(r#"fill="none" stroke="{}" stroke-width="{}" stroke-linejoin="round"{dash}"#, self.colour, self.width)
    }

    /// Circle, square, triangle, diamond or cross.
    fn marker(&self, out: &mut String, x: f64, y: f64) {
        let c = &self.colour;
        let _ = match self.index {
            0 => writeln!(out, r#"<circle cx="{x:.2}" cy="{y:.2}" r="1.9" fill="{c}"/>"#),
            1 => writeln!(
                out,
                r##"<rect x="{:.2}" y="{:.2}" width="3.6" height="3.6" fill="#fff" stroke="{c}" stroke-width="0.9"/>"##,
                x - 1.8,
                y - 1.8
            ),
            2 => writeln!(out, r#"<path d="M{:.2} {:.2}h4.8l-2.4 -4.4z" fill="{c}"/>"#, x - 2.4, y + 2.0),
            3 => writeln!(
                out,
                r##"<path d="M{x:.2} {:.2}l2.5 2.5l-2.5 2.5l-2.5 -2.5z" fill="#fff" stroke="{c}" stroke-width="0.9"/>"##,
                y - 2.5
            ),
            _ => writeln!(
                out,
                r#"<path d="M{:.2} {:.2}l4 4m0 -4l-4 4" fill="none" stroke="{c}" stroke-width="1.1"/>"#,
                x - 2.0,
                y - 2.0
            ),
        };
    }
}

impl Series {
    /// Draws the series; `place`, from 0 to 1, shifts sparse markers.
    pub fn draw(&self, out: &mut String, x: &Scale, y: &Scale, style: &Style, place: f64) {
        // z of a recording is the height of the centre line above its height on the flat robot, drawn as the lower face.
        let lift = if matches!(self.look, Look::Robot { .. }) { ROBOT / 2.0 } else { 0.0 };
        let at = |p: &(f64, f64)| (x.at(p.0), y.at(p.1) - lift);
        if self.look == Look::Band {
            self.draw_band(out, at, style);
            return;
        }
        if self.mark != Mark::Points {
            for part in self.points.split(|p| !shown(*p)).filter(|part| part.len() > 1) {
                let points: Vec<_> =
                    thinned(&part.iter().map(at).collect::<Vec<_>>()).iter().map(|(x, y)| format!("{x:.2},{y:.2}")).collect();
                let _ = writeln!(out, r#"<polyline points="{}" {}/>"#, points.join(" "), style.stroke());
            }
        }
        if self.mark != Mark::Line {
            for (x, y) in self.points.iter().filter(|p| shown(**p)).map(at) {
                style.marker(out, x, y);
            }
        } else if style.sparse {
            for k in 0..MARKERS {
                let target = x.low + (k as f64 + place) / MARKERS as f64 * x.range();
                let passes = |w: &&[(f64, f64)]| shown(w[0]) && shown(w[1]) && w[0].0 <= target && target < w[1].0;
                if let Some(w) = self.points.windows(2).find(passes) {
                    let (x, y) = at(&w[0]);
                    style.marker(out, x, y);
                }
            }
        }
    }

    /// Draws a band, interrupted where an end is missing.
    fn draw_band(&self, out: &mut String, at: impl Fn(&(f64, f64)) -> (f64, f64), style: &Style) {
        let pairs: Vec<&[(f64, f64)]> = self.points.chunks_exact(2).collect();
        for part in pairs.split(|pair| !pair.iter().all(|p| shown(*p))).filter(|part| part.len() > 1) {
            let there = part.iter().map(|pair| at(&pair[0]));
            let back = part.iter().rev().map(|pair| at(&pair[1]));
            let points: Vec<_> = there.chain(back).map(|(x, y)| format!("{x:.2},{y:.2}")).collect();
            let _ = writeln!(
                out,
                r#"<polygon points="{}" fill="{}" fill-opacity="0.18" stroke="none"/>"#,
                points.join(" "),
                style.colour
            );
        }
    }

    /// Draws the sample in a legend.
    pub fn sample(&self, out: &mut String, style: &Style, left: f64, middle: f64, width: f64) {
        if self.mark != Mark::Points {
            let _ = writeln!(
                out,
                r#"<line x1="{left:.2}" x2="{:.2}" y1="{middle:.2}" y2="{middle:.2}" {}/>"#,
                left + width,
                style.stroke()
            );
        }
        if self.mark != Mark::Line || style.sparse {
            style.marker(out, left + width / 2.0, middle);
        }
    }
}

/// Thins out many points (pt) in order of x: keeps the first, lowest, highest and last of each bin.
fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    if points.len() < 4000 || points.windows(2).any(|w| w[1].0 < w[0].0) {
        return points.to_vec();
    }
    let bin = |p: &(f64, f64)| (p.0 / BIN).floor();
    let mut kept = Vec::new();
    for group in points.chunk_by(|a, b| bin(a) == bin(b)) {
        let by = |best: usize, i: usize, lower: bool| if (group[i].1 < group[best].1) == lower { i } else { best };
        let low = (0..group.len()).fold(0, |best, i| by(best, i, true));
        let high = (0..group.len()).fold(0, |best, i| by(best, i, false));
        let mut of_group = vec![0, low, high, group.len() - 1];
        of_group.sort_unstable();
        of_group.dedup();
        kept.extend(of_group.into_iter().map(|i| group[i]));
    }
    kept
}
