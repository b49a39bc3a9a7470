//! Drives that fit a robot.

use thiserror::Error;

use super::gait::{self, Parameter};
use super::{Drive, Waveform};
use crate::model::{ModelError, Robot};
use crate::words::{not_one_of, number};

/// A drive that a robot cannot be given.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum DriveError {
    /// Not one voltage per actuator.
    #[error("{given} voltages for a robot of {needed} actuators")]
    Count {
        /// How many there are.
        given: usize,
        /// How many there must be.
        needed: usize,
    },
    /// A voltage that is not finite, or more than the material bears.
    #[error("a voltage of the drive {0}")]
    Voltage(String),
    /// A number of the waveform out of range.
    #[error("the drive's {what} is {}, but must be {needed}", number(*.value))]
    Value {
        /// Which number, with its unit.
        what: &'static str,
        /// Its value.
        value: f64,
        /// The range that is accepted.
        needed: &'static str,
    },
    /// A sequence without voltages.
    #[error("the drive has no voltages")]
    Empty,
    /// No such gait.
    #[error("gait: {}", not_one_of(.0, &gait::GAITS.map(|gait| gait.name)))]
    UnknownGait(String),
    /// A positive gain out of range.
    #[error(transparent)]
    Gain(#[from] ModelError),
}

/// Checks the factor on positive voltages (–).
pub(crate) fn check_positive_gain(gain: f64) -> Result<(), ModelError> {
    ModelError::unless(gain.is_finite() && gain > 0.0, "robot.positive_gain", gain, "positive")
}

fn unless(holds: bool, what: &'static str, value: f64, needed: &'static str) -> Result<(), DriveError> {
    if holds { Ok(()) } else { Err(DriveError::Value { what, value, needed }) }
}

fn positive(what: &'static str, value: f64) -> Result<(), DriveError> {
    unless(value.is_finite() && value > 0.0, what, value, "positive")
}

impl Drive {
    /// Checks that there is one voltage per actuator, which the material bears, and that times and frequencies are in range.
    ///
    /// # Errors
    /// [`DriveError`] says what does not fit the robot.
    pub fn check(&self, robot: &Robot) -> Result<(), DriveError> {
        check_positive_gain(self.positive_gain)?;
        unless(self.delay.is_finite(), "delay (s)", self.delay, "a finite number")?;
        let voltages = |voltages: &[f64]| self.check_voltages(voltages, robot);
        match &self.waveform {
            Waveform::Gait { gait, parameter, on_voltages } => {
                voltages(on_voltages)?;
                let p = *parameter;
                let count = gait::DEFAULT_ON_VOLTAGES.len();
                if robot.actuators != count {
                    return Err(DriveError::Count { given: count, needed: robot.actuators });
                }
                match gait.parameter {
                    Parameter::Nothing => Ok(()),
                    Parameter::Period => positive("period (s)", p),
                    _ if !gait.once_if_negative.is_empty() => unless(p.is_finite(), "delay (s)", p, "a finite number"),
                    _ => unless(p.is_finite() && p >= 0.0, "delay or on-time (s)", p, "zero or more"),
                }
            }
            Waveform::Dc(values) => voltages(values),
            Waveform::Sine { amplitudes, frequency } => {
                voltages(amplitudes)?;
                positive("frequency (Hz)", *frequency)?;
                positive("period (s)", 1.0 / frequency)
            }
            Waveform::Step { voltages: values, at } => {
                voltages(values)?;
                unless(at.is_finite(), "step time (s)", *at, "a finite number")
            }
            Waveform::Sequence { period, phases } => {
                period.map_or(Ok(()), |period| positive("period (s)", period))?;
                let mut last = 0.0;
                for (until, values) in phases {
                    unless(*until > last, "phase end (s)", *until, "later than the one before")?;
                    voltages(values)?;
                    last = *until;
                }
                if phases.is_empty() { Err(DriveError::Empty) } else { Ok(()) }
            }
            Waveform::Table(table) => (0..table.times().len()).try_for_each(|row| voltages(table.row(row))),
        }
    }

    fn check_voltages(&self, voltages: &[f64], robot: &Robot) -> Result<(), DriveError> {
        if voltages.len() != robot.actuators {
            return Err(DriveError::Count { given: voltages.len(), needed: robot.actuators });
        }
        let check = |&voltage: &f64| robot.check_voltage(voltage, self.positive_gain).map_err(DriveError::Voltage);
        voltages.iter().try_for_each(check)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drives_that_do_not_fit_are_refused() {
        let one = Robot::cantilever();
        let sequence = |period, phases| Drive::new(Waveform::Sequence { period, phases });
        let gait = |name, parameter| Drive::gait(name, parameter).unwrap();
        for (drive, words) in [
            (Drive::dc([]), "0 voltages for a robot of 1 actuators"),
            (Drive::dc([1.0, 2.0]), "2 voltages"),
            (Drive::dc([f64::NAN]), "NaN V"),
            (Drive::dc([f64::INFINITY]), "bears at most 2000 V"),
            (Drive::dc([1500.0]).with_positive_gain(1.733), "times positive_gain 2599.5 V"),
            (Drive::dc([0.0]).with_positive_gain(-1.0), "robot.positive_gain is -1, but must be positive"),
            (Drive::dc([0.0]).with_delay_s(f64::NAN), "delay (s)"),
            (Drive::sine([1.0], 0.0), "frequency (Hz) is 0, but must be positive"),
            (Drive::new(Waveform::Step { voltages: vec![1.0], at: f64::NAN }), "step time"),
            (sequence(None, Vec::new()), "no voltages"),
            (sequence(Some(0.0), vec![(1.0, vec![1.0])]), "period"),
            (sequence(None, vec![(1.0, vec![1.0]), (1.0, vec![2.0])]), "phase end"),
            (sequence(None, vec![(f64::NAN, vec![1.0])]), "phase end"),
            (gait("crawl", 0.1), "5 voltages for a robot of 1 actuators"),
        ] {
            let error = drive.check(&one).unwrap_err().to_string();
            assert!(error.contains(words), "{drive:?}: {error}");
        }
        let five = Robot::crawler();
        for broken in [gait("crawl", 0.0), gait("crawl", f64::NAN), gait("mover-delay", -1.0)] {
            assert!(matches!(broken.check(&five), Err(DriveError::Value { .. })), "{broken:?}");
        }
        for sound in [gait("crawl", 0.1), gait("jumper-delay", -0.02), gait("jumper", 0.0), Drive::sine([-1500.0; 5], 14.0)] {
            assert_eq!(sound.check(&five), Ok(()), "{sound:?}");
        }
        assert!(Drive::gait("craul", 0.1).unwrap_err().to_string().contains("crawl"));
    }
}
