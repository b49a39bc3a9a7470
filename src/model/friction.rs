//! Friction as a free curve of the sliding speed, linear in its weights.

/// Points of the curve.
pub const FRICTION_POINTS: usize = 5;

/// A change of the coefficient of friction (–) against the sliding speed: linear between points at 0 and at 1/27, 1/9, 1/3 and 1 of its range, constant beyond.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrictionCurve {
    /// Speeds of the points (cm/s).
    speeds: [f64; FRICTION_POINTS],
    /// Changes there, as shares of the coefficient (–).
    changes: [f64; FRICTION_POINTS],
}

impl FrictionCurve {
    /// No change at any speed.
    pub const OFF: Self = Self { speeds: [0.0; FRICTION_POINTS], changes: [0.0; FRICTION_POINTS] };

    /// A curve with its `changes` up to the speed `range` (cm/s).
    pub fn new(range: f64, changes: [f64; FRICTION_POINTS]) -> Self {
        let shares = [0.0, 1.0 / 27.0, 1.0 / 9.0, 1.0 / 3.0, 1.0];
        Self { speeds: shares.map(|share| share * range), changes }
    }

    /// True if no speed changes the coefficient.
    pub fn is_off(&self) -> bool {
        self.changes == Self::OFF.changes
    }

    /// Speeds (cm/s) and changes (–) of its points.
    pub fn points(&self) -> [[f64; 2]; FRICTION_POINTS] {
        std::array::from_fn(|k| [self.speeds[k], self.changes[k]])
    }

    /// The coefficient at the sliding speed `v` (cm/s), from one that does not depend on it; 0 at least.
    pub fn friction(&self, plain: f64, v: f64) -> f64 {
        let v = v.abs();
        let above = self.speeds.iter().position(|speed| v < *speed);
        let change = match above {
            Some(k) if k > 0 => {
                let [low, high] = [self.speeds[k - 1], self.speeds[k]];
                let [from, to] = [self.changes[k - 1], self.changes[k]];
                from + (v - low) / (high - low) * (to - from)
            }
            _ => self.changes[FRICTION_POINTS - 1],
        };
        (plain * (1.0 + change)).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_met_lines_lie_between_them_and_the_last_value_goes_on() {
        let curve = FrictionCurve::new(27.0, [0.5, 0.1, -0.2, -1.0, 0.4]);
        for (v, factor) in [(0.0, 1.5), (-1.0, 1.1), (2.0, 0.95), (9.0, 0.0), (18.0, 0.7), (27.0, 1.4), (-500.0, 1.4)] {
            assert!((curve.friction(0.3, v) - 0.3 * factor).abs() < 1e-15, "{v}: {}", curve.friction(0.3, v));
        }
        assert!(FrictionCurve::OFF.is_off() && FrictionCurve::OFF.friction(0.3, 5.0) == 0.3);
        assert_eq!(FrictionCurve::new(3.0, [-3.0; FRICTION_POINTS]).friction(0.3, 1.0), 0.0);
    }
}
