//! What residuals look like: tests with their statistics, and what they mean in words.

use std::f64::consts::PI;

use serde::Serialize;

use super::fit::Residuals;
use super::plant::{Plant, Signal};
use super::search::Split;

/// A test of the residuals.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ResidualTest {
    /// Its name.
    pub name: String,
    /// The run, or `all`.
    pub run: String,
    /// The statistic.
    pub statistic: f64,
    /// The value that noise alone exceeds in about one case of a thousand.
    pub limit: f64,
    /// Whether the residuals pass as noise.
    pub passed: bool,
    /// What the statistic means, in words.
    pub meaning: String,
}

/// Residuals of one channel of one run, with times and inputs.
struct Trace {
    times: Vec<f64>,
    inputs: Vec<f64>,
    values: Vec<f64>,
}

/// The channel with the largest residual.
fn trace(signal: &Signal, residuals: &[f64]) -> Trace {
    let channels = signal.channels.iter().copied().max().unwrap_or(0) + 1;
    let size = |channel: usize| -> f64 {
        residuals.iter().zip(&signal.channels).filter(|(_, c)| **c == channel).map(|(r, _)| r * r).sum()
    };
    let chosen = (0..channels).max_by(|a, b| size(*a).total_cmp(&size(*b))).unwrap_or(0);
    let rows: Vec<usize> = (0..residuals.len()).filter(|i| signal.channels[*i] == chosen).collect();
    Trace {
        times: rows.iter().map(|i| signal.times[*i]).collect(),
        inputs: rows.iter().map(|i| signal.inputs[*i]).collect(),
        values: rows.iter().map(|i| residuals[*i]).collect(),
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Coefficient of correlation of two series; 0 where one is constant.
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

/// Amplitude of a series at a frequency, by least squares with a constant; in the series' unit.
fn amplitude(times: &[f64], values: &[f64], frequency: f64) -> f64 {
    let m = mean(values);
    let (mut c, mut s) = (0.0, 0.0);
    for (t, v) in times.iter().zip(values) {
        c += (v - m) * (2.0 * PI * frequency * t).cos();
        s += (v - m) * (2.0 * PI * frequency * t).sin();
    }
    2.0 * c.hypot(s) / values.len().max(1) as f64
}

/// Frequency of a periodic input (Hz), from where it rises through its middle; none for fewer than three rises.
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

/// All tests on all runs, and those across runs.
pub fn residual_tests(plant: &dyn Plant, split: &Split, residuals: &[Residuals]) -> Vec<ResidualTest> {
    let mut tests = Vec::new();
    let (mut swings, mut gains) = (Vec::new(), Vec::new());
    for run in split.all() {
        let signal = &plant.signals()[run];
        let r = &residuals[run];
        if r.len() < 20 {
            continue;
        }
        let n = r.len() as f64;
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
        let chi2 = r.iter().map(|r| r * r).sum::<f64>() / n;
        add("chi-square per value", chi2, 1.0 + 3.1 * (2.0 / n).sqrt(), "as large as the noise", "larger than the noise");
        let trace = trace(signal, r);
        let m = trace.values.len() as f64;
        let limit = 3.3 / m.sqrt();
        let lag = correlation(&trace.values[..trace.values.len() - 1], &trace.values[1..]);
        add("correlation of neighbours", lag, limit, "white", "neighbours are alike: structure is left");
        let along = correlation(&trace.values, &trace.inputs);
        add("correlation with the input", along, limit, "independent of the input", "follows the input: a gain is off");
        let rates: Vec<f64> = trace.inputs.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let beside = correlation(&trace.values[1..], &rates);
        add(
            "correlation with the input's rate",
            beside,
            limit,
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
        if let Some(frequency) = input_frequency(&trace.times, &trace.inputs) {
            // An amplitude of noise of unit variance is about √(π/m); one in a thousand is above √(4 ln 1000/m).
            let limit = (4.0 * 1000_f64.ln() / m).sqrt();
            for (harmonic, odd) in [(2.0, false), (3.0, true)] {
                let size = amplitude(&trace.times, &trace.values, harmonic * frequency);
                let (name, bad) = if odd {
                    ("third harmonic", "an odd distortion: a gain, stiffness or loss that depends on amplitude")
                } else {
                    ("second harmonic", "an even distortion: the two directions differ")
                };
                add(name, size, limit, "no distortion", bad);
            }
            let area = loop_area(&trace);
            add(
                "loop area",
                area,
                3.3 * (0.5 / m).sqrt(),
                "no loop over the input",
                "a loop over the input: loss, lag or memory",
            );
        }
        let measured: Vec<f64> = {
            let rows: Vec<usize> = (0..r.len()).collect();
            rows.iter().map(|i| signal.values[*i] / signal.sigmas[*i]).collect()
        };
        let predicted: Vec<f64> = measured.iter().zip(r).map(|(y, r)| y - r).collect();
        let swing = trace.inputs.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), u| (l.min(*u), h.max(*u)));
        let spread: f64 = centred(signal, &predicted).iter().map(|v| v * v).sum();
        if spread > 0.0 {
            let product: f64 = centred(signal, &predicted).iter().zip(&centred(signal, &measured)).map(|(a, b)| a * b).sum();
            gains.push((product / spread, 1.0 / spread.sqrt()));
            swings.push(swing.1 - swing.0);
        }
    }
    if gains.len() >= 3 {
        let ratios: Vec<f64> = gains.iter().map(|(gain, _)| *gain).collect();
        let trend = correlation(&ratios, &swings);
        let worst = gains.iter().map(|(gain, error)| (gain - 1.0).abs() / error).fold(0.0, f64::max);
        tests.push(ResidualTest {
            name: "gain against amplitude".into(),
            run: "all".into(),
            statistic: trend,
            limit: (3.3 / (ratios.len() as f64).sqrt()).min(0.9),
            passed: worst < 4.0 || trend.abs() < (3.3 / (ratios.len() as f64).sqrt()).min(0.9),
            meaning: if worst < 4.0 {
                "the same gain in all runs"
            } else {
                "measured over simulated motion, correlated with the input's swing"
            }
            .into(),
        });
    }
    tests
}

/// Values less the mean of their channel.
fn centred(signal: &Signal, values: &[f64]) -> Vec<f64> {
    let channels = signal.channels.iter().copied().max().unwrap_or(0) + 1;
    let means: Vec<f64> = (0..channels)
        .map(|channel| {
            mean(&values.iter().zip(&signal.channels).filter(|(_, c)| **c == channel).map(|(v, _)| *v).collect::<Vec<_>>())
        })
        .collect();
    values.iter().zip(&signal.channels).map(|(v, channel)| v - means[*channel]).collect()
}

/// Mean of the residual's part in quadrature with the input's swing: ∮ r du, scaled to unit swing and per row.
fn loop_area(trace: &Trace) -> f64 {
    let (low, high) = trace.inputs.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), u| (l.min(*u), h.max(*u)));
    let half = 0.5 * (high - low).max(1e-9);
    let steps: Vec<f64> = trace.inputs.windows(2).map(|pair| (pair[1] - pair[0]) / half).collect();
    let size = (steps.iter().map(|s| s * s).sum::<f64>() / steps.len().max(1) as f64).sqrt().max(1e-12);
    let product: f64 = trace.values.windows(2).zip(&steps).map(|(r, s)| 0.5 * (r[0] + r[1]) * s / size).sum();
    product / steps.len().max(1) as f64
}

/// What unexplained residuals look like, in words.
pub fn describe(plant: &dyn Plant, split: &Split, residuals: &[Residuals]) -> Vec<String> {
    let mut words = Vec::new();
    let all = split.all();
    let signals = plant.signals();
    let excess = |run: usize| (residuals[run].iter().map(|r| r * r).sum::<f64>() - residuals[run].len() as f64).max(0.0);
    let whole: f64 = all.iter().map(|run| excess(*run)).sum();
    let mut order = all.clone();
    order.sort_by(|a, b| excess(*b).total_cmp(&excess(*a)));
    let worst: Vec<usize> = order.iter().copied().filter(|run| excess(*run) > 0.1 * whole).collect();
    let share = |run: &usize| format!("{} ({:.0} %)", signals[*run].id, 100.0 * excess(*run) / whole.max(1e-9));
    words.push(format!("where: {}", worst.iter().map(share).collect::<Vec<_>>().join(", ")));
    let clean = all.iter().filter(|run| excess(**run) < 0.3 * residuals[**run].len() as f64).count();
    if clean > 0 {
        words.push(format!("{clean} of {} runs are explained to the noise", all.len()));
    }
    for run in worst.iter().take(4) {
        let trace = trace(&signals[*run], &residuals[*run]);
        let id = &signals[*run].id;
        let n = trace.values.len();
        if n < 20 {
            continue;
        }
        let m = mean(&trace.values);
        let rms = (trace.values.iter().map(|v| v * v).sum::<f64>() / n as f64).sqrt();
        // A frequency: the largest of a periodogram up to a quarter of the sampling rate.
        let span = trace.times[n - 1] - trace.times[0];
        let top = (0.25 * n as f64) as usize;
        let best = (1..top.max(2))
            .map(|k| (k as f64 / span, amplitude(&trace.times, &trace.values, k as f64 / span)))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        let mut parts = Vec::new();
        if m.abs() > 0.7 * rms {
            parts.push(format!(
                "one-sided: {} by {:.1} times the noise on average",
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
            parts.push(format!("changes by {change:.1} times the noise within the run"));
        }
        if let Some((at, size)) = largest_step(&trace)
            && size.abs() > 1.2 * rms
        {
            parts.push(format!("steps by {size:.1} times the noise at {at:.3} s"));
        }
        if parts.is_empty() {
            parts.push("broad-band".into());
        }
        words.push(format!("{id}: {}", parts.join("; ")));
    }
    words
}

/// Where the mean before and after differ most, and by how much.
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
