//! Curves from the parameters of free forms.

use crate::model::Curve;

/// A curve between `-ends[0]` and `ends[1]` with `values` below and above 0, times `factor`.
pub(super) fn two_sided<const POINTS: usize>(ends: [f64; 2], values: &[f64], factor: f64) -> Curve<POINTS> {
    let side = |from: usize| std::array::from_fn(|k| factor * values[from + k]);
    Curve::equidistant(ends, [side(0), side(POINTS)])
}

/// An odd curve up to ±`end` with `values` above 0, times `factor`, on an axis that is linear up to a thirtieth of the end.
pub(super) fn odd(end: f64, values: &[f64], factor: f64) -> Curve {
    Curve::odd(end, std::array::from_fn(|k| factor * values[k]), end / 30.0)
}

/// Points of a curve, four between two of its own.
pub(super) fn points<const POINTS: usize>(curve: &Curve<POINTS>) -> Vec<[f64; 2]> {
    let parts = 4 * POINTS as i32;
    let ends = curve.ends();
    let at = |k: i32| {
        let share = f64::from(k) / f64::from(parts);
        share * ends[usize::from(k > 0)]
    };
    let first = if ends[0] > 0.0 { -parts } else { 0 };
    let last = if ends[1] > 0.0 { parts } else { 0 };
    (first..=last).map(at).map(|x| [x, curve.at(x)[0]]).collect()
}
