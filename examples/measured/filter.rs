//! Filters of rows at equal intervals.

use std::f64::consts::PI;

/// A Butterworth filter of order 4 with a cut-off of `frequency` periods a row, forward and backward, with odd reflections at the ends.
pub fn low_pass(values: &[f64], frequency: f64) -> Vec<f64> {
    let (n, pad) = (values.len(), 200.min(values.len() - 1));
    let before = (1..=pad).rev().map(|k| 2.0 * values[0] - values[k]);
    let after = (1..=pad).map(|k| 2.0 * values[n - 1] - values[n - 1 - k]);
    let mut all: Vec<f64> = before.chain(values.iter().copied()).chain(after).collect();
    let warped = (PI * frequency).tan();
    for _ in 0..2 {
        // Damping ratios of the two pairs of poles.
        for damping in [(PI / 8.0).cos(), (3.0 * PI / 8.0).cos()] {
            let scale = 1.0 / (1.0 + 2.0 * damping * warped + warped * warped);
            let (b, a1) = (warped * warped * scale, 2.0 * (warped * warped - 1.0) * scale);
            let a2 = (1.0 - 2.0 * damping * warped + warped * warped) * scale;
            let ([mut x1, mut x2], [mut y1, mut y2]) = ([all[0]; 2], [all[0]; 2]);
            for value in &mut all {
                let x = *value;
                let y = b * (x + 2.0 * x1 + x2) - a1 * y1 - a2 * y2;
                (x2, x1, y2, y1) = (x1, x, y1, y);
                *value = y;
            }
        }
        all.reverse();
    }
    all[pad..pad + n].to_vec()
}

/// Central differences (per second) of values at an interval (s); one-sided at the ends.
pub fn central_differences(values: &[f64], interval_s: f64) -> Vec<f64> {
    let last = values.len() - 1;
    let of = |i: usize| {
        let (from, to) = (i.saturating_sub(1), (i + 1).min(last));
        (values[to] - values[from]) / ((to - from) as f64 * interval_s)
    };
    (0..values.len()).map(of).collect()
}
