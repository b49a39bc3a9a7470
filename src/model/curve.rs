//! A smooth curve through the origin, linear in its values.

/// Points on each side of the origin.
pub const CURVE_POINTS: usize = 5;

/// A piecewise cubic with a continuous slope (Catmull and Rom 1974) through the origin and [`CURVE_POINTS`] equidistant points on each side; beyond
/// them it goes on straight. On a warped axis the points are equidistant in `asinh(x/warp)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Curve {
    /// Abscissa of the last point on the negative and on the positive side, as distances from the origin; 0 for a side without points.
    pub ends: [f64; 2],
    /// Values on the negative and on the positive side, from the origin outwards.
    pub values: [[f64; CURVE_POINTS]; 2],
    /// Abscissa about which the axis changes from linear to logarithmic; infinite for a linear axis.
    pub warp: f64,
}

impl Curve {
    /// 0 everywhere.
    pub const ZERO: Self = Self { ends: [0.0; 2], values: [[0.0; CURVE_POINTS]; 2], warp: f64::INFINITY };

    /// An odd curve with its last points at ±`end`.
    pub fn odd(end: f64, values: [f64; CURVE_POINTS], warp: f64) -> Self {
        Self { ends: [end; 2], values: [values.map(|value| -value), values], warp }
    }

    /// True if it is 0 everywhere.
    pub fn is_zero(&self) -> bool {
        self.values.as_flattened().iter().all(|value| *value == 0.0)
    }

    /// Largest absolute value of a point.
    pub fn largest(&self) -> f64 {
        self.values.as_flattened().iter().fold(0.0, |largest, value| value.abs().max(largest))
    }

    /// The steepest rise between the last points.
    pub fn steepest(&self) -> f64 {
        const SAMPLES: i32 = 16;
        let slopes = (-SAMPLES..=SAMPLES).map(|at| {
            let share = f64::from(at) / f64::from(SAMPLES);
            let end = self.ends[usize::from(at > 0)];
            let x = if self.warp.is_finite() { self.warp * (share * (end / self.warp).asinh()).sinh() } else { share * end };
            self.at(x)[1]
        });
        slopes.fold(0.0, f64::max)
    }

    /// Coordinate on the axis, and its derivative.
    fn warped(&self, x: f64) -> [f64; 2] {
        if self.warp.is_finite() {
            [self.warp * (x / self.warp).asinh(), 1.0 / (1.0 + (x / self.warp).powi(2)).sqrt()]
        } else {
            [x, 1.0]
        }
    }

    /// Value and slope at `x`.
    pub fn at(&self, x: f64) -> [f64; 2] {
        let steps = self.ends.map(|end| self.warped(end)[0] / CURVE_POINTS as f64);
        let [below, above] = [self.values[0][0], self.values[1][0]];
        // The slope at the origin, and that of a curve with one side only.
        let width = steps[0] + steps[1];
        if width == 0.0 {
            return [0.0; 2];
        }
        let origin = (above - below) / width;
        let [s, ds] = self.warped(x);
        let side = usize::from(s > 0.0);
        let (step, values) = (steps[side], &self.values[side]);
        let distance = s.abs();
        if step == 0.0 {
            return [origin * s, origin * ds];
        }
        let sign = if side == 1 { 1.0 } else { -1.0 };
        let value = |k: usize| if k == 0 { 0.0 } else { values[k - 1] };
        let slope = |k: usize| match k {
            0 => sign * origin * step,
            CURVE_POINTS => value(k) - value(k - 1),
            _ => 0.5 * (value(k + 1) - value(k - 1)),
        };
        let k = (distance / step) as usize;
        let (y, outward) = if k >= CURVE_POINTS {
            let last = slope(CURVE_POINTS);
            (value(CURVE_POINTS) + last * (distance / step - CURVE_POINTS as f64), last)
        } else {
            let t = distance / step - k as f64;
            let (a, b, p, q) = (value(k), value(k + 1), slope(k), slope(k + 1));
            let cubic = [a, p, 3.0 * (b - a) - 2.0 * p - q, 2.0 * (a - b) + p + q];
            (cubic[0] + t * (cubic[1] + t * (cubic[2] + t * cubic[3])), cubic[1] + t * (2.0 * cubic[2] + 3.0 * t * cubic[3]))
        };
        [y, sign * outward / step * ds]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn straight_lines_and_the_values_of_points_are_exact_and_the_slope_is_the_derivative() {
        let line =
            Curve { ends: [2.0, 6.0], values: [[-0.4, -0.8, -1.2, -1.6, -2.0], [1.2, 2.4, 3.6, 4.8, 6.0]], warp: f64::INFINITY };
        for x in [-5.0, -1.3, 0.0, 0.7, 6.0, 9.0] {
            let [y, slope] = line.at(x);
            assert!((y - x).abs() < 1e-12 && (slope - 1.0).abs() < 1e-12, "{x}: {y}, {slope}");
        }
        let bent = Curve { ends: [4.0, 8.0], values: [[-1.0, 0.5, 0.1, 2.0, -3.0], [0.3, 1.0, -2.0, 4.0, 5.0]], warp: 0.7 };
        for x in [-6.0, -3.1, -0.4, 0.2, 1.9, 7.0, 11.0] {
            let difference = (bent.at(x + 1e-6)[0] - bent.at(x - 1e-6)[0]) / 2e-6;
            assert!((bent.at(x)[1] - difference).abs() < 1e-6 * (1.0 + difference.abs()), "{x}");
        }
        assert!((bent.at(8.0)[0] - 5.0).abs() < 1e-12 && (bent.at(-4.0)[0] + 3.0).abs() < 1e-12);
        let odd = Curve::odd(3.0, [1.0, 2.0, 2.5, 2.6, 2.6], 0.1);
        assert!((odd.at(1.7)[0] + odd.at(-1.7)[0]).abs() < 1e-15);
    }
}
