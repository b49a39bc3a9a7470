//! The turn of a clamped root as a curve of the moment on it, linear in its weights.

/// Points of the curve, at equidistant moments over its range, which is as large to either side of 0.
pub const CLAMP_POINTS: usize = 7;
/// Pieces of the curve to either side.
const PIECES: usize = (CLAMP_POINTS - 1) / 2;
/// A compliance that is less than this share of the largest one counts as that, so that every turn has one moment.
const LEAST_SHARE: f64 = 1e-3;
/// Moment to either side over which the compliance changes where it has a jump (dyn·cm), far below what any sheet weighs on its clamp.
const KINK: f64 = 0.01;

/// A curve of the turn against the moment. Its slope, the compliance, is linear between points and constant beyond the last ones; no compliance is negative,
/// so the curve rises everywhere.
///
/// ```text
/// φ(M) = ∫ C(m) dm from 0 to M
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClampCurve {
    /// Distance between two points (dyn·cm).
    width: f64,
    /// Compliances at the points (rad/(dyn·cm)); all 0 for a rigid clamp.
    compliances: [f64; CLAMP_POINTS],
}

impl ClampCurve {
    /// The clamp that does not turn.
    pub const RIGID: Self = Self { width: 1.0, compliances: [0.0; CLAMP_POINTS] };

    /// A curve with its `compliances` (rad/(dyn·cm)) at equidistant moments from −`range` to `range` (dyn·cm). Negative ones and a range that is not positive count as
    /// none.
    pub fn new(range: f64, compliances: [f64; CLAMP_POINTS]) -> Self {
        let largest = compliances.into_iter().fold(0.0, f64::max);
        if largest == 0.0 || !(range > 0.0 && range.is_finite() && largest.is_finite()) {
            return Self::RIGID;
        }
        let compliances = compliances.map(|compliance| compliance.max(LEAST_SHARE * largest));
        Self { width: range / PIECES as f64, compliances }
    }

    /// A curve with a `compliance` (rad/(dyn·cm)) that is 1 + `asymmetry` times as large for positive moments and 1 − `asymmetry` times for negative
    /// ones, but at least a thousandth of the other side's.
    pub fn bilinear(compliance: f64, asymmetry: f64) -> Self {
        let [below, above] = [1.0 - asymmetry, 1.0 + asymmetry].map(|factor| compliance * factor);
        Self::new(PIECES as f64 * KINK, [below, below, below, compliance, above, above, above])
    }

    /// True if the clamp does not turn.
    pub fn is_rigid(&self) -> bool {
        self.largest() == 0.0
    }

    /// The largest compliance (rad/(dyn·cm)).
    pub fn largest(&self) -> f64 {
        self.compliances.into_iter().fold(0.0, f64::max)
    }

    /// The curve in series with a spring of a `compliance` (rad/(dyn·cm)): at one moment the turns add up.
    pub fn in_series(&self, compliance: f64) -> Self {
        Self { compliances: self.compliances.map(|own| own + compliance), ..*self }
    }

    /// Distance between two points (dyn·cm).
    pub fn width(&self) -> f64 {
        self.width
    }

    /// Compliances at the points (rad/(dyn·cm)).
    pub fn compliances(&self) -> [f64; CLAMP_POINTS] {
        self.compliances
    }

    /// The moment M (dyn·cm) that solves φ(M) + `added`·M = `turn` (rad), with `added` in rad/(dyn·cm). One of the two must turn.
    pub fn moment(&self, turn: f64, added: f64) -> f64 {
        let width = self.width;
        let at = |k: usize| self.compliances[if turn < 0.0 { PIECES - k } else { PIECES + k }] + added;
        let (mut rest, mut moment) = (turn.abs(), 0.0);
        for k in 0..PIECES {
            let [low, high] = [at(k), at(k + 1)];
            let whole = 0.5 * (low + high) * width;
            if rest < whole {
                // The smaller root of low·m + (high − low)·m²/(2·width) = rest.
                let curvature = (high - low) / width;
                return (moment + 2.0 * rest / (low + (low * low + 2.0 * curvature * rest).max(0.0).sqrt())).copysign(turn);
            }
            rest -= whole;
            moment += width;
        }
        (moment + rest / at(PIECES)).copysign(turn)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// φ(M) by the sum of trapezia, exact for a compliance that is linear between points.
    fn turn(curve: &ClampCurve, moment: f64) -> f64 {
        let Extents { at, beyond } = extents(curve, moment.abs());
        let mut c = curve.compliances();
        if moment < 0.0 {
            c.reverse();
        }
        let c = &c[PIECES..];
        let mut sum = beyond * c[PIECES];
        for (k, share) in at.into_iter().enumerate() {
            sum += curve.width() * share * (c[k] + 0.5 * share * (c[k + 1] - c[k]));
        }
        sum.copysign(moment)
    }

    struct Extents {
        at: [f64; PIECES],
        beyond: f64,
    }

    fn extents(curve: &ClampCurve, moment: f64) -> Extents {
        let at = std::array::from_fn(|k| (moment / curve.width() - k as f64).clamp(0.0, 1.0));
        Extents { at, beyond: (moment - curve.width() * PIECES as f64).max(0.0) }
    }

    #[test]
    fn the_moment_of_a_turn_solves_the_curve_on_every_piece() {
        for compliances in [
            [2e-7, 0.0, 1e-7, 1e-7, 3e-7, 2e-7, 5e-8],
            [1e-7, 1e-7, 0.0, 0.0, 0.0, 4e-7, 0.0],
            [0.0, 0.0, 5e-7, 5e-7, 0.0, 0.0, 1e-7],
            [2e-7; 7],
        ] {
            let curve = ClampCurve::new(3e4, compliances);
            for added in [0.0, 1e-9, 1e-6] {
                for k in -40..=40 {
                    let turn_of = |moment: f64| turn(&curve, moment) + added * moment;
                    let given = 1.5e3 * f64::from(k);
                    let found = curve.moment(turn_of(given), added);
                    // Where the compliance is a thousandth of the largest, rounding of the turn weighs a thousand times as much.
                    assert!((found - given).abs() < 1e-10 * 3e4, "{compliances:?} {added}: {found} not {given}");
                }
            }
        }
    }

    #[test]
    fn a_bilinear_curve_turns_by_another_compliance_to_either_side() {
        for (asymmetry, [below, above]) in [(0.6, [0.8e-7, 3.2e-7]), (-0.25, [2.5e-7, 1.5e-7]), (1.0, [4e-10, 4e-7])] {
            let curve = ClampCurve::bilinear(2e-7, asymmetry);
            for moment in [-3e4, -50.0, 0.0, 50.0, 3e4] {
                let turn = moment * if moment < 0.0 { below } else { above };
                // Over the kink the mean compliance is wrong by less than half the softer side's: that turn, by the compliance of the side.
                let error = curve.moment(turn, 0.0) - moment;
                assert!(error.abs() <= 0.5 * KINK * (below.max(above) / below.min(above)), "{asymmetry} {moment}: {error}");
            }
        }
    }

    #[test]
    fn equal_compliances_are_a_linear_spring_and_no_compliance_is_rigid() {
        let line = ClampCurve::new(2e4, [3e-7; CLAMP_POINTS]);
        for turn in [-0.05, -1e-3, 0.0, 2e-3, 0.2] {
            assert!((line.moment(turn, 0.0) - turn / 3e-7).abs() <= 1e-14 * (turn / 3e-7).abs(), "{turn}");
        }
        for curve in [ClampCurve::new(2e4, [0.0; 7]), ClampCurve::new(0.0, [1e-7; 7]), ClampCurve::new(f64::NAN, [1e-7; 7])] {
            assert!(curve.is_rigid());
        }
    }
}
