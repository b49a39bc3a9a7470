//! Formatted numbers for pages, figures and Markdown tables: a true minus sign, no negative zero, significant digits.
//!
//! Files for programs have Rust's plain formats.

/// Text for a missing value.
pub const NONE: &str = "–";

/// `value` with `digits` after the point.
///
/// ```
/// use sfers::number::fixed;
/// assert_eq!(fixed(-18.994, 2), "−18.99");
/// assert_eq!(fixed(-0.001, 2), "0.00");
/// assert_eq!(fixed(f64::NAN, 2), "–");
/// ```
pub fn fixed(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return NONE.into();
    }
    let text = format!("{:.digits$}", value.abs());
    let is_zero = text.chars().all(|c| c == '0' || c == '.');
    if value < 0.0 && !is_zero { format!("−{text}") } else { text }
}

/// As [`fixed`], with a plus sign before positive values, for differences.
///
/// ```
/// use sfers::number::signed;
/// assert_eq!((signed(0.5, 1), signed(-0.5, 1), signed(-0.01, 1)), ("+0.5".into(), "−0.5".into(), "0.0".into()));
/// ```
pub fn signed(value: f64, digits: usize) -> String {
    let text = fixed(value, digits);
    let is_positive = value > 0.0 && text.chars().any(|c| ('1'..='9').contains(&c));
    if is_positive { format!("+{text}") } else { text }
}

/// `value` with `count` significant digits, as a power of ten below 10⁻⁵ and from 10⁷.
///
/// ```
/// use sfers::number::significant;
/// assert_eq!(significant(-0.0123456, 3), "−0.0123");
/// assert_eq!(significant(18123.0, 3), "18123");
/// assert_eq!(significant(4.2e-9, 2), "4.2·10⁻⁹");
/// ```
pub fn significant(value: f64, count: usize) -> String {
    if !value.is_finite() || value == 0.0 {
        return fixed(value, 0);
    }
    let exponent = value.abs().log10().floor() as i32;
    if (-5..7).contains(&exponent) {
        return fixed(value, (count as i32 - 1 - exponent).max(0) as usize);
    }
    let power: String = exponent.to_string().chars().map(superscript).collect();
    format!("{}·10{power}", fixed(value / 10f64.powi(exponent), count.saturating_sub(1)))
}

fn superscript(c: char) -> char {
    match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        _ => c.to_digit(10).and_then(|digit| char::from_u32(0x2070 + digit)).unwrap_or(c),
    }
}

/// Digits after the point, at most six, that show two significant digits of `spread`, the uncertainty of a value.
pub fn digits_for(spread: f64) -> usize {
    if spread.is_finite() && spread > 0.0 { (1 - spread.log10().floor() as i32).clamp(0, 6) as usize } else { 4 }
}

/// A text with true minus signs for the hyphens before numbers; hyphens within words are kept.
///
/// ```
/// use sfers::number::minus;
/// assert_eq!(minus("step-1000v: (-3.5 to -.2)"), "step-1000v: (−3.5 to −.2)");
/// ```
pub fn minus(text: &str) -> String {
    let chars: Vec<char> = text.chars().collect();
    let before = |i: usize| i == 0 || !(chars[i - 1].is_alphanumeric() || ")]_-".contains(chars[i - 1]));
    let after = |i: usize| chars.get(i + 1).is_some_and(|c| c.is_ascii_digit() || *c == '.');
    chars.iter().enumerate().map(|(i, &c)| if c == '-' && before(i) && after(i) { '−' } else { c }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn no_number_has_a_hyphen_or_is_a_negative_zero(value in prop::num::f64::ANY, digits in 0..7_usize) {
            for text in [fixed(value, digits), signed(value, digits), significant(value, digits + 1)] {
                prop_assert!(!text.contains('-'), "{text}");
                let is_zero = text.contains('0') && !text.chars().any(|c| ('1'..='9').contains(&c));
                prop_assert!(!is_zero || text.starts_with('0'), "{text}");
            }
        }
    }

    #[test]
    fn a_range_shows_two_digits_of_its_width() {
        assert_eq!([digits_for(0.02), digits_for(3.0), digits_for(250.0), digits_for(1e-12)], [3, 1, 0, 6]);
    }
}
