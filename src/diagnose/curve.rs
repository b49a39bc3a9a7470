//! The curves of free forms, with their bands.

use super::diagnosis::Curve;
use super::intervals::Intervals;
use super::plant::{Free, FreeCurve, Term};
use super::search::{Scored, Search};

/// The curve of term `index` with its pointwise 95 % band; none of a named cause.
///
/// The band holds what noise and the other parameters leave open, from the covariance of the weights, and what the curve cannot follow between its
/// points: half of what a point is away from the straight line between its neighbours. A straight interpolation of a parabola errs by a quarter of
/// that, one of a corner by half.
pub(super) fn curve(search: &Search, best: &Scored, index: usize, found: &Intervals) -> Option<Curve> {
    let term = &best.model().terms[index];
    let plant = search.estimator.plant;
    let FreeCurve { x, y, points } = plant.curve(term)?;
    let first: usize = found.sizes[..index].iter().sum();
    let slopes = slopes(search, term, &points);
    let unresolved = unresolved(&points, &slopes);
    let half = |at: usize| {
        let mut variance = 0.0;
        for (i, a) in slopes.iter().enumerate() {
            for (j, b) in slopes.iter().enumerate() {
                variance += a[at] * b[at] * found.covariance[(first + i, first + j)];
            }
        }
        1.96 * variance.max(0.0).sqrt() + unresolved[at]
    };
    let [x_name, x_unit, y_name, y_unit] = [x[0], x[1], y[0], y[1]].map(String::from);
    Some(Curve {
        x_name,
        x_unit,
        y_name,
        y_unit,
        x: points.iter().map(|[x, _]| *x).collect(),
        y: points.iter().map(|[_, y]| *y).collect(),
        ci95: points.iter().enumerate().map(|(at, [_, y])| [y - half(at), y + half(at)]).collect(),
    })
}

/// Derivatives of a free form's curve by its weights, in which it is linear: weights × `points` of the curve.
pub(super) fn slopes(search: &Search, term: &Term, points: &[[f64; 2]]) -> Vec<Vec<f64>> {
    let slope = |(k, free): (usize, &Free)| {
        let by = if term.x[k] + free.scale > free.bounds[1] { -free.scale } else { free.scale };
        let mut moved = term.clone();
        moved.x[k] += by;
        let moved = search.estimator.plant.curve(&moved).map_or(Vec::new(), |curve| curve.points);
        moved.iter().zip(points).map(|(a, b)| (a[1] - b[1]) / by).collect()
    };
    search.candidate(term).parameters.iter().enumerate().map(slope).collect()
}

/// The points between which a curve is straight: where each weight moves it most (`slopes`, weights × points), and the origin that it goes through.
pub(super) fn knots(points: &[[f64; 2]], slopes: &[Vec<f64>]) -> Vec<usize> {
    let largest = |slope: &Vec<f64>| (0..points.len()).max_by(|a, b| slope[*a].abs().total_cmp(&slope[*b].abs()));
    let mut knots: Vec<usize> = slopes.iter().filter_map(largest).collect();
    knots.extend(points.iter().position(|point| *point == [0.0; 2]));
    knots.sort_unstable();
    knots.dedup();
    knots
}

/// What a curve cannot follow, at each of its points.
fn unresolved(points: &[[f64; 2]], slopes: &[Vec<f64>]) -> Vec<f64> {
    let knots = knots(points, slopes);
    let away: Vec<f64> = knots
        .windows(3)
        .map(|near| {
            let [[xa, ya], [x, y], [xb, yb]] = [near[0], near[1], near[2]].map(|at| points[at]);
            0.5 * (y - ya - (yb - ya) * (x - xa) / (xb - xa)).abs()
        })
        .collect();
    let (Some(first), Some(last)) = (away.first(), away.last()) else { return vec![0.0; points.len()] };
    let errors: Vec<f64> = std::iter::once(*first).chain(away.iter().copied()).chain([*last]).collect();
    let at = |k: usize| {
        let next = knots.partition_point(|knot| *knot < k).clamp(1, knots.len() - 1);
        let (from, to) = (points[knots[next - 1]][0], points[knots[next]][0]);
        let share = ((points[k][0] - from) / (to - from)).clamp(0.0, 1.0);
        errors[next - 1] + share * (errors[next] - errors[next - 1])
    };
    (0..points.len()).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_line_is_resolved_and_a_peak_is_not() {
        // Hats at 0, 1, 2, 3; points at every half.
        let hat = |k: usize, x: f64| (1.0 - (x - k as f64).abs()).max(0.0);
        let xs: Vec<f64> = (0..=6).map(|k| 0.5 * f64::from(k)).collect();
        let slopes: Vec<Vec<f64>> = (1..4).map(|k| xs.iter().map(|x| hat(k, *x)).collect()).collect();
        let line: Vec<[f64; 2]> = xs.iter().map(|x| [*x, 2.0 * x]).collect();
        assert!(unresolved(&line, &slopes).iter().all(|error| error.abs() < 1e-12));
        let peak: Vec<[f64; 2]> = xs.iter().map(|x| [*x, hat(1, *x)]).collect();
        let found = unresolved(&peak, &slopes);
        // Half of 1 at the peak, half of ½ at the point beyond it.
        assert_eq!((found[2], found[4], found[3]), (0.5, 0.25, 0.375));
    }
}
