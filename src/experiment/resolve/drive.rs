//! The keys of `[drive]`: one waveform and what belongs to it.

use std::path::Path;

use super::super::config::{ConfigError, DriveConfig, Fault, PhaseConfig};
use super::drive_csv;
use super::driven::Driven;
use crate::drive::Waveform;
use crate::drive::gait::{self, Parameter};
use crate::words::{not_one_of, number};

/// The keys of `[drive]` that are present, for finding those that do not belong to the waveform.
fn present(d: &DriveConfig) -> Vec<&'static str> {
    [
        ("gait", d.gait.is_some()),
        ("period_s", d.period_s.is_some()),
        ("frequency_hz", d.frequency_hz.is_some()),
        ("delay_s", d.delay_s.is_some()),
        ("on_time_s", d.on_time_s.is_some()),
        ("on_voltages_v", d.on_voltages_v.is_some()),
        ("voltages_v", d.voltages_v.is_some()),
        ("amplitude_v", d.amplitude_v.is_some()),
        ("amplitudes_v", d.amplitudes_v.is_some()),
        ("at_s", d.at_s.is_some()),
        ("phases", d.phases.is_some()),
        ("file", d.file.is_some()),
    ]
    .into_iter()
    .filter_map(|(key, present)| present.then_some(key))
    .collect()
}

fn only(d: &DriveConfig, whose: &str, allowed: &[&str]) -> Result<(), Fault> {
    match present(d).into_iter().find(|key| !allowed.contains(key)) {
        Some(key) => {
            Err(Fault::new(format!("drive.{key}"), format!("does not belong to {whose}; it takes {}", allowed.join(", "))))
        }
        None => Ok(()),
    }
}

fn needed<'a, T>(key: &str, value: Option<&'a T>) -> Result<&'a T, Fault> {
    value.ok_or_else(|| Fault::new(key, "is missing"))
}

fn finite(key: &str, value: f64) -> Result<f64, Fault> {
    if value.is_finite() { Ok(value) } else { Err(Fault::new(key, format!("is {}, but must be a finite number", number(value)))) }
}

fn positive(key: &str, value: f64) -> Result<f64, Fault> {
    if finite(key, value)? > 0.0 {
        Ok(value)
    } else {
        Err(Fault::new(key, format!("is {}, but must be positive", number(value))))
    }
}

/// Checks that a voltage is a number that the material bears.
fn voltage(key: &str, value: f64, robot: &Driven) -> Result<f64, Fault> {
    robot.check_voltage(finite(key, value)?).map_err(|reason| Fault::new(key, reason))?;
    Ok(value)
}

/// Checks that there is one voltage per actuator, and each of them.
fn voltages(key: &str, values: &[f64], robot: &Driven) -> Result<Vec<f64>, Fault> {
    if values.len() != robot.actuators {
        return Err(Fault::new(key, format!("has {} values for {} actuators", values.len(), robot.actuators)));
    }
    values.iter().try_for_each(|&value| voltage(key, value, robot).map(drop))?;
    Ok(values.to_vec())
}

fn period(d: &DriveConfig) -> Result<Option<f64>, Fault> {
    match (d.period_s, d.frequency_hz) {
        (Some(_), Some(_)) => Err(Fault::new("drive.frequency_hz", "period_s is given as well; keep one of the two")),
        (Some(period), None) => positive("drive.period_s", period).map(Some),
        (None, Some(frequency)) => positive("drive.period_s", 1.0 / positive("drive.frequency_hz", frequency)?).map(Some),
        (None, None) => Ok(None),
    }
}

pub(super) fn waveform(d: &DriveConfig, robot: &Driven, first: f64, folder: &Path) -> Result<Waveform, ConfigError> {
    let name = needed("drive.waveform", d.waveform.as_ref())?;
    let own = format!("waveform {name}");
    Ok(match name.as_str() {
        "gait" => gait_waveform(d, robot)?,
        "dc" => {
            only(d, &own, &["voltages_v"])?;
            Waveform::Dc(voltages("drive.voltages_v", needed("drive.voltages_v", d.voltages_v.as_ref())?, robot)?)
        }
        "sine" => {
            only(d, &own, &["amplitude_v", "amplitudes_v", "frequency_hz"])?;
            let amplitudes = match (d.amplitude_v, &d.amplitudes_v) {
                (Some(_), Some(_)) => {
                    return Err(Fault::new("drive.amplitudes_v", "amplitude_v is given as well; keep one of the two").into());
                }
                (Some(amplitude), None) => vec![voltage("drive.amplitude_v", amplitude, robot)?; robot.actuators],
                (None, Some(amplitudes)) => voltages("drive.amplitudes_v", amplitudes, robot)?,
                (None, None) => return Err(Fault::new("drive.amplitude_v", "is missing").into()),
            };
            let frequency = positive("drive.frequency_hz", *needed("drive.frequency_hz", d.frequency_hz.as_ref())?)?;
            Waveform::Sine { amplitudes, frequency }
        }
        "step" => {
            only(d, &own, &["voltages_v", "at_s"])?;
            let at = finite("drive.at_s", d.at_s.unwrap_or(0.0))?;
            let values = needed("drive.voltages_v", d.voltages_v.as_ref())?;
            // The reference holds 0 V for the first two steps.
            Waveform::Step { voltages: voltages("drive.voltages_v", values, robot)?, at: at.max(first) }
        }
        "sequence" => sequence(d, robot)?,
        "csv" => {
            only(d, &own, &["file"])?;
            let path = folder.join(needed("drive.file", d.file.as_ref())?);
            Waveform::Table(drive_csv::read(&path, robot)?)
        }
        other => {
            let waveforms = ["gait", "dc", "sine", "step", "sequence", "csv"];
            return Err(Fault::new("drive.waveform", not_one_of(other, &waveforms)).into());
        }
    })
}

fn gait_waveform(d: &DriveConfig, robot: &Driven) -> Result<Waveform, Fault> {
    let name = needed("drive.gait", d.gait.as_ref())?;
    let gait = gait::find(name).ok_or_else(|| {
        let names: Vec<_> = gait::GAITS.iter().map(|gait| gait.name).collect();
        Fault::new("drive.gait", not_one_of(name, &names))
    })?;
    if robot.actuators != 5 {
        let message =
            format!("gaits are written for 5 actuators, but robot.actuators is {}; use waveform sequence", robot.actuators);
        return Err(Fault::new("drive.gait", message));
    }
    let own = format!("gait {name}");
    let mut allowed = vec!["gait", "on_voltages_v"];
    match gait.parameter {
        Parameter::Nothing => {}
        Parameter::Period => allowed.extend(["period_s", "frequency_hz"]),
        Parameter::Delay => allowed.push("delay_s"),
        Parameter::OnTime => allowed.push("on_time_s"),
    }
    only(d, &own, &allowed)?;
    let key = format!("drive.{}", gait.parameter.key());
    let given = match gait.parameter {
        Parameter::Nothing => Some(0.0),
        Parameter::Period => period(d)?,
        Parameter::Delay => d.delay_s,
        Parameter::OnTime => d.on_time_s,
    };
    let parameter =
        given.or(gait.default_parameter).ok_or_else(|| Fault::new(&key, format!("is missing; gait {name} needs it")))?;
    finite(&key, parameter)?;
    if parameter < 0.0 && gait.once_if_negative.is_empty() {
        return Err(Fault::new(&key, format!("is {}, but must not be negative for gait {name}", number(parameter))));
    }
    let on_voltages = voltages("drive.on_voltages_v", d.on_voltages_v.as_deref().unwrap_or(&gait::DEFAULT_ON_VOLTAGES), robot)?;
    Ok(Waveform::Gait { gait, parameter, on_voltages })
}

fn sequence(d: &DriveConfig, robot: &Driven) -> Result<Waveform, Fault> {
    only(d, "waveform sequence", &["period_s", "frequency_hz", "phases", "on_voltages_v"])?;
    let period = period(d)?;
    let phases = needed("drive.phases", d.phases.as_ref())?;
    if phases.is_empty() {
        return Err(Fault::new("drive.phases", "is empty"));
    }
    let on_voltages = match &d.on_voltages_v {
        Some(values) => Some(voltages("drive.on_voltages_v", values, robot)?),
        None if robot.actuators == gait::DEFAULT_ON_VOLTAGES.len() && phases.iter().any(|phase| phase.on.is_some()) => {
            Some(voltages("drive.on_voltages_v", &gait::DEFAULT_ON_VOLTAGES, robot)?)
        }
        None => None,
    };
    let mut last = 0.0;
    let mut resolved = Vec::new();
    for (index, phase) in phases.iter().enumerate() {
        let fault = |message: String| Fault::new("drive.phases", format!("phase {}: {message}", index + 1));
        let until = phase_end(phase, period, index + 1 == phases.len()).map_err(fault)?;
        if until.is_nan() || until <= last {
            return Err(fault(format!("ends at {} s, but must end after {} s", number(until), number(last))));
        }
        last = until;
        resolved.push((until, phase_voltages(phase, on_voltages.as_deref(), robot).map_err(fault)?));
    }
    Ok(Waveform::Sequence { period, phases: resolved })
}

/// End of a phase (s). The last phase may go without: it holds.
fn phase_end(phase: &PhaseConfig, period: Option<f64>, last: bool) -> Result<f64, String> {
    match (phase.until, phase.until_s, period) {
        (Some(_), Some(_), _) => Err("until and until_s are both given; keep one of the two".into()),
        (Some(share), None, Some(period)) => Ok(share * period),
        (Some(_), None, None) => Err("until is a share of the period, but there is no period_s; use until_s".into()),
        (None, Some(seconds), _) => Ok(seconds),
        (None, None, _) if last => Ok(f64::INFINITY),
        (None, None, _) => Err("until or until_s is missing".into()),
    }
}

fn phase_voltages(phase: &PhaseConfig, on: Option<&[f64]>, robot: &Driven) -> Result<Vec<f64>, String> {
    match (&phase.on, &phase.voltages_v) {
        (None, Some(values)) => voltages("voltages_v", values, robot).map_err(|fault| format!("voltages_v {}", fault.message)),
        (Some(mask), None) => {
            if mask.len() != robot.actuators || mask.bytes().any(|b| b != b'0' && b != b'1') {
                return Err(format!("on = {mask:?} is not a mask of {} times 0 or 1", robot.actuators));
            }
            let on = on.ok_or("on needs drive.on_voltages_v for a robot that has not 5 actuators")?;
            Ok(mask.bytes().zip(on).map(|(bit, &v)| if bit == b'1' { v } else { 0.0 }).collect())
        }
        _ => Err("give either on or voltages_v".into()),
    }
}
