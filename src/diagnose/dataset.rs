//! Measured data: a description in TOML and one CSV per run, read with checks.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use thiserror::Error;
use toml::de::{DeTable, DeValue};

use super::observations::Fault;
use super::{observations, robot, voltage};
use crate::analytic;

use crate::experiment::{
    Config, ConfigError, DriveConfig, MaterialConfig, RobotConfig, SimulationConfig, Source, StepConfig, experiment, presets,
};
use crate::model::{Mount, Robot};
use crate::words;

/// Most time steps of a run: one prediction takes some seconds then, and a diagnosis needs hundreds.
const MOST_STEPS: f64 = 2e7;
/// Beyond these a column has another unit: MFC actuators take 1.5 kV, and no robot is a hundred metres long.
const MOST_SECONDS: f64 = 1e7;
const MOST_VOLTS: f64 = 1e4;
const MOST_MM: f64 = 1e5;
/// Jumps of the voltage between rows are given this width.
const LEAST_SECONDS: f64 = 1e-8;
const NOISE_MM: RangeInclusive<f64> = 1e-9..=1e5;

/// Data that cannot be used as they are.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DataError {
    /// The description is not valid; the message shows line, column and key.
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
        /// What is wrong, and what to try.
        reason: String,
    },
}

/// A data set's description, as written.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Description {
    dataset: About,
    material: MaterialConfig,
    robot: RobotConfig,
    markers: BTreeMap<String, f64>,
    noise: BTreeMap<String, f64>,
    run: Vec<RunEntry>,
    observation: Vec<Observation>,
}

#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct About {
    name: String,
    about: String,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RunEntry {
    id: String,
    file: PathBuf,
    #[serde(default)]
    role: Role,
}

/// A single measured number, with what it was measured under.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Observation {
    /// Name of a measure.
    pub measure: String,
    /// The measured value, in the measure's unit.
    pub value: f64,
    /// One standard deviation.
    pub sigma: f64,
    /// What it was measured under.
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
}

/// What a run is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// The program decides.
    #[default]
    Auto,
    /// Parameters are fitted to it.
    Fit,
    /// Models are judged by it.
    HeldOut,
}

/// A tracked point.
#[derive(Debug, Clone, PartialEq)]
pub struct Marker {
    /// Its name in the columns.
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
    /// What it is for.
    pub role: Role,
    /// Times (s).
    pub times: Vec<f64>,
    /// Voltages (V), row after row, one per actuator.
    pub voltages: Vec<f64>,
    /// Per channel, a value (mm) per time. Channels are x and z of every marker, in order; a channel that was not measured is empty.
    pub channels: Vec<Vec<f64>>,
    /// What was noticed while reading, in words.
    pub remarks: Vec<String>,
}

/// A data set.
#[derive(Debug, Clone)]
pub struct Dataset {
    /// Its name.
    pub name: String,
    /// A few words on it.
    pub about: String,
    /// The nominal experiment without drive: material and robot, as written.
    pub nominal: Config,
    /// The nominal robot.
    pub robot: Robot,
    /// The tracked points.
    pub markers: Vec<Marker>,
    /// One standard deviation per channel (mm), where it is given.
    pub noise: Vec<Option<f64>>,
    /// The runs.
    pub runs: Vec<MeasuredRun>,
    /// Single numbers.
    pub observations: Vec<Observation>,
}

const AXES: [&str; 2] = ["x", "z"];

impl Dataset {
    /// Names of the channels, as in the files without unit.
    pub fn channel_names(&self) -> Vec<String> {
        self.markers.iter().flat_map(|marker| AXES.map(|axis| format!("{}_{axis}", marker.name))).collect()
    }

    /// Reads a description, a file (`dataset.toml` of a folder) or `preset:NAME`, and its runs.
    ///
    /// # Errors
    /// [`DataError`] with file, line and column.
    pub fn read(path: &Path) -> Result<Self, DataError> {
        let in_folder = path.join("dataset.toml");
        let path = if path.is_dir() { &in_folder } else { path };
        let preset = path.to_str().and_then(|path| path.strip_prefix("preset:")).and_then(presets::find_dataset);
        let text = match preset {
            Some(preset) => preset.text.to_owned(),
            None => crate::files::read_text(path)
                .map_err(|error| DataError::Unreadable { path: path.into(), reason: error.to_string() })?,
        };
        let description: Description = toml::from_str(&text).map_err(|error| ConfigError::Syntax {
            source_name: path.display().to_string(),
            message: words::toml_error(&error),
        })?;
        let wrong =
            |way: &[Part], reason: String| DataError::Content { path: path.into(), line: line_of(&text, way), column: 0, reason };
        if let (false, [_, ..]) = (description.run.is_empty(), &description.observation[..]) {
            return Err(fault(
                path,
                &text,
                &[Part::Key("observation"), Part::Index(0)],
                "observation",
                "stands beside [[run]]: a data set has runs or single numbers; describe the numbers in a file of their own",
            ));
        }

        let nominal = Config {
            material: description.material,
            robot: description.robot,
            drive: DriveConfig::default(),
            simulation: SimulationConfig {
                engine: Some("planar".into()),
                time_step_s: Some(StepConfig::Seconds(1e-4)),
                duration_s: Some(1.0),
                ..SimulationConfig::default()
            },
            effect: Vec::new(),
        };
        let robot = resolved_robot(path, &text, &nominal)?;
        let length = robot.material.actuator_length * robot.actuators as f64;
        if description.run.is_empty() && description.observation.is_empty() {
            return Err(wrong(&[Part::Key("dataset")], "there are no runs: add [[run]] tables with id and file".into()));
        }
        if description.markers.is_empty() && !description.run.is_empty() {
            return Err(wrong(&[Part::Key("markers")], "there are no markers: add [markers] with name = distance in mm".into()));
        }
        let mut markers = Vec::new();
        for (name, position) in &description.markers {
            if !(0.0..=10.0 * length + 1e-9).contains(position) {
                return Err(wrong(
                    &[Part::Key("markers"), Part::Key(name)],
                    format!(
                        "marker {name} is at {} mm, but the robot is {} mm long",
                        words::number(*position),
                        words::number(10.0 * length)
                    ),
                ));
            }
            markers.push(Marker { name: name.clone(), position: 0.1 * position });
        }
        markers.sort_by(|a, b| a.position.total_cmp(&b.position));
        let mut noise = Vec::new();
        for (key, value) in &description.noise {
            let known = key == "default_mm" || markers.iter().any(|marker| *key == format!("{}_mm", marker.name));
            if !known {
                let known: Vec<_> = markers.iter().map(|marker| format!("{}_mm", marker.name)).collect();
                let hint = words::did_you_mean(key, known.iter().map(String::as_str).chain(["default_mm"]));
                return Err(wrong(
                    &[Part::Key("noise"), Part::Key(key)],
                    format!("{key} is neither default_mm nor the name of a marker with _mm{hint}"),
                ));
            }
            if !NOISE_MM.contains(value) {
                let [value, low, high] = [value, NOISE_MM.start(), NOISE_MM.end()].map(|x| words::number(*x));
                let reason = format!("{key} is {value}, but must be positive: between {low} and {high}");
                return Err(wrong(&[Part::Key("noise"), Part::Key(key)], reason));
            }
        }
        for marker in &markers {
            let own = description.noise.get(&format!("{}_mm", marker.name)).or(description.noise.get("default_mm")).copied();
            noise.extend([own, own]);
        }
        let mut runs: Vec<MeasuredRun> = Vec::new();
        for (index, entry) in description.run.iter().enumerate() {
            let at = |key: &'static str| [Part::Key("run"), Part::Index(index), Part::Key(key)];
            if entry.id.trim().is_empty() {
                return Err(wrong(&at("id"), "id is empty; every run needs a name".into()));
            }
            if runs.iter().any(|run| run.id == entry.id) {
                return Err(wrong(&at("id"), format!("id: two runs are called {:?}", entry.id)));
            }
            let file = path.parent().unwrap_or(Path::new("")).join(&entry.file);
            let (times, voltages, channels, remarks) =
                read_run(&file, &robot, nominal.robot.positive_gain.unwrap_or(1.0), &markers)?;
            let run = MeasuredRun { id: entry.id.clone(), path: file, role: entry.role, times, voltages, channels, remarks };
            runs.push(run.checked(&robot)?);
        }
        let mut observations = description.observation;
        for (index, observation) in observations.iter_mut().enumerate() {
            if let Some(file) = &mut observation.drive.file {
                *file = path.parent().unwrap_or(Path::new("")).join(&*file);
            }
            observations::check(&nominal, observation).map_err(|error| match error {
                Fault::At { key, message } => {
                    let way: Vec<Part> =
                        [Part::Key("observation"), Part::Index(index)].into_iter().chain(key.split('.').map(Part::Key)).collect();
                    fault(path, &text, &way, &format!("observation {}: {key}", index + 1), message)
                }
                Fault::Other(error) => error.into(),
            })?;
        }
        let name = if description.dataset.name.is_empty() {
            path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
        } else {
            description.dataset.name
        };
        Ok(Self { name, about: description.dataset.about, nominal, robot, markers, noise, runs, observations })
    }
}

/// A step on the way to a value in a description.
#[derive(Debug, Clone, Copy)]
enum Part<'a> {
    Key(&'a str),
    Index(usize),
}

/// Line (from 1) of the deepest part of the way that the text has.
fn line_of(text: &str, way: &[Part]) -> u64 {
    let Ok(parsed) = DeTable::parse(text) else { return 1 };
    let mut at: Option<&DeValue> = None;
    let mut offset = 0;
    let first = parsed.get_ref();
    for part in way {
        let next = match (part, at) {
            (Part::Key(key), None) => first.iter().find(|(name, _)| name.get_ref().as_ref() == *key),
            (Part::Key(key), Some(DeValue::Table(table))) => table.iter().find(|(name, _)| name.get_ref().as_ref() == *key),
            (Part::Index(index), Some(DeValue::Array(array))) => {
                let Some(item) = array.get(*index) else { break };
                (offset, at) = (item.span().start, Some(item.get_ref()));
                continue;
            }
            _ => None,
        };
        let Some((name, value)) = next else { break };
        (offset, at) = (name.span().start, Some(value.get_ref()));
    }
    text[..offset].matches('\n').count() as u64 + 1
}

/// A value of a description that makes no sense: a usage error.
fn fault(path: &Path, text: &str, way: &[Part], key: &str, message: impl Into<String>) -> DataError {
    let place = format!("{}, line {}", path.display(), line_of(text, way));
    ConfigError::Value { place, key: key.into(), message: message.into() }.into()
}

impl MeasuredRun {
    /// The run, if its rows make a run that can be simulated and its voltages are known between rows.
    fn checked(mut self, robot: &Robot) -> Result<Self, DataError> {
        let bad =
            |reason: String| DataError::Unreadable { path: self.path.clone(), reason: format!("run {}: {reason}", self.id) };
        let duration = self.times[self.times.len() - 1] - self.times[0];
        let steps = duration / robot::step(robot, &self.times);
        if steps > MOST_STEPS {
            return Err(bad(format!(
                "{duration} s in steps that suit the robot and the rows are {steps:.1e} steps, more than {MOST_STEPS:.0e}; is t_s in seconds?"
            )));
        }
        if let Some(reason) = voltage::too_coarse(&self.times, &self.voltages, robot.actuators) {
            return Err(bad(reason));
        }
        let rate = (self.times.len() - 1) as f64 / duration;
        let first = analytic::cantilever_frequency(robot) / (robot.actuators as f64).powi(2);
        if robot.mount == Mount::Clamped && rate < 2.0 * first {
            self.remarks.push(format!(
                "{rate:.1} rows per second show a drive of more than {:.1} Hz as a slower one, and the robot's first mode is at {first:.1} Hz; if it was \
                 driven that fast, record the voltage ten times per period",
                0.5 * rate
            ));
        }
        Ok(self)
    }
}

/// The robot of a description, by the way of an experiment at rest.
fn resolved_robot(path: &Path, text: &str, nominal: &Config) -> Result<Robot, ConfigError> {
    let actuators = nominal.robot.actuators.unwrap_or(5);
    let mut config = nominal.clone();
    config.drive.waveform = Some("dc".into());
    config.drive.voltages_v = Some(vec![0.0; actuators.min(10_000)]);
    let shown = toml::to_string(&config)
        .map_err(|error| ConfigError::Syntax { source_name: path.display().to_string(), message: error.to_string() })?;
    experiment(&Source::from_text(path.display().to_string(), shown)).map(|experiment| experiment.robot).map_err(|error| {
        match error {
            // The lines are those of the description, not of the experiment made of it.
            ConfigError::Value { key, message, .. } => {
                let way: Vec<Part> = key.split('.').map(Part::Key).collect();
                ConfigError::Value { place: format!("{}, line {}", path.display(), line_of(text, &way)), key, message }
            }
            other => other,
        }
    })
}

type RunData = (Vec<f64>, Vec<f64>, Vec<Vec<f64>>, Vec<String>);

fn read_run(path: &Path, robot: &Robot, positive_gain: f64, markers: &[Marker]) -> Result<RunData, DataError> {
    let bytes =
        crate::files::read(path).map_err(|error| DataError::Unreadable { path: path.into(), reason: error.to_string() })?;
    parse_run(&bytes, robot.actuators, markers, |voltage| robot.check_voltage(voltage, positive_gain)).map_err(
        |Wrong { line, column, reason }| match line {
            0 => DataError::Unreadable { path: path.into(), reason },
            _ => DataError::Content { path: path.into(), line, column, reason },
        },
    )
}

#[derive(Debug)]
struct Wrong {
    line: u64,
    column: usize,
    reason: String,
}

fn parse_run(
    bytes: &[u8],
    actuators: usize,
    markers: &[Marker],
    bears: impl Fn(f64) -> Result<(), String>,
) -> Result<RunData, Wrong> {
    let wrong = |line: u64, column: usize, reason: String| Wrong { line, column, reason };
    if bytes.is_empty() {
        return Err(wrong(0, 0, "is empty".into()));
    }
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes);
    let headers = reader.headers().map_err(|error| wrong(1, 0, error.to_string()))?.clone();
    let names: Vec<String> = markers.iter().flat_map(|marker| AXES.map(|axis| format!("{}_{axis}_mm", marker.name))).collect();
    let mut time_column = None;
    let mut volt_columns = vec![None; actuators];
    let mut columns = vec![None; names.len()];
    for (at, header) in headers.iter().enumerate() {
        let voltage = header.strip_prefix('v').and_then(|rest| rest.strip_suffix("_v")).and_then(|n| n.parse::<usize>().ok());
        let slot = if header == "t_s" {
            &mut time_column
        } else if let Some(n) = voltage {
            let reason =
                format!("there is a voltage {header}, but the robot has {actuators} actuators; is this a run of another robot?");
            n.checked_sub(1).and_then(|n| volt_columns.get_mut(n)).ok_or_else(|| wrong(1, at + 1, reason))?
        } else if let Some(n) = names.iter().position(|name| name == header) {
            &mut columns[n]
        } else {
            let known = markers.iter().map(|marker| marker.name.as_str()).collect::<Vec<_>>().join(", ");
            let reason =
                format!("{header:?} is neither t_s, a voltage v1_v, ..., nor NAME_x_mm or NAME_z_mm of a marker ({known})");
            return Err(wrong(1, at + 1, reason));
        };
        if slot.replace(at).is_some() {
            return Err(wrong(1, at + 1, format!("a second column {header}")));
        }
    }
    let time_column = time_column.ok_or_else(|| wrong(1, 0, "the column t_s is missing".into()))?;
    let volt_columns: Vec<usize> = volt_columns
        .into_iter()
        .enumerate()
        .map(|(i, column)| {
            column.ok_or_else(|| wrong(1, 0, format!("the column v{}_v is missing; the robot has {actuators} actuators", i + 1)))
        })
        .collect::<Result<_, _>>()?;
    if columns.iter().all(Option::is_none) {
        return Err(wrong(1, 0, "there is no column of a marker".into()));
    }

    let (mut times, mut voltages): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    let mut channels: Vec<Vec<f64>> = vec![Vec::new(); columns.len()];
    for record in reader.records() {
        let record = record.map_err(|error| {
            let line = error.position().map_or(0, csv::Position::line);
            wrong(line.max(1), 0, error.to_string())
        })?;
        let line = record.position().map_or(0, csv::Position::line);
        let number = |column: usize| {
            let text = record.get(column).unwrap_or_default();
            let value = text.parse::<f64>().ok().filter(|value| value.is_finite());
            value.ok_or_else(|| {
                wrong(line, column + 1, format!("{}: {text:?} is not a number", headers.get(column).unwrap_or_default()))
            })
        };
        let within = |column: usize, most: f64, unit: &str| {
            let value = number(column)?;
            if value.abs() <= most {
                return Ok(value);
            }
            let name = headers.get(column).unwrap_or_default();
            Err(wrong(line, column + 1, format!("{name} is {}, beyond {most:.0} {unit}; is it in {unit}?", words::number(value))))
        };
        let time = within(time_column, MOST_SECONDS, "s")?;
        if times.last().is_some_and(|last| time - last < LEAST_SECONDS) {
            let last = times[times.len() - 1];
            return Err(wrong(
                line,
                time_column + 1,
                format!(
                    "t_s is {} after {}; times must rise, by {LEAST_SECONDS:e} s at least",
                    words::number(time),
                    words::number(last)
                ),
            ));
        }
        times.push(time);
        for &column in &volt_columns {
            let voltage = within(column, MOST_VOLTS, "V")?;
            bears(voltage)
                .map_err(|reason| wrong(line, column + 1, format!("{} {reason}", headers.get(column).unwrap_or_default())))?;
            voltages.push(voltage);
        }
        for (channel, column) in channels.iter_mut().zip(&columns) {
            if let Some(column) = *column {
                let empty = record.get(column).unwrap_or_default().is_empty();
                channel.push(if empty { f64::NAN } else { within(column, MOST_MM, "mm")? });
            }
        }
    }
    if times.is_empty() {
        return Err(wrong(1, 0, "there are no rows below the header".into()));
    }
    if times.len() == 1 {
        return Err(wrong(2, 0, "there is one row; a run needs two at least".into()));
    }
    if channels.iter().flatten().all(|value| value.is_nan()) {
        return Err(wrong(2, 0, "all values of all markers are missing".into()));
    }
    let mut remarks = Vec::new();
    let missing = channels.iter().flatten().filter(|value| value.is_nan()).count();
    if missing > 0 {
        remarks.push(format!("{missing} values are missing"));
    }
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    if let (Some(&middle), Some(&largest)) = (steps.get(steps.len() / 2), steps.last())
        && largest > 5.0 * middle
    {
        remarks.push(format!("the largest gap between rows is {largest:.4} s, the usual step {middle:.4} s"));
    }
    Ok((times, voltages, channels, remarks))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn markers() -> Vec<Marker> {
        vec![Marker { name: "tip".into(), position: 10.0 }]
    }

    #[test]
    fn columns_may_stand_in_any_order_and_cells_may_be_empty() {
        let text = b"tip_z_mm, v1_v, t_s\n1.5, 10, 0\n, 20, 0.1\n";
        let (times, voltages, channels, remarks) = parse_run(text, 1, &markers(), |_| Ok(())).unwrap();
        assert_eq!((times, voltages), (vec![0.0, 0.1], vec![10.0, 20.0]));
        assert!(channels[0].is_empty() && channels[1][0] == 1.5 && channels[1][1].is_nan());
        assert_eq!(remarks.len(), 1);
    }

    #[test]
    fn what_is_wrong_is_named_with_line_and_column() {
        for (text, line, column, words) in [
            ("", 0, 0, "is empty"),
            ("t_s,v1_v,tip_z_mm\n", 1, 0, "no rows"),
            ("t_s,tip_z_mm\n0,1\n", 1, 0, "v1_v is missing"),
            ("t_s,v1_v,v2_v,tip_z_mm\n0,1,1,1\n", 1, 3, "another robot"),
            ("t_s,v1_v,nose_z_mm\n0,1,1\n", 1, 3, "nose_z_mm"),
            ("t_s,v1_v,tip_z_mm\n0,1,1\n0,1,1\n", 3, 1, "times must rise"),
            ("t_s,v1_v,tip_z_mm\n0,1,one\n", 2, 3, "\"one\" is not a number"),
            ("t_s,v1_v,tip_z_mm\n0,,1\n", 2, 2, "is not a number"),
            ("t_s,v1_v,tip_z_mm\n0,1,\n1,1,\n", 2, 0, "all values"),
            ("t_s,v1_v\n0,1\n", 1, 0, "no column of a marker"),
            ("t_s,v1_v,tip_z_mm\n0,1\n", 2, 0, "fields"),
        ] {
            let error = parse_run(text.as_bytes(), 1, &markers(), |_| Ok(())).unwrap_err();
            assert!(error.reason.contains(words) && (error.line, error.column) == (line, column), "{text:?}: {error:?}");
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_run_or_an_error_but_never_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..300), head in any::<bool>()) {
            let mut text = if head { b"t_s,v1_v,tip_z_mm\n".to_vec() } else { Vec::new() };
            text.extend(bytes);
            let _ = parse_run(&text, 1, &markers(), |_| Ok(()));
        }
    }
}
