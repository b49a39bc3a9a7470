//! Level and correlation time of the noise, from what does not repeat.
//!
//! Where the input is periodic or constant, everything deterministic is periodic with it or settles. Harmonics of the input and a linear trend are
//! removed from residuals there; what is left is noise, whatever the model lacks. Its autocorrelation is fitted by white noise beside a first-order
//! Gauss-Markov process (Bryson and Ho, Applied Optimal Control, 1975, chapter 11),
//!
//! ```text
//! ρ(Δt) = (1 − c) [Δt = 0] + c exp(−Δt/T)
//! ```
//!
//! and residuals are whitened by the innovations of the Kalman filter of this process, which is linear in them and exact for uneven rows.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{DMatrix, DVector};

use super::plant::Signal;

/// Most harmonics that are removed where the input is periodic, and least number of values for each coefficient.
const HARMONICS: usize = 10;
const VALUES_PER_COEFFICIENT: usize = 8;
/// Least number of periods and of values in a stretch.
const LEAST_PERIODS: f64 = 4.0;
const LEAST_VALUES: usize = 25;
/// Share of a stretch, from its beginning, in which transients decay.
const TRANSIENT: f64 = 0.4;
/// A channel's level needs this number of degrees of freedom.
const LEAST_FREEDOM: f64 = 100.0;
/// Levels that differ by less (natural logarithm) are the same.
const LEVEL_TOLERANCE: f64 = 0.2;
/// Noise of more than this multiple of the level that neighbouring rows or the description give is no noise.
const LARGEST_FACTOR: f64 = 3.0;
/// Longest lag of the autocorrelation (s).
const LONGEST_LAG: f64 = 0.4;
/// Correlated noise is assumed from this share on.
const LEAST_SHARE: f64 = 0.1;
/// Autocorrelations below this are oscillations, which are no noise of this kind.
const LEAST_CORRELATION: f64 = -0.35;

/// Noise of a plant's channels.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Noise {
    /// Factor on the given standard deviation of each channel (–); empty for the given ones.
    pub factors: Vec<f64>,
    /// Share c of the variance that is correlated (–).
    pub correlated: f64,
    /// Its correlation time T (s).
    pub time_s: f64,
}

/// What is left of a stretch of residuals without its trend and harmonics.
struct Rest {
    channel: usize,
    /// Interval of the rows (s).
    interval: f64,
    values: Vec<f64>,
    /// Number of values less that of fitted coefficients.
    freedom: f64,
}

/// Period (s) of a sampled input: the mean distance of its upward crossings of the mean, if they are evenly spaced; none otherwise.
fn period(times: &[f64], inputs: &[f64]) -> Option<f64> {
    let (low, high) = inputs.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), u| (low.min(*u), high.max(*u)));
    let middle = 0.5 * (low + high);
    let mut crossings = Vec::new();
    for (t, u) in times.windows(2).zip(inputs.windows(2)) {
        if u[0] < middle && u[1] >= middle {
            crossings.push(t[0] + (middle - u[0]) / (u[1] - u[0]) * (t[1] - t[0]));
        }
    }
    let [first, .., last] = crossings[..] else { return None };
    let period = (last - first) / (crossings.len() - 1) as f64;
    let row = (times[times.len() - 1] - times[0]) / (times.len() - 1) as f64;
    let even = crossings.iter().enumerate().all(|(k, t)| (t - first - k as f64 * period).abs() < 0.02 * period + row);
    (even && high > low).then_some(period)
}

/// Rows (first, end) of stretches of a run, without their transients, and the period of each; none for constant inputs.
fn stretches(times: &[f64], inputs: &[f64]) -> Vec<(usize, usize, Option<f64>)> {
    let n = times.len();
    let later = |from: usize, to: usize| from + ((to - from) as f64 * TRANSIENT) as usize;
    if n >= LEAST_VALUES
        && let Some(period) = period(times, inputs)
    {
        let from = later(0, n);
        let periods = (times[n - 1] - times[from]) / period;
        let rows = (n - from) as f64 / periods;
        return if periods >= LEAST_PERIODS && rows > 4.0 { vec![(from, n, Some(period))] } else { Vec::new() };
    }
    let (mut all, mut from) = (Vec::new(), 0);
    for row in 1..=n {
        if row == n || (inputs[row] - inputs[from]).abs() > 1e-9 {
            let first = later(from, row);
            if row - first >= LEAST_VALUES {
                all.push((first, row, None));
            }
            from = row;
        }
    }
    all
}

/// Residuals without trend and harmonics; none if there are too few.
fn without_trend(times: &[f64], values: &[f64], period: Option<f64>) -> Option<(Vec<f64>, f64)> {
    let (n, from) = (times.len(), times[0]);
    let length = times[n - 1] - from;
    // No harmonics beyond half of the rows' rate.
    let rate = (n - 1) as f64 / length;
    let most = HARMONICS.min(n / VALUES_PER_COEFFICIENT / 2);
    let harmonics = period.map_or(0, |period| most.min((0.5 * rate * period) as usize));
    let columns = 2 + 2 * harmonics;
    if n < columns + LEAST_VALUES / 2 {
        return None;
    }
    let basis = |row: usize, column: usize| {
        let t = times[row] - from;
        match column {
            0 => 1.0,
            1 => 2.0 * t / length - 1.0,
            _ => {
                let angle = std::f64::consts::TAU * (column / 2) as f64 * t / period.unwrap_or(1.0);
                if column.is_multiple_of(2) { angle.cos() } else { angle.sin() }
            }
        }
    };
    let matrix = DMatrix::from_fn(n, columns, basis);
    let right = DVector::from_column_slice(values);
    let fitted = (matrix.transpose() * &matrix).cholesky()?.solve(&(matrix.transpose() * &right));
    let rest = right - matrix * fitted;
    Some((rest.iter().copied().collect(), (n - columns) as f64))
}

fn rests(signals: &[Signal], used: &[Vec<bool>], residuals: &[Vec<f64>]) -> Vec<Rest> {
    let mut all = Vec::new();
    for ((signal, used), residuals) in signals.iter().zip(used).zip(residuals).filter(|((signal, _), _)| !signal.is_spectrum) {
        let channels = signal.channels.iter().max().map_or(0, |last| last + 1);
        for channel in 0..channels {
            let rows: Vec<usize> = (0..signal.values.len()).filter(|i| signal.channels[*i] == channel && used[*i]).collect();
            let of = |values: &[f64]| -> Vec<f64> { rows.iter().map(|i| values[*i]).collect() };
            let (times, inputs, values) = (of(&signal.times), of(&signal.inputs), of(residuals));
            for (from, to, period) in stretches(&times, &inputs) {
                if let Some((values, freedom)) = without_trend(&times[from..to], &values[from..to], period) {
                    let interval = (times[to - 1] - times[from]) / (to - from - 1) as f64;
                    all.push(Rest { channel, interval, values, freedom });
                }
            }
        }
    }
    all
}

/// Variance of a stretch.
fn variance(rest: &Rest) -> f64 {
    rest.values.iter().map(|r| r * r).sum::<f64>() / rest.freedom
}

/// A low quantile of the variances of stretches, by their degrees of freedom: what is not noise can only raise some.
fn low_quantile<'a>(rests: impl Iterator<Item = &'a Rest>) -> Option<f64> {
    let mut all: Vec<(f64, f64)> = rests.map(|rest| (variance(rest), rest.freedom)).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let whole: f64 = all.iter().map(|(_, freedom)| freedom).sum();
    let mut sum = 0.0;
    all.into_iter().filter(|_| whole >= LEAST_FREEDOM).find_map(|(variance, freedom)| {
        sum += freedom;
        (sum >= 0.4 * whole).then_some(variance)
    })
}

/// The noise that the residuals (σ) of a model show, run after run; none if too few values repeat, or if what is left oscillates.
pub fn estimate(signals: &[Signal], used: &[Vec<bool>], residuals: &[Vec<f64>]) -> Option<Noise> {
    let rests = rests(signals, used, residuals);
    let channels = signals.iter().flat_map(|signal| signal.channels.iter()).max()? + 1;
    let levels_of = |rests: &[Rest]| -> Vec<Option<f64>> {
        (0..channels).map(|c| low_quantile(rests.iter().filter(|rest| rest.channel == c))).collect()
    };
    let levels = levels_of(&rests);
    // Channels without enough values have the others' mean factor.
    let known: Vec<f64> = levels.iter().flatten().copied().collect();
    let mean = known.iter().sum::<f64>() / known.len().max(1) as f64;
    if known.is_empty() || mean <= 0.0 || known.iter().any(|level| *level > LARGEST_FACTOR * LARGEST_FACTOR) {
        return None;
    }
    let typical: Vec<&Rest> = rests.iter().filter(|rest| variance(rest) <= 2.0 * levels[rest.channel].unwrap_or(mean)).collect();
    let (correlated, time_s) = correlation(&typical)?;
    // Those of frequency responses keep the given level.
    let spectra: BTreeSet<usize> = signals.iter().filter(|s| s.is_spectrum).flat_map(|s| s.channels.iter().copied()).collect();
    let factor =
        |(channel, level): (usize, &Option<f64>)| if spectra.contains(&channel) { 1.0 } else { level.unwrap_or(mean).sqrt() };
    let noise = |levels: &[Option<f64>]| Noise { factors: levels.iter().enumerate().map(factor).collect(), correlated, time_s };
    if correlated == 0.0 {
        return Some(noise(&levels));
    }
    // Trends take more of correlated noise than their number of coefficients: the level is that of the innovations, which are white.
    let white: Vec<Rest> = rests
        .iter()
        .map(|rest| {
            let mut filter = Filter::new(correlated, time_s);
            let values = rest.values.iter().enumerate().map(|(k, r)| filter.innovation(k as f64 * rest.interval, *r));
            Rest { values: values.collect(), ..*rest }
        })
        .collect();
    Some(noise(&levels_of(&white)))
}

/// Share and correlation time (s) that fit the autocorrelations best; none if these oscillate.
fn correlation(rests: &[&Rest]) -> Option<(f64, f64)> {
    // Lag (s), autocorrelation, weight.
    let mut points: Vec<[f64; 3]> = Vec::new();
    for rest in rests {
        let own = variance(rest) * rest.freedom;
        let most = ((LONGEST_LAG / rest.interval) as usize).min(rest.values.len() / 4);
        for lag in 1..=most {
            let sum: f64 = rest.values.iter().zip(&rest.values[lag..]).map(|(a, b)| a * b).sum();
            points.push([lag as f64 * rest.interval, sum / own, rest.freedom]);
        }
    }
    // Means over a third of an octave.
    let mut bins: BTreeMap<i32, [f64; 2]> = BTreeMap::new();
    for [lag, value, weight] in &points {
        let bin = bins.entry((3.0 * lag.log2()).floor() as i32).or_default();
        bin[0] += weight * value;
        bin[1] += weight;
    }
    if bins.values().any(|[sum, weight]| sum / weight < LEAST_CORRELATION) {
        return None;
    }
    // Removing trends lowers all autocorrelations alike, nearly: an offset is fitted beside the share.
    let mut best = (0.0, 0.0, 0.0);
    for k in 0..40 {
        let time = 1e-3 * 10f64.powf(k as f64 / 13.0);
        let mut sums = [0.0; 5];
        for [lag, value, weight] in &points {
            let model = (-lag / time).exp();
            for (sum, term) in sums.iter_mut().zip([1.0, model, model * model, *value, value * model]) {
                *sum += weight * term;
            }
        }
        let [one, m, mm, v, vm] = sums;
        let (variance, covariance) = (mm - m * m / one, vm - v * m / one);
        let share = (covariance / variance).min(1.0);
        let offset = (v - share * m) / one;
        let (share, fall) = if offset < 0.0 && variance > 0.0 {
            (share, covariance * covariance / variance + v * v / one)
        } else {
            (vm / mm, vm * vm / mm)
        };
        if share > 0.0 && fall > best.0 {
            best = (fall, share.min(1.0), time);
        }
    }
    let (_, share, time) = best;
    Some(if share >= LEAST_SHARE { (share, time) } else { (0.0, 0.0) })
}

impl Noise {
    /// True if it contradicts the given standard deviations or white noise by more than estimates from some hundred values scatter.
    pub fn differs(&self, other: &Self) -> bool {
        let factor = |of: &Self, k: usize| of.factors.get(k).copied().unwrap_or(1.0);
        let level = |k: usize| (factor(self, k) / factor(other, k)).ln().abs() > LEVEL_TOLERANCE;
        (0..self.factors.len().max(other.factors.len())).any(level) || (self.correlated - other.correlated).abs() > LEAST_SHARE
    }

    /// Replaces residuals (σ, channel after channel, at `times` in s) by their innovations of unit variance; those that do not count are skipped.
    pub fn whiten(&self, signal: &Signal, used: &[bool], residuals: &mut [f64]) {
        if self.factors.is_empty() {
            return;
        }
        let (mut filter, mut before) = (Filter::new(self.correlated, self.time_s), None);
        for (i, r) in residuals.iter_mut().enumerate().take(signal.values.len()) {
            let (channel, t) = (signal.channels[i], signal.times[i]);
            if signal.is_spectrum {
                continue;
            }
            *r /= self.factors[channel];
            if self.correlated == 0.0 || !used[i] {
                continue;
            }
            if before.replace(channel) != Some(channel) {
                filter = Filter::new(self.correlated, self.time_s);
            }
            *r = filter.innovation(t, *r);
        }
    }
}

/// The Kalman filter of noise of unit variance.
struct Filter {
    correlated: f64,
    time_s: f64,
    /// Time (s) of the last value, mean and variance of the correlated part after it.
    last: Option<[f64; 3]>,
}

impl Filter {
    fn new(correlated: f64, time_s: f64) -> Self {
        Self { correlated, time_s, last: None }
    }

    /// The innovation of a value at `t` (s), of unit variance.
    fn innovation(&mut self, t: f64, value: f64) -> f64 {
        let (mean, variance) = match self.last {
            Some([at, mean, variance]) => {
                let decay = (-(t - at) / self.time_s).exp();
                (decay * mean, decay * decay * variance + (1.0 - decay * decay) * self.correlated)
            }
            None => (0.0, self.correlated),
        };
        let innovation = value - mean;
        let total = variance + 1.0 - self.correlated;
        let gain = variance / total;
        self.last = Some([t, mean + gain * innovation, (1.0 - gain) * variance]);
        innovation / total.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::random::Random;

    /// Runs of a sine of 2, 5 and 12 Hz and a staircase, 2 s in rows of 2 ms, with residuals of `of(t, phase, state)` σ.
    fn data(of: impl Fn(f64, f64, &mut Random, &mut f64) -> f64) -> (Vec<Signal>, Vec<Vec<bool>>, Vec<Vec<f64>>) {
        let (mut signals, mut residuals) = (Vec::new(), Vec::new());
        let mut random = Random::new(7);
        for hertz in [2.0, 5.0, 12.0, 0.0] {
            let (mut signal, mut r, mut memory) = (Signal::default(), Vec::new(), 0.0);
            for row in 0..1000 {
                let t = 0.002 * f64::from(row);
                let phase = std::f64::consts::TAU * hertz * t;
                signal.times.push(t);
                signal.channels.push(0);
                signal.values.push(0.0);
                signal.inputs.push(if hertz == 0.0 { -300.0 * (2.0 * t).floor() } else { -500.0 * (1.0 - phase.cos()) });
                r.push(of(t, phase, &mut random, &mut memory));
            }
            signals.push(signal);
            residuals.push(r);
        }
        let used = vec![vec![true; 1000]; 4];
        (signals, used, residuals)
    }

    #[test]
    fn the_level_is_that_of_what_does_not_repeat() {
        // A model error of 3 σ that follows the input, under noise of twice its stated size.
        let (signals, used, residuals) = data(|_, phase, random, _| 3.0 * (2.0 * phase).sin() + 2.0 * random.normal());
        let noise = estimate(&signals, &used, &residuals).unwrap();
        assert!((noise.factors[0] - 2.0).abs() < 0.2 && noise.correlated == 0.0, "{noise:?}");
        let white = Noise { factors: vec![1.0], ..Noise::default() };
        assert!(noise.differs(&white) && !white.differs(&Noise::default()));
    }

    #[test]
    fn correlated_noise_is_recovered_and_whitened() {
        let time = 0.03;
        let decay = f64::exp(-0.002 / time);
        // Half and half, of unit variance.
        let (signals, used, residuals) = data(|_, _, random, memory| {
            *memory = decay * *memory + (1.0 - decay * decay).sqrt() * random.normal();
            (*memory + random.normal()) / 2f64.sqrt()
        });
        let noise = estimate(&signals, &used, &residuals).unwrap();
        // 4000 values at 31 rows per correlation time: some 5 % of error of the level, 30 % of the time.
        assert!((noise.factors[0] - 1.0).abs() < 0.15, "{noise:?}");
        assert!((0.3..0.7).contains(&noise.correlated) && (0.4..2.0).contains(&(noise.time_s / time)), "{noise:?}");
        let exact = Noise { factors: vec![1.0], correlated: 0.5, time_s: time };
        let mut white = residuals[0].clone();
        exact.whiten(&signals[0], &used[0], &mut white);
        let mean_square = white.iter().map(|r| r * r).sum::<f64>() / 1000.0;
        let neighbours = white.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / 1000.0;
        // Three standard errors of 1000 independent values.
        assert!((mean_square - 1.0).abs() < 3.0 * 0.045 && neighbours.abs() < 3.0 * 0.032, "{mean_square} {neighbours}");
    }

    #[test]
    fn a_frequency_response_has_the_noise_that_it_is_given() {
        let (mut signals, mut used, mut residuals) = data(|_, _, random, _| 2.0 * random.normal());
        let without = estimate(&signals, &used, &residuals).unwrap();
        // What a model lacks at constant amplitude would pass for noise of 0.5 σ.
        let channels = vec![1; 200];
        let inputs = vec![100.0; 200];
        signals.push(Signal {
            times: signals[0].times[..200].to_vec(),
            values: inputs.clone(),
            channels,
            inputs,
            is_spectrum: true,
            ..Signal::default()
        });
        used.push(vec![true; 200]);
        residuals.push((0..200).map(|k| 0.7 * f64::from(k % 7 - 3).signum()).collect());
        let noise = estimate(&signals, &used, &residuals).unwrap();
        assert_eq!((noise.factors[0], noise.factors[1]), (without.factors[0], 1.0));
        let exact = Noise { factors: vec![2.0, 1.0], correlated: 0.5, time_s: 0.03 };
        let mut own = residuals[4].clone();
        exact.whiten(&signals[4], &used[4], &mut own);
        assert_eq!(own, residuals[4]);
    }

    #[test]
    fn a_hum_is_no_noise() {
        let (signals, used, residuals) = data(|t, _, random, _| 2.5 * (std::f64::consts::TAU * 7.3 * t).sin() + random.normal());
        assert_eq!(estimate(&signals, &used, &residuals), None);
    }
}
