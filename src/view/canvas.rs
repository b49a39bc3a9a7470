//! The page of a figure: its size, texts, lines and boxes.

use std::fmt::Write;

use super::text::{FAMILY, escape, minus_signs, shorten};

/// Points (1/72 inch) per millimetre. The unit of a figure is the point.
pub(super) const PT_PER_MM: f64 = 72.0 / 25.4;

/// Physical size of a figure: width and font size; the height follows from the contents.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Size {
    /// Width (mm).
    pub width_mm: f64,
    /// Font size of all texts but the title (pt).
    pub font_pt: f64,
}

impl Size {
    /// One column of a journal: 85 mm, 8 pt.
    pub const SINGLE: Self = Self { width_mm: 85.0, font_pt: 8.0 };
    /// Two columns of a journal: 175 mm, 8 pt.
    pub const DOUBLE: Self = Self { width_mm: 175.0, font_pt: 8.0 };
    /// A page on a screen: 170 mm (643 CSS px), 9.5 pt.
    pub const SCREEN: Self = Self { width_mm: 170.0, font_pt: 9.5 };

    /// Width (pt).
    pub(super) fn width(self) -> f64 {
        self.width_mm * PT_PER_MM
    }
}

/// The part of a text at its position: left end, middle or right end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

impl Anchor {
    fn attribute(self) -> &'static str {
        match self {
            Self::Start => "",
            Self::Middle => r#" text-anchor="middle""#,
            Self::End => r#" text-anchor="end""#,
        }
    }
}

/// A buffer for an SVG; its unit is the point.
#[derive(Debug, Default)]
pub(super) struct Canvas {
    pub out: String,
}

impl Canvas {
    /// Adds a text with its middle line at `y`.
    pub fn text(&mut self, x: f64, y: f64, size: f64, anchor: Anchor, text: &str) {
        let _ = writeln!(
            self.out,
            r#"<text x="{x:.2}" y="{:.2}" font-size="{size}"{}>{}</text>"#,
            y + 0.36 * size,
            anchor.attribute(),
            escape(&minus_signs(text))
        );
    }

    /// Adds a text with a white outline, for texts on data.
    pub fn note(&mut self, x: f64, y: f64, size: f64, text: &str) {
        let _ = writeln!(
            self.out,
            r##"<text x="{x:.2}" y="{:.2}" font-size="{size}" stroke="#fff" stroke-width="2" paint-order="stroke">{}</text>"##,
            y + 0.36 * size,
            escape(&minus_signs(text))
        );
    }

    /// Adds a text turned by 90°, centred on `(x, y)`.
    pub fn upright(&mut self, x: f64, y: f64, size: f64, text: &str) {
        let _ = writeln!(
            self.out,
            r#"<text transform="translate({:.2} {y:.2}) rotate(-90)" font-size="{size}" text-anchor="middle">{}</text>"#,
            x + 0.36 * size,
            escape(&minus_signs(text))
        );
    }

    /// Adds a line of a width (pt).
    pub fn line(&mut self, from: (f64, f64), to: (f64, f64), colour: &str, width: f64) {
        let _ = writeln!(
            self.out,
            r#"<line x1="{:.2}" y1="{:.2}" x2="{:.2}" y2="{:.2}" stroke="{colour}" stroke-width="{width}"/>"#,
            from.0, from.1, to.0, to.1
        );
    }

    /// Adds the frame of a pair of axes.
    pub fn frame(&mut self, area: Area) {
        let _ = writeln!(
            self.out,
            r##"<rect class="frame" x="{:.2}" y="{:.2}" width="{:.2}" height="{:.2}" fill="none" stroke="#111" stroke-width="0.6"/>"##,
            area.left,
            area.top,
            area.width(),
            area.height()
        );
    }

    /// Adds the floor: a line with hatching below it.
    pub fn floor(&mut self, left: f64, right: f64, y: f64) {
        self.out.push_str(r#"<g class="floor">"#);
        self.line((left, y), (right, y), "#111", 0.9);
        let mut path = String::new();
        let mut x = left + HATCH_STEP;
        while x <= right {
            let _ = write!(path, "M{x:.2} {y:.2}l-{HATCH} {HATCH}");
            x += HATCH_STEP;
        }
        let _ = writeln!(self.out, r##"<path d="{path}" fill="none" stroke="#111" stroke-width="0.5"/></g>"##);
    }

    /// The SVG document of a given height (pt).
    pub fn document(self, size: Size, height: f64, title: &str) -> String {
        let width = size.width();
        let mm = height / PT_PER_MM;
        let family = FAMILY;
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}mm\" height=\"{mm:.3}mm\" viewBox=\"0 0 {width:.3} {height:.3}\" \
             font-family=\"{family}\" font-size=\"{}\" fill=\"#111\">\n<title>{}</title>\n<rect width=\"{width:.3}\" height=\"{height:.3}\" fill=\"#fff\"/>\n{}</svg>\n",
            size.width_mm,
            size.font_pt,
            escape(&minus_signs(&shorten(title, 1.0, 500.0))),
            self.out
        )
    }
}

/// Length of the hatch lines (pt).
pub(super) const HATCH: f64 = 3.0;
/// Distance of the hatch lines (pt).
const HATCH_STEP: f64 = 4.0;

/// A rectangle on the page (pt).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Area {
    pub left: f64,
    pub top: f64,
    pub right: f64,
    pub bottom: f64,
}

impl Area {
    /// Width (pt).
    pub fn width(self) -> f64 {
        self.right - self.left
    }

    /// Height (pt).
    pub fn height(self) -> f64 {
        self.bottom - self.top
    }
}
