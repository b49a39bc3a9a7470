//! What of the data can be used: noise, outliers, frozen markers.

use super::dataset::{Dataset, MeasuredRun};
use crate::model::Mount;

/// A value is an outlier if it lies so many times the noise of the difference off the cubic through its four neighbours. With normal noise one
/// value in 10⁸ does.
const OUTLIER: f64 = 6.0;
/// The same value so many times in a row is a frozen marker; a moving one with noise repeats no digit that often.
const FROZEN: usize = 12;
/// Noise of the fourth difference y − (−y₋₂ + 4 y₋₁ + 4 y₊₁ − y₊₂)/6 of independent values, as a multiple of theirs: √(1 + 34/36).
const DIFFERENCE_NOISE: f64 = 1.394_433_377_556_793;
/// The median of |x| of a normal variable of unit variance.
const MEDIAN_OF_NORMAL: f64 = 0.674_489_750_196_081_7;

/// Noise and masks of a data set.
#[derive(Debug, Clone)]
pub struct Checked {
    /// One standard deviation per channel (mm).
    pub noise: Vec<f64>,
    /// The same as estimated from the data, whether given or not.
    pub estimated: Vec<f64>,
    /// Per run and channel: which rows can be used.
    pub runs: Vec<Vec<Vec<bool>>>,
    /// What was left out or looks odd, in words.
    pub remarks: Vec<String>,
}

/// Differences of every value from the cubic through its four neighbours, where rows are even enough and present.
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

/// Looks at all runs of a data set.
pub fn check(dataset: &Dataset) -> Checked {
    let names = dataset.channel_names();
    let mut remarks: Vec<String> = Vec::new();
    for run in &dataset.runs {
        remarks.extend(run.remarks.iter().map(|remark| format!("run {}: {remark}", run.id)));
    }
    let mut estimated = Vec::new();
    for channel in 0..names.len() {
        // Each run's own estimate; motion can only raise it, so the lower half counts.
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
            let mut good: Vec<bool> = y.iter().map(|value| value.is_finite()).collect();
            let outliers = remove_outliers(&run.times, y, &mut good, scatter);
            let frozen = remove_frozen(y, &mut good);
            let name = &names[channel];
            if outliers > 0 {
                remarks.push(format!("run {}: {outliers} outliers of {name} left out", run.id));
            }
            if frozen > 0 {
                remarks.push(format!("run {}: {name} stands still for {frozen} rows, which are left out", run.id));
            }
            masks.push(good);
        }
        // A foot on the floor may well stand still while the rest moves.
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

/// Takes out values far off their neighbours, the worst first, since each spoils its neighbours' differences.
fn remove_outliers(times: &[f64], y: &[f64], good: &mut [bool], noise: f64) -> usize {
    let mut work: Vec<f64> = y.to_vec();
    let limit = OUTLIER * DIFFERENCE_NOISE * noise;
    let mut count = 0;
    for _ in 0..y.len() / 5 {
        let d = differences(times, &work);
        let size = |i: usize| d.get(i).copied().flatten().unwrap_or(0.0);
        let worst = (0..y.len()).filter(|i| size(*i).abs() > limit).max_by(|a, b| size(*a).abs().total_cmp(&size(*b).abs()));
        let Some(i) = worst else { break };
        // Alone, its neighbours' differences are −2/3 and 1/6 of its own.
        let like = |k: usize, share: f64| (size(k) / size(i) - share).abs() < 0.3;
        let alone = like(i - 1, -2.0 / 3.0) && like(i + 1, -2.0 / 3.0) && like(i - 2, 1.0 / 6.0) && like(i + 2, 1.0 / 6.0);
        let bridge = (4.0 * (work[i - 1] + work[i + 1]) - work[i - 2] - work[i + 2]) / 6.0;
        // Where the motion itself is too fast for the rows, differences are large all around.
        let around: Vec<f64> = (3..9).flat_map(|k| [i.checked_sub(k), Some(i + k)]).flatten().map(|k| size(k).abs()).collect();
        let quiet = median(around).is_none_or(|around| size(i).abs() > 4.0 * around);
        if alone && quiet && good[i] {
            good[i] = false;
            count += 1;
        }
        // Bridged either way, so that the next worst is looked at.
        work[i] = bridge;
    }
    count
}

/// Takes out stretches of one and the same value.
fn remove_frozen(y: &[f64], good: &mut [bool]) -> usize {
    let mut count = 0;
    let mut from = 0;
    for i in 1..=y.len() {
        if i < y.len() && y[i] == y[from] {
            continue;
        }
        if i - from >= FROZEN {
            good[from..i].fill(false);
            count += i - from;
        }
        from = i;
    }
    count
}

/// Stretches in which a channel scatters like noise while the same axis of another marker moves by far more.
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
                // A marker nearer to the left end may well move a tenth of what one further out does.
                other != channel && run.channels[other].get(window.clone()).is_some_and(|y| spread(y) > 60.0 * noise[other])
            });
            if moves && spread(own) < 1.6 * noise[channel] {
                for good in &mut masks[channel][window] {
                    rows += usize::from(*good);
                    *good = false;
                }
            }
        }
        if rows > 0 {
            found.push((channel, rows));
        }
    }
    found
}
