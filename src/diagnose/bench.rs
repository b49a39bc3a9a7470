//! Faults of the bench: a clock offset and rate, a gain of the inputs, a scale of the signals, and a zero and a linear drift of each channel, run by
//! run.
//!
//! They are nuisance parameters u of a run with normal priors, u ~ N(0, S), and enter its residuals r (σ) linearly through the columns G (values ×
//! faults, σ per unit of u). They are eliminated from every prediction by generalised least squares (variable projection):
//!
//! ```text
//! û = (S⁻¹ + GᵀG)⁻¹ Gᵀ r,    χ² = |r − G û|² + |S^(−½) û|² = rᵀ (I + G S Gᵀ)⁻¹ r,    cost = χ² + log det(I + GᵀG S)
//! ```
//!
//! The standard deviations S are given in `[bench]`, or those of largest restricted likelihood (Patterson and Thompson, Biometrika 58 (1971) 545) of
//! faults about means that are free: what is common to all runs is left for the causes to explain, except for the clock's rate, which no cause is.

use nalgebra::{DMatrix, DVector};

/// A fault stays off unless the cost falls by this, once in some thousand data sets by chance (half of χ² with one degree of freedom), ...
const LEAST_FALL: f64 = 12.0;
/// ... and by this share of the number of values, a misfit of σ/3 (rms): less is model error that small faults would take from its cause.
const LEAST_SHARE: f64 = 0.1;
/// The mean of a fault over n runs is beyond chance above this, in standard deviations over √n.
const SHARED_MEAN: f64 = 4.0;
/// Trial standard deviations of a fault: from the error with which a run determines it, in this ratio, this many.
const RATIO: f64 = 1.333_521_432_163_324; // 10^(1/8)
const TRIALS: usize = 40;
/// Most passes over all faults.
const MOST_PASSES: usize = 6;

/// Kinds of faults, in the order of their columns.
pub const KINDS: usize = 6;
/// Largest standard deviations of clock offsets (s), rates, gains and scales that are estimated, and largest base values: more is no fault of a bench, but
/// the misfit of a model that lacks its causes.
const LARGEST: [f64; SHARED] = [0.05, 0.01, 0.3, 0.3];
/// Kinds in which predictions are not linear: clock offset, clock rate and gain. Their columns belong to a base value of each run.
pub const BASED: usize = 3;

/// Standard deviation of each kind of fault between runs; 0 is off.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Spread {
    /// Of the clock (s), its rate (–), the gain of the inputs (–), the scale of the signals (–), zeros (unit of the signals) and drifts (per
    /// second).
    pub of: [f64; KINDS],
}

impl Spread {
    /// Clock offsets: their index in [`of`](Self::of).
    pub const CLOCK: usize = 0;
    /// Rates of the clock.
    pub const RATE: usize = 1;
    /// Gains of the inputs.
    pub const GAIN: usize = 2;
    /// Scales of the signals.
    pub const SCALE: usize = 3;
    /// Zeros of the channels.
    pub const ZERO: usize = 4;
    /// Drifts of the channels.
    pub const DRIFT: usize = 5;

    /// True if all faults are off.
    pub fn is_off(&self) -> bool {
        self.of.iter().all(|sd| *sd == 0.0)
    }

    /// Base values from a list of a run's faults: within the largest ones, or within three standard deviations of these priors if that is more.
    pub fn base(&self, faults: &[f64]) -> [f64; BASED] {
        std::array::from_fn(|kind| {
            let largest = LARGEST[kind].max(3.0 * self.of[kind]);
            faults.get(kind).map_or(0.0, |fault| fault.clamp(-largest, largest))
        })
    }

    /// The base values of the kinds that are on; 0 for the others.
    pub fn keep(&self, base: [f64; BASED]) -> [f64; BASED] {
        std::array::from_fn(|kind| if self.of[kind] > 0.0 { base[kind] } else { 0.0 })
    }

    /// Standard deviation of every column of a run of a number of `channels`.
    fn columns(&self, channels: usize) -> Vec<f64> {
        (0..SHARED + 2 * channels).map(|column| self.of[kind(column, channels)]).collect()
    }
}

/// Columns of a run for all channels, before those for each.
const SHARED: usize = 4;

/// Kind of a column.
fn kind(column: usize, channels: usize) -> usize {
    match column {
        0..SHARED => column,
        _ if column < SHARED + channels => Spread::ZERO,
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
    /// Base values at which residuals are computed.
    base: [f64; BASED],
}

/// A fault of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fault {
    /// Its kind, an index of [`Spread::of`].
    pub kind: usize,
    /// Its channel, for zeros and drifts.
    pub channel: Option<usize>,
    /// The estimate, in the unit of its spread.
    pub value: f64,
    /// Its standard deviation.
    pub sd: f64,
}

/// What a run contributes to the likelihood of the faults.
pub struct Moments<'a> {
    gram: &'a DMatrix<f64>,
    /// Gᵀ r.
    along: DVector<f64>,
    channels: usize,
    /// Number of values.
    count: usize,
}

impl Columns {
    /// Columns of a run at base values: `predicted` values and their derivatives by time, `rate`, and by the gain; 1/σ of each value, 0 for those that do not
    /// count; `whiten` replaces residuals (σ) by independent ones.
    pub fn new(
        channels: &[usize],
        times: &[f64],
        [predicted, rate, by_gain]: [&[f64]; 3],
        weights: &[f64],
        base: [f64; BASED],
        whiten: impl Fn(&mut [f64]),
    ) -> Self {
        let count = channels.iter().max().map_or(0, |last| last + 1);
        let mut columns = vec![vec![0.0; predicted.len()]; SHARED + 2 * count];
        let middle = 0.5 * times.iter().copied().fold(0.0, f64::max);
        let mut first: Vec<Option<f64>> = vec![None; count];
        for (i, weight) in weights.iter().enumerate() {
            let channel = channels[i];
            let rest = *first[channel].get_or_insert(predicted[i]);
            columns[Spread::CLOCK][i] = weight * rate[i];
            columns[Spread::RATE][i] = weight * rate[i] * times[i];
            columns[Spread::GAIN][i] = weight * by_gain[i];
            columns[Spread::SCALE][i] = weight * (predicted[i] - rest);
            columns[SHARED + channel][i] = *weight;
            columns[SHARED + count + channel][i] = weight * (times[i] - middle);
        }
        let plain = columns.clone();
        columns.iter_mut().for_each(|column| whiten(column));
        let q = columns.len();
        let gram = DMatrix::from_fn(q, q, |i, j| columns[i].iter().zip(&columns[j]).map(|(a, b)| a * b).sum());
        Self { plain, columns, gram, channels: count, base }
    }

    /// Without the kinds for which `has` is false: their columns are zero.
    pub fn only(mut self, has: impl Fn(usize) -> bool) -> Self {
        for column in (0..self.columns.len()).filter(|column| !has(kind(*column, self.channels))) {
            self.plain[column].fill(0.0);
            self.columns[column].fill(0.0);
            self.gram.row_mut(column).fill(0.0);
            self.gram.column_mut(column).fill(0.0);
        }
        self
    }

    /// Residuals at the base values `base` as those about 0, to first order.
    fn about_zero(&self, base: [f64; BASED], residuals: &mut [f64]) {
        for (base, column) in base.iter().zip(&self.columns).filter(|(base, _)| **base != 0.0) {
            residuals.iter_mut().zip(column).for_each(|(r, g)| *r += base * g);
        }
    }

    fn along(&self, residuals: &[f64]) -> DVector<f64> {
        DVector::from_fn(self.columns.len(), |k, _| self.columns[k].iter().zip(residuals).map(|(g, r)| g * r).sum())
    }

    /// The faults of a run with the given residuals (σ): the clock offset (s), the gain, zeros and drifts.
    pub fn faults(&self, spread: &Spread, residuals: &[f64]) -> Vec<f64> {
        let mut residuals = residuals.to_vec();
        self.about_zero(spread.keep(self.base), &mut residuals);
        estimate(&self.gram, &self.along(&residuals), &spread.columns(self.channels)).0
    }

    /// The faults of a run that are not off, with their posterior standard deviations.
    pub fn found(&self, spread: &Spread, residuals: &[f64]) -> Vec<Fault> {
        let values = self.faults(spread, residuals);
        let sds = spread.columns(self.channels);
        let q = sds.len();
        let inverse = scaled(&self.gram, &sds).cholesky().map(|factor| factor.inverse());
        let of = |column: usize| Fault {
            kind: kind(column, self.channels),
            channel: column.checked_sub(SHARED).map(|k| k % self.channels),
            value: values[column],
            sd: inverse.as_ref().map_or(f64::NAN, |inverse| sds[column] * inverse[(column, column)].sqrt()),
        };
        (0..q).filter(|column| sds[*column] > 0.0).map(of).collect()
    }

    /// Eliminates the faults from residuals (σ): appends û/s, one value for each fault, and returns log det(I + S GᵀG).
    pub fn eliminate(&self, spread: &Spread, residuals: &mut Vec<f64>) -> f64 {
        if spread.is_off() {
            residuals.resize(residuals.len() + self.columns.len(), 0.0);
            return 0.0;
        }
        self.about_zero(spread.keep(self.base), residuals);
        let sds = spread.columns(self.channels);
        let (faults, log_det) = estimate(&self.gram, &self.along(residuals), &sds);
        for (fault, column) in faults.iter().zip(&self.columns).filter(|(fault, _)| **fault != 0.0) {
            residuals.iter_mut().zip(column).for_each(|(r, g)| *r -= fault * g);
        }
        residuals.extend(faults.iter().zip(sds).map(|(fault, sd)| if sd > 0.0 { fault / sd } else { 0.0 }));
        log_det
    }

    /// Takes the faults that `whitened` residuals show from `plain` ones (both in σ).
    pub fn take_from(&self, spread: &Spread, whitened: &[f64], plain: &mut [f64]) {
        if spread.is_off() {
            return;
        }
        let mut faults = self.faults(spread, whitened);
        faults.iter_mut().zip(spread.keep(self.base)).for_each(|(fault, base)| *fault -= base);
        for (fault, column) in faults.iter().zip(&self.plain).filter(|(fault, _)| **fault != 0.0) {
            plain.iter_mut().zip(column).for_each(|(r, g)| *r -= fault * g);
        }
    }

    /// What the run, with the given residuals (σ), contributes to the likelihood.
    pub fn moments(&self, residuals: &[f64]) -> Moments<'_> {
        let mut residuals = residuals.to_vec();
        self.about_zero(self.base, &mut residuals);
        Moments { gram: &self.gram, along: self.along(&residuals), channels: self.channels, count: residuals.len() }
    }
}

/// Estimates û of a run's faults from GᵀG and Gᵀr, 0 for those that are off, and their covariance factor S^(−½)(…)S^(−½) as log det(I + S GᵀG).
fn estimate(gram: &DMatrix<f64>, along: &DVector<f64>, sds: &[f64]) -> (Vec<f64>, f64) {
    // In units of the standard deviations: (I + D GᵀG D) v = D Gᵀ r, u = D v.
    let right = DVector::from_fn(sds.len(), |i, _| sds[i] * along[i]);
    match scaled(gram, sds).cholesky() {
        Some(factor) => {
            let v = factor.solve(&right);
            (v.iter().zip(sds).map(|(v, sd)| v * sd).collect(), log_det(&factor))
        }
        None => (vec![0.0; sds.len()], 0.0),
    }
}

/// I + D GᵀG D, with the standard deviations D on its diagonal.
fn scaled(gram: &DMatrix<f64>, sds: &[f64]) -> DMatrix<f64> {
    DMatrix::from_fn(sds.len(), sds.len(), |i, j| f64::from(u8::from(i == j)) + sds[i] * gram[(i, j)] * sds[j])
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
        let Some(factor) = scaled(run.gram, &sds).cholesky() else { return f64::INFINITY };
        let d = DMatrix::from_diagonal(&DVector::from_vec(sds));
        let v = factor.solve(&(&d * &run.along));
        sum += log_det(&factor) - v.dot(&(&d * &run.along));
        // GᵀWG and GᵀWr with W = (I + G S Gᵀ)⁻¹.
        information += run.gram - run.gram * &d * factor.solve(&(&d * run.gram));
        right += &run.along - run.gram * &d * v;
    }
    // Columns that no run determines have no mean, and the clock's rate has none by itself.
    let scale = DVector::from_fn(q, |k, _| {
        if k != Spread::RATE && information[(k, k)] > 0.0 { information[(k, k)].sqrt().recip() } else { 0.0 }
    });
    let matrix = DMatrix::from_fn(q, q, |i, j| f64::from(u8::from(i == j)) * 1e-9 + scale[i] * information[(i, j)] * scale[j]);
    let right = DVector::from_fn(q, |k, _| scale[k] * right[k]);
    let Some(factor) = matrix.cholesky() else { return f64::INFINITY };
    let size: f64 = scale.iter().filter(|s| **s > 0.0).map(|s| -2.0 * s.ln()).sum();
    sum + log_det(&factor) + size - right.dot(&factor.solve(&right))
}

/// The standard deviations of largest restricted likelihood; `given` ones are kept. Faults that the data do not ask for are off, and so are those whose
/// mean over the runs is beyond chance: their prior would pay for little more than the differences, and take what all runs share from its cause. Those
/// that are `established` stay: a mean of their own is one that the model's coordinates have not taken up yet.
pub fn spread(runs: &[Moments], given: &[Option<f64>; KINDS], established: &Spread) -> Spread {
    let mut given = *given;
    loop {
        let spread = likeliest(runs, &given);
        let may_be_shared = |of: usize| given[of].is_none() && established.of[of] == 0.0 && of != Spread::RATE;
        let Some(shared) = (0..KINDS).find(|of| may_be_shared(*of) && is_shared(runs, &spread, *of)) else { return spread };
        given[shared] = Some(0.0);
    }
}

/// The kinds whose faults have a mean over the runs beyond chance, but for the clock's rate, which no cause is.
pub fn shared(runs: &[Moments], spread: &Spread) -> Vec<usize> {
    (0..KINDS).filter(|of| *of != Spread::RATE && is_shared(runs, spread, *of)).collect()
}

/// True if the mean of a kind's faults over the runs, of one channel, is beyond chance.
fn is_shared(runs: &[Moments], spread: &Spread, of: usize) -> bool {
    let sd = spread.of[of];
    let columns = |run: &Moments| (0..run.along.len()).filter(|column| kind(*column, run.channels) == of).collect::<Vec<_>>();
    let Some(own) = runs.first().map(columns).filter(|_| sd > 0.0) else { return false };
    let estimated = |run: &Moments| estimate(run.gram, &run.along, &spread.columns(run.channels)).0;
    let faults: Vec<Vec<f64>> = runs.iter().map(estimated).collect();
    own.into_iter().any(|column| {
        let values: Vec<f64> = faults.iter().filter_map(|faults| faults.get(column)).copied().collect();
        let n = values.len() as f64;
        (values.iter().sum::<f64>() / n).abs() > SHARED_MEAN * sd / n.sqrt()
    })
}

/// The standard deviations of largest restricted likelihood.
fn likeliest(runs: &[Moments], given: &[Option<f64>; KINDS]) -> Spread {
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
    let least_fall = LEAST_FALL.max(LEAST_SHARE * runs.iter().map(|run| run.count as f64).sum::<f64>());
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
            let largest = LARGEST.get(*of).copied().unwrap_or(f64::INFINITY);
            let best = (0..TRIALS)
                .map(|k| least * RATIO.powi(k as i32))
                .take_while(|sd| *sd <= largest)
                .map(at)
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .filter(|best| best.1 < off.1 - least_fall)
                .unwrap_or(off);
            (spread, now) = best;
        }
        // A gain and a scale do nearly the same, so the first of the two that is tried takes the effect of both.
        if free.contains(&Spread::GAIN) && free.contains(&Spread::SCALE) {
            let mut swapped = spread;
            swapped.of.swap(Spread::GAIN, Spread::SCALE);
            let other = cost(runs, &swapped);
            if other < now {
                (spread, now) = (swapped, other);
            }
        }
        if spread == before {
            break;
        }
    }
    debug_assert!(now.is_finite());
    spread
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::plant::Signal;
    use crate::diagnose::random::Random;

    const SIGMA: f64 = 0.05;

    /// A sine of two channels in 500 rows of 2 ms, its derivative, and the signal with nothing measured.
    fn run(hertz: f64) -> (Signal, Vec<f64>, Vec<f64>) {
        let (mut signal, mut predicted, mut rate) = (Signal::default(), Vec::new(), Vec::new());
        for channel in 0..2 {
            for row in 0..500 {
                let (t, pulse) = (0.002 * f64::from(row), std::f64::consts::TAU * hertz);
                let size = if channel == 0 { 1.0 } else { 5.0 };
                predicted.push(size * (1.0 - (pulse * t).cos()));
                rate.push(size * pulse * (pulse * t).sin());
                signal.times.push(t);
                signal.channels.push(channel);
            }
        }
        (signal, predicted, rate)
    }

    fn columns(hertz: f64) -> Columns {
        let (signal, predicted, rate) = run(hertz);
        // As of a sheet that bends: its end moves back with the square of the voltage.
        let by_gain: Vec<f64> = predicted.iter().zip(&signal.channels).map(|(f, c)| if *c == 0 { 2.0 * f } else { *f }).collect();
        Columns::new(
            &signal.channels,
            &signal.times,
            [&predicted, &rate, &by_gain],
            &vec![1.0 / SIGMA; 1000],
            [0.0; BASED],
            |_| {},
        )
    }

    #[test]
    fn eliminated_residuals_have_the_generalised_least_squares_cost() {
        let own = columns(3.0);
        let spread = Spread { of: [2e-3, 0.0, 0.01, 0.0, 0.1, 0.0] };
        let mut random = Random::new(1);
        let r: Vec<f64> = (0..1000).map(|_| random.normal()).collect();
        let mut eliminated = r.clone();
        let log_det = own.eliminate(&spread, &mut eliminated);
        // The covariance I + G S Gᵀ itself.
        let sds = spread.columns(2);
        let covariance = DMatrix::from_fn(1000, 1000, |i, j| {
            let along: f64 = (0..sds.len()).map(|k| sds[k].powi(2) * own.columns[k][i] * own.columns[k][j]).sum();
            along + f64::from(u8::from(i == j))
        });
        let factor = covariance.cholesky().unwrap();
        let vector = DVector::from_vec(r);
        let direct = vector.dot(&factor.solve(&vector));
        let chi2: f64 = eliminated.iter().map(|r| r * r).sum();
        assert!((chi2 / direct - 1.0).abs() < 1e-9, "{chi2} {direct}");
        assert!((log_det / super::log_det(&factor) - 1.0).abs() < 1e-9);
    }

    /// Eleven runs with faults of the given standard deviations, and `common` to all; −2 log likelihood decides.
    fn found(sds: [f64; KINDS], common: [f64; KINDS], seed: u64) -> Spread {
        found_beside(sds, common, seed, &Spread::default())
    }

    /// The same where some faults are established.
    fn found_beside(sds: [f64; KINDS], common: [f64; KINDS], seed: u64, established: &Spread) -> Spread {
        let mut random = Random::new(seed);
        let runs: Vec<Columns> = (0..11).map(|k| columns(1.0 + 1.7 * f64::from(k))).collect();
        let moments = runs.iter().map(|own| {
            let mut r: Vec<f64> = (0..1000).map(|_| random.normal()).collect();
            for (column, g) in own.columns.iter().enumerate() {
                let of = kind(column, 2);
                let fault = common[of] + sds[of] * random.normal();
                r.iter_mut().zip(g).for_each(|(r, g)| *r += fault * g);
            }
            own.moments(&r)
        });
        spread(&moments.collect::<Vec<_>>(), &[None; KINDS], established)
    }

    #[test]
    fn spreads_are_recovered_and_off_where_nothing_differs() {
        for seed in 1..=20 {
            assert!(found([0.0; KINDS], [0.0; KINDS], seed).is_off(), "seed {seed}");
        }
        let true_sds = [4e-3, 0.0, 0.0, 0.01, 0.2, 0.0];
        for seed in 1..=5 {
            let sds = found(true_sds, [0.0; KINDS], seed).of;
            for (sd, truth) in sds.iter().zip(true_sds) {
                // χ² of ten (zeros: twenty) degrees of freedom: within a factor of two in all but some 0.5 %.
                assert!(if truth == 0.0 { *sd == 0.0 } else { (0.5..2.0).contains(&(sd / truth)) }, "seed {seed}: {sds:?}");
            }
        }
    }

    #[test]
    fn a_kind_that_a_run_cannot_have_is_neither_found_nor_taken_from_its_residuals() {
        let sds = Spread { of: [4e-3, 1e-3, 0.01, 0.0, 0.2, 0.1] };
        let no_clock = |kind| ![Spread::CLOCK, Spread::RATE, Spread::DRIFT].contains(&kind);
        let own = columns(3.0).only(no_clock);
        let mut random = Random::new(4);
        let r: Vec<f64> = columns(3.0).columns[Spread::CLOCK].iter().map(|g| 4e-3 * g + random.normal()).collect();
        for fault in own.found(&sds, &r) {
            assert!(no_clock(fault.kind) || (fault.value == 0.0 && fault.sd == sds.of[fault.kind]), "{fault:?}");
        }
        assert!(columns(3.0).found(&sds, &r)[0].value > 2e-3);
    }

    #[test]
    fn base_values_stay_within_what_a_bench_can_do_or_is_given() {
        let faults = [0.08, 0.02, -9.0, 0.5];
        assert_eq!(Spread::default().base(&faults), [0.05, 0.01, -0.3]);
        // A clock that is given as ±30 ms may be 80 ms off.
        assert_eq!(Spread { of: [0.03, 0.0, 0.0, 0.0, 0.0, 0.0] }.base(&faults), [0.08, 0.01, -0.3]);
    }

    #[test]
    fn what_all_runs_share_is_left_to_the_causes_but_for_the_rate_of_the_clock() {
        let common = [1e-3, 0.0, 0.0, 0.02, 0.3, 0.0];
        assert!(found([0.0; KINDS], common, 3).is_off());
        // Zeros of 0.3 mm that differ by a tenth are no zeros of ±0.3 mm, but zeros of ±0.3 mm about 0.1 mm are.
        assert!(found([0.0, 0.0, 0.0, 0.0, 0.03, 0.0], [0.0, 0.0, 0.0, 0.0, 0.3, 0.0], 3).is_off());
        assert!(found([0.0, 0.0, 0.0, 0.0, 0.3, 0.0], [0.0, 0.0, 0.0, 0.0, 0.1, 0.0], 3).of[Spread::ZERO] > 0.2);
        // Established zeros stay.
        let zeros = Spread { of: [0.0, 0.0, 0.0, 0.0, 0.1, 0.0] };
        let established = found_beside([0.0, 0.0, 0.0, 0.0, 0.03, 0.0], [0.0, 0.0, 0.0, 0.0, 0.3, 0.0], 3, &zeros);
        assert!(established.of[Spread::ZERO] > 0.02 && established.of[Spread::CLOCK] == 0.0, "{established:?}");
        let rate = found([0.0; KINDS], [0.0, 2e-3, 0.0, 0.0, 0.0, 0.0], 3).of;
        assert!((1e-3..4e-3).contains(&rate[Spread::RATE]) && rate[Spread::CLOCK] == 0.0, "{rate:?}");
    }
}
