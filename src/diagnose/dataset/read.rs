//! Reading a data set, with checks of description and runs.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::Path;

use super::super::identify::Space;
use super::super::observations;
use super::super::observations::ObservationError;
use super::super::run_csv;
use super::{Camera, Column, DataError, Dataset, Description, Marker, MeasuredRun, Observation};
use crate::effects::{self, Kind};
use crate::experiment::{self, Config, ConfigError, DriveConfig, EffectConfig, SimulationConfig, Source, StepConfig, presets};
use crate::model::Robot;
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
        let has_runs =
            !(description.run.is_empty() && description.frequency_response.is_empty() && description.steady.is_empty());
        if let (true, [_, ..]) = (has_runs, &description.observation[..]) {
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
            effect: description.effect,
            ensemble: None,
        };
        check_effects(&nominal.effect)
            .map_err(|(index, reason)| value_error(path, &text, &["effect", &index.to_string()], "effect", reason))?;
        let robot = resolved_robot(path, &text, &nominal, &[])?;
        let length = robot.material.actuator_length * robot.actuators as f64;
        if !has_runs && description.observation.is_empty() {
            return Err(wrong(&["dataset"], "there are no runs: add [[run]] tables with id and file".into()));
        }
        if description.markers.is_empty() && has_runs {
            return Err(wrong(&["markers"], "there are no markers: add [markers] with name = distance in mm".into()));
        }
        let mut markers = Vec::new();
        for (name, position) in &description.markers {
            if !(0.0..=10.0 * length + 1e-9).contains(position) {
                return Err(wrong(&["markers", name], beyond(name, *position, length)));
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
        let columns = &description.columns;
        run_csv::check_columns(columns, &robot, &markers)
            .map_err(|(key, reason)| value_error(path, &text, &["columns", &key], &format!("columns.{key}"), reason))?;
        let camera = description.camera;
        let per_frame = camera.frame_rate_hz.map_or(1e3, |rate| 1e3 / rate);
        for (key, value, most) in [("frame_rate_hz", camera.frame_rate_hz, 1e6), ("exposure_ms", camera.exposure_ms, per_frame)] {
            if let Some(value) = value.filter(|value| !(*value > 0.0 && *value <= most * (1.0 + 1e-9))) {
                let reason = format!("is {}, but must be above 0 and at most {}", words::number(value), words::number(most));
                let why =
                    if key == "exposure_ms" && camera.frame_rate_hz.is_some() { ", the time between two frames" } else { "" };
                return Err(value_error(path, &text, &["camera", key], &format!("camera.{key}"), reason + why));
            }
        }
        let reader = Reader { path, text: &text, nominal: &nominal, robot: &robot, markers: &markers, columns, camera };
        let mut runs: Vec<MeasuredRun> = Vec::new();
        for (index, entry) in description.run.iter().enumerate() {
            let number = index.to_string();
            if entry.id.trim().is_empty() {
                return Err(wrong(&["run", &number, "id"], "id is empty; every run needs a name".into()));
            }
            if runs.iter().any(|run| run.id == entry.id) {
                return Err(wrong(&["run", &number, "id"], format!("id: two runs are called {:?}", entry.id)));
            }
            runs.push(reader.run(index, entry)?);
        }
        for (index, entry) in description.frequency_response.iter().enumerate() {
            if runs.iter().any(|run| run.id == entry.id) {
                let parts = ["frequency_response", &index.to_string(), "id"];
                return Err(wrong(&parts, format!("id: two runs are called {:?}", entry.id)));
            }
            runs.push(reader.response(index, entry)?);
        }
        for (index, entry) in description.steady.iter().enumerate() {
            runs.push(reader.steady(index, entry)?);
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
        if let (None, Some(index)) = (&description.identify, observations.iter().position(Observation::is_foretold)) {
            let number = index.to_string();
            let key = format!("observation {}: role", index + 1);
            let message = "foretell belongs to a data set with [identify]";
            return Err(value_error(path, &text, &["observation", &number, "role"], &key, message));
        }
        let identify = description.identify.map(|identify| {
            let checked = if has_runs {
                Err((None, "is for [[observation]] tables; causes of runs are found without it".into()))
            } else if observations.iter().all(Observation::is_foretold) {
                Err((None, "has nothing to fit: every [[observation]] is to be foretold".into()))
            } else {
                Space::new(&identify).and_then(|space| space.check(&nominal, &observations).map(|()| space))
            };
            checked.map(|space| (identify, space)).map_err(|(key, message): (Option<String>, String)| {
                let parts: Vec<&str> =
                    ["identify"].into_iter().chain(key.iter().flat_map(|key| ["vary", key.as_str()])).collect();
                let shown = key.as_ref().map_or_else(|| "identify".to_owned(), |key| format!("identify.vary.\"{key}\""));
                value_error(path, &text, &parts, &shown, message)
            })
        });
        let identify = identify.transpose()?;
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
            camera,
            runs,
            observations,
            identify,
        })
    }
}

/// A description being read.
pub(super) struct Reader<'a> {
    pub path: &'a Path,
    pub text: &'a str,
    pub nominal: &'a Config,
    pub robot: &'a Robot,
    pub markers: &'a [Marker],
    pub columns: &'a BTreeMap<String, Column>,
    pub camera: Camera,
}

/// What is wrong with a marker at `position` (mm) of a robot of `length` (cm).
pub(super) fn beyond(name: &str, position: f64, length: f64) -> String {
    let [position, length] = [position, 10.0 * length].map(words::number);
    format!("marker {name} is at {position} mm, but the robot is {length} mm long")
}

/// Checks that known effects are of the structure, which all runs have from start to end.
///
/// # Errors
/// The index of the wrong one, and why.
pub(super) fn check_effects(effects: &[EffectConfig]) -> Result<(), (usize, String)> {
    for (index, effect) in effects.iter().enumerate() {
        if effects::find(&effect.id).is_some_and(|known| known.kind != Kind::Structure) {
            let known: Vec<&str> = effects::EFFECTS.iter().filter(|e| e.kind == Kind::Structure).map(|e| e.id).collect();
            let reason = format!(
                "is {}, but what a data set knows to be there must be of the structure: {}; other causes are for the diagnosis to find",
                effect.id,
                known.join(", ")
            );
            return Err((index, reason));
        }
    }
    Ok(())
}

/// Line (from 1) of the deepest part of a key that the text contains; 1 without any.
pub(super) fn line_of(text: &str, key: &[&str]) -> u64 {
    experiment::line_of(text, key.iter().copied()).map_or(1, |line| line as u64)
}

/// A wrong value of a description: a usage error.
pub(super) fn value_error(path: &Path, text: &str, parts: &[&str], key: &str, message: impl Into<String>) -> DataError {
    let place = format!("{}, line {}", path.display(), line_of(text, parts));
    ConfigError::Value { place, key: key.into(), message: message.into() }.into()
}

/// The robot of a config, resolved as that of an experiment at rest; `table` is the path of the table in the description that overrides it.
pub(super) fn resolved_robot(path: &Path, text: &str, nominal: &Config, table: &[&str]) -> Result<Robot, ConfigError> {
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
                    let parts: Vec<&str> = table.iter().copied().chain(key.split('.')).collect();
                    ConfigError::Value { place: format!("{}, line {}", path.display(), line_of(text, &parts)), key, message }
                }
                other => other,
            }
        },
    )
}
