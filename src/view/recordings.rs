//! Figures of one recording.

use super::figure::Figure;
use super::player::voltages;
use super::series::Mark;
use super::text::{number, significant};
use crate::model::units::mm_from_cm;
use crate::recording::Recording;
use crate::words;

/// Kinds of figures of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Kind {
    /// The robot's shape at some times.
    Shapes,
    /// Heights and travel of left end, middle and right end over time.
    Traces,
    /// Amplitude spectra of these heights.
    Spectrum,
}

/// Largest number of shapes in a figure.
const SHAPES: usize = 6;

impl Kind {
    /// Draws the figure with a title that begins with the experiment's name, and its settings below.
    pub fn titled(self, name: &str, recording: &Recording) -> Figure {
        let mut figure = self.figure(recording);
        let what = match self {
            Self::Shapes => "shapes over time",
            Self::Traces => "heights, travel and voltages",
            Self::Spectrum => "amplitude spectra of heights",
        };
        figure.title(&format!("{name}: {what}"));
        figure
    }

    /// Draws the figure.
    pub fn figure(self, recording: &Recording) -> Figure {
        let mut figure = self.plain(recording);
        figure.setting(&setting(recording));
        figure
    }

    fn plain(self, recording: &Recording) -> Figure {
        match self {
            Self::Shapes => {
                let last = recording.len().saturating_sub(1);
                let count = SHAPES.min(recording.len());
                let records: Vec<usize> = (0..count).map(|i| i * last / (count - 1).max(1)).collect();
                shapes("Shapes over time", recording, &records)
            }
            Self::Traces => traces("Nodes over time", recording),
            Self::Spectrum => spectrum("Spectrum", recording),
        }
    }
}

/// Shapes in some records, one panel each with its time, and the floor of robots on the ground.
pub fn shapes(title: &str, recording: &Recording, records: &[usize]) -> Figure {
    let mut figure = Figure::new(title, "x (mm)", "z (mm)");
    for (i, &record) in records.iter().enumerate() {
        if i > 0 {
            figure.panel("z (mm)");
        }
        figure.filled_aspect().panel_title(&format!("{} ms", significant((1e4 * recording.time[record]).round() / 10.0, 7)));
        if recording.meta.ground.is_some() {
            figure.floor();
        }
        figure.robot("", shape(recording, record), "#0072b2");
    }
    figure
}

/// Settings of the experiment from the metadata of a recording.
fn setting(recording: &Recording) -> String {
    let meta = &recording.meta;
    let plural = |n: usize, thing: &str| format!("{n} {thing}{}", if n == 1 { "" } else { "s" });
    let mut parts = vec![plural(meta.actuators, "actuator"), format!("m = {}", meta.motors_per_actuator)];
    // Drives without a frequency are recorded with 1 Hz.
    if meta.driven_frequency.is_finite() && meta.driven_frequency > 0.0 && meta.driven_frequency != 1.0 {
        parts.push(format!("{} Hz", significant(meta.driven_frequency, 4)));
    }
    parts.push(format!("damping_eta = {}", significant(meta.damping_eta, 4)));
    if let Some(ground) = &meta.ground {
        let (low, high) = (significant(ground.friction_low, 3), significant(ground.friction_high, 3));
        parts.push(if low == high { format!("friction {low}") } else { format!("friction {low} and {high}") });
    }
    parts.join(", ")
}

/// Positions x, z (mm) of the nodes in a record.
pub fn shape(recording: &Recording, record: usize) -> Vec<(f64, f64)> {
    (0..recording.nodes())
        .map(|node| {
            let [x, _, z] = recording.node(record, node);
            (mm_from_cm(x), mm_from_cm(z))
        })
        .collect()
}

/// Names and indices of left end, middle and right end.
fn watched(recording: &Recording) -> [(&'static str, usize); 3] {
    [("left end", 0), ("middle", recording.nodes() / 2), ("right end", recording.nodes() - 1)]
}

/// Height of a node in every record (mm).
fn height(recording: &Recording, node: usize) -> Vec<f64> {
    (0..recording.len()).map(|record| mm_from_cm(recording.node(record, node)[2])).collect()
}

/// Heights and travel of ends and middle over time, and the voltages of the actuators in strips below.
pub fn traces(title: &str, recording: &Recording) -> Figure {
    let mut figure = Figure::new(title, "time (ms)", "height z (mm)");
    let in_time = |values: Vec<f64>| recording.time.iter().zip(values).map(|(t, v)| (1e3 * t, v)).collect::<Vec<_>>();
    figure.from_zero();
    for (label, node) in watched(recording) {
        figure.series(label, in_time(height(recording, node)), Mark::Line);
    }
    figure.panel("travel along x (mm)");
    for (label, node) in watched(recording) {
        let x = |record: usize| mm_from_cm(recording.node(record, node)[0]);
        figure.series(label, in_time((0..recording.len()).map(|record| x(record) - x(0)).collect()), Mark::Line);
    }
    figure.panel("actuator voltage");
    let by_record: Vec<Vec<f64>> = (0..recording.len()).map(|record| voltages(recording, record)).collect();
    let mut groups: Vec<(Vec<usize>, Vec<f64>)> = Vec::new();
    for actuator in 0..recording.meta.actuators {
        let signal: Vec<f64> = by_record.iter().map(|volts| volts[actuator]).collect();
        match groups.iter_mut().find(|(_, other)| *other == signal) {
            Some((actuators, _)) => actuators.push(actuator + 1),
            None => groups.push((vec![actuator + 1], signal)),
        }
    }
    for (actuators, signal) in groups {
        let (low, high) = signal.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
        let remark = if low == high {
            format!("{} V", significant(low, 4))
        } else {
            format!("{} to {} V", significant(low, 4), significant(high, 4))
        };
        figure.strip(&numbers(&actuators), &remark, in_time(signal));
    }
    figure
}

/// A list of numbers, with runs of three or more as ranges: "1–3, 5".
fn numbers(list: &[usize]) -> String {
    let runs = list.chunk_by(|a, b| a + 1 == *b);
    let text = |run: &[usize]| match run {
        [first, _, .., last] => format!("{first}–{last}"),
        _ => run.iter().map(usize::to_string).collect::<Vec<_>>().join(", "),
    };
    runs.map(text).collect::<Vec<_>>().join(", ")
}

/// Amplitude spectra of the heights of ends and middle, up to 1.5 times the highest frequency with 1 % of the largest amplitude.
pub fn spectrum(title: &str, recording: &Recording) -> Figure {
    let mut figure = Figure::new(title, "frequency (Hz)", "amplitude of z (mm)");
    let spectra: Vec<_> = watched(recording)
        .into_iter()
        .map(|(label, node)| (label, amplitudes(&recording.time, &height(recording, node))))
        .collect();
    let highest = spectra.iter().flat_map(|(_, s)| s).map(|p| p.1).fold(0.0, f64::max);
    let limit = spectra.iter().flat_map(|(_, s)| s).filter(|p| p.1 > 0.01 * highest).map(|p| p.0).fold(0.0, f64::max);
    figure.from_zero();
    for (label, spectrum) in spectra {
        let shown: Vec<_> = spectrum.into_iter().filter(|p| p.0 <= 1.5 * limit).collect();
        let peak = shown.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1));
        // Peaks are in the legend, where they cannot overlap.
        let label = match peak.filter(|p| p.1 > 0.0) {
            Some((f, a)) => format!("{label}: {} mm at {} Hz", significant(a, 3), number(f, 1)),
            None => label.to_owned(),
        };
        figure.series(&label, shown, Mark::Line);
    }
    figure
}

/// Single-sided amplitude spectrum of a detrended signal with a Hann window: pairs of frequency (Hz) and amplitude.
///
/// ```text
/// A(f) = 2/Σw |Σ w_n x_n e^(−2πi f t_n)|,    w_n = (1 − cos 2πn/(N−1))/2
/// ```
///
/// at multiples of 1/(4 duration). A sine of many periods gives its amplitude at its frequency. Samples are interpolated to even spacing.
pub fn amplitudes(times: &[f64], values: &[f64]) -> Vec<(f64, f64)> {
    let n = times.len();
    if n < 4 {
        return Vec::new();
    }
    let (first, duration) = (times[0], times[n - 1] - times[0]);
    let step = duration / (n - 1) as f64;
    let even: Vec<f64> = (0..n)
        .map(|i| {
            let t = first + i as f64 * step;
            let after = times.partition_point(|&time| time < t).clamp(1, n - 1);
            let share = (t - times[after - 1]) / (times[after] - times[after - 1]);
            values[after - 1] + share * (values[after] - values[after - 1])
        })
        .collect();
    let middle = (n - 1) as f64 / 2.0;
    let mean = even.iter().sum::<f64>() / n as f64;
    let (up, down) = even.iter().enumerate().fold((0.0, 0.0), |(up, down), (i, x)| {
        let at = i as f64 - middle;
        (up + at * x, down + at * at)
    });
    let window = |i: usize| 0.5 - 0.5 * (2.0 * std::f64::consts::PI * i as f64 / (n - 1) as f64).cos();
    let weighted: Vec<f64> =
        even.iter().enumerate().map(|(i, x)| window(i) * (x - mean - up / down * (i as f64 - middle))).collect();
    let weight = (n - 1) as f64 / 2.0;
    // Up to half the sampling rate.
    chirp_transform(&weighted, 4 * (n - 1), 2 * n - 1)
        .into_iter()
        .enumerate()
        .skip(1)
        .map(|(k, [c, s])| (0.25 * k as f64 / duration, 2.0 / weight * f64::hypot(c, s)))
        .collect()
}

/// Σ x_n e^(−2πi k n/size) for k below `count`, by Bluestein's algorithm.
///
/// # References
/// L. I. Bluestein, IEEE Trans. Audio Electroacoust. 18 (1970).
fn chirp_transform(x: &[f64], size: usize, count: usize) -> Vec<[f64; 2]> {
    let length = (x.len() + count).next_power_of_two();
    // e^(−πi n²/size), with n² reduced so that its sine stays exact.
    let chirp = |n: usize| {
        let turn = (n * n % (2 * size)) as f64 / size as f64;
        let (sin, cos) = (std::f64::consts::PI * turn).sin_cos();
        [cos, -sin]
    };
    let mut signal = vec![[0.0; 2]; length];
    for (n, value) in x.iter().enumerate() {
        signal[n] = chirp(n).map(|part| value * part);
    }
    let mut filter = vec![[0.0; 2]; length];
    for n in 0..x.len().max(count) {
        let [c, s] = chirp(n);
        if n < count {
            filter[n] = [c, -s];
        }
        if n > 0 && n < x.len() {
            filter[length - n] = [c, -s];
        }
    }
    fourier(&mut signal);
    fourier(&mut filter);
    // The inverse is the transform of the conjugate.
    signal.iter_mut().zip(&filter).for_each(|(a, b)| {
        let [re, im] = times(*a, *b);
        *a = [re, -im];
    });
    fourier(&mut signal);
    let scale = 1.0 / length as f64;
    (0..count).map(|k| times(chirp(k), [scale * signal[k][0], -scale * signal[k][1]])).collect()
}

fn times([a, b]: [f64; 2], [c, d]: [f64; 2]) -> [f64; 2] {
    [a * c - b * d, a * d + b * c]
}

/// In-place radix-2 Fourier transform; the length is a power of two.
fn fourier(values: &mut [[f64; 2]]) {
    let n = values.len();
    let bits = n.trailing_zeros();
    if bits == 0 {
        return;
    }
    for i in 0..n {
        let j = i.reverse_bits() >> (usize::BITS - bits);
        if i < j {
            values.swap(i, j);
        }
    }
    let mut half = 1;
    while half < n {
        let turns: Vec<[f64; 2]> = (0..half)
            .map(|k| {
                let (sin, cos) = (-std::f64::consts::PI * k as f64 / half as f64).sin_cos();
                [cos, sin]
            })
            .collect();
        for block in values.chunks_mut(2 * half) {
            let (low, high) = block.split_at_mut(half);
            for ((a, b), turn) in low.iter_mut().zip(high).zip(&turns) {
                let turned = times(*b, *turn);
                *b = [a[0] - turned[0], a[1] - turned[1]];
                *a = [a[0] + turned[0], a[1] + turned[1]];
            }
        }
        half *= 2;
    }
}

/// Number of harmonics of the drive that should lie below half the record rate.
const HARMONICS: f64 = 5.0;

/// A warning if the drive or its first harmonics lie above half the record rate and alias in a spectrum.
pub fn aliased(recording: &Recording) -> Option<String> {
    let (&first, &last) = (recording.time.first()?, recording.time.last()?);
    let half = 0.5 * (recording.len() - 1) as f64 / (last - first);
    let meta = &recording.meta;
    let drive = match &meta.ground {
        Some(ground) if ground.period > 0.0 => 1.0 / ground.period,
        // Drives without a frequency are recorded with 1 Hz.
        _ if meta.driven_frequency == 1.0 && recording.motor_voltages.windows(2).all(|pair| pair[0] == pair[1]) => return None,
        _ => meta.driven_frequency,
    };
    let short = |frequency: f64| words::number((1e4 * frequency).round() / 1e4);
    let what = if drive > half {
        "the drive".to_owned()
    } else if HARMONICS * drive > half {
        format!("harmonics of the drive from number {:.0} on", (half / drive).floor() + 1.0)
    } else {
        return None;
    };
    Some(format!(
        "{what} ({} Hz) is above half the record rate, {} Hz, and shows at wrong frequencies; record more often than every {:.1e} s",
        short(drive),
        short(half),
        0.5 / (HARMONICS * drive)
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_has_its_amplitude_at_its_frequency_whatever_it_drifts_by() {
        let times: Vec<f64> = (0..=1000).map(|i| f64::from(i) * 1e-3).collect();
        let values: Vec<f64> = times.iter().map(|t| 3.0 + t + 2.0 * (2.0 * std::f64::consts::PI * 14.0 * t).cos()).collect();
        let spectrum = amplitudes(&times, &values);
        let (f, a) = spectrum.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        // The straight line through a cosine of whole periods is level to 1/N.
        assert!((f - 14.0).abs() < 1e-9 && (a - 2.0).abs() < 0.01, "{f} {a}");
        assert!(amplitudes(&times[..3], &values[..3]).is_empty());
    }

    /// 400 Hz in one second of records every millisecond: beyond three hundred over the duration.
    #[test]
    fn a_spectrum_goes_up_to_half_the_record_rate() {
        let times: Vec<f64> = (0..=1000).map(|i| f64::from(i) * 1e-3).collect();
        let values: Vec<f64> = times.iter().map(|t| 0.3 * (2.0 * std::f64::consts::PI * 400.0 * t).cos()).collect();
        let spectrum = amplitudes(&times, &values);
        let (f, a) = spectrum.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        assert!((f - 400.0).abs() < 1e-9 && (a - 0.3).abs() < 0.002, "{f} {a}");
        assert!((spectrum[spectrum.len() - 1].0 - 500.0).abs() < 0.3);
    }

    #[test]
    fn a_drive_or_harmonics_above_half_the_record_rate_are_told() {
        let recorded = |interval: f64| {
            let ground =
                crate::recording::GroundMeta { friction_low: 1.0, friction_high: 1.0, period: 0.1, date_time: String::new() };
            let meta = crate::recording::Meta { ground: Some(ground), ..Default::default() };
            aliased(&Recording { meta, time: (0..100).map(|i| interval * f64::from(i)).collect(), ..Default::default() })
        };
        assert_eq!(recorded(0.009), None);
        assert!(recorded(0.02).unwrap().contains("harmonics of the drive from number 3 on"), "{:?}", recorded(0.02));
        assert!(recorded(0.06).unwrap().starts_with("the drive (10 Hz) is above"), "{:?}", recorded(0.06));
    }
}
