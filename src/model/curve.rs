//! A smooth curve through the origin, linear in its values.

/// Points on each side of the origin of a joint's curves.
pub const CURVE_POINTS: usize = 5;

/// A piecewise cubic with a continuous slope through the origin and `POINTS` points on each side; beyond them it goes on straight. The slope at
/// a point is that of the parabola through it and its neighbours (Catmull and Rom 1974 for equidistant points), at the origin that of the chord
/// between its neighbours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Curve<const POINTS: usize = CURVE_POINTS> {
    /// Negative and positive side.
    sides: [Side<POINTS>; 2],
    is_zero: bool,
}

/// One side, by the distance from the origin.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Side<const POINTS: usize> {
    /// Distances of the points, from the origin outwards; 0 for a side without points.
    knots: [f64; POINTS],
    /// Values there.
    values: [f64; POINTS],
    /// Coefficients of the cubics between the points, in the distance from the inner one.
    cubics: [[f64; 4]; POINTS],
    /// Slope beyond the last point, over the distance.
    last: f64,
}

impl<const POINTS: usize> Side<POINTS> {
    const EMPTY: Self = Self { knots: [0.0; POINTS], values: [0.0; POINTS], cubics: [[0.0; 4]; POINTS], last: 0.0 };

    /// A side with its slope at the origin over the distance.
    fn new(knots: [f64; POINTS], values: [f64; POINTS], origin: f64) -> Self {
        if knots[0] == 0.0 {
            return Self { last: origin, ..Self::EMPTY };
        }
        let at = |k: usize| if k == 0 { [0.0; 2] } else { [knots[k - 1], values[k - 1]] };
        let width = |k: usize| at(k + 1)[0] - at(k)[0];
        let secant = |k: usize| (at(k + 1)[1] - at(k)[1]) / width(k);
        let slope = |k: usize| match k {
            0 => origin,
            _ if k == POINTS => secant(POINTS - 1),
            _ => (width(k) * secant(k - 1) + width(k - 1) * secant(k)) / (width(k - 1) + width(k)),
        };
        let cubic = |k: usize| {
            let (h, rise, p, q) = (width(k), secant(k), slope(k), slope(k + 1));
            [at(k)[1], p, (3.0 * rise - 2.0 * p - q) / h, (p + q - 2.0 * rise) / (h * h)]
        };
        Self { knots, values, cubics: std::array::from_fn(cubic), last: slope(POINTS) }
    }

    /// Value and slope at a distance.
    fn at(&self, distance: f64) -> [f64; 2] {
        let end = self.knots[POINTS - 1];
        if distance >= end {
            return [self.values[POINTS - 1] + self.last * (distance - end), self.last];
        }
        let k = self.knots.iter().take_while(|knot| distance >= **knot).count();
        let t = distance - if k == 0 { 0.0 } else { self.knots[k - 1] };
        let [a, b, c, d] = self.cubics[k];
        [a + t * (b + t * (c + t * d)), b + t * (2.0 * c + 3.0 * t * d)]
    }
}

impl<const POINTS: usize> Curve<POINTS> {
    /// 0 everywhere.
    pub const ZERO: Self = Self { sides: [Side::EMPTY; 2], is_zero: true };

    /// A curve through the points at `knots` (distances from the origin, from there outwards; 0 for a side without points) on the negative and the
    /// positive side, with its `values` there.
    pub fn new(knots: [[f64; POINTS]; 2], values: [[f64; POINTS]; 2]) -> Self {
        let width = knots[0][0] + knots[1][0];
        let first = |side: usize| if knots[side][0] > 0.0 { values[side][0] } else { 0.0 };
        let origin = if width > 0.0 { (first(1) - first(0)) / width } else { 0.0 };
        let sides = [Side::new(knots[0], values[0], -origin), Side::new(knots[1], values[1], origin)];
        Self { sides, is_zero: largest(&sides) == 0.0 }
    }

    /// A curve through equidistant points up to the distances `ends` on the negative and the positive side; 0 for a side without points.
    pub fn equidistant(ends: [f64; 2], values: [[f64; POINTS]; 2]) -> Self {
        Self::new(ends.map(|end| std::array::from_fn(|k| end * (k + 1) as f64 / POINTS as f64)), values)
    }

    /// An odd curve up to ±`end`, whose points are equidistant in asinh(x/`warp`): they are close together about the origin. 0 everywhere if `end` is 0.
    pub fn odd(end: f64, values: [f64; POINTS], warp: f64) -> Self {
        if end == 0.0 {
            return Self::ZERO;
        }
        let step = (end / warp).asinh() / POINTS as f64;
        let knots = std::array::from_fn(|k| if k + 1 == POINTS { end } else { warp * (step * (k + 1) as f64).sinh() });
        Self::new([knots; 2], [values.map(|value| -value), values])
    }

    /// Distances of the last points on the negative and the positive side from the origin; 0 for a side without points.
    pub fn ends(&self) -> [f64; 2] {
        [0, 1].map(|side| self.sides[side].knots[POINTS - 1])
    }

    /// True if it is 0 everywhere.
    pub fn is_zero(&self) -> bool {
        self.is_zero
    }

    /// Largest absolute value of a point.
    pub fn largest(&self) -> f64 {
        largest(&self.sides)
    }

    /// The steepest rise between the last points: a cubic is steepest at its ends or where its second derivative is 0.
    pub fn steepest(&self) -> f64 {
        let of = |(sign, side): (f64, &Side<POINTS>)| {
            let mut steepest = (sign * side.last).max(0.0);
            let mut inner = 0.0;
            for (outer, [_, b, c, d]) in side.knots.iter().zip(side.cubics) {
                let width = outer - inner;
                for t in [0.0, (-c / (3.0 * d)).clamp(0.0, width), width] {
                    // An infinite or missing turning point is none.
                    if t.is_finite() {
                        steepest = steepest.max(sign * (b + t * (2.0 * c + 3.0 * t * d)));
                    }
                }
                inner = *outer;
            }
            steepest
        };
        [-1.0, 1.0].into_iter().zip(&self.sides).map(of).fold(0.0, f64::max)
    }

    /// Value and slope at `x`.
    pub fn at(&self, x: f64) -> [f64; 2] {
        let [value, slope] = self.sides[usize::from(x > 0.0)].at(x.abs());
        [value, if x > 0.0 { slope } else { -slope }]
    }
}

fn largest<const POINTS: usize>(sides: &[Side<POINTS>; 2]) -> f64 {
    sides.iter().flat_map(|side| side.values).fold(0.0, |largest, value| value.abs().max(largest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn straight_lines_and_the_values_of_points_are_exact_and_the_slope_is_the_derivative() {
        let line = Curve::equidistant([2.0, 6.0], [[-0.4, -0.8, -1.2, -1.6, -2.0], [1.2, 2.4, 3.6, 4.8, 6.0]]);
        for x in [-5.0, -1.3, 0.0, 0.7, 6.0, 9.0] {
            let [y, slope] = line.at(x);
            assert!((y - x).abs() < 1e-12 && (slope - 1.0).abs() < 1e-12, "{x}: {y}, {slope}");
        }
        let bent = Curve::new(
            [[0.1, 0.5, 1.0, 2.0, 4.0], [0.3, 0.8, 2.0, 4.5, 8.0]],
            [[-1.0, 0.5, 0.1, 2.0, -3.0], [0.3, 1.0, -2.0, 4.0, 5.0]],
        );
        let mut steepest = 0.0_f64;
        for k in -6000..12_000 {
            let x = 1e-3 * f64::from(k) + 5e-4;
            let [_, slope] = bent.at(x);
            let difference = (bent.at(x + 1e-6)[0] - bent.at(x - 1e-6)[0]) / 2e-6;
            assert!((slope - difference).abs() < 1e-4 * (1.0 + difference.abs()), "{x}: {slope} {difference}");
            steepest = steepest.max(slope);
        }
        assert!((bent.steepest() / steepest - 1.0).abs() < 1e-3, "{} {steepest}", bent.steepest());
        assert!((bent.at(8.0)[0] - 5.0).abs() < 1e-12 && (bent.at(-4.0)[0] + 3.0).abs() < 1e-12);
        let odd = Curve::odd(3.0, [1.0, 2.0, 2.5, 2.6, 2.6], 0.1);
        assert!((odd.at(1.7)[0] + odd.at(-1.7)[0]).abs() < 1e-15);
        // A curve without extent is none, not one of numbers that are none.
        let nowhere = Curve::odd(0.0, [1.0; CURVE_POINTS], 0.0);
        assert!(nowhere.is_zero() && nowhere.at(2.0) == [0.0; 2] && nowhere.steepest() == 0.0);
    }

    #[test]
    fn a_side_without_points_goes_on_straight() {
        let half = Curve::equidistant([0.0, 5.0], [[0.0; 5], [2.0, 4.0, 6.0, 8.0, 10.0]]);
        assert!((half.at(-3.0)[0] + 6.0).abs() < 1e-12 && (half.at(2.5)[0] - 5.0).abs() < 1e-12);
        assert!(Curve::<8>::ZERO.is_zero() && Curve::<8>::ZERO.at(3.0) == [0.0; 2]);
    }
}
