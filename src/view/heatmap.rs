//! Heat maps: coloured cells over two keys, with a colour bar.

use std::fmt::Write;

use super::axis::{Scale, ticks};
use super::canvas::{Anchor, Area, Canvas};
use super::text::{number, width};

/// Colours of increasing lightness (after viridis), which keep their order in greyscale.
const COLOURS: [[f64; 3]; 6] = [
    [68.0, 1.0, 84.0],
    [65.0, 68.0, 135.0],
    [42.0, 120.0, 142.0],
    [34.0, 168.0, 132.0],
    [122.0, 209.0, 81.0],
    [253.0, 231.0, 37.0],
];
/// Number of steps of a colour bar.
const STEPS: usize = 64;

/// The colour of the scale at `share`, 0 to 1, as `#rrggbb`.
pub fn colour(share: f64) -> String {
    let at = share.clamp(0.0, 1.0) * (COLOURS.len() - 1) as f64;
    let low = (at as usize).min(COLOURS.len() - 2);
    let mix = |channel: usize| {
        let (a, b) = (COLOURS[low][channel], COLOURS[low + 1][channel]);
        (a + (at - low as f64) * (b - a)).round() as u8
    };
    format!("#{:02x}{:02x}{:02x}", mix(0), mix(1), mix(2))
}

/// An axis of a heat map.
#[derive(Debug, Clone)]
pub struct Categories {
    /// Label with unit.
    pub label: String,
    /// One text per column or row.
    pub texts: Vec<String>,
}

/// A colour scale with its label, which contains the unit.
#[derive(Debug, Clone)]
pub(super) struct Key {
    pub label: String,
    pub low: f64,
    pub high: f64,
    /// True if values are missing, which are hatched.
    pub missing: bool,
}

impl Key {
    /// The scale over all finite values.
    pub fn over(label: &str, values: &[Option<f64>]) -> Self {
        let known = values.iter().flatten().copied().filter(|v| v.is_finite());
        let (mut low, mut high) = known.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        if low == high {
            (low, high) = (low - 0.5 * low.abs().max(1e-9), high + 0.5 * high.abs().max(1e-9));
        }
        let missing = values.iter().any(|v| v.is_none_or(|v| !v.is_finite()));
        Self { label: label.into(), low, high, missing }
    }

    /// Position of a value on the scale, from 0 to 1.
    pub fn share(&self, value: f64) -> f64 {
        (value - self.low) / (self.high - self.low)
    }

    /// Draws label, bar and numbers from `top` down; returns their lower edge (pt).
    pub fn draw(&self, canvas: &mut Canvas, left: f64, right: f64, top: f64, size: f64) -> f64 {
        canvas.out.push_str("<g class=\"key\">\n");
        canvas.text((left + right) / 2.0, top + 0.6 * size, size, Anchor::Middle, &self.label);
        let bar = Area { left, top: top + 1.35 * size, right, bottom: top + 2.25 * size };
        for step in 0..STEPS {
            let share = step as f64 / STEPS as f64;
            let from = bar.left + share * bar.width();
            rectangle(
                &mut canvas.out,
                from,
                bar.top,
                bar.right - from,
                bar.height(),
                &colour((step as f64 + 0.5) / STEPS as f64),
            );
        }
        canvas.frame(bar);
        let mut x = Scale::over([self.low, self.high].into_iter(), 0.0);
        x.place(bar.left, bar.right);
        for count in (1..=7).rev() {
            let (values, digits) = ticks(self.low, self.high, count);
            let texts: Vec<_> = values.iter().map(|v| (x.at(*v), number(*v, digits))).collect();
            let apart = |w: &[(f64, String)]| w[1].0 - w[0].0 > 0.5 * (width(&w[0].1, size) + width(&w[1].1, size)) + 0.8 * size;
            if count == 1 || texts.windows(2).all(apart) {
                for (at, text) in texts {
                    canvas.line((at, bar.bottom), (at, bar.bottom + 2.0), "#111", 0.5);
                    canvas.text(at, bar.bottom + 2.0 + 0.6 * size, size, Anchor::Middle, &text);
                }
                break;
            }
        }
        let mut end = bar.bottom + 2.0 + 1.3 * size;
        if self.missing {
            let box_ = Area { left, top: end, right: left + 1.6 * size, bottom: end + size };
            hatch(&mut canvas.out, box_);
            canvas.frame(box_);
            canvas.text(box_.right + 3.0, end + 0.5 * size, size, Anchor::Start, "no value");
            end += 1.4 * size;
        }
        canvas.out.push_str("</g>\n");
        end
    }
}

fn rectangle(out: &mut String, x: f64, y: f64, width: f64, height: f64, fill: &str) {
    let _ = writeln!(out, r#"<rect x="{x:.3}" y="{y:.3}" width="{width:.3}" height="{height:.3}" fill="{fill}"/>"#);
}

/// Draws a white cell with hatching.
fn hatch(out: &mut String, area: Area) {
    rectangle(out, area.left, area.top, area.width(), area.height(), "#fff");
    let (width, height) = (area.width(), area.height());
    let mut path = String::new();
    let mut along = 3.0;
    // Lines x + y = along, from one edge of the cell to another.
    while along < width + height {
        let (x0, y0) = (f64::min(along, width), f64::max(along - width, 0.0));
        let (x1, y1) = (f64::max(along - height, 0.0), f64::min(along, height));
        let _ = write!(path, "M{:.2} {:.2}L{:.2} {:.2}", area.left + x0, area.top + y0, area.left + x1, area.top + y1);
        along += 4.0;
    }
    let _ = writeln!(out, r##"<path class="missing" d="{path}" fill="none" stroke="#888" stroke-width="0.5"/>"##);
}

/// Values over two axes, rows × columns from the bottom row; missing values are hatched.
#[derive(Debug, Clone)]
pub(super) struct Cells {
    pub x: Categories,
    pub y: Categories,
    pub values: Vec<Option<f64>>,
    pub key: Key,
}

impl Cells {
    /// Draws the cells.
    pub fn draw(&self, out: &mut String, area: Area) {
        let (columns, rows) = (self.x.texts.len().max(1), self.y.texts.len().max(1));
        let (wide, high) = (area.width() / columns as f64, area.height() / rows as f64);
        let value =
            |row: usize, column: usize| self.values.get(row * columns + column).copied().flatten().filter(|v| v.is_finite());
        out.push_str("<g class=\"cells\">\n");
        // A cell extends below its right and lower neighbours, drawn later, to avoid seams.
        for row in (0..rows).rev() {
            let top = area.bottom - (row + 1) as f64 * high;
            for column in 0..columns {
                let left = area.left + column as f64 * wide;
                if let Some(v) = value(row, column) {
                    let (right, bottom) = ((left + 1.5 * wide).min(area.right), (top + 1.5 * high).min(area.bottom));
                    rectangle(out, left, top, right - left, bottom - top, &colour(self.key.share(v)));
                } else {
                    hatch(out, Area { left, top, right: left + wide, bottom: top + high });
                }
            }
        }
        out.push_str("</g>\n");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lighter_is_more() {
        let lightness = |share: f64| {
            let text = colour(share);
            let channel = |i: usize| f64::from(u8::from_str_radix(&text[i..i + 2], 16).unwrap());
            0.2126 * channel(1) + 0.7152 * channel(3) + 0.0722 * channel(5)
        };
        assert!((0..50).all(|i| lightness(f64::from(i) / 50.0) < lightness(f64::from(i + 1) / 50.0)));
    }
}
