//! Text: width in the embedded font, line breaks, minus signs, XML.

use std::sync::OnceLock;

pub(super) use crate::number::minus as minus_signs;
pub(crate) use crate::xml::escape;

/// Fonts of an SVG. The layout assumes the first, which PNG, PDF and GIF embed; the others are narrower.
pub(super) const FAMILY: &str = "'DejaVu Sans', Arial, Helvetica, sans-serif";

/// The font of PNG, PDF and GIF, as TrueType.
pub(super) fn font() -> &'static [u8] {
    dejavu::sans::regular()
}

/// Width of a text at a font size, in the unit of the size.
pub(super) fn width(text: &str, size: f64) -> f64 {
    static FACE: OnceLock<Option<ttf_parser::Face<'static>>> = OnceLock::new();
    let face = FACE.get_or_init(|| ttf_parser::Face::parse(font(), 0).ok());
    let Some(face) = face else { return 0.7 * size * text.chars().count() as f64 };
    let advance = |c: char| face.glyph_index(c).and_then(|glyph| face.glyph_hor_advance(glyph));
    // A glyph from a fallback font is at most an em wide.
    let units = f64::from(face.units_per_em());
    text.chars().map(|c| advance(c).map_or(units, f64::from)).sum::<f64>() * size / units
}

/// The text in lines no wider than `most`, broken at spaces; longer words are shortened.
pub(super) fn wrap(text: &str, size: f64, most: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if width(&format!("{line} {word}"), size) <= most => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(shorten(word, size, most)),
        }
    }
    lines
}

/// The text, shortened with an ellipsis if it is wider than `most`.
pub(super) fn shorten(text: &str, size: f64, most: f64) -> String {
    if width(text, size) <= most {
        return text.to_owned();
    }
    let mut kept: Vec<char> = text.chars().collect();
    while kept.pop().is_some() {
        let short: String = kept.iter().chain(['…'].iter()).collect();
        if width(&short, size) <= most {
            return short;
        }
    }
    String::new()
}

/// A number with `digits` after the point, a true minus sign and no negative zero.
pub(super) fn number(value: f64, digits: usize) -> String {
    if digits > 6 || value.abs() >= 1e7 {
        return format!("{value:.1e}").replace('-', "−");
    }
    super::fixed(value, digits)
}

/// A number with about `digits` significant digits, without trailing zeros.
pub(super) fn significant(value: f64, digits: i32) -> String {
    if value == 0.0 || !value.is_finite() {
        return "0".into();
    }
    let power = value.abs().log10().floor() as i32;
    if !(-5..=8).contains(&power) {
        return format!("{value:.*e}", (digits - 1).max(0) as usize).replace('-', "−");
    }
    let places = (digits - 1 - power).max(0) as usize;
    let text = format!("{value:.places$}").replace('-', "−");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_true_minus_signs_and_zeros_have_none() {
        assert_eq!(number(-0.0, 2), "0.00");
        assert_eq!(number(-0.004, 2), "0.00");
        assert_eq!(number(-1.5, 1), "−1.5");
        assert_eq!(significant(-0.0, 3), "0");
        assert_eq!(significant(13.96, 3), "14");
        assert_eq!(significant(0.033, 6), "0.033");
        assert_eq!(significant(-1500.0, 3), "−1500");
        assert_eq!(minus_signs("jump-14hz at -1500 V, (-3, -.5)"), "jump-14hz at −1500 V, (−3, −.5)");
    }

    #[test]
    fn text_is_broken_into_lines_that_fit() {
        let lines = wrap("In-place jumping of five actuators at 14 Hz and an-extremely-long-word-without-any-space", 8.0, 120.0);
        assert!(lines.len() > 2 && lines.iter().all(|line| width(line, 8.0) <= 120.0), "{lines:?}");
        assert!(lines.last().unwrap().ends_with('…'));
        // DejaVu Sans: an "m" is 0.974 em wide.
        assert!((width("m", 10.0) - 9.74).abs() < 0.01);
    }
}
