//! A penalty on the roughness of free curves, with the strength that held-out runs choose.
//!
//! ```text
//! χ²(w) + λ Σ (second divided differences of the curve at its points)²
//! ```
//!
//! over the fit runs, to first order of the residuals about the fit (P-splines: Eilers and Marx 1996). Of several λ, none among them, that counts with
//! which χ² of the select runs is least. The covariance of the weights stays that of the fit without a penalty, so bands do not shrink by it.

use nalgebra::{DMatrix, DVector};

use super::curve::{knots, slopes};
use super::fit::{Fit, coordinates, sum_of_squares};
use super::plant::Term;
use super::search::{Scored, Search};

/// Strengths that are tried: the penalty's trace over that of the information of the weights, by powers of ten.
const STRENGTHS: [i32; 9] = [-6, -5, -4, -3, -2, -1, 0, 1, 2];

/// The model with its free curves smoothed, one after the other, where that lowers χ² of the select runs.
pub(super) fn smoothed(search: &Search, best: Scored) -> Scored {
    let mut best = best;
    for index in 0..best.model().terms.len() {
        let Some(curve) = Roughness::of(search, &best.model().terms[index]) else { continue };
        (search.progress)("the smoothness of a curve");
        // A curve that cannot be simulated is none.
        let tried =
            STRENGTHS.into_iter().filter_map(|strength| search.score(curve.penalised(search, &best, index, strength)?).ok());
        let least = tried.min_by(|a, b| a.select.total_cmp(&b.select));
        best = least.filter(|least| least.select < best.select).unwrap_or(best);
    }
    best
}

/// The sum of squared second divided differences of a curve, as a function of its weights.
struct Roughness {
    /// Half its gradient.
    gradient: DVector<f64>,
    /// Half its second derivatives, weights × weights.
    curvature: DMatrix<f64>,
}

impl Roughness {
    /// None of a named cause, and of a curve of fewer than three points.
    fn of(search: &Search, term: &Term) -> Option<Self> {
        let points = search.estimator.plant.curve(term)?.points;
        let slopes = slopes(search, term, &points);
        Some(Self::from(&points, &slopes)).filter(|roughness| roughness.curvature.trace() > 0.0)
    }

    fn from(points: &[[f64; 2]], slopes: &[Vec<f64>]) -> Self {
        let mut roughness =
            Self { gradient: DVector::zeros(slopes.len()), curvature: DMatrix::zeros(slopes.len(), slopes.len()) };
        for near in knots(points, slopes).windows(3) {
            let [a, b, c] = [near[0], near[1], near[2]].map(|at| points[at][0]);
            let second =
                |y: &dyn Fn(usize) -> f64| ((y(near[2]) - y(near[1])) / (c - b) - (y(near[1]) - y(near[0])) / (b - a)) / (c - a);
            let by_weights = DVector::from_iterator(slopes.len(), slopes.iter().map(|slope| second(&|at| slope[at])));
            roughness.gradient += second(&|at| points[at][1]) * &by_weights;
            roughness.curvature += &by_weights * by_weights.transpose();
        }
        roughness
    }

    /// The fit of `best` with a penalty on its term `index`, by the linear step from it; none where the information is singular.
    fn penalised(&self, search: &Search, best: &Scored, index: usize, strength: i32) -> Option<Fit> {
        let of_curve: Vec<usize> =
            (0..).zip(coordinates(best.model())).filter(|(_, (term, _))| *term == index).map(|(k, _)| k).collect();
        let mut information = best.fit.information.clone();
        let whole: f64 = of_curve.iter().map(|k| information[(*k, *k)]).sum();
        let lambda = 10_f64.powi(strength) * whole / self.curvature.trace();
        let mut gradient = DVector::zeros(information.nrows());
        for (i, row) in of_curve.iter().enumerate() {
            gradient[*row] = lambda * self.gradient[i];
            for (j, column) in of_curve.iter().enumerate() {
                information[(*row, *column)] += lambda * self.curvature[(i, j)];
            }
        }
        let by = information.lu().solve(&gradient).filter(|by| by.iter().all(|by| by.is_finite()))?;
        let mut fit = best.fit.clone();
        for ((term, parameter), by) in coordinates(&fit.model).into_iter().zip(by.iter()) {
            let [low, high] = search.candidate(&fit.model.terms[term]).parameters[parameter].bounds;
            let x = &mut fit.model.terms[term].x[parameter];
            *x = (*x - by).clamp(low, high);
        }
        let of_runs = search.estimator.residuals_of(&fit.model, &search.split.fit).ok()?;
        fit.chi2 = of_runs.iter().map(|r| sum_of_squares(r)).sum();
        Some(fit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::DiagnoseError;
    use crate::diagnose::plant::{Candidate, Free, FreeCurve, Model, Nuisance, Plant, Signal};
    use crate::diagnose::split::Split;

    const WEIGHTS: usize = 8;
    const VALUES: usize = 120;

    /// y = f(u) + noise, with a free form of f: straight between 0 and points at 1, 2, ...
    struct Curve {
        signals: Vec<Signal>,
        candidates: Vec<Candidate>,
    }

    fn input(at: usize) -> f64 {
        WEIGHTS as f64 * at as f64 / (VALUES - 1) as f64
    }

    fn hat(k: usize, u: f64) -> f64 {
        (1.0 - (u - (k + 1) as f64).abs()).max(0.0)
    }

    fn between(weights: &[f64], u: f64) -> f64 {
        weights.iter().enumerate().map(|(k, weight)| weight * hat(k, u)).sum()
    }

    impl Curve {
        fn new(law: &dyn Fn(f64) -> f64, sigma: f64) -> Self {
            let signal = |run: usize| {
                let noise = |at: usize| {
                    let noise = (1.0 + (run * VALUES + at) as f64).sin() * 43_758.545_3;
                    // Uniform noise of unit variance.
                    (noise - noise.floor() - 0.5) * 12_f64.sqrt()
                };
                Signal {
                    values: (0..VALUES).map(|at| law(input(at)) + sigma * noise(at)).collect(),
                    sigmas: vec![sigma; VALUES],
                    times: (0..VALUES).map(|at| at as f64).collect(),
                    channels: vec![0; VALUES],
                    inputs: (0..VALUES).map(input).collect(),
                    ..Signal::default()
                }
            };
            let free = Free { name: "w", unit: "", off: Some(0.0), bounds: [-1e3, 1e3], scale: 1.0, inverse: false };
            let candidate = Candidate {
                id: "curve",
                kind: "test",
                cause: "A curve.",
                places: vec!["test"],
                is_free_form: true,
                is_variant: false,
                is_constant: false,
                parameters: vec![free; WEIGHTS],
                fixed: Vec::new(),
                starts: vec![vec![0.1; WEIGHTS]],
            };
            Self { signals: (0..4).map(signal).collect(), candidates: vec![candidate] }
        }
    }

    impl Plant for Curve {
        fn signals(&self) -> &[Signal] {
            &self.signals
        }

        fn channels(&self) -> Vec<String> {
            vec!["y".into()]
        }

        fn unit(&self) -> &'static str {
            ""
        }

        fn candidates(&self) -> &[Candidate] {
            &self.candidates
        }

        fn curve(&self, term: &Term) -> Option<FreeCurve> {
            let points = (0..=WEIGHTS).map(|u| [u as f64, between(&term.x, u as f64)]).collect();
            Some(FreeCurve { x: ["u", ""], y: ["f", ""], points })
        }

        fn predict(&self, model: &Model, _run: usize, _: &Nuisance) -> Result<Vec<f64>, DiagnoseError> {
            Ok((0..VALUES).map(|at| model.terms.iter().map(|term| between(&term.x, input(at))).sum()).collect())
        }
    }

    /// Rms errors of the points as fitted and as smoothed.
    fn errors(law: &dyn Fn(f64) -> f64, sigma: f64) -> [f64; 2] {
        let plant = Curve::new(law, sigma);
        let split = Split { fit: vec![0, 1], select: vec![2, 3], judge: vec![] };
        let search = Search::new(&plant, split, &|_: &str| {});
        let fitted = search.fitted(&Model::new(vec![Term { candidate: 0, x: vec![0.1; WEIGHTS] }], 1.0, false)).unwrap();
        let error = |scored: &Scored| {
            let off = |(k, x): (usize, &f64)| (x - law((k + 1) as f64)).powi(2);
            (scored.model().terms[0].x.iter().enumerate().map(off).sum::<f64>() / WEIGHTS as f64).sqrt()
        };
        [error(&fitted), error(&smoothed(&search, fitted))]
    }

    #[test]
    fn noise_is_smoothed_and_a_curve_is_kept() {
        // A straight line under noise: the penalty costs nothing, and takes most of the noise of the points.
        let [plain, smooth] = errors(&|u| 0.5 * u, 1.0);
        assert!(smooth < 0.7 * plain, "{smooth} of {plain}");
        // A zigzag of 100 standard errors: what the penalty takes from it stays below the noise.
        let [plain, smooth] = errors(&|u| (u - 2.0 * (0.5 * u).round()).abs(), 0.02);
        assert!(plain < 0.01 && smooth < 1.5 * plain, "{smooth} of {plain}");
    }
}
