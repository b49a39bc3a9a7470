//! Reading a data set, with checks of description and runs.

use std::ops::RangeInclusive;
use std::path::Path;

use super::super::observations::ObservationError;
use super::super::{observations, robot, run_csv, voltage};
use super::{DataError, Dataset, Description, MOST_STEPS, Marker, MeasuredRun};
use crate::analytic;
use crate::experiment::{self, Config, ConfigError, DriveConfig, SimulationConfig, Source, StepConfig, presets};
use crate::model::{Mount, Robot};
use crate::words;

/// Range of a standard deviation (mm).
const NOISE_MM: RangeInclusive<f64> = 1e-9..=1e5;

impl Dataset {
    /// Reads a description (a file, the folder of a `dataset.toml`, or `preset:NAME`) and its runs.
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
            |key: &[&str], reason: String| DataError::Content { path: path.into(), line: line_of(&text, key), column: 0, reason };
        if let (false, [_, ..]) = (description.run.is_empty(), &description.observation[..]) {
            return Err(value_error(
                path,
                &text,
                &["observation", "0"],
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
            return Err(wrong(&["dataset"], "there are no runs: add [[run]] tables with id and file".into()));
        }
        if description.markers.is_empty() && !description.run.is_empty() {
            return Err(wrong(&["markers"], "there are no markers: add [markers] with name = distance in mm".into()));
        }
        let mut markers = Vec::new();
        for (name, position) in &description.markers {
            if !(0.0..=10.0 * length + 1e-9).contains(position) {
                return Err(wrong(
                    &["markers", name],
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
                    &["noise", key],
                    format!("{key} is neither default_mm nor the name of a marker with _mm{hint}"),
                ));
            }
            if !NOISE_MM.contains(value) {
                let [value, low, high] = [value, NOISE_MM.start(), NOISE_MM.end()].map(|x| words::number(*x));
                let reason = format!("{key} is {value}, but must be positive: between {low} and {high}");
                return Err(wrong(&["noise", key], reason));
            }
        }
        for (key, value, most) in description.bench.entries() {
            if let Some(value) = value.filter(|value| !(0.0..=most).contains(value)) {
                let reason = format!(
                    "{key} is {}, but must be a standard deviation between 0 and {}; leave it out to have it estimated",
                    words::number(value),
                    words::number(most)
                );
                return Err(value_error(path, &text, &["bench", key], &format!("bench.{key}"), reason));
            }
        }
        for marker in &markers {
            let own = description.noise.get(&format!("{}_mm", marker.name)).or(description.noise.get("default_mm")).copied();
            noise.extend([own, own]);
        }
        let mut runs: Vec<MeasuredRun> = Vec::new();
        for (index, entry) in description.run.iter().enumerate() {
            let number = index.to_string();
            let at = |key: &'static str| ["run", &number, key];
            if entry.id.trim().is_empty() {
                return Err(wrong(&at("id"), "id is empty; every run needs a name".into()));
            }
            if runs.iter().any(|run| run.id == entry.id) {
                return Err(wrong(&at("id"), format!("id: two runs are called {:?}", entry.id)));
            }
            let file = path.parent().unwrap_or(Path::new("")).join(&entry.file);
            let run_csv::Rows { times, voltages, channels, remarks } =
                run_csv::read(&file, &robot, nominal.robot.positive_gain.unwrap_or(1.0), &markers)?;
            let run = MeasuredRun { id: entry.id.clone(), path: file, role: entry.role, times, voltages, channels, remarks };
            runs.push(run.checked(&robot)?);
        }
        let mut observations = description.observation;
        for (index, observation) in observations.iter_mut().enumerate() {
            if let Some(file) = &mut observation.drive.file {
                *file = path.parent().unwrap_or(Path::new("")).join(&*file);
            }
            observations::check(&nominal, observation).map_err(|error| match error {
                ObservationError::Value { key, message } => {
                    let number = index.to_string();
                    let parts: Vec<&str> = ["observation", &number].into_iter().chain(key.split('.')).collect();
                    value_error(path, &text, &parts, &format!("observation {}: {key}", index + 1), message)
                }
                ObservationError::Other(error) => error.into(),
            })?;
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
            bench: description.bench,
            runs,
            observations,
        })
    }
}

impl MeasuredRun {
    /// The run, if it is short enough to be simulated and its voltages are known between rows.
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

/// Line (from 1) of the deepest part of a key that the text contains; 1 without any.
fn line_of(text: &str, key: &[&str]) -> u64 {
    experiment::line_of(text, key.iter().copied()).map_or(1, |line| line as u64)
}

/// A wrong value of a description: a usage error.
fn value_error(path: &Path, text: &str, parts: &[&str], key: &str, message: impl Into<String>) -> DataError {
    let place = format!("{}, line {}", path.display(), line_of(text, parts));
    ConfigError::Value { place, key: key.into(), message: message.into() }.into()
}

/// The robot of a description, resolved as that of an experiment at rest.
fn resolved_robot(path: &Path, text: &str, nominal: &Config) -> Result<Robot, ConfigError> {
    let actuators = nominal.robot.actuators.unwrap_or(5);
    let mut config = nominal.clone();
    config.drive.waveform = Some("dc".into());
    config.drive.voltages_v = Some(vec![0.0; actuators.min(10_000)]);
    let shown = toml::to_string(&config)
        .map_err(|error| ConfigError::Syntax { source_name: path.display().to_string(), message: error.to_string() })?;
    experiment::experiment(&Source::from_text(path.display().to_string(), shown)).map(|experiment| experiment.robot).map_err(
        |error| {
            match error {
                // Lines of the description, not of the experiment made from it.
                ConfigError::Value { key, message, .. } => {
                    let parts: Vec<&str> = key.split('.').collect();
                    ConfigError::Value { place: format!("{}, line {}", path.display(), line_of(text, &parts)), key, message }
                }
                other => other,
            }
        },
    )
}
