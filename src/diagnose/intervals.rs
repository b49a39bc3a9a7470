//! Confidence intervals of a model's coordinates.

use nalgebra::DMatrix;

use super::DiagnoseError;
use super::combinations::CORRELATED;
use super::diagnosis::Correlation;
use super::fit::coordinates;
use super::plant::Model;
use super::search::{Scored, Search, covariance};

/// 95 % quantile of χ² of one degree of freedom.
const CHI2_95: f64 = 3.841_458_820_694_124;

/// Confidence intervals of a model's coordinates, and their correlations.
pub(super) struct Intervals {
    /// Lower and upper end of each coordinate's 95 % interval.
    pub ends: Vec<[f64; 2]>,
    /// Covariance of the coordinates, inflated.
    pub covariance: DMatrix<f64>,
    /// Variance inflation of each coordinate, from [`Estimator::inflation`](super::fit::Estimator::inflation).
    pub inflation: Vec<f64>,
    /// Number of coordinates of each term.
    pub sizes: Vec<usize>,
    /// Nearly collinear coordinates.
    pub correlations: Vec<Correlation>,
    /// Ratio of the largest to the smallest eigenvalue of the scaled information.
    pub condition: f64,
}

/// 95 % intervals: half widths by the sandwich estimator, corrected by a profile (the coordinate is held at its end, all others are refitted, and the
/// end moves to where χ² has grown by its 95 % quantile). `numerics`, the error of each coordinate that is not noise, is added in quadrature.
///
/// # Errors
/// [`DiagnoseError`] if the model cannot be simulated.
pub(super) fn intervals_of(search: &Search, scored: &Scored, numerics: &[f64]) -> Result<Intervals, DiagnoseError> {
    let model = scored.model();
    let coordinates = coordinates(model);
    let n = coordinates.len();
    let naive = covariance(&scored.fit.information);
    let inflation = search.estimator.inflation(model, &search.split.fit, &naive)?;
    let name = |k: usize| {
        let (term, parameter) = coordinates[k];
        let candidate = &search.estimator.plant.candidates()[model.terms[term].candidate];
        format!("{} {}", candidate.id, candidate.parameters[parameter].name)
    };
    let (mut ends, mut correlations) = (Vec::new(), Vec::new());
    for k in 0..n {
        (search.progress)(&format!("the interval of {}", name(k)));
        let free = &search.estimator.plant.candidates()[model.terms[coordinates[k].0].candidate].parameters[coordinates[k].1];
        let x = model.terms[coordinates[k].0].x[coordinates[k].1];
        let spread = (naive[(k, k)] * inflation[k]).sqrt();
        let mut sides = [x, x];
        for (side, sign) in [-1.0, 1.0].into_iter().enumerate() {
            let mut half_width = CHI2_95.sqrt() * spread;
            // The weights of a free form keep the linear interval.
            let is_free_form = search.candidate(&model.terms[coordinates[k].0]).is_free_form;
            if n > 1 && !is_free_form && half_width.is_finite() && half_width > 0.0 {
                let to = (x + sign * half_width).clamp(free.bounds[0], free.bounds[1]);
                if (to - x).abs() > 0.5 * half_width
                    && let Ok(chi2) =
                        search.estimator.profile(&along(search, model, &naive, k, to), coordinates[k], &search.split.fit)
                {
                    let grown = (chi2 - scored.fit.chi2) / inflation[k];
                    let expected = CHI2_95 * ((to - x) / half_width).powi(2);
                    if grown > 0.0 {
                        half_width *= (expected / grown).sqrt().clamp(0.5, 3.0);
                    }
                }
            }
            half_width = half_width.hypot(numerics.get(k).copied().unwrap_or(0.0));
            sides[side] = if half_width.is_finite() {
                (x + sign * half_width).clamp(free.bounds[0], free.bounds[1])
            } else {
                free.bounds[side]
            };
        }
        ends.push(sides);
        for j in 0..k {
            let coefficient = naive[(k, j)] / (naive[(k, k)] * naive[(j, j)]).sqrt();
            if coefficient.abs() > CORRELATED {
                correlations.push(Correlation { between: [name(j), name(k)], coefficient });
            }
        }
    }
    let sizes = model.terms.iter().map(|term| term.x.len()).collect();
    let covariance = DMatrix::from_fn(n, n, |i, j| {
        let of = |k: usize| numerics.get(k).map_or(0.0, |error| error / CHI2_95.sqrt());
        let own = if i == j { of(i).powi(2) } else { 0.0 };
        naive[(i, j)] * (inflation[i] * inflation[j]).sqrt() + own
    });
    Ok(Intervals { ends, covariance, inflation, sizes, correlations, condition: condition(&scored.fit.information) })
}

/// The model with coordinate `k` at `to` and all others at their linear estimates, within their bounds.
fn along(search: &Search, model: &Model, covariance: &DMatrix<f64>, k: usize, to: f64) -> Model {
    let mut moved = model.clone();
    let coordinates = coordinates(model);
    let (term, parameter) = coordinates[k];
    let by = to - model.terms[term].x[parameter];
    for (j, (term, parameter)) in coordinates.into_iter().enumerate() {
        let [low, high] = search.estimator.plant.candidates()[model.terms[term].candidate].parameters[parameter].bounds;
        let x = &mut moved.terms[term].x[parameter];
        *x = if j == k { to } else { (*x + covariance[(j, k)] / covariance[(k, k)] * by).clamp(low, high) };
    }
    moved
}

/// Change of each coordinate with the next coarser discretisation (if it was refined), with the longer time step, and with all constants free, added
/// in quadrature.
///
/// The discretisation is fitted like a coordinate: where the coarser one raises χ² by more than a 95 % interval allows, the change is that to the end of
/// such an interval, for which χ² is a parabola.
///
/// # Errors
/// [`DiagnoseError`] if a model cannot be simulated.
pub(super) fn numerics(search: &Search, best: &Scored) -> Result<Vec<f64>, DiagnoseError> {
    let values_of = |model: &Model| -> Vec<f64> { model.terms.iter().flat_map(|term| term.x.clone()).collect() };
    let own = values_of(best.model());
    let resolutions = search.estimator.plant.resolutions();
    let at = resolutions.iter().position(|r| *r == best.model().resolution).unwrap_or(0);
    let mut moved = vec![0.0; own.len()];
    if own.is_empty() {
        return Ok(moved);
    }
    (search.progress)("the effect of the discretisation");
    let mut others = Vec::new();
    if at > 0 {
        let coarser = search.fitted(&Model { resolution: resolutions[at - 1], ..best.model().clone() })?;
        let inflation = search.estimator.inflation(best.model(), &search.split.fit, &covariance(&best.fit.information))?;
        let allowed = CHI2_95 * inflation.into_iter().fold(1.0, f64::max);
        let share = (allowed / (coarser.fitted - best.fitted).max(allowed)).sqrt();
        others.push((coarser, share));
    }
    others.push((search.ranked(&Model { fine: false, ..best.model().clone() })?, 1.0));
    others.push((search.ranked(&search.with_constants(best.model()))?, 1.0));
    for (other, share) in &others {
        // Missing constants come first.
        let values = values_of(other.model());
        for (moved, (a, b)) in moved.iter_mut().zip(own.iter().zip(&values[values.len() - own.len()..])) {
            *moved = f64::hypot(*moved, share * (a - b));
        }
    }
    Ok(moved)
}

/// Condition number of the information, scaled to a unit diagonal.
fn condition(information: &DMatrix<f64>) -> f64 {
    let n = information.nrows();
    if n == 0 {
        return 1.0;
    }
    let scaled = DMatrix::from_fn(n, n, |i, j| {
        let by = (information[(i, i)] * information[(j, j)]).sqrt();
        if by > 0.0 { information[(i, j)] / by } else { f64::from(u8::from(i == j)) }
    });
    let values = scaled.symmetric_eigenvalues();
    values.max() / values.min().max(1e-16)
}
