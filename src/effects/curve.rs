//! Curves from the parameters of free forms.

use crate::model::{CURVE_POINTS, Curve};

/// A curve between `-ends[0]` and `ends[1]` with `values` below and above 0, times `factor`.
pub(super) fn two_sided(ends: [f64; 2], values: &[f64], factor: f64) -> Curve {
    let side = |from: usize| std::array::from_fn(|k| factor * values[from + k]);
    Curve { ends, values: [side(0), side(CURVE_POINTS)], warp: f64::INFINITY }
}

/// An odd curve up to ±`end` with `values` above 0, times `factor`, on an axis that is linear up to a thirtieth of the end.
pub(super) fn odd(end: f64, values: &[f64], factor: f64) -> Curve {
    Curve::odd(end, std::array::from_fn(|k| factor * values[k]), end / 30.0)
}

/// Points of a curve, four between two of its own.
pub(super) fn points(curve: &Curve) -> Vec<[f64; 2]> {
    const PARTS: i32 = 4 * CURVE_POINTS as i32;
    let at = |k: i32| {
        let share = f64::from(k) / f64::from(PARTS);
        share * curve.ends[usize::from(k > 0)]
    };
    let first = if curve.ends[0] > 0.0 { -PARTS } else { 0 };
    let last = if curve.ends[1] > 0.0 { PARTS } else { 0 };
    (first..=last).map(at).map(|x| [x, curve.at(x)[0]]).collect()
}
