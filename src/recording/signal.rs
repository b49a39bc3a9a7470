//! Signal analysis: harmonics, ringing, resonance peaks, repetition.

use nalgebra::{Matrix3, Vector3};

/// A harmonic with mean: x = mean + c cos ωt + s sin ωt, in the unit of the signal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Harmonic {
    /// Mean.
    pub mean: f64,
    /// c.
    pub cos: f64,
    /// s.
    pub sin: f64,
}

/// Least-squares fit of one harmonic to `N` signals with common times, summed sample by sample. A sample weighs half the time to its neighbours, so
/// that the sampling density does not matter; the start of the interval is interpolated linearly.
#[derive(Debug, Clone)]
pub struct HarmonicSums<const N: usize> {
    frequency: f64,
    from: f64,
    samples: usize,
    /// Time (s) and values of the last sample, and its weight so far (s).
    last: Option<(f64, [f64; N], f64)>,
    normal: Matrix3<f64>,
    right: [Vector3<f64>; N],
    /// Largest magnitude of each signal.
    largest: [f64; N],
}

impl<const N: usize> HarmonicSums<N> {
    /// Empty sums at `frequency` (Hz) from the time `from` (s) on.
    pub fn new(frequency: f64, from: f64) -> Self {
        let (normal, right, largest) = (Matrix3::zeros(), [Vector3::zeros(); N], [0.0; N]);
        Self { frequency, from, samples: 0, last: None, normal, right, largest }
    }

    /// Takes the values of the signals at `time` (s).
    pub fn push(&mut self, time: f64, values: [f64; N]) {
        let mut half = 0.0;
        if let Some((before, old, stands)) = self.last.filter(|_| time > self.from) {
            if before < self.from {
                let share = (self.from - before) / (time - before);
                half = 0.5 * (time - self.from);
                self.add(self.from, std::array::from_fn(|k| old[k] + share * (values[k] - old[k])), half);
            } else {
                half = 0.5 * (time - before);
                self.add(before, old, stands + half);
            }
        }
        self.last = Some((time, values, half));
    }

    fn add(&mut self, time: f64, values: [f64; N], weight: f64) {
        let (sin, cos) = (2.0 * std::f64::consts::PI * self.frequency * time).sin_cos();
        let row = Vector3::new(1.0, cos, sin);
        self.samples += 1;
        self.normal += row * row.transpose() * weight;
        for (k, value) in values.into_iter().enumerate() {
            self.right[k] += row * (weight * value);
            self.largest[k] = self.largest[k].max(value.abs());
        }
    }

    /// The harmonic of each signal; `None` if the samples do not determine its three parameters.
    pub fn fit(&self) -> Option<[Harmonic; N]> {
        let mut all = self.clone();
        if let Some((time, values, stands)) = self.last {
            all.add(time, values, stands);
        }
        let normal = all.normal.cholesky().filter(|_| all.samples >= 3)?;
        Some(all.right.map(|right| {
            let p = normal.solve(&right);
            Harmonic { mean: p[0], cos: p[1], sin: p[2] }
        }))
    }

    /// The phase (deg) of each signal whose amplitude exceeds rounding.
    pub fn phases_deg(&self) -> [Option<f64>; N] {
        let fit = self.fit();
        std::array::from_fn(|k| fit.map(|fit| fit[k]).filter(|f| f.amplitude() > 1e-9 * self.largest[k]).map(|f| f.phase_deg()))
    }
}

impl Harmonic {
    /// Amplitude, √(c² + s²).
    pub fn amplitude(&self) -> f64 {
        self.cos.hypot(self.sin)
    }

    /// Phase φ (deg) of A cos(ωt + φ), between −180 and 180, negative for a lag.
    pub fn phase_deg(&self) -> f64 {
        (-self.sin).atan2(self.cos).to_degrees()
    }
}

/// `a − b` in degrees, between −180 and 180.
pub fn phase_difference_deg(a: f64, b: f64) -> f64 {
    let difference = (a - b).rem_euclid(360.0);
    if difference > 180.0 { difference - 360.0 } else { difference }
}

/// One mode of vibration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mode {
    /// Frequency of the largest response to a sinusoidal drive (Hz).
    pub resonance_hz: f64,
    /// Damping ratio ζ (–).
    pub damping_ratio: f64,
    /// Width of the resonance peak at 1/√2 of its height (Hz).
    pub half_power_bandwidth_hz: f64,
}

impl Mode {
    /// The mode of the ringing after a step, from turning points; `times` (s).
    ///
    /// ```text
    /// ln(swing_i) = const − i δ,    ζ = δ/√(π² + δ²),    f_d = 1/(2 Δt),    f_n = f_d/√(1−ζ²),    f_r = f_n √(1 − 2ζ²)
    /// ```
    ///
    /// δ: logarithmic decrement of half a period, Δt: mean time between turning points, both from linear fits to all swings above 1 % of the
    /// first. Differences of neighbouring turning points do not depend on the rest position. The peak width 2 ζ f_n holds for light damping.
    /// `None` if there are fewer than three swings, if the mode is too damped for a peak, or if the swings do not decay: their logarithms fall by less
    /// than 0.01 in all, or by less than two standard errors of the slope.
    ///
    /// # References
    /// D. J. Inman, *Engineering Vibration*, sections 1.6 (logarithmic decrement) and 2.2 (resonance peak).
    pub fn of_ringing(times: &[f64], values: &[f64]) -> Option<Self> {
        let turns = turning_points(times, values);
        let swings: Vec<f64> = turns.windows(2).map(|pair| (pair[1].1 - pair[0].1).abs()).collect();
        let first = *swings.first()?;
        let count = swings.iter().take_while(|&&swing| swing > 0.01 * first).count();
        if count < 3 {
            return None;
        }
        let logs: Vec<f64> = swings[..count].iter().map(|swing| swing.ln()).collect();
        let when: Vec<f64> = turns[..=count].iter().map(|turn| turn.0).collect();
        let decrement = -slope(&logs);
        if decrement * (count - 1) as f64 <= LEAST_DECAY || decrement <= 2.0 * slope_error(&logs, -decrement) {
            return None;
        }
        let damping_ratio = decrement / std::f64::consts::PI.hypot(decrement);
        let natural = 1.0 / (2.0 * slope(&when)) / (1.0 - damping_ratio.powi(2)).sqrt();
        let peak = 1.0 - 2.0 * damping_ratio.powi(2);
        (peak > 0.0).then(|| Self {
            resonance_hz: natural * peak.sqrt(),
            damping_ratio,
            half_power_bandwidth_hz: 2.0 * damping_ratio * natural,
        })
    }

    /// The mode of a frequency response, `amplitudes` at increasing `frequencies` (Hz): peak of the parabola through the largest amplitude and its
    /// neighbours, width by linear interpolation at 1/√2 of the peak, ζ = width/(2 f). `None` if the largest amplitude is at an end or the
    /// response does not fall below 1/√2 on both sides.
    pub fn of_response(frequencies: &[f64], amplitudes: &[f64]) -> Option<Self> {
        let top = (0..amplitudes.len()).max_by(|&a, &b| amplitudes[a].total_cmp(&amplitudes[b]))?;
        if top == 0 || top + 1 >= amplitudes.len() {
            return None;
        }
        let around = |values: &[f64]| [values[top - 1], values[top], values[top + 1]];
        let (resonance_hz, height) = parabola_top(around(frequencies), around(amplitudes))?;
        let half = height * std::f64::consts::FRAC_1_SQRT_2;
        let cross = |below: usize, above: usize| {
            let share = (half - amplitudes[below]) / (amplitudes[above] - amplitudes[below]);
            frequencies[below] + share * (frequencies[above] - frequencies[below])
        };
        let left = (0..top).rev().find(|&i| amplitudes[i] < half).map(|i| cross(i, i + 1))?;
        let right = (top + 1..amplitudes.len()).find(|&i| amplitudes[i] < half).map(|i| cross(i, i - 1))?;
        Some(Self { resonance_hz, damping_ratio: (right - left) / (2.0 * resonance_hz), half_power_bandwidth_hz: right - left })
    }
}

/// Total logarithmic decay below which swings count as constant: the error of interpolation between samples.
const LEAST_DECAY: f64 = 0.01;
/// Share of the last swing by which a signal must reverse for a turning point, to ignore ripples of higher modes.
const HYSTERESIS: f64 = 0.05;

/// Times and values of a signal's turning points, interpolated by parabolas, without the ends.
fn turning_points(times: &[f64], values: &[f64]) -> Vec<(f64, f64)> {
    let mut turns = Vec::new();
    let Some(&start) = values.first() else { return turns };
    let (mut best, mut direction, mut last) = (0, 0.0, start);
    for i in 1..values.len() {
        if direction == 0.0 {
            direction = values[i] - start;
        } else if (values[i] - values[best]) * direction >= 0.0 {
            best = i;
        } else if (values[i] - values[best]).abs() > HYSTERESIS * (values[best] - last).abs() {
            let at = |list: &[f64]| [list[best - 1], list[best], list[best + 1]];
            turns.push(parabola_top(at(times), at(values)).unwrap_or((times[best], values[best])));
            last = values[best];
            direction = -direction;
            best = i;
        }
        if direction != 0.0 && best == 0 {
            best = i;
        }
    }
    turns
}

/// Vertex of the parabola through three points; `None` if they are collinear.
pub(super) fn parabola_top([x0, x1, x2]: [f64; 3], [y0, y1, y2]: [f64; 3]) -> Option<(f64, f64)> {
    let (left, right) = ((y1 - y0) / (x1 - x0), (y2 - y1) / (x2 - x1));
    let curvature = (right - left) / (x2 - x0);
    if curvature == 0.0 {
        return None;
    }
    let x = 0.5 * (x0 + x1) - 0.5 * left / curvature;
    Some((x, y0 + left * (x - x0) + curvature * (x - x0) * (x - x1)))
}

/// Slope of the linear fit to values at 0, 1, 2, …
fn slope(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let middle = 0.5 * (n - 1.0);
    let (up, down) = values.iter().enumerate().fold((0.0, 0.0), |(up, down), (i, y)| {
        let x = i as f64 - middle;
        (up + x * y, down + x * x)
    });
    up / down
}

/// Standard error of the slope of a linear fit, from the residuals.
fn slope_error(values: &[f64], slope: f64) -> f64 {
    let n = values.len() as f64;
    let (middle, mean) = (0.5 * (n - 1.0), values.iter().sum::<f64>() / n);
    let (off, down) = values.iter().enumerate().fold((0.0, 0.0), |(off, down), (i, y)| {
        let x = i as f64 - middle;
        (off + (y - mean - slope * x).powi(2), down + x * x)
    });
    (off / (n - 2.0).max(1.0) / down).sqrt()
}

/// Number of times in a period at which [`Repetition`] compares.
const POINTS: usize = 100;

/// Difference of the nodes' heights from those one or two periods earlier, relative to unrelated motion: 0 for repeated motion, 1 for unrelated.
///
/// ```text
/// r = √(⟨|z(t) − z(t−T)|²⟩ / (2 ⟨|z − ⟨z⟩|²⟩))
/// ```
///
/// at 100 times per period, interpolated linearly between samples.
#[derive(Debug, Clone)]
pub struct Repetition {
    period: f64,
    /// Start and end of the motion (s).
    ends: [f64; 2],
    /// Number of points in the window, and of those taken so far including the two periods before it.
    points: usize,
    taken: usize,
    nodes: usize,
    /// Heights (cm) at the points of the last two periods, points × nodes.
    rows: Vec<f64>,
    /// Sums over the window of |z(t) − z(t−T)|² for T of one and of two periods.
    changes: [f64; 2],
    /// Sums over the window of z and z² of each node.
    sums: Vec<[f64; 2]>,
}

impl Repetition {
    /// Compares over the last `pairs` pairs of periods (s) of a motion with start and end `ends` (s), which begins at least one pair earlier.
    pub fn new(period: f64, pairs: usize, ends: [f64; 2], nodes: usize) -> Self {
        let (rows, sums) = (vec![0.0; 2 * POINTS * nodes], vec![[0.0; 2]; nodes]);
        Self { period, ends, points: 2 * pairs * POINTS, taken: 0, nodes, rows, changes: [0.0; 2], sums }
    }

    /// Takes the points between the previous sample and `now`, each a time (s) and the nodes' x, z (cm).
    pub fn take(&mut self, before: Option<(f64, &[[f64; 2]])>, now: (f64, &[[f64; 2]])) {
        while self.taken <= self.points + 2 * POINTS {
            let to_go = (self.points + 2 * POINTS - self.taken) as f64;
            let due = (self.ends[1] - to_go / POINTS as f64 * self.period).max(self.ends[0]);
            if due > now.0 {
                return;
            }
            let (share, old) = before.map_or((1.0, now.1), |(time, nodes)| ((due - time) / (now.0 - time), nodes));
            self.point(|node| old[node][1] + share * (now.1[node][1] - old[node][1]));
        }
    }

    fn point(&mut self, height: impl Fn(usize) -> f64) {
        let row = |taken: usize| taken % (2 * POINTS) * self.nodes;
        let (two, one) = (row(self.taken), row(self.taken + POINTS));
        let counts = self.taken > 2 * POINTS;
        for node in 0..self.nodes {
            let z = height(node);
            if counts {
                self.changes[0] += (z - self.rows[one + node]).powi(2);
                self.changes[1] += (z - self.rows[two + node]).powi(2);
                self.sums[node][0] += z;
                self.sums[node][1] += z * z;
            }
            self.rows[two + node] = z;
        }
        self.taken += 1;
    }

    /// True if the motion has reached its end.
    pub fn is_complete(&self) -> bool {
        self.taken > self.points + 2 * POINTS
    }

    /// r for 1 or 2 `periods`; `None` if the motion has not reached its end, or nothing moves.
    pub fn of(&self, periods: usize) -> Option<f64> {
        let n = self.points as f64;
        let spread: f64 = self.sums.iter().map(|[sum, squares]| squares - sum * sum / n).sum();
        let rounding = 1e-12 * self.sums.iter().map(|[_, squares]| squares).sum::<f64>();
        (self.is_complete() && spread > rounding).then(|| (self.changes[periods - 1] / (2.0 * spread)).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn sampled(duration: f64, step: f64, of: impl Fn(f64) -> f64) -> (Vec<f64>, Vec<f64>) {
        let times: Vec<f64> = (0..=(duration / step).round() as usize).map(|i| i as f64 * step).collect();
        let values = times.iter().map(|&t| of(t)).collect();
        (times, values)
    }

    #[test]
    fn a_harmonic_is_found_beside_its_mean_and_its_lag_is_negative() {
        let (times, values) = sampled(0.5, 1e-3, |t| 3.0 + 2.0 * (2.0 * PI * 14.0 * t - 0.7).cos());
        let mut sums = HarmonicSums::new(14.0, 0.0);
        assert!(sums.fit().is_none());
        times.iter().zip(&values).for_each(|(&t, &x)| sums.push(t, [x]));
        let [fit] = sums.fit().unwrap();
        assert!((fit.mean - 3.0).abs() < 1e-12 && (fit.amplitude() - 2.0).abs() < 1e-12);
        assert!((fit.phase_deg() + 0.7f64.to_degrees()).abs() < 1e-10);
        assert_eq!(phase_difference_deg(-170.0, 170.0), 20.0);
        assert_eq!(phase_difference_deg(170.0, -170.0), -20.0);
    }

    /// Step response of one mode, x = 1 − e^(−ζωt)(cos ω_d t + …), with a ripple of a second mode in its beginning.
    #[test]
    fn ringing_gives_frequency_and_damping_whatever_it_rings_about() {
        for (f, zeta) in [(18.0, 0.02), (25.0, 0.1), (9.0, 0.3)] {
            let omega: f64 = 2.0 * PI * f;
            let damped = omega * (1.0_f64 - zeta * zeta).sqrt();
            let (times, values) = sampled(20.0 / f, 1e-4, |t| {
                -5.0 + (-zeta * omega * t).exp() * ((damped * t).cos() + zeta * omega / damped * (damped * t).sin())
            });
            let mode = Mode::of_ringing(&times, &values).unwrap();
            // Sampling at 1e-4 s and a parabola: errors of the order of (ω Δt)² = 2e-4 at most.
            assert!((mode.damping_ratio / zeta - 1.0).abs() < 2e-3, "{f} {zeta}: {mode:?}");
            assert!((mode.resonance_hz / (f * (1.0_f64 - 2.0 * zeta * zeta).sqrt()) - 1.0).abs() < 2e-3, "{f} {zeta}: {mode:?}");
        }
        let (times, values) = sampled(1.0, 1e-3, |t| (-t).exp());
        assert_eq!(Mode::of_ringing(&times, &values), None);
        assert_eq!(Mode::of_ringing(&[], &[]), None);
    }

    #[test]
    fn oscillations_that_grow_or_stay_have_no_damping_ratio() {
        let noise = |t: f64| 0.01 * (1e4 * t * t).sin();
        for (rate, rough) in [(0.0, 0.0), (0.0, 1.0), (0.3, 0.0), (3.0, 1.0), (-1e-4, 1.0), (-1e-4, 0.0)] {
            for step in [1e-3, 3.1e-3, 7e-3] {
                let (times, values) = sampled(2.0, step, |t| (rate * t).exp() * (2.0 * PI * 18.0 * t).cos() + rough * noise(t));
                assert_eq!(Mode::of_ringing(&times, &values), None, "{rate} {rough} {step}");
            }
        }
        let (times, values) = sampled(2.0, 1e-3, |t| (-0.5 * t).exp() * (2.0 * PI * 18.0 * t).cos() + noise(t));
        let zeta = 0.5 / (2.0 * PI * 18.0);
        assert!((Mode::of_ringing(&times, &values).unwrap().damping_ratio / zeta - 1.0).abs() < 0.1);
    }

    #[test]
    fn a_response_gives_its_peak_and_width() {
        let (f0, zeta) = (23.0_f64, 0.05_f64);
        let frequencies: Vec<f64> = (1..=160).map(|i| 0.25 * f64::from(i)).collect();
        let response = |f: f64| 1.0 / ((1.0 - (f / f0).powi(2)).powi(2) + (2.0 * zeta * f / f0).powi(2)).sqrt();
        let amplitudes: Vec<f64> = frequencies.iter().map(|&f| response(f)).collect();
        let mode = Mode::of_response(&frequencies, &amplitudes).unwrap();
        assert!((mode.resonance_hz - f0 * (1.0 - 2.0 * zeta * zeta).sqrt()).abs() < 0.02, "{mode:?}");
        // Half-power width 2ζf₀ to second order in ζ, and straight lines between points: 2 %.
        assert!((mode.damping_ratio / zeta - 1.0).abs() < 0.02, "{mode:?}");
        assert_eq!(Mode::of_response(&frequencies[..80], &amplitudes[..80]), None);
    }

    #[test]
    fn a_subharmonic_repeats_after_two_periods_only() {
        let (times, values) = sampled(3.0, 1e-3, |t| (2.0 * PI * 5.0 * t).sin() + 0.7 * (2.0 * PI * 2.5 * t).cos());
        let rows: Vec<[[f64; 2]; 1]> = values.into_iter().map(|z| [[0.0, z]]).collect();
        let mut repetition = Repetition::new(0.2, 2, [0.0, 3.0], 1);
        for i in 0..times.len() {
            assert_eq!(repetition.of(1), None);
            let before = i.checked_sub(1).map(|before| (times[before], &rows[before][..]));
            repetition.take(before, (times[i], &rows[i]));
        }
        // Only the subharmonic changes sign: r² = 4·0.7²/2/(2·(1 + 0.7²)/2). Straight lines between samples err by (ωΔt)²/8 = 1.2e-4.
        assert!((repetition.of(1).unwrap() - (2.0 * 0.49_f64 / 1.49).sqrt()).abs() < 1e-3);
        assert!(repetition.of(2).unwrap() < 1e-3);
    }
}
