//! Data quality: noise, outliers and frozen markers.

use super::dataset::{Dataset, MeasuredRun};
use crate::model::Mount;

/// Outliers differ from the cubic through their four neighbours by more than this (in σ of the difference): one value in 10⁸ of normal noise.
const OUTLIER: f64 = 6.0;
/// Rows with one and the same value that make a frozen marker.
const FROZEN: usize = 12;
/// Standard deviation of y − (−y₋₂ + 4 y₋₁ + 4 y₊₁ − y₊₂)/6 for independent values of unit variance: √(1 + 34/36).
const DIFFERENCE_NOISE: f64 = 1.394_433_377_556_793;
/// Median of |x| for a standard normal x.
const MEDIAN_OF_NORMAL: f64 = 0.674_489_750_196_081_7;

/// Noise and masks of a data set.
#[derive(Debug, Clone)]
pub struct Checked {
    /// Standard deviation of each channel (mm): the given one, or the estimate.
    pub noise: Vec<f64>,
    /// Standard deviation of each channel estimated from the data (mm); 0 if there are too few rows.
    pub estimated: Vec<f64>,
    /// True for usable values, runs × channels × rows.
    pub runs: Vec<Vec<Vec<bool>>>,
    /// Remarks on what was masked or is unusual, in words.
    pub remarks: Vec<String>,
}

/// Difference of each value from the cubic through its four neighbours; none at uneven or missing rows.
fn differences(times: &[f64], y: &[f64]) -> Vec<Option<f64>> {
    let n = y.len();
    let at = |i: usize| {
        if i < 2 || i + 2 >= n {
            return None;
        }
        let steps = [1, 2, 3, 4].map(|k| times[i + k - 2] - times[i + k - 3]);
        let even = steps.iter().all(|step| (step / steps[0] - 1.0).abs() < 0.05);
        let d = y[i] - (4.0 * (y[i - 1] + y[i + 1]) - y[i - 2] - y[i + 2]) / 6.0;
        (even && d.is_finite()).then_some(d)
    };
    (0..n).map(at).collect()
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let middle = values.len() / 2;
    Some(*values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// The median interval (s) between rows; none for fewer than two.
pub(super) fn median_interval(times: &[f64]) -> Option<f64> {
    median(times.windows(2).map(|pair| pair[1] - pair[0]).collect())
}

/// Estimates the noise of a data set and masks its unusable values.
pub fn check(dataset: &Dataset) -> Checked {
    let names = dataset.channel_names();
    let mut remarks: Vec<String> = Vec::new();
    for run in &dataset.runs {
        remarks.extend(run.remarks.iter().map(|remark| format!("run {}: {remark}", run.id)));
    }
    let mut estimated = Vec::new();
    for channel in 0..names.len() {
        // Motion can only raise a run's estimate, so a low quantile of all runs counts.
        let of_run = |run: &MeasuredRun| {
            let d = differences(&run.times, run.channels.get(channel)?).into_iter().flatten().map(f64::abs).collect::<Vec<_>>();
            if d.len() < 20 { None } else { median(d).map(|d| d / MEDIAN_OF_NORMAL / DIFFERENCE_NOISE) }
        };
        let mut runs: Vec<f64> = dataset.runs.iter().filter_map(of_run).filter(|noise| *noise > 0.0).collect();
        runs.sort_by(f64::total_cmp);
        estimated.push(runs.get(runs.len() / 3).copied().unwrap_or(0.0));
    }
    let fallback = estimated.iter().copied().filter(|noise| *noise > 0.0).fold(f64::INFINITY, f64::min);
    let noise: Vec<f64> = dataset
        .noise
        .iter()
        .zip(&estimated)
        .map(|(given, own)| {
            given.unwrap_or(if *own > 0.0 {
                *own
            } else if fallback.is_finite() {
                fallback
            } else {
                1e-3
            })
        })
        .collect();
    for (name, (given, own)) in names.iter().zip(dataset.noise.iter().zip(&estimated)) {
        if let Some(given) = given
            && (own / given > 1.5 || own / given < 0.67)
            && *own > 0.0
        {
            remarks.push(format!("noise of {name} is given as {given} mm, but the data scatter by {own:.3} mm"));
        }
    }
    let mut runs = Vec::new();
    for run in &dataset.runs {
        let mut masks = Vec::new();
        for (channel, y) in run.channels.iter().enumerate() {
            let scatter = noise[channel].max(estimated[channel]);
            let mut usable: Vec<bool> = y.iter().map(|value| value.is_finite()).collect();
            let outliers = remove_outliers(&run.times, y, &mut usable, scatter);
            let frozen = remove_frozen(y, &mut usable);
            let name = &names[channel];
            if outliers > 0 {
                remarks.push(format!("run {}: {outliers} outliers of {name} left out", run.id));
            }
            if frozen > 0 {
                remarks.push(format!("run {}: {name} stands still for {frozen} rows, which are left out", run.id));
            }
            masks.push(usable);
        }
        // On the ground a foot may rest while the others move.
        let stuck = if dataset.robot.mount == Mount::Ground { Vec::new() } else { stuck(run, &noise, &mut masks) };
        for (channel, rows) in stuck {
            remarks.push(format!(
                "run {}: {} stands still for {rows} rows while others move; they are left out",
                run.id, names[channel]
            ));
        }
        runs.push(masks);
    }
    Checked { noise, estimated, runs, remarks }
}

/// Masks outliers, the worst first, since each raises its neighbours' differences. Returns their number.
fn remove_outliers(times: &[f64], y: &[f64], usable: &mut [bool], noise: f64) -> usize {
    let mut work: Vec<f64> = y.to_vec();
    let limit = OUTLIER * DIFFERENCE_NOISE * noise;
    let mut count = 0;
    for _ in 0..y.len() / 5 {
        let d = differences(times, &work);
        let size = |i: usize| d.get(i).copied().flatten().unwrap_or(0.0);
        let worst = (0..y.len()).filter(|i| size(*i).abs() > limit).max_by(|a, b| size(*a).abs().total_cmp(&size(*b).abs()));
        let Some(i) = worst else { break };
        // A single outlier gives its neighbours −2/3 and 1/6 of its own difference.
        let is_near = |k: usize, share: f64| (size(k) / size(i) - share).abs() < 0.3;
        let is_single =
            is_near(i - 1, -2.0 / 3.0) && is_near(i + 1, -2.0 / 3.0) && is_near(i - 2, 1.0 / 6.0) && is_near(i + 2, 1.0 / 6.0);
        let interpolated = (4.0 * (work[i - 1] + work[i + 1]) - work[i - 2] - work[i + 2]) / 6.0;
        // Motion that is too fast for the rows makes all differences large.
        let around: Vec<f64> = (3..9).flat_map(|k| [i.checked_sub(k), Some(i + k)]).flatten().map(|k| size(k).abs()).collect();
        let is_smooth_around = median(around).is_none_or(|around| size(i).abs() > 4.0 * around);
        if is_single && is_smooth_around && usable[i] {
            usable[i] = false;
            count += 1;
        }
        // Interpolated in any case, so that the next worst follows.
        work[i] = interpolated;
    }
    count
}

/// Masks [`FROZEN`] or more equal values in a row. Returns their number.
fn remove_frozen(y: &[f64], usable: &mut [bool]) -> usize {
    let mut count = 0;
    let mut from = 0;
    for i in 1..=y.len() {
        if i < y.len() && y[i] == y[from] {
            continue;
        }
        if i - from >= FROZEN {
            usable[from..i].fill(false);
            count += i - from;
        }
        from = i;
    }
    count
}

/// Masks windows in which a channel scatters like noise while the same axis of another marker moves far more. Returns channels and numbers of rows.
fn stuck(run: &MeasuredRun, noise: &[f64], masks: &mut [Vec<bool>]) -> Vec<(usize, usize)> {
    const WINDOW: usize = 40;
    let spread = |y: &[f64]| {
        let y: Vec<f64> = y.iter().copied().filter(|value| value.is_finite()).collect();
        let mean = y.iter().sum::<f64>() / y.len().max(1) as f64;
        (y.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / y.len().max(1) as f64).sqrt()
    };
    let mut found = Vec::new();
    for channel in 0..run.channels.len() {
        let mut rows = 0;
        for from in (0..run.times.len().saturating_sub(WINDOW)).step_by(WINDOW / 2) {
            let window = from..from + WINDOW;
            let Some(own) = run.channels[channel].get(window.clone()) else { continue };
            let moves = (channel % 2..run.channels.len()).step_by(2).any(|other| {
                // A marker near the left end may move a tenth of one further out.
                other != channel && run.channels[other].get(window.clone()).is_some_and(|y| spread(y) > 60.0 * noise[other])
            });
            if moves && spread(own) < 1.6 * noise[channel] {
                for usable in &mut masks[channel][window] {
                    rows += usize::from(*usable);
                    *usable = false;
                }
            }
        }
        if rows > 0 {
            found.push((channel, rows));
        }
    }
    found
}
