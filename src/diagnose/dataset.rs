//! Measured data: a description in TOML and one CSV per run, read with checks.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use thiserror::Error;

use crate::experiment::{
    Config, ConfigError, DriveConfig, MaterialConfig, RobotConfig, SimulationConfig, Source, StepConfig, experiment, presets,
};
use crate::model::Robot;
use crate::recording::definitions;
use crate::words;

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
        let line_of =
            |words: &str| text.lines().position(|line| line.trim_start().starts_with(words)).map_or(1, |at| at as u64 + 1);
        let wrong =
            |words: &str, reason: String| DataError::Content { path: path.into(), line: line_of(words), column: 0, reason };

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
            return Err(wrong("[dataset]", "there are no runs: add [[run]] tables with id and file".into()));
        }
        if description.markers.is_empty() && !description.run.is_empty() {
            return Err(wrong("[dataset]", "there are no markers: add [markers] with name = distance in mm".into()));
        }
        let mut markers = Vec::new();
        for (name, position) in &description.markers {
            if !(0.0..=10.0 * length + 1e-9).contains(position) {
                return Err(wrong(
                    name,
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
                return Err(wrong(key, format!("{key} is neither default_mm nor the name of a marker with _mm{hint}")));
            }
            if !(value.is_finite() && *value > 0.0) {
                return Err(wrong(key, format!("{key} is {}, but must be positive", words::number(*value))));
            }
        }
        for marker in &markers {
            let own = description.noise.get(&format!("{}_mm", marker.name)).or(description.noise.get("default_mm")).copied();
            noise.extend([own, own]);
        }
        let mut runs: Vec<MeasuredRun> = Vec::new();
        for entry in &description.run {
            if runs.iter().any(|run| run.id == entry.id) {
                return Err(wrong(&format!("id = \"{}\"", entry.id), format!("two runs are called {}", entry.id)));
            }
            let file = path.parent().unwrap_or(Path::new("")).join(&entry.file);
            let (times, voltages, channels, remarks) = read_run(&file, &robot, &markers)?;
            runs.push(MeasuredRun { id: entry.id.clone(), path: file, role: entry.role, times, voltages, channels, remarks });
        }
        for observation in &description.observation {
            if !definitions::names().contains(&observation.measure.as_str()) {
                let reason = words::not_one_of(&observation.measure, &definitions::names());
                return Err(wrong(&format!("measure = \"{}\"", observation.measure), format!("measure: {reason}")));
            }
            if !(observation.sigma.is_finite() && observation.sigma > 0.0 && observation.value.is_finite()) {
                return Err(wrong(
                    "[[observation]]",
                    format!("{}: value and sigma must be numbers, sigma positive", observation.measure),
                ));
            }
        }
        let name = if description.dataset.name.is_empty() {
            path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
        } else {
            description.dataset.name
        };
        Ok(Self {
            name,
            about: description.dataset.about,
            nominal,
            robot,
            markers,
            noise,
            runs,
            observations: description.observation,
        })
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
                let name = key.rsplit('.').next().unwrap_or(&key);
                let line =
                    text.lines().position(|line| line.trim_start().starts_with(name)).map(|at| format!(", line {}", at + 1));
                ConfigError::Value { place: format!("{}{}", path.display(), line.unwrap_or_default()), key, message }
            }
            other => other,
        }
    })
}

type RunData = (Vec<f64>, Vec<f64>, Vec<Vec<f64>>, Vec<String>);

fn read_run(path: &Path, robot: &Robot, markers: &[Marker]) -> Result<RunData, DataError> {
    let bytes =
        crate::files::read(path).map_err(|error| DataError::Unreadable { path: path.into(), reason: error.to_string() })?;
    parse_run(&bytes, robot.actuators, markers).map_err(|Wrong { line, column, reason }| match line {
        0 => DataError::Unreadable { path: path.into(), reason },
        _ => DataError::Content { path: path.into(), line, column, reason },
    })
}

#[derive(Debug)]
struct Wrong {
    line: u64,
    column: usize,
    reason: String,
}

fn parse_run(bytes: &[u8], actuators: usize, markers: &[Marker]) -> Result<RunData, Wrong> {
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
        let time = number(time_column)?;
        if times.last().is_some_and(|last| time <= *last) {
            return Err(wrong(
                line,
                time_column + 1,
                format!("t_s is {} after {}; times must rise", words::number(time), words::number(times[times.len() - 1])),
            ));
        }
        times.push(time);
        for &column in &volt_columns {
            voltages.push(number(column)?);
        }
        for (channel, column) in channels.iter_mut().zip(&columns) {
            if let Some(column) = *column {
                let empty = record.get(column).unwrap_or_default().is_empty();
                channel.push(if empty { f64::NAN } else { number(column)? });
            }
        }
    }
    if times.is_empty() {
        return Err(wrong(1, 0, "there are no rows below the header".into()));
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
        let (times, voltages, channels, remarks) = parse_run(text, 1, &markers()).unwrap();
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
            let error = parse_run(text.as_bytes(), 1, &markers()).unwrap_err();
            assert!(error.reason.contains(words) && (error.line, error.column) == (line, column), "{text:?}: {error:?}");
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_run_or_an_error_but_never_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..300), head in any::<bool>()) {
            let mut text = if head { b"t_s,v1_v,tip_z_mm\n".to_vec() } else { Vec::new() };
            text.extend(bytes);
            let _ = parse_run(&text, 1, &markers());
        }
    }
}
