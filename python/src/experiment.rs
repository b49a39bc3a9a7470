//! Experiments: checked once, then run, stepped or exported.

use std::path::PathBuf;

use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use sfers::drive::{Table, Waveform};
use sfers::experiment::presets::{DATASETS, PRESETS, Preset, SWEEPS, find_dataset, find_sweep, text_of};
use sfers::experiment::{self, Control, Setting, Source};
use sfers::{effects, export, keys};

use crate::error;
use crate::recording::Recording;
use crate::simulation::Simulation;

/// A checked experiment in CGS units.
#[pyclass(frozen, module = "sfers_rs._native")]
pub struct Experiment {
    pub(crate) inner: experiment::Experiment,
    name: String,
}

/// A table in JSON as TOML.
#[pyfunction(name = "toml")]
pub fn toml_of(text: &str) -> PyResult<String> {
    let table: serde_json::Map<String, serde_json::Value> =
        serde_json::from_str(text).map_err(|e| error::value(e.to_string()))?;
    toml::to_string(&table).map_err(|e| error::value(format!("a table that TOML cannot hold: {e}")))
}

impl Experiment {
    fn of(mut source: Source, settings: Vec<(String, String)>) -> PyResult<Self> {
        for (key, value) in settings {
            let place = format!("set: {key} = {value}");
            source.push(Setting { key, value, place });
        }
        let inner = experiment::experiment(&source).map_err(|e| error::of_config(&e))?;
        Ok(Self { inner, name: source.name })
    }
}

#[pymethods]
impl Experiment {
    /// From a table in JSON, with settings (key, value in TOML); relative paths start from `folder`.
    #[staticmethod]
    fn from_json(text: &str, settings: Vec<(String, String)>, folder: PathBuf) -> PyResult<Self> {
        let mut source = Source::from_text(error::TABLES, toml_of(text)?);
        source.folder = folder;
        Self::of(source, settings)
    }

    /// From a file or a preset.
    #[staticmethod]
    fn open(path: PathBuf, settings: Vec<(String, String)>) -> PyResult<Self> {
        Self::of(Source::open(&path).map_err(|e| error::of_config(&e))?, settings)
    }

    /// The same with a drive given as a table: times (s), shape (T,), and voltages (V), shape (T, actuators), linear between.
    fn driven_by(&self, times: PyReadonlyArray1<f64>, voltages: PyReadonlyArray2<f64>) -> PyResult<Self> {
        let columns = voltages.shape()[1];
        let values = voltages.as_array().iter().copied().collect();
        let table = Table::new(times.as_array().to_vec(), values, columns).map_err(|e| error::value(format!("drive: {e}")))?;
        let mut inner = self.inner.clone();
        inner.drive.waveform = Waveform::Table(table);
        inner.drive.check(&inner.robot).map_err(|e| error::value(format!("drive: {e}")))?;
        Ok(Self { inner, name: self.name.clone() })
    }

    /// Runs it; Ctrl-C is heard. `progress`, if given, gets the number of steps done and of all steps.
    #[pyo3(signature = (progress=None))]
    fn run(&self, py: Python<'_>, progress: Option<Py<PyAny>>) -> PyResult<Recording> {
        let mut heard = Ok(());
        let steps = self.inner.steps;
        let observe = |done: u64| {
            heard = Python::attach(|py| {
                py.check_signals()?;
                progress.as_ref().map_or(Ok(()), |progress| progress.call1(py, (done, steps)).map(drop))
            });
            if heard.is_ok() { Control::Continue } else { Control::Stop }
        };
        let result = py.detach(|| {
            let mut engine = self.inner.engine()?;
            experiment::run(&self.inner, engine.as_mut(), observe)
        });
        heard?;
        Ok(Recording::of_run(result.map_err(|e| error::of_engine(&e))?, &self.inner, self.name.clone()))
    }

    /// A robot at its start, to be stepped.
    fn simulation(&self) -> PyResult<Simulation> {
        Simulation::of(self.inner.clone())
    }

    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    #[getter]
    fn actuators(&self) -> usize {
        self.inner.robot.actuators
    }

    #[getter]
    fn joints(&self) -> usize {
        self.inner.robot.joints()
    }

    #[getter]
    fn steps(&self) -> u64 {
        self.inner.steps
    }

    #[getter]
    fn time_step_s(&self) -> f64 {
        self.inner.time_step
    }

    /// All numbers, resolved, in CGS units, as JSON.
    fn resolved(&self) -> String {
        self.inner.spec().to_string()
    }

    /// The robot as URDF, with a comment that says what made it.
    fn urdf(&self, made_by: &str) -> PyResult<String> {
        self.inner.robot.check().map_err(|e| error::value(e.to_string()))?;
        Ok(export::urdf(&self.inner, made_by))
    }

    /// What URDF cannot say, as JSON.
    fn urdf_sidecar(&self, made_by: &str) -> String {
        format!("{:#}\n", export::sidecar(&self.inner, made_by))
    }

    /// The robot as MJCF.
    fn mjcf(&self, made_by: &str) -> PyResult<String> {
        self.inner.robot.check().map_err(|e| error::value(e.to_string()))?;
        Ok(export::mjcf(&self.inner, made_by))
    }
}

/// Names and summaries of the built-in experiments, sweeps and data sets.
#[pyfunction]
pub fn presets() -> Vec<(&'static str, &'static str, String)> {
    let of = |kind: &'static str, list: &'static [Preset]| list.iter().map(move |p| (kind, p.name, p.summary()));
    let lists = of("experiment", PRESETS).chain(of("sweep", SWEEPS)).chain(of("dataset", DATASETS));
    lists.collect()
}

/// The text (TOML) of a built-in experiment, sweep or data set; `None` if there is none of that name.
#[pyfunction]
pub fn preset(name: &str) -> Option<String> {
    let others = || find_sweep(name).or_else(|| find_dataset(name)).map(|preset| preset.text.to_owned());
    text_of(name).or_else(others)
}

/// The tables of the keys of all files, as JSON.
#[pyfunction]
pub fn key_tables() -> String {
    keys::json().to_string()
}

/// Identifiers of the extensions of the model, with cause and equation.
#[pyfunction]
pub fn effect_table() -> Vec<(&'static str, &'static str, &'static str)> {
    effects::EFFECTS.iter().map(|effect| (effect.id, effect.cause, effect.equation)).collect()
}
