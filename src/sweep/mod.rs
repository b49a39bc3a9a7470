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
//! The runs are those of the planar engine unless the experiment names the other one.

mod rows;
mod run;

pub use rows::{Row, RowError, Rows, merge};
pub use run::{Outcome, run};

use std::path::Path;

use serde::Deserialize;
use toml::{Table, Value};

use crate::experiment::{self, ConfigError, Experiment, Source, presets};
use crate::recording::definitions;
use crate::words;

/// Largest number of points of a grid.
const MAX_POINTS: usize = 10_000_000;

/// One key and the values that it takes.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Key of the experiment file, with dots.
    pub key: String,
    /// Its values, in order.
    pub values: Vec<Value>,
}

/// A checked sweep.
#[derive(Debug, Clone)]
pub struct Sweep {
    /// The experiment that is varied.
    pub source: Source,
    /// Names of the measures wanted.
    pub measures: Vec<String>,
    /// What is varied; the last axis runs fastest.
    pub axes: Vec<Axis>,
}

/// The file as written.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct File {
    experiment: String,
    measures: Vec<String>,
    vary: Table,
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
    /// Reads a sweep from its text. `name` is for messages, `folder` where the experiment's path starts. Every point is checked.
    ///
    /// # Errors
    /// [`ConfigError`] for anything that is not a sweep: unknown keys or measures, an empty range, a point that makes no experiment.
    pub fn from_text(name: &str, text: &str, folder: &Path) -> Result<Self, ConfigError> {
        Self::with_settings(name, text, folder, &[])
    }

    fn with_settings(name: &str, text: &str, folder: &Path, settings: &[String]) -> Result<Self, ConfigError> {
        let file: File = toml::from_str(text)
            .map_err(|error| ConfigError::Syntax { source_name: name.into(), message: words::toml_error(&error) })?;
        let fault = |key: &str, message: String| ConfigError::Value { place: name.into(), key: key.into(), message };
        let mut source = match file.experiment.strip_prefix("preset:") {
            Some(preset) => {
                let found = presets::find(preset).ok_or_else(|| fault("experiment", presets::unknown(preset)))?;
                Source::from_text(found.name, found.text)
            }
            None => Source::from_file(&folder.join(&file.experiment))?,
        };
        for setting in settings {
            source.set(setting)?;
        }
        // Sweeps are what the fast engine is for.
        if source.parse()?.simulation.engine.is_none() {
            source.set("simulation.engine=planar")?;
        }
        if file.measures.is_empty() {
            return Err(fault("measures", format!("is empty; choose from {}", definitions::names().join(", "))));
        }
        for (i, measure) in file.measures.iter().enumerate() {
            if !definitions::names().contains(&measure.as_str()) {
                return Err(fault("measures", words::not_one_of(measure, &definitions::names())));
            }
            if file.measures[..i].contains(measure) {
                return Err(fault("measures", format!("{measure} stands there twice")));
            }
        }
        let axes = file
            .vary
            .into_iter()
            .map(|(key, values)| {
                let values = axis(&values).map_err(|message| fault(&format!("vary.\"{key}\""), message))?;
                Ok(Axis { key, values })
            })
            .collect::<Result<Vec<_>, ConfigError>>()?;
        let points = axes.iter().try_fold(1_usize, |points, axis| points.checked_mul(axis.values.len()));
        if axes.is_empty() || points.is_none_or(|points| points > MAX_POINTS) {
            return Err(fault("vary", format!("must give between 1 and {MAX_POINTS} points")));
        }
        let sweep = Self { source, measures: file.measures, axes };
        for index in 0..sweep.len() {
            experiment::check(&sweep.source_of(index)?)?;
        }
        Ok(sweep)
    }

    /// Reads a sweep file, or the built-in one of `preset:NAME`, with settings `KEY=VALUE` of its experiment.
    ///
    /// # Errors
    /// As [`from_text`](Self::from_text), and [`ConfigError::Unreadable`].
    pub fn open(path: &Path, settings: &[String]) -> Result<Self, ConfigError> {
        let name = path.display().to_string();
        if let Some(preset) = name.strip_prefix("preset:") {
            let unknown = || ConfigError::Unreadable { path: path.into(), reason: presets::unknown(preset) };
            let found = presets::find_sweep(preset).ok_or_else(unknown)?;
            return Self::with_settings(preset, found.text, Path::new(""), settings);
        }
        let text = std::fs::read_to_string(path)
            .map_err(|error| ConfigError::Unreadable { path: path.into(), reason: error.to_string() })?;
        Self::with_settings(&name, &text, path.parent().unwrap_or(Path::new("")), settings)
    }

    /// Divides every point's time step by `factor`.
    ///
    /// # Errors
    /// As [`from_text`](Self::from_text).
    pub fn refine(&mut self, factor: u32) -> Result<(), ConfigError> {
        let finer = |step: f64| step / f64::from(factor);
        if let Some(axis) = self.axes.iter_mut().find(|axis| axis.key == "simulation.time_step_s") {
            axis.values.iter_mut().for_each(|value| {
                if let Some(step) = value.as_float() {
                    *value = Value::Float(finer(step));
                }
            });
        } else {
            let step = self.experiment(0)?.time_step;
            self.source.set(&format!("simulation.time_step_s={}", finer(step)))?;
        }
        (0..self.len()).try_for_each(|index| self.experiment(index).map(|_| ()))
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.axes.iter().map(|axis| axis.values.len()).product()
    }

    /// Whether there is no point; never so for a sweep that was read.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The values of a point, one per axis.
    pub fn point(&self, index: usize) -> Vec<&Value> {
        let mut rest = index;
        let mut values: Vec<&Value> = self
            .axes
            .iter()
            .rev()
            .map(|axis| {
                let value = &axis.values[rest % axis.values.len()];
                rest /= axis.values.len();
                value
            })
            .collect();
        values.reverse();
        values
    }

    /// The experiment of a point.
    ///
    /// # Errors
    /// [`ConfigError`] that names the key and value at fault.
    pub fn experiment(&self, index: usize) -> Result<Experiment, ConfigError> {
        experiment::experiment(&self.source_of(index)?)
    }

    fn source_of(&self, index: usize) -> Result<Source, ConfigError> {
        let mut source = self.source.clone();
        for (axis, value) in self.axes.iter().zip(self.point(index)) {
            source.set(&format!("{}={value}", axis.key))?;
        }
        Ok(source)
    }

    /// Everything that decides the results: two sweeps with the same text give the same rows.
    pub fn identity(&self) -> serde_json::Value {
        let axes: Vec<_> = self.axes.iter().map(|axis| serde_json::json!({"key": axis.key, "values": axis.values})).collect();
        serde_json::json!({
            "schema": 1,
            "version": env!("CARGO_PKG_VERSION"),
            "experiment": self.source.text(),
            "settings": self.source.settings(),
            "measures": self.measures,
            "vary": axes,
        })
    }

    /// The header of the results.
    pub fn header(&self) -> Vec<&str> {
        let keys = self.axes.iter().map(|axis| axis.key.as_str());
        keys.chain(self.measures.iter().map(String::as_str)).chain(["status"]).collect()
    }
}

/// A list of values, or a range of evenly spaced ones whose ends are exact.
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
        Sweep::from_text("s.toml", &format!("{TEXT}{vary}"), Path::new(""))
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
