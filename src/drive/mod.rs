//! What voltage each actuator gets, when.
//!
//! A positive voltage bends an actuator's far end up, a negative one down. The piezo can take −1500 V to +520 V in the reference's
//! model; the real robot was driven with +300 V where the model applies +520 V, which `positive_gain = 1.733` expresses.

mod check;
pub mod gait;
mod table;

pub use check::DriveError;
pub(crate) use check::check_positive_gain;
pub use gait::Gait;
pub use table::{Table, TableError};

use std::borrow::Cow;
use std::f64::consts::PI;

use table::Reached;

/// Share of a time that sums of a few times err by at most.
const ROUNDING: f64 = 1e-12;

/// A voltage waveform for all actuators.
#[derive(Debug, Clone, PartialEq)]
pub enum Waveform {
    /// A gait of five actuators with its period, delay or on-time p (s).
    Gait {
        /// Which.
        gait: &'static Gait,
        /// Its number p (s); 0 for a gait that takes none.
        parameter: f64,
        /// The voltage of each actuator when it is on (V).
        on_voltages: Vec<f64>,
    },
    /// Constant voltages (V).
    Dc(Vec<f64>),
    /// `V = A/2 (1 − cos 2πft)`, which starts at rest and reaches A.
    Sine {
        /// A of each actuator (V).
        amplitudes: Vec<f64>,
        /// f (Hz).
        frequency: f64,
    },
    /// 0 V, then constant voltages.
    Step {
        /// The voltages after the step (V).
        voltages: Vec<f64>,
        /// When (s).
        at: f64,
    },
    /// Phases of constant voltages, repeated with a period or passed once.
    Sequence {
        /// Length of a repetition (s); `None` passes the phases once.
        period: Option<f64>,
        /// End (s) and voltages (V) of each phase, in order. The last phase's voltages hold from there on.
        phases: Vec<(f64, Vec<f64>)>,
    },
    /// A table, linear between rows.
    Table(Table),
}

/// A waveform and the factor on its positive part.
#[derive(Debug, Clone, PartialEq)]
pub struct Drive {
    /// The waveform.
    pub waveform: Waveform,
    /// Factor on positive voltages (–).
    pub positive_gain: f64,
    /// How much later than commanded it acts (s); before, what the waveform begins with.
    pub delay: f64,
}

impl Drive {
    /// A waveform as it is, without gain or delay.
    pub fn new(waveform: Waveform) -> Self {
        Self { waveform, positive_gain: 1.0, delay: 0.0 }
    }

    /// Constant voltages (V), one per actuator.
    pub fn dc(voltages: impl Into<Vec<f64>>) -> Self {
        Self::new(Waveform::Dc(voltages.into()))
    }

    /// `V = A/2 (1 − cos 2πft)` with an amplitude A (V) per actuator and the frequency f (Hz).
    pub fn sine(amplitudes: impl Into<Vec<f64>>, frequency: f64) -> Self {
        Self::new(Waveform::Sine { amplitudes: amplitudes.into(), frequency })
    }

    /// A gait by its name, with its period, delay or on-time (s), at [`gait::DEFAULT_ON_VOLTAGES`].
    ///
    /// # Errors
    /// [`DriveError::UnknownGait`].
    pub fn gait(name: &str, parameter: f64) -> Result<Self, DriveError> {
        let gait = gait::find(name).ok_or_else(|| DriveError::UnknownGait(name.into()))?;
        Ok(Self::new(Waveform::Gait { gait, parameter, on_voltages: gait::DEFAULT_ON_VOLTAGES.to_vec() }))
    }

    /// With a factor on positive voltages (–).
    #[must_use]
    pub fn with_positive_gain(self, positive_gain: f64) -> Self {
        Self { positive_gain, ..self }
    }

    /// With a delay (s).
    #[must_use]
    pub fn with_delay_s(self, delay: f64) -> Self {
        Self { delay, ..self }
    }

    /// Writes the voltages (V) at the beginning of a step of `h` (s), at its end and at the end of the next one to `out`.
    pub(crate) fn ahead(&self, step: u64, h: f64, out: &mut [Vec<f64>; 3]) {
        (step..).zip(out).for_each(|(step, volts)| self.voltages(step as f64 * h, volts));
    }

    /// Writes the voltages (V) that reach the torque law at time `t` (s) to `out`, one per actuator.
    pub fn voltages(&self, t: f64, out: &mut [f64]) {
        let t = if self.delay == 0.0 { t } else { (t - self.delay).max(0.0) };
        match &self.waveform {
            Waveform::Gait { gait, parameter, on_voltages } => {
                let mask = gait.mask(t, *parameter).bytes();
                for ((out, &on), bit) in out.iter_mut().zip(on_voltages).zip(mask) {
                    *out = if bit == b'1' { on } else { 0.0 };
                }
            }
            Waveform::Dc(voltages) => out.copy_from_slice(voltages),
            Waveform::Sine { amplitudes, frequency } => {
                // The products run from left to right, as in the reference.
                let swing = 1.0 - (2.0 * PI * frequency * t).cos();
                for (out, amplitude) in out.iter_mut().zip(amplitudes) {
                    *out = amplitude / 2.0 * swing;
                }
            }
            Waveform::Step { voltages, at } => {
                if t < *at {
                    out.fill(0.0);
                } else {
                    out.copy_from_slice(voltages);
                }
            }
            Waveform::Sequence { period, phases } => {
                let t = period.map_or(t, |period| t % period);
                if let Some((_, voltages)) = phases.iter().find(|(until, _)| t < *until).or(phases.last()) {
                    out.copy_from_slice(voltages);
                }
            }
            Waveform::Table(table) => table.at(t, out),
        }
        if self.positive_gain != 1.0 {
            for v in out.iter_mut().filter(|v| **v > 0.0) {
                *v *= self.positive_gain;
            }
        }
    }

    /// True if voltages change by jumps only.
    fn jumps(&self) -> bool {
        !matches!(self.waveform, Waveform::Sine { .. } | Waveform::Table(_))
    }

    /// A time (s) up to which the voltages are those at `t`: their next jump, but for what rounding may move it by.
    fn holds_until(&self, t: f64) -> f64 {
        let t = if self.delay == 0.0 { t } else { (t - self.delay).max(0.0) };
        let jump = match &self.waveform {
            Waveform::Gait { gait, parameter, .. } => gait.phase_end(t, *parameter),
            Waveform::Dc(_) => f64::INFINITY,
            Waveform::Step { at, .. } if t < *at => *at,
            Waveform::Step { .. } => f64::INFINITY,
            Waveform::Sequence { period, phases } => {
                let period = period.unwrap_or(f64::INFINITY);
                let within = t % period;
                let end = phases.iter().map(|(until, _)| *until).find(|until| within < *until);
                t + (end.unwrap_or(f64::INFINITY).min(period) - within)
            }
            Waveform::Sine { .. } | Waveform::Table(_) => t,
        };
        (jump + self.delay) * (1.0 - ROUNDING)
    }

    /// The next time (s) after `t` at which voltages jump, but for what rounding may move it by; none of what changes smoothly, or a table.
    pub(crate) fn next_jump(&self, t: f64) -> f64 {
        if self.jumps() { self.holds_until(t) } else { f64::INFINITY }
    }

    /// Writes the mean voltages (V) from `from` to `to` (s), between which none jumps: what changes smoothly is taken at the middle, and a
    /// table's lines are integrated.
    pub(crate) fn mean_without_jump(&self, from: f64, to: f64, out: &mut [f64]) {
        match self.plain_table() {
            Some(table) => table.mean(from - self.delay, to - self.delay, out),
            None => self.voltages(0.5 * (from + to), out),
        }
    }

    /// The table, if its lines are the voltages; then their mean is exact, also where a table jumps.
    fn plain_table(&self) -> Option<&Table> {
        match &self.waveform {
            Waveform::Table(table) if self.positive_gain == 1.0 => Some(table),
            _ => None,
        }
    }

    /// The period of the waveform (s), if it repeats.
    pub fn period(&self) -> Option<f64> {
        match &self.waveform {
            Waveform::Gait { gait, parameter, .. } if !gait.cycle.is_empty() => Some(*parameter),
            Waveform::Sine { frequency, .. } => Some(1.0 / frequency),
            Waveform::Sequence { period, .. } => *period,
            _ => None,
        }
    }
}

/// The mean voltages of a drive over stretches of time that follow on each other.
#[derive(Debug, Clone)]
pub struct Means<'a> {
    drive: Cow<'a, Drive>,
    /// Voltages at the start of the coming stretch (V), and until when (s) they hold.
    start: Vec<f64>,
    until: f64,
    /// How far a table's lines are integrated.
    reached: Reached,
}

impl<'a> Means<'a> {
    /// Of `drive` for a number of actuators, from the time `start` (s) on.
    pub fn new(drive: &'a Drive, actuators: usize, start: f64) -> Self {
        Self::of(Cow::Borrowed(drive), actuators, start)
    }

    pub(crate) fn of(drive: Cow<'a, Drive>, actuators: usize, start: f64) -> Self {
        let mut means = Self { drive, start: vec![0.0; actuators], until: start, reached: Reached::default() };
        means.restart(start);
        means
    }

    /// Begins anew at the time `start` (s).
    pub(crate) fn restart(&mut self, start: f64) {
        self.drive.voltages(start, &mut self.start);
        self.until = self.drive.holds_until(start);
    }

    /// The drive itself.
    pub(crate) fn drive(&self) -> &Drive {
        &self.drive
    }

    /// Mean voltages (V) from `from` to `to` (s) into `out`: a jump within counts from its moment on, what changes smoothly is taken at the
    /// middle, and a table's lines are integrated.
    pub fn over(&mut self, from: f64, to: f64, out: &mut [f64]) {
        if to < self.until {
            return out.copy_from_slice(&self.start);
        }
        let drive = self.drive.as_ref();
        if let Some(table) = drive.plain_table() {
            return table.mean_onwards(from - drive.delay, to - drive.delay, &mut self.reached, out);
        }
        if !drive.jumps() {
            return drive.mean_without_jump(from, to, out);
        }
        drive.voltages(to, out);
        self.until = drive.holds_until(to);
        let Some(first) = out.iter().zip(&self.start).position(|(end, start)| end != start) else {
            return self.start.copy_from_slice(out);
        };
        // The jump lies between `before` and `after`.
        let (mut before, mut after) = (from, to);
        loop {
            let middle = 0.5 * (before + after);
            if middle <= before || middle >= after {
                break;
            }
            drive.voltages(middle, out);
            if out[first] == self.start[first] { before = middle } else { after = middle }
        }
        drive.voltages(to, out);
        let share = (after - from) / (to - from);
        for (out, start) in out.iter_mut().zip(&mut self.start) {
            let end = *out;
            *out = share * *start + (1.0 - share) * end;
            *start = end;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_over_a_step_counts_a_jump_from_its_moment_on() {
        let drive = Drive::new(Waveform::Step { voltages: vec![-1000.0, 300.0], at: 0.3 }).with_positive_gain(2.0);
        let (mut means, mut mean) = (Means::new(&drive, 2, 0.0), vec![f64::NAN; 2]);
        means.over(0.0, 0.1, &mut mean);
        assert_eq!(mean, [0.0, 0.0]);
        means.over(0.1, 0.5, &mut mean);
        assert!((mean[0] + 500.0).abs() < 1e-9 && (mean[1] - 300.0).abs() < 1e-9, "{mean:?}");
        means.over(0.5, 0.6, &mut mean);
        assert_eq!(mean, [-1000.0, 600.0]);
        let sine = Drive::sine([-2.0], 1.0);
        Means::new(&sine, 1, 0.2).over(0.2, 0.3, &mut mean[..1]);
        assert!((mean[0] + 1.0).abs() < 1e-12);
    }

    #[test]
    fn voltages_hold_until_just_before_their_next_jump() {
        let sequence = |period| Waveform::Sequence { period, phases: vec![(0.03, vec![1.0; 5]), (0.1, vec![2.0; 5])] };
        let gaits = gait::GAITS.iter().flat_map(|gait| {
            let negative = (!gait.once_if_negative.is_empty()).then_some(-0.02);
            let parameters = [0.07].into_iter().chain(negative);
            parameters.map(move |parameter| Waveform::Gait { gait, parameter, on_voltages: vec![-1500.0; 5] })
        });
        let others =
            [sequence(None), sequence(Some(0.07)), sequence(Some(0.2)), Waveform::Step { voltages: vec![7.0; 5], at: 0.1 }];
        for waveform in gaits.chain(others) {
            for delay in [0.0, 0.0123] {
                let drive = Drive::new(waveform.clone()).with_delay_s(delay);
                let of = |t: f64| {
                    let mut out = [f64::NAN; 5];
                    drive.voltages(t, &mut out);
                    out
                };
                for t in (0..100).map(|i| 0.0037 * f64::from(i)) {
                    let length = drive.holds_until(t).min(10.0) - t;
                    assert!((0..50).all(|i| of(t + length.max(0.0) * f64::from(i) / 50.0) == of(t)), "{drive:?} {t} {length}");
                }
                assert!(drive.holds_until(0.001) > 0.013, "{drive:?}");
            }
        }
    }

    fn at(waveform: Waveform, gain: f64, t: f64) -> Vec<f64> {
        let mut out = vec![f64::NAN; 2];
        Drive::new(waveform).with_positive_gain(gain).voltages(t, &mut out);
        out
    }

    #[test]
    fn a_sine_starts_at_rest_and_reaches_its_amplitude_in_half_a_period() {
        let sine = || Waveform::Sine { amplitudes: vec![-1500.0, 300.0], frequency: 10.0 };
        assert_eq!(at(sine(), 1.0, 0.0), [0.0, 0.0]);
        assert_eq!(at(sine(), 1.0, 0.05), [-1500.0, 300.0]);
    }

    #[test]
    fn the_positive_gain_leaves_negative_voltages_alone() {
        assert_eq!(at(Waveform::Dc(vec![-1500.0, 300.0]), 1.5, 0.0), [-1500.0, 450.0]);
    }

    #[test]
    fn a_step_and_a_sequence_change_where_they_should() {
        let step = || Waveform::Step { voltages: vec![1.0, 2.0], at: 0.5 };
        assert_eq!(at(step(), 1.0, 0.49), [0.0, 0.0]);
        assert_eq!(at(step(), 1.0, 0.5), [1.0, 2.0]);
        let phases = vec![(0.25, vec![1.0, 0.0]), (0.5, vec![2.0, 0.0])];
        let repeated = || Waveform::Sequence { period: Some(1.0), phases: phases.clone() };
        let once = || Waveform::Sequence { period: None, phases: phases.clone() };
        assert_eq!(at(repeated(), 1.0, 0.3)[0], 2.0);
        assert_eq!(at(repeated(), 1.0, 0.9)[0], 2.0);
        assert_eq!(at(repeated(), 1.0, 1.1)[0], 1.0);
        assert_eq!(at(once(), 1.0, 1.1)[0], 2.0);
    }
}
