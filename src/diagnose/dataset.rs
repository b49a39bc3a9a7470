//! Measured data: a description in TOML and one CSV per run.

mod read;
mod response;
mod run;

pub(super) use run::overridden;

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::Deserialize;
use thiserror::Error;

use super::identify::{Identify, Space};
use crate::experiment::{Config, ConfigError, DriveConfig, EffectConfig, MaterialConfig, RobotConfig, SimulationConfig};
use crate::model::Robot;

/// Most time steps of a run: a prediction then takes some seconds, and a diagnosis needs hundreds.
pub(super) const MOST_STEPS: f64 = 2e7;

/// Data that cannot be used as they are.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DataError {
    /// The description is not valid: the message has line, column and key.
    #[error(transparent)]
    Description(#[from] ConfigError),
    /// A file cannot be read.
    #[error("{}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A file's content is wrong.
    #[error("{}, line {line}{}: {reason}", path.display(), if *column > 0 { format!(", column {column}") } else { String::new() })]
    Content {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// Column, from 1; 0 for a whole line.
        column: usize,
        /// What is wrong, with a remedy.
        reason: String,
    },
}

/// A data set's description, with the keys of the file.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Description {
    dataset: About,
    material: MaterialConfig,
    robot: RobotConfig,
    markers: BTreeMap<String, f64>,
    noise: BTreeMap<String, f64>,
    bench: Bench,
    camera: Camera,
    columns: BTreeMap<String, Column>,
    effect: Vec<EffectConfig>,
    run: Vec<RunEntry>,
    frequency_response: Vec<ResponseEntry>,
    steady: Vec<Steady>,
    observation: Vec<Observation>,
    identify: Option<Identify>,
}

/// `[camera]`: how frames become rows.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Camera {
    /// Frames per second, for rows numbered by `frame` in place of `t_s`.
    pub frame_rate_hz: Option<f64>,
    /// Time over which a frame takes the mean of the motion, in the middle of which its time lies (ms).
    pub exposure_ms: Option<f64>,
}

/// `[[frequency_response]]`: amplitudes and phases of a marker under sines.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ResponseEntry {
    id: String,
    file: PathBuf,
    coordinate: String,
    amplitude_v: f64,
    #[serde(default)]
    offset_v: f64,
    sigma_mm: f64,
    #[serde(default)]
    role: Role,
}

/// `[[steady]]`: positions of markers at rest under constant voltages.
#[derive(Debug, Clone, Deserialize)]
pub(crate) struct Steady {
    voltages_v: Vec<f64>,
    #[serde(default)]
    sigma_mm: Option<f64>,
    #[serde(default)]
    role: Role,
    /// `MARKER_x_mm` and `MARKER_z_mm`.
    #[serde(flatten)]
    positions: BTreeMap<String, f64>,
}

/// A frequency response as measured.
#[derive(Debug, Clone)]
pub struct Response {
    /// Frequencies (Hz), rising.
    pub frequencies: Vec<f64>,
    /// Channel of the coordinate.
    pub channel: usize,
    /// Half of the peak-to-peak voltage of every actuator (V).
    pub amplitude: f64,
    /// Its mean (V).
    pub offset: f64,
    /// In-phase and quadrature parts (mm) at each frequency: amplitude × (cos, sin) of the phase by which the coordinate leads the voltage.
    pub parts: Vec<[f64; 2]>,
}

/// A column of this program in a file that calls it otherwise or has another unit: value = `factor` × number + `offset`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Column {
    /// Its name in the file.
    pub from: String,
    /// In the unit of its key per unit of the file.
    #[serde(default = "one")]
    pub factor: f64,
    /// In the unit of its key.
    #[serde(default)]
    pub offset: f64,
}

fn one() -> f64 {
    1.0
}

#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct About {
    name: String,
    about: String,
}

/// How much the bench differs from run to run: one standard deviation each; estimated from the data where absent, none where 0.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Bench {
    /// Offset between the clocks of camera and voltage (ms).
    pub clock_ms: Option<f64>,
    /// Zero of every coordinate (mm).
    pub zero_mm: Option<f64>,
    /// Gain of the motion (–).
    pub gain: Option<f64>,
    /// Drift of every coordinate (mm/s).
    pub drift_mm_per_s: Option<f64>,
}

impl Bench {
    /// Keys, values and largest values.
    fn entries(&self) -> [(&'static str, Option<f64>, f64); 4] {
        [
            ("clock_ms", self.clock_ms, 1e3),
            ("zero_mm", self.zero_mm, 1e3),
            ("gain", self.gain, 1.0),
            ("drift_mm_per_s", self.drift_mm_per_s, 1e3),
        ]
    }
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RunEntry {
    id: String,
    file: PathBuf,
    voltage_file: Option<PathBuf>,
    rate_v_per_s: Option<f64>,
    #[serde(default)]
    role: Role,
    start: Option<String>,
    release: Option<Release>,
    #[serde(default)]
    robot: RobotConfig,
    #[serde(default)]
    material: MaterialConfig,
    #[serde(default)]
    markers: BTreeMap<String, f64>,
    #[serde(default)]
    effect: Vec<EffectConfig>,
}

/// `[run.release]`: the shape that a run is let go from at rest, and when.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Release {
    hung_g: Option<f64>,
    level: Option<bool>,
    height_mm: Option<f64>,
    held: Option<String>,
    held_z_mm: Option<f64>,
    at_s: Option<f64>,
}

/// The state of a run at its start. The robot is at rest.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Start {
    /// In equilibrium under gravity and the first voltages.
    #[default]
    Settled,
    /// All joints at zero angle, on the floor, in the clamp or in the air.
    Level {
        /// Height above the floor (cm).
        height: f64,
    },
    /// In equilibrium with a mass (g) at the right end that is taken away.
    Hung(f64),
    /// In equilibrium with the point at `position` (cm along the robot) held at the height `z` (cm) by a vertical force.
    Held {
        /// Distance of the point from the left end along the robot (cm).
        position: f64,
        /// Its height above the left end of the flat robot (cm).
        z: f64,
    },
}

/// A single measured number and the conditions of its measurement.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Observation {
    /// Name of a measure.
    pub measure: String,
    /// The measured value, in the measure's unit.
    pub value: f64,
    /// Standard deviation, in the measure's unit.
    pub sigma: f64,
    /// The drive.
    pub drive: DriveConfig,
    /// Overrides of the robot.
    #[serde(default)]
    pub robot: RobotConfig,
    /// Overrides of the material.
    #[serde(default)]
    pub material: MaterialConfig,
    /// Length and steps of the run.
    #[serde(default)]
    pub simulation: SimulationConfig,
    /// What an identification does with it.
    #[serde(default)]
    pub role: ObservationRole,
}

impl Observation {
    /// Whether an identification foretells it without seeing it.
    pub fn is_foretold(&self) -> bool {
        self.role == ObservationRole::Foretell
    }
}

/// The part of an observation in an identification.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ObservationRole {
    /// Constants are fitted to it.
    #[default]
    Fit,
    /// It is foretold from the others.
    Foretell,
}

/// The part of a run in the analysis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Chosen by [`split`](super::split::split).
    #[default]
    Auto,
    /// Parameters are fitted to it.
    Fit,
    /// Causes are selected on it, or it judges the result.
    HeldOut,
}

/// A tracked point of the robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Marker {
    /// Its name in the column headers.
    pub name: String,
    /// Distance from the left end along the robot (cm).
    pub position: f64,
}

/// One run as measured. Missing values are NaN.
#[derive(Debug, Clone)]
pub struct MeasuredRun {
    /// Its name.
    pub id: String,
    /// Its file.
    pub path: PathBuf,
    /// Its role.
    pub role: Role,
    /// Times (s).
    pub times: Vec<f64>,
    /// Voltages (V) at these times, rows × actuators.
    pub voltages: Vec<f64>,
    /// The voltages in rows of their own, if a file of their own has them.
    pub log: Option<Log>,
    /// The time (s) at which its motion starts.
    pub origin: f64,
    /// Its state then.
    pub start: Start,
    /// False where times were made of voltages.
    pub has_clock: bool,
    /// Its nominal experiment without drive.
    pub nominal: Config,
    /// Its nominal robot.
    pub robot: Robot,
    /// Positions of the markers along its robot (cm), in the order of the data set's.
    pub positions: Vec<f64>,
    /// Standard deviation of its values (mm), if given for it alone.
    pub sigma: Option<f64>,
    /// The frequency response that it is, if it is none in time.
    pub response: Option<Response>,
    /// Positions (mm), channels × rows. Channels are x and z of every marker, in order; one that was not measured is empty.
    pub channels: Vec<Vec<f64>>,
    /// Remarks on the data, in words.
    pub remarks: Vec<String>,
}

/// Voltages on a clock of their own.
#[derive(Debug, Clone)]
pub struct Log {
    /// Times (s).
    pub times: Vec<f64>,
    /// Voltages (V), rows × actuators.
    pub voltages: Vec<f64>,
}

impl MeasuredRun {
    /// Times (s) and voltages (V, rows × actuators) of the command.
    pub fn command(&self) -> (&[f64], &[f64]) {
        self.log.as_ref().map_or((&self.times, &self.voltages), |log| (&log.times, &log.voltages))
    }
}

/// A data set.
#[derive(Debug, Clone)]
pub struct Dataset {
    /// Its name.
    pub name: String,
    /// Its description.
    pub about: String,
    /// The nominal experiment without drive: material and robot, as in the file.
    pub nominal: Config,
    /// The nominal robot.
    pub robot: Robot,
    /// The tracked points, from left to right.
    pub markers: Vec<Marker>,
    /// Standard deviation of each channel (mm), if given.
    pub noise: Vec<Option<f64>>,
    /// How much the bench differs from run to run, as far as it is known.
    pub bench: Bench,
    /// The camera.
    pub camera: Camera,
    /// The runs.
    pub runs: Vec<MeasuredRun>,
    /// Single measured numbers, in place of runs.
    pub observations: Vec<Observation>,
    /// The constants that are to be identified from them.
    pub(super) identify: Option<(Identify, Space)>,
}

pub(super) const AXES: [&str; 2] = ["x", "z"];

impl Dataset {
    /// Whether constants are to be identified from its observations.
    pub fn is_identification(&self) -> bool {
        self.identify.is_some()
    }

    /// Names of the channels: `NAME_x` and `NAME_z` of every marker.
    pub fn channel_names(&self) -> Vec<String> {
        self.markers.iter().flat_map(|marker| AXES.map(|axis| format!("{}_{axis}", marker.name))).collect()
    }

    /// The channels of which there are frequency responses.
    pub fn response_channels(&self) -> Vec<usize> {
        let mut channels: Vec<usize> = self.runs.iter().filter_map(|run| Some(run.response.as_ref()?.channel)).collect();
        channels.sort_unstable();
        channels.dedup();
        channels
    }
}
