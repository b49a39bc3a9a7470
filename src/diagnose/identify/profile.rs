//! The likelihood of the constants by the quadratic models, its maximum and the ranges of its profiles.

use nalgebra::{DMatrix, DVector};

use super::MISSING;
use super::emulator::Emulator;

/// Rise of −2 ln L at the ends of a 95 % range of one constant: the quantile of χ² with one degree of freedom.
pub(super) const RANGE: f64 = 3.841_458_8;
/// Steps of a profile across the region.
const STEPS: usize = 60;
const ITERATIONS: usize = 80;

/// −2 ln L of coordinates, up to a constant, for measured values with their standard deviations.
pub(super) struct Likelihood<'a> {
    pub emulator: &'a Emulator,
    pub observed: &'a [(f64, f64)],
    /// The observation that is left out.
    pub without: Option<usize>,
}

/// One end of a profile's range.
#[derive(Debug, Clone)]
pub(super) struct End {
    /// Coordinates there, the other constants at their best.
    pub x: Vec<f64>,
    /// True if the region ends before the range does.
    pub is_edge: bool,
}

impl Likelihood<'_> {
    /// Residual over its standard deviation, its derivatives, and the variance, of every observation that counts.
    fn residuals(&self, x: &[f64]) -> Vec<(f64, Vec<f64>, f64)> {
        let counted = self.emulator.surfaces.iter().zip(self.observed).enumerate().filter(|(at, _)| Some(*at) != self.without);
        let residual = |(_, (surface, (value, sigma))): (usize, (&Option<super::emulator::Surface>, &(f64, f64)))| {
            let surface = surface.as_ref()?;
            let variance = sigma * sigma + surface.scatter * surface.scatter;
            let (predicted, slopes) = self.emulator.at(surface, x);
            let scale = 1.0 / variance.sqrt();
            Some(((predicted - value) * scale, slopes.iter().map(|slope| slope * scale).collect(), variance))
        };
        counted.filter_map(residual).collect()
    }

    /// −2 ln L. A number that no model gives counts as missed by far, so that regions with and without it can be compared.
    pub fn misfit(&self, x: &[f64]) -> f64 {
        let given = self.residuals(x).iter().map(|(residual, _, variance)| residual * residual + variance.ln()).sum::<f64>();
        let numbers = self.emulator.surfaces.iter().zip(self.observed).enumerate();
        let missing = numbers.filter(|(at, (surface, _))| surface.is_none() && Some(*at) != self.without);
        given + missing.map(|(_, (_, (_, sigma)))| MISSING * MISSING + 2.0 * sigma.ln()).sum::<f64>()
    }

    /// The sum of squared residuals over their variances, and their number.
    pub fn chi2(&self, x: &[f64]) -> (f64, usize) {
        let residuals = self.residuals(x);
        (residuals.iter().map(|(residual, ..)| residual * residual).sum(), residuals.len())
    }

    /// Half the Hessian of −2 ln L by Gauss's approximation: the information matrix.
    pub fn information(&self, x: &[f64]) -> DMatrix<f64> {
        let count = x.len();
        let mut information = DMatrix::zeros(count, count);
        for (_, slopes, _) in self.residuals(x) {
            let slopes = DVector::from_vec(slopes);
            information += &slopes * slopes.transpose();
        }
        information
    }

    /// The least misfit within the region from a start (Levenberg and Marquardt), with the coordinate `fixed` held.
    pub fn minimise(&self, start: &[f64], fixed: Option<usize>) -> (Vec<f64>, f64) {
        let region = &self.emulator.region;
        let (mut x, mut misfit) = (start.to_vec(), self.misfit(start));
        let mut damping = 1e-3;
        for _ in 0..ITERATIONS {
            let residuals = self.residuals(&x);
            let gradient = |at: usize| residuals.iter().map(|(residual, slopes, _)| residual * slopes[at]).sum::<f64>();
            let is_free = |at: usize| {
                let slope = gradient(at);
                Some(at) != fixed && !(x[at] <= region.low[at] && slope > 0.0 || x[at] >= region.high[at] && slope < 0.0)
            };
            let free: Vec<usize> = (0..x.len()).filter(|at| is_free(*at)).collect();
            let hessian =
                |i: usize, k: usize| residuals.iter().map(|(_, slopes, _)| slopes[free[i]] * slopes[free[k]]).sum::<f64>();
            let matrix = DMatrix::from_fn(free.len(), free.len(), |i, k| {
                hessian(i, k) * if i == k { 1.0 + damping } else { 1.0 } + if i == k { 1e-9 } else { 0.0 }
            });
            let right = DVector::from_fn(free.len(), |i, _| -gradient(free[i]));
            let Some(step) = matrix.cholesky().map(|factors| factors.solve(&right)) else { break };
            let mut next = x.clone();
            for (at, step) in free.iter().zip(step.iter()) {
                next[*at] = (next[*at] + step).clamp(region.low[*at], region.high[*at]);
            }
            let there = self.misfit(&next);
            if there < misfit {
                let fall = misfit - there;
                (x, misfit, damping) = (next, there, damping / 3.0);
                if fall < 1e-8 {
                    break;
                }
            } else {
                damping *= 4.0;
                if damping > 1e9 {
                    break;
                }
            }
        }
        (x, misfit)
    }

    /// The least misfit of all starts.
    pub fn best(&self, starts: impl Iterator<Item = Vec<f64>>) -> Option<(Vec<f64>, f64)> {
        starts.map(|start| self.minimise(&start, None)).min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// The ends of the range of a coordinate in which the profile of −2 ln L is at most `rise` above the best.
    pub fn range(&self, best: &(Vec<f64>, f64), at: usize, rise: f64) -> [End; 2] {
        let region = &self.emulator.region;
        [-1.0, 1.0].map(|direction| {
            let edge = if direction < 0.0 { region.low[at] } else { region.high[at] };
            let step = (edge - best.0[at]) / STEPS as f64;
            let (mut x, mut before) = (best.0.clone(), best.1);
            for _ in 0..STEPS {
                let mut next = x.clone();
                next[at] += step;
                let (next, misfit) = self.minimise(&next, Some(at));
                if misfit - best.1 > rise {
                    // Linear between the two steps.
                    let share = ((best.1 + rise - before) / (misfit - before)).clamp(0.0, 1.0);
                    let x = x.iter().zip(&next).map(|(a, b)| a + share * (b - a)).collect();
                    return End { x, is_edge: false };
                }
                (x, before) = (next, misfit);
            }
            End { x, is_edge: true }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::region::Region;
    use super::*;

    /// Straight lines y₁ = x₁ + x₂, y₂ = x₁ − x₂ with known scatter have ranges in closed form: ±1.96 σ/√2.
    #[test]
    fn ranges_of_a_linear_model_are_those_of_least_squares() {
        let runs: Vec<(Vec<f64>, Vec<Option<f64>>)> = (0..40)
            .map(|i| {
                let x = vec![f64::from(i) / 40.0, (f64::from(i) * 0.618_034) % 1.0];
                let values = vec![Some(x[0] + x[1]), Some(x[0] - x[1])];
                (x, values)
            })
            .collect();
        let emulator = Emulator::fit(Region::whole(2), runs.iter().map(|(x, y)| (&x[..], &y[..])), 2);
        let likelihood = Likelihood { emulator: &emulator, observed: &[(1.1, 0.05), (0.1, 0.05)], without: None };
        let best = likelihood.best([vec![0.2, 0.9]].into_iter()).unwrap();
        assert!((best.0[0] - 0.6).abs() < 1e-6 && (best.0[1] - 0.5).abs() < 1e-6, "{best:?}");
        for at in 0..2 {
            let [low, high] = likelihood.range(&best, at, RANGE);
            let half = 1.959_964 * 0.05 / 2.0_f64.sqrt();
            assert!((high.x[at] - best.0[at] - half).abs() < 0.02 * half, "{high:?}");
            assert!((best.0[at] - low.x[at] - half).abs() < 0.02 * half && !low.is_edge && !high.is_edge);
        }
        // With one of the two numbers x₁ + x₂ = 1.1 is all that is known: x₁ reaches the region's end above, and below it what x₂ ≤ 1 leaves, 0.1 − 0.098.
        let one = Likelihood { without: Some(1), ..likelihood };
        let best = one.best([vec![0.6, 0.5]].into_iter()).unwrap();
        let [low, high] = one.range(&best, 0, RANGE);
        assert!(high.is_edge && low.x[0] < 0.01, "{low:?} {high:?}");
    }
}
