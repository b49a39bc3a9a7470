//! Faults of a bench, on top of whatever is hidden: its clock, its zero, its amplifier, its camera and what it says of its noise.

use super::protocol::{RUNS, Run, Wave};
use super::random::Random;
use super::{Case, Markers};

/// Rows per second of the logger of the voltage.
const LOGGER_HZ: f64 = 480.0;

/// Sizes of the faults; the default has none.
#[derive(Clone)]
pub struct Bench {
    /// Standard deviation of the camera's clock against the drive's, run by run.
    pub clock_ms: f64,
    /// Standard deviation of the zero of each channel and run.
    pub zero_mm: f64,
    /// Standard deviation of the gain of the amplifier from run to run, as a share.
    pub gain: f64,
    /// Standard deviation of the drift of each channel and run.
    pub drift_mm_per_s: f64,
    /// Correlation time of half of the noise's variance; 0: all of it is white.
    pub correlation_s: f64,
    /// Frames per second of the camera; 0: the rows of the runs.
    pub frames_per_s: f64,
    /// Noise written to dataset.toml over the true one; none: there is no table.
    pub stated_noise: Option<f64>,
}

impl Default for Bench {
    fn default() -> Bench {
        Bench {
            clock_ms: 0.0,
            zero_mm: 0.0,
            gain: 0.0,
            drift_mm_per_s: 0.0,
            correlation_s: 0.0,
            frames_per_s: 0.0,
            stated_noise: Some(1.0),
        }
    }
}

/// Words before the colon of an id.
pub const WORDS: [&str; 11] =
    ["bench", "clock", "zero", "gain", "drift", "ar", "fps60", "fps120", "sigma2", "sigmahalf", "nosigma"];

impl Bench {
    /// The bench of a word; all faults but the drift for `bench`. None if the word is no fault.
    pub fn of(word: &str, seed: u64) -> Option<Bench> {
        let none = Bench::default();
        Some(match word {
            "bench" => Bench {
                clock_ms: 4.0,
                zero_mm: 0.2,
                gain: 0.01,
                correlation_s: 0.03,
                frames_per_s: if seed % 2 == 1 { 60.0 } else { 120.0 },
                stated_noise: [Some(2.0), Some(0.5), None][(seed % 3) as usize],
                ..none
            },
            "clock" => Bench { clock_ms: 4.0, ..none },
            "zero" => Bench { zero_mm: 0.2, ..none },
            "gain" => Bench { gain: 0.01, ..none },
            "drift" => Bench { drift_mm_per_s: 0.03, ..none },
            "ar" => Bench { correlation_s: 0.03, ..none },
            "fps60" => Bench { frames_per_s: 60.0, ..none },
            "fps120" => Bench { frames_per_s: 120.0, ..none },
            "sigma2" => Bench { stated_noise: Some(2.0), ..none },
            "sigmahalf" => Bench { stated_noise: Some(0.5), ..none },
            "nosigma" => Bench { stated_noise: None, ..none },
            _ => return None,
        })
    }

    /// Times of the rows of a run: those of the frames, or of the logger where it is needed.
    pub fn times(&self, run: &Run) -> Vec<f64> {
        if self.frames_per_s <= 0.0 {
            return run.times();
        }
        let rate = self.frames_per_s * self.rows_per_frame(run) as f64;
        let rows = (run.duration * rate + 1e-6) as usize;
        (0..=rows).map(|i| i as f64 / rate).collect()
    }

    /// Rows of a run for each frame. A drive with fewer than twenty frames in a period is logged at 480 Hz, with empty cells between the frames:
    /// the program refuses voltages in fewer rows.
    pub fn rows_per_frame(&self, run: &Run) -> usize {
        let hertz = match run.wave {
            Wave::Sine { hertz, .. } | Wave::Square { hertz, .. } => hertz,
            _ => 0.0,
        };
        if self.frames_per_s > 0.0 && 20.0 * hertz > self.frames_per_s { (LOGGER_HZ / self.frames_per_s) as usize } else { 1 }
    }

    /// Decimals of the times in the files.
    pub fn decimals(&self) -> usize {
        if self.frames_per_s > 0.0 { 6 } else { 4 }
    }

    /// True if the motion is not the one that a perfect bench films.
    pub fn films_anew(&self) -> bool {
        self.clock_ms > 0.0 || self.gain > 0.0 || self.frames_per_s > 0.0
    }
}

/// Faults drawn for a run.
pub struct Faults {
    pub clock_s: f64,
    pub gain: f64,
    zero_mm: [f64; 4],
    drift_mm_per_s: [f64; 4],
}

impl Faults {
    /// Faults of every run. Each kind has its own random numbers, so that it is the same alone and with the others.
    pub fn draw(bench: &Bench, seed: u64) -> [Faults; RUNS.len()] {
        let stream = |purpose: &str| Random::with_purpose(seed, &format!("bench {purpose}"));
        let (mut clock, mut zero, mut gain, mut drift) = (stream("clock"), stream("zero"), stream("gain"), stream("drift"));
        std::array::from_fn(|_| Faults {
            clock_s: 1e-3 * bench.clock_ms * clock.normal(),
            gain: 1.0 + bench.gain * gain.normal(),
            zero_mm: std::array::from_fn(|_| bench.zero_mm * zero.normal()),
            drift_mm_per_s: std::array::from_fn(|_| bench.drift_mm_per_s * drift.normal()),
        })
    }

    /// Moves the markers by the zero and the drift.
    pub fn shift(&self, rows: &mut Markers, times: &[f64]) {
        for (row, t) in rows.iter_mut().zip(times) {
            for (channel, value) in row.iter_mut().enumerate() {
                *value += self.zero_mm[channel] + self.drift_mm_per_s[channel] * t;
            }
        }
    }
}

/// Adds noise of which half the variance is white and half is a first-order autoregression in time.
pub fn add_correlated_noise(rows: &mut Markers, times: &[f64], case: &Case, correlation_s: f64, random: &mut Random) {
    let mut slow: [f64; 4] = std::array::from_fn(|_| random.normal());
    let mut before = times[0];
    for (row, t) in rows.iter_mut().zip(times) {
        let kept = (-(t - before) / correlation_s).exp();
        before = *t;
        for (value, slow) in row.iter_mut().zip(&mut slow) {
            *slow = kept * *slow + (1.0 - kept * kept).sqrt() * random.normal();
            *value += case.noise_mm * std::f64::consts::FRAC_1_SQRT_2 * (*slow + random.normal());
        }
    }
}
