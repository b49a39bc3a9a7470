//! Many runs of one experiment over a grid of values, in parallel, resumable and divisible.
//!
//! A sweep file names an experiment, the measures wanted and the values to vary:
//!
//! ```toml
//! experiment = "jump.toml"            # beside the sweep file, or "preset:NAME"
//! measures = ["jump_height_mm"]
//! [vary]                              # cartesian product, the last key fastest
//! "drive.on_time_s" = [0.004, 0.012, 0.020]
//! "robot.damping_eta" = { from = 0.008, to = 0.108, count = 5 }
//! ```
//!
//! Runs are on the planar engine unless the experiment names an engine.

mod finished;
mod identity;
mod journal;
mod merge;
mod rows;
mod run;
mod shard;
pub mod status;
pub mod submit;

pub use finished::Finished;
pub use identity::{adopt, claim};
pub use journal::PROGRAM;
pub use merge::{gather, merge, missing, rows};
pub use rows::{Point, Row, RowError, Rows};
pub use run::{Outcome, all_have_begun, mean_time, run};
pub use shard::Shard;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::Deserialize;
use toml::{Table, Value};

use crate::experiment::{self, ConfigError, Experiment, Setting, Source, Spread, ensemble, line_of, presets};
use crate::files;
use crate::recording::definitions;
use crate::words;

/// Largest number of points of a grid. Those that a process computes are checked before its first run, in about 25 µs each.
const MAX_POINTS: usize = 10_000_000;

/// A varied key with its values.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Key of the experiment file, with dots.
    pub key: String,
    /// Its values, in order.
    pub values: Vec<Value>,
    /// File and line of the values, for messages.
    pub place: String,
}

impl Axis {
    /// True if a setting of `key`, or of a table that contains it, would change these values.
    fn overlaps(&self, key: &str) -> bool {
        let inside = |inner: &str, outer: &str| inner.strip_prefix(outer).is_some_and(|rest| rest.starts_with('.'));
        self.key == key || inside(&self.key, key) || inside(key, &self.key)
    }
}

/// A sweep.
#[derive(Debug, Clone)]
pub struct Sweep {
    /// The experiment that is varied.
    pub source: Source,
    /// Names of the measures wanted.
    pub measures: Vec<String>,
    /// The varied keys; the last runs fastest.
    pub axes: Vec<Axis>,
    /// Whether every point is an ensemble.
    is_ensemble: bool,
    /// Paths of the files that the experiments refer to, as written there, with a digest of their content.
    files: BTreeMap<String, String>,
}

/// A sweep file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct File {
    experiment: String,
    measures: Vec<String>,
    vary: Table,
    ensemble: Option<Table>,
}

/// `{ from, to, count }`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Range {
    from: f64,
    to: f64,
    count: usize,
}

impl Sweep {
    /// Parses a sweep and checks its first point; [`check`](Self::check) does the others. `name` is for messages; the experiment's path is relative to
    /// `folder`.
    ///
    /// # Errors
    /// [`ConfigError`] for unknown keys or measures, an empty range, or a first point that is not a valid experiment.
    pub fn from_text(name: &str, text: &str, folder: &Path) -> Result<Self, ConfigError> {
        Self::with_settings(name, text, folder, &[])
    }

    fn with_settings(name: &str, text: &str, folder: &Path, settings: &[String]) -> Result<Self, ConfigError> {
        let file: File = toml::from_str(text)
            .map_err(|error| ConfigError::Syntax { source_name: name.into(), message: words::toml_error(&error) })?;
        let document = Document { name, text };
        let mut source = match file.experiment.strip_prefix("preset:") {
            Some(preset) => {
                let unknown = || document.fault("experiment", presets::unknown(preset));
                Source::from_text(preset, presets::text_of(preset).ok_or_else(unknown)?)
            }
            None => Source::from_file(&folder.join(&file.experiment))?,
        };
        document.check_measures(&file.measures)?;
        let mut axes = document.axes(file.vary)?;
        for setting in settings {
            apply(Setting::parse(setting)?, &mut source, &mut axes)?;
        }
        if source.parse()?.simulation.engine.is_none() {
            source.push(Setting {
                key: "simulation.engine".into(),
                value: "planar".into(),
                place: "the engine of sweeps by default".into(),
            });
        }
        if let Some(ensemble) = file.ensemble {
            let place = document.place(&["ensemble"]);
            source.push(Setting { key: "ensemble".into(), value: Value::Table(ensemble).to_string(), place });
        }
        if axes.is_empty() {
            return Err(document.wrong_size());
        }
        let is_ensemble = source.parse()?.ensemble.is_some();
        let mut sweep = Self { source, measures: file.measures, axes, is_ensemble, files: BTreeMap::new() };
        for index in sweep.combinations_of_words() {
            for file in experiment::experiment(&sweep.source_of(index)?)?.config.files() {
                let name = file.display().to_string();
                if !sweep.files.contains_key(&name) {
                    sweep.files.insert(name, sweep.digest(file)?);
                }
            }
        }
        sweep.members(0)?;
        Ok(sweep)
    }

    /// Points with all combinations of the values that are not numbers, which alone can name files, each with the first of the numbers.
    fn combinations_of_words(&self) -> Vec<usize> {
        let mut points = vec![0];
        let mut stride = self.len();
        for axis in &self.axes {
            stride /= axis.values.len();
            if !axis.values.iter().all(is_numeric) {
                points =
                    points.iter().flat_map(|point| (0..axis.values.len()).map(move |value| point + value * stride)).collect();
            }
        }
        points
    }

    /// Checks points, on all threads of the current pool.
    ///
    /// # Errors
    /// [`ConfigError`] of the first one that is not a valid experiment.
    pub fn check(&self, points: &[usize]) -> Result<(), ConfigError> {
        match points.par_iter().find_map_first(|&index| self.experiment(index).err()) {
            Some(error) => Err(error),
            None => Ok(()),
        }
    }

    fn digest(&self, file: &Path) -> Result<String, ConfigError> {
        let path = self.source.folder.join(file);
        match files::read(&path) {
            Ok(bytes) => Ok(files::digest(&bytes)),
            Err(error) => Err(ConfigError::Data { path, reason: error.to_string() }),
        }
    }

    /// The first file of an experiment, or of all experiments, whose content changed since the sweep was read.
    fn changed(&self, experiment: Option<&Experiment>) -> Option<PathBuf> {
        let as_before = |file: &Path| self.files.get(&file.display().to_string()) == self.digest(file).ok().as_ref();
        let changed = match experiment {
            Some(experiment) => experiment.config.files().find(|file| !as_before(file)),
            None => self.files.keys().map(Path::new).find(|file| !as_before(file)),
        };
        changed.map(|file| self.source.folder.join(file))
    }

    /// Reads a sweep file, or a built-in one (`preset:NAME`, or `NAME` where there is no file of that name), with settings `KEY=VALUE`
    /// of its experiment.
    ///
    /// # Errors
    /// As [`from_text`](Self::from_text), and [`ConfigError::Unreadable`].
    pub fn open(path: &Path, settings: &[String]) -> Result<Self, ConfigError> {
        let name = path.display().to_string();
        let prefixed = name.strip_prefix("preset:");
        if prefixed.is_some() || !path.exists() {
            let preset = prefixed.unwrap_or(&name);
            let unknown = || {
                let file = if prefixed.is_some() { "" } else { "no such file, and " };
                ConfigError::Unreadable { path: path.into(), reason: format!("{file}{}", presets::unknown(preset)) }
            };
            let found = presets::find_sweep(preset).ok_or_else(unknown)?;
            return Self::with_settings(preset, found.text, Path::new(""), settings);
        }
        let text =
            files::read_text(path).map_err(|error| ConfigError::Unreadable { path: path.into(), reason: error.to_string() })?;
        Self::with_settings(&name, &text, path.parent().unwrap_or(Path::new("")), settings)
    }

    /// The same sweep of the experiment as it is written, without its `[ensemble]`.
    #[must_use]
    pub fn without_ensemble(mut self) -> Self {
        self.is_ensemble = false;
        self
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.axes.iter().map(|axis| axis.values.len()).product()
    }

    /// True if there is no point, which no sweep from a file has.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The values of a point, one per axis.
    pub fn point(&self, index: usize) -> Vec<&Value> {
        self.axes.iter().zip(self.places(index)).map(|(axis, place)| &axis.values[place]).collect()
    }

    /// The places of a point's values in the lists of the axes.
    fn places(&self, index: usize) -> impl Iterator<Item = usize> {
        let mut stride = self.len();
        self.axes.iter().map(move |axis| {
            stride /= axis.values.len();
            index / stride % axis.values.len()
        })
    }

    /// The experiment of a point.
    ///
    /// # Errors
    /// [`ConfigError`] with the key and its value, if the point is not a valid experiment.
    pub fn experiment(&self, index: usize) -> Result<Experiment, ConfigError> {
        experiment::experiment(&self.source_of(index)?)
    }

    /// The experiments of a point: its ensemble, or one alone.
    ///
    /// # Errors
    /// [`ConfigError`] if the point, or a perturbed one, is not a valid experiment.
    pub fn members(&self, index: usize) -> Result<Vec<Experiment>, ConfigError> {
        if self.is_ensemble { ensemble::members(&self.source_of(index)?) } else { Ok(vec![self.experiment(index)?]) }
    }

    fn source_of(&self, index: usize) -> Result<Source, ConfigError> {
        let mut source = self.source.clone();
        for (axis, value) in self.axes.iter().zip(self.point(index)) {
            let place = if axis.place.starts_with("--set") {
                axis.place.clone()
            } else {
                format!("{}, {} = {value}", axis.place, axis.key)
            };
            source.push(Setting { key: axis.key.clone(), value: value.to_string(), place });
        }
        Ok(source)
    }

    /// The columns of measures: each measure, or its [`Spread`] over the members of an ensemble, as `mean_speed_mm_s`.
    pub fn columns(&self) -> Vec<String> {
        let prefixes: &[&str] = if self.is_ensemble { &Spread::PREFIXES } else { &[""] };
        self.measures.iter().flat_map(|measure| prefixes.iter().map(move |prefix| format!("{prefix}{measure}"))).collect()
    }

    /// The header of the results.
    pub fn header(&self) -> Vec<String> {
        let keys = self.axes.iter().map(|axis| axis.key.clone());
        keys.chain(self.columns()).chain(["status".to_owned()]).collect()
    }
}

/// True for numbers and lists of them.
fn is_numeric(value: &Value) -> bool {
    match value {
        Value::Integer(_) | Value::Float(_) => true,
        Value::Array(list) => list.iter().all(is_numeric),
        _ => false,
    }
}

/// The text of a sweep file with its name, for messages.
struct Document<'a> {
    name: &'a str,
    text: &'a str,
}

impl Document<'_> {
    /// Name and line of a key.
    fn place(&self, key: &[&str]) -> String {
        let name = self.name;
        line_of(self.text, key.iter().copied()).map_or_else(|| name.to_owned(), |line| format!("{name}, line {line}"))
    }

    fn fault(&self, key: &str, message: String) -> ConfigError {
        ConfigError::Value { place: self.place(&[key]), key: key.into(), message }
    }

    /// The error of a grid without points or with too many.
    fn wrong_size(&self) -> ConfigError {
        self.fault("vary", format!("must give between 1 and {MAX_POINTS} points"))
    }

    fn check_measures(&self, measures: &[String]) -> Result<(), ConfigError> {
        let names = definitions::names();
        if measures.is_empty() {
            return Err(self.fault("measures", format!("is empty; choose from {}", names.join(", "))));
        }
        for (i, measure) in measures.iter().enumerate() {
            if !names.contains(&measure.as_str()) {
                return Err(self.fault("measures", words::not_one_of(measure, &names)));
            }
            if measures[..i].contains(measure) {
                return Err(self.fault("measures", format!("{measure} is listed twice")));
            }
        }
        Ok(())
    }

    /// The axes of `[vary]`.
    fn axes(&self, vary: Table) -> Result<Vec<Axis>, ConfigError> {
        let mut axes = Vec::new();
        for (key, values) in vary {
            let place = self.place(&["vary", &key]);
            let values = axis(&values).map_err(|message| ConfigError::Value {
                place: place.clone(),
                key: format!("vary.\"{key}\""),
                message,
            })?;
            axes.push(Axis { key, values, place });
            if points(&axes).is_none() {
                return Err(self.wrong_size());
            }
        }
        Ok(axes)
    }
}

/// Applies a setting to the experiment, or to the axis of its key if that has a single value.
fn apply(setting: Setting, source: &mut Source, axes: &mut [Axis]) -> Result<(), ConfigError> {
    match axes.iter_mut().find(|axis| axis.overlaps(&setting.key)) {
        None => source.push(setting),
        Some(axis) if axis.values.len() == 1 && axis.key == setting.key => {
            (axis.values, axis.place) = (vec![setting.toml()], setting.place);
        }
        Some(axis) => {
            let message = format!("the sweep varies {} ({}); change its values there", axis.key, axis.place);
            return Err(ConfigError::Value { place: setting.place, key: setting.key, message });
        }
    }
    Ok(())
}

/// Number of points of a grid; `None` if there are too many.
fn points(axes: &[Axis]) -> Option<usize> {
    let points = axes.iter().try_fold(1_usize, |points, axis| points.checked_mul(axis.values.len()));
    points.filter(|points| *points <= MAX_POINTS)
}

/// A list of values, or a range of evenly spaced values with exact ends.
fn axis(values: &Value) -> Result<Vec<Value>, String> {
    let list = match values {
        Value::Array(list) => list.clone(),
        Value::Table(_) => {
            let Range { from, to, count } =
                values.clone().try_into().map_err(|error: toml::de::Error| words::toml_error(&error))?;
            if !(from.is_finite() && to.is_finite()) {
                return Err("from and to must be finite".into());
            }
            if count > MAX_POINTS {
                return Err(format!("count must be at most {MAX_POINTS}"));
            }
            let step = (to - from) / (count.max(2) - 1) as f64;
            (0..count).map(|i| Value::Float(if i + 1 == count && i > 0 { to } else { from + i as f64 * step })).collect()
        }
        _ => return Err("must be a list of values, or { from = …, to = …, count = … }".into()),
    };
    if list.is_empty() { Err("has no values".into()) } else { Ok(list) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TEXT: &str = "experiment = \"preset:jump-on-time\"\nmeasures = [\"jump_height_mm\"]\n[vary]\n";

    fn sweep(vary: &str) -> Result<Sweep, ConfigError> {
        let sweep = Sweep::from_text("s.toml", &format!("{TEXT}{vary}"), Path::new(""))?;
        sweep.check(&(0..sweep.len()).collect::<Vec<_>>()).map(|()| sweep)
    }

    #[test]
    fn points_run_through_the_axes_with_the_last_fastest() {
        let sweep =
            sweep("\"robot.damping_eta\" = [0.01, 0.02]\n\"drive.on_time_s\" = { from = 0.0, to = 0.3, count = 4 }").unwrap();
        assert_eq!(sweep.len(), 8);
        let point = |i| sweep.point(i).into_iter().map(|v| v.as_float().unwrap()).collect::<Vec<_>>();
        assert_eq!(point(0), [0.01, 0.0]);
        assert_eq!(point(3), [0.01, 0.3]);
        assert_eq!(point(4), [0.02, 0.0]);
        assert_eq!(sweep.header(), ["robot.damping_eta", "drive.on_time_s", "jump_height_mm", "status"]);
        assert_eq!(sweep.experiment(7).unwrap().robot.damping.eta(), 0.02);
    }

    #[test]
    fn whatever_is_no_sweep_is_refused_with_its_key() {
        for (vary, word) in [
            ("\"robot.legs\" = [4]", "legs"),
            ("\"drive.on_time_s\" = []", "no values"),
            ("\"drive.on_time_s\" = { from = 0.0, to = 1.0, count = 0 }", "no values"),
            ("\"drive.on_time_s\" = { from = 0.0, to = 1.0 }", "count"),
            ("\"drive.on_time_s\" = 3", "list"),
            ("\"material.width_mm\" = [20, -1]", "material.width_mm"),
            ("", "points"),
        ] {
            let error = sweep(vary).unwrap_err().to_string();
            assert!(error.contains(word), "{vary}: {error}");
        }
        let text = TEXT.replace("jump_height_mm", "hight");
        assert!(Sweep::from_text("s", &text, Path::new("")).unwrap_err().to_string().contains("hight"));
    }

    proptest! {
        #[test]
        fn any_text_is_a_sweep_or_an_error_but_never_a_panic(text in ".{0,200}") {
            let _ = Sweep::from_text("fuzz", &text, Path::new(""));
            let _ = Sweep::from_text("fuzz", &format!("{TEXT}\"drive.on_time_s\" = {text}"), Path::new(""));
        }
    }
}
