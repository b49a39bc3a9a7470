//! One pair of axes of a figure with its contents.

use std::fmt::Write;

use super::axis::Scale;
use super::canvas::{Anchor, Area, Canvas};
use super::heatmap::{Cells, colour};
use super::series::{Look, ROBOT, STYLES, Series, Style, shown};
use super::text::{number, shorten, width};

/// Colour of grid lines.
const GRID: &str = "#e2e2e2";
/// Height of a line of text as a multiple of the font size.
pub(super) const LINE: f64 = 1.25;

/// A strip for one signal, such as the voltage of some actuators.
#[derive(Debug, Clone)]
pub(super) struct Lane {
    pub name: String,
    pub remark: String,
    pub points: Vec<(f64, f64)>,
}

/// One pair of axes with its data and settings.
#[derive(Debug, Clone, Default)]
pub(super) struct Panel {
    pub title: String,
    pub y_label: String,
    pub series: Vec<Series>,
    pub notes: Vec<(f64, f64, String)>,
    pub horizontals: Vec<f64>,
    pub lanes: Vec<Lane>,
    pub cells: Option<Cells>,
    pub equal_aspect: bool,
    /// True if heights of a flat panel with equal scales are enlarged.
    pub enlarged: bool,
    pub y_numbers: bool,
    pub from_zero: bool,
    pub floor: bool,
    pub end_labels: bool,
    /// Height as a share of the width.
    pub share: f64,
}

impl Panel {
    /// An empty panel with a height of `share` times its width.
    pub fn new(y_label: &str, share: f64) -> Self {
        Self { y_label: y_label.into(), y_numbers: true, share, ..Self::default() }
    }

    /// Series with a label.
    pub fn labelled(&self) -> impl Iterator<Item = &Series> {
        self.series.iter().filter(|s| !s.label.is_empty())
    }

    /// True if labels are at the ends of the series, because a legend has at most five.
    pub fn ends_are_labelled(&self) -> bool {
        self.end_labels || self.labelled().count() > STYLES
    }

    /// Points of all series that can be drawn.
    pub fn points(&self) -> impl Iterator<Item = (f64, f64)> {
        self.series.iter().flat_map(|s| &s.points).copied().filter(|p| shown(*p))
    }

    /// Values that the x axis covers.
    pub fn x_values(&self) -> impl Iterator<Item = f64> {
        let lanes = self.lanes.iter().flat_map(|lane| &lane.points).copied().filter(|p| shown(*p));
        let cells = self.cells.iter().flat_map(|cells| [0.0, cells.x.texts.len() as f64]);
        self.points().chain(lanes).map(|p| p.0).chain(cells)
    }

    /// Values that the y axis covers.
    pub fn y_values(&self) -> impl Iterator<Item = f64> {
        let notes = self.notes.iter().filter(|note| shown((note.0, note.1))).map(|note| note.1);
        let cells = self.cells.iter().flat_map(|cells| [0.0, cells.y.texts.len() as f64]);
        let floor = self.floor.then_some(0.0);
        self.points().map(|p| p.1).chain(self.horizontals.iter().copied()).chain(notes).chain(cells).chain(floor)
    }

    /// The scale of `values`, from 0 if wanted or if they are close to it.
    pub fn y_scale(&self, values: impl Iterator<Item = f64>) -> Scale {
        if self.cells.is_some() {
            return Scale::over(values, 0.0);
        }
        let values: Vec<f64> = values.collect();
        let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        let mut scale = Scale::over(values.into_iter(), 0.06);
        // Values far above 0 relative to their range need not begin at 0, unless asked for.
        let near = low >= 0.0 && low <= 0.5 * high;
        let asked = (self.from_zero || self.floor) && high > 0.0 && low >= -0.02 * high;
        if (near && high > 0.0) || asked {
            scale.low = 0.0;
            // Robots are drawn above their points.
            let robots = self.series.iter().any(|s| matches!(s.look, Look::Robot { .. }));
            scale.high = high * if robots { 1.25 } else { 1.06 };
        }
        scale
    }

    /// The styles of the series, by the index of their label in `labels`, or by their index in the panel.
    pub fn styles(&self, labels: &[String]) -> Vec<Style> {
        let styled = self.series.iter().filter(|s| s.look == Look::Styled).count();
        let sequence = self.ends_are_labelled() || styled > STYLES;
        let of_styled = |place: usize, series: &Series| {
            if sequence {
                return Style::solid(&colour(0.85 * place as f64 / (styled.max(2) - 1) as f64), 1.1);
            }
            Style::of(labels.iter().position(|l| *l == series.label).unwrap_or(place), styled > 1)
        };
        let mut next = 0;
        let style = |(index, series): (usize, &Series)| match &series.look {
            Look::Plain { colour, width } => Style::solid(colour, *width),
            Look::Robot { colour } => Style::solid(colour, ROBOT),
            Look::Band => of_styled(next, self.series[index..].iter().find(|s| s.look == Look::Styled).unwrap_or(series)),
            Look::Styled => {
                next += 1;
                of_styled(next - 1, series)
            }
        };
        self.series.iter().enumerate().map(style).collect()
    }

    /// Values and texts of the y axis: ticks, names of lanes, or rows of a map.
    pub fn y_ticks(&self, y: &Scale, height: f64, size: f64) -> Vec<(f64, String)> {
        if !self.lanes.is_empty() {
            let n = self.lanes.len() as f64;
            return self.lanes.iter().enumerate().map(|(i, lane)| (n - i as f64 - 0.5, lane.name.clone())).collect();
        }
        if let Some(cells) = &self.cells {
            let every = (cells.y.texts.len() as f64 * 1.15 * size / height).ceil().max(1.0) as usize;
            return cells.y.texts.iter().enumerate().step_by(every).map(|(i, t)| (i as f64 + 0.5, t.clone())).collect();
        }
        if !self.y_numbers {
            return Vec::new();
        }
        // As many as have room, at least two if they fit.
        let wanted = ((height / (2.2 * size)) as usize).clamp(2, 7);
        let counts = (wanted..=8).map(|count| y.ticks(count));
        let fits = |ticks: &[f64]| ticks.len() as f64 * 1.2 * size <= height + size;
        let (ticks, digits) = counts.into_iter().find(|(t, _)| t.len() > 1 && fits(t)).unwrap_or_else(|| y.ticks(wanted));
        ticks.into_iter().map(|tick| (tick, number(tick, digits))).collect()
    }

    /// Values and texts of the x axis, without overlap.
    pub fn x_ticks(&self, x: &Scale, across: f64, size: f64, texts: &[String]) -> Vec<(f64, String)> {
        let named = self.cells.as_ref().map(|cells| (&cells.x.texts[..], 0.5)).or((!texts.is_empty()).then_some((texts, 0.0)));
        if let Some((texts, begin)) = named {
            let step = across / x.range();
            // Numbers are thinned out, names are shortened.
            let numbers = texts.iter().all(|t| t.replace('−', "-").parse::<f64>().is_ok());
            let widest = texts.iter().map(|t| width(t, size)).fold(0.0, f64::max) + 0.6 * size;
            let every = if numbers { widest / step } else { 3.0 * size / step }.ceil().max(1.0) as usize;
            let text = |t: &String| shorten(t, size, step * every as f64 - 0.6 * size);
            return texts.iter().enumerate().step_by(every).map(|(i, t)| (i as f64 + begin, text(t))).collect();
        }
        let mut best = Vec::new();
        for count in (1..=9).rev() {
            let (ticks, digits) = x.ticks(count);
            best = ticks.into_iter().map(|tick| (tick, number(tick, digits))).collect::<Vec<_>>();
            let widest = best.iter().map(|(_, t)| width(t, size)).fold(0.0, f64::max) + 0.8 * size;
            let step = if best.len() > 1 { (best[1].0 - best[0].0) / x.range() * across } else { across };
            if widest <= step {
                break;
            }
        }
        best
    }

    /// Width of the texts to the right of the panel, at most `most` (pt).
    pub fn right_room(&self, size: f64, most: f64) -> f64 {
        let ends = self.labelled().filter(|_| self.ends_are_labelled()).map(|s| s.label.as_str());
        let remarks = self.lanes.iter().map(|lane| lane.remark.as_str());
        let widest = ends.chain(remarks).map(|text| width(text, size)).fold(0.0, f64::max);
        if widest > 0.0 { widest.min(most) + if self.lanes.is_empty() { 12.0 } else { 4.0 } } else { 0.0 }
    }

    /// Least height for the texts beside the panel (pt).
    pub fn least_height(&self, size: f64) -> f64 {
        let ends = if self.ends_are_labelled() { self.labelled().count() } else { 0 };
        (1.15 * size * ends as f64).max(1.55 * size * self.lanes.len() as f64)
    }

    /// Draws the contents of the axes `area`.
    #[allow(clippy::too_many_arguments)]
    pub fn draw(
        &self,
        canvas: &mut Canvas,
        x: &Scale,
        y: &Scale,
        area: Area,
        styles: &[Style],
        size: f64,
        room: f64,
        texts: &[String],
    ) {
        let Area { left, top, right, bottom } = area;
        if let Some(cells) = &self.cells {
            cells.draw(&mut canvas.out, area);
            canvas.frame(area);
            return;
        }
        for (at, _) in self.x_ticks(x, area.width(), size, texts) {
            canvas.line((x.at(at), top), (x.at(at), bottom), GRID, 0.4);
        }
        if !self.lanes.is_empty() {
            self.draw_lanes(canvas, x, area, size);
            canvas.frame(area);
            return;
        }
        for (at, _) in self.y_ticks(y, area.height(), size) {
            canvas.line((left, y.at(at)), (right, y.at(at)), GRID, 0.4);
        }
        for &at in &self.horizontals {
            canvas.line((left, y.at(at)), (right, y.at(at)), "#777", 0.7);
        }
        canvas.frame(area);
        if self.floor {
            canvas.floor(left, right, y.at(0.0));
        }
        // A nested SVG clips the data to the axes, with a margin for strokes.
        let rim = 3.0;
        let _ = writeln!(
            canvas.out,
            r#"<svg class="data" x="{0:.2}" y="{1:.2}" width="{2:.2}" height="{3:.2}" viewBox="{0:.2} {1:.2} {2:.2} {3:.2}" overflow="hidden">"#,
            left - rim,
            top - rim,
            area.width() + 2.0 * rim,
            area.height() + 2.0 * rim
        );
        for (i, (series, style)) in self.series.iter().zip(styles).enumerate() {
            series.draw(&mut canvas.out, x, y, style, (i as f64 + 0.5) / self.series.len() as f64);
        }
        canvas.out.push_str("</svg>\n");
        self.draw_notes(canvas, x, y, area, size);
        if self.ends_are_labelled() {
            self.draw_ends(canvas, x, y, area, styles, size, room);
        }
    }

    /// Draws labels beside the right edge at the heights of the series' ends, moved apart to avoid overlap.
    #[allow(clippy::too_many_arguments)]
    fn draw_ends(&self, canvas: &mut Canvas, x: &Scale, y: &Scale, area: Area, styles: &[Style], size: f64, room: f64) {
        let end = |series: &Series| series.points.iter().rev().find(|p| shown(**p)).map(|p| (x.at(p.0), y.at(p.1)));
        let mut ends: Vec<_> = self
            .series
            .iter()
            .zip(styles)
            .filter(|(s, _)| !s.label.is_empty())
            .filter_map(|(s, style)| Some((end(s)?, s, style)))
            .collect();
        ends.sort_by(|a, b| a.0.1.total_cmp(&b.0.1));
        let step = 1.15 * size;
        let mut at: Vec<f64> = ends.iter().map(|e| e.0.1).collect();
        for i in 0..at.len() {
            let least = if i == 0 { area.top + 0.5 * size } else { at[i - 1] + step };
            at[i] = at[i].max(least);
        }
        for i in (0..at.len()).rev() {
            let most = if i + 1 == at.len() { area.bottom - 0.5 * size } else { at[i + 1] - step };
            at[i] = at[i].min(most);
        }
        canvas.out.push_str("<g class=\"ends\">\n");
        for (((from_x, from_y), series, style), at) in ends.into_iter().zip(at) {
            let begin = (from_x.max(area.right), from_y);
            if from_x < area.right - 1.0 {
                canvas.line((from_x, from_y), begin, &style.colour, 0.4);
            }
            canvas.line(begin, (area.right + 9.0, at), &style.colour, 0.6);
            canvas.text(area.right + 11.0, at, size, Anchor::Start, &shorten(&series.label, size, room - 11.0));
        }
        canvas.out.push_str("</g>\n");
    }

    /// Draws notes at their points, moved vertically to avoid overlap.
    fn draw_notes(&self, canvas: &mut Canvas, x: &Scale, y: &Scale, area: Area, size: f64) {
        let mut placed: Vec<Area> = Vec::new();
        for (at_x, at_y, text) in self.notes.iter().filter(|note| shown((note.0, note.1))) {
            let text = shorten(text.trim(), size, area.width());
            let across = width(&text, size);
            let left = (x.at(*at_x) + 2.0).min(area.right - across - 1.0).max(area.left + 1.0);
            let mut middle = y.at(*at_y).clamp(area.top + 0.7 * size, area.bottom - 0.7 * size);
            let spot = |middle: f64| Area { left, top: middle - 0.55 * size, right: left + across, bottom: middle + 0.55 * size };
            let hits =
                |a: Area| placed.iter().any(|b| a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom);
            let tries = (0..40).map(|k| middle + f64::from(k / 2 + k % 2) * 1.15 * size * if k % 2 == 0 { 1.0 } else { -1.0 });
            let inside = |m: &f64| *m > area.top + 0.5 * size && *m < area.bottom - 0.5 * size;
            if let Some(free) = tries.filter(inside).find(|m| !hits(spot(*m))) {
                middle = free;
            }
            placed.push(spot(middle));
            canvas.note(left, middle, size, &text);
        }
    }

    fn draw_lanes(&self, canvas: &mut Canvas, x: &Scale, area: Area, size: f64) {
        let values = || self.lanes.iter().flat_map(|lane| &lane.points).map(|p| p.1).filter(|v| v.is_finite());
        let (low, high) = values().fold((0.0_f64, 0.0_f64), |(l, h), v| (l.min(v), h.max(v)));
        let height = area.height() / self.lanes.len() as f64;
        for (i, lane) in self.lanes.iter().enumerate() {
            let top = area.top + i as f64 * height;
            let mut y = Scale::over([low, high].into_iter(), 0.0);
            y.place(top + 0.86 * height, top + 0.14 * height);
            if i > 0 {
                canvas.line((area.left, top), (area.right, top), "#999", 0.4);
            }
            canvas.line((area.left, y.at(0.0)), (area.right, y.at(0.0)), "#bbb", 0.4);
            canvas.out.push_str("<g class=\"data\">");
            let series =
                Series { label: String::new(), points: lane.points.clone(), mark: super::series::Mark::Line, look: Look::Styled };
            series.draw(&mut canvas.out, x, &y, &Style::of(0, false), 0.0);
            canvas.out.push_str("</g>\n");
            canvas.text(area.right + 4.0, top + 0.5 * height, size, Anchor::Start, &lane.remark);
        }
    }
}
