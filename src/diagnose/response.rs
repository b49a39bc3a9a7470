//! Steady vibrations under sines, as frequency responses show them.

use std::f64::consts::{PI, TAU};

use super::dataset::Response;
use crate::drive::Table;
use crate::model::Robot;

/// Samples of a period: those of the voltage, and those of the motion, whose mean products with sine and cosine are then exact up to the 20th harmonic.
const SAMPLES: usize = 40;
/// The amplitude rises over this many time constants of the first mode's decay, ...
const RISE: f64 = 3.0;
/// ... and vibrations are steady after this many.
const STEADY: f64 = 7.0;
/// Longest wait (s).
const LONGEST: f64 = 20.0;
/// Periods from the beginning of the sampled one to the end of the run.
const BEYOND: f64 = 1.5;

/// 2/(η ω²), the time (s) in which the first mode of a robot, at `first` (Hz), decays.
fn decay(robot: &Robot, first: f64) -> f64 {
    2.0 / (robot.damping.time() * (TAU * first).powi(2)).max(1e-9)
}

/// Beginning of the sampled period (s), a whole number of periods of a sine at `frequency` (Hz), for a time of decay (s).
fn from(decay: f64, frequency: f64) -> f64 {
    ((STEADY * decay).min(LONGEST) * frequency).ceil().max(2.0) / frequency
}

/// A sine and the times at which its response is sampled.
pub(super) struct Sine {
    frequency: f64,
    /// Beginning of the sampled period (s), a whole number of periods.
    from: f64,
    /// The voltages.
    pub table: Table,
}

impl Sine {
    /// A sine of a response at a frequency (Hz) for a robot whose first mode is at `first` (Hz); `applied` is the voltage (V) of a commanded one.
    pub fn new(response: &Response, frequency: f64, robot: &Robot, first: f64, applied: impl Fn(f64) -> f64) -> Self {
        let decay = decay(robot, first);
        let from = from(decay, frequency);
        let rise = (RISE * decay).min(0.5 * from);
        let count = ((from * frequency).round() as usize + 2) * SAMPLES;
        let times: Vec<f64> = (0..=count).map(|k| k as f64 / (SAMPLES as f64 * frequency)).collect();
        // Straight lines between the samples have a fundamental smaller by sinc².
        let line = PI / SAMPLES as f64;
        let whole = response.amplitude / (line.sin() / line).powi(2);
        let volt = |t: &f64| {
            let share = if *t < rise { 0.5 - 0.5 * (PI * t / rise).cos() } else { 1.0 };
            applied(response.offset + share * whole * (TAU * frequency * t).cos())
        };
        let volts: Vec<f64> = times.iter().flat_map(|t| std::iter::repeat_n(volt(t), robot.actuators)).collect();
        let table =
            Table::new(times, volts, robot.actuators).unwrap_or_else(|_| unreachable!("times rise and values are finite"));
        Self { frequency, from, table }
    }

    /// Length of the run (s).
    pub fn duration(&self) -> f64 {
        self.from + BEYOND / self.frequency
    }

    /// [`duration`](Self::duration) of a sine that need not be made for it.
    pub fn duration_of(frequency: f64, robot: &Robot, first: f64) -> f64 {
        from(decay(robot, first), frequency) + BEYOND / frequency
    }

    /// Times (s) of the samples of a period that begins later by `delay` (s).
    pub fn times(&self, delay: f64) -> Vec<f64> {
        (0..SAMPLES).map(|k| (self.from + k as f64 / (SAMPLES as f64 * self.frequency) + delay).max(0.0)).collect()
    }

    /// In-phase and quadrature part of the samples, each the mean over an exposure (s).
    pub fn parts(&self, samples: &[f64], exposure: f64) -> [f64; 2] {
        let mut parts = [0.0; 2];
        for (k, sample) in samples.iter().enumerate() {
            let (sin, cos) = (TAU * k as f64 / SAMPLES as f64).sin_cos();
            parts[0] += sample * cos;
            parts[1] -= sample * sin;
        }
        let half = PI * self.frequency * exposure;
        let blur = if half > 0.0 { half.sin() / half } else { 1.0 };
        parts.map(|part| 2.0 / SAMPLES as f64 * blur * part)
    }
}
