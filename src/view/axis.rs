//! Axes: maps from values to the page, and ticks.

/// An axis: a linear map from a range of values to a range of the page (pt).
#[derive(Debug, Clone, Copy)]
pub(super) struct Scale {
    pub low: f64,
    pub high: f64,
    from: f64,
    to: f64,
}

impl Scale {
    /// The range of the values, extended by the share `margin` at both ends, or around a single value.
    pub fn over(values: impl Iterator<Item = f64>, margin: f64) -> Self {
        let (mut low, mut high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        if low > high {
            (low, high) = (0.0, 1.0);
        }
        let (spread, size) = (high - low, high.abs().max(low.abs()));
        let pad = if spread > 1e-9 * size.max(1e-80) { margin * spread } else { 0.5 * size.max(1e-9) };
        Self { low: low - pad, high: high + pad, from: 0.0, to: 1.0 }
    }

    /// Widens to `range`, upwards if `keep_low`, otherwise about the middle.
    pub fn widen(&mut self, range: f64, keep_low: bool) {
        let low = if keep_low { self.low } else { 0.5 * (self.low + self.high - range) };
        (self.low, self.high) = (low, low + range);
    }

    /// Sets the range of the page (pt).
    pub fn place(&mut self, from: f64, to: f64) {
        (self.from, self.to) = (from, to);
    }

    /// Position of a value on the page (pt).
    pub fn at(&self, value: f64) -> f64 {
        self.from + (value - self.low) / (self.high - self.low) * (self.to - self.from)
    }

    /// Length of the range of values.
    pub fn range(&self) -> f64 {
        self.high - self.low
    }

    /// About `count` round values, and their digits after the point.
    pub fn ticks(&self, count: usize) -> (Vec<f64>, usize) {
        ticks(self.low, self.high, count)
    }
}

/// At most about `count` multiples of 1, 2 or 5 times a power of ten within a range, and their digits after the point.
pub(super) fn ticks(low: f64, high: f64, count: usize) -> (Vec<f64>, usize) {
    let rough = (high - low) / count as f64;
    // Smaller steps underflow.
    if rough < 1e-290 {
        return (vec![low], 0);
    }
    let power = rough.log10().floor();
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * 10f64.powf(power)).find(|step| *step >= rough * (1.0 - 1e-9));
    let step = step.unwrap_or(rough);
    let digits = (-(step * (1.0 + 1e-9)).log10().floor()).max(0.0) as usize;
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    ((first..=last).map(|i| i as f64 * step).collect(), digits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks(-0.4, 10.4, 6), (vec![0.0, 2.0, 4.0, 6.0, 8.0, 10.0], 0));
        let (values, digits) = ticks(0.0031, 0.0099, 8);
        assert_eq!(digits, 3);
        assert_eq!(ticks(0.0, 5e-324, 5).0, [0.0]);
        assert!(values.iter().zip([0.004, 0.005, 0.006, 0.007, 0.008, 0.009]).all(|(a, b)| (a - b).abs() < 1e-12));
    }
}
