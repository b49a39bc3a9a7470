//! Faults of the bench that differ from run to run: a clock offset, a gain, a zero and a linear drift of each channel.
//!
//! They are nuisance parameters u of a run with normal priors, u ~ N(0, S), and enter its residuals r (σ) linearly through the columns G (values ×
//! faults, σ per unit of u). They are eliminated from every prediction by generalised least squares (variable projection):
//!
//! ```text
//! û = (S⁻¹ + GᵀG)⁻¹ Gᵀ r,    χ² = |r − G û|² + |S^(−½) û|² = rᵀ (I + G S Gᵀ)⁻¹ r,    cost = χ² + log det(I + GᵀG S)
//! ```
//!
//! The standard deviations S are given in `[bench]`, or those of largest restricted likelihood (Patterson and Thompson, Biometrika 58 (1971) 545) of
//! faults about means that are free: what is common to all runs is left for the causes to explain.

use nalgebra::{DMatrix, DVector};

use super::plant::Signal;

/// A fault stays off unless the cost falls by this, once in some thousand data sets by chance (half of χ² with one degree of freedom).
const LEAST_FALL: f64 = 12.0;
/// Trial standard deviations of a fault: from the error with which a run determines it, in this ratio, this many.
const RATIO: f64 = 1.333_521_432_163_324; // 10^(1/8)
const TRIALS: usize = 40;
/// Most passes over all faults.
const MOST_PASSES: usize = 6;

/// Kinds of faults, in the order of their columns.
pub const KINDS: usize = 4;

/// Standard deviation of each kind of fault between runs; 0 is off.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Spread {
    /// Of the clock (s), the gain (–), zeros (unit of the signals) and drifts (per second).
    pub of: [f64; KINDS],
}

impl Spread {
    /// Clock offsets: their index in [`of`](Self::of).
    pub const CLOCK: usize = 0;
    /// Gains.
    pub const GAIN: usize = 1;
    /// Zeros of the channels.
    pub const ZERO: usize = 2;
    /// Drifts of the channels.
    pub const DRIFT: usize = 3;

    /// True if all faults are off.
    pub fn is_off(&self) -> bool {
        self.of.iter().all(|sd| *sd == 0.0)
    }

    /// Standard deviation of every column of a run of a number of `channels`.
    fn columns(&self, channels: usize) -> Vec<f64> {
        (0..2 + 2 * channels).map(|column| self.of[kind(column, channels)]).collect()
    }
}

/// Kind of a column.
fn kind(column: usize, channels: usize) -> usize {
    match column {
        0 => Spread::CLOCK,
        1 => Spread::GAIN,
        _ if column < 2 + channels => Spread::ZERO,
        _ => Spread::DRIFT,
    }
}

/// Columns of a run's faults.
#[derive(Debug, Clone)]
pub struct Columns {
    /// Faults × values (σ per unit), as they are and whitened.
    plain: Vec<Vec<f64>>,
    columns: Vec<Vec<f64>>,
    /// GᵀG.
    gram: DMatrix<f64>,
    /// Number of channels.
    channels: usize,
    /// Clock offset (s) at which residuals are computed.
    pub clock: f64,
}

/// What a run contributes to the likelihood of the faults.
pub struct Moments<'a> {
    gram: &'a DMatrix<f64>,
    /// Gᵀ r.
    along: DVector<f64>,
    channels: usize,
}

impl Columns {
    /// Columns of a run at a clock offset (s): `predicted` values and their derivative by time, `rate`; 1/σ of each value, 0 for those that do not
    /// count; `whiten` replaces residuals (σ) by independent ones.
    pub fn new(
        signal: &Signal,
        [predicted, rate]: [&[f64]; 2],
        weights: &[f64],
        clock: f64,
        whiten: impl Fn(&mut [f64]),
    ) -> Self {
        let (channels, times) = (&signal.channels, &signal.times);
        let count = channels.iter().max().map_or(0, |last| last + 1);
        let mut columns = vec![vec![0.0; predicted.len()]; 2 + 2 * count];
        let middle = 0.5 * times.iter().copied().fold(0.0, f64::max);
        let mut first: Vec<Option<f64>> = vec![None; count];
        for (i, weight) in weights.iter().enumerate() {
            let channel = channels[i];
            let rest = *first[channel].get_or_insert(predicted[i]);
            columns[0][i] = weight * rate[i];
            columns[1][i] = weight * (predicted[i] - rest);
            columns[2 + channel][i] = *weight;
            columns[2 + count + channel][i] = weight * (times[i] - middle);
        }
        let plain = columns.clone();
        columns.iter_mut().for_each(|column| whiten(column));
        let q = columns.len();
        let gram = DMatrix::from_fn(q, q, |i, j| columns[i].iter().zip(&columns[j]).map(|(a, b)| a * b).sum());
        Self { plain, columns, gram, channels: count, clock }
    }

    /// Residuals about no clock offset, to first order.
    fn about_zero(&self, residuals: &mut [f64]) {
        if self.clock != 0.0 {
            residuals.iter_mut().zip(&self.columns[0]).for_each(|(r, g)| *r += self.clock * g);
        }
    }

    /// Estimates of all faults, 0 for those that are off, and their covariance factor S^(−½)(…)S^(−½) as log det(I + S GᵀG).
    fn estimate(&self, spread: &Spread, along: &DVector<f64>) -> (Vec<f64>, f64) {
        let sds = spread.columns(self.channels);
        let q = sds.len();
        // In units of the standard deviations: (I + D GᵀG D) v = D Gᵀ r, u = D v.
        let matrix = DMatrix::from_fn(q, q, |i, j| f64::from(u8::from(i == j)) + sds[i] * self.gram[(i, j)] * sds[j]);
        let right = DVector::from_fn(q, |i, _| sds[i] * along[i]);
        match matrix.cholesky() {
            Some(factor) => {
                let v = factor.solve(&right);
                (v.iter().zip(&sds).map(|(v, sd)| v * sd).collect(), log_det(&factor))
            }
            None => (vec![0.0; q], 0.0),
        }
    }

    fn along(&self, residuals: &[f64]) -> DVector<f64> {
        DVector::from_fn(self.columns.len(), |k, _| self.columns[k].iter().zip(residuals).map(|(g, r)| g * r).sum())
    }

    /// The faults of a run with the given residuals (σ): the clock offset (s), the gain, zeros and drifts.
    pub fn faults(&self, spread: &Spread, residuals: &[f64]) -> Vec<f64> {
        let mut residuals = residuals.to_vec();
        if spread.of[Spread::CLOCK] > 0.0 {
            self.about_zero(&mut residuals);
        }
        self.estimate(spread, &self.along(&residuals)).0
    }

    /// Eliminates the faults from residuals (σ): appends û/s, one value for each fault, and returns log det(I + S GᵀG).
    pub fn eliminate(&self, spread: &Spread, residuals: &mut Vec<f64>) -> f64 {
        if spread.is_off() {
            residuals.resize(residuals.len() + self.columns.len(), 0.0);
            return 0.0;
        }
        if spread.of[Spread::CLOCK] > 0.0 {
            self.about_zero(residuals);
        }
        let (faults, log_det) = self.estimate(spread, &self.along(residuals));
        for (fault, column) in faults.iter().zip(&self.columns).filter(|(fault, _)| **fault != 0.0) {
            residuals.iter_mut().zip(column).for_each(|(r, g)| *r -= fault * g);
        }
        let sds = spread.columns(self.channels);
        residuals.extend(faults.iter().zip(sds).map(|(fault, sd)| if sd > 0.0 { fault / sd } else { 0.0 }));
        log_det
    }

    /// Takes the faults that `whitened` residuals show from `plain` ones (both in σ).
    pub fn take_from(&self, spread: &Spread, whitened: &[f64], plain: &mut [f64]) {
        if spread.is_off() {
            return;
        }
        let mut faults = self.faults(spread, whitened);
        faults[Spread::CLOCK] -= if spread.of[Spread::CLOCK] > 0.0 { self.clock } else { 0.0 };
        for (fault, column) in faults.iter().zip(&self.plain).filter(|(fault, _)| **fault != 0.0) {
            plain.iter_mut().zip(column).for_each(|(r, g)| *r -= fault * g);
        }
    }

    /// What the run, with the given residuals (σ), contributes to the likelihood.
    pub fn moments(&self, residuals: &[f64]) -> Moments<'_> {
        let mut residuals = residuals.to_vec();
        self.about_zero(&mut residuals);
        Moments { gram: &self.gram, along: self.along(&residuals), channels: self.channels }
    }
}

fn log_det(factor: &nalgebra::Cholesky<f64, nalgebra::Dyn>) -> f64 {
    factor.l_dirty().diagonal().iter().map(|d| 2.0 * d.ln()).sum()
}

/// −2 log restricted likelihood of the faults of all runs about free means, up to a constant.
fn cost(runs: &[Moments], spread: &Spread) -> f64 {
    let Some(q) = runs.first().map(|run| run.along.len()) else { return 0.0 };
    let (mut sum, mut information, mut right) = (0.0, DMatrix::zeros(q, q), DVector::zeros(q));
    for run in runs.iter().filter(|run| run.along.len() == q) {
        let sds = spread.columns(run.channels);
        let matrix = DMatrix::from_fn(q, q, |i, j| f64::from(u8::from(i == j)) + sds[i] * run.gram[(i, j)] * sds[j]);
        let Some(factor) = matrix.cholesky() else { return f64::INFINITY };
        let d = DMatrix::from_diagonal(&DVector::from_vec(sds));
        let v = factor.solve(&(&d * &run.along));
        sum += log_det(&factor) - v.dot(&(&d * &run.along));
        // GᵀWG and GᵀWr with W = (I + G S Gᵀ)⁻¹.
        information += run.gram - run.gram * &d * factor.solve(&(&d * run.gram));
        right += &run.along - run.gram * &d * v;
    }
    // Columns that no run determines have no mean.
    let scale = DVector::from_fn(q, |k, _| if information[(k, k)] > 0.0 { information[(k, k)].sqrt().recip() } else { 0.0 });
    let matrix = DMatrix::from_fn(q, q, |i, j| f64::from(u8::from(i == j)) * 1e-9 + scale[i] * information[(i, j)] * scale[j]);
    let right = DVector::from_fn(q, |k, _| scale[k] * right[k]);
    let Some(factor) = matrix.cholesky() else { return f64::INFINITY };
    let size: f64 = scale.iter().filter(|s| **s > 0.0).map(|s| -2.0 * s.ln()).sum();
    sum + log_det(&factor) + size - right.dot(&factor.solve(&right))
}

/// The standard deviations of largest restricted likelihood; `given` ones are kept. Faults that the data do not ask for are off. `inflation` is the
/// number of values per independent one (1 for white noise).
pub fn spread(runs: &[Moments], given: &[Option<f64>; KINDS], inflation: f64) -> Spread {
    let mut spread = Spread { of: given.map(|sd| sd.unwrap_or(0.0)) };
    let free: Vec<usize> = (0..KINDS).filter(|kind| given[*kind].is_none()).collect();
    if runs.len() < 3 || free.is_empty() {
        return spread;
    }
    // Median error with which a run determines each fault.
    let least = free.iter().map(|of| {
        let sizes = runs.iter().flat_map(|run| {
            let own = (0..run.along.len()).filter(|column| kind(*column, run.channels) == *of);
            own.map(|column| run.gram[(column, column)]).filter(|size| *size > 0.0)
        });
        let mut sizes: Vec<f64> = sizes.collect();
        sizes.sort_by(f64::total_cmp);
        sizes.get(sizes.len() / 2).map(|size| size.sqrt().recip())
    });
    let least: Vec<Option<f64>> = least.collect();
    let mut now = cost(runs, &spread);
    for _ in 0..MOST_PASSES {
        let before = spread;
        for (of, least) in free.iter().zip(&least) {
            let Some(least) = least else { continue };
            let at = |sd: f64| {
                let mut trial = spread;
                trial.of[*of] = sd;
                (trial, cost(runs, &trial))
            };
            let off = at(0.0);
            let best = (0..TRIALS)
                .map(|k| at(least * RATIO.powi(k as i32)))
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .filter(|best| best.1 < off.1 - LEAST_FALL * inflation)
                .unwrap_or(off);
            (spread, now) = best;
        }
        if spread == before {
            break;
        }
    }
    debug_assert!(now.is_finite());
    spread
}
