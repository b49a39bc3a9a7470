//! How far the data leave a model's coordinates open.

use nalgebra::DMatrix;

use super::diagnosis::Correlation;
use super::fit::places;
use super::plant::Model;
use super::search::{Scored, Search, covariance};

/// χ² of one degree of freedom that noise exceeds in 5 % of cases.
const CHI2_95: f64 = 3.841_458_820_694_124;

/// Intervals of a model's coordinates and how they hang together.
pub(super) struct Intervals {
    /// Per coordinate, in order: lower and upper end, in coordinates.
    pub ends: Vec<[f64; 2]>,
    /// How much larger than for independent noise the variance of each coordinate is.
    pub inflation: Vec<f64>,
    /// Number of coordinates of each term.
    pub sizes: Vec<usize>,
    /// Those that the data hardly tell apart.
    pub correlations: Vec<Correlation>,
    /// Ratio of the largest to the smallest eigenvalue of the scaled information.
    pub condition: f64,
}

/// Half widths by the sandwich of information and of what the residuals' structure adds, checked by profiles: the coordinate is put to its end, all
/// others are fitted again, and the end is moved to where χ² has grown by what 95 % asks for. `numerics`, what is not noise, is added in quadrature.
pub(super) fn intervals_of(search: &Search, scored: &Scored, numerics: &[f64]) -> Result<Intervals, String> {
    let model = scored.model();
    let places = places(model);
    let n = places.len();
    let naive = covariance(&scored.fit.information);
    let inflation = search.bench.inflation(model, &search.split.fit, &naive)?;
    let name = |k: usize| {
        let (term, parameter) = places[k];
        let candidate = &search.bench.plant.candidates()[model.terms[term].candidate];
        format!("{} {}", candidate.id, candidate.parameters[parameter].name)
    };
    let (mut ends, mut correlations) = (Vec::new(), Vec::new());
    for k in 0..n {
        (search.progress)(&format!("the interval of {}", name(k)));
        let free = &search.bench.plant.candidates()[model.terms[places[k].0].candidate].parameters[places[k].1];
        let x = model.terms[places[k].0].x[places[k].1];
        let spread = (naive[(k, k)] * inflation[k]).sqrt();
        let mut sides = [x, x];
        for (side, sign) in [-1.0, 1.0].into_iter().enumerate() {
            let mut reach = CHI2_95.sqrt() * spread;
            if n > 1 && reach.is_finite() && reach > 0.0 {
                let to = (x + sign * reach).clamp(free.bounds[0], free.bounds[1]);
                if (to - x).abs() > 0.5 * reach
                    && let Ok(chi2) = search.bench.profile(&along(search, model, &naive, k, to), places[k], &search.split.fit)
                {
                    let grown = (chi2 - scored.fit.chi2) / inflation[k];
                    let asked = CHI2_95 * ((to - x) / reach).powi(2);
                    if grown > 0.0 {
                        reach *= (asked / grown).sqrt().clamp(0.5, 3.0);
                    }
                }
            }
            reach = reach.hypot(numerics.get(k).copied().unwrap_or(0.0));
            sides[side] =
                if reach.is_finite() { (x + sign * reach).clamp(free.bounds[0], free.bounds[1]) } else { free.bounds[side] };
        }
        ends.push(sides);
        for j in 0..k {
            let coefficient = naive[(k, j)] / (naive[(k, k)] * naive[(j, j)]).sqrt();
            if coefficient.abs() > 0.95 {
                correlations.push(Correlation { between: [name(j), name(k)], coefficient });
            }
        }
    }
    let sizes = model.terms.iter().map(|term| term.x.len()).collect();
    Ok(Intervals { ends, inflation, sizes, correlations, condition: condition(&scored.fit.information) })
}

/// The model with coordinate `k` at `to` and all others where they would be best if the model were linear, within their bounds.
fn along(search: &Search, model: &Model, covariance: &DMatrix<f64>, k: usize, to: f64) -> Model {
    let mut moved = model.clone();
    let places = places(model);
    let (term, parameter) = places[k];
    let by = to - model.terms[term].x[parameter];
    for (j, (term, parameter)) in places.into_iter().enumerate() {
        let [low, high] = search.bench.plant.candidates()[model.terms[term].candidate].parameters[parameter].bounds;
        let x = &mut moved.terms[term].x[parameter];
        *x = if j == k { to } else { (*x + covariance[(j, k)] / covariance[(k, k)] * by).clamp(low, high) };
    }
    moved
}

/// How far each coordinate moves with the discretisation, to the next coarser number of joints (if it was refined) and with the time step, and with constants that are
/// nominal because the discretisation could do what they did.
pub(super) fn numerics(search: &Search, best: &Scored) -> Result<Vec<f64>, String> {
    let coordinates = |model: &Model| -> Vec<f64> { model.terms.iter().flat_map(|term| term.x.clone()).collect() };
    let own = coordinates(best.model());
    let ladder = search.bench.plant.resolutions();
    let at = ladder.iter().position(|r| *r == best.model().resolution).unwrap_or(0);
    let mut moved = vec![0.0; own.len()];
    let mut others = Vec::new();
    if !own.is_empty() {
        (search.progress)("how far the discretisation matters");
        if at > 0 {
            others.push(search.fitted(&Model { resolution: ladder[at - 1], ..best.model().clone() })?);
        }
        others.push(search.fitted(&Model { fine: false, ..best.model().clone() })?);
        others.push(search.fitted(&search.with_constants(best.model()))?);
    }
    for other in &others {
        for (moved, (a, b)) in moved.iter_mut().zip(own.iter().zip(coordinates(other.model()))) {
            *moved = f64::hypot(*moved, a - b);
        }
    }
    Ok(moved)
}

/// Condition of the information scaled to a unit diagonal.
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
