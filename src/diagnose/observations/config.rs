//! The experiment of an observation.

use super::super::DiagnoseError;
use super::super::dataset::{MOST_STEPS, Observation, overridden};
use crate::experiment::{Config, ConfigError, Source, StepConfig, experiment};
use crate::model::Mount;
use crate::recording::definitions;
use crate::words;

/// Length (s), time step (s) and interval of records (s) where an observation gives none.
const DURATION: f64 = 2.0;
const STEP: f64 = 2e-4;
const RECORD: f64 = 1e-3;

/// The experiment of an observation. A resonance under a sine without frequency is measured on the ringing after a step.
pub(in crate::diagnose) fn config(nominal: &Config, observation: &Observation) -> Result<Config, DiagnoseError> {
    let config = overridden(nominal, &observation.robot, &observation.material)
        .map_err(|reason| DiagnoseError::Observation { measure: observation.measure.clone(), reason })?;
    let mut config = Config { drive: observation.drive.clone(), simulation: observation.simulation.clone(), ..config };
    let drive = &mut config.drive;
    if observation.measure == "resonance_hz" && drive.waveform.as_deref() == Some("sine") && drive.frequency_hz.is_none() {
        let actuators = config.robot.actuators.unwrap_or(5);
        let volts = drive.amplitudes_v.take().unwrap_or_else(|| vec![drive.amplitude_v.unwrap_or(0.0); actuators]);
        drive.amplitude_v = None;
        drive.waveform = Some("step".into());
        drive.voltages_v = Some(volts);
    }
    let s = &mut config.simulation;
    s.engine.get_or_insert("planar".into());
    if s.time_step_s.is_none() {
        s.time_step_s = Some(StepConfig::Seconds(STEP));
    }
    if s.steps.is_none() && s.duration_s.is_none() {
        s.duration_s = Some(DURATION);
    }
    if s.record_every_s.is_none() && s.record_every_steps.is_none() {
        s.record_every_s = Some(RECORD);
    }
    Ok(config)
}

/// What is wrong with an observation.
pub(in crate::diagnose) enum ObservationError {
    /// A value, by its key within the observation.
    Value {
        /// The key.
        key: String,
        /// What is wrong.
        message: String,
    },
    /// A file that it refers to.
    Other(ConfigError),
}

impl ObservationError {
    fn value(key: &str, message: impl Into<String>) -> Self {
        Self::Value { key: key.into(), message: message.into() }
    }
}

/// Checks that an observation's measure is defined for its mount and drive, and that its experiment is valid.
///
/// # Errors
/// [`ObservationError`] with the key of the wrong value.
pub(in crate::diagnose) fn check(nominal: &Config, observation: &Observation) -> Result<(), ObservationError> {
    let measure = observation.measure.as_str();
    if !definitions::names().contains(&measure) {
        return Err(ObservationError::value("measure", words::not_one_of(measure, &definitions::names())));
    }
    if !observation.value.is_finite() {
        return Err(ObservationError::value("value", format!("is {}, but must be a number", observation.value)));
    }
    if !(observation.sigma.is_finite() && observation.sigma > 0.0) {
        return Err(ObservationError::value("sigma", format!("is {}, but must be a positive number", observation.sigma)));
    }
    let config = config(nominal, observation).map_err(|error| ObservationError::value("measure", error.to_string()))?;
    let text = toml::to_string(&config).map_err(|error| ObservationError::value("measure", error.to_string()))?;
    let experiment = experiment(&Source::from_text(measure, text)).map_err(|error| match error {
        ConfigError::Value { key, message, .. } => ObservationError::Value { key, message },
        other => ObservationError::Other(other),
    })?;
    if experiment.steps as f64 > MOST_STEPS {
        let message =
            format!("the run has {} steps, more than {MOST_STEPS:.0e}, and a diagnosis needs hundreds of runs", experiment.steps);
        return Err(ObservationError::value("simulation", message));
    }
    let (mount, repeats) = (experiment.robot.mount, experiment.drive.period().is_some());
    let refused = match measure {
        "energy_error" => Some("is known to a run only, no camera measures it"),
        "tip_deflection_mm"
        | "tip_amplitude_mm"
        | "tip_phase_deg"
        | "resonance_hz"
        | "damping_ratio"
        | "half_power_bandwidth_hz"
            if mount != Mount::Clamped =>
        {
            Some("is a measure of clamped robots; set mount = \"clamped\"")
        }
        "jump_height_mm" | "speed_mm_s" | "displacement_sum_mm" | "stride_mm" | "period_ratio" | "mid_end_phase_deg"
            if mount == Mount::Clamped =>
        {
            Some("is no measure of a clamped robot")
        }
        "body_touching" | "end_touching" | "aerial" if mount != Mount::Ground => Some("is a measure of robots on the ground"),
        "tip_phase_deg" | "stride_mm" | "period_ratio" | "mid_end_phase_deg" if !repeats => Some("needs a drive with a period"),
        "resonance_hz" | "damping_ratio" | "half_power_bandwidth_hz" if repeats => {
            Some("is taken from how the tip rings after a step: give a step, or for resonance_hz a sine without frequency_hz")
        }
        _ => None,
    };
    refused.map_or(Ok(()), |why| Err(ObservationError::value("measure", format!("{measure} {why}"))))
}
