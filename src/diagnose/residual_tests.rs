//! Residual tests: statistics of the residuals, with limits that noise alone exceeds once in a thousand, and their meaning in words.

use std::f64::consts::PI;

use serde::Serialize;

use super::fit::{Residuals, inner};
use super::plant::{Plant, Signal};

/// A test of a run's residuals.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ResidualTest {
    /// Its name.
    pub name: String,
    /// The run, or `all`.
    pub run: String,
    /// The statistic.
    pub statistic: f64,
    /// The limit, which noise alone exceeds once in about a thousand.
    pub limit: f64,
    /// True if the statistic is within the limit.
    pub passed: bool,
    /// What the statistic means, in words.
    pub meaning: String,
}

/// Residuals of one channel of one run.
struct Trace {
    /// Times (s).
    times: Vec<f64>,
    /// Inputs, in the plant's unit.
    inputs: Vec<f64>,
    /// Residuals (σ).
    values: Vec<f64>,
}

/// Fewest values of a tested channel.
const LEAST: usize = 20;

/// Indices of the used values of each channel.
pub(super) fn rows_by_channel(signal: &Signal, used: &[bool]) -> Vec<Vec<usize>> {
    let channels = signal.channels.iter().copied().max().map_or(0, |most| most + 1);
    let mut rows = vec![Vec::new(); channels];
    for (i, channel) in signal.channels.iter().enumerate().filter(|(i, _)| used[*i]) {
        rows[*channel].push(i);
    }
    rows
}

/// Sum of squared residuals over `rows`.
pub(super) fn sum_over(residuals: &[f64], rows: &[usize]) -> f64 {
    rows.iter().map(|i| residuals[*i] * residuals[*i]).sum()
}

/// Of the channels with enough used values, the one with the largest mean square residual, and the one with most values, whose times and inputs do
/// not depend on the residuals. Statistics of the first must not depend on its size, by which it is chosen.
fn trace(signal: &Signal, used: &[bool], residuals: &[f64]) -> Option<[Trace; 2]> {
    let mut rows = rows_by_channel(signal, used);
    rows.retain(|rows| rows.len() >= LEAST);
    let mean_square = |rows: &&Vec<usize>| sum_over(residuals, rows) / rows.len() as f64;
    let chosen = rows.iter().max_by(|a, b| mean_square(a).total_cmp(&mean_square(b)))?;
    let longest = rows.iter().max_by_key(|rows| rows.len())?;
    Some([chosen, longest].map(|rows| Trace {
        times: rows.iter().map(|i| signal.times[*i]).collect(),
        inputs: rows.iter().map(|i| signal.inputs[*i]).collect(),
        values: rows.iter().map(|i| residuals[*i]).collect(),
    }))
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Correlation coefficient of two series; 0 if one is constant.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (ma, mb) = (mean(a), mean(b));
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        ab += (a - ma) * (b - mb);
        aa += (a - ma) * (a - ma);
        bb += (b - mb) * (b - mb);
    }
    if aa > 0.0 && bb > 0.0 { ab / (aa * bb).sqrt() } else { 0.0 }
}

/// Amplitude of a series at a frequency (Hz), in the series' unit.
fn amplitude(times: &[f64], values: &[f64], frequency: f64) -> f64 {
    let m = mean(values);
    let (mut c, mut s) = (0.0, 0.0);
    for (t, v) in times.iter().zip(values) {
        c += (v - m) * (2.0 * PI * frequency * t).cos();
        s += (v - m) * (2.0 * PI * frequency * t).sin();
    }
    2.0 * c.hypot(s) / values.len().max(1) as f64
}

/// Frequency (Hz) of a periodic input at `times` (s), from its rises through the middle of its range; none for fewer than three.
pub fn input_frequency(times: &[f64], inputs: &[f64]) -> Option<f64> {
    let (low, high) = inputs.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), u| (l.min(*u), h.max(*u)));
    let middle = 0.5 * (low + high);
    if high - low < 1e-9 {
        return None;
    }
    let rises: Vec<f64> = times
        .windows(2)
        .zip(inputs.windows(2))
        .filter(|(_, u)| u[0] < middle && u[1] >= middle)
        .map(|(t, u)| t[0] + (t[1] - t[0]) * (middle - u[0]) / (u[1] - u[0]))
        .collect();
    let count = rises.len();
    (count >= 3).then(|| (count - 1) as f64 / (rises[count - 1] - rises[0]))
}

/// Standard normal quantiles that are exceeded once in a thousand, on either side and on one side.
const Z_TWO_SIDED: f64 = 3.290_526_731_491_9;
const Z_ONE_SIDED: f64 = 3.090_232_306_167_8;

/// Student's t that is exceeded, on either side, once in a thousand: Cornish and Fisher's expansion (M. Abramowitz and I. A. Stegun, 26.7.5), with an
/// error below 10⁻³ from 17 degrees of freedom on.
fn student(freedom: f64) -> f64 {
    let (z, n) = (Z_TWO_SIDED, freedom);
    let [z3, z5, z7] = [3, 5, 7].map(|power| z.powi(power));
    z + (z3 + z) / (4.0 * n)
        + (5.0 * z5 + 16.0 * z3 + 3.0 * z) / (96.0 * n * n)
        + (3.0 * z7 + 19.0 * z5 + 17.0 * z3 - 15.0 * z) / (384.0 * n * n * n)
}

/// Correlation coefficient that noise exceeds once in a thousand.
fn correlation_limit(values: usize) -> f64 {
    let freedom = values as f64 - 2.0;
    let t = student(freedom);
    t / (freedom + t * t).sqrt()
}

/// χ² per value that noise exceeds once in a thousand, by Wilson and Hilferty's approximation.
fn chi2_limit(values: f64) -> f64 {
    let spread = 2.0 / (9.0 * values);
    (1.0 - spread + Z_ONE_SIDED * spread.sqrt()).powi(3)
}

/// Amplitude of a trace at a frequency (Hz) by least squares, √(2 S/m) with S the sum of squares that sine and cosine explain of m values, and its
/// limit by Fisher's distribution of S/k over the mean square of the rest, for k = 2 coordinates (1 if sine and cosine are collinear at the rows).
fn harmonic(trace: &Trace, frequency: f64) -> (f64, f64) {
    let m = trace.values.len() as f64;
    let centred = |mut values: Vec<f64>| {
        let mean = mean(&values);
        values.iter_mut().for_each(|v| *v -= mean);
        values
    };
    let phases = trace.times.iter().map(|t| 2.0 * PI * frequency * (t - trace.times[0]));
    let (cos, sin): (Vec<f64>, Vec<f64>) = phases.map(|phase| (phase.cos(), phase.sin())).unzip();
    let values = centred(trace.values.clone());
    let (mut explained, mut basis): (f64, Vec<Vec<f64>>) = (0.0, Vec::new());
    for wave in [centred(cos), centred(sin)] {
        let mut rest = wave;
        for other in &basis {
            let along = inner(&rest, other);
            rest.iter_mut().zip(other).for_each(|(rest, other)| *rest -= along * other);
        }
        let size = inner(&rest, &rest).sqrt();
        if size * size > 1e-6 * m {
            rest.iter_mut().for_each(|rest| *rest /= size);
            explained += inner(&rest, &values).powi(2);
            basis.push(rest);
        }
    }
    let k = basis.len() as f64;
    let freedom = m - 1.0 - k;
    let left = (inner(&values, &values) - explained).max(0.0) / freedom;
    let limit = match basis.len() {
        0 => return (0.0, 0.0),
        1 => student(freedom).powi(2),
        _ => freedom * (1000_f64.powf(2.0 / freedom) - 1.0),
    };
    ((2.0 * explained / m).sqrt(), (2.0 * limit * left / m).sqrt())
}

/// All residual tests, of each run and across runs, on the values that are `used`. The list of tests does not depend on the residuals (σ).
pub fn residual_tests(plant: &dyn Plant, used: &[Vec<bool>], residuals: &[Residuals]) -> Vec<ResidualTest> {
    let mut tests = Vec::new();
    let (mut gains, mut runs) = (Vec::new(), 0);
    for ((signal, used), r) in plant.signals().iter().zip(used).zip(residuals) {
        let Some([trace, longest]) = trace(signal, used, r) else { continue };
        runs += 1;
        let mut add = |name: &str, statistic: f64, limit: f64, good: &str, bad: &str| {
            let passed = statistic.abs() <= limit;
            tests.push(ResidualTest {
                name: name.into(),
                run: signal.id.clone(),
                statistic,
                limit,
                passed,
                meaning: if passed { good } else { bad }.into(),
            });
        };
        let n = used.iter().filter(|used| **used).count() as f64;
        let chi2 = r.iter().zip(used).filter(|(_, used)| **used).map(|(r, _)| r * r).sum::<f64>() / n;
        add("chi-square per value", chi2, chi2_limit(n), "as large as the noise", "larger than the noise");
        let m = trace.values.len();
        let lag = correlation(&trace.values[..m - 1], &trace.values[1..]);
        add("correlation of neighbours", lag, correlation_limit(m - 1), "white", "neighbours are alike: structure is left");
        gains.extend(gain(signal, used, r));
        if signal.is_spectrum {
            continue;
        }
        let along = correlation(&trace.values, &trace.inputs);
        let limit = correlation_limit(m);
        add("correlation with the input", along, limit, "independent of the input", "follows the input: a gain is off");
        let ends = trace.inputs.windows(2).zip(trace.times.windows(2));
        let rates: Vec<f64> = ends.map(|(u, t)| (u[1] - u[0]) / (t[1] - t[0])).collect();
        let with_rate = correlation(&trace.values[1..], &rates);
        add(
            "correlation with the input's rate",
            with_rate,
            correlation_limit(m - 1),
            "independent of the rate",
            "follows the rate of the input: a lag, a loop or a loss is off",
        );
        let logs: Vec<f64> = trace.times.iter().map(|t| (t + 0.01).log10()).collect();
        let drift = correlation(&trace.values, &logs);
        add(
            "drift in log time",
            drift,
            limit,
            "does not drift",
            "drifts with the logarithm of time: creep, or a set-up that moves",
        );
        if let Some(frequency) = input_frequency(&longest.times, &longest.inputs) {
            for (times, name, bad) in [
                (2.0, "second harmonic", "an even distortion: the two directions differ"),
                (3.0, "third harmonic", "an odd distortion: a gain, stiffness or loss that depends on amplitude"),
            ] {
                let (size, limit) = harmonic(&trace, times * frequency);
                add(name, size, limit, "no distortion", bad);
            }
            let (area, limit) = loop_area(&trace);
            add("loop area", area, limit, "no loop over the input", "a loop over the input: loss, lag or memory");
        }
    }
    if runs >= 3 {
        let trend = trend(&gains);
        let passed = trend.abs() <= Z_TWO_SIDED;
        tests.push(ResidualTest {
            name: "gain against amplitude".into(),
            run: "all".into(),
            statistic: trend,
            limit: Z_TWO_SIDED,
            passed,
            meaning: if passed {
                "no trend of the gain with the input's swing"
            } else {
                "measured over simulated motion changes with the input's swing (in standard errors)"
            }
            .into(),
        });
    }
    tests
}

/// The input's range, the gain of measured over simulated motion about the mean (by least squares), and the gain's inverse variance.
fn gain(signal: &Signal, used: &[bool], residuals: &[f64]) -> Option<[f64; 3]> {
    let (mut product, mut spread) = (0.0, 0.0);
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for rows in rows_by_channel(signal, used) {
        let predicted: Vec<f64> = rows.iter().map(|i| signal.values[*i] / signal.sigmas[*i] - residuals[*i]).collect();
        let mean = mean(&predicted);
        for (i, predicted) in rows.iter().zip(&predicted) {
            product += (predicted - mean) * residuals[*i];
            spread += (predicted - mean).powi(2);
            low = low.min(signal.inputs[*i]);
            high = high.max(signal.inputs[*i]);
        }
    }
    // The input of a frequency response is its amplitude.
    let low = if signal.is_spectrum { -high } else { low };
    (spread > 0.0).then(|| [high - low, 1.0 + product / spread, spread])
}

/// Slope of the gains over the input's range by weighted least squares, in standard errors; 0 if all ranges are equal.
fn trend(gains: &[[f64; 3]]) -> f64 {
    let weight: f64 = gains.iter().map(|[_, _, w]| w).sum();
    let middle = gains.iter().map(|[swing, _, w]| w * swing).sum::<f64>() / weight;
    let (mut along, mut size) = (0.0, 0.0);
    for [swing, gain, w] in gains {
        // The mean gain drops out, since the deviations from the middle sum to 0.
        along += w * (swing - middle) * (gain - 1.0);
        size += w * (swing - middle).powi(2);
    }
    let largest = gains.iter().fold(0.0_f64, |most, [swing, ..]| most.max(swing.abs()));
    if size > 1e-12 * weight * largest * largest { along / size.sqrt() } else { 0.0 }
}

/// Loop area ∮ r du per row of residuals over the input, for input steps of unit rms, and its limit. A row is weighted with half of the input's steps
/// before and after it.
fn loop_area(trace: &Trace) -> (f64, f64) {
    let steps: Vec<f64> = trace.inputs.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let rows = steps.len().max(1) as f64;
    let size = (steps.iter().map(|s| s * s).sum::<f64>() / rows).sqrt();
    if size == 0.0 {
        return (0.0, 0.0);
    }
    let weight = |i: usize| 0.5 * (i.checked_sub(1).map_or(0.0, |k| steps[k]) + steps.get(i).copied().unwrap_or(0.0)) / size;
    let weights: Vec<f64> = (0..trace.values.len()).map(weight).collect();
    let spread = |values: &[f64]| {
        let mean = mean(values);
        values.iter().map(|v| (v - mean).powi(2)).sum::<f64>().sqrt()
    };
    let both = spread(&trace.values) * spread(&weights) / rows;
    (correlation(&trace.values, &weights) * both, correlation_limit(trace.values.len()) * both)
}

/// Describes unexplained residuals (σ) in words: where they are, and their shape in the worst runs.
pub fn describe(plant: &dyn Plant, used: &[Vec<bool>], residuals: &[Residuals]) -> Vec<String> {
    let mut words = Vec::new();
    let signals = plant.signals();
    let count = |run: usize| used[run].iter().filter(|used| **used).count() as f64;
    let excess = |run: usize| (residuals[run].iter().map(|r| r * r).sum::<f64>() - count(run)).max(0.0);
    let whole: f64 = (0..signals.len()).map(excess).sum();
    let mut order: Vec<usize> = (0..signals.len()).collect();
    order.sort_by(|a, b| excess(*b).total_cmp(&excess(*a)));
    let worst: Vec<usize> = order.iter().copied().filter(|run| excess(*run) > 0.1 * whole).collect();
    let share = |run: &usize| format!("{} ({:.0} %)", signals[*run].id, 100.0 * excess(*run) / whole.max(1e-9));
    words.push(format!("where: {}", worst.iter().map(share).collect::<Vec<_>>().join(", ")));
    let clean = (0..signals.len()).filter(|run| excess(*run) < 0.3 * count(*run)).count();
    if clean > 0 {
        words.push(format!("{clean} of {} runs are explained to the noise", signals.len()));
    }
    for run in worst.iter().take(4) {
        let Some([trace, _]) = trace(&signals[*run], &used[*run], &residuals[*run]) else { continue };
        let id = &signals[*run].id;
        let n = trace.values.len();
        let m = mean(&trace.values);
        let rms = (trace.values.iter().map(|v| v * v).sum::<f64>() / n as f64).sqrt();
        if signals[*run].is_spectrum {
            let largest = trace.times.iter().zip(&trace.values).max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
            words.extend(largest.map(|(frequency, size)| format!("{id}: largest at {frequency:.3} Hz, {:.1} σ", size.abs())));
            continue;
        }
        // The peak of the periodogram up to a quarter of the sampling rate.
        let span = trace.times[n - 1] - trace.times[0];
        let top = (0.25 * n as f64) as usize;
        let best = (1..top.max(2))
            .map(|k| (k as f64 / span, amplitude(&trace.times, &trace.values, k as f64 / span)))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        let mut parts = Vec::new();
        if m.abs() > 0.7 * rms {
            parts.push(format!(
                "one-sided: {} by {:.1} σ on average",
                if m > 0.0 { "measured above simulated" } else { "measured below simulated" },
                m.abs()
            ));
        }
        if let Some((frequency, size)) = best
            && size * size / 2.0 > 0.3 * rms * rms
        {
            let drive = input_frequency(&trace.times, &trace.inputs);
            let relation = match drive {
                Some(drive)
                    if ((frequency / drive).round() * drive - frequency).abs() < 1.5 / span && frequency > 0.5 * drive =>
                {
                    format!(", {} times the drive's", (frequency / drive).round())
                }
                Some(_) => ", unrelated to the drive".into(),
                None => String::new(),
            };
            parts.push(format!("at {frequency:.1} Hz{relation}"));
        }
        let half = n / 2;
        let change = mean(&trace.values[half..]) - mean(&trace.values[..half]);
        if change.abs() > rms {
            parts.push(format!("changes by {change:.1} σ within the run"));
        }
        if let Some((at, size)) = largest_step(&trace)
            && size.abs() > 1.2 * rms
        {
            parts.push(format!("steps by {size:.1} σ at {at:.3} s"));
        }
        if parts.is_empty() {
            parts.push("broad-band".into());
        }
        words.push(format!("{id}: {}", parts.join("; ")));
    }
    words
}

/// Time (s) and size (σ) of the largest step of the mean.
fn largest_step(trace: &Trace) -> Option<(f64, f64)> {
    let n = trace.values.len();
    let sums: Vec<f64> = trace
        .values
        .iter()
        .scan(0.0, |sum, v| {
            *sum += v;
            Some(*sum)
        })
        .collect();
    let total = *sums.last()?;
    (n / 10..n - n / 10)
        .map(|i| (trace.times[i], (total - sums[i]) / (n - i - 1) as f64 - sums[i] / (i + 1) as f64))
        .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
}
