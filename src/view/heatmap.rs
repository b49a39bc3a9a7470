//! A value over two others, as SVG.

use std::fmt::Write;

use super::figure::{escape, frame, number, open, ticks};

/// Colours of equal steps in lightness from dark to light, so that they stay in order in grey (after viridis).
const COLOURS: [[f64; 3]; 6] = [
    [68.0, 1.0, 84.0],
    [65.0, 68.0, 135.0],
    [42.0, 120.0, 142.0],
    [34.0, 168.0, 132.0],
    [122.0, 209.0, 81.0],
    [253.0, 231.0, 37.0],
];

/// A colour of the scale, at a share from 0 to 1.
pub fn colour(share: f64) -> String {
    let at = share.clamp(0.0, 1.0) * (COLOURS.len() - 1) as f64;
    let low = (at as usize).min(COLOURS.len() - 2);
    let mix = |channel: usize| {
        let (a, b) = (COLOURS[low][channel], COLOURS[low + 1][channel]);
        (a + (at - low as f64) * (b - a)).round() as u8
    };
    format!("#{:02x}{:02x}{:02x}", mix(0), mix(1), mix(2))
}

/// An axis of a heat map: label and the text of each column or row.
#[derive(Debug, Clone)]
pub struct Categories {
    /// Label with its unit.
    pub label: String,
    /// One text per column or row.
    pub texts: Vec<String>,
}

/// Draws `values`, row after row from the bottom; missing ones are hatched.
pub fn heat_map(title: &str, label: &str, x: &Categories, y: &Categories, values: &[Option<f64>]) -> String {
    let (left, top, right, bottom) = (76.0, 34.0, 540.0, 350.0);
    let (columns, rows) = (x.texts.len().max(1), y.texts.len().max(1));
    let known = || values.iter().flatten().copied().filter(|v| v.is_finite());
    let (mut low, mut high) = known().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    if low > high {
        (low, high) = (0.0, 1.0);
    }
    if low == high {
        (low, high) = (low - 0.5 * low.abs().max(1e-9), high + 0.5 * high.abs().max(1e-9));
    }
    let mut out = String::new();
    open(&mut out, 640.0, 400.0, title);
    out.push_str(
        r##"<pattern id="none" width="6" height="6" patternUnits="userSpaceOnUse"><path d="M0 6L6 0" stroke="#999"/></pattern>"##,
    );
    let (cell_x, cell_y) = ((right - left) / columns as f64, (bottom - top) / rows as f64);
    for row in 0..rows {
        for column in 0..columns {
            let value = values.get(row * columns + column).copied().flatten().filter(|v| v.is_finite());
            let fill = value.map_or_else(|| "url(#none)".into(), |v| colour((v - low) / (high - low)));
            // A hair wider than the cell, so that no seams show.
            let _ = writeln!(
                out,
                r#"<rect x="{:.2}" y="{:.2}" width="{:.2}" height="{:.2}" fill="{fill}"/>"#,
                left + column as f64 * cell_x,
                bottom - (row + 1) as f64 * cell_y,
                cell_x + 0.3,
                cell_y + 0.3
            );
        }
    }
    for (i, text) in x.texts.iter().enumerate().step_by(columns.div_ceil(10)) {
        let at = left + (i as f64 + 0.5) * cell_x;
        let _ = writeln!(out, r#"<text x="{at:.1}" y="{:.1}" text-anchor="middle">{}</text>"#, bottom + 16.0, escape(text));
    }
    for (i, text) in y.texts.iter().enumerate().step_by(rows.div_ceil(12)) {
        let at = bottom - (i as f64 + 0.5) * cell_y;
        let _ = writeln!(out, r#"<text x="{:.1}" y="{:.1}" text-anchor="end">{}</text>"#, left - 7.0, at + 4.0, escape(text));
    }
    for i in 0..64 {
        let share = f64::from(i) / 64.0;
        let y = bottom - (share + 1.0 / 64.0) * (bottom - top);
        let _ = writeln!(
            out,
            r#"<rect x="556" y="{y:.2}" width="18" height="{:.2}" fill="{}"/>"#,
            (bottom - top) / 64.0 + 0.3,
            colour(share)
        );
    }
    let (bar, digits) = ticks(low, high, 7);
    for tick in bar {
        let at = bottom - (tick - low) / (high - low) * (bottom - top);
        let _ = writeln!(out, r#"<text x="580" y="{:.1}">{}</text>"#, at + 4.0, number(tick, digits));
    }
    let _ = writeln!(
        out,
        r#"<text transform="translate(633 {}) rotate(-90)" text-anchor="middle" font-size="13">{}</text>"#,
        (top + bottom) / 2.0,
        escape(label)
    );
    frame(&mut out, [left, top, right, bottom], &x.label, &y.label);
    out.push_str("</svg>\n");
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_has_a_cell_per_value_and_hatches_what_is_missing() {
        let axis = |label: &str, n: usize| Categories { label: label.into(), texts: (0..n).map(|i| i.to_string()).collect() };
        let svg = heat_map("t", "v (mm)", &axis("x (s)", 2), &axis("y <", 2), &[Some(0.0), Some(1.0), None, Some(f64::NAN)]);
        let document = roxmltree::Document::parse(&svg).unwrap();
        let fills: Vec<_> = document.descendants().filter_map(|node| node.attribute("fill")).collect();
        assert_eq!(fills.iter().filter(|fill| **fill == "url(#none)").count(), 2);
        assert!(fills.contains(&"#440154") && fills.contains(&"#fde725"));
    }

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
